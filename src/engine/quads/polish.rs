//! Last moves of single vertices: away from bad faces, then to where the mean shape around is best.

use super::mixed::Mixed;
use super::smooth::{move_awake, worst};
use crate::error::Result;
use crate::optimize::input::Input;
use crate::vector::{Vec3, add_scaled, cross, unit};
use crate::work::Work;

/// Faces below this quality are chased.
const BAD: f64 = 0.55;
/// Rounds of the chase, and the steps tried in each, in sizes.
const CHASE: usize = 8;
const STEPS: [f64; 3] = [0.2, 0.08, 0.03];

/// Moves single vertices of bad faces in eight directions as long as the worst face around them gets better.
pub(super) fn chase(mesh: &mut Mixed, input: &Input<'_>, work: &Work<'_>) -> Result<()> {
    for _ in 0..CHASE {
        let mut moved = false;
        for v in 0..mesh.position.len() as u32 {
            if v.is_multiple_of(256) {
                work.check()?;
            }
            let i = v as usize;
            if mesh.is_fixed[i] || mesh.around[i].is_empty() {
                continue;
            }
            let mut best = worst(mesh, v, input);
            if best >= BAD {
                continue;
            }
            let (size, [x, y]) = plane_at(mesh, v, input);
            for step in STEPS {
                let mut place = (mesh.position[i], mesh.below[i]);
                let here = place;
                for turn in 0..8 {
                    let (sine, cosine) = (f64::from(turn) * std::f64::consts::FRAC_PI_4).sin_cos();
                    let p = add_scaled(add_scaled(here.0, x, step * size * cosine), y, step * size * sine);
                    let foot = input.project(p, here.1, 0.5 * size);
                    (mesh.position[i], mesh.below[i]) = (foot.position, foot.face);
                    let after = worst(mesh, v, input);
                    if after > best + 1e-3 {
                        best = after;
                        place = (foot.position, foot.face);
                        moved = true;
                    }
                }
                (mesh.position[i], mesh.below[i]) = place;
            }
        }
        if !moved {
            break;
        }
    }
    Ok(())
}

/// Rounds of the polish, and the steps tried, in sizes.
const POLISH: usize = 6;
const POLISH_STEPS: [f64; 3] = [0.12, 0.06, 0.03];
/// Losses of quality below this weigh eleven times.
const LOW: f64 = 0.6;

/// Moves single vertices in four directions as long as the mean shape of the faces around them gets better, where poor shapes weigh most.
pub(super) fn polish(mesh: &mut Mixed, input: &Input<'_>, work: &Work<'_>) -> Result<()> {
    move_awake(mesh, POLISH, work, |mesh, v| {
        let i = v as usize;
        let (size, [x, y]) = plane_at(mesh, v, input);
        let mut best = loss(mesh, v, input);
        let before = best;
        for step in POLISH_STEPS {
            for (dx, dy) in [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)] {
                let here = (mesh.position[i], mesh.below[i]);
                let p = add_scaled(add_scaled(here.0, x, step * size * dx), y, step * size * dy);
                let foot = input.project(p, here.1, 0.5 * size);
                (mesh.position[i], mesh.below[i]) = (foot.position, foot.face);
                let after = loss(mesh, v, input);
                if after < best {
                    best = after;
                } else {
                    (mesh.position[i], mesh.below[i]) = here;
                }
            }
        }
        best < before - 0.01
    })
}

/// Wanted size at a vertex and two directions of the tangent plane.
fn plane_at(mesh: &Mixed, v: u32, input: &Input<'_>) -> (f64, [Vec3; 2]) {
    let foot = input.walk(mesh.position[v as usize], mesh.below[v as usize]);
    let normal = input.normal(&foot);
    let side = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let x = unit(cross(normal, side));
    (input.size(&foot), [x, cross(normal, x)])
}

/// Sum over the faces around a vertex of what they lack, more where they are bad.
fn loss(mesh: &Mixed, v: u32, input: &Input<'_>) -> f64 {
    let one = |q: f64| 1.0 - q + if q < LOW { 10.0 * (LOW - q) } else { 0.0 };
    mesh.around[v as usize].iter().map(|&f| one(mesh.quality_of(mesh.corners(f), input))).sum()
}
