//! The one place that assembles: weights of triangles (P1 eq. 12, 14, 21), and the matrices made of them.

use super::domain::Flat;
use crate::error::Result;
use crate::sparse::compress;
use remesh_linalg::RealMatrix;

/// Weights of the pairs of vertices of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Weights {
    /// Half the cotangent of the opposite angle: linear finite elements.
    Cotangent,
    /// One half each (P1 eq. 12).
    Uniform,
    /// Tangent of half the angle at the first vertex over the length of the edge (P1 eq. 14). Not symmetric.
    MeanValue,
}

/// Weights of one triangle: for each side `k`, from corner `k` to the next, that of the pair in its direction and the other way.
pub(super) fn triangle_weights(flat: Flat, weights: Weights) -> [[f64; 2]; 3] {
    match weights {
        Weights::Uniform => [[0.5; 2]; 3],
        Weights::Cotangent => {
            let cot = flat.thickened().cotangents();
            [0, 1, 2].map(|k| [0.5 * cot[(k + 2) % 3]; 2])
        }
        Weights::MeanValue => {
            let flat = flat.thickened();
            let (cot, sides) = (flat.cotangents(), flat.sides());
            let half = cot.map(|c| {
                let root = (1.0 + c * c).sqrt();
                if c > 0.0 { 1.0 / (root + c) } else { root - c }
            });
            [0, 1, 2].map(|k| [half[k] / sides[k], half[(k + 1) % 3] / sides[k]])
        }
    }
}

/// The symmetric matrix of some triangles (P1 eq. 24), upper triangle. `flat` gives the layout of a triangle by its place in `triangles`,
/// `slot` the unknown of a vertex, below `size`.
///
/// # Errors
/// A matrix with more entries than its index type counts.
pub(super) fn stiffness(
    triangles: &[[u32; 3]],
    flat: impl Fn(usize) -> Flat,
    size: usize,
    slot: impl Fn(u32) -> u32,
    weights: Weights,
) -> Result<RealMatrix> {
    let mut diagonal = vec![0.0; size];
    let local: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(&slot)).collect();
    let values: Vec<[f64; 3]> = (0..triangles.len()).map(|f| triangle_weights(flat(f), weights).map(|w| w[0])).collect();
    for (t, w) in local.iter().zip(&values) {
        for k in 0..3 {
            diagonal[t[k] as usize] += w[k] + w[(k + 2) % 3];
        }
    }
    let columns = local.iter().flat_map(|t| (0..3).map(move |k| t[k].max(t[(k + 1) % 3])));
    let edges = local.iter().zip(&values).flat_map(|(t, w)| {
        (0..3).map(move |k| {
            let (i, j) = (t[k], t[(k + 1) % 3]);
            (i.min(j), i.max(j), -w[k])
        })
    });
    let diagonal = diagonal.iter().enumerate().map(|(i, &d)| (i as u32, i as u32, d));
    compress(size, columns.chain(0..size as u32), edges.chain(diagonal), 0.0)
}

/// Entries of the antisymmetric matrix C of the area functional (P1 eq. 21), as (i, j, c) with i < j: the halfedge from i to j counts
/// +1/2. Those of inner edges cancel, so only boundary edges of the given triangles (by slots) are left.
pub(super) fn area_entries(halfedges: impl Iterator<Item = (u32, u32)>) -> Vec<(u32, u32, f64)> {
    let mut entries: Vec<(u32, u32, f64)> = halfedges.map(|(i, j)| if i < j { (i, j, 0.5) } else { (j, i, -0.5) }).collect();
    entries.sort_unstable_by_key(|e| (e.0, e.1));
    let mut merged: Vec<(u32, u32, f64)> = Vec::with_capacity(entries.len());
    for entry in entries {
        match merged.last_mut() {
            Some(last) if (last.0, last.1) == (entry.0, entry.1) => last.2 += entry.2,
            _ => merged.push(entry),
        }
    }
    merged.retain(|e| e.2 != 0.0);
    merged
}
