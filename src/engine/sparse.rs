//! Sparse assembly without triplet lists (two passes over the mesh, a counting sort by column, a short sort in each column), and
//! what the solvers refuse, as errors of the engine.

use crate::error::{EngineError, Reason, Result};
use remesh_linalg::SolveError;
use sprs::CsMatI;
use std::ops::AddAssign;

/// Compresses entries `(row, column, value)`; duplicates are added. `columns` yields the column of every entry (in any order),
/// which saves computing the values twice. O(entries) for columns of bounded length.
///
/// # Errors
/// More entries than `u32` counts, or iterators that disagree (invariant).
pub(crate) fn compress<T: Copy + AddAssign>(
    size: usize,
    columns: impl Iterator<Item = u32>,
    entries: impl Iterator<Item = (u32, u32, T)>,
    zero: T,
) -> Result<CsMatI<T, u32>> {
    let mut start = vec![0usize; size + 1];
    columns.for_each(|c| start[c as usize + 1] += 1);
    for c in 0..size {
        start[c + 1] += start[c];
    }
    let mut next = start.clone();
    let mut bucket = vec![(0u32, zero); start[size]];
    for (row, column, value) in entries {
        let at = &mut next[column as usize];
        *bucket.get_mut(*at).ok_or_else(|| EngineError::invariant("assembly met more entries than it counted"))? = (row, value);
        *at += 1;
    }
    let mut pointers = Vec::with_capacity(size + 1);
    let mut rows = Vec::with_capacity(start[size]);
    let mut values = Vec::with_capacity(start[size]);
    pointers.push(0u32);
    for c in 0..size {
        let column = &mut bucket[start[c]..start[c + 1]];
        column.sort_unstable_by_key(|e| e.0);
        let first = rows.len();
        for &(row, value) in column.iter() {
            if rows.len() > first && rows.last() == Some(&row) {
                if let Some(last) = values.last_mut() {
                    *last += value;
                }
            } else {
                rows.push(row);
                values.push(value);
            }
        }
        pointers.push(u32::try_from(rows.len()).map_err(|_| EngineError::invariant("a matrix has too many entries"))?);
    }
    CsMatI::try_new_csc((size, size), pointers, rows, values).map_err(|e| EngineError::invariant(format!("assembly: {}", e.3)))
}

/// A solver failure as an engine error.
pub(crate) fn solver_error(e: &SolveError) -> EngineError {
    let reason = match e {
        SolveError::Resources(_) => Reason::LimitReached,
        SolveError::Shape { .. } => Reason::Invariant,
        _ => Reason::SolverSingular,
    };
    EngineError::new(reason, e.to_string())
}
