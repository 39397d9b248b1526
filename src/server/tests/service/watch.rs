//! Streams of events: two clients see each other's edits, readers go on where they were, and no reader stalls the work.

use crate::harness::{Daemon, assert_refused, size_of_count, small_config};
use remesh_proto::v1;
use std::time::Duration;
use tonic::transport::Endpoint;
use tonic::{Code, Streaming};
use v1::session_service_client::SessionServiceClient;
use v1::watch_session_request::Start;
use v1::watch_session_response::Event;

type Events = Streaming<v1::WatchSessionResponse>;

async fn watch(daemon: &Daemon, session: &str, start: Option<Start>, without_stages: bool) -> Result<Events, tonic::Status> {
    let request = v1::WatchSessionRequest { session: session.to_owned(), start, without_stages };
    daemon.sessions().watch_session(request).await.map(tonic::Response::into_inner)
}

async fn next(events: &mut Events) -> v1::WatchSessionResponse {
    let next = tokio::time::timeout(Duration::from_secs(60), events.message()).await.expect("in time");
    next.expect("message").expect("an event")
}

fn revision(event: &v1::WatchSessionResponse) -> (u64, Vec<&str>) {
    match event.event.as_ref().expect("event") {
        Event::RevisionMade(made) => (event.revision, made.changes.iter().map(String::as_str).collect()),
        other => panic!("no revision: {other:?}"),
    }
}

#[tokio::test]
async fn two_clients_see_each_others_edits() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let mut one = watch(&daemon, &session, None, true).await.expect("watch");
    let mut other = watch(&daemon, &session, None, true).await.expect("watch");
    daemon.change(&session, Some(0), size_of_count(1_000)).await.expect("change of the one");
    daemon.change(&session, Some(1), v1::change::Change::Features(v1::FeatureSpec::default())).await.expect("change of the other");
    daemon.sessions().undo_change(v1::UndoChangeRequest { session: session.clone(), ..Default::default() }).await.expect("undo");
    for events in [&mut one, &mut other] {
        assert_eq!(revision(&next(events).await), (1, vec!["size"]));
        assert_eq!(revision(&next(events).await), (2, vec!["features"]));
        assert_eq!(revision(&next(events).await), (3, vec!["undo"]));
    }
    daemon.sessions().delete_session(v1::DeleteSessionRequest { name: session.clone() }).await.expect("delete");
    for events in [&mut one, &mut other] {
        let closed = v1::SessionClosed { reason: v1::SessionEnd::Deleted.into() };
        assert_eq!(next(events).await.event, Some(Event::SessionClosed(closed)));
        assert!(events.message().await.expect("end").is_none(), "the stream ends with the session");
    }
    assert_refused(watch(&daemon, &session, None, true).await.map(drop), Code::NotFound, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn work_is_told_with_hits_and_runs_and_a_reader_goes_on_where_it_was() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let mut events = watch(&daemon, &session, Some(Start::AfterRevision(2)), false).await.expect("watch");
    daemon.remesh(&session).await.expect("remesh");
    daemon.remesh(&session).await.expect("remesh");
    let (mut ends, mut sequences, mut outcomes) = (Vec::new(), Vec::new(), Vec::new());
    while ends.len() < 2 {
        let event = next(&mut events).await;
        assert_eq!(event.revision, 2);
        sequences.push(event.sequence);
        match event.event.expect("event") {
            Event::StageMoved(moved) => outcomes.push((moved.call, moved.progress.expect("progress").outcome())),
            Event::WorkEnded(end) => ends.push(end),
            other => panic!("{other:?}"),
        }
    }
    assert!(sequences.windows(2).all(|w| w[1] == w[0] + 1), "nothing is missing");
    assert!(ends.iter().all(|end| end.method == "RemeshSurface" && end.code == 0 && end.reason.is_empty()));
    let count = |call, outcome| outcomes.iter().filter(|o| **o == (call, outcome)).count();
    assert!(count(ends[0].call, v1::StageOutcome::Run) > 5);
    assert_eq!(count(ends[1].call, v1::StageOutcome::Run), 0, "the second finds all of it");
    assert!(count(ends[1].call, v1::StageOutcome::Hit) > 5);
    // A connection that broke: the reader names the last event it has.
    let middle = sequences[sequences.len() / 2];
    drop(events);
    let mut again = watch(&daemon, &session, Some(Start::AfterSequence(middle)), false).await.expect("watch");
    for wanted in middle + 1..=*sequences.last().expect("events") {
        assert_eq!(next(&mut again).await.sequence, wanted);
    }
}

