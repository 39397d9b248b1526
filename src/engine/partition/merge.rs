//! Merging of neighbouring patches whose union is still a valid patch.

use super::faces_by_patch;
use super::surface::{Limits, Piece, Scratch, Surface, measure, trace};
use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Patches joined along less than this share of the shorter border stay apart: a chart of two lobes on a thin neck may overlap.
const LEAST_CONTACT: f64 = 0.12;

/// When to stop merging and what to keep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// Wanted number of patches; `None` merges whatever may be merged.
    pub(super) patches: Option<u32>,
    /// Faces that unions should not exceed while that is possible.
    pub(super) planned_faces: u32,
    /// What the union must keep.
    pub(super) limits: Limits,
}

/// A pair to try: contact as bits (larger is better), the two patches and their versions when it was proposed.
type Candidate = (u64, Reverse<[u32; 2]>, [u32; 2]);

/// Merges pairs of neighbours, longest relative contact first, while the union keeps `goal.limits`. Each patch is merged at most
/// log(patches) times into a larger one; a trial costs the two borders.
pub(super) fn merge_patches(surface: &Surface<'_>, label: &mut [u32], goal: &Goal, scratch: &mut Scratch, work: &Work<'_>) -> Result<()> {
    let faces = faces_by_patch(label);
    let pieces: Vec<Piece> = faces.iter().enumerate().map(|(p, set)| measure(surface, label, set, p as u32, scratch)).collect();
    let mut left = faces.iter().filter(|set| !set.is_empty()).count() as u32;
    let mut merger = Merger { surface, label, version: vec![0; faces.len()], faces, pieces, heap: BinaryHeap::new() };
    // First to patches of about the planned size, then, if a number is wanted, to any size allowed.
    for faces in [goal.planned_faces.min(goal.limits.faces), goal.limits.faces] {
        let limits = Limits { faces, ..goal.limits };
        merger.heap.clear();
        for p in 0..merger.pieces.len() as u32 {
            merger.propose(p, |q| q > p);
        }
        while goal.patches.is_none_or(|k| left > k) {
            let Some((_, Reverse([p, q]), versions)) = merger.heap.pop() else { break };
            if [p, q].map(|x| merger.version[x as usize]) != versions {
                continue;
            }
            work.check()?;
            if let Some(union) = merger.union_of(p, q, &limits, scratch) {
                merger.accept(p, q, union);
                left -= 1;
            }
        }
    }
    Ok(())
}

struct Merger<'a> {
    surface: &'a Surface<'a>,
    label: &'a mut [u32],
    faces: Vec<Vec<u32>>,
    pieces: Vec<Piece>,
    version: Vec<u32>,
    heap: BinaryHeap<Candidate>,
}

impl Merger<'_> {
    /// Puts the pairs of `p` with its wanted neighbours on the heap.
    fn propose(&mut self, p: u32, wanted: impl Fn(u32) -> bool) {
        let mut contact: Vec<(u32, f64)> = Vec::new();
        for &h in &self.pieces[p as usize].border {
            if let Some(g) = self.surface.crossing(h) {
                contact.push((self.label[g as usize], self.surface.length[h as usize]));
            }
        }
        contact.sort_by_key(|c| c.0);
        for run in contact.chunk_by(|a, b| a.0 == b.0).filter(|run| wanted(run[0].0)) {
            let q = run[0].0;
            let shared: f64 = run.iter().map(|c| c.1).sum();
            let shorter = self.pieces[p as usize].border_length.min(self.pieces[q as usize].border_length);
            let share = if shorter > 0.0 { (shared / shorter).min(1.0) } else { 1.0 };
            if share >= LEAST_CONTACT {
                let pair = [p.min(q), p.max(q)];
                // Bits of a positive number order as the number does.
                self.heap.push((share.to_bits(), Reverse(pair), pair.map(|x| self.version[x as usize])));
            }
        }
    }

    /// The union of two patches if it is valid. O(borders).
    fn union_of(&self, p: u32, q: u32, limits: &Limits, scratch: &mut Scratch) -> Option<Piece> {
        let (a, b) = (&self.pieces[p as usize], &self.pieces[q as usize]);
        if u64::from(a.faces) + u64::from(b.faces) > u64::from(limits.faces) {
            return None;
        }
        let topology = self.surface.topology;
        let label = &*self.label;
        let inside = |f: u32| label[f as usize] == p || label[f as usize] == q;
        let mut union = Piece {
            faces: a.faces + b.faces,
            area: a.area + b.area,
            inner_vertices: a.inner_vertices + b.inner_vertices,
            ..Piece::default()
        };
        scratch.vertices.clear();
        for &h in a.border.iter().chain(&b.border) {
            if !topology.twin(h).is_some_and(|t| inside(t / 3)) {
                union.border.push(h);
                continue;
            }
            let v = topology.origin(h);
            let enclosed = scratch.vertices.mark(v) && !topology.is_boundary_vertex(v) && topology.outgoing(v).all(|k| inside(k / 3));
            union.inner_vertices += u32::from(enclosed);
        }
        trace(self.surface, &mut union, inside, scratch);
        union.is_valid(limits).then_some(union)
    }

    fn accept(&mut self, p: u32, q: u32, union: Piece) {
        let (into, from) = if self.faces[p as usize].len() >= self.faces[q as usize].len() { (p, q) } else { (q, p) };
        let moved = std::mem::take(&mut self.faces[from as usize]);
        for &f in &moved {
            self.label[f as usize] = into;
        }
        self.faces[into as usize].extend(moved);
        self.pieces[from as usize] = Piece::default();
        self.pieces[into as usize] = union;
        self.version[into as usize] += 1;
        self.version[from as usize] += 1;
        self.propose(into, |_| true);
    }
}
