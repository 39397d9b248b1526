//! Captures detail that resampling lost: vertices of the input on crests and tips that are far from the mesh get a vertex of it, which
//! then stays.

use super::input::Foot;
use super::state::{State, cosine};
use super::untangle::{Corners, Nearby, Place};
use crate::assemble::VertexClass;
use crate::bvh::closest_on_triangle;
use crate::error::Result;
use crate::vector::{Vec3, area_vector_twice, distance, kappa, lerp};
use crate::work::Work;
use std::cell::OnceCell;

/// A vertex of the input is on a crest or tip if a face at it has a lower cosine with its normal: 26 degrees.
const SHARP: f64 = 0.9;
/// Farther than this part of the input's diagonal is lost,
const LOST: f64 = 0.0025;
/// within these bounds in local sizes.
const LOST_IN_SIZES: [f64; 2] = [0.12, 0.25];
/// Shape that a capture must leave for what follows to mend.
const LEAST_KAPPA: f64 = 0.25;
/// Shape that is good enough not to weigh against the distance from the input.
const FINE_KAPPA: f64 = 0.55;
/// New edges are at least this many sizes long.
const SHORTEST: f64 = 0.35;

/// A vertex of the input the mesh misses.
struct Lost {
    vertex: u32,
    tolerance: f64,
    distance: f64,
}

/// How to get a vertex to the lost place.
#[derive(Clone, Copy)]
enum Step {
    Move(u32),
    Split(u32),
}

/// Captures, farthest first; returns how many were, and the faces as they were before. Near-linear in the sharp vertices of the input.
pub(super) fn capture(state: &mut State<'_>, work: &Work<'_>) -> Result<(usize, OnceCell<Nearby>)> {
    let candidates = state.input.sharp_vertices(SHARP);
    if candidates.is_empty() {
        return Ok((0, OnceCell::new()));
    }
    work.check()?;
    let nearby = Nearby::new(&state.mesh);
    let mut lost = find_lost(state, &nearby, &candidates, work)?;
    lost.sort_unstable_by(|x, y| y.distance.total_cmp(&x.distance).then(x.vertex.cmp(&y.vertex)));
    let mut captured = 0;
    for l in &lost {
        work.check()?;
        captured += usize::from(capture_one(state, &nearby, l));
    }
    Ok((captured, OnceCell::from(nearby)))
}

fn find_lost(state: &State<'_>, nearby: &Nearby, candidates: &[u32], work: &Work<'_>) -> Result<Vec<Lost>> {
    let diagonal = state.input.diagonal();
    let mut lost = Vec::new();
    for (i, &v) in candidates.iter().enumerate() {
        if i % 1024 == 0 {
            work.check()?;
        }
        let size = state.input.vertex_size(v);
        let tolerance = (LOST * diagonal).clamp(LOST_IN_SIZES[0] * size, LOST_IN_SIZES[1] * size);
        let hit = nearby.bvh.closest_below(state.input.position(v), f64::INFINITY, tolerance * tolerance);
        let Some(hit) = hit.filter(|hit| hit.distance_squared > tolerance * tolerance) else { continue };
        lost.push(Lost { vertex: v, tolerance, distance: hit.distance_squared.sqrt() });
    }
    Ok(lost)
}

fn capture_one(state: &mut State<'_>, nearby: &Nearby, lost: &Lost) -> bool {
    let Some(foot) = state.input.inner_vertex(lost.vertex) else { return false };
    let p = foot.position;
    let size = state.input.vertex_size(lost.vertex);
    let reach = lost.distance + 2.0 * size;
    let place = Place { others: nearby.around(&state.mesh, p.map(|x| x - reach), p.map(|x| x + reach), size) };
    // What was captured before may have brought the mesh near; moved faces are all among the others.
    let nearest = place
        .others
        .iter()
        .filter(|&&f| state.mesh.is_face(f))
        .map(|&f| (distance(closest_on_triangle(p, &state.mesh.points(f)).0, p), f))
        .min_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    let Some((away, face)) = nearest.filter(|n| n.0 > lost.tolerance) else { return false };
    let best = steps(state, face)
        .into_iter()
        .filter_map(|step| worth(state, &place, step, &foot, away).map(|w| (w, step)))
        .max_by(|x, y| x.0.total_cmp(&y.0));
    let Some((_, step)) = best else { return false };
    let v = match step {
        Step::Move(v) => {
            state.place(v, &foot);
            v
        }
        Step::Split(h) => state.split_at(h, &foot),
    };
    state.mesh.class[v as usize] = VertexClass::Corner;
    true
}

