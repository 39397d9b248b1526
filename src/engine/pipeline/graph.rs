//! The one file that ties stage functions to stage keys, in the order of the pipeline. In a plan, a stage that is not cached is
//! recorded as "will run" and nothing below it is looked at.

mod edits;
mod quality;

pub(super) use quality::{compare_step, quality_step};

use super::context::{Context, Halt, Step};
use super::kept::Kept;
use super::naming::{on_surface, refusal};
use super::patch_set::PatchSet;
use super::{Charts, Layout, Partitioned, Remesh, Surface};
use crate::assemble::{Assembled, assemble};
use crate::bvh::TriangleBvh;
use crate::curve::{CurveMesh, CurvePolyline, PatchCurve, curve_polyline, mesh_curve, patch_curves, trace_curves};
use crate::cut::{CutSurface, cut_along_borders};
use crate::error::{EngineError, Reason, Result};
use crate::features::{Features, detect_features};
use crate::fingerprint::Contents;
use crate::import::{ImportOptions, Imported, import_arrays, import_mesh};
use crate::mesh::SurfaceMesh;
use crate::optimize::{Interiors, Remeshed, optimize_patch, optimize_surface};
use crate::parametrize::{
    BoundaryFactor, ChartFactor, ChartOutcome, ChartSpec, ChartSystem, MapSpec, ProblemSpec, SolvedMap, Weights, candidate_maps, conclude,
    factor_boundary, factor_system, next_map, plan_system, solve_map, unsolved_map,
};
use crate::partition::{BorderSmoothing, Partition, partition_surface, patch_identities, split_patches};
use crate::patch::{PatchMap, extract_patches};
use crate::planar::{CurveUse, LiftedPatch, Mesher, PlanarMesh, QuadKind, VertexOrigin, lift, mesh_chart};
use crate::quads::{QuadInput, base_sizes, make_quads};
use crate::regions::{RegionFreedom, assign_regions};
use crate::sample;
use crate::session::{MeshSource, Snapshot};
use crate::sizing::{SizeField, evaluate_size};
use crate::stage::{Stage, StageKey, Stored, Subject};
use crate::topology::Topology;
use std::sync::Arc;

/// Largest number of times patches without a usable chart are split.
const MAX_RESPLITS: usize = 24;

pub(super) fn import_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Stored<Imported>> {
    let source = snapshot.source.as_ref().ok_or_else(|| {
        EngineError::new(Reason::NoMesh, "the session holds no mesh").with_hint("import a file, arrays or a sample first")
    })?;
    import_source_step(context, source, &snapshot.import)
}

pub(super) fn import_source_step(context: &Context<'_>, source: &MeshSource, options: &ImportOptions) -> Step<Stored<Imported>> {
    let key = StageKey::new(Stage::Import, |f| {
        source.feed(f);
        f.text(&format!("{options:?}"));
    });
    context.stage(key, Subject::Surface, |work| match source {
        MeshSource::File(blob) => import_mesh(&blob.bytes, options, work),
        MeshSource::Arrays { mesh, .. } => import_arrays(SurfaceMesh::clone(mesh), options, work),
        MeshSource::Sample(spec) => import_arrays(sample::generate(spec, work)?, options, work),
    })
}

pub(super) fn surface_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Surface> {
    let imported = import_step(context, snapshot)?;
    if let Some(refusal) = imported.diagnosis.refusal() {
        return Err(refusal.into());
    }
    let key = StageKey::new(Stage::Topology, |f| {
        f.fingerprint(imported.output);
    });
    let mesh = &imported.mesh;
    let topology = context.stage(key, Subject::Surface, |_| Topology::build(&mesh.triangles, mesh.positions.len()))?;
    Ok(Surface { imported, topology })
}

pub(super) fn features_step(context: &Context<'_>, snapshot: &Snapshot, surface: &Surface) -> Step<Stored<Features>> {
    let spec = &snapshot.features;
    let key = StageKey::new(Stage::Features, |f| {
        f.fingerprint(surface.imported.output).text(&format!("{spec:?}"));
    });
    context.stage(key, Subject::Surface, |work| detect_features(&surface.imported.mesh, &surface.topology, spec, work))
}

fn partition_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    surface: &Surface,
    features: &Stored<Features>,
) -> Step<Stored<Partition>> {
    let spec = &snapshot.partition;
    let key = StageKey::new(Stage::Partition, |f| {
        f.fingerprint(surface.imported.output).fingerprint(features.output).text(&format!("{spec:?}"));
    });
    context.stage(key, Subject::Surface, |work| partition_surface(&surface.imported.mesh, &surface.topology, features, spec, work))
}

