//! Partition along handle loops: pieces with handles are cut along short disjoint loops to genus 0, then in two such that every loop has
//! one of the two on either side (P3 section 4.2).

use super::depth::expected_charts;
use super::homology::{DisjointSets, Loop, handle_loops, holes_of};
use super::nearest::Nearest;
use super::plane::limits_of;
use super::surface::{Scratch, Surface, measure};
use super::{Partition, PartitionSpec, complete, connected_sets, face_groups};
use crate::error::{EngineError, Result};
use crate::topology::Topology;
use crate::work::Work;

/// Labels of the faces of a piece while it is cut in two.
const NONE: u8 = 2;
/// Rounds of finding loops without progress before the rest is left to the divider.
const IDLE_ROUNDS: u32 = 2;

/// Which of the loops of a handle are cut: those around it are mostly short, those along it mostly long. Short cuts leave tubes, along
/// which a flat map shrinks exponentially; long ones open them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loops {
    /// The shortest disjoint ones.
    Shortest,
    /// The shortest of those that cross or depend on the shortest.
    Dual,
}

/// Partitions along handle loops, around the handles or along them: what gives fewer patches, of equal numbers what is expected to need
/// fewer charts.
pub(super) fn by_handles(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let mut best: Option<((usize, f64), Partition)> = None;
    for loops in [Loops::Shortest, Loops::Dual] {
        let sets = open_handles(surface, face_groups(surface), loops, work)?;
        let partition = complete(surface, sets, limits_of(spec), spec, work)?;
        let score = (partition.patches.len(), expected_charts(surface, &partition, work)?);
        if best.as_ref().is_none_or(|b| score < b.0) {
            best = Some((score, partition));
        }
    }
    best.map(|b| b.1).ok_or_else(|| EngineError::invariant("no loops were tried"))
}

/// Cuts every one of some disjoint connected sets of faces that has handles along short loops, in two halves of genus 0 (each of one
/// connected set, or a few where the triangles leave no room).
pub(super) fn open_handles(surface: &Surface<'_>, sets: Vec<Vec<u32>>, loops: Loops, work: &Work<'_>) -> Result<Vec<Vec<u32>>> {
    let mut label = vec![u32::MAX; surface.topology.face_count()];
    for (p, set) in sets.iter().enumerate() {
        set.iter().for_each(|&f| label[f as usize] = 2 * p as u32);
    }
    let mut scratch = Scratch::new(surface.topology);
    for (p, set) in sets.iter().enumerate() {
        work.check()?;
        if measure(surface, &label, set, 2 * p as u32, &mut scratch).genus() > 0 {
            for (&f, half) in set.iter().zip(halve(surface, set, loops, work)?) {
                label[f as usize] += u32::from(half);
            }
        }
    }
    Ok(connected_sets(surface, |f, g| label[f as usize] == label[g as usize]))
}

/// A set of faces as a surface of its own. Halfedges keep their face and corner while it is cut open.
pub(super) struct Sheet {
    /// Halfedge on the other side, in the set and not across a cut; none elsewhere.
    twin: Vec<Option<u32>>,
    pub(super) length: Vec<f64>,
    /// Vertex of the whole surface at each corner.
    corner: Vec<u32>,
}

impl Sheet {
    pub(super) fn new(surface: &Surface<'_>, faces: &[u32]) -> Self {
        let mut slot = vec![u32::MAX; surface.topology.face_count()];
        faces.iter().enumerate().for_each(|(i, &f)| slot[f as usize] = i as u32);
        let halfedges = || faces.iter().flat_map(|&f| 3 * f..3 * f + 3);
        let local = |t: u32| Some(slot[t as usize / 3]).filter(|&i| i != u32::MAX).map(|i| 3 * i + t % 3);
        Sheet {
            twin: halfedges().map(|h| surface.topology.twin(h).and_then(local)).collect(),
            length: halfedges().map(|h| surface.length[h as usize]).collect(),
            corner: halfedges().map(|h| surface.topology.origin(h)).collect(),
        }
    }

