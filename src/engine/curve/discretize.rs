//! The one-dimensional mesher: equal edges in the size field.

use super::{CurveKind, CurveMesh, CurvePoint, CurvePolyline, faithful};
use crate::error::{EngineError, Reason, Result};
use crate::vector::{Vec3, distance, lerp};
use crate::work::Work;

const MAX_POINTS: f64 = 1.0e7;
/// Samples per wanted edge on which the length of a seam is measured.
const SAMPLES_PER_EDGE: f64 = 8.0;
/// Passes of the [1 2 1] filter over those samples: a Gaussian of about 0.35 edges.
const FILTER_PASSES: usize = 16;

/// A polyline with a growing measure at its points; positions are `segment + t`.
pub(super) struct Measured {
    pub(super) at: Vec<f64>,
    pub(super) measure: Vec<f64>,
}

/// Length of a segment in the size field with sizes linear along it.
fn length_in_field(length: f64, a: f64, b: f64) -> f64 {
    let r = b / a - 1.0;
    if r.abs() < 1e-3 { length / (0.5 * (a + b)) } else { length * r.ln_1p() / (b - a) }
}

fn measure_exact(polyline: &CurvePolyline) -> Measured {
    let (points, sizes) = (&polyline.points, &polyline.sizes);
    let mut measure = vec![0.0];
    let mut sum = 0.0;
    for i in 1..points.len() {
        sum += length_in_field(distance(points[i - 1], points[i]), sizes[i - 1], sizes[i]);
        measure.push(sum);
    }
    Measured { at: (0..points.len()).map(|i| i as f64).collect(), measure }
}

/// Inverse of a measure: the positions where it takes the increasing values `wanted`.
pub(super) fn invert(measured: &Measured, wanted: impl Iterator<Item = f64>) -> Vec<f64> {
    let (at, measure) = (&measured.at, &measured.measure);
    let mut i = 1;
    wanted
        .map(|value| {
            while i + 1 < measure.len() && measure[i] < value {
                i += 1;
            }
            let span = measure[i] - measure[i - 1];
            let t = if span > 0.0 { ((value - measure[i - 1]) / span).clamp(0.0, 1.0) } else { 0.5 };
            at[i - 1] + t * (at[i] - at[i - 1])
        })
        .collect()
}

fn split_position(position: f64, segments: usize) -> (usize, f64) {
    let segment = (position.floor().max(0.0) as usize).min(segments - 1);
    (segment, (position - segment as f64).clamp(0.0, 1.0))
}

pub(super) fn point_at(polyline: &CurvePolyline, position: f64) -> (Vec3, f64) {
    let (s, t) = split_position(position, polyline.points.len() - 1);
    (lerp(polyline.points[s], polyline.points[s + 1], t), polyline.sizes[s] + t * (polyline.sizes[s + 1] - polyline.sizes[s]))
}

/// One pass of the [1 2 1] filter; ends fixed, or cyclic for closed curves (first and last sample are the same point).
fn filter(points: &mut [Vec3], closed: bool) {
    let last = points.len() - 1;
    let mut before = if closed { points[last - 1] } else { points[0] };
    for i in usize::from(!closed)..last {
        let (here, after) = (points[i], points[i + 1]);
        points[i] = std::array::from_fn(|k| 0.25 * (before[k] + after[k]) + 0.5 * here[k]);
        before = here;
    }
    if closed {
        points[last] = points[0];
    }
}

/// Measure of a seam: that of the polyline smoothed at the scale of the size.
fn measure_smoothed(polyline: &CurvePolyline, exact: Measured, work: &Work<'_>) -> Result<Measured> {
    let total = exact.measure.last().copied().unwrap_or(0.0);
    let count = (total * SAMPLES_PER_EDGE).ceil().max(8.0) as usize;
    let at = invert(&exact, (0..=count).map(|i| total * i as f64 / count as f64));
    let (mut points, sizes): (Vec<Vec3>, Vec<f64>) = at.iter().map(|&p| point_at(polyline, p)).unzip();
    for _ in 0..FILTER_PASSES {
        work.check()?;
        filter(&mut points, polyline.closed);
    }
    let mut measure = vec![0.0];
    let mut sum = 0.0;
    for i in 1..=count {
        // A floor keeps the points of a hairpin apart.
        let length = length_in_field(distance(points[i - 1], points[i]), sizes[i - 1], sizes[i]);
        sum += length.max(0.05 * total / count as f64);
        measure.push(sum);
    }
    Ok(Measured { at, measure })
}

/// Inner positions that divide the measure into round(total) equal parts, at least `least`.
fn equal_parts(measured: &Measured, least: usize) -> Vec<f64> {
    let total = measured.measure.last().copied().unwrap_or(0.0);
    let edges = (total.round() as usize).max(least);
    invert(measured, (1..edges).map(|i| total * i as f64 / edges as f64))
}

/// Whether a chord leaves the curve by more than is allowed.
fn cuts_corners(polyline: &CurvePolyline, inner: &[f64]) -> bool {
    let end = (polyline.points.len() - 1) as f64;
    let ends = inner.iter().copied().chain([end]);
    std::iter::once(0.0).chain(inner.iter().copied()).zip(ends).any(|(a, b)| faithful::deviation(polyline, a, b) > faithful::CUT_DEVIATION)
}

pub(super) fn discretize(polyline: &CurvePolyline, work: &Work<'_>) -> Result<CurveMesh> {
    work.check()?;
    let (points, sizes) = (&polyline.points, &polyline.sizes);
    if points.len() < 2 || sizes.len() != points.len() {
        return Err(EngineError::invariant(format!("a curve of {} points with {} sizes", points.len(), sizes.len())));
    }
    if let Some(bad) = sizes.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
        return Err(EngineError::bad_parameter("size", format!("a length of {bad} is wanted on a curve; lengths must be positive")));
    }
    let exact = measure_exact(polyline);
    let total = exact.measure.last().copied().unwrap_or(0.0);
    if !(total.is_finite() && total < MAX_POINTS) {
        return Err(EngineError::new(Reason::LimitReached, format!("a curve would get {total:e} points, the limit is {MAX_POINTS:e}"))
            .with_hint("ask for a larger size"));
    }
    let least = polyline.min_edges.max(if polyline.closed { 3 } else { 1 }) as usize;
    let measured = if polyline.kind == CurveKind::Seam && total > 0.0 { measure_smoothed(polyline, exact, work)? } else { exact };
    let mut inner = equal_parts(&measured, least);
    if polyline.kind != CurveKind::Seam && cuts_corners(polyline, &inner) {
        let faithful = faithful::divide(polyline, &measured, work)?;
        inner = faithful.filter(|f| f.len() + 1 >= least).unwrap_or(inner);
    }
    let last_segment = points.len() - 2;
    let mut mesh = Vec::with_capacity(inner.len() + 2);
    mesh.push(CurvePoint { segment: 0, t: 0.0, position: points[0] });
    for position in inner {
        let (segment, t) = split_position(position, points.len() - 1);
        mesh.push(CurvePoint { segment: segment as u32, t, position: lerp(points[segment], points[segment + 1], t) });
    }
    mesh.push(CurvePoint { segment: last_segment as u32, t: 1.0, position: points[last_segment + 1] });
    Ok(CurveMesh { points: mesh })
}
