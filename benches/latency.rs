//! How fast the daemon lets go and lets pass, over TCP to a process of its own:
//!
//! - `cancel`: from a dropped call, a deadline, a cancelled operation or a deleted session to the end of the compute, at random moments;
//! - `methods`: the same by cancelled operations for the other strategies of partition and meshers, at random moments each;
//! - `priority`: a re-pin and one patch, idle and under a batch load that never ends;
//! - `overhead`: the same remesh and re-pin by the daemon and by the engine called directly, each in a process of its own.
//!
//! ```sh
//! REMESH_LATENCY="cancel priority overhead" REMESH_MOMENTS=200 REMESH_MESH=bunny.obj cargo bench --bench latency
//! ```
//! Without `REMESH_MESH` the surface is generated, with 70000 triangles; without `REMESH_MOMENTS` there are 4 moments.

#[path = "../tests/common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use remesh_client::{ChartEdit, Client, EditingSession, RetryPolicy, Source, v1};
use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::import::ImportOptions;
use remesh_engine::parametrize::{ChartMethod, ChartSpec, Pin, Pins, face_distortion};
use remesh_engine::pipeline::{self, Run};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Blob, Change as EngineChange, MeshSource};
use remesh_engine::sizing::SizeSpec;
use remesh_engine::work::CancelToken;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use tonic::Request;
use v1::change::Change;
use v1::start_operation_request::Work;

const TRIANGLES: u64 = 70_000;
/// Previews in each turn of `overhead`.
const PREVIEWS: usize = 100;

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

async fn client_of(daemon: &Daemon) -> Client {
    Client::connect(&daemon.address).await.expect("connects").with_retry(RetryPolicy::NEVER)
}

fn size(triangles: u64) -> Change {
    Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(triangles)) })
}

fn sample() -> v1::SampleSpec {
    v1::SampleSpec { kind: v1::SampleKind::Pelvis.into(), triangles: Some(TRIANGLES), ..Default::default() }
}

