//! `RemeshService`: the whole pipeline, for a session or in one call.

use super::mesh::write;
use crate::convert::{from_proto, meshers, sizes, sources, to_proto};
use crate::dispatch::{Call, Intent, Weight};
use crate::state::{Shared, Target};
use crate::stream::Watch;
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::pipeline::{self, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::session::{Change, Session, Snapshot};
use remesh_engine::stage::{Outcome, StageRecord};
use remesh_proto::v1;
use remesh_proto::v1::remesh_service_server::RemeshService;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Remeshes(pub(crate) Arc<Shared>);

pub(super) fn remesh_all(shared: &Shared, run: &Run<'_>, snapshot: &Snapshot) -> EngineResult<v1::RemeshResult> {
    let begin = Instant::now();
    let answer = pipeline::quality(&shared.engine, snapshot, QualityScope::Elements, run)?;
    let (remesh, report) = answer.value;
    let mesh = &remesh.result.mesh;
    Ok(v1::RemeshResult {
        mesh: Some(to_proto::mesh_summary(mesh)),
        patches: to_proto::patches_of_result(&mesh.triangles, &remesh.result.face_patch, mesh.positions.len()),
        shape: Some(to_proto::shape(&report.shape)),
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
        warnings: remesh.warnings(snapshot),
        quads: report.quads.as_ref().map(to_proto::quads),
    })
}

pub(super) fn remesh_listed(shared: &Shared, run: &Run<'_>, snapshot: &Snapshot, patches: &[u32]) -> EngineResult<v1::RemeshResult> {
    let begin = Instant::now();
    let answer = pipeline::remesh_patches(&shared.engine, snapshot, patches, run)?;
    let meshes = patches.iter().zip(&answer.value.1).map(|(&patch, mesh)| v1::PatchMeshSummary {
        patch,
        vertices: mesh.positions.len() as u64,
        triangles: mesh.triangles.len() as u64,
    });
    Ok(v1::RemeshResult {
        mesh: None,
        patches: meshes.collect(),
        shape: None,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
        warnings: Vec::new(),
        quads: None,
    })
}

pub(super) fn check_listed(patches: &[u32]) -> EngineResult<()> {
    let mut sorted = patches.to_vec();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(EngineError::bad_parameter("patches", format!("patch {} is listed twice", pair[0]))),
        None => Ok(()),
    }
}

/// The plan of a remesh, of all patches or of those that are listed.
fn plan_remesh(shared: &Shared, run: &Run<'_>, snapshot: &Snapshot, patches: &[u32]) -> EngineResult<Vec<StageRecord>> {
    match patches {
        [] => pipeline::plan_quality(&shared.engine, snapshot, QualityScope::Elements, run),
        listed => pipeline::plan_patches(&shared.engine, snapshot, listed, run),
    }
}

fn plan(shared: &Shared, run: &Run<'_>, target: &Target, request: &v1::PlanRemeshRequest) -> EngineResult<v1::PlanRemeshResponse> {
    let (engine, snapshot) = (&shared.engine, &target.snapshot);
    let goal = v1::PlanGoal::try_from(request.goal).map_err(|_| EngineError::bad_parameter("goal", "is no known goal"))?;
    if !request.patches.is_empty() && !matches!(goal, v1::PlanGoal::Unspecified | v1::PlanGoal::Remesh) {
        return Err(EngineError::bad_parameter("patches", "can be listed for a remesh only"));
    }
    check_listed(&request.patches)?;
    let records = match goal {
        v1::PlanGoal::Unspecified | v1::PlanGoal::Remesh if request.patches.is_empty() => pipeline::plan(engine, snapshot, run)?,
        v1::PlanGoal::Unspecified | v1::PlanGoal::Remesh => pipeline::plan_patches(engine, snapshot, &request.patches, run)?,
        v1::PlanGoal::Partition => pipeline::plan_partition(engine, snapshot, run)?,
        v1::PlanGoal::Charts => pipeline::plan_charts(engine, snapshot, run)?,
        v1::PlanGoal::Quality => pipeline::plan_quality(engine, snapshot, QualityScope::Full, run)?,
    };
    let (stages, hits, runs, estimated_milliseconds) = to_proto::plan(&records);
    let estimated_bytes = records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.bytes).sum();
    Ok(v1::PlanRemeshResponse { revision: target.revision(), stages, hits, runs, estimated_milliseconds, estimated_bytes })
}

