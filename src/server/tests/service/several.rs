//! Several clients on one session: stale revisions, repeated requests, undo and redo, rollback.

use crate::harness::{Daemon, assert_refused, size_of_count};
use remesh_proto::v1;
use tonic::Code;
use tonic_types::StatusExt;

fn apply(session: &str, base_revision: Option<u64>, request_id: &str, triangles: u64) -> v1::ApplyChangeRequest {
    let change = Some(v1::Change { change: Some(size_of_count(triangles)) });
    v1::ApplyChangeRequest { session: session.to_owned(), base_revision, change, request_id: request_id.to_owned() }
}

async fn undo(daemon: &Daemon, session: &str, base_revision: Option<u64>) -> Result<v1::UndoChangeResponse, tonic::Status> {
    let request = v1::UndoChangeRequest { session: session.to_owned(), base_revision, ..Default::default() };
    daemon.sessions().undo_change(request).await.map(tonic::Response::into_inner)
}

async fn redo(daemon: &Daemon, session: &str) -> Result<v1::RedoChangeResponse, tonic::Status> {
    let request = v1::RedoChangeRequest { session: session.to_owned(), ..Default::default() };
    daemon.sessions().redo_change(request).await.map(tonic::Response::into_inner)
}

async fn get(daemon: &Daemon, session: &str) -> v1::Session {
    let got = daemon.sessions().get_session(v1::GetSessionRequest { name: session.to_owned() }).await.expect("get");
    got.into_inner().session.expect("session")
}

#[tokio::test]
async fn the_later_of_two_writers_is_told_the_current_revision() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let (one, other) = tokio::join!(async { daemon.sessions().apply_change(apply(&session, Some(0), "", 1_000)).await }, async {
        daemon.sessions().apply_change(apply(&session, Some(0), "", 2_000)).await
    },);
    let (won, lost): (Vec<_>, Vec<_>) = [one, other].into_iter().partition(Result::is_ok);
    assert_eq!((won.len(), lost.len()), (1, 1));
    let status = assert_refused(lost.into_iter().next().expect("one"), Code::Aborted, "STALE_REVISION");
    let metadata = status.get_error_details().error_info().expect("info").metadata.clone();
    assert_eq!(metadata.get("current_revision").map(String::as_str), Some("1"));
}

#[tokio::test]
async fn a_repeated_request_is_carried_out_once() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    // Its own success makes its base stale: the repetition must not be refused for that.
    for _ in 0..3 {
        let answer = daemon.sessions().apply_change(apply(&session, Some(0), "first", 1_000)).await.expect("applied");
        assert_eq!(answer.into_inner().revision, 1);
    }
    let again = apply(&session, None, "second", 2_000);
    let both = (0..8).map(|_| async { daemon.sessions().apply_change(again.clone()).await.expect("applied").into_inner().revision });
    for revision in both {
        assert_eq!(revision.await, 2);
    }
    assert_eq!(get(&daemon, &session).await.revision, 2);
    let other = daemon.sessions().apply_change(apply(&session, None, "second", 3_000)).await;
    let status = assert_refused(other, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(status.get_error_details().bad_request().expect("fields").field_violations[0].field, "request_id");
    // A request that was refused changed nothing and may be tried again.
    assert_refused(daemon.sessions().apply_change(apply(&session, Some(0), "third", 1_000)).await, Code::Aborted, "STALE_REVISION");
    assert_refused(daemon.sessions().apply_change(apply(&session, Some(0), "third", 1_000)).await, Code::Aborted, "STALE_REVISION");
    // The ids of one session mean nothing in another.
    let elsewhere = daemon.session().await;
    assert!(daemon.sessions().apply_change(apply(&elsewhere, Some(0), "second", 5_000)).await.is_ok());
}

#[tokio::test]
async fn edits_that_compute_are_carried_out_once_even_at_the_same_time() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let split =
        v1::SplitPatchRequest { session: session.clone(), base_revision: Some(2), request_id: "split".into(), ..Default::default() };
    let call = || async { daemon.partitions().split_patch(split.clone()).await.expect("split").into_inner() };
    let (one, two, three) = tokio::join!(call(), call(), call());
    assert_eq!(one.revision, 3);
    assert!(one == two && two == three, "the same answer, to the last field");
    let reset = v1::ResetPatchesRequest { session: session.clone(), request_id: "reset".into(), ..Default::default() };
    for _ in 0..2 {
        let answer = daemon.partitions().reset_patches(reset.clone()).await.expect("reset").into_inner();
        assert_eq!((answer.revision, answer.edits), (4, 1));
    }
}

#[tokio::test]
async fn undo_redo_and_rollback_run_no_stage() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let first = daemon.remesh(&session).await.expect("remesh").mesh;
    daemon.change(&session, Some(2), size_of_count(3_000)).await.expect("change");
    let second = daemon.remesh(&session).await.expect("remesh").mesh;
    assert_ne!(first, second);
    let undone = undo(&daemon, &session, Some(3)).await.expect("undo");
    assert_eq!((undone.revision, undone.undo_steps, undone.redo_steps), (4, 2, 1));
    let hits = async |wanted: &Option<v1::MeshSummary>| {
        let result = daemon.remesh(&session).await.expect("remesh");
        assert_eq!((result.summary.expect("summary").runs, &result.mesh), (0, wanted));
    };
    hits(&first).await;
    assert_eq!(redo(&daemon, &session).await.expect("redo").revision, 5);
    hits(&second).await;
    let rollback = v1::change::Change::Rollback(v1::Rollback { to_revision: 2 });
    daemon.change(&session, None, rollback).await.expect("rollback");
    hits(&first).await;
    // A rollback is a change like any other: it can be undone, and forgets what could be redone.
    assert_refused(redo(&daemon, &session).await, Code::FailedPrecondition, "NOTHING_TO_STEP_TO");
    undo(&daemon, &session, None).await.expect("undo");
    hits(&second).await;
    let told = get(&daemon, &session).await;
    assert_eq!((told.revision, told.undo_steps, told.redo_steps), (7, 3, 1));
    assert_refused(undo(&daemon, &session, Some(3)).await, Code::Aborted, "STALE_REVISION");
    for _ in 0..3 {
        undo(&daemon, &session, None).await.expect("undo");
    }
    assert_refused(undo(&daemon, &session, None).await, Code::FailedPrecondition, "NOTHING_TO_STEP_TO");
    let gone = v1::change::Change::Rollback(v1::Rollback { to_revision: 999 });
    assert_refused(daemon.change(&session, None, gone).await, Code::InvalidArgument, "BAD_PARAMETER");
}
