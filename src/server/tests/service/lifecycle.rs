//! The life of sessions: creation, listing by pages, expiry, deletion; shutdown of the server.

use crate::harness::{Daemon, assert_refused, end_of, small_config};
use remesh_proto::v1;
use remesh_server::{Clock, in_process};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};
use tonic::Code;

#[tokio::test]
async fn a_session_lives_and_ends() {
    let daemon = Daemon::usual().await;
    let mut client = daemon.sessions();
    let ttl = Some(prost_types::Duration { seconds: 90, nanos: 0 });
    let request = v1::CreateSessionRequest { display_name: "left carotid".into(), ttl };
    let made = client.create_session(request).await.expect("session").into_inner().session.expect("session");
    assert_eq!((made.revision, made.display_name.as_str(), made.ttl), (0, "left carotid", ttl));
    let get = v1::GetSessionRequest { name: made.name.clone() };
    let got = client.get_session(get.clone()).await.expect("get").into_inner().session.expect("session");
    assert_eq!((got.name, got.mesh, got.inputs.and_then(|i| i.size)), (made.name.clone(), None, None));
    client.delete_session(v1::DeleteSessionRequest { name: made.name }).await.expect("delete");
    assert_refused(client.get_session(get).await, Code::NotFound, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn lists_come_in_pages() {
    let daemon = Daemon::usual().await;
    let mut made = BTreeSet::new();
    for _ in 0..5 {
        made.insert(daemon.session().await);
    }
    let (mut seen, mut page_token, mut pages) = (Vec::new(), String::new(), 0);
    loop {
        let request = v1::ListSessionsRequest { page_size: 2, page_token };
        let page = daemon.sessions().list_sessions(request).await.expect("page").into_inner();
        seen.extend(page.sessions.into_iter().map(|s| s.name));
        (page_token, pages) = (page.next_page_token, pages + 1);
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!((pages, seen.len(), seen.into_iter().collect::<BTreeSet<_>>()), (3, 5, made));
    let bad = v1::ListSessionsRequest { page_size: 2, page_token: "nonsense".into() };
    assert_refused(daemon.sessions().list_sessions(bad).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn sessions_expire_by_the_clock() {
    let seconds = Arc::new(AtomicU64::new(1_000_000));
    let mut config = small_config();
    let time = seconds.clone();
    config.clock = Clock::new(move || SystemTime::UNIX_EPOCH + Duration::from_secs(time.load(Ordering::Relaxed)));
    config.engine.default_ttl = Duration::from_secs(100);
    let daemon = Daemon::start(config).await;
    let name = daemon.session().await;
    let get = v1::GetSessionRequest { name: name.clone() };
    seconds.fetch_add(99, Ordering::Relaxed);
    daemon.sessions().get_session(get.clone()).await.expect("a use prolongs its life");
    seconds.fetch_add(99, Ordering::Relaxed);
    let ttl = Some(prost_types::Duration { seconds: 10, nanos: 0 });
    daemon.sessions().update_session(v1::UpdateSessionRequest { name, ttl }).await.expect("still there");
    seconds.fetch_add(11, Ordering::Relaxed);
    assert_refused(daemon.sessions().get_session(get).await, Code::NotFound, "SESSION_EXPIRED");
    let listed = daemon.sessions().list_sessions(v1::ListSessionsRequest::default()).await.expect("list").into_inner();
    assert!(listed.sessions.is_empty());
}

#[tokio::test]
async fn shutdown_cancels_what_outlives_the_grace_period() {
    let mut config = small_config();
    config.grace = Duration::ZERO;
    let mut daemon = Daemon::start(config).await;
    let session = daemon.tube(150_000, 150_000).await;
    let mut stream = daemon.begin_remesh(&session).await;
    stream.message().await.expect("progress").expect("progress");
    daemon.stop.take().expect("running").send(()).expect("server listens");
    assert_refused(end_of(stream).await, Code::Cancelled, "CANCELLED");
    daemon.served.await.expect("no panic").expect("served");
}

#[tokio::test]
async fn an_idle_server_stops_at_once() {
    let mut daemon = Daemon::usual().await;
    daemon.session().await;
    daemon.stop.take().expect("running").send(()).expect("server listens");
    daemon.served.await.expect("no panic").expect("served");
}

#[tokio::test]
async fn the_private_server_answers_on_its_channel() {
    let channel = in_process(small_config()).await.expect("server");
    let mut client = v1::remesh_service_client::RemeshServiceClient::new(channel.clone());
    assert_refused(client.remesh_mesh(v1::RemeshMeshRequest::default()).await, Code::InvalidArgument, "BAD_PARAMETER");
    let mut sessions = v1::session_service_client::SessionServiceClient::new(channel);
    assert!(sessions.create_session(v1::CreateSessionRequest::default()).await.is_ok());
}
