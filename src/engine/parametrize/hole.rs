//! placeholder until the merge
use crate::error::{EngineError, Reason, Result};
use crate::vector::Vec3;
use crate::work::Work;

pub(super) struct HoleMesh {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

pub(super) fn mean_plane_fill(_ring: &[u32], _positions: &[Vec3], _work: &Work<'_>) -> Result<HoleMesh> {
    Err(EngineError::new(Reason::NotBuilt, "mean plane"))
}
