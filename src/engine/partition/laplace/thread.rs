//! The split line (P2 section 3, step 5): from one side of the unit disk to the other through the centres of gravity of the
//! clusters, and within each cluster likewise, down to the last scale.
//!
//! In every frame the line is a path without crossings between two points of the unit circle, so that all of it together is
//! one arc that cuts the disk in two, and on which side of it a point lies is decided in the frame that the point is resolved in.

use super::scales::{Scale, Scales, to_frame};
use crate::vector::Vec2;
use std::f64::consts::{PI, TAU};

/// Where the line leads into the disk of a cluster and out of it differs by at least this angle: what lies between
/// is the share of its girth that a branch gives to one side.
const LEAST_TURN: f64 = 0.8 * PI;
/// Besides clusters, holes of less radius than this are threaded.
const SMALL_HOLE: f64 = 0.02;
/// Paths through more stops than this are only sorted.
const MOST_ORDERED: usize = 600;
/// Corners of the arc that closes the outline of one side, per full turn.
const ARC: f64 = 12.0;
/// Its radius.
const FAR: f64 = 8.0;

/// Where the split line enters and leaves the unit disk.
#[derive(Debug, Clone, Copy)]
pub(in crate::partition) struct Ends {
    /// Direction of the point where it enters, in radians.
    pub(in crate::partition) enter: f64,
    /// Direction of the point where it leaves.
    pub(in crate::partition) leave: f64,
}

/// A split line: in each frame the outline of what lies on its left.
#[derive(Debug)]
pub(in crate::partition) struct Thread {
    outlines: Vec<Vec<Vec2>>,
}

impl Thread {
    /// Lays the line through all maps.
    pub(in crate::partition) fn new(scales: &Scales, ends: Ends) -> Thread {
        let mut outlines = vec![Vec::new(); scales.maps.len()];
        let mut directions = vec![ends; scales.maps.len()];
        for m in 0..scales.maps.len() {
            let map = &scales.maps[m];
            let stops = stops(scales, map);
            let path = path_through(directions[m], &stops);
            for k in 1..path.len() - 1 {
                let Some(child) = path[k].child else { continue };
                let (before, here, after) = (path[k - 1].at, path[k].at, path[k + 1].at);
                directions[child as usize] = spread(Ends { enter: angle(here, before), leave: angle(here, after) });
            }
            outlines[m] = outline(&path, directions[m]);
        }
        Thread { outlines }
    }

    /// Whether a point of the frame of a map lies on the left of the line.
    pub(in crate::partition) fn is_left(&self, scales: &Scales, map: u32, at: Vec2) -> bool {
        let (mut map, mut at) = (map, at);
        while let Some(child) = disk_around(scales, map, at) {
            let frame = &scales.maps[child as usize];
            at = to_frame(at, frame.centre, frame.radius);
            map = child;
        }
        contains(&self.outlines[map as usize], at)
    }
}

/// The cluster whose disk holds a point.
fn disk_around(scales: &Scales, map: u32, at: Vec2) -> Option<u32> {
    let near = |child: &&u32| {
        let c = &scales.maps[**child as usize];
        (at[0] - c.centre[0]).abs() < c.radius && (at[0] - c.centre[0]).hypot(at[1] - c.centre[1]) < c.radius
    };
    scales.maps[map as usize].children.iter().find(near).copied()
}

/// A point the line must pass.
#[derive(Debug, Clone, Copy)]
struct Stop {
    at: Vec2,
    child: Option<u32>,
}

/// Clusters and small holes; at the last scale all holes, or the centre of gravity.
fn stops(scales: &Scales, map: &Scale) -> Vec<Stop> {
    let mut stops: Vec<Stop> = map.children.iter().map(|&c| Stop { at: scales.maps[c as usize].centre, child: Some(c) }).collect();
    let last = stops.is_empty();
    stops.extend(map.holes.iter().filter(|h| last || h.1 < SMALL_HOLE).map(|h| Stop { at: h.0, child: None }));
    if stops.is_empty() {
        stops.push(Stop { at: map.gravity, child: None });
    }
    stops
}

fn angle(from: Vec2, to: Vec2) -> f64 {
    (to[1] - from[1]).atan2(to[0] - from[0])
}

