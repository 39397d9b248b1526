//! `ChartService`: the maps of the patches to the plane. What is about the spec of one patch is in `patch_chart`.

use super::partition::{check_patch, weight_of_layout};
use super::patch_chart;
use crate::answers::open_edit;
use crate::convert::{charts, from_proto, to_proto};
use crate::dispatch::{Call, Intent};
use crate::state::{Shared, Target};
use crate::stream::{Chunks, Column, Watch};
use remesh_engine::EngineError;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::parametrize::{ChartOutcome, FaceDistortion, face_distortion};
use remesh_engine::patch::{Patch, PatchMap};
use remesh_engine::pipeline::{self, Layout, Run};
use remesh_engine::session::Snapshot;
use remesh_proto::v1;
use remesh_proto::v1::chart_service_server::ChartService;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct ChartMaps(pub(crate) Arc<Shared>);

/// The numbers of the chart of a patch; the inner error is what is wrong with its own spec.
pub(crate) fn summary_of(layout: &Layout, snapshot: &Snapshot, patch: usize) -> EngineResult<Result<v1::ChartSummary, EngineError>> {
    let outcome = match &layout.charts[patch] {
        Ok(outcome) => outcome,
        Err(error) => return Ok(Err(error.clone())),
    };
    let ChartOutcome::Mapped(chart) = &*outcome.value else {
        return Err(EngineError::invariant(format!("patch {patch} has no chart")));
    };
    let map = &layout.patches.patches[patch].2;
    let origin = charts::origin(layout.spec_of(snapshot, patch)).0.into();
    let summary = charts::summary(patch as u32, map, &chart.attempts, &chart.distortion);
    Ok(Ok(v1::ChartSummary { origin, ..summary }))
}

fn parametrize(shared: &Shared, run: &Run<'_>, target: &Target, listed: &[u32]) -> EngineResult<v1::ParametrizeResult> {
    let begin = Instant::now();
    let answer = pipeline::layout(&shared.engine, &target.snapshot, run)?;
    let layout = &answer.value;
    let wanted: Vec<usize> = match listed {
        [] => (0..layout.charts.len()).collect(),
        listed => listed.iter().map(|&patch| check_patch(layout, patch)).collect::<EngineResult<_>>()?,
    };
    let mut result = v1::ParametrizeResult { patches: layout.charts.len() as u32, splits: layout.resplit, ..Default::default() };
    for patch in wanted {
        match summary_of(layout, &target.snapshot, patch)? {
            Ok(summary) => result.charts.push(summary),
            Err(error) => result.failures.push(charts::error(patch as u32, &error)),
        }
    }
    result.summary = Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3));
    Ok(result)
}

const CHART_COLUMNS: [v1::DataColumn; 9] = [
    v1::DataColumn::Uv,
    v1::DataColumn::Positions,
    v1::DataColumn::Triangles,
    v1::DataColumn::SourceVertex,
    v1::DataColumn::SourceFace,
    v1::DataColumn::FaceAngleDistortion,
    v1::DataColumn::FaceAreaDistortion,
    v1::DataColumn::FaceStretch,
    v1::DataColumn::FaceFlipped,
];

/// The columns of a chart that are asked for.
pub(crate) fn columns(numbers: &[i32]) -> EngineResult<Vec<v1::DataColumn>> {
    from_proto::columns(numbers, &CHART_COLUMNS, &[v1::DataColumn::Uv, v1::DataColumn::Triangles])
}

/// Where the plane coordinates of a chart are kept.
pub(crate) enum Coordinates {
    /// In the output of the chart stage.
    Outcome(Arc<ChartOutcome>),
    /// By themselves; empty if there is no map.
    Points(Arc<Vec<[f64; 2]>>),
}

impl Coordinates {
    /// One for each vertex, or none.
    pub(crate) fn points(&self) -> &[[f64; 2]] {
        match self {
            Coordinates::Points(points) => points,
            Coordinates::Outcome(outcome) => match &**outcome {
                ChartOutcome::Mapped(chart) => &chart.uv,
                ChartOutcome::MustSplit { .. } | ChartOutcome::Refused(_) => &[],
            },
        }
    }
}

/// What the columns of a chart are made of.
pub(crate) struct ChartData {
    patch: Arc<Patch>,
    map: Arc<PatchMap>,
    uv: Coordinates,
    /// Empty if no column needs it or there is no map.
    faces: Vec<FaceDistortion>,
    flipped: Vec<u32>,
}

impl ChartData {
    /// The data of a patch and a map of it, with as much as `columns` need.
    pub(crate) fn new(layout: &Layout, patch: usize, uv: Coordinates, columns: &[v1::DataColumn]) -> Arc<ChartData> {
        use v1::DataColumn::{FaceAngleDistortion, FaceAreaDistortion, FaceFlipped, FaceStretch};
        let (patch, _, map) = layout.patches.patches[patch].clone();
        let needs_faces = columns.iter().any(|c| matches!(c, FaceAngleDistortion | FaceAreaDistortion | FaceFlipped | FaceStretch));
        let faces = if needs_faces { face_distortion(&patch, uv.points()) } else { Vec::new() };
        let flipped = faces.iter().map(|face| u32::from(face.area <= 0.0)).collect();
        Arc::new(ChartData { patch, map, uv, faces, flipped })
    }

