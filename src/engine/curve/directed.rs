//! Curves under a metric: the length wanted along them.

use super::{Curve, CurvePolyline, curve_polyline, curve_vertices};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, distance, sub};

/// Points that are looked at on either side to tell the direction of a curve.
const MOST_STEPS: usize = 64;

/// The polyline of a curve with the sizes that a metric wants along it: `along` tells the length at a vertex in a direction, `smallest`
/// that in the direction where it is least. The direction at a vertex is that of the chord over about half the smallest size wanted
/// there on either side, so that the zigzag of a seam does not count. `locked` as in [`curve_polyline`].
pub fn curve_polyline_in_metric(
    mesh: &SurfaceMesh,
    topology: &Topology,
    curve: &Curve,
    smallest: &[f64],
    locked: &[bool],
    along: &dyn Fn(u32, Vec3) -> f64,
) -> CurvePolyline {
    let polyline = curve_polyline(mesh, topology, curve, smallest, locked);
    let vertices = curve_vertices(topology, curve);
    let chord = |i: usize| sub(far_point(&polyline, i, Way::On), far_point(&polyline, i, Way::Back));
    let sizes = vertices.iter().enumerate().map(|(i, &v)| along(v, chord(i))).collect();
    CurvePolyline { sizes, ..polyline }
}

#[derive(Clone, Copy)]
enum Way {
    On,
    Back,
}

/// The first point at least half a size away along the curve.
fn far_point(polyline: &CurvePolyline, from: usize, way: Way) -> Vec3 {
    let points = &polyline.points;
    let mut at = from;
    for _ in 0..MOST_STEPS {
        match step(polyline, at, way) {
            Some(next) if next != from => at = next,
            _ => break,
        }
        if distance(points[at], points[from]) >= 0.5 * polyline.sizes[from] {
            break;
        }
    }
    points[at]
}

/// The next point; over the seam of a closed curve, whose first point is its last.
fn step(polyline: &CurvePolyline, at: usize, way: Way) -> Option<usize> {
    let last = polyline.points.len() - 1;
    let around = polyline.closed && last > 1;
    match way {
        Way::On if at < last => Some(at + 1),
        Way::On => around.then_some(1),
        Way::Back if at > 0 => Some(at - 1),
        Way::Back => around.then(|| last - 1),
    }
}
