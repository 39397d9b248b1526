//! The stages that mesh curves and patches and join them.

use super::{Wanted, largest_first};
use crate::assemble::{Assembled, assemble};
use crate::curve::{CurveMesh, PatchCurve, mesh_curve};
use crate::error::EngineError;
use crate::fingerprint::Contents;
use crate::optimize::optimize_patch;
use crate::patch::PatchMap;
use crate::pipeline::Charts;
use crate::pipeline::context::{Context, Step};
use crate::planar::{CurveUse, Lengths, LiftedPatch, PlanarMesh, VertexOrigin, lift, mesh_chart_in};
use crate::session::Snapshot;
use crate::sizing::SizeField;
use crate::stage::{Stage, StageKey, Stored, Subject};
use std::sync::Arc;

/// Lifted meshes of patches and the curve meshes they share.
pub(in crate::pipeline) struct Lifted {
    curves: Vec<Option<Stored<CurveMesh>>>,
    /// One for each listed patch, in the order listed.
    pub(in crate::pipeline) lifted: Vec<Stored<LiftedPatch>>,
}

pub(in crate::pipeline) fn lifted_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: &Charts,
    lengths: Wanted<'_>,
    listed: &[u32],
) -> Step<Lifted> {
    let patches = &charts.patches;
    let mut wanted: Vec<usize> = listed.iter().flat_map(|&p| patches.uses[p as usize].iter().map(|u| u.curve as usize)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    // Sizes at the vertices of the surface that the patches are cut out of.
    let of_vertices = lengths.of_vertices(&charts.surface.imported.mesh);
    let split_sizes = charts.cut.as_ref().map(|cut| cut.at_vertices(&of_vertices));
    let vertex_size = split_sizes.as_deref().unwrap_or(&of_vertices);
    let lengths = Wanted { vertex_size, ..lengths };
    let meshed = context.each(&wanted, |c| curve_step(context, charts, lengths, c))?;
    let mut curves = vec![None; patches.network.curves.len()];
    for (c, mesh) in wanted.into_iter().zip(meshed) {
        curves[c] = Some(mesh);
    }
    let order = largest_first(patches, listed.iter().map(|&p| p as usize));
    let by_patch = context.each(&order, |p| lift_step(context, snapshot, charts, lengths, &curves, p))?;
    // `each` gives results by increasing patch; hand them out in the order asked for.
    let mut sorted: Vec<u32> = listed.to_vec();
    sorted.sort_unstable();
    let lifted = listed.iter().map(|p| by_patch[sorted.partition_point(|q| q < p)].clone()).collect();
    Ok(Lifted { curves, lifted })
}

fn curve_step(context: &Context<'_>, charts: &Charts, lengths: Wanted<'_>, c: usize) -> Step<Stored<CurveMesh>> {
    let (mesh, topology) = charts.ground();
    let curve = &charts.patches.network.curves[c];
    let polyline = lengths.polyline(charts, mesh, topology, curve);
    let key = StageKey::new(Stage::Curve, |f| polyline.feed(f));
    context.stage(key, Subject::Curve(c as u32), |work| mesh_curve(&polyline, work))
}

fn lift_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: &Charts,
    lengths: Wanted<'_>,
    curves: &[Option<Stored<CurveMesh>>],
    p: usize,
) -> Step<Stored<LiftedPatch>> {
    let (patch, fingerprint, map) = &charts.patches.patches[p];
    let mesher = snapshot.mesher.of_charts();
    let subject = Subject::Patch(p as u32);
    let chart = charts.chart(p).ok_or_else(|| EngineError::invariant(format!("patch {p} has no chart")))?;
    let local_size: Vec<f64> = map.vertices.iter().map(|&v| lengths.vertex_size[v as usize]).collect();
    let tensors = lengths.tensors(charts, patch, map);
    let uses = &charts.patches.uses[p];
    let mut meshes = Vec::with_capacity(uses.len());
    for used in uses {
        let mesh = curves[used.curve as usize].as_ref();
        meshes.push(mesh.ok_or_else(|| EngineError::invariant(format!("curve {} is not meshed", used.curve)))?);
    }
    // Curves are numbered by their place in `uses`, so that the key holds contents only.
    let local_uses: Vec<CurveUse<'_>> = uses
        .iter()
        .zip(&meshes)
        .enumerate()
        .map(|(place, (used, mesh))| CurveUse { path: used.path.clone(), mesh: &mesh.value, curve: place as u32 })
        .collect();
    let key = StageKey::new(Stage::Planar, |f| {
        f.fingerprint(*fingerprint).fingerprint(charts.charts[p].output).f64s(&local_size).text(&format!("{mesher:?}"));
        if let Some(tensors) = &tensors {
            f.points(tensors.as_flattened());
        }
        for (used, mesh) in uses.iter().zip(&meshes) {
            f.u32s(&used.path).fingerprint(mesh.output);
        }
    });
    let local = Lengths { vertex_size: &local_size, tensors: tensors.as_deref() };
    let planar: Stored<PlanarMesh> = context.stage(key, subject, |work| mesh_chart_in(patch, chart, &local_uses, &local, mesher, work))?;
    let key = StageKey::new(Stage::Lift, |f| {
        f.fingerprint(key.input).fingerprint(planar.output);
    });
    let lifted: Stored<LiftedPatch> = context.stage(key, subject, |_| Ok(lift(patch, &planar, &local_uses)))?;
    if lengths.metric.is_some() {
        // The optimisation in a metric does all of the surface at once.
        return Ok(lifted);
    }
    let spec = &snapshot.optimize;
    let key = StageKey::new(Stage::Interior, |f| {
        f.fingerprint(*fingerprint).fingerprint(lifted.output).f64s(&local_size).u64(u64::from(spec.rounds)).f64s(&[spec.min_kappa]);
    });
    context.stage(key, subject, |work| optimize_patch(patch, &lifted, &local_size, spec, work))
}

pub(super) fn assembly_step(context: &Context<'_>, charts: &Charts, sizes: &SizeField, meshes: &Lifted) -> Step<Stored<Assembled>> {
    let key = StageKey::new(Stage::Assembly, |f| {
        f.fingerprint(charts.patches.output).fingerprint(charts.features.output);
        sizes.feed_locked(f);
        for lifted in &meshes.lifted {
            f.fingerprint(lifted.output);
        }
    });
    context.stage(key, Subject::Surface, |work| {
        let curve_meshes: Vec<Arc<CurveMesh>> =
            meshes.curves.iter().map(|c| c.as_ref().map_or_else(Arc::default, |mesh| mesh.value.clone())).collect();
        let numbered: Vec<(Arc<LiftedPatch>, &PatchMap)> = (0..meshes.lifted.len())
            .map(|p| (Arc::new(with_network_numbers(&meshes.lifted[p], &charts.patches.uses[p])), &*charts.patches.patches[p].2))
            .collect();
        work.check()?;
        let (topology, corners) = (charts.ground().1, &charts.features.corners);
        let network = &charts.patches.network;
        assemble(&charts.surface.imported.mesh, topology, corners, &sizes.locked, network, &curve_meshes, &numbered, work)
    })
}

/// Curve numbers of the network instead of places in the patch's own list.
fn with_network_numbers(lifted: &LiftedPatch, uses: &[PatchCurve]) -> LiftedPatch {
    let mut copy = lifted.clone();
    for origin in &mut copy.origins {
        if let VertexOrigin::Curve { curve, .. } = origin {
            *curve = uses[*curve as usize].curve;
        }
    }
    copy
}
