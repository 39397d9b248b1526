//! Removes self-intersections, which appear where two sheets of the input are nearer than the elements are large: around each
//! intersecting face the step (flip, move, collapse, split) is taken that leaves fewer intersecting pairs.

use super::chase::EIGHT_WAYS;
use super::fit::Fitted;
use super::input::Foot;
use super::kernel::Kernel;
use super::rounds::new_faces;
use super::state::State;
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::quality::intersect::faces_intersect;
use crate::vector::{Vec3, add, add_scaled, cross, dot, kappa, sub, unit};
use crate::work::Work;

/// Rounds of search and repair.
const MOST_ROUNDS: u32 = 8;
/// Shape that a step must leave.
const LEAST_KAPPA: f64 = 0.3;
/// Edges are not split below this many sizes.
const SHORTEST: f64 = 0.5;

pub(super) type Corners = [Vec3; 3];

/// The faces near a place while the mesh changes: a tree made at the start of a round, and what came after it.
pub(super) struct Nearby {
    pub(super) bvh: TriangleBvh,
    pub(super) faces: Vec<u32>,
    /// Faces from this slot on are newer than the tree.
    slots: u32,
}

impl Nearby {
    pub(super) fn new(mesh: &Kernel) -> Self {
        let faces: Vec<u32> = mesh.faces_left().collect();
        let triangles: Vec<[u32; 3]> = faces.iter().map(|&f| mesh.corners(f)).collect();
        Nearby { bvh: TriangleBvh::build(&mesh.position, &triangles), faces, slots: mesh.face_slots() }
    }

    /// Faces that may meet a box; `margin` covers what faces have moved since the tree was made.
    pub(super) fn around(&self, mesh: &Kernel, low: Vec3, high: Vec3, margin: f64) -> Vec<u32> {
        let mut found = Vec::new();
        self.bvh.faces_in_box(low.map(|x| x - margin), high.map(|x| x + margin), |i| {
            let f = self.faces[i as usize];
            if mesh.is_face(f) {
                found.push(f);
            }
        });
        found.extend((self.slots..mesh.face_slots()).filter(|&f| mesh.is_face(f)));
        found
    }
}

/// Repairs; returns the number of faces that still intersect others (the input may intersect itself). At intersecting faces the
/// fit is undone first. After the first round only what repairs have changed is looked at again.
pub(super) fn untangle(state: &mut State<'_>, fitted: &[Fitted], work: &Work<'_>) -> Result<usize> {
    work.check()?;
    let nearby = Nearby::new(&state.mesh);
    work.check()?;
    let mut faces = intersecting_faces(&state.mesh, &nearby, work)?;
    faces = put_back(state, fitted, &nearby, faces, work)?;
    for _ in 0..MOST_ROUNDS {
        let since = state.activity.begin();
        let mut changed = false;
        for &f in &faces {
            work.check()?;
            if state.mesh.is_face(f) {
                changed |= repair(state, &nearby, f);
            }
        }
        if !changed {
            break;
        }
        faces.extend(new_faces(state, since));
        faces.sort_unstable();
        faces.dedup();
        faces = still_intersecting(state, &nearby, &faces, work)?;
    }
    Ok(faces.len())
}

/// Puts the fitted vertices of these faces back on the input, and of those that come to meet others by that; returns the faces that still do.
fn put_back(state: &mut State<'_>, fitted: &[Fitted], nearby: &Nearby, mut faces: Vec<u32>, work: &Work<'_>) -> Result<Vec<u32>> {
    let mut back = vec![false; fitted.len()];
    loop {
        let mut touched = Vec::new();
        for &f in &faces {
            for v in state.mesh.corners(f) {
                if let Ok(i) = fitted.binary_search_by_key(&v, |moved| moved.vertex)
                    && !std::mem::replace(&mut back[i], true)
                {
                    state.mesh.position[v as usize] = fitted[i].before;
                    touched.extend(state.mesh.around(v).map(|h| h / 3));
                }
            }
        }
        if touched.is_empty() {
            return Ok(faces);
        }
        faces.append(&mut touched);
        faces.sort_unstable();
        faces.dedup();
        faces = still_intersecting(state, nearby, &faces, work)?;
    }
}

