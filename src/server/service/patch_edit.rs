//! Edits of single patches: split, merge, move faces, take all back.

use crate::answers::Open;
use crate::convert::{patches, to_proto};
use crate::state::{Shared, Target};
use prost::Message;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::partition::PatchRequest;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::session::{Change, Pending};
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
pub(crate) fn edit<T: From<Edited> + Message>(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: &PatchRequest,
    open: Open,
) -> EngineResult<T> {
    let begin = Instant::now();
    let answer = pipeline::edit_patches(&shared.engine, &target.snapshot, request, run)?;
    let edited = answer.value;
    let made = Edited {
        revision: 0,
        patches: patches::summaries(&edited.layout, &edited.patches),
        patch_count: edited.layout.partition.patches.len() as u32,
        split_again: edited.split_again,
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    };
    let base = Some(target.snapshot.revision);
    target.apply(base, &[Change::PatchEdit(edited.edit)], open, |pending| T::from(Edited { revision: pending.next.revision.0, ..made }))
}

/// Takes all edits back.
pub(crate) fn reset(target: &Target, open: Open) -> EngineResult<v1::ResetPatchesResponse> {
    let edits = target.snapshot.patch_edits.len() as u32;
    let base = target.snapshot.revision;
    if edits == 0 {
        return target.unchanged(open, v1::ResetPatchesResponse { revision: base.0, edits });
    }
    let answer = |made: &Pending| v1::ResetPatchesResponse { revision: made.next.revision.0, edits };
    target.apply(Some(base), &[Change::ResetPatchEdits], open, answer)
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
