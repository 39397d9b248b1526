//! Work on one patch overtakes work on whole surfaces, and plans say what it would take.

use crate::harness::{Daemon, assert_refused, size_of_count, small_config};
use remesh_proto::v1;
use tonic::Code;

/// At least this many patches.
fn in_patches(patches: u32) -> v1::change::Change {
    v1::change::Change::Partition(v1::PartitionSpec { patches: Some(patches), ..Default::default() })
}

/// A session whose charts are there and whose next remesh of one patch is short.
async fn prepared(daemon: &Daemon) -> String {
    let session = daemon.tube(4000, 3000).await;
    daemon.change(&session, None, in_patches(4)).await.expect("partition");
    daemon.remesh(&session).await.expect("remesh");
    daemon.change(&session, None, size_of_count(3500)).await.expect("size");
    // The size field is of the whole surface.
    remesh_patch(daemon, &session, 0).await;
    session
}

async fn remesh_patch(daemon: &Daemon, session: &str, patch: u32) -> v1::RemeshResult {
    let request = v1::RemeshSurfaceRequest { session: session.to_owned(), patches: vec![patch], ..Default::default() };
    let mut stream = daemon.remeshes().remesh_surface(request).await.expect("stream").into_inner();
    let mut last = None;
    while let Some(message) = stream.message().await.expect("goes on") {
        last = message.event;
    }
    match last {
        Some(v1::remesh_surface_response::Event::Result(result)) => result,
        other => panic!("no result: {other:?}"),
    }
}

#[tokio::test]
async fn one_patch_does_not_wait_for_whole_surfaces() {
    let mut config = small_config();
    (config.max_running, config.max_queued) = (1, 8);
    let daemon = Daemon::start(config).await;
    let session = prepared(&daemon).await;
    let batch = daemon.tube(150_000, 300_000).await;
    let other = daemon.tube(100_000, 200_000).await;
    let mut running = daemon.begin_remesh(&batch).await;
    running.message().await.expect("progress").expect("the only place for long work is taken");
    let waiting = daemon.begin_remesh(&other).await;
    let result = remesh_patch(&daemon, &session, 1).await;
    assert!(result.summary.is_some_and(|s| s.runs > 0), "it computed while the others did not end");
    assert!(daemon.plan(&batch).await.runs > 0, "the batch is still on");
    drop((running, waiting));
}

#[tokio::test]
async fn plans_are_of_each_request_and_estimate_time_and_memory() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(4000, 3000).await;
    daemon.change(&session, None, in_patches(4)).await.expect("partition");
    let plan = |goal: v1::PlanGoal, patches: Vec<u32>| {
        let request = v1::PlanRemeshRequest { session: session.clone(), patches, goal: goal.into(), ..Default::default() };
        let mut client = daemon.remeshes();
        async move { client.plan_remesh(request).await.map(tonic::Response::into_inner) }
    };
    for goal in [v1::PlanGoal::Unspecified, v1::PlanGoal::Partition, v1::PlanGoal::Charts, v1::PlanGoal::Quality] {
        let cold = plan(goal, vec![]).await.expect("plan");
        assert!(cold.runs > 0 && cold.estimated_milliseconds > 0.0 && cold.estimated_bytes > 0, "{goal:?} {cold:?}");
    }
    daemon.remesh(&session).await.expect("remesh");
    let warm = plan(v1::PlanGoal::Remesh, vec![]).await.expect("plan");
    assert_eq!((warm.runs, warm.estimated_milliseconds, warm.estimated_bytes), (0, 0.0, 0));
    daemon.change(&session, None, size_of_count(3300)).await.expect("size");
    let whole = plan(v1::PlanGoal::Remesh, vec![]).await.expect("plan");
    let one = plan(v1::PlanGoal::Remesh, vec![1]).await.expect("plan");
    assert!(one.runs < whole.runs && one.estimated_milliseconds < whole.estimated_milliseconds && one.estimated_milliseconds > 0.0);
    assert!(one.stages.iter().all(|s| s.subject != "patch 0" || s.outcome == i32::from(v1::StageOutcome::Hit)));
    assert_eq!(plan(v1::PlanGoal::Charts, vec![]).await.expect("plan").runs, 0);
    assert_refused(plan(v1::PlanGoal::Remesh, vec![999]).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_refused(plan(v1::PlanGoal::Charts, vec![0]).await, Code::InvalidArgument, "BAD_PARAMETER");
}
