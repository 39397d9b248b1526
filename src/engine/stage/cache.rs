//! A cache of stage outputs: bounded in bytes, evicting by cost per byte, one computation per key at a time.

use super::{CostModel, Outcome, StageKey};
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Fingerprint};
use crate::work::CancelToken;
use std::any::Any;
use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// An output with its fingerprint. Holding it is a lease: the cache does not evict what somebody holds.
#[derive(Debug)]
pub struct Stored<T> {
    /// The output.
    pub value: Arc<T>,
    /// Fingerprint of the output: equal outputs of different inputs are equal downstream.
    pub output: Fingerprint,
    /// Its size in memory.
    pub bytes: usize,
}

impl<T> Clone for Stored<T> {
    fn clone(&self) -> Self {
        Stored { value: self.value.clone(), output: self.output, bytes: self.bytes }
    }
}

impl<T> std::ops::Deref for Stored<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

/// What the cache holds and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CacheUsage {
    /// Bytes held.
    pub bytes: u64,
    /// Bytes allowed.
    pub budget_bytes: u64,
    /// Outputs held.
    pub entries: u64,
    /// Requests answered from the cache.
    pub hits: u64,
    /// Requests computed.
    pub runs: u64,
    /// Outputs evicted.
    pub evictions: u64,
}

struct Entry {
    value: Arc<dyn Any + Send + Sync>,
    output: Fingerprint,
    bytes: usize,
    /// Nanoseconds of computation saved per byte held.
    worth: f64,
    /// Place in the eviction order: clock at last use plus `worth` (the GreedyDual-Size rule, which ages what is not used).
    priority: f64,
}

enum Slot {
    Computing,
    Ready(Entry),
}

/// A number that is ordered totally.
#[derive(Clone, Copy)]
struct Priority(f64);

impl PartialEq for Priority {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Priority {}

impl PartialOrd for Priority {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Priority {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[derive(Default)]
struct State {
    slots: HashMap<StageKey, Slot>,
    order: BTreeSet<(Priority, StageKey)>,
    clock: f64,
    usage: CacheUsage,
}

/// The cache. Shared by all sessions: keys are contents, so equal work is done once for everybody.
pub struct StageCache {
    /// What stages cost, for plans.
    pub costs: CostModel,
    state: Mutex<State>,
    changed: Condvar,
}

impl std::fmt::Debug for StageCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StageCache").field("usage", &self.usage()).finish()
    }
}

/// Removes the mark of a computation that did not end well, so that waiters take over.
struct Claim<'a> {
    cache: &'a StageCache,
    key: StageKey,
    finished: bool,
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        if !self.finished {
            self.cache.lock().slots.remove(&self.key);
        }
        self.cache.changed.notify_all();
    }
}

/// How often a waiter looks whether its own caller went away.
const WAIT_SLICE: Duration = Duration::from_millis(10);