fn on_circle(angle: f64) -> Vec2 {
    let (sin, cos) = angle.sin_cos();
    [cos, sin]
}

/// Turn from one direction to another, in (-pi, pi].
fn turn(from: f64, to: f64) -> f64 {
    let t = (to - from).rem_euclid(TAU);
    if t > PI { t - TAU } else { t }
}

/// Moves both ends apart evenly until they differ by [`LEAST_TURN`].
fn spread(ends: Ends) -> Ends {
    let t = turn(ends.enter, ends.leave);
    let lacking = (0.5 * (LEAST_TURN - t.abs())).max(0.0).copysign(t);
    Ends { enter: ends.enter - lacking, leave: ends.leave + lacking }
}

fn gap(a: Stop, b: Stop) -> f64 {
    (a.at[0] - b.at[0]).hypot(a.at[1] - b.at[1])
}

/// A short path through all stops between two points of the unit circle: sorted along the way, then improved by reversing and
/// moving stretches until it is locally shortest, which leaves no crossing.
fn path_through(ends: Ends, stops: &[Stop]) -> Vec<Stop> {
    let (first, last) = (Stop { at: on_circle(ends.enter), child: None }, Stop { at: on_circle(ends.leave), child: None });
    let way = [last.at[0] - first.at[0], last.at[1] - first.at[1]];
    let mut inner = stops.to_vec();
    inner.sort_by(|a, b| (a.at[0] * way[0] + a.at[1] * way[1]).total_cmp(&(b.at[0] * way[0] + b.at[1] * way[1])));
    let mut path = vec![first];
    path.extend(inner);
    path.push(last);
    if path.len() <= MOST_ORDERED {
        while reverse_stretches(&mut path) | move_stops(&mut path) {}
    }
    path
}

/// Relative gain that counts.
const GAIN: f64 = 1e-9;

/// Reverses stretches of the path where that shortens it.
fn reverse_stretches(path: &mut [Stop]) -> bool {
    let mut improved = false;
    for i in 0..path.len() - 2 {
        for j in i + 2..path.len() - 1 {
            let now = gap(path[i], path[i + 1]) + gap(path[j], path[j + 1]);
            if gap(path[i], path[j]) + gap(path[i + 1], path[j + 1]) < now * (1.0 - GAIN) {
                path[i + 1..=j].reverse();
                improved = true;
            }
        }
    }
    improved
}

/// Moves single stops to other places of the path where that shortens it.
fn move_stops(path: &mut Vec<Stop>) -> bool {
    let mut improved = false;
    for i in 1..path.len() - 1 {
        let saved = gap(path[i - 1], path[i]) + gap(path[i], path[i + 1]) - gap(path[i - 1], path[i + 1]);
        let detour = |j: usize| gap(path[j], path[i]) + gap(path[i], path[j + 1]) - gap(path[j], path[j + 1]);
        let best = (0..path.len() - 1).filter(|&j| j != i && j + 1 != i).min_by(|&a, &b| detour(a).total_cmp(&detour(b)));
        if let Some(j) = best.filter(|&j| detour(j) < saved - GAIN) {
            let stop = path.remove(i);
            path.insert(if j > i { j } else { j + 1 }, stop);
            improved = true;
        }
    }
    improved
}

/// The path, closed far outside the unit disk on its left.
fn outline(path: &[Stop], ends: Ends) -> Vec<Vec2> {
    let mut points: Vec<Vec2> = path.iter().map(|s| s.at).collect();
    let sweep = (ends.enter - ends.leave).rem_euclid(TAU);
    let corners = (sweep / TAU * ARC).ceil().max(1.0);
    for k in 0..=corners as u32 {
        points.push(on_circle(ends.leave + sweep * f64::from(k) / corners).map(|x| FAR * x));
    }
    points
}

/// Whether a point lies in a polygon (crossings of a ray).
fn contains(polygon: &[Vec2], at: Vec2) -> bool {
    let mut inside = false;
    let Some(mut a) = polygon.last() else { return false };
    for b in polygon {
        if (a[1] > at[1]) != (b[1] > at[1]) {
            let side = (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0]);
            inside ^= (side > 0.0) == (b[1] > a[1]);
        }
        a = b;
    }
    inside
}
