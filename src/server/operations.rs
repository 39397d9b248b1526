//! The operations of a session: long work that outlives the call that started it.

use crate::config::Clock;
use crate::convert::to_proto;
use crate::status::{Fault, Told};
use remesh_engine::work::CancelToken;
use remesh_proto::v1;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;
use v1::operation::Outcome;

/// Operations that are kept after their end.
const KEPT: usize = 64;
/// Operations of a session that run at a time.
pub(crate) const MOST_RUNNING: usize = 16;

/// One operation.
#[derive(Debug)]
pub(crate) struct Operation {
    number: u64,
    token: CancelToken,
    /// As it is told, without the session in its name; every change is seen by those who wait.
    state: watch::Sender<v1::Operation>,
    clock: Clock,
}

/// The operations of a session.
#[derive(Debug, Default)]
pub(crate) struct Operations(Mutex<List>);

#[derive(Debug, Default)]
struct List {
    last: u64,
    all: Vec<Arc<Operation>>,
}

fn is_running(operation: &v1::Operation) -> bool {
    operation.state() == v1::OperationState::Running
}

impl Operation {
    /// The operation as it is told of a session.
    pub(crate) fn told(&self, session: &str) -> v1::Operation {
        let mut told = self.state.borrow().clone();
        told.name = format!("{session}/operations/{}", self.number);
        told
    }

    /// Takes progress over.
    pub(crate) fn progress(&self, progress: v1::Progress) {
        self.state.send_modify(|state| state.progress = Some(progress));
    }

    /// Stops it at its next checkpoint.
    pub(crate) fn cancel(&self) {
        self.token.cancel();
    }

    /// Ends it.
    pub(crate) fn end(&self, result: Result<Outcome, Fault>) {
        let time = Some(to_proto::time(self.clock.now()));
        self.state.send_modify(|state| {
            state.end_time = time;
            let (kind, outcome) = match result {
                Ok(outcome) => (v1::OperationState::Succeeded, outcome),
                Err(fault) => {
                    let Told { code, reason, message } = Told::of(&fault);
                    let kind = if reason == "CANCELLED" { v1::OperationState::Cancelled } else { v1::OperationState::Failed };
                    (kind, Outcome::Error(v1::OperationError { code, reason, message }))
                }
            };
            (state.state, state.outcome) = (kind.into(), Some(outcome));
        });
    }

    /// Returns when it has ended.
    pub(crate) async fn ended(&self) {
        // An error means that the sender is gone, which cannot be while `self` is there.
        let _ = self.state.subscribe().wait_for(|state| !is_running(state)).await;
    }
}

impl Operations {
    fn list(&self) -> MutexGuard<'_, List> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A new operation that `token` stops.
    ///
    /// # Errors
    /// [`Fault::ClientLimit`] if [`MOST_RUNNING`] run.
    pub(crate) fn begin(&self, revision: u64, token: CancelToken, clock: Clock) -> Result<Arc<Operation>, Fault> {
        let mut list = self.list();
        if list.all.iter().filter(|o| is_running(&o.state.borrow())).count() >= MOST_RUNNING {
            return Err(Fault::ClientLimit { limit: "operations_per_session", most: MOST_RUNNING as u64 });
        }
        list.last += 1;
        let told = v1::Operation {
            revision,
            state: v1::OperationState::Running.into(),
            create_time: Some(to_proto::time(clock.now())),
            ..Default::default()
        };
        let operation = Arc::new(Operation { number: list.last, token, state: watch::Sender::new(told), clock });
        list.all.push(operation.clone());
        let ended = |o: &Arc<Operation>| !is_running(&o.state.borrow());
        if list.all.iter().filter(|o| ended(o)).count() > KEPT
            && let Some(oldest) = list.all.iter().position(ended)
        {
            list.all.remove(oldest);
        }
        Ok(operation)
    }

    /// The operation of a number, if it is kept.
    pub(crate) fn find(&self, number: u64) -> Option<Arc<Operation>> {
        self.list().all.iter().find(|o| o.number == number).cloned()
    }

    /// All that are kept, oldest first.
    pub(crate) fn all(&self) -> Vec<Arc<Operation>> {
        self.list().all.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ended_ones_are_forgotten_in_order_and_running_ones_are_bounded() {
        let operations = Operations::default();
        let begin = || operations.begin(1, CancelToken::new(), Clock::default());
        let first = begin().expect("first");
        for _ in 0..KEPT + 5 {
            begin().expect("room").end(Err(Fault::Draining));
        }
        assert_eq!(first.told("sessions/s").name, "sessions/s/operations/1");
        assert!(operations.find(1).is_some() && operations.find(2).is_none(), "what runs is kept");
        while operations.all().iter().filter(|o| is_running(&o.state.borrow())).count() < MOST_RUNNING {
            begin().expect("room");
        }
        assert!(matches!(begin(), Err(Fault::ClientLimit { .. })));
    }
}
