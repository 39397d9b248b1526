//! Reading a data folder: sessions as they were when their last change was acknowledged. What cannot be read is told and left alone.

use super::charges::{Charges, Step, file_of};
use super::ledger::{Ledger, Whole, part_names};
use super::{Keeper, Unreadable, guard, keys};
use crate::answers::Answers;
use crate::caller::Caller;
use crate::config::{Clock, Keeping};
use crate::convert::from_proto;
use crate::convert::stored::{PartId, ReadPart, part_id, read_part};
use crate::desk::Desk;
use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::session::{Past, Revision, Session, Snapshot};
use remesh_proto::v1;
use remesh_store::{Contents, Leftover, Store, StoreError};
use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// What a data folder held.
#[derive(Debug, Default)]
pub(crate) struct Opened {
    pub(crate) keeper: Keeper,
    /// What belongs to the sessions, which are in the engine, by id.
    pub(crate) desks: HashMap<String, Arc<Desk>>,
    /// Uploads that broke.
    pub(crate) leftovers: Vec<Leftover>,
}

/// The records of one session.
#[derive(Debug, Default)]
struct Records {
    session: Option<Vec<u8>>,
    head: Option<Vec<u8>>,
    revisions: Vec<Vec<u8>>,
    parts: BTreeMap<PartId, Vec<u8>>,
    answers: Vec<(Vec<u8>, Vec<u8>)>,
}

fn unreadable(what: impl Into<String>) -> EngineError {
    EngineError::new(Reason::SessionUnreadable, what.into())
        .with_hint("the log of the daemon tells more; delete the session, or ask for help")
}

fn decoded<M: Message + Default>(bytes: Option<&[u8]>, what: &str) -> Result<M> {
    let bytes = bytes.ok_or_else(|| unreadable(format!("{what} is missing")))?;
    M::decode(bytes).map_err(|error| unreadable(format!("{what} cannot be decoded: {error}")))
}

/// The inputs at each revision of a session, and the numbers of its meshes.
///
/// # Errors
/// [`Reason::SessionUnreadable`] for something that is missing or cannot be read; of the engine for what it does not take.
pub(crate) fn rebuild(engine: &Engine, whole: &Whole) -> Result<(Past, Vec<(Arc<Snapshot>, v1::MeshSummary)>)> {
    let mut read: HashMap<PartId, ReadPart> = HashMap::new();
    for (name, bytes) in &whole.parts {
        if part_id(bytes) != *name {
            return Err(unreadable("a part has other contents than its name says"));
        }
        read.insert(*name, read_part(engine, bytes)?);
    }
    let mut snapshots: BTreeMap<u64, Arc<Snapshot>> = BTreeMap::new();
    let mut meshes: HashMap<PartId, (Arc<Snapshot>, v1::MeshSummary)> = HashMap::new();
    for revision in &whole.revisions {
        let names = part_names(revision);
        let parts: Option<Vec<&ReadPart>> = names.iter().map(|name| read.get(name)).collect();
        let parts = parts.filter(|parts| parts.len() == revision.parts.len());
        let parts = parts.ok_or_else(|| unreadable(format!("revision {} names a part that is not there", revision.revision)))?;
        let changes = parts.iter().flat_map(|part| &part.changes);
        let snapshot = Arc::new(Snapshot::of_changes(Revision(revision.revision), changes)?);
        for (name, part) in names.iter().zip(&parts) {
            if let Some(summary) = &part.mesh {
                meshes.entry(*name).or_insert_with(|| (snapshot.clone(), summary.clone()));
            }
        }
        snapshots.insert(revision.revision, snapshot);
    }
    // A session without a change has no revision on the disk.
    if whole.head.revision == 0 {
        snapshots.insert(0, Arc::new(Snapshot::of_changes(Revision(0), [])?));
    }
    let find = |&number: &u64| {
        // The empty session is never written.
        let found = snapshots.get(&number).cloned();
        let found = found.or_else(|| Snapshot::of_changes(Revision(0), []).ok().filter(|_| number == 0).map(Arc::new));
        found.ok_or_else(|| unreadable(format!("revision {number} is not there")))
    };
    let current = whole.head.revision;
    find(&current)?;
    let oldest = (current + 1).saturating_sub(remesh_engine::session::KEPT_REVISIONS as u64);
    let mut history: Vec<Arc<Snapshot>> = Vec::new();
    for number in oldest..=current {
        match find(&number) {
            Ok(snapshot) => history.push(snapshot),
            // Of a daemon that kept fewer.
            Err(_) => history.clear(),
        }
    }
    let all = |numbers: &[u64]| numbers.iter().map(find).collect::<Result<Vec<_>>>();
    let past = Past { history, undo: all(&whole.head.undo)?, redo: all(&whole.head.redo)? };
    Ok((past, meshes.into_values().collect()))
}

/// What a whole session takes in the folder.
pub(super) fn steps_of(whole: &Whole, past: &Past) -> Vec<Step> {
    let states = past.history.iter().chain(&past.undo).chain(&past.redo);
    let files = states.map(|state| Step { revision: state.revision.0, file: file_of(state), ..Step::default() });
    let parts = whole.parts.iter().map(|(part, bytes)| (*part, bytes.len() as u64)).collect();
    files.chain([Step { parts, ..Step::default() }]).collect()
}

fn time(stamp: Option<prost_types::Timestamp>) -> Option<SystemTime> {
    SystemTime::try_from(stamp?).ok()
}

/// What all sessions are opened with.
struct Opening<'a> {
    engine: &'a Engine,
    clock: &'a Clock,
    /// When the daemon was last alive.
    alive: Option<SystemTime>,
}

