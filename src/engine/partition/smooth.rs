//! Border smoothing.

use super::surface::{Limits, Surface};
use crate::error::Result;
use crate::work::Work;

pub(super) fn smooth_borders(_s: &Surface<'_>, _label: &mut [u32], _limits: Limits, _work: &Work<'_>) -> Result<()> {
    Ok(())
}
