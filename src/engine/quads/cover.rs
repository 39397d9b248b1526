//! A triangulated surface whose vertices are exchanged: new points are put into its faces, edges are flipped, and the old vertices that
//! are not on curves are collapsed away. Every step keeps the topology.

use super::front::FrontPoint;
use super::mixed::{Mixed, NONE};
use crate::error::Result;
use crate::topology::Topology;
use crate::vector::{Vec2, Vec3, add, angle_between, area_vector_twice, dot, kappa, sub, unit};
use crate::work::Work;
use robust::{Coord, orient2d};

/// Least cosine between a face and those it replaces.
const TURN: f64 = 0.5;
/// Passes over the old vertices.
const PASSES: usize = 4;
/// Coordinates of new points in their face keep this far from its edges.
const INSIDE: f64 = 1e-3;

struct Cover {
    position: Vec<Vec3>,
    /// Face of the input below each vertex.
    below: Vec<u32>,
    tri: Vec<[u32; 3]>,
    /// Neighbour across the edge opposite each corner.
    adj: Vec<[u32; 3]>,
    /// Whether the edge opposite each corner stays.
    fixed: Vec<[bool; 3]>,
    label: Vec<[u32; 2]>,
    /// A face of each vertex.
    face_of: Vec<u32>,
}

fn next(k: usize) -> usize {
    (k + 1) % 3
}

fn previous(k: usize) -> usize {
    (k + 2) % 3
}

impl Cover {
    fn new(mesh: &Mixed) -> Result<Cover> {
        let tri: Vec<[u32; 3]> = mesh.faces.iter().map(|f| [f[0], f[1], f[2]]).collect();
        let topology = Topology::build(&tri, mesh.position.len())?;
        let mut face_of = vec![NONE; mesh.position.len()];
        let (mut adj, mut fixed) = (Vec::with_capacity(tri.len()), Vec::with_capacity(tri.len()));
        for (f, t) in tri.iter().enumerate() {
            t.iter().for_each(|&v| face_of[v as usize] = f as u32);
            let across = |k: usize| topology.twin((3 * f + next(k)) as u32).map_or(NONE, |h| topology.face(h));
            let near = [across(0), across(1), across(2)];
            adj.push(near);
            fixed.push([0, 1, 2].map(|k| {
                let g = near[k];
                g == NONE || mesh.label[g as usize][1] != mesh.label[f][1] || mesh.is_curve(t[next(k)], t[previous(k)])
            }));
        }
        let (position, below, label) = (mesh.position.clone(), mesh.below.clone(), mesh.label.clone());
        Ok(Cover { position, below, tri, adj, fixed, label, face_of })
    }

    fn corner(&self, f: u32, v: u32) -> usize {
        let t = &self.tri[f as usize];
        if t[1] == v {
            1
        } else if t[2] == v {
            2
        } else {
            0
        }
    }

    /// Edge of `f` that starts at `a`: the one opposite the corner before.
    fn edge(&self, f: u32, a: u32) -> usize {
        previous(self.corner(f, a))
    }

    fn points(&self, t: [u32; 3]) -> [Vec3; 3] {
        t.map(|v| self.position[v as usize])
    }

    fn area(&self, t: [u32; 3]) -> Vec3 {
        let [a, b, c] = self.points(t);
        area_vector_twice(a, b, c)
    }

    /// Faces around a vertex, in no promised order.
    fn star(&self, v: u32, out: &mut Vec<u32>) {
        out.clear();
        let first = self.face_of[v as usize];
        let mut f = first;
        while f != NONE {
            out.push(f);
            f = self.adj[f as usize][next(self.corner(f, v))];
            if f == first {
                return;
            }
        }
        if first == NONE {
            return;
        }
        f = self.adj[first as usize][previous(self.corner(first, v))];
        while f != NONE {
            out.push(f);
            f = self.adj[f as usize][previous(self.corner(f, v))];
        }
    }

