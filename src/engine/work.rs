//! What a long computation is given besides its inputs: a way to be stopped, a way to tell how far it is, and a way to let others pass.

use crate::error::{EngineError, Reason, Result};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Where batch work lets urgent work pass: it pauses at its checkpoints while urgent work computes. Clones share the gate.
///
/// Nobody waits for ever: a pause ends after [`LONGEST_PAUSE`], is followed by at least [`LEAST_TURN`] of work, and there is none while urgent
/// work itself waits for an output that batch work may be computing.
#[derive(Debug, Clone, Default)]
pub struct Gate(Arc<GateState>);

#[derive(Debug, Default)]
struct GateState {
    /// Urgent computations that are on.
    urgent: AtomicUsize,
    /// Threads of theirs that wait for an output.
    waiting: AtomicUsize,
    lock: Mutex<()>,
    changed: Condvar,
}

/// Longest time that batch work stands still in one go.
pub const LONGEST_PAUSE: Duration = Duration::from_millis(500);
/// Shortest time that it then computes before it pauses again.
pub const LEAST_TURN: Duration = Duration::from_millis(50);
/// How often paused work looks whether it is cancelled.
const PAUSE_SLICE: Duration = Duration::from_millis(5);

impl GateState {
    fn must_wait(&self) -> bool {
        self.urgent.load(Ordering::Relaxed) > 0 && self.waiting.load(Ordering::Relaxed) == 0
    }

    fn tell(&self) {
        self.changed.notify_all();
    }
}

/// An urgent computation, from its begin to its drop.
#[derive(Debug)]
pub struct Urgent(Arc<GateState>);

impl Drop for Urgent {
    fn drop(&mut self) {
        self.0.urgent.fetch_sub(1, Ordering::Relaxed);
        self.0.tell();
    }
}

impl Gate {
    /// Begins an urgent computation.
    pub fn enter(&self) -> Urgent {
        self.0.urgent.fetch_add(1, Ordering::Relaxed);
        Urgent(self.0.clone())
    }
}

/// While it lives, an urgent thread waits for what others compute.
#[derive(Debug)]
pub struct Aside<'a>(&'a GateState);

impl Drop for Aside<'_> {
    fn drop(&mut self) {
        self.0.waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What a computation is to the gate.
#[derive(Debug, Clone, Default)]
enum Side {
    #[default]
    None,
    Urgent(Gate),
    Batch(Gate, Arc<Mutex<Option<Instant>>>),
}

/// A flag that stops work at its next checkpoint; clones share the flag. Optionally carries a deadline and a side of a [`Gate`].
#[derive(Debug, Clone, Default)]
pub struct CancelToken {
    flag: Arc<AtomicBool>,
    deadline: Option<Instant>,
    side: Side,
}

impl CancelToken {
    /// A token that nobody has cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same flag, with a point in time after which work stops too.
    pub fn with_deadline(mut self, deadline: Instant) -> Self {
        self.deadline = Some(deadline);
        self
    }

    /// The same flag, for work that lets urgent work pass.
    pub fn batch(mut self, gate: &Gate) -> Self {
        self.side = Side::Batch(gate.clone(), Arc::default());
        self
    }

    /// The same flag, for urgent work. Between [`Gate::enter`] and the drop of what it gives batch work pauses.
    pub fn urgent(mut self, gate: &Gate) -> Self {
        self.side = Side::Urgent(gate.clone());
        self
    }

    /// Asks all work under this token to stop.
    pub fn cancel(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    /// `Err` once cancelled or past the deadline.
    #[inline]
    pub fn check(&self) -> Result<()> {
        if self.flag.load(Ordering::Relaxed) {
            return Err(EngineError::new(Reason::Cancelled, "the work was cancelled"));
        }
        if self.deadline.is_some_and(|at| Instant::now() > at) {
            return Err(EngineError::new(Reason::DeadlineExceeded, "the deadline passed before the work was done"));
        }
        Ok(())
    }

    /// Told by a thread that is about to wait for an output: batch work may be computing it, so it must not pause.
    pub fn step_aside(&self) -> Option<Aside<'_>> {
        let Side::Urgent(gate) = &self.side else { return None };
        gate.0.waiting.fetch_add(1, Ordering::Relaxed);
        gate.0.tell();
        Some(Aside(&gate.0))
    }

    /// Pauses batch work while urgent work computes. Never called with a lock held.
    #[inline]
    fn give_way(&self) -> Result<()> {
        match &self.side {
            Side::Batch(gate, turn) if gate.0.must_wait() => self.pause(&gate.0, turn),
            _ => Ok(()),
        }
    }

    #[cold]
    fn pause(&self, gate: &GateState, turn: &Mutex<Option<Instant>>) -> Result<()> {
        let begin = Instant::now();
        if turn.lock().unwrap_or_else(PoisonError::into_inner).is_some_and(|last| begin.duration_since(last) < LEAST_TURN) {
            return Ok(());
        }
        while gate.must_wait() {
            if begin.elapsed() >= LONGEST_PAUSE {
                *turn.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
                break;
            }
            self.check()?;
            let guard = gate.lock.lock().unwrap_or_else(PoisonError::into_inner);
            drop(gate.changed.wait_timeout(guard, PAUSE_SLICE).unwrap_or_else(PoisonError::into_inner));
        }
        Ok(())
    }
}

/// Cancellation and progress of one computation. Stage functions take `&Work` and call [`Work::check`] or
/// [`Work::step`] at least every few milliseconds.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    cancel: &'a CancelToken,
    progress: &'a (dyn Fn(f64) + Sync),
}

