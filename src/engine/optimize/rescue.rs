//! Faces that no single step betters: on a copy of their surroundings steps are tried that make things worse at first, each followed by
//! the usual ones. The best trial is done again on the mesh.

use super::activity::Activity;
use super::chase::{chase, chase_trial};
use super::kernel::{next, prev};
use super::rounds::{FlipGoal, flip_pass};
use super::state::{Curves, Operation, State};
use super::untangle::{Corners, Nearby, Place};
use crate::assemble::{Assembled, VertexClass};
use crate::error::Result;
use crate::work::Work;
use std::cell::OnceCell;

/// Rings of faces around a face that a trial may change.
const RINGS: u32 = 2;
/// Trials that are followed by another first step.
const WIDTH: usize = 2;
/// Least gain, of the badness a piece has.
const GAIN: f64 = 0.02;
/// Faces tried are one in so many, within two bounds: a mesh with more of them has another problem than this can solve, such as a size
/// coarser than its shape.
const ONE_IN: usize = 50;
const LEAST_FACES: usize = 100;
const MOST_FACES: usize = 2000;
/// Trials without success after which the rest, which are less bad, are left.
const PATIENCE: u32 = 40;
/// Faces of the surroundings, at most: more come from vertices with very many edges.
const MOST_AROUND: usize = 400;

/// The surroundings of a face as a mesh of its own.
pub(super) struct Piece<'a> {
    pub(super) state: State<'a>,
    /// Vertices and faces of the whole mesh, increasing.
    pub(super) vertices: Vec<u32>,
    faces: Vec<u32>,
    /// The face, as one of the piece.
    pub(super) face: u32,
}

/// How hard to try.
#[derive(Clone, Copy)]
pub(super) enum Effort<'a> {
    /// One first step, away from what is held, whatever sheet of the surface it runs into: others look at the whole mesh later.
    Inside,
    /// Two first steps, and none that makes faces intersect with those nearby (of a little earlier, or found when they are needed).
    Whole(&'a OnceCell<Nearby>),
}

/// Tries to better all faces below `target`, worst first; returns how many trials were taken over.
pub(super) fn rescue(state: &mut State<'_>, target: f64, effort: Effort<'_>, work: &Work<'_>) -> Result<u32> {
    let mut bad: Vec<(f64, u32)> = state.mesh.faces_left().map(|f| (state.kappa(f), f)).filter(|x| x.0 < target).collect();
    bad.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    bad.truncate(most_tried(state));
    work.check()?;
    let nearby = match effort {
        Effort::Whole(cell) if !bad.is_empty() => Some(cell.get_or_init(|| Nearby::new(&state.mesh))),
        _ => None,
    };
    let (mut taken, mut idle) = (0, 0);
    for (_, f) in bad {
        work.check()?;
        if idle >= PATIENCE {
            break;
        }
        let held = |state: &State<'_>| state.mesh.corners(f).iter().any(|&v| state.mesh.class[v as usize].stays());
        if !state.mesh.is_face(f) || state.kappa(f) >= target || (matches!(effort, Effort::Inside) && held(state)) {
            continue;
        }
        let Some(piece) = Piece::around(state, f) else { continue };
        let place = nearby.map(|nearby| piece.place(state, nearby));
        let accept = |trial: &State<'_>| place.as_ref().is_none_or(|place| !piece.adds_crossings(state, place, trial));
        if let Some(trial) = best_trial(&piece, target, effort, accept, work)? {
            redo(state, &piece.vertices, trial.log.unwrap_or_default());
            (taken, idle) = (taken + 1, 0);
        } else {
            idle += 1;
        }
    }
    Ok(taken)
}

/// Faces that trials are made for, at most.
pub(super) fn most_tried(state: &State<'_>) -> usize {
    (state.mesh.faces_left().count() / ONE_IN).clamp(LEAST_FACES, MOST_FACES)
}

