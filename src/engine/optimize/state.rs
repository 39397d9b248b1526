//! The mesh under optimisation with the foot of every vertex on the input, and the guarded local operations.

use super::activity::Activity;
use super::input::{Foot, Input, middle};
use super::kernel::{Kernel, next, prev};
use crate::assemble::{Assembled, VertexClass};
use crate::error::Result;
use crate::vector::{Vec3, add, add_scaled, area_vector_twice, cross, distance, dot, kappa, lerp, norm, scale, sub, unit};

/// Least cosine between a face before and after an operation.
const TURN: f64 = 0.3;
/// Least cosine between a face and the normal of the input under its middle, where it is asked for.
const AGREE: f64 = 0.25;
/// Edge midpoints may be this far from the input, in local sizes, without further question.
pub(super) const SAG: f64 = 0.1;
/// Faces of lower kappa have no normal to rely on.
const FLAT: f64 = 0.02;
/// A star with a face whose normal has a lower cosine with that of the whole star is bent.
pub(super) const BENT: f64 = 0.94;
/// Curve vertices may be dropped when the curve moves by no more than this, in local sizes.
const CURVE_SAG: f64 = 0.04;

/// The same on the boundary: the curve mesh has used up most of what the boundary may deviate.
const BOUNDARY_SAG: f64 = 0.01;

/// The same for features beside a face of lower kappa than [`NEEDLE`].
const CURVE_SAG_AT_NEEDLES: f64 = 0.085;
/// Kappa of faces to get rid of even where that moves a feature a little.
const NEEDLE: f64 = 0.3;
/// A vertex that moves by less than this, in local sizes, has come to rest.
const REST: f64 = 0.01;

/// One change of the mesh, by its vertices.
#[derive(Debug, Clone, Copy)]
pub(super) enum Operation {
    /// The edge between two vertices.
    Flip(u32, u32),
    /// The first vertex into the second.
    Collapse(u32, u32),
    /// The edge between two vertices; the new vertex gets the next number.
    Split(u32, u32, Foot),
    /// A vertex to a place.
    Place(u32, Foot),
}

/// What may be done to the vertices and edges of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Curves {
    /// Vertices may slide, go and come within bounds.
    Flexible,
    /// Edges are not split, and no edge is made between two corners: others share them.
    Held,
    /// As `Held` on the boundary, as `Flexible` inside.
    HeldBoundary,
}

/// What is being optimised.
#[derive(Clone)]
pub(super) struct State<'a> {
    pub(super) input: &'a Input<'a>,
    pub(super) mesh: Kernel,
    pub(super) curves: Curves,
    /// Face of the input under each vertex.
    pub(super) foot: Vec<u32>,
    /// Wanted edge length at each vertex.
    pub(super) size: Vec<f64>,
    pub(super) activity: Activity,
    /// What is done, if somebody wants to do it again.
    pub(super) log: Option<Vec<Operation>>,
}

impl<'a> State<'a> {
    /// `curves` says what may be done to curves, `activity` where there is something to do.
    pub(super) fn new(
        input: &'a Input<'a>,
        assembled: &Assembled,
        curves: Curves,
        activity: impl FnOnce(&Kernel) -> Activity,
    ) -> Result<Self> {
        let mesh = Kernel::new(assembled)?;
        let activity = activity(&mesh);
        let mut state = State { input, mesh, curves, foot: assembled.vertex_face.clone(), size: Vec::new(), activity, log: None };
        for v in 0..state.mesh.vertex_slots() {
            let foot = state.input.walk(state.mesh.at(v), state.foot[v as usize]);
            state.foot[v as usize] = foot.face;
            state.size.push(state.input.size(&foot));
        }
        if curves == Curves::Flexible {
            state.release_faint_corners();
        }
        Ok(state)
    }

    /// Sharp turns of features that are hardly visible at the wanted size (ends, junctions and boundary corners stay corners): a
    /// noisy feature has many of them, nearer to each other than elements are long.
    fn release_faint_corners(&mut self) {
        for v in 0..self.mesh.vertex_slots() {
            if !self.mesh.is_vertex(v) || self.mesh.class[v as usize] != VertexClass::Corner || self.mesh.is_boundary_vertex(v) {
                continue;
            }
            if let &[a, b] = self.curve_neighbours(v).as_slice() {
                let off = distance_to_segment(self.mesh.at(v), self.mesh.at(a), self.mesh.at(b));
                if off <= CURVE_SAG_AT_NEEDLES * self.size[v as usize] {
                    self.mesh.class[v as usize] = VertexClass::Curve;
                }
            }
        }
    }

