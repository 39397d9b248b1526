//! Every chart method on every patch of the real meshes and the samples: one-to-one, repaired, or not delivered; and conformal against mean
//! value charts under the same mesher (P1 table 1). Like `real_data.rs` these read `REMESH_DATA` and are ignored unless asked for.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::error::Reason;
use remesh_engine::import::ImportOptions;
use remesh_engine::parametrize::{ChartMethod, ChartSpec};
use remesh_engine::partition::{BorderSmoothing, PartitionSpec};
use remesh_engine::patch::Patch;
use remesh_engine::pipeline::{self, ChartVerdict, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Blob, Change, MeshSource, Session};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::work::CancelToken;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

fn file(name: &str) -> MeshSource {
    let folder = std::env::var_os("REMESH_DATA").expect("REMESH_DATA names the folder of the meshes");
    let path = PathBuf::from(folder).join(name);
    MeshSource::File(Arc::new(Blob::new(std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))))
}

fn open(source: MeshSource, options: ImportOptions) -> (Arc<Engine>, Arc<Session>) {
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    session.apply(None, &[Change::Mesh { source, options }]).unwrap();
    (engine, session)
}

/// What became of the charts of one method.
#[derive(Default)]
struct Tally {
    usable: u32,
    repaired: u32,
    must_split: u32,
    refused: u32,
    flips_before: u64,
    flips_left: u64,
}

/// Faces that are not counter-clockwise, in plain arithmetic: an independent count up to rounding.
fn clockwise(patch: &Patch, uv: &[[f64; 2]]) -> usize {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| uv[v as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let total: f64 = patch.triangles.iter().map(|t| area(t).abs()).sum();
    patch.triangles.iter().filter(|t| area(t) < -1e-14 * total).count()
}

fn all_methods(name: &str, source: MeshSource, options: ImportOptions) {
    let (engine, session) = open(source, options);
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 2 };
    let snapshot = session.snapshot();
    let count = pipeline::layout(&engine, &snapshot, &run).unwrap().value.charts.len() as u32;
    for method in ChartMethod::ALL {
        let mut tally = Tally::default();
        for p in 0..count {
            let (layout, preview) = pipeline::preview_chart(&engine, &snapshot, p, |_, _| Ok(ChartSpec::only(method)), &run).unwrap().value;
            let patch = &layout.patches.patches[p as usize].0;
            let last = preview.attempts.last().unwrap();
            assert!(preview.attempts.iter().all(|a| a.method == method), "{name} {p}: replaced");
            tally.flips_before += u64::from(last.flipped_before);
            match preview.verdict {
                ChartVerdict::Usable => {
                    assert!(!last.overlaps && last.flipped == 0 && clockwise(patch, &preview.uv) == 0, "{name} {p} {method:?}");
                    tally.usable += 1;
                    tally.repaired += u32::from(last.flipped_before > 0);
                }
                ChartVerdict::MustSplit(_) => tally.must_split += 1,
                ChartVerdict::Refused(error) => {
                    assert_eq!(error.reason(), Reason::ChartFailed);
                    tally.refused += 1;
                    tally.flips_left += u64::from(last.flipped);
                }
            }
        }
        let Tally { usable, repaired, must_split, refused, flips_before, flips_left } = tally;
        println!(
            "{name:<18} {:<24} {count:>4} patches: {usable:>4} usable ({repaired} repaired), {must_split:>3} too uneven, {refused:>3} refused; \
             flips before repair {flips_before}, in delivered charts 0, in refused ones {flips_left}",
            method.name()
        );
    }
    // Whatever the explicit methods do, the automatic choice has a chart for every patch.
    let charts = pipeline::charts(&engine, &snapshot, &run).unwrap().value;
    for p in 0..charts.charts.len() {
        assert_eq!(clockwise(&charts.patches.patches[p].0, &charts.chart(p).unwrap().uv), 0, "{name} {p}");
    }
}

const MODELS: [&str; 11] = [
    "bunny.obj",
    "pelvisSMOOTH.stl",
    "aorta2.stl",
    "bypass.stl",
    "carotid.stl",
    "skull.stl",
    "rocker-arm.obj",
    "3holes.off",
    "lilium.obj",
    "fandisk.obj",
    "t13_data.stl",
];

#[test]
#[ignore = "needs REMESH_DATA"]
fn every_method_on_every_patch_of_the_models() {
    for name in MODELS {
        all_methods(name, file(name), ImportOptions::default());
    }
    let only = ["100", "200", "300", "400"].map(String::from).to_vec();
    all_methods("pelvis-hemi.msh", file("pelvis-hemi.msh"), ImportOptions { only_regions: only, ..ImportOptions::default() });
}

#[test]
#[ignore = "long"]
fn every_method_on_every_patch_of_the_samples() {
    for kind in [SampleKind::Tube, SampleKind::Artery, SampleKind::Pelvis, SampleKind::Brake, SampleKind::CadPart] {
        let aspect_ratio = (kind == SampleKind::Tube).then_some(3.0);
        let spec = SampleSpec { kind, triangles: 20_000, genus: None, outlets: None, aspect_ratio };
        all_methods(&format!("{kind:?} sample"), MeshSource::Sample(spec), ImportOptions::default());
    }
}

/// P1 table 1: the same partition along input edges as there, sizes and mesher; the optimisation of the surface is off, so that charts and
/// mesher show alone.
#[test]
#[ignore = "needs REMESH_DATA"]
fn conformal_charts_give_better_meshes_than_mean_value_ones() {
    for (name, triangles) in [("aorta2.stl", 10_000), ("pelvisSMOOTH.stl", 8_400)] {
        let mut rows = Vec::new();
        for method in [ChartMethod::MeanValue, ChartMethod::SpectralConformal] {
            let (engine, session) = open(file(name), ImportOptions::default());
            let raw = remesh_engine::optimize::OptimizeSpec { rounds: 0, min_kappa: 0.0, ..Default::default() };
            let size = Change::Size(SizeSpec::TriangleCount { triangles });
            let along_edges = Change::Partition(PartitionSpec { borders: BorderSmoothing::Vote, ..PartitionSpec::default() });
            session.apply(None, &[size, along_edges, Change::Optimize(raw), Change::Chart(ChartSpec::only(method))]).unwrap();
            let cancel = CancelToken::new();
            let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
            let begin = Instant::now();
            let remesh = pipeline::remesh(&engine, &session.snapshot(), &run).unwrap_or_else(|e| panic!("{name} {method:?}: {e}")).value;
            let seconds = begin.elapsed().as_secs_f64();
            let (_, report) = pipeline::quality(&engine, &session.snapshot(), QualityScope::Elements, &run).unwrap().value;
            let shape = &report.shape;
            println!(
                "{name:<18} {:<20} kappa min {:.3} mean {:.4}, tau {:.1}, {} triangles, {seconds:.2} s, {} patches",
                method.name(),
                shape.kappa_min,
                shape.kappa_mean,
                shape.tau.unwrap(),
                shape.triangles,
                remesh.charts.charts.len()
            );
            rows.push((shape.kappa_min, shape.kappa_mean, shape.tau.unwrap()));
        }
        let [mean_value, conformal] = rows[..] else { panic!("two rows") };
        assert!(conformal.1 > mean_value.1 && conformal.2 > mean_value.2, "{name}: {rows:?}");
    }
}
