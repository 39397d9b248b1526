//! Charts: maps of a patch to the plane (P1 sections 2 to 5 and 8).
//!
//! A chart is made in steps, each of which is kept: [`plan_system`] analyses the connectivity of the patch, [`factor_system`] eliminates
//! its interior, [`factor_boundary`] factorizes what is left on the loops for a family of maps, [`solve_map`] solves for one map and
//! checks it. [`candidate_maps`] says which maps are tried, and [`conclude`] makes a chart or a verdict of them.

mod choose;
mod conformal;
mod dirichlet;
mod domain;
mod ears;
mod faces;
mod frame;
mod hole;
mod map;
mod mean_value;
mod mend;
mod operator;
mod outcome;
mod outer;
mod pins;
mod place;
mod spec;
mod system;
mod validity;

pub use choose::{candidate_maps, conclude, next_map};
pub use faces::face_distortion;
pub use map::{
    BoundaryFactor, Family, MAX_SCALE_VARIATION, MapSpec, MapVerdict, ProblemSpec, SolvedMap, factor_boundary, solve_map, unsolved_map,
};
pub use operator::Weights;
pub use outcome::{Chart, ChartAttempt, ChartOutcome, Distortion, FaceDistortion, Filling, HoleFilling, Spread};
pub use spec::{Boundary, BoundaryShape, ChartMethod, ChartSpec, Holes, MAX_CORNERS, MAX_PINS, OuterLoop, Pin, Pins, Spacing};
pub use system::{ChartFactor, ChartSystem, factor_system, plan_system};

use crate::error::Result;
use crate::patch::Patch;
use crate::work::Work;

/// The chart of a patch from scratch, without a cache. `spec` has local vertices.
///
/// # Errors
/// Those of the steps; [`crate::error::Reason::ChartFailed`] if a named method gives no one-to-one map.
pub fn parametrize_patch(patch: &Patch, spec: &ChartSpec, work: &Work<'_>) -> Result<ChartOutcome> {
    parametrize_planned(patch, &plan_system(patch, work)?, spec, work)
}

fn parametrize_planned(patch: &Patch, system: &ChartSystem, spec: &ChartSpec, work: &Work<'_>) -> Result<ChartOutcome> {
    let maps = candidate_maps(patch, spec)?;
    let mut interiors: Vec<(Weights, Result<ChartFactor>)> = Vec::new();
    let mut boundaries: Vec<(ProblemSpec, Result<BoundaryFactor>)> = Vec::new();
    let mut tried: Vec<Box<SolvedMap>> = Vec::new();
    while let Some(map) = next_map(&maps, &tried) {
        let problem = map.problem();
        if let Some(weights) = problem.family.interior()
            && !interiors.iter().any(|f| f.0 == weights)
        {
            interiors.push((weights, factor_system(patch, system, weights, work)));
        }
        let interior = interiors.iter().find(|f| Some(f.0) == problem.family.interior()).map(|f| f.1.as_ref());
        let interior = interior.transpose().map_err(Clone::clone);
        if !boundaries.iter().any(|b| b.0 == problem) {
            let made = interior.clone().and_then(|interior| factor_boundary(patch, interior, problem, work));
            boundaries.push((problem, made));
        }
        let boundary = boundaries.iter().find(|b| b.0 == problem).map(|b| b.1.as_ref());
        let solved = match (interior, boundary) {
            (Ok(interior), Some(Ok(boundary))) => solve_map(patch, interior, boundary, map, work)?,
            (Err(e), _) if e.fails_one_map() => unsolved_map(map, &e),
            (_, Some(Err(e))) if e.fails_one_map() => unsolved_map(map, e),
            (Err(e), _) => return Err(e),
            (_, Some(Err(e))) => return Err(e.clone()),
            (Ok(_), None) => return Err(crate::error::EngineError::invariant("a boundary problem was not made")),
        };
        tried.push(Box::new(solved));
    }
    match conclude(patch, spec, &tried) {
        ChartOutcome::Refused(error) => Err(error),
        outcome => Ok(outcome),
    }
}

#[cfg(test)]
mod tests;
