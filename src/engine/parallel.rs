//! Running independent items on a few threads. The only place in the engine that starts threads; stage functions never do.

use crate::error::Result;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Applies `f` to every index in `order` on up to `threads` threads and gives the results by index. Which thread does what
/// does not change results; after the first error no new item is begun, and of the errors seen the one of the lowest index is returned.
///
/// # Errors
/// What `f` returns.
///
/// # Panics
/// A panic of `f` is passed on to the caller.
pub fn map_indices<T: Send>(threads: usize, order: &[usize], f: impl Fn(usize) -> Result<T> + Sync) -> Result<Vec<T>> {
    let count = order.len();
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let done: Mutex<Vec<(usize, Result<T>)>> = Mutex::new(Vec::with_capacity(count));
    let worker = || {
        while !failed.load(Ordering::Relaxed) {
            let Some(&index) = order.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
            let result = f(index);
            if result.is_err() {
                failed.store(true, Ordering::Relaxed);
            }
            done.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((index, result));
        }
    };
    let extra = threads.min(count).saturating_sub(1);
    if extra == 0 {
        worker();
    } else {
        std::thread::scope(|scope| {
            let handles: Vec<_> = (0..extra).map(|_| scope.spawn(worker)).collect();
            worker();
            for handle in handles {
                if let Err(panic) = handle.join() {
                    std::panic::resume_unwind(panic);
                }
            }
        });
    }
    let mut done = done.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{EngineError, Reason};

    #[test]
    fn results_come_by_index_whatever_the_order_and_threads() {
        for threads in [1, 2, 7] {
            let order: Vec<usize> = (0..100).rev().collect();
            let squares = map_indices(threads, &order, |i| Ok(i * i)).unwrap();
            assert_eq!(squares, (0..100).map(|i| i * i).collect::<Vec<_>>());
        }
        assert!(map_indices(3, &[], |_| Ok(())).unwrap().is_empty());
    }

    #[test]
    fn an_error_stops_the_rest() {
        let begun = AtomicUsize::new(0);
        let order: Vec<usize> = (0..1000).collect();
        let error = map_indices(1, &order, |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i == 10 { Err(EngineError::new(Reason::Cancelled, "stop")) } else { Ok(()) }
        });
        assert_eq!(error.unwrap_err().reason(), Reason::Cancelled);
        assert_eq!(begun.into_inner(), 11);
    }
}
