//! What the server keeps beside a session: its name for people, its owner, its events, the answers to its edits; and the way every edit
//! takes.

use crate::answers::{Answers, Open};
use crate::caller::Caller;
use crate::config::Clock;
use crate::feed::Feed;
use crate::jobs::Works;
use crate::keep::ledger::{Entry, Ledger};
use crate::operations::Operations;
use crate::state::Shared;
use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::error::Result;
use remesh_engine::fingerprint::{Feeder, Fingerprint};
use remesh_engine::session::{Change, Edit, Pending, Revision, Session, Snapshot};
use remesh_proto::v1;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;
use v1::watch_session_response::Event;

/// Changes after which a session may have another surface.
const OTHER_MESH: [&str; 4] = ["mesh", "undo", "redo", "rollback"];
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
    /// Faces of the surface of the current revision.
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
    /// What is kept of it on the disk.
    pub(crate) ledger: Mutex<Ledger>,
    /// The last use that is noted on the disk.
    pub(crate) noted_use: Mutex<Option<SystemTime>>,
}

impl Desk {
    /// For a new session.
    pub(crate) fn new(display_name: String, owner: Caller, client: Arc<str>, clock: Clock) -> Self {
        Desk::kept(display_name, owner, client, clock, Answers::default(), Ledger::default())
    }

    /// For a session of before the server was started.
    pub(crate) fn kept(display_name: String, owner: Caller, client: Arc<str>, clock: Clock, answers: Answers, ledger: Ledger) -> Self {
        Desk {
            display_name,
            owner,
            client,
            faces: AtomicU64::new(0),
            works: Works::default(),
            operations: Operations::default(),
            feed: Arc::new(Feed::new(clock)),
            answers,
            meshes: Mutex::default(),
            ledger: Mutex::new(ledger),
            noted_use: Mutex::default(),
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
        let Some(key) = source_fingerprint(snapshot) else { return };
        let mut meshes = self.meshes.lock().unwrap_or_else(PoisonError::into_inner);
        meshes.retain(|(other, _)| *other != key);
        meshes.push((key, summary));
        if meshes.len() > KEPT_MESHES {
            meshes.remove(0);
        }
    }

    /// Counts the faces of the surface of what is the current revision now; of one whose numbers are forgotten those of the surface before stay.
    pub(crate) fn count_faces(&self, current: &Snapshot) {
        match self.mesh_summary(current) {
            Some(mesh) => self.faces.store(mesh.faces, Ordering::Relaxed),
            None if current.source.is_none() => self.faces.store(0, Ordering::Relaxed),
            None => {}
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
    pub(crate) fn apply<A: Message>(
        &self,
        base: Option<Revision>,
        changes: &[Change],
        open: Open,
        answer: impl FnOnce(&Pending) -> A,
    ) -> Result<A> {
        self.edit(base, Edit::Changes(changes), open, answer)
    }

    /// Makes a revision of the session and gives the answer to the request: the one way of the server to do so. With a data folder both are on
    /// the disk before anybody sees them. Tells those who watch and the audit log. Blocks while the disk works.
    ///
    /// # Errors
    /// Those of [`Session::edit`]; `StoreFull` and `StoreFailed` if it cannot be kept. Then nothing has changed.
    pub(crate) fn edit<A: Message>(
        &self,
        base: Option<Revision>,
        edit: Edit<'_>,
        open: Open,
        answer: impl FnOnce(&Pending) -> A,
    ) -> Result<A> {
        let names = edit.names();
        let mut answered = None;
        let commit = |pending: &Pending| {
            let answer = answer(pending);
            let (author, request_id) = (self.caller.name(), self.request_id.as_str());
            let entry = Entry { changes: &names, author, request_id, answer: open.stored(&answer) };
            let mut ledger = self.desk.ledger.lock().unwrap_or_else(PoisonError::into_inner);
            ledger.record(&self.shared.keeper, &self.session.id, &self.desk, pending, entry)?;
            answered = Some(answer);
            Ok(())
        };
        self.session.edit(base, edit, commit, |pending| self.tell(pending, &names))?;
        let answer = answered.ok_or_else(|| EngineError::invariant("an edit without an answer"))?;
        Ok(open.keep(answer))
    }

    /// The answer to a request that found nothing to change.
    ///
    /// # Errors
    /// `StoreFull` and `StoreFailed` if the answer cannot be kept.
    pub(crate) fn unchanged<A: Message>(&self, open: Open, answer: A) -> Result<A> {
        if let Some(stored) = open.stored(&answer) {
            let mut ledger = self.desk.ledger.lock().unwrap_or_else(PoisonError::into_inner);
            ledger.record_answer(&self.shared.keeper, &self.session.id, self.revision(), &stored)?;
        }
        Ok(open.keep(answer))
    }

    /// Tells those who watch and the audit log of a revision.
    fn tell(&self, pending: &Pending, names: &[&'static str]) {
        let revision = pending.next.revision.0;
        if names.iter().any(|name| OTHER_MESH.contains(name)) {
            self.desk.count_faces(&pending.next);
        }
        let (author, request_id) = (self.caller.name(), self.request_id.as_str());
        tracing::info!(target: "audit", action = "edit", session = short_id(&self.session), revision, changes = names.join(","), author, request_id);
        let made = v1::RevisionMade {
            base_revision: revision.saturating_sub(1),
            changes: names.iter().map(|&name| name.to_owned()).collect(),
            request_id: request_id.to_owned(),
            author: author.to_owned(),
        };
        self.desk.feed.push(revision, Event::RevisionMade(made));
        self.shared.metrics.revision(names);
    }
}
