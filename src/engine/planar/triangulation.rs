//! A triangulation of the plane that grows by insertion: corner tables, fixed edges, Delaunay flips in a metric.

use super::locate::area2;
use super::metric::{Metric, inner};
use crate::vector::Vec2;
use robust::{Coord, orient2d};

pub(super) const NONE: u32 = u32::MAX;

/// Triangles with their neighbours. Edge `k` of a triangle is the one opposite its corner `k`.
#[derive(Default)]
pub(super) struct Triangulation {
    pub(super) uv: Vec<Vec2>,
    /// Metric over squared size at each vertex.
    pub(super) metric: Vec<Metric>,
    pub(super) tri: Vec<[u32; 3]>,
    pub(super) adj: Vec<[u32; 3]>,
    pub(super) fixed: Vec<[bool; 3]>,
}

/// Where a walk ended.
pub(super) enum Found {
    Inside(u32),
    /// On the (not fixed) edge of a triangle.
    OnEdge(u32, usize),
    /// A fixed edge is in the way, or the point is on one or on a vertex.
    Blocked,
}

/// Exact orientation of three points.
pub(super) fn orientation(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let at = |p: Vec2| Coord { x: p[0], y: p[1] };
    orient2d(at(a), at(b), at(c))
}

/// Next corner.
#[inline]
pub(super) fn next(k: usize) -> usize {
    if k == 2 { 0 } else { k + 1 }
}

/// Previous corner.
#[inline]
pub(super) fn previous(k: usize) -> usize {
    if k == 0 { 2 } else { k - 1 }
}

impl Triangulation {
    /// Corner of `t` that is vertex `v`; 0 if there is none.
    #[inline]
    pub(super) fn corner(&self, t: u32, v: u32) -> usize {
        let c = &self.tri[t as usize];
        if c[1] == v {
            1
        } else if c[2] == v {
            2
        } else {
            0
        }
    }

    /// Edge of `t` that borders on `u`.
    #[inline]
    fn edge_to(&self, t: u32, u: u32) -> usize {
        let n = &self.adj[t as usize];
        if n[1] == u {
            1
        } else if n[2] == u {
            2
        } else {
            0
        }
    }

    /// Edge of `t` from `a` to `b`, if it still has it.
    pub(super) fn edge_of(&self, t: u32, a: u32, b: u32) -> Option<usize> {
        let c = &self.tri[t as usize];
        (0..3).find(|&k| c[next(k)] == a && c[previous(k)] == b)
    }

    /// Corner of `u` that `t`, its neighbour, does not have.
    pub(super) fn far_corner(&self, t: u32, u: u32) -> Option<u32> {
        self.tri.get(u as usize).map(|c| c[self.edge_to(u, t)])
    }

    /// Makes the neighbours `a` and `b` of a triangle that closes neighbours of one another; their edge is fixed if `fixed` or already so.
    pub(super) fn join(&mut self, gone: u32, (a, b): (u32, u32), fixed: bool) {
        let side = |s: &Self, t: u32| (t != NONE).then(|| s.edge_to(t, gone));
        let (i, j) = (side(self, a), side(self, b));
        let fixed = fixed || [(a, i), (b, j)].into_iter().any(|(t, k)| k.is_some_and(|k| self.fixed[t as usize][k]));
        for (t, k, other) in [(a, i, b), (b, j, a)] {
            if let Some(k) = k {
                self.adj[t as usize][k] = other;
                self.fixed[t as usize][k] = fixed;
            }
        }
    }

    /// Takes triangles out and renumbers the rest in order.
    pub(super) fn compact(&mut self, dead: &[bool]) {
        let mut number = vec![NONE; self.tri.len()];
        let mut count = 0;
        for (t, is_dead) in dead.iter().enumerate() {
            if !is_dead {
                number[t] = count;
                count += 1;
            }
        }
        for (t, is_dead) in dead.iter().enumerate() {
            if *is_dead {
                continue;
            }
            let at = number[t] as usize;
            self.tri[at] = self.tri[t];
            self.fixed[at] = self.fixed[t];
            self.adj[at] = self.adj[t].map(|u| if u == NONE { NONE } else { number[u as usize] });
        }
        let count = count as usize;
        self.tri.truncate(count);
        self.adj.truncate(count);
        self.fixed.truncate(count);
    }

