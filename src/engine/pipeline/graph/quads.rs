//! The stage of quadrangles.

use crate::bvh::TriangleBvh;
use crate::optimize::Remeshed;
use crate::pipeline::Charts;
use crate::pipeline::context::{Context, Step};
use crate::pipeline::kept::Kept;
use crate::planar::QuadKind;
use crate::quads::{QuadInput, make_quads};
use crate::sizing::SizeField;
use crate::stage::{Stage, StageKey, Stored, Subject};

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
