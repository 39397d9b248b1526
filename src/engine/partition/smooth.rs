//! Border smoothing: faces change patches one at a time where that straightens a border and changes no patch's topology.

use super::surface::{Limits, Surface};
use crate::error::Result;
use crate::work::Work;

/// Sweeps of the neighbourhood vote at most.
const SWEEPS: usize = 12;
/// A face changes only if the winner has this many times the area of its own patch around it (no endless swaps).
const MARGIN: f64 = 1.02;

/// Smooths all borders between patches that are not features: first every face goes with the majority of its neighbourhood
/// (a discrete curvature flow), then ears that lengthen a border are removed. Patches stay connected and keep their topology,
/// no patch comes to touch itself in a vertex, none grows over `limits.faces`. O(border) after one pass over the faces.
pub(super) fn smooth_borders(surface: &Surface<'_>, label: &mut [u32], limits: Limits, work: &Work<'_>) -> Result<()> {
    let count = label.iter().max().map_or(0, |&p| p as usize + 1);
    let mut size = vec![0u32; count];
    for &p in label.iter() {
        size[p as usize] += 1;
    }
    let held = vertices_on_features(surface);
    let least = size.iter().map(|n| n.div_ceil(2)).collect();
    let mut mover = Mover { surface, label, size, least, held, most: limits.faces, around: Vec::new() };
    let mut front: Vec<u32> = (0..surface.area.len() as u32).filter(|&f| mover.is_on_border(f)).collect();
    work.check()?;
    let mut queued = vec![0u32; surface.area.len()];
    for sweep in 1..=SWEEPS as u32 {
        let mut next = Vec::new();
        for &f in &front {
            if mover.vote(f).is_some_and(|q| mover.try_move(f, q)) {
                for g in mover.vertex_neighbours(f) {
                    if std::mem::replace(&mut queued[g as usize], sweep) != sweep {
                        next.push(g);
                    }
                }
            }
        }
        work.check()?;
        next.sort_unstable();
        front = next;
        if front.is_empty() {
            break;
        }
    }
    // Every move shortens the borders, so this ends.
    let mut stack: Vec<u32> = (0..surface.area.len() as u32).rev().filter(|&f| mover.is_on_border(f)).collect();
    while let Some(f) = stack.pop() {
        if mover.ear(f).is_some_and(|q| mover.try_move(f, q)) {
            stack.extend(mover.vertex_neighbours(f));
        }
    }
    work.check()
}

fn vertices_on_features(surface: &Surface<'_>) -> Vec<bool> {
    let mut held = vec![false; surface.topology.vertex_count()];
    for (h, &feature) in surface.features.is_feature.iter().enumerate() {
        if feature {
            held[surface.topology.origin(h as u32) as usize] = true;
        }
    }
    held
}

struct Mover<'a> {
    surface: &'a Surface<'a>,
    label: &'a mut [u32],
    size: Vec<u32>,
    /// No patch loses more than half of its faces: small discs would shrink away.
    least: Vec<u32>,
    /// Vertices on features: faces there stay, so that features never come to divide a patch.
    held: Vec<bool>,
    most: u32,
    around: Vec<(u32, f64)>,
}

