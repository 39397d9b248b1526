//! Every kind of refusal, with its code, reason and details.

use crate::harness::{Daemon, assert_refused, locations, size_of_count, tube};
use remesh_proto::v1;
use remesh_proto::v1::import_mesh_request::Source;
use tonic::codegen::http::uri::PathAndQuery;
use tonic::{Code, Request};
use tonic_types::StatusExt;

/// The request of `GetSession` with bytes in place of its text.
#[derive(Clone, PartialEq, prost::Message)]
struct NoText {
    #[prost(bytes = "vec", tag = "1")]
    name: Vec<u8>,
}

#[tokio::test]
async fn bytes_that_are_no_message_are_refused_with_a_reason() {
    let daemon = Daemon::usual().await;
    let mut client = tonic::client::Grpc::new(daemon.channel.clone());
    client.ready().await.expect("ready");
    let codec = tonic_prost::ProstCodec::<NoText, v1::GetSessionResponse>::default();
    let method = PathAndQuery::from_static("/remesh.v1.SessionService/GetSession");
    let refused = client.unary(Request::new(NoText { name: vec![0xff] }), method, codec).await;
    assert_refused(refused, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn stale_revisions_are_aborted() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 300).await;
    let status = assert_refused(daemon.change(&session, Some(1), size_of_count(5)).await, Code::Aborted, "STALE_REVISION");
    let details = status.get_error_details();
    assert_eq!(details.error_info().expect("info").metadata["current_revision"], "2");
    let request = v1::PlanRemeshRequest { session: session.clone(), expected_revision: Some(7), ..Default::default() };
    assert_refused(daemon.remeshes().plan_remesh(request).await, Code::Aborted, "STALE_REVISION");
    let request = v1::ImportMeshRequest { session, base_revision: Some(0), source: Some(tube(500)), options: None, ..Default::default() };
    assert_refused(daemon.meshes().import_mesh(request).await, Code::Aborted, "STALE_REVISION");
}

#[tokio::test]
async fn names_must_exist_and_have_their_form() {
    let daemon = Daemon::usual().await;
    let get = |name: &str| v1::GetSessionRequest { name: name.to_owned() };
    let mut sessions = daemon.sessions();
    assert_refused(sessions.get_session(get("sessions/none")).await, Code::NotFound, "SESSION_NOT_FOUND");
    for name in ["", "none", "blobs/x"] {
        let status = assert_refused(sessions.get_session(get(name)).await, Code::InvalidArgument, "BAD_PARAMETER");
        assert_eq!(status.get_error_details().bad_request().expect("violations").field_violations[0].field, "name");
    }
    let session = daemon.session().await;
    assert_refused(daemon.import(&session, Source::Blob("blobs/none".into())).await, Code::NotFound, "BLOB_NOT_FOUND");
}

#[tokio::test]
async fn bad_parameters_name_their_field() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let uniform = |size| v1::change::Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Uniform(size)) });
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let status = assert_refused(daemon.change(&session, None, uniform(size)).await, Code::InvalidArgument, "BAD_PARAMETER");
        let details = status.get_error_details();
        assert_eq!(details.bad_request().expect("violations").field_violations[0].field, "size.uniform");
        assert_eq!(details.error_info().expect("info").domain, "remeshd.dev");
    }
    let mesher = v1::MesherSpec { kind: v1::MesherKind::Frontal.into(), all_quads: true, ..Default::default() };
    let status = daemon.change(&session, None, v1::change::Change::Mesher(mesher)).await;
    let status = assert_refused(status, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(status.get_error_details().bad_request().expect("violations").field_violations[0].field, "mesher.all_quads");
    let rollback = v1::change::Change::Rollback(v1::Rollback { to_revision: 9 });
    assert_refused(daemon.change(&session, None, rollback).await, Code::InvalidArgument, "BAD_PARAMETER");
    let missing = v1::ApplyChangeRequest { session, ..Default::default() };
    assert_refused(daemon.sessions().apply_change(missing).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn a_session_without_mesh_or_size_cannot_be_remeshed() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    assert_refused(daemon.remesh(&session).await, Code::FailedPrecondition, "NO_MESH");
    daemon.import(&session, tube(500)).await.expect("import");
    assert_refused(daemon.remesh(&session).await, Code::InvalidArgument, "BAD_PARAMETER");
}

/// Three triangles on one edge.
const FIN: &str = "OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n3 0 1 2\n3 1 0 3\n3 0 1 4\n";

#[tokio::test]
async fn a_broken_surface_is_imported_diagnosed_and_refused_with_places() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let imported = daemon.import(&session, Source::Inline(FIN.into())).await.expect("imported nevertheless");
    let diagnosis = imported.diagnosis.expect("diagnosis");
    assert!(!diagnosis.remeshable && diagnosis.findings.iter().any(|f| f.prevents_remeshing && !f.locations.is_empty()));
    daemon.change(&session, None, size_of_count(100)).await.expect("size");
    let status = assert_refused(daemon.remesh(&session).await, Code::FailedPrecondition, "NON_MANIFOLD_EDGE");
    let places = locations(&status).expect("places");
    assert_eq!((places.total, places.locations[0].element()), (1, v1::ElementKind::Edge));
    let midpoint = places.locations[0].position.expect("position");
    assert_eq!((midpoint.x, midpoint.y, midpoint.z), (0.5, 0.0, 0.0));
}

#[tokio::test]
async fn unreadable_files_leave_the_session_as_it_was() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let garbage: Vec<u8> = (0..1000u32).map(|i| (i * 37 % 251) as u8).collect();
    let status = daemon.import(&session, Source::Inline(garbage.into())).await.expect_err("garbage");
    assert_eq!(status.code(), Code::InvalidArgument, "{status:?}");
    assert_eq!(daemon.plan(&session).await.revision, 2, "the former mesh is still there");
}

#[tokio::test]
async fn columns_of_other_methods_are_refused() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 300).await;
    let request = v1::ReadMeshDataRequest { session, columns: vec![v1::DataColumn::Uv.into()], ..Default::default() };
    assert_refused(daemon.meshes().read_mesh_data(request).await, Code::InvalidArgument, "BAD_PARAMETER");
}
