//! Division of a boundary or feature curve whose corners equal edges would cut: the best chain of points by dynamic programming,
//! weighing edge lengths against the distance of the chords from the curve.

use super::discretize::{Measured, invert, point_at};
use super::{CurveKind, CurvePolyline};
use crate::error::Result;
use crate::vector::{Vec3, add_scaled, distance, dot, sub};
use crate::work::Work;

/// Chords may be this far from the curve, in sizes, without cost.
const FREE_DEVIATION: f64 = 0.07;
/// Weight of the squared surplus deviation against the squared logarithm of the edge length in sizes.
const DEVIATION_WEIGHT: f64 = 200.0;
/// Chords should not be farther than this from the curve, in sizes.
const MOST_DEVIATION: f64 = 0.085;
/// Weight of the surplus over that: 0.01 sizes weigh as much as an edge of half or twice the size.
const EXCESS_WEIGHT: f64 = 5000.0;
/// Candidates per size, besides the vertices of the polyline.
const CANDIDATES_PER_SIZE: f64 = 12.0;
/// Shortest and longest edge considered, in sizes.
const EDGE_RANGE: [f64; 2] = [0.35, 1.7];
/// Shortest edge considered on the boundary, whose notches are kept even where they are small.
const SHORTEST_ON_BOUNDARY: f64 = 0.12;
/// Chords farther than this from the curve, in sizes, make a curve worth the effort.
pub(super) const CUT_DEVIATION: f64 = 0.09;

fn distance_to_segment(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let d = sub(b, a);
    let t = (dot(sub(p, a), d) / dot(d, d).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    distance(p, add_scaled(a, d, t))
}

/// Largest distance, in sizes, of the polyline's vertices between two positions from the chord of these positions.
pub(super) fn deviation(polyline: &CurvePolyline, from: f64, to: f64) -> f64 {
    let ((a, _), (b, _)) = (point_at(polyline, from), point_at(polyline, to));
    let inner = from.floor() as usize + 1..(to.ceil() as usize).min(polyline.points.len());
    inner.map(|j| distance_to_segment(polyline.points[j], a, b) / polyline.sizes[j]).fold(0.0, f64::max)
}

/// Positions where points may be put, increasing, with their measure: equal steps and the vertices in between, thinned where
/// they are dense.
fn candidates(polyline: &CurvePolyline, exact: &Measured) -> Vec<(f64, f64)> {
    let total = exact.measure.last().copied().unwrap_or(0.0);
    let steps = (total * CANDIDATES_PER_SIZE).ceil().max(2.0) as usize;
    let gap = total / steps as f64;
    let even = (0..=steps).map(|i| total * i as f64 / steps as f64);
    let mut all: Vec<(f64, f64)> = invert(exact, even.clone()).into_iter().zip(even).collect();
    // Of the vertices in one step keep the one that is most of a corner.
    let count = polyline.points.len();
    let bend = |j: usize| {
        let (a, b) = (sub(polyline.points[j], polyline.points[j - 1]), sub(polyline.points[j + 1], polyline.points[j]));
        crate::vector::angle_between(a, b)
    };
    let mut best: Option<(usize, usize)> = None;
    for j in 1..count - 1 {
        let cell = (exact.measure[j] / gap) as usize;
        match best {
            Some((c, k)) if c == cell && bend(k) >= bend(j) => {}
            Some((c, k)) if c != cell => {
                all.push((k as f64, exact.measure[k]));
                best = Some((cell, j));
            }
            _ => best = Some((cell, j)),
        }
    }
    all.extend(best.map(|(_, k)| (k as f64, exact.measure[k])));
    all.sort_by(|x, y| x.0.total_cmp(&y.0));
    all.dedup_by(|x, y| x.0 == y.0);
    all
}

/// Inner positions of the best chain; `None` if no chain has edges in the range considered.
pub(super) fn divide(polyline: &CurvePolyline, exact: &Measured, work: &Work<'_>) -> Result<Option<Vec<f64>>> {
    let places = candidates(polyline, exact);
    let last = places.len() - 1;
    let shortest = if polyline.kind == CurveKind::Boundary { SHORTEST_ON_BOUNDARY } else { EDGE_RANGE[0] };
    let mut cost = vec![(f64::INFINITY, 0usize); places.len()];
    cost[0].0 = 0.0;
    for j in 1..=last {
        if j % 512 == 0 {
            work.step(j, last)?;
        }
        for i in (0..j).rev() {
            let length = places[j].1 - places[i].1;
            if length > EDGE_RANGE[1] {
                break;
            }
            if length < shortest || !cost[i].0.is_finite() {
                continue;
            }
            let deviation = deviation(polyline, places[i].0, places[j].0);
            let (surplus, excess) = ((deviation - FREE_DEVIATION).max(0.0), (deviation - MOST_DEVIATION).max(0.0));
            let sum = cost[i].0 + length.ln() * length.ln() + DEVIATION_WEIGHT * surplus * surplus + EXCESS_WEIGHT * excess * excess;
            if sum < cost[j].0 {
                cost[j] = (sum, i);
            }
        }
    }
    if !cost[last].0.is_finite() {
        return Ok(None);
    }
    let mut inner = Vec::new();
    let mut at = cost[last].1;
    while at != 0 {
        inner.push(places[at].0);
        at = cost[at].1;
    }
    inner.reverse();
    Ok(Some(inner))
}