impl Mover<'_> {
    fn faces_at(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.surface.topology.outgoing(v).map(|h| h / 3)
    }

    fn corners(&self, f: u32) -> [u32; 3] {
        self.surface.mesh.triangles[f as usize]
    }

    /// Faces that share a vertex with `f`; some twice.
    fn vertex_neighbours(&self, f: u32) -> Vec<u32> {
        self.corners(f).into_iter().flat_map(|v| self.faces_at(v)).filter(|&g| g != f).collect()
    }

    fn is_on_border(&self, f: u32) -> bool {
        (3 * f..3 * f + 3).any(|h| self.surface.crossing(h).is_some_and(|g| self.label[g as usize] != self.label[f as usize]))
    }

    /// The patch with most area around the vertices of `f`, if it is another one and beats the patch of `f`.
    fn vote(&mut self, f: u32) -> Option<u32> {
        let own = self.label[f as usize];
        self.around.clear();
        for v in self.corners(f) {
            for h in self.surface.topology.outgoing(v) {
                let g = h / 3;
                let (p, area) = (self.label[g as usize], self.surface.area[g as usize]);
                match self.around.iter_mut().find(|(q, _)| *q == p) {
                    Some(entry) => entry.1 += area,
                    None => self.around.push((p, area)),
                }
            }
        }
        let mine = self.around.iter().find(|(q, _)| *q == own).map_or(0.0, |e| e.1);
        // The face itself has counted for its own patch three times; let it count for neither.
        let mine = mine - 3.0 * self.surface.area[f as usize];
        let best = self.around.iter().filter(|(q, _)| *q != own).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        (best.1 > MARGIN * mine).then_some(best.0)
    }

    /// The patch to which `f` should go to shorten the border.
    fn ear(&self, f: u32) -> Option<u32> {
        let own = self.label[f as usize];
        let shared = |p: u32| -> f64 {
            (3 * f..3 * f + 3)
                .filter(|&h| self.surface.crossing(h).is_some_and(|g| self.label[g as usize] == p))
                .map(|h| self.surface.length[h as usize])
                .sum()
        };
        let keep = shared(own) * (1.0 + 1e-9);
        (3 * f..3 * f + 3).filter_map(|h| self.surface.crossing(h)).map(|g| self.label[g as usize]).find(|&q| q != own && shared(q) > keep)
    }

    fn try_move(&mut self, f: u32, to: u32) -> bool {
        let from = self.label[f as usize];
        let free = self.corners(f).iter().all(|&v| !self.held[v as usize]);
        let room = self.size[to as usize] < self.most && self.size[from as usize] > self.least[from as usize];
        let allowed = free && room && self.can_leave(f, from) && self.can_enter(f, to);
        if allowed {
            self.label[f as usize] = to;
            self.size[from as usize] -= 1;
            self.size[to as usize] += 1;
        }
        allowed
    }

    fn has(&self, h: u32, p: u32) -> bool {
        !self.surface.on_border(self.label, h, p)
    }

    /// Whether patch `p` of `f` keeps its topology without it: `f` touches the border in one edge and not in the vertex opposite,
    /// or in two edges.
    fn can_leave(&self, f: u32, p: u32) -> bool {
        let mut outer = (3 * f..3 * f + 3).filter(|&h| !self.has(h, p));
        match (outer.next(), outer.next(), outer.next()) {
            (Some(h), None, None) => self.encloses(p, self.opposite(h), f),
            (Some(_), Some(_), None) => true,
            _ => false,
        }
    }

    /// Whether patch `p` keeps its topology with `f`: `f` shares one edge and the vertex opposite is not of the patch, or two edges
    /// and the patch closes around the vertex between them.
    fn can_enter(&self, f: u32, p: u32) -> bool {
        let mut shared = (3 * f..3 * f + 3).filter(|&h| self.has(h, p));
        match (shared.next(), shared.next(), shared.next()) {
            (Some(h), None, None) => self.faces_at(self.opposite(h)).all(|g| self.label[g as usize] != p),
            (Some(h), Some(k), None) => {
                let topology = self.surface.topology;
                let between = if topology.next(h) == k { topology.origin(k) } else { topology.origin(h) };
                self.encloses(p, between, f)
            }
            _ => false,
        }
    }

    fn opposite(&self, h: u32) -> u32 {
        self.surface.topology.origin(self.surface.topology.prev(h))
    }

    /// Whether all faces around an inner vertex, `f` aside, are of patch `p`.
    fn encloses(&self, p: u32, v: u32, f: u32) -> bool {
        !self.surface.topology.is_boundary_vertex(v) && self.faces_at(v).all(|g| g == f || self.label[g as usize] == p)
    }
}
