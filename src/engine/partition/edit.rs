//! Edits of single patches: split one, merge some, move faces. Every edit leaves all other patches as they are, and gives patches
//! that are connected, of genus 0 and with a border, or an error that says which patch would not be, and where.

mod log;

pub use log::{EditState, PatchEdit, apply_edits, name_edit, patch_identities};

use super::divide::Divider;
use super::surface::{Limits, Surface, measure};
use super::two_way::{Verdict, cut_in_two};
use super::{Partition, PartitionStrategy, PatchOrigin, Plane, check_sizes, faces_by_patch, finish, strategy};
use crate::error::{EngineError, Location, Reason, Result};
use crate::features::Features;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{dot, sub};
use crate::work::Work;

/// How a patch is cut in two.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum SplitMethod {
    /// Along a short cut, with about half of the area on either side (at least a quarter where the mesh allows).
    #[default]
    Balanced,
    /// Through the centres of harmonic maps at many scales (P2 section 3): long patches lengthwise.
    Laplace,
    /// By a plane; faces go by their centroids. Of each side all but the largest piece changes sides.
    Plane(Plane),
}

/// An edit of patches, by their numbers in a partition.
#[derive(Debug, Clone, PartialEq)]
pub enum PatchRequest {
    /// Cut a patch in two.
    Split {
        /// The patch.
        patch: u32,
        /// How.
        method: SplitMethod,
    },
    /// Make one patch of several.
    Merge {
        /// Two or more patches that hang together.
        patches: Vec<u32>,
    },
    /// Move faces to a patch.
    Reassign {
        /// Faces of the imported mesh. Those that are in the patch already stay there.
        faces: Vec<u32>,
        /// The patch that gets them.
        to: u32,
    },
}

/// A surface with its adjacency and features.
#[derive(Debug, Clone, Copy)]
pub struct Ground<'a> {
    /// The surface.
    pub mesh: &'a SurfaceMesh,
    /// Its adjacency.
    pub topology: &'a Topology,
    /// Its features.
    pub features: &'a Features,
}

/// Carries out one edit. `max_aspect_ratio` bounds eta of merged patches and of patches that faces are moved between; parts of a split
/// may have any. Patches are numbered anew, by their lowest face. O(F).
///
/// # Errors
/// [`Reason::PatchNotFound`]; [`Reason::BadParameter`] for fewer than two patches, a patch or face listed that is not there, and for a plane
/// that does not cut the patch; [`Reason::PatchTopology`], with locations and the patch as metadata, if a patch would not be valid.
pub fn edit_partition(
    ground: Ground<'_>,
    partition: &Partition,
    request: &PatchRequest,
    max_aspect_ratio: f64,
    work: &Work<'_>,
) -> Result<Partition> {
    let surface = ground.surface(partition)?;
    let mut editor = Editor::new(ground, &surface, partition, max_aspect_ratio);
    editor.edit(request, work)?;
    editor.finish(partition, work)
}

impl<'a> Ground<'a> {
    fn surface(&self, partition: &Partition) -> Result<Surface<'a>> {
        check_sizes(self.mesh, self.topology, self.features)?;
        if partition.face_patch.len() != self.topology.face_count() {
            return Err(EngineError::invariant("the partition is not of this surface"));
        }
        Ok(Surface::new(self.mesh, self.topology, self.features))
    }
}

/// A partition that is being edited. Patches keep their numbers while it is; new ones get the next.
struct Editor<'a> {
    ground: Ground<'a>,
    surface: &'a Surface<'a>,
    divider: Divider<'a>,
    /// Faces of each patch, increasing; empty for patches that are gone.
    faces: Vec<Vec<u32>>,
    /// How each patch came about.
    origin: Vec<PatchOrigin>,
    max_aspect_ratio: f64,
}