    /// Adjacency with vertices doubled along the cuts.
    fn topology(&self) -> Result<Topology> {
        let mut sets = DisjointSets::new(self.twin.len());
        let next = |h: u32| if h % 3 == 2 { h - 2 } else { h + 1 };
        for (h, t) in self.twin.iter().enumerate() {
            if let Some(t) = *t {
                sets.join(h as u32, next(t));
            }
        }
        let mut name = vec![u32::MAX; self.twin.len()];
        let mut count = 0;
        let mut vertex = |h: u32| {
            let root = sets.find(h) as usize;
            if name[root] == u32::MAX {
                name[root] = count;
                count += 1;
            }
            name[root]
        };
        let triangles: Vec<[u32; 3]> =
            (0..self.twin.len() as u32 / 3).map(|f| [vertex(3 * f), vertex(3 * f + 1), vertex(3 * f + 2)]).collect();
        Topology::build(&triangles, count as usize)
            .map_err(|e| EngineError::invariant(format!("a piece cut open along loops is no surface: {e}")))
    }

    fn cut(&mut self, h: u32) {
        if let Some(t) = self.twin[h as usize].take() {
            self.twin[t as usize] = None;
        }
    }
}

/// Cuts a connected set of faces with handles in two: 0 or 1 for each face. Unless the loops lie too close for the triangles, the
/// connected parts of both halves have genus 0. O(F log F) for each round of loops; a few rounds.
fn halve(surface: &Surface<'_>, faces: &[u32], loops: Loops, work: &Work<'_>) -> Result<Vec<u8>> {
    let mut sheet = Sheet::new(surface, faces);
    let closed = Sheet { twin: sheet.twin.clone(), length: Vec::new(), corner: Vec::new() };
    let flat = cut_open(surface, &mut sheet, loops, work)?;
    two_sides(surface, faces, &closed, &flat, work)
}

/// Cuts the sheet along disjoint loops until it has no handle; returns its adjacency then.
pub(super) fn cut_open(surface: &Surface<'_>, sheet: &mut Sheet, wanted: Loops, work: &Work<'_>) -> Result<Topology> {
    let mut topology = sheet.topology()?;
    let mut genus = topology.totals().1;
    let mut cuts = vec![Place::Free; surface.topology.vertex_count()];
    let (mut idle, mut round) = (0, 0u32);
    while genus > 0 && idle < IDLE_ROUNDS {
        let root = round.wrapping_mul(0x9E37) % topology.vertex_count().max(1) as u32;
        round += 1;
        let found = handle_loops(&topology, &sheet.length, root, work)?;
        let cut = choose(surface, sheet, &topology, &found, wanted, &cuts);
        for &i in &cut {
            for &h in &found[i].edges {
                for v in [sheet.corner[h as usize], sheet.corner[topology.next(h) as usize]] {
                    for k in surface.topology.outgoing(v) {
                        let beside = &mut cuts[surface.topology.target(k) as usize];
                        *beside = (*beside).max(Place::Beside);
                    }
                    cuts[v as usize] = Place::On;
                }
                sheet.cut(h);
            }
        }
        topology = sheet.topology()?;
        let now = topology.totals().1;
        idle = if now < genus { 0 } else { idle + 1 };
        genus = now;
    }
    Ok(topology)
}

/// Where a vertex is with respect to earlier cuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Free,
    Beside,
    On,
}

/// Loops, sorted by length, that keep at least an edge off each other and off earlier cuts; if there is none, such that meet no earlier
/// cut; if all do, the first alone. Any disjoint loops of a basis leave the surface connected.
fn choose(surface: &Surface<'_>, sheet: &Sheet, topology: &Topology, found: &[Loop], wanted: Loops, cuts: &[Place]) -> Vec<usize> {
    let pick = |order: &mut dyn Iterator<Item = usize>, most: Place| {
        let mut near = vec![false; cuts.len()];
        let mut chosen = Vec::new();
        for i in order {
            let ends = |&h: &u32| [sheet.corner[h as usize], sheet.corner[topology.next(h) as usize]];
            let vertices: Vec<u32> = found[i].edges.iter().flat_map(ends).collect();
            if vertices.iter().any(|&v| near[v as usize] || cuts[v as usize] > most) {
                continue;
            }
            for v in vertices {
                near[v as usize] = true;
                surface.topology.outgoing(v).for_each(|h| near[surface.topology.target(h) as usize] = true);
            }
            chosen.push(i);
        }
        chosen
    };
    for most in [Place::Free, Place::Beside] {
        let shortest = pick(&mut (0..found.len()), most);
        let dual = match wanted {
            Loops::Shortest => Vec::new(),
            Loops::Dual => pick(&mut (0..found.len()).filter(|i| shortest.binary_search(i).is_err()), most),
        };
        if let Some(chosen) = [dual, shortest].into_iter().find(|chosen| !chosen.is_empty()) {
            return chosen;
        }
    }
    if found.is_empty() { Vec::new() } else { vec![0] }
}

