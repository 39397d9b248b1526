//! Recursive division of a connected set of faces until every part is small enough and of genus 0 with a boundary.

use super::bisect::{Share, bisect};
use super::graph::{Balance, dual_graph};
use super::surface::{Limits, Scratch, Surface, measure};
use crate::error::Result;
use crate::work::Work;

/// Of the room that `max_patch_faces` leaves, the share a division further up may use.
const ROOM: f64 = 0.5;
/// Parts are planned to be this full at most.
const FILL: f64 = 0.92;
/// Least share of its aim that a part must get.
const LEAST_FILL: f64 = 0.6;
/// Least share of the area of the smaller part when a part is divided for its shape.
const SMALLER_PART: f64 = 0.28;

/// Divides sets of faces; owns the labels.
#[derive(Debug)]
pub(super) struct Divider<'a> {
    pub(super) surface: &'a Surface<'a>,
    pub(super) limits: Limits,
    /// Faces a patch is planned to have at most; `limits.faces` or less.
    pub(super) planned_faces: f64,
    pub(super) label: Vec<u32>,
    pub(super) next_label: u32,
    pub(super) scratch: Scratch,
    slot: Vec<u32>,
}

impl<'a> Divider<'a> {
    pub(super) fn new(surface: &'a Surface<'a>, limits: Limits, planned_faces: f64) -> Self {
        let faces = surface.topology.face_count();
        Divider {
            surface,
            limits,
            planned_faces,
            label: vec![u32::MAX; faces],
            next_label: 0,
            scratch: Scratch::new(surface.topology),
            slot: vec![0; faces],
        }
    }

    /// A fresh label on some faces.
    pub(super) fn name(&mut self, faces: &[u32]) -> u32 {
        let p = self.next_label;
        self.next_label += 1;
        for &f in faces {
            self.label[f as usize] = p;
        }
        p
    }

    /// Divides a connected set of faces as far as needed; every part gets a label of its own. Stops only at valid parts.
    pub(super) fn divide(&mut self, faces: Vec<u32>, work: &Work<'_>) -> Result<()> {
        let parts = self.parts_for(faces.len(), FILL);
        let mut stack = vec![(faces, parts)];
        while let Some((part, parts)) = stack.pop() {
            work.check()?;
            let p = self.name(&part);
            let parts = parts.max(self.parts_for(part.len(), 1.0)).min(part.len() as f64);
            if parts < 1.5 && measure(self.surface, &self.label, &part, p, &mut self.scratch).is_valid(&self.limits) {
                continue;
            }
            let (a, b) = self.halve(&part, parts, work)?;
            let first = first_parts(parts);
            stack.push((b, (parts - first).max(1.0)));
            stack.push((a, first));
        }
        Ok(())
    }

    /// Parts that so many faces need, each filled to at most `fill` of the plan. A set that fits as it is needs one.
    fn parts_for(&self, faces: usize, fill: f64) -> f64 {
        if faces as f64 <= self.planned_faces { 1.0 } else { (faces as f64 / (fill * self.planned_faces)).ceil() }
    }

    /// Cuts a connected set of at least two faces in two connected sets, aiming at `parts` parts of equal size in the end.
    pub(super) fn halve(&mut self, faces: &[u32], parts: f64, work: &Work<'_>) -> Result<(Vec<u32>, Vec<u32>)> {
        let by_count = parts > 1.5;
        let graph = dual_graph(self.surface, faces, if by_count { Balance::Faces } else { Balance::Area }, &mut self.slot);
        let total = graph.total();
        let share = if by_count { self.counted_share(total as f64, parts) } else { shape_share(total) };
        let mut side = bisect(graph, share, work)?;
        self.connect(faces, &mut side);
        Ok(split_by(faces, &side))
    }

    /// Cuts a connected set of at least two faces in two connected sets by sides that may be scattered: of each side all but the largest
    /// piece changes sides.
    pub(super) fn halve_by(&mut self, faces: &[u32], mut side: Vec<bool>) -> (Vec<u32>, Vec<u32>) {
        for (i, &f) in faces.iter().enumerate() {
            self.slot[f as usize] = i as u32;
        }
        self.connect(faces, &mut side);
        split_by(faces, &side)
    }

