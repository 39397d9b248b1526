//! Uploads that break and go on, what the daemon has, unused files, and sessions that cannot be opened.

use crate::harness::{Daemon, assert_refused, small_config};
use remesh_proto::v1;
use remesh_server::{Clock, Keeping, ServerConfig};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};
use tonic::Code;
use tonic_types::StatusExt;

fn with_folder(folder: &Path) -> ServerConfig {
    let keeping = Keeping { folder: folder.to_owned(), max_bytes: None, max_bytes_per_client: None, blob_grace: Duration::from_secs(60) };
    ServerConfig { keeping: Some(keeping), sweep_interval: Duration::from_millis(20), ..small_config() }
}

fn file(bytes: usize) -> Vec<u8> {
    (0..bytes).map(|i| (i * i % 251) as u8).collect()
}

fn digest(file: &[u8]) -> String {
    blake3::hash(file).to_hex().to_string()
}

async fn missing(daemon: &Daemon, digest: &str) -> Option<u64> {
    let request = v1::FindMissingBlobsRequest { digests: vec![digest.to_owned()] };
    let answer = daemon.meshes().find_missing_blobs(request).await.expect("asked").into_inner();
    answer.missing.first().map(|missing| missing.received_bytes)
}

fn first(file: &[u8], offset: usize, end: usize) -> v1::UploadMeshRequest {
    v1::UploadMeshRequest {
        data: file[offset..end].to_vec().into(),
        total_bytes: Some(file.len() as u64),
        expected_digest: digest(file),
        offset: offset as u64,
    }
}