    /// Takes vertices out that no triangle has; returns the old numbers of those left.
    pub(super) fn drop_vertices(&mut self, gone: &[bool]) -> Vec<u32> {
        let kept: Vec<u32> = (0..self.uv.len() as u32).filter(|&v| !gone[v as usize]).collect();
        let mut number = vec![NONE; self.uv.len()];
        kept.iter().enumerate().for_each(|(i, &v)| number[v as usize] = i as u32);
        self.uv = kept.iter().map(|&v| self.uv[v as usize]).collect();
        self.metric = kept.iter().map(|&v| self.metric[v as usize]).collect();
        self.tri.iter_mut().for_each(|t| *t = t.map(|v| number[v as usize]));
        kept
    }

    pub(super) fn corners(&self, t: u32) -> [Vec2; 3] {
        self.tri[t as usize].map(|v| self.uv[v as usize])
    }

    /// Walks from triangle `t` to the point `p` without crossing fixed edges.
    pub(super) fn walk(&self, p: Vec2, t: u32) -> Found {
        let mut at = t;
        let mut from = NONE;
        for _ in 0..10_000 {
            let c = self.corners(at);
            let mut zero = None;
            let mut zeros = 0;
            let mut out = None;
            for k in 0..3 {
                if self.adj[at as usize][k] == from && from != NONE {
                    continue;
                }
                let side = orientation(c[next(k)], c[previous(k)], p);
                if side < 0.0 {
                    out = Some(k);
                    break;
                }
                if side == 0.0 {
                    zero = Some(k);
                    zeros += 1;
                }
            }
            match (out, zero) {
                (Some(k), _) => {
                    if self.fixed[at as usize][k] || self.adj[at as usize][k] == NONE {
                        return Found::Blocked;
                    }
                    from = at;
                    at = self.adj[at as usize][k];
                }
                (None, Some(k)) => {
                    let usable = zeros == 1 && !self.fixed[at as usize][k] && self.adj[at as usize][k] != NONE;
                    return if usable { Found::OnEdge(at, k) } else { Found::Blocked };
                }
                (None, None) => return Found::Inside(at),
            }
        }
        Found::Blocked
    }

    fn relink(&mut self, t: u32, old: u32, new: u32) {
        if t != NONE {
            let k = self.edge_to(t, old);
            self.adj[t as usize][k] = new;
        }
    }

    /// Inserts a vertex where [`Triangulation::walk`] found it and restores the Delaunay property. Changed triangles go to `touched`.
    pub(super) fn insert(&mut self, p: Vec2, metric: Metric, found: &Found, touched: &mut Vec<u32>) {
        let v = self.uv.len() as u32;
        let mut stack = match *found {
            Found::Blocked => return,
            Found::Inside(t) => self.split_face(t, v),
            Found::OnEdge(t, k) => self.split_edge(t, k, v),
        };
        self.uv.push(p);
        self.metric.push(metric);
        touched.extend(&stack);
        while let Some(t) = stack.pop() {
            let k = self.corner(t, v);
            if self.should_flip(t, k) {
                let u = self.flip(t, k);
                touched.push(u);
                stack.push(u);
                stack.push(t);
            }
        }
    }

    fn split_face(&mut self, t: u32, v: u32) -> Vec<u32> {
        let ([a, b, c], [na, nb, nc], [fa, fb, fc]) = (self.tri[t as usize], self.adj[t as usize], self.fixed[t as usize]);
        let (t1, t2) = (self.tri.len() as u32, self.tri.len() as u32 + 1);
        self.tri[t as usize] = [a, b, v];
        self.adj[t as usize] = [t1, t2, nc];
        self.fixed[t as usize] = [false, false, fc];
        self.tri.push([b, c, v]);
        self.adj.push([t2, t, na]);
        self.fixed.push([false, false, fa]);
        self.tri.push([c, a, v]);
        self.adj.push([t, t1, nb]);
        self.fixed.push([false, false, fb]);
        self.relink(na, t, t1);
        self.relink(nb, t, t2);
        vec![t, t1, t2]
    }