impl<'a> Piece<'a> {
    /// `None` where the surroundings of a face are no manifold by themselves or too large.
    pub(super) fn around(state: &State<'a>, face: u32) -> Option<Piece<'a>> {
        let m = &state.mesh;
        let mut faces = vec![face];
        for _ in 0..RINGS {
            faces = faces.iter().flat_map(|&f| m.corners(f)).flat_map(|v| m.around(v)).map(|h| h / 3).collect();
            faces.sort_unstable();
            faces.dedup();
            if faces.len() > MOST_AROUND {
                return None;
            }
        }
        let mut vertices: Vec<u32> = faces.iter().flat_map(|&f| m.corners(f)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let local = |v: u32| vertices.partition_point(|&w| w < v) as u32;
        let inside = |h: u32| faces.binary_search(&(h / 3)).is_ok();
        let class = |&v: &u32| if m.around(v).all(inside) { m.class[v as usize] } else { VertexClass::Corner };
        let mut curve_edges: Vec<[u32; 2]> = faces
            .iter()
            .flat_map(|&f| 3 * f..3 * f + 3)
            .filter(|&h| m.is_on_curve(h))
            .map(|h| [local(m.from(h)), local(m.to(h))])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        curve_edges.sort_unstable();
        curve_edges.dedup();
        let mesh = Assembled {
            positions: vertices.iter().map(|&v| m.at(v)).collect(),
            triangles: faces.iter().map(|&f| m.corners(f).map(local)).collect(),
            face_patch: vec![0; faces.len()],
            face_region: vec![0; faces.len()],
            vertex_class: vertices.iter().map(class).collect(),
            curve_edges,
            vertex_face: vertices.iter().map(|&v| state.foot[v as usize]).collect(),
            curve_vertices: 0,
        };
        let all = |mesh: &super::kernel::Kernel| Activity::new(mesh.vertex_slots() as usize);
        let curves = if state.curves == Curves::Held { Curves::Held } else { Curves::HeldBoundary };
        let mut piece = State::new(state.input, &mesh, curves, all).ok()?;
        piece.log = Some(Vec::new());
        let face = faces.binary_search(&face).ok()? as u32;
        Some(Piece { state: piece, vertices, faces, face })
    }

    /// What the piece may run into.
    pub(super) fn place(&self, state: &State<'_>, nearby: &Nearby) -> Place {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in self.vertices.iter().map(|&v| state.mesh.at(v)) {
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        let size = self.state.size.iter().fold(0.0f64, |most, s| most.max(*s));
        Place { others: nearby.around(&state.mesh, low, high, size) }
    }

    /// Whether more pairs of faces intersect after a trial than before.
    pub(super) fn adds_crossings(&self, state: &State<'_>, place: &Place, trial: &State<'_>) -> bool {
        let points = |of: &State<'_>| of.mesh.faces_left().map(|f| of.mesh.points(f)).collect::<Vec<Corners>>();
        place.crossings(&state.mesh, &self.faces, &points(trial)) > place.crossings(&state.mesh, &self.faces, &points(&self.state))
    }
}

/// How bad the faces below `target` are, the worst most.
fn badness(state: &State<'_>, target: f64) -> f64 {
    state.mesh.faces_left().map(|f| (1.0 - state.kappa(f) / target).max(0.0)).map(|x| x * x * x).sum()
}

/// A piece after a trial, with its badness.
type Trial<'a> = (f64, State<'a>);

/// The best of all trials of one or two first steps, if it is better than the piece as it is.
fn best_trial<'a>(
    piece: &Piece<'a>,
    target: f64,
    effort: Effort<'_>,
    accept: impl Fn(&State<'a>) -> bool,
    work: &Work<'_>,
) -> Result<Option<State<'a>>> {
    let enough = badness(&piece.state, target) * (1.0 - GAIN);
    let mut trials = try_all(&piece.state, piece.face, target, &accept, work)?;
    trials.truncate(WIDTH);
    let mut found = trials.clone();
    if matches!(effort, Effort::Whole(_)) && trials.first().is_none_or(|best| best.0 > 0.0) {
        for (_, trial) in &trials {
            if let Some(worst) = worst_inside(trial, target) {
                found.extend(try_all(trial, worst, target, &accept, work)?.into_iter().take(WIDTH));
            }
        }
    }
    found.sort_by(|x, y| x.0.total_cmp(&y.0));
    for (_, mut trial) in found.into_iter().take_while(|trial| trial.0 < enough) {
        chase(&mut trial, target, work)?;
        if accept(&trial) {
            return Ok(Some(trial));
        }
    }
    Ok(None)
}

