//! Ears: virtual triangles over the reflex corners of the outer loop.
//!
//! A free boundary has nothing that keeps the sides of a deep notch from crossing in the plane (P1 figure 12). A triangle over
//! the notch does: its conformal energy grows without bound as it is folded. Corners are clipped from the most reflex on, as if
//! the outside were triangulated, until the loop is nearly convex in its own surface.

use super::domain::Domain;
use crate::vector::{angle_between, distance, sub};
use std::collections::BinaryHeap;
use std::f64::consts::PI;

/// Ears have an edge no longer than this part of the loop: they bridge notches; they must not close the end of a tube.
const MAX_BRIDGE: f64 = 0.15;

/// Corners with a larger angle inside the patch get an ear.
const REFLEX: f64 = 1.1 * PI;

/// Adds ears to a domain and takes the vertices behind them out of its outer loop. O(m log m) for m edges, and O(faces).
pub(super) fn clip(domain: &mut Domain<'_>) {
    let count = domain.outer.len();
    let mut ring = Ring {
        next: (0..count).map(|k| (k + 1) % count).collect(),
        prev: (0..count).map(|k| (k + count - 1) % count).collect(),
        angle: angles_inside(domain),
        gone: vec![false; count],
    };
    let mut left = count;
    let bridge = MAX_BRIDGE * domain.outer_lengths().iter().sum::<f64>();
    // Angles are not negative, so their bits are ordered like them.
    let mut heap: BinaryHeap<(u64, usize)> = (0..count).map(|k| (ring.angle[k].to_bits(), k)).collect();
    while let Some((key, k)) = heap.pop() {
        if f64::from_bits(key) <= REFLEX || left <= 4 {
            break;
        }
        if ring.gone[k] || key != ring.angle[k].to_bits() {
            continue;
        }
        let (p, n) = (ring.prev[k], ring.next[k]);
        let [at, before, after] = [k, p, n].map(|k| domain.positions[domain.outer[k] as usize]);
        if distance(before, after) > bridge {
            continue;
        }
        domain.virtual_triangles.push([k, p, n].map(|k| domain.outer[k]));
        ring.gone[k] = true;
        left -= 1;
        (ring.next[p], ring.prev[n]) = (n, p);
        ring.angle[p] += angle_between(sub(at, before), sub(after, before));
        ring.angle[n] += angle_between(sub(before, after), sub(at, after));
        heap.extend([p, n].map(|k| (ring.angle[k].to_bits(), k)));
    }
    let kept = (0..count).filter(|&k| !ring.gone[k]).map(|k| domain.outer[k]).collect();
    domain.outer = kept;
}

struct Ring {
    next: Vec<usize>,
    prev: Vec<usize>,
    angle: Vec<f64>,
    gone: Vec<bool>,
}

/// Sum of the angles of the faces at each vertex of the outer loop.
fn angles_inside(domain: &Domain<'_>) -> Vec<f64> {
    let mut sums = vec![0.0; domain.size()];
    for t in &domain.patch.triangles {
        let p = t.map(|v| domain.positions[v as usize]);
        for k in 0..3 {
            sums[t[k] as usize] += angle_between(sub(p[(k + 1) % 3], p[k]), sub(p[(k + 2) % 3], p[k]));
        }
    }
    domain.outer.iter().map(|&v| sums[v as usize]).collect()
}
