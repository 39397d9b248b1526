//! Charts in sessions: what an edit of a chart runs, previews and plans, specifications that stay with their patch.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::{EngineError, Reason};
use remesh_engine::import::ImportOptions;
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::parametrize::{Boundary, BoundaryShape, ChartMethod, ChartOutcome, ChartSpec, OuterLoop, Pin, Pins};
use remesh_engine::partition::PartitionSpec;
use remesh_engine::pipeline::{self, Answer, ChartVerdict, Charts, Layout, Run, SpecOf};
use remesh_engine::session::{Change, MeshSource, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, Stage, StageRecord, Subject};
use remesh_engine::work::CancelToken;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::SystemTime;

const SIDE: u32 = 24;

/// A bumpy sheet, `bump` high, of 2 x 24 x 24 triangles.
fn sheet(bump: f64) -> SurfaceMesh {
    let n = SIDE + 1;
    let at = |k: u32| f64::from(k) / f64::from(SIDE);
    let positions = (0..n * n).map(|k| {
        let (x, y) = (at(k % n), at(k / n));
        [2.0 * x, y, bump * (5.0 * x).sin() * (4.0 * y).cos()]
    });
    let quads = (0..SIDE * SIDE).map(|k| (k / SIDE) * n + k % SIDE);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]);
    SurfaceMesh::from_parts(positions.collect(), triangles.collect())
}

fn mesh(bump: f64) -> Change {
    Change::Mesh { source: MeshSource::from_arrays(sheet(bump)), options: ImportOptions::default() }
}

fn in_patches(patches: u32) -> Change {
    Change::Partition(PartitionSpec { patches: Some(patches), ..PartitionSpec::default() })
}

fn open(changes: &[Change]) -> (Arc<Engine>, Arc<Session>) {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    session.apply(None, changes).unwrap();
    (engine, session)
}

fn run<T>(work: impl FnOnce(&Run<'_>) -> T) -> T {
    let cancel = CancelToken::new();
    work(&Run { cancel: &cancel, events: &|_| {}, threads: 2 })
}

fn charts(engine: &Engine, session: &Session) -> Result<Answer<Charts>, EngineError> {
    run(|run| pipeline::charts(engine, &session.snapshot(), run))
}

fn layout(engine: &Engine, session: &Session) -> Layout {
    run(|run| pipeline::layout(engine, &session.snapshot(), run)).unwrap().value
}

fn set(session: &Session, layout: &Layout, patch: usize, spec: Option<ChartSpec>) {
    session.apply(None, &[Change::PatchChart { patch: layout.patches.identities[patch], spec }]).unwrap();
}

fn of_charts(records: &[StageRecord], outcome: Outcome) -> BTreeSet<&'static str> {
    let stages = [Stage::System, Stage::Factor, Stage::Boundary, Stage::Solve, Stage::Chart];
    records.iter().filter(|r| r.outcome == outcome && stages.contains(&r.stage)).map(|r| r.stage.name()).collect()
}

fn ran(engine: &Engine, session: &Session) -> BTreeSet<&'static str> {
    of_charts(&charts(engine, session).unwrap().records, Outcome::Run)
}

fn pins(a: u32, b: u32, targets: [[f64; 2]; 2]) -> ChartSpec {
    let pins = vec![Pin { vertex: a, target: Some(targets[0]) }, Pin { vertex: b, target: Some(targets[1]) }];
    ChartSpec { pins: Pins::Given(pins), ..ChartSpec::only(ChartMethod::LeastSquaresConformal) }
}

fn shape(method: ChartMethod, shape: BoundaryShape) -> ChartSpec {
    ChartSpec { boundary: Boundary { shape, ..Boundary::default() }, ..ChartSpec::only(method) }
}

