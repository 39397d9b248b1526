//! Partition of a surface into patches of genus 0 with a boundary (P2 eq. 5), by one of several strategies.

mod aspect;
mod auto;
mod bisect;
mod cuts;
mod depth;
mod divide;
mod edit;
mod graph;
mod handles;
mod homology;
mod laplace;
mod max_cut;
mod merge;
mod nearest;
mod pants;
mod plane;
mod smooth;
mod straighten;
mod strategy;
mod surface;
#[cfg(test)]
mod tests;
mod two_way;

pub use aspect::{OrientedBox, box_aspect_ratio, smallest_box};
pub use edit::{EditState, Ground, PatchEdit, PatchRequest, SplitMethod, apply_edits, edit_partition, name_edit, patch_identities};
pub use strategy::{BorderSmoothing, PartitionStrategy, Plane};
pub use two_way::{TwoWayCut, Verdict, cut_in_two};

use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;
use divide::Divider;
use merge::Goal;
use surface::{Limits, Scratch, Surface, measure};

/// How to partition.
#[derive(Debug, Clone, PartialEq)]
pub struct PartitionSpec {
    /// Wanted number of patches over the whole surface; `None` chooses from `max_patch_faces`.
    /// More are made where topology or features ask for it.
    pub patches: Option<u32>,
    /// Patches are split until none has more faces than this.
    pub max_patch_faces: u32,
    /// Bound on eta = pi A / L^2 with L the longest boundary loop (P2 section 4, eta_max = 4).
    pub max_aspect_ratio: f64,
    /// By which method.
    pub strategy: PartitionStrategy,
    /// What is done to the borders between patches.
    pub borders: BorderSmoothing,
}

impl Default for PartitionSpec {
    fn default() -> Self {
        PartitionSpec {
            patches: None,
            max_patch_faces: 12_000,
            max_aspect_ratio: 4.0,
            strategy: PartitionStrategy::default(),
            borders: BorderSmoothing::default(),
        }
    }
}

/// Numbers of one patch.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchSummary {
    /// Faces.
    pub faces: u32,
    /// Area in squared units of the mesh.
    pub area: f64,
    /// Boundary loops.
    pub loops: u32,
    /// Handles; 0 for every delivered patch.
    pub genus: u32,
    /// Length of all boundary loops.
    pub border_length: f64,
    /// eta = pi A / L^2 with L the longest loop.
    pub aspect_ratio: f64,
    /// How it came about.
    pub origin: PatchOrigin,
}

/// How a patch came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum PatchOrigin {
    /// By the strategy of the partition.
    #[default]
    Strategy,
    /// Half of a patch that had no usable chart.
    ChartSplit,
    /// Part of a patch that the user split.
    Split,
    /// Union of patches that the user merged.
    Merge,
    /// The user moved faces in or out.
    Reassigned,
}

/// A patch number for each face. Patches are connected, of genus 0 and have at least one boundary loop; no feature edge that
/// closes off a piece of surface runs through a patch (dangling feature edges may).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Partition {
    /// Patch of each face, `0..patches.len()`; numbered by their lowest face.
    pub face_patch: Vec<u32>,
    /// Numbers of each patch.
    pub patches: Vec<PatchSummary>,
    /// The strategy that made it; never `Auto` for what [`partition_surface`] returns. No part of the fingerprint.
    pub strategy: PartitionStrategy,
    /// Why this strategy, one sentence. No part of the fingerprint.
    pub reason: String,
    /// What became of the edits that [`apply_edits`] looked at. No part of the fingerprint.
    pub edits: Vec<EditState>,
}

impl Contents for Partition {
    fn feed(&self, into: &mut Feeder) {
        into.u32s(&self.face_patch);
    }

    fn bytes(&self) -> usize {
        self.face_patch.len() * 4 + self.patches.len() * std::mem::size_of::<PatchSummary>() + self.reason.len()
    }
}

/// Partitions a surface. Deterministic. O(F log F).
///
/// # Errors
/// [`Reason::BadParameter`]; [`Reason::PatchTopology`] (with locations) if some piece cannot be brought to genus 0 with a boundary,
/// or if [`PartitionStrategy::MaxCut`] fails on it; [`Reason::SolverSingular`] from the maps of the strategies that need them.
pub fn partition_surface(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    spec: &PartitionSpec,
    work: &Work<'_>,
) -> Result<Partition> {
    check_spec(spec)?;
    check_sizes(mesh, topology, features)?;
    let surface = Surface::new(mesh, topology, features);
    strategy::partition_by(&surface, spec, work)
}

/// Multilevel cuts of the dual graph. O(F log F).
fn multilevel(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    complete(surface, face_groups(surface), Limits::new(spec), spec, work)
}

/// Divides connected sets of faces as far as `limits` ask for: a label for each face.
fn divided(
    surface: &Surface<'_>,
    sets: Vec<Vec<u32>>,
    limits: Limits,
    spec: &PartitionSpec,
    work: &Work<'_>,
) -> Result<(Vec<u32>, Scratch)> {
    let faces = surface.topology.face_count();
    let wanted = wanted_faces(surface, spec);
    let mut divider = Divider::new(surface, limits, f64::from(spec.max_patch_faces).min(PLAN_SLACK * wanted).max(1.0));
    let mut done = 0;
    for set in sets {
        done += set.len();
        divider.divide(set, work)?;
        work.step(done, 2 * faces)?;
    }
    Ok((divider.label, divider.scratch))
}

