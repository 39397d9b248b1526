//! The mutable halfedge triangulation the optimisation works on: connectivity and the three local operations. Knows no quality.

use crate::assemble::{Assembled, VertexClass};
use crate::error::Result;
use crate::topology::Topology;
use crate::vector::{Vec3, area_vector_twice};

/// "No halfedge", "no face": only inside this module's arrays.
pub(super) const NONE: u32 = u32::MAX;

/// Halfedge `3 f + k` runs from corner `k` of face `f` to corner `k + 1`. Removed faces and vertices stay as holes until
/// [`Kernel::faces_left`] gathers the rest.
#[derive(Debug, Clone, Default)]
pub(super) struct Kernel {
    /// Vertex each halfedge leaves; [`NONE`] in removed faces.
    origin: Vec<u32>,
    twin: Vec<u32>,
    /// Whether the edge lies on a curve that has to stay.
    on_curve: Vec<bool>,
    /// A halfedge that leaves the vertex, the boundary one if there is one; [`NONE`] for removed vertices.
    outgoing: Vec<u32>,
    pub(super) position: Vec<Vec3>,
    pub(super) class: Vec<VertexClass>,
    /// Patch and region of each face.
    pub(super) label: Vec<[u32; 2]>,
    /// Marks of [`Kernel::can_collapse`].
    stamp: Vec<u32>,
    clock: u32,
}

