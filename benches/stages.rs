//! Milliseconds per stage, cold and after a size change, on one and two threads, with the ratios that matter.
//!
//! `cargo bench --bench stages [-- FILE TRIANGLES]`: without a file, the bunny of `REMESH_DATA` at 25,000 triangles, or a generated pelvis.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::import::ImportOptions;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Blob, Change, MeshSource};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::stage::{Outcome, Stage, StageRecord};
use remesh_engine::work::CancelToken;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

struct Timing {
    wall_ms: f64,
    cpu_ms: f64,
    stages: BTreeMap<Stage, (f64, usize, usize)>,
    triangles: usize,
}

/// User CPU milliseconds of this process so far (Linux; 0 elsewhere), in steps of 10.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let mut fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.nth(11).and_then(|ticks| ticks.parse::<f64>().ok()).map_or(0.0, |ticks| ticks * 10.0)
}

fn by_stage(records: &[StageRecord]) -> BTreeMap<Stage, (f64, usize, usize)> {
    let mut table: BTreeMap<Stage, (f64, usize, usize)> = BTreeMap::new();
    for record in records {
        let entry = table.entry(record.stage).or_default();
        entry.0 += record.milliseconds;
        match record.outcome {
            Outcome::Run => entry.1 += 1,
            Outcome::Hit => entry.2 += 1,
        }
    }
    // A chart waits for its factor: count that time once.
    let factor = table.get(&Stage::Factor).map_or(0.0, |f| f.0);
    if let Some(chart) = table.get_mut(&Stage::Chart) {
        chart.0 -= factor.min(chart.0);
    }
    table
}

fn measure(engine: &Engine, session: &remesh_engine::session::Session, threads: usize) -> Timing {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads };
    let (begin, cpu) = (Instant::now(), cpu_ms());
    let answer = pipeline::remesh(engine, &session.snapshot(), &run).expect("the benchmark surface remeshes");
    Timing {
        wall_ms: begin.elapsed().as_secs_f64() * 1e3,
        cpu_ms: cpu_ms() - cpu,
        stages: by_stage(&answer.records),
        triangles: answer.value.result.mesh.triangles.len(),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let data = std::env::var_os("REMESH_DATA").map(|folder| PathBuf::from(folder).join("bunny.obj"));
    let path = arguments.first().map(PathBuf::from).or(data);
    let triangles: u64 = arguments.get(1).and_then(|t| t.parse().ok()).unwrap_or(25_000);
    let source = match &path {
        Some(path) => MeshSource::File(Arc::new(Blob::new(std::fs::read(path).expect("the file is readable")))),
        None => {
            MeshSource::Sample(SampleSpec { kind: SampleKind::Pelvis, triangles: 70_000, genus: None, outlets: None, aspect_ratio: None })
        }
    };
    println!("{} to {triangles} triangles", path.as_ref().map_or("generated pelvis".into(), |p| p.display().to_string()));
    let mut totals = Vec::new();
    for threads in [1, 2] {
        let engine = Engine::new(EngineConfig::default());
        let session = engine.create_session(None, SystemTime::now()).expect("a session opens");
        let mesh = Change::Mesh { source: source.clone(), options: ImportOptions::default() };
        session.apply(None, &[mesh, Change::Size(SizeSpec::TriangleCount { triangles })]).expect("the change applies");
        let cold = measure(&engine, &session, threads);
        session.apply(None, &[Change::Size(SizeSpec::TriangleCount { triangles: triangles * 9 / 10 })]).expect("the change applies");
        let resized = measure(&engine, &session, threads);
        let again = measure(&engine, &session, threads);
        println!("\n{threads} thread(s)       cold ms (runs)      resized ms (runs/hits)");
        for stage in Stage::ALL {
            let Some(c) = cold.stages.get(&stage) else { continue };
            let r = resized.stages.get(&stage).copied().unwrap_or_default();
            println!("  {:<12} {:>9.1} ({:>4})      {:>9.1} ({:>4}/{:>4})", stage.name(), c.0, c.1, r.0, r.1, r.2);
        }
        for (name, t) in [("cold", &cold), ("resized", &resized), ("unchanged", &again)] {
            println!("  {name:<10} wall {:>8.1} ms, user CPU {:>7.0} ms, {} triangles", t.wall_ms, t.cpu_ms, t.triangles);
        }
        println!("  resized / cold: wall {:.2}, CPU {:.2}", resized.wall_ms / cold.wall_ms, resized.cpu_ms / cold.cpu_ms.max(1.0));
        totals.push(cold.wall_ms);
    }
    println!("\ncold, one thread / two threads: wall {:.2}", totals[0] / totals[1]);
}
