//! Edits of patches in a session: what runs after one, that an edited session equals a fresh one, undo, and edits that wait.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::fingerprint::{Contents, Fingerprint};
use remesh_engine::import::ImportOptions;
use remesh_engine::partition::{EditState, PartitionSpec, PatchRequest, SplitMethod};
use remesh_engine::pipeline::{self, Layout, Run};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MAX_PATCH_EDITS, MeshSource, Revision, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, Stage, StageRecord, Subject};
use remesh_engine::work::CancelToken;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::SystemTime;

fn open(engine: &Engine) -> Arc<Session> {
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    let spec = SampleSpec { kind: SampleKind::Pelvis, triangles: 6000, genus: None, outlets: None, aspect_ratio: None };
    let mesh = Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() };
    let partition = Change::Partition(PartitionSpec { patches: Some(16), ..PartitionSpec::default() });
    session.apply(None, &[mesh, partition, Change::Size(SizeSpec::TriangleCount { triangles: 3000 })]).unwrap();
    session
}

fn with_run<T>(threads: usize, call: impl FnOnce(&Run<'_>) -> T) -> T {
    let cancel = CancelToken::new();
    call(&Run { cancel: &cancel, events: &|_| {}, threads })
}

fn remesh(engine: &Engine, session: &Session, threads: usize) -> (Fingerprint, Vec<StageRecord>) {
    let answer = with_run(threads, |run| pipeline::remesh(engine, &session.snapshot(), run)).unwrap();
    (answer.value.result.value.fingerprint(), answer.records)
}

fn layout(engine: &Engine, session: &Session) -> Layout {
    with_run(2, |run| pipeline::layout(engine, &session.snapshot(), run)).unwrap().value
}

/// Edits as the service does; the patches made.
fn edit(engine: &Engine, session: &Session, request: &PatchRequest) -> (Vec<u32>, Layout) {
    let snapshot = session.snapshot();
    let edited = with_run(2, |run| pipeline::edit_patches(engine, &snapshot, request, run)).unwrap().value;
    session.apply(Some(snapshot.revision), &[Change::PatchEdit(edited.edit)]).unwrap();
    (edited.patches, edited.layout)
}

fn largest(layout: &Layout) -> u32 {
    let patches = &layout.partition.patches;
    (0..patches.len() as u32).max_by_key(|&p| patches[p as usize].faces).unwrap()
}

/// Patches that a stage ran for.
fn ran(records: &[StageRecord], stage: Stage) -> BTreeSet<u32> {
    let runs = records.iter().filter(|r| r.stage == stage && r.outcome == Outcome::Run);
    runs.filter_map(|r| if let Subject::Patch(p) = r.subject { Some(p) } else { None }).collect()
}

fn split(patch: u32) -> PatchRequest {
    PatchRequest::Split { patch, method: SplitMethod::Balanced }
}

#[test]
fn an_edit_runs_the_patches_that_changed_and_undo_runs_nothing() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine);
    let (first, _) = remesh(&engine, &session, 2);
    let before = layout(&engine, &session);
    let snapshot = session.snapshot();
    let answer = with_run(2, |run| pipeline::edit_patches(&engine, &snapshot, &split(largest(&before)), run)).unwrap();
    let (edited, records) = (answer.value, answer.records);
    assert_eq!(edited.patches.len() as u32, 2 + edited.split_again);
    let made: BTreeSet<u32> = edited.patches.iter().copied().collect();
    for stage in [Stage::System, Stage::Factor, Stage::Solve, Stage::Chart] {
        assert_eq!(ran(&records, stage), made, "{stage:?}");
    }
    session.apply(Some(snapshot.revision), &[Change::PatchEdit(edited.edit)]).unwrap();
    let (second, records) = remesh(&engine, &session, 2);
    assert_ne!(first, second);
    assert_eq!(ran(&records, Stage::Chart), BTreeSet::new(), "the edit left its charts in the cache");
    // Meshed again: the new patches and neighbours, whose border has a new junction.
    let after = layout(&engine, &session);
    let curves = |p: u32| after.patches.uses[p as usize].iter().map(|u| u.curve).collect::<BTreeSet<u32>>();
    let touched: BTreeSet<u32> = after
        .patches
        .network
        .curves
        .iter()
        .filter(|c| {
            let ends = [c.halfedges[0], c.halfedges[c.halfedges.len() - 1]];
            ends.iter().any(|&h| {
                after
                    .surface
                    .topology
                    .outgoing(after.surface.topology.origin(h))
                    .any(|k| made.contains(&after.partition.face_patch[k as usize / 3]))
            }) || ends.iter().any(|&h| {
                after
                    .surface
                    .topology
                    .outgoing(after.surface.topology.target(h))
                    .any(|k| made.contains(&after.partition.face_patch[k as usize / 3]))
            })
        })
        .enumerate()
        .map(|(_, c)| after.patches.network.curves.iter().position(|d| d.halfedges == c.halfedges).unwrap() as u32)
        .collect();
    let planar = ran(&records, Stage::Planar);
    assert!(planar.is_superset(&made) && planar.len() < after.patches.patches.len() / 2, "{planar:?}");
    assert!(planar.iter().all(|&p| made.contains(&p) || !curves(p).is_disjoint(&touched)), "{planar:?}");
    // Undo, and redo.
    session.apply(None, &[Change::Rollback(Revision(1))]).unwrap();
    let (back, records) = remesh(&engine, &session, 2);
    assert_eq!(back, first);
    assert!(records.iter().all(|r| r.outcome == Outcome::Hit));
    session.apply(None, &[Change::Rollback(Revision(2))]).unwrap();
    let (again, records) = remesh(&engine, &session, 2);
    assert_eq!(again, second);
    assert!(records.iter().all(|r| r.outcome == Outcome::Hit));
    session.apply(None, &[Change::ResetPatchEdits]).unwrap();
    assert_eq!(remesh(&engine, &session, 2).0, first);
}

