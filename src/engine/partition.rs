//! Partition of a surface into patches of genus 0 with a boundary (P2 eq. 5), by a multilevel cut of the dual graph.

use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;

/// How to partition.
#[derive(Debug, Clone, PartialEq)]
pub struct PartitionSpec {
    /// Wanted number of patches over the whole surface; `None` chooses from `max_patch_faces`.
    /// More are made where topology or features ask for it.
    pub patches: Option<u32>,
    /// Patches are split until none has more faces than this.
    pub max_patch_faces: u32,
    /// Bound on eta = pi A / L^2 with L the longest boundary loop (P2 section 4, eta_max = 4).
    pub max_aspect_ratio: f64,
}

impl Default for PartitionSpec {
    fn default() -> Self {
        PartitionSpec { patches: None, max_patch_faces: 12_000, max_aspect_ratio: 4.0 }
    }
}

/// Numbers of one patch.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchSummary {
    /// Faces.
    pub faces: u32,
    /// Area in squared units of the mesh.
    pub area: f64,
    /// Boundary loops.
    pub loops: u32,
    /// Handles; 0 for every delivered patch.
    pub genus: u32,
    /// Length of all boundary loops.
    pub border_length: f64,
    /// eta = pi A / L^2 with L the longest loop.
    pub aspect_ratio: f64,
}

/// A patch number for each face. Patches are connected, of genus 0 and have at least one boundary loop; no feature edge that
/// closes off a piece of surface runs through a patch (dangling feature edges may).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Partition {
    /// Patch of each face, `0..patches.len()`; numbered by their lowest face.
    pub face_patch: Vec<u32>,
    /// Numbers of each patch.
    pub patches: Vec<PatchSummary>,
}

impl Contents for Partition {
    fn feed(&self, into: &mut Feeder) {
        into.u32s(&self.face_patch);
    }

    fn bytes(&self) -> usize {
        self.face_patch.len() * 4 + self.patches.len() * std::mem::size_of::<PatchSummary>()
    }
}

/// Partitions a surface. Deterministic. O(F log F).
///
/// # Errors
/// [`Reason::BadParameter`]; [`Reason::PatchTopology`] (with locations) if some piece cannot be brought to genus 0 with a boundary.
pub fn partition_surface(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    spec: &PartitionSpec,
    work: &Work<'_>,
) -> Result<Partition> {
    let _ = (mesh, topology, features, spec, work);
    Err(EngineError::new(Reason::NotBuilt, "partition"))
}

/// Splits the listed patches in two (those whose chart failed) and leaves all others' face sets as they are.
///
/// # Errors
/// [`Reason::PatchTopology`] (with locations) if a patch is too small to split.
pub fn split_patches(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    partition: &Partition,
    split: &[u32],
    work: &Work<'_>,
) -> Result<Partition> {
    let _ = (mesh, topology, features, partition, split, work);
    Err(EngineError::new(Reason::NotBuilt, "patch split"))
}