    fn are_joined(&self, a: u32, b: u32, scratch: &mut Vec<u32>) -> bool {
        self.star(a, scratch);
        scratch.iter().any(|&f| self.tri[f as usize].contains(&b))
    }

    /// Makes `f` across its edge `k` and `g` across its edge from `a` neighbours.
    fn link(&mut self, f: u32, k: usize, g: u32, a: u32, fixed: bool) {
        self.adj[f as usize][k] = g;
        self.fixed[f as usize][k] = fixed;
        if g != NONE {
            let j = self.edge(g, a);
            self.adj[g as usize][j] = f;
            self.fixed[g as usize][j] = fixed;
        }
    }

    /// Puts a vertex into a face, which becomes three; the new two come last.
    fn split(&mut self, f: u32, position: Vec3, below: u32) -> u32 {
        let v = self.position.len() as u32;
        self.position.push(position);
        self.below.push(below);
        self.face_of.push(f);
        let ([a, b, c], adj, fixed) = (self.tri[f as usize], self.adj[f as usize], self.fixed[f as usize]);
        let (g, h) = (self.tri.len() as u32, self.tri.len() as u32 + 1);
        self.tri[f as usize] = [a, b, v];
        self.tri.extend([[b, c, v], [c, a, v]]);
        self.adj[f as usize] = [g, h, NONE];
        self.adj.extend([[h, f, NONE], [f, g, NONE]]);
        self.fixed[f as usize] = [false; 3];
        self.fixed.extend([[false; 3]; 2]);
        let label = self.label[f as usize];
        self.label.extend([label; 2]);
        self.link(f, 2, adj[2], b, fixed[2]);
        self.link(g, 2, adj[0], c, fixed[0]);
        self.link(h, 2, adj[1], a, fixed[1]);
        (self.face_of[a as usize], self.face_of[b as usize], self.face_of[c as usize]) = (f, f, g);
        v
    }

    /// Puts the points of a face into it; one that falls on another is left out.
    fn put_in(&mut self, face: u32, points: &[FrontPoint]) {
        let corners = self.tri[face as usize];
        let below = self.below[corners[0] as usize];
        let mut place: Vec<(u32, Vec2)> = vec![(corners[0], [0.0, 0.0]), (corners[1], [1.0, 0.0]), (corners[2], [0.0, 1.0])];
        let mut parts = vec![face];
        for point in points {
            let w = point.weights.map(|x| x.max(INSIDE));
            let sum = w[0] + w[1] + w[2];
            let at = [w[1] / sum, w[2] / sum];
            let coord = |p: Vec2| Coord { x: p[0], y: p[1] };
            let of = |v: u32| coord(place.iter().find(|p| p.0 == v).map_or([0.0; 2], |p| p.1));
            let least = |f: u32| {
                let [a, b, c] = self.tri[f as usize].map(of);
                let p = coord(at);
                orient2d(a, b, p).min(orient2d(b, c, p)).min(orient2d(c, a, p))
            };
            let best = parts.iter().copied().max_by(|&f, &g| least(f).total_cmp(&least(g)));
            if let Some(part) = best.filter(|&f| least(f) > 0.0) {
                let v = self.split(part, point.position, below);
                place.push((v, at));
                parts.extend([self.tri.len() as u32 - 2, self.tri.len() as u32 - 1]);
            }
        }
    }

