//! Partition by two-way cuts of parts of genus 0 with a border (P2 section 4): the topology first, then the shape.

use super::divide::Divider;
use super::laplace::sheet::Sheet;
use super::merge::{Goal, merge_patches};
use super::smooth::smooth_borders;
use super::straighten::straighten_borders;
use super::surface::{Limits, Surface, measure};
use super::two_way::{TwoWayCut, Verdict};
use super::{BorderSmoothing, Partition, PartitionSpec, face_groups, faces_by_patch, finish, renumber};
use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A method that cuts a sheet of genus 0 with a border in two.
pub(super) type Way = fn(&Sheet, &Work<'_>) -> Result<TwoWayCut>;

/// What a part must have to be mapped to a disk.
const MAPPABLE: Limits = Limits { faces: u32::MAX, loops: u32::MAX, aspect_ratio: f64::INFINITY };

/// Cuts the surface into parts of genus 0 with a border, then each of those until it keeps the limits, then the largest until the
/// wanted number is reached. Nothing is merged that a two-way cut has cut.
pub(super) fn partition(surface: &Surface<'_>, spec: &PartitionSpec, way: Way, work: &Work<'_>) -> Result<Partition> {
    let limits = Limits::new(spec);
    let parts = mappable_parts(surface, work)?;
    let faces = surface.topology.face_count();
    let mut cutter = Cutter { divider: Divider::new(surface, limits, f64::from(limits.faces)), slot: vec![0; faces], way };
    let (mut valid, mut done) = (Vec::new(), 0);
    for part in parts {
        done += part.len();
        valid.extend(cutter.divide(part, work)?);
        work.step(done, 2 * faces)?;
    }
    if let Some(wanted) = spec.patches {
        valid = cutter.refine(valid, wanted as usize, work)?;
    }
    for part in &valid {
        cutter.divider.name(part);
    }
    let mut label = cutter.divider.label;
    renumber(&mut label);
    if spec.borders != BorderSmoothing::Vote {
        straighten_borders(surface, &mut label, limits, work)?;
    }
    finish(surface, label, limits, work)
}

/// The connected sets of faces, those with handles or without a border cut by the multilevel method.
fn mappable_parts(surface: &Surface<'_>, work: &Work<'_>) -> Result<Vec<Vec<u32>>> {
    let mut divider = Divider::new(surface, MAPPABLE, f64::from(u32::MAX));
    let groups = face_groups(surface);
    let count = groups.len() as u32;
    for group in groups {
        divider.divide(group, work)?;
    }
    let (mut label, mut scratch) = (divider.label, divider.scratch);
    if divider.next_label > count {
        let goal = Goal { patches: None, planned_faces: u32::MAX, limits: MAPPABLE };
        renumber(&mut label);
        for _ in 0..2 {
            smooth_borders(surface, &mut label, MAPPABLE, work)?;
            merge_patches(surface, &mut label, &goal, &mut scratch, work)?;
            renumber(&mut label);
        }
        smooth_borders(surface, &mut label, MAPPABLE, work)?;
    }
    renumber(&mut label);
    Ok(faces_by_patch(&label))
}

struct Cutter<'a> {
    divider: Divider<'a>,
    slot: Vec<u32>,
    way: Way,
}

impl Cutter<'_> {
    /// Cuts a part until every piece keeps the limits.
    fn divide(&mut self, part: Vec<u32>, work: &Work<'_>) -> Result<Vec<Vec<u32>>> {
        let (mut stack, mut valid) = (vec![part], Vec::new());
        while let Some(part) = stack.pop() {
            work.check()?;
            let divider = &mut self.divider;
            let p = divider.name(&part);
            if measure(divider.surface, &divider.label, &part, p, &mut divider.scratch).is_valid(&divider.limits) {
                valid.push(part);
            } else {
                let [first, second] = self.cut(part, work)?;
                stack.push(second);
                stack.push(first);
            }
        }
        Ok(valid)
    }

    fn cut(&mut self, part: Vec<u32>, work: &Work<'_>) -> Result<[Vec<u32>; 2]> {
        let sheet = Sheet::new(self.divider.surface, part, &mut self.slot);
        let cut = (self.way)(&sheet, work)?;
        if let Verdict::Unusable(reason) = &cut.verdict {
            return Err(cut.refusal(self.divider.surface.mesh, &sheet, reason));
        }
        Ok([false, true].map(|side| sheet.faces.iter().zip(&cut.second).filter(|(_, s)| **s == side).map(|(f, _)| *f).collect()))
    }

    /// Cuts the part of largest area until there are as many as wanted or only single faces.
    fn refine(&mut self, parts: Vec<Vec<u32>>, wanted: usize, work: &Work<'_>) -> Result<Vec<Vec<u32>>> {
        // Bits of a positive number order as the number does.
        let area = |part: &[u32], this: &Self| part.iter().map(|&f| this.divider.surface.area[f as usize]).sum::<f64>().to_bits();
        let mut heap: BinaryHeap<(u64, Reverse<usize>)> = parts.iter().enumerate().map(|(i, p)| (area(p, self), Reverse(i))).collect();
        let mut parts = parts;
        while parts.len() < wanted {
            let Some((_, Reverse(i))) = heap.pop() else { break };
            if parts[i].len() < 2 {
                continue;
            }
            let pieces = self.cut(std::mem::take(&mut parts[i]), work)?;
            let mut both = Vec::new();
            for piece in pieces {
                both.extend(self.divide(piece, work)?);
            }
            for (k, piece) in both.into_iter().enumerate() {
                let slot = if k == 0 { i } else { parts.len() };
                heap.push((area(&piece, self), Reverse(slot)));
                if k == 0 { parts[i] = piece } else { parts.push(piece) }
            }
        }
        Ok(parts)
    }
}
