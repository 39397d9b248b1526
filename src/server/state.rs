//! What all calls share: the engine, the compute pool, and the desks that hold what belongs to sessions beside their inputs.

use crate::caller::Caller;
use crate::config::ServerConfig;
pub(crate) use crate::desk::Target;
use crate::desk::{Desk, short_id};
use crate::dispatch::Pool;
use crate::jobs::Clients;
use crate::keep::snapshot::Restored;
use crate::keep::{Keeper, Opened};
use crate::metrics::Metrics;
use crate::service::upload::Uploads;
use crate::status::Fault;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::session::{Revision, Session};
use remesh_engine::work::Gate;
use remesh_proto::v1;
use remesh_store::StoreError;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The state behind all services.
#[derive(Debug)]
pub(crate) struct Shared {
    /// Settings.
    pub(crate) config: ServerConfig,
    /// The engine.
    pub(crate) engine: Arc<Engine>,
    /// Permits to compute, and the calls that are on.
    pub(crate) pool: Pool,
    /// Uploads under way, and those that broke.
    pub(crate) uploads: Uploads,
    /// What has happened.
    pub(crate) metrics: Metrics,
    /// Jobs of each client.
    pub(crate) clients: Clients,
    /// Where batch work lets interactive work pass.
    pub(crate) gate: Gate,
    /// What outlives the server.
    pub(crate) keeper: Keeper,
    /// Readers of events.
    pub(crate) watchers: Arc<AtomicUsize>,
    desks: Mutex<HashMap<String, Arc<Desk>>>,
}

const SESSION_PREFIX: &str = "sessions/";
const BLOB_PREFIX: &str = "blobs/";

/// The name of a session.
pub(crate) fn session_name(session: &Session) -> String {
    format!("{SESSION_PREFIX}{}", session.id)
}

/// The name of an uploaded file.
pub(crate) fn blob_name(digest: &str) -> String {
    format!("{BLOB_PREFIX}{digest}")
}

/// The digest in the name of an uploaded file.
pub(crate) fn blob_digest<'a>(name: &'a str, field: &str) -> EngineResult<&'a str> {
    name.strip_prefix(BLOB_PREFIX).ok_or_else(|| EngineError::bad_parameter(field, "a blob is named `blobs/{digest}`"))
}

impl Shared {
    /// The state of a new server; with a data folder, the sessions that are in it.
    ///
    /// # Errors
    /// Those of the data folder.
    pub(crate) fn new(config: ServerConfig) -> Result<Arc<Shared>, StoreError> {
        let engine = Engine::new(config.engine.clone());
        let opened = config.keeping.as_ref().map(|keeping| Opened::folder(keeping, &engine, &config.clock)).transpose()?;
        let Opened { keeper, desks, leftovers } = opened.unwrap_or_default();
        let pool = Pool::new(config.max_running, config.max_running_short, config.max_queued);
        Ok(Arc::new(Shared {
            uploads: Uploads::of(leftovers, config.clock.now()),
            config,
            engine,
            pool,
            metrics: Metrics::default(),
            clients: Clients::default(),
            gate: Gate::default(),
            keeper,
            watchers: Arc::default(),
            desks: Mutex::new(desks),
        }))
    }

    fn desks(&self) -> MutexGuard<'_, HashMap<String, Arc<Desk>>> {
        self.desks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What belongs to a session, if the caller may see it.
    pub(crate) fn desk(&self, session: &Session, caller: &Caller) -> Option<Arc<Desk>> {
        self.desks().get(&session.id).filter(|desk| desk.owner == *caller).cloned()
    }

    /// A session of the caller by its name in field `field`, and what belongs to it; marks it as used.
    pub(crate) fn session(&self, name: &str, field: &str, caller: &Caller) -> EngineResult<(Arc<Session>, Arc<Desk>)> {
        if name.is_empty() {
            return Err(EngineError::bad_parameter(field, "is required"));
        }
        let id = name.strip_prefix(SESSION_PREFIX);
        let id = id.ok_or_else(|| EngineError::bad_parameter(field, "a session is named `sessions/{id}`"))?;
        // Looked up before the session is touched: a session of somebody else is answered as one that never was.
        let desk = self.desks().get(id).filter(|desk| desk.owner == *caller).cloned();
        let desk = desk.ok_or_else(|| {
            self.keeper.unreadable(id, caller.key()).unwrap_or_else(|| {
                EngineError::new(Reason::SessionNotFound, "no such session").with_hint("it was never made, was deleted, or has expired")
            })
        })?;
        Ok((self.engine.session(id, self.config.clock.now())?, desk))
    }

