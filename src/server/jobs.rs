//! Work that is on: which tokens stop that of a session, and how many jobs each client has.

use crate::status::Fault;
use remesh_engine::error::{EngineError, Reason, Result};
use remesh_engine::work::CancelToken;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

fn guard<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What computes for a session; all of it stops when the session ends.
#[derive(Debug, Default)]
pub(crate) struct Works(Mutex<Tokens>);

#[derive(Debug, Default)]
struct Tokens {
    closed: bool,
    of_calls: HashMap<u64, CancelToken>,
}

impl Works {
    /// Adds a call.
    ///
    /// # Errors
    /// [`Reason::SessionNotFound`] if the session has ended meanwhile.
    pub(crate) fn add(&self, call: u64, token: &CancelToken) -> Result<()> {
        let mut tokens = guard(&self.0);
        if tokens.closed {
            return Err(EngineError::new(Reason::SessionNotFound, "no such session").with_hint("it was deleted just now"));
        }
        tokens.of_calls.insert(call, token.clone());
        Ok(())
    }

    /// Takes a call away that has ended.
    pub(crate) fn remove(&self, call: u64) {
        guard(&self.0).of_calls.remove(&call);
    }

    /// Stops all calls and takes no more; gives how many there were.
    pub(crate) fn close(&self) -> usize {
        let mut tokens = guard(&self.0);
        tokens.closed = true;
        tokens.of_calls.values().for_each(CancelToken::cancel);
        tokens.of_calls.len()
    }
}

/// Jobs of each client that compute or wait to.
#[derive(Debug, Default, Clone)]
pub(crate) struct Clients(Arc<Mutex<HashMap<Arc<str>, usize>>>);

/// One job of a client, until it is dropped.
#[derive(Debug)]
pub(crate) struct Job {
    clients: Clients,
    client: Arc<str>,
}

impl Drop for Job {
    fn drop(&mut self) {
        let mut clients = guard(&self.clients.0);
        if let Some(count) = clients.get_mut(&self.client) {
            *count -= 1;
            if *count == 0 {
                clients.remove(&self.client);
            }
        }
    }
}

impl Clients {
    /// A job more of a client, if it has fewer than `most`.
    ///
    /// # Errors
    /// [`Fault::ClientLimit`].
    pub(crate) fn begin(&self, client: &Arc<str>, most: usize) -> std::result::Result<Job, Fault> {
        let mut clients = guard(&self.0);
        let count = clients.entry(client.clone()).or_default();
        if *count >= most {
            return Err(Fault::ClientLimit { limit: "max_jobs_per_client", most: most as u64 });
        }
        *count += 1;
        Ok(Job { clients: self.clone(), client: client.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clients_are_counted_apart_and_forgotten() {
        let clients = Clients::default();
        let (a, b): (Arc<str>, Arc<str>) = ("a".into(), "b".into());
        let held = [clients.begin(&a, 2).expect("first"), clients.begin(&a, 2).expect("second")];
        assert!(matches!(clients.begin(&a, 2), Err(Fault::ClientLimit { limit: "max_jobs_per_client", most: 2 })));
        assert!(clients.begin(&b, 2).is_ok(), "another client");
        drop(held);
        assert!(clients.begin(&a, 2).is_ok() && guard(&clients.0).is_empty());
    }

    #[test]
    fn the_end_of_a_session_stops_its_work_and_takes_no_more() {
        let (works, token) = (Works::default(), CancelToken::new());
        works.add(1, &token).expect("open");
        works.remove(1);
        assert_eq!(works.close(), 0);
        assert!(token.check().is_ok(), "its call had ended");
        assert_eq!(works.add(2, &token).expect_err("closed").reason(), Reason::SessionNotFound);
    }
}
