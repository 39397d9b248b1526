//! The one file that ties stage functions to stage keys, in the order of the pipeline. The same functions carry out a request
//! and plan it: in a plan, a stage that is not cached is recorded as "will run" and nothing below it is looked at.

pub mod context;

pub use context::{Event, Progress, Run};

use crate::assemble::{Assembled, assemble};
use crate::bvh::TriangleBvh;
use crate::curve::{CurveMesh, CurveNetwork, CurvePolyline, curve_polyline, mesh_curve, trace_curves};
use crate::engine::Engine;
use crate::error::{EngineError, Reason, Result};
use crate::features::{Features, detect_features};
use crate::fingerprint::{Contents, Feeder, Fingerprint};
use crate::import::{ImportOptions, Imported, import_arrays, import_mesh};
use crate::mesh::SurfaceMesh;
use crate::optimize::{Remeshed, optimize_surface};
use crate::parametrize::{Chart, ChartOutcome, ConformalFactor, factor_conformal, parametrize_patch};
use crate::partition::{Partition, partition_surface, split_patches};
use crate::patch::{Patch, PatchMap, extract_patches};
use crate::planar::{CurveUse, LiftedPatch, PlanarMesh, VertexOrigin, lift, mesh_chart};
use crate::quality::{QualityReport, QualityScope, TargetSize, measure_quality};
use crate::sample;
use crate::session::{MeshSource, Snapshot};
use crate::sizing::{SizeField, evaluate_size};
use crate::stage::{Outcome, Stage, StageKey, StageRecord, Stored, Subject};
use crate::topology::Topology;
use context::{Context, Halt, Step};
use std::sync::Arc;

/// A result with what it took.
#[derive(Debug, Clone)]
pub struct Answer<T> {
    /// The result.
    pub value: T,
    /// What every stage did, in pipeline order.
    pub records: Vec<StageRecord>,
}

/// A surface that can be remeshed.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The imported mesh with its report and diagnosis.
    pub imported: Stored<Imported>,
    /// Its adjacency.
    pub topology: Stored<Topology>,
}

/// The patches of a partition, cut out, and the curves between them.
#[derive(Debug, Default)]
pub struct PatchSet {
    /// Each patch with its fingerprint and its place in the surface.
    pub patches: Vec<(Arc<Patch>, Fingerprint, Arc<PatchMap>)>,
    /// The curves.
    pub network: CurveNetwork,
    /// For each patch the curves it must respect.
    pub uses: Vec<Vec<PatchCurve>>,
}

/// A curve as a patch sees it.
#[derive(Debug, Clone)]
pub struct PatchCurve {
    /// Curve of the network.
    pub curve: u32,
    /// Local vertices of the patch along the curve.
    pub path: Vec<u32>,
}

impl Contents for PatchSet {
    fn feed(&self, into: &mut Feeder) {
        for (_, fingerprint, map) in &self.patches {
            into.fingerprint(*fingerprint).u32s(&map.vertices);
        }
        for curve in &self.network.curves {
            into.u64(curve.kind as u64).u32s(&curve.halfedges);
        }
    }

    fn bytes(&self) -> usize {
        let patches: usize = self.patches.iter().map(|(p, _, m)| p.bytes() + (m.vertices.len() + m.faces.len()) * 4).sum();
        let curves: usize = self.network.curves.iter().map(|c| c.halfedges.len() * 4 + 40).sum();
        patches + curves + self.uses.iter().flatten().map(|u| u.path.len() * 4 + 32).sum::<usize>()
    }
}

/// A partitioned surface with a chart for every patch.
#[derive(Debug, Clone)]
pub struct Charts {
    /// The surface.
    pub surface: Surface,
    /// Its features.
    pub features: Stored<Features>,
    /// The partition all of whose patches have a chart.
    pub partition: Stored<Partition>,
    /// The patches.
    pub patches: Stored<PatchSet>,
    /// Outcome of each patch; all are mapped.
    pub charts: Vec<Stored<ChartOutcome>>,
    /// How many patches had to be split because no chart of theirs was usable.
    pub resplit: u32,
}

