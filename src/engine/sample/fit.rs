//! Finds the spacing at which a generator gives about the wanted number of triangles.

use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;

/// A count within this factor of the wanted one ends the search.
const CLOSE: f64 = 1.15;
const MOST_TRIES: usize = 14;
/// Counts above this are calibrated at this count first.
const CALIBRATION: f64 = 12_000.0;

/// Calls `make(spacing)` until the count fits. `make` gives `None` where a spacing is too coarse for the shape's topology; then
/// only finer spacings are tried and the best fit among those is returned.
///
/// # Errors
/// Those of `make`; [`crate::error::Reason::BadParameter`] if no spacing tried gave a surface: too few triangles for the topology.
pub(super) fn fit(target: u64, first_spacing: f64, mut make: impl FnMut(f64) -> Result<Option<SurfaceMesh>>) -> Result<SurfaceMesh> {
    let target = target as f64;
    let mut goal = target.min(CALIBRATION);
    let mut spacing = first_spacing * (target / goal).sqrt();
    let mut too_coarse = f64::INFINITY;
    let mut best: Option<(f64, SurfaceMesh)> = None;
    for _ in 0..MOST_TRIES {
        let Some(mesh) = make(spacing)? else {
            too_coarse = too_coarse.min(spacing);
            spacing *= 0.85;
            continue;
        };
        let count = mesh.triangles.len() as f64;
        let off = (count / goal).max(goal / count);
        let done = goal == target && off < CLOSE;
        let stuck = best.as_ref().is_some_and(|(_, b)| b.triangles.len() == mesh.triangles.len());
        let score = (count / target).max(target / count);
        if best.as_ref().is_none_or(|(s, _)| score < *s) {
            best = Some((score, mesh));
        }
        if off < CLOSE || count > goal {
            goal = target;
        }
        let next = spacing * (count / goal).sqrt();
        if done || (stuck && goal == target) || (count > goal && next > 0.93 * too_coarse) {
            break;
        }
        spacing = next;
    }
    best.map(|(_, mesh)| mesh).ok_or_else(|| {
        EngineError::bad_parameter("sample.triangles", "too few triangles for the topology of the shape")
            .with_hint("ask for more triangles")
    })
}
