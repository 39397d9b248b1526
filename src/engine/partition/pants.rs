//! Pants decomposition (P3 algorithms 1 and 2): pieces with handles are cut open along short disjoint loops, then loops around two holes
//! at a time, the nearest first, cut off parts of genus 0 with three loops until nothing else is left.
//!
//! P3 runs a shortest path from every vertex of a cut graph for every loop. Here the loops around handles come from one shortest path tree
//! per round, and a loop around two holes is the shortest front of a wave that starts at both and at the way between them: each loop costs
//! O(n log n) in the n faces its wave passes.

use super::handles::{Dual, Loops, Sheet, cut_open, open_handles};
use super::homology::{DisjointSets, holes_of};
use super::nearest::Nearest;
use super::straighten::straighten_borders;
use super::surface::{Limits, Scratch, Stamps, Surface, measure};
use super::{Partition, PartitionSpec, connected_sets, divided, face_groups, faces_by_patch, finish, renumber, smooth};
use crate::error::Result;
use crate::topology::Topology;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No hole, no pair of pants.
const NONE: u32 = u32::MAX;
/// Loops that a pair of pants has.
const LOOPS: u32 = 3;
/// A wave goes on for this share of the length of its shortest front so far.
const REACH: f64 = 0.6;

/// Cuts into pairs of pants, then further where size or aspect ratio ask for it. A pair glued to itself along a loop (a handle closed in
/// itself) is cut in two. Nothing is merged; borders are smoothed and, unless that takes a
/// hole to the other side of one, laid along shortest paths.
pub(super) fn by_pants(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let limits = Limits::new(spec);
    let groups = face_groups(surface);
    let mut label = vec![NONE; surface.topology.face_count()];
    let mut next = 0;
    for group in &groups {
        let pants = decompose(surface, group, work)?;
        group.iter().zip(&pants).for_each(|(&f, &p)| label[f as usize] = next + p);
        next += pants.iter().max().map_or(0, |p| p + 1);
    }
    let sets = connected_sets(surface, |f, g| label[f as usize] == label[g as usize]);
    let sets = open_handles(surface, sets, Loops::Shortest, work)?;
    let (mut label, _) = divided(surface, sets, limits, spec, work)?;
    renumber(&mut label);
    smooth::smooth_borders(surface, &mut label, limits, work)?;
    // A shortest path may pass a small hole on its other side.
    let (before, kept) = (loops(surface, &label), label.clone());
    straighten_borders(surface, &mut label, limits, work)?;
    let label = if loops(surface, &label) == before { label } else { kept };
    finish(surface, label, limits, work)
}

/// Border loops of each part.
fn loops(surface: &Surface<'_>, label: &[u32]) -> Vec<u32> {
    let mut scratch = Scratch::new(surface.topology);
    faces_by_patch(label).iter().enumerate().map(|(p, faces)| measure(surface, label, faces, p as u32, &mut scratch).loops).collect()
}

/// Fewest patches that a pants decomposition of pieces with these (genus, loops) can have.
pub(super) fn fewest_pants(pieces: impl Iterator<Item = (i64, u32)>) -> i64 {
    pieces.map(|(genus, loops)| (2 * genus - 2 + i64::from(loops)).max(if genus > 0 || loops == 0 { 2 } else { 1 })).sum()
}

/// Pair of pants of each of some connected faces, numbered from 0. Where the triangles leave no room for a loop, two pairs stay one part.
fn decompose(surface: &Surface<'_>, faces: &[u32], work: &Work<'_>) -> Result<Vec<u32>> {
    let mut sheet = Sheet::new(surface, faces);
    let flat = cut_open(surface, &mut sheet, Loops::Shortest, work)?;
    if flat.totals().1 > 0 || flat.loops.len() as u32 <= LOOPS {
        return Ok(vec![0; faces.len()]);
    }
    let dual = Dual::new(surface, faces, &flat);
    let mut state = Pants::new(&flat, &dual, &sheet.length);
    while state.alive > LOOPS {
        let before = state.alive;
        state.round(work)?;
        if state.alive == before {
            break;
        }
    }
    // What is left is the last pair.
    let last = state.region_hole.len() as u32;
    Ok(state.pants.into_iter().map(|p| if p == NONE { last } else { p }).collect())
}

