//! `kill -9` at random moments while clients edit and upload: what was acknowledged is there, to the last bit, and nothing else is.

use crate::daemon::{Daemon, Dice};
use remesh_client::{Client, v1};
use remesh_server::{ServerConfig, in_process};
use std::collections::HashSet;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tonic::Status;
use v1::change::Change;

const SESSIONS: usize = 4;

/// An edit, as a client sends it.
#[derive(Debug, Clone)]
enum Edit {
    Apply(v1::ApplyChangeRequest),
    Import(v1::ImportMeshRequest),
    Undo(v1::UndoChangeRequest),
    Redo(v1::RedoChangeRequest),
}

/// What became of an edit: a revision, or why it was refused.
type Outcome = Result<u64, String>;

impl Edit {
    fn on(mut self, name: &str) -> Edit {
        match &mut self {
            Edit::Apply(r) => r.session = name.into(),
            Edit::Import(r) => r.session = name.into(),
            Edit::Undo(r) => r.session = name.into(),
            Edit::Redo(r) => r.session = name.into(),
        }
        self
    }

    /// Sends it; `None` if nobody knows what became of it.
    async fn send(self, client: &Client) -> Option<Outcome> {
        let answer = match self {
            Edit::Apply(r) => client.sessions().apply_change(r).await.map(|a| a.into_inner().revision),
            Edit::Import(r) => client.meshes().import_mesh(r).await.map(|a| a.into_inner().revision),
            Edit::Undo(r) => client.sessions().undo_change(r).await.map(|a| a.into_inner().revision),
            Edit::Redo(r) => client.sessions().redo_change(r).await.map(|a| a.into_inner().revision),
        };
        match answer {
            Ok(revision) => Some(Ok(revision)),
            Err(status) => reason(&status).map(Err),
        }
    }
}

/// The reason that the daemon gives; none if the connection broke.
fn reason(status: &Status) -> Option<String> {
    use tonic_types::StatusExt;
    status.get_details_error_info().map(|info| info.reason)
}

/// A random edit with a `request_id` of its own.
fn random_edit(dice: &mut Dice, blobs: &[String], number: u64) -> Edit {
    let request_id = format!("edit-{number}");
    let change = match dice.below(12) {
        0 => return Edit::Undo(v1::UndoChangeRequest { request_id, ..Default::default() }),
        1 => return Edit::Redo(v1::RedoChangeRequest { request_id, ..Default::default() }),
        2 => {
            use v1::import_mesh_request::Source;
            let sample =
                v1::SampleSpec { kind: v1::SampleKind::Tube.into(), triangles: Some(200 + 50 * dice.below(4)), ..Default::default() };
            let source = match blobs {
                [] => Source::Sample(sample),
                _ if dice.below(2) == 0 => Source::Sample(sample),
                blobs => Source::Blob(blobs[dice.below(blobs.len() as u64) as usize].clone()),
            };
            return Edit::Import(v1::ImportMeshRequest { request_id, source: Some(source), ..Default::default() });
        }
        3 => Change::Rollback(v1::Rollback { to_revision: number.saturating_sub(dice.below(6)) }),
        4 => {
            let sharp_edges = Some(v1::feature_spec::SharpEdges::FeatureAngle(20.0 + dice.below(5) as f64));
            Change::Features(v1::FeatureSpec { sharp_edges, ..Default::default() })
        }
        5 => Change::Partition(v1::PartitionSpec { patches: Some(2 + dice.below(3) as u32), ..Default::default() }),
        6 => {
            let kinds = [v1::MesherKind::Frontal, v1::MesherKind::Delaunay, v1::MesherKind::MeshAdapt];
            Change::Mesher(v1::MesherSpec { kind: kinds[dice.below(3) as usize].into(), ..Default::default() })
        }
        7 => Change::Optimize(v1::OptimizeSpec { rounds: Some(dice.below(4) as u32), ..Default::default() }),
        8 => Change::Lock(v1::LockSpec { lock: Some(v1::lock_spec::Lock::Boundary(v1::BoundaryLock {})), count: 0 }),
        _ => Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(150 + dice.below(200))) }),
    };
    Edit::Apply(v1::ApplyChangeRequest { request_id, change: Some(v1::Change { change: Some(change) }), ..Default::default() })
}

