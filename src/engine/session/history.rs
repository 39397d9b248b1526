//! Making revisions: the one writer of a session, and the states that undo and redo lead to.

use super::{Change, KEPT_REVISIONS, Revision, Session, Snapshot};
use crate::error::{EngineError, Reason, Result};
use std::collections::VecDeque;
use std::sync::Arc;

/// How a session is to change.
#[derive(Debug, Clone, Copy)]
pub enum Edit<'a> {
    /// By changes of inputs, all or none.
    Changes(&'a [Change]),
    /// By taking the last change back.
    Undo,
    /// By taking the last undo back.
    Redo,
}

impl Edit<'_> {
    /// What changes, in the words of [`Change::name`], or `undo`, `redo`.
    pub fn names(&self) -> Vec<&'static str> {
        match self {
            Edit::Changes(changes) => changes.iter().map(Change::name).collect(),
            Edit::Undo => vec!["undo"],
            Edit::Redo => vec!["redo"],
        }
    }
}

impl Change {
    /// Name of the input that changes, for logs and for people.
    pub fn name(&self) -> &'static str {
        match self {
            Change::Mesh { .. } => "mesh",
            Change::Features(_) => "features",
            Change::Partition(_) => "partition",
            Change::Chart(_) => "charts",
            Change::PatchChart { .. } => "patch_chart",
            Change::PatchEdit(_) | Change::ResetPatchEdits => "patch_edits",
            Change::Size(_) => "size",
            Change::Lock(_) => "lock",
            Change::Mesher(_) => "mesher",
            Change::Anisotropic(_) => "anisotropic",
            Change::Optimize(_) => "optimize",
            Change::Rollback(_) => "rollback",
        }
    }
}

/// How far undo and redo reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Steps {
    /// Changes that can be undone.
    pub undo: usize,
    /// Undos that can be taken back.
    pub redo: usize,
}

/// The states that undo and redo lead to, the next one last. Bounded by [`KEPT_REVISIONS`] each.
#[derive(Debug, Default, Clone)]
pub(super) struct Stacks {
    undo: VecDeque<Arc<Snapshot>>,
    redo: Vec<Arc<Snapshot>>,
}

/// A revision that is about to be made.
#[derive(Debug)]
pub struct Pending {
    /// Its inputs.
    pub next: Arc<Snapshot>,
    /// Oldest revision that a rollback can name once it is made.
    pub oldest: Revision,
    /// Revisions whose inputs undo will lead to, the next one last.
    pub undo: Vec<Revision>,
    /// Revisions whose inputs redo will lead to, the next one last.
    pub redo: Vec<Revision>,
}

impl Pending {
    /// How far undo and redo will reach.
    pub fn steps(&self) -> Steps {
        Steps { undo: self.undo.len(), redo: self.redo.len() }
    }
}

impl Stacks {
    /// Stacks with these states, the next one last.
    pub(super) fn of(undo: Vec<Arc<Snapshot>>, redo: Vec<Arc<Snapshot>>) -> Self {
        Stacks { undo: undo.into(), redo }
    }

    /// The states of both, the next one last.
    pub(super) fn states(&self) -> (Vec<Arc<Snapshot>>, Vec<Arc<Snapshot>>) {
        (self.undo.iter().cloned().collect(), self.redo.clone())
    }

    /// All states, in no particular order.
    pub(super) fn all(&self) -> impl Iterator<Item = &Arc<Snapshot>> {
        self.undo.iter().chain(&self.redo)
    }

    fn steps(&self) -> Steps {
        Steps { undo: self.undo.len(), redo: self.redo.len() }
    }

    /// Where an edit that is no change of inputs leads.
    fn target(&self, edit: Edit<'_>) -> Result<Arc<Snapshot>> {
        let (found, what) = match edit {
            Edit::Redo => (self.redo.last(), "undone"),
            Edit::Undo | Edit::Changes(_) => (self.undo.back(), "changed"),
        };
        found.cloned().ok_or_else(|| {
            EngineError::new(Reason::NothingToStepTo, format!("nothing was {what} that could be taken back"))
                .with_hint("any revision that is kept can be had back by a rollback")
        })
    }

    /// Takes note of an edit that was made of `current`.
    fn note(&mut self, edit: Edit<'_>, current: Arc<Snapshot>) {
        match edit {
            Edit::Undo => {
                self.undo.pop_back();
                self.redo.push(current);
                return;
            }
            Edit::Redo => drop(self.redo.pop()),
            Edit::Changes(_) => self.redo.clear(),
        }
        self.undo.push_back(current);
        if self.undo.len() > KEPT_REVISIONS {
            self.undo.pop_front();
        }
    }
}

impl Session {
    /// Makes a revision. With `base`, only if that is still the current one. `commit` sees it before it is there; if that fails nothing has
    /// changed. `made` is called when it is there. Both are called in the order of revisions; readers do not wait meanwhile, other writers do.
    ///
    /// # Errors
    /// [`Reason::StaleRevision`] with the current revision as metadata, [`Reason::NothingToStepTo`], those of [`Session::apply`] and those
    /// of `commit`.
    pub fn edit(
        &self,
        base: Option<Revision>,
        edit: Edit<'_>,
        commit: impl FnOnce(&Pending) -> Result<()>,
        made: impl FnOnce(&Pending),
    ) -> Result<Revision> {
        let _writer = self.writer.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let (pending, steps) = self.pending(base, edit)?;
        commit(&pending)?;
        let mut state = self.lock();
        state.steps = steps;
        state.history.push_back(pending.next.clone());
        while state.history.len() > KEPT_REVISIONS {
            state.history.pop_front();
        }
        drop(state);
        made(&pending);
        Ok(pending.next.revision)
    }

