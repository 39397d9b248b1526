//! A smooth field of crosses on a triangulated surface: in every face two directions at right angles, along curves where there are any.

use super::mixed::Mixed;
use crate::error::Result;
use crate::topology::Topology;
use crate::vector::{Vec2, Vec3, area_vector_twice, cross, distance, dot, sub, unit};
use crate::work::Work;
use std::collections::VecDeque;

/// Most sweeps of smoothing.
const SWEEPS: usize = 200;

/// The surface with a plane frame in every face, and in it the cross.
pub(super) struct CrossField {
    pub(super) topology: Topology,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Corners of each face in its own plane: the first at the origin, the second on the first axis.
    pub(super) plane: Vec<[Vec2; 3]>,
    /// Axes of the plane in space.
    axes: Vec<[Vec3; 2]>,
    /// Whether the edge a halfedge is on cannot be crossed.
    pub(super) is_wall: Vec<bool>,
    /// Unit complex number: fourth power of a direction of the cross.
    power: Vec<Vec2>,
}

fn times(a: Vec2, b: Vec2) -> Vec2 {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn direction_of(angle: f64) -> Vec2 {
    [angle.cos(), angle.sin()]
}

impl CrossField {
    /// `mesh` has triangles only.
    pub(super) fn new(mesh: &Mixed, work: &Work<'_>) -> Result<CrossField> {
        let triangles: Vec<[u32; 3]> = mesh.faces.iter().map(|f| [f[0], f[1], f[2]]).collect();
        let topology = Topology::build(&triangles, mesh.position.len())?;
        let (mut plane, mut axes) = (Vec::new(), Vec::new());
        for t in &triangles {
            let [a, b, c] = t.map(|v| mesh.position[v as usize]);
            let normal = unit(area_vector_twice(a, b, c));
            let x = unit(sub(b, a));
            let y = cross(normal, x);
            axes.push([x, y]);
            plane.push([[0.0, 0.0], [distance(a, b), 0.0], [dot(sub(c, a), x), dot(sub(c, a), y)]]);
        }
        let is_wall = (0..topology.halfedge_count() as u32).map(|h| match topology.twin(h) {
            None => true,
            Some(t) => {
                let labels = [h, t].map(|h| mesh.label[topology.face(h) as usize][1]);
                labels[0] != labels[1] || mesh.is_curve(topology.origin(h), topology.target(h))
            }
        });
        let is_wall = is_wall.collect();
        let power = vec![[0.0; 2]; triangles.len()];
        let mut field = CrossField { topology, triangles, plane, axes, is_wall, power };
        let is_given = field.align();
        field.spread(&is_given);
        field.smooth(&is_given, work)?;
        Ok(field)
    }

    /// Angle of a halfedge in the plane of its face.
    fn angle(&self, h: u32) -> f64 {
        let p = &self.plane[self.topology.face(h) as usize];
        let k = h as usize % 3;
        let (a, b) = (p[k], p[(k + 1) % 3]);
        (b[1] - a[1]).atan2(b[0] - a[0])
    }

    /// What is added to an angle in the face of `h` to have it in the face across.
    pub(super) fn turn_across(&self, h: u32, twin: u32) -> f64 {
        self.angle(twin) + std::f64::consts::PI - self.angle(h)
    }

    /// Faces at walls take the direction of the wall.
    fn align(&mut self) -> Vec<bool> {
        let mut is_given = vec![false; self.triangles.len()];
        for (f, given) in is_given.iter_mut().enumerate() {
            let mut sum = [0.0; 2];
            for k in 0..3 {
                let h = (3 * f + k) as u32;
                if self.is_wall[h as usize] {
                    let (a, b) = (self.plane[f][k], self.plane[f][(k + 1) % 3]);
                    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                    let along = direction_of(4.0 * self.angle(h));
                    sum = [sum[0] + length * along[0], sum[1] + length * along[1]];
                }
            }
            let size = sum[0].hypot(sum[1]);
            if size > 0.0 {
                *given = true;
                self.power[f] = [sum[0] / size, sum[1] / size];
            }
        }
        is_given
    }

    /// Copies the crosses from face to face, from the walls inwards; where there is no wall, from the first face.
    fn spread(&mut self, is_given: &[bool]) {
        let count = self.triangles.len();
        let mut seen = is_given.to_vec();
        let mut queue: VecDeque<u32> = (0..count as u32).filter(|&f| is_given[f as usize]).collect();
        let mut next = 0;
        loop {
            while let Some(f) = queue.pop_front() {
                for h in 3 * f..3 * f + 3 {
                    let Some(twin) = self.topology.twin(h).filter(|_| !self.is_wall[h as usize]) else { continue };
                    let g = self.topology.face(twin) as usize;
                    if !seen[g] {
                        seen[g] = true;
                        self.power[g] = times(self.power[f as usize], direction_of(4.0 * self.turn_across(h, twin)));
                        queue.push_back(g as u32);
                    }
                }
            }
            while next < count && seen[next] {
                next += 1;
            }
            if next == count {
                return;
            }
            seen[next] = true;
            self.power[next] = [1.0, 0.0];
            queue.push_back(next as u32);
        }
    }

    fn smooth(&mut self, is_given: &[bool], work: &Work<'_>) -> Result<()> {
        let count = self.topology.halfedge_count() as u32;
        // By halfedge the face across and the turn from there.
        let turns: Vec<Option<(u32, Vec2)>> = (0..count)
            .map(|h| {
                let twin = self.topology.twin(h).filter(|_| !self.is_wall[h as usize])?;
                Some((self.topology.face(twin), direction_of(4.0 * self.turn_across(twin, h))))
            })
            .collect();
        for _ in 0..SWEEPS {
            work.check()?;
            let mut largest = 0.0f64;
            for f in (0..self.triangles.len()).filter(|&f| !is_given[f]) {
                let mut sum = [0.0; 2];
                for (g, turn) in turns[3 * f..3 * f + 3].iter().flatten() {
                    let p = times(self.power[*g as usize], *turn);
                    sum = [sum[0] + p[0], sum[1] + p[1]];
                }
                let size = sum[0].hypot(sum[1]);
                if size > 1e-9 {
                    let new = [sum[0] / size, sum[1] / size];
                    largest = largest.max((new[0] - self.power[f][0]).abs() + (new[1] - self.power[f][1]).abs());
                    self.power[f] = new;
                }
            }
            if largest < 1e-3 {
                break;
            }
        }
        Ok(())
    }

    /// The angle of the cross in the plane of the face, up to quarter turns.
    pub(super) fn cross(&self, f: u32) -> f64 {
        let p = self.power[f as usize];
        p[1].atan2(p[0]) / 4.0
    }

    /// The direction of the cross nearest to an angle.
    pub(super) fn nearest(&self, f: u32, angle: f64) -> f64 {
        let quarter = std::f64::consts::FRAC_PI_2;
        let own = self.cross(f);
        own + ((angle - own) / quarter).round() * quarter
    }

    /// A direction in the plane of a face, in space.
    pub(super) fn in_space(&self, f: u32, angle: f64) -> Vec3 {
        let [x, y] = self.axes[f as usize];
        let d = direction_of(angle);
        std::array::from_fn(|k| d[0] * x[k] + d[1] * y[k])
    }
}
