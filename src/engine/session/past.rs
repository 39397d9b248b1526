//! A session that was before: its inputs at the revisions that can still be reached, to make it again.

use super::{Change, KEPT_REVISIONS, Revision, Session, Snapshot, State, history::Stacks};
use crate::error::{EngineError, Reason, Result};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

/// The inputs of a session at the revisions that can still be reached.
#[derive(Debug, Clone, Default)]
pub struct Past {
    /// Kept revisions, oldest first; the last is the current one.
    pub history: Vec<Arc<Snapshot>>,
    /// What undo leads to, the next one last.
    pub undo: Vec<Arc<Snapshot>>,
    /// What redo leads to, the next one last.
    pub redo: Vec<Arc<Snapshot>>,
}

impl Snapshot {
    /// The inputs that changes make of an empty session, under the number of a revision.
    ///
    /// # Errors
    /// Those of [`Session::apply`]; a rollback leads nowhere.
    pub fn of_changes<'a>(revision: Revision, changes: impl IntoIterator<Item = &'a Change>) -> Result<Snapshot> {
        let mut snapshot = Snapshot::empty();
        for change in changes {
            snapshot.change(std::slice::from_ref(change), |_| Err(EngineError::bad_parameter("rollback", "has nowhere to lead")))?;
        }
        snapshot.revision = revision;
        Ok(snapshot)
    }
}

impl Session {
    /// A session that goes on where another ended. Nothing is computed.
    ///
    /// # Errors
    /// [`Reason::SnapshotInvalid`] for a past without revisions, with more than are kept, or out of order.
    pub fn resume(id: String, created: SystemTime, ttl: Duration, last_used: SystemTime, past: Past) -> Result<Session> {
        let wrong = |what: &str| EngineError::new(Reason::SnapshotInvalid, format!("the session cannot go on: {what}"));
        if past.history.is_empty() {
            return Err(wrong("it has no current revision"));
        }
        if [past.history.len(), past.undo.len(), past.redo.len()].iter().any(|&count| count > KEPT_REVISIONS) {
            return Err(wrong("it has more revisions than are kept"));
        }
        if !past.history.is_sorted_by(|a, b| a.revision < b.revision) {
            return Err(wrong("its revisions are out of order"));
        }
        let state = State { history: past.history.into(), steps: Stacks::of(past.undo, past.redo), ttl, last_used: last_used.max(created) };
        Ok(Session { id, created, writer: Mutex::default(), state: Mutex::new(state) })
    }

    /// Its inputs at all revisions that can be reached.
    pub fn past(&self) -> Past {
        let state = self.lock();
        let (undo, redo) = state.steps.states();
        Past { history: state.history.iter().cloned().collect(), undo, redo }
    }

    /// When it was last used.
    pub fn last_used(&self) -> SystemTime {
        self.lock().last_used
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Edit;
    use crate::sizing::SizeSpec;

    fn size(size: f64) -> Change {
        Change::Size(SizeSpec::Uniform { size })
    }

    #[test]
    fn a_session_goes_on_with_its_revisions_and_steps() {
        let start = SystemTime::UNIX_EPOCH;
        let first = Session::new("s".into(), Duration::from_secs(60), start);
        for n in 1..=4 {
            first.apply(None, &[size(f64::from(n))]).unwrap();
        }
        first.edit(None, Edit::Undo, |_| Ok(()), |_| ()).unwrap();
        let second = Session::resume("t".into(), start, Duration::from_secs(60), start, first.past()).unwrap();
        for session in [&first, &second] {
            let mut seen = vec![(session.revision(), session.oldest_revision(), session.steps(), session.snapshot().size.clone())];
            for edit in [Edit::Undo, Edit::Redo, Edit::Redo, Edit::Changes(&[Change::Rollback(Revision(1))])] {
                session.edit(None, edit, |_| Ok(()), |_| ()).unwrap();
                seen.push((session.revision(), session.oldest_revision(), session.steps(), session.snapshot().size.clone()));
            }
            let sizes: Vec<_> = seen.iter().map(|(.., size)| size.clone()).collect();
            let expected = [3.0, 2.0, 3.0, 4.0, 1.0].map(|size| Some(SizeSpec::Uniform { size }));
            assert_eq!((sizes.as_slice(), seen[4].0), (expected.as_slice(), Revision(9)));
        }
        assert_eq!((first.steps(), first.oldest_revision()), (second.steps(), second.oldest_revision()));
    }

    #[test]
    fn a_past_that_cannot_be_is_refused() {
        let at = |revision| Arc::new(Snapshot::of_changes(Revision(revision), []).unwrap());
        let start = SystemTime::UNIX_EPOCH;
        let pasts = [
            Past::default(),
            Past { history: vec![at(2), at(1)], ..Past::default() },
            Past { history: (0..=KEPT_REVISIONS as u64).map(at).collect(), ..Past::default() },
        ];
        for past in pasts {
            let refused = Session::resume("s".into(), start, Duration::from_secs(1), start, past).unwrap_err();
            assert_eq!(refused.reason(), Reason::SnapshotInvalid);
        }
        let rollback = Snapshot::of_changes(Revision(1), [&Change::Rollback(Revision(0))]).unwrap_err();
        assert_eq!(rollback.reason(), Reason::BadParameter);
    }
}
