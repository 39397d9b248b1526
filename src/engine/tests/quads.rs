//! Quadrangles through the whole pipeline: what is kept, what is promised of the elements, what the cache shares, what files hold.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::export::{Encoding, FaceData, export_mesh};
use remesh_engine::features::FeatureSpec;
use remesh_engine::import::{Format, ImportOptions};
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::optimize::Remeshed;
use remesh_engine::pipeline::{self, Answer, Remesh, Run};
use remesh_engine::planar::{Mesher, QuadKind};
use remesh_engine::quality::{QualityReport, QualityScope};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, Stage, Stored};
use remesh_engine::work::{CancelToken, Work};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::SystemTime;

fn run<T>(work: impl FnOnce(&Run<'_>) -> T) -> T {
    let cancel = CancelToken::new();
    work(&Run { cancel: &cancel, events: &|_| {}, threads: 2 })
}

fn open(source: MeshSource, size: f64, mesher: Mesher) -> (Arc<Engine>, Arc<Session>) {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    let mesh = Change::Mesh { source, options: ImportOptions::default() };
    session.apply(None, &[mesh, Change::Size(SizeSpec::Uniform { size }), Change::Mesher(mesher)]).unwrap();
    (engine, session)
}

fn quality(engine: &Engine, session: &Session) -> Answer<(Remesh, Stored<QualityReport>)> {
    run(|run| pipeline::quality(engine, &session.snapshot(), QualityScope::Full, run)).unwrap()
}

/// A square plate of side 12 with a square hole, of triangles with sides 0.5.
fn plate() -> MeshSource {
    let n = 25u32;
    let at = |k: u32| 0.5 * f64::from(k);
    let positions: Vec<[f64; 3]> = (0..n * n).map(|k| [at(k % n), at(k / n), 0.0]).collect();
    let is_hole = |x: u32, y: u32| (8..16).contains(&x) && (10..14).contains(&y);
    let cells = (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| (x, y))).filter(|&(x, y)| !is_hole(x, y));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|(x, y)| {
            let a = y * n + x;
            [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
        })
        .collect();
    let mut number = BTreeMap::new();
    let mut kept = Vec::new();
    let triangles = triangles.iter().map(|t| {
        t.map(|v| {
            *number.entry(v).or_insert_with(|| {
                kept.push(positions[v as usize]);
                kept.len() as u32 - 1
            })
        })
    });
    let triangles = triangles.collect();
    MeshSource::from_arrays(SurfaceMesh::from_parts(kept, triangles))
}

fn sample(kind: SampleKind, triangles: u64) -> MeshSource {
    MeshSource::Sample(SampleSpec::new(kind, triangles))
}

/// Quadrangles, then triangles, as lists of corners.
fn elements(result: &Remeshed) -> Vec<Vec<u32>> {
    let t = &result.mesh.triangles;
    let pairs = 2 * result.quads as usize;
    let quads = t[..pairs].chunks(2).map(|pair| {
        assert_eq!((pair[0][0], pair[0][2]), (pair[1][0], pair[1][1]), "the halves share the diagonal");
        vec![pair[0][0], pair[0][1], pair[0][2], pair[1][2]]
    });
    quads.chain(t[pairs..].iter().map(|t| t.to_vec())).collect()
}

fn check(remesh: &Remesh, report: &QualityReport, all: bool) {
    let quads = report.quads.as_ref().expect("quadrangles");
    assert!(report.topology_kept && report.self_intersections == Some(0), "{report:?}");
    assert_eq!(quads.quads, u64::from(remesh.result.quads));
    assert!(!all || quads.triangles == 0);
    assert!(quads.triangles * 50 < quads.quads, "{quads:?}");
    assert!(quads.eta_min > 0.2 && quads.eta_mean > 0.85 && quads.tau.unwrap() > 85.0, "{quads:?}");
    // Every edge has one or two elements, run through in opposite directions.
    let mut sides = BTreeMap::new();
    for e in elements(&remesh.result) {
        for k in 0..e.len() {
            assert!(sides.insert((e[k], e[(k + 1) % e.len()]), ()).is_none(), "an edge is used twice in one direction");
        }
    }
    // The diagonals of quadrangles are no curves.
    for e in &remesh.result.curve_edges {
        assert!(sides.contains_key(&(e[0], e[1])) || sides.contains_key(&(e[1], e[0])), "a curve edge is an edge of elements");
    }
}

#[test]
fn a_plate_with_a_hole_becomes_squares() {
    for (kind, all) in [(QuadKind::Mixed, false), (QuadKind::All, true)] {
        let (engine, session) = open(plate(), 0.6, Mesher::Quads(kind));
        let (remesh, report) = quality(&engine, &session).value;
        check(&remesh, &report, all);
        let quads = report.quads.as_ref().unwrap();
        assert!(quads.eta_mean > 0.93 && (!all || quads.triangles == 0), "{quads:?}");
        assert!((report.fidelity.as_ref().unwrap().area_ratio - 1.0).abs() < 1e-9);
    }
}

