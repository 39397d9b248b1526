//! Which maps are tried for a patch and in which order (P1 sections 5, 6.4 and 8, figure 23), and what comes out of them.

use super::map::{MapSpec, MapVerdict, SolvedMap};
use super::outcome::{Chart, ChartAttempt, ChartOutcome, Filling, HoleFilling};
use super::spec::{BoundaryShape, ChartMethod, ChartSpec, Holes, OuterLoop, Pins, check_vertex};
use super::{pins, validity};
use crate::error::{Element, EngineError, Location, Reason, Result};
use crate::patch::Patch;
use crate::vector::{Vec2, add, scale};

/// The maps to try for a patch, in order. `spec` has local vertices.
///
/// # Errors
/// [`Reason::PatchTopology`] for a closed patch; [`Reason::BadParameter`] if the spec does not fit the patch: a vertex that is not in
/// it, an outer vertex on no loop.
pub fn candidate_maps(patch: &Patch, spec: &ChartSpec) -> Result<Vec<MapSpec>> {
    spec.validate()?;
    if patch.loops.is_empty() || patch.triangles.is_empty() {
        return Err(EngineError::new(Reason::PatchTopology, "the patch has no faces or no boundary")
            .with_hint("partition the surface into patches of genus 0 with a boundary"));
    }
    let outer = outer_loop(patch, spec.outer)?;
    let methods: Vec<ChartMethod> = match spec.method {
        Some(method) => vec![method],
        None => vec![ChartMethod::SpectralConformal, ChartMethod::LeastSquaresConformal, ChartMethod::MeanValue],
    };
    let mut maps = Vec::new();
    for method in methods {
        let fillings = fillings(method, spec.holes, patch.loops.len(), outer);
        let base =
            MapSpec { method, outer, filling: Filling::default(), pins: Vec::new(), targets: Vec::new(), boundary: spec.boundary.clone() };
        if method == ChartMethod::LeastSquaresConformal {
            let (choices, targets) = pin_choices(patch, outer, &spec.pins)?;
            // Other pins cost next to nothing, another filling a factorization.
            let first = fillings.iter().take(1).flat_map(|&filling| choices.iter().map(move |pins| (filling, pins)));
            let later = fillings.iter().skip(1).flat_map(|&filling| choices.iter().take(1).map(move |pins| (filling, pins)));
            let all = first.chain(later);
            maps.extend(all.map(|(filling, pins)| MapSpec { filling, pins: pins.clone(), targets: targets.clone(), ..base.clone() }));
        } else {
            // Without a choice by the caller, the automatic chart ends with one mean value map.
            let count = if spec.method.is_none() && method == ChartMethod::MeanValue { 1 } else { fillings.len() };
            maps.extend(fillings[..count].iter().map(|&filling| MapSpec { filling, ..base.clone() }));
        }
    }
    Ok(maps)
}

fn outer_loop(patch: &Patch, outer: OuterLoop) -> Result<usize> {
    match outer {
        OuterLoop::Longest => Ok(0),
        OuterLoop::Through(v) => {
            check_vertex(patch, v, "outer_vertex")?;
            patch.loops.iter().position(|ring| ring.contains(&v)).ok_or_else(|| {
                EngineError::bad_parameter("outer_vertex", "the vertex is on no boundary loop of the patch")
                    .with_locations([vertex_location(patch, v)])
            })
        }
    }
}

