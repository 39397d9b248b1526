//! Faces at seams whose connection is at fault: on a copy of their surroundings an edge is flipped, split or collapsed and all settles
//! anew. What lowers the energy most is done on the mesh.

use super::polish::{energy_of, relax};
use super::rescue::{Piece, first_steps, most_tried, redo, take};
use super::state::{Operation, State};
use super::untangle::Nearby;
use crate::error::Result;
use crate::work::Work;
use std::cell::OnceCell;

/// Faces below this kappa are looked at.
const POOR: f64 = 0.85;
/// Rounds of settling in a trial, and in that which is done.
const ROUNDS: [u32; 2] = [3, 12];
/// Least gain in energy.
const GAIN: f64 = 0.02;
/// Edges longer than this many sizes are not collapsed, shorter ones not split.
const COLLAPSED: f64 = 1.1;
const SPLIT: f64 = 0.9;

/// Reconnects poor faces with a corner in the zone, worst first, up to as many as [`most_tried`]; returns the vertices around, increasing.
pub(super) fn reconnect(state: &mut State<'_>, zone: &[u32], target: f64, nearby: &OnceCell<Nearby>, work: &Work<'_>) -> Result<Vec<u32>> {
    let mut poor: Vec<(f64, u32)> = Vec::new();
    for &v in zone.iter().filter(|&&v| state.mesh.is_vertex(v)) {
        poor.extend(state.mesh.around(v).map(|h| (state.kappa(h / 3), h / 3)).filter(|x| x.0 < POOR));
    }
    poor.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    poor.dedup();
    poor.truncate(most_tried(state));
    let mut around = Vec::new();
    if poor.is_empty() {
        return Ok(around);
    }
    let nearby = nearby.get_or_init(|| Nearby::new(&state.mesh));
    for (_, f) in poor {
        work.check()?;
        if !state.mesh.is_face(f) || state.kappa(f) >= POOR {
            continue;
        }
        let Some(piece) = Piece::around(state, f) else { continue };
        let Some(mut trial) = best_trial(&piece, target, work)? else { continue };
        let all: Vec<u32> = (0..trial.mesh.vertex_slots()).collect();
        relax(&mut trial, &all, ROUNDS[1], target, work)?;
        let place = piece.place(state, nearby);
        if !piece.adds_crossings(state, &place, &trial) {
            around.extend_from_slice(&piece.vertices);
            redo(state, &piece.vertices, trial.log.unwrap_or_default());
        }
    }
    around.sort_unstable();
    around.dedup();
    Ok(around)
}

/// The piece after the step that lowers its energy most, if one does and leaves no face worse than the worst was.
fn best_trial<'a>(piece: &Piece<'a>, target: f64, work: &Work<'_>) -> Result<Option<State<'a>>> {
    let least = |state: &State<'_>| state.mesh.faces_left().map(|f| state.kappa(f)).fold(target, f64::min);
    let worst = least(&piece.state);
    let mut enough = energy_of(&piece.state) - GAIN;
    let mut best = None;
    for step in first_steps(&piece.state, piece.face) {
        let mut trial = piece.state.clone();
        let since = trial.activity.begin();
        if !is_worth_it(&piece.state, &step) || !take(&mut trial, step) {
            continue;
        }
        let mut near: Vec<u32> = trial.activity.changed_since(since).to_vec();
        near.retain(|&v| trial.mesh.is_vertex(v));
        near.sort_unstable();
        near.dedup();
        relax(&mut trial, &near, ROUNDS[0], target, work)?;
        let after = energy_of(&trial);
        if after < enough && least(&trial) >= worst {
            enough = after;
            best = Some(trial);
        }
    }
    Ok(best)
}

fn is_worth_it(state: &State<'_>, step: &Operation) -> bool {
    match *step {
        Operation::Collapse(a, b) => state.ratio_of(a, b) < COLLAPSED,
        Operation::Split(a, b, _) => state.ratio_of(a, b) > SPLIT,
        Operation::Flip(..) | Operation::Place(..) => true,
    }
}