/// Moves of the free vertices and splits of the edges on a face and beside it.
fn steps(state: &State<'_>, face: u32) -> Vec<Step> {
    let m = &state.mesh;
    let corners = m.corners(face);
    let mut vertices: Vec<u32> = corners.into_iter().chain(corners.into_iter().flat_map(|v| m.neighbours(v))).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut edges: Vec<u32> = corners.iter().flat_map(|&v| m.around(v)).flat_map(|h| [h, super::kernel::next(h)]).collect();
    edges.iter_mut().for_each(|h| *h = m.twin(*h).map_or(*h, |t| t.min(*h)));
    edges.sort_unstable();
    edges.dedup();
    let moves = vertices.into_iter().filter(|&v| state.is_free(v)).map(Step::Move);
    moves.chain(edges.into_iter().filter(|&h| !m.is_on_curve(h)).map(Step::Split)).collect()
}

/// Faces a step removes and what comes in their place, the new point first.
fn replacement(state: &State<'_>, step: Step, p: Vec3) -> (Vec<u32>, Vec<Corners>) {
    let m = &state.mesh;
    let ring: Vec<u32> = match step {
        Step::Move(v) => m.around(v).map(super::kernel::next).collect(),
        Step::Split(h) => {
            [Some(h), m.twin(h)].into_iter().flatten().flat_map(|g| [super::kernel::next(g), super::kernel::prev(g)]).collect()
        }
    };
    let mut gone: Vec<u32> = ring.iter().map(|h| h / 3).collect();
    gone.dedup();
    (gone, ring.iter().map(|&h| [p, m.at(m.from(h)), m.at(m.to(h))]).collect())
}

/// How good a step is; `None` if it must not be taken.
fn worth(state: &State<'_>, place: &Place, step: Step, foot: &Foot, away: f64) -> Option<f64> {
    let p = foot.position;
    let (gone, new) = replacement(state, step, p);
    let least = new.iter().map(|t| kappa(t[0], t[1], t[2])).fold(1.0, f64::min);
    let size = state.input.size(foot);
    if least < LEAST_KAPPA || new.iter().any(|t| distance(p, t[1]) < SHORTEST * size) {
        return None;
    }
    let old: Vec<Corners> = gone.iter().map(|&f| state.mesh.points(f)).collect();
    for (i, t) in new.iter().enumerate() {
        // Two of the four faces of a split replace each old one.
        let before = old[i * old.len() / new.len()];
        let turn = cosine(area_vector_twice(before[0], before[1], before[2]), area_vector_twice(t[0], t[1], t[2]));
        if turn < 0.0 && !agrees(state, foot, *t) {
            return None;
        }
    }
    // What the mesh leaves behind must not be lost instead.
    let left = match step {
        Step::Move(v) => {
            let q = state.mesh.at(v);
            new.iter().map(|t| distance(closest_on_triangle(q, t).0, q)).fold(f64::INFINITY, f64::min)
        }
        Step::Split(_) => 0.0,
    };
    let sag = new.iter().map(|t| sag(state, foot, p, t[1])).fold(0.0, f64::max);
    let cost = sag.max(left) / size;
    if left > 0.8 * away || place.crossings(&state.mesh, &gone, &new) > place.crossings(&state.mesh, &gone, &old) {
        return None;
    }
    Some(least.min(FINE_KAPPA) - cost)
}

fn agrees(state: &State<'_>, foot: &Foot, t: Corners) -> bool {
    let under = state.input.walk(super::input::middle(t), foot.face);
    state.input.agrees(area_vector_twice(t[0], t[1], t[2]), &under, 0.25)
}

fn sag(state: &State<'_>, foot: &Foot, p: Vec3, q: Vec3) -> f64 {
    state.input.walk(lerp(p, q, 0.5), foot.face).distance_squared.sqrt()
}
