//! Files and arrays in and out: what goes in comes out.

use crate::harness::{Daemon, assert_refused, column};
use remesh_proto::v1;
use remesh_proto::v1::import_mesh_request::Source;
use std::collections::HashMap;
use tonic::{Code, Status};

/// A unit sphere: an octahedron whose faces are cut in four `times` times.
fn sphere_off(times: u32) -> String {
    let mut points: Vec<[f64; 3]> = vec![[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
    let mut faces: Vec<[usize; 3]> = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..times {
        let mut middles = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let mut middle = |p: usize, q: usize| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let sum: [f64; 3] = std::array::from_fn(|k| points[p][k] + points[q][k]);
                    let norm = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                    points.push(sum.map(|x| x / norm));
                    points.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = finer;
    }
    let mut text = format!("OFF\n{} {} 0\n", points.len(), faces.len());
    points.iter().for_each(|[x, y, z]| text.push_str(&format!("{x:?} {y:?} {z:?}\n")));
    faces.iter().for_each(|[a, b, c]| text.push_str(&format!("3 {a} {b} {c}\n")));
    text
}

pub(crate) async fn upload(daemon: &Daemon, parts: Vec<v1::UploadMeshRequest>) -> Result<v1::UploadMeshResponse, Status> {
    daemon.meshes().upload_mesh(tokio_stream::iter(parts)).await.map(tonic::Response::into_inner)
}

fn parts(file: &[u8], size: usize) -> Vec<v1::UploadMeshRequest> {
    file.chunks(size).map(|piece| v1::UploadMeshRequest { data: piece.to_vec().into(), ..Default::default() }).collect()
}

#[tokio::test]
async fn equal_uploads_have_equal_names_and_digests_are_checked() {
    let daemon = Daemon::usual().await;
    let file = sphere_off(3);
    let one = upload(&daemon, parts(file.as_bytes(), 1000)).await.expect("upload");
    let mut again = parts(file.as_bytes(), 777);
    again[0].total_bytes = Some(file.len() as u64);
    again[0].expected_digest = one.blob.strip_prefix("blobs/").expect("name").to_uppercase();
    assert_eq!(upload(&daemon, again.clone()).await.expect("upload"), one);
    again[0].expected_digest = "00".repeat(32);
    assert_refused(upload(&daemon, again.clone()).await, Code::InvalidArgument, "DIGEST_MISMATCH");
    again[0].total_bytes = Some(3);
    assert_refused(upload(&daemon, again).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_refused(upload(&daemon, Vec::new()).await, Code::InvalidArgument, "BAD_PARAMETER");
    let session = daemon.session().await;
    let imported = daemon.import(&session, Source::Blob(one.blob)).await.expect("import");
    assert_eq!(imported.mesh.map(|m| (m.vertices, m.faces)), Some((258, 512)));
}

async fn mesh_data(daemon: &Daemon, request: v1::ReadMeshDataRequest) -> (v1::MeshDataHeader, Vec<v1::DataChunk>) {
    let mut stream = daemon.meshes().read_mesh_data(request).await.expect("data").into_inner();
    let (mut header, mut chunks) = (None, Vec::new());
    while let Some(message) = stream.message().await.expect("message") {
        match message.part.expect("part") {
            v1::read_mesh_data_response::Part::Header(first) => header = Some(first),
            v1::read_mesh_data_response::Part::Chunk(chunk) => chunks.push(chunk),
        }
    }
    (header.expect("header"), chunks)
}

#[tokio::test]
async fn arrays_go_round() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    daemon.import(&session, Source::Inline(sphere_off(3).into())).await.expect("import");
    let columns = [v1::DataColumn::Positions, v1::DataColumn::Triangles, v1::DataColumn::FaceRegion, v1::DataColumn::FaceKappa];
    let read = |session: &str| v1::ReadMeshDataRequest {
        session: session.to_owned(),
        source: v1::MeshSource::Input.into(),
        columns: columns.map(i32::from).to_vec(),
        ..Default::default()
    };
    let (header, chunks) = mesh_data(&daemon, read(&session)).await;
    let packed = |kind| Some(v1::PackedArray { data: Some(v1::packed_array::Data::Inline(column(&chunks, kind).into())) });
    let arrays = v1::MeshArrays {
        positions: packed(v1::DataColumn::Positions),
        triangles: packed(v1::DataColumn::Triangles),
        face_regions: packed(v1::DataColumn::FaceRegion),
        regions: vec![v1::Region { id: 7, name: "ball".into() }],
        unit: v1::LengthUnit::Millimetre.into(),
    };
    let other = daemon.session().await;
    let imported = daemon.import(&other, Source::Arrays(arrays)).await.expect("import").mesh.expect("mesh");
    assert_eq!((imported.vertices, imported.faces, imported.unit()), (header.vertices, header.faces, v1::LengthUnit::Millimetre));
    assert_eq!(imported.regions[0].name, "ball");
    assert_eq!(mesh_data(&daemon, read(&other)).await.1, chunks, "bit for bit");
    let kappa = column(&chunks, v1::DataColumn::FaceKappa);
    assert!(kappa.as_chunks::<8>().0.iter().all(|b| (0.5..=1.0).contains(&f64::from_le_bytes(*b))));
}

#[tokio::test]
async fn results_are_exported_in_chunks_and_read_back() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let result = daemon.remesh(&session).await.expect("remesh").mesh.expect("mesh");
    let request = v1::ExportMeshRequest { session: session.clone(), format: v1::MeshFormat::Off.into(), ..Default::default() };
    let mut stream = daemon.meshes().export_mesh(request).await.expect("export").into_inner();
    let (mut header, mut file) = (None, Vec::new());
    while let Some(message) = stream.message().await.expect("message") {
        match message.part.expect("part") {
            v1::export_mesh_response::Part::Header(first) => header = Some(first),
            v1::export_mesh_response::Part::Data(piece) => file.extend_from_slice(&piece),
        }
    }
    let header = header.expect("header");
    assert_eq!((header.total_bytes, header.faces), (file.len() as u64, result.faces));
    let other = daemon.session().await;
    let back = daemon.import(&other, Source::Inline(file.into())).await.expect("reads what it writes").mesh.expect("mesh");
    assert_eq!((back.vertices, back.faces), (result.vertices, result.faces));
    let unspecified = v1::ExportMeshRequest { session, ..Default::default() };
    assert_refused(daemon.meshes().export_mesh(unspecified).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn patches_and_features_are_read_of_input_and_result() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    for source in [v1::MeshSource::Input, v1::MeshSource::Result] {
        let columns = [v1::DataColumn::FacePatch, v1::DataColumn::FeatureEdges].map(i32::from).to_vec();
        let request = v1::ReadMeshDataRequest { session: session.clone(), source: source.into(), columns, ..Default::default() };
        let (header, chunks) = mesh_data(&daemon, request).await;
        assert_eq!(column(&chunks, v1::DataColumn::FacePatch).len() as u64, 4 * header.faces);
        assert_eq!(column(&chunks, v1::DataColumn::FeatureEdges).len() as u64, 8 * header.feature_edges);
    }
}

#[tokio::test]
async fn one_call_remeshes_a_file_and_repeats_from_the_cache() {
    let daemon = Daemon::usual().await;
    let request = v1::RemeshMeshRequest {
        source: Some(v1::remesh_mesh_request::Source::Data(sphere_off(4).into())),
        size: Some(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(1_000)) }),
        output_format: v1::MeshFormat::Off.into(),
        ..Default::default()
    };
    let first = daemon.remeshes().remesh_mesh(request.clone()).await.expect("remesh").into_inner();
    let quality = first.quality.expect("quality");
    assert!(quality.topology_kept && quality.self_intersections == Some(0), "{quality:?}");
    assert!(first.data.starts_with(b"OFF"));
    let second = daemon.remeshes().remesh_mesh(request).await.expect("remesh").into_inner();
    assert_eq!((second.summary.expect("summary").runs, second.data), (0, first.data));
}

#[tokio::test]
async fn files_of_other_tools_are_compared() {
    let daemon = Daemon::usual().await;
    let file = |times| {
        let source = v1::mesh_file::Source::Inline(sphere_off(times).into());
        Some(v1::MeshFile { source: Some(source), options: None })
    };
    let request = v1::CompareMeshesRequest { input: file(4), output: file(3), size: Some(0.2), scope: 0 };
    let report = daemon.qualities().compare_meshes(request).await.expect("compare").into_inner().report.expect("report");
    assert!(report.topology_kept && report.shape.is_some_and(|s| s.triangles == 512 && s.tau.is_some()));
    let far = report.fidelity.expect("fidelity").hausdorff_max_rel;
    assert!(far > 1e-4 && far < 0.01, "{far}");
    let missing = v1::CompareMeshesRequest { input: file(1), ..Default::default() };
    assert_refused(daemon.qualities().compare_meshes(missing).await, Code::InvalidArgument, "BAD_PARAMETER");
}