/// One session of the daemon and its twin, which nobody kills.
struct Pair {
    name: String,
    twin: String,
    dice: Dice,
    sent: u64,
    /// The edit that was under way when the daemon died.
    open: Option<Edit>,
}

impl Pair {
    /// Edits until the daemon is gone. Whatever is acknowledged is done to the twin as well, and must end the same there.
    async fn edit(&mut self, client: &Client, mirror: &Client, blobs: &[String]) {
        loop {
            let edit = self.open.take().unwrap_or_else(|| {
                self.sent += 1;
                random_edit(&mut self.dice, blobs, self.sent)
            });
            let Some(outcome) = edit.clone().on(&self.name).send(client).await else {
                self.open = Some(edit);
                return;
            };
            let expected = edit.clone().on(&self.twin).send(mirror).await.expect("the twin lives");
            assert_eq!(outcome, expected, "{edit:?}");
        }
    }

    /// Sends the edit that was under way again: it is carried out once, whether it was before or not.
    async fn settle(&mut self, client: &Client, mirror: &Client) {
        let Some(edit) = self.open.take() else { return };
        let outcome = edit.clone().on(&self.name).send(client).await.expect("the daemon lives");
        let expected = edit.clone().on(&self.twin).send(mirror).await.expect("the twin lives");
        assert_eq!(outcome, expected, "{edit:?} again");
    }

    /// The inputs, steps and mesh of both are the same.
    async fn compare(&self, client: &Client, mirror: &Client) {
        let told = |session: v1::Session| v1::Session { name: String::new(), create_time: None, expire_time: None, ..session };
        let ours = told(client.get_session(&self.name).await.expect("every session opens"));
        let theirs = told(mirror.get_session(&self.twin).await.expect("the twin lives"));
        assert_eq!(ours, theirs);
    }

    /// The result of the daemon is that of the twin, bit for bit, or both are refused alike.
    async fn compare_results(&self, client: &Client, mirror: &Client) -> bool {
        let export = |session: &str| v1::ExportMeshRequest {
            session: session.to_owned(),
            source: v1::MeshSource::Result.into(),
            format: v1::MeshFormat::Off.into(),
            ..Default::default()
        };
        let ours = client.export(export(&self.name), |_, _| {}).await.map(|e| e.bytes);
        let theirs = mirror.export(export(&self.twin), |_, _| {}).await.map(|e| e.bytes);
        match (ours, theirs) {
            (Ok(ours), Ok(theirs)) => {
                assert!(ours == theirs, "results differ");
                true
            }
            (ours, theirs) => {
                let reason = |result: &Result<Vec<u8>, remesh_client::ClientError>| {
                    result.as_ref().err().and_then(|e| e.reason().map(str::to_owned))
                };
                assert_eq!(reason(&ours), reason(&theirs));
                assert!(reason(&ours).is_some());
                false
            }
        }
    }
}

/// A file of a few hundred kilobytes that nobody has uploaded before; not a mesh.
fn random_file(dice: &mut Dice) -> bytes::Bytes {
    let length = 100_000 + dice.below(900_000);
    (0..length).map(|_| dice.below(256) as u8).collect::<Vec<u8>>().into()
}

/// Uploads until the daemon is gone; gives what was acknowledged.
async fn upload(client: &Client, dice: &mut Dice) -> Vec<String> {
    let mut acknowledged = Vec::new();
    loop {
        let file = random_file(dice);
        let pieces: Vec<v1::UploadMeshRequest> =
            file.chunks(64 << 10).map(|data| v1::UploadMeshRequest { data: data.to_vec().into(), ..Default::default() }).collect();
        match client.meshes().upload_mesh(tokio_stream::iter(pieces)).await {
            Ok(answer) => acknowledged.push(answer.into_inner().blob),
            Err(status) => {
                assert!(reason(&status).is_none(), "{status:?}");
                return acknowledged;
            }
        }
    }
}

fn digests(blobs: &HashSet<String>) -> Vec<String> {
    blobs.iter().filter_map(|blob| blob.strip_prefix("blobs/").map(str::to_owned)).collect()
}

