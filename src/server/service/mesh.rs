//! `MeshService`: meshes in and out of a session.

use super::upload::{missing, receive};
use crate::answers::{Open, open_edit};
use crate::convert::from_proto::{self, WhichMesh};
use crate::convert::{sources, to_proto};
use crate::dispatch::{Call, Intent, Weight};
use crate::state::{Shared, Target, blob_name};
use crate::stream::{Chunks, Column, Watch, file_pieces};
use remesh_engine::error::Result as EngineResult;
use remesh_engine::export::{Encoding, Exported, FaceData, export_mesh};
use remesh_engine::import::Format;
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::optimize::Remeshed;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::session::{Change, Revision, Snapshot};
use remesh_engine::stage::{Stage, StageRecord};
use remesh_engine::vector::kappa;
use remesh_proto::v1;
use remesh_proto::v1::mesh_service_server::MeshService;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Request, Response, Status, Streaming};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Meshes(pub(crate) Arc<Shared>);

fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

fn import(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: v1::ImportMeshRequest,
    open: Open,
) -> EngineResult<v1::ImportMeshResponse> {
    let begin = Instant::now();
    let options = sources::import_options(&shared.engine, request.options)?;
    let source = sources::import_source(&shared.engine, request.source)?;
    let mut candidate = Snapshot::clone(&target.snapshot);
    candidate.source = Some(source.clone());
    candidate.import = options.clone();
    // Imported before it becomes a revision: a file that cannot be read leaves the session as it was.
    shared.check_faces(&target.desk, 0)?;
    let answer = pipeline::import(&shared.engine, &candidate, run)?;
    shared.check_faces(&target.desk, answer.value.mesh.triangles.len() as u64)?;
    let mesh = to_proto::mesh_summary(&answer.value.mesh);
    target.desk.note_mesh(&candidate, mesh.clone());
    let response = v1::ImportMeshResponse {
        revision: 0,
        mesh: Some(mesh),
        report: Some(to_proto::import_report(&answer.value.report)),
        diagnosis: Some(to_proto::diagnosis(&answer.value.diagnosis)),
        summary: Some(to_proto::summary(&answer.records, milliseconds(begin))),
    };
    target.apply(request.base_revision.map(Revision), &[Change::Mesh { source, options }], open, |made| v1::ImportMeshResponse {
        revision: made.next.revision.0,
        ..response
    })
}

/// A mesh of a session, computed if it is not cached.
enum Picked {
    Input(remesh_engine::stage::Stored<remesh_engine::import::Imported>),
    Result(remesh_engine::stage::Stored<Remeshed>),
}

impl Picked {
    /// Number of quadrangles whose halves come first.
    fn quads(&self) -> u32 {
        match self {
            Picked::Input(_) => 0,
            Picked::Result(remeshed) => remeshed.quads,
        }
    }

    fn mesh(&self) -> &SurfaceMesh {
        match self {
            Picked::Input(imported) => &imported.mesh,
            Picked::Result(remeshed) => &remeshed.mesh,
        }
    }
}

fn pick(shared: &Shared, run: &Run<'_>, target: &Target, which: WhichMesh) -> EngineResult<(Picked, Vec<StageRecord>)> {
    match which {
        WhichMesh::Result => {
            let answer = pipeline::remesh(&shared.engine, &target.snapshot, run)?;
            Ok((Picked::Result(answer.value.result), answer.records))
        }
        WhichMesh::Input => {
            let answer = pipeline::import(&shared.engine, &target.snapshot, run)?;
            Ok((Picked::Input(answer.value), answer.records))
        }
    }
}

/// How dear a mesh of a session is.
fn weight(shared: &Shared, run: &Run<'_>, target: &Target, which: WhichMesh) -> EngineResult<Intent> {
    match which {
        WhichMesh::Result => Ok(Intent::of_plan(&pipeline::plan(&shared.engine, &target.snapshot, run)?)),
        WhichMesh::Input => {
            let records = pipeline::plan_charts(&shared.engine, &target.snapshot, run)?;
            Ok(Intent::of_plan(records.iter().filter(|record| record.stage == Stage::Import)))
        }
    }
}

