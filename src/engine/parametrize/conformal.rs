//! The conformal operator on the boundary, and the free-boundary maps that share its factor.
//!
//! With w = u + i v the energy E_D - A (P1 eq. 17) is w^H L w / 2, L = A + i C: A is the cotangent Laplacian and C has +1/2 and
//! -1/2 along the halfedges, which cancels everywhere but on the boundary. So the interior is eliminated from A alone, once for
//! all maps of the patch, and H = S + i C is left on the loops (S the Schur complement of A). Constants are the null space of H
//! (similarities, if the surface is developable). The factor is that of K = H + sigma M with M the boundary mass, which serves
//! - the spectral map: inverse iteration K y = M u, constants projected out (P1 eq. 29);
//! - the map with pins: H w = sum nu_p r_p with r_p the load at pin p determines w; re-pinning is a Green's function per pin.
//!
//! M is the *length* measure of the outer loop, of total 1, not one per vertex as in P1: a loop that is sampled finely on one
//! side would otherwise weigh that side more.

use super::domain::Domain;
use super::operator::{Weights, area_entries, stiffness};
use super::system::{ChartFactor, Reduction, condensed_operator};
use crate::error::{EngineError, Reason, Result};
use crate::sparse::solver_error;
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::{CholeskyPlan, Complex, ComplexMatrix, Condensation, DenseHermitian, HermitianCholesky, Load, SolveError};
use std::sync::Arc;

/// Shifts to try, relative to a boundary mass of 1: far below the smallest eigenvalues of interest (1e-6 and more on meshes up
/// to a million vertices), above what rounding makes of a zero pivot. The larger ones are for meshes with extreme weights.
const SHIFTS: [f64; 3] = [1e-9, 1e-7, 1e-5];

const MAX_INVERSE_ITERATIONS: usize = 60;
/// Two or three do on round patches; long strips have conformal modes almost as weak as the shift.
const MAX_PIN_ITERATIONS: usize = 100;

const ZERO: Complex = Complex::new(0.0, 0.0);

/// Factor of K with what the maps need besides. One for each outer loop and filling.
#[derive(Debug)]
pub(super) struct ConformalProblem {
    factor: Factor,
    /// Vertex of each unknown of a condensed problem, increasing; `None` if every vertex of the domain is unknown.
    kept: Option<Vec<u32>>,
    size: usize,
    shift: f64,
    /// Unknowns of the outer loop.
    outer: Vec<u32>,
    mass: Vec<f64>,
}

#[derive(Debug)]
enum Factor {
    Dense(DenseHermitian),
    Sparse(HermitianCholesky),
}

/// What the shift is added to.
enum Base<'a> {
    /// H on the kept vertices of a condensed patch.
    Dense { kept: &'a [u32], matrix: Vec<Complex> },
    /// All vertices; the matrix is assembled with the shift.
    Sparse(&'a Arc<CholeskyPlan>),
}

/// Half the edges beside each vertex of the outer loop, over the whole length.
pub(super) fn boundary_mass(domain: &Domain<'_>) -> Vec<f64> {
    let lengths = domain.outer_lengths();
    let total: f64 = lengths.iter().sum();
    (0..lengths.len()).map(|k| 0.5 * (lengths[k] + lengths[(k + lengths.len() - 1) % lengths.len()]) / total).collect()
}

/// Halfedges of all triangles whose contributions to C may remain: those of the loops and of virtual triangles.
fn area_halfedges<'a>(domain: &'a Domain<'_>) -> impl Iterator<Item = (u32, u32)> + 'a {
    let loops = domain.patch.loops.iter().flat_map(|ring| (0..ring.len()).map(move |k| (ring[k], ring[(k + 1) % ring.len()])));
    let filled = domain.virtual_triangles.iter().flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])));
    loops.chain(filled)
}

/// H on the kept unknowns, dense, columns one after another, lower triangle.
fn dense_operator(domain: &Domain<'_>, condensation: &Condensation) -> Result<Vec<Complex>> {
    let kept = condensation.plan().kept();
    let size = kept.len();
    let real = condensed_operator(domain, condensation, Weights::Cotangent)?;
    let mut matrix: Vec<Complex> = real.into_iter().map(|s| Complex::new(s, 0.0)).collect();
    let slot = |v: u32| kept.partition_point(|&w| w < v);
    for (i, j, c) in area_entries(area_halfedges(domain)) {
        // Entries at virtual vertices cancel; above the diagonal the sign is +, and this is the entry below it.
        matrix[slot(i) * size + slot(j)] += Complex::new(0.0, -c);
    }
    Ok(matrix)
}