/// Faces that meet another face in more than what they share, sorted.
fn intersecting_faces(mesh: &Kernel, nearby: &Nearby, work: &Work<'_>) -> Result<Vec<u32>> {
    let (mut found, mut visited) = (Vec::new(), 0u32);
    let even: Vec<bool> = (0..mesh.vertex_slots()).map(|v| mesh.is_vertex(v) && is_graph(mesh, v)).collect();
    nearby.bvh.overlapping_pairs(|i, j| -> Result<()> {
        visited = visited.wrapping_add(1);
        if visited % 8192 == 0 {
            work.check()?;
        }
        let [f, g] = [nearby.faces[i as usize], nearby.faces[j as usize]];
        let beside = mesh.corners(f).into_iter().any(|v| even[v as usize] && mesh.corners(g).contains(&v));
        if !beside && faces_intersect(&mesh.points(f), &mesh.points(g)) {
            found.extend([f, g]);
        }
        Ok(())
    })?;
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// Whether the faces around an inner vertex, seen along their common normal, lie side by side once around it: then none of them meets
/// another one. With a margin for rounding.
fn is_graph(mesh: &Kernel, v: u32) -> bool {
    if mesh.is_boundary_vertex(v) {
        return false;
    }
    let normal = unit(mesh.around(v).fold([0.0; 3], |sum, h| add(sum, mesh.area_vector(h / 3))));
    let faces_up = |h: u32| {
        let n = mesh.area_vector(h / 3);
        let along = dot(n, normal);
        along > 0.0 && along * along > 0.01 * dot(n, n)
    };
    if !mesh.around(v).all(faces_up) {
        return false;
    }
    let axis = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let across = cross(normal, axis);
    let centre = mesh.at(v);
    let beyond = |v: u32| dot(sub(mesh.at(v), centre), across) >= 0.0;
    // All turn the same way, so they go around once if they come to the far side once.
    mesh.around(v).filter(|&h| !beyond(mesh.to(h)) && beyond(mesh.apex(h))).count() == 1
}

/// The same among these faces and what they meet, where all pairs that intersect have a face among them.
fn still_intersecting(state: &State<'_>, nearby: &Nearby, faces: &[u32], work: &Work<'_>) -> Result<Vec<u32>> {
    let mesh = &state.mesh;
    let mut found = Vec::new();
    for &f in faces.iter().filter(|f| mesh.is_face(**f)) {
        work.check()?;
        let points = mesh.points(f);
        let meets = |g: &u32| *g != f && boxes_meet(&mesh.points(*g), &points) && faces_intersect(&mesh.points(*g), &points);
        let before = found.len();
        found.extend(Place::new(state, nearby, f).others.into_iter().filter(meets));
        if found.len() > before {
            found.push(f);
        }
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// The surroundings of a face: everything a step there may run into.
pub(super) struct Place {
    pub(super) others: Vec<u32>,
}

impl Place {
    fn new(state: &State<'_>, nearby: &Nearby, f: u32) -> Self {
        let corners = state.mesh.corners(f);
        let reach = corners.iter().map(|&v| state.size[v as usize]).fold(0.0, f64::max);
        let points = state.mesh.points(f);
        let low = std::array::from_fn(|k| points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min));
        let high = std::array::from_fn(|k| points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max));
        Place { others: nearby.around(&state.mesh, low, high, 2.5 * reach) }
    }

    /// Intersecting pairs if the faces `gone` were replaced by `new`.
    pub(super) fn crossings(&self, mesh: &Kernel, gone: &[u32], new: &[Corners]) -> usize {
        let mut count = 0;
        for &f in self.others.iter().filter(|f| mesh.is_face(**f) && !gone.contains(f)) {
            let points = mesh.points(f);
            count += new.iter().filter(|t| boxes_meet(&points, t) && faces_intersect(&points, t)).count();
        }
        for (i, s) in new.iter().enumerate() {
            count += new[..i].iter().filter(|t| faces_intersect(s, t)).count();
        }
        count
    }

    /// How many pairs a replacement saves, if its faces have an acceptable shape.
    fn saves(&self, mesh: &Kernel, gone: &[u32], new: &[Corners]) -> bool {
        let old: Vec<Corners> = gone.iter().map(|&f| mesh.points(f)).collect();
        let least = |faces: &[Corners]| faces.iter().map(|t| kappa(t[0], t[1], t[2])).fold(1.0, f64::min);
        least(new) >= LEAST_KAPPA.min(least(&old)) && self.crossings(mesh, gone, new) < self.crossings(mesh, gone, &old)
    }
}

fn boxes_meet(s: &Corners, t: &Corners) -> bool {
    (0..3).all(|k| {
        let range = |c: &Corners| (c[0][k].min(c[1][k]).min(c[2][k]), c[0][k].max(c[1][k]).max(c[2][k]));
        let ((a, b), (c, d)) = (range(s), range(t));
        a <= d && c <= b
    })
}

/// Makes one step at a face that lowers the number of intersecting pairs.
fn repair(state: &mut State<'_>, nearby: &Nearby, f: u32) -> bool {
    let place = Place::new(state, nearby, f);
    if place.crossings(&state.mesh, &[f], &[state.mesh.points(f)]) == 0 {
        return false;
    }
    let edges = [3 * f, 3 * f + 1, 3 * f + 2];
    let corners = state.mesh.corners(f);
    edges.iter().any(|&h| flip(state, &place, h))
        || corners.iter().any(|&v| shift(state, &place, v, Reach::Surface))
        || edges.iter().any(|&h| collapse(state, &place, h))
        || edges.iter().any(|&h| split(state, &place, h))
        || corners.iter().any(|&v| shift(state, &place, v, Reach::Off))
}

fn flip(state: &mut State<'_>, place: &Place, h: u32) -> bool {
    let Some(t) = state.mesh.twin(h) else { return false };
    let m = &state.mesh;
    let [a, b, c, d] = [m.from(h), m.from(t), m.apex(h), m.apex(t)].map(|v| m.at(v));
    m.can_flip(h) && place.saves(m, &[h / 3, t / 3], &[[a, d, c], [d, b, c]]) && state.try_flip(h)
}

fn collapse(state: &mut State<'_>, place: &Place, h: u32) -> bool {
    for side in [Some(h), state.mesh.twin(h)].into_iter().flatten() {
        let Some(foot) = state.collapse_target(side) else { continue };
        let m = &state.mesh;
        let (a, b) = (m.from(side), m.to(side));
        let mut gone: Vec<u32> = m.around(a).chain(m.around(b)).map(|g| g / 3).collect();
        gone.sort_unstable();
        gone.dedup();
        let new = state.faces_after_collapse(side, foot.position);
        if place.saves(m, &gone, &new) && state.try_collapse(side, &foot) {
            return true;
        }
    }
    false
}

fn split(state: &mut State<'_>, place: &Place, h: u32) -> bool {
    let Some(t) = state.mesh.twin(h) else { return false };
    if state.ratio(h) < SHORTEST || state.mesh.is_on_curve(h) {
        return false;
    }
    let foot = state.middle_foot(h);
    let m = &state.mesh;
    let [a, b, c, d] = [m.from(h), m.from(t), m.apex(h), m.apex(t)].map(|v| m.at(v));
    let p = foot.position;
    place.saves(m, &[h / 3, t / 3], &[[a, p, c], [p, b, c], [b, p, d], [p, a, d]]) && state.try_split(h).is_some()
}

/// Where a vertex may be moved.
#[derive(Clone, Copy, PartialEq)]
enum Reach {
    /// On the input.
    Surface,
    /// A little off it, along the normal: the last resort.
    Off,
}

/// Moves a free vertex to the first of some places around it that saves pairs.
fn shift(state: &mut State<'_>, place: &Place, v: u32, reach: Reach) -> bool {
    if !state.is_free(v) {
        return false;
    }
    let normal = state.star_normal(v);
    let (p, size) = (state.mesh.at(v), state.size[v as usize]);
    let axis = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = unit(cross(normal, axis));
    let w = cross(normal, u);
    let gone: Vec<u32> = state.mesh.around(v).map(|h| h / 3).collect();
    let mut feet: Vec<Foot> = Vec::new();
    match reach {
        Reach::Surface => {
            for step in [0.05, 0.1, 0.2, 0.3] {
                for [sin, cos] in *EIGHT_WAYS {
                    feet.push(state.project_near(v, add_scaled(add_scaled(p, u, step * size * cos), w, step * size * sin)));
                }
            }
        }
        Reach::Off => {
            let own = state.own_foot(v);
            for step in [0.02, -0.02, 0.05, -0.05, 0.1, -0.1] {
                feet.push(Foot { position: add_scaled(p, normal, step * size), ..own });
            }
        }
    }
    let deepest = state.present_star_sag(v).max(0.1 * size);
    for foot in feet {
        let new: Vec<Corners> =
            state.mesh.around(v).map(|h| [foot.position, state.mesh.at(state.mesh.to(h)), state.mesh.at(state.mesh.apex(h))]).collect();
        let stays = state.star_at(v, foot.position, normal).is_some() && state.star_sag(v, foot.position) <= deepest;
        if stays && place.saves(&state.mesh, &gone, &new) {
            state.place(v, &foot);
            return true;
        }
    }
    false
}
