//! `PartitionService`: the partition, and single patches of the input.

use super::patch_edit;
use crate::answers::{Open, open_edit};
use crate::convert::{from_proto, patches, to_proto};
use crate::dispatch::{Call, Intent, Weight};
use crate::state::{Shared, Target};
use crate::stream::{Chunks, Column, Watch};
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::partition::PatchRequest;
use remesh_engine::pipeline::{self, Answer, Layout, Partitioned, Run};
use remesh_engine::stage::Outcome;
use remesh_proto::v1;
use remesh_proto::v1::partition_service_server::PartitionService;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Partitions(pub(crate) Arc<Shared>);

/// The place of a patch in the lists of a layout, or the error for one that does not exist.
pub(crate) fn check_patch(layout: &Layout, patch: u32) -> EngineResult<usize> {
    let count = layout.charts.len();
    if (patch as usize) < count {
        return Ok(patch as usize);
    }
    Err(EngineError::new(Reason::PatchNotFound, format!("there is no patch {patch}; the surface has {count}"))
        .with_metadata("patch", patch)
        .with_metadata("patches", count))
}

/// How dear the charts of a session are. Those of a small surface are short work even if nothing of it is there yet: somebody takes a first look.
pub(crate) fn weight_of_layout(target: &Target) -> Weight {
    let target = target.clone();
    Weight::planned(move |shared, run| intent_of_layout(shared, run, &target))
}

fn intent_of_layout(shared: &Shared, run: &Run<'_>, target: &Target) -> EngineResult<Intent> {
    let records = pipeline::plan_charts(&shared.engine, &target.snapshot, run)?;
    let to_run = records.iter().filter(|record| record.outcome == Outcome::Run);
    let estimated: f64 = to_run.map(|record| record.milliseconds).sum();
    Ok(if estimated <= FIRST_LOOK_MILLISECONDS { Intent::Short } else { Intent::of_plan(&records) })
}

/// A plan ends at the first stage whose input is not there, so that of a first look it tells the partition, but not the charts, which take about
/// as long again.
const FIRST_LOOK_MILLISECONDS: f64 = 100.0;

fn partition(shared: &Shared, run: &Run<'_>, target: &Target, with_charts: bool) -> EngineResult<v1::PartitionResult> {
    let begin = Instant::now();
    let snapshot = &target.snapshot;
    // Edits are of patches after all splits that charts ask for.
    let with_charts = with_charts || !snapshot.patch_edits.is_empty();
    let (records, parted, boxes, states) = if with_charts {
        let Answer { value, records } = pipeline::layout(&shared.engine, snapshot, run)?;
        let Layout { surface, features, partition, cut, patches, edits, .. } = value;
        let boxes = patches.patches.iter().map(|(patch, ..)| patch.box_aspect_ratio()).collect();
        (records, Partitioned { surface, features, partition, cut }, boxes, edits)
    } else {
        let Answer { value, records } = pipeline::partition(&shared.engine, snapshot, run)?;
        let boxes = value.box_aspect_ratios(run)?;
        (records, value, boxes, Vec::new())
    };
    let summaries = parted.summaries();
    let numbered = summaries.iter().zip(boxes).enumerate();
    let patches = numbered.map(|(number, (patch, ratio))| to_proto::patch_summary(number, patch, ratio)).collect();
    let (strategy, plane) = to_proto::strategy(parted.partition.strategy);
    let compounds = parted.features.compounds.list.iter().map(|c| patches::compound(&parted.surface.imported.mesh, c)).collect();
    Ok(v1::PartitionResult {
        patches,
        summary: Some(to_proto::summary(&records, begin.elapsed().as_secs_f64() * 1e3)),
        strategy: strategy.into(),
        reason: parted.partition.reason.clone(),
        plane,
        compounds,
        edits: snapshot.patch_edits.iter().zip(&states).map(|(edit, state)| patches::edit_state(edit, state)).collect(),
        with_charts,
    })
}

const PATCH_COLUMNS: [v1::DataColumn; 4] =
    [v1::DataColumn::Positions, v1::DataColumn::Triangles, v1::DataColumn::SourceVertex, v1::DataColumn::SourceFace];

