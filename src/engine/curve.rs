//! The network of curves every patch mesh must respect (boundary, features, patch borders) and their one-dimensional meshes.
//! Each curve is meshed once and shared by the patches beside it, which keeps neighbours conforming (P2 section 4, step 4).

use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::partition::Partition;
use crate::topology::Topology;
use crate::vector::Vec3;
use crate::work::Work;

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
}

impl Contents for CurvePolyline {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.points).f64s(&self.sizes).u64(u64::from(self.closed)).u64(self.kind as u64);
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
    let _ = (topology, features, partition);
    CurveNetwork::default()
}

/// The polyline of a curve with the wanted sizes at its vertices.
pub fn curve_polyline(mesh: &SurfaceMesh, topology: &Topology, curve: &Curve, vertex_size: &[f64]) -> CurvePolyline {
    let _ = (mesh, topology, curve, vertex_size);
    CurvePolyline { points: Vec::new(), sizes: Vec::new(), closed: false, kind: CurveKind::Seam }
}

/// Divides a curve into N = round(integral of ds / size) edges of equal length in the size field (P2 section 4, step 4).
///
/// # Errors
/// [`Reason::BadParameter`] for sizes that are not positive; [`Reason::LimitReached`] for more than 50 million points.
pub fn mesh_curve(polyline: &CurvePolyline, work: &Work<'_>) -> Result<CurveMesh> {
    let _ = (polyline, work);
    Err(EngineError::new(Reason::NotBuilt, "curve mesh"))
}
