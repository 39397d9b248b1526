//! Merging of neighbouring patches whose union is still a valid patch.

use super::surface::{Limits, Scratch, Surface};
use crate::error::Result;
use crate::work::Work;

/// When to stop merging and what to keep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// Wanted number of patches.
    pub(super) patches: Option<u32>,
    /// What the union must keep.
    pub(super) limits: Limits,
}

pub(super) fn merge_patches(_s: &Surface<'_>, _label: &mut [u32], _goal: &Goal, _scratch: &mut Scratch, _work: &Work<'_>) -> Result<()> {
    Ok(())
}
