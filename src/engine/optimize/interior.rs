//! The inside of one patch as a mesh to optimise, and back.

use super::state::State;
use crate::assemble::{Assembled, VertexClass};
use crate::planar::{LiftedPatch, SurfacePoint, VertexOrigin};

/// Curve vertices are corners, and every edge between two of them is a curve edge: both stay.
pub(super) fn as_assembled(lifted: &LiftedPatch) -> Assembled {
    let held = |v: u32| lifted.origins[v as usize] != VertexOrigin::Interior;
    let edges = lifted.triangles.iter().flat_map(|t| (0..3).map(move |k| [t[k], t[(k + 1) % 3]]));
    let mut curve_edges: Vec<[u32; 2]> = edges.filter(|&[a, b]| held(a) && held(b)).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    curve_edges.sort_unstable();
    curve_edges.dedup();
    let class = |origin: &VertexOrigin| match origin {
        VertexOrigin::Interior => VertexClass::Free,
        VertexOrigin::Curve { .. } => VertexClass::Corner,
    };
    Assembled {
        positions: lifted.positions.clone(),
        triangles: lifted.triangles.clone(),
        face_patch: vec![0; lifted.triangles.len()],
        face_region: vec![0; lifted.triangles.len()],
        vertex_class: lifted.origins.iter().map(class).collect(),
        curve_edges,
        vertex_face: lifted.points.iter().map(|p| p.face).collect(),
        curve_vertices: 0,
    }
}

/// What has become of `before`. Vertices that are still there keep their order.
pub(super) fn as_lifted(state: &State<'_>, before: &LiftedPatch) -> LiftedPatch {
    let kernel = &state.mesh;
    let mut number = vec![0u32; kernel.vertex_slots() as usize];
    let mut after = LiftedPatch::default();
    for v in (0..kernel.vertex_slots()).filter(|&v| kernel.is_vertex(v)) {
        number[v as usize] = after.positions.len() as u32;
        let origin = before.origins.get(v as usize).copied().unwrap_or(VertexOrigin::Interior);
        let point = match origin {
            VertexOrigin::Curve { .. } => before.points[v as usize],
            VertexOrigin::Interior => {
                let foot = state.own_foot(v);
                SurfacePoint { face: foot.face, barycentric: foot.barycentric }
            }
        };
        after.positions.push(kernel.at(v));
        after.origins.push(origin);
        after.points.push(point);
    }
    after.triangles = kernel.faces_left().map(|f| kernel.corners(f).map(|v| number[v as usize])).collect();
    after
}
