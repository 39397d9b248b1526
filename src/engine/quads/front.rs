//! Points for quadrangles, placed from the front on the surface itself: each point proposes four others at the wanted distance along its
//! cross; one is taken if no other is near in the maximum norm of the cross (after Remacle et al. 2011).

use super::cross::CrossField;
use super::mixed::Mixed;
use crate::bvh::closest_on_triangle;
use crate::error::Result;
use crate::vector::{Vec2, Vec3, dot, sub};
use crate::work::Work;
use std::collections::VecDeque;

/// A new point is at least this far from all others, in sizes, in the maximum norm of its cross.
const LEAST: f64 = 0.7;
/// Directions nearer to a wall than this do not leave it (sine).
const OFF_WALL: f64 = 0.34;
/// Faces a walk may cross.
const MOST_FACES: usize = 200;

/// A point in a face.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontPoint {
    pub(super) face: u32,
    /// Weights of the corners.
    pub(super) weights: [f64; 3],
    pub(super) position: Vec3,
}

struct Front<'a> {
    mesh: &'a Mixed,
    field: &'a CrossField,
    /// Wanted size at the vertices of the mesh.
    sizes: &'a [f64],
    points: Vec<FrontPoint>,
    /// Points in each face.
    inside: Vec<Vec<u32>>,
    seen: Vec<u32>,
    clock: u32,
    queue: VecDeque<u32>,
}

/// Places points; vertices on curves count as placed.
pub(super) fn place_points(mesh: &Mixed, field: &CrossField, sizes: &[f64], work: &Work<'_>) -> Result<Vec<FrontPoint>> {
    let faces = field.triangles.len();
    let mut front = Front {
        mesh,
        field,
        sizes,
        points: Vec::new(),
        inside: vec![Vec::new(); faces],
        seen: vec![0; faces],
        clock: 0,
        queue: VecDeque::new(),
    };
    for v in 0..mesh.position.len() as u32 {
        if mesh.is_fixed[v as usize] {
            front.leave_vertex(v);
        }
    }
    front.drain(work)?;
    // Where nothing has come, because there is no curve or the front could not pass: from the middle of a face.
    for f in 0..faces as u32 {
        if front.try_point(f, [1.0 / 3.0; 3]) {
            front.drain(work)?;
        }
    }
    Ok(front.points)
}

