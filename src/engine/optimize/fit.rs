//! Faces to both sides of the input: with all vertices on it, faces cut below its bulges, and volumes and radii come out too small.

use super::state::State;
use crate::error::Result;
use crate::vector::{Vec3, add, add_scaled, dot, lerp, scale, sub};
use crate::work::Work;

/// A vertex moves off the input by no more than this, in local sizes.
const MOST: f64 = 0.08;

/// A vertex that was moved off the input.
pub(super) struct Fitted {
    pub(super) vertex: u32,
    pub(super) before: Vec3,
}

/// Moves every free vertex along the normal of its star by the mean distance, with its sign, between the middles of its edges and the input.
/// On a smooth surface that is the mean over its faces, for a parabola meets a chord's middle at the mean distance of the surface from the
/// triangles around; what remains has about half the root mean square, and a volume right to the next order. Vertices stay where that would
/// fold a face, or bring the worst face around them below `target` (lower, if it is below already). Returns what has moved, by vertex. Linear.
pub(super) fn fit(state: &mut State<'_>, target: f64, work: &Work<'_>) -> Result<Vec<Fitted>> {
    let slots = state.mesh.vertex_slots();
    let mut offset = vec![[0.0; 3]; slots as usize];
    let mut edges = vec![0u32; slots as usize];
    for f in 0..state.mesh.face_slots() {
        if f.is_multiple_of(1024) {
            work.check()?;
        }
        if !state.mesh.is_face(f) {
            continue;
        }
        for h in 3 * f..3 * f + 3 {
            if state.mesh.twin(h).is_none_or(|t| h > t) || state.mesh.is_on_curve(h) {
                continue;
            }
            let ends = [state.mesh.from(h), state.mesh.to(h)];
            let middle = lerp(state.mesh.at(ends[0]), state.mesh.at(ends[1]), 0.5);
            let away = sub(state.project_near(ends[0], middle).position, middle);
            for v in ends {
                offset[v as usize] = add(offset[v as usize], away);
                edges[v as usize] += 1;
            }
        }
    }
    let mut fitted = Vec::new();
    for v in 0..slots {
        if v.is_multiple_of(1024) {
            work.check()?;
        }
        if !state.mesh.is_vertex(v) || !state.is_free(v) || edges[v as usize] == 0 {
            continue;
        }
        let normal = state.star_normal(v);
        let most = MOST * state.size[v as usize];
        let away = dot(scale(offset[v as usize], 1.0 / f64::from(edges[v as usize])), normal).clamp(-most, most);
        let place = add_scaled(state.mesh.at(v), normal, away);
        if state.star_at(v, place, normal).is_some_and(|least| least >= target.min(state.star_kappa(v))) {
            fitted.push(Fitted { vertex: v, before: std::mem::replace(&mut state.mesh.position[v as usize], place) });
        }
    }
    Ok(fitted)
}