#[test]
fn edits_of_a_chart_run_what_they_touch_and_plans_say_so() {
    let (engine, session) = open(&[mesh(0.2), in_patches(1)]);
    let layout = layout(&engine, &session);
    assert_eq!(layout.charts.len(), 1);
    let [a, b, c] = [0, SIDE, (SIDE + 1) * SIDE];
    let square = BoundaryShape::Rectangle { ratio: Some(1.0), corners: Some([0, SIDE, 624, 600]) };
    use ChartMethod::{Barycentric, Harmonic, MeanValue, SpectralConformal};
    let steps: Vec<(&str, ChartSpec, &[&str])> = vec![
        // The default chart was spectral: interior and conformal factors are there.
        ("pins", pins(a, b, [[0.0, 0.0], [1.0, 0.0]]), &["solve", "chart"]),
        ("moved targets", pins(a, b, [[2.0, 1.0], [0.0, 5.0]]), &["chart"]),
        ("other pins", pins(a, c, [[2.0, 1.0], [0.0, 5.0]]), &["solve", "chart"]),
        ("a pin inside", pins(a, 8 * (SIDE + 1) + 9, [[2.0, 1.0], [0.0, 5.0]]), &["solve", "chart"]),
        ("spectral", ChartSpec::only(SpectralConformal), &["chart"]),
        ("harmonic", shape(Harmonic, BoundaryShape::Circle), &["boundary", "solve", "chart"]),
        ("harmonic, square", shape(Harmonic, square.clone()), &["solve", "chart"]),
        ("barycentric", shape(Barycentric, BoundaryShape::Circle), &["factor", "boundary", "solve", "chart"]),
        ("barycentric, square", shape(Barycentric, square.clone()), &["solve", "chart"]),
        ("mean value", shape(MeanValue, BoundaryShape::Circle), &["factor", "solve", "chart"]),
        ("mean value, ellipse", shape(MeanValue, BoundaryShape::Ellipse { ratio: 2.0 }), &["solve", "chart"]),
        ("back", pins(a, b, [[2.0, 1.0], [0.0, 5.0]]), &[]),
    ];
    for (name, spec, wanted) in steps {
        set(&session, &layout, 0, Some(spec));
        let plan = run(|run| pipeline::plan_charts(&engine, &session.snapshot(), run)).unwrap();
        let answer = charts(&engine, &session).unwrap();
        let wanted: BTreeSet<&str> = wanted.iter().copied().collect();
        assert_eq!(of_charts(&answer.records, Outcome::Run), wanted, "{name}");
        // A plan stops at the first thing it does not know; what it lists is what happens.
        let planned = of_charts(&plan, Outcome::Run);
        assert!(planned.is_subset(&wanted) && planned.is_empty() == wanted.is_empty(), "{name}: {planned:?}");
        if wanted == BTreeSet::from(["solve", "chart"]) {
            assert_eq!(planned, wanted, "{name}");
            // The plan shows that the factorization is there.
            let dear = if name.starts_with("mean value") { "factor" } else { "boundary" };
            assert!(of_charts(&plan, Outcome::Hit).contains(dear), "{name}");
        }
    }
}

#[test]
fn a_size_does_not_touch_charts_and_moved_vertices_keep_the_elimination_order() {
    let (engine, session) = open(&[mesh(0.2), in_patches(1)]);
    assert_eq!(ran(&engine, &session), BTreeSet::from(["system", "factor", "boundary", "solve", "chart"]));
    session.apply(None, &[Change::Size(SizeSpec::Uniform { size: 0.1 })]).unwrap();
    assert_eq!(ran(&engine, &session), BTreeSet::new());
    session.apply(None, &[mesh(0.21)]).unwrap();
    assert_eq!(ran(&engine, &session), BTreeSet::from(["factor", "boundary", "solve", "chart"]));
}

#[test]
fn an_edited_session_is_a_fresh_one_bit_for_bit() {
    let (engine, session) = open(&[mesh(0.2), in_patches(3)]);
    let first = layout(&engine, &session);
    let spec = shape(ChartMethod::MeanValue, BoundaryShape::Ellipse { ratio: 1.5 });
    for step in [Some(ChartSpec::only(ChartMethod::Barycentric)), None, Some(spec.clone())] {
        set(&session, &first, 1, step);
        charts(&engine, &session).unwrap();
    }
    let (other, fresh) = open(&[mesh(0.2), in_patches(3)]);
    let other_layout = layout(&other, &fresh);
    set(&fresh, &other_layout, 1, Some(spec));
    let (one, two) = (charts(&engine, &session).unwrap().value, charts(&other, &fresh).unwrap().value);
    assert_eq!(one.charts.len(), two.charts.len());
    for (a, b) in one.charts.iter().zip(&two.charts) {
        assert_eq!((a.output, &*a.value), (b.output, &*b.value));
    }
    assert_eq!(one.chart(1).unwrap().method, ChartMethod::MeanValue);
}

#[test]
fn only_the_chart_of_the_edited_patch_is_made_again() {
    let (engine, session) = open(&[mesh(0.2), in_patches(4)]);
    let layout = layout(&engine, &session);
    assert!(layout.charts.len() >= 4);
    set(&session, &layout, 2, Some(ChartSpec::only(ChartMethod::LeastSquaresConformal)));
    let records = charts(&engine, &session).unwrap().records;
    let touched: BTreeSet<Subject> = records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.subject).collect();
    assert_eq!(touched, BTreeSet::from([Subject::Patch(2)]));
}

#[test]
fn a_specification_stays_with_its_patch() {
    let (engine, session) = open(&[mesh(0.2), in_patches(2)]);
    let two = layout(&engine, &session);
    let spec = ChartSpec::only(ChartMethod::Harmonic);
    set(&session, &two, 1, Some(spec.clone()));
    // It sleeps while its patch does not exist, and is there again when it does.
    session.apply(None, &[in_patches(5)]).unwrap();
    let five = layout(&engine, &session);
    assert!((0..five.charts.len()).all(|p| matches!(five.spec_of(&session.snapshot(), p), SpecOf::Session(_))));
    session.apply(None, &[in_patches(2)]).unwrap();
    let again = layout(&engine, &session);
    assert_eq!(again.spec_of(&session.snapshot(), 1), SpecOf::Patch(&spec));
    set(&session, &again, 1, None);
    assert!(matches!(layout(&engine, &session).spec_of(&session.snapshot(), 1), SpecOf::Session(_)));
}

