//! Requests on a session: import, partition, charts, remesh, quality, plan. [`graph`] ties stages to keys; the same walk carries a
//! request out or, for a plan, only looks at what is cached.

mod context;
mod graph;
mod kept;
mod naming;
mod patch_set;

pub use context::{Event, Progress, Run};
pub use patch_set::PatchSet;

use crate::assemble::Assembled;
use crate::cut::CutSurface;
use crate::diagnose::{Defect, Diagnosis};
use crate::engine::Engine;
use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::import::{ImportOptions, Imported};
use crate::mesh::SurfaceMesh;
use crate::metric::SurfaceMetric;
use crate::optimize::{FLAT, Remeshed};
use crate::parametrize::{Chart, ChartAttempt, ChartOutcome, ChartSpec, Distortion};
use crate::partition::{EditState, Ground, Partition, PatchEdit, PatchRequest, PatchSummary, box_aspect_ratios, edit_partition, name_edit};
use crate::planar::{LiftedPatch, Mesher, QuadKind};
use crate::quality::{QualityReport, QualityScope};
use crate::session::{MeshSource, Snapshot};
use crate::sizing::{SizeBase, SizeField, SizeSpec};
use crate::stage::{Stage, StageRecord, Stored};
use crate::topology::Topology;
use crate::vector::Vec2;
use crate::work::Work;
use context::Context;
use std::collections::BTreeSet;

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

/// A partitioned surface, before charts.
#[derive(Debug, Clone)]
pub struct Partitioned {
    /// The surface.
    pub surface: Surface,
    /// Its features.
    pub features: Stored<Features>,
    /// The partition.
    pub partition: Stored<Partition>,
    /// The surface split along it, if its borders are to be straight.
    pub cut: Option<Stored<CutSurface>>,
}

impl Partitioned {
    /// The patches as they are mapped.
    pub fn summaries(&self) -> Vec<PatchSummary> {
        mapped_summaries(&self.partition, self.cut.as_deref())
    }

    /// Aspect ratio of each patch by oriented boxes.
    ///
    /// # Errors
    /// Cancellation.
    pub fn box_aspect_ratios(&self, run: &Run<'_>) -> Result<Vec<f64>> {
        let work = Work::silent(run.cancel);
        match &self.cut {
            Some(cut) => box_aspect_ratios(&cut.mesh, &cut.topology, &cut.partition, &work),
            None => box_aspect_ratios(&self.surface.imported.mesh, &self.surface.topology, &self.partition, &work),
        }
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
    /// The surface split along straight borders, if they were asked for: what the patches are cut out of.
    pub cut: Option<Stored<CutSurface>>,
    /// The patches.
    pub patches: Stored<PatchSet>,
    /// Outcome of each patch; all are mapped.
    pub charts: Vec<Stored<ChartOutcome>>,
    /// How many patches had to be split because no chart of theirs was usable.
    pub resplit: u32,
    /// What became of the edits of patches, in the order of the session's log.
    pub edits: Vec<EditState>,
}

/// A partitioned surface, some of whose patches may have a specification that gives no chart.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The surface.
    pub surface: Surface,
    /// Its features.
    pub features: Stored<Features>,
    /// The partition: its patches have a chart or a specification that gives none.
    pub partition: Stored<Partition>,
    /// The surface split along straight borders, if they were asked for: what the patches are cut out of.
    pub cut: Option<Stored<CutSurface>>,
    /// The patches.
    pub patches: Stored<PatchSet>,
    /// Chart of each patch (mapped), or what is wrong with its specification.
    pub charts: Vec<Result<Stored<ChartOutcome>>>,
    /// How many patches had to be split because no chart of theirs was usable.
    pub resplit: u32,
    /// What became of the edits of patches, in the order of the session's log.
    pub edits: Vec<EditState>,
}

/// Measures of the patches after the cut; how they came about is known before it only: equal partitions share one cut.
fn mapped_summaries(partition: &Partition, cut: Option<&CutSurface>) -> Vec<PatchSummary> {
    let measured = cut.map_or(&partition.patches, |cut| &cut.partition.patches);
    measured.iter().zip(&partition.patches).map(|(after, before)| PatchSummary { origin: before.origin, ..after.clone() }).collect()
}

