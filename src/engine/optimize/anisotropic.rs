//! Optimisation under a metric with directions of its own: the same guarded operations, with lengths and shapes measured in the metric.
//! No isotropic floor on shape applies.

use super::activity::Activity;
use super::input::{Input, Tree};
use super::kernel::Kernel;
use super::state::{Curves, State, tangential};
use super::{OptimizeSpec, Remeshed, SurfaceFit, check, finish, fit, untangle};
use crate::assemble::Assembled;
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::metric::{SurfaceMetric, squared_length};
use crate::sizing::SizeField;
use crate::vector::{Vec3, add, add_scaled, scale, sub};
use crate::work::Work;

/// Edges longer than this in the metric are split.
const LONG: f64 = 1.4;
/// Edges shorter than this in the metric are collapsed.
const SHORT: f64 = 0.7;
/// Edges shorter than this push no harder.
const SHORTEST_PULL: f64 = 0.2;
/// Shape in the metric that a collapse must leave, unless it was worse before.
const LEAST_SHAPE: f64 = 0.3;
/// Operations between two checks for cancellation.
const CHECK_EVERY: u32 = 1024;

type Tensor = [f64; 6];

/// What a pass of flips looks for.
#[derive(Clone, Copy, PartialEq)]
enum Goal {
    /// Valences near 6 (4 on the boundary); shape in the metric decides ties.
    Valence,
    /// Better shape in the metric of the worse of the two faces.
    Shape,
}

/// The mesh and the tensor at each of its vertices.
struct Measured<'s, 'a> {
    state: &'s mut State<'a>,
    input: &'a SurfaceMesh,
    metric: &'a SurfaceMetric,
    tensors: Vec<Tensor>,
}

/// Optimises under a metric. Keeps topology, corners and all curve vertices; free vertices end as there.
///
/// # Errors
/// Those of [`super::optimize_surface`].
pub fn optimize_in_metric(
    input: &SurfaceMesh,
    bvh: &TriangleBvh,
    assembled: &Assembled,
    metric: &SurfaceMetric,
    spec: &OptimizeSpec,
    work: &Work<'_>,
) -> Result<Remeshed> {
    let smallest = (0..input.positions.len() as u32).map(|v| metric.smallest_length(v)).map(|l| if l.is_finite() { l } else { 1.0 });
    let sizes = SizeField::new(smallest.collect());
    check(input, assembled, &sizes)?;
    let surface = Input::new(input, Tree::Made(bvh), &sizes);
    let all = |mesh: &Kernel| Activity::new(mesh.vertex_slots() as usize);
    let mut state = State::new(&surface, assembled, Curves::Held, all)?;
    let stages = spec.rounds as usize + 2;
    let mut crossing = None;
    if spec.rounds > 0 {
        let mut measured = Measured { state: &mut state, input, metric, tensors: Vec::new() };
        for v in 0..measured.state.mesh.vertex_slots() {
            if v.is_multiple_of(CHECK_EVERY) {
                work.check()?;
            }
            measured.renew(v);
        }
        for round in 0..spec.rounds {
            measured.split_long(work)?;
            measured.collapse_short(work)?;
            measured.flip(Goal::Valence, work)?;
            measured.smooth(3, work)?;
            work.step(round as usize, stages)?;
        }
        for _ in 0..3 {
            measured.flip(Goal::Shape, work)?;
            measured.smooth(2, work)?;
        }
        measured.flip(Goal::Shape, work)?;
        let fitted = match spec.fit {
            // No floor on shape: triangles are long here.
            SurfaceFit::Faces => fit::fit(&mut state, 0.0, work)?,
            SurfaceFit::Vertices => Vec::new(),
        };
        crossing = Some(untangle::untangle(&mut state, &fitted, work)? as u32);
    }
    work.step(stages, stages)?;
    Ok(Remeshed { crossing_faces: crossing, ..finish(input, &state) })
}

/// Shape in a metric from the squared lengths of the edges: 2 r / R, 1 for equilateral.
fn shape(squares: [f64; 3]) -> f64 {
    let [a, b, c] = squares.map(f64::sqrt);
    let product = a * b * c;
    if product > 0.0 { ((b + c - a) * (c + a - b) * (a + b - c) / product).max(0.0) } else { 0.0 }
}

