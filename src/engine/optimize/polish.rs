//! Faces at seams to better mean shape: vertices go to where an energy of shapes and lengths is least, edges flip where that lowers it. Seams
//! lie in the narrow, bent places of a surface; the passes over the whole mesh, which ask for the worst face or the centroid, leave them
//! somewhat worse than the rest.

use super::reconnect::reconnect;
use super::sag::SagLimit;
use super::state::{SAG, State, tangents};
use super::untangle::Nearby;
use crate::error::Result;
use crate::vector::{Vec3, add_scaled, area_vector_twice, distance, dot, kappa, norm};
use crate::work::Work;
use std::cell::OnceCell;

/// Rings of edges around seams whose vertices move.
const RINGS: u32 = 1;
/// Rounds, at most; each costs less than the one before, as vertices come to rest.
const ROUNDS: u32 = 12;
/// Weight of an edge's length against the shape of a face.
const LENGTH: f64 = 0.6;
/// Weight of the square of what a face lacks.
const SQUARE: f64 = 2.0;
/// What lowers the energy by less than this is not worth it.
const GAIN: f64 = 1e-4;
/// Least cosine between a face and its star's normal.
const TURN: f64 = 0.3;
/// Step of the differences, in local sizes.
const DIFFERENCE: f64 = 0.02;
/// Longest move at once, in local sizes.
const LONGEST: f64 = 0.3;
/// Moves shorter than this, in local sizes, are none.
const SHORTEST: f64 = 1e-3;

/// Polishes the faces at seams. No face gets worse that is below `target` or would fall below it. One look at all faces, then linear in the
/// faces at seams. `nearby` as for [`super::rescue::Effort::Whole`].
pub(super) fn polish(state: &mut State<'_>, target: f64, nearby: &OnceCell<Nearby>, work: &Work<'_>) -> Result<()> {
    let zone = zone(state);
    relax(state, &zone, ROUNDS, target, work)?;
    let moved = reconnect(state, &zone, target, nearby, work)?;
    relax(state, &moved, ROUNDS, target, work)
}

/// Vertices of seams and within some rings of edges around them, increasing.
fn zone(state: &State<'_>) -> Vec<u32> {
    let m = &state.mesh;
    let mut seen = vec![false; m.vertex_slots() as usize];
    let mut front = Vec::new();
    for f in m.faces_left() {
        for h in 3 * f..3 * f + 3 {
            let other = m.twin(h).map_or(f, |t| t / 3);
            if m.label[f as usize][0] != m.label[other as usize][0] && !m.is_on_curve(h) {
                front.push(m.from(h));
            }
        }
    }
    let mut zone = Vec::new();
    for _ in 0..=RINGS {
        front.retain(|&v| !std::mem::replace(&mut seen[v as usize], true));
        zone.extend_from_slice(&front);
        front = front.iter().flat_map(|&v| m.neighbours(v)).collect();
    }
    zone.sort_unstable();
    zone
}

/// Moves these vertices, flips the edges at them, and goes on with their neighbours among `start`, until nothing gains.
pub(super) fn relax(state: &mut State<'_>, start: &[u32], rounds: u32, target: f64, work: &Work<'_>) -> Result<()> {
    let mut inside = vec![false; state.mesh.vertex_slots() as usize];
    start.iter().for_each(|&v| inside[v as usize] = true);
    let mut awake = inside.clone();
    for _ in 0..rounds {
        let mut changed = 0u32;
        for (i, &v) in start.iter().enumerate() {
            if i % 256 == 0 {
                work.check()?;
            }
            if !std::mem::replace(&mut awake[v as usize], false) || !state.mesh.is_vertex(v) {
                continue;
            }
            if flip_around(state, v, target) | settle(state, v, target) {
                changed += 1;
                awake[v as usize] = true;
                state.mesh.neighbours(v).for_each(|n| awake[n as usize] = inside[n as usize]);
            }
        }
        if changed == 0 {
            break;
        }
    }
    Ok(())
}

/// Energy of all faces and of the edges inside.
pub(super) fn energy_of(state: &State<'_>) -> f64 {
    let m = &state.mesh;
    let mut sum = 0.0;
    for f in m.faces_left() {
        let [a, b, c] = m.points(f);
        sum += of_face(kappa(a, b, c));
        sum += (3 * f..3 * f + 3).filter(|&h| m.twin(h).is_some_and(|t| h < t)).map(|h| of_length(state.ratio(h))).sum::<f64>();
    }
    sum
}

fn of_face(kappa: f64) -> f64 {
    let lack = 1.0 - kappa;
    lack + SQUARE * lack * lack
}

/// Near 1 the square of the logarithm.
fn of_length(ratio: f64) -> f64 {
    let x = 0.5 * (ratio - 1.0 / ratio);
    LENGTH * x * x
}