/// The surface split along straight borders, if the snapshot asks for them.
fn cut_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    surface: &Surface,
    features: &Stored<Features>,
    partition: &Stored<Partition>,
) -> Step<Option<Stored<CutSurface>>> {
    if snapshot.partition.borders != BorderSmoothing::Geodesic {
        return Ok(None);
    }
    let most = snapshot.partition.max_aspect_ratio;
    let key = StageKey::new(Stage::Cut, |f| {
        f.fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(partition.output).f64(most);
    });
    let mesh = &surface.imported.mesh;
    let cut = context.stage(key, Subject::Surface, |work| cut_along_borders(mesh, &surface.topology, features, partition, most, work))?;
    Ok(Some(cut))
}

/// The partition before any split that charts ask for and any edit.
pub(super) fn partitioned_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Partitioned> {
    let surface = surface_step(context, snapshot)?;
    let features = features_step(context, snapshot, &surface)?;
    let partition = partition_step(context, snapshot, &surface, &features)?;
    let cut = cut_step(context, snapshot, &surface, &features, &partition)?;
    Ok(Partitioned { surface, features, partition, cut })
}

fn patches_step(
    context: &Context<'_>,
    surface: &Surface,
    features: &Stored<Features>,
    partition: &Stored<Partition>,
    cut: Option<&Stored<CutSurface>>,
) -> Step<Stored<PatchSet>> {
    let key = StageKey::new(Stage::Patches, |f| {
        f.fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(partition.output);
        cut.into_iter().for_each(|cut| {
            f.fingerprint(cut.output);
        });
    });
    context.stage(key, Subject::Surface, |_| {
        let identities = patch_identities(&surface.imported.mesh, partition);
        let (mesh, topology, features, partition): (_, _, &Features, &Partition) = match cut {
            Some(cut) => (&cut.mesh, &cut.topology, &cut.features, &cut.partition),
            None => (&surface.imported.mesh, &*surface.topology, features, partition),
        };
        let network = trace_curves(topology, features, partition);
        let mut parts = extract_patches(mesh, topology, partition)?;
        let uses = patch_curves(topology, &network, partition, &parts);
        if let Some(cut) = cut {
            for (_, map) in &mut parts {
                map.faces.iter_mut().for_each(|f| *f = cut.face_origin[*f as usize]);
                map.named.iter_mut().for_each(|v| *v = cut.vertex_before(*v));
            }
        }
        let patches = parts.into_iter().map(|(patch, map)| {
            let fingerprint = patch.fingerprint();
            (Arc::new(patch), fingerprint, Arc::new(map))
        });
        Ok(PatchSet { patches: patches.collect(), identities, network, uses })
    })
}

/// Indices of patches, those with most faces first, so that threads end at about the same time.
fn largest_first(patches: &PatchSet, listed: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut order: Vec<usize> = listed.collect();
    order.sort_by_key(|&p| (std::cmp::Reverse(patches.patches[p].0.triangles.len()), p));
    order
}

pub(super) fn charts_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Charts> {
    let Layout { surface, features, partition, cut, patches, charts, resplit, edits } = layout_step(context, snapshot)?;
    let charts = charts.into_iter().collect::<Result<Vec<_>>>()?;
    Ok(Charts { surface, features, partition, cut, patches, charts, resplit, edits })
}

/// The partition with the user's edits. They are of patches as the user saw them, all with charts, so the log is replayed on those; an
/// edit may be of halves of patches that edits before it made and that had to be split, so these are mapped before it.
pub(super) fn layout_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Layout> {
    let surface = surface_step(context, snapshot)?;
    let features = features_step(context, snapshot, &surface)?;
    let partition = partition_step(context, snapshot, &surface, &features)?;
    let mut layout = mapped_step(context, snapshot, surface, features, partition)?;
    while let Some(left) = snapshot.patch_edits.get(layout.edits.len()..).filter(|left| !left.is_empty()) {
        let edited = edits::edits_step(context, snapshot, &layout, left)?;
        let Layout { surface, features, edits, resplit, .. } = layout;
        let edits = [edits, edited.edits.clone()].concat();
        let mapped = mapped_step(context, snapshot, surface, features, edited)?;
        layout = Layout { resplit: resplit + mapped.resplit, edits, ..mapped };
    }
    Ok(layout)
}

