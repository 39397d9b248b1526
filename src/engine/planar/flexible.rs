//! A triangle mesh in space that can be changed locally: edge split, edge collapse under the link condition, edge flip.
//! Combinatorial validity never depends on coordinates.

use super::{SurfacePoint, VertexOrigin};
use crate::vector::{Vec2, Vec3, area_vector_twice, dot, kappa};
use std::collections::BTreeSet;

const DEAD: [u32; 3] = [u32::MAX; 3];

/// The mesh; vertices keep their numbers, dead triangles stay in the list.
#[derive(Default)]
pub(super) struct Flexible {
    pub(super) uv: Vec<Vec2>,
    pub(super) positions: Vec<Vec3>,
    pub(super) points: Vec<SurfacePoint>,
    pub(super) origins: Vec<VertexOrigin>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Edges inside the patch that lie on a curve, low vertex first.
    pub(super) creases: BTreeSet<(u32, u32)>,
    /// Triangles of each vertex, filled by [`Flexible::index`].
    pub(super) star: Vec<Vec<u32>>,
}

fn pair(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl Flexible {
    /// Fills the incidence of vertices from the triangles.
    pub(super) fn index(mut self) -> Self {
        self.star = vec![Vec::new(); self.positions.len()];
        for (t, v) in self.triangles.iter().enumerate() {
            v.iter().for_each(|&v| self.star[v as usize].push(t as u32));
        }
        self
    }

    pub(super) fn is_alive(&self, v: u32) -> bool {
        !self.star[v as usize].is_empty()
    }

    /// Triangles along an edge: one on the boundary, else two.
    pub(super) fn along(&self, a: u32, b: u32) -> Vec<u32> {
        self.star[a as usize].iter().copied().filter(|&t| self.triangles[t as usize].contains(&b)).collect()
    }

    /// Neighbours of a vertex, sorted.
    pub(super) fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut all: Vec<u32> = self.star[v as usize].iter().flat_map(|&t| self.triangles[t as usize]).filter(|&w| w != v).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    pub(super) fn is_crease(&self, a: u32, b: u32) -> bool {
        self.creases.contains(&pair(a, b))
    }

    pub(super) fn is_boundary(&self, a: u32, b: u32) -> bool {
        self.along(a, b).len() == 1
    }

    fn opposite(&self, t: u32, a: u32, b: u32) -> u32 {
        let v = self.triangles[t as usize];
        if v[0] != a && v[0] != b {
            v[0]
        } else if v[1] != a && v[1] != b {
            v[1]
        } else {
            v[2]
        }
    }

    pub(super) fn corners(&self, t: u32) -> [Vec3; 3] {
        self.triangles[t as usize].map(|v| self.positions[v as usize])
    }

    pub(super) fn kappa(&self, t: u32) -> f64 {
        let [a, b, c] = self.corners(t);
        kappa(a, b, c)
    }

    pub(super) fn add_vertex(&mut self, uv: Vec2, position: Vec3, point: SurfacePoint, origin: VertexOrigin) -> u32 {
        self.uv.push(uv);
        self.positions.push(position);
        self.points.push(point);
        self.origins.push(origin);
        self.star.push(Vec::new());
        self.positions.len() as u32 - 1
    }

    /// Puts vertex `m` on the edge `a b`.
    pub(super) fn split(&mut self, a: u32, b: u32, m: u32) {
        for t in self.along(a, b) {
            let new = self.triangles.len() as u32;
            let old = self.triangles[t as usize];
            self.triangles[t as usize] = old.map(|v| if v == b { m } else { v });
            self.triangles.push(old.map(|v| if v == a { m } else { v }));
            let apex = self.opposite(new, m, b);
            self.star[b as usize].retain(|&s| s != t);
            self.star[b as usize].push(new);
            self.star[m as usize].extend([t, new]);
            self.star[apex as usize].push(new);
        }
        if self.creases.remove(&pair(a, b)) {
            self.creases.extend([pair(a, m), pair(m, b)]);
        }
    }

    /// Common neighbours of `v` and `w` that are not opposite their edge: what the link condition forbids.
    pub(super) fn obstacles(&self, v: u32, w: u32) -> Vec<u32> {
        let opposite: Vec<u32> = self.along(v, w).into_iter().map(|t| self.opposite(t, v, w)).collect();
        let of_w = self.neighbours(w);
        self.neighbours(v).into_iter().filter(|x| *x != w && of_w.binary_search(x).is_ok() && !opposite.contains(x)).collect()
    }

    /// Triangles of `v` as they would be after its collapse into `w`.
    pub(super) fn after_collapse(&self, v: u32, w: u32) -> impl Iterator<Item = (u32, [Vec3; 3])> + '_ {
        self.star[v as usize]
            .iter()
            .copied()
            .filter(move |&t| !self.triangles[t as usize].contains(&w))
            .map(move |t| (t, self.triangles[t as usize].map(|x| self.positions[if x == v { w } else { x } as usize])))
    }

    /// Moves all of `v` to `w`. The caller has made sure that there are no obstacles.
    pub(super) fn collapse(&mut self, v: u32, w: u32) {
        for x in self.neighbours(v) {
            if self.creases.remove(&pair(v, x)) && x != w {
                self.creases.insert(pair(x, w));
            }
        }
        for t in std::mem::take(&mut self.star[v as usize]) {
            let old = self.triangles[t as usize];
            if old.contains(&w) {
                self.triangles[t as usize] = DEAD;
                old.iter().filter(|&&x| x != v).for_each(|&x| self.star[x as usize].retain(|&s| s != t));
            } else {
                self.triangles[t as usize] = old.map(|x| if x == v { w } else { x });
                self.star[w as usize].push(t);
            }
        }
    }

    /// Flips the edge `a b` if that makes the worse of its two triangles better, bends no more and makes no double edge.
    pub(super) fn flip_if_better(&mut self, a: u32, b: u32) -> bool {
        let along = self.along(a, b);
        let [t, u] = along[..] else { return false };
        if self.is_crease(a, b) {
            return false;
        }
        // Let t run along a b.
        let runs = |t: u32| {
            let v = self.triangles[t as usize];
            (0..3).any(|k| v[k] == a && v[(k + 1) % 3] == b)
        };
        let (t, u) = if runs(t) { (t, u) } else { (u, t) };
        let (p, q) = (self.opposite(t, a, b), self.opposite(u, a, b));
        if p == q || !self.along(p, q).is_empty() {
            return false;
        }
        let at = |v: u32| self.positions[v as usize];
        let shape = |x: [u32; 3]| kappa(at(x[0]), at(x[1]), at(x[2]));
        let normal = |x: [u32; 3]| area_vector_twice(at(x[0]), at(x[1]), at(x[2]));
        let (new_t, new_u) = ([p, a, q], [q, b, p]);
        let before = self.kappa(t).min(self.kappa(u));
        let (n, m) = (normal(self.triangles[t as usize]), normal(self.triangles[u as usize]));
        let whole: Vec3 = std::array::from_fn(|k| n[k] + m[k]);
        let upright = dot(normal(new_t), whole) > 0.0 && dot(normal(new_u), whole) > 0.0;
        if !upright || shape(new_t).min(shape(new_u)) <= before * (1.0 + 1e-9) {
            return false;
        }
        self.triangles[t as usize] = new_t;
        self.triangles[u as usize] = new_u;
        self.star[b as usize].retain(|&s| s != t);
        self.star[a as usize].retain(|&s| s != u);
        self.star[q as usize].push(t);
        self.star[p as usize].push(u);
        true
    }

    /// Flips around a vertex while that helps.
    pub(super) fn relax_around(&mut self, v: u32) {
        for _ in 0..4 {
            let mut edges: Vec<(u32, u32)> = self.star[v as usize]
                .iter()
                .flat_map(|&t| {
                    let x = self.triangles[t as usize];
                    [pair(x[0], x[1]), pair(x[1], x[2]), pair(x[2], x[0])]
                })
                .collect();
            edges.sort_unstable();
            edges.dedup();
            let mut changed = false;
            for (a, b) in edges {
                changed |= self.flip_if_better(a, b);
            }
            if !changed {
                return;
            }
        }
    }

    pub(super) fn is_dead(&self, t: u32) -> bool {
        self.triangles[t as usize] == DEAD
    }
}
