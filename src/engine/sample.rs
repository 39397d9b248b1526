//! Deterministic, deliberately poor surfaces to try the product on: marching-cubes style scans and CAD style tessellations.

use crate::error::{EngineError, Reason, Result};
use crate::mesh::SurfaceMesh;
use crate::work::Work;

/// A generated surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SampleKind {
    /// An arterial tree with open outlets (marching cubes, voxel steps).
    Artery,
    /// A closed body of some genus (marching cubes, pelvis-like).
    Pelvis,
    /// A ventilated brake disc; genus 83 at full size.
    Brake,
    /// A CAD part with sharp edges, slivers and named regions.
    CadPart,
    /// A tube of some aspect ratio (height over diameter), open at both ends.
    Tube,
}

/// What to generate.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleSpec {
    /// Which surface.
    pub kind: SampleKind,
    /// Roughly how many triangles are wanted; the result is within a factor of 1.5 where the shape allows.
    pub triangles: u64,
    /// Handles of `Pelvis`, vanes of `Brake`; `None` takes the usual (3; 83 at full size).
    pub genus: Option<u32>,
    /// Outlets of `Artery`; `None` takes the usual 9.
    pub outlets: Option<u32>,
    /// Height over diameter of `Tube`; `None` takes 3.
    pub aspect_ratio: Option<f64>,
}

/// Generates a sample. The same spec gives the same bits.
///
/// # Errors
/// [`Reason::BadParameter`] for counts that make no sense; [`Reason::LimitReached`] above 5 million triangles.
pub fn generate(spec: &SampleSpec, work: &Work<'_>) -> Result<SurfaceMesh> {
    let _ = (spec, work);
    Err(EngineError::new(Reason::NotBuilt, "samples"))
}