/// A partition all of whose patches have a chart or a specification that gives none. A patch with a specification of its own is never
/// split, nor is one whose named method is refused: what is wrong is kept beside the others, so that it can be named and mended.
fn mapped_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    surface: Surface,
    features: Stored<Features>,
    mut partition: Stored<Partition>,
) -> Step<Layout> {
    let mut resplit = 0;
    for _ in 0..=MAX_RESPLITS {
        let cut = cut_step(context, snapshot, &surface, &features, &partition)?;
        let patches = patches_step(context, &surface, &features, &partition, cut.as_ref())?;
        let order = largest_first(&patches, 0..patches.patches.len());
        let charts = context.each(&order, |p| spec_and_chart_step(context, snapshot, &surface, &patches, p))?;
        let failing: Vec<u32> = (0..charts.len())
            .filter(|&p| charts[p].as_ref().is_ok_and(|c| matches!(*c.value, ChartOutcome::MustSplit { .. })))
            .map(|p| p as u32)
            .collect();
        if failing.is_empty() {
            return Ok(Layout { surface, features, partition, cut, patches, charts, resplit, edits: Vec::new() });
        }
        resplit += failing.len() as u32;
        let key = StageKey::new(Stage::Partition, |f| {
            f.fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(partition.output).u32s(&failing);
        });
        let split = context.stage(key, Subject::Surface, |work| {
            split_patches(&surface.imported.mesh, &surface.topology, &features, &partition, &failing, work)
        })?;
        partition = split;
    }
    Err(EngineError::new(Reason::ChartFailed, format!("some patches have no usable chart even after {MAX_RESPLITS} splits"))
        .with_hint("diagnose the surface: zero-width necks and folded faces cannot be mapped")
        .into())
}

/// The chart of a patch under its own specification or that of the session. The inner error says that the specification gives none.
fn spec_and_chart_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    surface: &Surface,
    patches: &PatchSet,
    p: usize,
) -> Step<Result<Stored<ChartOutcome>>> {
    let Some(own) = snapshot.patch_charts.get(&patches.identities[p]) else {
        let chart = chart_step(context, &snapshot.chart, patches, p)?;
        return Ok(match refusal(&chart, patches, p) {
            Some(error) => Err(error),
            None => Ok(chart),
        });
    };
    let spec = match own.localised(&patches.patches[p].2, &surface.imported.mesh.positions) {
        Ok(spec) => spec,
        Err(error) => return Ok(Err(error)),
    };
    match chart_step(context, &spec, patches, p) {
        Ok(chart) => match &*chart.value {
            ChartOutcome::Mapped(_) => Ok(Ok(chart)),
            ChartOutcome::Refused(error) => Ok(Err(refusal(&chart, patches, p).unwrap_or_else(|| error.clone()))),
            ChartOutcome::MustSplit { reason, .. } => {
                let message = format!("patch {p} has no usable chart under its own specification: {reason}");
                Ok(Err(EngineError::new(Reason::ChartFailed, message)
                    .with_hint("take the specification of the patch back, so that it can be split")
                    .with_metadata("patch", p)))
            }
        },
        Err(Halt::Error(error)) if !error.stops_work() => Ok(Err(error.with_metadata("patch", p))),
        Err(halt) => Err(halt),
    }
}

/// The chart a patch would have under another specification (vertices of the imported mesh), and the maps that were tried for it.
pub(super) fn preview_step(
    context: &Context<'_>,
    layout: &Layout,
    p: usize,
    spec: &ChartSpec,
) -> Step<(Stored<ChartOutcome>, Vec<Stored<SolvedMap>>)> {
    let map = &layout.patches.patches[p].2;
    let spec = spec.localised(map, &layout.surface.imported.mesh.positions)?;
    let chart = chart_step(context, &spec, &layout.patches, p)?;
    let tried = tried_maps(context, &spec, &layout.patches, p).map_err(|halt| on_surface(halt, map))?;
    Ok((chart, tried))
}

/// `spec` has local vertices; errors name elements of the surface.
fn chart_step(context: &Context<'_>, spec: &ChartSpec, patches: &PatchSet, p: usize) -> Step<Stored<ChartOutcome>> {
    let (patch, fingerprint, map) = &patches.patches[p];
    let key = StageKey::new(Stage::Chart, |f| {
        f.fingerprint(*fingerprint).text(&format!("{spec:?}"));
    });
    let tried = || tried_maps(context, spec, patches, p);
    context.staged(key, Subject::Patch(p as u32), tried, |tried, _| Ok(conclude(patch, spec, &tried))).map_err(|halt| on_surface(halt, map))
}