impl Layout {
    /// The patches as they are mapped: with straight borders their numbers are those of the split surface.
    pub fn summaries(&self) -> Vec<PatchSummary> {
        mapped_summaries(&self.partition, self.cut.as_deref())
    }

    /// # Errors
    /// [`Reason::PatchNotFound`] for a number that no patch has.
    pub fn check_patch(&self, patch: u32) -> Result<usize> {
        let count = self.patches.patches.len();
        if (patch as usize) < count {
            return Ok(patch as usize);
        }
        Err(EngineError::new(Reason::PatchNotFound, format!("there is no patch {patch}; the surface has {count}")))
    }

    /// The specification a patch follows: its own, or that of the session.
    pub fn spec_of<'a>(&self, snapshot: &'a Snapshot, patch: usize) -> SpecOf<'a> {
        match snapshot.patch_charts.get(&self.patches.identities[patch]) {
            Some(own) => SpecOf::Patch(own),
            None => SpecOf::Session(&snapshot.chart),
        }
    }
}

/// What an edit of patches makes.
#[derive(Debug, Clone)]
pub struct EditedPatches {
    /// The edit, for [`crate::session::Change::PatchEdit`].
    pub edit: PatchEdit,
    /// The partition after it, with charts.
    pub layout: Layout,
    /// Numbers in it of the patches that the edit made or changed, increasing.
    pub patches: Vec<u32>,
    /// How many of these are halves more than the edit asked for, since a patch that it made had no usable chart.
    pub split_again: u32,
}

/// Whose chart specification a patch follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpecOf<'a> {
    /// Its own.
    Patch(&'a ChartSpec),
    /// That of the session.
    Session(&'a ChartSpec),
}

/// The chart a patch would have under another specification.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartPreview {
    /// The specification.
    pub spec: ChartSpec,
    /// Positions of the last map that was tried, usable or not; empty if none could be computed.
    pub uv: Vec<Vec2>,
    /// What was tried, in order.
    pub attempts: Vec<ChartAttempt>,
    /// Distortion of the last map.
    pub distortion: Distortion,
    /// What to make of it.
    pub verdict: ChartVerdict,
}

/// Whether a chart can be used.
#[derive(Debug, Clone, PartialEq)]
pub enum ChartVerdict {
    /// One-to-one and even enough.
    Usable,
    /// Nothing is wrong with the specification, but the patch must be split first; with the reason.
    MustSplit(String),
    /// The method asked for gives no one-to-one map; with the error that a session with this specification would get.
    Refused(EngineError),
}

impl Charts {
    /// The surface that the patches are cut out of: the imported one, or that split along straight borders.
    pub fn ground(&self) -> (&SurfaceMesh, &Topology) {
        match &self.cut {
            Some(cut) => (&cut.mesh, &cut.topology),
            None => (&self.surface.imported.mesh, &self.surface.topology),
        }
    }