/// Gives each side of every cut one of two labels and spreads them: from the cut sides of a label along paths that join them, then to
/// the nearest.
fn two_sides(surface: &Surface<'_>, faces: &[u32], closed: &Sheet, flat: &Topology, work: &Work<'_>) -> Result<Vec<u8>> {
    let dual = Dual::new(surface, faces, flat);
    let hole = holes_of(flat);
    let pairs = hole_pairs(closed, flat, &hole);
    let colour = colour_holes(&dual, flat, &pairs, work)?;
    let mut label = vec![NONE; faces.len()];
    // Faces along the cuts, then those that touch them in a vertex.
    for h in 0..hole.len() as u32 {
        if let Some(&c) = hole.get(h as usize).and_then(|&i| colour.get(i as usize))
            && c != NONE
            && closed.twin[h as usize].is_some()
            && label[h as usize / 3] == NONE
        {
            label[h as usize / 3] = c;
        }
    }
    for (i, ring) in flat.loops.iter().enumerate().filter(|(i, _)| colour[*i] != NONE) {
        for h in ring.iter().flat_map(|&h| flat.outgoing(flat.origin(h))) {
            let slot = &mut label[h as usize / 3];
            if *slot == NONE {
                *slot = colour[i];
            }
        }
    }
    for c in [0, 1] {
        join(&dual, &mut label, c, work)?;
    }
    spread(&dual, &mut label, work)?;
    Ok(label)
}

/// Holes of the opened sheet that lie across a cut from one another.
fn hole_pairs(closed: &Sheet, flat: &Topology, hole: &[u32]) -> Vec<[u32; 2]> {
    let mut pairs: Vec<[u32; 2]> = (0..flat.halfedge_count())
        .filter(|&h| hole[h] != u32::MAX)
        .filter_map(|h| closed.twin[h].map(|t| [hole[h], hole[t as usize]]))
        .filter(|[a, b]| a < b)
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Faces and the distances between neighbours' centroids, over the common edge.
pub(super) struct Dual<'a> {
    flat: &'a Topology,
    /// Length of the step over each halfedge.
    pub(super) step: Vec<f64>,
}

impl<'a> Dual<'a> {
    pub(super) fn new(surface: &Surface<'_>, faces: &[u32], flat: &'a Topology) -> Self {
        // From the centroid to the middle of an edge it is a third of the median.
        let half = |h: usize| {
            let [a, b, c] = surface.mesh.corners(faces[h / 3] as usize);
            let (from, to, tip) = [(a, b, c), (b, c, a), (c, a, b)][h % 3];
            crate::vector::distance(crate::vector::lerp(from, to, 0.5), tip) / 3.0
        };
        let half: Vec<f64> = (0..flat.halfedge_count()).map(half).collect();
        let step = (0..half.len()).map(|h| half[h] + flat.twin(h as u32).map_or(0.0, |t| half[t as usize])).collect();
        Dual { flat, step }
    }

    pub(super) fn neighbours(&self, f: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        (3 * f..3 * f + 3).filter_map(|h| self.flat.twin(h).map(|t| (t / 3, self.step[h as usize])))
    }

    /// Distances of all faces from some.
    fn distances(&self, from: impl Iterator<Item = u32>, work: &Work<'_>) -> Result<Vec<f64>> {
        let mut nearest = Nearest::new(self.flat.face_count());
        from.for_each(|f| nearest.source(f));
        while let Some(f) = nearest.take(work)? {
            for (g, step) in self.neighbours(f) {
                nearest.reach(f, g, step);
            }
        }
        Ok(nearest.distance)
    }
}

