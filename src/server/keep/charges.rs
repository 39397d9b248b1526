//! What each client has in the data folder: inputs and files of its sessions, and files that it sent and no session of its uses yet. Kept only
//! where there is a bound for it.

use crate::convert::stored::PartId;
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result};
use remesh_engine::session::{MeshSource, Snapshot};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// A file: its digest and its bytes.
pub(crate) type File = (String, u64);

/// The file that a surface rests on.
pub(crate) fn file_of(snapshot: &Snapshot) -> Option<File> {
    match &snapshot.source {
        Some(MeshSource::File(blob)) => Some((blob.digest.clone(), blob.len() as u64)),
        _ => None,
    }
}

/// What one session has.
#[derive(Debug, Default)]
struct OfSession {
    client: Arc<str>,
    parts: HashMap<PartId, u64>,
    /// Files by revision.
    files: BTreeMap<u64, File>,
}

#[derive(Debug, Default)]
struct Table {
    sessions: HashMap<String, OfSession>,
    /// Files that were sent, with their bytes and when.
    sent: HashMap<(Arc<str>, String), (u64, SystemTime)>,
}

/// All charges.
#[derive(Debug, Default)]
pub(crate) struct Charges {
    most: Option<u64>,
    table: Mutex<Table>,
}

/// What a revision adds to and takes from what a session has.
#[derive(Debug, Default)]
pub(crate) struct Step {
    pub(crate) revision: u64,
    pub(crate) parts: Vec<(PartId, u64)>,
    pub(crate) file: Option<File>,
    pub(crate) gone_parts: Vec<PartId>,
    pub(crate) gone_revisions: Vec<u64>,
}

impl Charges {
    /// With a bound for each client, or without one.
    pub(crate) fn new(most: Option<u64>) -> Self {
        Charges { most, table: Mutex::default() }
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a client may have so many bytes and these files more. Reserves nothing: what comes in at the same time may exceed the bound
    /// together, once.
    ///
    /// # Errors
    /// [`Reason::LimitReached`].
    pub(crate) fn admit<'a>(&self, client: &str, bytes: u64, new: impl IntoIterator<Item = &'a File>) -> Result<()> {
        let Some(most) = self.most else { return Ok(()) };
        let table = self.table();
        let (mut used, mut files) = (0, HashMap::new());
        for session in table.sessions.values().filter(|session| &*session.client == client) {
            used += session.parts.values().sum::<u64>();
            files.extend(session.files.values().map(|(digest, bytes)| (digest.as_str(), *bytes)));
        }
        let sent = table.sent.iter().filter(|((other, _), _)| &**other == client);
        files.extend(sent.map(|((_, digest), (bytes, _))| (digest.as_str(), *bytes)));
        let new: BTreeMap<&str, u64> = new.into_iter().map(|(digest, bytes)| (digest.as_str(), *bytes)).collect();
        let new_files = new.iter().filter(|(digest, _)| !files.contains_key(*digest)).map(|(_, bytes)| bytes);
        let more = new_files.fold(bytes, |sum, bytes| sum.saturating_add(*bytes));
        used += files.values().sum::<u64>();
        if used.saturating_add(more) <= most || more == 0 {
            return Ok(());
        }
        let message = format!("sessions and files of this client take {used} bytes of the data folder, {more} more would exceed {most}");
        Err(EngineError::new(Reason::LimitReached, message)
            .with_hint("delete a session that is no longer needed; files that no session uses go after a while")
            .with_metadata("limit", "max_store_mb_per_client")
            .with_metadata("retry", "when there is room"))
    }

    /// Charges what a revision changes.
    pub(crate) fn charge(&self, session: &str, client: &Arc<str>, step: Step) {
        if self.most.is_none() {
            return;
        }
        let mut table = self.table();
        let own = table.sessions.entry(session.to_owned()).or_default();
        own.client = client.clone();
        own.parts.retain(|part, _| !step.gone_parts.contains(part));
        own.parts.extend(step.parts);
        own.files.retain(|revision, _| !step.gone_revisions.contains(revision));
        own.files.extend(step.file.map(|file| (step.revision, file)));
    }

    /// Charges a file that was sent.
    pub(crate) fn sent(&self, client: &Arc<str>, (digest, bytes): File, now: SystemTime) {
        if self.most.is_some() {
            self.table().sent.insert((client.clone(), digest), (bytes, now));
        }
    }

    /// A session is gone.
    pub(crate) fn forget(&self, session: &str) {
        self.table().sessions.remove(session);
    }

    /// Files that were deleted, and those that were sent long ago, which only sessions hold any more, are not of their senders any more.
    pub(crate) fn clean_up(&self, deleted: &[String], now: SystemTime, grace: Duration) {
        let is_late = |at: SystemTime| now.duration_since(at).is_ok_and(|age| age > grace);
        self.table().sent.retain(|(_, digest), (_, at)| !deleted.contains(digest) && !is_late(*at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, bytes: u64) -> File {
        (name.to_owned(), bytes)
    }

    #[test]
    fn a_client_pays_once_for_a_file_and_no_more_for_what_is_gone() {
        let charges = Charges::new(Some(100));
        let (a, now): (Arc<str>, _) = ("a".into(), SystemTime::UNIX_EPOCH);
        charges.sent(&a, file("x", 60), now);
        charges.charge("s", &a, Step { revision: 1, parts: vec![([1; 16], 10)], file: Some(file("x", 60)), ..Step::default() });
        charges.charge("t", &a, Step { revision: 1, file: Some(file("x", 60)), ..Step::default() });
        assert!(charges.admit("a", 30, Some(&file("x", 60))).is_ok());
        let refused = charges.admit("a", 31, None).expect_err("too much");
        assert_eq!(refused.reason(), Reason::LimitReached);
        assert!(charges.admit("a", 0, Some(&file("y", 31))).is_err());
        assert!(charges.admit("b", 100, None).is_ok(), "another client");
        assert!(charges.admit("a", 0, None).is_ok(), "what needs nothing is never refused");
        charges.charge("s", &a, Step { revision: 2, gone_parts: vec![[1; 16]], gone_revisions: vec![1], ..Step::default() });
        charges.forget("t");
        charges.clean_up(&[], now + Duration::from_secs(61), Duration::from_secs(60));
        assert!(charges.admit("a", 100, None).is_ok());
        assert!(Charges::new(None).admit("a", u64::MAX, None).is_ok(), "no bound");
    }
}