fn number(variable: &str, usual: u64) -> u64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn nothing_that_was_acknowledged_is_lost() {
    let (kills, seed) = (number("REMESH_KILLS", 8), number("REMESH_SEED", 1));
    let folder = tempfile::tempdir().expect("folder");
    let mirror = Client::from_channel(in_process(ServerConfig::default()).await.expect("a server"));
    let mut dice = Dice(seed);
    let daemon = Daemon::on(folder.path(), &[]);
    let client = daemon.connect().await;
    // A file that sessions import, known to both.
    let file: bytes::Bytes = b"OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n".to_vec().into();
    let blob = client.upload(file.clone(), |_| {}).await.expect("upload");
    assert_eq!(mirror.upload(file, |_| {}).await.expect("upload"), blob);
    let mut pairs = Vec::new();
    for n in 0..SESSIONS {
        let name = client.create_session("twin", None).await.expect("session").name;
        let twin = mirror.create_session("twin", None).await.expect("session").name;
        pairs.push(Pair { name, twin, dice: Dice(seed + 1000 + n as u64), sent: 0, open: None });
    }
    let blobs = vec![blob.clone()];
    let uploaded = Arc::new(Mutex::new(HashSet::from([blob])));
    let (mut daemon, mut client) = (daemon, client);
    let (mut compared, mut open) = (0, 0);
    let mut slowest = Duration::ZERO;
    for round in 0..kills {
        let life = Duration::from_millis(5 + dice.below(400));
        let mut upload_dice = Dice(seed + 5000 + round);
        let upload_client = client.clone();
        let uploads = tokio::spawn(async move { upload(&upload_client, &mut upload_dice).await });
        let edits = pairs.iter_mut().map(|pair| pair.edit(&client, &mirror, &blobs));
        let killer = async {
            tokio::time::sleep(life).await;
            daemon.kill();
        };
        tokio::join!(futures_join(edits), killer);
        let came = uploads.await.expect("uploads");
        uploaded.lock().expect("not poisoned").extend(came);
        let begin = Instant::now();
        daemon = Daemon::on(folder.path(), &[]);
        client = daemon.connect().await;
        assert_eq!(client.list_sessions().await.expect("list").len(), SESSIONS);
        slowest = slowest.max(begin.elapsed());
        let asked = digests(&uploaded.lock().expect("not poisoned"));
        for asked in asked.chunks(1000) {
            assert_eq!(client.missing_blobs(asked).await.expect("asked"), [], "uploads are there");
        }
        for pair in &mut pairs {
            open += u32::from(pair.open.is_some());
            pair.settle(&client, &mirror).await;
            pair.compare(&client, &mirror).await;
        }
        let chosen = &pairs[dice.below(SESSIONS as u64) as usize];
        compared += u32::from(chosen.compare_results(&client, &mirror).await);
    }
    for pair in &pairs {
        compared += u32::from(pair.compare_results(&client, &mirror).await);
    }
    let edits: u64 = pairs.iter().map(|pair| pair.sent).sum();
    let files = uploaded.lock().expect("not poisoned").len();
    println!(
        "{kills} kills, {edits} edits ({open} under way at a kill), {files} files, {compared} results compared, slowest start {slowest:?}"
    );
    assert!(edits > kills, "there was something to lose");
}

#[tokio::test]
async fn a_daemon_that_is_killed_while_it_starts_can_be_started() {
    for microseconds in (0..24).map(|n| n * 1000) {
        let folder = tempfile::tempdir().expect("folder");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_remeshd"));
        command.args(["--listen", "127.0.0.1:0", "--log", "error", "--data-dir"]).arg(folder.path());
        let mut child = command.spawn().expect("starts");
        std::thread::sleep(Duration::from_micros(microseconds));
        child.kill().expect("killed");
        child.wait().expect("ended");
        let daemon = Daemon::on(folder.path(), &[]);
        daemon.connect().await.create_session("", None).await.expect("it works");
    }
}

/// Waits for all.
async fn futures_join(futures: impl Iterator<Item = impl Future<Output = ()>>) {
    let mut all: Vec<_> = futures.map(Box::pin).collect();
    std::future::poll_fn(|context| {
        all.retain_mut(|one| one.as_mut().poll(context).is_pending());
        if all.is_empty() { std::task::Poll::Ready(()) } else { std::task::Poll::Pending }
    })
    .await;
}
