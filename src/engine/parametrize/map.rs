//! One map of a patch: which operator, under which conditions; its solution and what the checks say of it.

use super::conformal::ConformalProblem;
use super::dirichlet::DirichletProblem;
use super::domain::Domain;
use super::mean_value::MeanValueProblem;
use super::mend;
use super::operator::Weights;
use super::outcome::{ChartAttempt, Distortion, Filling};
use super::outer::place_outer;
use super::place::{FaceShapes, Turn, chart_areas, distortion, place};
use super::spec::{Boundary, ChartMethod};
use super::system::ChartFactor;
use super::validity::{self, Overlap, find_overlap, scale_variation};
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::patch::Patch;
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::Complex;

/// Largest over smallest local length scale of a usable chart. Conformal maps shrink a tube by e per radius of length: a tube of
/// 3.5 diameters reaches this (P2 section 3 splits at such aspect ratios, too), and past it the planar mesher runs out of room.
/// Stricter than the areas below 1e-10 of P2.
pub const MAX_SCALE_VARIATION: f64 = 1e3;

/// One map to compute, with local vertices. What only moves a finished map (targets of two pins) is not part of it.
#[derive(Debug, Clone, PartialEq)]
pub struct MapSpec {
    /// The method.
    pub method: ChartMethod,
    /// Which loop of the patch is the outer one.
    pub outer: usize,
    /// Virtual triangles.
    pub filling: Filling,
    /// Pinned vertices; at least two for LSCM, else none.
    pub pins: Vec<u32>,
    /// Targets of the pins if there are more than two.
    pub targets: Vec<Vec2>,
    /// Positions of the outer loop, for methods that hold it.
    pub boundary: Boundary,
}

/// Which factorization a map needs besides that of the interior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ProblemSpec {
    /// Whether it is conformal, held with symmetric weights, or mean value.
    pub family: Family,
    /// Which loop of the patch is the outer one.
    pub outer: usize,
    /// Virtual triangles.
    pub filling: Filling,
}

/// Maps that share one factorization on the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// Spectral and least squares conformal, any pins.
    Conformal,
    /// Harmonic (cotangent) or barycentric (uniform weights), any positions of the outer loop.
    Held(Weights),
    /// Mean value, any positions of the outer loop.
    MeanValue,
}

impl Family {
    /// Weights of the interior elimination it builds on; `None` for mean value, which has its own factor.
    pub fn interior(self) -> Option<Weights> {
        match self {
            Family::Conformal => Some(Weights::Cotangent),
            Family::Held(weights) => Some(weights),
            Family::MeanValue => None,
        }
    }
}

impl MapSpec {
    /// The factorization it needs.
    pub fn problem(&self) -> ProblemSpec {
        let family = match self.method {
            ChartMethod::SpectralConformal | ChartMethod::LeastSquaresConformal => Family::Conformal,
            ChartMethod::Harmonic => Family::Held(Weights::Cotangent),
            ChartMethod::Barycentric => Family::Held(Weights::Uniform),
            ChartMethod::MeanValue => Family::MeanValue,
        };
        ProblemSpec { family, outer: self.outer, filling: self.filling }
    }
}

/// Factorization of a boundary problem; serves every map of its family.
#[derive(Debug)]
pub struct BoundaryFactor(Problem);

#[derive(Debug)]
enum Problem {
    Conformal(ConformalProblem),
    Dirichlet(DirichletProblem),
    MeanValue(Box<(MeanValueProblem, FaceShapes)>),
}

impl BoundaryFactor {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match &self.0 {
            Problem::Conformal(problem) => problem.bytes(),
            Problem::Dirichlet(problem) => problem.bytes(),
            Problem::MeanValue(held) => held.0.bytes() + held.1.bytes(),
        }
    }
}

