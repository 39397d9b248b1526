//! Edits of single patches.

use crate::arrays::pack_u32;
use crate::connection::Client;
use crate::error::Result;
use crate::retry::{new_request_id, send};
use remesh_proto::v1;
use v1::packed_array::Data;
use v1::split_patch_request::How;

/// Arrays up to this size travel in the message, larger ones as a blob.
const INLINE_BYTES: usize = 1 << 20;

impl Client {
    /// Cuts a patch in two; `None` balances the areas. With `base`, only if that is the current revision.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`, `PATCH_TOPOLOGY` with the place, `BAD_PARAMETER` for a plane that does not cut the patch, `STALE_REVISION`.
    pub async fn split_patch(&self, session: &str, patch: u32, how: Option<How>, base: Option<u64>) -> Result<v1::SplitPatchResponse> {
        let request = v1::SplitPatchRequest { session: session.to_owned(), base_revision: base, patch, how, request_id: new_request_id() };
        Ok(send!(self.partitions.split_patch(request)))
    }

    /// Makes one patch of several.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`; `PATCH_TOPOLOGY` with the places if the union would not be a patch; `STALE_REVISION`.
    pub async fn merge_patches(&self, session: &str, patches: &[u32], base: Option<u64>) -> Result<v1::MergePatchesResponse> {
        let request = v1::MergePatchesRequest {
            session: session.to_owned(),
            base_revision: base,
            patches: patches.to_vec(),
            request_id: new_request_id(),
        };
        Ok(send!(self.partitions.merge_patches(request)))
    }

    /// Moves faces of the imported mesh to a patch.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`; `BAD_PARAMETER` for a face that is not there; `PATCH_TOPOLOGY` with the patch that would break, and where;
    /// `STALE_REVISION`.
    pub async fn reassign_faces(&self, session: &str, faces: &[u32], patch: u32, base: Option<u64>) -> Result<v1::ReassignFacesResponse> {
        let bytes = pack_u32(faces);
        let data = if bytes.len() <= INLINE_BYTES { Data::Inline(bytes) } else { Data::Blob(self.upload(bytes, |_| {}).await?) };
        let faces = Some(v1::PackedArray { data: Some(data) });
        let request =
            v1::ReassignFacesRequest { session: session.to_owned(), base_revision: base, faces, patch, request_id: new_request_id() };
        Ok(send!(self.partitions.reassign_faces(request)))
    }

    /// Takes all edits of patches back.
    ///
    /// # Errors
    /// `STALE_REVISION`.
    pub async fn reset_patches(&self, session: &str, base: Option<u64>) -> Result<v1::ResetPatchesResponse> {
        let request = v1::ResetPatchesRequest { session: session.to_owned(), base_revision: base, request_id: new_request_id() };
        Ok(send!(self.partitions.reset_patches(request)))
    }
}
