//! Maps with the outer loop held (Dirichlet, P1 eq. 23 and 25) under symmetric weights: harmonic and barycentric.
//!
//! The factor does not know where the loop is held: another shape, spacing or starting vertex is a back substitution.

use super::conformal::Solution;
use super::domain::Domain;
use super::operator::stiffness;
use super::system::{ChartFactor, Reduction, condensed_operator};
use crate::error::{EngineError, Result};
use crate::sparse::{compress, solver_error};
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::{Complex, DenseReal, RealCholesky};

/// Factor of the unknowns that are neither eliminated nor on the outer loop. One for each outer loop, filling and kind of weights.
#[derive(Debug)]
pub(super) struct DirichletProblem {
    /// Number of unknowns of the boundary problem, held ones included.
    size: usize,
    /// Held unknowns, in the order of the outer loop.
    held: Vec<u32>,
    /// Free unknowns, increasing.
    free: Vec<u32>,
    factor: Option<Factor>,
    /// Matrix entries between a free unknown (by its place in `free`) and a held one (by its place in `held`).
    coupling: Vec<(u32, u32, f64)>,
}

#[derive(Debug)]
enum Factor {
    Dense(DenseReal),
    Sparse(RealCholesky),
}

impl DirichletProblem {
    /// Assembles and factorizes. A condensed patch with one loop has nothing to factorize.
    ///
    /// # Errors
    /// [`crate::error::Reason::SolverSingular`], [`crate::error::Reason::LimitReached`].
    pub(super) fn new(domain: &Domain<'_>, factor: &ChartFactor, work: &Work<'_>) -> Result<Self> {
        work.check()?;
        match &factor.reduction {
            Reduction::Whole(_) => whole(domain, factor),
            Reduction::Condensed(condensation) => {
                let kept = condensation.plan().kept();
                let matrix = condensed_operator(domain, condensation, factor.weights)?;
                let slot = |&v: &u32| kept.partition_point(|&w| w < v) as u32;
                condensed(domain.outer.iter().map(slot).collect(), &matrix, kept.len())
            }
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        let factor = match &self.factor {
            None => 0,
            Some(Factor::Dense(factor)) => factor.bytes(),
            Some(Factor::Sparse(factor)) => factor.bytes(),
        };
        factor + (self.held.len() + self.free.len()) * 4 + self.coupling.len() * 16
    }

    /// The map whose outer loop is at `outer`, vertex by vertex.
    ///
    /// # Errors
    /// A broken invariant.
    pub(super) fn solve(&self, outer: &[Vec2]) -> Result<Solution> {
        if outer.len() != self.held.len() {
            return Err(EngineError::invariant("the positions do not fit the outer loop"));
        }
        let mut unknowns = vec![Complex::new(0.0, 0.0); self.size];
        for (&slot, p) in self.held.iter().zip(outer) {
            unknowns[slot as usize] = Complex::new(p[0], p[1]);
        }
        if let Some(factor) = &self.factor {
            let count = self.free.len();
            let mut rhs = vec![0.0; 2 * count];
            for &(row, column, value) in &self.coupling {
                let p = outer[column as usize];
                rhs[row as usize] -= value * p[0];
                rhs[count + row as usize] -= value * p[1];
            }
            match factor {
                Factor::Dense(factor) => factor.solve_in_place(&mut rhs, 2),
                Factor::Sparse(factor) => factor.solve_in_place(&mut rhs, 2),
            }
            for (k, &slot) in self.free.iter().enumerate() {
                unknowns[slot as usize] = Complex::new(rhs[k], rhs[count + k]);
            }
        }
        Ok(Solution { unknowns, loads: Vec::new() })
    }
}

/// For each unknown its place among the held ones.
fn places_of(held: &[u32], size: usize) -> Vec<Option<u32>> {
    let mut place = vec![None; size];
    held.iter().enumerate().for_each(|(k, &slot)| place[slot as usize] = Some(k as u32));
    place
}

fn condensed(held: Vec<u32>, matrix: &[f64], size: usize) -> Result<DirichletProblem> {
    let place = places_of(&held, size);
    let free: Vec<u32> = (0..size as u32).filter(|&slot| place[slot as usize].is_none()).collect();
    if free.is_empty() {
        return Ok(DirichletProblem { size, held, free, factor: None, coupling: Vec::new() });
    }
    let mut block = Vec::with_capacity(free.len() * free.len());
    let mut coupling = Vec::with_capacity(free.len() * held.len());
    for &column in &free {
        block.extend(free.iter().map(|&row| matrix[column as usize * size + row as usize]));
    }
    for (row, &slot) in free.iter().enumerate() {
        coupling.extend(held.iter().enumerate().map(|(k, &h)| (row as u32, k as u32, matrix[h as usize * size + slot as usize])));
    }
    let factor = DenseReal::new(block, free.len()).map_err(|e| solver_error(&e))?;
    Ok(DirichletProblem { size, held, free, factor: Some(Factor::Dense(factor)), coupling })
}

fn whole(domain: &Domain<'_>, factor: &ChartFactor) -> Result<DirichletProblem> {
    let size = domain.size();
    let all: Vec<[u32; 3]> = domain.triangles().collect();
    let matrix = stiffness(&all, |f| domain.flat(all[f]), size, |v| v, factor.weights)?;
    let held = domain.outer.clone();
    let place = places_of(&held, size);
    let free: Vec<u32> = (0..size as u32).filter(|&v| place[v as usize].is_none()).collect();
    if free.is_empty() {
        return Ok(DirichletProblem { size, held, free, factor: None, coupling: Vec::new() });
    }
    let row_of = |v: u32| free.partition_point(|&w| w < v) as u32;
    let mut coupling = Vec::new();
    let (mut columns, mut entries) = (Vec::new(), Vec::new());
    for (&value, (i, j)) in &matrix {
        match (place[i as usize], place[j as usize]) {
            (None, None) => {
                columns.push(row_of(j));
                entries.push((row_of(i), row_of(j), value));
            }
            (None, Some(k)) => coupling.push((row_of(i), k, value)),
            (Some(k), None) => coupling.push((row_of(j), k, value)),
            (Some(_), Some(_)) => {}
        }
    }
    let inner = compress(free.len(), columns.into_iter(), entries.into_iter(), 0.0)?;
    let factor = RealCholesky::new(&inner).map_err(|e| solver_error(&e))?;
    Ok(DirichletProblem { size, held, free, factor: Some(Factor::Sparse(factor)), coupling })
}
