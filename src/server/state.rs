//! What all calls share: the engine, the compute pool, notes on sessions that the engine does not need.

use crate::config::ServerConfig;
use crate::dispatch::Pool;
use crate::service::upload::UploadBudget;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::fingerprint::{Feeder, Fingerprint};
use remesh_engine::session::{Revision, Session, Snapshot};
use remesh_proto::v1;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};

/// What the server notes about a session.
#[derive(Debug, Default)]
struct Notes {
    display_name: String,
    /// Numbers of imported meshes by what they were imported from; the latest last.
    meshes: Vec<(Fingerprint, v1::MeshSummary)>,
}

/// Imports whose numbers are remembered per session, for rollbacks.
const KEPT_MESHES: usize = 64;

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
    notes: Mutex<HashMap<String, Notes>>,
}

/// The session and the inputs that a call is about.
#[derive(Debug, Clone)]
pub(crate) struct Target {
    /// The session.
    pub(crate) session: Arc<Session>,
    /// Its inputs when the call came.
    pub(crate) snapshot: Arc<Snapshot>,
}

impl Target {
    /// The revision that answers name.
    pub(crate) fn revision(&self) -> u64 {
        self.snapshot.revision.0
    }
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

fn source_fingerprint(snapshot: &Snapshot) -> Option<Fingerprint> {
    let mut feeder = Feeder::new();
    snapshot.source.as_ref()?.feed(&mut feeder);
    feeder.text(&format!("{:?}", snapshot.import));
    Some(feeder.finish())
}

impl Shared {
    /// The state of a new server.
    pub(crate) fn new(config: ServerConfig) -> Arc<Shared> {
        let engine = Engine::new(config.engine.clone());
        let pool = Pool::new(config.max_running, config.max_running_short, config.max_queued);
        Arc::new(Shared { config, engine, pool, uploads: UploadBudget::default(), notes: Mutex::default() })
    }

    fn notes(&self) -> MutexGuard<'_, HashMap<String, Notes>> {
        self.notes.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// A session by its name in field `field`; marks it as used.
    pub(crate) fn session(&self, name: &str, field: &str) -> Result<Arc<Session>> {
        if name.is_empty() {
            return Err(EngineError::bad_parameter(field, "is required"));
        }
        let id = name.strip_prefix(SESSION_PREFIX);
        let id = id.ok_or_else(|| EngineError::bad_parameter(field, "a session is named `sessions/{id}`"))?;
        self.engine.session(id, self.config.clock.now())
    }

    /// The session and its inputs, if it is at the expected revision.
    pub(crate) fn target(&self, name: &str, expected_revision: Option<u64>) -> Result<Target> {
        let session = self.session(name, "session")?;
        let snapshot = session.snapshot();
        match expected_revision.map(Revision) {
            Some(expected) if expected != snapshot.revision => {
                let message = format!("the call is for revision {}, the session is at {}", expected.0, snapshot.revision.0);
                Err(EngineError::new(Reason::StaleRevision, message)
                    .with_hint("read the session again and repeat the call for its current revision")
                    .with_metadata("expected_revision", expected.0)
                    .with_metadata("current_revision", snapshot.revision.0))
            }
            _ => Ok(Target { session, snapshot }),
        }
    }

    /// Remembers what the creator calls a session.
    pub(crate) fn note_display_name(&self, session: &Session, display_name: String) {
        self.notes().entry(session.id.clone()).or_default().display_name = display_name;
    }

    /// What the creator calls a session.
    pub(crate) fn display_name(&self, session: &Session) -> String {
        self.notes().get(&session.id).map_or_else(String::new, |n| n.display_name.clone())
    }

    /// Remembers the numbers of an imported mesh.
    pub(crate) fn note_mesh(&self, session: &Session, snapshot: &Snapshot, summary: v1::MeshSummary) {
        let Some(key) = source_fingerprint(snapshot) else { return };
        let mut notes = self.notes();
        let meshes = &mut notes.entry(session.id.clone()).or_default().meshes;
        meshes.retain(|(other, _)| *other != key);
        meshes.push((key, summary));
        if meshes.len() > KEPT_MESHES {
            meshes.remove(0);
        }
    }

    /// The numbers of the mesh of a snapshot.
    pub(crate) fn mesh_summary(&self, session: &Session, snapshot: &Snapshot) -> Option<v1::MeshSummary> {
        let key = source_fingerprint(snapshot)?;
        self.notes().get(&session.id)?.meshes.iter().find(|(other, _)| *other == key).map(|(_, summary)| summary.clone())
    }

    /// Closes a session and forgets the notes on it.
    pub(crate) fn delete_session(&self, session: &Session) -> Result<()> {
        self.notes().remove(&session.id);
        self.engine.delete_session(&session.id)
    }

    /// Removes expired sessions and their notes.
    pub(crate) fn sweep(&self) {
        let now = self.config.clock.now();
        let removed = self.engine.sweep(now);
        if removed > 0 {
            let open: Vec<_> = self.engine.sessions(now);
            self.notes().retain(|id, _| open.iter().any(|s| s.id == *id));
            tracing::info!(removed, "expired sessions removed");
        }
    }
}
