//! The chart spec of one patch: read, changed, taken back, tried and planned.

use super::chart::{ChartData, Coordinates, columns, summary_of};
use super::partition::check_patch;
use crate::answers::Open;
use crate::convert::charts::{self, within};
use crate::convert::to_proto;
use crate::state::{Shared, Target};
use crate::stream::Chunks;
use prost_types::FieldMask;
use remesh_engine::EngineError;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::parametrize::ChartSpec;
use remesh_engine::pipeline::{self, Answer, ChartVerdict, Layout, Run};
use remesh_engine::session::{Change, Pending};
use remesh_engine::stage::Outcome;
use remesh_proto::v1;
use std::sync::Arc;
use std::time::Instant;

fn layout(shared: &Shared, run: &Run<'_>, target: &Target) -> EngineResult<Answer<Layout>> {
    pipeline::layout(&shared.engine, &target.snapshot, run)
}

fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

/// The spec of a patch and its chart.
pub(crate) fn get(shared: &Shared, run: &Run<'_>, target: &Target, patch: u32) -> EngineResult<v1::GetPatchChartResponse> {
    use v1::get_patch_chart_response::Chart;
    let begin = Instant::now();
    let answer = layout(shared, run, target)?;
    let p = check_patch(&answer.value, patch)?;
    let (origin, spec) = charts::origin(answer.value.spec_of(&target.snapshot, p));
    let chart = match summary_of(&answer.value, &target.snapshot, p)? {
        Ok(summary) => Chart::Summary(summary),
        Err(error) => Chart::Error(charts::error(patch, &error)),
    };
    Ok(v1::GetPatchChartResponse {
        revision: target.revision(),
        spec: Some(charts::wire(spec)),
        origin: origin.into(),
        chart: Some(chart),
        run: Some(to_proto::summary(&answer.records, milliseconds(begin))),
    })
}

/// The spec that a request means: the one that the patch follows, with what the request puts in its place. Checked as far as that
/// goes without a map.
fn proposed(
    layout: &Layout,
    target: &Target,
    patch: usize,
    given: Option<v1::ChartSpec>,
    mask: Option<&FieldMask>,
) -> EngineResult<ChartSpec> {
    let (_, current) = charts::origin(layout.spec_of(&target.snapshot, patch));
    let merged = charts::merged(charts::wire(current), given, mask)?;
    let checked = charts::spec(&merged).and_then(|spec| {
        spec.validate()?;
        spec.localised(&layout.patches.patches[patch].2, &layout.surface.imported.mesh.positions)?;
        Ok(spec)
    });
    checked.map_err(|error| within("spec", error))
}

/// Gives a patch a spec of its own.
pub(crate) fn update(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: v1::UpdatePatchChartRequest,
    open: Open,
) -> EngineResult<v1::UpdatePatchChartResponse> {
    let layout = layout(shared, run, target)?.value;
    let p = check_patch(&layout, request.patch)?;
    let spec = proposed(&layout, target, p, request.spec, request.update_mask.as_ref())?;
    let told = charts::wire(&spec);
    let change = Change::PatchChart { patch: layout.patches.identities[p], spec: Some(spec) };
    // On the revision that the number was looked up in: in another one it may be another patch.
    let answer = |made: &Pending| v1::UpdatePatchChartResponse { revision: made.next.revision.0, spec: Some(told) };
    target.apply(Some(target.snapshot.revision), &[change], open, answer)
}

/// Takes the own spec of a patch back.
pub(crate) fn reset(shared: &Shared, run: &Run<'_>, target: &Target, patch: u32, open: Open) -> EngineResult<v1::ResetPatchChartResponse> {
    let layout = layout(shared, run, target)?.value;
    let p = check_patch(&layout, patch)?;
    let identity = layout.patches.identities[p];
    let base = target.snapshot.revision;
    let spec = Some(charts::wire(&target.snapshot.chart));
    if !target.snapshot.patch_charts.contains_key(&identity) {
        return target.unchanged(open, v1::ResetPatchChartResponse { revision: base.0, spec });
    }
    let answer = |made: &Pending| v1::ResetPatchChartResponse { revision: made.next.revision.0, spec };
    target.apply(Some(base), &[Change::PatchChart { patch: identity, spec: None }], open, answer)
}

/// The chart that a patch would have, with its verdict.
pub(crate) fn preview(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: v1::PreviewPatchChartRequest,
) -> EngineResult<Chunks<v1::PreviewPatchChartResponse>> {
    use v1::preview_patch_chart_response::Part;
    let begin = Instant::now();
    let columns = columns(&request.columns)?;
    let propose = |layout: &Layout, p: usize| proposed(layout, target, p, request.spec.clone(), request.update_mask.as_ref());
    let answer = pipeline::preview_chart(&shared.engine, &target.snapshot, request.patch, propose, run)?;
    let (layout, preview) = answer.value;
    let p = check_patch(&layout, request.patch)?;
    let map = &layout.patches.patches[p].2;
    let mut chart = charts::summary(request.patch, map, &preview.attempts, &preview.distortion);
    if preview.uv.is_empty() {
        chart.distortion = None;
    }
    if preview.attempts.is_empty() {
        chart.method = charts::wire(&preview.spec).method;
    }
    let (verdict, error) = match &preview.verdict {
        ChartVerdict::Usable => (v1::ChartVerdict::Usable, None),
        ChartVerdict::MustSplit(reason) => {
            let message = format!("the patch must be split first: {reason}");
            let error = EngineError::new(remesh_engine::error::Reason::ChartFailed, message);
            (v1::ChartVerdict::MustSplit, Some(charts::error(request.patch, &error)))
        }
        ChartVerdict::Refused(error) => (v1::ChartVerdict::Refused, Some(charts::error(request.patch, error))),
    };
    let header = v1::ChartPreviewHeader {
        chart: Some(chart),
        verdict: verdict.into(),
        error,
        has_map: !preview.uv.is_empty(),
        spec: Some(charts::wire(&preview.spec)),
        summary: Some(to_proto::summary(&answer.records, milliseconds(begin))),
    };
    let data = ChartData::new(&layout, p, Coordinates::Points(Arc::new(preview.uv)), &columns);
    let revision = target.revision();
    let parts = std::iter::once(Part::Header(header)).chain(data.chunks(columns).map(Part::Chunk));
    Ok(Box::new(parts.map(move |part| v1::PreviewPatchChartResponse { revision, part: Some(part) })))
}

/// What the charts or a preview would cost.
pub(crate) fn plan(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    preview: Option<v1::ChartProposal>,
) -> EngineResult<v1::PlanChartsResponse> {
    let mut records = pipeline::plan_charts(&shared.engine, &target.snapshot, run)?;
    // Only once the charts are there is it known which patch a number means; then looking it up computes nothing.
    if let Some(proposal) = preview
        && records.iter().all(|r| r.outcome == Outcome::Hit)
    {
        let layout = layout(shared, run, target)?.value;
        let p = check_patch(&layout, proposal.patch)?;
        let spec = proposed(&layout, target, p, proposal.spec, proposal.update_mask.as_ref());
        let spec = spec.map_err(|error| within("preview", error))?;
        records = pipeline::plan_preview(&shared.engine, &target.snapshot, proposal.patch, &spec, run)?;
    }
    let (stages, hits, runs, estimated_milliseconds) = to_proto::plan(&records);
    Ok(v1::PlanChartsResponse { revision: target.revision(), stages, hits, runs, estimated_milliseconds })
}
