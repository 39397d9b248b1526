//! `PartitionService`: the partition, and single patches of the input.

use crate::convert::{from_proto, to_proto};
use crate::dispatch::{Call, Intent};
use crate::state::{Shared, Target};
use crate::stream::{Chunks, Column, Watch};
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::pipeline::{self, Layout, Run};
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

/// How dear the charts of a session are.
pub(crate) fn weight_of_layout(shared: &Shared, run: &Run<'_>, target: &Target) -> EngineResult<Intent> {
    Ok(Intent::of_plan(&pipeline::plan_charts(&shared.engine, &target.snapshot, run)?))
}

fn partition(shared: &Shared, run: &Run<'_>, target: &Target) -> EngineResult<v1::PartitionResult> {
    let begin = Instant::now();
    let answer = pipeline::partition_and_boxes(&shared.engine, &target.snapshot, run)?;
    let (partitioned, boxes) = answer.value;
    let numbered = partitioned.summaries().iter().zip(boxes).enumerate();
    let patches = numbered.map(|(number, (patch, ratio))| to_proto::patch_summary(number, patch, ratio)).collect();
    let (strategy, plane) = to_proto::strategy(partitioned.partition.strategy);
    Ok(v1::PartitionResult {
        patches,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
        strategy: strategy.into(),
        reason: partitioned.partition.reason.clone(),
        plane,
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
        call.watch(
            move |progress| wrap(Event::Progress(progress)),
            move |result| wrap(Event::Result(result)),
            move |shared, run| partition(shared, run, &target),
        )
    }

    type ReadPatchDataStream = Watch<v1::ReadPatchDataResponse>;

    async fn read_patch_data(&self, request: Request<v1::ReadPatchDataRequest>) -> Result<Response<Self::ReadPatchDataStream>, Status> {
        let mut call = Call::begin(&self.0, "ReadPatchData", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let planned = target.clone();
        let intent = call.weigh(move |shared, run| weight_of_layout(shared, run, &planned)).await;
        call.bulk(intent, move |shared, run| read(shared, run, &target, &request)).await
    }
}
