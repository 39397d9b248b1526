//! A call that is dropped or past its deadline stops its work.

use crate::harness::{Daemon, assert_refused, end_of};
use remesh_proto::v1;
use remesh_proto::v1::capability_service_client::CapabilityServiceClient;
use std::time::Duration;
use tonic::{Code, Request};

/// Waits until nothing computes; every question is a call of its own.
async fn idle(daemon: &Daemon) {
    let mut client = CapabilityServiceClient::new(daemon.channel.clone());
    let wait = async { while client.get_cache_usage(v1::GetCacheUsageRequest {}).await.expect("usage").into_inner().running > 0 {} };
    tokio::time::timeout(Duration::from_secs(20), wait).await.expect("the work stops");
}

async fn is_remeshed(daemon: &Daemon, session: &str) -> bool {
    daemon.plan(session).await.runs == 0
}

#[tokio::test]
async fn dropping_a_call_stops_its_work() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(150_000, 150_000).await;
    let mut stream = daemon.begin_remesh(&session).await;
    stream.message().await.expect("progress").expect("progress");
    drop(stream);
    idle(&daemon).await;
    assert!(!is_remeshed(&daemon, &session).await);
}

#[tokio::test]
async fn a_deadline_stops_streams_and_single_calls() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(150_000, 150_000).await;
    let mut request = Request::new(v1::RemeshSurfaceRequest { session: session.clone(), ..Default::default() });
    request.set_timeout(Duration::from_millis(60));
    let stream = daemon.remeshes().remesh_surface(request).await.expect("stream").into_inner();
    assert_refused(end_of(stream).await, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
    idle(&daemon).await;
    let mut request = Request::new(v1::GetQualityRequest { session: session.clone(), ..Default::default() });
    request.set_timeout(Duration::from_millis(60));
    let status = daemon.qualities().get_quality(request).await.expect_err("deadline");
    // The client's own timer may be first; it says CANCELLED.
    assert!(matches!(status.code(), Code::DeadlineExceeded | Code::Cancelled), "{status:?}");
    idle(&daemon).await;
    assert!(!is_remeshed(&daemon, &session).await);
}