/// A way between two holes: the faces where the cells of both meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Meeting {
    f: u32,
    g: u32,
    /// Halfedge of `f` between them.
    h: u32,
}

/// A surface of genus 0 from which pairs of pants are cut off one after the other. A hole is a boundary loop or, later, the open loop of
/// what has been cut off; it is named by the lowest boundary loop that it stands for.
struct Pants<'a> {
    flat: &'a Topology,
    dual: &'a Dual<'a>,
    length: &'a [f64],
    /// Boundary loop of each boundary halfedge.
    loop_of: Vec<u32>,
    /// Pair of pants of each face; `NONE` while it is free.
    pants: Vec<u32>,
    /// A boundary loop of the hole that each pair of pants belongs to.
    region_hole: Vec<u32>,
    /// A boundary loop of the hole that each vertex touches; `NONE` if none.
    touches: Vec<u32>,
    /// Boundary loops that stand for one hole.
    holes: DisjointSets,
    /// Length of the loop around each hole.
    around: Vec<f64>,
    /// Halfedges of free faces along each hole.
    rim: Vec<Vec<u32>>,
    /// Holes.
    alive: u32,
    /// Vertices of the part that is growing, and faces counted for it.
    mine: Stamps,
    counted: Stamps,
    wave: Nearest,
}

/// How far a growing part keeps off other holes: so that later parts can get between, or just so that it does not touch them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Room {
    Wide,
    Narrow,
}

/// A way between two holes.
struct Way {
    holes: [u32; 2],
    faces: Vec<u32>,
    cost: f64,
}

impl<'a> Pants<'a> {
    fn new(flat: &'a Topology, dual: &'a Dual<'a>, length: &'a [f64]) -> Self {
        let mut touches = vec![NONE; flat.vertex_count()];
        for (i, ring) in flat.loops.iter().enumerate() {
            ring.iter().for_each(|&h| touches[flat.origin(h) as usize] = i as u32);
        }
        Pants {
            flat,
            dual,
            length,
            loop_of: holes_of(flat),
            pants: vec![NONE; flat.face_count()],
            region_hole: Vec::new(),
            touches,
            holes: DisjointSets::new(flat.loops.len()),
            around: flat.loops.iter().map(|ring| ring.iter().map(|&h| length[h as usize]).sum()).collect(),
            rim: flat.loops.clone(),
            alive: flat.loops.len() as u32,
            mine: Stamps::new(flat.vertex_count()),
            counted: Stamps::new(flat.face_count()),
            wave: Nearest::new(flat.face_count()),
        }
    }

