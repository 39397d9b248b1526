//! Locked boundary vertices come out bit for bit, with the boundary edges between them.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::Reason;
use remesh_engine::import::ImportOptions;
use remesh_engine::lock::LockSpec;
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::metric::MetricSpec;
use remesh_engine::pipeline::{self, Remesh, Run};
use remesh_engine::planar::{Mesher, QuadKind};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::topology::Topology;
use remesh_engine::work::CancelToken;
use std::collections::BTreeSet;
use std::time::SystemTime;

fn tube() -> Change {
    let spec = SampleSpec { kind: SampleKind::Tube, triangles: 4000, genus: None, outlets: None, aspect_ratio: Some(4.0) };
    Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() }
}

fn run(lock: LockSpec, triangles: u64) -> remesh_engine::Result<(Remesh, f64)> {
    run_with(Change::Mesher(Mesher::Frontal), lock, triangles)
}

fn run_with(mesher: Change, lock: LockSpec, triangles: u64) -> remesh_engine::Result<(Remesh, f64)> {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    session.apply(None, &[tube(), Change::Size(SizeSpec::TriangleCount { triangles }), Change::Lock(lock), mesher]).unwrap();
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    let (remesh, report) = pipeline::quality(&engine, &session.snapshot(), QualityScope::Full, &run)?.value;
    assert!(report.topology_kept && report.self_intersections == Some(0));
    Ok((remesh, report.shape.kappa_min))
}

type Bits = [u64; 3];

/// Boundary edges as pairs of positions by their bits.
fn boundary(mesh: &SurfaceMesh) -> BTreeSet<[Bits; 2]> {
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let bits = |v: u32| mesh.positions[v as usize].map(f64::to_bits);
    topology.loops.iter().flatten().map(|&h| [bits(topology.origin(h)), bits(topology.target(h))]).collect()
}

#[test]
fn the_whole_boundary_stays() {
    for triangles in [600, 6000] {
        let (remesh, kappa_min) = run(LockSpec::Boundary, triangles).unwrap();
        let input = boundary(&remesh.charts.surface.imported.mesh);
        let output = boundary(&remesh.result.mesh);
        assert!(input.len() > 30);
        assert_eq!(input, output, "at {triangles} triangles");
        assert!(kappa_min > 0.1, "{kappa_min}");
    }
}

#[test]
fn every_mesher_keeps_locked_edges() {
    let meshers = [
        Change::Mesher(Mesher::Delaunay { min_angle_deg: 25.0 }),
        Change::Mesher(Mesher::MeshAdapt),
        Change::Mesher(Mesher::Quads(QuadKind::Mixed)),
        Change::Mesher(Mesher::Quads(QuadKind::All)),
        Change::Anisotropic(MetricSpec { max_stretch: 4.0, ..MetricSpec::default() }),
    ];
    for mesher in meshers {
        let (remesh, _) = run_with(mesher.clone(), LockSpec::Boundary, 3000).unwrap();
        assert_eq!(boundary(&remesh.charts.surface.imported.mesh), boundary(&remesh.result.mesh), "{mesher:?}");
    }
}

#[test]
fn one_loop_or_some_vertices_stay() {
    let (free, _) = run(LockSpec::Nothing, 1500).unwrap();
    let surface = &free.charts.surface;
    let (mesh, loops) = (&surface.imported.mesh, &surface.topology.loops);
    let input = boundary(mesh);
    assert!(boundary(&free.result.mesh).intersection(&input).count() < input.len() / 4, "the size is another");
    let first = surface.topology.origin(loops[0][3]);
    let (one, _) = run(LockSpec::Loops(vec![first]), 1500).unwrap();
    let kept = boundary(&one.result.mesh);
    let edge = |h: u32| [surface.topology.origin(h), surface.topology.target(h)].map(|v| mesh.positions[v as usize].map(f64::to_bits));
    assert!(loops[0].iter().all(|&h| kept.contains(&edge(h))));
    assert!(loops[1].iter().filter(|&&h| kept.contains(&edge(h))).count() < loops[1].len() / 4);
    // Three single vertices and a run of four.
    let on_loop = |i: usize| surface.topology.origin(loops[1][i]);
    let n = loops[1].len();
    let single = [0, n / 3, n / 2];
    let vertices: Vec<u32> = single.into_iter().chain(n - 8..n - 4).map(on_loop).collect();
    let (some, _) = run(LockSpec::Vertices(vertices.clone()), 1500).unwrap();
    let kept = boundary(&some.result.mesh);
    let points: BTreeSet<Bits> = kept.iter().map(|e| e[0]).collect();
    assert!(vertices.iter().all(|&v| points.contains(&mesh.positions[v as usize].map(f64::to_bits))));
    assert!((n - 8..n - 5).all(|i| kept.contains(&edge(loops[1][i]))), "edges of a run stay");
}

#[test]
fn only_boundary_vertices_can_be_locked() {
    let (free, _) = run(LockSpec::Nothing, 1500).unwrap();
    let topology = &free.charts.surface.topology;
    let inner = (0..topology.vertex_count() as u32).find(|&v| !topology.is_boundary_vertex(v)).unwrap();
    for spec in [LockSpec::Vertices(vec![inner]), LockSpec::Loops(vec![inner]), LockSpec::Vertices(vec![u32::MAX])] {
        let error = run(spec, 1500).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
        assert!(error.metadata().contains(&("field".into(), "lock".into())));
    }
}
