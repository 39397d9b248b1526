//! What edits cost: revisions, cache hits, plans, undo; and reading what was computed.

use crate::harness::{Daemon, assert_refused, column, size_of_count, tube};
use remesh_proto::v1;
use remesh_proto::v1::remesh_surface_response::Event;
use tonic::Code;
use tonic_types::StatusExt;

#[tokio::test]
async fn a_second_remesh_finds_everything_in_the_cache() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let first = daemon.remesh(&session).await.expect("remesh");
    let second = daemon.remesh(&session).await.expect("remesh");
    let summary = second.summary.expect("summary");
    assert_eq!(summary.runs, 0, "{summary:?}");
    assert_eq!(first.mesh, second.mesh);
    assert_eq!(daemon.plan(&session).await.runs, 0);
    let patches: u64 = second.patches.iter().map(|p| p.triangles).sum();
    assert_eq!(patches, second.mesh.expect("mesh").faces);
}

#[tokio::test]
async fn a_size_change_keeps_partition_and_charts_and_undo_hits_everything() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let first = daemon.remesh(&session).await.expect("remesh");
    assert_eq!(daemon.change(&session, Some(2), size_of_count(3_000)).await.expect("change"), 3);
    let planned = daemon.plan(&session).await;
    assert!(planned.revision == 3 && planned.hits > 0 && planned.runs > 0);
    let second = daemon.remesh(&session).await.expect("remesh");
    let stages = second.summary.expect("summary").stages;
    let ran: Vec<_> = stages.iter().filter(|s| s.outcome() == v1::StageOutcome::Run).map(|s| s.stage.as_str()).collect();
    for kept in ["import", "topology", "features", "partition", "patches", "factor", "chart"] {
        assert!(!ran.contains(&kept), "{kept} ran again: {ran:?}");
    }
    let rollback = v1::change::Change::Rollback(v1::Rollback { to_revision: 2 });
    daemon.change(&session, Some(3), rollback).await.expect("rollback");
    let back = daemon.remesh(&session).await.expect("remesh");
    assert_eq!((back.summary.expect("summary").runs, back.mesh), (0, first.mesh));
}

#[tokio::test]
async fn quadrangles_come_with_their_quality_and_share_the_triangles() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    assert!(daemon.remesh(&session).await.expect("remesh").quads.is_none());
    let mesher = v1::MesherSpec { kind: v1::MesherKind::Quads.into(), all_quads: false, ..Default::default() };
    daemon.change(&session, None, v1::change::Change::Mesher(mesher)).await.expect("change");
    let result = daemon.remesh(&session).await.expect("remesh");
    let quads = result.quads.expect("quadrangles");
    assert_eq!(2 * quads.quads + quads.triangles, result.mesh.expect("mesh").faces);
    assert!(quads.eta_mean > 0.8 && quads.quads > 10 * quads.triangles, "{quads:?}");
    let stages = result.summary.expect("summary").stages;
    let ran: Vec<_> = stages.iter().filter(|s| s.outcome() == v1::StageOutcome::Run).map(|s| s.stage.as_str()).collect();
    assert_eq!(ran, ["quads", "quality"]);
    let mesher = v1::MesherSpec { kind: v1::MesherKind::Quads.into(), all_quads: true, ..Default::default() };
    daemon.change(&session, None, v1::change::Change::Mesher(mesher)).await.expect("change");
    assert_eq!(daemon.remesh(&session).await.expect("remesh").quads.expect("quadrangles").triangles, 0);
}

#[tokio::test]
async fn progress_tells_stages_and_grows() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let mut stream = daemon.begin_remesh(&session).await;
    let (mut total, mut stages, mut ended) = (0.0, Vec::new(), false);
    while let Some(message) = stream.message().await.expect("message") {
        assert!(message.revision == 2 && !ended, "the result is the last message");
        match message.event.expect("event") {
            Event::Progress(progress) => {
                assert!(progress.total_fraction >= total && progress.total_fraction <= 1.0);
                total = progress.total_fraction;
                stages.push(progress.stage);
            }
            Event::Result(_) => ended = true,
        }
    }
    assert!(ended && stages.iter().any(|s| s == "partition") && stages.iter().any(|s| s == "optimize"), "{stages:?}");
}

