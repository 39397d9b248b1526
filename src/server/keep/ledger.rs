//! What is kept of one session, and what of it can go when a revision is added.

use super::charges::{Step, file_of};
use super::open::steps_of;
use super::{Keeper, keys, stored_session};
use crate::convert::stored::{PartId, Parts, parts};
use crate::desk::Desk;
use prost::Message;
use remesh_engine::error::Result;
use remesh_engine::session::{MeshSource, Pending, Session, Snapshot};
use remesh_proto::v1;
use remesh_store::Batch;
use std::collections::{BTreeMap, HashSet, VecDeque};
use std::sync::Arc;

/// Answers kept on the disk: as many as in memory.
const KEPT_ANSWERS: usize = crate::answers::KEPT_ANSWERS;
/// Parts that no revision lists any more are looked for once in so many revisions.
const REVISIONS_A_SWEEP: u64 = 16;

/// What is kept of a session. Empty without a data folder.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    /// The parts of the current revision.
    current: Option<Parts>,
    /// Parts that are kept.
    kept: HashSet<PartId>,
    /// Kept revisions and their parts.
    revisions: BTreeMap<u64, Vec<PartId>>,
    /// Keys of kept answers, the oldest first.
    answers: VecDeque<Vec<u8>>,
}

/// What goes with a revision.
#[derive(Debug)]
pub(crate) struct Entry<'a> {
    /// What changed.
    pub(crate) changes: &'a [&'static str],
    /// Who changed it.
    pub(crate) author: &'a str,
    /// `request_id` of the request.
    pub(crate) request_id: &'a str,
    /// The answer to it, if it may be asked for again.
    pub(crate) answer: Option<v1::StoredAnswer>,
}

/// What changes in a ledger once a batch is on the disk.
struct Written {
    current: Parts,
    kept: Vec<(PartId, u64)>,
    gone_parts: Vec<PartId>,
    gone_revisions: Vec<u64>,
    answer: Option<Vec<u8>>,
}

impl Ledger {
    /// Of a session that was read.
    pub(super) fn of(kept: HashSet<PartId>, revisions: BTreeMap<u64, Vec<PartId>>, answers: VecDeque<Vec<u8>>) -> Self {
        Ledger { current: None, kept, revisions, answers }
    }

    /// Writes a revision with all it needs, and deletes what it makes superfluous. It is on the disk when this returns; after an error nothing has
    /// changed.
    ///
    /// # Errors
    /// `StoreFull`, `StoreFailed`, `LimitReached` for a client that has as much as it may.
    pub(crate) fn record(&mut self, keeper: &Keeper, id: &str, desk: &Desk, pending: &Pending, entry: Entry<'_>) -> Result<()> {
        if !keeper.is_on() {
            return Ok(());
        }
        let mut batch = Batch::default();
        let head = v1::StoredHead {
            revision: pending.next.revision.0,
            undo: pending.undo.iter().map(|r| r.0).collect(),
            redo: pending.redo.iter().map(|r| r.0).collect(),
        };
        let written = self.revision(&mut batch, id, desk, pending, &head, entry)?;
        batch.put(keys::head(id), head.encode_to_vec());
        let step = Step {
            revision: head.revision,
            parts: written.kept.clone(),
            file: file_of(&pending.next),
            gone_parts: written.gone_parts.clone(),
            gone_revisions: written.gone_revisions.clone(),
        };
        let bytes = step.parts.iter().map(|(_, bytes)| bytes).sum();
        keeper.charges.admit(&desk.client, bytes, step.file.iter())?;
        // Only now: a refused change leaves no file behind.
        keep_source(keeper, &pending.next)?;
        keeper.commit(batch)?;
        keeper.charges.charge(id, &desk.client, step);
        self.take(head.revision, written);
        Ok(())
    }

    fn revision(
        &self,
        batch: &mut Batch,
        id: &str,
        desk: &Desk,
        pending: &Pending,
        head: &v1::StoredHead,
        entry: Entry<'_>,
    ) -> Result<Written> {
        let number = head.revision;
        let (current, fresh) = parts(&pending.next, desk.mesh_summary(&pending.next), self.current.as_ref())?;
        let mut kept = Vec::new();
        for (part, bytes) in fresh.into_iter().filter(|(part, _)| !self.kept.contains(part)) {
            kept.push((part, bytes.len() as u64));
            batch.put(keys::part(id, &part), bytes);
        }
        let record = stored_revision(number, &current, &entry, Some(desk.feed.now().into()));
        batch.put(keys::revision(id, number), record.encode_to_vec());
        let reached: HashSet<u64> = head.undo.iter().chain(&head.redo).copied().collect();
        let is_gone = |&r: &u64| r < pending.oldest.0 && !reached.contains(&r);
        let gone_revisions: Vec<u64> = self.revisions.keys().copied().filter(is_gone).collect();
        gone_revisions.iter().for_each(|&r| batch.delete(keys::revision(id, r)));
        let gone_parts = if number.is_multiple_of(REVISIONS_A_SWEEP) { self.unused_parts(&gone_revisions, &current) } else { Vec::new() };
        gone_parts.iter().for_each(|part| batch.delete(keys::part(id, part)));
        let answer = entry.answer.map(|answer| self.answer(batch, id, number, &answer));
        Ok(Written { current, kept, gone_parts, gone_revisions, answer })
    }

