//! Delaunay refinement (Ruppert 1995, Chew 1993) in the metric: circumcentres of triangles that are too large or too sharp go in, worst
//! first. Edges on curves are given and never split: a point that would encroach upon one is not put.

use super::SurfacePoint;
use super::frontal::{Domain, circumcentre, edge_length, minus};
use super::metric::{Metric, density, inner, length};
use super::triangulation::{Found, NONE, Triangulation, next, previous};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;
use std::collections::BinaryHeap;

/// Triangles of a larger circumradius, in sizes, are too large: with it the mean edge is one size long.
const LARGEST_RADIUS: f64 = 0.74;
/// A point sees an edge of a curve under at most the angle of this cosine.
const ENCROACHED: f64 = -0.2;

struct Refiner<'a> {
    domain: &'a Domain<'a>,
    mesh: &'a mut Triangulation,
    points: &'a mut Vec<SurfacePoint>,
    largest_radius: f64,
    /// Circumradius over shortest edge that the least angle allows.
    most_ratio: f64,
    stamp: Vec<u32>,
    heap: BinaryHeap<(u64, u32, u32)>,
    /// Marks of [`Refiner::has_room`].
    seen: Vec<u32>,
    clock: u32,
}

/// Shape of a triangle in the metric.
struct Shape {
    radius: f64,
    shortest: f64,
    /// Edge opposite the least angle.
    at: usize,
}

impl Refiner<'_> {
    fn shape(&self, t: u32) -> Shape {
        let v = self.mesh.tri[t as usize];
        let c = self.mesh.corners(t);
        let area = 0.5 * super::locate::area2(c[0], c[1], c[2]);
        let over = |l: [f64; 3], density: f64| {
            let below = 4.0 * area * density;
            if below > 0.0 { l[0] * l[1] * l[2] / below } else { f64::MAX }
        };
        let l = [0, 1, 2].map(|k| edge_length(self.mesh, v[next(k)], v[previous(k)]));
        let mean = v.iter().map(|&v| density(self.mesh.metric[v as usize])).sum::<f64>() / 3.0;
        let mut radius = over(l, mean);
        if radius <= self.largest_radius {
            let centroid = [0, 1].map(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0);
            let (_, m) = self.domain.sample(centroid, self.points[v[0] as usize].face);
            let e = [minus(c[2], c[1]), minus(c[0], c[2]), minus(c[1], c[0])];
            radius = radius.max(over(e.map(|e| length(m, e)), density(m)));
        }
        let at = if l[0] <= l[1] && l[0] <= l[2] { 0 } else { 1 + usize::from(l[2] < l[1]) };
        Shape { radius, shortest: l[at], at }
    }

    /// Whether both other edges at the least angle lie on curves: then nothing can be done about it.
    fn is_given(&self, t: u32, at: usize) -> bool {
        let fixed = self.mesh.fixed[t as usize];
        fixed[next(at)] && fixed[previous(at)]
    }

    fn renew(&mut self, t: u32) {
        let i = t as usize;
        if self.stamp.len() < self.mesh.tri.len() {
            self.stamp.resize(self.mesh.tri.len(), 0);
        }
        self.stamp[i] += 1;
        let shape = self.shape(t);
        let sharp = shape.radius > self.most_ratio * shape.shortest && !self.is_given(t, shape.at);
        if shape.radius > self.largest_radius || sharp {
            self.heap.push((shape.radius.min(f64::MAX).to_bits(), t, self.stamp[i]));
        }
    }

    /// Whether a point may go in: nothing nearer than `least`, no curve encroached upon. Looks at the cavity of the point.
    fn has_room(&mut self, p: Vec2, m: Metric, found: &Found, least: f64) -> bool {
        let t = match *found {
            Found::Inside(t) | Found::OnEdge(t, _) => t,
            Found::Blocked => return false,
        };
        self.clock += 1;
        if self.seen.len() < self.mesh.tri.len() {
            self.seen.resize(self.mesh.tri.len(), 0);
        }
        self.seen[t as usize] = self.clock;
        let mut stack = vec![t];
        let mut budget = 200;
        while let Some(t) = stack.pop() {
            let to = self.mesh.corners(t).map(|c| minus(c, p));
            let l = to.map(|d| length(m, d));
            if l.iter().any(|l| *l < least) {
                return false;
            }
            for k in 0..3 {
                let (i, j) = (next(k), previous(k));
                let u = self.mesh.adj[t as usize][k];
                if u == NONE || self.mesh.fixed[t as usize][k] {
                    if inner(m, to[i], to[j]) < ENCROACHED * l[i] * l[j] {
                        return false;
                    }
                } else if self.seen[u as usize] != self.clock && budget > 0 && self.in_circle(u, p, m) {
                    self.seen[u as usize] = self.clock;
                    budget -= 1;
                    stack.push(u);
                }
            }
        }
        true
    }

    /// Whether `p` is in the circumcircle of `t` in one metric.
    fn in_circle(&self, t: u32, p: Vec2, m: Metric) -> bool {
        let c = self.mesh.corners(t);
        circumcentre(c, m).is_some_and(|x| length(m, minus(x, p)) < length(m, minus(x, c[0])))
    }

    /// Puts the circumcentre of a triangle, if there is room for it.
    fn split(&mut self, t: u32, touched: &mut Vec<u32>) {
        let v = self.mesh.tri[t as usize];
        let shape = self.shape(t);
        let c = self.mesh.corners(t);
        let mean = std::array::from_fn(|k| v.iter().map(|&v| self.mesh.metric[v as usize][k]).sum::<f64>() / 3.0);
        let hint = self.points[v[0] as usize].face;
        let Some(first) = circumcentre(c, mean) else { return };
        let (point, m) = self.domain.sample(first, hint);
        let Some(p) = circumcentre(c, std::array::from_fn(|k| 0.5 * (mean[k] + m[k]))) else { return };
        let (point, m) = self.domain.sample(p, point.face);
        let found = self.mesh.walk(p, t);
        // No edge becomes shorter than the shortest there is, which is why this ends.
        let least = shape.shortest.max(0.6 * shape.radius).min(0.6 * self.largest_radius.max(shape.shortest));
        if self.has_room(p, m, &found, least) {
            self.points.push(point);
            self.mesh.insert(p, m, &found, touched);
        }
    }
}