/// The maps of a patch up to the first that can be used.
fn tried_maps(context: &Context<'_>, spec: &ChartSpec, patches: &PatchSet, p: usize) -> Step<Vec<Stored<SolvedMap>>> {
    let maps = candidate_maps(&patches.patches[p].0, spec)?;
    let mut tried = Vec::new();
    while let Some(map) = next_map(&maps, &tried) {
        tried.push(solve_step(context, map, patches, p)?);
    }
    Ok(tried)
}

fn solve_step(context: &Context<'_>, map: &MapSpec, patches: &PatchSet, p: usize) -> Step<Stored<SolvedMap>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    let key = StageKey::new(Stage::Solve, |f| {
        f.fingerprint(*fingerprint).text(&format!("{map:?}"));
    });
    let problem = map.problem();
    let factors = || -> Step<Result<(Option<Stored<Kept<ChartFactor>>>, Stored<Kept<BoundaryFactor>>)>> {
        // An operator that cannot be factorized is the end of this map, not of the chart.
        let interior = match problem.family.interior().map(|weights| factor_step(context, weights, patches, p)).transpose() {
            Ok(interior) => interior,
            Err(halt) => return one_map_fails(halt),
        };
        match boundary_step(context, problem, patches, p) {
            Ok(boundary) => Ok(Ok((interior, boundary))),
            Err(halt) => one_map_fails(halt),
        }
    };
    context.staged(key, Subject::Patch(p as u32), factors, |factors, work| match factors {
        Ok((interior, boundary)) => solve_map(patch, interior.as_ref().map(|f| &f.value.output), &boundary.value.output, map, work),
        Err(error) => Ok(unsolved_map(map, &error)),
    })
}

fn one_map_fails<T>(halt: Halt) -> Step<Result<T>> {
    match halt {
        Halt::Error(error) if error.fails_one_map() => Ok(Err(error)),
        halt => Err(halt),
    }
}

fn boundary_step(context: &Context<'_>, problem: ProblemSpec, patches: &PatchSet, p: usize) -> Step<Stored<Kept<BoundaryFactor>>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    // Mean value has no interior to share: its one factorization is the dear one.
    let stage = if problem.family.interior().is_some() { Stage::Boundary } else { Stage::Factor };
    let key = StageKey::new(stage, |f| {
        f.fingerprint(*fingerprint).text(&format!("{problem:?}"));
    });
    let of = key.input;
    let interior = || problem.family.interior().map(|weights| factor_step(context, weights, patches, p)).transpose();
    context.staged(key, Subject::Patch(p as u32), interior, |interior, work| {
        let factor = factor_boundary(patch, interior.as_ref().map(|f| &f.value.output), problem, work)?;
        Ok(Kept { bytes: factor.bytes(), output: factor, of })
    })
}

fn factor_step(context: &Context<'_>, weights: Weights, patches: &PatchSet, p: usize) -> Step<Stored<Kept<ChartFactor>>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    let key = StageKey::new(Stage::Factor, |f| {
        f.fingerprint(*fingerprint).text(&format!("{weights:?}"));
    });
    let of = key.input;
    context.staged(
        key,
        Subject::Patch(p as u32),
        || system_step(context, patches, p),
        |system, work| {
            let factor = factor_system(patch, &system.value.output, weights, work)?;
            Ok(Kept { bytes: factor.bytes(), output: factor, of })
        },
    )
}

/// Keyed by connectivity only, so that it outlives moved vertices.
fn system_step(context: &Context<'_>, patches: &PatchSet, p: usize) -> Step<Stored<Kept<ChartSystem>>> {
    let (patch, ..) = &patches.patches[p];
    let key = StageKey::new(Stage::System, |f| {
        f.u64(patch.positions.len() as u64).tuples(&patch.triangles);
    });
    let of = key.input;
    context.stage(key, Subject::Patch(p as u32), |work| {
        let factor = plan_system(patch, work)?;
        Ok(Kept { bytes: factor.bytes(), output: factor, of })
    })
}