    fn answer(&self, batch: &mut Batch, id: &str, revision: u64, answer: &v1::StoredAnswer) -> Vec<u8> {
        let key = keys::answer(id, revision, &answer.request_id);
        batch.put(key.clone(), answer.encode_to_vec());
        if let Some(oldest) = self.answers.front().filter(|_| self.answers.len() >= KEPT_ANSWERS) {
            batch.delete(oldest.clone());
        }
        key
    }

    fn unused_parts(&self, gone: &[u64], current: &Parts) -> Vec<PartId> {
        let staying = self.revisions.iter().filter(|(number, _)| !gone.contains(number));
        let used: HashSet<PartId> = staying.flat_map(|(_, parts)| parts.iter().copied()).chain(current.ids()).collect();
        self.kept.difference(&used).copied().collect()
    }

    fn take(&mut self, revision: u64, written: Written) {
        let Written { current, kept, gone_parts, gone_revisions, answer } = written;
        self.kept.extend(kept.into_iter().map(|(part, _)| part));
        self.kept.retain(|part| !gone_parts.contains(part));
        gone_revisions.iter().for_each(|number| drop(self.revisions.remove(number)));
        self.revisions.insert(revision, current.ids().collect());
        self.current = Some(current);
        answer.into_iter().for_each(|key| self.note_answer(key));
    }

    fn note_answer(&mut self, key: Vec<u8>) {
        if self.answers.len() >= KEPT_ANSWERS {
            self.answers.pop_front();
        }
        self.answers.push_back(key);
    }

    /// Writes the answer to a request that changed nothing.
    ///
    /// # Errors
    /// `StoreFull`, `StoreFailed`.
    pub(crate) fn record_answer(&mut self, keeper: &Keeper, id: &str, revision: u64, answer: &v1::StoredAnswer) -> Result<()> {
        if !keeper.is_on() {
            return Ok(());
        }
        let mut batch = Batch::default();
        let key = self.answer(&mut batch, id, revision, answer);
        keeper.commit(batch)?;
        self.note_answer(key);
        Ok(())
    }

    /// Writes a whole session that was not kept before.
    ///
    /// # Errors
    /// Those of [`Ledger::record`].
    pub(crate) fn record_all(&mut self, keeper: &Keeper, session: &Session, desk: &Desk, whole: &Whole) -> Result<()> {
        if !keeper.is_on() {
            return Ok(());
        }
        let id = &session.id;
        let steps = steps_of(whole, &session.past());
        let bytes = steps.iter().flat_map(|step| &step.parts).map(|(_, bytes)| bytes).sum();
        keeper.charges.admit(&desk.client, bytes, steps.iter().filter_map(|step| step.file.as_ref()))?;
        let mut batch = Batch::default();
        batch.put(keys::session(id), stored_session(session, desk).encode_to_vec());
        batch.put(keys::head(id), whole.head.encode_to_vec());
        for (part, bytes) in &whole.parts {
            batch.put(keys::part(id, part), bytes.clone());
        }
        for revision in &whole.revisions {
            batch.put(keys::revision(id, revision.revision), revision.encode_to_vec());
        }
        keeper.commit(batch)?;
        steps.into_iter().for_each(|step| keeper.charges.charge(id, &desk.client, step));
        self.kept = whole.parts.keys().copied().collect();
        self.revisions = whole.revisions.iter().map(|r| (r.revision, part_names(r))).collect();
        Ok(())
    }
}

/// The names of the parts of a revision; those that are none are left out, for [`super::rebuild`] to complain of.
pub(super) fn part_names(revision: &v1::StoredRevision) -> Vec<PartId> {
    revision.parts.iter().filter_map(|name| PartId::try_from(name.as_ref()).ok()).collect()
}

/// A revision as it is kept.
pub(super) fn stored_revision(number: u64, parts: &Parts, entry: &Entry<'_>, time: Option<prost_types::Timestamp>) -> v1::StoredRevision {
    v1::StoredRevision {
        revision: number,
        parts: parts.ids().map(|part| part.to_vec().into()).collect(),
        changes: entry.changes.iter().map(|&name| name.to_owned()).collect(),
        author: entry.author.to_owned(),
        request_id: entry.request_id.to_owned(),
        time,
    }
}

/// A session as a whole, in the form in which it is kept.
#[derive(Debug, Default)]
pub(crate) struct Whole {
    pub(crate) head: v1::StoredHead,
    pub(crate) parts: BTreeMap<PartId, Vec<u8>>,
    /// By number.
    pub(crate) revisions: Vec<v1::StoredRevision>,
}

/// Puts the file of a surface into the data folder.
fn keep_source(keeper: &Keeper, snapshot: &Arc<Snapshot>) -> Result<()> {
    match &snapshot.source {
        Some(MeshSource::File(blob)) => keeper.keep_blob(blob),
        _ => Ok(()),
    }
}