impl<'a> Editor<'a> {
    fn new(ground: Ground<'a>, surface: &'a Surface<'a>, partition: &Partition, max_aspect_ratio: f64) -> Self {
        let mut divider = Divider::new(surface, NO_LIMITS, f64::from(u32::MAX));
        divider.label.clone_from(&partition.face_patch);
        let faces = faces_by_patch(&partition.face_patch);
        divider.next_label = faces.len() as u32;
        let origin = partition.patches.iter().map(|p| p.origin).collect();
        Editor { ground, surface, divider, faces, origin, max_aspect_ratio }
    }

    /// Carries an edit out, or leaves everything as it is; the patches that it made or changed.
    fn edit(&mut self, request: &PatchRequest, work: &Work<'_>) -> Result<Vec<u32>> {
        match request {
            PatchRequest::Split { patch, method } => self.split(*patch, *method, work),
            PatchRequest::Merge { patches } => self.merge(patches),
            PatchRequest::Reassign { faces, to } => self.reassign(faces, *to),
        }
    }

    fn check_patch(&self, p: u32) -> Result<()> {
        if self.faces.get(p as usize).is_some_and(|faces| !faces.is_empty()) {
            return Ok(());
        }
        let count = self.faces.len();
        Err(EngineError::new(Reason::PatchNotFound, format!("there is no patch {p}; the surface has {count}")).with_metadata("patch", p))
    }

    /// A new patch of some faces.
    fn add(&mut self, mut faces: Vec<u32>, origin: PatchOrigin) -> u32 {
        faces.sort_unstable();
        let p = self.divider.name(&faces);
        self.faces.push(faces);
        self.origin.push(origin);
        p
    }

    fn split(&mut self, p: u32, method: SplitMethod, work: &Work<'_>) -> Result<Vec<u32>> {
        self.check_patch(p)?;
        let faces = &self.faces[p as usize];
        let location = |f: u32| self.surface.mesh.face_location(f as usize);
        if faces.len() < 2 {
            return Err(broken(p, format!("patch {p} is a single face and cannot be split"), faces.iter().map(|&f| location(f))));
        }
        let (first, second) = match method {
            SplitMethod::Balanced => self.divider.halve(faces, 1.0, work)?,
            SplitMethod::Laplace => {
                let Ground { mesh, topology, features } = self.ground;
                let cut = cut_in_two(mesh, topology, features, faces, PartitionStrategy::Laplace, work)?;
                if let Verdict::Unusable(reason) = &cut.verdict {
                    return Err(broken(p, format!("the Laplace cut of patch {p} fails: {reason}"), [location(faces[0])]));
                }
                self.divider.halve_by(faces, cut.second)
            }
            SplitMethod::Plane(plane) => {
                strategy::check_plane(&plane)?;
                let side: Vec<bool> = faces.iter().map(|&f| dot(sub(location(f).position, plane.point), plane.normal) >= 0.0).collect();
                if side.iter().all(|&s| s) || !side.contains(&true) {
                    let message = format!("all of patch {p} is on one side of it");
                    return Err(EngineError::bad_parameter("plane", message)
                        .with_metadata("patch", p)
                        .with_locations([location(faces[0])]));
                }
                self.divider.halve_by(faces, side)
            }
        };
        self.faces[p as usize].clear();
        Ok([first, second].map(|part| self.add(part, PatchOrigin::Split)).to_vec())
    }

    fn merge(&mut self, patches: &[u32]) -> Result<Vec<u32>> {
        let mut listed = patches.to_vec();
        listed.sort_unstable();
        listed.dedup();
        if listed.len() < 2 || listed.len() != patches.len() {
            return Err(EngineError::bad_parameter("patches", "list two or more patches, each once"));
        }
        listed.iter().try_for_each(|&p| self.check_patch(p))?;
        let mut union: Vec<u32> = listed.iter().flat_map(|&p| self.faces[p as usize].iter().copied()).collect();
        union.sort_unstable();
        let before: Vec<u32> = union.iter().map(|&f| self.divider.label[f as usize]).collect();
        let name = list_of(&listed);
        let next = self.divider.next_label;
        self.relabel(&union, next);
        if let Err(error) = self.check_valid(next, &union, &format!("the union of patches {name}"), &before) {
            union.iter().zip(&before).for_each(|(&f, &p)| self.divider.label[f as usize] = p);
            return Err(error.with_metadata("patches", name));
        }
        listed.iter().for_each(|&p| self.faces[p as usize].clear());
        Ok(vec![self.add(union, PatchOrigin::Merge)])
    }

