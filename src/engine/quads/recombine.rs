//! Pairs of triangles become quadrangles by a matching of least cost over the whole surface (Blossom-Quad, Remacle et al. 2012).

use super::mixed::{Mixed, NONE};
use super::shape::eta;
use crate::error::Result;
use crate::matching::{MatchingEdge, SingleCost, least_cost_matching};
use crate::planar::QuadKind;
use crate::topology::Topology;
use crate::vector::{area_vector_twice, dot, unit};
use crate::work::Work;

/// Cost of a pair whose quadrangle has eta 0; also of a triangle left alone.
const WORST: f64 = 10_000.0;
/// Weight of the fold between the two triangles (1 - cosine) beside eta.
const FOLD: f64 = 2.0;
/// What is added where a pair is no good quadrangle whatever is done later, if it is allowed at all.
const POOR: f64 = 100.0;
/// Pairs of lower eta are no quadrangle at all.
const LEAST_ETA: f64 = 0.02;

/// Joins triangles of equal region across edges that are not on curves. Every face of `mesh` must be a triangle.
pub(super) fn recombine(mesh: &mut Mixed, kind: QuadKind, work: &Work<'_>) -> Result<()> {
    let triangles: Vec<[u32; 3]> = mesh.faces.iter().map(|f| [f[0], f[1], f[2]]).collect();
    let topology = Topology::build(&triangles, mesh.position.len())?;
    let mut edges = Vec::with_capacity(triangles.len() * 3 / 2);
    let mut corners = Vec::with_capacity(edges.capacity());
    for h in 0..topology.halfedge_count() as u32 {
        let Some(twin) = topology.twin(h).filter(|&t| h < t) else { continue };
        let (f, g) = (topology.face(h), topology.face(twin));
        let (a, b) = (topology.origin(h), topology.target(h));
        if mesh.label[f as usize][1] != mesh.label[g as usize][1] || mesh.is_curve(a, b) {
            continue;
        }
        let (left, right) = (topology.target(topology.next(h)), topology.target(topology.next(twin)));
        let quad = [a, right, b, left];
        let p = quad.map(|v| mesh.position[v as usize]);
        let shape = eta(&p);
        let is_poor = shape < LEAST_ETA || mesh.is_pinned_flat(&quad);
        if left == right || (is_poor && kind == QuadKind::Mixed) {
            continue;
        }
        let fold = 1.0 - dot(unit(area_vector_twice(p[0], p[1], p[2])), unit(area_vector_twice(p[0], p[2], p[3])));
        let cost = WORST * (1.0 - shape + FOLD * fold + if is_poor { POOR } else { 0.0 });
        edges.push(MatchingEdge { ends: [f, g], cost: cost.round() as i64 });
        corners.push(quad);
    }
    let single = match kind {
        QuadKind::Mixed => SingleCost::Each(WORST as i64),
        QuadKind::All => SingleCost::Forbidden,
    };
    let matching = least_cost_matching(triangles.len() as u32, &edges, single, work)?;
    let mut taken = vec![false; triangles.len()];
    for (edge, quad) in edges.iter().zip(corners) {
        let [f, g] = edge.ends;
        // Two triangles that share two edges are listed twice, but joined once.
        if matching.mate[f as usize] == Some(g) && !taken[f as usize] {
            taken[f as usize] = true;
            mesh.faces[f as usize] = quad;
            mesh.faces[g as usize] = [NONE; 4];
        }
    }
    mesh.index();
    Ok(())
}