/// One trial for each first step at a face, best first; up to the first that is acceptable and leaves nothing bad.
fn try_all<'a>(start: &State<'a>, face: u32, target: f64, accept: impl Fn(&State<'a>) -> bool, work: &Work<'_>) -> Result<Vec<Trial<'a>>> {
    let mut trials: Vec<Trial<'a>> = Vec::new();
    for first in first_steps(start, face) {
        let mut trial = start.clone();
        // What a step does not touch was chased before.
        let since = trial.activity.begin();
        if take(&mut trial, first) {
            flip_pass(&mut trial, FlipGoal::Shape, since, work)?;
            chase_trial(&mut trial, since, target, work)?;
            let left = badness(&trial, target);
            trials.push((left, trial));
            if left == 0.0 && trials.last().is_some_and(|trial| accept(&trial.1)) {
                break;
            }
        }
    }
    trials.sort_by(|x, y| x.0.total_cmp(&y.0));
    Ok(trials)
}

/// The worst face below `target` with a corner that may go.
fn worst_inside(state: &State<'_>, target: f64) -> Option<u32> {
    let m = &state.mesh;
    let inside = |f: &u32| m.corners(*f).iter().any(|&v| !m.class[v as usize].stays());
    let bad = m.faces_left().filter(inside).map(|f| (state.kappa(f), f)).filter(|x| x.0 < target);
    bad.min_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1))).map(|x| x.1)
}

/// Flips, splits and collapses (both ways) of the edges of a face and of the faces beside it.
pub(super) fn first_steps(state: &State<'_>, face: u32) -> Vec<Operation> {
    let m = &state.mesh;
    let own = [3 * face, 3 * face + 1, 3 * face + 2];
    let beside = own.iter().filter_map(|&h| m.twin(h)).flat_map(|t| [next(t), prev(t)]);
    let mut edges: Vec<u32> = own.into_iter().chain(beside).map(|h| m.twin(h).map_or(h, |t| t.min(h))).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut steps = Vec::new();
    for h in edges {
        let (a, b) = (m.from(h), m.to(h));
        steps.extend([Operation::Collapse(a, b), Operation::Collapse(b, a)]);
        steps.extend([Operation::Flip(a, b), Operation::Split(a, b, state.middle_foot(h))]);
    }
    steps
}

/// Takes a step if it leaves a surface that does not fold.
pub(super) fn take(state: &mut State<'_>, step: Operation) -> bool {
    match step {
        Operation::Flip(a, b) => state.mesh.find(a, b).is_some_and(|h| state.try_flip(h)),
        Operation::Split(a, b, _) => state.mesh.find(a, b).is_some_and(|h| state.try_split(h).is_some()),
        Operation::Collapse(a, b) => {
            let Some(h) = state.mesh.find(a, b) else { return false };
            state.collapse_target(h).is_some_and(|foot| state.try_collapse(h, &foot))
        }
        Operation::Place(v, foot) => {
            state.place(v, &foot);
            true
        }
    }
}

/// Does on the mesh what was done on a piece of it with these vertices.
pub(super) fn redo(state: &mut State<'_>, vertices: &[u32], log: Vec<Operation>) {
    let mut vertices = vertices.to_vec();
    for operation in log {
        match operation {
            Operation::Flip(a, b) => {
                if let Some(h) = state.mesh.find(vertices[a as usize], vertices[b as usize]) {
                    state.flip(h);
                }
            }
            Operation::Collapse(a, b) => {
                if let Some(h) = state.mesh.find(vertices[a as usize], vertices[b as usize]) {
                    state.collapse(h);
                }
            }
            Operation::Split(a, b, foot) => {
                if let Some(h) = state.mesh.find(vertices[a as usize], vertices[b as usize]) {
                    vertices.push(state.split_at(h, &foot));
                }
            }
            Operation::Place(v, foot) => state.place(vertices[v as usize], &foot),
        }
    }
}