fn shape_in(t: &Tensor, p: [Vec3; 3]) -> f64 {
    shape([squared_length(t, sub(p[1], p[0])), squared_length(t, sub(p[2], p[1])), squared_length(t, sub(p[0], p[2]))])
}

fn mean<const N: usize>(tensors: [&Tensor; N]) -> Tensor {
    std::array::from_fn(|k| tensors.iter().map(|t| t[k]).sum::<f64>() / N as f64)
}

impl Measured<'_, '_> {
    /// The tensor at a vertex that is new or has moved.
    fn renew(&mut self, v: u32) {
        if self.tensors.len() <= v as usize {
            self.tensors.resize(v as usize + 1, [0.0; 6]);
        }
        if self.state.mesh.is_vertex(v) {
            let foot = self.state.own_foot(v);
            self.tensors[v as usize] = self.metric.at(self.input, foot.face, foot.barycentric);
        }
    }

    fn length(&self, a: u32, b: u32) -> f64 {
        let e = sub(self.state.mesh.at(b), self.state.mesh.at(a));
        let along = |v: u32| squared_length(&self.tensors[v as usize], e).max(0.0).sqrt();
        0.5 * (along(a) + along(b))
    }

    fn edge_length(&self, h: u32) -> f64 {
        self.length(self.state.mesh.from(h), self.state.mesh.to(h))
    }

    /// Edges off curves whose length is wanted.
    fn edges(&self, wanted: impl Fn(f64) -> bool) -> Vec<(f64, u32)> {
        let m = &self.state.mesh;
        (0..3 * m.face_slots())
            .filter(|&h| m.is_face(h / 3) && !m.is_on_curve(h) && m.twin(h).is_none_or(|t| h < t))
            .map(|h| (self.edge_length(h), h))
            .filter(|e| wanted(e.0))
            .collect()
    }

    fn split_long(&mut self, work: &Work<'_>) -> Result<()> {
        for _ in 0..6 {
            work.check()?;
            let mut long = self.edges(|l| l > LONG);
            long.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
            let mut changed = 0;
            for (i, &(length, h)) in long.iter().enumerate() {
                if (i as u32).is_multiple_of(CHECK_EVERY) {
                    work.check()?;
                }
                if (self.edge_length(h) - length).abs() < 1e-12
                    && let Some(v) = self.state.try_split(h)
                {
                    self.renew(v);
                    changed += 1;
                }
            }
            if changed * 100 < long.len() {
                break;
            }
        }
        Ok(())
    }

    fn collapse_short(&mut self, work: &Work<'_>) -> Result<()> {
        for _ in 0..4 {
            work.check()?;
            let mut short = self.edges(|l| l < SHORT);
            short.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            let mut changed = 0;
            for (i, &(_, h)) in short.iter().enumerate() {
                if (i as u32).is_multiple_of(CHECK_EVERY) {
                    work.check()?;
                }
                if self.state.mesh.is_face(h / 3) && self.edge_length(h) < SHORT && self.collapse(h) {
                    changed += 1;
                }
            }
            if changed * 50 < short.len() {
                break;
            }
        }
        Ok(())
    }

    fn collapse(&mut self, h: u32) -> bool {
        for side in [Some(h), self.state.mesh.twin(h)].into_iter().flatten() {
            let Some(foot) = self.state.collapse_target(side) else { continue };
            let (a, b) = (self.state.mesh.from(side), self.state.mesh.to(side));
            let t = mean([&self.tensors[a as usize], &self.tensors[b as usize]]);
            let after = self.state.faces_after_collapse(side, foot.position);
            let longest = after.iter().flat_map(|f| [sub(f[1], f[0]), sub(f[2], f[0])]).map(|e| squared_length(&t, e)).fold(0.0, f64::max);
            let worst = after.iter().map(|f| shape_in(&t, *f)).fold(1.0, f64::min);
            let before = self.star_shape(a).min(self.star_shape(b));
            if longest < LONG * LONG && worst > before.min(LEAST_SHAPE) && self.state.try_collapse(side, &foot) {
                self.renew(b);
                return true;
            }
        }
        false
    }

