//! Quality of quadrangles: eta (P1 eq. 4) and the sizes of element edges, diagonals left out.

use super::TargetSize;
use super::edges::Edge;
use super::shape::{measure_sizes, percentile};
use crate::mesh::SurfaceMesh;
use crate::quads::shape::eta;

/// Shape and size of a mesh of quadrangles and a few triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct QuadQuality {
    /// Quadrangles.
    pub quads: u64,
    /// Triangles.
    pub triangles: u64,
    /// Smallest eta (P1 eq. 4).
    pub eta_min: f64,
    /// Mean eta.
    pub eta_mean: f64,
    /// First percentile of eta.
    pub eta_p01: f64,
    /// Counts of eta in 20 equal bins of `[0, 1]`.
    pub eta_histogram: Vec<u64>,
    /// Efficiency index (P1 eq. 5) over the edges of elements, in percent; `None` without a target size.
    pub tau: Option<f64>,
    /// Share of these edges with length over size in [1/sqrt 2, sqrt 2]; `None` without a target size.
    pub edge_ratio_ok: Option<f64>,
}

/// Eta of quadrangle `q`, whose halves are the faces `2 q` and `2 q + 1`.
pub fn eta_of_pair(mesh: &SurfaceMesh, q: usize) -> f64 {
    let ([a, b, c], [_, _, d]) = (mesh.corners(2 * q), mesh.corners(2 * q + 1));
    eta(&[a, b, c, d]).clamp(0.0, 1.0)
}

/// Measures the quadrangles `0..quads` (pairs of faces, see [`crate::optimize::Remeshed::quads`]). O(F log F).
pub(super) fn measure_quads(mesh: &SurfaceMesh, quads: usize, edges: &[Edge], target: Option<&TargetSize>) -> QuadQuality {
    let mut out = QuadQuality { quads: quads as u64, eta_histogram: vec![0; 20], ..QuadQuality::default() };
    out.triangles = (mesh.triangles.len() - 2 * quads) as u64;
    let mut etas: Vec<f64> = (0..quads).map(|q| eta_of_pair(mesh, q)).collect();
    for eta in &etas {
        out.eta_histogram[((eta * 20.0) as usize).min(19)] += 1;
    }
    out.eta_min = etas.iter().copied().fold(1.0, f64::min);
    out.eta_mean = etas.iter().sum::<f64>() / quads.max(1) as f64;
    if quads > 0 {
        out.eta_p01 = percentile(&mut etas, 0.01);
    }
    if let Some(target) = target {
        let mut diagonals: Vec<[u32; 2]> = (0..quads).map(|q| diagonal(mesh.triangles[2 * q])).collect();
        diagonals.sort_unstable();
        let kept: Vec<Edge> = edges.iter().copied().filter(|e| diagonals.binary_search(&e.ends).is_err()).collect();
        (out.tau, out.edge_ratio_ok) = measure_sizes(mesh, &kept, target);
    }
    out
}

fn diagonal([a, _, c]: [u32; 3]) -> [u32; 2] {
    [a.min(c), a.max(c)]
}