/// Faces of a patch if there are as many patches as wanted; infinite if no number is.
fn wanted_faces(surface: &Surface<'_>, spec: &PartitionSpec) -> f64 {
    spec.patches.map_or(f64::INFINITY, |k| surface.topology.face_count() as f64 / f64::from(k))
}

/// Divides connected sets of faces as far as `limits` ask for, merges what may be merged and smooths the borders.
fn complete(surface: &Surface<'_>, sets: Vec<Vec<u32>>, limits: Limits, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let (mut label, mut scratch) = divided(surface, sets, limits, spec, work)?;
    let wanted = wanted_faces(surface, spec);
    let goal = Goal { patches: spec.patches, planned_faces: (MERGE_SLACK * wanted).min(f64::from(u32::MAX)) as u32, limits };
    // Smooth borders merge better, and merged patches have new borders to smooth.
    for _ in 0..2 {
        smooth::smooth_borders(surface, &mut label, limits, work)?;
        merge::merge_patches(surface, &mut label, &goal, &mut scratch, work)?;
    }
    smooth::smooth_borders(surface, &mut label, limits, work)?;
    if spec.borders != BorderSmoothing::Vote {
        straighten::straighten_borders(surface, &mut label, limits, work)?;
    }
    finish(surface, label, limits, work)
}

/// With a wanted number of patches, a patch may be this much larger than the mean.
const PLAN_SLACK: f64 = 1.12;
/// And a merged patch by this much.
const MERGE_SLACK: f64 = 1.3;

fn check_spec(spec: &PartitionSpec) -> Result<()> {
    if spec.patches == Some(0) {
        return Err(EngineError::bad_parameter("patches", "must be at least 1"));
    }
    if spec.max_patch_faces == 0 {
        return Err(EngineError::bad_parameter("max_patch_faces", "must be at least 1"));
    }
    // A flat disc has eta = 1/4, a hemisphere 1/2.
    if spec.max_aspect_ratio.is_nan() || spec.max_aspect_ratio < 0.5 {
        return Err(EngineError::bad_parameter("max_aspect_ratio", "must be at least 0.5 (the value of a hemisphere)"));
    }
    Ok(())
}

fn check_sizes(mesh: &SurfaceMesh, topology: &Topology, features: &Features) -> Result<()> {
    let faces = topology.face_count();
    if mesh.triangles.len() != faces || features.is_feature.len() != 3 * faces || mesh.positions.len() != topology.vertex_count() {
        return Err(EngineError::invariant("mesh, topology and features are not of the same surface"));
    }
    Ok(())
}

/// Connected sets of faces that no closed chain of feature edges divides; in order of their lowest face.
fn face_groups(surface: &Surface<'_>) -> Vec<Vec<u32>> {
    connected_sets(surface, |_, _| true)
}

/// Sets of faces connected over edges that are no features, between faces that are `alike`; in order of their lowest face.
fn connected_sets(surface: &Surface<'_>, alike: impl Fn(u32, u32) -> bool) -> Vec<Vec<u32>> {
    let mut seen = vec![false; surface.topology.face_count()];
    let mut groups = Vec::new();
    for seed in 0..seen.len() as u32 {
        if std::mem::replace(&mut seen[seed as usize], true) {
            continue;
        }
        let mut group = vec![seed];
        let mut head = 0;
        while head < group.len() {
            let f = group[head];
            head += 1;
            for g in (3 * f..3 * f + 3).filter_map(|h| surface.crossing(h)).filter(|&g| alike(f, g)) {
                if !std::mem::replace(&mut seen[g as usize], true) {
                    group.push(g);
                }
            }
        }
        groups.push(group);
    }
    groups
}

/// Faces of each patch, increasing.
fn faces_by_patch(label: &[u32]) -> Vec<Vec<u32>> {
    let count = label.iter().max().map_or(0, |&p| p as usize + 1);
    let mut size = vec![0usize; count];
    for &p in label {
        size[p as usize] += 1;
    }
    let mut faces: Vec<Vec<u32>> = size.into_iter().map(Vec::with_capacity).collect();
    for (f, &p) in label.iter().enumerate() {
        faces[p as usize].push(f as u32);
    }
    faces
}

/// Numbers patches by their lowest face.
fn renumber(label: &mut [u32]) {
    let count = label.iter().max().map_or(0, |&p| p as usize + 1);
    let mut name = vec![u32::MAX; count];
    let mut next = 0;
    for p in label {
        let new = &mut name[*p as usize];
        if *new == u32::MAX {
            *new = next;
            next += 1;
        }
        *p = *new;
    }
}