/// L + shift M over all vertices of the domain, upper triangle.
pub(super) fn conformal_matrix(domain: &Domain<'_>, mass: &[f64], shift: f64) -> Result<ComplexMatrix> {
    let all: Vec<[u32; 3]> = domain.triangles().collect();
    let real = stiffness(&all, |f| domain.flat(all[f]), domain.size(), |v| v, Weights::Cotangent)?;
    let mut matrix: ComplexMatrix = real.map(|&w| Complex::new(w, 0.0));
    let missing = || EngineError::invariant("a boundary edge is not in the pattern");
    for (i, j, c) in area_entries(area_halfedges(domain)) {
        *matrix.get_mut(i as usize, j as usize).ok_or_else(missing)? += Complex::new(0.0, c);
    }
    for (&v, &m) in domain.outer.iter().zip(mass) {
        *matrix.get_mut(v as usize, v as usize).ok_or_else(missing)? += Complex::new(shift * m, 0.0);
    }
    Ok(matrix)
}

/// A point condition of a map.
enum Pin {
    /// The value of an unknown.
    Unknown(usize),
    /// The value at an eliminated vertex.
    Eliminated(Load),
}

impl Pin {
    /// Adds `factor` times the right-hand side of the pin.
    fn add_load(&self, factor: Complex, rhs: &mut [Complex]) {
        match self {
            Pin::Unknown(slot) => rhs[*slot] += factor,
            Pin::Eliminated(load) => rhs.iter_mut().zip(&load.kept).for_each(|(r, &l)| *r += factor * l),
        }
    }

    /// The value at the pin, as far as the unknowns say.
    fn value(&self, w: &[Complex]) -> Complex {
        match self {
            Pin::Unknown(slot) => w[*slot],
            Pin::Eliminated(load) => load.kept.iter().zip(w).map(|(&l, w)| *w * l).sum(),
        }
    }

    /// The value here under a unit load at `other` with the unknowns held.
    fn response(&self, other: &Pin) -> f64 {
        match (self, other) {
            (Pin::Eliminated(a), Pin::Eliminated(b)) => a.response(b),
            _ => 0.0,
        }
    }
}

impl ConformalProblem {
    /// Assembles and factorizes the boundary problem of a domain. O(m^3) for a condensed patch of m loop vertices.
    ///
    /// # Errors
    /// [`Reason::SolverSingular`], [`Reason::LimitReached`], cancellation.
    pub(super) fn new(domain: &Domain<'_>, factor: &ChartFactor, work: &Work<'_>) -> Result<Self> {
        if factor.weights != Weights::Cotangent {
            return Err(EngineError::invariant("conformal maps need cotangent weights"));
        }
        let mass = boundary_mass(domain);
        let mut failure = None;
        let base = match &factor.reduction {
            Reduction::Condensed(condensation) => {
                Base::Dense { kept: condensation.plan().kept(), matrix: dense_operator(domain, condensation)? }
            }
            Reduction::Whole(plan) => Base::Sparse(plan),
        };
        for shift in SHIFTS {
            work.check()?;
            let made = match &base {
                Base::Dense { kept, matrix } => dense_factor(domain, kept, matrix.clone(), &mass, shift),
                Base::Sparse(plan) => sparse_factor(domain, plan, &mass, shift)?,
            };
            let factor = match made {
                Ok(factor) => factor,
                Err(e @ (SolveError::NotPositiveDefinite { .. } | SolveError::Inaccurate { .. })) => {
                    failure = Some(e);
                    continue;
                }
                Err(e) => return Err(solver_error(&e)),
            };
            let kept = match base {
                Base::Dense { kept, .. } => Some(kept.to_vec()),
                Base::Sparse(_) => None,
            };
            let size = kept.as_ref().map_or(domain.size(), Vec::len);
            let slot = |v: &u32| kept.as_ref().map_or(*v, |kept| kept.partition_point(|w| w < v) as u32);
            let outer = domain.outer.iter().map(slot).collect();
            return Ok(ConformalProblem { factor, kept, size, shift, outer, mass });
        }
        Err(failure.map_or_else(|| EngineError::invariant("no shift was tried"), |e| solver_error(&e)))
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        let factor = match &self.factor {
            Factor::Dense(factor) => factor.bytes(),
            Factor::Sparse(factor) => factor.bytes(),
        };
        factor + self.outer.len() * 12 + self.kept.as_ref().map_or(0, |kept| kept.len() * 4)
    }

    fn solve(&self, rhs: &mut [Complex]) {
        match &self.factor {
            Factor::Dense(factor) => factor.solve_in_place(rhs, 1),
            Factor::Sparse(factor) => factor.solve_in_place(rhs, 1),
        }
    }

