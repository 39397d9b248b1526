//! What is recomputed after an edit, and that an edited session equals a fresh one bit for bit.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::features::FeatureSpec;
use remesh_engine::fingerprint::{Contents, Fingerprint};
use remesh_engine::import::ImportOptions;
use remesh_engine::metric::{MetricSource, MetricSpec};
use remesh_engine::optimize::{OptimizeSpec, SurfaceFit};
use remesh_engine::parametrize::{ChartMethod, ChartSpec};
use remesh_engine::partition::PartitionSpec;
use remesh_engine::pipeline::{self, Event, Progress, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource, Revision, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, Stage, StageRecord};
use remesh_engine::work::CancelToken;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

fn engine() -> Arc<Engine> {
    Engine::new(EngineConfig::default())
}

fn sample(kind: SampleKind, triangles: u64) -> SampleSpec {
    SampleSpec { kind, triangles, genus: None, outlets: None, aspect_ratio: None }
}

fn mesh(spec: SampleSpec) -> Change {
    Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() }
}

fn open(engine: &Engine, changes: &[Change]) -> Arc<Session> {
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    session.apply(None, changes).unwrap();
    session
}

fn remesh(engine: &Engine, session: &Session, threads: usize) -> (Fingerprint, Vec<StageRecord>) {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads };
    let answer = pipeline::remesh(engine, &session.snapshot(), &run).unwrap();
    (answer.value.result.value.fingerprint(), answer.records)
}

fn ran(records: &[StageRecord]) -> BTreeSet<&'static str> {
    records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.stage.name()).collect()
}

fn pelvis() -> [Change; 2] {
    [mesh(sample(SampleKind::Pelvis, 6000)), Change::Size(SizeSpec::TriangleCount { triangles: 3000 })]
}

#[test]
fn a_second_remesh_runs_nothing() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    let (first, records) = remesh(&engine, &session, 2);
    let stages: BTreeSet<Stage> = records.iter().map(|r| r.stage).collect();
    let measures = [Stage::Curvature, Stage::Proximity, Stage::Thickness, Stage::Centerline];
    let asked_for = [&measures[..], &[Stage::Metric, Stage::Quads, Stage::Quality]].concat();
    let usual: BTreeSet<Stage> = Stage::ALL.into_iter().filter(|s| !asked_for.contains(s)).collect();
    assert_eq!(stages, usual);
    let (second, records) = remesh(&engine, &session, 2);
    assert_eq!(first, second);
    assert_eq!(ran(&records), BTreeSet::new());
}

#[test]
fn another_metric_neither_partitions_nor_parametrizes() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    let (mut before, _) = remesh(&engine, &session, 2);
    let below = BTreeSet::from(["metric", "curve", "planar", "lift", "assembly", "optimize"]);
    for normal_angle_deg in [25.0, 15.0] {
        let source = MetricSource::Curvature { deviation: None, normal_angle_deg: Some(normal_angle_deg) };
        session.apply(None, &[Change::Anisotropic(MetricSpec { source, ..MetricSpec::default() })]).unwrap();
        let cancel = CancelToken::new();
        let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
        let planned = pipeline::plan(&engine, &session.snapshot(), &run).unwrap();
        assert!(planned.iter().any(|r| r.stage == Stage::Metric && r.outcome == Outcome::Run));
        let (result, records) = remesh(&engine, &session, 2);
        assert!(ran(&records).is_subset(&below) && ran(&records).contains("planar"), "{:?}", ran(&records));
        assert_ne!(result, before);
        before = result;
    }
}

#[test]
fn another_size_neither_partitions_nor_parametrizes() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    remesh(&engine, &session, 2);
    session.apply(None, &[Change::Size(SizeSpec::TriangleCount { triangles: 5000 })]).unwrap();
    let (_, records) = remesh(&engine, &session, 2);
    assert_eq!(ran(&records), BTreeSet::from(["size", "curve", "planar", "lift", "interior", "assembly", "optimize"]));
}

