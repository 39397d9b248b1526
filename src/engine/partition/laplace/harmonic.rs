//! The discrete harmonic map of a set of faces with some vertices fixed (P2 eq. 3): positive symmetric weights, free holes.

use super::sheet::{NONE, Sheet};
use crate::error::{EngineError, Reason, Result};
use crate::sparse::{compress, solver_error};
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::RealCholesky;

/// A vertex whose place is given.
const FIXED: u32 = NONE - 1;

/// The state of maps of one sheet, one set of faces after the other.
#[derive(Debug)]
pub(in crate::partition) struct Harmonic {
    /// Places of the vertices of the last set mapped (others: of earlier sets, in other frames).
    pub(in crate::partition) uv: Vec<Vec2>,
    /// [`NONE`] between maps; during one the unknown of each vertex, or [`FIXED`].
    row: Vec<u32>,
}

impl Harmonic {
    pub(in crate::partition) fn new(sheet: &Sheet) -> Harmonic {
        Harmonic { uv: vec![[0.0; 2]; sheet.vertices], row: vec![NONE; sheet.vertices] }
    }

    /// Places every vertex of `faces`, those of `fixed` where it says. `inside` tells the faces of the set from others. Every vertex
    /// that a face outside the set shares must be fixed. One sparse Cholesky factorization.
    ///
    /// # Errors
    /// [`Reason::SolverSingular`], [`Reason::LimitReached`]; cancellation.
    pub(in crate::partition) fn place(
        &mut self,
        sheet: &Sheet,
        faces: &[u32],
        inside: impl Fn(u32) -> bool,
        fixed: &[(u32, Vec2)],
        work: &Work<'_>,
    ) -> Result<()> {
        for &(v, at) in fixed {
            self.row[v as usize] = FIXED;
            self.uv[v as usize] = at;
        }
        let mut unknowns: Vec<u32> = Vec::new();
        for &v in faces.iter().flat_map(|&f| &sheet.triangles[f as usize]) {
            if self.row[v as usize] == NONE {
                self.row[v as usize] = unknowns.len() as u32;
                unknowns.push(v);
            }
        }
        work.check()?;
        let solved = if unknowns.is_empty() { Ok(Vec::new()) } else { self.solve(sheet, faces, inside, unknowns.len(), work) };
        for v in fixed.iter().map(|f| f.0).chain(unknowns.iter().copied()) {
            self.row[v as usize] = NONE;
        }
        let values = solved?;
        for (i, &v) in unknowns.iter().enumerate() {
            self.uv[v as usize] = [values[i], values[unknowns.len() + i]];
        }
        Ok(())
    }

    fn solve(&self, sheet: &Sheet, faces: &[u32], inside: impl Fn(u32) -> bool, n: usize, work: &Work<'_>) -> Result<Vec<f64>> {
        let mut rhs = vec![0.0; 2 * n];
        let mut diagonal = vec![0.0; n];
        // Entries above the diagonal as (row, column, value): every edge once.
        let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(4 * n);
        for &f in faces {
            for h in 3 * f..3 * f + 3 {
                let t = sheet.twin[h as usize];
                if t < h && inside(t / 3) {
                    continue;
                }
                let (a, b, w) = (sheet.origin(h), sheet.origin(super::sheet::next(h)), sheet.weight[h as usize]);
                for (i, j) in [(a, b), (b, a)] {
                    let (row, other) = (self.row[i as usize], self.row[j as usize]);
                    if row == FIXED {
                        continue;
                    }
                    diagonal[row as usize] += w;
                    if other == FIXED {
                        rhs[row as usize] += w * self.uv[j as usize][0];
                        rhs[n + row as usize] += w * self.uv[j as usize][1];
                    } else if row < other {
                        entries.push((row, other, -w));
                    }
                }
            }
        }
        work.check()?;
        entries.extend(diagonal.iter().enumerate().map(|(v, &w)| (v as u32, v as u32, w)));
        let matrix = compress(n, entries.iter().map(|e| e.1), entries.iter().copied(), 0.0)?;
        let factor = RealCholesky::new(&matrix).map_err(|e| solver_error(&e))?;
        work.check()?;
        factor.solve_in_place(&mut rhs, 2);
        if rhs.iter().any(|x| !x.is_finite()) {
            return Err(EngineError::new(Reason::SolverSingular, "the harmonic map is not finite"));
        }
        Ok(rhs)
    }
}