    fn counted_share(&self, total: f64, parts: f64) -> Share {
        let first = first_parts(parts);
        let second = parts - first;
        let aim = total * first / parts;
        let room = if parts < 2.5 { 1.0 } else { ROOM };
        let above = |k: f64, aim: f64| aim + room * (k * self.planned_faces - aim).max(0.0);
        // Room is for shorter cuts, not for shaving off a few faces.
        let high = above(first, aim).min(total - LEAST_FILL * (total - aim)).max(1.0);
        let low = (total - above(second, total - aim)).max(LEAST_FILL * aim).min(high);
        Share { low: low as u64, aim: aim as u64, high: high.ceil() as u64 }
    }

    /// Makes both sides connected: all but the largest component of each side change sides.
    fn connect(&mut self, faces: &[u32], side: &mut [bool]) {
        for turn in [false, true, false] {
            let component = self.components(faces, side);
            let Some(largest) = largest_of(&component, side, turn) else {
                // All on one side: the first face alone makes the other.
                self.part_one(faces, side, turn);
                continue;
            };
            for i in 0..side.len() {
                if side[i] == turn && component[i] != largest {
                    side[i] = !turn;
                }
            }
        }
    }

    /// Puts a single face on side `turn`, one whose loss leaves the rest connected.
    fn part_one(&self, faces: &[u32], side: &mut [bool], turn: bool) {
        // The last face that a breadth-first search reaches separates nothing.
        let mut reached = vec![false; faces.len()];
        let mut queue = vec![0u32];
        reached[0] = true;
        let mut head = 0;
        while head < queue.len() {
            let i = queue[head];
            head += 1;
            for j in self.neighbours(faces, i) {
                if !std::mem::replace(&mut reached[j as usize], true) {
                    queue.push(j);
                }
            }
        }
        if let Some(&last) = queue.last() {
            side[last as usize] = turn;
        }
    }

    /// Positions in `faces` of the neighbours of `faces[i]` (`slot` must hold them: after [`dual_graph`]).
    fn neighbours(&self, faces: &[u32], i: u32) -> impl Iterator<Item = u32> {
        let f = faces[i as usize];
        (3 * f..3 * f + 3).filter_map(|h| self.surface.crossing(h)).filter_map(|g| {
            let j = self.slot[g as usize];
            (faces.get(j as usize) == Some(&g)).then_some(j)
        })
    }

    fn components(&self, faces: &[u32], side: &[bool]) -> Vec<u32> {
        let mut component = vec![u32::MAX; faces.len()];
        let mut stack = Vec::new();
        let mut count = 0;
        for seed in 0..faces.len() as u32 {
            if component[seed as usize] != u32::MAX {
                continue;
            }
            component[seed as usize] = count;
            stack.push(seed);
            while let Some(i) = stack.pop() {
                for j in self.neighbours(faces, i) {
                    if side[j as usize] == side[i as usize] && component[j as usize] == u32::MAX {
                        component[j as usize] = count;
                        stack.push(j);
                    }
                }
            }
            count += 1;
        }
        component
    }
}

/// Of `parts` parts, those on the first side.
fn first_parts(parts: f64) -> f64 {
    (parts / 2.0).floor().max(1.0)
}

fn shape_share(total: u64) -> Share {
    let low = ((total as f64 * SMALLER_PART) as u64).max(1);
    Share { low, aim: total / 2, high: total.saturating_sub(low).max(low) }
}

/// Component with most faces on a side; the lower numbered of equals.
fn largest_of(component: &[u32], side: &[bool], turn: bool) -> Option<u32> {
    let count = component.iter().max().map_or(0, |&c| c as usize + 1);
    let mut size = vec![0u32; count];
    for (i, &c) in component.iter().enumerate() {
        size[c as usize] += u32::from(side[i] == turn);
    }
    let (largest, &most) = size.iter().enumerate().max_by_key(|&(i, &n)| (n, std::cmp::Reverse(i)))?;
    (most > 0).then_some(largest as u32)
}

fn split_by(faces: &[u32], side: &[bool]) -> (Vec<u32>, Vec<u32>) {
    let pick = |wanted: bool| faces.iter().zip(side).filter(|(_, s)| **s == wanted).map(|(f, _)| *f).collect();
    (pick(false), pick(true))
}