    /// Moves a vertex onto its foot.
    pub(super) fn place(&mut self, v: u32, foot: &Foot) {
        self.note(Operation::Place(v, *foot));
        let i = v as usize;
        let moved = distance(self.mesh.position[i], foot.position);
        self.mesh.position[i] = foot.position;
        self.foot[i] = foot.face;
        self.size[i] = self.input.size(foot);
        if moved > REST * self.size[i] {
            self.activity.mark_changed(v);
            self.wake_star(v);
        }
    }

    fn note(&mut self, operation: Operation) {
        if let Some(log) = &mut self.log {
            log.push(operation);
        }
    }

    pub(super) fn is_free(&self, v: u32) -> bool {
        self.mesh.class[v as usize] == VertexClass::Free
    }

    /// Length of an edge over the wanted one.
    #[inline]
    pub(super) fn ratio(&self, h: u32) -> f64 {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        self.ratio_of(a, b)
    }

    pub(super) fn ratio_of(&self, a: u32, b: u32) -> f64 {
        distance(self.mesh.at(a), self.mesh.at(b)) / (0.5 * (self.size[a as usize] + self.size[b as usize]))
    }

    pub(super) fn kappa(&self, f: u32) -> f64 {
        let [a, b, c] = self.mesh.points(f);
        kappa(a, b, c)
    }

    /// Least kappa of the faces around a vertex.
    pub(super) fn star_kappa(&self, v: u32) -> f64 {
        self.mesh.around(v).map(|h| self.kappa(h / 3)).fold(1.0, f64::min)
    }

    /// Whether the face with these corners, the first of which is near vertex `near`, looks the way of the input.
    fn agrees(&self, near: u32, corners: [Vec3; 3]) -> bool {
        let foot = self.input.walk(middle(corners), self.foot[near as usize]);
        self.input.agrees(area_vector_twice(corners[0], corners[1], corners[2]), &foot, AGREE)
    }

    /// Whether a face that becomes `new` keeps the way it looks. A face too flat to have a normal is compared with the input.
    fn keeps_looking(&self, near: u32, old: [Vec3; 3], new: [Vec3; 3]) -> bool {
        if kappa(old[0], old[1], old[2]) < FLAT {
            return self.agrees(near, new);
        }
        cosine(area_vector_twice(old[0], old[1], old[2]), area_vector_twice(new[0], new[1], new[2])) >= TURN
    }

    /// Gain of flipping an edge: least kappa after and before; `None` if connectivity forbids it or the surface would fold.
    pub(super) fn flip_kappa(&self, h: u32) -> Option<(f64, f64)> {
        let t = self.mesh.twin(h)?;
        if self.mesh.is_on_curve(h) {
            return None;
        }
        let [a, b, c, d] = [self.mesh.from(h), self.mesh.from(t), self.mesh.apex(h), self.mesh.apex(t)].map(|v| self.mesh.at(v));
        let (old, new) = ([[a, b, c], [b, a, d]], [[a, d, c], [d, b, c]]);
        let least = |faces: &[[Vec3; 3]; 2]| faces.iter().map(|f| kappa(f[0], f[1], f[2])).fold(1.0, f64::min);
        Some((least(&new), least(&old)))
    }

    /// Whether the edge cuts off a crest which its other diagonal follows: clearly nearer the input, and of acceptable shape.
    pub(super) fn cuts_a_crest(&self, h: u32, t: u32) -> bool {
        let (m, n) = (self.mesh.area_vector(h / 3), self.mesh.area_vector(t / 3));
        if cosine(m, n) > BENT {
            return false;
        }
        let ends = [self.mesh.from(h), self.mesh.from(t), self.mesh.apex(h), self.mesh.apex(t)];
        let [a, b, c, d] = ends.map(|v| self.mesh.at(v));
        let now = self.sag(ends[0], a, b);
        now > 0.5 * SAG * self.size[ends[0] as usize] && self.sag(ends[2], c, d) < 0.6 * now
    }

