//! Fields of a place: shapes, points, curves, centerlines.

use super::SizeInput;
use super::spec::{Centerline, CenterlineMeasure, DistanceSize, DistanceSource, Shape};
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::vector::{Vec3, add_scaled, distance, dot, norm, scale, sub};
use crate::work::Work;
use std::f64::consts::TAU;

impl Shape {
    /// Straight distance of a point from the shape: exactly 0 inside and on its boundary.
    pub fn distance(&self, point: Vec3) -> f64 {
        match *self {
            Shape::Box { low, high } => norm(std::array::from_fn(|k| (low[k] - point[k]).max(point[k] - high[k]).max(0.0))),
            Shape::Sphere { center, radius } => (distance(point, center) - radius).max(0.0),
            Shape::Cylinder { start, end, radius } => {
                let axis = sub(end, start);
                let length = norm(axis);
                let from = sub(point, start);
                let along = dot(from, axis) / length;
                let aside = norm(add_scaled(from, scale(axis, 1.0 / length), -along));
                let (beyond, out) = ((-along).max(along - length).max(0.0), (aside - radius).max(0.0));
                beyond.hypot(out)
            }
        }
    }
}

/// Points and segments as a search tree of degenerate triangles.
struct Curves {
    tree: TriangleBvh,
    points: Vec<Vec3>,
    segments: Vec<[u32; 3]>,
}

impl Curves {
    fn new(points: Vec<Vec3>, segments: Vec<[u32; 3]>) -> Curves {
        Curves { tree: TriangleBvh::build(&points, &segments), points, segments }
    }

    fn polylines<'a>(lines: impl Iterator<Item = &'a [Vec3]>) -> Curves {
        let (mut points, mut segments) = (Vec::new(), Vec::new());
        for line in lines {
            let first = points.len() as u32;
            points.extend_from_slice(line);
            let last = points.len() as u32;
            match last - first {
                0 => {}
                1 => segments.push([first; 3]),
                _ => segments.extend((first + 1..last).map(|i| [i - 1, i, i])),
            }
        }
        Curves::new(points, segments)
    }

    /// Distance to the closest point, with its segment and the parameter on it.
    fn closest(&self, point: Vec3) -> Option<(f64, [u32; 3], f64)> {
        let hit = self.tree.closest(point)?;
        let segment = self.segments[hit.face as usize];
        let (a, b) = (self.points[segment[0] as usize], self.points[segment[1] as usize]);
        let length = distance(a, b);
        let t = if length > 0.0 { (distance(a, hit.position) / length).min(1.0) } else { 0.0 };
        Some((hit.distance_squared.sqrt(), segment, t))
    }
}

fn surface_edges(input: &SizeInput<'_>, wanted: impl Fn(u32) -> bool) -> Curves {
    let topology = input.topology;
    let edges = (0..topology.halfedge_count() as u32).filter(|&h| topology.is_edge_representative(h) && wanted(h));
    let segments = edges.map(|h| [topology.origin(h), topology.target(h), topology.target(h)]).collect();
    Curves::new(input.mesh.positions.clone(), segments)
}

/// For each vertex the distance from points or curves; infinite without any.
pub(super) fn distances(input: &SizeInput<'_>, spec: &DistanceSize, work: &Work<'_>) -> Result<Vec<f64>> {
    let curves = match &spec.from {
        DistanceSource::Points(points) => Curves::polylines(points.iter().map(std::slice::from_ref)),
        DistanceSource::Polylines(lines) => Curves::polylines(lines.iter().map(Vec::as_slice)),
        DistanceSource::Features => surface_edges(input, |h| input.features.is_feature[h as usize]),
        DistanceSource::Boundary => surface_edges(input, |h| input.topology.twin(h).is_none()),
    };
    each_vertex(input, work, |p| curves.closest(p).map_or(f64::INFINITY, |(d, ..)| d))
}

fn each_vertex(input: &SizeInput<'_>, work: &Work<'_>, value: impl Fn(Vec3) -> f64) -> Result<Vec<f64>> {
    let positions = &input.mesh.positions;
    let mut values = Vec::with_capacity(positions.len());
    for (v, p) in positions.iter().enumerate() {
        if v.is_multiple_of(4096) {
            work.step(v, positions.len())?;
        }
        values.push(value(*p));
    }
    Ok(values)
}

/// Lengths from given centerlines: of the closest point of all lines its radius, or its distance.
pub(super) fn along_centerlines(
    input: &SizeInput<'_>,
    lines: &[Centerline],
    measure: CenterlineMeasure,
    elements_around: f64,
    work: &Work<'_>,
) -> Result<Vec<f64>> {
    let curves = Curves::polylines(lines.iter().map(|line| line.points.as_slice()));
    let radii: Vec<f64> = lines.iter().flat_map(|line| line.radii.iter().copied()).collect();
    let factor = TAU / elements_around;
    each_vertex(input, work, |p| match (curves.closest(p), measure) {
        (None, _) => f64::INFINITY,
        (Some((distance, ..)), CenterlineMeasure::Distance) => factor * distance,
        (Some((_, [a, b, _], t)), CenterlineMeasure::Radius) => factor * ((1.0 - t) * radii[a as usize] + t * radii[b as usize]),
    })
}

/// For each vertex the length of a field that is `size` up to `reach` and grows beyond; without a slope nothing is asked for there.
pub(super) fn growing(distances: Vec<f64>, size: f64, reach: f64, slope: Option<f64>) -> Vec<f64> {
    let length = |d: f64| match slope {
        _ if d <= reach => size,
        Some(slope) if d.is_finite() => size + slope * (d - reach),
        _ => f64::INFINITY,
    };
    distances.into_iter().map(length).collect()
}
