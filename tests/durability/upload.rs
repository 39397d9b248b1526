//! Uploads over connections that break, and over the end of the daemon: what arrived is not sent again.

use crate::daemon::{Daemon, Dice};
use bytes::Bytes;
use remesh_client::Client;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

const FILE_BYTES: usize = 16 << 20;

fn file(seed: u64) -> Bytes {
    let mut dice = Dice(seed);
    (0..FILE_BYTES).map(|_| dice.below(256) as u8).collect::<Vec<u8>>().into()
}

/// Forwards connections, counts what the client sends, and cuts each of the first connections after so many bytes of it.
async fn proxy(listener: TcpListener, target: String, sent: Arc<AtomicU64>, mut cuts: Vec<u64>) {
    while let Ok((near, _)) = listener.accept().await {
        let far = TcpStream::connect(&target).await.expect("the daemon listens");
        let limit = cuts.pop().unwrap_or(u64::MAX);
        let sent = sent.clone();
        tokio::spawn(async move {
            let ((mut near_read, mut near_write), (mut far_read, mut far_write)) = (near.into_split(), far.into_split());
            let up = async {
                let mut buffer = vec![0; 64 << 10];
                let mut passed = 0;
                while let Ok(read @ 1..) = near_read.read(&mut buffer).await {
                    passed += read as u64;
                    sent.fetch_add(read as u64, Ordering::Relaxed);
                    if passed > limit || far_write.write_all(&buffer[..read]).await.is_err() {
                        break;
                    }
                }
            };
            // Both ways end together, as when a cable is pulled.
            tokio::select! {
                () = up => {}
                _ = tokio::io::copy(&mut far_read, &mut near_write) => {}
            }
        });
    }
}

async fn through_a_proxy(daemon: &Daemon, cuts: Vec<u64>) -> (Client, Arc<AtomicU64>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = listener.local_addr().expect("address").to_string();
    let sent = Arc::new(AtomicU64::new(0));
    tokio::spawn(proxy(listener, daemon.address.clone(), sent.clone(), cuts));
    (Client::connect(&address).await.expect("connects"), sent)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_goes_on_after_its_connection_broke() {
    for in_folder in [false, true] {
        let folder = tempfile::tempdir().expect("folder");
        let daemon = if in_folder { Daemon::on(folder.path(), &[]) } else { Daemon::start(&[]) };
        let (client, sent) = through_a_proxy(&daemon, vec![4 << 20, 6 << 20]).await;
        let file = file(3);
        let blob = client.upload(file.clone(), |_| {}).await.expect("upload");
        let first = sent.load(Ordering::Relaxed);
        assert!(first < FILE_BYTES as u64 + (8 << 20), "{first} bytes went for {FILE_BYTES}: what arrived was sent again");
        assert_eq!(client.upload(file, |_| {}).await.expect("upload"), blob);
        let again = sent.load(Ordering::Relaxed) - first;
        assert!(again < 10_000, "{again} bytes went for a file that the daemon has");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_goes_on_after_the_daemon_was_killed() {
    let folder = tempfile::tempdir().expect("folder");
    let daemon = Daemon::on(folder.path(), &[]);
    let (client, _) = through_a_proxy(&daemon, vec![6 << 20, 6 << 20, 6 << 20, 6 << 20, 6 << 20, 6 << 20, 6 << 20]).await;
    let file = file(4);
    let upload = tokio::spawn({
        let (client, file) = (client.clone(), file.clone());
        async move { client.upload(file, |_| {}).await }
    });
    tokio::time::sleep(std::time::Duration::from_millis(150)).await;
    daemon.kill();
    upload.abort();
    let daemon = Daemon::on(folder.path(), &[]);
    let (client, sent) = through_a_proxy(&daemon, Vec::new()).await;
    let incoming = std::fs::read_dir(folder.path().join("incoming")).expect("folder");
    let arrived: u64 = incoming.map(|entry| entry.expect("entry").metadata().expect("file").len()).sum();
    assert!(arrived > 1 << 20, "{arrived} bytes had arrived");
    let blob = client.upload(file, |_| {}).await.expect("upload");
    assert!(blob.starts_with("blobs/"));
    let sent = sent.load(Ordering::Relaxed);
    assert!(sent < FILE_BYTES as u64 - arrived + (1 << 20), "{sent} bytes went although {arrived} had arrived");
}