impl StageCache {
    /// An empty cache that holds at most `budget_bytes`, leases apart.
    pub fn new(budget_bytes: usize) -> Self {
        let usage = CacheUsage { budget_bytes: budget_bytes as u64, ..CacheUsage::default() };
        StageCache { costs: CostModel::default(), state: Mutex::new(State { usage, ..State::default() }), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is consistent between statements; a panic elsewhere does not spoil it.
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// What is held.
    pub fn usage(&self) -> CacheUsage {
        self.lock().usage
    }

    /// Brings the cache back under its budget after leases have ended. New outputs do so too; this is for quiet times.
    pub fn trim(&self) {
        self.lock().evict();
    }

    /// The output under a key, if it is ready.
    pub fn peek<T: Any + Send + Sync>(&self, key: &StageKey) -> Option<Stored<T>> {
        let mut state = self.lock();
        take_ready(&mut state, key)
    }

    /// The output under a key, if it is ready; counted as a hit.
    pub fn hit<T: Any + Send + Sync>(&self, key: &StageKey) -> Option<Stored<T>> {
        let mut state = self.lock();
        let found = take_ready(&mut state, key)?;
        state.usage.hits += 1;
        Some(found)
    }

    /// The output under a key: from the cache, by waiting for whoever computes it, or by computing it.
    /// Failed and cancelled computations leave nothing behind; if the computation waited for fails, the waiter computes itself.
    ///
    /// # Errors
    /// What `compute` returns, or the cancellation of the waiting caller.
    pub fn get_or_compute<T: Contents + Any + Send + Sync>(
        &self,
        key: StageKey,
        cancel: &CancelToken,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<(Stored<T>, Outcome)> {
        let mut state = self.lock();
        loop {
            if let Some(stored) = take_ready(&mut state, &key) {
                state.usage.hits += 1;
                return Ok((stored, Outcome::Hit));
            }
            match state.slots.get(&key) {
                Some(Slot::Computing) => {
                    // Whoever computes it must not pause for us.
                    let _aside = cancel.step_aside();
                    state = self.changed.wait_timeout(state, WAIT_SLICE).unwrap_or_else(|poisoned| poisoned.into_inner()).0;
                    cancel.check()?;
                }
                Some(Slot::Ready(_)) => return Err(EngineError::invariant(format!("{key:?} holds another type"))),
                None => break,
            }
        }
        state.slots.insert(key, Slot::Computing);
        drop(state);
        let mut claim = Claim { cache: self, key, finished: false };
        let begin = Instant::now();
        let value = compute()?;
        let nanos = begin.elapsed().as_nanos() as u64;
        let stored = Stored { output: value.fingerprint(), bytes: value.bytes(), value: Arc::new(value) };
        self.lock().keep(key, &stored, nanos);
        claim.finished = true;
        Ok((stored, Outcome::Run))
    }
}

fn take_ready<T: Any + Send + Sync>(state: &mut State, key: &StageKey) -> Option<Stored<T>> {
    let clock = state.clock;
    let Some(Slot::Ready(entry)) = state.slots.get_mut(key) else { return None };
    let value = entry.value.clone().downcast::<T>().ok()?;
    let stored = Stored { value, output: entry.output, bytes: entry.bytes };
    let before = entry.priority;
    entry.priority = clock + entry.worth;
    let after = entry.priority;
    state.order.remove(&(Priority(before), *key));
    state.order.insert((Priority(after), *key));
    Some(stored)
}

impl State {
    fn keep<T: Any + Send + Sync>(&mut self, key: StageKey, stored: &Stored<T>, nanos: u64) {
        self.usage.runs += 1;
        let worth = nanos as f64 / stored.bytes.max(1) as f64;
        let priority = self.clock + worth;
        let entry = Entry { value: stored.value.clone(), output: stored.output, bytes: stored.bytes, worth, priority };
        self.slots.insert(key, Slot::Ready(entry));
        self.order.insert((Priority(priority), key));
        self.usage.bytes += stored.bytes as u64;
        self.usage.entries += 1;
        self.evict();
    }

    /// Drops what saves least until the budget holds; leased outputs stay. O(dropped + leased).
    fn evict(&mut self) {
        let mut excess = self.usage.bytes.saturating_sub(self.usage.budget_bytes);
        let mut victims = Vec::new();
        for &(priority, key) in &self.order {
            if excess == 0 {
                break;
            }
            if let Some(Slot::Ready(entry)) = self.slots.get(&key)
                && Arc::strong_count(&entry.value) == 1
            {
                victims.push((priority, key, entry.bytes as u64));
                excess = excess.saturating_sub(entry.bytes as u64);
            }
        }
        for (priority, key, bytes) in victims {
            self.clock = self.clock.max(priority.0);
            self.slots.remove(&key);
            self.order.remove(&(priority, key));
            self.usage.bytes -= bytes;
            self.usage.entries -= 1;
            self.usage.evictions += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Reason;
    use crate::fingerprint::Feeder;
    use crate::stage::Stage;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[derive(Debug, PartialEq)]
    struct Blob(u64, usize);
    impl Contents for Blob {
        fn feed(&self, into: &mut Feeder) {
            into.u64(self.0);
        }
        fn bytes(&self) -> usize {
            self.1
        }
    }

    fn key(n: u64) -> StageKey {
        StageKey::new(Stage::Chart, |f| {
            f.u64(n);
        })
    }

    #[test]
    fn second_request_hits_and_failures_leave_nothing() {
        let cache = StageCache::new(1000);
        let cancel = CancelToken::new();
        let failed = cache.get_or_compute::<Blob>(key(1), &cancel, || Err(EngineError::new(Reason::Cancelled, "x")));
        assert!(failed.is_err());
        assert_eq!(cache.usage().entries, 0);
        let (first, outcome) = cache.get_or_compute(key(1), &cancel, || Ok(Blob(7, 10))).unwrap();
        assert_eq!(outcome, Outcome::Run);
        let (second, outcome) = cache.get_or_compute(key(1), &cancel, || Ok(Blob(8, 10))).unwrap();
        assert_eq!((outcome, &*second), (Outcome::Hit, &Blob(7, 10)));
        assert_eq!(first.output, second.output);
    }

    #[test]
    fn a_panic_leaves_nothing_and_the_next_caller_computes() {
        let cache = StageCache::new(1000);
        let cancel = CancelToken::new();
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let _ = cache.get_or_compute::<Blob>(key(1), &cancel, || panic!("boom"));
        }));
        assert!(panicked.is_err());
        assert_eq!(cache.get_or_compute(key(1), &cancel, || Ok(Blob(1, 1))).unwrap().1, Outcome::Run);
    }

    #[test]
    fn the_budget_holds_and_leases_are_not_evicted() {
        let cache = StageCache::new(100);
        let cancel = CancelToken::new();
        let leased = cache.get_or_compute(key(0), &cancel, || Ok(Blob(0, 60))).unwrap().0;
        for n in 1..20 {
            cache.get_or_compute(key(n), &cancel, || Ok(Blob(n, 30))).unwrap();
        }
        assert!(cache.usage().bytes <= 100, "{:?}", cache.usage());
        assert!(cache.peek::<Blob>(&key(0)).is_some());
        drop(leased);
        for n in 20..40 {
            cache.get_or_compute(key(n), &cancel, || Ok(Blob(n, 30))).unwrap();
        }
        assert!(cache.peek::<Blob>(&key(0)).is_none(), "unused and cheap per byte: goes");
        assert!(cache.usage().evictions > 0);
    }

    #[test]
    fn what_is_dear_per_byte_stays_longer() {
        let cache = StageCache::new(100);
        let cancel = CancelToken::new();
        let slow = |n| {
            move || {
                std::thread::sleep(Duration::from_millis(30));
                Ok(Blob(n, 40))
            }
        };
        cache.get_or_compute(key(100), &cancel, slow(100)).unwrap();
        for n in 0..3 {
            cache.get_or_compute(key(n), &cancel, || Ok(Blob(n, 40))).unwrap();
        }
        assert!(cache.peek::<Blob>(&key(100)).is_some());
    }

    #[test]
    fn one_computation_per_key() {
        let cache = StageCache::new(1000);
        let cancel = CancelToken::new();
        let runs = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    cache.get_or_compute(key(5), &cancel, || {
                        runs.fetch_add(1, Ordering::Relaxed);
                        std::thread::sleep(Duration::from_millis(20));
                        Ok(Blob(5, 1))
                    })
                });
            }
        });
        assert_eq!(runs.into_inner(), 1);
    }

    #[test]
    fn a_cancelled_waiter_leaves_at_once() {
        let cache = StageCache::new(1000);
        let (never, cancelled) = (CancelToken::new(), CancelToken::new());
        cancelled.cancel();
        std::thread::scope(|scope| {
            let (begun, wait) = std::sync::mpsc::channel();
            let cache = &cache;
            scope.spawn(move || {
                cache.get_or_compute(key(1), &never, || {
                    begun.send(()).expect("the test listens");
                    std::thread::sleep(Duration::from_millis(100));
                    Ok(Blob(1, 1))
                })
            });
            wait.recv().expect("the other thread sends");
            let error = cache.get_or_compute(key(1), &cancelled, || Ok(Blob(2, 1))).unwrap_err();
            assert_eq!(error.reason(), Reason::Cancelled);
        });
    }
}
