//! The conformal operator as one complex Hermitian matrix, and the two free-boundary maps that share its factor.
//!
//! With w = u + i v the energy E_D - A (P1 eq. 17) is w^H L w / 2, L = A + i C: A is the cotangent Laplacian and C has +1/2 and
//! -1/2 along the halfedges, which cancels everywhere but on the boundary. Constants are the null space of L (similarities, if
//! the surface is developable). The factor is that of K = L + sigma B with B the boundary mass, which serves
//! - the spectral map: inverse iteration K y = B u, constants projected out (P1 eq. 29);
//! - the map with two pins p, q: L w = nu (e_p - e_q) determines w up to a similarity, so re-pinning is one Green's function.
//!
//! B is the *length* measure of the outer loop, of total 1, not one per vertex as in P1: a loop that is sampled finely on one
//! side would otherwise weigh that side more.

use super::assembly::compress;
use super::domain::Domain;
use crate::error::{EngineError, Reason, Result};
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::{Complex, ComplexMatrix, HermitianCholesky, SolveError};

/// Shifts to try, relative to a boundary mass of 1: far below the smallest eigenvalues of interest (1e-6 and more on meshes up
/// to a million vertices), above what rounding makes of a zero pivot. The larger ones are for meshes with extreme weights.
const SHIFTS: [f64; 3] = [1e-9, 1e-7, 1e-5];

const MAX_INVERSE_ITERATIONS: usize = 60;
const MAX_PIN_ITERATIONS: usize = 10;

/// Factor of K with what the maps need besides.
#[derive(Debug)]
pub(super) struct Conformal {
    factor: HermitianCholesky,
    size: usize,
    shift: f64,
    boundary: Vec<u32>,
    mass: Vec<f64>,
}

/// L + shift B, upper triangle.
pub(super) fn conformal_matrix(domain: &Domain<'_>, boundary: &[u32], mass: &[f64], shift: f64) -> Result<ComplexMatrix> {
    let mut diagonal = vec![0.0; domain.size()];
    let cotangents: Vec<[f64; 3]> = domain.triangles().map(|t| domain.flat(t).thickened().cotangents()).collect();
    for (t, cot) in domain.triangles().zip(&cotangents) {
        for k in 0..3 {
            diagonal[t[k] as usize] += 0.5 * (cot[(k + 1) % 3] + cot[(k + 2) % 3]);
        }
    }
    for (&v, &m) in boundary.iter().zip(mass) {
        diagonal[v as usize] += shift * m;
    }
    let columns = domain.triangles().flat_map(|t| (0..3).map(move |k| t[k].max(t[(k + 1) % 3])));
    let edges = domain.triangles().zip(&cotangents).flat_map(|(t, cot)| {
        (0..3).map(move |k| {
            let (i, j) = (t[k], t[(k + 1) % 3]);
            let area = if i < j { 0.5 } else { -0.5 };
            (i.min(j), i.max(j), Complex::new(-0.5 * cot[(k + 2) % 3], area))
        })
    });
    let size = domain.size() as u32;
    let diagonal = diagonal.iter().enumerate().map(|(i, &d)| (i as u32, i as u32, Complex::new(d, 0.0)));
    compress(domain.size(), columns.chain(0..size), edges.chain(diagonal), Complex::new(0.0, 0.0))
}

/// Half the edges beside each vertex of the outer loop, over the whole length.
pub(super) fn boundary_mass(domain: &Domain<'_>) -> Vec<f64> {
    let lengths = domain.outer_lengths();
    let total: f64 = lengths.iter().sum();
    (0..lengths.len()).map(|k| 0.5 * (lengths[k] + lengths[(k + lengths.len() - 1) % lengths.len()]) / total).collect()
}

impl Conformal {
    /// Assembles and factorizes.
    pub(super) fn new(domain: &Domain<'_>, work: &Work<'_>) -> Result<Self> {
        let boundary = domain.outer.clone();
        let mass = boundary_mass(domain);
        let mut failure = None;
        for shift in SHIFTS {
            work.check()?;
            let matrix = conformal_matrix(domain, &boundary, &mass, shift)?;
            work.check()?;
            match HermitianCholesky::new(&matrix) {
                Ok(factor) => return Ok(Conformal { factor, size: domain.size(), shift, boundary, mass }),
                Err(e @ (SolveError::NotPositiveDefinite { .. } | SolveError::Inaccurate { .. })) => failure = Some(e),
                Err(e) => return Err(solver_error(&e)),
            }
        }
        Err(failure.map_or_else(|| EngineError::invariant("no shift was tried"), |e| solver_error(&e)))
    }

    pub(super) fn bytes(&self) -> usize {
        self.factor.bytes() + self.boundary.len() * 12
    }

    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// Right-hand side `B w` for boundary values `w`.
    fn load(&self, values: &[Complex], scale: f64) -> Vec<Complex> {
        let mut rhs = vec![Complex::new(0.0, 0.0); self.size];
        for ((&v, &m), &w) in self.boundary.iter().zip(&self.mass).zip(values) {
            rhs[v as usize] = w * (m * scale);
        }
        rhs
    }

