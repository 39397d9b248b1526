//! Straightens the curves of a two-way cut: each is replaced by the shortest path along edges within a band around it.

use super::sheet::{NONE, Sheet, next, prev};
use super::{components, share_and_length};
use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Rings of vertices on each side of a curve that its shortest path may use.
const RINGS: u32 = 5;
/// Border vertices that an end of a curve may slide over, to each side.
const SLIDE: usize = 4;
/// What sliding costs, as a share of the length slid over.
const SLIDE_COST: f64 = 0.5;
/// Most that the share of a side may change.
const MOST_SHIFT: f64 = 0.08;
/// Faces pushed between two looks at the flag that stops the work.
const CHECK_EVERY: usize = 4096;

/// Straightens all curves of a cut that run from border to border, or leaves the cut as it is where the sides would not stay
/// connected or would change much. Both sides must be connected. O(n log n) for the n vertices in the bands.
pub(super) fn straighten(sheet: &Sheet, second: &mut Vec<bool>, work: &Work<'_>) -> Result<()> {
    let curves = curves(sheet, second);
    let mut tracer = Tracer::new(sheet);
    tracer.block(&curves.open);
    let mut paths: Vec<Vec<u32>> = curves.closed;
    for curve in curves.open {
        work.check()?;
        paths.push(tracer.shorter(curve, work)?);
    }
    if let Some(straight) = sides(sheet, &paths, second) {
        let shift = (share_and_length(sheet, &straight).0 - share_and_length(sheet, second).0).abs();
        if shift < MOST_SHIFT {
            *second = straight;
        }
    }
    Ok(())
}

/// The curves between two sides as halfedges with the first side on their left.
struct Curves {
    /// From border to border.
    open: Vec<Vec<u32>>,
    closed: Vec<Vec<u32>>,
}

fn curves(sheet: &Sheet, second: &[bool]) -> Curves {
    let first_side = |h: u32| !second[h as usize / 3];
    let across = |h: u32| Some(sheet.twin[h as usize]).filter(|&t| t != NONE && first_side(t));
    let on_cut = |h: u32| first_side(h) && sheet.twin[h as usize] != NONE && !first_side(sheet.twin[h as usize]);
    let follow = |h: u32, step: fn(u32) -> u32| {
        let mut at = step(h);
        while let Some(t) = across(at) {
            at = step(t);
        }
        Some(at).filter(|&at| sheet.twin[at as usize] != NONE)
    };
    let mut seen = vec![false; sheet.twin.len()];
    let mut curves = Curves { open: Vec::new(), closed: Vec::new() };
    let all = || (0..sheet.twin.len() as u32).filter(|&h| on_cut(h));
    // Open ones from their first halfedge, then what is left.
    for from_border in [true, false] {
        for start in all() {
            if seen[start as usize] || from_border && follow(start, prev).is_some() {
                continue;
            }
            let (mut curve, mut at) = (Vec::new(), Some(start));
            while let Some(h) = at.filter(|&h| !std::mem::replace(&mut seen[h as usize], true)) {
                curve.push(h);
                at = follow(h, next);
            }
            if from_border { curves.open.push(curve) } else { curves.closed.push(curve) }
        }
    }
    curves
}

struct Tracer<'a> {
    sheet: &'a Sheet,
    /// A halfedge that leaves each vertex; the border one where there is one.
    leaving: Vec<u32>,
    /// Curves through each vertex, its border counted as one.
    uses: Vec<u32>,
    /// Band that a vertex was last in.
    band: Vec<u32>,
    bands: u32,
    distance: Vec<f64>,
    /// Halfedge of the edge a vertex was reached over, either way round.
    via: Vec<u32>,
}

