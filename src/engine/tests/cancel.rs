//! Work that is stopped at any moment leaves caches right, and what plans estimate follows what was run.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::Reason;
use remesh_engine::fingerprint::{Contents, Fingerprint};
use remesh_engine::import::ImportOptions;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, StageRecord};
use remesh_engine::work::CancelToken;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

fn open(engine: &Engine, triangles: u64, wanted: u64) -> Arc<Session> {
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    let spec = SampleSpec { kind: SampleKind::Pelvis, triangles, genus: None, outlets: None, aspect_ratio: None };
    let mesh = Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() };
    session.apply(None, &[mesh, Change::Size(SizeSpec::TriangleCount { triangles: wanted })]).unwrap();
    session
}

fn measured(engine: &Engine, session: &Session) -> (Fingerprint, Fingerprint) {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    let answer = pipeline::quality(engine, &session.snapshot(), QualityScope::Full, &run).unwrap();
    (answer.value.0.result.fingerprint(), answer.value.1.fingerprint())
}

/// Events of a run that is cancelled when the `last` one comes; whether it was stopped.
fn stopped_at(engine: &Engine, session: &Session, last: usize) -> (usize, bool) {
    let (cancel, seen) = (CancelToken::new(), AtomicUsize::new(0));
    let events = |_: &pipeline::Event| {
        if seen.fetch_add(1, Ordering::Relaxed) + 1 == last {
            cancel.cancel();
        }
    };
    let outcome = pipeline::quality(engine, &session.snapshot(), QualityScope::Full, &Run { cancel: &cancel, events: &events, threads: 2 });
    let stopped = outcome.is_err_and(|error| {
        assert_eq!(error.reason(), Reason::Cancelled);
        true
    });
    (seen.into_inner(), stopped)
}

#[test]
fn what_is_stopped_at_any_moment_is_computed_right_afterwards() {
    let fresh = Engine::new(EngineConfig::default());
    let session = open(&fresh, 2000, 1500);
    let (all, stopped) = stopped_at(&fresh, &session, usize::MAX);
    assert!(!stopped && all > 100);
    let expected = measured(&fresh, &session);
    let mut at = 1;
    while at < all {
        let engine = Engine::new(EngineConfig::default());
        let session = open(&engine, 2000, 1500);
        assert!(stopped_at(&engine, &session, at).1, "{at} of {all}");
        // Stopped again in what is left, then carried out: leftovers of both must be of use and right.
        stopped_at(&engine, &session, at / 2 + 1);
        assert_eq!(measured(&engine, &session), expected, "stopped at event {at} of {all}");
        at += all / 9 + 1;
    }
}

fn total(records: &[StageRecord]) -> f64 {
    records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.milliseconds).sum()
}

#[test]
fn estimates_are_learnt_and_follow_the_size() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine, 6000, 3000);
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let plan = |session: &Session| pipeline::plan(&engine, &session.snapshot(), &run).unwrap();
    let first = plan(&session);
    assert!(first.iter().filter(|r| r.outcome == Outcome::Run).all(|r| r.milliseconds > 0.0 && r.bytes > 0), "{first:?}");
    let answer = pipeline::remesh(&engine, &session.snapshot(), &run).unwrap();
    assert_eq!(total(&plan(&session)), 0.0);
    let resize = |triangles| session.apply(None, &[Change::Size(SizeSpec::TriangleCount { triangles })]).unwrap();
    let meshing = |records: &[StageRecord]| -> f64 {
        let of_result = |r: &&StageRecord| ["planar", "interior", "optimize"].contains(&r.stage.name()) && r.outcome == Outcome::Run;
        records.iter().filter(of_result).map(|r| r.milliseconds).sum()
    };
    resize(3300);
    let near = plan(&session);
    // The same within rounding as what was run, scaled: the sums are weighted by size.
    let ratio = meshing(&near) / (1.1 * meshing(&answer.records));
    assert!((0.3..3.0).contains(&ratio), "{ratio}");
    resize(30_000);
    let far = meshing(&plan(&session));
    // Patches that get less than one triangle count as one.
    assert!((far / meshing(&near) - 30_000.0 / 3300.0).abs() < 0.5, "{far}");
}

#[test]
fn plans_of_single_patches_and_of_quality_tell_the_truth() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine, 6000, 3000);
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    pipeline::charts(&engine, &session.snapshot(), &run).unwrap();
    let snapshot = session.snapshot();
    let runs = |records: &[StageRecord]| -> Vec<_> {
        records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| (r.stage, r.subject)).collect()
    };
    let planned = pipeline::plan_patches(&engine, &snapshot, &[1], &run).unwrap();
    assert!(!runs(&planned).is_empty());
    let did = pipeline::remesh_patches(&engine, &snapshot, &[1], &run).unwrap();
    let (planned, did) = (runs(&planned), runs(&did.records));
    assert!(planned.iter().all(|r| did.contains(r)), "{planned:?} {did:?}");
    assert!(runs(&pipeline::plan_patches(&engine, &snapshot, &[1], &run).unwrap()).is_empty());
    let wrong = pipeline::plan_patches(&engine, &snapshot, &[9999], &run).unwrap_err();
    assert_eq!(wrong.reason(), Reason::PatchNotFound);
    let quality = pipeline::plan_quality(&engine, &snapshot, QualityScope::Full, &run).unwrap();
    assert!(runs(&quality).iter().any(|(stage, _)| stage.name() == "quality"));
    measured(&engine, &session);
    assert!(runs(&pipeline::plan_quality(&engine, &snapshot, QualityScope::Full, &run).unwrap()).is_empty());
    assert!(runs(&pipeline::plan_partition(&engine, &snapshot, &run).unwrap()).is_empty());
}
