//! Size fields and locks over the wire.

use crate::harness::{Daemon, assert_refused, column};
use remesh_proto::v1;
use std::collections::BTreeSet;
use tonic::Code;
use tonic_types::StatusExt;
use v1::change::Change;
use v1::size_field::Field;

fn composed(max_size: f64, fields: Vec<Field>) -> v1::SizeSpec {
    let fields = fields.into_iter().map(|field| v1::SizeField { field: Some(field) }).collect();
    let composed = v1::ComposedSize {
        fields,
        min_size: Some(max_size / 20.0),
        max_size: Some(max_size),
        growth_rate: Some(1.3),
        ..Default::default()
    };
    v1::SizeSpec { size: Some(v1::size_spec::Size::Composed(composed)) }
}

fn on_patch(number: u32, size: f64) -> Field {
    Field::Patch(v1::PatchSize { patch: Some(v1::patch_size::Patch::Number(number)), size })
}

async fn told_size(daemon: &Daemon, session: &str) -> v1::SizeSpec {
    let request = v1::GetSessionRequest { name: session.to_owned() };
    let found = daemon.sessions().get_session(request).await.expect("session").into_inner().session.expect("session");
    found.inputs.expect("inputs").size.expect("size")
}

async fn read(daemon: &Daemon, session: &str, source: v1::MeshSource, kind: v1::DataColumn) -> (v1::MeshDataHeader, Vec<u8>) {
    use v1::read_mesh_data_response::Part;
    let request =
        v1::ReadMeshDataRequest { session: session.to_owned(), source: source.into(), columns: vec![kind.into()], ..Default::default() };
    let mut stream = daemon.meshes().read_mesh_data(request).await.expect("data").into_inner();
    let (mut header, mut chunks) = (None, Vec::new());
    while let Some(message) = stream.message().await.expect("message") {
        match message.part.expect("part") {
            Part::Header(found) => header = Some(found),
            Part::Chunk(chunk) => chunks.push(chunk),
        }
    }
    (header.expect("header"), column(&chunks, kind))
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
}

#[tokio::test]
async fn fields_are_set_told_back_read_and_used() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_000).await;
    let (_, even) = read(&daemon, &session, v1::MeshSource::Input, v1::DataColumn::VertexSize).await;
    let size = numbers(&even)[0];
    let curved = Field::Curvature(v1::CurvatureSize { normal_angle: Some(20.0), deviation: None, smoothing: None });
    let gap = Field::Proximity(v1::ProximitySize { elements_per_gap: 8.0, ..Default::default() });
    let spec = composed(3.0 * size, vec![curved, gap, on_patch(0, 0.5 * size)]);
    assert_eq!(daemon.change(&session, Some(2), Change::Size(spec)).await.expect("set"), 3);
    let Some(v1::size_spec::Size::Composed(told)) = told_size(&daemon, &session).await.size else { panic!("composed") };
    assert_eq!((told.fields.len(), told.max_size), (3, Some(3.0 * size)));
    let Some(Field::Patch(patch)) = &told.fields[2].field else { panic!("{told:?}") };
    assert!(matches!(&patch.patch, Some(v1::patch_size::Patch::Identity(digits)) if digits.len() == 32), "{patch:?}");
    // Told back, it can be set again as it is.
    let again = v1::SizeSpec { size: Some(v1::size_spec::Size::Composed(told)) };
    daemon.change(&session, Some(3), Change::Size(again)).await.expect("set again");
    let result = daemon.remesh(&session).await.expect("remesh");
    let stages: BTreeSet<String> = result.summary.expect("summary").stages.into_iter().map(|s| s.stage).collect();
    assert!(["curvature", "proximity", "size"].iter().all(|s| stages.contains(*s)), "{stages:?}");
    let (header, sizes) = read(&daemon, &session, v1::MeshSource::Result, v1::DataColumn::VertexSize).await;
    let sizes = numbers(&sizes);
    assert_eq!(sizes.len() as u64, header.vertices);
    let (low, high) = (sizes.iter().copied().fold(f64::INFINITY, f64::min), sizes.iter().copied().fold(0.0, f64::max));
    assert!(low <= 0.51 * size && low >= 3.0 * size / 20.0 && high <= 3.0 * size && high > 1.1 * low, "{low} {high} {size}");
}

#[tokio::test]
async fn bad_fields_are_refused_with_their_path() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 300).await;
    let change = |field| Change::Size(composed(1.0, vec![field]));
    let field_of = |status: &tonic::Status| status.get_error_details().bad_request().expect("violations").field_violations[0].field.clone();
    let thin = Field::Thickness(v1::ThicknessSize { elements: -1.0 });
    let status = assert_refused(daemon.change(&session, None, change(thin)).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(field_of(&status), "size.composed.fields[0].thickness.elements");
    let status = assert_refused(daemon.change(&session, None, change(on_patch(0, 0.0))).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(field_of(&status), "size.composed.fields[0].patch.size");
    assert_refused(daemon.change(&session, None, change(on_patch(999, 0.1))).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_refused(daemon.change(&session, Some(0), change(on_patch(0, 0.1))).await, Code::Aborted, "STALE_REVISION");
    // Regions are looked for when sizes are evaluated.
    let region = Field::Region(v1::RegionSize { region: Some(v1::region_size::Region::Name("nowhere".into())), size: 0.1 });
    daemon.change(&session, None, change(region)).await.expect("set");
    assert_refused(daemon.remesh(&session).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn a_locked_boundary_keeps_its_vertices() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 600).await;
    let lock = v1::LockSpec { lock: Some(v1::lock_spec::Lock::Boundary(v1::BoundaryLock {})), count: 0 };
    daemon.change(&session, None, Change::Lock(lock)).await.expect("lock");
    daemon.remesh(&session).await.expect("remesh");
    let positions = |source| {
        let (daemon, session) = (&daemon, &session);
        async move {
            let (_, bytes) = read(daemon, session, source, v1::DataColumn::Positions).await;
            bytes.as_chunks::<24>().0.iter().copied().collect::<BTreeSet<[u8; 24]>>()
        }
    };
    let (_, edges) = read(&daemon, &session, v1::MeshSource::Result, v1::DataColumn::FeatureEdges).await;
    let (input, output) = (positions(v1::MeshSource::Input).await, positions(v1::MeshSource::Result).await);
    let rim = edges.len() / 8;
    assert!(rim > 20 && input.intersection(&output).count() >= rim, "{rim} {}", input.intersection(&output).count());
    let inner = v1::PackedArray { data: Some(v1::packed_array::Data::Inline(vec![0u8, 1, 2].into())) };
    let ragged = v1::LockSpec { lock: Some(v1::lock_spec::Lock::Vertices(inner)), count: 0 };
    assert_refused(daemon.change(&session, None, Change::Lock(ragged)).await, Code::InvalidArgument, "BAD_PARAMETER");
}