    /// Whether the sum of the angles opposite edge `k` of `f` says flip, and the flip is allowed.
    fn should_flip(&self, f: u32, k: usize, scratch: &mut Vec<u32>) -> bool {
        let g = self.adj[f as usize][k];
        if g == NONE || self.fixed[f as usize][k] {
            return false;
        }
        let (p, a, b) = (self.tri[f as usize][k], self.tri[f as usize][next(k)], self.tri[f as usize][previous(k)]);
        let q = self.tri[g as usize][self.edge(g, b)];
        let [x, y, z, w] = [p, a, b, q].map(|v| self.position[v as usize]);
        let sum = angle_between(sub(y, x), sub(z, x)) + angle_between(sub(y, w), sub(z, w));
        if sum <= std::f64::consts::PI + 1e-6 || p == q {
            return false;
        }
        let mean = unit(add(self.area([p, a, b]), self.area([q, b, a])));
        [[p, a, q], [p, q, b]].iter().all(|&t| dot(unit(self.area(t)), mean) > TURN) && !self.are_joined(p, q, scratch)
    }

    fn flip(&mut self, f: u32, k: usize) -> u32 {
        let g = self.adj[f as usize][k];
        let (p, a, b) = (self.tri[f as usize][k], self.tri[f as usize][next(k)], self.tri[f as usize][previous(k)]);
        let j = self.edge(g, b);
        let q = self.tri[g as usize][j];
        let side = |s: &Cover, f: u32, k: usize| (s.adj[f as usize][k], s.fixed[f as usize][k]);
        let (bp, pa) = (side(self, f, next(k)), side(self, f, previous(k)));
        // In g the corners after q are b and a.
        let (aq, qb) = (side(self, g, next(j)), side(self, g, previous(j)));
        self.tri[f as usize] = [p, a, q];
        self.tri[g as usize] = [p, q, b];
        self.adj[f as usize] = [NONE, g, NONE];
        self.adj[g as usize] = [NONE, NONE, f];
        self.fixed[f as usize] = [false; 3];
        self.fixed[g as usize] = [false; 3];
        self.link(f, 0, aq.0, q, aq.1);
        self.link(f, 2, pa.0, a, pa.1);
        self.link(g, 0, qb.0, b, qb.1);
        self.link(g, 1, bp.0, p, bp.1);
        (self.face_of[p as usize], self.face_of[a as usize]) = (f, f);
        (self.face_of[q as usize], self.face_of[b as usize]) = (g, g);
        g
    }

    /// Flips from the listed faces on until nothing is to flip (or far too often: on curved surfaces it may never end).
    fn flip_from(&mut self, stack: &mut Vec<u32>, scratch: &mut Vec<u32>) {
        let mut budget = 20 * stack.len() + 200;
        while let Some(f) = stack.pop() {
            if self.tri[f as usize][0] == NONE {
                continue;
            }
            for k in 0..3 {
                if self.should_flip(f, k, scratch) {
                    let g = self.flip(f, k);
                    stack.extend([f, g]);
                    budget -= 1;
                    break;
                }
            }
            if budget == 0 {
                stack.clear();
            }
        }
    }

    /// Worst face around `v` after it went to its neighbour `w`, -1 if one looks another way.
    fn after_collapse(&self, v: u32, w: u32, star: &[u32], mean: Vec3) -> f64 {
        let mut least = 1.0f64;
        for &f in star {
            let t = self.tri[f as usize];
            if !t.contains(&w) {
                let new = t.map(|x| if x == v { w } else { x });
                let [a, b, c] = self.points(new);
                let is_upright = dot(unit(area_vector_twice(a, b, c)), mean) > TURN;
                least = least.min(if is_upright { kappa(a, b, c) } else { -1.0 });
            }
        }
        least
    }

