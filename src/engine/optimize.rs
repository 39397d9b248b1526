//! Optimisation of the assembled mesh on the input surface, across seams that are not features: flips, splits, collapses and
//! tangential smoothing with projection to the input.

use crate::assemble::Assembled;
use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::sizing::SizeField;
use crate::work::Work;

/// How far to optimise.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizeSpec {
    /// Rounds of split, collapse, flip and smoothing over the whole mesh; 0 leaves the assembled mesh as it is.
    pub rounds: u32,
    /// Triangles below this kappa are chased one by one afterwards.
    pub min_kappa: f64,
}

impl Default for OptimizeSpec {
    fn default() -> Self {
        OptimizeSpec { rounds: 5, min_kappa: 0.5 }
    }
}

/// The finished mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Remeshed {
    /// Surface, with the regions, region names and unit of the input.
    pub mesh: SurfaceMesh,
    /// Patch of each face (of the partition the mesh was made with; approximate along seams).
    pub face_patch: Vec<u32>,
    /// Edges on boundary and feature curves (vertex pairs, low first, sorted).
    pub curve_edges: Vec<[u32; 2]>,
}

impl Contents for Remeshed {
    fn feed(&self, into: &mut Feeder) {
        self.mesh.feed(into);
        into.u32s(&self.face_patch).tuples(&self.curve_edges);
    }

    fn bytes(&self) -> usize {
        self.mesh.bytes() + self.face_patch.len() * 4 + self.curve_edges.len() * 8
    }
}

/// Optimises. Keeps topology, corners, and curves as curves; never flips a face against the input's normal; deterministic.
///
/// # Errors
/// Cancellation; [`Reason::Invariant`].
pub fn optimize_surface(
    input: &SurfaceMesh,
    bvh: &TriangleBvh,
    assembled: &Assembled,
    sizes: &SizeField,
    spec: &OptimizeSpec,
    work: &Work<'_>,
) -> Result<Remeshed> {
    let _ = (input, bvh, assembled, sizes, spec, work);
    Err(EngineError::new(Reason::NotBuilt, "optimisation"))
}
