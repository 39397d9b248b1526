//! What all calls share: the engine, the compute pool, and the desks that hold what belongs to sessions beside their inputs.

use crate::caller::Caller;
use crate::config::ServerConfig;
pub(crate) use crate::desk::Target;
use crate::desk::{Desk, short_id};
use crate::dispatch::Pool;
use crate::jobs::Clients;
use crate::metrics::Metrics;
use crate::service::upload::UploadBudget;
use crate::status::Fault;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::session::{Revision, Session};
use remesh_engine::work::Gate;
use remesh_proto::v1;
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
    /// Bytes of uploads under way.
    pub(crate) uploads: UploadBudget,
    /// What has happened.
    pub(crate) metrics: Metrics,
    /// Jobs of each client.
    pub(crate) clients: Clients,
    /// Where batch work lets interactive work pass.
    pub(crate) gate: Gate,
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
pub(crate) fn blob_digest<'a>(name: &'a str, field: &str) -> Result<&'a str> {
    name.strip_prefix(BLOB_PREFIX).ok_or_else(|| EngineError::bad_parameter(field, "a blob is named `blobs/{digest}`"))
}

impl Shared {
    /// The state of a new server.
    pub(crate) fn new(config: ServerConfig) -> Arc<Shared> {
        let engine = Engine::new(config.engine.clone());
        let pool = Pool::new(config.max_running, config.max_running_short, config.max_queued);
        let uploads = UploadBudget::default();
        Arc::new(Shared {
            config,
            engine,
            pool,
            uploads,
            metrics: Metrics::default(),
            clients: Clients::default(),
            gate: Gate::default(),
            watchers: Arc::default(),
            desks: Mutex::default(),
        })
    }

    fn desks(&self) -> MutexGuard<'_, HashMap<String, Arc<Desk>>> {
        self.desks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What belongs to a session, if the caller may see it.
    pub(crate) fn desk(&self, session: &Session, caller: &Caller) -> Option<Arc<Desk>> {
        self.desks().get(&session.id).filter(|desk| desk.owner == *caller).cloned()
    }

    /// A session of the caller by its name in field `field`, and what belongs to it; marks it as used.
    pub(crate) fn session(&self, name: &str, field: &str, caller: &Caller) -> Result<(Arc<Session>, Arc<Desk>)> {
        if name.is_empty() {
            return Err(EngineError::bad_parameter(field, "is required"));
        }
        let id = name.strip_prefix(SESSION_PREFIX);
        let id = id.ok_or_else(|| EngineError::bad_parameter(field, "a session is named `sessions/{id}`"))?;
        // Looked up before the session is touched: a session of somebody else is answered as one that never was.
        let desk = self.desks().get(id).filter(|desk| desk.owner == *caller).cloned();
        let desk = desk.ok_or_else(|| {
            EngineError::new(Reason::SessionNotFound, "no such session").with_hint("it was never made, was deleted, or has expired")
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
    ) -> Result<Target> {
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
    /// [`Reason::LimitReached`] if it has as many as one client may have, or the daemon as many as it may.
    pub(crate) fn create_session(
        &self,
        ttl: Option<Duration>,
        display_name: String,
        caller: &Caller,
        client: &Arc<str>,
    ) -> std::result::Result<(Arc<Session>, Arc<Desk>), Fault> {
        let mut desks = self.desks();
        let most = self.config.max_sessions_per_client;
        if desks.values().filter(|desk| desk.client == *client).count() >= most {
            return Err(Fault::ClientLimit { limit: "max_sessions_per_client", most: most as u64 });
        }
        let session = self.engine.create_session(ttl, self.config.clock.now())?;
        let desk = Arc::new(Desk::new(display_name, caller.clone(), client.clone(), self.config.clock.clone()));
        desks.insert(session.id.clone(), desk.clone());
        tracing::info!(target: "audit", action = "create", session = short_id(&session), author = caller.name());
        Ok((session, desk))
    }

    /// Whether a session may get a surface of so many faces, beside those of all others and those of the same client.
    pub(crate) fn check_faces(&self, of: &Arc<Desk>, faces: u64) -> Result<()> {
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

    /// Closes a session and tells those who watch it.
    pub(crate) fn delete_session(&self, session: &Session, caller: &Caller) -> Result<()> {
        self.engine.delete_session(&session.id)?;
        if let Some(desk) = self.desks().remove(&session.id) {
            desk.close(session.revision().0, v1::SessionEnd::Deleted);
        }
        tracing::info!(target: "audit", action = "delete", session = short_id(session), author = caller.name());
        Ok(())
    }

    /// Removes expired sessions and what belongs to them.
    pub(crate) fn sweep(&self) {
        let now = self.config.clock.now();
        let removed = self.engine.sweep(now);
        if removed > 0 {
            // Held while the sessions are listed, so that one that is just being made keeps its desk.
            let mut desks = self.desks();
            let open: HashSet<String> = self.engine.sessions(now).iter().map(|s| s.id.clone()).collect();
            desks.retain(|id, desk| {
                let keep = open.contains(id);
                if !keep {
                    tracing::info!(target: "audit", action = "expire", session = id.get(..8), author = "");
                    desk.close(0, v1::SessionEnd::Expired);
                }
                keep
            });
            tracing::info!(removed, "expired sessions removed");
        }
    }

    /// Tells all who watch that the server shuts down.
    pub(crate) fn close_feeds(&self) {
        self.desks().values().for_each(|desk| desk.feed.close(0, v1::SessionEnd::Shutdown));
    }
}