#[test]
fn curved_surfaces_with_and_without_features_keep_their_topology() {
    for kind in [SampleKind::Tube, SampleKind::CadPart, SampleKind::Artery] {
        let (engine, session) = open(sample(kind, 3000), 1.0, Mesher::Frontal);
        if kind == SampleKind::Artery {
            // At this size its noise would be features, on branches four elements around.
            session.apply(None, &[Change::Features(FeatureSpec { feature_angle_deg: None, ..FeatureSpec::default() })]).unwrap();
        }
        let area = run(|run| pipeline::import(&engine, &session.snapshot(), run)).unwrap().value.mesh.area();
        let size = (area / 1500.0).sqrt();
        let fewer = if kind == SampleKind::Artery { 15 } else { 20 };
        for kind in [QuadKind::Mixed, QuadKind::All] {
            session.apply(None, &[Change::Size(SizeSpec::Uniform { size }), Change::Mesher(Mesher::Quads(kind))]).unwrap();
            let (remesh, report) = quality(&engine, &session).value;
            let quads = report.quads.as_ref().expect("quadrangles");
            assert!(report.topology_kept, "{report:?}");
            match kind {
                // More triangles stay where a branch is four elements around.
                QuadKind::Mixed => assert!(quads.eta_mean > 0.85 && quads.triangles * fewer < quads.quads, "{quads:?}"),
                QuadKind::All => assert!(quads.eta_mean > 0.7 && quads.triangles == 0, "{quads:?}"),
            }
            elements(&remesh.result);
        }
    }
}

#[test]
fn halves_of_quadrangles_around_narrow_branches_are_a_surface() {
    let (engine, session) = open(sample(SampleKind::Artery, 3000), 2.06, Mesher::Quads(QuadKind::Mixed));
    assert!(quality(&engine, &session).value.1.topology_kept);
}

#[test]
fn mixed_quadrangles_leave_curve_vertices_where_the_triangles_have_them() {
    let (engine, session) = open(plate(), 0.6, Mesher::Frontal);
    let corners = |mesh: &Remeshed| {
        let mut on: Vec<_> = mesh.curve_edges.as_flattened().iter().map(|&v| mesh.mesh.positions[v as usize].map(f64::to_bits)).collect();
        on.sort_unstable();
        on.dedup();
        on
    };
    let triangles = quality(&engine, &session).value.0;
    session.apply(None, &[Change::Mesher(Mesher::Quads(QuadKind::Mixed))]).unwrap();
    let answer = run(|run| pipeline::remesh(&engine, &session.snapshot(), run)).unwrap();
    assert_eq!(corners(&triangles.result), corners(&answer.value.result));
    let ran: Vec<Stage> = answer.records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.stage).collect();
    assert_eq!(ran, [Stage::Quads], "the triangles are shared with the frontal mesher");
}

#[test]
fn results_do_not_depend_on_threads() {
    let result = |threads| {
        let (engine, session) = open(sample(SampleKind::Tube, 2000), 4.0, Mesher::Quads(QuadKind::Mixed));
        let cancel = CancelToken::new();
        let once = Run { cancel: &cancel, events: &|_| {}, threads };
        pipeline::remesh(&engine, &session.snapshot(), &once).unwrap().value.result.output
    };
    assert_eq!(result(1), result(2));
}

#[test]
fn files_hold_quadrangles_where_the_format_can() {
    let (engine, session) = open(plate(), 0.9, Mesher::Quads(QuadKind::All));
    let result = quality(&engine, &session).value.0.result;
    let kappa = vec![0.5; result.mesh.triangles.len()];
    let data = FaceData { patch: Some(&result.face_patch), kappa: Some(&kappa), quads: result.quads };
    let cancel = CancelToken::new();
    for (format, encoding) in [
        (Format::Obj, Encoding::Ascii),
        (Format::Off, Encoding::Ascii),
        (Format::Ply, Encoding::Ascii),
        (Format::Ply, Encoding::Binary),
        (Format::Msh, Encoding::Ascii),
        (Format::Msh, Encoding::Binary),
        (Format::Msh, Encoding::Msh22),
        (Format::Stl, Encoding::Binary),
    ] {
        let written = export_mesh(&result.mesh, data, format, encoding).unwrap();
        let told = written.warnings.iter().any(|w| w.contains("quadrangles was written as two"));
        assert_eq!(told, format == Format::Stl, "{format:?} {:?}", written.warnings);
        let read = remesh_engine::import::import_mesh(&written.bytes, &ImportOptions::default(), &Work::silent(&cancel)).unwrap();
        assert_eq!(read.mesh.triangles.len(), result.mesh.triangles.len(), "{format:?} {encoding:?}");
        assert!((read.mesh.area() / result.mesh.area() - 1.0).abs() < 1e-6);
    }
    let vtu = String::from_utf8(export_mesh(&result.mesh, data, Format::Vtu, Encoding::Ascii).unwrap().bytes).unwrap();
    assert!(vtu.contains(&format!("NumberOfCells=\"{}\"", result.quads)) && vtu.contains("Name=\"shape\""));
    let wrong = FaceData { quads: result.quads + 1, ..data };
    assert!(export_mesh(&result.mesh, wrong, Format::Obj, Encoding::Ascii).is_err());
}
