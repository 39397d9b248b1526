//! How a request walks the stage graph: it executes stages through the cache, or only looks at what is cached.

use super::Answer;
use crate::engine::Engine;
use crate::error::{EngineError, Result};
use crate::fingerprint::Contents;
use crate::parallel::map_indices;
use crate::stage::cost::Sizes;
use crate::stage::{Estimate, Outcome, Stage, StageKey, StageRecord, Stored, Subject};
use crate::work::{CancelToken, Work};
use std::any::Any;
use std::collections::HashSet;
use std::sync::{Mutex, MutexGuard};
use std::time::Instant;

/// How far a stage is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// It looks for its output or waits for it.
    Started,
    /// Done share of a stage that is running.
    Fraction(f64),
    /// It is done.
    Finished(StageRecord),
}

/// Something a client may want to show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The stage.
    pub stage: Stage,
    /// What it works on.
    pub subject: Subject,
    /// How far it is.
    pub progress: Progress,
}

/// What a request brings besides its inputs.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// Stops it.
    pub cancel: &'a CancelToken,
    /// Hears of every stage, from any thread; must be quick.
    pub events: &'a (dyn Fn(&Event) + Sync),
    /// Most threads to use.
    pub threads: usize,
}

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run").field("cancel", &self.cancel).field("threads", &self.threads).finish_non_exhaustive()
    }
}

/// Why a walk of the graph does not go on.
#[derive(Debug)]
pub(super) enum Halt {
    /// Something failed.
    Error(EngineError),
    /// Planning: the output is not cached, so what depends on it is not known.
    Unknown,
}

impl From<EngineError> for Halt {
    fn from(error: EngineError) -> Self {
        Halt::Error(error)
    }
}

pub(super) type Step<T> = std::result::Result<T, Halt>;

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Execute,
    Plan,
}

/// One walk of the stage graph.
pub(super) struct Context<'a> {
    engine: &'a Engine,
    run: &'a Run<'a>,
    mode: Mode,
    records: Mutex<Vec<StageRecord>>,
    /// How large things are, as far as the walk knows by now.
    sizes: Mutex<Sizes>,
}

impl<'a> Context<'a> {
    /// Carries out `steps`.
    pub(super) fn execute<T>(engine: &'a Engine, run: &'a Run<'a>, steps: impl FnOnce(&Self) -> Step<T>) -> Result<Answer<T>> {
        let context = Context { engine, run, mode: Mode::Execute, records: Mutex::default(), sizes: Mutex::default() };
        match steps(&context) {
            Ok(value) => Ok(Answer { value, records: context.into_records() }),
            Err(Halt::Error(error)) => Err(error),
            Err(Halt::Unknown) => Err(EngineError::invariant("an output was unknown outside of planning")),
        }
    }

    /// Walks as far as outputs are cached.
    pub(super) fn plan(engine: &'a Engine, run: &'a Run<'a>, steps: impl FnOnce(&Self) -> Step<()>) -> Result<Vec<StageRecord>> {
        let context = Context { engine, run, mode: Mode::Plan, records: Mutex::default(), sizes: Mutex::default() };
        match steps(&context) {
            Ok(()) | Err(Halt::Unknown) => Ok(context.into_records()),
            Err(Halt::Error(error)) => Err(error),
        }
    }

    fn into_records(self) -> Vec<StageRecord> {
        let mut records = self.records.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        // Threads finish in any order; a stage that runs in rounds keeps the order of its rounds.
        records.sort_by_key(|r| (r.stage, r.subject));
        // A factor that two stages of a chart ask for is one.
        let shared = |r: &StageRecord| r.outcome == Outcome::Hit && matches!(r.stage, Stage::System | Stage::Factor | Stage::Boundary);
        let same = |a: &StageRecord, b: &StageRecord| (a.stage, a.subject, a.bytes) == (b.stage, b.subject, b.bytes);
        records.dedup_by(|later, first| shared(later) && same(later, first));
        records
    }

    fn lock_records(&self) -> MutexGuard<'_, Vec<StageRecord>> {
        self.records.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn record(&self, record: StageRecord) {
        self.lock_records().push(record);
    }

    /// Passes a halt on; if it is one of a plan, notes what lies below it and was not looked at as going to run.
    pub(super) fn and_below(&self, halt: Halt, surface: &[Stage], items: &[(Stage, Subject)]) -> Halt {
        if matches!(halt, Halt::Unknown) {
            let seen: HashSet<(Stage, Subject)> = self.lock_records().iter().map(|r| (r.stage, r.subject)).collect();
            let whole = surface.iter().map(|&stage| (stage, Subject::Surface));
            for (stage, subject) in whole.chain(items.iter().copied()).filter(|item| !seen.contains(item)) {
                self.record(self.planned_record(stage, subject, None));
            }
        }
        halt
    }