#[test]
fn a_preview_changes_nothing_and_warms_the_cache() {
    let (engine, session) = open(&[mesh(0.2), in_patches(1)]);
    let layout = layout(&engine, &session);
    let revision = session.revision();
    let spec = shape(ChartMethod::Harmonic, BoundaryShape::Rectangle { ratio: None, corners: Some([0, SIDE, 624, 600]) });
    let plan = run(|run| pipeline::plan_preview(&engine, &session.snapshot(), 0, &spec, run)).unwrap();
    assert!(of_charts(&plan, Outcome::Hit).contains("factor") && of_charts(&plan, Outcome::Run).contains("boundary"));
    let (_, preview) = run(|run| pipeline::preview_chart(&engine, &session.snapshot(), 0, |_, _| Ok(spec.clone()), run)).unwrap().value;
    assert_eq!((preview.verdict, session.revision(), preview.uv.len()), (ChartVerdict::Usable, revision, 625));
    set(&session, &layout, 0, Some(spec));
    assert_eq!(ran(&engine, &session), BTreeSet::new());
    let charts = charts(&engine, &session).unwrap().value;
    assert_eq!(charts.chart(0).unwrap().uv, preview.uv);
}

#[test]
fn a_bad_specification_is_an_error_with_places_and_can_be_mended() {
    let (engine, session) = open(&[mesh(0.2), in_patches(2)]);
    let layout = layout(&engine, &session);
    let (_, _, map) = &layout.patches.patches[0];
    let foreign = (0..625).find(|v| !map.vertices.contains(v)).unwrap();
    let boundary =
        |v: u32| ChartSpec { boundary: Boundary { start: Some(v), ..Boundary::default() }, ..ChartSpec::only(ChartMethod::Harmonic) };
    let patch = &layout.patches.patches[0].0;
    let inside = (0..patch.positions.len() as u32).find(|v| !patch.loops.concat().contains(v)).unwrap();
    let inside = map.vertices[inside as usize];
    let cases = [
        (pins(foreign, map.vertices[0], [[0.0, 0.0], [1.0, 0.0]]), foreign),
        (boundary(inside), inside),
        (ChartSpec { outer: OuterLoop::Through(inside), ..ChartSpec::default() }, inside),
    ];
    for (spec, vertex) in cases {
        set(&session, &layout, 0, Some(spec));
        let error = charts(&engine, &session).unwrap_err();
        assert_eq!((error.reason(), error.locations()[0].ids.clone()), (Reason::BadParameter, vec![vertex]));
        assert_eq!(error.locations()[0].position, sheet(0.2).positions[vertex as usize]);
        // The patches still have their numbers, so it can be mended.
        let held = run(|run| pipeline::layout(&engine, &session.snapshot(), run)).unwrap().value;
        assert!(held.charts[0].is_err() && held.charts[1].is_ok());
    }
    let unknown = run(|run| pipeline::preview_chart(&engine, &session.snapshot(), 99, |_, _| Ok(ChartSpec::default()), run)).unwrap_err();
    assert_eq!(unknown.reason(), Reason::PatchNotFound);
    set(&session, &layout, 0, None);
    assert!(charts(&engine, &session).unwrap().value.charts.iter().all(|c| matches!(*c.value, ChartOutcome::Mapped(_))));
    // A method of the session that some patch refuses does not hide the numbers either.
    let square = BoundaryShape::Rectangle { ratio: None, corners: None };
    session.apply(None, &[Change::Chart(shape(ChartMethod::Barycentric, square))]).unwrap();
    let refused = charts(&engine, &session).unwrap_err();
    assert!(refused.reason() == Reason::ChartFailed && refused.message().starts_with("patch "), "{refused}");
    let held = run(|run| pipeline::layout(&engine, &session.snapshot(), run)).unwrap().value;
    assert!(held.charts.iter().any(Result::is_err));
    let plan = run(|run| pipeline::plan_charts(&engine, &session.snapshot(), run)).unwrap();
    assert!(plan.iter().all(|r| r.outcome == Outcome::Hit), "what the patch refuses is known, and the plan says so without failing");
    run(|run| pipeline::preview_chart(&engine, &session.snapshot(), 0, |_, _| Ok(ChartSpec::default()), run)).unwrap();
    let wide = session.apply(None, &[Change::Chart(boundary(inside))]).unwrap_err();
    assert_eq!(wide.reason(), Reason::BadParameter);
}