/// Factorizes the boundary problem of a family. `factor` is the elimination of the interior under the weights of
/// [`Family::interior`]; mean value needs none.
///
/// # Errors
/// [`crate::error::Reason::SolverSingular`], [`crate::error::Reason::LimitReached`]; [`crate::error::Reason::ChartFailed`] for a hole that
/// cannot be filled that way; cancellation; broken invariants.
pub fn factor_boundary(patch: &Patch, factor: Option<&ChartFactor>, spec: ProblemSpec, work: &Work<'_>) -> Result<BoundaryFactor> {
    let domain = Domain::new(patch, spec.outer, spec.filling, work)?;
    let interior = || factor.ok_or_else(|| EngineError::invariant("the interior is not factorized"));
    Ok(BoundaryFactor(match spec.family {
        Family::Conformal => Problem::Conformal(ConformalProblem::new(&domain, interior()?, work)?),
        Family::Held(_) => Problem::Dirichlet(DirichletProblem::new(&domain, interior()?, work)?),
        Family::MeanValue => Problem::MeanValue(Box::new((MeanValueProblem::new(&domain, work)?, FaceShapes::of(&domain)))),
    }))
}

/// What the checks say of a map; the words are in [`ChartAttempt::rejected`].
#[derive(Debug, Clone, PartialEq)]
pub enum MapVerdict {
    /// One-to-one and even enough.
    Usable,
    /// One-to-one, but lengths are scaled so unevenly that the patch must be split.
    Crowded,
    /// Not one-to-one.
    NotBijective {
        /// Flipped faces.
        flipped: Vec<u32>,
        /// Two boundary edges (pairs of vertices) that meet in the plane, if any do.
        crossing: Option<[[u32; 2]; 2]>,
    },
    /// The solver gave up, or what it found is no chart.
    Unsolved,
}

/// A map with what the checks say of it: the output of the solve stage.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedMap {
    /// Positions of the patch's vertices; empty if there is no solution. Scaled to the area of the patch, centred, principal axis
    /// first; but with targets in the spec: as solved.
    pub uv: Vec<Vec2>,
    /// Distortion.
    pub distortion: Distortion,
    /// What was tried.
    pub attempt: ChartAttempt,
    /// What to make of it.
    pub verdict: MapVerdict,
}

impl Contents for SolvedMap {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.uv).text(&format!("{:?}", self.attempt));
    }

    fn bytes(&self) -> usize {
        self.uv.len() * 16 + 512
    }
}

fn attempt_of(map: &MapSpec) -> ChartAttempt {
    ChartAttempt {
        method: map.method,
        filling: map.filling,
        pins: map.pins.clone(),
        flipped_before: 0,
        flipped: 0,
        overlaps: false,
        rejected: String::new(),
    }
}

/// The record of a map whose factorization failed.
pub fn unsolved_map(map: &MapSpec, error: &EngineError) -> SolvedMap {
    let attempt = ChartAttempt { rejected: error.message().to_owned(), ..attempt_of(map) };
    SolvedMap { uv: Vec::new(), distortion: Distortion::default(), attempt, verdict: MapVerdict::Unsolved }
}

/// Solves for a map, repairs flipped faces (P1 section 5) and checks it. One or two back substitutions for held loops and pins, about a
/// dozen small ones for the spectral map, then O(n + m log m).
///
/// # Errors
/// [`crate::error::Reason::BadParameter`] for conditions that do not fit the patch; cancellation; broken invariants. A solver that gives
/// up is a verdict.
pub fn solve_map(
    patch: &Patch,
    factor: Option<&ChartFactor>,
    boundary: &BoundaryFactor,
    map: &MapSpec,
    work: &Work<'_>,
) -> Result<SolvedMap> {
    match positions_of(patch, factor, boundary, map, work) {
        Ok(uv) => {
            let shapes = match (&boundary.0, factor) {
                (Problem::MeanValue(held), _) => &held.1,
                (_, Some(factor)) => &factor.shapes,
                (_, None) => return Err(EngineError::invariant("the interior is not factorized")),
            };
            examine(patch, shapes, map, uv, work)
        }
        Err(e) if e.reason() == crate::error::Reason::SolverSingular => Ok(unsolved_map(map, &e)),
        Err(e) => Err(e),
    }
}

