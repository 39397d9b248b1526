//! Files in and out of the daemon: chunked upload, import, chunked export.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{new_request_id, send};
use bytes::{Bytes, BytesMut};
use remesh_proto::v1;
use v1::export_mesh_response::Part;
use v1::import_mesh_request::Source as WireSource;

/// Bytes in one message of an upload.
pub const CHUNK_BYTES: usize = 256 << 10;

/// Where the surface of an import comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// An uploaded file, `blobs/{digest}`.
    Blob(String),
    /// A small file itself (below the daemon's `max_message_bytes`).
    Inline(Bytes),
    /// Arrays.
    Arrays(v1::MeshArrays),
    /// A surface that the daemon generates.
    Sample(v1::SampleSpec),
}

impl From<Source> for WireSource {
    fn from(source: Source) -> Self {
        match source {
            Source::Blob(name) => WireSource::Blob(name),
            Source::Inline(data) => WireSource::Inline(data),
            Source::Arrays(arrays) => WireSource::Arrays(arrays),
            Source::Sample(spec) => WireSource::Sample(spec),
        }
    }
}

/// A file that the daemon wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// What the format could not carry, one sentence each.
    pub warnings: Vec<String>,
    /// Vertices written.
    pub vertices: u64,
    /// Faces written.
    pub faces: u64,
    /// What ran for it.
    pub summary: v1::RunSummary,
}

/// The messages of an upload: a view of `data` in pieces, never a copy. An empty file is one empty message.
fn chunks(data: Bytes, mut on_sent: impl FnMut(u64)) -> impl Iterator<Item = v1::UploadMeshRequest> {
    let total = data.len();
    let count = total.div_ceil(CHUNK_BYTES).max(1);
    (0..count).map(move |index| {
        let end = ((index + 1) * CHUNK_BYTES).min(total);
        on_sent(end as u64);
        v1::UploadMeshRequest {
            data: data.slice(index * CHUNK_BYTES..end),
            total_bytes: (index == 0).then_some(total as u64),
            expected_digest: String::new(),
        }
    })
}

impl Client {
    /// Uploads bytes (a mesh file or a packed array) and gives the name of the blob. `on_sent` learns how many bytes are on their way.
    ///
    /// # Errors
    /// `LIMIT_REACHED` if the file is larger than the daemon allows.
    pub async fn upload(&self, data: Bytes, on_sent: impl FnMut(u64) + Send + 'static) -> Result<String> {
        let size = data.len() as u64;
        let answer = self.meshes().upload_mesh(tokio_stream::iter(chunks(data, on_sent))).await?.into_inner();
        if answer.bytes != size {
            return Err(ClientError::protocol(format!("{size} bytes were uploaded, {} arrived", answer.bytes)));
        }
        Ok(answer.blob)
    }

    /// Reads a surface into a session. A surface that cannot be remeshed is imported as well: see `diagnosis.remeshable`.
    ///
    /// # Errors
    /// Of the file (`FORMAT_MALFORMED`, `FORMAT_UNSUPPORTED`, `NON_FINITE`, `EMPTY_MESH`, ...), of the session and of limits.
    pub async fn import(&self, session: &str, source: Source, options: v1::ImportOptions) -> Result<v1::ImportMeshResponse> {
        self.import_at(session, source, options, None).await
    }

    /// The same; with `base`, only if that is the current revision.
    ///
    /// # Errors
    /// Those of [`Client::import`], `STALE_REVISION`.
    pub async fn import_at(
        &self,
        session: &str,
        source: Source,
        options: v1::ImportOptions,
        base: Option<u64>,
    ) -> Result<v1::ImportMeshResponse> {
        let request = v1::ImportMeshRequest {
            session: session.to_owned(),
            base_revision: base,
            source: Some(source.into()),
            options: Some(options),
            request_id: new_request_id(),
        };
        Ok(send!(self.meshes.import_mesh(request)))
    }

    /// Writes the input or the result of a session as a file. `on_received` learns how many bytes of how many have come.
    ///
    /// # Errors
    /// `FORMAT_UNSUPPORTED`, and those of a remesh if the result is asked for and not cached.
    pub async fn export(&self, request: v1::ExportMeshRequest, mut on_received: impl FnMut(u64, u64)) -> Result<Exported> {
        let mut stream = self.meshes().export_mesh(request).await?.into_inner();
        let Some(Part::Header(header)) = stream.message().await?.and_then(|m| m.part) else {
            return Err(ClientError::protocol("an export without a header"));
        };
        // The announced size is a hint for the allocation only, and not trusted beyond a bound.
        let mut file = BytesMut::with_capacity(header.total_bytes.min(64 << 20) as usize);
        while let Some(message) = stream.message().await? {
            let Some(Part::Data(data)) = message.part else {
                return Err(ClientError::protocol("an export with a second header"));
            };
            file.extend_from_slice(&data);
            on_received(file.len() as u64, header.total_bytes);
        }
        if file.len() as u64 != header.total_bytes {
            return Err(ClientError::protocol(format!("a file of {} bytes ended after {}", header.total_bytes, file.len())));
        }
        Ok(Exported {
            bytes: file.into(),
            warnings: header.warnings,
            vertices: header.vertices,
            faces: header.faces,
            summary: header.summary.unwrap_or_default(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_the_data_in_order() {
        for size in [0, 1, CHUNK_BYTES - 1, CHUNK_BYTES, CHUNK_BYTES + 1, 3 * CHUNK_BYTES] {
            let data: Vec<u8> = (0..size).map(|i| (i % 251) as u8).collect();
            let messages: Vec<_> = chunks(data.clone().into(), |_| {}).collect();
            let joined: Vec<u8> = messages.iter().flat_map(|m| m.data.to_vec()).collect();
            assert_eq!(joined, data);
            assert_eq!(messages[0].total_bytes, Some(size as u64));
            assert!(messages[1..].iter().all(|m| m.total_bytes.is_none() && !m.data.is_empty()));
            assert!(messages.iter().all(|m| m.data.len() <= CHUNK_BYTES));
        }
    }
}