#[tokio::test]
async fn the_session_tells_its_inputs_and_mesh() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let angle = v1::FeatureSpec { sharp_edges: Some(v1::feature_spec::SharpEdges::FeatureAngle(25.0)), ..Default::default() };
    daemon.change(&session, None, v1::change::Change::Features(angle)).await.expect("change");
    let got = daemon.sessions().get_session(v1::GetSessionRequest { name: session }).await.expect("get").into_inner();
    let got = got.session.expect("session");
    let inputs = got.inputs.expect("inputs");
    assert_eq!(got.revision, 3);
    assert!(got.mesh.is_some_and(|m| m.faces > 1_000));
    assert_eq!(inputs.size.and_then(|s| s.size), Some(v1::size_spec::Size::Triangles(1_500)));
    assert_eq!(inputs.features.and_then(|f| f.sharp_edges), Some(v1::feature_spec::SharpEdges::FeatureAngle(25.0)));
}

async fn remesh_listed(daemon: &Daemon, session: &str, patches: Vec<u32>) -> Result<Option<Event>, tonic::Status> {
    let request = v1::RemeshSurfaceRequest { session: session.to_owned(), expected_revision: Some(2), patches };
    let mut stream = daemon.remeshes().remesh_surface(request).await?.into_inner();
    let mut last = None;
    while let Some(message) = stream.message().await? {
        last = message.event;
    }
    Ok(last)
}

#[tokio::test]
async fn single_patches_can_be_meshed_and_wrong_ones_are_told() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let Some(Event::Result(result)) = remesh_listed(&daemon, &session, vec![0]).await.expect("patch 0") else {
        panic!("no result");
    };
    assert!(result.mesh.is_none() && result.patches.len() == 1 && result.patches[0].triangles > 0);
    assert_refused(remesh_listed(&daemon, &session, vec![999]).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_refused(remesh_listed(&daemon, &session, vec![0, 0]).await, Code::InvalidArgument, "BAD_PARAMETER");
}

async fn partition(daemon: &Daemon, session: &str) -> v1::PartitionResult {
    let request = v1::PartitionSurfaceRequest { session: session.to_owned(), ..Default::default() };
    let mut stream = daemon.partitions().partition_surface(request).await.expect("partition").into_inner();
    let mut partition = None;
    while let Some(message) = stream.message().await.expect("message") {
        if let Some(v1::partition_surface_response::Event::Result(result)) = message.event {
            partition = Some(result);
        }
    }
    partition.expect("result")
}

#[tokio::test]
async fn the_partition_has_patches_that_can_be_mapped() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    daemon.import(&session, tube(2_000)).await.expect("import");
    let partition = partition(&daemon, &session).await;
    assert!(partition.patches.iter().all(|p| p.genus == 0 && p.loops >= 1 && p.box_aspect_ratio > 0.0));
    assert_eq!(partition.strategy(), v1::PartitionStrategy::Multilevel);
    assert!(!partition.reason.is_empty() && partition.plane.is_none());
}

