//! Planar meshers and the metric over the wire.

use crate::harness::{Daemon, assert_refused};
use remesh_proto::v1;
use tonic::Code;
use tonic_types::StatusExt;

fn mesher(kind: v1::MesherKind, min_angle: Option<f64>, metric: Option<v1::MetricSpec>) -> v1::change::Change {
    v1::change::Change::Mesher(v1::MesherSpec { kind: kind.into(), min_angle, metric, ..Default::default() })
}

#[tokio::test]
async fn each_mesher_makes_a_mesh_and_the_metric_is_a_stage_of_its_own() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(2_000, 1_500).await;
    let frontal = daemon.remesh(&session).await.expect("remesh");
    let metric = v1::MetricSpec {
        source: Some(v1::metric_spec::Source::Curvature(v1::CurvatureMetric { deviation: None, normal_angle: Some(15.0) })),
        max_stretch: Some(4.0),
        ..Default::default()
    };
    let cases = [
        mesher(v1::MesherKind::Delaunay, Some(25.0), None),
        mesher(v1::MesherKind::MeshAdapt, None, None),
        mesher(v1::MesherKind::Anisotropic, None, Some(metric)),
    ];
    for (i, change) in cases.into_iter().enumerate() {
        daemon.change(&session, None, change).await.expect("change");
        let result = daemon.remesh(&session).await.expect("remesh");
        assert_ne!(result.mesh, frontal.mesh);
        let ran: Vec<String> = result.summary.expect("summary").stages.into_iter().map(|s| s.stage).collect();
        assert_eq!(ran.iter().any(|s| s == "metric"), i == 2, "{ran:?}");
        assert!(result.shape.and_then(|s| s.tau).is_some_and(|tau| tau > 80.0));
    }
    daemon.change(&session, None, mesher(v1::MesherKind::Frontal, None, None)).await.expect("change");
    assert_eq!(daemon.remesh(&session).await.expect("remesh").summary.expect("summary").runs, 0, "the first result is still there");
}

#[tokio::test]
async fn options_of_other_meshers_are_refused_by_name() {
    let daemon = Daemon::usual().await;
    let session = daemon.tube(500, 300).await;
    let metric = |max_stretch| Some(v1::MetricSpec { max_stretch: Some(max_stretch), ..Default::default() });
    let cases = [
        (mesher(v1::MesherKind::Frontal, Some(20.0), None), "mesher.min_angle"),
        (mesher(v1::MesherKind::Delaunay, Some(40.0), None), "mesher.min_angle"),
        (mesher(v1::MesherKind::MeshAdapt, None, metric(3.0)), "mesher.metric"),
        (mesher(v1::MesherKind::Anisotropic, None, metric(0.5)), "mesher.metric.max_stretch"),
    ];
    for (change, field) in cases {
        let status = assert_refused(daemon.change(&session, None, change).await, Code::InvalidArgument, "BAD_PARAMETER");
        assert_eq!(status.get_error_details().bad_request().expect("violations").field_violations[0].field, field);
    }
    // As many tensors as vertices: found when the mesh is known.
    let few = v1::PackedArray { data: Some(v1::packed_array::Data::Inline(vec![0; 48].into())) };
    let metric = v1::MetricSpec { source: Some(v1::metric_spec::Source::Tensors(few)), ..Default::default() };
    daemon.change(&session, None, mesher(v1::MesherKind::Anisotropic, None, Some(metric))).await.expect("change");
    let status = daemon.remesh(&session).await.expect_err("one tensor for many vertices");
    assert_eq!(status.code(), Code::InvalidArgument, "{status:?}");
}