    /// The chart of a patch.
    pub fn chart(&self, patch: usize) -> Option<&Chart> {
        match &*self.charts.get(patch)?.value {
            ChartOutcome::Mapped(chart) => Some(chart),
            ChartOutcome::MustSplit { .. } | ChartOutcome::Refused(_) => None,
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
    /// The metric, if the mesher follows one.
    pub metric: Option<Stored<SurfaceMetric>>,
    /// The mesh before the optimisation.
    pub assembled: Stored<Assembled>,
    /// The finished mesh.
    pub result: Stored<Remeshed>,
}

impl Remesh {
    /// What a user should know of the result, one sentence each; empty if all is well.
    pub fn warnings(&self, snapshot: &Snapshot) -> Vec<String> {
        let mut warnings = Vec::new();
        if !self.result.lost_regions.is_empty() {
            let regions = &self.result.mesh.regions;
            let named: Vec<String> = self.result.lost_regions.iter().take(20).map(|&r| regions[r as usize].id.to_string()).collect();
            let more = if self.result.lost_regions.len() > 20 { ", ..." } else { "" };
            warnings.push(format!(
                "{} regions are smaller than an element and have no face in the result: {}{more}",
                self.result.lost_regions.len(),
                named.join(", ")
            ));
        }
        let waiting = self.charts.edits.iter().filter(|e| matches!(e, EditState::Waiting(_))).count();
        if waiting > 0 {
            warnings.push(format!("{waiting} edits of patches wait: the patches they edit are not in the partition"));
        }
        if let Some(count) = self.result.crossing_faces.filter(|&count| count > 0) {
            warnings.push(format!("{count} faces of the result intersect others; a smaller size follows narrow places more closely"));
        }
        let flat = self.result.flat_faces;
        if flat > 0 {
            warnings.push(format!("{flat} triangles have kappa below {FLAT}; a smaller size follows what is thinner than the size there"));
        }
        let single = self.result.mesh.triangles.len() as u64 - 2 * u64::from(self.result.quads);
        if single > 0 && snapshot.mesher == Mesher::Quads(QuadKind::All) {
            warnings.push(format!(
                "triangles are left ({single}): a part between curves is too narrow for quadrangles only, or all its edges are locked"
            ));
        }
        let asked = match &snapshot.size {
            Some(SizeSpec::TriangleCount { triangles }) => Some(*triangles),
            Some(SizeSpec::Composed(composed)) => match composed.base {
                SizeBase::Triangles(triangles) => Some(triangles),
                SizeBase::Uniform(_) | SizeBase::MaxSize => None,
            },
            _ => None,
        };
        if self.sizes.fields_scaled_by > 1.0 {
            let factor = self.sizes.fields_scaled_by;
            warnings.push(format!("the size fields ask for more triangles than that: they were made larger by {factor:.3}"));
        }
        if let Some(triangles) = asked {
            let made = self.result.mesh.triangles.len() as u64;
            if made * 2 > triangles * 3 || made * 3 < triangles * 2 {
                warnings.push(format!(
                    "{triangles} triangles were asked for and {made} made: features and boundaries need other sizes than that"
                ));
            }
        }
        warnings
    }
}

/// Imports the surface of a snapshot, whether or not it can be remeshed.
///
/// # Errors
/// [`Reason::NoMesh`], those of [`import_mesh`].
pub fn import(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Stored<Imported>>> {
    Context::execute(engine, run, |context| graph::import_step(context, snapshot))
}

/// Imports the surface of a snapshot and tells all that is wrong with it, self-intersections included, which an import does not look for.
///
/// # Errors
/// Those of [`import`].
pub fn diagnose(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Diagnosis>> {
    Context::execute(engine, run, |context| {
        let imported = graph::import_step(context, snapshot)?;
        let diagnosis = imported.diagnosis.clone();
        if diagnosis.finding(Defect::NonFinite).is_some() {
            return Ok(diagnosis);
        }
        let crossings = graph::intersections_step(context, &imported)?;
        Ok(match &crossings.value.output {
            Some(finding) => diagnosis.with(finding.clone()),
            None => diagnosis,
        })
    })
}

/// Imports and checks that the surface can be remeshed.
///
/// # Errors
/// Those of [`import`], and the refusal of [`crate::diagnose::Diagnosis::refusal`].
pub fn surface(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Surface>> {
    Context::execute(engine, run, |context| graph::surface_step(context, snapshot))
}

/// Partitions the surface (before any split that charts ask for, and before any edit of patches). With straight borders the numbers of
/// the patches are those of the surface split along them.
///
/// # Errors
/// Those of [`surface`], [`detect_features`] and [`partition_surface`].
pub fn partition(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Partitioned>> {
    Context::execute(engine, run, |context| graph::partitioned_step(context, snapshot))
}

/// Edits patches: what the session would be with one more edit. Changes nothing; if the session takes the edit over, its charts are
/// cache hits.
///
/// # Errors
/// Those of [`layout`] and [`edit_partition`] (in the numbers of `snapshot`); [`Reason::LimitReached`].
pub fn edit_patches(engine: &Engine, snapshot: &Snapshot, request: &PatchRequest, run: &Run<'_>) -> Result<Answer<EditedPatches>> {
    Context::execute(engine, run, |context| {
        let before = graph::layout_step(context, snapshot)?;
        let edit = name_edit(&before.partition, &before.patches.identities, request)?;
        let ground = Ground { mesh: &before.surface.imported.mesh, topology: &before.surface.topology, features: &before.features };
        let work = Work::silent(run.cancel);
        let alone = edit_partition(ground, &before.partition, request, snapshot.partition.max_aspect_ratio, &work)?;
        let next = snapshot.with_patch_edit(edit.clone())?;
        let layout = graph::layout_step(context, &next)?;
        if let Some(EditState::Waiting(why)) = layout.edits.last() {
            return Err(EngineError::invariant(format!("an edit that is valid waits: {why}")).into());
        }
        // Patches that are not as they were: those of faces whose patch before was touched.
        let touched: BTreeSet<_> = edit.patches().into_iter().collect();
        let changed = |f: usize| touched.contains(&before.patches.identities[before.partition.face_patch[f] as usize]);
        let label = &layout.partition.face_patch;
        let patches: BTreeSet<u32> = (0..label.len()).filter(|&f| changed(f)).map(|f| label[f]).collect();
        let split_again = (layout.partition.patches.len() - alone.patches.len().min(layout.partition.patches.len())) as u32;
        Ok(EditedPatches { edit, layout, patches: patches.into_iter().collect(), split_again })
    })
}

/// Partitions the surface and computes the charts of all patches.
///
/// # Errors
/// Those of [`partition`] and [`parametrize_patch`].
pub fn charts(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Charts>> {
    Context::execute(engine, run, |context| graph::charts_step(context, snapshot))
}

/// The patches with their numbers, also if the specification of some gives no chart. As dear as [`charts`].
///
/// # Errors
/// Those of [`charts`], but for the failures it holds.
pub fn layout(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Layout>> {
    Context::execute(engine, run, |context| graph::layout_step(context, snapshot))
}

/// The chart that patch `patch` would have under the spec (vertices of the imported mesh) that `propose` makes of the layout and the
/// place of the patch in it, whatever the session says. Changes nothing; if the session takes the spec over, its chart is a cache hit.
///
/// # Errors
/// Those of [`layout`] and of `propose`; [`Reason::PatchNotFound`]; [`Reason::BadParameter`] for a spec that contradicts itself or the
/// patch. A map that is not one-to-one is no error but a verdict.
pub fn preview_chart(
    engine: &Engine,
    snapshot: &Snapshot,
    patch: u32,
    propose: impl Fn(&Layout, usize) -> Result<ChartSpec>,
    run: &Run<'_>,
) -> Result<Answer<(Layout, ChartPreview)>> {
    Context::execute(engine, run, |context| {
        let layout = graph::layout_step(context, snapshot)?;
        let p = layout.check_patch(patch)?;
        let spec = propose(&layout, p)?;
        spec.validate()?;
        let (outcome, tried) = graph::preview_step(context, &layout, p, &spec)?;
        let verdict = match (&*outcome.value, naming::refusal(&outcome, &layout.patches, p)) {
            (_, Some(error)) => ChartVerdict::Refused(error),
            (ChartOutcome::MustSplit { reason, .. }, None) => ChartVerdict::MustSplit(reason.clone()),
            (ChartOutcome::Mapped(_) | ChartOutcome::Refused(_), None) => ChartVerdict::Usable,
        };
        let last = tried.last();
        let uv = match &*outcome.value {
            ChartOutcome::Mapped(chart) => chart.uv.clone(),
            _ => last.map(|map| map.uv.clone()).unwrap_or_default(),
        };
        let attempts = tried.iter().map(|map| map.attempt.clone()).collect();
        let distortion = last.map(|map| map.distortion).unwrap_or_default();
        Ok((layout, ChartPreview { spec, uv, attempts, distortion, verdict }))
    })
}

/// What computing the charts would find in the cache and what it would run. Computes nothing.
///
/// # Errors
/// [`Reason::NoMesh`], a refusal that is already known.
pub fn plan_charts(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| graph::layout_step(context, snapshot).map(|_| ()))
}

/// What a preview of a chart would find in the cache and what it would run. Computes nothing.
///
/// # Errors
/// As [`preview_chart`], as far as they are known without computing.
pub fn plan_preview(engine: &Engine, snapshot: &Snapshot, patch: u32, spec: &ChartSpec, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    spec.validate()?;
    Context::plan(engine, run, |context| {
        let layout = graph::layout_step(context, snapshot)?;
        let p = layout.check_patch(patch)?;
        graph::preview_step(context, &layout, p, spec).map(|_| ())
    })
}

/// The wanted edge length at each vertex of the input, with the charts that patches are named by.
///
/// # Errors
/// Those of [`charts`] and of [`crate::sizing::evaluate_size`]; [`Reason::BadParameter`] if no size is set.
pub fn sizes(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Stored<SizeField>>> {
    Context::execute(engine, run, |context| {
        let charts = graph::charts_step(context, snapshot)?;
        graph::size_step(context, snapshot, &charts)
    })
}

/// The wanted edge length at each vertex of the result, linear on the input face below it. As dear as [`remesh`], and O(T log F).
///
/// # Errors
/// Those of [`remesh`].
pub fn sizes_of_result(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Vec<f64>>> {
    Context::execute(engine, run, |context| {
        let remesh = graph::remesh_step(context, snapshot)?;
        graph::result_sizes(context, &remesh)
    })
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
        let charts = graph::charts_step(context, snapshot)?;
        graph::listed_step(context, snapshot, charts, patches)
    })
}

/// What [`remesh_patches`] would find in the cache and what it would run. Computes nothing.
///
/// # Errors
/// As [`remesh_patches`], as far as they are known without computing.
pub fn plan_patches(engine: &Engine, snapshot: &Snapshot, patches: &[u32], run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| graph::listed_step(context, snapshot, graph::charts_step(context, snapshot)?, patches).map(|_| ()))
}

/// What a partition without charts would find in the cache and what it would run. Computes nothing.
///
/// # Errors
/// As [`partition`], as far as they are known without computing.
pub fn plan_partition(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| graph::partitioned_step(context, snapshot).map(|_| ()))
}

/// What a measure of the result would find in the cache and what it would run, the remesh included. Computes nothing.
///
/// # Errors
/// As [`plan`].
pub fn plan_quality(engine: &Engine, snapshot: &Snapshot, scope: QualityScope, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| {
        let remesh = graph::remesh_step(context, snapshot).map_err(|halt| context.and_below(halt, &[Stage::Quality], &[]))?;
        graph::quality_step(context, &remesh, scope).map(|_| ())
    })
}

/// The whole pipeline up to the finished mesh.
///
/// # Errors
/// [`Reason::BadParameter`] if no size is set; those of all stages.
pub fn remesh(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Answer<Remesh>> {
    Context::execute(engine, run, |context| graph::remesh_step(context, snapshot))
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
        let remesh = graph::remesh_step(context, snapshot)?;
        let report = graph::quality_step(context, &remesh, scope)?;
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
    Context::execute(engine, run, |context| graph::compare_step(context, input, output, size, scope))
}

/// What a request for the finished mesh would find in the cache and what it would run. Computes nothing.
/// Where a stage will run, the stages below it are listed as running too (they may turn out to be cached); patches and curves
/// of a partition that is not known yet cannot be listed.
///
/// # Errors
/// [`Reason::NoMesh`], [`Reason::BadParameter`] if no size is set, a refusal that is already known.
pub fn plan(engine: &Engine, snapshot: &Snapshot, run: &Run<'_>) -> Result<Vec<StageRecord>> {
    Context::plan(engine, run, |context| graph::remesh_step(context, snapshot).map(|_| ()))
}
