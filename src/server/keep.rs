//! Sessions that outlive the daemon: what is written when, and how it is read again. Without a data folder all of this does nothing.
//!
//! Every session has a [`ledger::Ledger`] that writes its revisions inside the lock of the session, so in their order; a revision is on the disk
//! before anybody sees it. Results are not kept: they are recomputed, bit for bit, when somebody asks.

pub(crate) mod charges;
mod keys;
pub(crate) mod ledger;
mod open;
pub(crate) mod snapshot;

use crate::desk::Desk;
use charges::Charges;
use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::session::{Blob, ReadBlob, Session};
use remesh_proto::v1;
use remesh_store::{Batch, Incoming, Leftover, Store, StoreError, StoredBlob};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

pub(crate) use open::{Opened, rebuild};

/// A session that could not be opened: what is told of it until somebody deletes it.
#[derive(Debug, Clone)]
pub(crate) struct Unreadable {
    /// Whose it is.
    pub(crate) owner: Option<String>,
    /// Why.
    pub(crate) error: EngineError,
}

/// The data folder of a daemon, if it has one.
#[derive(Debug, Default)]
pub(crate) struct Keeper {
    store: Option<Arc<Store>>,
    /// Held while a file gets its name or loses it.
    names: Mutex<()>,
    unreadable: Mutex<HashMap<String, Unreadable>>,
    /// What each client has in it.
    pub(crate) charges: Charges,
}

/// What the engine and clients are told of an error of the store. Where it is on the disk is for the log only.
pub(crate) fn told(error: &StoreError) -> EngineError {
    match error {
        StoreError::Full { .. } => tracing::warn!(%error, "the data folder is full"),
        _ => tracing::error!(%error, "the data folder"),
    }
    match error {
        StoreError::Full { .. } => EngineError::new(Reason::StoreFull, "there is no room to keep this; nothing has changed")
            .with_hint("delete sessions that are no longer needed, or ask for more room")
            .with_metadata("retry", "when there is room"),
        _ => EngineError::new(Reason::StoreFailed, "this could not be kept; nothing has changed. The log of the daemon tells why"),
    }
}

