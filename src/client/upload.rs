//! Uploads: what the daemon has is not sent, and what broke goes on where it ended.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use bytes::Bytes;
use remesh_proto::v1;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Bytes in one message of an upload.
pub const CHUNK_BYTES: usize = 512 << 10;

/// How often an upload that gets no further is tried again before that is given up.
const TRIES: u32 = 6;
const RETRY_DELAY: Duration = Duration::from_millis(200);

/// The messages of an upload from `offset` on: a view of `data` in pieces, never a copy. With nothing to send it is one empty message.
fn chunks(
    data: Bytes,
    offset: usize,
    expected_digest: String,
    mut on_sent: impl FnMut(u64),
) -> impl Iterator<Item = v1::UploadMeshRequest> {
    let total = data.len();
    let count = (total - offset).div_ceil(CHUNK_BYTES).max(1);
    (0..count).map(move |index| {
        let begin = offset + index * CHUNK_BYTES;
        let end = (begin + CHUNK_BYTES).min(total);
        on_sent(end as u64);
        let data = data.slice(begin..end);
        match index {
            0 => v1::UploadMeshRequest {
                data,
                total_bytes: Some(total as u64),
                expected_digest: expected_digest.clone(),
                offset: offset as u64,
            },
            _ => v1::UploadMeshRequest { data, ..Default::default() },
        }
    })
}

/// Whether a repetition may succeed: the connection broke, or somebody else went on with the upload.
fn may_go_on(error: &ClientError) -> bool {
    matches!(error, ClientError::Unreachable { .. }) || matches!(error.reason(), Some("UPLOAD_BROKEN" | "UPLOAD_OFFSET" | "SHUTTING_DOWN"))
}

impl Client {
    /// Which of some files (BLAKE3 digests in hex, at most 1000) the daemon does not have, and how much of each has arrived.
    ///
    /// # Errors
    /// `BAD_PARAMETER` for what is no digest.
    pub async fn missing_blobs(&self, digests: &[String]) -> Result<Vec<v1::MissingBlob>> {
        let request = v1::FindMissingBlobsRequest { digests: digests.to_vec() };
        Ok(self.meshes().find_missing_blobs(request).await?.into_inner().missing)
    }

    /// Uploads bytes (a mesh file or a packed array) and gives the name of the blob. What the daemon has is not sent again; after a broken
    /// connection the upload goes on where it ended. `on_sent` learns how many bytes are on their way.
    ///
    /// # Errors
    /// `LIMIT_REACHED` if the file is larger than the daemon allows, `STORE_FULL` if it has no room.
    pub async fn upload(&self, data: Bytes, on_sent: impl FnMut(u64) + Send + 'static) -> Result<String> {
        let digest = digest_of(data.clone()).await?;
        let on_sent = Arc::new(Mutex::new(on_sent));
        let tell = move |sent| (on_sent.lock().unwrap_or_else(PoisonError::into_inner))(sent);
        let (mut tries, mut reached) = (0, 0);
        loop {
            let cause = match self.upload_rest(&data, &digest, tell.clone(), &mut reached, &mut tries).await {
                Ok(blob) => return Ok(blob),
                Err(cause) => cause,
            };
            tries += 1;
            if tries >= TRIES || !may_go_on(&cause) {
                return Err(cause);
            }
            tokio::time::sleep(RETRY_DELAY * 2u32.pow(tries - 1)).await;
        }
    }

    /// Sends what the daemon has not; `tries` begin anew when more than `reached` had arrived.
    async fn upload_rest(
        &self,
        data: &Bytes,
        digest: &str,
        on_sent: impl FnMut(u64) + Send + 'static,
        reached: &mut u64,
        tries: &mut u32,
    ) -> Result<String> {
        let missing = self.missing_blobs(&[digest.to_owned()]).await?;
        let Some(missing) = missing.first() else {
            let mut on_sent = on_sent;
            on_sent(data.len() as u64);
            return Ok(format!("blobs/{digest}"));
        };
        if missing.received_bytes > *reached {
            (*reached, *tries) = (missing.received_bytes, 0);
        }
        let offset = usize::try_from(missing.received_bytes).ok().filter(|&offset| offset <= data.len());
        let offset = offset.ok_or_else(|| ClientError::protocol("more of a file has arrived than it has"))?;
        let answer =
            self.meshes().upload_mesh(tokio_stream::iter(chunks(data.clone(), offset, digest.to_owned(), on_sent))).await?.into_inner();
        if answer.bytes != data.len() as u64 {
            return Err(ClientError::protocol(format!("{} bytes were uploaded, {} arrived", data.len(), answer.bytes)));
        }
        Ok(answer.blob)
    }
}

/// BLAKE3 digest, computed beside the runtime: large files take a while.
async fn digest_of(data: Bytes) -> Result<String> {
    let digest = tokio::task::spawn_blocking(move || blake3::hash(&data).to_hex().to_string()).await;
    digest.map_err(|_| ClientError::protocol("the runtime is going down"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_the_data_from_the_offset_on() {
        for size in [0, 1, CHUNK_BYTES - 1, CHUNK_BYTES, CHUNK_BYTES + 1, 3 * CHUNK_BYTES] {
            for offset in [0, size / 3, size] {
                let data: Vec<u8> = (0..size).map(|i| (i % 251) as u8).collect();
                let messages: Vec<_> = chunks(data.clone().into(), offset, "d".to_owned(), |_| {}).collect();
                let joined: Vec<u8> = messages.iter().flat_map(|m| m.data.to_vec()).collect();
                assert_eq!(joined, data[offset..]);
                let first = &messages[0];
                assert_eq!((first.total_bytes, first.offset, first.expected_digest.as_str()), (Some(size as u64), offset as u64, "d"));
                assert!(messages[1..].iter().all(|m| m.total_bytes.is_none() && !m.data.is_empty()));
                assert!(messages.iter().all(|m| m.data.len() <= CHUNK_BYTES));
            }
        }
    }
}