#[tokio::test]
async fn errors_of_work_are_told() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 400).await;
    let mut events = watch(&daemon, &session, None, true).await.expect("watch");
    let bad = v1::RemeshSurfaceRequest { session: session.clone(), patches: vec![999], ..Default::default() };
    let mut stream = daemon.remeshes().remesh_surface(bad).await.expect("stream").into_inner();
    while let Ok(Some(_)) = stream.message().await {}
    let Some(Event::WorkEnded(end)) = next(&mut events).await.event else { panic!("no end of work") };
    assert_eq!((end.code, end.reason.as_str()), (Code::NotFound as i32, "PATCH_NOT_FOUND"));
}

#[tokio::test]
async fn a_reader_that_never_reads_stalls_nothing_and_is_told_what_it_missed() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 400).await;
    // A connection that buffers little, with three streams that nobody reads.
    let slow = Endpoint::from_shared(format!("http://{}", daemon.address)).expect("uri").initial_stream_window_size(64 << 10);
    let mut slow = SessionServiceClient::new(slow.connect().await.expect("connects"));
    let request = v1::WatchSessionRequest { session: session.clone(), ..Default::default() };
    let mut streams = Vec::new();
    for _ in 0..3 {
        streams.push(slow.watch_session(request.clone()).await.expect("watch").into_inner());
    }
    let mut idle = streams.pop().expect("three");
    // More than the transport buffers and the ring keeps.
    let name = "x".repeat(64);
    for n in 0..3_000u64 {
        let change = Some(v1::Change { change: Some(size_of_count(400 + n)) });
        let request_id = format!("{}{n:06}", &name[..58]);
        let request = v1::ApplyChangeRequest { session: session.clone(), base_revision: Some(2 + n), change, request_id };
        daemon.sessions().apply_change(request).await.expect("an edit is never held up");
    }
    daemon.remesh(&session).await.expect("nor is work");
    drop(streams);
    let (mut missed, mut last) = (0, 0);
    while last < 3_002 {
        let event = next(&mut idle).await;
        match event.event.expect("event") {
            Event::Lagged(lagged) => missed += lagged.missed,
            _ => last = event.revision,
        }
    }
    assert!(missed > 1_000, "{missed}");
}

#[tokio::test]
async fn watching_is_bounded_and_ends_with_the_daemon() {
    let mut config = small_config();
    config.max_watchers = 1;
    let mut daemon = Daemon::start(config).await;
    let session = daemon.session().await;
    let mut events = watch(&daemon, &session, None, false).await.expect("the first");
    assert_refused(watch(&daemon, &session, None, false).await.map(drop), Code::ResourceExhausted, "LIMIT_REACHED");
    daemon.stop.take().expect("running").send(()).expect("server listens");
    let closed = v1::SessionClosed { reason: v1::SessionEnd::Shutdown.into() };
    assert_eq!(next(&mut events).await.event, Some(Event::SessionClosed(closed)));
    assert!(events.message().await.expect("end").is_none());
    daemon.served.await.expect("no panic").expect("served");
}

#[tokio::test]
async fn a_deadline_ends_a_stream_of_events() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let mut request = tonic::Request::new(v1::WatchSessionRequest { session, ..Default::default() });
    request.set_timeout(std::time::Duration::from_millis(200));
    let mut stream = daemon.sessions().watch_session(request).await.expect("stream").into_inner();
    let next = tokio::time::timeout(std::time::Duration::from_secs(20), stream.message());
    assert_refused(next.await.expect("it ends"), Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
}
