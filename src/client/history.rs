//! Undo, redo, and the events of a session.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{new_request_id, send};
use remesh_proto::v1;
use std::time::Duration;
use tonic::Streaming;
use v1::watch_session_request::Start;
use v1::watch_session_response::Event;

/// How often a broken stream of events is opened again before that is given up.
const RETRIES: u32 = 5;
const RETRY_DELAY: Duration = Duration::from_millis(200);

/// The events of a session, as they happen. A connection that breaks is opened again after the last event that was read.
#[derive(Debug)]
pub struct SessionEvents {
    client: Client,
    request: v1::WatchSessionRequest,
    stream: Streaming<v1::WatchSessionResponse>,
    closed: bool,
}

impl SessionEvents {
    /// The next event; `None` after the end of the session.
    ///
    /// # Errors
    /// Those of [`Client::watch`], after a few tries if the daemon cannot be reached.
    pub async fn next(&mut self) -> Result<Option<v1::WatchSessionResponse>> {
        while !self.closed {
            let cause = match self.stream.message().await {
                Ok(Some(event)) => {
                    self.closed = matches!(event.event, Some(Event::SessionClosed(_)));
                    self.request.start = Some(Start::AfterSequence(event.sequence));
                    return Ok(Some(event));
                }
                Ok(None) => ClientError::protocol("events that ended before the session"),
                Err(status) => status.into(),
            };
            self.reopen(cause).await?;
        }
        Ok(None)
    }

    /// Opens a broken stream again, if that is what `cause` says.
    async fn reopen(&mut self, mut cause: ClientError) -> Result<()> {
        for tries in 0..RETRIES {
            if !matches!(cause, ClientError::Unreachable { .. }) {
                break;
            }
            tokio::time::sleep(RETRY_DELAY * 2u32.pow(tries)).await;
            match self.client.sessions().watch_session(self.request.clone()).await {
                Ok(stream) => {
                    self.stream = stream.into_inner();
                    return Ok(());
                }
                Err(status) => cause = status.into(),
            }
        }
        Err(cause)
    }
}

impl Client {
    /// Takes the last change back; with `base`, only if that is the current revision.
    ///
    /// # Errors
    /// `NOTHING_TO_STEP_TO`, `STALE_REVISION`.
    pub async fn undo(&self, session: &str, base: Option<u64>) -> Result<v1::UndoChangeResponse> {
        let request = v1::UndoChangeRequest { session: session.to_owned(), base_revision: base, request_id: new_request_id() };
        Ok(send!(self.sessions.undo_change(request)))
    }

    /// Takes the last undo back.
    ///
    /// # Errors
    /// `NOTHING_TO_STEP_TO`, `STALE_REVISION`.
    pub async fn redo(&self, session: &str, base: Option<u64>) -> Result<v1::RedoChangeResponse> {
        let request = v1::RedoChangeRequest { session: session.to_owned(), base_revision: base, request_id: new_request_id() };
        Ok(send!(self.sessions.redo_change(request)))
    }

    /// Watches a session; without `start`, from now on.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`; `LIMIT_REACHED` if too many watch.
    pub async fn watch(&self, session: &str, start: Option<Start>, without_stages: bool) -> Result<SessionEvents> {
        let request = v1::WatchSessionRequest { session: session.to_owned(), start, without_stages };
        let stream = self.sessions().watch_session(request.clone()).await?.into_inner();
        Ok(SessionEvents { client: self.clone(), request, stream, closed: false })
    }
}