    /// Least shape around a vertex.
    fn star_shape(&self, v: u32) -> f64 {
        let m = &self.state.mesh;
        let t = &self.tensors[v as usize];
        m.around(v).map(|h| shape_in(t, m.points(h / 3))).fold(1.0, f64::min)
    }

    fn flip(&mut self, goal: Goal, work: &Work<'_>) -> Result<()> {
        for _ in 0..6 {
            let mut changed = 0;
            for h in 0..3 * self.state.mesh.face_slots() {
                if h.is_multiple_of(CHECK_EVERY) {
                    work.check()?;
                }
                if self.state.mesh.is_face(h / 3) && self.wants_flip(h, goal) && self.state.try_flip(h) {
                    changed += 1;
                }
            }
            if changed == 0 {
                break;
            }
        }
        Ok(())
    }

    fn wants_flip(&self, h: u32, goal: Goal) -> bool {
        let m = &self.state.mesh;
        let Some(twin) = m.twin(h).filter(|&t| h < t && !m.is_on_curve(h)) else { return false };
        let ids = [m.from(h), m.from(twin), m.apex(h), m.apex(twin)];
        let [a, b, c, d] = ids.map(|v| m.at(v));
        let t = mean(ids.map(|v| &self.tensors[v as usize]));
        let least = |faces: [[Vec3; 3]; 2]| shape_in(&t, faces[0]).min(shape_in(&t, faces[1]));
        let (after, before) = (least([[a, d, c], [d, b, c]]), least([[a, b, c], [b, a, d]]));
        if goal == Goal::Shape {
            return after > before + 1e-4;
        }
        let excess = |v: u32| m.valence(v) as i32 - if m.is_boundary_vertex(v) { 4 } else { 6 };
        // Change of the sum of squared excesses when two valences drop by one and two rise by one.
        let change = [ids[2], ids[3]].map(|v| 2 * excess(v) + 1).iter().sum::<i32>()
            - [ids[0], ids[1]].map(|v| 2 * excess(v) - 1).iter().sum::<i32>();
        if change < 0 { after > 0.4 * before && after > 0.15 } else { change == 0 && after > before + 1e-3 }
    }

    fn smooth(&mut self, sweeps: u32, work: &Work<'_>) -> Result<()> {
        for _ in 0..sweeps {
            for v in 0..self.state.mesh.vertex_slots() {
                if v.is_multiple_of(CHECK_EVERY) {
                    work.check()?;
                }
                if self.state.mesh.is_vertex(v) && self.state.is_free(v) && self.state.activity.take_awake(v) {
                    self.smooth_vertex(v);
                }
            }
        }
        Ok(())
    }

    /// Mean of the places at which each edge of a vertex would be one element long.
    fn target(&self, v: u32) -> Vec3 {
        let m = &self.state.mesh;
        let x = m.at(v);
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for w in m.neighbours(v) {
            let l = self.length(v, w).max(SHORTEST_PULL);
            sum = add(sum, add_scaled(m.at(w), sub(x, m.at(w)), 1.0 / l));
            count += 1.0;
        }
        if count > 0.0 { scale(sum, 1.0 / count) } else { x }
    }

    fn smooth_vertex(&mut self, v: u32) {
        let p = self.state.mesh.at(v);
        let normal = self.state.star_normal(v);
        let step = tangential(sub(self.target(v), p), normal);
        let before = self.star_shape(v);
        let mut sag = self.state.sag_limit(v, normal);
        for share in [1.0, 0.5, 0.2] {
            let foot = self.state.project_near(v, add(p, scale(step, share)));
            if self.state.star_at(v, foot.position, normal).is_none() || self.state.input.is_on_boundary(&foot) {
                continue;
            }
            let t = &self.tensors[v as usize];
            let m = &self.state.mesh;
            let after = m.around(v).map(|h| shape_in(t, [foot.position, m.at(m.to(h)), m.at(m.apex(h))])).fold(1.0, f64::min);
            if (after >= 0.4 || after >= before) && self.state.keeps_limit(v, foot.position, &mut sag) {
                self.state.place(v, &foot);
                self.renew(v);
                return;
            }
        }
    }
}
