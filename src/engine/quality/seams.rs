//! Quality at seams apart from the interior: the elements that touch an interface curve between patches, before and after the
//! optimisation.

use super::TargetSize;
use super::shape::length_in;
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, kappa};

/// Elements of a part of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PartQuality {
    /// Triangles.
    pub triangles: u64,
    /// Smallest kappa (P1 eq. 3); 1 without triangles.
    pub kappa_min: f64,
    /// Mean kappa; 0 without triangles.
    pub kappa_mean: f64,
    /// Share of the triangles with kappa below 0.5.
    pub below_half: f64,
    /// Share of the triangles with kappa below 0.8.
    pub below_four_fifths: f64,
    /// Efficiency index in percent (P1 eq. 5) over the edges of the part; `None` without edges.
    pub tau: Option<f64>,
}

/// Quality at seams and away from them. An edge is a seam if its two faces come from different patches and it lies on no feature;
/// a face is at a seam if it touches a vertex of a seam. Edges of faces at seams count there, all others for the interior.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeamSplit {
    /// Faces that touch a seam.
    pub seam: PartQuality,
    /// All others.
    pub interior: PartQuality,
}

/// Both before and after the optimisation. Afterwards the patch of a face is that of the assembled face it descends from, as flips,
/// splits and collapses pass it on: seams stay chains of edges, within about an element of the interface curve on the input.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeamQuality {
    /// Of the assembled mesh; the inside of each patch has been optimised on the patch alone by then.
    pub before: SeamSplit,
    /// Of the finished mesh.
    pub after: SeamSplit,
}

/// A mesh with the patch of each face and what its seams are not.
pub struct Patched<'a> {
    /// Vertices.
    pub positions: &'a [Vec3],
    /// Faces.
    pub triangles: &'a [[u32; 3]],
    /// Patch of each face.
    pub face_patch: &'a [u32],
    /// Edges on boundary and feature curves: vertex pairs, low first, sorted.
    pub curve_edges: &'a [[u32; 2]],
}

impl<'a> Patched<'a> {
    /// The same of a surface mesh.
    pub fn of(mesh: &'a SurfaceMesh, face_patch: &'a [u32], curve_edges: &'a [[u32; 2]]) -> Patched<'a> {
        Patched { positions: &mesh.positions, triangles: &mesh.triangles, face_patch, curve_edges }
    }
}

/// Faces that touch a seam. O(F) for bounded valence.
pub fn faces_at_seams(mesh: &Patched<'_>) -> Vec<bool> {
    faces_beside(mesh, &edges_with_faces(mesh))
}

fn faces_beside(mesh: &Patched<'_>, sides: &[([u32; 2], u32)]) -> Vec<bool> {
    let mut on_seam = vec![false; mesh.positions.len()];
    for pair in sides.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let patch = |side: &([u32; 2], u32)| mesh.face_patch[side.1 as usize];
        if patch(&pair[0]) != patch(&pair[1]) && mesh.curve_edges.binary_search(&pair[0].0).is_err() {
            pair[0].0.iter().for_each(|&v| on_seam[v as usize] = true);
        }
    }
    mesh.triangles.iter().map(|t| t.iter().any(|&v| on_seam[v as usize])).collect()
}

/// The edges of all faces, low end first, each with its face; sorted.
fn edges_with_faces(mesh: &Patched<'_>) -> Vec<([u32; 2], u32)> {
    let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)]);
    let mut start = vec![0usize; mesh.positions.len() + 1];
    for [low, _] in mesh.triangles.iter().flat_map(sides) {
        start[low as usize + 1] += 1;
    }
    for v in 1..start.len() {
        start[v] += start[v - 1];
    }
    let mut fill = start.clone();
    let mut edges = vec![([0; 2], 0); 3 * mesh.triangles.len()];
    for (f, t) in mesh.triangles.iter().enumerate() {
        for ends in sides(t) {
            let place = &mut fill[ends[0] as usize];
            edges[*place] = (ends, f as u32);
            *place += 1;
        }
    }
    for part in start.windows(2) {
        edges[part[0]..part[1]].sort_unstable();
    }
    edges
}

/// Measures both parts of a mesh. O(F) for bounded valence.
pub fn measure_seams(mesh: &Patched<'_>, target: &TargetSize) -> SeamSplit {
    let edges = edges_with_faces(mesh);
    let at_seam = faces_beside(mesh, &edges);
    let mut parts = [PartQuality { kappa_min: 1.0, ..PartQuality::default() }; 2];
    for (f, t) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        let part = &mut parts[usize::from(!at_seam[f])];
        let k = kappa(a, b, c);
        part.triangles += 1;
        part.kappa_min = part.kappa_min.min(k);
        part.kappa_mean += k;
        part.below_half += f64::from(u8::from(k < 0.5));
        part.below_four_fifths += f64::from(u8::from(k < 0.8));
    }
    // An edge belongs to the seam part if one of its faces does.
    let mut sums = [(0.0, 0u64); 2];
    for sides in edges.chunk_by(|x, y| x.0 == y.0) {
        let [a, b] = sides[0].0;
        let l = length_in(target, mesh.positions, a as usize, b as usize);
        let sum = &mut sums[usize::from(!sides.iter().any(|side| at_seam[side.1 as usize]))];
        *sum = (sum.0 + if l < 1.0 { l - 1.0 } else { 1.0 / l - 1.0 }, sum.1 + 1);
    }
    for (part, (sum, count)) in parts.iter_mut().zip(sums) {
        let faces = part.triangles.max(1) as f64;
        part.kappa_mean /= faces;
        part.below_half /= faces;
        part.below_four_fifths /= faces;
        part.tau = (count > 0).then(|| 100.0 * f64::exp(sum / count as f64));
    }
    SeamSplit { seam: parts[0], interior: parts[1] }
}
