//! placeholder until the merge
use crate::vector::{Vec3, distance};

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

pub(super) fn inertia(ring: &[u32], positions: &[Vec3], _triangles: &[[u32; 3]]) -> (u32, u32) {
    farthest(ring, positions)
}

pub(super) fn half_way(ring: &[u32], _positions: &[Vec3], v: u32) -> u32 {
    let at = ring.iter().position(|&w| w == v).unwrap_or(0);
    ring[(at + ring.len() / 2) % ring.len()]
}