impl Front<'_> {
    fn drain(&mut self, work: &Work<'_>) -> Result<()> {
        let mut rounds = 0usize;
        while let Some(p) = self.queue.pop_front() {
            rounds += 1;
            if rounds.is_multiple_of(256) {
                work.check()?;
            }
            let point = self.points[p as usize];
            let size = self.size_at(point.face, point.weights);
            let at = self.in_plane(point.face, point.weights);
            for k in 0..4 {
                let angle = self.field.cross(point.face) + f64::from(k) * std::f64::consts::FRAC_PI_2;
                self.propose(point.face, at, angle, size);
            }
        }
        Ok(())
    }

    fn size_at(&self, f: u32, w: [f64; 3]) -> f64 {
        let t = self.field.triangles[f as usize];
        (0..3).map(|k| w[k] * self.sizes[t[k] as usize]).sum()
    }

    fn in_plane(&self, f: u32, w: [f64; 3]) -> Vec2 {
        let p = &self.field.plane[f as usize];
        [0, 1].map(|i| (0..3).map(|k| w[k] * p[k][i]).sum())
    }

    /// The proposals of a vertex on a curve: those directions of the crosses around it that lead away from the curve.
    fn leave_vertex(&mut self, v: u32) {
        let (field, mesh) = (self.field, self.mesh);
        let size = self.sizes[v as usize];
        for i in 0..mesh.around[v as usize].len() {
            let f = mesh.around[v as usize][i];
            let k = field.triangles[f as usize].iter().position(|&c| c == v).unwrap_or(0);
            let p = &field.plane[f as usize];
            let to = |j: usize| {
                let d = [p[j][0] - p[k][0], p[j][1] - p[k][1]];
                let l = d[0].hypot(d[1]).max(f64::MIN_POSITIVE);
                [d[0] / l, d[1] / l]
            };
            let (first, second) = (to((k + 1) % 3), to((k + 2) % 3));
            let wall = |j: usize| field.is_wall[3 * f as usize + j];
            for turn in 0..4 {
                let angle = field.cross(f) + f64::from(turn) * std::f64::consts::FRAC_PI_2;
                let d = [angle.cos(), angle.sin()];
                let side = |a: Vec2, b: Vec2| a[0] * b[1] - a[1] * b[0];
                let off = |sine: f64, wall: bool| if wall { sine > OFF_WALL } else { sine >= 0.0 };
                let is_forward = d[0] * (first[0] + second[0]) + d[1] * (first[1] + second[1]) > 0.0;
                if is_forward && off(side(first, d), wall(k)) && off(side(d, second), wall((k + 2) % 3)) {
                    self.propose(f, p[k], angle, size);
                }
            }
        }
    }

    fn propose(&mut self, face: u32, from: Vec2, angle: f64, size: f64) {
        if let Some((f, weights)) = self.walk(face, from, angle, size) {
            self.try_point(f, weights);
        }
    }

    /// Goes a length across faces along the crosses; `None` if a wall is in the way.
    fn walk(&self, face: u32, from: Vec2, angle: f64, length: f64) -> Option<(u32, [f64; 3])> {
        let (mut f, mut at, mut angle, mut left) = (face, from, angle, length);
        let mut entered = None;
        for _ in 0..MOST_FACES {
            let p = &self.field.plane[f as usize];
            let d = [angle.cos(), angle.sin()];
            let mut exit: Option<(f64, usize)> = None;
            for k in (0..3).filter(|k| entered != Some(*k)) {
                let (a, b) = (p[k], p[(k + 1) % 3]);
                let e = [b[0] - a[0], b[1] - a[1]];
                let out = d[0] * e[1] - d[1] * e[0];
                if out > 0.0 {
                    let t = ((a[0] - at[0]) * e[1] - (a[1] - at[1]) * e[0]) / out;
                    if exit.is_none_or(|x| t < x.0) {
                        exit = Some((t.max(0.0), k));
                    }
                }
            }
            let (t, k) = exit?;
            if t >= left {
                return Some((f, weights(p, [at[0] + left * d[0], at[1] + left * d[1]])));
            }
            let h = 3 * f + k as u32;
            if self.field.is_wall[h as usize] {
                return None;
            }
            let twin = self.field.topology.twin(h)?;
            let (a, b) = (p[k], p[(k + 1) % 3]);
            let hit = [at[0] + t * d[0], at[1] + t * d[1]];
            let e = [b[0] - a[0], b[1] - a[1]];
            let share = (((hit[0] - a[0]) * e[0] + (hit[1] - a[1]) * e[1]) / (e[0] * e[0] + e[1] * e[1])).clamp(0.0, 1.0);
            angle += self.field.turn_across(h, twin);
            f = self.field.topology.face(twin);
            let j = twin as usize % 3;
            let q = &self.field.plane[f as usize];
            // The twin runs the other way.
            at = [0, 1].map(|i| q[(j + 1) % 3][i] + share * (q[j][i] - q[(j + 1) % 3][i]));
            angle = self.field.nearest(f, angle);
            entered = Some(j);
            left -= t;
        }
        None
    }

    /// Takes a point if no other is near.
    fn try_point(&mut self, f: u32, w: [f64; 3]) -> bool {
        let corners = self.field.triangles[f as usize].map(|v| self.mesh.position[v as usize]);
        let position: Vec3 = std::array::from_fn(|i| (0..3).map(|k| w[k] * corners[k][i]).sum());
        let size = self.size_at(f, w);
        if !self.is_alone(f, position, size) {
            return false;
        }
        self.inside[f as usize].push(self.points.len() as u32);
        self.queue.push_back(self.points.len() as u32);
        self.points.push(FrontPoint { face: f, weights: w, position });
        true
    }

    fn is_alone(&mut self, f: u32, position: Vec3, size: f64) -> bool {
        let angle = self.field.cross(f);
        let axes = [angle, angle + std::f64::consts::FRAC_PI_2].map(|a| self.field.in_space(f, a));
        let near = |p: Vec3| {
            let d = sub(p, position);
            dot(d, axes[0]).abs().max(dot(d, axes[1]).abs()) < LEAST * size && dot(d, d) < 2.0 * LEAST * LEAST * size * size
        };
        // Faces within reach, without crossing walls: points on the other side of a curve or on another sheet do not count.
        self.clock += 1;
        self.seen[f as usize] = self.clock;
        let mut stack = vec![f];
        while let Some(g) = stack.pop() {
            if self.inside[g as usize].iter().any(|&p| near(self.points[p as usize].position)) {
                return false;
            }
            let t = self.field.triangles[g as usize];
            for (k, &v) in t.iter().enumerate() {
                if self.mesh.is_fixed[v as usize] && near(self.mesh.position[v as usize]) {
                    return false;
                }
                let h = 3 * g + k as u32;
                let Some(twin) = self.field.topology.twin(h).filter(|_| !self.field.is_wall[h as usize]) else { continue };
                let other = self.field.topology.face(twin);
                if self.seen[other as usize] != self.clock && self.touches(other, position, size) {
                    self.seen[other as usize] = self.clock;
                    stack.push(other);
                }
            }
        }
        true
    }

    /// Whether a face comes within a size of a point.
    fn touches(&self, f: u32, p: Vec3, size: f64) -> bool {
        let corners = self.field.triangles[f as usize].map(|v| self.mesh.position[v as usize]);
        let d = sub(closest_on_triangle(p, &corners).0, p);
        dot(d, d) < size * size
    }
}

/// Weights of the corners at a point of the plane, drawn inside.
fn weights(p: &[Vec2; 3], at: Vec2) -> [f64; 3] {
    let area = |a: Vec2, b: Vec2, c: Vec2| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let w = [area(at, p[1], p[2]), area(p[0], at, p[2]), area(p[0], p[1], at)].map(|x| x.max(0.0));
    let sum = w[0] + w[1] + w[2];
    if sum > 0.0 { w.map(|x| x / sum) } else { [1.0 / 3.0; 3] }
}