/// Checks every patch, divides those that smoothing or merging has made invalid, numbers and measures them.
fn finish(surface: &Surface<'_>, mut label: Vec<u32>, limits: Limits, work: &Work<'_>) -> Result<Partition> {
    renumber(&mut label);
    let mut divider = Divider::new(surface, limits, f64::from(limits.faces));
    let all = faces_by_patch(&label);
    divider.next_label = all.len() as u32;
    divider.label = label;
    for (p, faces) in all.into_iter().enumerate() {
        work.check()?;
        let piece = measure(surface, &divider.label, &faces, p as u32, &mut divider.scratch);
        if !piece.is_valid(&limits) {
            divider.divide(faces, work)?;
        }
    }
    let Divider { mut label, mut scratch, .. } = divider;
    renumber(&mut label);
    let mut patches = Vec::new();
    for (p, faces) in faces_by_patch(&label).iter().enumerate() {
        let piece = measure(surface, &label, faces, p as u32, &mut scratch);
        if piece.genus() != 0 || piece.loops == 0 {
            return Err(EngineError::new(
                Reason::PatchTopology,
                format!("patch {p} has genus {} and {} boundary loops", piece.genus(), piece.loops),
            )
            .with_locations(faces.iter().map(|&f| surface.mesh.face_location(f as usize))));
        }
        patches.push(piece.summary());
    }
    Ok(Partition { face_patch: label, patches, ..Partition::default() })
}

/// Lower bound of eta of every patch: longest side of the oriented box of the patch over that of its longest loop (P2 section 2). Limited
/// by nothing, so it is no part of a [`Partition`]; it costs about a tenth of one.
///
/// # Errors
/// Those of `work`.
pub fn box_aspect_ratios(mesh: &SurfaceMesh, topology: &Topology, partition: &Partition, work: &Work<'_>) -> Result<Vec<f64>> {
    let label = &partition.face_patch;
    if label.len() != topology.face_count() || mesh.triangles.len() != label.len() {
        return Err(EngineError::invariant("the partition is not of this surface"));
    }
    let mut scratch = Scratch::new(topology);
    let ratio = |faces: Vec<u32>| {
        work.check()?;
        Ok(aspect::by_boxes(mesh, topology, label, &faces, &mut scratch))
    };
    faces_by_patch(label).into_iter().map(ratio).collect()
}

/// Measures the patches of given labels, one after another; nothing is checked. O(F).
pub fn summarize_patches(mesh: &SurfaceMesh, topology: &Topology, features: &Features, face_patch: &[u32]) -> Vec<PatchSummary> {
    let surface = Surface::new(mesh, topology, features);
    let mut scratch = Scratch::new(topology);
    let summary = |(p, faces): (usize, &Vec<u32>)| measure(&surface, face_patch, faces, p as u32, &mut scratch).summary();
    faces_by_patch(face_patch).iter().enumerate().map(summary).collect()
}

/// Splits the listed patches in two (those whose chart failed) and leaves all others' face sets as they are. A patch listed
/// twice is split once. The parts are connected, of genus 0, and each has at least about a quarter of the area where the mesh allows.
///
/// # Errors
/// [`Reason::PatchNotFound`] for a number that is no patch; [`Reason::PatchTopology`] (with locations) if a patch is too small to split.
pub fn split_patches(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    partition: &Partition,
    split: &[u32],
    work: &Work<'_>,
) -> Result<Partition> {
    check_sizes(mesh, topology, features)?;
    if partition.face_patch.len() != topology.face_count() {
        return Err(EngineError::invariant("the partition is not of this surface"));
    }
    let surface = Surface::new(mesh, topology, features);
    let all = faces_by_patch(&partition.face_patch);
    let mut divider = Divider::new(&surface, edit::NO_LIMITS, f64::from(u32::MAX));
    divider.label.clone_from(&partition.face_patch);
    divider.next_label = all.len() as u32;
    let mut listed: Vec<u32> = split.to_vec();
    listed.sort_unstable();
    listed.dedup();
    for &p in &listed {
        work.check()?;
        let Some(faces) = all.get(p as usize).filter(|faces| !faces.is_empty()) else {
            return Err(EngineError::new(Reason::PatchNotFound, format!("there is no patch {p}; there are {}", all.len())));
        };
        if faces.len() < 2 {
            return Err(EngineError::new(Reason::PatchTopology, format!("patch {p} is a single face and cannot be split"))
                .with_locations(faces.iter().map(|&f| mesh.face_location(f as usize))));
        }
        let (_, second) = divider.halve(faces, 1.0, work)?;
        divider.name(&second);
    }
    let (strategy, reason) = (partition.strategy, partition.reason.clone());
    let mut after = finish(&surface, divider.label, edit::NO_LIMITS, work)?;
    let mut lowest = vec![None; after.patches.len()];
    for (f, &p) in after.face_patch.iter().enumerate() {
        lowest[p as usize].get_or_insert(partition.face_patch[f]);
    }
    for (patch, before) in after.patches.iter_mut().zip(lowest) {
        let kept = before.filter(|p| listed.binary_search(p).is_err()).and_then(|p| partition.patches.get(p as usize));
        patch.origin = kept.map_or(PatchOrigin::ChartSplit, |before| before.origin);
    }
    Ok(Partition { strategy, reason, ..after })
}
