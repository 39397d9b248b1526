//! What an edit of a chart costs next to the cold chart: other pins, moved targets, another boundary, another method, on the bunny in two
//! patches. Prints milliseconds, ratios and which stages ran.
//!
//! `cargo bench --bench charts [-- FILE PATCHES]`: without a file, the bunny of `REMESH_DATA`, or a generated pelvis.
//!
//! `cargo bench --bench charts -- cold PATCH.off..`: cold LSCM and harmonic charts of files that are one patch each, user CPU, to set
//! beside those of `benches/libigl.py`.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::features::FeatureSpec;
use remesh_engine::import::{ImportOptions, import_mesh};
use remesh_engine::parametrize::{
    Boundary, BoundaryShape, ChartMethod, ChartSpec, Holes, MapVerdict, Pin, Pins, Weights, candidate_maps, factor_boundary, factor_system,
    plan_system, solve_map,
};
use remesh_engine::partition::{Partition, PartitionSpec, PatchSummary};
use remesh_engine::patch::{Patch, extract_patches};
use remesh_engine::pipeline::{self, Layout, Run};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Blob, Change, MeshSource, Session};
use remesh_engine::stage::{Outcome, Stage, StageRecord};
use remesh_engine::topology::Topology;
use remesh_engine::work::{CancelToken, Work};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

const REPEATS: usize = 5;

struct Bench {
    source: MeshSource,
    patches: u32,
    patch: u32,
}

/// Wall milliseconds of the stages that ran for a patch, besides what lies above its charts.
fn chart_stages(records: &[StageRecord]) -> Vec<(Stage, f64)> {
    let is_chart = |s: Stage| matches!(s, Stage::System | Stage::Factor | Stage::Boundary | Stage::Solve | Stage::Chart);
    records.iter().filter(|r| r.outcome == Outcome::Run && is_chart(r.stage)).map(|r| (r.stage, r.milliseconds)).collect()
}

impl Bench {
    fn open(&self) -> (Arc<Engine>, Arc<Session>) {
        let engine = Engine::new(EngineConfig::default());
        let session = engine.create_session(None, SystemTime::now()).expect("a session opens");
        let partition =
            PartitionSpec { patches: Some(self.patches), max_patch_faces: 1 << 24, max_aspect_ratio: 1e6, ..PartitionSpec::default() };
        let features = FeatureSpec { feature_angle_deg: None, ..FeatureSpec::default() };
        let mesh = Change::Mesh { source: self.source.clone(), options: ImportOptions::default() };
        session.apply(None, &[mesh, Change::Features(features), Change::Partition(partition)]).expect("the changes apply");
        (engine, session)
    }

    fn layout(&self, engine: &Engine, session: &Session) -> Layout {
        let cancel = CancelToken::new();
        let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
        pipeline::layout(engine, &session.snapshot(), &run).expect("the surface has charts").value
    }

    /// Milliseconds and stages run of charts under the session's inputs.
    fn charts(&self, engine: &Engine, session: &Session) -> (f64, Vec<(Stage, f64)>) {
        let cancel = CancelToken::new();
        let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
        let begin = Instant::now();
        let answer = pipeline::charts(engine, &session.snapshot(), &run);
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        match answer {
            Ok(answer) => (milliseconds, chart_stages(&answer.records)),
            Err(error) => {
                println!("    refused: {}", error.message());
                (f64::NAN, Vec::new())
            }
        }
    }

