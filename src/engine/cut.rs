//! Straight borders: interface curves shortened over the surface to polylines that pass through faces, and the faces split along them.
//! The surface stays where it is; only its triangulation changes, and only along the borders.

mod funnel;
mod network;
mod path;
mod split;
#[cfg(test)]
mod tests;

pub use split::EdgePoint;

use crate::curve::trace_curves;
use crate::error::Result;
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::partition::{Partition, PatchSummary, summarize_patches};
use crate::topology::Topology;
use crate::work::Work;
use network::{Border, Network};
use split::Split;

/// A node of a path on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Node {
    /// In a vertex.
    Vertex(u32),
    /// In an edge, which the path crosses from the face of the halfedge to that of its twin.
    Crossing {
        /// The halfedge.
        halfedge: u32,
        /// Share of the way from its origin to its target.
        t: f64,
    },
}

/// A surface whose faces are split along the borders of its patches. Vertices of the mesh before keep their numbers, new ones follow.
#[derive(Debug, Clone, PartialEq)]
pub struct CutSurface {
    /// The surface.
    pub mesh: SurfaceMesh,
    /// Its adjacency.
    pub topology: Topology,
    /// Its features: the same edges; no feature edge is split.
    pub features: Features,
    /// Its patches, numbered as before. Faces, area and lengths are those of the split surface.
    pub partition: Partition,
    /// Where each new vertex is on the mesh before, in order.
    pub new_vertices: Vec<EdgePoint>,
    /// Face of the mesh before of each face.
    pub face_origin: Vec<u32>,
    /// Length of all borders that are no features, before and after.
    pub border_length: [f64; 2],
}

impl CutSurface {
    /// Values at the vertices before, carried on to the new ones; linear along edges. O(V).
    pub fn at_vertices(&self, values: &[f64]) -> Vec<f64> {
        let at = |p: &EdgePoint| {
            let [a, b] = p.ends.map(|v| values[v as usize]);
            a + p.t * (b - a)
        };
        values.iter().copied().chain(self.new_vertices.iter().map(at)).collect()
    }

    /// The vertex before that stands for a vertex: itself, or the nearer end of the edge it is in.
    pub fn vertex_before(&self, v: u32) -> u32 {
        let before = self.mesh.positions.len() - self.new_vertices.len();
        (v as usize).checked_sub(before).and_then(|i| self.new_vertices.get(i)).map_or(v, EdgePoint::nearest)
    }
}

impl Contents for CutSurface {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.mesh.positions).tuples(&self.mesh.triangles).u32s(&self.face_origin);
        self.features.feed(into);
        self.partition.feed(into);
    }

    fn bytes(&self) -> usize {
        self.mesh.bytes()
            + self.topology.bytes()
            + self.features.bytes()
            + self.partition.bytes()
            + self.face_origin.len() * 4
            + self.new_vertices.len() * 16
    }
}

/// Passes over the borders of a patch: fewer each time that it comes out badly.
const PASSES: [u32; 4] = [48, 12, 4, 0];
/// Times that patches which come out badly are tried again; then all borders stay.
const ATTEMPTS: usize = 8;
/// No patch keeps less than this share of its area.
const LEAST_AREA: f64 = 0.6;

/// Shortens every border between patches that is no feature to a geodesic nearby and splits the faces it crosses. Junctions, ends on
/// features and on the boundary stay. Borders of a patch that would lose its topology, much of its area, or come to exceed
/// `max_aspect_ratio` move less or stay as they are. Deterministic. O(F log F), and for the borders O(passes x faces crossed).
///
/// # Errors
/// Cancellation; broken invariants.
pub fn cut_along_borders(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    partition: &Partition,
    max_aspect_ratio: f64,
    work: &Work<'_>,
) -> Result<CutSurface> {
    let curves = trace_curves(topology, features, partition);
    let mut level = vec![0; partition.patches.len()];
    for attempt in 0..=ATTEMPTS {
        if attempt == ATTEMPTS {
            level.fill(PASSES.len() - 1);
        }
        let mut network = Network::new(mesh, topology, &curves);
        let of_sides = |border: &Border| sides(topology, partition, border).map(|p| PASSES[level[p as usize]]);
        let passes: Vec<u32> = network.borders.iter().map(|border| of_sides(border).into_iter().min().unwrap_or(0)).collect();
        let before = network.total_length();
        work.check()?;
        network.shorten(&passes, work)?;
        let cut = apply(mesh, topology, features, partition, &network.borders, work)?;
        work.step(attempt + 1, ATTEMPTS + 2)?;
        let Some(cut) = cut else {
            level.fill(PASSES.len() - 1);
            continue;
        };
        let bad: Vec<usize> = (0..level.len())
            .filter(|&p| level[p] + 1 < PASSES.len() && spoilt(&partition.patches[p], &cut.partition.patches[p], max_aspect_ratio))
            .collect();
        if bad.is_empty() {
            return Ok(CutSurface { border_length: [before, network.total_length()], ..cut });
        }
        bad.iter().for_each(|&p| level[p] += 1);
    }
    let (mesh, topology, features, partition) = (mesh.clone(), topology.clone(), features.clone(), partition.clone());
    let face_origin = (0..mesh.triangles.len() as u32).collect();
    Ok(CutSurface { mesh, topology, features, partition, new_vertices: Vec::new(), face_origin, border_length: [0.0; 2] })
}

