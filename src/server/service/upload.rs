//! Taking a file in chunks, within the limits at every chunk.

use crate::config::CHUNK_BYTES;
use crate::guarded::next_message;
use crate::state::Shared;
use crate::status::Fault;
use remesh_engine::EngineError;
use remesh_engine::error::Reason;
use remesh_proto::v1;
use std::sync::atomic::{AtomicUsize, Ordering};
use tonic::Streaming;

/// Bytes of all uploads that are under way.
#[derive(Debug, Default)]
pub(crate) struct UploadBudget(AtomicUsize);

/// The part of the budget that one upload holds; given back when dropped.
struct Held<'a> {
    budget: &'a UploadBudget,
    bytes: usize,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.budget.0.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl Held<'_> {
    fn grow(&mut self, bytes: usize, limit: usize) -> Result<(), Fault> {
        let all = self.budget.0.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.bytes += bytes;
        if all <= limit {
            return Ok(());
        }
        let error = EngineError::new(Reason::LimitReached, format!("uploads under way would take {all} bytes, the limit is {limit}"));
        Err(error.with_metadata("retry", "when other uploads have ended").into())
    }
}

fn too_large(bytes: u64, limit: usize) -> Fault {
    let error = EngineError::new(Reason::LimitReached, format!("the file has {bytes} bytes or more, the limit is {limit}"));
    error.with_metadata("limit", "max_blob_bytes").with_metadata("max_blob_bytes", limit).into()
}

/// A whole file and what its sender says of it.
pub(crate) struct Upload {
    pub(crate) file: Vec<u8>,
    pub(crate) expected_digest: String,
}

/// Reads all chunks. Memory follows what arrives, never what is announced.
pub(crate) async fn receive(shared: &Shared, mut stream: Streaming<v1::UploadMeshRequest>) -> Result<Upload, Fault> {
    let limit = shared.config.engine.max_blob_bytes;
    let mut held = Held { budget: &shared.uploads, bytes: 0 };
    let mut upload = Upload { file: Vec::new(), expected_digest: String::new() };
    let mut announced = None;
    let mut first = true;
    loop {
        let Some(chunk) = next_message(&mut stream, shared.config.upload_idle).await? else { break };
        if std::mem::take(&mut first) {
            announced = chunk.total_bytes;
            upload.expected_digest = chunk.expected_digest;
        }
        if let Some(total) = announced.filter(|&total| total > limit as u64) {
            return Err(too_large(total, limit));
        }
        if chunk.data.len() > CHUNK_BYTES {
            let message = format!("a chunk has {} bytes, the limit is {CHUNK_BYTES}", chunk.data.len());
            return Err(EngineError::bad_parameter("data", message).into());
        }
        let total = upload.file.len() + chunk.data.len();
        if total > limit {
            return Err(too_large(total as u64, limit));
        }
        held.grow(chunk.data.len(), shared.config.engine.max_total_blob_bytes)?;
        shared.metrics.uploaded(chunk.data.len());
        upload.file.extend_from_slice(&chunk.data);
    }
    if upload.file.is_empty() {
        return Err(EngineError::bad_parameter("data", "the file is empty").into());
    }
    if let Some(total) = announced.filter(|&total| total != upload.file.len() as u64) {
        let message = format!("{total} bytes were announced, {} came", upload.file.len());
        return Err(EngineError::bad_parameter("total_bytes", message).into());
    }
    Ok(upload)
}
