//! Sessions out and in as files.

use crate::caller::Caller;
use crate::config::CHUNK_BYTES;
use crate::desk::{Desk, short_id};
use crate::dispatch::Call;
use crate::guarded::next_message;
use crate::keep::snapshot::{Picture, Restored, read};
use crate::state::Shared;
use crate::status::{Fault, status_of};
use crate::stream::Watch;
use bytes::{Buf, Bytes};
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::session::Session;
use remesh_engine::work::CancelToken;
use remesh_proto::v1;
use std::io::Read;
use std::sync::Arc;
use tokio::sync::mpsc;
use tonic::{Status, Streaming};

/// Pieces between the transport and the thread that reads or writes.
const QUEUE: usize = 4;

/// A session as a file, written as the client takes it.
pub(crate) fn snapshot(shared: &Shared, session: &str, caller: &Caller) -> Result<Watch<v1::SnapshotSessionResponse>, Fault> {
    let (session, desk) = shared.session(session, "session", caller)?;
    let (sender, receiver) = mpsc::channel::<Result<v1::SnapshotSessionResponse, Status>>(QUEUE);
    tracing::info!(target: "audit", action = "snapshot", session = short_id(&session), author = caller.name());
    tokio::task::spawn_blocking(move || {
        let write = || -> EngineResult<()> {
            let picture = Picture::of(&session, &desk)?;
            let revision = picture.revision();
            picture.write(CHUNK_BYTES, |data| {
                let sent = sender.blocking_send(Ok(v1::SnapshotSessionResponse { revision, data }));
                sent.map_err(|_| EngineError::new(Reason::Cancelled, "the client went away"))
            })
        };
        if let Err(error) = write() {
            tracing::warn!(%error, "a snapshot ended early");
            // A client that went away hears nothing.
            let _ = sender.blocking_send(Err(status_of(&error.into())));
        }
    });
    Ok(Watch::of_progress(receiver, CancelToken::new()))
}

/// Pieces of a file as they come, for a thread that reads them.
struct Pieces {
    receiver: mpsc::Receiver<Bytes>,
    current: Bytes,
}

impl Read for Pieces {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        while self.current.is_empty() {
            match self.receiver.blocking_recv() {
                Some(next) => self.current = next,
                None => return Ok(0),
            }
        }
        let count = into.len().min(self.current.len());
        self.current.copy_to_slice(&mut into[..count]);
        Ok(count)
    }
}

/// Makes a session of a file.
pub(crate) async fn restore(
    call: Call,
    shared: &Arc<Shared>,
    stream: Streaming<v1::RestoreSessionRequest>,
) -> (Call, Result<(Arc<Session>, Arc<Desk>), Fault>) {
    let outcome = receive(shared, call.caller(), call.client(), stream).await;
    (call, outcome)
}

async fn receive(
    shared: &Arc<Shared>,
    caller: &Caller,
    client: &Arc<str>,
    mut stream: Streaming<v1::RestoreSessionRequest>,
) -> Result<(Arc<Session>, Arc<Desk>), Fault> {
    let idle = shared.config.upload_idle;
    let first = next_message(&mut stream, idle).await?.unwrap_or_default();
    let display_name = first.display_name.clone();
    super::session::check_display_name(&display_name)?;
    let (sender, receiver) = mpsc::channel(QUEUE);
    let (reader_shared, reader_caller, reader_client) = (shared.clone(), caller.clone(), client.clone());
    let reader = tokio::task::spawn_blocking(move || {
        let restored = read(&reader_shared, Pieces { receiver, current: Bytes::new() })?;
        open(&reader_shared, restored, display_name, &reader_caller, &reader_client)
    });
    let mut next = Some(first);
    while let Some(v1::RestoreSessionRequest { data, .. }) = next {
        if data.len() > CHUNK_BYTES {
            let message = format!("a chunk has {} bytes, the limit is {CHUNK_BYTES}", data.len());
            return Err(EngineError::bad_parameter("data", message).into());
        }
        shared.metrics.uploaded(data.len());
        // The reader ends early only to say what is wrong.
        if sender.send(data).await.is_err() {
            break;
        }
        next = next_message(&mut stream, idle).await?;
    }
    drop(sender);
    reader.await.map_err(|_| EngineError::invariant("the thread that reads a snapshot ended"))?
}

fn open(
    shared: &Shared,
    restored: Restored,
    display_name: String,
    caller: &Caller,
    client: &Arc<str>,
) -> Result<(Arc<Session>, Arc<Desk>), Fault> {
    let ttl = restored.session.ttl.and_then(|ttl| std::time::Duration::try_from(ttl).ok()).filter(|ttl| !ttl.is_zero());
    let name = if display_name.is_empty() { restored.session.display_name.clone() } else { display_name };
    super::session::check_display_name(&name)?;
    // Expired sessions must not keep new ones out.
    shared.expire();
    shared.restore_session(ttl, name, &restored, caller, client)
}