/// 0 or 1 for each hole at a cut such that paired holes differ, `NONE` for the others. Of the two ways for each cluster of pairs the one
/// is taken that keeps equal colours together: near the two sides of the pair whose sides are farthest apart.
fn colour_holes(dual: &Dual<'_>, flat: &Topology, pairs: &[[u32; 2]], work: &Work<'_>) -> Result<Vec<u8>> {
    let mut colour = vec![NONE; flat.loops.len()];
    let Some(&[first, _]) = pairs.first() else { return Ok(colour) };
    let faces_of = |i: u32| flat.loops[i as usize].iter().map(|&h| h / 3);
    let at = |distance: &[f64], i: u32| faces_of(i).map(|f| distance[f as usize]).fold(f64::INFINITY, f64::min);
    // The pair whose two sides are farthest apart, by the difference of their distances from a landmark.
    let from_first = dual.distances(faces_of(first), work)?;
    let spread = |p: &[u32; 2]| (at(&from_first, p[0]) - at(&from_first, p[1])).abs();
    let Some(&[zero, one]) = pairs.iter().max_by(|p, q| spread(p).total_cmp(&spread(q)).then(q.cmp(p))) else { return Ok(colour) };
    let (to_zero, to_one) = (dual.distances(faces_of(zero), work)?, dual.distances(faces_of(one), work)?);
    let lean = |i: u32| at(&to_zero, i) - at(&to_one, i);
    // Clusters of holes connected by pairs; nearly always single pairs.
    let mut mates: Vec<Vec<u32>> = vec![Vec::new(); colour.len()];
    for &[a, b] in pairs {
        mates[a as usize].push(b);
        mates[b as usize].push(a);
    }
    for seed in 0..colour.len() as u32 {
        if colour[seed as usize] != NONE || mates[seed as usize].is_empty() {
            continue;
        }
        colour[seed as usize] = 0;
        let mut cluster = vec![seed];
        let mut head = 0;
        while head < cluster.len() {
            let a = cluster[head];
            head += 1;
            for &b in &mates[a as usize] {
                if colour[b as usize] == NONE {
                    colour[b as usize] = 1 - colour[a as usize];
                    cluster.push(b);
                }
            }
        }
        let sum: f64 = cluster.iter().map(|&i| if colour[i as usize] == 0 { lean(i) } else { -lean(i) }).sum();
        if sum > 0.0 {
            cluster.iter().for_each(|&i| colour[i as usize] = 1 - colour[i as usize]);
        }
    }
    Ok(colour)
}

/// Joins the connected sets of faces of label `c` by shortest paths over faces without label, the nearest first. Sets that cannot be
/// reached stay apart. O(F log F), times a small factor where many sets lie close together.
fn join(dual: &Dual<'_>, label: &mut [u8], c: u8, work: &Work<'_>) -> Result<()> {
    let Some(first) = (0..label.len() as u32).find(|&f| label[f as usize] == c) else { return Ok(()) };
    let mut nearest = Nearest::new(label.len());
    let mut joined = vec![false; label.len()];
    let mut absorb = |start: u32, label: &[u8], nearest: &mut Nearest| {
        let mut stack = vec![start];
        while let Some(f) = stack.pop() {
            if label[f as usize] == c && !std::mem::replace(&mut joined[f as usize], true) {
                nearest.source(f);
                stack.extend(dual.neighbours(f).map(|(g, _)| g));
            }
        }
    };
    absorb(first, label, &mut nearest);
    while let Some(f) = nearest.take(work)? {
        if label[f as usize] == c && nearest.distance[f as usize] > 0.0 {
            // Another set: the way to it and the set itself are joined.
            let mut at = nearest.from[f as usize];
            while label[at as usize] == NONE {
                label[at as usize] = c;
                at = nearest.from[at as usize];
            }
            absorb(f, label, &mut nearest);
            continue;
        }
        for (g, step) in dual.neighbours(f).filter(|(g, _)| label[*g as usize] != 1 - c) {
            nearest.reach(f, g, step);
        }
    }
    Ok(())
}

/// Gives every face without label that of the nearest with one.
fn spread(dual: &Dual<'_>, label: &mut [u8], work: &Work<'_>) -> Result<()> {
    let mut nearest = Nearest::new(label.len());
    (0..label.len() as u32).filter(|&f| label[f as usize] != NONE).for_each(|f| nearest.source(f));
    while let Some(f) = nearest.take(work)? {
        for (g, step) in dual.neighbours(f) {
            if nearest.reach(f, g, step) {
                label[g as usize] = label[f as usize];
            }
        }
    }
    label.iter_mut().filter(|c| **c == NONE).for_each(|c| *c = 0);
    Ok(())
}
