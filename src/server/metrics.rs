//! Numbers for Prometheus: stages, calls, caches, queue. Told as text on a port of their own, beside liveness and readiness.

mod http;
mod text;

pub(crate) use http::serve_metrics;

use remesh_engine::pipeline::{Event, Progress};
use remesh_engine::stage::{Outcome, Stage};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Upper bounds of the classes of durations, in seconds.
const BOUNDS: [f64; 9] = [0.001, 0.005, 0.025, 0.1, 0.5, 2.5, 10.0, 60.0, 300.0];

/// Durations in classes.
#[derive(Debug, Clone, Default, PartialEq)]
struct Histogram {
    /// Of each class, the last without a bound.
    counts: [u64; BOUNDS.len() + 1],
    sum: f64,
}

impl Histogram {
    fn add(&mut self, seconds: f64) {
        self.counts[BOUNDS.partition_point(|&bound| bound < seconds)] += 1;
        self.sum += seconds;
    }

    fn count(&self) -> u64 {
        self.counts.iter().sum()
    }
}

#[derive(Debug, Default)]
struct Tables {
    /// Times of stages that ran.
    stages: BTreeMap<&'static str, Histogram>,
    /// Outputs of stages that were found in the cache.
    hits: BTreeMap<&'static str, u64>,
    /// Times of calls by method and status code.
    calls: BTreeMap<(&'static str, &'static str), Histogram>,
    /// Revisions by what changed.
    revisions: BTreeMap<&'static str, u64>,
}

/// What has happened since the server started.
#[derive(Debug, Default)]
pub(crate) struct Metrics {
    tables: Mutex<Tables>,
    upload_bytes: AtomicU64,
    unauthenticated: AtomicU64,
}

impl Metrics {
    fn tables(&self) -> MutexGuard<'_, Tables> {
        self.tables.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes an event of the engine, from any thread.
    pub(crate) fn on(&self, event: &Event) {
        let Progress::Finished(record) = event.progress else { return };
        let name = Stage::name(record.stage);
        let mut tables = self.tables();
        match record.outcome {
            Outcome::Run => tables.stages.entry(name).or_default().add(record.milliseconds * 1e-3),
            Outcome::Hit => *tables.hits.entry(name).or_default() += 1,
        }
    }

    /// A call has ended.
    pub(crate) fn call(&self, method: &'static str, code: &'static str, milliseconds: f64) {
        self.tables().calls.entry((method, code)).or_default().add(milliseconds * 1e-3);
    }

    /// A session has a new revision.
    pub(crate) fn revision(&self, changes: &[&'static str]) {
        let mut tables = self.tables();
        changes.iter().for_each(|name| *tables.revisions.entry(name).or_default() += 1);
    }

    /// Bytes of an upload have come.
    pub(crate) fn uploaded(&self, bytes: usize) {
        self.upload_bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// A call was refused for want of a name.
    pub(crate) fn unauthenticated(&self) {
        self.unauthenticated.fetch_add(1, Ordering::Relaxed);
    }
}