impl std::fmt::Debug for Work<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Work").field("cancel", &self.cancel).finish_non_exhaustive()
    }
}

impl<'a> Work<'a> {
    /// Work under a token; `progress` receives the done fraction, `0..=1`, from any thread.
    pub fn new(cancel: &'a CancelToken, progress: &'a (dyn Fn(f64) + Sync)) -> Self {
        Work { cancel, progress }
    }

    /// Work that reports to nobody but can be cancelled.
    pub fn silent(cancel: &'a CancelToken) -> Self {
        Work { cancel, progress: &|_| {} }
    }

    /// The token, to hand to nested work.
    pub fn cancel(&self) -> &'a CancelToken {
        self.cancel
    }

    /// A checkpoint: `Err` once cancelled. Batch work lets urgent work pass here.
    #[inline]
    pub fn check(&self) -> Result<()> {
        self.cancel.check()?;
        self.cancel.give_way()
    }

    /// A checkpoint that also tells that `done` of `total` units are done.
    pub fn step(&self, done: usize, total: usize) -> Result<()> {
        self.check()?;
        (self.progress)(done as f64 / total.max(1) as f64);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batch_work_stands_still_while_urgent_work_computes_but_can_be_cancelled() {
        let gate = Gate::default();
        let (batch, cancelled) = (CancelToken::new().batch(&gate), CancelToken::new().batch(&gate));
        let urgent = gate.enter();
        cancelled.cancel();
        assert_eq!(Work::silent(&cancelled).check().unwrap_err().reason(), Reason::Cancelled);
        let passed = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                Work::silent(&batch).check().unwrap();
                passed.store(true, Ordering::SeqCst);
            });
            std::thread::sleep(Duration::from_millis(20));
            assert!(!passed.load(Ordering::SeqCst), "it waits");
            drop(urgent);
        });
        assert!(passed.load(Ordering::SeqCst));
    }

    #[test]
    fn pauses_end_and_are_followed_by_a_turn_and_none_is_made_for_work_that_waits() {
        let gate = Gate::default();
        let _urgent = gate.enter();
        let batch = CancelToken::new().batch(&gate);
        let begin = Instant::now();
        Work::silent(&batch).check().unwrap();
        assert!(begin.elapsed() >= LONGEST_PAUSE, "a pause of its own length, though urgent work never ends");
        Work::silent(&batch).check().unwrap();
        let fresh = CancelToken::new().batch(&gate);
        let urgent = CancelToken::new().urgent(&gate);
        let _aside = urgent.step_aside();
        Work::silent(&fresh).check().unwrap();
        Work::silent(&urgent).check().unwrap();
        assert!(CancelToken::new().step_aside().is_none() && fresh.step_aside().is_none());
    }
}
