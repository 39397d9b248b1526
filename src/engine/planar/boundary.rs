//! The polygon of curve points in the chart: made free of crossings, then triangulated with its edges as constraints.
//!
//! A chord of two neighbouring curve points cuts corners of the chart. Where chords meet one another, vertices of the input polyline
//! are put between ("extra" nodes); with all of them the polygon is the chart's own boundary. They are taken out again in space.

use super::locate::Locator;
use super::metric::{Metric, MetricField};
use super::triangulation::{NONE, Triangulation, orientation};
use super::{CurveUse, SurfacePoint, VertexOrigin};
use crate::error::{EngineError, Result};
use crate::patch::Patch;
use crate::topology::Topology;
use crate::vector::Vec2;
use crate::work::Work;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

/// A vertex of a curve's polygon: its place along the path (segment + t) and its number.
#[derive(Clone, Copy)]
pub(super) struct Node {
    at: f64,
    vertex: u32,
}

/// A curve as it lies in the patch.
pub(super) struct Strand {
    pub(super) nodes: Vec<Node>,
    /// `None` inside the patch; else whether the patch lies on the left of the path.
    pub(super) left: Option<bool>,
}

/// The vertices on curves and how they are joined.
#[derive(Default)]
pub(super) struct Outline {
    pub(super) uv: Vec<Vec2>,
    pub(super) points: Vec<SurfacePoint>,
    pub(super) origins: Vec<VertexOrigin>,
    /// Vertices that must not stay.
    pub(super) extra: Vec<bool>,
    pub(super) strands: Vec<Strand>,
    of_local: Vec<u32>,
}

/// The halfedge of the patch along `a b`, or against it.
pub(super) fn edge_between(topology: &Topology, a: u32, b: u32) -> Option<u32> {
    let leaving = |a: u32, b: u32| topology.outgoing(a).find(|&h| topology.target(h) == b);
    leaving(a, b).or_else(|| leaving(b, a))
}

/// Point at parameter `t` from `a` to `b` on the face of their edge.
fn point_on_edge(topology: &Topology, a: u32, b: u32, t: f64) -> Result<SurfacePoint> {
    let h =
        edge_between(topology, a, b).ok_or_else(|| EngineError::invariant(format!("curve step {a}-{b} is not an edge of the patch")))?;
    let k = (h % 3) as usize;
    let mut barycentric = [0.0; 3];
    let s = if topology.origin(h) == a { t } else { 1.0 - t };
    barycentric[k] = 1.0 - s;
    barycentric[(k + 1) % 3] = s;
    Ok(SurfacePoint { face: topology.face(h), barycentric })
}

