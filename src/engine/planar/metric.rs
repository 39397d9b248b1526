//! The metric of the map (P1 eq. 2) divided by the squared size: lengths in it are numbers of elements.

use super::SurfacePoint;
use super::locate::{Locator, area2};
use crate::patch::Patch;
use crate::vector::{Vec2, distance, dot, sub, triangle_area};

/// A symmetric positive 2 x 2 matrix `[[m0, m1], [m1, m2]]`.
pub(super) type Metric = [f64; 3];

/// Scalar product in a metric.
#[inline]
pub(super) fn inner(m: Metric, a: Vec2, b: Vec2) -> f64 {
    a[0] * (m[0] * b[0] + m[1] * b[1]) + a[1] * (m[1] * b[0] + m[2] * b[1])
}

/// Length in a metric.
#[inline]
pub(super) fn length(m: Metric, a: Vec2) -> f64 {
    inner(m, a, a).max(0.0).sqrt()
}

/// Square root of the determinant: area in the metric per area.
#[inline]
pub(super) fn density(m: Metric) -> f64 {
    (m[0] * m[2] - m[1] * m[1]).max(0.0).sqrt()
}

/// What is interpolated in the chart: the pull-back metric and the size, at each vertex.
pub(super) struct MetricField {
    /// `[m0, m1, m2, size]` at the vertices.
    values: Vec<[f64; 4]>,
    /// Metric of each face and the weight it has against the interpolated one, from 0 (the face is small against the size) to 1.
    faces: Vec<[f64; 4]>,
}

/// Faces whose smallest height over the size is below the first number are smoothed over, above the second taken as they are.
const FACE_HEIGHTS: [f64; 2] = [1.0, 2.0];

fn face_weight(patch: &Patch, face: usize, sizes: &[f64]) -> f64 {
    let t = patch.triangles[face].map(|v| v as usize);
    let [a, b, c] = t.map(|v| patch.positions[v]);
    let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
    let height = 2.0 * triangle_area(a, b, c) / longest.max(f64::MIN_POSITIVE);
    let size = t.iter().map(|&v| sizes[v]).sum::<f64>() / 3.0;
    let weight = (height / size - FACE_HEIGHTS[0]) / (FACE_HEIGHTS[1] - FACE_HEIGHTS[0]);
    if weight.is_finite() { weight.clamp(0.0, 1.0) } else { 0.0 }
}

/// Metric tensor of the inverse map on a face: `(dx/du)^T (dx/du)`.
fn face_metric(patch: &Patch, uv: &[Vec2], face: usize) -> Option<(Metric, f64)> {
    let t = patch.triangles[face].map(|v| v as usize);
    let [a, b, c] = t.map(|v| uv[v]);
    let area = area2(a, b, c);
    if area.is_nan() || area <= 0.0 {
        return None;
    }
    let (e, f) = (sub(patch.positions[t[1]], patch.positions[t[0]]), sub(patch.positions[t[2]], patch.positions[t[0]]));
    // Rows of the inverse of [b - a, c - a].
    let inverse = [[(c[1] - a[1]) / area, -(c[0] - a[0]) / area], [-(b[1] - a[1]) / area, (b[0] - a[0]) / area]];
    let x: [[f64; 3]; 2] = std::array::from_fn(|j| std::array::from_fn(|k| e[k] * inverse[0][j] + f[k] * inverse[1][j]));
    let m = [dot(x[0], x[0]), dot(x[0], x[1]), dot(x[1], x[1])];
    m.iter().all(|v| v.is_finite()).then_some((m, area))
}

/// A face whose share of the chart is this much smaller than its share of the surface is squeezed flat: what its map says is rounding.
const SQUEEZED: f64 = 1e-9;

/// Twice the area in the chart below which each face is squeezed.
fn least_areas(patch: &Patch, uv: &[Vec2]) -> impl Fn(usize) -> f64 {
    let surface = |f: usize| {
        let [a, b, c] = patch.triangles[f].map(|v| patch.positions[v as usize]);
        2.0 * triangle_area(a, b, c)
    };
    let in_chart = |f: usize| {
        let [a, b, c] = patch.triangles[f].map(|v| uv[v as usize]);
        area2(a, b, c).max(0.0)
    };
    let faces = 0..patch.triangles.len();
    let ratio = faces.clone().map(in_chart).sum::<f64>() / faces.map(surface).sum::<f64>();
    move |f| SQUEEZED * ratio * surface(f)
}

impl MetricField {
    /// Metrics of the faces averaged to the vertices by chart area, so that for a conformal map the metric at a vertex is the
    /// ratio of areas around it.
    pub(super) fn new(patch: &Patch, uv: &[Vec2], sizes: &[f64]) -> MetricField {
        let mut values = vec![[0.0; 4]; patch.positions.len()];
        let mut weight = vec![0.0; values.len()];
        let mut faces = vec![[0.0; 4]; patch.triangles.len()];
        let least = least_areas(patch, uv);
        for f in 0..patch.triangles.len() {
            let Some((m, area)) = face_metric(patch, uv, f).filter(|x| x.1 > least(f)) else { continue };
            faces[f] = [m[0], m[1], m[2], face_weight(patch, f, sizes)];
            for &v in &patch.triangles[f] {
                for k in 0..3 {
                    values[v as usize][k] += area * m[k];
                }
                weight[v as usize] += area;
            }
        }
        for v in 0..values.len() {
            let m = &mut values[v];
            let usable = weight[v] > 0.0 && m[0] * m[2] - m[1] * m[1] > 0.0;
            if usable {
                (0..3).for_each(|k| m[k] /= weight[v]);
            } else {
                *m = [1.0, 0.0, 1.0, 0.0];
            }
            m[3] = sizes[v];
        }
        MetricField { values, faces }
    }

    /// The metric over squared size at a point of the chart.
    #[inline]
    pub(super) fn at(&self, locator: &Locator<'_>, point: &SurfacePoint) -> Metric {
        let [a, b, c, size] = locator.at(point, &self.values);
        let [x, y, z, w] = self.faces[point.face as usize];
        let s = 1.0 / (size * size);
        [s * (a + w * (x - a)), s * (b + w * (y - b)), s * (c + w * (z - c))]
    }
}
