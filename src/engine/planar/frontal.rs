//! Points from the front (Rebay 1993): the worst triangle next to a good one gets a point that makes its shared edge part of
//! an ideal triangle in the metric.

use super::SurfacePoint;
use super::locate::{Locator, area2};
use super::metric::{Metric, MetricField, density, inner, length};
use super::triangulation::{Found, NONE, Triangulation, next, previous};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;
use std::collections::BinaryHeap;

/// Circumradius of the ideal triangle.
const IDEAL_RADIUS: f64 = 0.577_350_269_189_625_8;
/// Triangles with at most this circumradius are good.
const GOOD_RADIUS: f64 = 0.75;
/// Least distance of a new point to the old ones.
const LEAST_DISTANCE: f64 = 0.65;
/// Least height of a new point over a fixed edge.
const LEAST_HEIGHT: f64 = 0.4;

/// The chart, seen through the metric, while its mesh grows.
pub(super) struct Domain<'a> {
    pub(super) locator: &'a Locator<'a>,
    pub(super) field: &'a MetricField,
    /// Most vertices the mesh may come to have.
    pub(super) most: usize,
}

/// How the filling of an outline ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Filled {
    Whole,
    /// [`Domain::most`] was reached: the outline holds parts of the plane that are not the chart.
    TooMany,
}

impl Domain<'_> {
    pub(super) fn sample(&self, p: Vec2, hint: u32) -> (SurfacePoint, Metric) {
        let point = self.locator.locate(p, hint);
        (point, self.field.at(self.locator, &point))
    }
}

#[inline]
pub(super) fn minus(a: Vec2, b: Vec2) -> Vec2 {
    [a[0] - b[0], a[1] - b[1]]
}

fn middle(a: Metric, b: Metric) -> Metric {
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
}

/// Length of an edge, averaged over the metrics of its ends.
pub(super) fn edge_length(mesh: &Triangulation, a: u32, b: u32) -> f64 {
    let e = minus(mesh.uv[b as usize], mesh.uv[a as usize]);
    0.5 * (length(mesh.metric[a as usize], e) + length(mesh.metric[b as usize], e))
}

/// Circumcentre of a triangle in a metric; `None` if it is flat.
pub(super) fn circumcentre(c: [Vec2; 3], m: Metric) -> Option<Vec2> {
    let (e, f) = (minus(c[1], c[0]), minus(c[2], c[0]));
    let (ee, ff) = (0.5 * inner(m, e, e), 0.5 * inner(m, f, f));
    // <e, x> = ee and <f, x> = ff in the metric.
    let (r, s) = ([m[0] * e[0] + m[1] * e[1], m[1] * e[0] + m[2] * e[1]], [m[0] * f[0] + m[1] * f[1], m[1] * f[0] + m[2] * f[1]]);
    let det = r[0] * s[1] - r[1] * s[0];
    if det.abs() <= f64::MIN_POSITIVE {
        return None;
    }
    let x = [(ee * s[1] - ff * r[1]) / det, (r[0] * ff - s[0] * ee) / det];
    Some([c[0][0] + x[0], c[0][1] + x[1]])
}

struct Front<'a> {
    domain: &'a Domain<'a>,
    mesh: &'a mut Triangulation,
    points: &'a mut Vec<SurfacePoint>,
    good: Vec<bool>,
    /// Raised whenever a triangle changes, so that old heap entries are known.
    stamp: Vec<u32>,
    heap: BinaryHeap<(u64, u32, u32)>,
}

