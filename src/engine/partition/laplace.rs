//! The multiscale Laplace partition (P2 section 3): a part that is too long or too large is cut in two along a line through
//! the centres of gravity of harmonic maps at all scales.

pub(super) mod harmonic;
pub(super) mod scales;
pub(super) mod sheet;
mod straighten;
mod thread;

use super::two_way::TwoWayCut;
use crate::error::{EngineError, Result};
use crate::vector::Vec2;
use crate::work::Work;
use scales::{Scales, map_scales};
use sheet::Sheet;
use std::f64::consts::PI;
use thread::{Ends, Thread};

/// Directions of the line that are tried, over half a turn.
const DIRECTIONS: u32 = 8;
/// Steps of the search for ends of the line that balance the areas.
const BALANCING: u32 = 6;
/// A side with less than this share of the area asks for balancing.
const LEAST_SHARE: f64 = 0.4;

/// Cuts a connected set of faces of genus 0 with a border in two connected sets.
pub(super) fn cut(sheet: &Sheet, work: &Work<'_>) -> Result<TwoWayCut> {
    let scales = map_scales(sheet, work)?;
    let mut best: Option<Trial> = None;
    let axis = principal_axis(sheet, &scales);
    for k in 0..DIRECTIONS {
        work.check()?;
        let direction = axis + PI * f64::from(k) / f64::from(DIRECTIONS);
        let trial = Trial::new(sheet, &scales, Ends { enter: direction + PI, leave: direction });
        if best.as_ref().is_none_or(|b| trial.cost < b.cost) {
            best = Some(trial);
        }
    }
    let Some(mut best) = best else { return Err(EngineError::invariant("no direction was tried")) };
    if best.share.min(1.0 - best.share) < LEAST_SHARE {
        best = balanced(sheet, &scales, best, work)?;
    }
    let mut second = best.second;
    connect(sheet, &mut second);
    straighten::straighten(sheet, &mut second, work)?;
    let levels = scales.maps.iter().map(|m| m.depth + 1).max().unwrap_or(1);
    let mut cut = TwoWayCut::measured(sheet, second);
    (cut.levels, cut.maps) = (levels, scales.maps.len() as u32);
    Ok(cut)
}

/// Bends the line (both ends to the same side) until the areas are balanced or the bend is large; the best trial.
fn balanced(sheet: &Sheet, scales: &Scales, start: Trial, work: &Work<'_>) -> Result<Trial> {
    let straight = start.ends;
    // What is on the left grows as the ends turn to the right.
    let (mut low, mut high) = if start.share < 0.5 { (0.0, 0.45 * PI) } else { (-0.45 * PI, 0.0) };
    let mut best = start;
    for _ in 0..BALANCING {
        work.check()?;
        let bend = 0.5 * (low + high);
        let trial = Trial::new(sheet, scales, Ends { enter: straight.enter + bend, leave: straight.leave - bend });
        if trial.share < 0.5 {
            low = bend
        } else {
            high = bend
        }
        if trial.cost < best.cost {
            best = trial;
        }
    }
    Ok(best)
}

/// The direction in which the vertices of the first map vary most (Alliez 2002; P2 section 3).
fn principal_axis(sheet: &Sheet, scales: &Scales) -> f64 {
    let first = (0..sheet.triangles.len()).filter(|&f| scales.face_map[f] == 0).map(|f| scales.face_at[f]);
    axis_of(scales.maps[0].gravity, first)
}

/// Direction of the larger principal moment of some points about a centre.
pub(super) fn axis_of(centre: Vec2, points: impl Iterator<Item = Vec2>) -> f64 {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = [p[0] - centre[0], p[1] - centre[1]];
        (xx, xy, yy) = (xx + d[0] * d[0], xy + d[0] * d[1], yy + d[1] * d[1]);
    }
    0.5 * (2.0 * xy).atan2(xx - yy)
}

/// A line and what it cuts.
#[derive(Debug)]
struct Trial {
    ends: Ends,
    second: Vec<bool>,
    /// Share of the area on the left.
    share: f64,
    cost: f64,
}

impl Trial {
    fn new(sheet: &Sheet, scales: &Scales, ends: Ends) -> Trial {
        let thread = Thread::new(scales, ends);
        let faces = 0..sheet.triangles.len();
        let left: Vec<bool> = faces.map(|f| thread.is_left(scales, scales.face_map[f], scales.face_at[f])).collect();
        let (share, length) = share_and_length(sheet, &left);
        let off = ((share - 0.5).abs() - (0.5 - LEAST_SHARE)).max(0.0);
        Trial { ends, second: left, share, cost: length * (1.0 + 10.0 * off) }
    }
}

/// Share of the area that is marked, and the length of the border between marked and unmarked.
pub(super) fn share_and_length(sheet: &Sheet, marked: &[bool]) -> (f64, f64) {
    let (mut area, mut length) = (0.0, 0.0);
    for (f, _) in marked.iter().enumerate().filter(|m| *m.1) {
        area += sheet.area[f];
        for h in 3 * f..3 * f + 3 {
            let t = sheet.twin[h];
            if t != sheet::NONE && !marked[t as usize / 3] {
                length += sheet.length[h];
            }
        }
    }
    let total = sheet.total_area();
    (if total > 0.0 { area / total } else { 0.5 }, length)
}

/// Makes both sides connected and not empty: all but the component of largest area of each side change sides.
pub(super) fn connect(sheet: &Sheet, second: &mut [bool]) {
    for turn in [false, true, false] {
        let components = components(sheet, second);
        let area = |set: &Vec<u32>| set.iter().map(|&f| sheet.area[f as usize]).sum::<f64>();
        let of_side = || components.iter().filter(|set| second[set[0] as usize] == turn);
        let Some(largest) = of_side().max_by(|a, b| area(a).total_cmp(&area(b)).then(b[0].cmp(&a[0]))) else {
            if let Some(f) = last_reached(sheet) {
                second[f as usize] = turn;
            }
            continue;
        };
        let moved: Vec<u32> = of_side().filter(|s| s[0] != largest[0]).flatten().copied().collect();
        moved.into_iter().for_each(|f| second[f as usize] = !turn);
    }
}

/// Components of both sides, in order of their first face.
pub(super) fn components(sheet: &Sheet, second: &[bool]) -> Vec<Vec<u32>> {
    let mut seen = vec![false; second.len()];
    let mut sets = Vec::new();
    for seed in 0..second.len() as u32 {
        if std::mem::replace(&mut seen[seed as usize], true) {
            continue;
        }
        let mut set = vec![seed];
        let mut head = 0;
        while head < set.len() {
            for g in sheet.crossings(set[head]) {
                if second[g as usize] == second[seed as usize] && !std::mem::replace(&mut seen[g as usize], true) {
                    set.push(g);
                }
            }
            head += 1;
        }
        sets.push(set);
    }
    sets
}

/// A face whose loss leaves the rest connected: the last one a breadth-first search reaches.
fn last_reached(sheet: &Sheet) -> Option<u32> {
    components(sheet, &vec![false; sheet.triangles.len()]).first().and_then(|set| set.last().copied())
}