    /// Flips an edge if the surface neither folds nor leaves the input.
    pub(super) fn try_flip(&mut self, h: u32) -> bool {
        if !self.mesh.can_flip(h) {
            return false;
        }
        let Some(t) = self.mesh.twin(h) else { return false };
        if self.curves != Curves::Flexible && [self.mesh.apex(h), self.mesh.apex(t)].iter().all(|&v| self.is_corner(v)) {
            return false;
        }
        let ends = [self.mesh.from(h), self.mesh.from(t), self.mesh.apex(h), self.mesh.apex(t)];
        let [a, b, c, d] = ends.map(|v| self.mesh.at(v));
        let (m, n) = (area_vector_twice(a, b, c), area_vector_twice(b, a, d));
        let (p, q) = (area_vector_twice(a, d, c), area_vector_twice(d, b, c));
        let old = add(m, n);
        if cosine(p, old) < TURN || cosine(q, old) < TURN {
            return false;
        }
        let flat = kappa(a, b, c).min(kappa(b, a, d)) < FLAT;
        if flat || cosine(m, n) < 0.97 || cosine(p, q) < 0.97 {
            let then = self.sag(ends[2], c, d);
            if then > SAG * self.size[ends[2] as usize] && then > self.present_sag(ends[0], a, b) {
                return false;
            }
            if !(self.agrees(ends[0], [a, d, c]) && self.agrees(ends[1], [b, c, d])) {
                return false;
            }
        }
        self.flip(h);
        true
    }

    /// Flips an edge, unguarded.
    pub(super) fn flip(&mut self, h: u32) {
        let Some(t) = self.mesh.twin(h) else { return };
        let ends = [self.mesh.from(h), self.mesh.from(t), self.mesh.apex(h), self.mesh.apex(t)];
        self.note(Operation::Flip(ends[0], ends[1]));
        self.mesh.flip(h);
        self.mark_connected(&ends);
    }

    /// Where a split puts its vertex: the foot of the edge's middle, or the middle itself on a curve.
    pub(super) fn middle_foot(&self, h: u32) -> Foot {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let at = lerp(self.mesh.at(a), self.mesh.at(b), 0.5);
        let local = 0.5 * (self.size[a as usize] + self.size[b as usize]);
        let foot = self.input.project(at, self.foot[a as usize], 0.5 * local);
        if self.mesh.is_on_curve(h) { Foot { position: at, ..foot } } else { foot }
    }

    /// The faces a collapse of `h` to `p` leaves around it.
    pub(super) fn faces_after_collapse(&self, h: u32, p: Vec3) -> Vec<[Vec3; 3]> {
        self.collapse_star(h, p).into_iter().map(|(_, new, _)| new).collect()
    }

    /// Splits an edge at its middle (projected, off curves), unless the surface would fold.
    pub(super) fn try_split(&mut self, h: u32) -> Option<u32> {
        let held = match self.curves {
            Curves::Flexible => false,
            Curves::Held => self.mesh.is_on_curve(h),
            Curves::HeldBoundary => self.mesh.is_boundary(h),
        };
        if held || self.mesh.is_locked(h) {
            return None;
        }
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let (pa, pb) = (self.mesh.at(a), self.mesh.at(b));
        let at = lerp(pa, pb, 0.5);
        let foot = self.middle_foot(h);
        let p = foot.position;
        if distance(p, at) > 0.4 * distance(pa, pb) || (!self.mesh.is_on_curve(h) && self.input.is_on_boundary(&foot)) {
            return None;
        }
        for side in [Some(h), self.mesh.twin(h)].into_iter().flatten() {
            let (x, y, z) = (self.mesh.at(self.mesh.from(side)), self.mesh.at(self.mesh.to(side)), self.mesh.at(self.mesh.apex(side)));
            let shape = (0.3 * kappa(x, y, z)).min(0.1);
            let fine = |new: [Vec3; 3]| kappa(new[0], new[1], new[2]) >= shape && self.keeps_looking(a, [x, y, z], new);
            if ![[x, p, z], [p, y, z]].into_iter().all(fine) {
                return None;
            }
            // The new edge to the apex must not cut a crest deeper than the faces it replaces.
            let bent =
                [[x, p, z], [p, y, z]].into_iter().any(|n| cosine(area_vector_twice(n[0], n[1], n[2]), area_vector_twice(x, y, z)) < BENT);
            let local = self.size[a as usize];
            if bent && self.sag(a, p, z) > (SAG * local).max(distance(p, at)) {
                return None;
            }
        }
        Some(self.split_at(h, &foot))
    }