    /// The session and its inputs, if it is at the expected revision.
    pub(crate) fn target(
        self: &Arc<Self>,
        name: &str,
        expected_revision: Option<u64>,
        caller: &Caller,
        request_id: &str,
    ) -> EngineResult<Target> {
        let (session, desk) = self.session(name, "session", caller)?;
        let snapshot = session.snapshot();
        match expected_revision.map(Revision) {
            Some(expected) if expected != snapshot.revision => {
                let message = format!("the call is for revision {}, the session is at {}", expected.0, snapshot.revision.0);
                Err(EngineError::new(Reason::StaleRevision, message)
                    .with_hint("read the session again and repeat the call for its current revision")
                    .with_metadata("expected_revision", expected.0)
                    .with_metadata("current_revision", snapshot.revision.0))
            }
            _ => Ok(Target { session, snapshot, desk, caller: caller.clone(), request_id: request_id.to_owned(), shared: self.clone() }),
        }
    }

    /// Opens a session for a caller.
    ///
    /// # Errors
    /// [`Reason::LimitReached`] if it has as many as one client may have, or the daemon as many as it may; those of the data folder.
    pub(crate) fn create_session(
        &self,
        ttl: Option<Duration>,
        display_name: String,
        caller: &Caller,
        client: &Arc<str>,
    ) -> Result<(Arc<Session>, Arc<Desk>), Fault> {
        let desk = Desk::new(display_name, caller.clone(), client.clone(), self.config.clock.clone());
        let (session, desk) = self.admit(desk, || self.engine.create_session(ttl, self.config.clock.now()))?;
        if let Err(error) = self.keeper.put_session(&session, &desk) {
            self.forget(&session)?;
            return Err(error.into());
        }
        tracing::info!(target: "audit", action = "create", session = short_id(&session), author = caller.name());
        Ok((session, desk))
    }

    /// Gives a new session its place among those of its client.
    fn admit(&self, desk: Desk, open: impl FnOnce() -> EngineResult<Arc<Session>>) -> Result<(Arc<Session>, Arc<Desk>), Fault> {
        let mut desks = self.desks();
        let most = self.config.max_sessions_per_client;
        if desks.values().filter(|other| other.client == desk.client).count() >= most {
            return Err(Fault::ClientLimit { limit: "max_sessions_per_client", most: most as u64 });
        }
        let (session, desk) = (open()?, Arc::new(desk));
        desks.insert(session.id.clone(), desk.clone());
        Ok((session, desk))
    }

    /// Takes back a session that could not be kept.
    fn forget(&self, session: &Session) -> EngineResult<()> {
        self.desks().remove(&session.id);
        self.engine.delete_session(&session.id)
    }

    /// Whether a session may get a surface of so many faces, beside those of all others and those of the same client.
    pub(crate) fn check_faces(&self, of: &Arc<Desk>, faces: u64) -> EngineResult<()> {
        let desks = self.desks();
        let others = || desks.values().filter(|desk| !Arc::ptr_eq(desk, of));
        let sum = |own: bool| others().filter(|d| !own || d.client == of.client).map(|d| d.faces.load(Ordering::Relaxed)).sum::<u64>();
        let limits = [
            ("max_open_faces", self.config.max_open_faces, sum(false)),
            ("max_open_faces_per_client", self.config.max_open_faces_per_client, sum(true)),
        ];
        match limits.into_iter().find(|(_, most, others)| others.saturating_add(faces) > *most) {
            None => Ok(()),
            Some((limit, most, others)) => {
                let message = format!("open sessions have {others} faces, {faces} more would exceed the limit of {most}");
                Err(EngineError::new(Reason::LimitReached, message)
                    .with_hint("delete a session that is no longer needed")
                    .with_metadata("limit", limit)
                    .with_metadata("retry", "when sessions have ended"))
            }
        }
    }