/// Virtual triangles to try for a patch of `loops` loops. Held loops need filled holes to be one-to-one; free ones are tried bare first.
fn fillings(method: ChartMethod, holes: Holes, loops: usize, outer: usize) -> Vec<Filling> {
    let filling = |holes, ears| Filling { holes, ears };
    let (open, centre, plane) = (HoleFilling::Open, HoleFilling::CentreVertex, HoleFilling::MeanPlane);
    let chosen = match holes {
        Holes::Automatic => None,
        Holes::Open => Some(open),
        Holes::CentreVertex => Some(centre),
        Holes::MeanPlane => Some(plane),
    };
    match (chosen, method.has_fixed_boundary(), loops > 1) {
        (Some(holes), _, true) => vec![filling(holes, false)],
        (None, true, true) => vec![filling(centre, false), filling(plane, false), filling(open, false)],
        (_, true, false) => vec![filling(open, false)],
        (_, false, false) => vec![filling(open, false), filling(open, true)],
        (None, false, true) if outer != 0 => vec![filling(centre, false), filling(plane, false), filling(centre, true)],
        (None, false, true) => {
            vec![filling(open, false), filling(centre, false), filling(plane, false), filling(open, true), filling(centre, true)]
        }
    }
}

/// Choices of pinned vertices, and targets if they belong to the map.
fn pin_choices(patch: &Patch, outer: usize, wanted: &Pins) -> Result<(Vec<Vec<u32>>, Vec<Vec2>)> {
    let ring = &patch.loops[outer];
    let farthest = || pins::farthest(ring, &patch.positions);
    let inertia = || pins::inertia(ring, &patch.positions, &patch.triangles);
    let pair = |(p, q): (u32, u32)| vec![p, q];
    let choices = match wanted {
        Pins::Farthest => vec![pair(farthest())],
        Pins::Inertia => vec![pair(inertia())],
        Pins::Automatic => {
            let far = farthest();
            let mut choices: Vec<Vec<u32>> = Vec::new();
            for (p, q) in [far, inertia(), (far.0, pins::half_way(ring, &patch.positions, far.0))] {
                // The same pair twice would give the same map twice.
                if !choices.iter().any(|c| c.contains(&p) && c.contains(&q)) {
                    choices.push(pair((p, q)));
                }
            }
            choices
        }
        Pins::Given(given) => {
            given.iter().try_for_each(|pin| check_vertex(patch, pin.vertex, "pins"))?;
            let targets = if given.len() > 2 { given.iter().filter_map(|pin| pin.target).collect() } else { Vec::new() };
            return Ok((vec![given.iter().map(|pin| pin.vertex).collect()], targets));
        }
    };
    Ok((choices, Vec::new()))
}

/// The map to try after those already solved; `None` if one is usable or nothing is left. No two of `maps` have method, filling and pins
/// in common, as those of [`candidate_maps`].
pub fn next_map<'a>(maps: &'a [MapSpec], tried: &[impl std::ops::Deref<Target = SolvedMap>]) -> Option<&'a MapSpec> {
    if tried.last().is_some_and(|map| map.verdict == MapVerdict::Usable) {
        return None;
    }
    // No map of a tube is even: once one is one-to-one and merely crowded, only filled holes can better it.
    let crowded = tried.iter().any(|map| matches!(map.verdict, MapVerdict::Crowded));
    let begun = tried.last().map_or(0, |last| {
        let same =
            |map: &MapSpec| map.method == last.attempt.method && map.filling == last.attempt.filling && map.pins == last.attempt.pins;
        maps.iter().position(same).map_or(maps.len(), |at| at + 1)
    });
    let may_help = |map: &&MapSpec| {
        let filled = map.filling.holes != HoleFilling::Open && !map.filling.ears && map.method != ChartMethod::MeanValue;
        !crowded || filled
    };
    maps[begun..].iter().find(may_help)
}

