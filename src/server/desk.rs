//! What the server keeps beside a session: its name for people, its owner, its events, the answers to its edits; and the way every edit
//! takes.

use crate::answers::Answers;
use crate::caller::Caller;
use crate::config::Clock;
use crate::feed::Feed;
use crate::jobs::Works;
use crate::operations::Operations;
use crate::state::Shared;
use remesh_engine::error::Result;
use remesh_engine::fingerprint::{Feeder, Fingerprint};
use remesh_engine::session::{Change, Edit, Revision, Session, Snapshot};
use remesh_proto::v1;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use v1::watch_session_response::Event;

/// Imports whose numbers are remembered per session, for rollbacks.
const KEPT_MESHES: usize = 64;

/// What belongs to a session and is no input of it.
#[derive(Debug)]
pub(crate) struct Desk {
    /// What the creator calls it.
    pub(crate) display_name: String,
    /// Who made it; nobody else sees it.
    pub(crate) owner: Caller,
    /// Whose limits it counts for.
    pub(crate) client: Arc<str>,
    /// Faces of the surface that was imported last.
    pub(crate) faces: AtomicU64,
    /// What computes for it.
    pub(crate) works: Works,
    /// Its long work.
    pub(crate) operations: Operations,
    /// What happens to it.
    pub(crate) feed: Arc<Feed>,
    /// What was answered to edits of it.
    pub(crate) answers: Answers,
    /// Numbers of imported meshes by what they were imported from; the latest last.
    meshes: Mutex<Vec<(Fingerprint, v1::MeshSummary)>>,
}

impl Desk {
    /// For a new session.
    pub(crate) fn new(display_name: String, owner: Caller, client: Arc<str>, clock: Clock) -> Self {
        Desk {
            display_name,
            owner,
            client,
            faces: AtomicU64::new(0),
            works: Works::default(),
            operations: Operations::default(),
            feed: Arc::new(Feed::new(clock)),
            answers: Answers::default(),
            meshes: Mutex::default(),
        }
    }

    /// Ends it: stops its work and tells those who watch.
    pub(crate) fn close(&self, revision: u64, reason: v1::SessionEnd) {
        let stopped = self.works.close();
        if stopped > 0 {
            tracing::info!(stopped, "work of a session that has ended is stopped");
        }
        self.feed.close(revision, reason);
    }

    /// Remembers the numbers of an imported mesh.
    pub(crate) fn note_mesh(&self, snapshot: &Snapshot, summary: v1::MeshSummary) {
        self.faces.store(summary.faces, Ordering::Relaxed);
        let Some(key) = source_fingerprint(snapshot) else { return };
        let mut meshes = self.meshes.lock().unwrap_or_else(PoisonError::into_inner);
        meshes.retain(|(other, _)| *other != key);
        meshes.push((key, summary));
        if meshes.len() > KEPT_MESHES {
            meshes.remove(0);
        }
    }

    /// The numbers of the mesh of a snapshot.
    pub(crate) fn mesh_summary(&self, snapshot: &Snapshot) -> Option<v1::MeshSummary> {
        let key = source_fingerprint(snapshot)?;
        let meshes = self.meshes.lock().unwrap_or_else(PoisonError::into_inner);
        meshes.iter().find(|(other, _)| *other == key).map(|(_, summary)| summary.clone())
    }
}

fn source_fingerprint(snapshot: &Snapshot) -> Option<Fingerprint> {
    let mut feeder = Feeder::new();
    snapshot.source.as_ref()?.feed(&mut feeder);
    feeder.text(&format!("{:?}", snapshot.import));
    Some(feeder.finish())
}

/// The session and the inputs that a call is about.
#[derive(Debug, Clone)]
pub(crate) struct Target {
    /// The session.
    pub(crate) session: Arc<Session>,
    /// Its inputs when the call came.
    pub(crate) snapshot: Arc<Snapshot>,
    /// What belongs to it.
    pub(crate) desk: Arc<Desk>,
    /// Who calls.
    pub(crate) caller: Caller,
    /// `request_id` of the call; empty if it has none.
    pub(crate) request_id: String,
    /// What all calls share.
    pub(crate) shared: Arc<Shared>,
}

/// As much of the id of a session as is told in logs: whole ids are keys to sessions.
pub(crate) fn short_id(session: &Session) -> &str {
    session.id.get(..8).unwrap_or(&session.id)
}

impl Target {
    /// The revision that answers name.
    pub(crate) fn revision(&self) -> u64 {
        self.snapshot.revision.0
    }

    /// Changes the inputs of the session. See [`Target::edit`].
    pub(crate) fn apply(&self, base: Option<Revision>, changes: &[Change]) -> Result<Revision> {
        self.edit(base, Edit::Changes(changes))
    }

    /// Makes a revision of the session: the one way of the server to do so. Tells those who watch and the audit log.
    ///
    /// # Errors
    /// Those of [`Session::edit`].
    pub(crate) fn edit(&self, base: Option<Revision>, edit: Edit<'_>) -> Result<Revision> {
        let names = edit.names();
        self.session.edit(base, edit, |next| {
            let revision = next.revision.0;
            let (author, request_id) = (self.caller.name(), self.request_id.as_str());
            tracing::info!(target: "audit", action = "edit", session = short_id(&self.session), revision, changes = names.join(","), author, request_id);
            let made = v1::RevisionMade {
                base_revision: revision.saturating_sub(1),
                changes: names.iter().map(|&name| name.to_owned()).collect(),
                request_id: request_id.to_owned(),
                author: author.to_owned(),
            };
            self.desk.feed.push(revision, Event::RevisionMade(made));
            self.shared.metrics.revision(&names);
            Ok(())
        })
    }
}