/// What to refine.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Goal {
    /// Triangles that are too large or too sharp.
    SizeAndAngle,
    /// Only those too sharp.
    Angle,
}

/// Refines until no triangle is too large or has an angle in the metric below `min_angle_deg`, but for those whose circumcentre would
/// encroach upon a curve. Near-linear: each point goes in once, none is removed.
pub(super) fn refine(
    domain: &Domain<'_>,
    mesh: &mut Triangulation,
    points: &mut Vec<SurfacePoint>,
    min_angle_deg: f64,
    goal: Goal,
    work: &Work<'_>,
) -> Result<()> {
    let count = mesh.tri.len();
    let most_ratio = if min_angle_deg > 0.0 { 0.5 / min_angle_deg.to_radians().sin() } else { f64::INFINITY };
    let largest_radius = if goal == Goal::Angle { f64::INFINITY } else { LARGEST_RADIUS };
    let mut refiner = Refiner {
        domain,
        mesh,
        points,
        largest_radius,
        most_ratio,
        stamp: vec![0; count],
        heap: BinaryHeap::new(),
        seen: vec![0; count],
        clock: 0,
    };
    (0..count as u32).for_each(|t| refiner.renew(t));
    let mut touched = Vec::new();
    let mut round = 0usize;
    while let Some((_, t, stamp)) = refiner.heap.pop() {
        if refiner.stamp[t as usize] != stamp {
            continue;
        }
        round += 1;
        if round.is_multiple_of(1024) {
            work.check()?;
        }
        if refiner.mesh.uv.len() > domain.most {
            break;
        }
        touched.clear();
        refiner.split(t, &mut touched);
        touched.sort_unstable();
        touched.dedup();
        for &t in &touched {
            refiner.renew(t);
        }
    }
    Ok(())
}