/// Next halfedge in the face.
#[inline]
pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// Previous halfedge in the face.
#[inline]
pub(super) fn prev(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl Kernel {
    /// # Errors
    /// Those of [`Topology::build`] for triangles that are not manifold.
    pub(super) fn new(mesh: &Assembled) -> Result<Kernel> {
        let topology = Topology::build(&mesh.triangles, mesh.positions.len())?;
        let count = topology.halfedge_count() as u32;
        let mut kernel = Kernel {
            origin: mesh.triangles.as_flattened().to_vec(),
            twin: (0..count).map(|h| topology.twin(h).unwrap_or(NONE)).collect(),
            on_curve: vec![false; count as usize],
            outgoing: (0..mesh.positions.len() as u32).map(|v| topology.outgoing(v).next().unwrap_or(NONE)).collect(),
            position: mesh.positions.clone(),
            class: mesh.vertex_class.clone(),
            label: mesh.face_patch.iter().zip(&mesh.face_region).map(|(p, r)| [*p, *r]).collect(),
            stamp: vec![0; mesh.positions.len()],
            clock: 0,
        };
        for h in 0..count {
            let (a, b) = (kernel.from(h), kernel.to(h));
            let key = [a.min(b), a.max(b)];
            kernel.on_curve[h as usize] = kernel.is_boundary(h) || mesh.curve_edges.binary_search(&key).is_ok();
        }
        Ok(kernel)
    }

    pub(super) fn face_slots(&self) -> u32 {
        self.origin.len() as u32 / 3
    }

    pub(super) fn vertex_slots(&self) -> u32 {
        self.outgoing.len() as u32
    }

    #[inline]
    pub(super) fn is_face(&self, f: u32) -> bool {
        self.origin[3 * f as usize] != NONE
    }

    #[inline]
    pub(super) fn is_vertex(&self, v: u32) -> bool {
        self.outgoing[v as usize] != NONE
    }

    #[inline]
    pub(super) fn from(&self, h: u32) -> u32 {
        self.origin[h as usize]
    }

    #[inline]
    pub(super) fn to(&self, h: u32) -> u32 {
        self.origin[next(h) as usize]
    }

    /// Corner opposite the halfedge in its face.
    #[inline]
    pub(super) fn apex(&self, h: u32) -> u32 {
        self.origin[prev(h) as usize]
    }

    #[inline]
    pub(super) fn twin(&self, h: u32) -> Option<u32> {
        let t = self.twin[h as usize];
        (t != NONE).then_some(t)
    }

    #[inline]
    pub(super) fn is_boundary(&self, h: u32) -> bool {
        self.twin[h as usize] == NONE
    }

    #[inline]
    pub(super) fn is_on_curve(&self, h: u32) -> bool {
        self.on_curve[h as usize]
    }

    #[inline]
    pub(super) fn is_boundary_vertex(&self, v: u32) -> bool {
        self.is_boundary(self.outgoing[v as usize])
    }

    #[inline]
    pub(super) fn corners(&self, f: u32) -> [u32; 3] {
        let f = 3 * f as usize;
        [self.origin[f], self.origin[f + 1], self.origin[f + 2]]
    }

    #[inline]
    pub(super) fn points(&self, f: u32) -> [Vec3; 3] {
        self.corners(f).map(|v| self.position[v as usize])
    }

    #[inline]
    pub(super) fn at(&self, v: u32) -> Vec3 {
        self.position[v as usize]
    }

    /// Twice the area vector of a face.
    #[inline]
    pub(super) fn area_vector(&self, f: u32) -> Vec3 {
        let [a, b, c] = self.points(f);
        area_vector_twice(a, b, c)
    }

    /// Halfedges that leave a vertex, counter-clockwise, from the boundary if there is one.
    #[inline]
    pub(super) fn around(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.outgoing[v as usize];
        let mut at = first;
        std::iter::from_fn(move || {
            if at == NONE {
                return None;
            }
            let h = at;
            at = self.twin[prev(h) as usize];
            if at == first {
                at = NONE;
            }
            Some(h)
        })
    }

    /// The neighbours of a vertex; on the boundary also the last one, which no outgoing halfedge reaches.
    pub(super) fn neighbours(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let last = self.outgoing[v as usize];
        let open = last != NONE && self.is_boundary(last);
        let mut far = None;
        let mut ring = self.around(v);
        std::iter::from_fn(move || match ring.next() {
            Some(h) => {
                far = Some(self.apex(h));
                Some(self.to(h))
            }
            None if open => far.take(),
            None => None,
        })
    }

    /// Number of edges at a vertex.
    pub(super) fn valence(&self, v: u32) -> u32 {
        self.around(v).count() as u32 + u32::from(self.is_boundary_vertex(v))
    }

    /// Halfedge from `a` to `b`, if it has a face.
    pub(super) fn find(&self, a: u32, b: u32) -> Option<u32> {
        self.around(a).find(|&h| self.to(h) == b)
    }

    /// Whether an edge (of either direction) joins two vertices.
    pub(super) fn are_joined(&self, a: u32, b: u32) -> bool {
        self.find(a, b).is_some() || self.find(b, a).is_some()
    }

    fn set(&mut self, h: u32, origin: u32, twin: u32, on_curve: bool) {
        self.origin[h as usize] = origin;
        self.on_curve[h as usize] = on_curve;
        self.twin[h as usize] = twin;
        if twin != NONE {
            self.twin[twin as usize] = h;
        }
    }

    /// Whether the edge may be flipped as far as connectivity goes: not on a curve, and its other diagonal is not an edge.
    pub(super) fn can_flip(&self, h: u32) -> bool {
        match self.twin(h) {
            Some(t) if !self.is_on_curve(h) => {
                let (c, d) = (self.apex(h), self.apex(t));
                c != d && !self.are_joined(c, d)
            }
            _ => false,
        }
    }

    /// Flips an inner edge: `h` from `a` to `b` becomes the halfedge from the far apex to the near one.
    pub(super) fn flip(&mut self, h: u32) {
        let t = self.twin[h as usize];
        let (h1, h2, t1, t2) = (next(h), prev(h), next(t), prev(t));
        let (a, b, c, d) = (self.from(h), self.from(t), self.from(h2), self.from(t2));
        let outer = [h1, h2, t1, t2].map(|x| (self.twin[x as usize], self.on_curve[x as usize]));
        self.set(h, d, t, false);
        self.set(h1, c, outer[1].0, outer[1].1);
        self.set(h2, a, outer[2].0, outer[2].1);
        self.set(t, c, h, false);
        self.set(t1, d, outer[3].0, outer[3].1);
        self.set(t2, b, outer[0].0, outer[0].1);
        for (vertex, old, new) in [(a, [h, t1], h2), (b, [t, h1], t2), (c, [h2, h2], h1), (d, [t2, t2], t1)] {
            if old.contains(&self.outgoing[vertex as usize]) {
                self.outgoing[vertex as usize] = new;
            }
        }
    }

    /// Whether an edge stays as it is: a boundary edge between locked vertices.
    pub(super) fn is_locked(&self, h: u32) -> bool {
        let ends = [self.from(h), self.to(h)];
        self.is_boundary(h) && ends.iter().all(|&v| self.class[v as usize] == VertexClass::Locked)
    }

    /// Splits the edge of `h` at a new vertex, which is returned; its class is that of the edge.
    pub(super) fn split(&mut self, h: u32, at: Vec3) -> u32 {
        let m = self.outgoing.len() as u32;
        let curve = self.is_on_curve(h);
        self.position.push(at);
        self.class.push(if curve { VertexClass::Curve } else { VertexClass::Free });
        self.stamp.push(0);
        let t = self.twin[h as usize];
        let g = self.split_face(h, m);
        self.outgoing.push(g);
        if t == NONE {
            return m;
        }
        // The far side: `t` keeps its face and now leaves `m`; the new face takes the part at `b`.
        let b = self.from(t);
        let (d, t2) = (self.apex(t), prev(t));
        let (outer, outer_curve) = (self.twin[t2 as usize], self.on_curve[t2 as usize]);
        let k = self.push_face(t / 3);
        self.set(t, m, h, curve);
        self.set(k, b, g, curve);
        self.set(k + 1, m, t2, false);
        self.set(k + 2, d, outer, outer_curve);
        self.on_curve[t2 as usize] = false;
        for (vertex, old, new) in [(b, t, k), (d, t2, k + 2)] {
            if self.outgoing[vertex as usize] == old {
                self.outgoing[vertex as usize] = new;
            }
        }
        m
    }

    /// Cuts the face of `h` from `m` on its edge to the apex; returns the halfedge from `m` to the end of the edge.
    fn split_face(&mut self, h: u32, m: u32) -> u32 {
        let h1 = next(h);
        let (b, c) = (self.from(h1), self.apex(h));
        let (outer, outer_curve) = (self.twin[h1 as usize], self.on_curve[h1 as usize]);
        let g = self.push_face(h / 3);
        self.set(g, m, NONE, self.is_on_curve(h));
        self.set(g + 1, b, outer, outer_curve);
        self.set(g + 2, c, h1, false);
        self.origin[h1 as usize] = m;
        self.on_curve[h1 as usize] = false;
        if self.outgoing[b as usize] == h1 {
            self.outgoing[b as usize] = g + 1;
        }
        g
    }

    fn push_face(&mut self, like: u32) -> u32 {
        let g = self.origin.len() as u32;
        for _ in 0..3 {
            self.origin.push(NONE);
            self.twin.push(NONE);
            self.on_curve.push(false);
        }
        self.label.push(self.label[like as usize]);
        g
    }

    /// Whether the vertex `h` leaves may be merged into the one it reaches: link condition, and curves and boundary stay.
    pub(super) fn can_collapse(&mut self, h: u32) -> bool {
        let (a, b) = (self.from(h), self.to(h));
        match self.class[a as usize] {
            VertexClass::Corner | VertexClass::Locked => return false,
            VertexClass::Curve if !self.is_on_curve(h) => return false,
            _ => {}
        }
        if self.is_boundary_vertex(a) && !self.is_boundary(h) {
            return false;
        }
        let t = self.twin(h);
        for side in [Some(h), t].into_iter().flatten() {
            let c = self.apex(side);
            let left = if self.is_boundary_vertex(c) { 2 } else { 3 };
            // A boundary vertex must not lose its last face, nor two curve edges become one, unless the vertex that goes is one of
            // the curve between them: then its face is the sliver between two curves.
            let merges = self.is_on_curve(next(side)) && self.is_on_curve(prev(side));
            let sliver = self.is_on_curve(h) && !self.is_boundary_vertex(a);
            if self.valence(c) <= left || (merges && !sliver) {
                return false;
            }
        }
        self.clock += 1;
        for v in self.neighbours(a).collect::<Vec<_>>() {
            self.stamp[v as usize] = self.clock;
        }
        let common = self.neighbours(b).filter(|v| self.stamp[*v as usize] == self.clock).count();
        common == 1 + usize::from(t.is_some())
    }

    /// Merges the vertex `h` leaves into the one it reaches. Only after [`Kernel::can_collapse`].
    pub(super) fn collapse(&mut self, h: u32) {
        let (a, b, t) = (self.from(h), self.to(h), self.twin[h as usize]);
        let ring: Vec<u32> = self.around(a).collect();
        for g in ring {
            self.origin[g as usize] = b;
        }
        let mut leaving = NONE;
        for side in [h, t] {
            if side != NONE {
                leaving = self.close_face(side);
            }
        }
        self.outgoing[a as usize] = NONE;
        // The boundary halfedge, if there is one, is the last when turning clockwise.
        self.outgoing[b as usize] = leaving;
        let mut at = leaving;
        loop {
            let t = self.twin[at as usize];
            if t == NONE {
                self.outgoing[b as usize] = at;
                break;
            }
            at = next(t);
            if at == leaving {
                break;
            }
        }
    }

    /// Removes the face of `side`, an edge that has shrunk to a vertex, and joins its other two edges; returns a halfedge that leaves
    /// that vertex.
    fn close_face(&mut self, side: u32) -> u32 {
        let (x, y) = (next(side), prev(side));
        let apex = self.from(y);
        // `p` leaves the apex, `q` the vertex; on the boundary one of them is missing.
        let (p, q) = (self.twin[x as usize], self.twin[y as usize]);
        let curve = self.is_on_curve(x) || self.is_on_curve(y);
        for z in [side, x, y] {
            self.origin[z as usize] = NONE;
        }
        for (z, other) in [(p, q), (q, p)] {
            if z != NONE {
                self.twin[z as usize] = other;
                self.on_curve[z as usize] = curve;
            }
        }
        if self.outgoing[apex as usize] == y {
            self.outgoing[apex as usize] = p;
        }
        if q != NONE { q } else { next(p) }
    }

    /// The faces that are left, in order.
    pub(super) fn faces_left(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.face_slots()).filter(|&f| self.is_face(f))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An open square grid with a curve along its first row of inner edges.
    fn grid(n: u32) -> Kernel {
        let mut mesh = Assembled::default();
        for j in 0..=n {
            for i in 0..=n {
                mesh.positions.push([f64::from(i), f64::from(j), 0.0]);
                let rim = i == 0 || j == 0 || i == n || j == n;
                mesh.vertex_class.push(if rim || j == 1 { VertexClass::Curve } else { VertexClass::Free });
            }
        }
        let at = |i: u32, j: u32| j * (n + 1) + i;
        for j in 0..n {
            for i in 0..n {
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh.curve_edges = (0..n).map(|i| [at(i, 1), at(i + 1, 1)]).collect();
        mesh.face_patch = vec![0; mesh.triangles.len()];
        mesh.face_region = mesh.face_patch.clone();
        Kernel::new(&mesh).unwrap()
    }

    /// Twins, marks and remembered halfedges agree, and the surface is a disc.
    fn check(kernel: &Kernel) {
        let mut triangles = Vec::new();
        for f in kernel.faces_left() {
            triangles.push(kernel.corners(f));
            for h in 3 * f..3 * f + 3 {
                if let Some(t) = kernel.twin(h) {
                    assert_eq!((kernel.twin(t), kernel.from(t), kernel.to(t)), (Some(h), kernel.to(h), kernel.from(h)));
                    assert_eq!(kernel.is_on_curve(h), kernel.is_on_curve(t));
                } else {
                    assert!(kernel.is_on_curve(h));
                }
            }
        }
        let topology = Topology::build(&triangles, kernel.vertex_slots() as usize).unwrap();
        assert_eq!(topology.totals(), (1, 0, 1, 1));
        for v in (0..kernel.vertex_slots()).filter(|&v| kernel.is_vertex(v)) {
            let mut ring: Vec<u32> = kernel.around(v).map(|h| h / 3).collect();
            assert!(kernel.around(v).all(|h| kernel.from(h) == v));
            assert_eq!(ring.len(), topology.outgoing(v).count());
            assert_eq!(kernel.is_boundary_vertex(v), topology.is_boundary_vertex(v));
            ring.sort_unstable();
            ring.dedup();
            assert_eq!(kernel.neighbours(v).count() as u32, kernel.valence(v));
            assert_eq!(ring.len() as u32 + u32::from(kernel.is_boundary_vertex(v)), kernel.valence(v));
        }
    }

    #[test]
    fn random_operations_keep_a_disc_with_its_curve() {
        let mut kernel = grid(6);
        let mut state = 12345u64;
        let mut counts = [0; 3];
        for step in 0..600 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let h = (state >> 33) as u32 % (3 * kernel.face_slots());
            if !kernel.is_face(h / 3) {
                continue;
            }
            match (state >> 20) % 3 {
                0 if kernel.can_flip(h) => {
                    counts[0] += 1;
                    kernel.flip(h);
                }
                1 if step < 300 => {
                    counts[1] += 1;
                    kernel.split(h, [0.5; 3]);
                }
                2 if kernel.can_collapse(h) => {
                    counts[2] += 1;
                    kernel.collapse(h);
                }
                _ => {}
            }
            check(&kernel);
        }
        assert!(counts.iter().all(|c| *c > 30), "{counts:?}");
        // The curve still joins the two ends it had (vertices 7 and 13, which are on the boundary).
        let marked = (0..3 * kernel.face_slots()).filter(|&h| kernel.is_face(h / 3) && kernel.is_on_curve(h) && !kernel.is_boundary(h));
        assert!(marked.count() >= 2);
    }
}