    fn faces(self: &Arc<Self>, kind: v1::DataColumn, value: fn(&FaceDistortion) -> f64) -> Column {
        let held = self.clone();
        Column::computed(kind, held.faces.len(), move |face| value(&held.faces[face]))
    }

    fn column(self: &Arc<Self>, kind: v1::DataColumn) -> Column {
        let held = self.clone();
        match kind {
            v1::DataColumn::Positions => Column::f64s(kind, held, |d: &ChartData| &d.patch.positions),
            v1::DataColumn::Triangles => Column::u32s(kind, held, |d: &ChartData| &d.patch.triangles),
            v1::DataColumn::SourceVertex => Column::indices(kind, held, |d: &ChartData| &d.map.named),
            v1::DataColumn::SourceFace => Column::indices(kind, held, |d: &ChartData| &d.map.faces),
            v1::DataColumn::FaceAngleDistortion => self.faces(kind, |face| face.angle),
            v1::DataColumn::FaceAreaDistortion => self.faces(kind, |face| face.area),
            v1::DataColumn::FaceStretch => self.faces(kind, |face| face.stretch),
            v1::DataColumn::FaceFlipped => Column::indices(kind, held, |d: &ChartData| &d.flipped),
            _ => Column::f64s(kind, held, |d: &ChartData| d.uv.points()),
        }
    }

    /// The pieces of the columns, in order.
    pub(crate) fn chunks(self: Arc<Self>, columns: Vec<v1::DataColumn>) -> impl Iterator<Item = v1::DataChunk> + Send {
        columns.into_iter().flat_map(move |kind| self.column(kind).chunks())
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
    let columns = columns(&request.columns)?;
    let answer = pipeline::layout(&shared.engine, &target.snapshot, run)?;
    let layout = answer.value;
    let patch = check_patch(&layout, request.patch)?;
    let chart = summary_of(&layout, &target.snapshot, patch)??;
    let outcome = layout.charts[patch].as_ref().map_err(Clone::clone)?.value.clone();
    let data = ChartData::new(&layout, patch, Coordinates::Outcome(outcome), &columns);
    let summary = to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3);
    let header = v1::ChartDataHeader { chart: Some(chart), summary: Some(summary) };
    let revision = target.revision();
    let parts = std::iter::once(Part::Header(header)).chain(data.chunks(columns).map(Part::Chunk));
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
        let weight = weight_of_layout(&target);
        call.watch(
            weight,
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
        let weight = weight_of_layout(&target);
        call.bulk(weight, move |shared, run| read(shared, run, &target, &request)).await
    }

    async fn get_patch_chart(&self, request: Request<v1::GetPatchChartRequest>) -> Result<Response<v1::GetPatchChartResponse>, Status> {
        let mut call = Call::begin(&self.0, "GetPatchChart", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let weight = weight_of_layout(&target);
        call.compute(weight, move |shared, run| patch_chart::get(shared, run, &target, request.patch)).await
    }

    async fn update_patch_chart(
        &self,
        request: Request<v1::UpdatePatchChartRequest>,
    ) -> Result<Response<v1::UpdatePatchChartResponse>, Status> {
        let mut call = Call::begin(&self.0, "UpdatePatchChart", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        let weight = weight_of_layout(&target);
        call.compute(weight, move |shared, run| patch_chart::update(shared, run, &target, request, open)).await
    }

    async fn reset_patch_chart(
        &self,
        request: Request<v1::ResetPatchChartRequest>,
    ) -> Result<Response<v1::ResetPatchChartResponse>, Status> {
        let mut call = Call::begin(&self.0, "ResetPatchChart", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        let weight = weight_of_layout(&target);
        call.compute(weight, move |shared, run| patch_chart::reset(shared, run, &target, request.patch, open)).await
    }

    type PreviewPatchChartStream = Watch<v1::PreviewPatchChartResponse>;

    async fn preview_patch_chart(
        &self,
        request: Request<v1::PreviewPatchChartRequest>,
    ) -> Result<Response<Self::PreviewPatchChartStream>, Status> {
        let mut call = Call::begin(&self.0, "PreviewPatchChart", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        // Previews follow a hand that drags: one patch at a time does not wait for long work, unless everything is still to be done.
        let weight = weight_of_layout(&target);
        call.bulk(weight, move |shared, run| patch_chart::preview(shared, run, &target, request)).await
    }

    async fn plan_charts(&self, request: Request<v1::PlanChartsRequest>) -> Result<Response<v1::PlanChartsResponse>, Status> {
        let mut call = Call::begin(&self.0, "PlanCharts", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        call.compute(Intent::Short, move |shared, run| patch_chart::plan(shared, run, &target, request.preview)).await
    }
}
