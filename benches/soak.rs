//! A soak: 16 clients on one daemon (a process of its own, over TCP) do random things for some minutes: edits, remeshes, cancelled and
//! dropped calls, operations, uploads, broken connections, sessions that come and go. Fails if a call ends with a code that is not expected,
//! or if the daemon takes more memory than its budget and the working set that is stated here.
//!
//! ```sh
//! REMESH_SOAK_MINUTES=30 cargo bench --bench soak
//! ```

#[path = "../tests/common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use remesh_client::{ChartEdit, Client, ClientError, EditingSession, RetryPolicy, Source, v1};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use v1::change::Change;

const CLIENTS: u64 = 16;
/// Megabytes of the stage cache.
const CACHE_MB: u64 = 256;
/// Megabytes that 6 computations at a time (2 long, 4 short) on surfaces of at most 20000 triangles, 48 sessions, uploads of 64 MB in all
/// and the allocator's holes may take beside the cache.
const WORKING_SET_MB: u64 = 768;
/// Codes that may be met: limits, work that was stopped on purpose, edits by others, sessions deleted by others, surfaces that refuse.
const EXPECTED: [&str; 11] = [
    "OK",
    "LIMIT_REACHED",
    "QUEUE_FULL",
    "CANCELLED",
    "DEADLINE_EXCEEDED",
    "STALE_REVISION",
    "SESSION_NOT_FOUND",
    "NOTHING_TO_STEP_TO",
    "PATCH_TOPOLOGY",
    // Of a session whose size or mesh was undone.
    "NO_MESH",
    "BAD_PARAMETER size",
];

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % bound.max(1)
    }
}

fn start() -> Daemon {
    let cache = CACHE_MB.to_string();
    Daemon::start(&["--cache-mb", &cache, "--max-sessions", "48", "--max-uploads-mb", "64", "--max-jobs-per-client", "64"])
}

/// Resident and peak resident megabytes.
fn memory(daemon: &Daemon) -> [u64; 2] {
    let status = std::fs::read_to_string(format!("/proc/{}/status", daemon.child.id())).unwrap_or_default();
    let of = |key: &str| {
        let line = status.lines().find(|line| line.starts_with(key));
        line.and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok()).unwrap_or(0) / 1024
    };
    [of("VmRSS:"), of("VmHWM:")]
}

#[derive(Default)]
struct Tally {
    /// Operations by what they were.
    operations: BTreeMap<&'static str, u64>,
    /// Ends by reason.
    ends: BTreeMap<String, u64>,
    /// Milliseconds of re-pins, and what of it was computing.
    repins: Vec<[f64; 2]>,
    /// The same of first looks at a surface, at patches that were changed, and of what had left the cache: more than one patch had to be mapped.
    first_looks: Vec<[f64; 2]>,
    unexpected: Vec<String>,
}

type Shared = Arc<Mutex<Tally>>;

fn note<T>(tally: &Shared, what: &'static str, result: Result<T, ClientError>) -> Option<T> {
    let mut tally = tally.lock().expect("no panic");
    *tally.operations.entry(what).or_default() += 1;
    let reason = match &result {
        Ok(_) => "OK".to_owned(),
        Err(error) => match (error.reason(), error.call().and_then(|call| call.metadata.get("field"))) {
            (Some("BAD_PARAMETER"), Some(field)) => format!("BAD_PARAMETER {field}"),
            (Some(reason), _) => reason.to_owned(),
            (None, _) => error.to_string(),
        },
    };
    if !EXPECTED.contains(&reason.as_str()) {
        tally.unexpected.push(format!("{what}: {reason}: {:?}", result.as_ref().err()));
    }
    *tally.ends.entry(reason).or_default() += 1;
    result.ok()
}

fn size(triangles: u64) -> Change {
    Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(triangles)) })
}