/// The inputs of a one-call remesh, as a session would hold them.
fn one_call_inputs(shared: &Shared, request: v1::RemeshMeshRequest) -> EngineResult<Arc<Snapshot>> {
    let engine = &shared.engine;
    if let Some(v1::remesh_mesh_request::Source::Data(data)) = &request.source {
        check_inline(shared, data.len(), "the file")?;
    }
    let size = request.size.ok_or_else(|| EngineError::bad_parameter("size", "is required"))?;
    let mut changes = vec![Change::Size(sizes::size(engine, &size)?)];
    if let Some(spec) = &request.lock {
        changes.push(Change::Lock(sizes::lock(engine, spec)?));
    }
    if let Some(spec) = &request.features {
        changes.push(Change::Features(from_proto::features(engine, spec)?));
    }
    if let Some(spec) = &request.partition {
        changes.push(Change::Partition(from_proto::partition(spec)?));
    }
    if let Some(spec) = &request.charts {
        changes.push(Change::Chart(from_proto::charts(spec)?));
    }
    if let Some(spec) = &request.mesher {
        changes.push(meshers::change(engine, spec)?);
    }
    if let Some(spec) = &request.optimize {
        changes.push(Change::Optimize(from_proto::optimize(spec)?));
    }
    let options = sources::import_options(engine, request.import)?;
    changes.push(Change::Mesh { source: sources::one_call_source(engine, request.source)?, options });
    let inputs = Session::new(String::new(), Duration::ZERO, SystemTime::UNIX_EPOCH);
    inputs.apply(None, &changes)?;
    Ok(inputs.snapshot())
}

fn check_inline(shared: &Shared, bytes: usize, what: &str) -> EngineResult<()> {
    let limit = shared.config.max_inline_bytes;
    if bytes <= limit {
        return Ok(());
    }
    let message = format!("{what} has {bytes} bytes; one message carries {limit}");
    let hint = "use a session: UploadMesh, ImportMesh, RemeshSurface, ExportMesh";
    Err(EngineError::new(Reason::LimitReached, message).with_hint(hint).with_metadata("limit", "max_inline_bytes"))
}

fn one_call(shared: &Shared, run: &Run<'_>, request: v1::RemeshMeshRequest) -> EngineResult<v1::RemeshMeshResponse> {
    let begin = Instant::now();
    let format = from_proto::output_format(request.output_format, "output_format")?;
    let encoding = from_proto::encoding(request.output_encoding, "output_encoding")?;
    let scope = from_proto::scope(request.quality, "quality")?;
    let snapshot = one_call_inputs(shared, request)?;
    let answer = pipeline::quality(&shared.engine, &snapshot, scope, run)?;
    let (remesh, report) = answer.value;
    let written = write(&remesh.result.mesh, Some(&remesh.result.face_patch), remesh.result.quads, format, encoding)?;
    let warnings = remesh.warnings(&snapshot).into_iter().chain(written.warnings).collect();
    check_inline(shared, written.bytes.len(), "the result")?;
    Ok(v1::RemeshMeshResponse {
        data: written.bytes.into(),
        warnings,
        mesh: Some(to_proto::mesh_summary(&remesh.result.mesh)),
        report: Some(to_proto::import_report(&remesh.charts.surface.imported.report)),
        quality: Some(to_proto::quality(&report)),
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    })
}

#[tonic::async_trait]
impl RemeshService for Remeshes {
    type RemeshSurfaceStream = Watch<v1::RemeshSurfaceResponse>;

    async fn remesh_surface(&self, request: Request<v1::RemeshSurfaceRequest>) -> Result<Response<Self::RemeshSurfaceStream>, Status> {
        use v1::remesh_surface_response::Event;
        let mut call = Call::begin(&self.0, "RemeshSurface", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        call.check(check_listed(&request.patches))?;
        let revision = target.revision();
        let wrap = move |event| v1::RemeshSurfaceResponse { revision, event: Some(event) };
        let (planned, listed) = (target.clone(), request.patches.clone());
        let weigh = move |shared: &Shared, run: &Run<'_>| Ok(Intent::of_plan(&plan_remesh(shared, run, &planned.snapshot, &listed)?));
        let weight = Weight::planned(weigh);
        call.watch(
            weight,
            move |progress| wrap(Event::Progress(progress)),
            move |result| wrap(Event::Result(result)),
            move |shared, run| match request.patches.as_slice() {
                [] => remesh_all(shared, run, &target.snapshot),
                listed => remesh_listed(shared, run, &target.snapshot, listed),
            },
        )
    }

    async fn plan_remesh(&self, request: Request<v1::PlanRemeshRequest>) -> Result<Response<v1::PlanRemeshResponse>, Status> {
        let mut call = Call::begin(&self.0, "PlanRemesh", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        call.compute(Intent::Short, move |shared, run| plan(shared, run, &target, &request)).await
    }

    async fn remesh_mesh(&self, request: Request<v1::RemeshMeshRequest>) -> Result<Response<v1::RemeshMeshResponse>, Status> {
        let call = Call::begin(&self.0, "RemeshMesh", &request)?;
        let request = request.into_inner();
        call.compute(Intent::Long, move |shared, run| one_call(shared, run, request)).await
    }
}