/// Energy of the star of a vertex and its least kappa, were it at `p`; `None` where a face would fold.
fn star(state: &State<'_>, v: u32, p: Vec3, normal: Vec3) -> Option<(f64, f64)> {
    let m = &state.mesh;
    let size = state.size[v as usize];
    let (mut sum, mut least) = (0.0, 1f64);
    for h in m.around(v) {
        let (y, z) = (m.to(h), m.apex(h));
        let (q, r) = (m.at(y), m.at(z));
        let n = area_vector_twice(p, q, r);
        let along = dot(n, normal);
        if along <= 0.0 || along * along < TURN * TURN * dot(n, n) {
            return None;
        }
        let k = kappa(p, q, r);
        least = least.min(k);
        sum += of_face(k) + of_length(distance(p, q) / (0.5 * (size + state.size[y as usize])));
    }
    Some((sum, least))
}

/// Moves a free vertex by Newton's method in its tangent plane; tells whether it did.
fn settle(state: &mut State<'_>, v: u32, target: f64) -> bool {
    if !state.is_free(v) {
        return false;
    }
    let normal = state.star_normal(v);
    let p = state.mesh.at(v);
    let Some((before, least)) = star(state, v, p, normal) else { return false };
    let Some(step) = newton(state, v, tangents(normal), normal, before) else { return false };
    // Three times what other passes may do: the faces here are few.
    let mut sag = match state.sag_limit(v, normal) {
        SagLimit::None => SagLimit::None,
        SagLimit::Unless(_) | SagLimit::AtMost(_) => SagLimit::Unless(1.5 * SAG * state.size[v as usize]),
    };
    for share in [1.0, 0.6, 0.35, 0.2, 0.1] {
        let foot = state.project_near(v, add_scaled(p, step, share));
        if let Some((after, then)) = star(state, v, foot.position, normal)
            && after < before - GAIN
            && !state.input.is_on_boundary(&foot)
            && then >= least.min(target)
            && state.keeps_limit(v, foot.position, &mut sag)
        {
            state.place(v, &foot);
            return true;
        }
    }
    false
}

/// The step to where a quadric through six values is least, or down its slope where it has no least place.
fn newton(state: &State<'_>, v: u32, [u, w]: [Vec3; 2], normal: Vec3, at: f64) -> Option<Vec3> {
    let local = state.size[v as usize];
    let p = state.mesh.at(v);
    let d = DIFFERENCE * local;
    let value = |x: f64, y: f64| star(state, v, add_scaled(add_scaled(p, u, x * d), w, y * d), normal).map(|s| s.0);
    let (east, west, north, south) = (value(1.0, 0.0)?, value(-1.0, 0.0)?, value(0.0, 1.0)?, value(0.0, -1.0)?);
    let slope = [0.5 * (east - west), 0.5 * (north - south)];
    let (xx, yy) = (east + west - 2.0 * at, north + south - 2.0 * at);
    let xy = value(1.0, 1.0)? - at - slope[0] - slope[1] - 0.5 * (xx + yy);
    let determinant = xx * yy - xy * xy;
    let [x, y] = if xx > 0.0 && determinant > 1e-3 * xx * xx {
        [(xy * slope[1] - yy * slope[0]) / determinant, (xy * slope[0] - xx * slope[1]) / determinant]
    } else {
        let steep = slope[0].hypot(slope[1]).max(f64::MIN_POSITIVE);
        slope.map(|s| -s / steep * 0.1 / DIFFERENCE)
    };
    let step = add_scaled(u.map(|c| c * x * d), w, y * d);
    let length = norm(step);
    if !length.is_finite() || length < SHORTEST * local {
        return None;
    }
    let most = LONGEST * local;
    Some(if length > most { step.map(|s| s * most / length) } else { step })
}

/// Flips edges of the star of a vertex where that lowers the energy; tells whether one was.
fn flip_around(state: &mut State<'_>, v: u32, target: f64) -> bool {
    let ring: Vec<u32> = state.mesh.around(v).collect();
    let mut flipped = false;
    for h in ring {
        flipped |= state.mesh.from(h) == v && flip_gains(state, h, target) && state.try_flip(h);
    }
    flipped
}

fn flip_gains(state: &State<'_>, h: u32, target: f64) -> bool {
    let m = &state.mesh;
    let Some(t) = m.twin(h).filter(|_| !m.is_on_curve(h)) else { return false };
    let ends = [m.from(h), m.from(t), m.apex(h), m.apex(t)];
    let [a, b, c, d] = ends.map(|v| m.at(v));
    let (old, new) = ([kappa(a, b, c), kappa(b, a, d)], [kappa(a, d, c), kappa(d, b, c)]);
    let before = of_face(old[0]) + of_face(old[1]) + of_length(state.ratio_of(ends[0], ends[1]));
    let after = of_face(new[0]) + of_face(new[1]) + of_length(state.ratio_of(ends[2], ends[3]));
    after < before - GAIN && new[0].min(new[1]) >= old[0].min(old[1]).min(target)
}
