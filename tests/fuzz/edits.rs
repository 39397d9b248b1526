//! Random edit scripts on a session, with work in between that is sometimes cancelled: what comes out is what a fresh engine makes of the
//! same inputs, bit for bit, errors included.

use crate::for_a_while;
use crate::random::Random;
use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::Reason;
use remesh_engine::features::FeatureSpec;
use remesh_engine::fingerprint::{Contents, Fingerprint};
use remesh_engine::import::ImportOptions;
use remesh_engine::optimize::OptimizeSpec;
use remesh_engine::parametrize::{ChartMethod, ChartSpec};
use remesh_engine::partition::{PartitionSpec, PartitionStrategy, PatchRequest, SplitMethod};
use remesh_engine::pipeline::{self, Run};
use remesh_engine::planar::{Mesher, QuadKind};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, Edit, MeshSource, Revision, Session, Snapshot};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::work::CancelToken;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

fn remeshed(engine: &Engine, snapshot: &Snapshot, threads: usize) -> Result<Fingerprint, Reason> {
    let cancel = CancelToken::new();
    let answer = pipeline::remesh(engine, snapshot, &Run { cancel: &cancel, events: &|_| {}, threads });
    answer.map(|a| a.value.result.fingerprint()).map_err(|e| e.reason())
}

/// Runs until a random event.
fn cancelled(engine: &Engine, snapshot: &Snapshot, random: &mut Random) {
    let (cancel, seen, last) = (CancelToken::new(), AtomicUsize::new(0), 1 + random.below(120));
    let events = |_: &pipeline::Event| {
        if seen.fetch_add(1, Ordering::Relaxed) == last {
            cancel.cancel();
        }
    };
    let _ = pipeline::remesh(engine, snapshot, &Run { cancel: &cancel, events: &events, threads: 2 });
}

/// The optimisation takes most of the time, above all the search for better triangles where a size is coarser than the shape: few scripts have all
/// of it.
fn optimize(random: &mut Random) -> Change {
    let rounds = *random.pick(&[0, 0, 0, 0, 0, 1, 1, 3]);
    let usual = OptimizeSpec::default();
    Change::Optimize(OptimizeSpec { rounds, min_kappa: *random.pick(&[0.05, 0.05, 0.05, 0.05, 0.2, usual.min_kappa]), ..usual })
}

fn mesh(random: &mut Random) -> Change {
    let kind = *random.pick(&[SampleKind::Tube, SampleKind::Tube, SampleKind::CadPart]);
    let spec = SampleSpec { kind, triangles: 60 + random.below(100) as u64, genus: None, outlets: None, aspect_ratio: None };
    Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() }
}

fn change(random: &mut Random) -> Change {
    match random.below(9) {
        0 => mesh(random),
        1 => Change::Features(FeatureSpec {
            feature_angle_deg: *random.pick(&[None, Some(20.0), Some(40.0), Some(60.0)]),
            ..FeatureSpec::default()
        }),
        2 => {
            use PartitionStrategy::{Auto, Handles, Laplace, Multilevel};
            let strategy = *random.pick(&[Auto, Multilevel, Laplace, Handles]);
            Change::Partition(PartitionSpec { strategy, patches: random.one_in(2).then_some(4), ..PartitionSpec::default() })
        }
        3 => {
            let method = *random.pick(&[None, Some(ChartMethod::MeanValue), Some(ChartMethod::LeastSquaresConformal)]);
            Change::Chart(ChartSpec { method, ..ChartSpec::default() })
        }
        4 | 5 => Change::Size(SizeSpec::TriangleCount { triangles: 40 + random.below(80) as u64 }),
        6 => Change::Mesher(*random.pick(&[
            Mesher::Frontal,
            Mesher::MeshAdapt,
            Mesher::Delaunay { min_angle_deg: 20.0 },
            Mesher::Quads(QuadKind::Mixed),
        ])),
        7 => optimize(random),
        _ => Change::ResetPatchEdits,
    }
}

/// Splits or merges patches as they are now; what cannot be edited is left alone.
fn edit_patches(engine: &Engine, session: &Session, random: &mut Random) {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let snapshot = session.snapshot();
    let Ok(layout) = pipeline::layout(engine, &snapshot, &run) else { return };
    let patch = random.below(layout.value.charts.len()) as u32;
    let request = if random.one_in(2) {
        PatchRequest::Split { patch, method: SplitMethod::Balanced }
    } else {
        PatchRequest::Merge { patches: vec![patch, patch.wrapping_add(1)] }
    };
    match pipeline::edit_patches(engine, &snapshot, &request, &run) {
        Ok(edited) => drop(session.apply(None, &[Change::PatchEdit(edited.value.edit)])),
        Err(error) => assert_ne!(error.reason(), Reason::Invariant, "{error}"),
    }
}

fn own_chart(engine: &Engine, session: &Session, random: &mut Random) {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let Ok(layout) = pipeline::layout(engine, &session.snapshot(), &run) else { return };
    let patch = *random.pick(&layout.value.patches.identities);
    let method = *random.pick(&[None, Some(ChartMethod::MeanValue), Some(ChartMethod::Harmonic)]);
    let spec = random.one_in(4).then_some(ChartSpec { method, ..ChartSpec::default() });
    let _ = session.apply(None, &[Change::PatchChart { patch, spec }]);
}

#[test]
fn edited_sessions_equal_fresh_ones() {
    for_a_while("edit scripts", |seed| {
        let mut random = Random::new(seed);
        let small = EngineConfig { cache_bytes: 1 << 20, ..EngineConfig::default() };
        let engine = Engine::new(if random.one_in(3) { small } else { EngineConfig::default() });
        let session = engine.create_session(None, SystemTime::now()).expect("session");
        let size = Change::Size(SizeSpec::TriangleCount { triangles: 60 });
        session.apply(None, &[mesh(&mut random), size, optimize(&mut random)]).expect("inputs");
        for _ in 0..3 + random.below(8) {
            match random.below(10) {
                0 => drop(session.edit(None, Edit::Undo, |_| Ok(()), |_| ())),
                1 => drop(session.edit(None, Edit::Redo, |_| Ok(()), |_| ())),
                2 => drop(session.apply(None, &[Change::Rollback(Revision(random.below(12) as u64))])),
                3 | 4 => edit_patches(&engine, &session, &mut random),
                5 => own_chart(&engine, &session, &mut random),
                _ => drop(session.apply(None, &[change(&mut random)])),
            }
            match random.below(3) {
                0 => drop(remeshed(&engine, &session.snapshot(), 2)),
                1 => cancelled(&engine, &session.snapshot(), &mut random),
                _ => {}
            }
        }
        let snapshot = session.snapshot();
        let edited = remeshed(&engine, &snapshot, 2);
        let fresh = remeshed(&Engine::new(EngineConfig::default()), &snapshot, 1);
        assert_eq!(edited, fresh, "seed {seed}: {snapshot:?}");
        assert_ne!(edited, Err(Reason::Invariant), "seed {seed}: {snapshot:?}");
    });
}