    /// Tells the walk how large something is, for estimates and what is learnt from runs.
    pub(super) fn note_sizes(&self, note: impl FnOnce(&mut Sizes)) {
        note(&mut self.sizes.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
    }

    fn units(&self, stage: Stage, subject: Subject) -> f64 {
        self.sizes.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).units(stage, subject)
    }

    /// What a plan tells of a stage whose output is cached with so many bytes, or will run.
    fn planned_record(&self, stage: Stage, subject: Subject, hit: Option<u64>) -> StageRecord {
        if let Some(bytes) = hit {
            return StageRecord { stage, subject, outcome: Outcome::Hit, milliseconds: 0.0, bytes };
        }
        let Estimate { milliseconds, bytes } = self.engine.cache.costs.estimate(stage, self.units(stage, subject));
        StageRecord { stage, subject, outcome: Outcome::Run, milliseconds, bytes: bytes as u64 }
    }

    /// A stage whose inputs are stages too: they are looked at only if its own output is not cached. A plan that does not find the
    /// output looks at the inputs and goes no further.
    pub(super) fn staged<I, T: Contents + Any + Send + Sync>(
        &self,
        key: StageKey,
        subject: Subject,
        inputs: impl FnOnce() -> Step<I>,
        compute: impl FnOnce(I, &Work<'_>) -> Result<T>,
    ) -> Step<Stored<T>> {
        let begin = Instant::now();
        if let Some(found) = self.found::<T>(&key) {
            let milliseconds = if self.mode == Mode::Plan { 0.0 } else { begin.elapsed().as_secs_f64() * 1e3 };
            self.finished(StageRecord { stage: key.stage, subject, outcome: Outcome::Hit, milliseconds, bytes: found.bytes as u64 });
            return Ok(found);
        }
        match inputs() {
            Ok(inputs) => self.stage(key, subject, |work| compute(inputs, work)),
            Err(Halt::Unknown) => {
                self.record(self.planned_record(key.stage, subject, None));
                Err(Halt::Unknown)
            }
            Err(halt) => Err(halt),
        }
    }

    /// What is cached under a key; a hit if the request is carried out.
    fn found<T: Any + Send + Sync>(&self, key: &StageKey) -> Option<Stored<T>> {
        match self.mode {
            Mode::Plan => self.engine.cache.peek(key),
            Mode::Execute => self.engine.cache.hit(key),
        }
    }

    fn finished(&self, record: StageRecord) {
        self.record(record);
        if self.mode == Mode::Execute {
            (self.run.events)(&Event { stage: record.stage, subject: record.subject, progress: Progress::Finished(record) });
        }
    }

    /// One stage through the cache.
    pub(super) fn stage<T: Contents + Any + Send + Sync>(
        &self,
        key: StageKey,
        subject: Subject,
        compute: impl FnOnce(&Work<'_>) -> Result<T>,
    ) -> Step<Stored<T>> {
        let stage = key.stage;
        if self.mode == Mode::Plan {
            let found = self.engine.cache.peek::<T>(&key);
            self.record(self.planned_record(stage, subject, found.as_ref().map(|f| f.bytes as u64)));
            return found.ok_or(Halt::Unknown);
        }
        self.run.cancel.check()?;
        let span = tracing::info_span!("stage", stage = stage.name(), subject = ?subject);
        let _entered = span.enter();
        (self.run.events)(&Event { stage, subject, progress: Progress::Started });
        let begin = Instant::now();
        let fraction = |done: f64| (self.run.events)(&Event { stage, subject, progress: Progress::Fraction(done) });
        let work = Work::new(self.run.cancel, &fraction);
        let computed = self.engine.cache.get_or_compute(key, self.run.cancel, || compute(&work));
        let (stored, outcome) = computed.inspect_err(|error| tracing::debug!(reason = error.reason().code(), "stage failed"))?;
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        let record = StageRecord { stage, subject, outcome, milliseconds, bytes: stored.bytes as u64 };
        if outcome == Outcome::Run {
            self.engine.cache.costs.learn(stage, self.units(stage, subject), Estimate { milliseconds, bytes: stored.bytes as f64 });
        }
        tracing::debug!(hit = outcome == Outcome::Hit, milliseconds, bytes = record.bytes, "stage done");
        self.finished(record);
        Ok(stored)
    }

    /// The same step for many items, in parallel; results by increasing index. A plan visits every item even if some are unknown.
    pub(super) fn each<T: Send>(&self, order: &[usize], step: impl Fn(usize) -> Step<T> + Sync) -> Step<Vec<T>> {
        let threads = if self.mode == Mode::Plan { 1 } else { self.run.threads };
        let results = map_indices(threads, order, |i| match step(i) {
            Ok(value) => Ok(Some(value)),
            Err(Halt::Unknown) => Ok(None),
            Err(Halt::Error(error)) => Err(error),
        })?;
        results.into_iter().collect::<Option<Vec<T>>>().ok_or(Halt::Unknown)
    }
}
