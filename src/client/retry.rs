//! Calls that are tried again: only those that may come twice, only after failures that pass, later and later, and never sooner than the
//! daemon asks for.

use crate::error::{ClientError, Result};
use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// How often and how late calls are tried again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RetryPolicy {
    /// Tries in all; 1 tries nothing again.
    pub tries: u32,
    /// Wait after the first try; doubles with each, and varies by half of it so that clients do not come back together.
    pub first_wait: Duration,
    /// Longest wait; where the daemon asks for a longer one, the error is given back instead.
    pub longest_wait: Duration,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        RetryPolicy { tries: 5, first_wait: Duration::from_millis(100), longest_wait: Duration::from_secs(5) }
    }
}

impl RetryPolicy {
    /// Tries nothing again.
    pub const NEVER: RetryPolicy = RetryPolicy { tries: 1, first_wait: Duration::ZERO, longest_wait: Duration::ZERO };
}

/// What may be tried again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Repeat {
    /// The call reads, or carries a `request_id`: whether the first one was carried out makes no difference.
    Free,
    /// The call makes something: only if the daemon has said that it did nothing.
    IfRefused,
}

/// The waits of one call.
#[derive(Debug)]
pub(crate) struct Backoff {
    policy: RetryPolicy,
    repeat: Repeat,
    tried: u32,
}

/// A text that is as good as never the same again.
pub(crate) fn new_request_id() -> String {
    let half = || RandomState::new().hash_one(std::time::SystemTime::now());
    format!("{:016x}{:016x}", half(), half())
}

/// The wait that the daemon asks for, if it is only busy. Other limits (of sessions, of sizes) are not gone a moment later.
fn busy(error: &ClientError) -> Option<Duration> {
    let call = error.call()?;
    let full = call.reason.as_deref() == Some("QUEUE_FULL") || call.metadata.get("limit").is_some_and(|l| l == "max_jobs_per_client");
    call.retry_after.filter(|_| full)
}

impl Backoff {
    pub(crate) fn new(policy: RetryPolicy, repeat: Repeat) -> Self {
        Backoff { policy, repeat, tried: 0 }
    }

    /// The wait before the next try, or none if there is to be none.
    fn wait_after(&mut self, error: &ClientError) -> Option<Duration> {
        self.tried += 1;
        if self.tried >= self.policy.tries {
            return None;
        }
        let own = self.policy.first_wait.saturating_mul(1 << (self.tried - 1).min(16)).min(self.policy.longest_wait);
        let varied = own.mul_f64(1.0 + 0.5 * (RandomState::new().hash_one(self.tried) % 1000) as f64 / 1000.0);
        match (error, busy(error)) {
            (_, Some(asked)) => (asked <= self.policy.longest_wait).then(|| varied.max(asked)),
            (ClientError::Unreachable { .. }, None) if self.repeat == Repeat::Free => Some(varied),
            _ => None,
        }
    }

    /// Waits for the next try, or gives the error back.
    pub(crate) async fn after(&mut self, error: ClientError) -> Result<()> {
        let Some(wait) = self.wait_after(&error) else { return Err(error) };
        tokio::time::sleep(wait).await;
        Ok(())
    }
}

/// The answer to a call of a stub, tried again as the policy of the client says.
macro_rules! send {
    ($client:ident . $stub:ident . $method:ident ($request:expr), $repeat:ident) => {{
        let request = $request;
        let mut backoff = $crate::retry::Backoff::new($client.retry_policy(), $crate::retry::Repeat::$repeat);
        loop {
            match $client.$stub().$method(request.clone()).await {
                Ok(answer) => break answer.into_inner(),
                Err(status) => backoff.after(status.into()).await?,
            }
        }
    }};
    ($client:ident . $stub:ident . $method:ident ($request:expr)) => {
        $crate::retry::send!($client.$stub.$method($request), Free)
    };
}
pub(crate) use send;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::CallError;
    use std::collections::BTreeMap;
    use tonic::{Code, Status};

    fn unreachable() -> ClientError {
        ClientError::Unreachable { endpoint: None, cause: String::new() }
    }

    fn refused(reason: &str, limit: &str, retry_after: Option<Duration>) -> ClientError {
        let mut call = CallError::from_status(&Status::new(Code::ResourceExhausted, "no"));
        call.reason = Some(reason.to_owned());
        call.metadata = BTreeMap::from([("limit".to_owned(), limit.to_owned())]);
        call.retry_after = retry_after;
        ClientError::Call(Box::new(call))
    }

    #[test]
    fn only_what_may_come_twice_is_sent_twice_after_a_broken_connection() {
        let policy = RetryPolicy::default();
        assert!(Backoff::new(policy, Repeat::Free).wait_after(&unreachable()).is_some());
        assert_eq!(Backoff::new(policy, Repeat::IfRefused).wait_after(&unreachable()), None);
        assert_eq!(Backoff::new(RetryPolicy::NEVER, Repeat::Free).wait_after(&unreachable()), None);
        let stale = refused("STALE_REVISION", "", None);
        assert_eq!(Backoff::new(policy, Repeat::Free).wait_after(&stale), None, "it will not pass");
    }

    #[test]
    fn waits_grow_are_bounded_and_never_shorter_than_the_daemon_asks_for() {
        let mut backoff = Backoff::new(RetryPolicy { tries: 9, ..RetryPolicy::default() }, Repeat::Free);
        let waits: Vec<_> = (0..8).map(|_| backoff.wait_after(&unreachable()).expect("again")).collect();
        assert!(waits[1] >= 2 * Duration::from_millis(100) && waits.iter().all(|w| *w <= Duration::from_millis(7500)), "{waits:?}");
        assert_eq!(backoff.wait_after(&unreachable()), None, "the last try");
        let mut backoff = Backoff::new(RetryPolicy::default(), Repeat::IfRefused);
        let full = refused("QUEUE_FULL", "", Some(Duration::from_secs(2)));
        assert!(backoff.wait_after(&full).is_some_and(|w| w >= Duration::from_secs(2)));
        let much = refused("QUEUE_FULL", "", Some(Duration::from_secs(60)));
        assert_eq!(backoff.wait_after(&much), None);
        let sessions = refused("LIMIT_REACHED", "max_sessions_per_client", Some(Duration::from_secs(1)));
        assert_eq!(Backoff::new(RetryPolicy::default(), Repeat::Free).wait_after(&sessions), None, "waiting does not help soon");
    }

    #[test]
    fn ids_are_of_their_own() {
        let ids: std::collections::BTreeSet<String> = (0..1000).map(|_| new_request_id()).collect();
        assert!(ids.len() == 1000 && ids.iter().all(|id| id.len() == 32));
    }
}
