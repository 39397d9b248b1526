//! What stands where the polygon of curve points cannot be meshed in the plane: meshes with more vertices on the curves than wanted,
//! whose surplus is collapsed away in space. Always ends with exactly the curve points, by construction: a collapse
//! along a curve that the link condition forbids becomes allowed once the edges in its way are split.

use super::boundary::{Outline, edge_between};
use super::flexible::Flexible;
use super::locate::Locator;
use super::{CurveUse, PlanarMesh, SurfacePoint, VertexOrigin, point_in_space};
use crate::error::{EngineError, Reason, Result};
use crate::patch::Patch;
use crate::topology::Topology;
use crate::vector::{Vec2, Vec3, area_vector_twice, distance, dot, kappa, lerp};
use crate::work::Work;

/// Edges shorter than this share of the size are collapsed when the input mesh itself is coarsened.
const SHORT: f64 = 0.7;
/// Edges longer than this share of the size are split.
const LONG: f64 = 1.5;
const PASSES: usize = 20;

struct Reducer<'a> {
    patch: &'a Patch,
    locator: &'a Locator<'a>,
    mesh: Flexible,
}

impl Reducer<'_> {
    /// A new vertex halfway between two others in the chart; at the place of the first, if the chart is no help.
    fn midpoint(&mut self, a: u32, b: u32) -> u32 {
        let (i, j) = (a as usize, b as usize);
        let (p, q) = (self.mesh.uv[i], self.mesh.uv[j]);
        let uv = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        let point = self.locator.locate(uv, self.mesh.points[i].face);
        let place = point_in_space(self.patch, &point);
        let (x, y) = (self.mesh.positions[i], self.mesh.positions[j]);
        if distance(place, x).max(distance(place, y)) <= distance(x, y) {
            return self.mesh.add_vertex(uv, place, point, VertexOrigin::Interior);
        }
        // A surplus vertex: it lies where its face says, curve points need not.
        let point = self.mesh.points[i];
        self.mesh.add_vertex(p, point_in_space(self.patch, &point), point, VertexOrigin::Interior)
    }

    /// Where a surplus vertex may go: its two neighbours along its curve.
    fn targets(&self, v: u32) -> Vec<u32> {
        let around = self.mesh.neighbours(v);
        let border: Vec<u32> = around.iter().copied().filter(|&w| self.mesh.is_boundary(v, w)).collect();
        if border.is_empty() { around.into_iter().filter(|&w| self.mesh.is_crease(v, w)).collect() } else { border }
    }

    /// Worst triangle after the collapse, negative if a normal turns over.
    fn score(&self, v: u32, w: u32) -> f64 {
        let mut worst = 1.0f64;
        for (t, [a, b, c]) in self.mesh.after_collapse(v, w) {
            let [x, y, z] = self.mesh.corners(t);
            let upright = dot(area_vector_twice(a, b, c), area_vector_twice(x, y, z)) > 0.0;
            worst = worst.min(if upright { kappa(a, b, c) } else { -1.0 });
        }
        worst
    }

    /// Takes a surplus vertex off its curve.
    fn remove(&mut self, v: u32) -> Result<()> {
        let targets = self.targets(v);
        let free: Vec<u32> = targets.iter().copied().filter(|&w| self.mesh.obstacles(v, w).is_empty()).collect();
        let among = if free.is_empty() { &targets } else { &free };
        let best = among.iter().copied().max_by(|&a, &b| self.score(v, a).total_cmp(&self.score(v, b)).then(b.cmp(&a)));
        let Some(w) = best else {
            return Err(EngineError::invariant(format!("vertex {v} of a patch mesh has no neighbour along its curve")));
        };
        for x in self.mesh.obstacles(v, w) {
            let on_curve = |a: u32, b: u32| self.mesh.is_boundary(a, b) || self.mesh.is_crease(a, b);
            let from = if !on_curve(v, x) {
                v
            } else if !on_curve(w, x) {
                w
            } else {
                return Err(EngineError::new(Reason::PlanarMeshFailed, "a boundary loop of a patch has fewer than three curve points")
                    .with_hint("ask for a smaller size or more patches"));
            };
            let m = self.midpoint(from, x);
            self.mesh.split(from, x, m);
        }
        self.mesh.collapse(v, w);
        self.mesh.relax_around(w);
        Ok(())
    }

    fn remove_all(&mut self, surplus: impl Iterator<Item = u32>, work: &Work<'_>) -> Result<()> {
        for v in surplus {
            work.check()?;
            self.remove(v)?;
        }
        Ok(())
    }

    /// Collapses short edges at free vertices.
    fn coarsen(&mut self, is_free: &[bool], wanted: &dyn Fn(&SurfacePoint) -> f64, work: &Work<'_>) -> Result<()> {
        for _ in 0..PASSES {
            let mut changed = false;
            for v in 0..is_free.len() as u32 {
                if v.is_multiple_of(256) {
                    work.check()?;
                }
                if !is_free[v as usize] || !self.mesh.is_alive(v) {
                    continue;
                }
                let here = self.mesh.positions[v as usize];
                let limit = SHORT * wanted(&self.mesh.points[v as usize]);
                let best = self
                    .mesh
                    .neighbours(v)
                    .into_iter()
                    .filter(|&w| distance(here, self.mesh.positions[w as usize]) < limit)
                    .filter(|&w| self.mesh.obstacles(v, w).is_empty())
                    .map(|w| (self.score(v, w), w))
                    .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
                let worst = self.mesh.star[v as usize].iter().map(|&t| self.mesh.kappa(t)).fold(1.0, f64::min);
                if let Some((_, w)) = best.filter(|b| b.0 > 0.1f64.min(0.9 * worst)) {
                    self.mesh.collapse(v, w);
                    self.mesh.relax_around(w);
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        Ok(())
    }

    /// The mesh with vertices that are left, in their order.
    fn finish(self) -> PlanarMesh {
        let mesh = self.mesh;
        let mut number = vec![u32::MAX; mesh.positions.len()];
        let mut out = PlanarMesh::default();
        for v in 0..mesh.positions.len() {
            if mesh.is_alive(v as u32) {
                number[v] = out.uv.len() as u32;
                out.uv.push(mesh.uv[v]);
                out.origins.push(mesh.origins[v]);
                out.points.push(mesh.points[v]);
            }
        }
        let alive = (0..mesh.triangles.len() as u32).filter(|&t| !mesh.is_dead(t));
        out.triangles = alive.map(|t| mesh.triangles[t as usize].map(|v| number[v as usize])).collect();
        out
    }
}

/// The input's triangles with curve points on their edges, cut up; each piece still lies in one face.
struct Pieces {
    mesh: Flexible,
    /// Face of the patch that holds each triangle.
    source: Vec<u32>,
}

impl Pieces {
    fn split(&mut self, a: u32, b: u32, m: u32) {
        for t in self.mesh.along(a, b) {
            self.source.push(self.source[t as usize]);
        }
        self.mesh.split(a, b, m);
    }

    /// Splits long edges that are not on curves, longest of each triangle first.
    fn refine(&mut self, patch: &Patch, wanted: &dyn Fn(&SurfacePoint) -> f64, work: &Work<'_>) -> Result<()> {
        for _ in 0..PASSES {
            let before = self.mesh.triangles.len();
            for t in 0..before {
                if t.is_multiple_of(256) {
                    work.check()?;
                }
                let v = self.mesh.triangles[t];
                let length = |k: usize| distance(self.mesh.positions[v[k] as usize], self.mesh.positions[v[(k + 1) % 3] as usize]);
                let Some(k) = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j))) else { continue };
                let (a, b) = (v[k], v[(k + 1) % 3]);
                let middle = lerp(self.mesh.positions[a as usize], self.mesh.positions[b as usize], 0.5);
                let point = on_face(patch, self.source[t], middle);
                if length(k) <= LONG * wanted(&point) || self.mesh.is_boundary(a, b) || self.mesh.is_crease(a, b) {
                    continue;
                }
                let (p, q) = (self.mesh.uv[a as usize], self.mesh.uv[b as usize]);
                let uv = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
                let m = self.mesh.add_vertex(uv, middle, point, VertexOrigin::Interior);
                self.split(a, b, m);
            }
            if self.mesh.triangles.len() == before {
                break;
            }
        }
        Ok(())
    }
}

