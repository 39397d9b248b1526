//! Passes over the whole mesh: split long edges, collapse short ones, flip, smooth.

use super::kernel::{next, prev};
use super::state::{State, star_centroid, tangential};
use crate::error::Result;
use crate::vector::{add, distance, scale, sub};
use crate::work::Work;

/// Edges longer than this many sizes are split.
const LONG: f64 = 4.0 / 3.0;
/// Edges on curves are split above this: the curve mesh has its own good spacing, short curves apart.
const LONG_ON_CURVE: f64 = 1.6;
/// Edges shorter than this many sizes are collapsed.
const SHORT: f64 = 4.0 / 5.0;
/// Operations between two checks for cancellation.
const CHECK_EVERY: u32 = 1024;

/// Splits until no edge is too long. `since` as in [`flip_pass`].
pub(super) fn split_long(state: &mut State<'_>, since: u32, work: &Work<'_>) -> Result<u32> {
    let mut since = since;
    for _ in 0..12 {
        work.check()?;
        let sweep = state.activity.begin();
        let mut long: Vec<(f64, u32)> = new_edges(state, since)
            .into_iter()
            .map(|h| (state.ratio(h), h))
            .filter(|&(ratio, h)| ratio > if state.mesh.is_on_curve(h) { LONG_ON_CURVE } else { LONG })
            .collect();
        long.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        let mut changed = 0;
        for (i, &(ratio, h)) in long.iter().enumerate() {
            if (i as u32).is_multiple_of(CHECK_EVERY) {
                work.check()?;
            }
            // Splits beside it leave an edge as it is, so its length is still right unless it was itself replaced.
            if (state.ratio(h) - ratio).abs() < 1e-12 && state.try_split(h).is_some() {
                changed += 1;
            }
        }
        since = sweep;
        if changed == 0 {
            break;
        }
    }
    Ok(since)
}

/// Collapses short edges, shortest first. `since` as in [`flip_pass`].
pub(super) fn collapse_short(state: &mut State<'_>, since: u32, work: &Work<'_>) -> Result<u32> {
    let mut since = since;
    for _ in 0..12 {
        work.check()?;
        let sweep = state.activity.begin();
        let mut short: Vec<(f64, u32)> = new_edges(state, since).into_iter().map(|h| (state.ratio(h), h)).filter(|x| x.0 < SHORT).collect();
        short.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut changed = 0;
        for (i, &(_, h)) in short.iter().enumerate() {
            if (i as u32).is_multiple_of(CHECK_EVERY) {
                work.check()?;
            }
            if state.mesh.is_face(h / 3) && state.ratio(h) < SHORT && collapse_edge(state, h) {
                changed += 1;
            }
        }
        since = sweep;
        if changed == 0 {
            break;
        }
    }
    Ok(since)
}

