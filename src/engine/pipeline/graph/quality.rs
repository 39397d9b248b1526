//! The stages that measure: a result against the session's surface, or any mesh against any other.

use super::{import_source_step, search_tree_step};
use crate::bvh::{TriangleBvh, closest_on_triangle};
use crate::diagnose::{Finding, intersections};
use crate::error::{EngineError, Result};
use crate::import::{ImportOptions, Imported};
use crate::metric::SurfaceMetric;
use crate::pipeline::context::{Context, Step};
use crate::pipeline::kept::Kept;
use crate::pipeline::{Remesh, Surface};
use crate::quality::seams::{Patched, SeamQuality, measure_seams};
use crate::quality::{MeasuredMesh, QualityReport, QualityScope, TargetSize, measure_quality};
use crate::session::MeshSource;
use crate::sizing::SizeField;
use crate::stage::{Stage, StageKey, Stored, Subject};
use crate::vector::Vec3;

pub(in crate::pipeline) fn quality_step(context: &Context<'_>, remesh: &Remesh, scope: QualityScope) -> Step<Stored<QualityReport>> {
    let surface = &remesh.charts.surface;
    let tree = search_tree_step(context, &surface.imported)?;
    let key = StageKey::new(Stage::Quality, |f| {
        f.fingerprint(surface.imported.output).fingerprint(remesh.assembled.output).fingerprint(remesh.result.output);
        f.fingerprint(remesh.sizes.output).u64(scope as u64);
        if let Some(metric) = &remesh.metric {
            f.fingerprint(metric.output);
        }
    });
    context.stage(key, Subject::Surface, |work| {
        let (output, assembled) = (&remesh.result.mesh, &remesh.assembled);
        let target = |positions: &[Vec3]| match (&remesh.metric, remesh.sizes.uniform) {
            (Some(metric), _) => metric_at(surface, &tree.value.output, metric, positions).map(TargetSize::Metric),
            (None, Some(size)) => Ok(TargetSize::Uniform(size)),
            (None, None) => sizes_at(surface, &tree.value.output, &remesh.sizes, positions).map(TargetSize::PerVertex),
        };
        let (size, size_before) = (target(&output.positions)?, target(&assembled.positions)?);
        let before = Patched {
            positions: &assembled.positions,
            triangles: &assembled.triangles,
            face_patch: &assembled.face_patch,
            curve_edges: &assembled.curve_edges,
        };
        let after = Patched::of(output, &remesh.result.face_patch, &remesh.result.curve_edges);
        let seams = SeamQuality { before: measure_seams(&before, &size_before), after: measure_seams(&after, &size) };
        let measured = MeasuredMesh { mesh: output, quads: remesh.result.quads };
        let report = measure_quality(&surface.imported.mesh, &tree.value.output, measured, Some(&size), scope, work)?;
        // Halves of quadrangles tell nothing of seams.
        Ok(QualityReport { seams: (remesh.result.quads == 0).then_some(seams), ..report })
    })
}

/// The self-intersections of the imported surface.
pub(in crate::pipeline) fn intersections_step(context: &Context<'_>, imported: &Stored<Imported>) -> Step<Stored<Kept<Option<Finding>>>> {
    let tree = search_tree_step(context, imported)?;
    let key = StageKey::new(Stage::Quality, |f| {
        f.text("intersections").fingerprint(imported.output);
    });
    context.stage(key, Subject::Surface, |work| {
        let found = intersections(&imported.mesh, &tree.value.output, work)?;
        let places = found.as_ref().map_or(0, |finding| finding.locations.len());
        Ok(Kept { bytes: 64 + places * 128, output: found, of: imported.output })
    })
}

/// The size field at the vertices of a result.
pub(in crate::pipeline) fn result_sizes(context: &Context<'_>, remesh: &Remesh) -> Step<Vec<f64>> {
    let surface = &remesh.charts.surface;
    let tree = search_tree_step(context, &surface.imported)?;
    Ok(sizes_at(surface, &tree.value.output, &remesh.sizes, &remesh.result.mesh.positions)?)
}

/// The metric at points near the input.
fn metric_at(surface: &Surface, tree: &TriangleBvh, metric: &SurfaceMetric, points: &[Vec3]) -> Result<Vec<[f64; 6]>> {
    let input = &surface.imported.mesh;
    let at = |point: &Vec3| {
        let hit = tree.closest(*point).ok_or_else(|| EngineError::invariant("the search tree is empty"))?;
        let (_, barycentric) = closest_on_triangle(*point, &input.corners(hit.face as usize));
        Ok(metric.at(input, hit.face, barycentric))
    };
    points.iter().map(at).collect()
}

/// The size field at points near the input, linear on the input face below each.
fn sizes_at(surface: &Surface, tree: &TriangleBvh, sizes: &SizeField, points: &[Vec3]) -> Result<Vec<f64>> {
    let input = &surface.imported.mesh;
    let at = |point: &Vec3| {
        let hit = tree.closest(*point).ok_or_else(|| EngineError::invariant("the search tree is empty"))?;
        let [a, b, c] = input.corners(hit.face as usize);
        let [i, j, k] = input.triangles[hit.face as usize].map(|v| sizes.vertex_size[v as usize]);
        let weight = |p, q| crate::vector::triangle_area(p, q, hit.position);
        let (wa, wb, wc) = (weight(b, c), weight(c, a), weight(a, b));
        let sum = wa + wb + wc;
        Ok(if sum > 0.0 { (wa * i + wb * j + wc * k) / sum } else { i })
    };
    points.iter().map(at).collect()
}

pub(in crate::pipeline) fn compare_step(
    context: &Context<'_>,
    input: (&MeshSource, &ImportOptions),
    output: (&MeshSource, &ImportOptions),
    size: Option<f64>,
    scope: QualityScope,
) -> Step<Stored<QualityReport>> {
    let before = import_source_step(context, input.0, input.1)?;
    let after = import_source_step(context, output.0, output.1)?;
    let tree = search_tree_step(context, &before)?;
    let key = StageKey::new(Stage::Quality, |f| {
        f.text("compare").fingerprint(before.output).fingerprint(after.output).option_f64(size).u64(scope as u64);
    });
    let target = size.map(TargetSize::Uniform);
    context
        .stage(key, Subject::Surface, |work| measure_quality(&before.mesh, &tree.value.output, &after.mesh, target.as_ref(), scope, work))
}