    fn reassign(&mut self, faces: &[u32], to: u32) -> Result<Vec<u32>> {
        self.check_patch(to)?;
        let count = self.divider.label.len();
        if let Some(&unknown) = faces.iter().find(|&&f| f as usize >= count) {
            return Err(EngineError::bad_parameter("faces", format!("there is no face {unknown}; the mesh has {count}")));
        }
        let mut moved: Vec<u32> = faces.iter().copied().filter(|&f| self.divider.label[f as usize] != to).collect();
        moved.sort_unstable();
        moved.dedup();
        if moved.is_empty() {
            return Err(EngineError::bad_parameter("faces", format!("no face is listed that is not in patch {to} already")));
        }
        let before: Vec<u32> = moved.iter().map(|&f| self.divider.label[f as usize]).collect();
        let mut touched = before.clone();
        touched.push(to);
        touched.sort_unstable();
        touched.dedup();
        self.relabel(&moved, to);
        let mut after: Vec<Vec<u32>> = Vec::new();
        for &p in &touched {
            let mut left: Vec<u32> = self.faces[p as usize].iter().copied().filter(|&f| self.divider.label[f as usize] == p).collect();
            if p == to {
                left.extend_from_slice(&moved);
                left.sort_unstable();
            }
            let origins: Vec<u32> = left.iter().map(|&f| if moved.binary_search(&f).is_ok() { u32::MAX } else { p }).collect();
            if let Err(error) = self.check_valid(p, &left, &format!("patch {p}"), &origins) {
                moved.iter().zip(&before).for_each(|(&f, &q)| self.divider.label[f as usize] = q);
                return Err(error);
            }
            after.push(left);
        }
        for (&p, left) in touched.iter().zip(after) {
            self.faces[p as usize] = left;
            self.origin[p as usize] = PatchOrigin::Reassigned;
        }
        Ok(touched)
    }

    fn relabel(&mut self, faces: &[u32], p: u32) {
        faces.iter().for_each(|&f| self.divider.label[f as usize] = p);
    }

    /// Checks that the faces labelled `p` are a valid patch. `parts` tells the part each face came from: their common borders are where
    /// a union fails.
    fn check_valid(&mut self, p: u32, faces: &[u32], what: &str, parts: &[u32]) -> Result<()> {
        let mesh = self.surface.mesh;
        let Some(&seed) = faces.first() else {
            return Err(broken(p, format!("{what} would be left without faces"), []).with_hint("merge it instead"));
        };
        let over_edges = self.unreached(p, seed, faces, Crossing::All);
        if let Some(&apart) = over_edges.first() {
            let message = format!("{what} would not be connected: {} of {} faces are apart", over_edges.len(), faces.len());
            let places = [apart, seed].into_iter().chain(over_edges[1..].iter().copied());
            return Err(broken(p, message, places.map(|f| mesh.face_location(f as usize))));
        }
        let over_surface = self.unreached(p, seed, faces, Crossing::NoFeatures);
        if !over_surface.is_empty() {
            let chain = self.edges_of(faces, |h, g| {
                self.divider.label[g as usize] == p
                    && self.surface.features.is_feature[h as usize]
                    && over_surface.binary_search(&(h / 3)).is_ok() != over_surface.binary_search(&g).is_ok()
            });
            let message = format!("feature edges close off a part of {what}: {} of {} faces", over_surface.len(), faces.len());
            return Err(broken(p, message, chain).with_hint("raise the feature angle, or make a compound of the regions on both sides"));
        }
        let piece = measure(self.surface, &self.divider.label, faces, p, &mut self.divider.scratch);
        let (genus, eta) = (piece.genus(), piece.aspect_ratio());
        let message = if piece.loops == 0 {
            format!("{what} would be closed: it has no border")
        } else if genus != 0 {
            format!("{what} would have genus {genus}; a patch must have genus 0")
        } else if eta > self.max_aspect_ratio {
            format!("{what} would have the aspect ratio {eta:.3}, above max_aspect_ratio {}", self.max_aspect_ratio)
        } else {
            return Ok(());
        };
        let part_of = |f: u32| faces.binary_search(&f).ok().map(|i| parts[i]);
        let seams = self.edges_of(faces, |h, g| part_of(g).is_some_and(|q| part_of(h / 3) != Some(q)));
        let error = broken(p, message, seams).with_metadata("genus", genus).with_metadata("loops", piece.loops);
        Err(error.with_metadata("aspect_ratio", eta))
    }