    /// Right-hand side `M w` for outer values `w`.
    fn load(&self, values: &[Complex], scale: f64) -> Vec<Complex> {
        let mut rhs = vec![ZERO; self.size];
        for ((&v, &m), &w) in self.outer.iter().zip(&self.mass).zip(values) {
            rhs[v as usize] = w * (m * scale);
        }
        rhs
    }

    fn on_outer(&self, w: &[Complex]) -> Vec<Complex> {
        self.outer.iter().map(|&v| w[v as usize]).collect()
    }

    fn inner(&self, a: &[Complex], b: &[Complex]) -> Complex {
        self.mass.iter().zip(a.iter().zip(b)).map(|(&m, (a, b))| a.conj() * b * m).sum()
    }

    /// Takes the mean over the outer loop away; returns the norm of the rest.
    fn centre(&self, w: &mut [Complex]) -> f64 {
        let mean: Complex = self.mass.iter().zip(w.iter()).map(|(&m, &w)| w * m).sum();
        w.iter_mut().for_each(|x| *x -= mean);
        self.inner(w, w).re.sqrt()
    }

    /// The spectral map and its eigenvalue: energy over boundary moment (P1 eq. 27-29). Started from the circle, hence deterministic.
    /// Stops on the Rayleigh quotient, which converges with the square of the ratio of the two smallest eigenvalues.
    pub(super) fn spectral(&self, work: &Work<'_>) -> Result<(Solution, f64)> {
        let mut angle = 0.0;
        let mut u = Vec::with_capacity(self.outer.len());
        for k in 0..self.outer.len() {
            u.push(Complex::from_polar(1.0, angle));
            angle += std::f64::consts::PI * (self.mass[k] + self.mass[(k + 1) % self.mass.len()]);
        }
        let norm = self.centre(&mut u);
        u.iter_mut().for_each(|w| *w /= norm);
        let mut last: f64 = f64::INFINITY;
        for _ in 0..MAX_INVERSE_ITERATIONS {
            work.check()?;
            let mut y = self.load(&u, 1.0);
            self.solve(&mut y);
            let mut next = self.on_outer(&y);
            let norm = self.centre(&mut next);
            let quotient: f64 = 1.0 / self.inner(&u, &next).re;
            if !(norm > 0.0 && norm.is_finite() && quotient.is_finite()) {
                return Err(EngineError::new(Reason::SolverSingular, "inverse iteration broke down"));
            }
            next.iter_mut().for_each(|w| *w /= norm);
            u = next;
            if (last - quotient).abs() <= 1e-10 * quotient {
                y.iter_mut().for_each(|w| *w /= norm);
                return Ok((Solution { unknowns: y, loads: Vec::new() }, quotient - self.shift));
            }
            last = quotient;
        }
        Err(EngineError::new(Reason::SolverSingular, "inverse iteration did not converge: two conformal maps are equally good"))
    }

    /// The least squares conformal map with pinned vertices at their targets (P1 section 2.3). Two pins or more; a solve for each but
    /// one, and a forward substitution for each that is not on a loop.
    ///
    /// # Errors
    /// [`Reason::SolverSingular`].
    pub(super) fn pinned(&self, factor: &ChartFactor, pins: &[(u32, Complex)], work: &Work<'_>) -> Result<Solution> {
        let conditions = pins.iter().map(|&(v, _)| self.condition(factor, v)).collect::<Result<Vec<Pin>>>()?;
        let (first, others) = conditions.split_first().ok_or_else(|| EngineError::invariant("a map without pins"))?;
        let goals: Vec<Complex> = pins[1..].iter().map(|p| p.1 - pins[0].1).collect();
        let count = others.len();
        // Loads in pairs: their sum is zero, so that constants, which K hardly resists, are not excited.
        let mut greens = Vec::with_capacity(count);
        for pin in others {
            work.check()?;
            let mut rhs = vec![ZERO; self.size];
            pin.add_load(Complex::new(1.0, 0.0), &mut rhs);
            first.add_load(Complex::new(-1.0, 0.0), &mut rhs);
            self.solve(&mut rhs);
            greens.push(rhs);
        }
        let spans = |w: &[Complex]| others.iter().map(|pin| pin.value(w) - first.value(w)).collect::<Vec<Complex>>();
        let mut coupling = vec![ZERO; count * count];
        for (l, green) in greens.iter().enumerate() {
            let held = |pin: &Pin| pin.response(&others[l]) - pin.response(first);
            for (j, span) in spans(green).into_iter().enumerate() {
                coupling[l * count + j] = span + (held(&others[j]) - held(first));
            }
        }
        let coupling = DenseHermitian::new(coupling, count).map_err(|e| solver_error(&e))?;
        let strengths = |rest: &[Complex]| {
            let mut nu: Vec<Complex> = goals.iter().zip(spans(rest)).map(|(goal, span)| goal - span).collect();
            coupling.solve_in_place(&mut nu, 1);
            nu
        };
        let mut rest = vec![ZERO; self.size];
        let mut last: Option<Vec<Complex>> = None;
        // The factor is that of H + shift M: move the shift to the right-hand side until nothing changes.
        for _ in 0..MAX_PIN_ITERATIONS {
            work.check()?;
            let nu = strengths(&rest);
            let mut w = rest;
            for (green, nu) in greens.iter().zip(&nu) {
                w.iter_mut().zip(green).for_each(|(w, g)| *w += nu * g);
            }
            let mut values = self.on_outer(&w);
            let change = last.as_ref().map(|last| {
                let mut change: Vec<Complex> = values.iter().zip(last).map(|(a, b)| a - b).collect();
                self.centre(&mut change)
            });
            last = Some(values.clone());
            let size = self.centre(&mut values);
            if !size.is_finite() {
                break;
            }
            if change.is_some_and(|change| change <= 1e-9 * size) {
                return Ok(finish(w, conditions, nu, pins[0].1));
            }
            rest = self.load(&values, self.shift);
            self.solve(&mut rest);
        }
        Err(EngineError::new(Reason::SolverSingular, "the pinned conformal map did not converge"))
    }

