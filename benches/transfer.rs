//! Throughput of a real daemon over loopback: a surface of 1.5 million triangles in and out, and its memory meanwhile.
//! `cargo bench --bench transfer` (with `-- FOLDER` for a data folder there; without, one run in memory and one in a temporary folder).

#[path = "../tests/common/daemon.rs"]
mod daemon;

use bytes::Bytes;
use daemon::Daemon;
use remesh_client::{Client, Source, v1};
use std::path::Path;
use std::time::Instant;

/// Squares along each side: two triangles each.
const SIDE: usize = 866;
const RUNS: usize = 5;
const EDITS: u64 = 500;

/// A wavy sheet as binary STL.
fn sheet() -> Bytes {
    let height = |x: usize, y: usize| 20.0 * ((x as f32) * 0.05).sin() * ((y as f32) * 0.04).cos();
    let point = |x: usize, y: usize| [x as f32, y as f32, height(x, y)];
    let mut file = vec![0; 80];
    file.extend_from_slice(&(2 * (SIDE * SIDE) as u32).to_le_bytes());
    for (x, y) in (0..SIDE).flat_map(|x| (0..SIDE).map(move |y| (x, y))) {
        let corners = [point(x, y), point(x + 1, y), point(x + 1, y + 1), point(x, y + 1)];
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            file.extend_from_slice(&[0; 12]);
            triangle.iter().flat_map(|&corner| corners[corner]).for_each(|number: f32| file.extend_from_slice(&number.to_le_bytes()));
            file.extend_from_slice(&[0; 2]);
        }
    }
    file.into()
}

/// User and system CPU seconds, and the peak of the resident memory in MB, of a process.
fn used(pid: u32) -> (f64, f64) {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let ticks: f64 =
        stat.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<f64>().ok()).sum();
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<f64>().ok());
    (ticks / 100.0, peak.unwrap_or(0.0) / 1024.0)
}

fn tell(what: &str, bytes: usize, begin: Instant, pid: u32, before: f64) {
    let seconds = begin.elapsed().as_secs_f64();
    let (cpu, peak) = used(pid);
    let megabytes = bytes as f64 / 1e6;
    println!("{what:<34} {megabytes:7.1} MB {:7.0} MB/s   daemon {:5.2} s CPU, peak {peak:5.0} MB", megabytes / seconds, cpu - before);
}

async fn measure(settings: &[&str]) {
    let daemon = Daemon::start(settings);
    let pid = daemon.child.id();
    let client = Client::connect(&daemon.address).await.expect("connects");
    let file = sheet();
    for run in 0..RUNS {
        // Another file each time, or nothing would be sent.
        let mut other = file.to_vec();
        other[run] = 1;
        let (other, begin, before) = (Bytes::from(other), Instant::now(), used(pid).0);
        client.upload(other, |_| {}).await.expect("upload");
        tell("upload, digest and fsync included", file.len(), begin, pid, before);
    }
    let blob = client.upload(file.clone(), |_| {}).await.expect("upload");
    let begin = Instant::now();
    client.upload(file.clone(), |_| {}).await.expect("upload");
    println!("{:<34} {:7.1} ms", "upload of what is there", begin.elapsed().as_secs_f64() * 1e3);
    let session = client.create_session("", None).await.expect("session").name;
    let begin = Instant::now();
    client.import(&session, Source::Blob(blob), v1::ImportOptions::default()).await.expect("import");
    println!("{:<34} {:7.1} s", "import (not of this measurement)", begin.elapsed().as_secs_f64());
    for format in [v1::MeshFormat::Stl, v1::MeshFormat::Ply] {
        for _ in 0..2 {
            let request = v1::ExportMeshRequest {
                session: session.clone(),
                source: v1::MeshSource::Input.into(),
                format: format.into(),
                encoding: v1::MeshEncoding::Binary.into(),
                ..Default::default()
            };
            let (begin, before) = (Instant::now(), used(pid).0);
            let bytes = client.export(request, |_, _| {}).await.expect("export").bytes.len();
            tell(&format!("export as {}", format.as_str_name()), bytes, begin, pid, before);
        }
    }
    for _ in 0..2 {
        let request = v1::ReadMeshDataRequest { session: session.clone(), source: v1::MeshSource::Input.into(), ..Default::default() };
        let (begin, before) = (Instant::now(), used(pid).0);
        let mut stream = client.meshes().read_mesh_data(request).await.expect("data").into_inner();
        let mut bytes = 0;
        while let Some(message) = stream.message().await.expect("message") {
            if let Some(v1::read_mesh_data_response::Part::Chunk(chunk)) = message.part {
                bytes += chunk.data.len();
            }
        }
        tell("read as arrays", bytes, begin, pid, before);
    }
    let (begin, before) = (Instant::now(), used(pid).0);
    let mut stream = client.snapshot_session(&session).await.expect("snapshot");
    let mut bytes = 0;
    while let Some(piece) = stream.next().await.expect("piece") {
        bytes += piece.len();
    }
    tell("snapshot", bytes, begin, pid, before);
    edits(&client).await;
}

/// Latency of small edits, one after the other and of several sessions at once.
async fn edits(client: &Client) {
    for sessions in [1, 8] {
        let begin = Instant::now();
        let tasks: Vec<_> = (0..sessions).map(|_| tokio::spawn(edit_one(client.clone()))).collect();
        let mut times = Vec::new();
        for task in tasks {
            times.extend(task.await.expect("edits"));
        }
        let rate = times.len() as f64 / begin.elapsed().as_secs_f64();
        times.sort_by(f64::total_cmp);
        let (median, late) = (times[times.len() / 2], times[times.len() * 99 / 100]);
        println!("{:<34} {rate:7.0} /s   median {median:.2} ms, 99 % {late:.2} ms", format!("edits of {sessions} sessions"));
    }
}

async fn edit_one(client: Client) -> Vec<f64> {
    let session = client.create_session("", None).await.expect("session").name;
    let mut times = Vec::new();
    for n in 1..=EDITS {
        let size = v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(n)) };
        let begin = Instant::now();
        client.apply(&session, v1::change::Change::Size(size), None).await.expect("edit");
        times.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    times
}

#[tokio::main]
async fn main() {
    let named = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    let temporary = tempfile::tempdir().expect("folder");
    let folder = named.as_deref().map_or(temporary.path(), Path::new).join("transfer-data");
    println!("in memory");
    measure(&[]).await;
    println!("in {}", folder.display());
    measure(&["--data-dir", folder.to_str().expect("UTF-8")]).await;
    let _ = std::fs::remove_dir_all(&folder);
}