fn sides(topology: &Topology, partition: &Partition, border: &Border) -> [u32; 2] {
    let left = partition.face_patch[border.first as usize / 3];
    [left, topology.twin(border.first).map_or(left, |t| partition.face_patch[t as usize / 3])]
}

/// Whether a patch is worse off.
fn spoilt(before: &PatchSummary, after: &PatchSummary, max_aspect_ratio: f64) -> bool {
    after.genus != 0
        || after.loops != before.loops
        || after.area < LEAST_AREA * before.area
        || after.aspect_ratio > max_aspect_ratio.max(before.aspect_ratio)
}

/// Splits the faces and gives each to the side it is on. `None` if the borders do not part the patches as before.
fn apply(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    partition: &Partition,
    borders: &[Border],
    work: &Work<'_>,
) -> Result<Option<CutSurface>> {
    let paths: Vec<&[Node]> = borders.iter().map(|border| &border.path[..]).collect();
    let split = split::split(mesh, topology, &paths)?;
    work.check()?;
    let new = Topology::build(&split.mesh.triangles, split.mesh.positions.len())?;
    work.check()?;
    let is_feature: Vec<bool> = split.whole.iter().map(|whole| whole.is_some_and(|h| features.is_feature[h as usize])).collect();
    let features = Features { is_feature, corners: features.corners.clone(), compounds: features.compounds.clone() };
    let sides: Vec<[u32; 2]> = borders.iter().map(|border| sides(topology, partition, border)).collect();
    let Some(face_patch) = labels(&new, &features, partition, &split, &sides) else { return Ok(None) };
    work.check()?;
    let patches = summarize_patches(&split.mesh, &new, &features, &face_patch);
    let partition = Partition { face_patch, patches, ..partition.clone() };
    let Split { mesh, new_vertices, face_origin, .. } = split;
    Ok(Some(CutSurface { mesh, topology: new, features, partition, new_vertices, face_origin, border_length: [0.0; 2] }))
}

/// Patch of each face: that of the border beside which it is, or its old one where no border moved. `None` if that is not one connected
/// set for each patch.
fn labels(topology: &Topology, features: &Features, partition: &Partition, split: &Split, sides: &[[u32; 2]]) -> Option<Vec<u32>> {
    const NONE: u32 = u32::MAX;
    let old = |f: u32| partition.face_patch[split.face_origin[f as usize] as usize];
    let mut wall = vec![false; topology.halfedge_count()];
    let mut seed = vec![NONE; topology.face_count()];
    for (path, [left, right]) in split.paths.iter().zip(sides) {
        for pair in path.windows(2) {
            let h = topology.outgoing(pair[0]).find(|&h| topology.target(h) == pair[1])?;
            let t = topology.twin(h)?;
            for (h, side) in [(h, *left), (t, *right)] {
                wall[h as usize] = true;
                let seed = &mut seed[h as usize / 3];
                if *seed != NONE && *seed != side {
                    return None;
                }
                *seed = side;
            }
        }
    }
    for h in 0..wall.len() as u32 {
        wall[h as usize] |= features.is_feature[h as usize] && topology.twin(h).is_some_and(|t| old(h / 3) != old(t / 3));
    }
    let mut label = vec![NONE; topology.face_count()];
    let mut found = vec![false; partition.patches.len()];
    let mut set = Vec::new();
    for start in 0..label.len() as u32 {
        if label[start as usize] != NONE {
            continue;
        }
        set.clear();
        set.push(start);
        label[start as usize] = old(start);
        let (mut head, mut known) = (0, NONE);
        while head < set.len() {
            let f = set[head];
            head += 1;
            let here = seed[f as usize];
            if here != NONE && known != NONE && here != known {
                return None;
            }
            known = if here == NONE { known } else { here };
            for h in (3 * f..3 * f + 3).filter(|&h| !wall[h as usize]) {
                if let Some(g) = topology.twin(h).map(|t| t / 3).filter(|&g| label[g as usize] == NONE) {
                    label[g as usize] = old(g);
                    set.push(g);
                }
            }
        }
        let patch = if known == NONE { old(start) } else { known };
        if std::mem::replace(found.get_mut(patch as usize)?, true) {
            return None;
        }
        set.iter().for_each(|&f| label[f as usize] = patch);
    }
    found.iter().all(|&found| found).then_some(label)
}