    /// Splits an edge at a foot, unguarded.
    pub(super) fn split_at(&mut self, h: u32, foot: &Foot) -> u32 {
        self.note(Operation::Split(self.mesh.from(h), self.mesh.to(h), *foot));
        let v = self.mesh.split(h, foot.position);
        self.foot.push(foot.face);
        self.size.push(self.input.size(foot));
        self.activity.push();
        let ring: Vec<u32> = self.mesh.neighbours(v).collect();
        self.mark_connected(&ring);
        v
    }

    /// Where the vertex goes when `h` is collapsed into the vertex it reaches.
    pub(super) fn collapse_target(&self, h: u32) -> Option<Foot> {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let (pa, pb) = (self.mesh.at(a), self.mesh.at(b));
        if self.is_free(a) && self.is_free(b) {
            let local = 0.5 * (self.size[a as usize] + self.size[b as usize]);
            return Some(self.input.project(lerp(pa, pb, 0.5), self.foot[b as usize], 0.5 * local));
        }
        Some(self.own_foot(b))
    }

    /// A vertex as its own foot.
    pub(super) fn own_foot(&self, v: u32) -> Foot {
        let walked = self.input.walk(self.mesh.at(v), self.foot[v as usize]);
        Foot { position: self.mesh.at(v), ..walked }
    }

    /// Faces that a collapse of `h` to `p` leaves, as (corner positions before, after, an outer vertex).
    fn collapse_star(&self, h: u32, p: Vec3) -> Vec<([Vec3; 3], [Vec3; 3], u32)> {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let gone = [h / 3, self.mesh.twin(h).map_or(h / 3, |t| t / 3)];
        let mut star = Vec::with_capacity(16);
        for v in [a, b] {
            for g in self.mesh.around(v) {
                if !gone.contains(&(g / 3)) {
                    let (y, z) = (self.mesh.to(g), self.mesh.apex(g));
                    let (py, pz) = (self.mesh.at(y), self.mesh.at(z));
                    star.push(([self.mesh.at(v), py, pz], [p, py, pz], y));
                }
            }
        }
        star
    }

    /// Least kappa after and before a collapse and the longest edge after it over its size.
    pub(super) fn collapse_kappa(&self, h: u32, p: Vec3) -> (f64, f64, f64) {
        let size = self.size[self.mesh.to(h) as usize];
        let mut result = (1f64, self.kappa(h / 3), 0f64);
        if let Some(t) = self.mesh.twin(h) {
            result.1 = result.1.min(self.kappa(t / 3));
        }
        for (old, new, _) in self.collapse_star(h, p) {
            result.0 = result.0.min(kappa(new[0], new[1], new[2]));
            result.1 = result.1.min(kappa(old[0], old[1], old[2]));
            result.2 = result.2.max(distance(new[0], new[1]) / size).max(distance(new[0], new[2]) / size);
        }
        result
    }

    /// Collapses `h` into the vertex it reaches, at `foot`, if topology, curves, normals and the distance to the input allow it.
    pub(super) fn try_collapse(&mut self, h: u32, foot: &Foot) -> bool {
        if !self.mesh.can_collapse(h) || (self.curves != Curves::Flexible && self.may_join_beyond(h)) {
            return false;
        }
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let local = 0.5 * (self.size[a as usize] + self.size[b as usize]);
        let worst = self.kappa(h / 3).min(self.mesh.twin(h).map_or(1.0, |t| self.kappa(t / 3)));
        let allowed = if worst < NEEDLE && !self.mesh.is_boundary_vertex(a) { CURVE_SAG_AT_NEEDLES } else { self.curve_sag(a) };
        if self.mesh.is_on_curve(h) && !self.curve_stays(h, allowed * local) {
            return false;
        }
        let star = self.collapse_star(h, foot.position);
        let mut dropped = f64::INFINITY;
        for (old, new, outer) in &star {
            if !self.keeps_looking(*outer, *old, *new) {
                return false;
            }
            let (m, n) = (area_vector_twice(old[0], old[1], old[2]), area_vector_twice(new[0], new[1], new[2]));
            let c = cosine(m, n);
            let then = self.sag(*outer, new[0], new[1]);
            let too_far = then > SAG * local && then > self.present_sag(*outer, old[0], old[1]);
            if too_far || (c < 0.9 && !self.agrees(*outer, *new)) {
                return false;
            }
            let near = crate::bvh::closest_on_triangle(self.mesh.at(a), new).0;
            dropped = dropped.min(distance(near, self.mesh.at(a)));
        }
        if dropped > 2.0 * SAG * local {
            return false;
        }
        self.collapse(h);
        if self.is_free(b) {
            self.place(b, foot);
        }
        true
    }