fn needs_charts(columns: &[v1::DataColumn]) -> bool {
    [v1::DataColumn::FacePatch, v1::DataColumn::FeatureEdges, v1::DataColumn::VertexSize].iter().any(|kind| columns.contains(kind))
}

fn mesh_columns(request: &v1::ReadMeshDataRequest) -> EngineResult<Vec<v1::DataColumn>> {
    from_proto::columns(&request.columns, &MESH_COLUMNS, &[v1::DataColumn::Positions, v1::DataColumn::Triangles])
}

fn weight_of_data(shared: &Shared, run: &Run<'_>, target: &Target, request: &v1::ReadMeshDataRequest) -> EngineResult<Intent> {
    match from_proto::which_mesh(request.source)? {
        WhichMesh::Input if needs_charts(&mesh_columns(request)?) => {
            Ok(Intent::of_plan(&pipeline::plan_charts(&shared.engine, &target.snapshot, run)?))
        }
        which => weight(shared, run, target, which),
    }
}

/// Kappa of a face; rounding may not take it above 1.
fn face_kappa(mesh: &SurfaceMesh, face: usize) -> f64 {
    let [a, b, c] = mesh.corners(face);
    kappa(a, b, c).min(1.0)
}

/// Writes a mesh with what the format has a place for.
pub(crate) fn write(mesh: &SurfaceMesh, patch: Option<&[u32]>, quads: u32, format: Format, encoding: Encoding) -> EngineResult<Exported> {
    let kappas: Option<Vec<f64>> = (format == Format::Vtu).then(|| (0..mesh.triangles.len()).map(|f| face_kappa(mesh, f)).collect());
    export_mesh(mesh, FaceData { patch, kappa: kappas.as_deref(), quads }, format, encoding)
}

fn export(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: &v1::ExportMeshRequest,
) -> EngineResult<Chunks<v1::ExportMeshResponse>> {
    use v1::export_mesh_response::Part;
    let begin = Instant::now();
    let format = from_proto::output_format(request.format, "format")?;
    let encoding = from_proto::encoding(request.encoding, "encoding")?;
    let (picked, records) = pick(shared, run, target, from_proto::which_mesh(request.source)?)?;
    let patch = match &picked {
        Picked::Result(remeshed) => Some(remeshed.face_patch.as_slice()),
        Picked::Input(_) => None,
    };
    let written = write(picked.mesh(), patch, picked.quads(), format, encoding)?;
    let header = v1::ExportHeader {
        total_bytes: written.bytes.len() as u64,
        warnings: written.warnings,
        vertices: picked.mesh().positions.len() as u64,
        faces: picked.mesh().triangles.len() as u64,
        quads: picked.quads().into(),
        summary: Some(to_proto::summary(&records, milliseconds(begin))),
    };
    let revision = target.revision();
    let parts = std::iter::once(Part::Header(header)).chain(file_pieces(written.bytes.into()).map(Part::Data));
    Ok(Box::new(parts.map(move |part| v1::ExportMeshResponse { revision, part: Some(part) })))
}

const MESH_COLUMNS: [v1::DataColumn; 7] = [
    v1::DataColumn::Positions,
    v1::DataColumn::Triangles,
    v1::DataColumn::FacePatch,
    v1::DataColumn::FaceRegion,
    v1::DataColumn::FaceKappa,
    v1::DataColumn::FeatureEdges,
    v1::DataColumn::VertexSize,
];

/// Edges marked as features, as vertex pairs.
fn feature_edges(layout: &pipeline::Layout) -> Vec<[u32; 2]> {
    let topology = &layout.surface.topology;
    let marked = (0..topology.halfedge_count() as u32).filter(|&h| layout.features.is_feature[h as usize]);
    marked.filter(|&h| topology.is_edge_representative(h)).map(|h| [topology.origin(h), topology.target(h)]).collect()
}

