//! A daemon that is stopped and started again: sessions, answers, uploads, snapshots, and how long it takes.

use crate::daemon::Daemon;
use bytes::Bytes;
use remesh_client::{Client, Source, v1};
use std::time::Instant;
use v1::change::Change;

fn size(triangles: u64) -> Change {
    Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(triangles)) })
}

async fn tube(client: &Client, name: &str) -> String {
    let session = client.create_session(name, None).await.expect("session").name;
    let sample = v1::SampleSpec { kind: v1::SampleKind::Tube.into(), triangles: Some(400), ..Default::default() };
    client.import(&session, Source::Sample(sample), v1::ImportOptions::default()).await.expect("import");
    client.apply(&session, size(300), None).await.expect("size");
    session
}

async fn result(client: &Client, session: &str) -> Vec<u8> {
    let request = v1::ExportMeshRequest { session: session.to_owned(), format: v1::MeshFormat::Off.into(), ..Default::default() };
    client.export(request, |_, _| {}).await.expect("export").bytes
}

async fn snapshot(client: &Client, session: &str) -> Bytes {
    let mut stream = client.snapshot_session(session).await.expect("snapshot");
    let mut file = Vec::new();
    while let Some(piece) = stream.next().await.expect("piece") {
        file.extend_from_slice(&piece);
    }
    file.into()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hundred_sessions_are_there_again() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::on(folder.path(), &[]);
    let client = daemon.connect().await;
    let mut names = Vec::new();
    for n in 0..100 {
        names.push(tube(&client, &format!("number {n}")).await);
    }
    for triangles in 100..110 {
        client.apply(&names[0], size(triangles), None).await.expect("size");
    }
    let (before, file) = (client.get_session(&names[0]).await.expect("session"), result(&client, &names[0]).await);
    daemon.stop();
    let begin = Instant::now();
    let daemon = Daemon::on(folder.path(), &[]);
    let client = daemon.connect().await;
    client.list_sessions().await.expect("list");
    println!("100 sessions: {:?} from the start of the process until it answers", begin.elapsed());
    let mut listed: Vec<String> = client.list_sessions().await.expect("list").into_iter().map(|s| s.name).collect();
    listed.sort();
    names.sort();
    assert_eq!(listed, names);
    let after = client.get_session(&before.name).await.expect("session");
    assert_eq!(v1::Session { expire_time: None, ..after }, v1::Session { expire_time: None, ..before.clone() });
    assert!(result(&client, &before.name).await == file, "bit for bit");
}

#[tokio::test(flavor = "multi_thread")]
async fn one_folder_has_one_daemon_and_its_settings_are_checked() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::on(folder.path(), &[]);
    let run = |arguments: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_remeshd")).args(arguments).output().expect("runs");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr))
    };
    let path = folder.path().to_str().expect("UTF-8");
    let (code, told) = run(&["--listen", "127.0.0.1:0", "--data-dir", path]);
    assert!(code == Some(1) && told.contains("in use by another process"), "{told}");
    let (code, told) = run(&["check-config", "--data-dir", path, "--max-store-mb", "100"]);
    assert!(code == Some(0) && told.contains("data_dir = ") && told.contains("max_store_mb = 100"), "{told}");
    let (code, told) = run(&["check-config", "--max-store-mb", "100"]);
    assert!(code == Some(2) && told.contains("--data-dir"), "{told}");
    drop(daemon);
    Daemon::on(folder.path(), &[]).stop();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_snapshot_is_restored_by_another_daemon() {
    let (one, two) = (tempfile::tempdir().expect("folder"), tempfile::tempdir().expect("folder"));
    let (first, second) = (Daemon::on(one.path(), &[]), Daemon::on(two.path(), &[]));
    let (from, to) = (first.connect().await, second.connect().await);
    let session = tube(&from, "mine").await;
    let obj = result(&from, &session).await;
    let blob = from.upload(obj.into(), |_| {}).await.expect("upload");
    from.import(&session, Source::Blob(blob), v1::ImportOptions::default()).await.expect("import");
    from.apply(&session, size(250), None).await.expect("size");
    let file = snapshot(&from, &session).await;
    let restored = to.restore_session(file.clone(), "").await.expect("restored");
    let original = from.get_session(&session).await.expect("session");
    let told = |s: &v1::Session| v1::Session { name: String::new(), create_time: None, expire_time: None, ..s.clone() };
    assert_eq!(told(&restored), told(&original));
    assert!(result(&to, &restored.name).await == result(&from, &session).await, "bit for bit");
    // Undo and rollback lead where they would have, also after a restart.
    drop(second);
    let second = Daemon::on(two.path(), &[]);
    let to = second.connect().await;
    for client_and_name in [(&from, &session), (&to, &restored.name)] {
        let (client, name) = client_and_name;
        client.sessions().undo_change(v1::UndoChangeRequest { session: name.clone(), ..Default::default() }).await.expect("undo");
        client.rollback(name, 2).await.expect("rollback");
    }
    assert!(result(&to, &restored.name).await == result(&from, &session).await, "bit for bit");
    assert_eq!(told(&to.get_session(&restored.name).await.expect("there")), told(&from.get_session(&session).await.expect("there")));
    // What is not as it was written is refused, and the daemon goes on.
    let mut bad: Vec<Vec<u8>> = (0..file.len()).step_by(file.len() / 40 + 1).map(|cut| file[..cut].to_vec()).collect();
    bad.extend((0..file.len()).step_by(file.len() / 60 + 1).map(|at| {
        let mut flipped = file.to_vec();
        flipped[at] ^= 1 << (at % 8);
        flipped
    }));
    bad.push([file.as_ref(), b"more"].concat());
    bad.push(b"remesh-session\n\xff\xff\xff\xff".to_vec());
    bad.push(vec![0; 100_000]);
    let count = to.list_sessions().await.expect("list").len();
    for bad in bad {
        let refused = to.restore_session(bad.into(), "").await.expect_err("refused");
        // A length that says too much may also be beyond a limit.
        assert!(matches!(refused.reason(), Some("SNAPSHOT_INVALID" | "LIMIT_REACHED")), "{refused}");
    }
    assert_eq!(to.list_sessions().await.expect("list").len(), count);
}
