//! Charts: maps of a patch to the plane. Spectral conformal first (P1 section 4), then LSCM, then mean value on a disk when a
//! check finds flips or overlap (P1 section 8).

use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::patch::Patch;
use crate::vector::Vec2;
use crate::work::Work;

/// A map to the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ChartMethod {
    /// Smallest non-zero generalized eigenvector of the conformal energy and the boundary mass (P1 eq. 29).
    SpectralConformal,
    /// Least squares conformal map with two pinned boundary vertices (P1 section 2.3).
    LeastSquaresConformal,
    /// Mean value convex combination map onto a circle (P1 eq. 14, 26); always bijective for a disc.
    MeanValue,
}

/// Which chart is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ChartSpec {
    /// Spectral conformal, LSCM or mean value: the first that passes the checks (P1 figure 23).
    #[default]
    Automatic,
    /// This method or an error, never another.
    Only(ChartMethod),
}

/// Distortion of a chart over its faces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    /// Largest over smallest singular value of the map, area-weighted mean (1 = conformal).
    pub angle_mean: f64,
    /// Its maximum.
    pub angle_max: f64,
    /// Smallest ratio of chart area to surface area of a face (after scaling the whole chart to the area of the patch).
    pub area_min: f64,
    /// Largest such ratio.
    pub area_max: f64,
}

/// One method that was tried and what the checks said.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAttempt {
    /// The method.
    pub method: ChartMethod,
    /// Faces of negative or zero area in the plane.
    pub flipped: u32,
    /// Whether the boundary crosses itself in the plane (global overlap).
    pub overlaps: bool,
    /// Why it was not taken; empty for the one that was.
    pub rejected: String,
}

/// A bijective chart. The patch is scaled so that chart area equals surface area; all faces are counter-clockwise.
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
}

impl Contents for ChartOutcome {
    fn feed(&self, into: &mut Feeder) {
        match self {
            ChartOutcome::Mapped(chart) => into.u64(1).u64(chart.method as u64).points(&chart.uv),
            ChartOutcome::MustSplit { reason, .. } => into.u64(0).text(reason),
        };
    }

    fn bytes(&self) -> usize {
        match self {
            ChartOutcome::Mapped(chart) => chart.uv.len() * 16 + 256,
            ChartOutcome::MustSplit { reason, .. } => reason.len() + 256,
        }
    }
}

/// A factorization of the conformal operator of a patch, reusable by every conformal map of it.
#[derive(Debug)]
pub struct ConformalFactor {}

impl ConformalFactor {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        0
    }
}

/// Assembles and factorizes the conformal energy E_D - A of a patch (P1 eq. 17, 22) as one complex Hermitian matrix.
///
/// # Errors
/// [`Reason::SolverSingular`] if a pivot is not positive or the residual check fails (the chart stage then falls back to mean value).
pub fn factor_conformal(patch: &Patch, work: &Work<'_>) -> Result<ConformalFactor> {
    let _ = (patch, work);
    Err(EngineError::new(Reason::NotBuilt, "conformal factor"))
}

/// Computes and checks the chart of a patch. `factor` is `Err` if the factorization failed.
///
/// # Errors
/// [`Reason::ChartFailed`] if an explicitly requested method gives no bijective chart; cancellation.
pub fn parametrize_patch(
    patch: &Patch,
    factor: std::result::Result<&ConformalFactor, &EngineError>,
    spec: ChartSpec,
    work: &Work<'_>,
) -> Result<ChartOutcome> {
    let _ = (patch, factor, spec, work);
    Err(EngineError::new(Reason::NotBuilt, "chart"))
}
