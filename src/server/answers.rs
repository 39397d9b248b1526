//! Answers to edits that a client may ask for again: each request with an id is carried out once and answered the same.

use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::error::Result;
use remesh_proto::v1;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::OwnedMutexGuard;

/// Ids of requests that are remembered for a session.
pub(crate) const KEPT_ANSWERS: usize = 256;
const MAX_ID_BYTES: usize = 64;

/// An answer and the request it is to.
#[derive(Debug, Clone)]
struct Kept {
    request: blake3::Hash,
    answer: Vec<u8>,
}

/// Locked while the request is carried out; empty until it has succeeded.
type Slot = Arc<tokio::sync::Mutex<Option<Kept>>>;

/// The answers of a session.
#[derive(Debug, Default)]
pub(crate) struct Answers(Mutex<Log>);

#[derive(Debug, Default)]
struct Log {
    slots: HashMap<String, Slot>,
    order: VecDeque<String>,
}

/// What is known of a request.
#[derive(Debug)]
pub(crate) enum Once<A> {
    /// It was carried out; the answer.
    Answered(A),
    /// It is to be carried out.
    Open(Open),
}

/// A place for the answer to a request; other requests with the same id wait until it is dropped.
#[derive(Debug, Default)]
pub(crate) struct Open {
    id: String,
    slot: Option<(OwnedMutexGuard<Option<Kept>>, blake3::Hash)>,
}

impl Open {
    /// The id of the request; empty if it has none.
    pub(crate) fn id(&self) -> &str {
        &self.id
    }

    /// The answer as it is kept on a disk, if it may be asked for again.
    pub(crate) fn stored(&self, answer: &impl Message) -> Option<v1::StoredAnswer> {
        let (_, request) = self.slot.as_ref()?;
        let request_digest = request.as_bytes().to_vec().into();
        Some(v1::StoredAnswer { request_id: self.id.clone(), request_digest, answer: answer.encode_to_vec().into() })
    }

    /// Remembers the answer.
    pub(crate) fn keep<A: Message>(self, answer: A) -> A {
        if let Some((mut slot, request)) = self.slot {
            *slot = Some(Kept { request, answer: answer.encode_to_vec() });
        }
        answer
    }
}

impl Answers {
    /// Answers of before the daemon was started, the oldest first.
    pub(crate) fn of(stored: Vec<v1::StoredAnswer>) -> Self {
        let answers = Answers::default();
        for v1::StoredAnswer { request_id, request_digest, answer } in stored {
            let Ok(digest) = <[u8; 32]>::try_from(request_digest.as_ref()) else { continue };
            let kept = Kept { request: blake3::Hash::from_bytes(digest), answer: answer.into() };
            let slot = answers.slot(&request_id);
            // Nobody else has it yet.
            if let Ok(mut slot) = slot.try_lock() {
                *slot = Some(kept);
            }
        }
        answers
    }

    fn slot(&self, id: &str) -> Slot {
        let mut log = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(slot) = log.slots.get(id) {
            return slot.clone();
        }
        let slot = Slot::default();
        log.slots.insert(id.to_owned(), slot.clone());
        log.order.push_back(id.to_owned());
        if log.order.len() > KEPT_ANSWERS
            && let Some(oldest) = log.order.pop_front()
        {
            log.slots.remove(&oldest);
        }
        slot
    }

    /// What is known of a request; waits while the same one is being carried out.
    ///
    /// # Errors
    /// `BadParameter` for an id that is too long or was used for another request.
    pub(crate) async fn once<A: Message + Default>(&self, id: &str, method: &str, request: &impl Message) -> Result<Once<A>> {
        if id.is_empty() {
            return Ok(Once::Open(Open::default()));
        }
        if id.len() > MAX_ID_BYTES || !id.bytes().all(|b| b.is_ascii_graphic()) {
            return Err(EngineError::bad_parameter("request_id", "must be at most 64 printable ASCII characters"));
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update(method.as_bytes()).update(&[0]).update(&request.encode_to_vec());
        let request = hasher.finalize();
        let slot = self.slot(id).lock_owned().await;
        let Some(kept) = slot.as_ref() else { return Ok(Once::Open(Open { id: id.to_owned(), slot: Some((slot, request)) })) };
        if kept.request != request {
            return Err(EngineError::bad_parameter("request_id", "was used for another request"));
        }
        let answer = A::decode(kept.answer.as_slice());
        answer.map(Once::Answered).map_err(|e| EngineError::invariant(format!("a kept answer cannot be decoded: {e}")))
    }
}

/// The place for the answer to an edit; ends the call with the answer if it was carried out before.
macro_rules! open_edit {
    ($call:ident, $request:ident) => {
        match $call.once(&$request.session, &$request.request_id, &$request).await? {
            $crate::answers::Once::Answered(answer) => return $call.finish(Ok(answer)),
            $crate::answers::Once::Open(open) => open,
        }
    };
}
pub(crate) use open_edit;

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::error::Reason;
    use remesh_proto::v1::{ApplyChangeResponse, UndoChangeRequest};

    async fn once(answers: &Answers, id: &str, base: u64) -> Result<Once<ApplyChangeResponse>> {
        let request = UndoChangeRequest { base_revision: Some(base), ..Default::default() };
        answers.once(id, "UndoChange", &request).await
    }

    fn opened(once: Once<ApplyChangeResponse>) -> Open {
        match once {
            Once::Open(open) => open,
            Once::Answered(answer) => panic!("answered: {answer:?}"),
        }
    }

    #[tokio::test]
    async fn the_second_is_answered_as_the_first_and_failures_are_forgotten() {
        let answers = Answers::default();
        drop(opened(once(&answers, "a", 1).await.expect("failed work keeps nothing")));
        let open = opened(once(&answers, "a", 1).await.expect("open"));
        let (second, ()) = tokio::join!(once(&answers, "a", 1), async {
            tokio::task::yield_now().await;
            open.keep(ApplyChangeResponse { revision: 7 });
        });
        assert!(matches!(second.expect("waited"), Once::Answered(ApplyChangeResponse { revision: 7 })));
        assert_eq!(once(&answers, "a", 2).await.map(drop).expect_err("another request").reason(), Reason::BadParameter);
        for bad in ["x".repeat(65), "with space".into(), "ä".into()] {
            assert_eq!(once(&answers, &bad, 1).await.map(drop).expect_err("refused").reason(), Reason::BadParameter);
        }
        opened(once(&answers, "", 1).await.expect("no id"));
    }

    #[tokio::test]
    async fn the_oldest_are_forgotten() {
        let answers = Answers::default();
        for n in 0..=KEPT_ANSWERS {
            opened(once(&answers, &n.to_string(), 1).await.expect("open")).keep(ApplyChangeResponse { revision: n as u64 });
        }
        assert!(matches!(once(&answers, "1", 1).await, Ok(Once::Answered(_))));
        assert!(matches!(once(&answers, "0", 1).await, Ok(Once::Open(_))));
    }
}
