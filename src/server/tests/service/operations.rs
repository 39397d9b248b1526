//! Long work that outlives its call: progress, wait, result, cancel, the end of its session.

use crate::harness::{Daemon, assert_refused, small_config};
use remesh_proto::v1;
use remesh_proto::v1::operation_service_client::OperationServiceClient;
use std::time::Duration;
use tonic::transport::Channel;
use tonic::{Code, Request, Status};
use v1::operation::Outcome;
use v1::start_operation_request::Work;

fn operations(daemon: &Daemon) -> OperationServiceClient<Channel> {
    OperationServiceClient::new(daemon.channel.clone())
}

fn remesh() -> Work {
    Work::Remesh(v1::RemeshWork::default())
}

async fn start(daemon: &Daemon, session: &str, work: Option<Work>, request_id: &str) -> Result<v1::Operation, Status> {
    let request =
        v1::StartOperationRequest { session: session.to_owned(), expected_revision: None, work, request_id: request_id.to_owned() };
    Ok(operations(daemon).start_operation(request).await?.into_inner().operation.expect("operation"))
}

async fn wait(daemon: &Daemon, name: &str, seconds: i64) -> Result<v1::Operation, Status> {
    let timeout = Some(prost_types::Duration { seconds, nanos: 0 });
    let answer = operations(daemon).wait_operation(v1::WaitOperationRequest { name: name.to_owned(), timeout }).await?;
    Ok(answer.into_inner().operation.expect("operation"))
}

#[tokio::test]
async fn an_operation_goes_on_without_its_call_and_keeps_its_result() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(4000, 3000).await;
    let mut request = Request::new(v1::StartOperationRequest { session: session.clone(), work: Some(remesh()), ..Default::default() });
    // The deadline is of the call, not of the work.
    request.set_timeout(Duration::from_secs(1));
    let started = operations(&daemon).start_operation(request).await.expect("started").into_inner().operation.expect("operation");
    assert_eq!((started.state(), started.revision), (v1::OperationState::Running, 2));
    let ended = wait(&daemon, &started.name, 60).await.expect("waits");
    assert_eq!(ended.state(), v1::OperationState::Succeeded);
    assert!(ended.end_time.is_some() && ended.progress.as_ref().is_some_and(|p| p.total_fraction > 0.5), "{ended:?}");
    let Some(Outcome::Remesh(result)) = ended.outcome else { panic!("no result") };
    assert!(result.mesh.is_some_and(|m| m.faces > 1000));
    assert_eq!(daemon.plan(&session).await.runs, 0, "what it computed is cached");
    let scope = v1::QualityScope::Full.into();
    let measured = start(&daemon, &session, Some(Work::Quality(v1::QualityWork { scope })), "").await.expect("started");
    assert!(matches!(wait(&daemon, &measured.name, 60).await.expect("waits").outcome, Some(Outcome::Quality(_))));
    let listed = operations(&daemon).list_operations(v1::ListOperationsRequest { session }).await.expect("list").into_inner();
    let names: Vec<_> = listed.operations.iter().map(|o| o.name.clone()).collect();
    assert!(names == [started.name, measured.name] && listed.operations.iter().all(|o| o.outcome.is_none()));
}

#[tokio::test]
async fn the_same_request_starts_one_operation() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2000, 1000).await;
    let first = start(&daemon, &session, Some(remesh()), "a").await.expect("started");
    let again = start(&daemon, &session, Some(remesh()), "a").await.expect("answered");
    let other = start(&daemon, &session, Some(remesh()), "b").await.expect("started");
    assert!(first.name == again.name && first.name != other.name);
}

#[tokio::test]
async fn cancelled_and_with_the_session_they_end() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(100_000, 200_000).await;
    let first = start(&daemon, &session, Some(remesh()), "").await.expect("started");
    let short = wait(&daemon, &first.name, 0).await.expect("answers at once");
    assert_eq!(short.state(), v1::OperationState::Running);
    operations(&daemon).cancel_operation(v1::CancelOperationRequest { name: first.name.clone() }).await.expect("cancels");
    let ended = wait(&daemon, &first.name, 20).await.expect("waits");
    assert_eq!(ended.state(), v1::OperationState::Cancelled);
    assert!(matches!(ended.outcome, Some(Outcome::Error(error)) if error.reason == "CANCELLED"));
    let second = start(&daemon, &session, Some(remesh()), "").await.expect("started");
    // A remesh that somebody waits for ends with the session, too.
    let mut stream = daemon.begin_remesh(&session).await;
    stream.message().await.expect("progress").expect("progress");
    let (waiting, deleted) = tokio::join!(wait(&daemon, &second.name, 20), async {
        tokio::time::sleep(Duration::from_millis(100)).await;
        daemon.sessions().delete_session(v1::DeleteSessionRequest { name: session.clone() }).await
    });
    deleted.expect("deleted");
    assert_eq!(waiting.expect("told").state(), v1::OperationState::Cancelled);
    assert_refused(crate::harness::end_of(stream).await, Code::Cancelled, "CANCELLED");
    assert_refused(wait(&daemon, &second.name, 1).await, Code::NotFound, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn wrong_names_and_work_are_refused() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2000, 1000).await;
    assert_refused(start(&daemon, &session, None, "").await, Code::InvalidArgument, "BAD_PARAMETER");
    let twice = Work::Remesh(v1::RemeshWork { patches: vec![1, 1] });
    assert_refused(start(&daemon, &session, Some(twice), "").await, Code::InvalidArgument, "BAD_PARAMETER");
    for name in ["", "operations/1", &format!("{session}/operations/x")] {
        assert_refused(wait(&daemon, name, 0).await, Code::InvalidArgument, "BAD_PARAMETER");
    }
    assert_refused(wait(&daemon, &format!("{session}/operations/7"), 0).await, Code::NotFound, "OPERATION_NOT_FOUND");
    let missing = Work::Remesh(v1::RemeshWork { patches: vec![9999] });
    let failed = start(&daemon, &session, Some(missing), "").await.expect("started");
    let ended = wait(&daemon, &failed.name, 60).await.expect("waits");
    assert!(matches!(ended.outcome, Some(Outcome::Error(error)) if error.reason == "PATCH_NOT_FOUND"));
}

#[tokio::test]
async fn too_many_operations_of_a_session_are_refused_at_once() {
    let mut config = small_config();
    config.max_running = 1;
    let daemon = Daemon::start(config).await;
    let session = daemon.tube(100_000, 200_000).await;
    for _ in 0..16 {
        start(&daemon, &session, Some(remesh()), "").await.expect("room");
    }
    assert_refused(start(&daemon, &session, Some(remesh()), "").await, Code::ResourceExhausted, "LIMIT_REACHED");
}
