//! `ChartService`: the maps of the patches to the plane.

use super::partition::check_patch;
use crate::convert::{from_proto, to_proto};
use crate::dispatch::{Call, Intent};
use crate::state::{Shared, Target};
use crate::stream::{Chunks, Column, Watch};
use remesh_engine::EngineError;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::parametrize::ChartOutcome;
use remesh_engine::pipeline::{self, Charts, Run};
use remesh_proto::v1;
use remesh_proto::v1::chart_service_server::ChartService;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct ChartMaps(pub(crate) Arc<Shared>);

fn summary_of(charts: &Charts, patch: u32) -> EngineResult<v1::ChartSummary> {
    check_patch(charts, patch)?;
    let chart = charts.chart(patch as usize).ok_or_else(|| EngineError::invariant(format!("patch {patch} has no chart")))?;
    Ok(to_proto::chart_summary(patch, chart, charts.patches.patches[patch as usize].0.triangles.len()))
}

fn parametrize(shared: &Shared, run: &Run<'_>, target: &Target, listed: &[u32]) -> EngineResult<v1::ParametrizeResult> {
    let begin = Instant::now();
    let answer = pipeline::charts(&shared.engine, &target.snapshot, run)?;
    let count = answer.value.charts.len() as u32;
    let all: Vec<u32> = (0..count).collect();
    let wanted = if listed.is_empty() { &all } else { listed };
    Ok(v1::ParametrizeResult {
        charts: wanted.iter().map(|&patch| summary_of(&answer.value, patch)).collect::<EngineResult<_>>()?,
        patches: count,
        splits: answer.value.resplit,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    })
}

const CHART_COLUMNS: [v1::DataColumn; 4] =
    [v1::DataColumn::Uv, v1::DataColumn::Triangles, v1::DataColumn::SourceVertex, v1::DataColumn::SourceFace];

fn uv_of(outcome: &ChartOutcome) -> &[[f64; 2]] {
    match outcome {
        ChartOutcome::Mapped(chart) => &chart.uv,
        ChartOutcome::MustSplit { .. } => &[],
    }
}

fn read(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: &v1::ReadChartDataRequest,
) -> EngineResult<Chunks<v1::ReadChartDataResponse>> {
    use v1::read_chart_data_response::Part;
    let begin = Instant::now();
    let columns = from_proto::columns(&request.columns, &CHART_COLUMNS, &[v1::DataColumn::Uv, v1::DataColumn::Triangles])?;
    let answer = pipeline::charts(&shared.engine, &target.snapshot, run)?;
    let charts = answer.value;
    let chart = summary_of(&charts, request.patch)?;
    let summary = to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3);
    let header = v1::ChartDataHeader { chart: Some(chart), summary: Some(summary) };
    let number = request.patch as usize;
    let (patch, _, map) = charts.patches.patches[number].clone();
    let outcome = charts.charts[number].value.clone();
    let column = move |kind| match kind {
        v1::DataColumn::Triangles => Column::u32s(kind, patch.clone(), |p| &p.triangles),
        v1::DataColumn::SourceVertex => Column::indices(kind, map.clone(), |m| &m.vertices),
        v1::DataColumn::SourceFace => Column::indices(kind, map.clone(), |m| &m.faces),
        _ => Column::f64s(kind, outcome.clone(), uv_of),
    };
    let revision = target.revision();
    let chunks = columns.into_iter().flat_map(move |kind| column(kind).chunks()).map(Part::Chunk);
    let parts = std::iter::once(Part::Header(header)).chain(chunks);
    Ok(Box::new(parts.map(move |part| v1::ReadChartDataResponse { revision, part: Some(part) })))
}

#[tonic::async_trait]
impl ChartService for ChartMaps {
    type ParametrizePatchesStream = Watch<v1::ParametrizePatchesResponse>;

    async fn parametrize_patches(
        &self,
        request: Request<v1::ParametrizePatchesRequest>,
    ) -> Result<Response<Self::ParametrizePatchesStream>, Status> {
        use v1::parametrize_patches_response::Event;
        let mut call = Call::begin(&self.0, "ParametrizePatches", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let revision = target.revision();
        let wrap = move |event| v1::ParametrizePatchesResponse { revision, event: Some(event) };
        call.watch(
            move |progress| wrap(Event::Progress(progress)),
            move |result| wrap(Event::Result(result)),
            move |shared, run| parametrize(shared, run, &target, &request.patches),
        )
    }

    type ReadChartDataStream = Watch<v1::ReadChartDataResponse>;

    async fn read_chart_data(&self, request: Request<v1::ReadChartDataRequest>) -> Result<Response<Self::ReadChartDataStream>, Status> {
        let mut call = Call::begin(&self.0, "ReadChartData", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        call.bulk(Intent::Short, move |shared, run| read(shared, run, &target, &request)).await
    }
}