    fn on_boundary(&self, w: &[Complex]) -> Vec<Complex> {
        self.boundary.iter().map(|&v| w[v as usize]).collect()
    }

    fn inner(&self, a: &[Complex], b: &[Complex]) -> Complex {
        self.mass.iter().zip(a.iter().zip(b)).map(|(&m, (a, b))| a.conj() * b * m).sum()
    }

    /// Takes the mean over the boundary away; returns the norm of the rest.
    fn centre(&self, w: &mut [Complex]) -> f64 {
        let mean: Complex = self.mass.iter().zip(w.iter()).map(|(&m, &w)| w * m).sum();
        w.iter_mut().for_each(|x| *x -= mean);
        self.inner(w, w).re.sqrt()
    }

    /// The spectral map and its eigenvalue: energy over boundary moment (P1 eq. 27-29). Started from the circle, hence deterministic.
    /// Stops on the Rayleigh quotient, which converges with the square of the ratio of the two smallest eigenvalues.
    pub(super) fn spectral(&self, work: &Work<'_>) -> Result<(Vec<Complex>, f64)> {
        let mut angle = 0.0;
        let mut u = Vec::with_capacity(self.boundary.len());
        for k in 0..self.boundary.len() {
            u.push(Complex::from_polar(1.0, angle));
            angle += std::f64::consts::PI * (self.mass[k] + self.mass[(k + 1) % self.mass.len()]);
        }
        let norm = self.centre(&mut u);
        u.iter_mut().for_each(|w| *w /= norm);
        let mut last: f64 = f64::INFINITY;
        for _ in 0..MAX_INVERSE_ITERATIONS {
            work.check()?;
            let mut y = self.load(&u, 1.0);
            self.factor.solve_in_place(&mut y, 1);
            let mut next = self.on_boundary(&y);
            let norm = self.centre(&mut next);
            let quotient: f64 = 1.0 / self.inner(&u, &next).re;
            if !(norm > 0.0 && norm.is_finite() && quotient.is_finite()) {
                return Err(EngineError::new(Reason::SolverSingular, "inverse iteration broke down"));
            }
            next.iter_mut().for_each(|w| *w /= norm);
            u = next;
            if (last - quotient).abs() <= 1e-10 * quotient {
                y.iter_mut().for_each(|w| *w /= norm);
                return Ok((y, quotient - self.shift));
            }
            last = quotient;
        }
        Err(EngineError::new(Reason::SolverSingular, "inverse iteration did not converge: two conformal maps are equally good"))
    }

    /// The least squares conformal map with vertices `p` and `q` pinned to two points of distance 1 (P1 section 2.3).
    pub(super) fn pinned(&self, p: u32, q: u32, work: &Work<'_>) -> Result<Vec<Complex>> {
        let (p, q) = (p as usize, q as usize);
        let mut green = vec![Complex::new(0.0, 0.0); self.size];
        green[p] = Complex::new(1.0, 0.0);
        green[q] = Complex::new(-1.0, 0.0);
        self.factor.solve_in_place(&mut green, 1);
        let span = green[p] - green[q];
        let mut w: Vec<Complex> = green.iter().map(|g| g / span).collect();
        // The factor is that of L + shift B: move the shift to the right-hand side until nothing changes.
        for _ in 0..MAX_PIN_ITERATIONS {
            work.check()?;
            let mut values = self.on_boundary(&w);
            let size = self.centre(&mut values);
            let mut next = self.load(&values, self.shift);
            self.factor.solve_in_place(&mut next, 1);
            let nu = (1.0 - (next[p] - next[q])) / span;
            next.iter_mut().zip(&green).for_each(|(n, g)| *n += nu * g);
            let mut change: Vec<Complex> = self.on_boundary(&next).iter().zip(self.on_boundary(&w)).map(|(a, b)| a - b).collect();
            let change = self.centre(&mut change);
            w = next;
            if !change.is_finite() {
                break;
            }
            if change <= 1e-9 * size {
                return Ok(w);
            }
        }
        Err(EngineError::new(Reason::SolverSingular, "the pinned conformal map did not converge"))
    }
}

/// Complex values as points, those of the patch only.
pub(super) fn as_points(w: &[Complex], count: usize) -> Vec<Vec2> {
    w[..count].iter().map(|w| [w.re, w.im]).collect()
}

/// A solver failure as an engine error.
pub(super) fn solver_error(e: &SolveError) -> EngineError {
    let reason = match e {
        SolveError::Resources(_) => Reason::LimitReached,
        SolveError::Shape { .. } => Reason::Invariant,
        _ => Reason::SolverSingular,
    };
    EngineError::new(reason, e.to_string())
}
