//! The mean value convex combination map onto a circle (P1 eq. 10-14, 24-26; Floater 2003): one-to-one for every disc in exact
//! arithmetic, whatever the triangles look like.

use super::assembly::compress;
use super::conformal::solver_error;
use super::domain::Domain;
use crate::error::{EngineError, Reason, Result};
use crate::vector::Vec2;
use crate::work::Work;
use remesh_linalg::RealLu;

const FIXED: u32 = u32::MAX;

/// Maps the outer loop to the unit circle by arc length and every other vertex to a convex combination of its neighbours.
/// Returns the vertices of the patch (not the centres of the caps).
///
/// # Errors
/// [`Reason::SolverSingular`]; cancellation.
pub(super) fn mean_value(domain: &Domain<'_>, work: &Work<'_>) -> Result<Vec<Vec2>> {
    let mut uv = circle(domain);
    let mut unknown = vec![0u32; domain.size()];
    domain.outer.iter().for_each(|&v| unknown[v as usize] = FIXED);
    let mut count = 0;
    for slot in unknown.iter_mut().filter(|slot| **slot != FIXED) {
        *slot = count;
        count += 1;
    }
    if count > 0 {
        let values = solve(domain, &unknown, count as usize, &uv, work)?;
        for (slot, uv) in unknown.iter().zip(&mut uv).filter(|(slot, _)| **slot != FIXED) {
            *uv = [values[*slot as usize], values[(count + *slot) as usize]];
        }
    }
    uv.truncate(domain.patch.positions.len());
    if uv.iter().flatten().any(|x| !x.is_finite()) {
        return Err(EngineError::new(Reason::SolverSingular, "the mean value map is not finite"));
    }
    Ok(uv)
}

/// The outer loop on the circle (P1 eq. 26), all else at the origin.
fn circle(domain: &Domain<'_>) -> Vec<Vec2> {
    let lengths = domain.outer_lengths();
    let total: f64 = lengths.iter().sum();
    let mut uv = vec![[0.0; 2]; domain.size()];
    let mut run = 0.0;
    for (&v, length) in domain.outer.iter().zip(lengths) {
        let (sin, cos) = (std::f64::consts::TAU * run / total).sin_cos();
        uv[v as usize] = [cos, sin];
        run += length;
    }
    uv
}

/// Weights `w_ij` of all pairs in a triangle, as (i, j, weight): tan(half the angle at i) over the length of ij (P1 eq. 14).
fn weights(domain: &Domain<'_>, t: [u32; 3]) -> [(u32, u32, f64); 6] {
    let flat = domain.flat(t).thickened();
    let (cot, sides) = (flat.cotangents(), flat.sides());
    let mut out = [(0, 0, 0.0); 6];
    for k in 0..3 {
        let root = 1.0f64.hypot(cot[k]);
        let half = if cot[k] > 0.0 { 1.0 / (root + cot[k]) } else { root - cot[k] };
        let (next, prev) = ((k + 1) % 3, (k + 2) % 3);
        out[2 * k] = (t[k], t[next], half / sides[k]);
        out[2 * k + 1] = (t[k], t[prev], half / sides[prev]);
    }
    out
}

fn solve(domain: &Domain<'_>, unknown: &[u32], count: usize, uv: &[Vec2], work: &Work<'_>) -> Result<Vec<f64>> {
    let mut sums = vec![0.0; domain.size()];
    let mut rhs = vec![0.0; 2 * count];
    for (i, _, w) in domain.triangles().flat_map(|t| weights(domain, t)) {
        sums[i as usize] += w;
    }
    for (i, j, w) in domain.triangles().flat_map(|t| weights(domain, t)) {
        let row = unknown[i as usize];
        if row != FIXED && unknown[j as usize] == FIXED {
            rhs[row as usize] += w / sums[i as usize] * uv[j as usize][0];
            rhs[count + row as usize] += w / sums[i as usize] * uv[j as usize][1];
        }
    }
    work.check()?;
    let inner = |i: u32, j: u32| unknown[i as usize] != FIXED && unknown[j as usize] != FIXED;
    let pairs = domain.triangles().flat_map(|t| [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)].map(|(a, b)| (t[a], t[b])));
    let columns = pairs.filter(|&(i, j)| inner(i, j)).map(|(_, j)| unknown[j as usize]).chain(0..count as u32);
    let entries = domain
        .triangles()
        .flat_map(|t| weights(domain, t))
        .filter(|&(i, j, _)| inner(i, j))
        .map(|(i, j, w)| (unknown[i as usize], unknown[j as usize], -w / sums[i as usize]))
        .chain((0..count as u32).map(|i| (i, i, 1.0)));
    let matrix = compress(count, columns, entries, 0.0)?;
    work.check()?;
    let factor = RealLu::new(&matrix).map_err(|e| solver_error(&e))?;
    work.check()?;
    factor.solve_in_place(&mut rhs, 2);
    Ok(rhs)
}