    /// Faces labelled `p` that are not reached from `seed`, increasing.
    fn unreached(&self, p: u32, seed: u32, faces: &[u32], crossing: Crossing) -> Vec<u32> {
        let mut reached = vec![false; faces.len()];
        let place = |f: u32| faces.binary_search(&f).ok();
        let mut stack = vec![seed];
        place(seed).into_iter().for_each(|i| reached[i] = true);
        while let Some(f) = stack.pop() {
            for h in 3 * f..3 * f + 3 {
                let beyond = match crossing {
                    Crossing::All => self.surface.topology.twin(h).map(|t| t / 3),
                    Crossing::NoFeatures => self.surface.crossing(h),
                };
                if let Some(g) = beyond.filter(|&g| self.divider.label[g as usize] == p)
                    && place(g).is_some_and(|i| !std::mem::replace(&mut reached[i], true))
                {
                    stack.push(g);
                }
            }
        }
        faces.iter().zip(reached).filter(|(_, r)| !r).map(|(&f, _)| f).collect()
    }

    /// Locations of the edges of some faces for which `wanted` holds of the halfedge and the face across; each once.
    fn edges_of(&self, faces: &[u32], wanted: impl Fn(u32, u32) -> bool) -> Vec<Location> {
        let topology = self.surface.topology;
        let halfedges = faces.iter().flat_map(|&f| 3 * f..3 * f + 3);
        let kept = halfedges.filter(|&h| topology.twin(h).is_some_and(|t| h < t && wanted(h, t / 3)));
        kept.map(|h| self.surface.mesh.edge_location(topology.origin(h), topology.target(h))).collect()
    }

    /// The edited partition, numbered and measured.
    fn finish(self, before: &Partition, work: &Work<'_>) -> Result<Partition> {
        let label = self.divider.label;
        let mut origins = Vec::new();
        let mut seen = vec![false; self.faces.len()];
        for &p in &label {
            if !std::mem::replace(&mut seen[p as usize], true) {
                origins.push(self.origin[p as usize]);
            }
        }
        let mut after = finish(self.surface, label, NO_LIMITS, work)?;
        after.patches.iter_mut().zip(origins).for_each(|(patch, origin)| patch.origin = origin);
        Ok(Partition { strategy: before.strategy, reason: before.reason.clone(), ..after })
    }
}

/// No limit but genus 0 and a border.
pub(super) const NO_LIMITS: Limits = Limits { faces: u32::MAX, loops: u32::MAX, aspect_ratio: f64::INFINITY };

/// Which edges a search crosses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Crossing {
    All,
    NoFeatures,
}

fn broken(patch: u32, message: String, locations: impl IntoIterator<Item = Location>) -> EngineError {
    EngineError::new(Reason::PatchTopology, message).with_metadata("patch", patch).with_locations(locations)
}

/// "3, 7 and 9".
fn list_of(numbers: &[u32]) -> String {
    let words: Vec<String> = numbers.iter().map(u32::to_string).collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => words.concat(),
    }
}