    /// What an edit would make.
    fn pending(&self, base: Option<Revision>, edit: Edit<'_>) -> Result<(Pending, Stacks)> {
        let state = self.lock();
        let current = state.history.back().expect("history is never empty").clone();
        if let Some(base) = base.filter(|&base| base != current.revision) {
            let message = format!("the change is based on revision {}, the session is at {}", base.0, current.revision.0);
            return Err(EngineError::new(Reason::StaleRevision, message)
                .with_hint("read the session again and repeat the change on its current revision")
                .with_metadata("base_revision", base.0)
                .with_metadata("current_revision", current.revision.0));
        }
        let mut next = match edit {
            Edit::Changes(changes) => Session::changed(&state, &current, changes)?,
            Edit::Undo | Edit::Redo => Snapshot::clone(&*state.steps.target(edit)?),
        };
        next.revision = Revision(current.revision.0 + 1);
        let mut steps = state.steps.clone();
        steps.note(edit, current);
        let dropped = (state.history.len() + 1).saturating_sub(KEPT_REVISIONS);
        let oldest = state.history.get(dropped).map_or(next.revision, |snapshot| snapshot.revision);
        let revisions = |states: &mut dyn Iterator<Item = &Arc<Snapshot>>| states.map(|s| s.revision).collect();
        let (undo, redo) = (revisions(&mut steps.undo.iter()), revisions(&mut steps.redo.iter()));
        Ok((Pending { next: Arc::new(next), oldest, undo, redo }, steps))
    }

    /// How far undo and redo reach.
    pub fn steps(&self) -> Steps {
        self.lock().steps.steps()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sizing::SizeSpec;
    use std::time::{Duration, SystemTime};

    fn session() -> Session {
        Session::new("s".into(), Duration::from_secs(60), SystemTime::UNIX_EPOCH)
    }

    fn size(size: f64) -> [Change; 1] {
        [Change::Size(SizeSpec::Uniform { size })]
    }

    fn step(session: &Session, edit: Edit<'_>) -> Option<f64> {
        session.edit(None, edit, |_| Ok(()), |_| ()).unwrap();
        match session.snapshot().size {
            Some(SizeSpec::Uniform { size }) => Some(size),
            _ => None,
        }
    }

    #[test]
    fn undo_and_redo_walk_the_states_as_an_editor_does() {
        let session = session();
        for n in 1..=3 {
            session.apply(None, &size(f64::from(n))).unwrap();
        }
        let walk = [Edit::Undo, Edit::Undo, Edit::Redo, Edit::Undo, Edit::Undo].map(|edit| step(&session, edit));
        assert_eq!(walk, [Some(2.0), Some(1.0), Some(2.0), Some(1.0), None]);
        assert_eq!(session.steps(), Steps { undo: 0, redo: 3 });
        let none = session.edit(None, Edit::Undo, |_| Ok(()), |_| ()).unwrap_err();
        assert_eq!((none.reason(), session.revision()), (Reason::NothingToStepTo, Revision(8)), "every step makes a revision");
        assert_eq!([Edit::Redo; 3].map(|edit| step(&session, edit)), [Some(1.0), Some(2.0), Some(3.0)]);
        step(&session, Edit::Undo);
        assert_eq!(step(&session, Edit::Changes(&size(9.0))), Some(9.0));
        assert_eq!(session.steps(), Steps { undo: 3, redo: 0 }, "a change forgets what could be redone");
        assert_eq!(step(&session, Edit::Undo), Some(2.0));
    }

    #[test]
    fn undo_reaches_as_far_as_it_says_and_no_further() {
        let session = session();
        for n in 0..3 * KEPT_REVISIONS {
            session.apply(None, &size((n + 1) as f64)).unwrap();
        }
        assert_eq!(session.steps().undo, KEPT_REVISIONS);
        for n in 0..KEPT_REVISIONS {
            assert_eq!(step(&session, Edit::Undo), Some((3 * KEPT_REVISIONS - 1 - n) as f64));
        }
        assert_eq!(session.edit(None, Edit::Undo, |_| Ok(()), |_| ()).unwrap_err().reason(), Reason::NothingToStepTo);
    }

    #[test]
    fn a_commit_that_fails_leaves_the_session_as_it_was() {
        let session = session();
        session.apply(None, &size(1.0)).unwrap();
        let full = |_: &Pending| Err(EngineError::new(Reason::LimitReached, "disk full"));
        for edit in [Edit::Changes(&size(2.0)), Edit::Undo] {
            assert_eq!(session.edit(None, edit, full, |_| panic!("not made")).unwrap_err().reason(), Reason::LimitReached);
            assert_eq!((session.revision(), session.steps()), (Revision(1), Steps { undo: 1, redo: 0 }));
        }
    }
}