    /// A session whose patch has the first spec; then each of the others in turn. Medians of several fresh sessions.
    fn measure(&self, first: &ChartSpec, edits: &[(&str, ChartSpec)]) -> Vec<f64> {
        let mut rows: Vec<Vec<f64>> = vec![Vec::new(); edits.len() + 1];
        let mut ran: Vec<String> = vec![String::new(); edits.len() + 1];
        for _ in 0..REPEATS {
            let (engine, session) = self.open();
            let layout = self.layout(&engine, &session);
            let identity = layout.patches.identities[self.patch as usize];
            // Only what belongs to the patches above the charts stays; factors of the default chart go with the engine.
            let (engine, fresh) = self.open();
            let cancel = CancelToken::new();
            let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
            pipeline::partition(&engine, &fresh.snapshot(), &run).expect("the surface is partitioned");
            for (k, spec) in std::iter::once(first).chain(edits.iter().map(|e| &e.1)).enumerate() {
                fresh.apply(None, &[Change::PatchChart { patch: identity, spec: Some(spec.clone()) }]).expect("the change applies");
                let (whole, stages) = self.charts(&engine, &fresh);
                // The first computes the other patches, too: count the stages of this patch alone.
                rows[k].push(if k == 0 { self.cold(&engine, &fresh, spec) } else { whole });
                ran[k] = stages.iter().map(|(s, ms)| format!("{} {ms:.1}", s.name())).collect::<Vec<_>>().join(", ");
            }
        }
        let medians: Vec<f64> = rows
            .iter_mut()
            .map(|row| {
                row.sort_by(f64::total_cmp);
                row[row.len() / 2]
            })
            .collect();
        println!("  {:<34} {:>8.2} ms", "cold", medians[0]);
        for (k, (name, _)) in edits.iter().enumerate() {
            println!("  {name:<34} {:>8.2} ms   1/{:<5.1} [{}]", medians[k + 1], medians[0] / medians[k + 1], ran[k + 1]);
        }
        medians
    }

    /// The chart of the patch alone, nothing of it cached.
    fn cold(&self, engine: &Engine, session: &Session, spec: &ChartSpec) -> f64 {
        let layout = self.layout(engine, session);
        let (patch, _, map) = &layout.patches.patches[self.patch as usize];
        let local = spec.localised(map, &layout.surface.imported.mesh.positions).expect("the vertices are of the patch");
        let cancel = CancelToken::new();
        let begin = Instant::now();
        let chart = remesh_engine::parametrize::parametrize_patch(patch, &local, &Work::silent(&cancel));
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        if let Err(error) = chart {
            println!("    refused: {}", error.message());
        }
        milliseconds
    }
}

fn pins(a: u32, b: u32, targets: Option<[[f64; 2]; 2]>) -> ChartSpec {
    let pin = |vertex, k: usize| Pin { vertex, target: targets.map(|t| t[k]) };
    ChartSpec { pins: Pins::Given(vec![pin(a, 0), pin(b, 1)]), ..ChartSpec::only(ChartMethod::LeastSquaresConformal) }
}

fn shape(method: ChartMethod, shape: BoundaryShape, start: Option<u32>) -> ChartSpec {
    ChartSpec { boundary: Boundary { shape, start, ..Boundary::default() }, ..ChartSpec::only(method) }
}

/// User CPU milliseconds of this process so far (Linux; 0 elsewhere), in steps of 10.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let mut fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.nth(11).and_then(|ticks| ticks.parse::<f64>().ok()).map_or(0.0, |ticks| ticks * 10.0)
}

/// A surface that is one patch, as an open session would have it.
fn one_patch(path: &str) -> Patch {
    let blob = Blob::new(std::fs::read(path).expect("the file is readable"));
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let mesh = import_mesh(&blob.bytes().expect("in memory"), &ImportOptions::default(), &work).expect("the file is a surface").mesh;
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).expect("the surface is manifold");
    let faces = mesh.triangles.len();
    let partition = Partition { face_patch: vec![0; faces], patches: vec![PatchSummary::default()], ..Partition::default() };
    extract_patches(&mesh, &topology, &partition).expect("the surface has a boundary").remove(0).0
}

/// Elimination order, factors, solution and checks of the first map of a method.
fn cold_map(patch: &Patch, method: ChartMethod, work: &Work<'_>) -> MapVerdict {
    let spec =
        ChartSpec { pins: if method == ChartMethod::Harmonic { Pins::Automatic } else { Pins::Farthest }, ..ChartSpec::only(method) };
    let spec = ChartSpec { holes: Holes::Open, ..spec };
    let maps = candidate_maps(patch, &spec).expect("the spec fits");
    let system = plan_system(patch, work).expect("the patch is sound");
    let factor = factor_system(patch, &system, Weights::Cotangent, work).expect("the patch is sound");
    let boundary = factor_boundary(patch, Some(&factor), maps[0].problem(), work).expect("the patch is sound");
    solve_map(patch, Some(&factor), &boundary, &maps[0], work).expect("the map is solved").verdict
}

