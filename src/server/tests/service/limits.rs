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
    assert_refused(daemon.import(&session, source).await, Code::ResourceExhausted, "LIMIT_REACHED");
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

/// The wait that a refusal asks for.
fn retry_delay(status: &tonic::Status) -> Option<std::time::Duration> {
    status.get_error_details().retry_info().and_then(|info| info.retry_delay)
}

#[tokio::test]
async fn one_client_may_have_so_many_jobs_and_sessions_and_is_told_when_to_come_back() {
    let mut config = small_config();
    (config.max_jobs_per_client, config.max_sessions_per_client, config.max_running) = (1, 2, 1);
    let daemon = Daemon::start(config).await;
    let session = daemon.tube(100_000, 200_000).await;
    let mut stream = daemon.begin_remesh(&session).await;
    stream.message().await.expect("progress").expect("it runs");
    let status = assert_refused(daemon.remesh(&session).await, Code::ResourceExhausted, "LIMIT_REACHED");
    assert!(retry_delay(&status).is_some() && status.message().contains("max_jobs_per_client"), "{status:?}");
    drop(stream);
    daemon.session().await;
    let third = daemon.sessions().create_session(v1::CreateSessionRequest::default()).await;
    let status = assert_refused(third, Code::ResourceExhausted, "LIMIT_REACHED");
    assert!(retry_delay(&status).is_some() && status.message().contains("max_sessions_per_client"), "{status:?}");
}

#[tokio::test]
async fn faces_of_open_sessions_are_limited_together_and_given_back() {
    let mut config = small_config();
    config.max_open_faces_per_client = 5000;
    let daemon = Daemon::start(config).await;
    let (first, second) = (daemon.session().await, daemon.session().await);
    daemon.import(&first, tube(3000)).await.expect("fits");
    let status = assert_refused(daemon.import(&second, tube(3000)).await, Code::ResourceExhausted, "LIMIT_REACHED");
    assert!(retry_delay(&status).is_some(), "{status:?}");
    daemon.import(&first, tube(4000)).await.expect("replaces its own");
    // An import that fails after it was read reserves nothing.
    let stale = v1::ImportMeshRequest { session: second.clone(), base_revision: Some(7), source: Some(tube(900)), ..Default::default() };
    assert_refused(daemon.meshes().import_mesh(stale).await, Code::Aborted, "STALE_REVISION");
    daemon.import(&first, tube(4400)).await.expect("as much as if nobody had tried");
    daemon.import(&first, tube(4000)).await.expect("fewer again");
    daemon.sessions().delete_session(v1::DeleteSessionRequest { name: first }).await.expect("deleted");
    daemon.import(&second, tube(3000)).await.expect("there is room again");
}

#[tokio::test]
async fn connections_that_say_nothing_are_cut_and_too_many_are_not_taken() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let mut config = small_config();
    config.first_word = std::time::Duration::from_millis(300);
    config.max_connections = 2;
    // The channel of the harness is one of the two.
    let daemon = Daemon::start(config).await;
    daemon.session().await;
    let mut silent = tokio::net::TcpStream::connect(daemon.address).await.expect("connects");
    silent.write_all(b"PRI * HTTP/2").await.expect("a part of the first words");
    let mut refused = tokio::net::TcpStream::connect(daemon.address).await.expect("the system accepts");
    let mut buffer = [0; 64];
    let end = refused.read(&mut buffer).await;
    assert!(matches!(end, Ok(0) | Err(_)), "closed at once: {end:?}");
    let cut = async { while silent.read(&mut buffer).await.is_ok_and(|n| n > 0) {} };
    tokio::time::timeout(std::time::Duration::from_secs(20), cut).await.expect("the silent one is cut");
    daemon.session().await;
    // Its place is free again.
    let endpoint = tonic::transport::Endpoint::from_shared(format!("http://{}", daemon.address)).expect("uri");
    let mut client = v1::session_service_client::SessionServiceClient::new(endpoint.connect().await.expect("connects"));
    client.create_session(v1::CreateSessionRequest::default()).await.expect("answered");
}

#[tokio::test]
async fn an_upload_that_stands_still_ends() {
    use tokio_stream::StreamExt;
    let mut config = small_config();
    config.upload_idle = std::time::Duration::from_millis(200);
    let daemon = Daemon::start(config).await;
    let endless = tokio_stream::iter([chunk(1000)]).chain(tokio_stream::pending());
    let mut client = daemon.meshes();
    let upload = tokio::time::timeout(std::time::Duration::from_secs(20), client.upload_mesh(endless));
    assert_refused(upload.await.expect("it ends"), Code::DeadlineExceeded, "UPLOAD_BROKEN");
}