/// What the columns of a mesh are made of.
struct MeshData {
    mesh: Picked,
    face_patch: Vec<u32>,
    feature_edges: Vec<[u32; 2]>,
    sizes: Vec<[f64; 1]>,
}

impl MeshData {
    fn column(self: &Arc<Self>, kind: v1::DataColumn) -> Column {
        let held = self.clone();
        match kind {
            v1::DataColumn::Triangles => Column::u32s(kind, held, |d: &MeshData| &d.mesh.mesh().triangles),
            v1::DataColumn::FacePatch => Column::indices(kind, held, |d: &MeshData| match &d.mesh {
                Picked::Result(remeshed) => &remeshed.face_patch,
                Picked::Input(_) => &d.face_patch,
            }),
            v1::DataColumn::FaceRegion => Column::indices(kind, held, |d: &MeshData| &d.mesh.mesh().face_region),
            v1::DataColumn::FaceKappa => {
                let faces = held.mesh.mesh().triangles.len();
                Column::computed(kind, faces, move |face| face_kappa(held.mesh.mesh(), face))
            }
            v1::DataColumn::FeatureEdges => Column::u32s(kind, held, |d: &MeshData| match &d.mesh {
                Picked::Result(remeshed) => &remeshed.curve_edges,
                Picked::Input(_) => &d.feature_edges,
            }),
            v1::DataColumn::VertexSize => Column::f64s(kind, held, |d: &MeshData| &d.sizes),
            _ => Column::f64s(kind, held, |d: &MeshData| &d.mesh.mesh().positions),
        }
    }
}

fn read(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: &v1::ReadMeshDataRequest,
) -> EngineResult<Chunks<v1::ReadMeshDataResponse>> {
    use v1::read_mesh_data_response::Part;
    let begin = Instant::now();
    let columns = mesh_columns(request)?;
    let which = from_proto::which_mesh(request.source)?;
    let (mesh, mut records) = pick(shared, run, target, which)?;
    let mut data = MeshData { mesh, face_patch: Vec::new(), feature_edges: Vec::new(), sizes: Vec::new() };
    let wants = |kind| columns.contains(&kind);
    if which == WhichMesh::Input && needs_charts(&columns) {
        let answer = pipeline::layout(&shared.engine, &target.snapshot, run)?;
        data.face_patch = answer.value.partition.face_patch.clone();
        data.feature_edges = feature_edges(&answer.value);
        records = answer.records;
    }
    if wants(v1::DataColumn::VertexSize) {
        let sizes = match which {
            WhichMesh::Input => pipeline::sizes(&shared.engine, &target.snapshot, run)?.value.vertex_size.clone(),
            WhichMesh::Result => pipeline::sizes_of_result(&shared.engine, &target.snapshot, run)?.value,
        };
        data.sizes = sizes.into_iter().map(|size| [size]).collect();
    }
    let feature_edges = match &data.mesh {
        Picked::Result(remeshed) => remeshed.curve_edges.len(),
        Picked::Input(_) => data.feature_edges.len(),
    };
    let mesh = data.mesh.mesh();
    let header = v1::MeshDataHeader {
        vertices: mesh.positions.len() as u64,
        faces: mesh.triangles.len() as u64,
        quads: data.mesh.quads().into(),
        feature_edges: if wants(v1::DataColumn::FeatureEdges) { feature_edges as u64 } else { 0 },
        regions: to_proto::regions(&mesh.regions),
        unit: to_proto::unit(mesh.unit).into(),
        summary: Some(to_proto::summary(&records, milliseconds(begin))),
    };
    let revision = target.revision();
    let data = Arc::new(data);
    let chunks = columns.into_iter().flat_map(move |kind| data.column(kind).chunks()).map(Part::Chunk);
    let parts = std::iter::once(Part::Header(header)).chain(chunks);
    Ok(Box::new(parts.map(move |part| v1::ReadMeshDataResponse { revision, part: Some(part) })))
}