    /// Collapses a vertex off curves into the neighbour that leaves the best faces; whether one allowed it.
    fn remove(&mut self, v: u32, star: &mut Vec<u32>, scratch: &mut Vec<u32>) -> bool {
        self.star(v, star);
        let mut ring: Vec<u32> = star.iter().flat_map(|&f| self.tri[f as usize]).filter(|&w| w != v).collect();
        ring.sort_unstable();
        ring.dedup();
        // The fan of a vertex off curves is closed: as many neighbours as faces.
        if ring.len() != star.len() || ring.len() < 3 {
            return false;
        }
        let mean = unit(star.iter().fold([0.0; 3], |s, &f| add(s, self.area(self.tri[f as usize]))));
        let mut best: Option<(f64, u32)> = None;
        for &w in &ring {
            let least = self.after_collapse(v, w, star, mean);
            if least <= 1e-4 || best.is_some_and(|b| b.0 >= least) {
                continue;
            }
            // Common neighbours: only the two beside the edge.
            self.star(w, scratch);
            let corners = scratch.iter().flat_map(|&f| self.tri[f as usize]);
            let mut common: Vec<u32> = corners.filter(|&x| x != w && x != v && ring.binary_search(&x).is_ok()).collect();
            common.sort_unstable();
            common.dedup();
            if common.len() == 2 {
                best = Some((least, w));
            }
        }
        let Some((_, w)) = best else { return false };
        self.collapse(v, w, star);
        let mut stack: Vec<u32> = star.iter().copied().filter(|&f| self.tri[f as usize][0] != NONE).collect();
        self.flip_from(&mut stack, scratch);
        true
    }

    fn collapse(&mut self, v: u32, w: u32, star: &[u32]) {
        let mut joins = Vec::new();
        for &f in star.iter().filter(|&&f| self.tri[f as usize].contains(&w)) {
            let (kv, kw) = (self.corner(f, v), self.corner(f, w));
            let x = self.tri[f as usize][3 - kv - kw];
            // Opposite v is the edge of w and x, opposite w that of v and x.
            joins.push((f, self.adj[f as usize][kv], self.adj[f as usize][kw], self.fixed[f as usize][kv], x));
        }
        for &f in star {
            let k = self.corner(f, v);
            self.tri[f as usize][k] = w;
        }
        for &(f, ..) in &joins {
            self.tri[f as usize] = [NONE; 3];
        }
        for (_, outer, inner, fixed, x) in joins {
            for (f, g) in [(inner, outer), (outer, inner)] {
                if f != NONE {
                    let t = self.tri[f as usize];
                    let k = (0..3).find(|&k| t[k] != w && t[k] != x).unwrap_or(0);
                    self.adj[f as usize][k] = g;
                    self.fixed[f as usize][k] = fixed;
                }
            }
            (self.face_of[x as usize], self.face_of[w as usize]) = (inner, inner);
        }
        self.face_of[v as usize] = NONE;
    }
}

/// Gives the surface the listed points for vertices, besides those on curves. Old vertices whose removal would break the surface stay.
pub(super) fn exchange(mesh: &mut Mixed, points: &[FrontPoint], work: &Work<'_>) -> Result<()> {
    let mut cover = Cover::new(mesh)?;
    let old = mesh.position.len() as u32;
    let mut sorted = points.to_vec();
    sorted.sort_by_key(|p| p.face);
    for group in sorted.chunk_by(|a, b| a.face == b.face) {
        cover.put_in(group[0].face, group);
    }
    work.check()?;
    let (mut star, mut scratch) = (Vec::new(), Vec::new());
    let mut stack: Vec<u32> = (0..cover.tri.len() as u32).collect();
    cover.flip_from(&mut stack, &mut scratch);
    let mut left: Vec<u32> = (0..old).filter(|&v| !mesh.is_fixed[v as usize] && cover.face_of[v as usize] != NONE).collect();
    for _ in 0..PASSES {
        work.check()?;
        left.retain(|&v| !cover.remove(v, &mut star, &mut scratch));
    }
    let alive: Vec<usize> = (0..cover.tri.len()).filter(|&f| cover.tri[f][0] != NONE).collect();
    mesh.label = alive.iter().map(|&f| cover.label[f]).collect();
    mesh.faces = alive.iter().map(|&f| cover.tri[f]).map(|[a, b, c]| [a, b, c, NONE]).collect();
    (mesh.position, mesh.below) = (cover.position, cover.below);
    mesh.is_fixed.resize(mesh.position.len(), false);
    mesh.index();
    Ok(())
}