pub(super) fn size_step(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts) -> Step<Stored<SizeField>> {
    let spec = snapshot.size.as_ref().ok_or_else(|| {
        EngineError::bad_parameter("size", "no size is set")
            .with_hint("set a uniform size, a triangle count, per-vertex sizes or a graded field")
    })?;
    let key = StageKey::new(Stage::Size, |f| {
        f.fingerprint(charts.surface.imported.output).fingerprint(charts.features.output).text(&format!("{spec:?}"));
    });
    let surface = &charts.surface;
    context.stage(key, Subject::Surface, |work| evaluate_size(&surface.imported.mesh, &surface.topology, &charts.features, spec, work))
}

/// Lifted meshes of patches and the curve meshes they share.
pub(super) struct Lifted {
    curves: Vec<Option<Stored<CurveMesh>>>,
    /// One for each listed patch, in the order listed.
    pub(super) lifted: Vec<Stored<LiftedPatch>>,
}

pub(super) fn lifted_step(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts, sizes: &SizeField, listed: &[u32]) -> Step<Lifted> {
    let patches = &charts.patches;
    let mut wanted: Vec<usize> = listed.iter().flat_map(|&p| patches.uses[p as usize].iter().map(|u| u.curve as usize)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    // Sizes at the vertices of the surface that the patches are cut out of.
    let split_sizes = charts.cut.as_ref().map(|cut| cut.at_vertices(&sizes.vertex_size));
    let vertex_size = split_sizes.as_deref().unwrap_or(&sizes.vertex_size);
    let meshed = context.each(&wanted, |c| curve_step(context, charts, vertex_size, c))?;
    let mut curves = vec![None; patches.network.curves.len()];
    for (c, mesh) in wanted.into_iter().zip(meshed) {
        curves[c] = Some(mesh);
    }
    let order = largest_first(patches, listed.iter().map(|&p| p as usize));
    let by_patch = context.each(&order, |p| lift_step(context, snapshot, charts, vertex_size, &curves, p))?;
    // `each` gives results by increasing patch; hand them out in the order asked for.
    let mut sorted: Vec<u32> = listed.to_vec();
    sorted.sort_unstable();
    let lifted = listed.iter().map(|p| by_patch[sorted.partition_point(|q| q < p)].clone()).collect();
    Ok(Lifted { curves, lifted })
}

fn curve_step(context: &Context<'_>, charts: &Charts, vertex_size: &[f64], c: usize) -> Step<Stored<CurveMesh>> {
    let (mesh, topology) = charts.ground();
    let curve = &charts.patches.network.curves[c];
    let polyline: CurvePolyline = curve_polyline(mesh, topology, curve, vertex_size);
    let key = StageKey::new(Stage::Curve, |f| polyline.feed(f));
    context.stage(key, Subject::Curve(c as u32), |work| mesh_curve(&polyline, work))
}

fn lift_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: &Charts,
    vertex_size: &[f64],
    curves: &[Option<Stored<CurveMesh>>],
    p: usize,
) -> Step<Stored<LiftedPatch>> {
    let (patch, fingerprint, map) = &charts.patches.patches[p];
    let subject = Subject::Patch(p as u32);
    let chart = charts.chart(p).ok_or_else(|| EngineError::invariant(format!("patch {p} has no chart")))?;
    // Quadrangles are made of frontal triangles: they share them.
    let mesher = if snapshot.mesher.quads().is_some() { Mesher::Frontal } else { snapshot.mesher };
    let local_size: Vec<f64> = map.vertices.iter().map(|&v| vertex_size[v as usize]).collect();
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
        for (used, mesh) in uses.iter().zip(&meshes) {
            f.u32s(&used.path).fingerprint(mesh.output);
        }
    });
    let planar: Stored<PlanarMesh> =
        context.stage(key, subject, |work| mesh_chart(patch, chart, &local_uses, &local_size, mesher, work))?;
    let key = StageKey::new(Stage::Lift, |f| {
        f.fingerprint(key.input).fingerprint(planar.output);
    });
    let lifted: Stored<LiftedPatch> = context.stage(key, subject, |_| Ok(lift(patch, &planar, &local_uses)))?;
    let spec = &snapshot.optimize;
    let key = StageKey::new(Stage::Interior, |f| {
        f.fingerprint(*fingerprint).fingerprint(lifted.output).f64s(&local_size).text(&format!("{spec:?}"));
    });
    context.stage(key, subject, |work| optimize_patch(patch, &lifted, &local_size, spec, work))
}