impl<'a> Tracer<'a> {
    fn new(sheet: &'a Sheet) -> Tracer<'a> {
        let mut leaving = vec![NONE; sheet.vertices];
        for h in 0..sheet.twin.len() as u32 {
            let slot = &mut leaving[sheet.origin(h) as usize];
            if *slot == NONE || sheet.twin[h as usize] == NONE {
                *slot = h;
            }
        }
        let mut uses = vec![0; sheet.vertices];
        sheet.loops.iter().flatten().for_each(|&h| uses[sheet.origin(h) as usize] = 1);
        let count = sheet.vertices;
        Tracer { sheet, leaving, uses, band: vec![0; count], bands: 0, distance: vec![f64::INFINITY; count], via: vec![NONE; count] }
    }

    fn target(&self, h: u32) -> u32 {
        self.sheet.origin(next(h))
    }

    fn vertices(&self, curve: &[u32]) -> Vec<u32> {
        let first = curve.first().map(|&h| self.sheet.origin(h));
        first.into_iter().chain(curve.iter().map(|&h| self.target(h))).collect()
    }

    fn block(&mut self, curves: &[Vec<u32>]) {
        for curve in curves {
            self.vertices(curve).into_iter().for_each(|v| self.uses[v as usize] += 1);
        }
    }

    /// Edges at a vertex as (neighbour, halfedge of the edge).
    fn spokes(&self, v: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let first = self.leaving[v as usize];
        let mut at = Some(first);
        let mut last = None;
        std::iter::from_fn(move || {
            if let Some(h) = last.take() {
                return Some((self.sheet.origin(h), h));
            }
            let h = at?;
            let back = prev(h);
            let t = self.sheet.twin[back as usize];
            at = (t != NONE && t != first).then_some(t);
            // At the border the last edge has no halfedge that leaves the vertex.
            last = (t == NONE).then_some(back);
            Some((self.target(h), h))
        })
    }

    /// The end of a curve and the border vertices next to it that no other curve uses, each with what it costs to slide there.
    fn landing(&self, v: u32) -> Vec<(u32, f64)> {
        let mut ends = vec![(v, 0.0)];
        for forward in [true, false] {
            let (mut at, mut slid) = (v, 0.0);
            for _ in 0..SLIDE {
                let h = if forward { Some(self.leaving[at as usize]) } else { self.border_before(at) };
                let Some((h, w)) = h.map(|h| (h, if forward { self.target(h) } else { self.sheet.origin(h) })) else { break };
                if self.uses[w as usize] != 1 || ends.iter().any(|e| e.0 == w) {
                    break;
                }
                slid += SLIDE_COST * self.sheet.length[h as usize];
                ends.push((w, slid));
                at = w;
            }
        }
        ends
    }

    /// The border halfedge that leads to a border vertex.
    fn border_before(&self, v: u32) -> Option<u32> {
        self.spokes(v).find(|&(_, h)| self.sheet.twin[h as usize] == NONE && self.target(h) == v).map(|s| s.1)
    }

    /// The shortest path in the band of a curve, as halfedges in no particular direction; the curve itself if there is none.
    fn shorter(&mut self, curve: Vec<u32>, work: &Work<'_>) -> Result<Vec<u32>> {
        let vertices = self.vertices(&curve);
        let (Some(&start), Some(&end)) = (vertices.first(), vertices.last()) else { return Ok(curve) };
        vertices.iter().for_each(|&v| self.uses[v as usize] -= 1);
        let (from, to) = (self.landing(start), self.landing(end));
        let band = self.band_around(&vertices);
        let reached = self.search(&from, &to, work)?;
        let mut path = Vec::new();
        if let Some(mut at) = reached {
            while self.via[at as usize] != NONE {
                let h = self.via[at as usize];
                path.push(h);
                at = if self.sheet.origin(h) == at { self.target(h) } else { self.sheet.origin(h) };
            }
        }
        for v in band.into_iter().chain(from.iter().chain(&to).map(|e| e.0)) {
            (self.distance[v as usize], self.via[v as usize]) = (f64::INFINITY, NONE);
        }
        let path = if path.is_empty() { curve } else { path };
        for &h in &path {
            for v in [self.sheet.origin(h), self.target(h)] {
                self.uses[v as usize] = self.uses[v as usize].max(1) + 1;
            }
        }
        Ok(path)
    }

    /// Marks the free vertices within some rings of a curve.
    fn band_around(&mut self, vertices: &[u32]) -> Vec<u32> {
        self.bands += 1;
        let mut band: Vec<u32> = Vec::new();
        let mut ring = vertices.to_vec();
        for _ in 0..=RINGS {
            let mut next_ring = Vec::new();
            for &v in &ring {
                if self.uses[v as usize] == 0 && std::mem::replace(&mut self.band[v as usize], self.bands) != self.bands {
                    band.push(v);
                }
            }
            for &v in &ring {
                next_ring
                    .extend(self.spokes(v).map(|s| s.0).filter(|&w| self.uses[w as usize] == 0 && self.band[w as usize] != self.bands));
            }
            next_ring.sort_unstable();
            next_ring.dedup();
            ring = next_ring;
        }
        band
    }

    /// Dijkstra from some vertices through the band; the target with the least way and cost.
    fn search(&mut self, from: &[(u32, f64)], to: &[(u32, f64)], work: &Work<'_>) -> Result<Option<u32>> {
        let cost_at = |v: u32| to.iter().find(|e| e.0 == v).map(|e| e.1);
        let mut heap: BinaryHeap<(Reverse<u64>, Reverse<u32>)> = BinaryHeap::new();
        for &(v, cost) in from.iter().filter(|e| cost_at(e.0).is_none()) {
            self.distance[v as usize] = cost;
            heap.push((Reverse(cost.to_bits()), Reverse(v)));
        }
        let (mut popped, mut best) = (0, (f64::INFINITY, None));
        while let Some((Reverse(bits), Reverse(v))) = heap.pop() {
            popped += 1;
            if popped % CHECK_EVERY == 0 {
                work.check()?;
            }
            let here = f64::from_bits(bits);
            if here >= best.0 {
                break;
            }
            if here > self.distance[v as usize] {
                continue;
            }
            if let Some(cost) = cost_at(v) {
                best = if here + cost < best.0 { (here + cost, Some(v)) } else { best };
                continue;
            }
            let spokes: Vec<(u32, u32)> = self.spokes(v).filter(|&(_, h)| self.sheet.twin[h as usize] != NONE).collect();
            for (w, h) in spokes {
                let far = here + self.sheet.length[h as usize];
                let open = self.band[w as usize] == self.bands || cost_at(w).is_some();
                if open && far < self.distance[w as usize] {
                    (self.distance[w as usize], self.via[w as usize]) = (far, h);
                    heap.push((Reverse(far.to_bits()), Reverse(w)));
                }
            }
        }
        Ok(best.1)
    }
}

/// The sides that the edges of some paths make, if they are two; the first is the one that has more of the first side before.
fn sides(sheet: &Sheet, paths: &[Vec<u32>], before: &[bool]) -> Option<Vec<bool>> {
    let mut barrier = vec![false; sheet.twin.len()];
    for &h in paths.iter().flatten() {
        barrier[h as usize] = true;
        if sheet.twin[h as usize] != NONE {
            barrier[sheet.twin[h as usize] as usize] = true;
        }
    }
    let mut side = vec![NONE; before.len()];
    let mut kept = [0.0; 2];
    let mut count = 0;
    let mut stack = Vec::new();
    for seed in 0..before.len() as u32 {
        if side[seed as usize] != NONE {
            continue;
        }
        if count == 2 {
            return None;
        }
        side[seed as usize] = count;
        stack.push(seed);
        while let Some(f) = stack.pop() {
            let sign = if before[f as usize] { -1.0 } else { 1.0 };
            kept[count as usize] += sign * sheet.area[f as usize];
            for h in (3 * f..3 * f + 3).filter(|&h| !barrier[h as usize]) {
                let t = sheet.twin[h as usize];
                if t != NONE && side[t as usize / 3] == NONE {
                    side[t as usize / 3] = count;
                    stack.push(t / 3);
                }
            }
        }
        count += 1;
    }
    let second = u32::from(kept[0] >= kept[1]);
    let marked: Vec<bool> = side.iter().map(|&s| s == second).collect();
    (count == 2 && components(sheet, &marked).len() == 2).then_some(marked)
}
