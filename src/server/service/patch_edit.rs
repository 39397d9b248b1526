//! Edits of single patches: split, merge, move faces, take all back.

use crate::convert::{patches, to_proto};
use crate::state::{Shared, Target};
use remesh_engine::error::Result as EngineResult;
use remesh_engine::partition::PatchRequest;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::session::Change;
use remesh_proto::v1;
use std::time::Instant;

/// What an edit has made.
pub(crate) struct Edited {
    revision: u64,
    patches: Vec<v1::PatchSummary>,
    patch_count: u32,
    split_again: u32,
    summary: Option<v1::RunSummary>,
}

/// Carries out an edit on the revision that its numbers were looked up in: in another one they may be other patches.
pub(crate) fn edit(shared: &Shared, run: &Run<'_>, target: &Target, request: &PatchRequest) -> EngineResult<Edited> {
    let begin = Instant::now();
    let answer = pipeline::edit_patches(&shared.engine, &target.snapshot, request, run)?;
    let edited = answer.value;
    let revision = target.apply(Some(target.snapshot.revision), &[Change::PatchEdit(edited.edit)])?;
    Ok(Edited {
        revision: revision.0,
        patches: patches::summaries(&edited.layout, &edited.patches),
        patch_count: edited.layout.partition.patches.len() as u32,
        split_again: edited.split_again,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    })
}

/// Takes all edits back.
pub(crate) fn reset(target: &Target) -> EngineResult<v1::ResetPatchesResponse> {
    let edits = target.snapshot.patch_edits.len() as u32;
    let mut revision = target.snapshot.revision;
    if edits > 0 {
        revision = target.apply(Some(revision), &[Change::ResetPatchEdits])?;
    }
    Ok(v1::ResetPatchesResponse { revision: revision.0, edits })
}

impl From<Edited> for v1::SplitPatchResponse {
    fn from(Edited { revision, patches, patch_count, split_again, summary }: Edited) -> Self {
        v1::SplitPatchResponse { revision, patches, patch_count, split_again, summary }
    }
}

impl From<Edited> for v1::MergePatchesResponse {
    fn from(Edited { revision, patches, patch_count, split_again, summary }: Edited) -> Self {
        v1::MergePatchesResponse { revision, patches, patch_count, split_again, summary }
    }
}

impl From<Edited> for v1::ReassignFacesResponse {
    fn from(Edited { revision, patches, patch_count, split_again, summary }: Edited) -> Self {
        v1::ReassignFacesResponse { revision, patches, patch_count, split_again, summary }
    }
}
