//! How much a flat map of a patch has to shrink: along a tube of circumference c the scale falls by 2 pi / c a unit of length, so long
//! uncut tubes make useless charts however the rest of the patch looks (P2 section 2, eq. 4). Estimated without a map, from the wave
//! that runs inwards from the longest border loop. Used only to choose between partitions: it sees no chart that overlaps itself.

use super::homology::DisjointSets;
use super::nearest::Nearest;
use super::surface::{Scratch, Surface, measure};
use super::{Partition, faces_by_patch};
use crate::error::Result;
use crate::work::Work;
use std::f64::consts::TAU;

/// Logarithm of the largest ratio of scales that a chart may have.
const MOST: f64 = 6.9;
/// Patches of more than this eta (that of a hemisphere) often need several charts.
const ROUND: f64 = 0.5;
/// Width of the wave's bands in mean edge lengths.
const BAND: f64 = 3.0;

/// Paths over the middles of faces and edges are about this much longer than straight ones.
const DETOUR: f64 = 1.2;

/// How many charts a partition is expected to need: one for each patch, and more for those that would shrink too much or bulge over a
/// short border. A sum of fractions, to compare partitions by. O(F log F).
///
/// # Errors
/// Only those of `work`.
pub(super) fn expected_charts(surface: &Surface<'_>, partition: &Partition, work: &Work<'_>) -> Result<f64> {
    let label = &partition.face_patch;
    let mut scratch = Scratch::new(surface.topology);
    let mut state = Wave { surface, label, slot: vec![0; label.len()] };
    let mut charts = 0.0;
    for (p, faces) in faces_by_patch(label).iter().enumerate() {
        work.check()?;
        let border = measure(surface, label, faces, p as u32, &mut scratch).border;
        let first = longest_loop(surface, label, &border, p as u32);
        let bulge = partition.patches.get(p).map_or(0.0, |summary| summary.aspect_ratio / ROUND);
        charts += (state.depth(faces, &first, p as u32, work)? / MOST).max(bulge).max(1.0);
    }
    Ok(charts)
}

/// Border halfedges of the longest loop.
fn longest_loop(surface: &Surface<'_>, label: &[u32], border: &[u32], p: u32) -> Vec<u32> {
    let inside = |f: u32| label[f as usize] == p;
    let mut sorted = border.to_vec();
    sorted.sort_unstable();
    let mut seen = vec![false; sorted.len()];
    let mut best = (-1.0, Vec::new());
    for i in 0..sorted.len() {
        let (mut at, mut ring, mut length) = (sorted[i], Vec::new(), 0.0);
        while let Ok(k) = sorted.binary_search(&at)
            && !std::mem::replace(&mut seen[k], true)
        {
            ring.push(at);
            length += surface.length[at as usize];
            at = surface.next_on_border(at, inside);
        }
        if length > best.0 && !ring.is_empty() {
            best = (length, ring);
        }
    }
    best.1
}

struct Wave<'a> {
    surface: &'a Surface<'a>,
    label: &'a [u32],
    slot: Vec<u32>,
}

/// A connected piece of a band.
#[derive(Clone, Copy)]
struct Front {
    area: f64,
    /// Whether it touches a border: then it is no ring around a tube, and a map can give way.
    open: bool,
    /// Logarithm of the scale there, from 0 at the start downwards.
    scale: f64,
}

impl Wave<'_> {
    fn inside(&self, h: u32, p: u32) -> Option<u32> {
        self.surface.topology.twin(h).map(|t| t / 3).filter(|&g| self.label[g as usize] == p)
    }

    /// Estimated logarithm of the ratio of the largest to the smallest scale of a map of patch `p`. O(faces log faces).
    fn depth(&mut self, faces: &[u32], first: &[u32], p: u32, work: &Work<'_>) -> Result<f64> {
        let surface = self.surface;
        faces.iter().enumerate().for_each(|(i, &f)| self.slot[f as usize] = i as u32);
        let edges = 3.0 * faces.len() as f64;
        let length: f64 = faces.iter().flat_map(|&f| 3 * f..3 * f + 3).map(|h| surface.length[h as usize]).sum();
        let width = BAND * length / edges.max(1.0);
        if width <= 0.0 || !width.is_finite() {
            return Ok(0.0);
        }
        let distance = self.distances(faces, first, p, work)?;
        let band = |i: usize| (distance[i] / width).min(f64::from(u32::MAX)) as u32;
        let mut sets = DisjointSets::new(faces.len());
        for (i, &f) in faces.iter().enumerate() {
            for g in (3 * f..3 * f + 3).filter_map(|h| self.inside(h, p)) {
                let j = self.slot[g as usize] as usize;
                if band(i) == band(j) {
                    sets.join(i as u32, j as u32);
                }
            }
        }
        let mut front = vec![Front { area: 0.0, open: false, scale: 0.0 }; faces.len()];
        for (i, &f) in faces.iter().enumerate() {
            let entry = &mut front[sets.find(i as u32) as usize];
            entry.area += surface.area[f as usize];
            entry.open |= band(i) > 0 && (3 * f..3 * f + 3).any(|h| self.inside(h, p).is_none());
        }
        // Pairs (later front, earlier front), in the order of the wave.
        let mut steps: Vec<(u32, u32, u32)> = Vec::new();
        for (i, &f) in faces.iter().enumerate() {
            for g in (3 * f..3 * f + 3).filter_map(|h| self.inside(h, p)) {
                let j = self.slot[g as usize] as usize;
                if band(j) < band(i) {
                    steps.push((band(i), sets.find(i as u32), sets.find(j as u32)));
                }
            }
        }
        steps.sort_unstable();
        steps.dedup();
        let mut children = vec![0.0; faces.len()];
        for &(_, to, from) in &steps {
            children[from as usize] += front[to as usize].area;
        }
        let (mut low, mut high) = (0.0f64, 0.0f64);
        for run in steps.chunk_by(|a, b| a.1 == b.1) {
            let to = run[0].1 as usize;
            let Some(from) = run.iter().map(|s| s.2 as usize).max_by(|&a, &b| front[a].scale.total_cmp(&front[b].scale)) else { continue };
            let mut scale = front[from].scale;
            if !front[to].open && run.len() == 1 {
                let across = width / DETOUR;
                let around = (front[to].area / across).max(1e-9 * across);
                // Nothing is lost where the surface itself narrows as a flat one would.
                let narrowing = (children[from] / front[from].area.max(1e-300)).max(1e-9).ln().clamp(-1.0, 1.0);
                scale -= (TAU * across / around).min(2.0) + if front[from].open { 0.0 } else { narrowing };
            }
            front[to].scale = scale;
            (low, high) = (low.min(scale), high.max(scale));
        }
        Ok(high - low)
    }

    /// Distances of the faces of a patch from a loop, over the middles of edges.
    fn distances(&self, faces: &[u32], first: &[u32], p: u32, work: &Work<'_>) -> Result<Vec<f64>> {
        let mut nearest = Nearest::new(faces.len());
        first.iter().for_each(|&h| nearest.source(self.slot[h as usize / 3]));
        let centre = |f: u32| {
            let [a, b, c] = self.surface.mesh.corners(f as usize);
            [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
        };
        while let Some(i) = nearest.take(work)? {
            let f = faces[i as usize];
            for g in (3 * f..3 * f + 3).filter_map(|h| self.inside(h, p)) {
                nearest.reach(i, self.slot[g as usize], crate::vector::distance(centre(f), centre(g)));
            }
        }
        Ok(nearest.distance)
    }
}
