//! Which two vertices of the outer loop a least squares conformal map pins when nobody says (P1 section 4 and 6.4).

use super::frame::Moments;
use crate::vector::{Vec3, add, add_scaled, distance, dot, norm, scale, sub, triangle_area};

/// Two vertices of the loop far apart in space: farthest from the first, then back and forth until nothing grows. O(m).
/// Distinct, whatever the positions. The loop has at least two vertices.
pub(super) fn farthest(ring: &[u32], positions: &[Vec3]) -> (u32, u32) {
    let from = |k: usize| {
        let centre = positions[ring[k] as usize];
        let far = |k: usize| distance(centre, positions[ring[k] as usize]);
        (0..ring.len()).fold((0, -1.0), |best, k| if far(k) > best.1 { (k, far(k)) } else { best })
    };
    let (mut p, mut q, mut span) = (0, from(0).0, 0.0);
    for _ in 0..8 {
        let (next, length) = from(q);
        if length <= span {
            break;
        }
        (p, q, span) = (q, next, length);
    }
    if p == q { (ring[0], ring[1]) } else { (ring[p], ring[q]) }
}

/// The vertices of the loop that lie outermost along the principal axis of the surface, the direction in which its second moment
/// about its centroid is largest. O(faces + m). Distinct; those of [`farthest`] for a surface without extent. Where the largest
/// moment is not unique, so is the axis, but it is always the same.
pub(super) fn inertia(ring: &[u32], positions: &[Vec3], triangles: &[[u32; 3]]) -> (u32, u32) {
    let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
    let (mut area, mut sum) = (0.0, [0.0; 3]);
    for [a, b, c] in triangles.iter().map(corners) {
        let w = triangle_area(a, b, c);
        (area, sum) = (area + w, add_scaled(sum, add(add(a, b), c), w / 3.0));
    }
    if !(area > 0.0 && area.is_finite()) {
        return farthest(ring, positions);
    }
    let centre = scale(sum, 1.0 / area);
    let mut moments = Moments::default();
    for [a, b, c] in triangles.iter().map(corners) {
        // Midpoints of the sides integrate quadratics exactly.
        let w = triangle_area(a, b, c) / (3.0 * area);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            moments.add(sub(scale(add(p, q), 0.5), centre), w);
        }
    }
    let axis = moments.axes()[0];
    let along = |v: u32| dot(sub(positions[v as usize], centre), axis);
    let (low, high) = ring.iter().fold((ring[0], ring[0]), |(low, high), &v| {
        (if along(v) < along(low) { v } else { low }, if along(v) > along(high) { v } else { high })
    });
    if low == high || norm(axis) == 0.0 { farthest(ring, positions) } else { (low, high) }
}

/// The vertex nearest to half of the loop's length from `vertex`, the earlier of two. O(m). Never `vertex` itself. If it is not on the
/// loop, the first vertex of the loop stands for it.
pub(super) fn half_way(ring: &[u32], positions: &[Vec3], vertex: u32) -> u32 {
    let m = ring.len();
    let start = ring.iter().position(|&v| v == vertex).unwrap_or(0);
    let at = |k: usize| positions[ring[(start + k) % m] as usize];
    let half = 0.5 * (0..m).map(|k| distance(at(k), at(k + 1))).sum::<f64>();
    let (mut run, mut best) = (0.0, (1, f64::INFINITY));
    for k in 1..m {
        run += distance(at(k - 1), at(k));
        if (run - half).abs() < best.1 {
            best = (k, (run - half).abs());
        }
    }
    ring[(start + best.0) % m]
}

#[cfg(test)]
mod tests;
