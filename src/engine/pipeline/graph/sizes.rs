//! Stages of the size field: the measures of the surface that it rests on, and the field.

use super::{Context, Step, search_tree_step};
use crate::error::EngineError;
use crate::fingerprint::Fingerprint;
use crate::pipeline::Charts;
use crate::session::Snapshot;
use crate::sizing::{MeasureSpec, Measured, SizeField, SizeInput, SizeSpec, evaluate_size, measure, with_locked};
use crate::stage::{Stage, StageKey, Stored, Subject};

fn no_size() -> EngineError {
    EngineError::bad_parameter("size", "no size is set")
        .with_hint("set a uniform size, a triangle count, per-vertex sizes or a graded field")
}

/// Refuses a session with a mesh and no size before anything is computed.
pub(in crate::pipeline) fn check_size_is_set(snapshot: &Snapshot) -> Step<()> {
    if snapshot.source.is_some() && snapshot.size.is_none() { Err(no_size().into()) } else { Ok(()) }
}

pub(in crate::pipeline) fn size_step(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts) -> Step<Stored<SizeField>> {
    let spec = snapshot.size.as_ref().ok_or_else(no_size)?;
    spec.validate()?;
    let patches = &charts.patches;
    let imported = charts.surface.imported.mesh.positions.len();
    // A patch whose borders were straightened has vertices that the imported mesh has not.
    let named: Vec<(Fingerprint, Option<Vec<u32>>)> = spec
        .named_patches()
        .into_iter()
        .map(|identity| {
            let found = patches.identities.iter().position(|known| *known == identity);
            let vertices = |p: usize| patches.patches[p].2.vertices.iter().copied().filter(|&v| (v as usize) < imported).collect();
            (identity, found.map(vertices))
        })
        .collect();
    let key = StageKey::new(Stage::Size, |f| {
        f.fingerprint(charts.surface.imported.output).fingerprint(charts.features.output);
        spec.feed(f);
        f.text(&format!("{:?}", snapshot.lock));
        named.iter().for_each(|(_, vertices)| {
            f.u32s(vertices.as_deref().unwrap_or_default());
        });
    });
    let surface = &charts.surface;
    let measures = || measures_step(context, spec, charts);
    context.staged(key, Subject::Surface, measures, |measured, work| {
        let patch_vertices = |identity| {
            let (_, vertices) = named.iter().find(|(known, _)| *known == identity)?;
            vertices.as_deref()
        };
        let measured: Vec<Option<&Measured>> = measured.iter().map(|m| m.as_ref().map(|m| &*m.value)).collect();
        let input = SizeInput {
            mesh: &surface.imported.mesh,
            topology: &surface.topology,
            features: &charts.features,
            patch_vertices: &patch_vertices,
            measured: &measured,
        };
        let field = evaluate_size(&input, spec, work)?;
        with_locked(input.mesh, input.topology, field, &snapshot.lock, spec.growth_rate(), work)
    })
}

/// What the fields of a size specification rest on, for each field. Keyed by the surface, so that other lengths find it.
fn measures_step(context: &Context<'_>, spec: &SizeSpec, charts: &Charts) -> Step<Vec<Option<Stored<Measured>>>> {
    let SizeSpec::Composed(composed) = spec else { return Ok(Vec::new()) };
    let surface = &charts.surface;
    let measured = |measure_spec: MeasureSpec| {
        let stage = match measure_spec {
            MeasureSpec::Curvature { .. } => Stage::Curvature,
            MeasureSpec::Gaps { .. } => Stage::Proximity,
            MeasureSpec::Thickness => Stage::Thickness,
            MeasureSpec::Radius => Stage::Centerline,
        };
        let key = StageKey::new(stage, |f| {
            f.fingerprint(surface.imported.output).text(&format!("{measure_spec:?}"));
            if stage == Stage::Curvature {
                f.fingerprint(charts.features.output);
            }
        });
        let tree = || if measure_spec.needs_tree() { search_tree_step(context, &surface.imported).map(Some) } else { Ok(None) };
        context.staged(key, Subject::Surface, tree, |tree, work| {
            let tree = tree.as_ref().map(|tree| &tree.value.output);
            measure(&surface.imported.mesh, &surface.topology, &charts.features, tree, measure_spec, work)
        })
    };
    // A plan looks at all of them, even if some are unknown.
    let steps: Vec<Step<Option<Stored<Measured>>>> =
        composed.fields.iter().map(|field| field.measure().map(measured).transpose()).collect();
    steps.into_iter().collect()
}