    /// Opens a session for a caller with the past of a snapshot.
    ///
    /// # Errors
    /// As [`Shared::create_session`].
    pub(crate) fn restore_session(
        &self,
        ttl: Option<Duration>,
        display_name: String,
        restored: &Restored,
        caller: &Caller,
        client: &Arc<str>,
    ) -> Result<(Arc<Session>, Arc<Desk>), Fault> {
        let desk = Desk::new(display_name, caller.clone(), client.clone(), self.config.clock.clone());
        let past = restored.past.clone();
        let (session, desk) = self.admit(desk, || self.engine.restore_session(ttl, self.config.clock.now(), past))?;
        restored.meshes.iter().for_each(|(snapshot, summary)| desk.note_mesh(snapshot, summary.clone()));
        desk.count_faces(&session.snapshot());
        let kept = {
            let mut ledger = desk.ledger.lock().unwrap_or_else(PoisonError::into_inner);
            ledger.record_all(&self.keeper, &session, &desk, &restored.whole)
        };
        if let Err(error) = kept {
            self.forget(&session)?;
            return Err(error.into());
        }
        tracing::info!(target: "audit", action = "restore", session = short_id(&session), author = caller.name());
        Ok((session, desk))
    }

    /// Closes a session and tells those who watch it.
    pub(crate) fn delete_session(&self, session: &Session, caller: &Caller) -> EngineResult<()> {
        self.keeper.delete_session(&session.id)?;
        self.engine.delete_session(&session.id)?;
        if let Some(desk) = self.desks().remove(&session.id) {
            desk.close(session.revision().0, v1::SessionEnd::Deleted);
        }
        tracing::info!(target: "audit", action = "delete", session = short_id(session), author = caller.name());
        Ok(())
    }

    /// Deletes a session that could not be opened, if the caller has one of this name; gives whether.
    pub(crate) fn delete_unreadable(&self, name: &str, caller: &Caller) -> EngineResult<bool> {
        let Some(id) = name.strip_prefix(SESSION_PREFIX) else { return Ok(false) };
        let deleted = self.keeper.delete_unreadable(id, caller.key())?;
        if deleted {
            tracing::info!(target: "audit", action = "delete", session = id.get(..8), author = caller.name());
        }
        Ok(deleted)
    }

    /// What is done from time to time: expired sessions go, uses are noted, and what nobody uses is cleaned up.
    pub(crate) fn sweep(&self) {
        self.expire();
        self.note_uses();
        let now = self.config.clock.now();
        self.uploads.expire(self, now, self.config.upload_patience);
        if let Some(keeping) = &self.config.keeping {
            let files = self.keeper.clean_up(&self.engine, now, keeping.blob_grace);
            if files > 0 {
                tracing::info!(files, "unused uploaded files deleted");
            }
        }
    }

    /// Removes expired sessions and what belongs to them.
    pub(crate) fn expire(&self) {
        let now = self.config.clock.now();
        let removed = self.engine.sweep(now);
        if removed > 0 {
            // Held while the sessions are listed, so that one that is just being made keeps its desk.
            let mut desks = self.desks();
            let open: HashSet<String> = self.engine.sessions(now).iter().map(|s| s.id.clone()).collect();
            let (kept, expired): (HashMap<_, _>, HashMap<_, _>) = desks.drain().partition(|(id, _)| open.contains(id));
            *desks = kept;
            drop(desks);
            for (id, desk) in expired {
                tracing::info!(target: "audit", action = "expire", session = id.get(..8), author = "");
                desk.close(0, v1::SessionEnd::Expired);
                if let Err(error) = self.keeper.delete_session(&id) {
                    tracing::error!(%error, session = id.get(..8), "an expired session is still in the data folder; it goes after the next start");
                }
            }
            tracing::info!(removed, "expired sessions removed");
        }
    }

    /// Notes on the disk when sessions were used.
    pub(crate) fn note_uses(&self) {
        let now = self.config.clock.now();
        let sessions = self.engine.sessions(now);
        let desks: Vec<_> = {
            let desks = self.desks();
            sessions.iter().filter_map(|session| Some((session.clone(), desks.get(&session.id)?.clone()))).collect()
        };
        self.keeper.note_uses(desks.iter().map(|(session, desk)| (&**session, &**desk)), now);
    }

    /// Tells all who watch that the server shuts down.
    pub(crate) fn close_feeds(&self) {
        self.desks().values().for_each(|desk| desk.feed.close(0, v1::SessionEnd::Shutdown));
    }
}