    fn condition(&self, factor: &ChartFactor, v: u32) -> Result<Pin> {
        let Some(kept) = &self.kept else { return Ok(Pin::Unknown(v as usize)) };
        match (kept.binary_search(&v), &factor.reduction) {
            (Ok(slot), _) => Ok(Pin::Unknown(slot)),
            (Err(_), Reduction::Condensed(condensation)) => condensation.load(v).map(Pin::Eliminated).map_err(|e| solver_error(&e)),
            (Err(_), Reduction::Whole(_)) => Err(EngineError::invariant("the boundary problem belongs to another patch")),
        }
    }
}

/// Moves the map so that the first pin is at its target, and names the loads inside the patch.
fn finish(mut w: Vec<Complex>, conditions: Vec<Pin>, nu: Vec<Complex>, target: Complex) -> Solution {
    let mut all = vec![-nu.iter().sum::<Complex>()];
    all.extend(nu);
    let inside: Complex = conditions.iter().zip(&all).map(|(pin, &nu)| nu * conditions[0].response(pin)).sum();
    let shift = target - conditions[0].value(&w) - inside;
    w.iter_mut().for_each(|w| *w += shift);
    let loads = conditions.into_iter().zip(all).filter_map(|(pin, nu)| match pin {
        Pin::Eliminated(load) => Some((load, nu)),
        Pin::Unknown(_) => None,
    });
    Solution { unknowns: w, loads: loads.collect() }
}

/// Values of the unknowns of a boundary problem, and loads inside the patch.
pub(super) struct Solution {
    pub(super) unknowns: Vec<Complex>,
    pub(super) loads: Vec<(Load, Complex)>,
}

impl Solution {
    /// Positions of all vertices of the patch: one backward substitution for a condensed patch.
    pub(super) fn spread(&self, factor: &ChartFactor, count: usize) -> Result<Vec<Vec2>> {
        let pair = |w: &Complex| [w.re, w.im];
        match &factor.reduction {
            Reduction::Whole(_) => Ok(self.unknowns[..count].iter().map(pair).collect()),
            Reduction::Condensed(condensation) => {
                let kept: Vec<Vec2> = self.unknowns.iter().map(pair).collect();
                let loads: Vec<(&Load, [f64; 2])> = self.loads.iter().map(|(load, nu)| (load, pair(nu))).collect();
                condensation.extend(&kept, &loads).map_err(|e| solver_error(&e))
            }
        }
    }
}

fn dense_factor(
    domain: &Domain<'_>,
    kept: &[u32],
    mut matrix: Vec<Complex>,
    mass: &[f64],
    shift: f64,
) -> std::result::Result<Factor, SolveError> {
    for (&v, &m) in domain.outer.iter().zip(mass) {
        matrix[kept.partition_point(|&w| w < v) * (kept.len() + 1)] += Complex::new(shift * m, 0.0);
    }
    DenseHermitian::new(matrix, kept.len()).map(Factor::Dense)
}

fn sparse_factor(
    domain: &Domain<'_>,
    plan: &Arc<CholeskyPlan>,
    mass: &[f64],
    shift: f64,
) -> Result<std::result::Result<Factor, SolveError>> {
    let matrix = conformal_matrix(domain, mass, shift)?;
    let made = if domain.virtual_triangles.is_empty() {
        HermitianCholesky::with_plan(plan.clone(), &matrix)
    } else {
        HermitianCholesky::new(&matrix)
    };
    Ok(made.map(Factor::Sparse))
}