#[test]
fn optimisation_options_run_the_optimisation_only() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    remesh(&engine, &session, 2);
    session.apply(None, &[Change::Optimize(OptimizeSpec { rounds: 2, ..OptimizeSpec::default() })]).unwrap();
    assert_eq!(ran(&remesh(&engine, &session, 2).1), BTreeSet::from(["interior", "assembly", "optimize"]));
    session.apply(None, &[Change::Optimize(OptimizeSpec { rounds: 2, fit: SurfaceFit::Vertices, ..OptimizeSpec::default() })]).unwrap();
    assert_eq!(ran(&remesh(&engine, &session, 2).1), BTreeSet::from(["optimize"]));
}

#[test]
fn another_method_keeps_the_factor_and_the_curves() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    remesh(&engine, &session, 2);
    session.apply(None, &[Change::Chart(ChartSpec::only(ChartMethod::LeastSquaresConformal))]).unwrap();
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    match pipeline::remesh(&engine, &session.snapshot(), &run) {
        Ok(answer) => {
            let ran = ran(&answer.records);
            assert!(!ran.contains("factor") && !ran.contains("partition") && !ran.contains("curve"), "{ran:?}");
            assert!(ran.contains("chart") && ran.contains("planar"));
        }
        // An explicit method is honoured or refused, never replaced.
        Err(error) => assert_eq!(error.reason(), remesh_engine::error::Reason::ChartFailed),
    }
}

#[test]
fn an_edit_that_changes_nothing_ends_the_wave() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    remesh(&engine, &session, 2);
    // Another angle, the same edges: features run, nothing below does.
    let spec = FeatureSpec { feature_angle_deg: Some(178.0), ..FeatureSpec::default() };
    session.apply(None, &[Change::Features(spec.clone())]).unwrap();
    remesh(&engine, &session, 2);
    session.apply(None, &[Change::Features(FeatureSpec { feature_angle_deg: Some(179.0), ..spec })]).unwrap();
    assert_eq!(ran(&remesh(&engine, &session, 2).1), BTreeSet::from(["features"]));
}

#[test]
fn undo_is_free() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    let (first, _) = remesh(&engine, &session, 2);
    session.apply(None, &[Change::Partition(PartitionSpec { patches: Some(12), ..PartitionSpec::default() })]).unwrap();
    let (other, records) = remesh(&engine, &session, 2);
    assert!(ran(&records).contains("partition"));
    assert_ne!(first, other);
    session.apply(None, &[Change::Rollback(Revision(1))]).unwrap();
    let (back, records) = remesh(&engine, &session, 2);
    assert_eq!(first, back);
    assert_eq!(ran(&records), BTreeSet::new());
}

#[test]
fn equal_work_is_shared_between_sessions() {
    let engine = engine();
    let (a, b) = (open(&engine, &pelvis()), open(&engine, &pelvis()));
    remesh(&engine, &a, 2);
    assert_eq!(ran(&remesh(&engine, &b, 2).1), BTreeSet::new());
}

#[test]
fn an_edited_session_equals_a_fresh_one_and_threads_do_not_matter() {
    let edits = [
        vec![Change::Size(SizeSpec::TriangleCount { triangles: 2000 })],
        vec![Change::Partition(PartitionSpec { patches: Some(6), ..PartitionSpec::default() })],
        vec![Change::Features(FeatureSpec { feature_angle_deg: None, ..FeatureSpec::default() })],
        vec![mesh(sample(SampleKind::CadPart, 4000)), Change::Features(FeatureSpec::default())],
    ];
    let engine_edited = engine();
    let edited = open(&engine_edited, &pelvis());
    let mut script: Vec<Change> = pelvis().to_vec();
    for edit in edits {
        edited.apply(None, &edit).unwrap();
        script.extend(edit);
        let (incremental, _) = remesh(&engine_edited, &edited, 2);
        let fresh_engine = engine();
        let (from_scratch, _) = remesh(&fresh_engine, &open(&fresh_engine, &script), 1);
        assert_eq!(incremental, from_scratch, "after {} changes", script.len());
    }
}

