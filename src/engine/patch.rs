//! One patch as a mesh of its own, in local numbers, so that its fingerprint depends on nothing but its content.

use crate::error::Result;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::partition::Partition;
use crate::topology::Topology;
use crate::vector::Vec3;

/// A connected piece of surface of genus 0 with at least one boundary loop, manifold by itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patch {
    /// Local vertex positions, in increasing order of global vertex (then of copy, where the patch touches itself in a vertex).
    pub positions: Vec<Vec3>,
    /// Local vertex indices of each face, in increasing order of global face, corners in the global corner order.
    pub triangles: Vec<[u32; 3]>,
    /// Boundary loops as local vertices in halfedge direction (the patch lies on the left); the longest first.
    pub loops: Vec<Vec<u32>>,
}

/// Where the local elements of a patch are in the surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchMap {
    /// Global vertex of each local vertex. A global vertex occurs twice if the patch touches itself there.
    pub vertices: Vec<u32>,
    /// Global face of each local face, increasing.
    pub faces: Vec<u32>,
}

impl Contents for Patch {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles);
    }

    fn bytes(&self) -> usize {
        self.positions.len() * 24 + self.triangles.len() * 12 + self.loops.iter().map(|l| l.len() * 4 + 24).sum::<usize>()
    }
}

/// Cuts every patch out of the surface. O(F). A vertex in which a patch touches itself is doubled, so that every patch is manifold.
///
/// # Errors
/// Only broken invariants of `partition`.
pub fn extract_patches(mesh: &SurfaceMesh, topology: &Topology, partition: &Partition) -> Result<Vec<(Patch, PatchMap)>> {
    let _ = (mesh, topology, partition);
    Err(crate::error::EngineError::new(crate::error::Reason::NotBuilt, "patch extraction"))
}