    /// Collapses an edge into the vertex it reaches, unguarded.
    pub(super) fn collapse(&mut self, h: u32) {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        self.note(Operation::Collapse(a, b));
        self.mesh.collapse(h);
        self.activity.mark_changed(b);
        let ring: Vec<u32> = self.mesh.neighbours(b).collect();
        self.mark_connected(&ring);
    }

    /// Whether a collapse may make an edge between two corners, which others may have made, too, or leave a corner too few edges.
    fn may_join_beyond(&self, h: u32) -> bool {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let mut apexes = [Some(h), self.mesh.twin(h)].into_iter().flatten().map(|side| self.mesh.apex(side));
        let apexes = [apexes.next(), apexes.next()];
        apexes.iter().flatten().any(|&c| self.is_corner(c) && self.mesh.valence(c) <= 3)
            || (self.is_corner(b) && self.mesh.neighbours(a).any(|x| x != b && self.is_corner(x) && !apexes.contains(&Some(x))))
    }

    fn is_corner(&self, v: u32) -> bool {
        self.mesh.class[v as usize].stays()
    }

    /// Whether dropping the curve vertex `h` leaves moves its curve by no more than `most`.
    fn curve_stays(&self, h: u32, most: f64) -> bool {
        let (a, b) = (self.mesh.from(h), self.mesh.to(h));
        let before = self.curve_neighbours(a).into_iter().find(|&v| v != b);
        let Some(before) = before else { return false };
        let (p, q, r) = (self.mesh.at(before), self.mesh.at(b), self.mesh.at(a));
        distance_to_segment(r, p, q) <= most
    }

    /// How far the curve of a vertex may move away from it, in local sizes.
    fn curve_sag(&self, v: u32) -> f64 {
        if self.mesh.is_boundary_vertex(v) { BOUNDARY_SAG } else { CURVE_SAG }
    }

    /// Where a curve vertex may slide along its curve, cutting off no more of it than allowed, with the least kappa around it then.
    pub(super) fn slides(&self, v: u32) -> Vec<(f64, Foot)> {
        let ends = self.curve_neighbours(v);
        let (&[a, b], VertexClass::Curve) = (ends.as_slice(), self.mesh.class[v as usize]) else { return Vec::new() };
        let p = self.mesh.at(v);
        let mut found = Vec::new();
        for (to, back) in [(a, b), (b, a)] {
            for share in [0.1, 0.2, 0.3, 0.45] {
                let x = lerp(p, self.mesh.at(to), share);
                if distance_to_segment(p, self.mesh.at(back), x) > self.curve_sag(v) * self.size[v as usize] {
                    break;
                }
                let mut least = 1f64;
                let fine = self.mesh.around(v).all(|h| {
                    let (y, z) = (self.mesh.to(h), self.mesh.apex(h));
                    let (q, r) = (self.mesh.at(y), self.mesh.at(z));
                    least = least.min(kappa(x, q, r));
                    self.keeps_looking(y, [p, q, r], [x, q, r])
                });
                if fine {
                    let foot = self.input.walk(x, self.foot[v as usize]);
                    found.push((least, Foot { position: x, ..foot }));
                }
            }
        }
        found
    }

    /// The vertices joined to a vertex by curve edges.
    pub(super) fn curve_neighbours(&self, v: u32) -> Vec<u32> {
        let mut found = Vec::new();
        for h in self.mesh.around(v) {
            if self.mesh.is_on_curve(h) {
                found.push(self.mesh.to(h));
            }
            if self.mesh.is_boundary(prev(h)) {
                found.push(self.mesh.from(prev(h)));
            }
        }
        found
    }

    /// Whether the star of a vertex moved to `p` keeps the way its faces look; the least kappa then.
    pub(super) fn star_at(&self, v: u32, p: Vec3, normal: Vec3) -> Option<f64> {
        let mut least = 1f64;
        for h in self.mesh.around(v) {
            let (q, r) = (self.mesh.at(self.mesh.to(h)), self.mesh.at(self.mesh.apex(h)));
            least = least.min(kappa_if_it_faces(p, [q, r], distance(q, r), normal)?);
        }
        Some(least)
    }