#[tokio::test]
async fn every_strategy_can_be_asked_for_and_is_told() {
    use v1::PartitionStrategy as Strategy;
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let kind = v1::SampleKind::Pelvis.into();
    let pelvis = v1::SampleSpec { kind, triangles: Some(4_000), genus: Some(2), ..Default::default() };
    daemon.import(&session, v1::import_mesh_request::Source::Sample(pelvis)).await.expect("import");
    let change = |spec| v1::change::Change::Partition(spec);
    for strategy in [Strategy::Auto, Strategy::Multilevel, Strategy::Laplace, Strategy::Handles, Strategy::Pants, Strategy::Plane] {
        let spec = v1::PartitionSpec { strategy: strategy.into(), ..Default::default() };
        daemon.change(&session, None, change(spec)).await.expect("change");
        let told = partition(&daemon, &session).await;
        if strategy == Strategy::Auto {
            assert!(told.strategy() != Strategy::Auto && told.reason.contains("patches"), "{}", told.reason);
            continue;
        }
        assert_eq!(told.strategy(), strategy);
        assert!(told.patches.len() > 1 && told.patches.iter().all(|p| p.genus == 0 && p.loops >= 1), "{strategy:?}");
        assert_eq!(told.plane.is_some(), strategy == Strategy::Plane, "the plane found is told");
    }
    // A given plane, shortest borders; the session tells them.
    let point = |x: f64, y: f64, z: f64| Some(v1::Point { x, y, z });
    let plane = v1::CutPlane { point: point(0.0, 0.0, 0.0), normal: point(1.0, 0.0, 0.0) };
    let borders = v1::PartitionBorders::Shortest.into();
    let spec = v1::PartitionSpec { strategy: Strategy::Plane.into(), plane: Some(plane), borders, ..Default::default() };
    daemon.change(&session, None, change(spec)).await.expect("change");
    assert_eq!(partition(&daemon, &session).await.plane, Some(plane));
    let got = daemon.sessions().get_session(v1::GetSessionRequest { name: session.clone() }).await.expect("get").into_inner();
    let inputs = got.session.and_then(|s| s.inputs).and_then(|i| i.partition).expect("partition");
    assert_eq!((inputs.plane, inputs.strategy(), inputs.borders), (Some(plane), Strategy::Plane, borders));
    // What cannot be is refused, with the field.
    let flat = v1::CutPlane { normal: point(0.0, 0.0, 0.0), ..plane };
    let odd = v1::CutPlane { point: point(f64::NAN, 0.0, 0.0), ..plane };
    for (strategy, plane, field) in [
        (Strategy::Handles, plane, "partition.plane"),
        (Strategy::Unspecified, plane, "partition.plane"),
        (Strategy::Plane, flat, "partition.plane.normal"),
        (Strategy::Plane, odd, "partition.plane.point"),
    ] {
        let spec = v1::PartitionSpec { strategy: strategy.into(), plane: Some(plane), ..Default::default() };
        let status = assert_refused(daemon.change(&session, None, change(spec)).await, Code::InvalidArgument, "BAD_PARAMETER");
        assert_eq!(status.get_error_details().bad_request().expect("violations").field_violations[0].field, field);
    }
}

#[tokio::test]
async fn charts_and_patches_can_be_read() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    daemon.import(&session, tube(2_000)).await.expect("import");
    let request = v1::ReadChartDataRequest { session: session.clone(), ..Default::default() };
    let mut stream = daemon.charts().read_chart_data(request).await.expect("chart").into_inner();
    let (mut header, mut chunks) = (None, Vec::new());
    while let Some(message) = stream.message().await.expect("message") {
        match message.part.expect("part") {
            v1::read_chart_data_response::Part::Header(first) => header = first.chart,
            v1::read_chart_data_response::Part::Chunk(chunk) => chunks.push(chunk),
        }
    }
    let header = header.expect("header");
    let uv = column(&chunks, v1::DataColumn::Uv);
    let uv: Vec<f64> = uv.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let corners = column(&chunks, v1::DataColumn::Triangles);
    let corners: Vec<usize> = corners.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b) as usize).collect();
    assert_eq!((uv.len() as u64, corners.len() as u64), (2 * header.vertices, 3 * header.faces));
    for t in corners.as_chunks::<3>().0 {
        let [a, b, c] = t.map(|v| (uv[2 * v], uv[2 * v + 1]));
        assert!((b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0) > 0.0, "charts are counter-clockwise");
    }
    let request = v1::ReadPatchDataRequest { session, ..Default::default() };
    let mut stream = daemon.partitions().read_patch_data(request).await.expect("patch").into_inner();
    let first = stream.message().await.expect("message").expect("header");
    let Some(v1::read_patch_data_response::Part::Header(patch)) = first.part else { panic!("no header") };
    assert_eq!((patch.vertices, patch.faces), (header.vertices, header.faces));
}

#[tokio::test]
async fn quality_is_measured_in_both_scopes() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    for (scope, full) in [(v1::QualityScope::Elements, false), (v1::QualityScope::Full, true)] {
        let request = v1::GetQualityRequest { session: session.clone(), expected_revision: Some(2), scope: scope.into() };
        let report = daemon.qualities().get_quality(request).await.expect("quality").into_inner().report.expect("report");
        assert_eq!((report.fidelity.is_some(), report.self_intersections.is_some()), (full, full));
        assert!(report.topology_kept && report.shape.is_some_and(|s| s.kappa_mean > 0.8 && s.tau.is_some()));
    }
}
