//! What a long computation is given besides its inputs: a way to be stopped and a way to tell how far it is.

use crate::error::{EngineError, Reason, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A flag that stops work at its next checkpoint; clones share the flag. Optionally carries a deadline.
#[derive(Debug, Clone, Default)]
pub struct CancelToken {
    flag: Arc<AtomicBool>,
    deadline: Option<Instant>,
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

    /// A checkpoint: `Err` once cancelled.
    #[inline]
    pub fn check(&self) -> Result<()> {
        self.cancel.check()
    }

    /// A checkpoint that also tells that `done` of `total` units are done.
    pub fn step(&self, done: usize, total: usize) -> Result<()> {
        self.cancel.check()?;
        (self.progress)(done as f64 / total.max(1) as f64);
        Ok(())
    }
}