impl Opening<'_> {
    fn session(&self, id: &str, header: v1::StoredSession, records: Records, charges: &Charges) -> Result<(Session, Desk)> {
        let now = self.clock.now();
        let head = records.head.as_deref().map_or_else(|| Ok(v1::StoredHead::default()), |bytes| decoded(Some(bytes), "the head"))?;
        let revisions: Vec<v1::StoredRevision> =
            records.revisions.iter().map(|bytes| decoded(Some(bytes), "a revision")).collect::<Result<_>>()?;
        let whole = Whole { head, parts: records.parts, revisions };
        let (past, meshes) = rebuild(self.engine, &whole)?;
        let steps = steps_of(&whole, &past);
        let created = time(header.create_time).unwrap_or(now);
        let used = time(header.use_time).unwrap_or(created);
        // The time without a daemon does not count.
        let idle = self.alive.and_then(|alive| alive.duration_since(used).ok()).unwrap_or(Duration::ZERO);
        let ttl = header.ttl.map(|ttl| from_proto::duration(ttl, "ttl")).transpose()?.unwrap_or(self.engine.config.default_ttl);
        let session = Session::resume(id.to_owned(), created, ttl, now.checked_sub(idle).unwrap_or(now), past)?;
        let answers: Vec<v1::StoredAnswer> =
            records.answers.iter().map(|(_, bytes)| decoded(Some(bytes), "an answer")).collect::<Result<_>>()?;
        let kept: HashSet<PartId> = whole.parts.keys().copied().collect();
        let keys: VecDeque<Vec<u8>> = records.answers.into_iter().map(|(key, _)| key).collect();
        let ledger = Ledger::of(kept, whole.revisions.iter().map(|r| (r.revision, part_names(r))).collect(), keys);
        let owner = header.owner.map(Caller::named).unwrap_or_default();
        // An older daemon did not write it.
        let client: Arc<str> = if header.client.is_empty() { owner.name().into() } else { header.client.into() };
        for step in steps {
            charges.charge(id, &client, step);
        }
        let desk = Desk::kept(header.display_name, owner, client, self.clock.clone(), Answers::of(answers), ledger);
        meshes.into_iter().for_each(|(snapshot, summary)| desk.note_mesh(&snapshot, summary));
        desk.count_faces(&session.snapshot());
        Ok((session, desk))
    }
}

fn by_session(records: Vec<(Vec<u8>, Vec<u8>)>) -> BTreeMap<String, Records> {
    let mut sessions: BTreeMap<String, Records> = BTreeMap::new();
    for (key, value) in records {
        let Some((id, kind)) = keys::read(&key) else { continue };
        let records = sessions.entry(id.to_owned()).or_default();
        match kind {
            keys::Kind::Session => records.session = Some(value),
            keys::Kind::Head => records.head = Some(value),
            keys::Kind::Revision => records.revisions.push(value),
            keys::Kind::Part => {
                if let Some(name) = key.last_chunk::<16>() {
                    records.parts.insert(*name, value);
                }
            }
            keys::Kind::Answer => records.answers.push((key, value)),
        }
    }
    sessions
}

impl Opened {
    /// Opens a data folder and all sessions in it.
    ///
    /// # Errors
    /// Of the folder as a whole. A session that cannot be opened is told in the log and to its owner, and keeps no other from being opened.
    pub(crate) fn folder(keeping: &Keeping, engine: &Engine, clock: &Clock) -> std::result::Result<Opened, StoreError> {
        let begin = Instant::now();
        let (store, Contents { records, blobs, leftovers }) = Store::open(&keeping.folder, keeping.max_bytes)?;
        let store = Arc::new(store);
        let files = blobs.len();
        for blob in &blobs {
            // They take no memory, so there is no limit to reach.
            if let Err(error) = engine.add_blob(Keeper::blob_elsewhere(&store, blob)) {
                tracing::error!(%error, "an uploaded file is not taken up");
            }
        }
        let alive = records.iter().find(|(key, _)| key == keys::ALIVE);
        let alive = alive.and_then(|(_, bytes)| time(prost_types::Timestamp::decode(bytes.as_slice()).ok()));
        let mut opened = Opened {
            keeper: Keeper { store: Some(store), charges: Charges::new(keeping.max_bytes_per_client), ..Keeper::default() },
            desks: HashMap::new(),
            leftovers,
        };
        let opening = Opening { engine, clock, alive };
        for (id, records) in by_session(records) {
            opened.take(&opening, &id, records);
        }
        let unreadable = guard(&opened.keeper.unreadable).len();
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        tracing::info!(sessions = opened.desks.len(), unreadable, files, milliseconds, "data folder opened");
        Ok(opened)
    }

    fn take(&mut self, opening: &Opening<'_>, id: &str, records: Records) {
        let header = decoded::<v1::StoredSession>(records.session.as_deref(), "the session");
        let owner = header.as_ref().ok().and_then(|header| header.owner.clone());
        match header.and_then(|header| opening.session(id, header, records, &self.keeper.charges)) {
            Ok((session, desk)) => {
                opening.engine.reopen_session(session);
                self.desks.insert(id.to_owned(), Arc::new(desk));
            }
            Err(error) => {
                let short = id.get(..8).unwrap_or(id);
                tracing::error!(session = short, reason = error.reason().code(), %error, "a session cannot be opened; the others are");
                let error = unreadable(format!("the session cannot be opened: {error}"));
                guard(&self.keeper.unreadable).insert(id.to_owned(), Unreadable { owner, error });
            }
        }
    }
}
