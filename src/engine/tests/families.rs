//! Every generated surface through the whole pipeline: topology kept, quality above the floor, close to the input.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::import::ImportOptions;
use remesh_engine::partition::{BorderSmoothing, PartitionSpec};
use remesh_engine::pipeline::{self, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::topology::Topology;
use remesh_engine::work::CancelToken;
use std::time::SystemTime;

fn remeshed(spec: SampleSpec, size: SizeSpec) {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    let name = format!("{spec:?} {size:?}");
    let mesh = Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() };
    session.apply(None, &[mesh, Change::Size(size)]).unwrap();
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    let (remesh, report) = pipeline::quality(&engine, &session.snapshot(), QualityScope::Full, &run).unwrap().value;
    let output = &remesh.result.mesh;
    output.validate().unwrap();
    Topology::build(&output.triangles, output.positions.len()).unwrap();
    assert!(report.topology_kept, "{name}: {:?} became {:?}", report.topology_input, report.topology_output);
    assert_eq!(report.self_intersections, Some(0), "{name}");
    let seams = report.seams.unwrap();
    assert_eq!(seams.after.seam.triangles + seams.after.interior.triangles, output.triangles.len() as u64, "{name}");
    let shape = &report.shape;
    assert!(shape.kappa_mean >= 0.96, "{name}: kappa mean {}", shape.kappa_mean);
    assert!(shape.kappa_min >= 0.25, "{name}: kappa min {}", shape.kappa_min);
    assert!(shape.tau.is_some_and(|tau| tau >= 88.0), "{name}: tau {:?}", shape.tau);
    let fidelity = report.fidelity.as_ref().unwrap();
    assert!(fidelity.hausdorff_max_rel <= 0.005, "{name}: Hausdorff {}", fidelity.hausdorff_max_rel);
    let regions = |mesh: &remesh_engine::mesh::SurfaceMesh| {
        let mut used: Vec<u32> = mesh.face_region.clone();
        used.sort_unstable();
        used.dedup();
        (used, mesh.regions.clone())
    };
    assert_eq!(regions(output), regions(&remesh.charts.surface.imported.mesh), "{name}: regions");
}

fn spec(kind: SampleKind, triangles: u64) -> SampleSpec {
    SampleSpec { kind, triangles, genus: None, outlets: None, aspect_ratio: None }
}

#[test]
fn artery() {
    remeshed(spec(SampleKind::Artery, 12_000), SizeSpec::TriangleCount { triangles: 8000 });
}

#[test]
fn pelvis() {
    remeshed(spec(SampleKind::Pelvis, 12_000), SizeSpec::TriangleCount { triangles: 8000 });
}

#[test]
fn brake() {
    remeshed(spec(SampleKind::Brake, 20_000), SizeSpec::TriangleCount { triangles: 16_000 });
}

#[test]
fn cad_part() {
    remeshed(spec(SampleKind::CadPart, 6000), SizeSpec::TriangleCount { triangles: 8000 });
}

#[test]
fn tube() {
    let spec = SampleSpec { aspect_ratio: Some(8.0), ..spec(SampleKind::Tube, 6000) };
    remeshed(spec, SizeSpec::TriangleCount { triangles: 5000 });
}

/// Straight borders, which are the default of all the above: shorter, named by the imported mesh, the same with any number of threads.
#[test]
fn straight_borders() {
    let geodesic = || PartitionSpec { borders: BorderSmoothing::Geodesic, ..PartitionSpec::default() };
    let wanted = |triangles| SizeSpec::TriangleCount { triangles };
    let outputs = [1, 4].map(|threads| {
        let engine = Engine::new(EngineConfig::default());
        let session = engine.create_session(None, SystemTime::now()).unwrap();
        let mesh = Change::Mesh { source: MeshSource::Sample(spec(SampleKind::Pelvis, 6000)), options: ImportOptions::default() };
        session.apply(None, &[mesh, Change::Size(wanted(4000)), Change::Partition(geodesic())]).unwrap();
        let cancel = CancelToken::new();
        let run = Run { cancel: &cancel, events: &|_| {}, threads };
        let remesh = pipeline::remesh(&engine, &session.snapshot(), &run).unwrap().value;
        let cut = remesh.charts.cut.as_ref().unwrap();
        assert!(cut.border_length[1] < 0.99 * cut.border_length[0], "{:?}", cut.border_length);
        // Everything a client sees is named by elements of the imported mesh.
        let imported = &remesh.charts.surface.imported.mesh;
        for (patch, _, map) in &remesh.charts.patches.patches {
            assert!(map.named.iter().all(|&v| (v as usize) < imported.positions.len()));
            assert!(map.faces.iter().all(|&f| (f as usize) < imported.triangles.len()));
            assert_eq!((map.named.len(), map.faces.len()), (patch.positions.len(), patch.triangles.len()));
        }
        remesh.result.output
    });
    assert_eq!(outputs[0], outputs[1]);
}
