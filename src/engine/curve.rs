//! The network of curves every patch mesh must respect (boundary, features, patch borders) and their one-dimensional meshes.
//! Each curve is meshed once and shared by the patches beside it, which keeps neighbours conforming (P2 section 4, step 4).

use crate::error::Result;
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::partition::Partition;
use crate::patch::{Patch, PatchMap};
use crate::topology::Topology;
use crate::vector::Vec3;
use crate::work::Work;

mod directed;
mod discretize;
mod faithful;
mod locked;
mod trace;

pub use directed::curve_polyline_in_metric;

/// Why an edge of the surface is part of a curve; the first that applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CurveKind {
    /// The surface ends here.
    Boundary,
    /// A feature edge (sharp, region border kept, or explicit).
    Feature,
    /// Only a border between two patches: free to vanish in the optimisation.
    Seam,
}

/// A maximal chain of edges between two junctions, or a closed chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// What it is. Chains are cut where the kind changes.
    pub kind: CurveKind,
    /// Halfedges along the curve, one after another. For boundary curves the boundary halfedges.
    /// Of the two possible directions the one is taken whose first halfedge is the lower (deterministic).
    pub halfedges: Vec<u32>,
    /// Whether the chain ends where it began.
    pub closed: bool,
    /// Least number of edges of its mesh that keeps the whole mesh free of double edges: 3 for closed chains, 2 if another curve
    /// joins the same two ends, else 1.
    pub min_edges: u32,
}

/// All curves of a partitioned surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveNetwork {
    /// The curves, in order of their lowest halfedge.
    pub curves: Vec<Curve>,
}

/// What a curve mesh depends on: the chain's points and the wanted size at each.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePolyline {
    /// Points of the chain; for closed chains the first is repeated at the end.
    pub points: Vec<Vec3>,
    /// Wanted edge length at each point.
    pub sizes: Vec<f64>,
    /// Whether the chain is closed.
    pub closed: bool,
    /// What the curve is: seams may be sampled more freely than features.
    pub kind: CurveKind,
    /// Least number of edges (see [`Curve::min_edges`]).
    pub min_edges: u32,
    /// Whether each point is locked: then it is a point of the mesh, and a segment between two such points is one edge. Empty for none.
    pub locked: Vec<bool>,
}

impl Contents for CurvePolyline {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.points).f64s(&self.sizes).u64(u64::from(self.closed)).u64(self.kind as u64).u64(u64::from(self.min_edges));
        into.raw(&self.locked.iter().map(|&l| u8::from(l)).collect::<Vec<u8>>());
    }

    fn bytes(&self) -> usize {
        self.points.len() * 32
    }
}

/// A point of a curve mesh: on segment `segment` of the polyline at parameter `t` in `[0, 1]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Segment of the polyline.
    pub segment: u32,
    /// Position on the segment.
    pub t: f64,
    /// Point in space, exactly on the segment.
    pub position: Vec3,
}

/// The one-dimensional mesh of a curve: its points in order, both ends included (for a closed curve the first point is the
/// last, written twice). Ends are bit-identical to the ends of the polyline.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveMesh {
    /// The points; at least 2, at least 4 for closed curves (a closed curve has at least 3 edges).
    pub points: Vec<CurvePoint>,
}

impl Contents for CurveMesh {
    fn feed(&self, into: &mut Feeder) {
        into.u64(self.points.len() as u64);
        for p in &self.points {
            into.u64(u64::from(p.segment)).f64(p.t).points(&[p.position]);
        }
    }

    fn bytes(&self) -> usize {
        self.points.len() * std::mem::size_of::<CurvePoint>()
    }
}

/// Chains all boundary, feature and patch border edges into curves; cut at junctions, at corners of `features` and where the kind
/// or the pair of patches beside the edge changes. O(F).
pub fn trace_curves(topology: &Topology, features: &Features, partition: &Partition) -> CurveNetwork {
    trace::trace(topology, features, partition)
}

/// Vertices along a curve, from the origin of its first halfedge to the target of its last (for closed curves the same vertex).
pub fn curve_vertices(topology: &Topology, curve: &Curve) -> Vec<u32> {
    let mut vertices: Vec<u32> = curve.halfedges.iter().map(|&h| topology.origin(h)).collect();
    vertices.extend(curve.halfedges.last().map(|&h| topology.target(h)));
    vertices
}

