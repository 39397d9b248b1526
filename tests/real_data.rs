//! Real meshes through the engine: the floors of quality and fidelity, and refusals that say what and where.
//! They read the folder named by `REMESH_DATA` and are ignored (`cargo test` says so) unless asked for: `-- --ignored`.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::{EngineError, Reason};
use remesh_engine::import::ImportOptions;
use remesh_engine::pipeline::{self, Remesh, Run};
use remesh_engine::quality::{QualityReport, QualityScope};
use remesh_engine::session::{Blob, Change, MeshSource};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::work::CancelToken;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

fn file(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("REMESH_DATA").expect("REMESH_DATA names the folder of the meshes");
    let path = PathBuf::from(folder).join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn remesh(bytes: Vec<u8>, options: ImportOptions, triangles: u64) -> Result<(Remesh, QualityReport), EngineError> {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now())?;
    let source = MeshSource::File(Arc::new(Blob::new(bytes)));
    session.apply(None, &[Change::Mesh { source, options }, Change::Size(SizeSpec::TriangleCount { triangles })])?;
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    let (remesh, report) = pipeline::quality(&engine, &session.snapshot(), QualityScope::Full, &run)?.value;
    Ok((remesh, QualityReport::clone(&report)))
}

/// The floors of every remesh of a sound surface.
fn check_floors(name: &str, remesh: &Remesh, report: &QualityReport) {
    let size = remesh.sizes.uniform.unwrap();
    let fidelity = report.fidelity.as_ref().unwrap();
    let shape = &report.shape;
    println!(
        "{name}: {} triangles, {} patches, kappa min {:.3} mean {:.4}, tau {:.1}, Hausdorff {:.5} of the diagonal",
        shape.triangles,
        remesh.charts.charts.len(),
        shape.kappa_min,
        shape.kappa_mean,
        shape.tau.unwrap(),
        fidelity.hausdorff_max_rel
    );
    assert!(report.topology_kept, "{name}: {:?} became {:?}", report.topology_input, report.topology_output);
    assert_eq!(report.self_intersections, Some(0), "{name}");
    assert!(shape.kappa_mean >= 0.96, "{name}: kappa mean {}", shape.kappa_mean);
    assert!(shape.kappa_min >= 0.25, "{name}: kappa min {}", shape.kappa_min);
    assert!(shape.tau.unwrap() >= 88.0, "{name}: tau {:?}", shape.tau);
    assert!(fidelity.hausdorff_max_rel <= 0.005, "{name}: Hausdorff {}", fidelity.hausdorff_max_rel);
    if let Some(boundary) = fidelity.boundary_deviation_rel {
        assert!(boundary * fidelity.diagonal <= 0.1 * size, "{name}: boundary off by {boundary}");
    }
}

fn meets_floors(name: &str, triangles: u64, options: ImportOptions) {
    let (remesh, report) = remesh(file(name), options, triangles).unwrap_or_else(|e| panic!("{name}: {e}"));
    check_floors(name, &remesh, &report);
}

macro_rules! models {
    ($($test:ident: $file:literal, $triangles:literal;)*) => {
        $(#[test]
        #[ignore = "needs REMESH_DATA"]
        fn $test() {
            meets_floors($file, $triangles, ImportOptions::default());
        })*
    };
}

models! {
    bunny: "bunny.obj", 25_000;
    pelvis_smooth: "pelvisSMOOTH.stl", 8_400;
    aorta2: "aorta2.stl", 10_000;
    bypass: "bypass.stl", 20_000;
    carotid: "carotid.stl", 10_000;
    skull: "skull.stl", 10_000;
    rocker_arm: "rocker-arm.obj", 20_000;
    three_holes: "3holes.off", 10_000;
    lilium: "lilium.obj", 10_000;
    fandisk: "fandisk.obj", 10_000;
    t13: "t13_data.stl", 20_000;
}

#[test]
#[ignore = "needs REMESH_DATA"]
fn pelvis_hemi_with_the_surfaces_of_one_copy() {
    let only = ["100", "200", "300", "400"].map(String::from).to_vec();
    meets_floors("pelvis-hemi.msh", 21_000, ImportOptions { only_regions: only, ..ImportOptions::default() });
}

/// Either a sound remesh or an error that names the cause; where the cause is geometric, with places.
fn is_remeshed_or_refused(name: &str, bytes: Vec<u8>) {
    match remesh(bytes, ImportOptions::default(), 5000) {
        Ok((_, report)) => {
            println!("{name}: remeshed, kappa min {:.3}, self-intersections {:?}", report.shape.kappa_min, report.self_intersections);
            assert!(report.topology_kept, "{name}");
        }
        Err(error) => {
            println!("{name}: refused, {error}");
            assert_ne!(error.reason(), Reason::Invariant, "{name}: {error}");
            if matches!(error.reason(), Reason::NonManifoldEdge | Reason::NonManifoldVertex | Reason::NotOrientable) {
                assert!(!error.locations().is_empty(), "{name}: {error}");
            }
        }
    }
}

const BROKEN: [&str; 7] = ["demo1.stl", "car_body.stl", "prt2.stl", "implant.stl", "button_ascii.stl", "multi_solid.stl", "pelvis-BAD.stl"];

#[test]
#[ignore = "needs REMESH_DATA"]
fn broken_files_are_remeshed_or_refused() {
    for name in BROKEN {
        is_remeshed_or_refused(name, file(name));
    }
}

#[test]
#[ignore = "needs REMESH_DATA"]
fn damaged_files_are_remeshed_or_refused() {
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    for name in BROKEN {
        let bytes = file(name);
        is_remeshed_or_refused(&format!("{name} empty"), Vec::new());
        for part in [1, 3, 7] {
            is_remeshed_or_refused(&format!("{name} cut to {part}/8"), bytes[..bytes.len() * part / 8].to_vec());
        }
        let mut flipped = bytes;
        for _ in 0..5 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let at = (random >> 20) as usize % flipped.len();
            flipped[at] ^= 1 << (random >> 60 & 7);
        }
        is_remeshed_or_refused(&format!("{name} with flipped bits"), flipped);
    }
}
