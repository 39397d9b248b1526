//! The stages of the chart of a patch, from its elimination order to the first map that can be used.

use crate::error::{EngineError, Reason, Result};
use crate::parametrize::{
    BoundaryFactor, ChartFactor, ChartOutcome, ChartSpec, ChartSystem, MapSpec, ProblemSpec, SolvedMap, Weights, candidate_maps, conclude,
    factor_boundary, factor_system, next_map, plan_system, solve_map, unsolved_map,
};
use crate::pipeline::context::{Context, Halt, Step};
use crate::pipeline::kept::Kept;
use crate::pipeline::naming::{on_surface, refusal};
use crate::pipeline::patch_set::PatchSet;
use crate::pipeline::{Layout, Surface};
use crate::session::Snapshot;
use crate::stage::{Stage, StageKey, Stored, Subject};

/// The chart of a patch under its own specification or that of the session. The inner error says that the specification gives none.
pub(super) fn spec_and_chart_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    surface: &Surface,
    patches: &PatchSet,
    p: usize,
) -> Step<Result<Stored<ChartOutcome>>> {
    let Some(own) = snapshot.patch_charts.get(&patches.identities[p]) else {
        let chart = chart_step(context, &snapshot.chart, patches, p)?;
        return Ok(match refusal(&chart, patches, p) {
            Some(error) => Err(error),
            None => Ok(chart),
        });
    };
    let spec = match own.localised(&patches.patches[p].2, &surface.imported.mesh.positions) {
        Ok(spec) => spec,
        Err(error) => return Ok(Err(error)),
    };
    match chart_step(context, &spec, patches, p) {
        Ok(chart) => match &*chart.value {
            ChartOutcome::Mapped(_) => Ok(Ok(chart)),
            ChartOutcome::Refused(error) => Ok(Err(refusal(&chart, patches, p).unwrap_or_else(|| error.clone()))),
            ChartOutcome::MustSplit { reason, .. } => {
                let message = format!("patch {p} has no usable chart under its own specification: {reason}");
                Ok(Err(EngineError::new(Reason::ChartFailed, message)
                    .with_hint("take the specification of the patch back, so that it can be split")
                    .with_metadata("patch", p)))
            }
        },
        Err(Halt::Error(error)) if !error.stops_work() => Ok(Err(error.with_metadata("patch", p))),
        Err(halt) => Err(halt),
    }
}

/// The chart a patch would have under another specification (vertices of the imported mesh), and the maps that were tried for it.
pub(in crate::pipeline) fn preview_step(
    context: &Context<'_>,
    layout: &Layout,
    p: usize,
    spec: &ChartSpec,
) -> Step<(Stored<ChartOutcome>, Vec<Stored<SolvedMap>>)> {
    let map = &layout.patches.patches[p].2;
    let spec = spec.localised(map, &layout.surface.imported.mesh.positions)?;
    let chart = chart_step(context, &spec, &layout.patches, p)?;
    let tried = tried_maps(context, &spec, &layout.patches, p).map_err(|halt| on_surface(halt, map))?;
    Ok((chart, tried))
}

/// `spec` has local vertices; errors name elements of the surface.
fn chart_step(context: &Context<'_>, spec: &ChartSpec, patches: &PatchSet, p: usize) -> Step<Stored<ChartOutcome>> {
    let (patch, fingerprint, map) = &patches.patches[p];
    let key = StageKey::new(Stage::Chart, |f| {
        f.fingerprint(*fingerprint).text(&format!("{spec:?}"));
    });
    let tried = || tried_maps(context, spec, patches, p);
    context.staged(key, Subject::Patch(p as u32), tried, |tried, _| Ok(conclude(patch, spec, &tried))).map_err(|halt| on_surface(halt, map))
}

