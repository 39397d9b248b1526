//! Surfaces into a session and files out of it: import, chunked export.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{new_request_id, send};
use bytes::{Bytes, BytesMut};
use remesh_proto::v1;
use v1::export_mesh_response::Part;
use v1::import_mesh_request::Source as WireSource;

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

impl Client {
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