fn read(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: &v1::ReadPatchDataRequest,
) -> EngineResult<Chunks<v1::ReadPatchDataResponse>> {
    use v1::read_patch_data_response::Part;
    let begin = Instant::now();
    let columns = from_proto::columns(&request.columns, &PATCH_COLUMNS, &PATCH_COLUMNS)?;
    let answer = pipeline::layout(&shared.engine, &target.snapshot, run)?;
    let layout = answer.value;
    let number = check_patch(&layout, request.patch)?;
    let (patch, _, map) = &layout.patches.patches[number];
    let header = v1::PatchDataHeader {
        patch: layout.summaries().get(number).map(|summary| to_proto::patch_summary(number, summary, patch.box_aspect_ratio())),
        vertices: patch.positions.len() as u64,
        faces: patch.triangles.len() as u64,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    };
    let (patch, map) = (patch.clone(), map.clone());
    let column = move |kind| match kind {
        v1::DataColumn::Triangles => Column::u32s(kind, patch.clone(), |p| &p.triangles),
        v1::DataColumn::SourceVertex => Column::indices(kind, map.clone(), |m| &m.named),
        v1::DataColumn::SourceFace => Column::indices(kind, map.clone(), |m| &m.faces),
        _ => Column::f64s(kind, patch.clone(), |p| &p.positions),
    };
    let revision = target.revision();
    let chunks = columns.into_iter().flat_map(move |kind| column(kind).chunks()).map(Part::Chunk);
    let parts = std::iter::once(Part::Header(header)).chain(chunks);
    Ok(Box::new(parts.map(move |part| v1::ReadPatchDataResponse { revision, part: Some(part) })))
}

#[tonic::async_trait]
impl PartitionService for Partitions {
    type PartitionSurfaceStream = Watch<v1::PartitionSurfaceResponse>;

    async fn partition_surface(
        &self,
        request: Request<v1::PartitionSurfaceRequest>,
    ) -> Result<Response<Self::PartitionSurfaceStream>, Status> {
        use v1::partition_surface_response::Event;
        let mut call = Call::begin(&self.0, "PartitionSurface", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let revision = target.revision();
        let wrap = move |event| v1::PartitionSurfaceResponse { revision, event: Some(event) };
        let (planned, with_charts) = (target.clone(), request.with_charts);
        let weigh = move |shared: &Shared, run: &Run<'_>| {
            let plan = if with_charts { pipeline::plan_charts } else { pipeline::plan_partition };
            Ok(Intent::of_plan(&plan(&shared.engine, &planned.snapshot, run)?))
        };
        let weight = Weight::planned(weigh);
        call.watch(
            weight,
            move |progress| wrap(Event::Progress(progress)),
            move |result| wrap(Event::Result(result)),
            move |shared, run| partition(shared, run, &target, request.with_charts),
        )
    }

    type ReadPatchDataStream = Watch<v1::ReadPatchDataResponse>;

    async fn read_patch_data(&self, request: Request<v1::ReadPatchDataRequest>) -> Result<Response<Self::ReadPatchDataStream>, Status> {
        let mut call = Call::begin(&self.0, "ReadPatchData", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let weight = weight_of_layout(&target);
        call.bulk(weight, move |shared, run| read(shared, run, &target, &request)).await
    }

    async fn split_patch(&self, request: Request<v1::SplitPatchRequest>) -> Result<Response<v1::SplitPatchResponse>, Status> {
        let mut call = Call::begin(&self.0, "SplitPatch", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        edit(call, target, open, move |_| patches::split(&request)).await
    }

    async fn merge_patches(&self, request: Request<v1::MergePatchesRequest>) -> Result<Response<v1::MergePatchesResponse>, Status> {
        let mut call = Call::begin(&self.0, "MergePatches", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        edit(call, target, open, move |_| Ok(patches::merge(&request))).await
    }

    async fn reassign_faces(&self, request: Request<v1::ReassignFacesRequest>) -> Result<Response<v1::ReassignFacesResponse>, Status> {
        let mut call = Call::begin(&self.0, "ReassignFaces", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        edit(call, target, open, move |shared| patches::reassign(&shared.engine, &request)).await
    }

    async fn reset_patches(&self, request: Request<v1::ResetPatchesRequest>) -> Result<Response<v1::ResetPatchesResponse>, Status> {
        let mut call = Call::begin(&self.0, "ResetPatches", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        call.compute(Intent::Short, move |_, _| patch_edit::reset(&target, open)).await
    }
}

/// Carries an edit out on the pool. It maps the patches that it makes, so it counts as long.
async fn edit<T: From<patch_edit::Edited> + prost::Message + 'static>(
    call: Call,
    target: Target,
    open: Open,
    wanted: impl FnOnce(&Shared) -> EngineResult<PatchRequest> + Send + 'static,
) -> Result<Response<T>, Status> {
    call.compute(Intent::Long, move |shared, run| {
        let request = wanted(shared)?;
        patch_edit::edit(shared, run, &target, &request, open)
    })
    .await
}
