//! Rays through the tree.

use super::{Node, TriangleBvh};
use crate::vector::{Vec3, cross, dot, sub};

/// Share of a face by which its edges are drawn outwards, so that no ray slips through between two faces.
const SEAM: f64 = 1e-9;

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// Face.
    pub face: u32,
    /// Distance from the origin in lengths of the direction.
    pub distance: f64,
}

impl TriangleBvh {
    /// First face that `accept` takes along the ray from `origin` in `direction`, at a distance above 0 and below `within`
    /// (in lengths of the direction). Of equal distances the one found first, which is always the same. O(log F) for most rays.
    pub fn ray(&self, origin: Vec3, direction: Vec3, within: f64, mut accept: impl FnMut(u32) -> bool) -> Option<RayHit> {
        let root = self.nodes.first()?;
        let inverse = direction.map(|x| 1.0 / x);
        let mut best = None;
        let mut bound = within;
        let mut stack = [(0u32, 0f64); 64];
        let mut depth = usize::from(entry(root, origin, inverse, bound).is_some());
        while depth > 0 {
            depth -= 1;
            let (at, from) = stack[depth];
            if from >= bound {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count == 0 {
                let enter = |child: u32| entry(&self.nodes[child as usize], origin, inverse, bound).map(|t| (child, t));
                let (a, b) = (enter(node.first), enter(node.first + 1));
                let (near, far) = match (a, b) {
                    (Some(x), Some(y)) if y.1 < x.1 => (b, a),
                    _ => (a, b),
                };
                // Halving keeps the depth below 32, so two entries a level always fit.
                for next in [far, near].into_iter().flatten() {
                    stack[depth] = next;
                    depth += 1;
                }
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                if let Some(distance) = meet(origin, direction, &self.corners[slot]).filter(|t| *t > 0.0 && *t < bound)
                    && accept(self.faces[slot])
                {
                    bound = distance;
                    best = Some(RayHit { face: self.faces[slot], distance });
                }
            }
        }
        best
    }
}

/// Where the ray enters the box, if it does before `bound`.
#[inline]
fn entry(node: &Node, origin: Vec3, inverse: Vec3, bound: f64) -> Option<f64> {
    let (mut from, mut to) = (0.0f64, bound);
    for k in 0..3 {
        let (a, b) = ((node.low[k] - origin[k]) * inverse[k], (node.high[k] - origin[k]) * inverse[k]);
        // A ray within a side of the box gives NaN, which `min` and `max` pass over.
        from = from.max(a.min(b));
        to = to.min(a.max(b) * (1.0 + 1e-12));
    }
    (from <= to).then_some(from)
}

/// Distance along the ray to the plane of a triangle, if it is met inside.
#[inline]
fn meet(origin: Vec3, direction: Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f64> {
    let (ab, ac) = (sub(*b, *a), sub(*c, *a));
    let p = cross(direction, ac);
    let determinant = dot(ab, p);
    if determinant == 0.0 {
        return None;
    }
    let scale = 1.0 / determinant;
    let s = sub(origin, *a);
    let u = dot(s, p) * scale;
    let q = cross(s, ab);
    let v = dot(direction, q) * scale;
    let inside = u >= -SEAM && v >= -SEAM && u + v <= 1.0 + SEAM;
    let t = dot(ac, q) * scale;
    (inside && t.is_finite()).then_some(t)
}