/// The maps of a patch up to the first that can be used.
fn tried_maps(context: &Context<'_>, spec: &ChartSpec, patches: &PatchSet, p: usize) -> Step<Vec<Stored<SolvedMap>>> {
    let maps = candidate_maps(&patches.patches[p].0, spec)?;
    let mut tried = Vec::new();
    while let Some(map) = next_map(&maps, &tried) {
        tried.push(solve_step(context, map, patches, p)?);
    }
    Ok(tried)
}

fn solve_step(context: &Context<'_>, map: &MapSpec, patches: &PatchSet, p: usize) -> Step<Stored<SolvedMap>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    let key = StageKey::new(Stage::Solve, |f| {
        f.fingerprint(*fingerprint).text(&format!("{map:?}"));
    });
    let problem = map.problem();
    let factors = || -> Step<Result<(Option<Stored<Kept<ChartFactor>>>, Stored<Kept<BoundaryFactor>>)>> {
        // An operator that cannot be factorized is the end of this map, not of the chart.
        let interior = match problem.family.interior().map(|weights| factor_step(context, weights, patches, p)).transpose() {
            Ok(interior) => interior,
            Err(halt) => return one_map_fails(halt),
        };
        match boundary_step(context, problem, patches, p) {
            Ok(boundary) => Ok(Ok((interior, boundary))),
            Err(halt) => one_map_fails(halt),
        }
    };
    context.staged(key, Subject::Patch(p as u32), factors, |factors, work| match factors {
        Ok((interior, boundary)) => solve_map(patch, interior.as_ref().map(|f| &f.value.output), &boundary.value.output, map, work),
        Err(error) => Ok(unsolved_map(map, &error)),
    })
}

fn one_map_fails<T>(halt: Halt) -> Step<Result<T>> {
    match halt {
        Halt::Error(error) if error.fails_one_map() => Ok(Err(error)),
        halt => Err(halt),
    }
}

fn boundary_step(context: &Context<'_>, problem: ProblemSpec, patches: &PatchSet, p: usize) -> Step<Stored<Kept<BoundaryFactor>>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    // Mean value has no interior to share: its one factorization is the dear one.
    let stage = if problem.family.interior().is_some() { Stage::Boundary } else { Stage::Factor };
    let key = StageKey::new(stage, |f| {
        f.fingerprint(*fingerprint).text(&format!("{problem:?}"));
    });
    let of = key.input;
    let interior = || problem.family.interior().map(|weights| factor_step(context, weights, patches, p)).transpose();
    context.staged(key, Subject::Patch(p as u32), interior, |interior, work| {
        let factor = factor_boundary(patch, interior.as_ref().map(|f| &f.value.output), problem, work)?;
        Ok(Kept { bytes: factor.bytes(), output: factor, of })
    })
}

fn factor_step(context: &Context<'_>, weights: Weights, patches: &PatchSet, p: usize) -> Step<Stored<Kept<ChartFactor>>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    let key = StageKey::new(Stage::Factor, |f| {
        f.fingerprint(*fingerprint).text(&format!("{weights:?}"));
    });
    let of = key.input;
    context.staged(
        key,
        Subject::Patch(p as u32),
        || system_step(context, patches, p),
        |system, work| {
            let factor = factor_system(patch, &system.value.output, weights, work)?;
            Ok(Kept { bytes: factor.bytes(), output: factor, of })
        },
    )
}

/// Keyed by connectivity only, so that it outlives moved vertices.
fn system_step(context: &Context<'_>, patches: &PatchSet, p: usize) -> Step<Stored<Kept<ChartSystem>>> {
    let (patch, ..) = &patches.patches[p];
    let key = StageKey::new(Stage::System, |f| {
        f.u64(patch.positions.len() as u64).tuples(&patch.triangles);
    });
    let of = key.input;
    context.stage(key, Subject::Patch(p as u32), |work| {
        let factor = plan_system(patch, work)?;
        Ok(Kept { bytes: factor.bytes(), output: factor, of })
    })
}