fn positions_of(
    patch: &Patch,
    factor: Option<&ChartFactor>,
    boundary: &BoundaryFactor,
    map: &MapSpec,
    work: &Work<'_>,
) -> Result<Vec<Vec2>> {
    let count = patch.positions.len();
    let interior = || factor.ok_or_else(|| EngineError::invariant("the interior is not factorized"));
    let held = || place_outer(&patch.loops[map.outer], &patch.positions, &map.boundary);
    match &boundary.0 {
        Problem::MeanValue(problem) => problem.0.solve(&held()?, count),
        Problem::Dirichlet(problem) => problem.solve(&held()?)?.spread(interior()?, count),
        Problem::Conformal(problem) if map.method == ChartMethod::SpectralConformal => problem.spectral(work)?.0.spread(interior()?, count),
        Problem::Conformal(problem) => {
            let default = [[0.0, 0.0], [1.0, 0.0]];
            let targets = if map.targets.is_empty() { &default[..] } else { &map.targets };
            let pins: Vec<(u32, Complex)> = map.pins.iter().zip(targets).map(|(&v, t)| (v, Complex::new(t[0], t[1]))).collect();
            let mut uv = problem.pinned(interior()?, &pins, work)?.spread(interior()?, count)?;
            // Exactly there: the solution is off by rounding.
            map.pins.iter().zip(targets).for_each(|(&v, &t)| uv[v as usize] = t);
            Ok(uv)
        }
    }
}

fn examine(patch: &Patch, shapes: &FaceShapes, map: &MapSpec, mut uv: Vec<Vec2>, work: &Work<'_>) -> Result<SolvedMap> {
    let area: f64 = shapes.areas.iter().sum();
    let first = patch.loops[map.outer][0];
    let exact = !map.targets.is_empty();
    let turn = if map.method.has_fixed_boundary() { Turn::Keep } else { Turn::Principal };
    let held: &[u32] = match (exact, turn) {
        (true, _) => &map.pins,
        (false, Turn::Keep) => &patch.loops[map.outer],
        (false, Turn::Principal) => &[],
    };
    let mut attempt = attempt_of(map);
    let mut flipped = Vec::new();
    // The second pass puts a mended chart back to size, which may round a hair-thin face flat again.
    for pass in 0..2 {
        if !exact && place(&patch.triangles, first, area, turn, &mut uv).is_none() {
            "the chart has no area".clone_into(&mut attempt.rejected);
            return Ok(SolvedMap { uv, distortion: Distortion::default(), attempt, verdict: MapVerdict::Unsolved });
        }
        flipped = validity::flipped_faces(&patch.triangles, &uv);
        if pass == 0 {
            attempt.flipped_before = flipped.len() as u32;
        }
        if flipped.is_empty() {
            break;
        }
        flipped = mend::mend_flips(patch, held, &mut uv, work)?.flipped;
    }
    attempt.flipped = flipped.len() as u32;
    let overlap = find_overlap(&patch.loops, &uv, work)?;
    attempt.overlaps = overlap.is_some();
    let scale = if exact { area / chart_areas(&patch.triangles, &uv).iter().sum::<f64>().abs() } else { 1.0 };
    let distortion = distortion(&patch.triangles, shapes, &uv, scale.sqrt());
    let verdict = if !flipped.is_empty() || attempt.overlaps {
        attempt.rejected = match (flipped.len(), attempt.overlaps) {
            (0, _) => "the boundary runs into itself".to_owned(),
            (n, false) => format!("{n} flipped faces"),
            (n, true) => format!("{n} flipped faces and the boundary runs into itself"),
        };
        let crossing = match overlap {
            Some(Overlap::Edges(edges)) => Some(edges),
            Some(Overlap::Winding(_)) | None => None,
        };
        MapVerdict::NotBijective { flipped, crossing }
    } else if map.outer != 0 && !validity::runs_counter_clockwise(&patch.loops[map.outer], &uv) {
        "another loop came out outside".clone_into(&mut attempt.rejected);
        MapVerdict::Unsolved
    } else {
        let variation = scale_variation(&patch.triangles, &shapes.areas, &chart_areas(&patch.triangles, &uv), patch.positions.len());
        if variation > MAX_SCALE_VARIATION {
            attempt.rejected = format!("lengths are scaled by factors that differ {variation:.3e} times");
            MapVerdict::Crowded
        } else {
            MapVerdict::Usable
        }
    };
    if !exact {
        let unit = Domain::unit_of(patch)?;
        uv.iter_mut().flatten().for_each(|x| *x *= unit);
    }
    Ok(SolvedMap { uv, distortion, attempt, verdict })
}