    /// The star of a vertex, to try many places.
    pub(super) fn ring(&self, v: u32) -> Ring {
        let edge = |h: u32| {
            let ends = [self.mesh.at(self.mesh.to(h)), self.mesh.at(self.mesh.apex(h))];
            (ends, distance(ends[0], ends[1]))
        };
        Ring { edges: self.mesh.around(v).map(edge).collect() }
    }

    /// Sum of the area vectors around a vertex.
    pub(super) fn star_normal(&self, v: u32) -> Vec3 {
        let sum = self.mesh.around(v).fold([0.0; 3], |s, h| add(s, self.mesh.area_vector(h / 3)));
        crate::vector::unit(sum)
    }

    /// Projects a point near a vertex.
    pub(super) fn project_near(&self, v: u32, p: Vec3) -> Foot {
        self.input.project(p, self.foot[v as usize], 0.5 * self.size[v as usize])
    }
}

/// The edges opposite a vertex with their lengths; the one whose face stopped the last place that failed is the first.
pub(super) struct Ring {
    edges: Vec<([Vec3; 2], f64)>,
}

impl Ring {
    /// As [`State::star_at`], but `None` also where the least kappa is not above `level`: most places fail at their first face.
    pub(super) fn above(&mut self, p: Vec3, normal: Vec3, level: f64) -> Option<f64> {
        let mut least = 1f64;
        for i in 0..self.edges.len() {
            let (ends, length) = self.edges[i];
            match kappa_if_it_faces(p, ends, length, normal) {
                Some(kappa) if kappa > level => least = least.min(kappa),
                _ => {
                    self.edges.swap(0, i);
                    return None;
                }
            }
        }
        (least > level).then_some(least)
    }
}

/// Kappa of the face over an edge of a length; `None` if it looks away from a unit normal.
#[inline]
fn kappa_if_it_faces(p: Vec3, [q, r]: [Vec3; 2], length: f64, normal: Vec3) -> Option<f64> {
    let n = area_vector_twice(p, q, r);
    let square = dot(n, n);
    let along = dot(n, normal);
    if along < 0.0 || along * along < TURN * TURN * square {
        return None;
    }
    let (a, b) = (distance(r, p), distance(p, q));
    let product = length * a * b;
    let around = length + a + b;
    Some(if product > 0.0 { 4.0 * square / (around * product) } else { 0.0 })
}

/// Cosine of the angle between two vectors; -1 if one is zero.
pub(super) fn cosine(a: Vec3, b: Vec3) -> f64 {
    let n = dot(a, a) * dot(b, b);
    if n > 0.0 { dot(a, b) / n.sqrt() } else { -1.0 }
}

/// Distance of `r` from the segment `p q`.
fn distance_to_segment(r: Vec3, p: Vec3, q: Vec3) -> f64 {
    let along = sub(q, p);
    let t = (dot(sub(r, p), along) / dot(along, along).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    distance(r, lerp(p, q, t))
}

/// Two unit vectors at right angles to a unit vector and to each other.
pub(super) fn tangents(normal: Vec3) -> [Vec3; 2] {
    let axis = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = unit(tangential(axis, normal));
    [u, cross(normal, u)]
}

/// The part of a vector at right angles to a unit vector.
pub(super) fn tangential(a: Vec3, unit: Vec3) -> Vec3 {
    add_scaled(a, unit, -dot(a, unit))
}

/// Area centroid of the star of a vertex, each face weighted for the wanted sizes: area / size^4 makes the faces' areas follow the
/// square of the size.
pub(super) fn star_centroid(state: &State<'_>, v: u32) -> Vec3 {
    let p = state.mesh.at(v);
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for h in state.mesh.around(v) {
        let (y, z) = (state.mesh.from(next(h)), state.mesh.apex(h));
        let (q, r) = (state.mesh.at(y), state.mesh.at(z));
        let size = (state.size[v as usize] + state.size[y as usize] + state.size[z as usize]) / 3.0;
        let weight = norm(area_vector_twice(p, q, r)) / (size * size * size * size);
        sum = add_scaled(sum, middle([p, q, r]), weight);
        total += weight;
    }
    if total > 0.0 { scale(sum, 1.0 / total) } else { p }
}
