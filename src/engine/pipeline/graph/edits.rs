//! The stage that carries out the user's edits of patches.

use crate::partition::{Ground, Partition, PatchEdit, apply_edits};
use crate::pipeline::Layout;
use crate::pipeline::context::{Context, Step};
use crate::session::Snapshot;
use crate::stage::{Stage, StageKey, Stored, Subject};
use std::sync::Arc;

/// The partition of a layout with the edits `left`, or with as many of them as can be done before patches are mapped again.
pub(super) fn edits_step(context: &Context<'_>, snapshot: &Snapshot, layout: &Layout, left: &[Arc<PatchEdit>]) -> Step<Stored<Partition>> {
    let Layout { surface, features, partition, .. } = layout;
    let limit = snapshot.partition.max_aspect_ratio;
    let key = StageKey::new(Stage::Partition, |f| {
        f.text("edits").fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(partition.output).f64(limit);
        left.iter().for_each(|edit| edit.feed(f));
    });
    context.stage(key, Subject::Surface, |work| {
        let ground = Ground { mesh: &surface.imported.mesh, topology: &surface.topology, features };
        apply_edits(ground, partition, left, limit, work)
    })
}
