//! Opens vessels: removes what lies beyond a plane across an end, leaving a boundary loop.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::vector::{Vec3, distance, dot, lerp, sub};
use crate::work::Work;

/// Closest a cut comes to an end of its edge.
const MARGIN: f64 = 0.03;

/// A plane across one end of a vessel; it acts within `reach` of its centre only.
#[derive(Debug, Clone)]
pub(super) struct Opening {
    pub(super) centre: Vec3,
    /// Unit direction out of the body.
    pub(super) outward: Vec3,
    pub(super) reach: f64,
}

impl Opening {
    /// Height above the plane; negative, i.e. kept, outside the reach.
    fn height(&self, p: Vec3) -> f64 {
        if distance(p, self.centre) < self.reach { dot(sub(p, self.centre), self.outward) } else { -self.reach }
    }
}

struct Cutter<'a> {
    positions: &'a mut Vec<Vec3>,
    height: Vec<f64>,
    cuts: BTreeMap<(u32, u32), u32>,
}

/// Removes the parts above the planes. Cuts lie in their plane to within 3 % of an edge: no face comes out degenerate, and as
/// every new face is part of an old one, no intersection can arise.
///
/// # Errors
/// Only those of `work`.
pub(super) fn cut(positions: &mut Vec<Vec3>, triangles: &[[u32; 3]], openings: &[Opening], work: &Work<'_>) -> Result<Vec<[u32; 3]>> {
    work.check()?;
    let height = positions.iter().map(|&p| openings.iter().map(|o| o.height(p)).fold(f64::NEG_INFINITY, f64::max)).collect();
    work.check()?;
    let mut cutter = Cutter { positions, height, cuts: BTreeMap::new() };
    let mut kept = Vec::with_capacity(triangles.len());
    for &t in triangles {
        cutter.triangle(t, &mut kept);
    }
    compact(positions, &mut kept);
    Ok(kept)
}

impl Cutter<'_> {
    fn triangle(&mut self, t: [u32; 3], kept: &mut Vec<[u32; 3]>) {
        let above = t.map(|v| self.height[v as usize] > 0.0);
        match above.iter().filter(|x| **x).count() {
            0 => kept.push(t),
            1 => {
                let k = (0..3).find(|&k| above[k]).unwrap_or(0);
                let [top, a, b] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
                let (p, q) = (self.point(top, a), self.point(top, b));
                kept.extend([[p, a, b], [p, b, q]]);
            }
            2 => {
                let k = (0..3).find(|&k| !above[k]).unwrap_or(0);
                let [low, a, b] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
                kept.push([low, self.point(a, low), self.point(b, low)]);
            }
            _ => {}
        }
    }

    fn point(&mut self, above: u32, below: u32) -> u32 {
        let (high, low) = (self.height[above as usize], self.height[below as usize]);
        let (from, to) = (self.positions[below as usize], self.positions[above as usize]);
        *self.cuts.entry((below, above)).or_insert_with(|| {
            let t = (low / (low - high)).clamp(MARGIN, 1.0 - MARGIN);
            self.positions.push(lerp(from, to, t));
            self.positions.len() as u32 - 1
        })
    }
}

/// Drops vertices no face uses, keeping the order.
fn compact(positions: &mut Vec<Vec3>, triangles: &mut [[u32; 3]]) {
    let mut number = vec![u32::MAX; positions.len()];
    for &v in triangles.as_flattened() {
        number[v as usize] = 0;
    }
    let mut next = 0;
    for slot in number.iter_mut().filter(|slot| **slot == 0) {
        *slot = next;
        next += 1;
    }
    let mut at = 0;
    positions.retain(|_| {
        at += 1;
        number[at - 1] != u32::MAX
    });
    triangles.as_flattened_mut().iter_mut().for_each(|v| *v = number[*v as usize]);
}