#[test]
fn an_edited_session_equals_a_fresh_one() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine);
    // Split the largest, merge a part with a neighbour if that makes a patch, move the faces of a border.
    let (parts, after) = edit(&engine, &session, &split(largest(&layout(&engine, &session))));
    let label = &after.partition.face_patch;
    let topology = &after.surface.topology;
    let beside = |p: u32| {
        let across = (0..topology.halfedge_count() as u32).filter(|&h| label[h as usize / 3] == p).filter_map(|h| topology.twin(h));
        across.map(|t| label[t as usize / 3]).filter(|q| !parts.contains(q)).collect::<BTreeSet<u32>>()
    };
    let merged = beside(parts[0]).into_iter().any(|q| {
        let request = PatchRequest::Merge { patches: vec![parts[0], q] };
        let snapshot = session.snapshot();
        let tried = with_run(2, |run| pipeline::edit_patches(&engine, &snapshot, &request, run));
        tried.is_ok_and(|answer| session.apply(None, &[Change::PatchEdit(answer.value.edit)]).is_ok())
    });
    assert!(merged, "no neighbour can be merged");
    let now = layout(&engine, &session);
    let label = &now.partition.face_patch;
    let moved = (0..label.len() as u32).any(|f| {
        let topology = &now.surface.topology;
        let beyond = (3 * f..3 * f + 3).filter_map(|h| topology.twin(h)).map(|t| label[t as usize / 3]).filter(|&q| q != label[f as usize]);
        let Some(to) = beyond.min() else { return false };
        let snapshot = session.snapshot();
        let request = PatchRequest::Reassign { faces: vec![f], to };
        let tried = with_run(2, |run| pipeline::edit_patches(&engine, &snapshot, &request, run));
        tried.is_ok_and(|answer| session.apply(None, &[Change::PatchEdit(answer.value.edit)]).is_ok())
    });
    assert!(moved, "no face can be moved");
    let (incremental, _) = remesh(&engine, &session, 2);
    let fresh_engine = Engine::new(EngineConfig::default());
    let fresh = open(&fresh_engine);
    let log: Vec<Change> = session.snapshot().patch_edits.iter().map(|e| Change::PatchEdit((**e).clone())).collect();
    assert_eq!(log.len(), 3);
    fresh.apply(None, &log).unwrap();
    assert_eq!(remesh(&fresh_engine, &fresh, 1).0, incremental);
    assert_eq!(layout(&fresh_engine, &fresh).edits, vec![EditState::Applied; 3]);
}

#[test]
fn edits_wait_while_their_patches_are_gone() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine);
    let spec = session.snapshot().partition.clone();
    edit(&engine, &session, &split(largest(&layout(&engine, &session))));
    let edited = remesh(&engine, &session, 2).0;
    session.apply(None, &[Change::Partition(PartitionSpec { patches: Some(9), ..spec.clone() })]).unwrap();
    assert!(matches!(layout(&engine, &session).edits[..], [EditState::Waiting(_)]));
    let answer = with_run(2, |run| pipeline::remesh(&engine, &session.snapshot(), run)).unwrap();
    let warnings = answer.value.warnings(&session.snapshot());
    assert!(warnings.iter().any(|w| w.contains("wait")), "{warnings:?}");
    // Another edit of patches that are there is carried out although the first waits.
    edit(&engine, &session, &split(0));
    assert!(matches!(layout(&engine, &session).edits[..], [EditState::Waiting(_), EditState::Applied]));
    session.apply(None, &[Change::Partition(spec)]).unwrap();
    assert!(matches!(layout(&engine, &session).edits[..], [EditState::Applied, EditState::Waiting(_)]));
    assert_eq!(remesh(&engine, &session, 2).0, edited);
}

#[test]
fn a_plan_with_edits_tells_the_truth_and_the_log_is_bounded() {
    let engine = Engine::new(EngineConfig::default());
    let session = open(&engine);
    edit(&engine, &session, &split(0));
    let hits = |records: &[StageRecord]| -> BTreeSet<String> {
        records.iter().filter(|r| r.outcome == Outcome::Hit).map(|r| format!("{:?} {:?}", r.stage, r.subject)).collect()
    };
    let planned = with_run(1, |run| pipeline::plan(&engine, &session.snapshot(), run)).unwrap();
    let expected = hits(&planned);
    assert_eq!(expected, hits(&remesh(&engine, &session, 1).1));
    let one = (*session.snapshot().patch_edits[0]).clone();
    let revision = session.revision();
    let many = vec![Change::PatchEdit(one); MAX_PATCH_EDITS];
    let error = session.apply(None, &many).unwrap_err();
    assert_eq!((error.reason(), session.revision()), (remesh_engine::error::Reason::LimitReached, revision));
}