/// Sends a part of a file and ends; waits until the daemon knows how much came. (Connections that break: tests/durability.)
async fn broken_upload(daemon: &Daemon, file: &[u8], offset: usize, end: usize) {
    let sent = daemon.meshes().upload_mesh(tokio_stream::iter([first(file, offset, end)])).await;
    assert_refused(sent, Code::InvalidArgument, "BAD_PARAMETER");
    for _ in 0..200 {
        if missing(daemon, &digest(file)).await == Some(end as u64) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("{end} bytes never arrived");
}

async fn an_upload_goes_on(config: ServerConfig) {
    let daemon = Daemon::start(config).await;
    let file = file(300_000);
    assert_eq!(missing(&daemon, &digest(&file)).await, Some(0));
    broken_upload(&daemon, &file, 0, 100_000).await;
    broken_upload(&daemon, &file, 100_000, 200_000).await;
    let send = |message| async { daemon.meshes().upload_mesh(tokio_stream::iter([message])).await.map(tonic::Response::into_inner) };
    let wrong = assert_refused(send(first(&file, 150_000, 300_000)).await, Code::InvalidArgument, "UPLOAD_OFFSET");
    let received = wrong.get_details_error_info().and_then(|info| info.metadata.get("received_bytes").cloned());
    assert_eq!(received.as_deref(), Some("200000"));
    let nameless = v1::UploadMeshRequest { expected_digest: String::new(), ..first(&file, 200_000, 300_000) };
    assert_refused(send(nameless).await, Code::InvalidArgument, "BAD_PARAMETER");
    let done = send(first(&file, 200_000, 300_000)).await.expect("complete");
    assert_eq!(done, v1::UploadMeshResponse { blob: format!("blobs/{}", digest(&file)), bytes: 300_000 });
    assert_eq!(missing(&daemon, &digest(&file).to_uppercase()).await, None);
    // A wrong beginning is found out at the end, and not kept.
    let mut other = file.clone();
    other[7] ^= 1;
    let lying = v1::UploadMeshRequest { expected_digest: digest(&other), ..first(&file, 0, 300_000) };
    assert_refused(send(lying).await, Code::InvalidArgument, "DIGEST_MISMATCH");
    assert_eq!(missing(&daemon, &digest(&other)).await, Some(0));
    for bad in ["", "xyz", &"g".repeat(64)] {
        let request = v1::FindMissingBlobsRequest { digests: vec![bad.to_owned()] };
        assert_refused(daemon.meshes().find_missing_blobs(request).await, Code::InvalidArgument, "BAD_PARAMETER");
    }
    let many = v1::FindMissingBlobsRequest { digests: vec![digest(&file); 1001] };
    assert_refused(daemon.meshes().find_missing_blobs(many).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn an_upload_goes_on_in_memory() {
    an_upload_goes_on(small_config()).await;
}

#[tokio::test]
async fn an_upload_goes_on_in_a_folder() {
    let folder = tempfile::tempdir().expect("folder");
    an_upload_goes_on(with_folder(folder.path())).await;
}

/// A clock that the test moves.
fn clock() -> (Clock, Arc<AtomicU64>) {
    let ahead = Arc::new(AtomicU64::new(0));
    let read = ahead.clone();
    (Clock::new(move || SystemTime::now() + Duration::from_secs(read.load(Ordering::Relaxed))), ahead)
}

async fn upload(daemon: &Daemon, file: &[u8]) -> String {
    let message = first(file, 0, file.len());
    daemon.meshes().upload_mesh(tokio_stream::iter([message])).await.expect("upload").into_inner().blob
}

#[tokio::test]
async fn unused_files_go_and_used_ones_stay() {
    let folder = tempfile::tempdir().expect("folder");
    let (clock, ahead) = clock();
    let daemon = Daemon::start(ServerConfig { clock, ..with_folder(folder.path()) }).await;
    let mesh = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let used = upload(&daemon, mesh).await;
    let session = daemon.session().await;
    daemon.import(&session, v1::import_mesh_request::Source::Blob(used)).await.expect("import");
    upload(&daemon, &file(1000)).await;
    broken_upload(&daemon, &file(5000), 0, 3000).await;
    let incoming = || std::fs::read_dir(folder.path().join("incoming")).expect("folder").count();
    assert_eq!((missing(&daemon, &digest(&file(1000))).await, incoming()), (None, 1));
    ahead.store(120, Ordering::Relaxed);
    let mut tries = 0;
    while missing(&daemon, &digest(&file(1000))).await.is_none() {
        // Asking counts as a use, by the clock of the disk.
        tries += 1;
        assert!(tries < 100, "it stays for ever");
        tokio::time::sleep(Duration::from_millis(30)).await;
    }
    assert_eq!(missing(&daemon, &digest(mesh)).await, None, "a session uses it");
    assert_eq!(missing(&daemon, &digest(&file(5000))).await, Some(3000), "it may still be gone on with");
    ahead.store(4000, Ordering::Relaxed);
    for _ in 0..100 {
        tokio::time::sleep(Duration::from_millis(20)).await;
        if incoming() == 0 {
            break;
        }
    }
    assert_eq!((incoming(), missing(&daemon, &digest(&file(5000))).await), (0, Some(0)));
}

#[tokio::test]
async fn a_session_that_cannot_be_opened_keeps_no_other_from_it() {
    let folder = tempfile::tempdir().expect("folder");
    let mesh = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let mut daemon = Daemon::start(with_folder(folder.path())).await;
    let used = upload(&daemon, mesh).await;
    let (broken, sound) = (daemon.session().await, daemon.tube(200, 100).await);
    daemon.import(&broken, v1::import_mesh_request::Source::Blob(used)).await.expect("import");
    let _ = daemon.stop.take().map(|stop| stop.send(()));
    drop(daemon.channel);
    daemon.served.await.expect("no panic").expect("ends well");
    std::fs::remove_file(folder.path().join("blobs").join(digest(mesh))).expect("there");
    let daemon = Daemon::start(with_folder(folder.path())).await;
    let get = |name: &str| v1::GetSessionRequest { name: name.to_owned() };
    assert_refused(daemon.sessions().get_session(get(&broken)).await, Code::DataLoss, "SESSION_UNREADABLE");
    let whole = daemon.sessions().get_session(get(&sound)).await.expect("opens").into_inner().session.expect("session");
    assert_eq!((whole.revision, whole.mesh.is_some()), (2, true));
    daemon.sessions().delete_session(v1::DeleteSessionRequest { name: broken.clone() }).await.expect("deleted");
    assert_refused(daemon.sessions().get_session(get(&broken)).await, Code::NotFound, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn a_folder_that_cannot_be_written_to_is_an_error_of_the_store() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::start(with_folder(folder.path())).await;
    let session = daemon.session().await;
    std::fs::remove_dir_all(folder.path().join("incoming")).expect("there");
    let mesh = file(5000);
    let refused = daemon.meshes().upload_mesh(tokio_stream::iter([first(&mesh, 0, mesh.len())])).await;
    let status = assert_refused(refused, Code::Internal, "STORE_FAILED");
    let path = folder.path().display().to_string();
    assert!(!status.message().contains(&path), "no paths of the server: {}", status.message());
    daemon.change(&session, None, crate::harness::size_of_count(100)).await.expect("what needs no file goes on");
}

#[tokio::test]
async fn sessions_of_before_a_restart_count_for_their_client() {
    let folder = tempfile::tempdir().expect("folder");
    let config = || ServerConfig { max_sessions_per_client: 2, max_open_faces_per_client: 400, ..with_folder(folder.path()) };
    let mut daemon = Daemon::start(config()).await;
    daemon.tube(200, 100).await;
    let _ = daemon.stop.take().map(|stop| stop.send(()));
    drop(daemon.channel);
    daemon.served.await.expect("no panic").expect("ends well");
    let daemon = Daemon::start(config()).await;
    let second = daemon.session().await;
    let third = daemon.sessions().create_session(v1::CreateSessionRequest::default()).await;
    assert_refused(third, Code::ResourceExhausted, "LIMIT_REACHED");
    assert_refused(daemon.import(&second, crate::harness::tube(300)).await, Code::ResourceExhausted, "LIMIT_REACHED");
    daemon.import(&second, crate::harness::tube(100)).await.expect("few enough");
}

#[tokio::test]
async fn one_client_cannot_fill_the_folder() {
    let folder = tempfile::tempdir().expect("folder");
    let mut config = with_folder(folder.path());
    config.keeping.as_mut().expect("folder").max_bytes_per_client = Some(100_000);
    let daemon = Daemon::start(config).await;
    let big = file(80_000);
    upload(&daemon, &big).await;
    let other = file(30_000);
    let refused = daemon.meshes().upload_mesh(tokio_stream::iter([first(&other, 0, other.len())])).await;
    let status = assert_refused(refused, Code::ResourceExhausted, "LIMIT_REACHED");
    let limit = status.get_details_error_info().and_then(|info| info.metadata.get("limit").cloned());
    assert_eq!(limit.as_deref(), Some("max_store_mb_per_client"));
    assert_eq!(missing(&daemon, &digest(&other)).await, Some(0));
    daemon.tube(200, 100).await;
}
