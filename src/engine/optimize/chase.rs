//! The worst faces one by one: the best of flip, collapse, split and moving a corner, until nothing helps.

use super::input::Foot;
use super::rounds::new_faces;
use super::state::{State, tangents};
use crate::error::Result;
use crate::vector::{Vec3, add_scaled, kappa, lerp, norm};
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::LazyLock;

/// Least gain in kappa of a step.
const GAIN: f64 = 1e-3;
/// The same in a trial: faces beside edges that are held creep up in steps so small that there are hundreds of them.
const TRIAL_GAIN: f64 = 0.02;
/// Edges the chase makes stay between these many sizes.
const RATIOS: [f64; 2] = [0.4, 1.8];

/// Sine and cosine of the multiples of 45 degrees.
pub(super) static EIGHT_WAYS: LazyLock<[[f64; 2]; 8]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let (sin, cos) = (k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
        [sin, cos]
    })
});

/// Chases all faces below `target`; returns how many steps were made. Each step raises the least kappa of the faces it replaces, so
/// the chase ends.
pub(super) fn chase(state: &mut State<'_>, target: f64, work: &Work<'_>) -> Result<u32> {
    let faces = state.mesh.faces_left().collect();
    chase_faces(state, faces, target, GAIN, work)
}

/// Chases only what has changed since a sweep (see [`super::activity`]), in steps worth their while: enough to tell what a trial leads to
/// where all else was chased before, in vain.
pub(super) fn chase_trial(state: &mut State<'_>, since: u32, target: f64, work: &Work<'_>) -> Result<u32> {
    let faces = new_faces(state, since);
    chase_faces(state, faces, target, TRIAL_GAIN, work)
}

fn chase_faces(state: &mut State<'_>, faces: Vec<u32>, target: f64, gain: f64, work: &Work<'_>) -> Result<u32> {
    let mut queue = BinaryHeap::new();
    for f in faces {
        enqueue(state, f, target, &mut queue);
    }
    let budget = 20 * queue.len() + 1000;
    let mut steps = 0;
    let mut touched = Vec::new();
    for turn in 0..budget {
        if turn % 64 == 0 {
            work.check()?;
        }
        let Some(Reverse((bits, f))) = queue.pop() else { break };
        if !state.mesh.is_face(f) || state.kappa(f).to_bits() != bits {
            continue;
        }
        touched.clear();
        if improve(state, f, gain, &mut touched) {
            steps += 1;
            for &v in &touched {
                for h in state.mesh.around(v).collect::<Vec<_>>() {
                    enqueue(state, h / 3, target, &mut queue);
                }
            }
        }
    }
    Ok(steps)
}

fn enqueue(state: &State<'_>, f: u32, target: f64, queue: &mut BinaryHeap<Reverse<(u64, u32)>>) {
    let k = state.kappa(f);
    if k < target {
        queue.push(Reverse((k.to_bits(), f)));
    }
}

/// Makes the best step for a face; collects the vertices whose stars changed.
fn improve(state: &mut State<'_>, f: u32, gain: f64, touched: &mut Vec<u32>) -> bool {
    let edges = [3 * f, 3 * f + 1, 3 * f + 2];
    let corners = state.mesh.corners(f);
    try_flips(state, edges, gain, touched)
        || corners.iter().any(|&v| move_vertex(state, v, gain, touched) || slide_vertex(state, v, gain, touched))
        || try_collapses(state, edges, gain, touched)
        || try_splits(state, edges, gain, touched)
}

fn try_flips(state: &mut State<'_>, edges: [u32; 3], gain: f64, touched: &mut Vec<u32>) -> bool {
    let mut gains: Vec<(f64, u32)> =
        edges.iter().filter_map(|&h| state.flip_kappa(h).map(|(after, before)| (after - before, h))).filter(|x| x.0 > gain).collect();
    gains.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    for (_, h) in gains {
        let Some(t) = state.mesh.twin(h) else { continue };
        let quad = [state.mesh.from(h), state.mesh.from(t), state.mesh.apex(h), state.mesh.apex(t)];
        if state.ratio_of(quad[2], quad[3]) < RATIOS[1] && state.try_flip(h) {
            touched.extend([quad[2], quad[3]]);
            return true;
        }
    }
    false
}