/// One halfedge of every edge that has changed or whose opposite corners have, increasing. O(changes log changes).
fn new_edges(state: &State<'_>, since: u32) -> Vec<u32> {
    let m = &state.mesh;
    let changed = state.activity.changed_since(since);
    let mut found = Vec::with_capacity(6 * changed.len());
    for &v in changed.iter().filter(|&&v| m.is_vertex(v)) {
        for h in m.around(v) {
            // Edges at the vertex and opposite of it; the last is reached from the boundary only.
            found.extend([h, next(h), prev(h)].map(|g| m.twin(g).map_or(g, |t| t.min(g))));
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Faces with a corner that has changed, increasing. O(changes log changes).
pub(super) fn new_faces(state: &State<'_>, since: u32) -> Vec<u32> {
    let m = &state.mesh;
    let changed = state.activity.changed_since(since);
    let mut found: Vec<u32> = changed.iter().filter(|&&v| m.is_vertex(v)).flat_map(|&v| m.around(v)).map(|h| h / 3).collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Collapses an edge in the better direction that works.
fn collapse_edge(state: &mut State<'_>, h: u32) -> bool {
    for side in [Some(h), state.mesh.twin(h)].into_iter().flatten() {
        let Some(foot) = state.collapse_target(side) else { continue };
        let (after, before, longest) = state.collapse_kappa(side, foot.position);
        if longest < LONG * 1.02 && after > before.min(0.3) && state.try_collapse(side, &foot) {
            return true;
        }
    }
    false
}

/// What a flip pass looks for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum FlipGoal {
    /// Valences near 6 (4 on the boundary); shape decides ties.
    Valence,
    /// Better shape of the worse of the two faces.
    Shape,
}

/// Flips until nothing gains, at most a few sweeps. Looks only at what has changed since sweep `since`, the answer of the pass
/// before; returns the sweep from which on the next pass has to look.
pub(super) fn flip_pass(state: &mut State<'_>, goal: FlipGoal, since: u32, work: &Work<'_>) -> Result<u32> {
    let mut since = since;
    for _ in 0..6 {
        let sweep = state.activity.begin();
        let mut changed = 0;
        for (i, f) in new_faces(state, since).into_iter().enumerate() {
            if (i as u32).is_multiple_of(CHECK_EVERY) {
                work.check()?;
            }
            for h in 3 * f..3 * f + 3 {
                let Some(t) = state.mesh.twin(h) else { continue };
                // An edge between two new faces has its turn in the first.
                if (h < t || !is_new_face(state, t / 3, since)) && wants_flip(state, h, t, goal) && state.try_flip(h) {
                    changed += 1;
                }
            }
        }
        since = sweep;
        if changed == 0 {
            break;
        }
    }
    Ok(since)
}

fn is_new_face(state: &State<'_>, f: u32, since: u32) -> bool {
    state.mesh.is_face(f) && state.mesh.corners(f).into_iter().any(|v| state.activity.is_new(v, since))
}

fn wants_flip(state: &State<'_>, h: u32, t: u32, goal: FlipGoal) -> bool {
    let Some((after, before)) = state.flip_kappa(h) else { return false };
    if after > before.min(0.5) && state.cuts_a_crest(h, t) {
        return true;
    }
    if goal == FlipGoal::Shape {
        return after > before + 1e-6;
    }
    let m = &state.mesh;
    let excess = |v: u32| m.valence(v) as i32 - if m.is_boundary_vertex(v) { 4 } else { 6 };
    let loses = [m.from(h), m.from(t)].map(excess);
    let gains = [m.apex(h), m.apex(t)].map(excess);
    // Change of the sum of squares when two valences drop by one and two rise by one.
    let change = gains.iter().map(|x| 2 * x + 1).sum::<i32>() - loses.iter().map(|x| 2 * x - 1).sum::<i32>();
    if change < 0 { after > 0.4 * before && after > 0.15 } else { change == 0 && after > before + 1e-3 }
}

/// Moves every free vertex that is not at rest towards the centroid of its star, `sweeps` times; returns the largest last move over the local size.
pub(super) fn smooth(state: &mut State<'_>, sweeps: u32, work: &Work<'_>) -> Result<f64> {
    let mut largest = 0f64;
    for _ in 0..sweeps {
        largest = 0.0;
        for v in 0..state.mesh.vertex_slots() {
            if v.is_multiple_of(CHECK_EVERY) {
                work.check()?;
            }
            if state.mesh.is_vertex(v) && state.is_free(v) && state.activity.take_awake(v) {
                largest = largest.max(smooth_vertex(state, v));
            }
        }
    }
    Ok(largest)
}

/// One step of one vertex; the move over the local size.
fn smooth_vertex(state: &mut State<'_>, v: u32) -> f64 {
    let p = state.mesh.at(v);
    let normal = state.star_normal(v);
    let target = star_centroid(state, v);
    let step = tangential(sub(target, p), normal);
    let mut sag = state.sag_limit(v, normal);
    for share in [1.0, 0.5, 0.2] {
        let foot = state.project_near(v, add(p, scale(step, share)));
        if let Some(least) = state.star_at(v, foot.position, normal)
            && !state.input.is_on_boundary(&foot)
            && (least >= 0.4 || least >= state.star_kappa(v))
            && state.keeps_limit(v, foot.position, &mut sag)
        {
            let moved = distance(p, foot.position) / state.size[v as usize];
            state.place(v, &foot);
            return moved;
        }
    }
    0.0
}
