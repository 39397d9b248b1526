//! The arterial tree and the tube: strands with open ends.

use std::f64::consts::{PI, TAU};

use super::cut::Opening;
use super::field::{Field, Primitive};
use super::scan::Body;
use crate::vector::{Vec3, add, add_scaled, norm, scale, sub, unit};

/// Share of its radius by which a strand runs on beyond the plane that cuts it.
const OVERHANG: f64 = 0.6;

/// Trees with more ends than this have forked side branches: their trunk would become too long for a vessel.
const PLAIN: u32 = 40;

/// A tree with `ends` open ends, inlet included: a trunk that forks into two legs (which fork again from 6 ends on), the other
/// ends on side branches that wind around the trunk, which fork, too, above [`PLAIN`] ends. Radii 2.6 to 11 mm.
pub(super) fn tree(ends: u32) -> Body {
    let legs = match ends {
        2 => 0,
        3..=5 => 2,
        _ => 4,
    };
    let ends_at_sides = ends - 1 - legs.max(1);
    let sides = if ends > PLAIN { ends_at_sides.div_ceil(2) } else { ends_at_sides };
    // A forked branch has two ends; an odd number leaves the last branch plain.
    let forks = ends_at_sides - sides;
    let mut forked = Vec::new();
    let length = 90.0 + 17.0 * f64::from(sides.max(2));
    let trunk = |t: f64| -> (Vec3, f64) {
        let bend = [7.0 * (PI * 1.3 * t).sin(), 12.0 * (PI * t).sin() + 9.0 * t, -length * t];
        (bend, 11.0 - 3.0 * t)
    };
    let mut strands = vec![curve(16, trunk)];
    let fork = trunk(1.0).0;
    for leg in 0..legs.min(2) {
        let out = if leg == 0 { -1.0 } else { 1.0 };
        strands.push(curve(8, |t| (add(fork, [out * (4.0 + 26.0 * t) * t.sqrt(), 6.0 * (PI * t).sin(), -62.0 * t]), 6.6 - 0.9 * t)));
        let knee = add(fork, [out * 30.0, 0.0, -62.0]);
        if legs == 4 {
            strands.push(curve(8, |t| (add(knee, [out * 17.0 * t, -7.0 * (2.0 * t).sin(), -52.0 * t]), 5.2 - 0.7 * t)));
            strands.push(curve(8, |t| (add(knee, [-out * 10.0 * t, 24.0 * (1.5 * t).sin(), -38.0 * t + 5.0 * t * t]), 4.6 - 0.8 * t)));
        }
    }
    for side in 0..sides {
        let share = (f64::from(side) + 0.6) / (f64::from(sides) + 0.4);
        let (root, _) = trunk(0.12 + 0.66 * share);
        let turn = TAU * 0.381_966 * f64::from(side) + 0.3;
        let droop = if side.is_multiple_of(2) { 10.0 } else { 22.0 };
        let around = |angle: f64, reach: f64| [reach * angle.cos(), reach * angle.sin(), 0.0];
        strands.push(curve(8, |t| {
            let sweep = add(around(turn + 0.35 * t, 52.0 * t), [0.0, 0.0, 6.0 * (PI * t).sin() - droop * t * t]);
            (add(root, sweep), 4.9 - 1.3 * t)
        }));
        if side < forks {
            forked.push(strands.len() - 1);
            let tip = add(root, add(around(turn + 0.35, 52.0), [0.0, 0.0, -droop]));
            for bend in [-0.55, 0.55] {
                let away = |t: f64| add(around(turn + 0.35 + bend, 34.0 * t), [0.0, 0.0, -8.0 * t]);
                strands.push(curve(4, |t| (add(tip, away(t)), 3.4 - 0.8 * t)));
            }
        }
    }
    let trunks = |s: usize| legs > 0 && s == 0 || legs == 4 && (s == 1 || s == 4);
    let free: Vec<usize> = (0..strands.len()).filter(|s| !trunks(*s) && !forked.contains(s)).collect();
    let mut openings = vec![open(&mut strands[0], false)];
    openings.extend(free.into_iter().map(|s| open(&mut strands[s], true)));
    Body { field: field(strands, 3.0), openings, genus: 0, name: "wall" }
}

/// A straight tube of diameter 20 mm, open at both ends, its axis along x.
pub(super) fn tube(aspect_ratio: f64) -> Body {
    let half = 10.0 * aspect_ratio;
    let mut strand = vec![([-half, 0.0, 0.0], 10.0), ([half, 0.0, 0.0], 10.0)];
    let openings = vec![open(&mut strand, false), open(&mut strand, true)];
    Body { field: field(vec![strand], 1.0), openings, genus: 0, name: "wall" }
}

fn field(strands: Vec<Vec<(Vec3, f64)>>, blend: f64) -> Field {
    Field { primitives: strands.into_iter().map(Primitive::Strand).collect(), blend }
}

fn curve(steps: u32, point: impl Fn(f64) -> (Vec3, f64)) -> Vec<(Vec3, f64)> {
    (0..=steps).map(|k| point(f64::from(k) / f64::from(steps))).collect()
}

/// Lengthens one end of a strand and gives the plane across the point where it ended.
fn open(strand: &mut Vec<(Vec3, f64)>, at_end: bool) -> Opening {
    if !at_end {
        strand.reverse();
    }
    let last = strand.len() - 1;
    let (centre, radius) = strand[last];
    let outward = unit(sub(centre, strand[last - 1].0));
    strand.push((add_scaled(centre, outward, OVERHANG * radius), radius));
    if !at_end {
        strand.reverse();
    }
    // The farthest point beyond the plane is the tip; the lattice adds a fraction of a spacing.
    let reach = 1.25 * norm(scale(outward, (1.0 + OVERHANG) * radius));
    Opening { centre, outward, reach }
}