fn try_collapses(state: &mut State<'_>, edges: [u32; 3], gain: f64, touched: &mut Vec<u32>) -> bool {
    let mut options = Vec::new();
    for h in edges {
        for side in [Some(h), state.mesh.twin(h)].into_iter().flatten() {
            let Some(foot) = state.collapse_target(side) else { continue };
            let (after, before, longest) = state.collapse_kappa(side, foot.position);
            if after > before + gain && longest < RATIOS[1] {
                options.push((after, side, foot));
            }
        }
    }
    options.sort_by(|x, y| y.0.total_cmp(&x.0));
    for (_, side, foot) in options {
        let kept = state.mesh.to(side);
        if state.try_collapse(side, &foot) {
            touched.push(kept);
            return true;
        }
    }
    false
}

/// Splits the longest edge if the four faces are better than the two, at once or after the new vertex has moved.
fn try_splits(state: &mut State<'_>, edges: [u32; 3], gain: f64, touched: &mut Vec<u32>) -> bool {
    let longest = edges.into_iter().fold(edges[0], |a, b| if state.ratio(b) > state.ratio(a) { b } else { a });
    if state.ratio(longest) < 2.0 * RATIOS[0] || state.mesh.is_on_curve(longest) {
        return false;
    }
    let Some(t) = state.mesh.twin(longest) else { return false };
    let [a, b, c, d] =
        [state.mesh.from(longest), state.mesh.from(t), state.mesh.apex(longest), state.mesh.apex(t)].map(|v| state.mesh.at(v));
    let m = lerp(a, b, 0.5);
    let after = [[a, m, c], [m, b, c], [b, m, d], [m, a, d]].iter().map(|x| kappa(x[0], x[1], x[2])).fold(1.0, f64::min);
    let before = state.kappa(longest / 3).min(state.kappa(t / 3));
    if after < before + gain {
        return false;
    }
    match state.try_split(longest) {
        Some(v) => {
            touched.push(v);
            move_vertex(state, v, gain, touched);
            true
        }
        None => false,
    }
}

/// Slides a curve vertex along its curve to where the least kappa of its star is highest.
fn slide_vertex(state: &mut State<'_>, v: u32, gain: f64, touched: &mut Vec<u32>) -> bool {
    let best = state.slides(v).into_iter().max_by(|x, y| x.0.total_cmp(&y.0));
    match best {
        Some((least, foot)) if least > state.star_kappa(v) + gain => {
            state.place(v, &foot);
            touched.push(v);
            true
        }
        _ => false,
    }
}

/// Moves a free vertex by pattern search in its tangent plane so that the least kappa of its star rises.
fn move_vertex(state: &mut State<'_>, v: u32, gain: f64, touched: &mut Vec<u32>) -> bool {
    if !state.is_free(v) {
        return false;
    }
    let start = state.star_kappa(v);
    let normal = state.star_normal(v);
    let [u, w] = tangents(normal);
    if norm(u) == 0.0 {
        return false;
    }
    let mut sag = None;
    let mut ring = state.ring(v);
    let mut best: Option<(f64, Foot)> = None;
    let mut level = start;
    let mut at: Vec3 = state.mesh.at(v);
    let mut step = 0.2 * state.size[v as usize];
    for _ in 0..8 {
        let mut found = None;
        for [sin, cos] in *EIGHT_WAYS {
            let p = add_scaled(add_scaled(at, u, step * cos), w, step * sin);
            // Off the surface it is about as good as at its foot, which is dearer to find.
            if ring.above(p, normal, level).is_none() {
                continue;
            }
            let foot = state.project_near(v, p);
            if let Some(k) = ring.above(foot.position, normal, level)
                && !state.input.is_on_boundary(&foot)
                && state.keeps_limit(v, foot.position, sag.get_or_insert_with(|| state.sag_limit(v, normal)))
            {
                level = k;
                found = Some(foot);
            }
        }
        match found {
            Some(foot) => {
                at = foot.position;
                best = Some((level, foot));
            }
            None => step *= 0.5,
        }
    }
    match best {
        Some((level, foot)) if level > start + gain => {
            state.place(v, &foot);
            touched.push(v);
            true
        }
        _ => false,
    }
}
