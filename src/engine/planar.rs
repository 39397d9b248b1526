//! Meshing a chart: frontal Delaunay in the plane under the metric of the map (P1 eq. 2) and the size field, then the lift of the
//! planar mesh to the input surface.

use crate::curve::CurveMesh;
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::parametrize::Chart;
use crate::patch::Patch;
use crate::vector::{Vec2, Vec3};
use crate::work::Work;

/// A curve as one patch sees it: a boundary curve of the patch, or a feature inside it.
#[derive(Debug, Clone)]
pub struct CurveUse<'a> {
    /// Local vertices of the patch along the curve in the direction of `mesh` (the polyline's points).
    /// A curve with the patch on both sides that is a border (not inside) comes twice, once for each side.
    pub path: Vec<u32>,
    /// The shared one-dimensional mesh.
    pub mesh: &'a CurveMesh,
    /// Number of the curve in the network; only carried to the origin of the vertices.
    pub curve: u32,
}

/// Where a vertex of a patch mesh comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VertexOrigin {
    /// Point `point` of the mesh of curve `curve` of the network.
    Curve {
        /// Curve of the network.
        curve: u32,
        /// Index in [`CurveMesh::points`].
        point: u32,
    },
    /// Inside the patch.
    Interior,
}

/// A point on a face of the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Face.
    pub face: u32,
    /// Barycentric coordinates, not negative, of sum 1.
    pub barycentric: [f64; 3],
}

/// The mesh of a chart in the plane. Every curve point is a vertex, every curve edge is an edge.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanarMesh {
    /// Vertices in the plane.
    pub uv: Vec<Vec2>,
    /// Counter-clockwise triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Where each vertex comes from.
    pub origins: Vec<VertexOrigin>,
    /// Where each vertex lies on the patch (local face).
    pub points: Vec<SurfacePoint>,
}

impl Contents for PlanarMesh {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.uv).tuples(&self.triangles);
    }

    fn bytes(&self) -> usize {
        self.uv.len() * (16 + 40 + 12) + self.triangles.len() * 12
    }
}

/// A patch mesh in space, with the same vertices and triangles as its planar mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LiftedPatch {
    /// Vertices in space, on the input surface.
    pub positions: Vec<Vec3>,
    /// Triangles, oriented like the patch.
    pub triangles: Vec<[u32; 3]>,
    /// Where each vertex comes from.
    pub origins: Vec<VertexOrigin>,
    /// Where each vertex lies on the patch (local face).
    pub points: Vec<SurfacePoint>,
}

impl Contents for LiftedPatch {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles).u64(self.origins.len() as u64);
        for origin in &self.origins {
            match *origin {
                VertexOrigin::Interior => into.u64(0),
                VertexOrigin::Curve { curve, point } => into.u64(1).u64(u64::from(curve)).u64(u64::from(point)),
            };
        }
        into.u64(self.points.len() as u64);
        for point in &self.points {
            into.u64(u64::from(point.face)).points(&[point.barycentric]);
        }
    }

    fn bytes(&self) -> usize {
        self.positions.len() * (24 + 40 + 12) + self.triangles.len() * 12
    }
}

/// Planar mesher options.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Mesher {
    /// Delaunay with points placed from the front (Rebay 1993), the default.
    #[default]
    Frontal,
}

/// Meshes a chart. `vertex_size` is the wanted length in space at each patch vertex. Deterministic; near-linear.
///
/// # Errors
/// [`Reason::PlanarMeshFailed`] with a location if the boundary of the chart cannot be recovered; cancellation.
pub fn mesh_chart(
    patch: &Patch,
    chart: &Chart,
    curves: &[CurveUse<'_>],
    vertex_size: &[f64],
    mesher: Mesher,
    work: &Work<'_>,
) -> Result<PlanarMesh> {
    let _ = (patch, chart, curves, vertex_size, mesher, work);
    Err(EngineError::new(Reason::NotBuilt, "planar mesh"))
}

/// Lifts a planar mesh to space: curve points take the positions of the curve mesh bit for bit, others lie on their face.
pub fn lift(patch: &Patch, planar: &PlanarMesh, curves: &[CurveUse<'_>]) -> LiftedPatch {
    let _ = (patch, planar, curves);
    LiftedPatch::default()
}