/// The polyline of a curve with the wanted sizes at its vertices; `locked` tells of each vertex of the surface whether it stays, and is
/// empty if none does.
pub fn curve_polyline(mesh: &SurfaceMesh, topology: &Topology, curve: &Curve, vertex_size: &[f64], locked: &[bool]) -> CurvePolyline {
    let vertices = curve_vertices(topology, curve);
    CurvePolyline {
        points: vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
        sizes: vertices.iter().map(|&v| vertex_size[v as usize]).collect(),
        closed: curve.closed,
        kind: curve.kind,
        min_edges: curve.min_edges,
        locked: locked_points(curve, &vertices, locked),
    }
}

/// Only points of boundary curves are ever locked.
fn locked_points(curve: &Curve, vertices: &[u32], locked: &[bool]) -> Vec<bool> {
    let points: Vec<bool> = vertices.iter().map(|&v| locked.get(v as usize).copied().unwrap_or(false)).collect();
    if curve.kind == CurveKind::Boundary && points.contains(&true) { points } else { Vec::new() }
}

/// Divides a curve into N = round(integral of ds / size) edges of equal length in the size field (P2 section 4, step 4), but into
/// no fewer than its `min_edges` (3 for a closed curve). Seams follow input edges in a zigzag; their length is measured on a copy
/// smoothed at the scale of the size, their points still lie on the input edges. Boundary and feature curves whose corners equal edges
/// would cut by more than 0.09 sizes get unequal edges that mostly do not. Locked points divide a curve into pieces that are meshed apart.
///
/// # Errors
/// [`Reason::BadParameter`](crate::error::Reason::BadParameter) for sizes that are not positive;
/// [`Reason::LimitReached`](crate::error::Reason::LimitReached) for more than 10 million points.
pub fn mesh_curve(polyline: &CurvePolyline, work: &Work<'_>) -> Result<CurveMesh> {
    if polyline.locked.contains(&true) { locked::discretize(polyline, work) } else { discretize::discretize(polyline, work) }
}

/// A curve as a patch sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PatchCurve {
    /// Curve of the network.
    pub curve: u32,
    /// Local vertices of the patch along the curve, in the direction of the curve.
    pub path: Vec<u32>,
}

/// The curves of every patch: boundary curves of the patch and features inside it, in local vertices. `patches` are all patches of
/// the partition, in order. A feature with the patch on both sides is listed once, unless the patch was cut open along it; then twice.
/// O(total length of the curves + F).
pub fn patch_curves(
    topology: &Topology,
    network: &CurveNetwork,
    partition: &Partition,
    patches: &[(Patch, PatchMap)],
) -> Vec<Vec<PatchCurve>> {
    let mut local_face = vec![0u32; partition.face_patch.len()];
    for (_, map) in patches {
        map.faces.iter().enumerate().for_each(|(i, &f)| local_face[f as usize] = i as u32);
    }
    let patch_of = |h: u32| partition.face_patch[topology.face(h) as usize];
    // The local vertex a halfedge leaves, in the patch that holds its face.
    let start = |h: u32| patches[patch_of(h) as usize].0.triangles[local_face[topology.face(h) as usize] as usize][h as usize % 3];
    let end = |h: u32| start(topology.next(h));
    let mut curves: Vec<Vec<PatchCurve>> = vec![Vec::new(); patches.len()];
    for (number, curve) in network.curves.iter().enumerate() {
        let Some((&first, &last)) = curve.halfedges.first().zip(curve.halfedges.last()) else { continue };
        let number = number as u32;
        let path: Vec<u32> = curve.halfedges.iter().map(|&h| start(h)).chain([end(last)]).collect();
        let twins: Vec<u32> = curve.halfedges.iter().filter_map(|&h| topology.twin(h)).collect();
        if let Some((&first_twin, &last_twin)) = twins.first().zip(twins.last()) {
            let behind: Vec<u32> = twins.iter().map(|&t| end(t)).chain([start(last_twin)]).collect();
            if patch_of(first_twin) != patch_of(first) || behind != path {
                curves[patch_of(first_twin) as usize].push(PatchCurve { curve: number, path: behind });
            }
        }
        curves[patch_of(first) as usize].push(PatchCurve { curve: number, path });
    }
    curves
}

#[cfg(test)]
mod tests;