#[test]
fn a_plan_tells_the_truth() {
    let engine = engine();
    let session = open(&engine, &pelvis());
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let runs_before = engine.cache.usage().runs;
    let cold = pipeline::plan(&engine, &session.snapshot(), &run).unwrap();
    assert_eq!(engine.cache.usage().runs, runs_before, "a plan computes nothing");
    assert!(cold.iter().all(|r| r.outcome == Outcome::Run) && cold.iter().any(|r| r.stage == Stage::Import));
    remesh(&engine, &session, 1);
    session.apply(None, &[Change::Size(SizeSpec::TriangleCount { triangles: 2500 })]).unwrap();
    let planned = pipeline::plan(&engine, &session.snapshot(), &run).unwrap();
    let hits = |records: &[StageRecord]| -> BTreeSet<(Stage, String)> {
        records.iter().filter(|r| r.outcome == Outcome::Hit).map(|r| (r.stage, format!("{:?}", r.subject))).collect()
    };
    let planned_hits = hits(&planned);
    let (_, records) = remesh(&engine, &session, 1);
    assert_eq!(planned_hits, hits(&records));
    let warm = pipeline::plan(&engine, &session.snapshot(), &run).unwrap();
    assert!(warm.iter().all(|r| r.outcome == Outcome::Hit));
}

#[test]
fn cancelled_work_stops_and_leaves_a_usable_cache() {
    let reference = {
        let engine = engine();
        remesh(&engine, &open(&engine, &pelvis()), 1).0
    };
    let engine = engine();
    let session = open(&engine, &pelvis());
    // Cancel at the first, second, third... report, until a run gets through.
    for at in 0.. {
        let cancel = CancelToken::new();
        let seen = AtomicUsize::new(0);
        let events = |event: &Event| {
            if matches!(event.progress, Progress::Started | Progress::Fraction(_)) && seen.fetch_add(1, Ordering::Relaxed) == at * 3 {
                cancel.cancel();
            }
        };
        let run = Run { cancel: &cancel, events: &events, threads: 2 };
        match pipeline::remesh(&engine, &session.snapshot(), &run) {
            Err(error) => assert_eq!(error.reason(), remesh_engine::error::Reason::Cancelled),
            Ok(answer) => {
                assert_eq!(answer.value.result.value.fingerprint(), reference);
                break;
            }
        }
        assert!(at < 2000, "never got through");
    }
    assert_eq!(remesh(&engine, &session, 1).0, reference);
}

#[test]
fn a_tiny_cache_changes_nothing_but_time() {
    let roomy = engine();
    let expected = remesh(&roomy, &open(&roomy, &pelvis()), 1).0;
    let tiny = Engine::new(EngineConfig { cache_bytes: 10_000, ..EngineConfig::default() });
    let session = open(&tiny, &pelvis());
    assert_eq!(remesh(&tiny, &session, 2).0, expected);
    assert_eq!(remesh(&tiny, &session, 2).0, expected);
    tiny.cache.trim();
    assert!(tiny.cache.usage().bytes <= 10_000);
}

#[test]
fn what_is_missing_is_said() {
    let engine = engine();
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let empty = engine.create_session(None, SystemTime::now()).unwrap();
    let error = pipeline::remesh(&engine, &empty.snapshot(), &run).unwrap_err();
    assert_eq!(error.reason(), remesh_engine::error::Reason::NoMesh);
    let no_size = open(&engine, &[mesh(sample(SampleKind::Tube, 500))]);
    let error = pipeline::quality(&engine, &no_size.snapshot(), QualityScope::Elements, &run).unwrap_err();
    assert_eq!(error.reason(), remesh_engine::error::Reason::BadParameter);
    let sized = open(&engine, &[mesh(sample(SampleKind::Tube, 500)), Change::Size(SizeSpec::TriangleCount { triangles: 300 })]);
    let error = pipeline::remesh_patches(&engine, &sized.snapshot(), &[9999], &run).unwrap_err();
    assert_eq!(error.reason(), remesh_engine::error::Reason::PatchNotFound);
}
