//! Limits of size, count and load.

use crate::files::upload;
use crate::harness::{Daemon, assert_refused, small_config, tube};
use remesh_proto::v1;
use tonic::Code;
use tonic_types::StatusExt;

fn chunk(bytes: usize) -> v1::UploadMeshRequest {
    v1::UploadMeshRequest { data: vec![b'x'; bytes].into(), ..Default::default() }
}

#[tokio::test]
async fn uploads_stop_at_the_limit() {
    let mut config = small_config();
    config.engine.max_blob_bytes = 3_000_000;
    let daemon = Daemon::start(config).await;
    assert_refused(upload(&daemon, vec![chunk(1 << 20); 4]).await, Code::ResourceExhausted, "LIMIT_REACHED");
    let announced = v1::UploadMeshRequest { total_bytes: Some(u64::MAX), ..chunk(1) };
    assert_refused(upload(&daemon, vec![announced]).await, Code::ResourceExhausted, "LIMIT_REACHED");
    assert_refused(upload(&daemon, vec![chunk((1 << 20) + 1)]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert!(upload(&daemon, vec![chunk(1 << 20); 2]).await.is_ok());
}

#[tokio::test]
async fn messages_have_a_largest_size() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let source = v1::import_mesh_request::Source::Inline(vec![0; 5 << 20].into());
    let status = daemon.import(&session, source).await.expect_err("too large");
    assert_eq!(status.code(), Code::OutOfRange, "{status:?}");
    let mut config = small_config();
    config.max_inline_bytes = 1000;
    let daemon = Daemon::start(config).await;
    let request = v1::RemeshMeshRequest {
        source: Some(v1::remesh_mesh_request::Source::Data(vec![0; 2000].into())),
        size: Some(v1::SizeSpec { size: Some(v1::size_spec::Size::Uniform(1.0)) }),
        output_format: v1::MeshFormat::Off.into(),
        ..Default::default()
    };
    assert_refused(daemon.remeshes().remesh_mesh(request).await, Code::ResourceExhausted, "LIMIT_REACHED");
}

#[tokio::test]
async fn sessions_and_faces_are_limited() {
    let mut config = small_config();
    config.engine.max_sessions = 1;
    config.engine.max_faces = 1000;
    let daemon = Daemon::start(config).await;
    let session = daemon.session().await;
    let second = daemon.sessions().create_session(v1::CreateSessionRequest::default()).await;
    assert_refused(second, Code::ResourceExhausted, "LIMIT_REACHED");
    assert_refused(daemon.import(&session, tube(1_000_000)).await, Code::ResourceExhausted, "LIMIT_REACHED");
}

#[tokio::test]
async fn a_full_queue_tells_when_to_come_back() {
    let mut config = small_config();
    (config.max_running, config.max_queued) = (1, 0);
    let daemon = Daemon::start(config).await;
    let session = daemon.tube(150_000, 150_000).await;
    let mut stream = daemon.begin_remesh(&session).await;
    stream.message().await.expect("progress").expect("it runs, so the only place is taken");
    let status = assert_refused(daemon.remesh(&session).await, Code::ResourceExhausted, "QUEUE_FULL");
    assert!(status.get_error_details().retry_info().is_some_and(|r| r.retry_delay.is_some()));
    assert_eq!(daemon.plan(&session).await.revision, 2, "short calls go on");
}