fn guard<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Keeper {
    /// Whether there is a data folder.
    pub(crate) fn is_on(&self) -> bool {
        self.store.is_some()
    }

    /// Bytes of the data folder; 0 without one.
    pub(crate) fn used_bytes(&self) -> u64 {
        self.store.as_ref().map_or(0, |store| store.used_bytes())
    }

    fn commit(&self, batch: Batch) -> Result<()> {
        self.store.as_ref().map_or(Ok(()), |store| store.commit(batch)).map_err(|error| told(&error))
    }

    /// Reads a file whenever it is needed.
    fn reader(store: &Arc<Store>, digest: &str) -> ReadBlob {
        let (store, digest) = (store.clone(), digest.to_owned());
        Box::new(move || {
            store.read(&digest).map_err(|error| {
                tracing::error!(%error, "an uploaded file cannot be read");
                EngineError::new(Reason::StoreFailed, "the uploaded file cannot be read").with_hint("upload and import it again")
            })
        })
    }

    /// A file whose contents are in the data folder.
    fn blob_elsewhere(store: &Arc<Store>, blob: &StoredBlob) -> Blob {
        let len = usize::try_from(blob.bytes).unwrap_or(usize::MAX);
        Blob::elsewhere(blob.digest.clone(), len, Keeper::reader(store, &blob.digest))
    }

    /// Puts a file that is in memory into the data folder, so that it need not stay there.
    pub(crate) fn keep_blob(&self, blob: &Blob) -> Result<()> {
        let Some(store) = self.store.as_ref().filter(|_| blob.held_bytes() > 0) else { return Ok(()) };
        let keep = || -> std::result::Result<(), StoreError> {
            let bytes = blob.bytes().map_err(|error| StoreError::Corrupt { what: error.to_string() })?;
            let mut incoming = store.begin(None)?;
            incoming.write(&bytes)?;
            let _names = guard(&self.names);
            incoming.finish().map(drop)
        };
        keep().map_err(|error| told(&error))?;
        blob.move_elsewhere(Keeper::reader(store, &blob.digest));
        Ok(())
    }

    /// Begins a file, if there is a data folder to put it into.
    pub(crate) fn begin(&self, label: Option<&str>) -> Option<Result<Incoming>> {
        self.store.as_ref().map(|store| store.begin(label).map_err(|error| told(&error)))
    }

    /// Goes on with a file.
    pub(crate) fn resume(&self, leftover: &Leftover) -> Option<Result<Incoming>> {
        self.store.as_ref().map(|store| store.resume(leftover).map_err(|error| told(&error)))
    }

    /// Names a file that is complete, and makes it known to the engine.
    pub(crate) fn finish(&self, engine: &Engine, incoming: Incoming) -> Result<Arc<Blob>> {
        let Some(store) = &self.store else { return Err(EngineError::invariant("a file without a data folder")) };
        let _names = guard(&self.names);
        let blob = incoming.finish().map_err(|error| told(&error))?;
        store.touch(&blob.digest);
        engine.add_blob(Keeper::blob_elsewhere(store, &blob))
    }

    /// Marks a file as used.
    pub(crate) fn touch(&self, digest: &str) {
        if let Some(store) = &self.store {
            store.touch(digest);
        }
    }

    /// Deletes files that no session and no call uses and that nobody asked for during `grace`; gives how many. While there are sessions that could
    /// not be read nothing is deleted: they may use any file.
    pub(crate) fn clean_up(&self, engine: &Engine, now: SystemTime, grace: Duration) -> usize {
        let Some(store) = self.store.as_ref().filter(|_| guard(&self.unreadable).is_empty()) else { return 0 };
        let _names = guard(&self.names);
        let is_old = |blob: &Blob| {
            let used = store.used_at(&blob.digest);
            blob.held_bytes() == 0 && used.is_some_and(|used| now.duration_since(used).is_ok_and(|age| age > grace))
        };
        let dropped = engine.drop_unused_blobs(is_old);
        for digest in &dropped {
            if let Err(error) = store.remove(digest) {
                tracing::error!(%error, "an unused file cannot be deleted");
            }
        }
        self.charges.clean_up(&dropped, now, grace);
        dropped.len()
    }

    /// Writes what belongs to a session and is no input; it is on the disk when this returns.
    pub(crate) fn put_session(&self, session: &Session, desk: &Desk) -> Result<()> {
        if !self.is_on() {
            return Ok(());
        }
        let mut batch = Batch::default();
        batch.put(keys::session(&session.id), stored_session(session, desk).encode_to_vec());
        self.commit(batch)
    }

    /// Forgets a session; it is off the disk when this returns.
    pub(crate) fn delete_session(&self, id: &str) -> Result<()> {
        let mut batch = Batch::default();
        batch.delete_all(keys::all_of(id));
        self.commit(batch)?;
        self.charges.forget(id);
        Ok(())
    }

    /// Writes when sessions were last used, and that the daemon was alive now: the time that it is not does not count.
    pub(crate) fn note_uses<'a>(&self, sessions: impl Iterator<Item = (&'a Session, &'a Desk)>, now: SystemTime) {
        if !self.is_on() {
            return;
        }
        let mut batch = Batch::default();
        batch.put(keys::ALIVE.to_vec(), prost_types::Timestamp::from(now).encode_to_vec());
        for (session, desk) in sessions {
            let used = session.last_used();
            let mut noted = guard(&desk.noted_use);
            if *noted != Some(used) {
                batch.put(keys::session(&session.id), stored_session(session, desk).encode_to_vec());
                *noted = Some(used);
            }
        }
        if let Err(error) = self.commit(batch) {
            tracing::warn!(%error, "uses of sessions were not noted");
        }
    }

    /// The session that could not be opened, if the caller may see it.
    pub(crate) fn unreadable(&self, id: &str, caller: Option<&str>) -> Option<EngineError> {
        guard(&self.unreadable).get(id).filter(|it| it.owner.as_deref() == caller).map(|it| it.error.clone())
    }

    /// Deletes a session that could not be opened; gives whether there was one that the caller may see.
    pub(crate) fn delete_unreadable(&self, id: &str, caller: Option<&str>) -> Result<bool> {
        if self.unreadable(id, caller).is_none() {
            return Ok(false);
        }
        self.delete_session(id)?;
        guard(&self.unreadable).remove(id);
        Ok(true)
    }
}

/// What belongs to a session and is no input, as it is kept.
fn stored_session(session: &Session, desk: &Desk) -> v1::StoredSession {
    v1::StoredSession {
        display_name: desk.display_name.clone(),
        owner: desk.owner.key().map(str::to_owned),
        create_time: Some(session.created.into()),
        ttl: prost_types::Duration::try_from(session.ttl()).ok(),
        use_time: Some(session.last_used().into()),
        client: desk.client.to_string(),
    }
}
