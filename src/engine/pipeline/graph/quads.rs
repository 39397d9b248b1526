//! Quadrangles: the sizes of the triangles that they are made of, and their stage.

use crate::bvh::TriangleBvh;
use crate::error::EngineError;
use crate::fingerprint::Contents;
use crate::optimize::Remeshed;
use crate::pipeline::Charts;
use crate::pipeline::context::{Context, Step};
use crate::pipeline::kept::Kept;
use crate::planar::QuadKind;
use crate::quads::{QuadInput, base_sizes, make_quads};
use crate::session::Snapshot;
use crate::sizing::SizeField;
use crate::stage::{Stage, StageKey, Stored, Subject};
use std::sync::Arc;

/// The sizes for which triangles are made: those wanted, or larger ones where quadrangles are made of them.
pub(in crate::pipeline) fn triangle_sizes(snapshot: &Snapshot, wanted: &Stored<SizeField>) -> Step<Stored<SizeField>> {
    let Some(kind) = snapshot.mesher.quads() else { return Ok(wanted.clone()) };
    if kind == QuadKind::All && wanted.locked.contains(&true) {
        return Err(EngineError::bad_parameter("mesher.all_quads", "divides every edge, also those of the boundary that are locked")
            .with_hint("take the lock away, or let a few triangles stay")
            .into());
    }
    let base = base_sizes(wanted, kind);
    Ok(Stored { output: base.fingerprint(), bytes: base.bytes(), value: Arc::new(base) })
}

/// Quadrangles out of the triangles of a finished remesh.
pub(super) fn quads_step(
    context: &Context<'_>,
    charts: &Charts,
    tree: &Stored<Kept<TriangleBvh>>,
    base: &Stored<Remeshed>,
    sizes: &Stored<SizeField>,
    kind: QuadKind,
) -> Step<Stored<Remeshed>> {
    let surface = &charts.surface;
    let key = StageKey::new(Stage::Quads, |f| {
        f.fingerprint(surface.imported.output).fingerprint(charts.features.output).fingerprint(base.output);
        f.fingerprint(sizes.output).text(&format!("{kind:?}"));
    });
    context.stage(key, Subject::Surface, |work| {
        let topology = &surface.topology;
        let is_kept = |h: &u32| topology.twin(*h).is_none_or(|t| *h < t && charts.features.is_feature[*h as usize]);
        let kept = (0..topology.halfedge_count() as u32).filter(is_kept);
        let curves: Vec<[u32; 2]> = kept.map(|h| [topology.origin(h), topology.target(h)]).collect();
        let input = QuadInput { mesh: &surface.imported.mesh, tree: &tree.value.output, curves: &curves };
        make_quads(input, base, sizes, kind, work)
    })
}