impl Front<'_> {
    /// Circumradius in the metric at the vertices, or, if that is good, at the centroid if it is larger there.
    fn radius(&self, t: u32) -> f64 {
        let v = self.mesh.tri[t as usize];
        let c = self.mesh.corners(t);
        let area = 0.5 * area2(c[0], c[1], c[2]);
        let of = |l: [f64; 3], density: f64| {
            let below = 4.0 * area * density;
            if below > 0.0 { l[0] * l[1] * l[2] / below } else { f64::MAX }
        };
        let l = [edge_length(self.mesh, v[1], v[2]), edge_length(self.mesh, v[2], v[0]), edge_length(self.mesh, v[0], v[1])];
        let mean = v.iter().map(|&v| density(self.mesh.metric[v as usize])).sum::<f64>() / 3.0;
        let by_vertices = of(l, mean);
        if by_vertices > GOOD_RADIUS {
            return by_vertices;
        }
        let centroid = [0, 1].map(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0);
        let (_, m) = self.domain.sample(centroid, self.points[v[0] as usize].face);
        let e = [minus(c[2], c[1]), minus(c[0], c[2]), minus(c[1], c[0])];
        by_vertices.max(of(e.map(|e| length(m, e)), density(m)))
    }

    fn renew(&mut self, t: u32) {
        let i = t as usize;
        if self.good.len() < self.mesh.tri.len() {
            self.good.resize(self.mesh.tri.len(), false);
            self.stamp.resize(self.mesh.tri.len(), 0);
        }
        self.stamp[i] += 1;
        let radius = self.radius(t);
        self.good[i] = radius <= GOOD_RADIUS;
        if !self.good[i] {
            self.heap.push((radius.min(f64::MAX).to_bits(), t, self.stamp[i]));
        }
    }

    fn is_front(&self, t: u32, k: usize) -> bool {
        let u = self.mesh.adj[t as usize][k];
        u == NONE || self.mesh.fixed[t as usize][k] || self.good[u as usize]
    }

    fn is_active(&self, t: u32) -> bool {
        (0..3).any(|k| self.is_front(t, k))
    }

    /// The ideal point over edge `k` of `t`, in a metric.
    fn ideal(&self, t: u32, k: usize, m: Metric) -> Option<Vec2> {
        let c = self.mesh.corners(t);
        let (a, b, apex) = (c[next(k)], c[previous(k)], c[k]);
        let e = minus(b, a);
        let me = [m[0] * e[0] + m[1] * e[1], m[1] * e[0] + m[2] * e[1]];
        let normal = [-me[1], me[0]];
        let scale = length(m, normal);
        let whole = length(m, e);
        if !(scale > 0.0 && whole > 0.0) {
            return None;
        }
        let normal = normal.map(|x| x / scale);
        let mid = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let r = minus(apex, mid);
        let (x, y, p) = (inner(m, r, e) / whole, inner(m, r, normal), 0.5 * whole);
        if y <= 0.0 {
            return None;
        }
        let q = (x * x + y * y - p * p) / (2.0 * y);
        if q <= 0.0 {
            return None;
        }
        let radius = IDEAL_RADIUS.max(p).min((p * p + q * q) / (2.0 * q));
        let height = radius + (radius * radius - p * p).max(0.0).sqrt();
        Some([mid[0] + height * normal[0], mid[1] + height * normal[1]])
    }

    /// Whether a point is far enough from the vertices around it and from fixed edges.
    fn is_free(&self, p: Vec2, m: Metric, found: &Found) -> bool {
        let t = match *found {
            Found::Inside(t) | Found::OnEdge(t, _) => t,
            Found::Blocked => return false,
        };
        let far = |v: u32| length(m, minus(self.mesh.uv[v as usize], p)) >= LEAST_DISTANCE;
        let c = self.mesh.corners(t);
        (0..3).all(|k| {
            let u = self.mesh.adj[t as usize][k];
            let apex_far = u == NONE || self.mesh.fixed[t as usize][k] || {
                let v = self.mesh.tri[u as usize];
                v.iter().all(|&v| far(v))
            };
            let high = !self.mesh.fixed[t as usize][k] || {
                let (a, b) = (c[next(k)], c[previous(k)]);
                let e = length(m, minus(b, a));
                area2(a, b, p) * density(m) >= LEAST_HEIGHT * e
            };
            far(self.mesh.tri[t as usize][k]) && apex_far && high
        })
    }

    /// Tries to put a point; the second answer of `place` is refined once with the metric found there.
    fn try_point(&mut self, t: u32, place: impl Fn(&Self, Option<Metric>) -> Option<Vec2>, touched: &mut Vec<u32>) -> bool {
        let hint = self.points[self.mesh.tri[t as usize][0] as usize].face;
        let Some(first) = place(self, None) else { return false };
        let (point, m) = self.domain.sample(first, hint);
        let Some(p) = place(self, Some(m)) else { return false };
        let (point, m) = self.domain.sample(p, point.face);
        let found = self.mesh.walk(p, t);
        if !self.is_free(p, m, &found) {
            return false;
        }
        self.points.push(point);
        self.mesh.insert(p, m, &found, touched);
        true
    }

    /// Works on an active triangle; marks it good if no point can be put.
    fn advance(&mut self, t: u32, touched: &mut Vec<u32>) {
        let vertices = self.mesh.tri[t as usize];
        let mut edges: Vec<(f64, usize)> = (0..3)
            .filter(|&k| self.is_front(t, k))
            .map(|k| ((edge_length(self.mesh, vertices[next(k)], vertices[previous(k)]) - 1.0).abs(), k))
            .collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, k) in edges {
            let ends = middle(self.mesh.metric[vertices[next(k)] as usize], self.mesh.metric[vertices[previous(k)] as usize]);
            let place = |s: &Self, at: Option<Metric>| s.ideal(t, k, at.map_or(ends, |m| middle(ends, m)));
            if self.try_point(t, place, touched) {
                return;
            }
        }
        let mean = std::array::from_fn(|k| vertices.iter().map(|&v| self.mesh.metric[v as usize][k]).sum::<f64>() / 3.0);
        if self.try_point(t, |s, at| circumcentre(s.mesh.corners(t), at.unwrap_or(mean)), touched) {
            return;
        }
        self.good[t as usize] = true;
        for k in 0..3 {
            let u = self.mesh.adj[t as usize][k];
            if u != NONE && !self.good[u as usize] {
                self.renew(u);
            }
        }
    }
}

/// Fills the triangulated boundary with points. `points` grows along with the vertices.
pub(super) fn fill(domain: &Domain<'_>, mesh: &mut Triangulation, points: &mut Vec<SurfacePoint>, work: &Work<'_>) -> Result<Filled> {
    let count = mesh.tri.len();
    let mut front = Front { domain, mesh, points, good: vec![false; count], stamp: vec![0; count], heap: BinaryHeap::new() };
    (0..count as u32).for_each(|t| front.renew(t));
    let mut touched = Vec::new();
    let mut round = 0usize;
    while let Some((_, t, stamp)) = front.heap.pop() {
        let i = t as usize;
        if front.stamp[i] != stamp || front.good[i] || !front.is_active(t) {
            continue;
        }
        round += 1;
        if round.is_multiple_of(1024) {
            work.check()?;
        }
        if front.mesh.uv.len() > domain.most {
            return Ok(Filled::TooMany);
        }
        touched.clear();
        front.advance(t, &mut touched);
        touched.sort_unstable();
        touched.dedup();
        for &t in &touched {
            front.renew(t);
        }
        // A triangle that became good makes its neighbours part of the front.
        for &t in &touched {
            for k in 0..3 {
                let u = front.mesh.adj[t as usize][k];
                if front.good[t as usize] && u != NONE && !front.good[u as usize] && touched.binary_search(&u).is_err() {
                    front.renew(u);
                }
            }
        }
    }
    Ok(Filled::Whole)
}
