//! What is told of a chart: its positions, what was tried, and how it distorts.

use super::spec::ChartMethod;
use crate::error::EngineError;
use crate::fingerprint::{Contents, Feeder};
use crate::vector::Vec2;

/// Smallest value, area-weighted mean and largest value of a quantity over the faces of a chart.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// Smallest value.
    pub min: f64,
    /// Mean weighted with the areas on the surface.
    pub mean: f64,
    /// Largest value.
    pub max: f64,
}

/// Distortion of a chart over its faces, after scaling the whole chart to the area of the patch. With singular values a >= b of the
/// map from the surface to the plane on a face. Faces without area on the surface are left out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    /// a / b; 1 is conformal.
    pub angle: Spread,
    /// a b; 1 is area-preserving.
    pub area: Spread,
    /// Root mean square of 1/a and 1/b, the stretch of Sander et al. 2001; 1 everywhere is isometric.
    pub stretch: Spread,
}

/// Distortion of one face.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FaceDistortion {
    /// a / b as in [`Distortion`]; infinite for a face that is flat in the plane.
    pub angle: f64,
    /// a b, negative for a flipped face.
    pub area: f64,
    /// Root mean square of 1/a and 1/b.
    pub stretch: f64,
}

/// Virtual triangles under which a map was computed. They never reach the chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Filling {
    /// How inner loops were filled.
    pub holes: HoleFilling,
    /// Whether notches of the outer loop were bridged.
    pub ears: bool,
}

/// How the inner loops of a patch were filled for a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum HoleFilling {
    /// Not at all.
    #[default]
    Open,
    /// With a vertex in the centre.
    CentreVertex,
    /// With a mesh of the mean plane.
    MeanPlane,
}

/// One map that was tried and what the checks said.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAttempt {
    /// The method.
    pub method: ChartMethod,
    /// Virtual triangles.
    pub filling: Filling,
    /// Pinned vertices (local); empty for methods without pins.
    pub pins: Vec<u32>,
    /// Faces of negative or zero area in the plane as the map came from the solver.
    pub flipped_before: u32,
    /// Such faces after the cavity and boundary repair (P1 section 5).
    pub flipped: u32,
    /// Whether the boundary crosses itself in the plane (global overlap).
    pub overlaps: bool,
    /// Why it was not taken; empty for the one that was.
    pub rejected: String,
}

/// A bijective chart; all faces are counter-clockwise. Scaled so that chart area equals surface area, centred, principal axis first,
/// unless pins have targets: then it is where they say.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Plane position of each patch vertex.
    pub uv: Vec<Vec2>,
    /// The method that gave it.
    pub method: ChartMethod,
    /// What was tried, in order; the last one was taken.
    pub attempts: Vec<ChartAttempt>,
    /// Distortion.
    pub distortion: Distortion,
}

/// What the chart stage says of a patch.
#[derive(Debug, Clone, PartialEq)]
pub enum ChartOutcome {
    /// A chart that passed all checks.
    Mapped(Chart),
    /// No usable chart: the patch must be split. With the attempts and the reason.
    MustSplit {
        /// What was tried.
        attempts: Vec<ChartAttempt>,
        /// Why none is usable.
        reason: String,
    },
    /// The specification names a method that gives no one-to-one map.
    Refused(EngineError),
}

impl Contents for ChartOutcome {
    fn feed(&self, into: &mut Feeder) {
        match self {
            ChartOutcome::Mapped(chart) => into.u64(1).u64(chart.method as u64).points(&chart.uv),
            ChartOutcome::MustSplit { reason, .. } => into.u64(0).text(reason),
            ChartOutcome::Refused(error) => into.u64(2).text(error.message()),
        };
    }

    fn bytes(&self) -> usize {
        match self {
            ChartOutcome::Mapped(chart) => chart.uv.len() * 16 + 256,
            ChartOutcome::MustSplit { reason, .. } => reason.len() + 256,
            ChartOutcome::Refused(error) => error.message().len() + error.locations().len() * 64 + 256,
        }
    }
}