/// Barycentric coordinates of a point of a face.
fn on_face(patch: &Patch, face: u32, p: Vec3) -> SurfacePoint {
    let [a, b, c] = patch.triangles[face as usize].map(|v| patch.positions[v as usize]);
    let normal = area_vector_twice(a, b, c);
    let weight = |x: Vec3, y: Vec3| dot(area_vector_twice(x, y, p), normal).max(0.0);
    let w = [weight(b, c), weight(c, a), weight(a, b)];
    let sum = w[0] + w[1] + w[2];
    let barycentric = if sum > 0.0 { w.map(|x| x / sum) } else { [1.0, 0.0, 0.0] };
    SurfacePoint { face, barycentric }
}

/// Removes the extra vertices of an outline from a finished planar mesh.
pub(super) fn without_extra(
    patch: &Patch,
    planar: PlanarMesh,
    outline: &Outline,
    curves: &[CurveUse<'_>],
    locator: &Locator<'_>,
    work: &Work<'_>,
) -> Result<PlanarMesh> {
    let positions = super::lift(patch, &planar, curves).positions;
    let inner = |e: &&(u32, u32, usize, usize)| outline.strands[e.2].left.is_none();
    let creases = outline.edges().iter().filter(inner).map(|e| (e.0.min(e.1), e.0.max(e.1))).collect();
    let PlanarMesh { uv, triangles, origins, points } = planar;
    let mesh = Flexible { uv, positions, points, origins, triangles, creases, ..Flexible::default() }.index();
    let mut reducer = Reducer { patch, locator, mesh };
    reducer.remove_all((0..outline.extra.len() as u32).filter(|&v| outline.extra[v as usize]), work)?;
    Ok(reducer.finish())
}

/// Makes the patch mesh from the input's own triangles, for charts that cannot be meshed in the plane at all: curve points are put
/// on its edges, then the rest is coarsened and refined towards the size.
pub(super) fn from_patch(
    patch: &Patch,
    uv: &[Vec2],
    topology: &Topology,
    curves: &[CurveUse<'_>],
    vertex_size: &[f64],
    locator: &Locator<'_>,
    work: &Work<'_>,
) -> Result<PlanarMesh> {
    let count = patch.positions.len();
    let on_corner = |v: u32| {
        let h = topology.outgoing(v).next().unwrap_or(0);
        let mut barycentric = [0.0; 3];
        barycentric[(h % 3) as usize] = 1.0;
        SurfacePoint { face: topology.face(h), barycentric }
    };
    let mesh = Flexible {
        uv: uv.to_vec(),
        positions: patch.positions.clone(),
        points: (0..count as u32).map(on_corner).collect(),
        origins: vec![VertexOrigin::Interior; count],
        triangles: patch.triangles.clone(),
        ..Flexible::default()
    }
    .index();
    let mut pieces = Pieces { mesh, source: (0..patch.triangles.len() as u32).collect() };
    let mut is_free = vec![true; count];
    let mut is_point = vec![false; count];
    for curve in curves {
        let path = &curve.path;
        let last = curve.mesh.points.len() - 1;
        path.iter().for_each(|&v| is_free[v as usize] = false);
        for (i, v) in [(0, path[0]), (last, path[path.len() - 1])] {
            if !std::mem::replace(&mut is_point[v as usize], true) {
                pieces.mesh.origins[v as usize] = VertexOrigin::Curve { curve: curve.curve, point: i as u32 };
                pieces.mesh.positions[v as usize] = curve.mesh.points[i].position;
            }
        }
        let is_inner = edge_between(topology, path[0], path[1]).is_some_and(|h| topology.twin(h).is_some());
        if is_inner {
            pieces.mesh.creases.extend(path.windows(2).map(|w| (w[0].min(w[1]), w[0].max(w[1]))));
        }
        let mut from = (u32::MAX, 0u32);
        for (i, p) in curve.mesh.points.iter().enumerate().take(last).skip(1) {
            let (a, b) = (path[p.segment as usize], path[p.segment as usize + 1]);
            // Several points of a segment: the part that is left starts at the one before.
            let start = if from.0 == p.segment { from.1 } else { a };
            let (x, y) = (uv[a as usize], uv[b as usize]);
            let place = [x[0] + p.t * (y[0] - x[0]), x[1] + p.t * (y[1] - x[1])];
            let face = pieces.mesh.along(start, b).first().copied();
            let home = edge_between(topology, a, b).map_or(on_corner(a), |h| {
                let k = (h % 3) as usize;
                let s = if topology.origin(h) == a { p.t } else { 1.0 - p.t };
                let mut barycentric = [0.0; 3];
                barycentric[k] = 1.0 - s;
                barycentric[(k + 1) % 3] = s;
                SurfacePoint { face: topology.face(h), barycentric }
            });
            if face.is_none() {
                return Err(EngineError::invariant(format!("curve {} leaves the patch", curve.curve)));
            }
            let m = pieces.mesh.add_vertex(place, p.position, home, VertexOrigin::Curve { curve: curve.curve, point: i as u32 });
            pieces.split(start, b, m);
            from = (p.segment, m);
        }
    }
    let surplus: Vec<u32> = (0..count as u32).filter(|&v| !is_free[v as usize] && !is_point[v as usize]).collect();
    let wanted = |p: &SurfacePoint| {
        let t = patch.triangles[p.face as usize];
        (0..3).map(|k| p.barycentric[k] * vertex_size[t[k] as usize]).sum::<f64>()
    };
    pieces.refine(patch, &wanted, work)?;
    is_free.resize(count.max(pieces.mesh.positions.len()), false);
    for v in count..pieces.mesh.positions.len() {
        is_free[v] = pieces.mesh.origins[v] == VertexOrigin::Interior;
    }
    let mut reducer = Reducer { patch, locator, mesh: pieces.mesh };
    reducer.coarsen(&is_free, &wanted, work)?;
    reducer.remove_all(surplus.into_iter(), work)?;
    reducer.coarsen(&is_free, &wanted, work)?;
    Ok(reducer.finish())
}