    /// Finds the ways between neighbouring holes and cuts off pairs of pants around the shortest until none is left.
    fn round(&mut self, work: &Work<'_>) -> Result<()> {
        let (cells, cell) = self.cells(work)?;
        let mut heap: BinaryHeap<Reverse<(u64, Meeting)>> = BinaryHeap::new();
        for meeting in self.meetings(&cells, &cell) {
            heap.extend(self.way(&cells, &cell, meeting).map(|way| Reverse((way.cost.to_bits(), meeting))));
        }
        while let Some(Reverse((_, meeting))) = heap.pop() {
            if self.alive <= LOOPS {
                break;
            }
            work.check()?;
            let Some(way) = self.way(&cells, &cell, meeting) else { continue };
            if heap.peek().is_some_and(|Reverse(next)| next.0 < way.cost.to_bits()) {
                heap.push(Reverse((way.cost.to_bits(), meeting)));
            } else {
                for room in [Room::Wide, Room::Narrow] {
                    if self.cut_off(&way, room, work)? {
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    /// Distances of the free faces from the nearest hole, and which it is.
    fn cells(&mut self, work: &Work<'_>) -> Result<(Nearest, Vec<u32>)> {
        let mut nearest = Nearest::new(self.pants.len());
        let mut cell = vec![NONE; self.pants.len()];
        for (i, rim) in self.rim.iter().enumerate() {
            for f in rim.iter().map(|h| h / 3) {
                if cell[f as usize] == NONE {
                    cell[f as usize] = i as u32;
                    nearest.source(f);
                }
            }
        }
        while let Some(f) = nearest.take(work)? {
            for (g, step) in self.dual.neighbours(f).filter(|(g, _)| self.pants[*g as usize] == NONE) {
                if nearest.reach(f, g, step) {
                    cell[g as usize] = cell[f as usize];
                }
            }
        }
        Ok((nearest, cell))
    }

    /// The shortest meeting of each pair of cells.
    fn meetings(&self, cells: &Nearest, cell: &[u32]) -> Vec<Meeting> {
        let mut all: Vec<([u32; 2], u64, Meeting)> = Vec::new();
        for h in (0..self.flat.halfedge_count() as u32).filter(|&h| self.pants[h as usize / 3] == NONE) {
            let Some(g) = self.flat.twin(h).map(|t| t / 3).filter(|&g| self.pants[g as usize] == NONE) else { continue };
            let f = h / 3;
            let pair = [cell[f as usize], cell[g as usize]];
            if pair[0] < pair[1] && pair[1] != NONE {
                let between = cells.distance[f as usize] + self.dual.step[h as usize] + cells.distance[g as usize];
                all.push((pair, between.to_bits(), Meeting { f, g, h }));
            }
        }
        all.sort_unstable();
        all.dedup_by_key(|m| m.0);
        all.into_iter().map(|m| m.2).collect()
    }

    /// The free faces of the way through a meeting as things are now; `None` if it leads from a hole to itself or is taken.
    fn way(&mut self, cells: &Nearest, cell: &[u32], meeting: Meeting) -> Option<Way> {
        let (mut faces, mut holes, mut length) = (Vec::new(), [NONE; 2], self.dual.step[meeting.h as usize]);
        for (k, start) in [meeting.f, meeting.g].into_iter().enumerate() {
            let mut at = start;
            let end = loop {
                match self.pants[at as usize] {
                    NONE => faces.push(at),
                    region => break self.region_hole[region as usize],
                }
                if cells.from[at as usize] == at {
                    break cell[at as usize];
                }
                at = cells.from[at as usize];
            };
            length += cells.distance[start as usize] - cells.distance[at as usize];
            holes[k] = self.holes.find(end);
        }
        let cost = self.around[holes[0] as usize] + self.around[holes[1] as usize] + 2.0 * length.max(0.0);
        (holes[0] != holes[1] && !faces.is_empty()).then_some(Way { holes, faces, cost })
    }

    /// Whether something belongs to one of two holes, given one of their boundary loops.
    fn is_one_of(&mut self, hole: u32, holes: [u32; 2]) -> bool {
        hole != NONE && holes.contains(&self.holes.find(hole))
    }

    /// Whether the part growing around `holes`, or one of them, lies across a halfedge.
    fn is_closed(&mut self, h: u32, holes: [u32; 2], name: u32) -> bool {
        match self.flat.twin(h).map(|t| self.pants[t as usize / 3]) {
            None => self.is_one_of(self.loop_of[h as usize], holes),
            Some(NONE) => false,
            Some(p) => p == name || self.is_one_of(self.region_hole[p as usize], holes),
        }
    }

    /// Cuts off the part between two holes and the shortest front of the wave that runs from both and from the way between them. Nothing
    /// happens, and the answer is `false`, where the front cannot get clear of the holes.
    fn cut_off(&mut self, way: &Way, room: Room, work: &Work<'_>) -> Result<bool> {
        let (holes, name) = (way.holes, self.region_hole.len() as u32);
        let rims: Vec<u32> = holes.iter().flat_map(|&i| self.rim[i as usize].iter().copied()).collect();
        let mut front = Front { length: holes.iter().map(|&i| self.around[i as usize]).sum(), ..Front::default() };
        self.mine.clear();
        self.counted.clear();
        for f in rims.iter().flat_map(|&h| [h, self.flat.next(h)]).flat_map(|h| self.flat.outgoing(self.flat.origin(h))).map(|h| h / 3) {
            if self.pants[f as usize] == NONE && self.counted.mark(f) {
                front.pending += 1;
            }
        }
        let mut reached: Vec<u32> = Vec::new();
        for &f in &way.faces {
            self.add(f, holes, name, &mut front);
        }
        let seeds = way.faces.iter().copied().chain(rims.iter().map(|h| h / 3));
        for f in seeds {
            self.wave.source(f);
            reached.push(f);
        }
        let mut best: Option<(f64, usize)> = None;
        let mut end = f64::INFINITY;
        while let Some(f) = self.wave.take(work)?.filter(|&f| self.wave.distance[f as usize] <= end) {
            let (now, mut stack) = (self.wave.distance[f as usize], vec![f]);
            while let Some(f) = stack.pop() {
                let added = self.pants[f as usize] == name;
                if !added && !self.may_add(f, holes, name, room) {
                    continue;
                }
                if !added {
                    self.add(f, holes, name, &mut front);
                }
                for (g, step) in self.dual.neighbours(f) {
                    if self.pants[g as usize] == NONE {
                        // What has been refused may fit now.
                        if !added && self.wave.distance[g as usize] <= now {
                            stack.push(g);
                        }
                        if self.wave.reach(f, g, step) {
                            reached.push(g);
                        }
                    }
                }
            }
            if front.pending == 0 && best.is_none_or(|b| front.length < b.0) {
                best = Some((front.length, front.faces.len()));
                end = now + REACH * front.length;
            }
        }
        self.wave.forget(reached);
        self.keep(holes, front, best);
        Ok(best.is_some())
    }

    /// Whether a face meets the growing part in one stretch of its outline, and nothing else that is closed.
    fn may_add(&mut self, f: u32, holes: [u32; 2], name: u32, room: Room) -> bool {
        let (mut edges, mut apex) = (0, NONE);
        for h in 3 * f..3 * f + 3 {
            if self.is_closed(h, holes, name) {
                edges += 1;
                apex = self.flat.origin(self.flat.prev(h));
            }
            let v = self.flat.origin(h);
            if self.is_foreign(v, holes) {
                return false;
            }
            if room == Room::Wide && !self.mine.is_marked(v) {
                let flat = self.flat;
                if flat.outgoing(v).any(|k| self.is_foreign(flat.target(k), holes)) {
                    return false;
                }
            }
        }
        edges == 2 || edges == 1 && !self.mine.is_marked(apex) && self.touches[apex as usize] == NONE
    }

    /// Whether a vertex lies on a hole that is none of two.
    fn is_foreign(&mut self, v: u32, holes: [u32; 2]) -> bool {
        let touched = self.touches[v as usize];
        touched != NONE && !self.is_one_of(touched, holes)
    }

    fn add(&mut self, f: u32, holes: [u32; 2], name: u32, front: &mut Front) {
        for h in 3 * f..3 * f + 3 {
            let sign = if self.is_closed(h, holes, name) { -1.0 } else { 1.0 };
            front.length += sign * self.length[h as usize];
        }
        for h in 3 * f..3 * f + 3 {
            self.mine.mark(self.flat.origin(h));
        }
        self.pants[f as usize] = name;
        front.pending -= u32::from(self.counted.is_marked(f));
        front.faces.push(f);
    }

    /// Gives back the faces beyond the best front and makes one hole of the two.
    fn keep(&mut self, holes: [u32; 2], front: Front, best: Option<(f64, usize)>) {
        let (length, count) = best.unwrap_or((0.0, 0));
        front.faces[count..].iter().for_each(|&f| self.pants[f as usize] = NONE);
        if count == 0 {
            return;
        }
        self.region_hole.push(holes[0]);
        self.holes.join(holes[0], holes[1]);
        let hole = self.holes.find(holes[0]) as usize;
        holes.iter().for_each(|&i| self.rim[i as usize].clear());
        for &f in &front.faces[..count] {
            for h in 3 * f..3 * f + 3 {
                self.touches[self.flat.origin(h) as usize] = hole as u32;
                if let Some(t) = self.flat.twin(h).filter(|&t| self.pants[t as usize / 3] == NONE) {
                    self.rim[hole].push(t);
                }
            }
        }
        self.around[hole] = length.max(0.0);
        self.alive -= 1;
    }
}

/// The state of a wave.
#[derive(Debug, Default)]
struct Front {
    /// Length of its front.
    length: f64,
    /// Faces it has passed, in order.
    faces: Vec<u32>,
    /// Faces around the two holes that it has still to pass.
    pending: u32,
}
