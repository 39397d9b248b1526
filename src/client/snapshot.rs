//! Sessions as files: out of one daemon, into another.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use bytes::Bytes;
use remesh_proto::v1;

/// Bytes in one message.
const PIECE_BYTES: usize = 512 << 10;

/// The file of a session, as it comes.
#[derive(Debug)]
pub struct SnapshotStream {
    stream: tonic::Streaming<v1::SnapshotSessionResponse>,
}

impl SnapshotStream {
    /// The next bytes; `None` at the end.
    ///
    /// # Errors
    /// Of the connection; `STORE_FAILED` if the daemon cannot read an uploaded file. What came is then no whole snapshot.
    pub async fn next(&mut self) -> Result<Option<Bytes>> {
        Ok(self.stream.message().await?.map(|message| message.data))
    }
}

impl Client {
    /// Writes a session to a file: its inputs at all kept revisions and the uploaded files they rest on.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`.
    pub async fn snapshot_session(&self, session: &str) -> Result<SnapshotStream> {
        let request = v1::SnapshotSessionRequest { session: session.to_owned() };
        Ok(SnapshotStream { stream: self.sessions().snapshot_session(request).await?.into_inner() })
    }

    /// Makes a new session of such a file. An empty `display_name` keeps that of the file.
    ///
    /// # Errors
    /// `SNAPSHOT_INVALID` for a file that is not whole or not as it was written, `LIMIT_REACHED`, `STORE_FULL`.
    pub async fn restore_session(&self, file: Bytes, display_name: &str) -> Result<v1::Session> {
        let answer = self.sessions().restore_session(tokio_stream::iter(pieces(file, display_name.to_owned()))).await?.into_inner();
        answer.session.ok_or_else(|| ClientError::protocol("an answer without the session"))
    }
}

fn pieces(file: Bytes, display_name: String) -> impl Iterator<Item = v1::RestoreSessionRequest> {
    (0..file.len().div_ceil(PIECE_BYTES).max(1)).map(move |index| {
        let data = file.slice(index * PIECE_BYTES..((index + 1) * PIECE_BYTES).min(file.len()));
        v1::RestoreSessionRequest { data, display_name: if index == 0 { display_name.clone() } else { String::new() } }
    })
}