async fn session(client: &Client, triangles: u64) -> EditingSession {
    let mut session = EditingSession::create(client, "latency").await.expect("session");
    let source = match variable("REMESH_MESH") {
        Some(path) => Source::Blob(client.upload(std::fs::read(path).expect("a file").into(), |_| {}).await.expect("upload")),
        None => Source::Sample(sample()),
    };
    session.import(source, v1::ImportOptions::default()).await.expect("import");
    session.apply(size(triangles)).await.expect("size");
    session
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// Median, 99 % and largest.
fn told(times: &mut [f64]) -> String {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times.get(((times.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(f64::NAN);
    format!("p50 {:.1} ms, p99 {:.1} ms, max {:.1} ms of {}", at(0.5), at(0.99), at(1.0), times.len())
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Milliseconds until nothing computes.
async fn until_idle(client: &Client, since: Instant) -> f64 {
    while client.cache_usage().await.expect("usage").running > 0 {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    milliseconds(since)
}

/// Stops a remesh of a session after `wait` in one of four ways; gives the moment it was told to.
async fn stop(client: &Client, session: EditingSession, way: usize, wait: Duration) -> Instant {
    let name = session.name().to_owned();
    let begin = Instant::now();
    match way {
        0 => {
            let _ = tokio::time::timeout(wait, client.remesh(&name, &[], |_| {})).await;
            Instant::now()
        }
        1 => {
            let mut request = Request::new(v1::RemeshSurfaceRequest { session: name, ..Default::default() });
            request.set_timeout(wait);
            if let Ok(stream) = client.remeshing().remesh_surface(request).await {
                let mut stream = stream.into_inner();
                while let Ok(Some(_)) = stream.message().await {}
            }
            begin + wait
        }
        2 => {
            let operation = client.start(&name, Work::Remesh(v1::RemeshWork::default())).await.expect("starts");
            tokio::time::sleep(wait).await;
            let told = Instant::now();
            client.cancel(&operation.name).await.expect("cancels");
            told
        }
        _ => {
            let (own, other) = (client.clone(), name.clone());
            let running = tokio::spawn(async move { own.remesh(&other, &[], |_| {}).await });
            tokio::time::sleep(wait).await;
            let told = Instant::now();
            session.delete().await.expect("deletes");
            let _ = running.await;
            told
        }
    }
}

async fn cancel(moments: u64) {
    // Without a cache every run computes everything.
    let daemon = Daemon::start(&["--cache-mb", "0"]);
    let client = client_of(&daemon).await;
    let whole = session(&client, TRIANGLES).await;
    let begin = Instant::now();
    let result = client.remesh(whole.name(), &[], |_| {}).await.expect("remesh");
    let duration = milliseconds(begin);
    println!("cancel: a whole remesh takes {duration:.0} ms and gives {} triangles", result.mesh.unwrap_or_default().faces);
    let mut times: [Vec<f64>; 4] = Default::default();
    let mut state = 1u64;
    for moment in 0..moments {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let wait = Duration::from_secs_f64(duration * 1e-3 * (state >> 11) as f64 / (1u64 << 53) as f64);
        let way = moment as usize % 4;
        let session = session(&client, TRIANGLES).await;
        let name = session.name().to_owned();
        let told = stop(&client, session, way, wait).await;
        times[way].push(until_idle(&client, told).await);
        let _ = client.delete_session(&name).await;
    }
    for (way, times) in ["dropped call", "deadline", "cancelled operation", "deleted session"].iter().zip(&mut times) {
        println!("cancel: {way}: {}", told(times));
    }
    let mut all = times.concat();
    println!("cancel: all: {}", told(&mut all));
}

/// The strategies of partition and the meshers that a plain remesh does not run.
fn methods() -> Vec<(&'static str, Change)> {
    use v1::MesherKind;
    let partition =
        |strategy: v1::PartitionStrategy| Change::Partition(v1::PartitionSpec { strategy: strategy.into(), ..Default::default() });
    let mesher = |kind: MesherKind| Change::Mesher(v1::MesherSpec { kind: kind.into(), ..Default::default() });
    vec![
        ("laplace", partition(v1::PartitionStrategy::Laplace)),
        ("pants", partition(v1::PartitionStrategy::Pants)),
        ("plane", partition(v1::PartitionStrategy::Plane)),
        ("handles", partition(v1::PartitionStrategy::Handles)),
        ("quads", mesher(MesherKind::Quads)),
        ("anisotropic", mesher(MesherKind::Anisotropic)),
        ("delaunay", mesher(MesherKind::Delaunay)),
        ("mesh adapt", mesher(MesherKind::MeshAdapt)),
    ]
}

async fn cancel_methods(moments: u64) {
    let daemon = Daemon::start(&["--cache-mb", "0"]);
    let client = client_of(&daemon).await;
    let mut state = 7u64;
    for (name, change) in methods() {
        let mut whole = session(&client, TRIANGLES).await;
        whole.apply(change.clone()).await.expect(name);
        let begin = Instant::now();
        let ended = client.remesh(whole.name(), &[], |_| {}).await.map(|_| ()).map_err(|error| error.to_string());
        let (duration, mut times) = (milliseconds(begin), Vec::new());
        for _ in 0..moments {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let wait = Duration::from_secs_f64(duration * 1e-3 * (state >> 11) as f64 / (1u64 << 53) as f64);
            let operation = client.start(whole.name(), Work::Remesh(v1::RemeshWork::default())).await.expect("starts");
            tokio::time::sleep(wait).await;
            let told = Instant::now();
            client.cancel(&operation.name).await.expect("cancels");
            times.push((until_idle(&client, told).await, wait));
        }
        let latest = times.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, wait)| wait.as_secs_f64() * 1e3);
        let mut times: Vec<f64> = times.into_iter().map(|(time, _)| time).collect();
        println!("methods: {name}: {} (the largest {latest:.0} ms after the begin of {duration:.0} ms: {ended:?})", told(&mut times));
    }
}

/// Two vertices of a patch to pin, other ones for each `round`.
fn pins(vertices: &[u32], round: usize) -> ChartEdit {
    let pin = |k: usize| v1::Pin { vertex: vertices[(k * 7919) % vertices.len()], target: None };
    let given = vec![pin(2 * round + 1), pin(2 * round + 2)];
    let spec = v1::ChartSpec {
        method: v1::ChartMethod::LeastSquaresConformal.into(),
        pins: Some(v1::PinSpec { given, ..Default::default() }),
        ..Default::default()
    };
    ChartEdit { spec, paths: vec!["method".into(), "pins".into()] }
}

/// Milliseconds of previews of other pins, and of a new pin with a new mesh of its patch.
async fn interactive(client: &Client, session: &mut EditingSession, vertices: &[u32], rounds: std::ops::Range<usize>) -> [Vec<f64>; 2] {
    let mut times: [Vec<f64>; 2] = Default::default();
    for round in rounds {
        let begin = Instant::now();
        client.preview_chart(session.name(), 0, pins(vertices, 2 * round)).await.expect("preview");
        times[0].push(milliseconds(begin));
        let begin = Instant::now();
        // A pin may give a map that is not one-to-one, whose patch then has no mesh: that is an answer, too.
        if session.update_patch_chart(0, pins(vertices, 2 * round + 1)).await.is_ok() {
            let _ = client.remesh(session.name(), &[0], |_| {}).await;
        }
        times[1].push(milliseconds(begin));
    }
    times
}

async fn priority(moments: u64) {
    let daemon = Daemon::start(&[]);
    let client = client_of(&daemon).await;
    let mut own = session(&client, TRIANGLES).await;
    client.remesh(own.name(), &[], |_| {}).await.expect("remesh");
    let vertices = client.read_chart(own.name(), 0).await.expect("chart").source_vertex;
    let moments = moments as usize;
    interactive(&client, &mut own, &vertices, 0..3).await;
    let mut idle = interactive(&client, &mut own, &vertices, 3..3 + moments).await;
    let batch: Vec<_> = (0..6u64)
        .map(|n| {
            let address = daemon.address.clone();
            tokio::spawn(async move {
                let client = Client::connect(&address).await.expect("connects");
                let mut session = session(&client, TRIANGLES + 1000 * n).await;
                for round in 0.. {
                    session.apply(size(TRIANGLES + 1000 * n + 7 * round)).await.expect("size");
                    client.remesh(session.name(), &[], |_| {}).await.expect("remesh");
                }
            })
        })
        .collect();
    tokio::time::sleep(Duration::from_secs(5)).await;
    let busy = client.cache_usage().await.expect("usage");
    let mut loaded = interactive(&client, &mut own, &vertices, 3 + moments..3 + 2 * moments).await;
    batch.iter().for_each(tokio::task::JoinHandle::abort);
    println!("priority: {} batch jobs compute, {} wait", busy.running, busy.queued);
    for (k, what) in ["re-pin (preview)", "re-pin and mesh of the patch"].iter().enumerate() {
        let ratio = median(&mut loaded[k]) / median(&mut idle[k]);
        println!("priority: {what}: idle {}; loaded {}; ratio of medians {ratio:.2}", told(&mut idle[k]), told(&mut loaded[k]));
    }
}

/// The engine called directly, in a process of its own as the daemon is: prints the milliseconds of a cold remesh, those of previews, those
/// of previews with the distortion of each face (which a preview with all columns has too), and imported vertices of patch 0.
fn direct(rounds: usize) {
    // As the daemon does, see its `keep_freed_memory`.
    drop(std::hint::black_box(Vec::<u8>::with_capacity(16 << 20)));
    let engine = Engine::new(EngineConfig::default());
    let session = engine.create_session(None, SystemTime::now()).expect("session");
    let source = match variable("REMESH_MESH") {
        Some(path) => MeshSource::File(Arc::new(Blob::new(std::fs::read(path).expect("a file")))),
        None => {
            let spec = SampleSpec { kind: SampleKind::Pelvis, triangles: TRIANGLES, genus: None, outlets: None, aspect_ratio: None };
            MeshSource::Sample(spec)
        }
    };
    let mesh = EngineChange::Mesh { source, options: ImportOptions::default() };
    session.apply(None, &[mesh, EngineChange::Size(SizeSpec::TriangleCount { triangles: TRIANGLES })]).expect("inputs");
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: engine.config.threads };
    let snapshot = session.snapshot();
    pipeline::import(&engine, &snapshot, &run).expect("import");
    let begin = Instant::now();
    pipeline::quality(&engine, &snapshot, QualityScope::Elements, &run).expect("remesh");
    let remesh = milliseconds(begin);
    let layout = pipeline::layout(&engine, &snapshot, &run).expect("layout").value;
    // Those that a split made have names that may be of another patch.
    let map = &layout.patches.patches[0].2;
    let vertices: Vec<u32> = map.vertices.iter().zip(&map.named).filter(|(own, name)| own == name).map(|(own, _)| *own).collect();
    let (mut alone, mut with_faces) = (Vec::new(), Vec::new());
    for round in 0..2 * rounds {
        let pin = |k: usize| Pin { vertex: vertices[(k * 7919) % vertices.len()], target: None };
        let pins = Pins::Given(vec![pin(2 * round + 1), pin(2 * round + 2)]);
        let spec = ChartSpec { method: Some(ChartMethod::LeastSquaresConformal), pins, ..ChartSpec::default() };
        let begin = Instant::now();
        let (layout, preview) = pipeline::preview_chart(&engine, &snapshot, 0, |_, _| Ok(spec.clone()), &run).expect("preview").value;
        if round % 2 == 0 {
            alone.push(milliseconds(begin));
            continue;
        }
        let faces = face_distortion(&layout.patches.patches[0].0, &preview.uv);
        with_faces.push(milliseconds(begin));
        assert!(!faces.is_empty());
    }
    let line = |numbers: Vec<String>| println!("{}", numbers.join(" "));
    line(vec![remesh.to_string()]);
    line(alone.iter().map(f64::to_string).collect());
    line(with_faces.iter().map(f64::to_string).collect());
    line(vertices.iter().map(u32::to_string).collect());
}

/// What [`direct`] prints in another process.
fn in_another_process() -> (f64, [Vec<f64>; 2], Vec<u32>) {
    let program = std::env::current_exe().expect("a program");
    let output = Command::new(program).env("REMESH_LATENCY", "direct").output().expect("runs");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let mut lines = text.lines().map(|line| line.split_whitespace());
    let mut numbers = || lines.next().expect("a line").map(|number| number.parse::<f64>().expect("a number")).collect::<Vec<f64>>();
    let (remesh, previews, vertices) = (numbers()[0], [numbers(), numbers()], numbers());
    (remesh, previews, vertices.into_iter().map(|vertex| vertex as u32).collect())
}

/// A preview of which the new coordinates come: what a re-pin changes.
async fn coordinates(client: &Client, session: &str, edit: ChartEdit) -> Vec<[f64; 2]> {
    use v1::preview_patch_chart_response::Part;
    let request = v1::PreviewPatchChartRequest {
        session: session.to_owned(),
        patch: 0,
        spec: Some(edit.spec),
        update_mask: Some(prost_types::FieldMask { paths: edit.paths }),
        columns: vec![v1::DataColumn::Uv.into()],
        ..Default::default()
    };
    let mut stream = client.charts().preview_patch_chart(request).await.expect("preview").into_inner();
    let mut uv = Vec::new();
    while let Some(message) = stream.message().await.expect("a message") {
        if let Some(Part::Chunk(chunk)) = message.part {
            let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().expect("8 bytes"));
            uv.extend(chunk.data.chunks_exact(16).map(|row| [number(&row[..8]), number(&row[8..])]));
        }
    }
    uv
}

async fn overhead(rounds: usize) {
    let (mut by_engine, mut by_daemon): ([Vec<f64>; 3], [Vec<f64>; 3]) = Default::default();
    let (mut inside, mut bytes) = (Vec::new(), [0; 2]);
    // In turns, so that what else the machine does meets both.
    for _ in 0..rounds.div_ceil(20).clamp(1, 20) {
        let (remesh, [alone, with_faces], vertices) = tokio::task::spawn_blocking(in_another_process).await.expect("no panic");
        by_engine[0].push(remesh);
        by_engine[1].extend(alone);
        by_engine[2].extend(with_faces);
        let daemon = Daemon::start(&[]);
        let client = client_of(&daemon).await;
        let session = session(&client, TRIANGLES).await;
        let begin = Instant::now();
        client.remesh(session.name(), &[], |_| {}).await.expect("remesh");
        by_daemon[0].push(milliseconds(begin));
        client.read_chart(session.name(), 0).await.expect("chart");
        for round in 0..PREVIEWS {
            let (edit, begin) = (pins(&vertices, round), Instant::now());
            let uv = coordinates(&client, session.name(), edit).await;
            by_daemon[1].push(milliseconds(begin));
            let (edit, begin) = (pins(&vertices, PREVIEWS + round), Instant::now());
            let shown = client.preview_chart(session.name(), 0, edit).await.expect("preview");
            by_daemon[2].push(milliseconds(begin));
            inside.push(shown.chart.run.milliseconds);
            bytes = [16 * uv.len(), (16 + 24 + 4) * uv.len() + (12 + 4 + 3 * 8 + 4) * shown.chart.triangles.len()];
        }
    }
    let [coordinates, all] = bytes.map(|bytes| bytes as f64 / 1e6);
    let preview = format!("re-pin (preview, coordinates, {coordinates:.1} MB)");
    let whole = format!("re-pin (preview, all nine columns of the chart, {all:.1} MB)");
    for (k, what) in ["remesh", preview.as_str(), whole.as_str()].iter().enumerate() {
        let (engine, daemon) = (median(&mut by_engine[k]), median(&mut by_daemon[k]));
        let share = 100.0 * (daemon / engine - 1.0);
        println!("overhead: {what}: engine {engine:.1} ms, daemon {daemon:.1} ms, {:+.1} ms, {share:+.1} %", daemon - engine);
    }
    println!("overhead: of a preview with all columns the daemon computes {:.1} ms", median(&mut inside));
}

fn main() {
    let wanted = variable("REMESH_LATENCY").unwrap_or_default();
    let moments = variable("REMESH_MOMENTS").and_then(|v| v.parse().ok()).unwrap_or(4);
    if wanted == "direct" {
        return direct(PREVIEWS);
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("threads");
    runtime.block_on(async {
        if wanted.is_empty() || wanted.contains("cancel") {
            cancel(moments).await;
        }
        if wanted.is_empty() || wanted.contains("methods") {
            cancel_methods(moments).await;
        }
        if wanted.is_empty() || wanted.contains("priority") {
            priority(moments).await;
        }
        if wanted.is_empty() || wanted.contains("overhead") {
            overhead(moments as usize).await;
        }
    });
}
