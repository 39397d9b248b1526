//! The one file that ties stage functions to stage keys, in the order of the pipeline. In a plan, a stage that is not cached is
//! recorded as "will run" and nothing below it is looked at.

mod charts;
mod edits;
mod lengths;
mod meshes;
mod quads;
mod quality;
mod sizes;

pub(super) use charts::preview_step;
pub(super) use lengths::{Wanted, metric_step};
pub(super) use meshes::lifted_step;
pub(super) use quality::{compare_step, intersections_step, quality_step, result_sizes};
pub(super) use sizes::{check_size_is_set, size_step};

use super::context::{Context, Step};
use super::kept::Kept;
use super::patch_set::PatchSet;
use super::{Charts, Layout, Partitioned, Remesh, Surface};
use crate::assemble::Assembled;
use crate::bvh::TriangleBvh;
use crate::curve::{patch_curves, trace_curves};
use crate::cut::{CutSurface, cut_along_borders};
use crate::error::{EngineError, Reason, Result};
use crate::features::{Features, detect_features};
use crate::fingerprint::Contents;
use crate::import::{ImportOptions, Imported, import_arrays, import_mesh};
use crate::mesh::SurfaceMesh;
use crate::metric::SurfaceMetric;
use crate::optimize::{Interiors, Remeshed, optimize_in_metric, optimize_surface};
use crate::parametrize::ChartOutcome;
use crate::partition::{BorderSmoothing, Partition, partition_surface, patch_identities, split_patches};
use crate::patch::extract_patches;
use crate::planar::{LiftedPatch, Mesher};
use crate::regions::{RegionFreedom, assign_regions};
use crate::sample;
use crate::session::{MeshSource, Snapshot};
use crate::sizing::{SizeBase, SizeField, SizeSpec};
use crate::stage::{Stage, StageKey, Stored, Subject};
use crate::topology::Topology;
use charts::spec_and_chart_step;
use meshes::assembly_step;
use quads::quads_step;
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
    context.note_sizes(|sizes| sizes.source = source.bytes() as f64);
    let imported = context.stage(key, Subject::Surface, |work| match source {
        MeshSource::File(blob) => import_mesh(&blob.bytes()?, options, work),
        MeshSource::Arrays { mesh, .. } => import_arrays(SurfaceMesh::clone(mesh), options, work),
        MeshSource::Sample(spec) => import_arrays(sample::generate(spec, work)?, options, work),
    })?;
    context.note_sizes(|sizes| sizes.faces = imported.mesh.triangles.len() as f64);
    Ok(imported)
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

fn partition_step(context: &Context<'_>, snapshot: &Snapshot, surface: &Surface, features: &Stored<Features>) -> Step<Stored<Partition>> {
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
    let patches = context.stage(key, Subject::Surface, |_| {
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
    })?;
    context.note_sizes(|sizes| sizes.patches = patches.patches.iter().map(|(patch, ..)| patch.triangles.len() as f64).collect());
    Ok(patches)
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

pub(super) fn remesh_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Remesh> {
    check_size_is_set(snapshot)?;
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
        .filter(|(stage, _)| *stage != Stage::Interior || snapshot.mesher != Mesher::Anisotropic)
        .collect();
    note_wanted(context, snapshot, &charts);
    let below = |halt| context.and_below(halt, below_charts, &each);
    let sizes = size_step(context, snapshot, &charts).map_err(below)?;
    let all: Vec<u32> = (0..charts.charts.len() as u32).collect();
    let metric = metric_step(context, snapshot, &charts, &sizes).map_err(below)?;
    let lengths = Wanted::new(&sizes, metric.as_deref());
    let meshes = lifted_step(context, snapshot, &charts, lengths, &all).map_err(below)?;
    let tree = tree.map_err(below)?;
    let assembled = assembly_step(context, &charts, &sizes, &meshes).map_err(below)?;
    let parts = Joined { charts: &charts, sizes: &sizes, metric: metric.as_ref(), assembled: &assembled };
    let result = optimize_step(context, snapshot, &tree, &parts);
    let result = match quads {
        None => result?,
        Some(kind) => {
            let base = result.map_err(|halt| context.and_below(halt, &[Stage::Quads], &[]))?;
            quads_step(context, &charts, &tree, &base, &sizes, kind)?
        }
    };
    Ok(Remesh { charts, sizes, metric, assembled, result })
}

/// The listed patches up to their lifted meshes.
pub(super) fn listed_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: Charts,
    patches: &[u32],
) -> Step<(Charts, Vec<Stored<LiftedPatch>>)> {
    let count = charts.charts.len();
    if let Some(&unknown) = patches.iter().find(|&&p| p as usize >= count) {
        let message = format!("there is no patch {unknown}; the surface has {count}");
        return Err(EngineError::new(Reason::PatchNotFound, message).into());
    }
    note_wanted(context, snapshot, &charts);
    let stages: &[Stage] = match snapshot.mesher {
        Mesher::Anisotropic => &[Stage::Planar, Stage::Lift],
        _ => &[Stage::Planar, Stage::Lift, Stage::Interior],
    };
    let each: Vec<(Stage, Subject)> = patches.iter().flat_map(|&p| stages.iter().map(move |&s| (s, Subject::Patch(p)))).collect();
    let below = |halt| context.and_below(halt, &[], &each);
    let sizes = size_step(context, snapshot, &charts).map_err(below)?;
    let metric = metric_step(context, snapshot, &charts, &sizes).map_err(below)?;
    let lengths = Wanted::new(&sizes, metric.as_deref());
    let meshes = lifted_step(context, snapshot, &charts, lengths, patches).map_err(below)?;
    Ok((charts, meshes.lifted))
}

