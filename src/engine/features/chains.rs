//! Chains of sharp edges: free branches and components that are too short are noise (scans, slivers) and lose their marks.

use super::{Mark, set_mark};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, angle_between, bounding_diagonal, distance, triangle_area};
use crate::work::Work;

/// A component without a closed chain must be this many times longer than one with: creases of scans come in open fragments,
/// edges of parts close up.
const OPEN_FACTOR: f64 = 5.0;
/// And must span this share of its required length, which a ragged cluster does not.
const OPEN_SPAN: f64 = 0.6;
/// Unless this share of all sharp length passes: then the surface is a part, and its short open chains are believed too.
const PART_SHARE: f64 = 0.95;
/// Sharp edges that close off less than this share of the square of the shortest length are noise.
const SPECK_AREA: f64 = 0.1;
/// So are those that close off at most this many faces where the other edges around turn by [`ROUGH`] (radians) on average.
const SPECK_FACES: usize = 16;
const ROUGH: f64 = 0.17;
/// Opening one speck may uncover a larger one: sweeps at most.
const SPECK_SWEEPS: usize = 3;

/// Drops the sharp edges around specks, then sharp branches with a free end and sharp components shorter than `shortest`.
/// Given marks are never dropped and hold the sharp edges that touch them. O(F).
pub(super) fn drop_noise(
    mesh: &SurfaceMesh,
    topology: &Topology,
    normals: &[Vec3],
    shortest: f64,
    marks: &mut [Mark],
    work: &Work<'_>,
) -> Result<()> {
    for _ in 0..SPECK_SWEEPS {
        let opened = dissolve_specks(mesh, topology, normals, SPECK_AREA * shortest * shortest, marks);
        work.check()?;
        if opened == 0 {
            break;
        }
    }
    prune_branches(mesh, topology, shortest, marks);
    work.check()?;
    drop_components(mesh, topology, shortest, marks);
    work.check()
}

/// Joins every piece of surface that sharp edges close off and that is smaller than `least_area` to the neighbour across the
/// longest sharp edge, smallest face numbers first. Returns how many were joined.
fn dissolve_specks(mesh: &SurfaceMesh, topology: &Topology, normals: &[Vec3], least_area: f64, marks: &mut [Mark]) -> usize {
    let mut done = vec![false; topology.face_count()];
    let mut piece: Vec<u32> = Vec::new();
    let mut opened = 0;
    for seed in 0..topology.face_count() as u32 {
        if done[seed as usize] {
            continue;
        }
        let mut area = 0.0;
        piece.clear();
        piece.push(seed);
        done[seed as usize] = true;
        let mut head = 0;
        while head < piece.len() {
            let f = piece[head];
            head += 1;
            let [a, b, c] = mesh.corners(f as usize);
            area += triangle_area(a, b, c);
            for t in (3 * f..3 * f + 3).filter(|&h| marks[h as usize] == Mark::None).filter_map(|h| topology.twin(h)) {
                if !std::mem::replace(&mut done[topology.face(t) as usize], true) {
                    piece.push(topology.face(t));
                }
            }
        }
        if area < least_area || piece.len() <= SPECK_FACES && roughness(topology, normals, &piece, marks) > ROUGH {
            opened += usize::from(open_speck(mesh, topology, &piece, marks));
        }
    }
    opened
}