impl Charts {
    /// The chart of a patch.
    pub fn chart(&self, patch: usize) -> Option<&Chart> {
        match &*self.charts.get(patch)?.value {
            ChartOutcome::Mapped(chart) => Some(chart),
            ChartOutcome::MustSplit { .. } => None,
        }
    }
}

/// A finished remesh and what led to it.
#[derive(Debug, Clone)]
pub struct Remesh {
    /// Partition and charts.
    pub charts: Charts,
    /// Wanted sizes.
    pub sizes: Stored<SizeField>,
    /// The finished mesh.
    pub result: Stored<Remeshed>,
}

/// Largest number of times patches without a usable chart are split.
const MAX_RESPLITS: usize = 24;

/// Imports the surface of a snapshot, whether or not it can be remeshed.
///
/// # Errors
/// [`Reason::NoMesh`], those of [`import_mesh`].
pub fn import(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Stored<Imported>>> {
    Context::execute(engine, run, |context| import_step(context, snapshot))
}

/// Imports and checks that the surface can be remeshed.
///
/// # Errors
/// Those of [`import`], and the refusal of [`crate::diagnose::Diagnosis::refusal`].
pub fn surface(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Surface>> {
    Context::execute(engine, run, |context| surface_step(context, snapshot))
}

/// Partitions the surface (before any split that charts ask for).
///
/// # Errors
/// Those of [`surface`], [`detect_features`] and [`partition_surface`].
pub fn partition(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Stored<Partition>>> {
    Context::execute(engine, run, |context| {
        let surface = surface_step(context, snapshot)?;
        let features = features_step(context, snapshot, &surface)?;
        partition_step(context, snapshot, &surface, &features)
    })
}

/// Partitions the surface and computes the charts of all patches.
///
/// # Errors
/// Those of [`partition`] and [`parametrize_patch`].
pub fn charts(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Charts>> {
    Context::execute(engine, run, |context| charts_step(context, snapshot))
}

/// Remeshes the listed patches only, up to their lifted meshes (neighbours stay conforming: curves are shared).
///
/// # Errors
/// [`Reason::PatchNotFound`], and those of [`remesh`].
pub fn remesh_patches(
    engine: &Engine,
    snapshot: &Snapshot,
    patches: &[u32],
    run: &Run<'_>,
) -> Result<Answer<(Charts, Vec<Stored<LiftedPatch>>)>> {
    Context::execute(engine, run, |context| {
        let charts = charts_step(context, snapshot)?;
        let count = charts.charts.len();
        if let Some(&unknown) = patches.iter().find(|&&p| p as usize >= count) {
            let message = format!("there is no patch {unknown}; the surface has {count}");
            return Err(EngineError::new(Reason::PatchNotFound, message).into());
        }
        let sizes = size_step(context, snapshot, &charts)?;
        let meshes = lifted_step(context, snapshot, &charts, &sizes, patches)?;
        Ok((charts, meshes.lifted))
    })
}

/// The whole pipeline up to the finished mesh.
///
/// # Errors
/// [`Reason::BadParameter`] if no size is set; those of all stages.
pub fn remesh(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Remesh>> {
    Context::execute(engine, run, |context| remesh_step(context, snapshot))
}

/// Remeshes (from the cache, if nothing changed) and measures the result against the input.
///
/// # Errors
/// Those of [`remesh`] and [`measure_quality`].
pub fn quality(
    engine: &Engine,
    snapshot: &Snapshot,
    scope: QualityScope,
    run: &Run<'_>,
) -> Result<Answer<(Remesh, Stored<QualityReport>)>> {
    Context::execute(engine, run, |context| {
        let remesh = remesh_step(context, snapshot)?;
        let report = quality_step(context, &remesh, scope)?;
        Ok((remesh, report))
    })
}

/// Measures any mesh against any other, as [`quality`] does for results: for meshes that other tools made. Both are imported with
/// the same repairs as every surface; `size` is the wanted edge length for tau.
///
/// # Errors
/// Those of [`import_mesh`] and [`measure_quality`].
pub fn compare(
    engine: &Engine,
    input: (&MeshSource, &ImportOptions),
    output: (&MeshSource, &ImportOptions),
    size: Option<f64>,
    scope: QualityScope,
    run: &Run<'_>,
) -> Result<Answer<Stored<QualityReport>>> {
    if size.is_some_and(|size| !(size > 0.0 && size.is_finite())) {
        return Err(EngineError::bad_parameter("size", "the wanted edge length must be positive and finite"));
    }
    Context::execute(engine, run, |context| {
        let before = import_source_step(context, input.0, input.1)?;
        let after = import_source_step(context, output.0, output.1)?;
        let tree = search_tree_step(context, &before)?;
        let key = StageKey::new(Stage::Quality, |f| {
            f.text("compare").fingerprint(before.output).fingerprint(after.output).option_f64(size).u64(scope as u64);
        });
        let target = size.map(TargetSize::Uniform);
        context.stage(key, Subject::Surface, |work| measure_quality(&before.mesh, &tree.tree, &after.mesh, target.as_ref(), scope, work))
    })
}

/// What a request for the finished mesh would find in the cache and what it would run. Computes nothing.
/// Where a stage will run, the stages below it that work on the whole surface are listed as running too; patches and curves
/// of a partition that is not known yet cannot be listed.
///
/// # Errors
/// [`Reason::NoMesh`], [`Reason::BadParameter`] if no size is set, a refusal that is already known.
pub fn plan(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| remesh_step(context, snapshot).map(|_| ()))
}

fn import_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Stored<Imported>> {
    let source = snapshot.source.as_ref().ok_or_else(|| {
        EngineError::new(Reason::NoMesh, "the session holds no mesh").with_hint("import a file, arrays or a sample first")
    })?;
    import_source_step(context, source, &snapshot.import)
}

fn import_source_step(context: &Context<'_>, source: &MeshSource, options: &ImportOptions) -> Step<Stored<Imported>> {
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

fn surface_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Surface> {
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

fn features_step(context: &Context<'_>, snapshot: &Snapshot, surface: &Surface) -> Step<Stored<Features>> {
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

fn patches_step(
    context: &Context<'_>,
    surface: &Surface,
    features: &Stored<Features>,
    partition: &Stored<Partition>,
) -> Step<Stored<PatchSet>> {
    let key = StageKey::new(Stage::Patches, |f| {
        f.fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(partition.output);
    });
    context.stage(key, Subject::Surface, |_| {
        let network = trace_curves(&surface.topology, features, partition);
        let cut = extract_patches(&surface.imported.mesh, &surface.topology, partition)?;
        let uses = curve_uses(&surface.topology, partition, &network, &cut)?;
        let patches = cut.into_iter().map(|(patch, map)| {
            let fingerprint = patch.fingerprint();
            (Arc::new(patch), fingerprint, Arc::new(map))
        });
        Ok(PatchSet { patches: patches.collect(), network, uses })
    })
}

/// The local vertices of each patch along each curve beside or inside it.
fn curve_uses(
    topology: &Topology,
    partition: &Partition,
    network: &CurveNetwork,
    cut: &[(Patch, PatchMap)],
) -> Result<Vec<Vec<PatchCurve>>> {
    let mut local_face = vec![0u32; topology.face_count()];
    for (_, map) in cut {
        for (local, &global) in map.faces.iter().enumerate() {
            local_face[global as usize] = local as u32;
        }
    }
    let local_corner = |halfedge: u32| {
        let face = topology.face(halfedge) as usize;
        cut[partition.face_patch[face] as usize].0.triangles[local_face[face] as usize][halfedge as usize % 3]
    };
    let mut uses: Vec<Vec<PatchCurve>> = vec![Vec::new(); cut.len()];
    for (number, curve) in network.curves.iter().enumerate() {
        let curve_number = number as u32;
        let (Some(&first), Some(&last)) = (curve.halfedges.first(), curve.halfedges.last()) else {
            return Err(EngineError::invariant(format!("curve {number} has no edge")));
        };
        let left = partition.face_patch[topology.face(first) as usize];
        let mut path: Vec<u32> = curve.halfedges.iter().map(|&h| local_corner(h)).collect();
        path.push(local_corner(topology.next(last)));
        uses[left as usize].push(PatchCurve { curve: curve_number, path });
        let Some(twin) = topology.twin(first) else { continue };
        let right = partition.face_patch[topology.face(twin) as usize];
        if right == left {
            continue;
        }
        let twins: Option<Vec<u32>> = curve.halfedges.iter().map(|&h| topology.twin(h)).collect();
        let twins = twins.ok_or_else(|| EngineError::invariant(format!("curve {number} runs along the boundary and inside")))?;
        let mut path: Vec<u32> = twins.iter().map(|&t| local_corner(topology.next(t))).collect();
        path.push(local_corner(twins[twins.len() - 1]));
        uses[right as usize].push(PatchCurve { curve: curve_number, path });
    }
    Ok(uses)
}

/// Indices of patches, those with most faces first, so that threads end at about the same time.
fn largest_first(patches: &PatchSet, listed: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut order: Vec<usize> = listed.collect();
    order.sort_by_key(|&p| (std::cmp::Reverse(patches.patches[p].0.triangles.len()), p));
    order
}

fn charts_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Charts> {
    let surface = surface_step(context, snapshot)?;
    let features = features_step(context, snapshot, &surface)?;
    let mut partition = partition_step(context, snapshot, &surface, &features)?;
    let mut resplit = 0;
    for _ in 0..=MAX_RESPLITS {
        let patches = patches_step(context, &surface, &features, &partition)?;
        let order = largest_first(&patches, 0..patches.patches.len());
        let charts = context.each(&order, |p| chart_step(context, snapshot, &patches, p))?;
        let failing: Vec<u32> =
            (0..charts.len()).filter(|&p| matches!(*charts[p].value, ChartOutcome::MustSplit { .. })).map(|p| p as u32).collect();
        if failing.is_empty() {
            return Ok(Charts { surface, features, partition, patches, charts, resplit });
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

fn chart_step(context: &Context<'_>, snapshot: &Snapshot, patches: &PatchSet, p: usize) -> Step<Stored<ChartOutcome>> {
    let (patch, fingerprint, _) = &patches.patches[p];
    let subject = Subject::Patch(p as u32);
    let spec = snapshot.chart;
    let key = StageKey::new(Stage::Chart, |f| {
        f.fingerprint(*fingerprint).text(&format!("{spec:?}"));
    });
    context.nested_stage(key, subject, |work| {
        let factor_key = StageKey::new(Stage::Factor, |f| {
            f.fingerprint(*fingerprint);
        });
        let factor =
            context.stage(factor_key, subject, |work| factor_conformal(patch, work).map(|factor| Factor { factor, of: *fingerprint }));
        let factor = match factor {
            Ok(factor) => Ok(factor),
            Err(Halt::Error(error)) if error.reason() == Reason::SolverSingular => Err(error),
            Err(halt) => return Err(halt),
        };
        Ok(parametrize_patch(patch, factor.as_ref().map(|f| &f.factor), spec, work)?)
    })
}

/// A cached factor; its identity is that of the patch it belongs to.
struct Factor {
    factor: ConformalFactor,
    of: Fingerprint,
}

impl Contents for Factor {
    fn feed(&self, into: &mut Feeder) {
        into.fingerprint(self.of);
    }

    fn bytes(&self) -> usize {
        self.factor.bytes()
    }
}

fn size_step(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts) -> Step<Stored<SizeField>> {
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
struct Lifted {
    curves: Vec<Option<Stored<CurveMesh>>>,
    lifted: Vec<Stored<LiftedPatch>>,
}

fn lifted_step(context: &Context<'_>, snapshot: &Snapshot, charts: &Charts, sizes: &SizeField, listed: &[u32]) -> Step<Lifted> {
    let patches = &charts.patches;
    let mut wanted: Vec<usize> = listed.iter().flat_map(|&p| patches.uses[p as usize].iter().map(|u| u.curve as usize)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let meshed = context.each(&wanted, |c| curve_step(context, charts, sizes, c))?;
    let mut curves = vec![None; patches.network.curves.len()];
    for (c, mesh) in wanted.into_iter().zip(meshed) {
        curves[c] = Some(mesh);
    }
    let order = largest_first(patches, listed.iter().map(|&p| p as usize));
    let by_patch = context.each(&order, |p| lift_step(context, snapshot, charts, sizes, &curves, p))?;
    // `each` gives results by increasing patch; hand them out in the order asked for.
    let mut sorted: Vec<u32> = listed.to_vec();
    sorted.sort_unstable();
    let lifted = listed.iter().map(|p| by_patch[sorted.partition_point(|q| q < p)].clone()).collect();
    Ok(Lifted { curves, lifted })
}

fn curve_step(context: &Context<'_>, charts: &Charts, sizes: &SizeField, c: usize) -> Step<Stored<CurveMesh>> {
    let surface = &charts.surface;
    let curve = &charts.patches.network.curves[c];
    let polyline: CurvePolyline = curve_polyline(&surface.imported.mesh, &surface.topology, curve, &sizes.vertex_size);
    let key = StageKey::new(Stage::Curve, |f| polyline.feed(f));
    context.stage(key, Subject::Curve(c as u32), |work| mesh_curve(&polyline, work))
}

fn lift_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: &Charts,
    sizes: &SizeField,
    curves: &[Option<Stored<CurveMesh>>],
    p: usize,
) -> Step<Stored<LiftedPatch>> {
    let (patch, fingerprint, map) = &charts.patches.patches[p];
    let subject = Subject::Patch(p as u32);
    let chart = charts.chart(p).ok_or_else(|| EngineError::invariant(format!("patch {p} has no chart")))?;
    let local_size: Vec<f64> = map.vertices.iter().map(|&v| sizes.vertex_size[v as usize]).collect();
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
        f.fingerprint(*fingerprint).fingerprint(charts.charts[p].output).f64s(&local_size).text(&format!("{:?}", snapshot.mesher));
        for (used, mesh) in uses.iter().zip(&meshes) {
            f.u32s(&used.path).fingerprint(mesh.output);
        }
    });
    let planar: Stored<PlanarMesh> =
        context.stage(key, subject, |work| mesh_chart(patch, chart, &local_uses, &local_size, snapshot.mesher, work))?;
    let key = StageKey::new(Stage::Lift, |f| {
        f.fingerprint(key.input).fingerprint(planar.output);
    });
    context.stage(key, subject, |_| Ok(lift(patch, &planar, &local_uses)))
}

fn remesh_step(context: &Context<'_>, snapshot: &Snapshot) -> Step<Remesh> {
    let charts = match charts_step(context, snapshot) {
        Err(Halt::Unknown) => {
            context.will_run(&[Stage::Assembly, Stage::SearchTree, Stage::Optimize]);
            return Err(Halt::Unknown);
        }
        other => other?,
    };
    let below = |halt: Halt| {
        if matches!(halt, Halt::Unknown) {
            context.will_run(&[Stage::Assembly, Stage::Optimize]);
        }
        halt
    };
    let sizes = size_step(context, snapshot, &charts).map_err(below)?;
    let all: Vec<u32> = (0..charts.charts.len() as u32).collect();
    let tree = search_tree_step(context, &charts.surface.imported);
    let meshes = lifted_step(context, snapshot, &charts, &sizes, &all).map_err(below)?;
    let tree = tree.map_err(below)?;
    let assembled = assembly_step(context, &charts, &meshes).map_err(below)?;
    let spec = &snapshot.optimize;
    let key = StageKey::new(Stage::Optimize, |f| {
        f.fingerprint(charts.surface.imported.output).fingerprint(assembled.output).fingerprint(sizes.output).text(&format!("{spec:?}"));
    });
    let input = &charts.surface.imported.mesh;
    let result = context.stage(key, Subject::Surface, |work| optimize_surface(input, &tree.tree, &assembled, &sizes, spec, work))?;
    Ok(Remesh { charts, sizes, result })
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
        let surface = &charts.surface;
        assemble(&surface.imported.mesh, &surface.topology, &charts.features.corners, &charts.patches.network, &curve_meshes, &numbered)
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

/// A cached search tree; its identity is that of the surface it belongs to.
struct SearchTree {
    tree: TriangleBvh,
    of: Fingerprint,
}

impl Contents for SearchTree {
    fn feed(&self, into: &mut Feeder) {
        into.fingerprint(self.of);
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }
}

fn search_tree_step(context: &Context<'_>, imported: &Stored<Imported>) -> Step<Stored<SearchTree>> {
    let key = StageKey::new(Stage::SearchTree, |f| {
        f.fingerprint(imported.output);
    });
    let mesh = &imported.mesh;
    let of = imported.output;
    context.stage(key, Subject::Surface, |_| Ok(SearchTree { tree: TriangleBvh::build(&mesh.positions, &mesh.triangles), of }))
}

fn quality_step(context: &Context<'_>, remesh: &Remesh, scope: QualityScope) -> Step<Stored<QualityReport>> {
    let surface = &remesh.charts.surface;
    let tree = search_tree_step(context, &surface.imported)?;
    let key = StageKey::new(Stage::Quality, |f| {
        f.fingerprint(surface.imported.output).fingerprint(remesh.result.output).fingerprint(remesh.sizes.output).u64(scope as u64);
    });
    context.stage(key, Subject::Surface, |work| {
        let output = &remesh.result.mesh;
        let target = match remesh.sizes.uniform {
            Some(size) => TargetSize::Uniform(size),
            None => TargetSize::PerVertex(sizes_on_output(surface, &tree.tree, &remesh.sizes, output)?),
        };
        measure_quality(&surface.imported.mesh, &tree.tree, output, Some(&target), scope, work)
    })
}

/// The size field at the vertices of the output, linear on the input face below each.
fn sizes_on_output(surface: &Surface, tree: &TriangleBvh, sizes: &SizeField, output: &SurfaceMesh) -> Result<Vec<f64>> {
    let input = &surface.imported.mesh;
    let at = |point: &[f64; 3]| {
        let hit = tree.closest(*point).ok_or_else(|| EngineError::invariant("the search tree is empty"))?;
        let [a, b, c] = input.corners(hit.face as usize);
        let [i, j, k] = input.triangles[hit.face as usize].map(|v| sizes.vertex_size[v as usize]);
        let weight = |p, q| crate::vector::triangle_area(p, q, hit.position);
        let (wa, wb, wc) = (weight(b, c), weight(c, a), weight(a, b));
        let sum = wa + wb + wc;
        Ok(if sum > 0.0 { (wa * i + wb * j + wc * k) / sum } else { i })
    };
    output.positions.iter().map(at).collect()
}

/// The outcome that a plan records for a stage.
fn planned(hit: bool) -> Outcome {
    if hit { Outcome::Hit } else { Outcome::Run }
}