fn between(a: Vec2, b: Vec2, t: f64) -> Vec2 {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

impl Outline {
    fn push(&mut self, uv: Vec2, point: SurfacePoint, origin: VertexOrigin, extra: bool) -> u32 {
        self.uv.push(uv);
        self.points.push(point);
        self.origins.push(origin);
        self.extra.push(extra);
        self.uv.len() as u32 - 1
    }

    /// The curve points as polygons; ends of curves at the same patch vertex are one.
    pub(super) fn new(patch: &Patch, uv: &[Vec2], topology: &Topology, curves: &[CurveUse<'_>]) -> Result<Outline> {
        let mut outline = Outline { of_local: vec![NONE; patch.positions.len()], ..Outline::default() };
        let mut border_edges = 0;
        for curve in curves {
            let (path, points) = (&curve.path, &curve.mesh.points);
            if path.len() < 2 || points.len() < 2 || points.iter().any(|p| p.segment as usize + 1 >= path.len()) {
                return Err(EngineError::invariant(format!("the mesh of curve {} does not fit its path", curve.curve)));
            }
            let first = edge_between(topology, path[0], path[1])
                .ok_or_else(|| EngineError::invariant(format!("curve {} leaves the patch", curve.curve)))?;
            let left = topology.twin(first).is_none().then(|| topology.origin(first) == path[0]);
            border_edges += if left.is_some() { path.len() - 1 } else { 0 };
            let last = points.len() - 1;
            let mut nodes = Vec::with_capacity(points.len());
            for (i, p) in points.iter().enumerate() {
                let s = p.segment as usize;
                let end = if i == 0 { Some(0) } else { (i == last).then(|| path.len() - 1) };
                let known = end.map_or(NONE, |e| outline.of_local[path[e] as usize]);
                let vertex = if known != NONE {
                    known
                } else {
                    let origin = VertexOrigin::Curve { curve: curve.curve, point: i as u32 };
                    let (at, t) = end.map_or((s, p.t), |e| if e == 0 { (0, 0.0) } else { (path.len() - 2, 1.0) });
                    let place = between(uv[path[at] as usize], uv[path[at + 1] as usize], t);
                    let place = end.map_or(place, |e| uv[path[e] as usize]);
                    outline.push(place, point_on_edge(topology, path[at], path[at + 1], t)?, origin, false)
                };
                if let Some(e) = end {
                    outline.of_local[path[e] as usize] = vertex;
                }
                nodes.push(Node { at: end.map_or(s as f64 + p.t, |e| e as f64), vertex });
            }
            outline.strands.push(Strand { nodes, left });
        }
        if border_edges != patch.loops.iter().map(Vec::len).sum::<usize>() {
            return Err(EngineError::invariant("the curves do not cover the boundary of the patch"));
        }
        Ok(outline)
    }

    /// All polygon edges as `(from, to, strand, index)`; those of the boundary run with the patch on their left.
    pub(super) fn edges(&self) -> Vec<(u32, u32, usize, usize)> {
        let mut edges = Vec::new();
        for (s, strand) in self.strands.iter().enumerate() {
            for (i, w) in strand.nodes.windows(2).enumerate() {
                let (a, b) = if strand.left == Some(false) { (w[1].vertex, w[0].vertex) } else { (w[0].vertex, w[1].vertex) };
                edges.push((a, b, s, i));
            }
        }
        edges
    }

    /// Puts the path vertex farthest from the chord on each listed edge; returns how many edges had one.
    fn refine(&mut self, uv: &[Vec2], topology: &Topology, curves: &[CurveUse<'_>], mut edges: Vec<(usize, usize)>) -> Result<usize> {
        edges.sort_unstable();
        edges.dedup();
        let mut count = 0;
        for &(s, i) in edges.iter().rev() {
            let path = &curves[s].path;
            let (from, to) = (self.strands[s].nodes[i], self.strands[s].nodes[i + 1]);
            let (low, high) = (from.at.floor() as usize + 1, to.at.ceil() as usize);
            let (a, b) = (self.uv[from.vertex as usize], self.uv[to.vertex as usize]);
            let off = |j: usize| {
                let p = uv[path[j] as usize];
                let d = [b[0] - a[0], b[1] - a[1]];
                let e = [p[0] - a[0], p[1] - a[1]];
                let t = ((d[0] * e[0] + d[1] * e[1]) / (d[0] * d[0] + d[1] * d[1]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                (e[0] - t * d[0]).hypot(e[1] - t * d[1])
            };
            let middle = (low + high) / 2;
            let best = (low..high).max_by(|&x, &y| off(x).total_cmp(&off(y)).then_with(|| y.abs_diff(middle).cmp(&x.abs_diff(middle))));
            let Some(j) = best else { continue };
            let point = if j + 1 < path.len() {
                point_on_edge(topology, path[j], path[j + 1], 0.0)?
            } else {
                point_on_edge(topology, path[j - 1], path[j], 1.0)?
            };
            let vertex = self.push(uv[path[j] as usize], point, VertexOrigin::Interior, true);
            self.strands[s].nodes.insert(i + 1, Node { at: j as f64, vertex });
            count += 1;
        }
        Ok(count)
    }

    /// Triangulates the inside, refining the polygon where its edges meet. `None` if even the whole boundary does not make a
    /// simple polygon of the right topology (the chart is then not bijective in floating point).
    pub(super) fn triangulate(
        &mut self,
        patch: &Patch,
        uv: &[Vec2],
        topology: &Topology,
        curves: &[CurveUse<'_>],
        work: &Work<'_>,
    ) -> Result<Option<Triangulation>> {
        loop {
            work.check()?;
            let edges = self.edges();
            let crossing = crossings(&self.uv, &edges);
            if !crossing.is_empty() {
                if self.refine(uv, topology, curves, crossing)? == 0 {
                    return Ok(None);
                }
                continue;
            }
            if let Some(mesh) = constrained(&self.uv, &edges, &self.strands, patch.loops.len()) {
                return Ok(Some(mesh));
            }
            if self.refine_all(uv, topology, curves)? == 0 {
                return Ok(None);
            }
        }
    }

    /// Brings every edge nearer to its curve; returns how many had a vertex left to take in.
    pub(super) fn refine_all(&mut self, uv: &[Vec2], topology: &Topology, curves: &[CurveUse<'_>]) -> Result<usize> {
        let all = self.edges().iter().map(|&(_, _, s, i)| (s, i)).collect();
        self.refine(uv, topology, curves, all)
    }

    /// The metric at every vertex.
    pub(super) fn metrics(&self, locator: &Locator<'_>, field: &MetricField) -> Vec<Metric> {
        self.points.iter().map(|p| field.at(locator, p)).collect()
    }
}

/// Whether two segments meet other than in a common end.
fn meet(uv: &[Vec2], (a, b): (u32, u32), (c, d): (u32, u32)) -> bool {
    let p = |v: u32| uv[v as usize];
    let shared = |x: u32| x == c || x == d;
    match (shared(a), shared(b)) {
        (true, true) => true,
        (false, false) => {
            let (o1, o2) = (orientation(p(a), p(b), p(c)), orientation(p(a), p(b), p(d)));
            let (o3, o4) = (orientation(p(c), p(d), p(a)), orientation(p(c), p(d), p(b)));
            let sides = |x: f64, y: f64| (x <= 0.0 && y >= 0.0) || (x >= 0.0 && y <= 0.0);
            sides(o1, o2) && sides(o3, o4)
        }
        (on_a, _) => {
            let (s, x) = if on_a { (a, b) } else { (b, a) };
            let y = if s == c { d } else { c };
            let (e, f) = ([p(x)[0] - p(s)[0], p(x)[1] - p(s)[1]], [p(y)[0] - p(s)[0], p(y)[1] - p(s)[1]]);
            orientation(p(s), p(x), p(y)) == 0.0 && e[0] * f[0] + e[1] * f[1] >= 0.0
        }
    }
}

/// Edges that meet others, found by a sweep over their boxes.
fn crossings(uv: &[Vec2], edges: &[(u32, u32, usize, usize)]) -> Vec<(usize, usize)> {
    let bounds = |e: &(u32, u32, usize, usize), k: usize| {
        let (a, b) = (uv[e.0 as usize][k], uv[e.1 as usize][k]);
        (a.min(b), a.max(b))
    };
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&i, &j| bounds(&edges[i], 0).0.total_cmp(&bounds(&edges[j], 0).0).then(i.cmp(&j)));
    let mut active: Vec<usize> = Vec::new();
    let mut found = Vec::new();
    for i in order {
        let e = &edges[i];
        let (x, y) = (bounds(e, 0), bounds(e, 1));
        active.retain(|&j| bounds(&edges[j], 0).1 >= x.0);
        for &j in &active {
            let f = &edges[j];
            let other = bounds(f, 1);
            if other.0 <= y.1 && y.0 <= other.1 && meet(uv, (e.0, e.1), (f.0, f.1)) {
                found.extend([(e.2, e.3), (f.2, f.3)]);
            }
        }
        active.push(i);
    }
    found
}

/// Links triangles over their common edges. `None` if an edge has more than two.
fn link(tri: &[[u32; 3]]) -> Option<Vec<[u32; 3]>> {
    let mut sides: Vec<(u32, u32, u32, usize)> = Vec::with_capacity(tri.len() * 3);
    for (t, v) in tri.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (v[(k + 1) % 3], v[(k + 2) % 3]);
            sides.push((a.min(b), a.max(b), t as u32, k));
        }
    }
    sides.sort_unstable();
    let mut adj = vec![[NONE; 3]; tri.len()];
    for w in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        match w {
            [_] => {}
            [x, y] => {
                adj[x.2 as usize][x.3] = y.2;
                adj[y.2 as usize][y.3] = x.2;
            }
            _ => return None,
        }
    }
    Some(adj)
}

/// Constrained Delaunay triangulation of the inside; `None` if it is not what the patch is: all vertices used, every boundary edge with
/// one triangle, on its left, every inner edge with two, and the right Euler characteristic.
fn constrained(uv: &[Vec2], edges: &[(u32, u32, usize, usize)], strands: &[Strand], loops: usize) -> Option<Triangulation> {
    let settle = |x: f64| if x.abs() < 1e-40 { 0.0 } else { x };
    let vertices: Vec<Point2<f64>> = uv.iter().map(|p| Point2::new(settle(p[0]), settle(p[1]))).collect();
    let mut conflict = false;
    let pairs: Vec<[usize; 2]> = edges.iter().map(|e| [e.0 as usize, e.1 as usize]).collect();
    let cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(vertices, pairs, |_| conflict = true).ok()?;
    if conflict || cdt.num_vertices() != uv.len() {
        return None;
    }
    let all: Vec<[u32; 3]> = cdt.inner_faces().map(|f| f.vertices().map(|v| v.index() as u32)).collect();
    let adj = link(&all)?;
    // Directed sides, to look edges up.
    let mut sides: Vec<(u32, u32, u32, usize)> = Vec::with_capacity(all.len() * 3);
    for (t, v) in all.iter().enumerate() {
        (0..3).for_each(|k| sides.push((v[(k + 1) % 3], v[(k + 2) % 3], t as u32, k)));
    }
    sides.sort_unstable();
    let side = |a: u32, b: u32| {
        let i = sides.partition_point(|s| (s.0, s.1) < (a, b));
        sides.get(i).filter(|s| (s.0, s.1) == (a, b)).map(|s| (s.2, s.3))
    };
    let mut fixed = vec![[false; 3]; all.len()];
    let mut inside = vec![false; all.len()];
    let mut stack = Vec::new();
    for &(a, b, s, _) in edges {
        let (ahead, behind) = (side(a, b), side(b, a));
        for (t, k) in [ahead, behind].into_iter().flatten() {
            fixed[t as usize][k] = true;
        }
        if strands[s].left.is_some() {
            stack.push(ahead?.0);
        } else {
            ahead.and(behind)?;
        }
    }
    let border: Vec<(u32, u32)> = {
        let mut list: Vec<(u32, u32)> =
            edges.iter().filter(|e| strands[e.2].left.is_some()).map(|e| (e.0.min(e.1), e.0.max(e.1))).collect();
        list.sort_unstable();
        list
    };
    let is_border = |t: u32, k: usize| {
        let v = all[t as usize];
        let (a, b) = (v[(k + 1) % 3], v[(k + 2) % 3]);
        fixed[t as usize][k] && border.binary_search(&(a.min(b), a.max(b))).is_ok()
    };
    while let Some(t) = stack.pop() {
        if std::mem::replace(&mut inside[t as usize], true) {
            continue;
        }
        for k in 0..3 {
            if !is_border(t, k) {
                match adj[t as usize][k] {
                    NONE => return None,
                    u => stack.push(u),
                }
            }
        }
    }
    for &(a, b, s, _) in edges {
        let within = |at: Option<(u32, usize)>| at.is_some_and(|(t, _)| inside[t as usize]);
        let behind = within(side(b, a));
        if !within(side(a, b)) || behind == strands[s].left.is_some() {
            return None;
        }
    }
    let kept: Vec<usize> = (0..all.len()).filter(|&t| inside[t]).collect();
    let mut number = vec![NONE; all.len()];
    kept.iter().enumerate().for_each(|(i, &t)| number[t] = i as u32);
    let renumber = |t: usize| {
        let linked = |k: usize| match adj[t][k] {
            NONE => NONE,
            u => number[u as usize],
        };
        [linked(0), linked(1), linked(2)]
    };
    let mesh = Triangulation {
        uv: uv.to_vec(),
        metric: Vec::new(),
        tri: kept.iter().map(|&t| all[t]).collect(),
        adj: kept.iter().map(|&t| renumber(t)).collect(),
        fixed: kept.iter().map(|&t| fixed[t]).collect(),
    };
    let mut used = vec![false; uv.len()];
    mesh.tri.iter().flatten().for_each(|&v| used[v as usize] = true);
    let outer = mesh.adj.iter().flatten().filter(|&&u| u == NONE).count();
    let twice_edges = mesh.tri.len() * 3 + outer;
    let euler = uv.len() as i64 - (twice_edges / 2) as i64 + mesh.tri.len() as i64;
    (used.iter().all(|u| *u) && euler == 2 - loops as i64).then_some(mesh)
}
