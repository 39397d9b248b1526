//! Deterministic, deliberately poor surfaces to try the product on: marching-cubes style scans and CAD style tessellations.
//!
//! Scans ([`SampleKind::Artery`], [`SampleKind::Pelvis`], [`SampleKind::Tube`], [`SampleKind::Lattice`]) are level sets of an implicit body, extracted
//! tetrahedron by tetrahedron from partly quantised values, so they show voxel steps and slivers. CAD parts
//! ([`SampleKind::Brake`], [`SampleKind::CadPart`]) are stacks of prisms over a planar layout: sharp edges, uneven strips, needles.
//! Every sample is manifold, oriented outward, of one component, free of self-intersections and of zero-area faces.

use crate::error::{EngineError, Reason, Result};
use crate::mesh::{LengthUnit, SurfaceMesh};
use crate::work::Work;

mod artery;
mod brake;
mod cad;
mod cut;
mod field;
mod fit;
mod lattice;
mod layout;
mod net;
mod pelvis;
mod scan;
mod stack;

/// Most triangles a sample may be asked for.
pub const MAX_TRIANGLES: u64 = 5_000_000;

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
    /// A closed block of gyroid lattice: struts along a net of three-fold nodes; genus 240 at full size (marching cubes, voxel steps).
    Lattice,
}

/// What to generate.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleSpec {
    /// Which surface.
    pub kind: SampleKind,
    /// Roughly how many triangles are wanted; the result is within a factor of 1.5 where the shape allows. A shape that needs
    /// more triangles to have its topology at all (9 vessels, 83 handles) gets about the fewest that do.
    pub triangles: u64,
    /// Genus of `Pelvis` (0 to 64; `None` takes 3: the pelvic ring and two obturator foramina) or of `Brake` (2 to 400; `None`
    /// takes 83 from 40,000 triangles on and proportionally fewer below), or of `Lattice` (1 to 1000; `None` takes 240 from 60,000
    /// triangles on and proportionally fewer below). A brake disc of genus `g` has `g - 6` vanes and 5 bolt
    /// slots, or, below genus 12, `g - 1` vanes and no slot. Ignored by no kind: the others refuse it.
    pub genus: Option<u32>,
    /// Open ends of `Artery`, the inlet included (2 to 240), i.e. the number of boundary loops; `None` takes the usual 9.
    pub outlets: Option<u32>,
    /// Height over diameter of `Tube` (0.25 to 100); `None` takes 3.
    pub aspect_ratio: Option<f64>,
}

impl SampleSpec {
    /// A sample of a kind with the usual parameters.
    pub fn new(kind: SampleKind, triangles: u64) -> Self {
        SampleSpec { kind, triangles, genus: None, outlets: None, aspect_ratio: None }
    }
}

/// Generates a sample. The same spec gives the same bits. Lengths are millimetres. Cost: a few microseconds a triangle.
///
/// # Errors
/// [`Reason::BadParameter`] for counts that make no sense and for parameters the kind does not have;
/// [`Reason::LimitReached`] above [`MAX_TRIANGLES`].
pub fn generate(spec: &SampleSpec, work: &Work<'_>) -> Result<SurfaceMesh> {
    check(spec)?;
    let target = spec.triangles;
    let mut mesh = match spec.kind {
        SampleKind::Artery => scan::generate(&artery::tree(spec.outlets.unwrap_or(9)), target, work)?,
        SampleKind::Tube => scan::generate(&artery::tube(spec.aspect_ratio.unwrap_or(3.0)), target, work)?,
        SampleKind::Pelvis => scan::generate(&pelvis::body(spec.genus.unwrap_or(3)), target, work)?,
        SampleKind::Brake => brake::generate(spec.genus.unwrap_or_else(|| brake::usual_genus(target)), target, work)?,
        SampleKind::CadPart => cad::generate(target, work)?,
        SampleKind::Lattice => scan::generate(&net::body(spec.genus.unwrap_or_else(|| net::usual_genus(target))), target, work)?,
    };
    mesh.unit = LengthUnit::Millimetre;
    Ok(mesh)
}

fn check(spec: &SampleSpec) -> Result<()> {
    if spec.triangles == 0 {
        return Err(EngineError::bad_parameter("triangles", "at least 1 triangle must be asked for"));
    }
    if spec.triangles > MAX_TRIANGLES {
        let message = format!("{} triangles were asked for; the most is {MAX_TRIANGLES}", spec.triangles);
        return Err(EngineError::new(Reason::LimitReached, message).with_metadata("limit", MAX_TRIANGLES));
    }
    let genus_range = match spec.kind {
        SampleKind::Pelvis => Some((0, 64)),
        SampleKind::Brake => Some((2, 400)),
        SampleKind::Lattice => Some((1, 1000)),
        _ => None,
    };
    let outlet_range = (spec.kind == SampleKind::Artery).then_some((2, 240));
    check_count("genus", spec.genus, genus_range)?;
    check_count("outlets", spec.outlets, outlet_range)?;
    match spec.aspect_ratio {
        Some(_) if spec.kind != SampleKind::Tube => Err(EngineError::bad_parameter("aspect_ratio", "only a tube has one")),
        Some(ratio) if !(0.25..=100.0).contains(&ratio) => {
            Err(EngineError::bad_parameter("aspect_ratio", format!("{ratio} is not in 0.25 to 100")))
        }
        _ => Ok(()),
    }
}

fn check_count(field: &str, value: Option<u32>, range: Option<(u32, u32)>) -> Result<()> {
    match (value, range) {
        (Some(_), None) => Err(EngineError::bad_parameter(field, "this kind of sample has no such parameter")),
        (Some(n), Some((low, high))) if n < low || n > high => {
            Err(EngineError::bad_parameter(field, format!("{n} is not in {low} to {high}")))
        }
        _ => Ok(()),
    }
}

/// A number in `[0, 1)` that depends on `key` alone (SplitMix64 finalizer).
fn noise(key: u64) -> f64 {
    let mut x = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests;