/// Mean angle (radians) across the edges at the vertices of a piece that carry no mark.
fn roughness(topology: &Topology, normals: &[Vec3], piece: &[u32], marks: &[Mark]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for h in piece.iter().flat_map(|&f| 3 * f..3 * f + 3).flat_map(|h| topology.outgoing(topology.origin(h))) {
        if let Some(t) = topology.twin(h).filter(|_| marks[h as usize] == Mark::None) {
            sum += angle_between(normals[topology.face(h) as usize], normals[topology.face(t) as usize]);
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Unmarks the longest sharp edge of a speck's border, if it has one.
fn open_speck(mesh: &SurfaceMesh, topology: &Topology, piece: &[u32], marks: &mut [Mark]) -> bool {
    let sharp = piece.iter().flat_map(|&f| 3 * f..3 * f + 3).filter(|&h| marks[h as usize] == Mark::Sharp);
    let longest = sharp.map(|h| (length_of(mesh, topology, h), h)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    if let Some((_, h)) = longest {
        set_mark(topology, marks, h, Mark::None);
    }
    longest.is_some()
}

/// Marked halfedges that leave `v`. Marks are on interior edges only, so every marked edge of `v` occurs once.
fn marked_at(topology: &Topology, marks: &[Mark], v: u32) -> impl Iterator<Item = u32> {
    topology.outgoing(v).filter(move |&h| marks[h as usize] != Mark::None)
}

fn length_of(mesh: &SurfaceMesh, topology: &Topology, h: u32) -> f64 {
    distance(mesh.positions[topology.origin(h) as usize], mesh.positions[topology.target(h) as usize])
}

/// Removes, again and again, sharp branches from a free end to a junction that are shorter than `shortest`.
fn prune_branches(mesh: &SurfaceMesh, topology: &Topology, shortest: f64, marks: &mut [Mark]) {
    let mut ends: Vec<u32> = (0..topology.vertex_count() as u32).filter(|&v| marked_at(topology, marks, v).count() == 1).collect();
    let mut branch = Vec::new();
    while let Some(end) = ends.pop() {
        branch.clear();
        let mut length = 0.0;
        let mut at = end;
        let mut came = None;
        // A junction ends the walk; so does an edge that stays anyway, or enough length.
        let junction = loop {
            let mut onward = marked_at(topology, marks, at).filter(|&h| Some(h) != came);
            let (Some(h), None) = (onward.next(), onward.next()) else { break at };
            if marks[h as usize] == Mark::Given || length >= shortest {
                break at;
            }
            branch.push(h);
            length += length_of(mesh, topology, h);
            at = topology.target(h);
            came = topology.twin(h);
        };
        let free = marked_at(topology, marks, junction).count() == 1;
        if length >= shortest || branch.is_empty() || free {
            continue; // long enough, nothing there, or a component of its own (judged as a whole below)
        }
        for &h in &branch {
            set_mark(topology, marks, h, Mark::None);
        }
        if marked_at(topology, marks, junction).count() == 1 {
            ends.push(junction);
        }
    }
}

/// A connected component of marked edges.
struct Component {
    /// Marked halfedges; of every edge both.
    halves: Vec<u32>,
    vertices: usize,
    length: f64,
    /// Diagonal of the bounding box.
    span: f64,
    /// Whether a given edge is in it.
    held: bool,
}

impl Component {
    /// A closed chain of length l spans at least l / pi.
    fn is_short(&self, shortest: f64) -> bool {
        self.length < shortest || self.span < shortest / std::f64::consts::PI
    }

    /// Whether it has no closed chain (a tree has one edge less than it has vertices) and is not long and wide enough for that.
    fn is_fragment(&self, shortest: f64) -> bool {
        let wanted = OPEN_FACTOR * shortest;
        self.halves.len() / 2 < self.vertices && (self.length < wanted || self.span < OPEN_SPAN * wanted)
    }
}

/// Removes connected components of sharp edges that hold no given edge and are noise by their size.
fn drop_components(mesh: &SurfaceMesh, topology: &Topology, shortest: f64, marks: &mut [Mark]) {
    let components = collect_components(mesh, topology, marks);
    let long: f64 = components.iter().filter(|c| c.held || !c.is_short(shortest)).map(|c| c.length).sum();
    let sound: f64 = components.iter().filter(|c| c.held || !c.is_short(shortest) && !c.is_fragment(shortest)).map(|c| c.length).sum();
    let is_part = sound >= PART_SHARE * long;
    for component in components.iter().filter(|c| !c.held) {
        if component.is_short(shortest) || !is_part && component.is_fragment(shortest) {
            for &h in &component.halves {
                set_mark(topology, marks, h, Mark::None);
            }
        }
    }
}

fn collect_components(mesh: &SurfaceMesh, topology: &Topology, marks: &[Mark]) -> Vec<Component> {
    let mut seen = vec![false; topology.vertex_count()];
    let (mut stack, mut points) = (Vec::new(), Vec::new());
    let mut components = Vec::new();
    for seed in 0..topology.vertex_count() as u32 {
        if seen[seed as usize] || marked_at(topology, marks, seed).next().is_none() {
            continue;
        }
        let mut halves = Vec::new();
        points.clear();
        seen[seed as usize] = true;
        stack.push(seed);
        while let Some(v) = stack.pop() {
            points.push(mesh.positions[v as usize]);
            for h in marked_at(topology, marks, v) {
                halves.push(h);
                let to = topology.target(h);
                if !std::mem::replace(&mut seen[to as usize], true) {
                    stack.push(to);
                }
            }
        }
        components.push(Component {
            vertices: points.len(),
            length: 0.5 * halves.iter().map(|&h| length_of(mesh, topology, h)).sum::<f64>(),
            span: bounding_diagonal(&points),
            held: halves.iter().any(|&h| marks[h as usize] == Mark::Given),
            halves,
        });
    }
    components
}
