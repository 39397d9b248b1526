//! The mean value convex combination map onto a held outer loop (P1 eq. 10-14, 24-26; Floater 2003): one-to-one for every disc on a
//! strictly convex curve in exact arithmetic, whatever the triangles look like.

use super::domain::Domain;
use super::operator::{Weights, triangle_weights};
use crate::error::{EngineError, Reason, Result};
use crate::sparse::{compress, solver_error};
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::RealLu;

const HELD: u32 = u32::MAX;

/// LU factor of the mean value matrix of a patch; one for each outer loop and filling. The matrix is not symmetric, so its interior is
/// not shared with other methods.
#[derive(Debug)]
pub(super) struct MeanValueProblem {
    /// Row of each vertex of the domain, or `HELD`.
    unknown: Vec<u32>,
    count: usize,
    /// The outer loop.
    held: Vec<u32>,
    factor: Option<RealLu>,
    /// Weights of held vertices (by place in the loop) in the rows.
    coupling: Vec<(u32, u32, f64)>,
}

impl MeanValueProblem {
    /// Assembles and factorizes.
    ///
    /// # Errors
    /// [`Reason::SolverSingular`], [`Reason::LimitReached`]; cancellation.
    pub(super) fn new(domain: &Domain<'_>, work: &Work<'_>) -> Result<Self> {
        let mut unknown = vec![0u32; domain.size()];
        domain.outer.iter().for_each(|&v| unknown[v as usize] = HELD);
        let mut count = 0;
        for slot in unknown.iter_mut().filter(|slot| **slot != HELD) {
            *slot = count;
            count += 1;
        }
        let held = domain.outer.clone();
        let count = count as usize;
        if count == 0 {
            return Ok(MeanValueProblem { unknown, count, held, factor: None, coupling: Vec::new() });
        }
        let weights: Vec<(u32, u32, f64)> = domain
            .triangles()
            .flat_map(|t| {
                let w = triangle_weights(domain.flat(t), Weights::MeanValue);
                (0..3).flat_map(move |k| [(t[k], t[(k + 1) % 3], w[k][0]), (t[(k + 1) % 3], t[k], w[k][1])])
            })
            .collect();
        work.check()?;
        let mut sums = vec![0.0; domain.size()];
        weights.iter().for_each(|&(i, _, w)| sums[i as usize] += w);
        let mut place = vec![0u32; domain.size()];
        held.iter().enumerate().for_each(|(k, &v)| place[v as usize] = k as u32);
        let (mut inner, mut coupling) = (Vec::new(), Vec::new());
        for &(i, j, w) in weights.iter().filter(|w| unknown[w.0 as usize] != HELD) {
            let (row, share) = (unknown[i as usize], w / sums[i as usize]);
            match unknown[j as usize] {
                HELD => coupling.push((row, place[j as usize], share)),
                column => inner.push((row, column, -share)),
            }
        }
        let diagonal = (0..count as u32).map(|i| (i, i, 1.0));
        let columns = inner.iter().map(|e| e.1).chain(0..count as u32);
        let matrix = compress(count, columns, inner.iter().copied().chain(diagonal), 0.0)?;
        work.check()?;
        let factor = RealLu::new(&matrix).map_err(|e| solver_error(&e))?;
        Ok(MeanValueProblem { unknown, count, held, factor: Some(factor), coupling })
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        let factor = self.factor.as_ref().map_or(0, RealLu::bytes);
        factor + (self.unknown.len() + self.held.len()) * 4 + self.coupling.len() * 16
    }

    /// Positions of the first `vertices` vertices of the domain when the outer loop is at `outer`.
    ///
    /// # Errors
    /// [`Reason::SolverSingular`] if they are not finite; a broken invariant.
    pub(super) fn solve(&self, outer: &[Vec2], vertices: usize) -> Result<Vec<Vec2>> {
        if outer.len() != self.held.len() {
            return Err(EngineError::invariant("the positions do not fit the outer loop"));
        }
        let mut rhs = vec![0.0; 2 * self.count];
        for &(row, k, share) in &self.coupling {
            let p = outer[k as usize];
            rhs[row as usize] += share * p[0];
            rhs[self.count + row as usize] += share * p[1];
        }
        if let Some(factor) = &self.factor {
            factor.solve_in_place(&mut rhs, 2);
        }
        if rhs.iter().any(|x| !x.is_finite()) {
            return Err(EngineError::new(Reason::SolverSingular, "the mean value map is not finite"));
        }
        let mut uv: Vec<Vec2> = self.unknown[..vertices]
            .iter()
            .map(|&row| if row == HELD { [0.0; 2] } else { [rhs[row as usize], rhs[self.count + row as usize]] })
            .collect();
        self.held.iter().zip(outer).for_each(|(&v, &p)| uv[v as usize] = p);
        Ok(uv)
    }
}