fn diagnose(shared: &Shared, run: &Run<'_>, target: &Target) -> EngineResult<v1::DiagnoseMeshResponse> {
    let begin = Instant::now();
    let answer = pipeline::diagnose(&shared.engine, &target.snapshot, run)?;
    Ok(v1::DiagnoseMeshResponse {
        revision: target.revision(),
        diagnosis: Some(to_proto::diagnosis(&answer.value)),
        summary: Some(to_proto::summary(&answer.records, milliseconds(begin))),
    })
}

#[tonic::async_trait]
impl MeshService for Meshes {
    async fn upload_mesh(&self, request: Request<Streaming<v1::UploadMeshRequest>>) -> Result<Response<v1::UploadMeshResponse>, Status> {
        let call = Call::begin(&self.0, "UploadMesh", &request)?;
        let upload = match receive(&self.0, call.caller(), call.client(), request.into_inner()).await {
            Ok(upload) => upload,
            Err(fault) => return call.finish(Err(fault)),
        };
        let bytes = upload.file.bytes();
        let client = call.client().clone();
        let finish = move |shared: &Shared, _: &Run<'_>| {
            let finished = upload.file.finish(shared, upload.expected.as_deref());
            if let Ok(blob) = &finished {
                shared.keeper.charges.sent(&client, (blob.digest.clone(), bytes), shared.config.clock.now());
            }
            Ok(finished)
        };
        let (call, stored) = call.on_pool(Intent::Short, finish).await;
        let response = stored.and_then(|finished| finished).map(|blob| v1::UploadMeshResponse { blob: blob_name(&blob.digest), bytes });
        call.finish(response)
    }

    async fn find_missing_blobs(
        &self,
        request: Request<v1::FindMissingBlobsRequest>,
    ) -> Result<Response<v1::FindMissingBlobsResponse>, Status> {
        let call = Call::begin(&self.0, "FindMissingBlobs", &request)?;
        let caller = call.caller().clone();
        call.on_disk(move |shared| missing(shared, &caller, &request.into_inner().digests)).await
    }

    async fn import_mesh(&self, request: Request<v1::ImportMeshRequest>) -> Result<Response<v1::ImportMeshResponse>, Status> {
        let mut call = Call::begin(&self.0, "ImportMesh", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        call.compute(Intent::Long, move |shared, run| import(shared, run, &target, request, open)).await
    }

    async fn diagnose_mesh(&self, request: Request<v1::DiagnoseMeshRequest>) -> Result<Response<v1::DiagnoseMeshResponse>, Status> {
        let mut call = Call::begin(&self.0, "DiagnoseMesh", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let planned = target.clone();
        let weight = Weight::planned(move |shared, run| weight(shared, run, &planned, WhichMesh::Input));
        call.compute(weight, move |shared, run| diagnose(shared, run, &target)).await
    }

    type ExportMeshStream = Watch<v1::ExportMeshResponse>;

    async fn export_mesh(&self, request: Request<v1::ExportMeshRequest>) -> Result<Response<Self::ExportMeshStream>, Status> {
        let mut call = Call::begin(&self.0, "ExportMesh", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let (planned, source) = (target.clone(), request.source);
        let weight = Weight::planned(move |shared, run| weight(shared, run, &planned, from_proto::which_mesh(source)?));
        call.bulk(weight, move |shared, run| export(shared, run, &target, &request)).await
    }

    type ReadMeshDataStream = Watch<v1::ReadMeshDataResponse>;

    async fn read_mesh_data(&self, request: Request<v1::ReadMeshDataRequest>) -> Result<Response<Self::ReadMeshDataStream>, Status> {
        let mut call = Call::begin(&self.0, "ReadMeshData", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let planned = (target.clone(), request.clone());
        let weight = Weight::planned(move |shared, run| weight_of_data(shared, run, &planned.0, &planned.1));
        call.bulk(weight, move |shared, run| read(shared, run, &target, &request)).await
    }
}
