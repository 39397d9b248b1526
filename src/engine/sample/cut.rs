//! Opens vessels: removes what lies beyond a plane across an end, leaving a boundary loop.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::vector::{Vec3, add_scaled, area_vector_twice, distance, dot, kappa, lerp, norm, sub};
use crate::work::Work;

/// Vertices this close to a plane, in spacings, are moved onto it where no face turns over.
const SNAP: f64 = 0.12;
/// Closest a cut comes to an end of its edge.
const MARGIN: f64 = 0.06;

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
    /// Height above the plane nearby; zero on it.
    height: Vec<f64>,
    cuts: BTreeMap<(u32, u32), u32>,
}

/// Removes the parts above the planes. The rims lie in their planes to within 6 % of an edge; no face comes out degenerate, and as
/// every new face is part of an old one, no intersection can arise.
///
/// # Errors
/// Only those of `work`.
pub(super) fn cut(
    positions: &mut Vec<Vec3>,
    triangles: &[[u32; 3]],
    openings: &[Opening],
    spacing: f64,
    work: &Work<'_>,
) -> Result<Vec<[u32; 3]>> {
    work.check()?;
    let mut height: Vec<f64> = Vec::with_capacity(positions.len());
    let mut nearest: Vec<(u32, usize)> = Vec::new();
    for (v, &p) in positions.iter().enumerate() {
        let (best, which) =
            openings.iter().enumerate().map(|(k, o)| (o.height(p), k)).fold((f64::NEG_INFINITY, 0), |a, b| if b.0 > a.0 { b } else { a });
        height.push(best);
        if best.abs() < SNAP * spacing {
            nearest.push((v as u32, which));
        }
    }
    work.check()?;
    snap(positions, triangles, &mut height, &nearest, openings, SNAP * spacing);
    work.check()?;
    let mut cutter = Cutter { positions, height, cuts: BTreeMap::new() };
    let mut kept = Vec::with_capacity(triangles.len());
    for &t in triangles {
        cutter.triangle(t, &mut kept);
    }
    compact(positions, &mut kept);
    Ok(kept)
}

/// Moves vertices onto the planes they almost lie on, unless a face around would turn by much or get thin.
fn snap(positions: &mut [Vec3], triangles: &[[u32; 3]], height: &mut [f64], nearest: &[(u32, usize)], openings: &[Opening], limit: f64) {
    let mut around: BTreeMap<u32, Vec<[u32; 3]>> = nearest.iter().map(|n| (n.0, Vec::new())).collect();
    for &t in triangles {
        for v in t {
            if height[v as usize].abs() < limit
                && let Some(faces) = around.get_mut(&v)
            {
                faces.push(t);
            }
        }
    }
    for &(v, which) in nearest {
        let old = positions[v as usize];
        let new = add_scaled(old, openings[which].outward, -height[v as usize]);
        let moved = |w: u32| if w == v { new } else { positions[w as usize] };
        let safe = around[&v].iter().all(|t| {
            let [a, b, c] = t.map(|w| positions[w as usize]);
            let [p, q, r] = t.map(moved);
            let (before, after) = (area_vector_twice(a, b, c), area_vector_twice(p, q, r));
            let (was, is) = (norm(before), norm(after));
            dot(before, after) > 0.8 * was * is && kappa(p, q, r) > 0.7 * kappa(a, b, c).min(0.1)
        });
        if safe {
            positions[v as usize] = new;
            height[v as usize] = 0.0;
        }
    }
}

impl Cutter<'_> {
    /// Keeps the part of a face that is not above, as a fan over at most four corners.
    fn triangle(&mut self, t: [u32; 3], kept: &mut Vec<[u32; 3]>) {
        let h = t.map(|v| self.height[v as usize]);
        if h.iter().all(|h| *h <= 0.0) {
            if h.iter().any(|h| *h < 0.0) {
                kept.push(t);
            }
            return;
        }
        if h.iter().all(|h| *h >= 0.0) {
            return;
        }
        let mut corners = Vec::with_capacity(4);
        for k in 0..3 {
            let l = (k + 1) % 3;
            if h[k] <= 0.0 {
                corners.push(t[k]);
            }
            if h[k] * h[l] < 0.0 {
                corners.push(if h[k] > 0.0 { self.point(t[k], t[l]) } else { self.point(t[l], t[k]) });
            }
        }
        for k in 1..corners.len() - 1 {
            kept.push([corners[0], corners[k], corners[k + 1]]);
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
    for (next, slot) in number.iter_mut().filter(|slot| **slot == 0).enumerate() {
        *slot = next as u32;
    }
    let mut at = 0;
    positions.retain(|_| {
        at += 1;
        number[at - 1] != u32::MAX
    });
    triangles.as_flattened_mut().iter_mut().for_each(|v| *v = number[*v as usize]);
}
