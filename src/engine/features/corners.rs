//! Corners: the vertices at which a feature or boundary curve must keep its shape.

use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, angle_between, distance, norm, sub};
use crate::work::Work;

/// A turn sharper than this (degrees) is a corner.
const TURN_DEG: f64 = 40.0;
/// The turn is measured over this many mean edge lengths of the two edges at the vertex, so that steps of one edge cancel.
const WINDOW: f64 = 3.0;
/// And over at most this many edges to either side.
const WINDOW_EDGES: usize = 12;

/// Ends, junctions and sharp turns of the curves made of boundary and feature edges; sorted. O(F).
pub(super) fn find_corners(mesh: &SurfaceMesh, topology: &Topology, is_feature: &[bool], work: &Work<'_>) -> Result<Vec<u32>> {
    let mut corners = Vec::new();
    for v in 0..topology.vertex_count() as u32 {
        if v.is_multiple_of(65_536) {
            work.check()?;
        }
        let around = curve_neighbours(topology, is_feature, v);
        let corner = match around[..] {
            [] => false,
            [a, b] => is_sharp_turn(mesh, topology, is_feature, v, [a, b]),
            _ => true,
        };
        if corner {
            corners.push(v);
        }
    }
    Ok(corners)
}

/// Vertices joined to `v` by a boundary or feature edge.
fn curve_neighbours(topology: &Topology, is_feature: &[bool], v: u32) -> Vec<u32> {
    let mut found = Vec::new();
    for h in topology.outgoing(v) {
        if is_feature[h as usize] || topology.twin(h).is_none() {
            found.push(topology.target(h));
        }
        let back = topology.prev(h);
        if topology.twin(back).is_none() {
            found.push(topology.origin(back));
        }
    }
    found
}

/// Whether the curve turns by more than [`TURN_DEG`] at `v`, both at its two edges and over a window of several edges.
/// A staircase of single edges turns at its edges but not over the window; a smooth arc the other way round.
fn is_sharp_turn(mesh: &SurfaceMesh, topology: &Topology, is_feature: &[bool], v: u32, next: [u32; 2]) -> bool {
    let at = mesh.positions[v as usize];
    let limit = TURN_DEG.to_radians();
    let ends = next.map(|w| mesh.positions[w as usize]);
    if turn(ends[0], at, ends[1]) < limit {
        return false;
    }
    let reach = WINDOW * 0.5 * (distance(at, ends[0]) + distance(at, ends[1]));
    let far = next.map(|w| walk(mesh, topology, is_feature, [v, w], reach));
    turn(far[0], at, far[1]) >= limit
}

/// Angle between the directions `a -> b` and `b -> c`; 0 if one of them vanishes.
fn turn(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    let (u, w) = (sub(b, a), sub(c, b));
    if norm(u) == 0.0 || norm(w) == 0.0 { 0.0 } else { angle_between(u, w) }
}

/// The mean of the curve's points (by length) on the way from `from` over `to`, up to `reach` or the next junction.
fn walk(mesh: &SurfaceMesh, topology: &Topology, is_feature: &[bool], [from, to]: [u32; 2], reach: f64) -> Vec3 {
    let (mut before, mut at) = (from, to);
    let (mut length, mut sum) = (0.0, [0.0; 3]);
    for _ in 0..WINDOW_EDGES {
        let (p, q) = (mesh.positions[before as usize], mesh.positions[at as usize]);
        let step = distance(p, q);
        length += step;
        for k in 0..3 {
            sum[k] += step * 0.5 * (p[k] + q[k]);
        }
        if length >= reach {
            break;
        }
        let [a, b] = curve_neighbours(topology, is_feature, at)[..] else { break };
        let onward = if a == before { b } else { a };
        if onward == from {
            break; // once around a closed curve
        }
        (before, at) = (at, onward);
    }
    if length > 0.0 { sum.map(|x| x / length) } else { mesh.positions[to as usize] }
}
