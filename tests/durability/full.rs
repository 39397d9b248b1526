//! A daemon without room: what it cannot keep it refuses, what it has acknowledged it keeps, and it goes on.

use crate::daemon::{Daemon, Dice};
use bytes::Bytes;
use remesh_client::{Client, pack_f64, v1};
use std::path::Path;
use v1::change::Change;

fn size(triangles: u64) -> Change {
    Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(triangles)) })
}

/// A change that takes so many bytes.
fn large(bytes: usize, value: f64) -> Change {
    let sizes: Vec<f64> = (0..bytes / 8).map(|i| value + i as f64).collect();
    let sizes = Some(v1::PackedArray { data: Some(v1::packed_array::Data::Inline(pack_f64(&sizes))) });
    Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::PerVertex(v1::PerVertexSize { sizes, ..Default::default() })) })
}

fn file(bytes: u64, seed: u64) -> Bytes {
    let mut dice = Dice(seed);
    (0..bytes).map(|_| dice.below(256) as u8).collect::<Vec<u8>>().into()
}

/// Fills the folder through edits and uploads; what was acknowledged is there after a restart with room.
async fn fill(mut daemon: Daemon, folder: &Path) {
    let client = daemon.connect().await;
    let session = client.create_session("", None).await.expect("session").name;
    let other = client.create_session("", None).await.expect("session").name;
    let refused = |error: &remesh_client::ClientError| {
        let call = error.call().unwrap_or_else(|| panic!("{error}"));
        assert_eq!((call.code, call.reason.as_deref()), (tonic::Code::ResourceExhausted, Some("STORE_FULL")), "{error}");
    };
    let mut acknowledged = 0;
    let mut refusals = 0;
    for n in 1..60 {
        match client.apply(&session, large(2 << 20, f64::from(n)), None).await {
            Ok(revision) => {
                assert_eq!(revision, acknowledged + 1, "a refused change makes no revision");
                acknowledged = revision;
            }
            Err(error) => {
                refused(&error);
                refusals += 1;
                if refusals == 3 {
                    break;
                }
            }
        }
    }
    assert!(acknowledged > 0 && refusals == 3, "{acknowledged} acknowledged, {refusals} refused");
    let error = client.upload(file(40 << 20, 7), |_| {}).await.expect_err("no room");
    refused(&error);
    assert!(daemon.is_alive());
    // What is open goes on being read, and small edits are either kept or refused.
    let mut small = client.get_session(&other).await.expect("session").revision;
    for n in 1..20 {
        match client.apply(&other, size(100 + n), None).await {
            Ok(revision) => small = revision,
            Err(error) => refused(&error),
        }
    }
    assert_eq!(client.get_session(&session).await.expect("session").revision, acknowledged);
    drop(daemon);
    let daemon = Daemon::on(folder, &[]);
    let client = daemon.connect().await;
    assert_eq!(client.get_session(&session).await.expect("session").revision, acknowledged);
    assert_eq!(client.get_session(&other).await.expect("session").revision, small);
    client.apply(&session, size(100), None).await.expect("there is room");
    client.upload(file(4 << 20, 8), |_| {}).await.expect("there is room");
    println!("{acknowledged} large changes and {small} small ones were kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bound_of_the_folder_is_kept() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::on(folder.path(), &["--max-store-mb", "24"]);
    fill(daemon, folder.path()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn writes_that_fail_are_refused_and_taken_back() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::with_small_files(folder.path(), 24 << 20);
    fill(daemon, folder.path()).await;
}

/// `REMESH_SMALL_DISK=/mnt/small` is a folder on a disk of some 30 MB, as `mount -t tmpfs -o size=30m none /mnt/small` makes; started again it gets
/// no more room, so only reading is asked of it.
#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_loses_nothing() {
    let Some(disk) = std::env::var_os("REMESH_SMALL_DISK") else {
        eprintln!("NOT RUN: REMESH_SMALL_DISK names no small disk");
        return;
    };
    let folder = Path::new(&disk).join("data");
    let mut daemon = Daemon::on(&folder, &[]);
    let client: Client = daemon.connect().await;
    let session = client.create_session("", None).await.expect("session").name;
    let mut acknowledged = 0;
    let mut refused = 0;
    for n in 1..60 {
        let (change, upload) = (large(1 << 20, f64::from(n)), file(1 << 20, n as u64));
        for outcome in [client.apply(&session, change, None).await.map(Some), client.upload(upload, |_| {}).await.map(|_| None)] {
            match outcome {
                Ok(revision) => acknowledged = revision.unwrap_or(acknowledged),
                Err(error) => {
                    assert_eq!(error.reason(), Some("STORE_FULL"), "{error}");
                    refused += 1;
                }
            }
        }
    }
    assert!(daemon.is_alive() && acknowledged > 0 && refused > 0);
    daemon.kill();
    let daemon = Daemon::on(&folder, &[]);
    let client = daemon.connect().await;
    assert_eq!(client.get_session(&session).await.expect("session").revision, acknowledged);
    client.delete_session(&session).await.expect("deleting makes room");
    let next = client.create_session("", None).await.expect("session").name;
    client.apply(&next, large(1 << 20, 1.0), None).await.expect("there is room again");
    println!("{acknowledged} large changes were kept, {refused} refusals");
}