fn cold_times(paths: &[String]) {
    const ROUNDS: u32 = 40;
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    for path in paths {
        let patch = one_patch(path);
        println!("{path}: {} vertices, {} loops", patch.positions.len(), patch.loops.len());
        for method in [ChartMethod::LeastSquaresConformal, ChartMethod::Harmonic] {
            let (begin, cpu) = (Instant::now(), cpu_ms());
            let mut verdict = MapVerdict::Usable;
            for _ in 0..ROUNDS {
                verdict = cold_map(&patch, method, &work);
            }
            let each = |total: f64| total / f64::from(ROUNDS);
            let (cpu, wall) = (each(cpu_ms() - cpu), each(begin.elapsed().as_secs_f64() * 1e3));
            let verdict = format!("{verdict:?}");
            println!(
                "  {:<24} user CPU {cpu:>6.1} ms, wall {wall:>6.1} ms  ({})",
                method.name(),
                verdict.split(['{', '(']).next().unwrap_or("")
            );
        }
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if words.first().is_some_and(|word| word == "cold") {
        return cold_times(&words[1..]);
    }
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let data = std::env::var_os("REMESH_DATA").map(|folder| PathBuf::from(folder).join("bunny.obj"));
    let path = arguments.first().map(PathBuf::from).or(data);
    let patches: u32 = arguments.get(1).and_then(|t| t.parse().ok()).unwrap_or(2);
    let source = match &path {
        Some(path) => MeshSource::File(Arc::new(Blob::new(std::fs::read(path).expect("the file is readable")))),
        None => {
            MeshSource::Sample(SampleSpec { kind: SampleKind::Pelvis, triangles: 70_000, genus: None, outlets: None, aspect_ratio: None })
        }
    };
    let mut bench = Bench { source, patches, patch: 0 };
    let (engine, session) = bench.open();
    let layout = bench.layout(&engine, &session);
    let largest = (0..layout.patches.patches.len()).max_by_key(|&p| layout.patches.patches[p].0.triangles.len()).unwrap_or(0);
    bench.patch = largest as u32;
    let (patch, _, map) = &layout.patches.patches[largest];
    println!(
        "{} patches; patch {largest}: {} vertices, {} faces, {} loops of {} vertices\n",
        layout.patches.patches.len(),
        patch.positions.len(),
        patch.triangles.len(),
        patch.loops.len(),
        patch.loops.iter().map(Vec::len).sum::<usize>()
    );
    let ring: Vec<u32> = patch.loops[0].iter().map(|&v| map.vertices[v as usize]).collect();
    let at = |share: f64| ring[(share * ring.len() as f64) as usize];
    let inside = {
        let on_loop: Vec<u32> = patch.loops.concat();
        (0..patch.positions.len() as u32).filter(|v| !on_loop.contains(v)).nth(patch.positions.len() / 3).map(|v| map.vertices[v as usize])
    };
    let inside = inside.expect("the patch has inner vertices");
    println!("least squares conformal, two pins");
    let targets = [[0.0, 0.0], [10.0, 3.0]];
    bench.measure(
        &pins(at(0.0), at(0.5), Some(targets)),
        &[
            ("moved targets", pins(at(0.0), at(0.5), Some([[1.0, 2.0], [-4.0, 7.0]]))),
            ("other pins on the boundary", pins(at(0.2), at(0.7), Some(targets))),
            ("other pins, one inside", pins(at(0.2), inside, Some(targets))),
            ("spectral conformal", ChartSpec::only(ChartMethod::SpectralConformal)),
            ("harmonic on a circle", ChartSpec::only(ChartMethod::Harmonic)),
        ],
    );
    for method in [ChartMethod::Harmonic, ChartMethod::Barycentric, ChartMethod::MeanValue] {
        println!("\n{}, circle", method.name());
        bench.measure(
            &shape(method, BoundaryShape::Circle, None),
            &[
                ("square", shape(method, BoundaryShape::Rectangle { ratio: Some(1.0), corners: None }, None)),
                ("circle, other starting vertex", shape(method, BoundaryShape::Circle, Some(at(0.3)))),
                ("ellipse", shape(method, BoundaryShape::Ellipse { ratio: 2.0 }, None)),
            ],
        );
    }
    println!("\nspectral conformal");
    bench.measure(
        &ChartSpec::only(ChartMethod::SpectralConformal),
        &[
            ("least squares conformal, two pins", pins(at(0.0), at(0.5), Some(targets))),
            ("least squares conformal, any pins", ChartSpec::only(ChartMethod::LeastSquaresConformal)),
        ],
    );
}
