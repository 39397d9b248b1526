//! Curves with locked points: those are kept bit for bit, and what lies between them is meshed piece by piece.

use super::discretize::discretize as divide;
use super::{CurveMesh, CurvePoint, CurvePolyline};
use crate::error::{EngineError, Result};
use crate::work::Work;

/// The mesh of a polyline of which some points are locked. Ends are points of the mesh in any case.
pub(super) fn discretize(polyline: &CurvePolyline, work: &Work<'_>) -> Result<CurveMesh> {
    let last = polyline.points.len().saturating_sub(1);
    if last == 0 || polyline.locked.len() != polyline.points.len() || polyline.sizes.len() != polyline.points.len() {
        return Err(EngineError::invariant("a curve without points, or with other numbers of points, sizes and locks"));
    }
    let least = polyline.min_edges.max(if polyline.closed { 3 } else { 1 });
    let stops: Vec<usize> = (0..=last).filter(|&i| i == 0 || i == last || polyline.locked[i]).collect();
    let mesh = pieces(polyline, &stops, 1, work)?;
    // Too few edges: the free pieces get more. If there is none, all edges are those of the input, which is no worse.
    if mesh.points.len() <= least as usize { pieces(polyline, &stops, least, work) } else { Ok(mesh) }
}

fn pieces(polyline: &CurvePolyline, stops: &[usize], least: u32, work: &Work<'_>) -> Result<CurveMesh> {
    let mut points = vec![CurvePoint { segment: 0, t: 0.0, position: polyline.points[0] }];
    for pair in stops.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        if to > from + 1 || !(polyline.locked[from] && polyline.locked[to]) {
            let piece = CurvePolyline {
                points: polyline.points[from..=to].to_vec(),
                sizes: polyline.sizes[from..=to].to_vec(),
                closed: false,
                kind: polyline.kind,
                min_edges: least,
                locked: Vec::new(),
            };
            let inner = divide(&piece, work)?.points;
            let inside = inner.get(1..inner.len().saturating_sub(1)).unwrap_or_default();
            points.extend(inside.iter().map(|p| CurvePoint { segment: p.segment + from as u32, ..*p }));
        }
        points.push(CurvePoint { segment: to as u32 - 1, t: 1.0, position: polyline.points[to] });
    }
    Ok(CurveMesh { points })
}