/// The chart, from the maps that were tried, or why there is none. A refusal ([`Reason::ChartFailed`], if the spec names a method and no
/// map of it is one-to-one) has boundary edges that meet and flipped faces (patch-local ids) as locations.
pub fn conclude(patch: &Patch, spec: &ChartSpec, tried: &[impl std::ops::Deref<Target = SolvedMap>]) -> ChartOutcome {
    let attempts: Vec<ChartAttempt> = tried.iter().map(|map| map.attempt.clone()).collect();
    if let Some(last) = tried.last().filter(|map| map.verdict == MapVerdict::Usable) {
        let uv = match &spec.pins {
            Pins::Given(given) if given.len() == 2 => to_targets(&last.uv, given.iter().map(|pin| (pin.vertex, pin.target)).collect()),
            _ => None,
        };
        if let Some(uv) = &uv
            && !validity::flipped_faces(&patch.triangles, uv).is_empty()
        {
            return ChartOutcome::Refused(
                EngineError::new(Reason::ChartFailed, "rounding at the targets of the pins flips faces")
                    .with_hint("move the targets closer to the origin, or farther apart"),
            );
        }
        let uv = uv.unwrap_or_else(|| last.uv.clone());
        return ChartOutcome::Mapped(Chart { uv, method: last.attempt.method, attempts, distortion: last.distortion });
    }
    let crowded = tried.iter().find(|map| matches!(map.verdict, MapVerdict::Crowded));
    if let Some(crowded) = crowded {
        return ChartOutcome::MustSplit { attempts, reason: crowded.attempt.rejected.clone() };
    }
    let told: Vec<String> = attempts.iter().map(|a| format!("{}: {}", a.method.name(), a.rejected)).collect();
    let reason = format!("no chart is one-to-one ({})", told.join("; "));
    let Some(method) = spec.method else { return ChartOutcome::MustSplit { attempts, reason } };
    let blame = tried.iter().rev().find_map(|map| match &map.verdict {
        MapVerdict::NotBijective { flipped, crossing } => Some((flipped, crossing)),
        _ => None,
    });
    let faces = blame.iter().flat_map(|(flipped, _)| flipped.iter().map(|&f| face_location(patch, f)));
    let edges = blame.iter().flat_map(|(_, crossing)| crossing.iter().flatten().map(|&e| edge_location(patch, e)));
    let error = EngineError::new(Reason::ChartFailed, format!("the requested {} map fails: {reason}", method.name()))
        .with_hint(match &spec.boundary.shape {
            BoundaryShape::Rectangle { .. } | BoundaryShape::Polygon { .. } => {
                "faces with all corners on one straight side go flat: name the corners, or take a circle or an ellipse"
            }
            _ => "let the method be chosen automatically, or split the patch",
        })
        .with_locations(edges.chain(faces));
    ChartOutcome::Refused(error)
}

/// The similarity that takes two vertices of a finished map to their targets; `None` without targets.
fn to_targets(uv: &[Vec2], pins: Vec<(u32, Option<Vec2>)>) -> Option<Vec<Vec2>> {
    let [(p, Some(a)), (q, Some(b))] = pins[..] else { return None };
    let (from, to) = (uv[p as usize], uv[q as usize]);
    let (d, e) = ([to[0] - from[0], to[1] - from[1]], [b[0] - a[0], b[1] - a[1]]);
    let square = d[0] * d[0] + d[1] * d[1];
    // e / d as complex numbers.
    let (re, im) = ((e[0] * d[0] + e[1] * d[1]) / square, (e[1] * d[0] - e[0] * d[1]) / square);
    let moved = |w: &Vec2| {
        let (x, y) = (w[0] - from[0], w[1] - from[1]);
        [a[0] + re * x - im * y, a[1] + im * x + re * y]
    };
    let mut out: Vec<Vec2> = uv.iter().map(moved).collect();
    (out[p as usize], out[q as usize]) = (a, b);
    Some(out)
}

pub(super) fn vertex_location(patch: &Patch, vertex: u32) -> Location {
    Location { element: Element::Vertex, ids: vec![vertex], position: patch.positions[vertex as usize] }
}

fn edge_location(patch: &Patch, edge: [u32; 2]) -> Location {
    let [a, b] = edge.map(|v| patch.positions[v as usize]);
    Location { element: Element::Edge, ids: edge.to_vec(), position: scale(add(a, b), 0.5) }
}

pub(super) fn face_location(patch: &Patch, face: u32) -> Location {
    let corners = patch.triangles[face as usize].map(|v| patch.positions[v as usize]);
    let position = std::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
    Location { element: Element::Face, ids: vec![face], position }
}