/// A tube as OFF text, different for each seed.
fn tube_file(random: &mut Random) -> Vec<u8> {
    let (around, along) = (12 + random.below(20) as usize, 10 + random.below(60) as usize);
    let wobble = random.below(1000) as f64 * 1e-5;
    let mut text = format!("OFF\n{} {} 0\n", around * (along + 1), 2 * around * along);
    for i in 0..=along {
        for j in 0..around {
            let angle = j as f64 / around as f64 * std::f64::consts::TAU;
            let radius = 5.0 + (i as f64 * 0.3).sin() + wobble;
            text += &format!("{} {} {}\n", radius * angle.cos(), radius * angle.sin(), i as f64 * 0.8);
        }
    }
    for i in 0..along {
        for j in 0..around {
            let (a, b) = (i * around + j, i * around + (j + 1) % around);
            text += &format!("3 {a} {b} {}\n3 {b} {} {}\n", a + around, b + around, a + around);
        }
    }
    text.into_bytes()
}

async fn connect(address: &str) -> Client {
    Client::connect(address).await.expect("connects").with_retry(RetryPolicy { tries: 3, ..RetryPolicy::default() })
}

/// One client: a session of its own and one that it shares with three others.
async fn play(number: u64, address: String, common: String, stop: Arc<AtomicBool>, tally: Shared) {
    let mut random = Random(number * 7919 + 1);
    let mut client = connect(&address).await;
    let mut own: Option<EditingSession> = None;
    while !stop.load(Ordering::Relaxed) {
        let session = match own.as_mut() {
            Some(session) => session,
            None => {
                let Some(mut made) = note(&tally, "create", EditingSession::create(&client, "soak").await) else {
                    tokio::time::sleep(Duration::from_millis(200)).await;
                    continue;
                };
                let imported = match client.upload(tube_file(&mut random).into(), |_| {}).await {
                    Ok(blob) => made.import(Source::Blob(blob), v1::ImportOptions::default()).await,
                    Err(error) => Err(error),
                };
                note(&tally, "upload and import", imported);
                note(&tally, "edit", made.apply(size(1000)).await);
                own.insert(made)
            }
        };
        let name = session.name().to_owned();
        match random.below(16) {
            0..=2 => drop(note(&tally, "edit", session.apply(size(500 + random.below(3000))).await)),
            3 | 4 => drop(note(&tally, "remesh", client.remesh(&name, &[], |_| {}).await)),
            5 => {
                // Dropped at a random moment.
                let wait = Duration::from_millis(random.below(300));
                let _ = tokio::time::timeout(wait, client.remesh(&name, &[], |_| {})).await;
                *tally.lock().expect("no panic").operations.entry("dropped remesh").or_default() += 1;
            }
            6 | 7 => {
                let edit = ChartEdit {
                    spec: v1::ChartSpec { method: v1::ChartMethod::LeastSquaresConformal.into(), ..Default::default() },
                    paths: vec!["method".into()],
                };
                let begin = Instant::now();
                let shown = note(&tally, "re-pin", client.preview_chart(&name, 0, edit).await);
                if let Some(shown) = shown {
                    let times = [begin.elapsed().as_secs_f64() * 1e3, shown.chart.run.milliseconds];
                    // A re-pin maps one patch, for which nothing else has to run.
                    let of_patch = ["system", "factor", "boundary", "solve", "chart"];
                    let other = |s: &v1::StageRecord| {
                        s.outcome() == v1::StageOutcome::Run && (!of_patch.contains(&s.stage.as_str()) || s.subject != "patch 0")
                    };
                    let mut tally = tally.lock().expect("no panic");
                    let is_first = shown.chart.run.stages.iter().any(other);
                    if is_first { tally.first_looks.push(times) } else { tally.repins.push(times) }
                }
            }
            8 => drop(note(&tally, "undo", session.undo().await)),
            9 => drop(note(&tally, "split", session.split_patch(0, None).await)),
            10 => {
                let work = v1::start_operation_request::Work::Remesh(v1::RemeshWork::default());
                if let Some(operation) = note(&tally, "start operation", client.start(&name, work).await) {
                    if random.below(2) == 0 {
                        tokio::time::sleep(Duration::from_millis(random.below(200))).await;
                        note(&tally, "cancel operation", client.cancel(&operation.name).await);
                    }
                    note(&tally, "wait for operation", client.wait(&operation.name).await);
                }
            }
            11 => {
                // Others edit this one at the same time.
                let seen = client.get_session(&common).await.map(|s| s.revision);
                if let Some(revision) = note(&tally, "read common", seen) {
                    note(&tally, "edit common", client.apply(&common, size(800 + random.below(800)), Some(revision)).await);
                    note(&tally, "remesh common", client.remesh(&common, &[], |_| {}).await);
                }
            }
            12 => drop(note(&tally, "plan", client.plan(&name).await)),
            13 => {
                let request = v1::ExportMeshRequest {
                    session: name,
                    source: v1::MeshSource::Result.into(),
                    format: v1::MeshFormat::Ply.into(),
                    ..Default::default()
                };
                note(&tally, "export", client.export(request, |_, _| {}).await);
            }
            14 => {
                // A connection that breaks in the middle of work, and a new one.
                let broken = connect(&address).await;
                let _ = tokio::time::timeout(Duration::from_millis(random.below(50)), broken.remesh(&name, &[], |_| {})).await;
                drop(broken);
                client = connect(&address).await;
                if let Some(opened) = note(&tally, "reconnect", EditingSession::open(&client, &name).await) {
                    own = Some(opened);
                }
            }
            _ => {
                if let Some(session) = own.take() {
                    note(&tally, "delete", session.delete().await);
                }
            }
        }
    }
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted.get(((sorted.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(f64::NAN)
}

async fn soak(minutes: f64) -> bool {
    let daemon = start();
    let (tally, stop) = (Shared::default(), Arc::new(AtomicBool::new(false)));
    let host = connect(&daemon.address).await;
    let mut common = Vec::new();
    for _ in 0..CLIENTS / 4 {
        let mut session = EditingSession::create(&host, "common").await.expect("session");
        let sample = v1::SampleSpec { kind: v1::SampleKind::Pelvis.into(), triangles: Some(3000), ..Default::default() };
        session.import(Source::Sample(sample), v1::ImportOptions::default()).await.expect("import");
        session.apply(size(1000)).await.expect("size");
        common.push(session.name().to_owned());
    }
    let players: Vec<_> = (0..CLIENTS)
        .map(|n| tokio::spawn(play(n, daemon.address.clone(), common[(n / 4) as usize].clone(), stop.clone(), tally.clone())))
        .collect();
    let end = Instant::now() + Duration::from_secs_f64(60.0 * minutes);
    while Instant::now() < end {
        tokio::time::sleep(Duration::from_secs(1)).await;
        let [now, _] = memory(&daemon);
        assert!(now <= CACHE_MB + WORKING_SET_MB, "{now} MB resident; {} are allowed", CACHE_MB + WORKING_SET_MB);
    }
    stop.store(true, Ordering::Relaxed);
    for player in players {
        player.await.expect("no panic");
    }
    let [last, peak] = memory(&daemon);
    let tally = tally.lock().expect("no panic");
    println!("{} operations in {minutes} minutes by {CLIENTS} clients: {:?}", tally.operations.values().sum::<u64>(), tally.operations);
    println!("ends: {:?}", tally.ends);
    println!("resident memory: peak {peak} MB, at the end {last} MB; allowed {} + {} MB", CACHE_MB, WORKING_SET_MB);
    for (what, times) in [("re-pin", &tally.repins), ("first look", &tally.first_looks)] {
        let sorted = |part: usize| {
            let mut times: Vec<f64> = times.iter().map(|t| t[part]).collect();
            times.sort_by(f64::total_cmp);
            format!("p50 {:.1} ms, p99 {:.1} ms, max {:.1} ms", quantile(&times, 0.5), quantile(&times, 0.99), quantile(&times, 1.0))
        };
        println!("{what} (preview of a chart, under this load): {}; inside the engine: {}; {} times", sorted(0), sorted(1), times.len());
    }
    tally.unexpected.iter().take(20).for_each(|what| println!("UNEXPECTED {what}"));
    tally.unexpected.is_empty()
}

fn main() {
    // `cargo test --benches` runs every bench for a moment.
    let minutes = std::env::var("REMESH_SOAK_MINUTES").ok().and_then(|v| v.parse().ok()).unwrap_or(0.1);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("threads");
    if !runtime.block_on(soak(minutes)) {
        std::process::exit(1);
    }
}