pub(super) fn remesh_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Remesh> {
    let quads = snapshot.mesher.quads();
    let whole = [Stage::Assembly, Stage::Optimize, Stage::Quads];
    let below_charts = &whole[..if quads.is_some() { 3 } else { 2 }];
    let charts = charts_step(context, snapshot).map_err(|halt| context.and_below(halt, below_charts, &[]))?;
    // Looked at before anything below it can halt a plan.
    let tree = search_tree_step(context, &charts.surface.imported);
    let patches = (0..charts.charts.len() as u32).map(Subject::Patch);
    let curves = (0..charts.patches.network.curves.len() as u32).map(Subject::Curve);
    let each: Vec<(Stage, Subject)> = curves
        .map(|c| (Stage::Curve, c))
        .chain(patches.flat_map(|p| [(Stage::Planar, p), (Stage::Lift, p), (Stage::Interior, p)]))
        .collect();
    let below = |halt| context.and_below(halt, below_charts, &each);
    let wanted = size_step(context, snapshot, &charts).map_err(below)?;
    let sizes = match quads {
        None => wanted.clone(),
        Some(kind) => {
            let base = base_sizes(&wanted, kind);
            Stored { output: base.fingerprint(), bytes: base.bytes(), value: Arc::new(base) }
        }
    };
    let all: Vec<u32> = (0..charts.charts.len() as u32).collect();
    let meshes = lifted_step(context, snapshot, &charts, &sizes, &all).map_err(below)?;
    let tree = tree.map_err(below)?;
    let assembled = assembly_step(context, &charts, &meshes).map_err(below)?;
    let spec = &snapshot.optimize;
    let freedom = RegionFreedom::new(&charts.features.compounds, snapshot.features.region_borders);
    let key = StageKey::new(Stage::Optimize, |f| {
        f.fingerprint(charts.surface.imported.output).fingerprint(assembled.output).fingerprint(sizes.output).text(&format!("{spec:?}"));
        if !freedom.is_none() {
            f.u32s(&freedom.groups());
        }
    });
    let input = &charts.surface.imported.mesh;
    let result = context.stage(key, Subject::Surface, |work| {
        let mut result = optimize_surface(input, &tree.value.output, &assembled, Interiors::Optimized, &sizes, spec, work)?;
        let (mesh, fixed) = (&mut result.mesh, &result.curve_edges);
        result.lost_regions = assign_regions(input, &tree.value.output, mesh, fixed, freedom, work)?;
        Ok(result)
    });
    let result = match quads {
        None => result?,
        Some(kind) => {
            let base = result.map_err(|halt| context.and_below(halt, &[Stage::Quads], &[]))?;
            quads_step(context, &charts, &tree, &base, &wanted, kind)?
        }
    };
    Ok(Remesh { charts, sizes: wanted, assembled, result })
}

fn quads_step(
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

fn assembly_step(context: &Context<'_>, charts: &Charts, meshes: &Lifted) -> Step<Stored<Assembled>> {
    let key = StageKey::new(Stage::Assembly, |f| {
        f.fingerprint(charts.patches.output).fingerprint(charts.features.output);
        for lifted in &meshes.lifted {
            f.fingerprint(lifted.output);
        }
    });
    context.stage(key, Subject::Surface, |_| {
        let curve_meshes: Vec<Arc<CurveMesh>> =
            meshes.curves.iter().map(|c| c.as_ref().map_or_else(Arc::default, |mesh| mesh.value.clone())).collect();
        let numbered: Vec<(Arc<LiftedPatch>, &PatchMap)> = (0..meshes.lifted.len())
            .map(|p| (Arc::new(with_network_numbers(&meshes.lifted[p], &charts.patches.uses[p])), &*charts.patches.patches[p].2))
            .collect();
        let topology = charts.ground().1;
        assemble(&charts.surface.imported.mesh, topology, &charts.features.corners, &charts.patches.network, &curve_meshes, &numbered)
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

fn search_tree_step(context: &Context<'_>, imported: &Stored<Imported>) -> Step<Stored<Kept<TriangleBvh>>> {
    let key = StageKey::new(Stage::SearchTree, |f| {
        f.fingerprint(imported.output);
    });
    let mesh = &imported.mesh;
    let of = imported.output;
    context.stage(key, Subject::Surface, |_| {
        let tree = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        Ok(Kept { bytes: tree.bytes(), output: tree, of })
    })
}
