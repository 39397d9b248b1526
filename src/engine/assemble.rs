//! Joining the lifted patches into one conforming mesh along the shared curve meshes.

use crate::curve::{CurveMesh, CurveNetwork};
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::patch::PatchMap;
use crate::planar::LiftedPatch;
use crate::topology::Topology;
use crate::vector::Vec3;

/// What the optimisation may do with a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VertexClass {
    /// Never moved or removed: ends and junctions of features and boundary, sharp corners.
    Corner,
    /// May slide along its feature or boundary curve.
    Curve,
    /// May move on the surface (also vertices of seams).
    Free,
}

/// A conforming mesh of the whole surface, before optimisation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Assembled {
    /// Vertices in space.
    pub positions: Vec<Vec3>,
    /// Triangles, oriented like the input.
    pub triangles: Vec<[u32; 3]>,
    /// Patch of each face.
    pub face_patch: Vec<u32>,
    /// Region (index into the input's regions) of each face.
    pub face_region: Vec<u32>,
    /// What may be done with each vertex.
    pub vertex_class: Vec<VertexClass>,
    /// Edges on boundary and feature curves (vertex pairs, low first, sorted): to be kept as edges or subdivided along the curve.
    pub curve_edges: Vec<[u32; 2]>,
    /// Face of the input on which each vertex lies: a starting point for projections.
    pub vertex_face: Vec<u32>,
}

impl Contents for Assembled {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles).u32s(&self.face_patch).u32s(&self.face_region).tuples(&self.curve_edges);
        into.u64(self.vertex_class.len() as u64);
        for class in &self.vertex_class {
            into.u64(*class as u64);
        }
        into.u32s(&self.vertex_face);
    }

    fn bytes(&self) -> usize {
        self.positions.len() * (24 + 1 + 4) + self.triangles.len() * 20 + self.curve_edges.len() * 8
    }
}

/// Joins lifted patches: vertices with the same curve point become one. O(output).
/// `corners` are the corners of the features; ends of feature and boundary curves that are junctions are corners too.
///
/// # Errors
/// [`Reason::Invariant`] if the result is not a manifold with the input's topology.
pub fn assemble(
    mesh: &SurfaceMesh,
    topology: &Topology,
    corners: &[u32],
    network: &CurveNetwork,
    curve_meshes: &[std::sync::Arc<CurveMesh>],
    patches: &[(std::sync::Arc<LiftedPatch>, &PatchMap)],
) -> Result<Assembled> {
    let _ = (mesh, topology, corners, network, curve_meshes, patches);
    Err(EngineError::new(Reason::NotBuilt, "assembly"))
}
