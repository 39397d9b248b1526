//! Smoothing: every free vertex goes to the mean of where the regular polygons nearest to its faces want it, on the input surface.

use super::mixed::Mixed;
use super::shape::nearest_regular;
use crate::error::Result;
use crate::optimize::input::Input;
use crate::vector::{Vec3, add_scaled, distance, lerp, scale};
use crate::work::Work;

/// How sides of the nearest square are drawn to the wanted size.
const TOWARDS_SIZE: f64 = 0.4;
/// Moves by less than this share of the size do not wake the neighbours up.
const STILL: f64 = 0.004;
/// Faces above this quality may lose some of it for better ones.
const GOOD: f64 = 0.72;

/// Where the faces around a vertex want it; bad ones weigh more.
fn wanted(mesh: &Mixed, v: u32, size: f64) -> Option<Vec3> {
    let mut sum = ([0.0; 3], 0.0);
    let mut places = [[0.0; 3]; 4];
    for &f in &mesh.around[v as usize] {
        let corners = mesh.corners(f);
        let (points, count) = mesh.points(corners);
        let points = &points[..count];
        nearest_regular(points, size, TOWARDS_SIZE, &mut places);
        let shape = super::shape::quality(points);
        let weight = 1.0 + 4.0 * (1.0 - shape) * (1.0 - shape);
        let k = corners.iter().position(|&c| c == v)?;
        sum = (add_scaled(sum.0, places[k], weight), sum.1 + weight);
    }
    (sum.1 > 0.0).then(|| scale(sum.0, 1.0 / sum.1)).filter(|p| p.iter().all(|x| x.is_finite()))
}

pub(super) fn worst(mesh: &Mixed, v: u32, input: &Input<'_>) -> f64 {
    mesh.around[v as usize].iter().map(|&f| mesh.quality_of(mesh.corners(f), input)).fold(1.0, f64::min)
}

/// Offers free vertices to `step` at most `rounds` times, after the first only those on faces of vertices for which it was true.
pub(super) fn move_awake(mesh: &mut Mixed, rounds: usize, work: &Work<'_>, mut step: impl FnMut(&mut Mixed, u32) -> bool) -> Result<()> {
    let count = mesh.position.len();
    let mut is_awake = vec![true; count];
    for _ in 0..rounds {
        let mut next = vec![false; count];
        let mut moved = false;
        for v in 0..count as u32 {
            if v.is_multiple_of(256) {
                work.check()?;
            }
            let i = v as usize;
            if is_awake[i] && !mesh.is_fixed[i] && !mesh.around[i].is_empty() && step(mesh, v) {
                moved = true;
                mesh.around[i].iter().flat_map(|&f| mesh.corners(f)).for_each(|&w| next[w as usize] = true);
            }
        }
        is_awake = next;
        if !moved {
            break;
        }
    }
    Ok(())
}

/// Moves the free vertices at most `rounds` times, only those near others that moved. Curve vertices stay bit-identical.
pub(super) fn smooth(mesh: &mut Mixed, input: &Input<'_>, rounds: usize, work: &Work<'_>) -> Result<()> {
    move_awake(mesh, rounds, work, |mesh, v| {
        let i = v as usize;
        let here = (mesh.position[i], mesh.below[i]);
        let size = input.size(&input.walk(here.0, here.1));
        let Some(goal) = wanted(mesh, v, size) else { return false };
        let before = worst(mesh, v, input);
        for share in [1.0, 0.4] {
            let foot = input.project(lerp(here.0, goal, share), here.1, 0.5 * size);
            (mesh.position[i], mesh.below[i]) = (foot.position, foot.face);
            let after = worst(mesh, v, input);
            if after >= before.min(GOOD) {
                break;
            }
            (mesh.position[i], mesh.below[i]) = here;
        }
        distance(mesh.position[i], here.0) > STILL * size
    })
}