    fn split_edge(&mut self, t: u32, k: usize, v: u32) -> Vec<u32> {
        let u = self.adj[t as usize][k];
        let j = self.edge_to(u, t);
        let (t1, u1) = (self.tri.len() as u32, self.tri.len() as u32 + 1);
        // t = (p, a, b), u = (q, b, a); the vertex goes between a and b.
        let cut = |s: &Triangulation, t: u32, k: usize| {
            let i = t as usize;
            ([k, next(k), previous(k)].map(|c| s.tri[i][c]), [k, next(k), previous(k)].map(|c| (s.adj[i][c], s.fixed[i][c])))
        };
        let ([p, a, b], [_, tb, ta]) = cut(self, t, k);
        let ([q, _, _], [_, ua, ub]) = cut(self, u, j);
        // tb is opposite a, that is edge (b, p); ta opposite b, edge (p, a); ua opposite b in u, edge (a, q); ub edge (q, b).
        self.tri[t as usize] = [p, a, v];
        self.adj[t as usize] = [u1, t1, ta.0];
        self.fixed[t as usize] = [false, false, ta.1];
        self.tri.push([p, v, b]);
        self.adj.push([u, tb.0, t]);
        self.fixed.push([false, tb.1, false]);
        self.tri[u as usize] = [q, b, v];
        self.adj[u as usize] = [t1, u1, ub.0];
        self.fixed[u as usize] = [false, false, ub.1];
        self.tri.push([q, v, a]);
        self.adj.push([t, ua.0, u]);
        self.fixed.push([false, ua.1, false]);
        self.relink(tb.0, t, t1);
        self.relink(ua.0, u, u1);
        vec![t, t1, u, u1]
    }

    /// Whether edge `k` of `t` is not Delaunay in the metric at its four vertices and may be flipped.
    pub(super) fn should_flip(&self, t: u32, k: usize) -> bool {
        let u = self.adj[t as usize][k];
        if u == NONE || self.fixed[t as usize][k] {
            return false;
        }
        let j = self.edge_to(u, t);
        let ids = [self.tri[t as usize][k], self.tri[t as usize][next(k)], self.tri[t as usize][previous(k)], self.tri[u as usize][j]];
        let [p, a, b, q] = ids.map(|v| self.uv[v as usize]);
        let mut m = [0.0; 3];
        for v in ids {
            (0..3).for_each(|i| m[i] += self.metric[v as usize][i]);
        }
        let to = |x: Vec2, y: Vec2| [y[0] - x[0], y[1] - x[1]];
        let at_p = inner(m, to(p, a), to(p, b)) * area2(q, b, a).abs();
        let at_q = inner(m, to(q, a), to(q, b)) * area2(p, a, b).abs();
        let sum = at_p + at_q;
        // Sum of the cotangents opposite the edge, up to a positive factor.
        sum < -1e-12 * (at_p.abs() + at_q.abs()) && orientation(p, a, q) > 0.0 && orientation(p, q, b) > 0.0
    }

    /// Flips edge `k` of `t`; afterwards `t` and the returned triangle share the other diagonal and both have `t`'s old corner `k`.
    pub(super) fn flip(&mut self, t: u32, k: usize) -> u32 {
        let u = self.adj[t as usize][k];
        let j = self.edge_to(u, t);
        let (ti, ui) = (t as usize, u as usize);
        let (p, a, b, q) = (self.tri[ti][k], self.tri[ti][next(k)], self.tri[ti][previous(k)], self.tri[ui][j]);
        let (pa, bp) = ((self.adj[ti][previous(k)], self.fixed[ti][previous(k)]), (self.adj[ti][next(k)], self.fixed[ti][next(k)]));
        // In u = (q, b, a) the edge opposite b is (a, q), opposite a is (q, b).
        let (aq, qb) = ((self.adj[ui][next(j)], self.fixed[ui][next(j)]), (self.adj[ui][previous(j)], self.fixed[ui][previous(j)]));
        self.tri[ti] = [p, a, q];
        self.adj[ti] = [aq.0, u, pa.0];
        self.fixed[ti] = [aq.1, false, pa.1];
        self.tri[ui] = [p, q, b];
        self.adj[ui] = [qb.0, bp.0, t];
        self.fixed[ui] = [qb.1, bp.1, false];
        self.relink(aq.0, u, t);
        self.relink(bp.0, t, u);
        u
    }

    /// Flips until every edge is Delaunay in the metric, or as often as there are six times triangles (a metric that varies has no
    /// exact Delaunay triangulation).
    pub(super) fn flip_all(&mut self) {
        let mut stack = Vec::new();
        let mut budget = 6 * self.tri.len();
        for t in 0..self.tri.len() as u32 {
            for k in 0..3 {
                // Each edge once, from the side of the higher number; what a flip changes goes on the stack.
                let u = self.adj[t as usize][k];
                if u < t && self.should_flip(t, k) {
                    stack.extend([self.flip(t, k), t]);
                    break;
                }
            }
            while let Some(t) = stack.pop() {
                for k in 0..3 {
                    if self.should_flip(t, k) {
                        stack.extend([self.flip(t, k), t]);
                        budget = budget.saturating_sub(1);
                        break;
                    }
                }
                if budget == 0 {
                    return;
                }
            }
        }
    }
}