/// Tells the walk about how many triangles are wanted, where the specification says so by itself.
pub(super) fn note_wanted(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts) {
    let area: f64 = charts.partition.patches.iter().map(|p| p.area).sum();
    // An equilateral triangle of side h has the area sqrt(3)/4 h^2.
    let of_size = |size: f64| area / (0.433 * size * size);
    let wanted = match &snapshot.size {
        Some(SizeSpec::Uniform { size }) => of_size(*size),
        Some(SizeSpec::TriangleCount { triangles }) => *triangles as f64,
        Some(SizeSpec::Composed(composed)) => match composed.base {
            SizeBase::Triangles(triangles) => triangles as f64,
            SizeBase::Uniform(size) => of_size(size),
            SizeBase::MaxSize => 0.0,
        },
        _ => 0.0,
    };
    context.note_sizes(|sizes| sizes.wanted = if wanted.is_finite() { wanted } else { 0.0 });
}

/// What the optimisation is done to.
struct Joined<'a> {
    charts: &'a Charts,
    /// For the triangles, be they of quadrangles.
    sizes: &'a Stored<SizeField>,
    metric: Option<&'a Stored<SurfaceMetric>>,
    assembled: &'a Stored<Assembled>,
}

fn optimize_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    tree: &Stored<Kept<TriangleBvh>>,
    parts: &Joined<'_>,
) -> Step<Stored<Remeshed>> {
    let Joined { charts, sizes, metric, assembled } = parts;
    let spec = &snapshot.optimize;
    let freedom = RegionFreedom::new(&charts.features.compounds, snapshot.features.region_borders);
    let key = StageKey::new(Stage::Optimize, |f| {
        f.fingerprint(charts.surface.imported.output).fingerprint(assembled.output).fingerprint(sizes.output).text(&format!("{spec:?}"));
        if !freedom.is_none() {
            f.u32s(&freedom.groups());
        }
        if let Some(metric) = metric {
            f.fingerprint(metric.output);
        }
    });
    let input = &charts.surface.imported.mesh;
    context.stage(key, Subject::Surface, |work| {
        let mut result = match metric {
            None => optimize_surface(input, &tree.value.output, assembled, Interiors::Optimized, sizes, spec, work)?,
            Some(metric) => optimize_in_metric(input, &tree.value.output, assembled, metric, spec, work)?,
        };
        let (mesh, fixed) = (&mut result.mesh, &result.curve_edges);
        result.lost_regions = assign_regions(input, &tree.value.output, mesh, fixed, freedom, work)?;
        Ok(result)
    })
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
