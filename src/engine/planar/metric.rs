//! The metric of the map (P1 eq. 2) divided by the squared size, or a tensor of the surface pulled back through the map: lengths in it
//! are numbers of elements.

use super::SurfacePoint;
use super::locate::{Locator, area2};
use crate::metric::tensor::{self, Sym3};
use crate::patch::Patch;
use crate::vector::{Vec2, Vec3, distance, dot, sub, triangle_area};

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

/// What is interpolated in the chart.
pub(super) enum MetricField {
    /// The same length in all directions on the surface.
    Sized(SizedField),
    /// A tensor on the surface.
    Tensor(TensorField),
}

/// The pull-back metric and the size at each vertex.
pub(super) struct SizedField {
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

/// Columns of the inverse map on a face, `dx/du` and `dx/dv`, and twice its area in the chart.
fn face_columns(patch: &Patch, uv: &[Vec2], face: usize) -> Option<([Vec3; 2], f64)> {
    let t = patch.triangles[face].map(|v| v as usize);
    let [a, b, c] = t.map(|v| uv[v]);
    let area = area2(a, b, c);
    if area.is_nan() || area <= 0.0 {
        return None;
    }
    let (e, f) = (sub(patch.positions[t[1]], patch.positions[t[0]]), sub(patch.positions[t[2]], patch.positions[t[0]]));
    // Rows of the inverse of [b - a, c - a].
    let inverse = [[(c[1] - a[1]) / area, -(c[0] - a[0]) / area], [-(b[1] - a[1]) / area, (b[0] - a[0]) / area]];
    let x: [Vec3; 2] = std::array::from_fn(|j| std::array::from_fn(|k| e[k] * inverse[0][j] + f[k] * inverse[1][j]));
    x.as_flattened().iter().all(|v| v.is_finite()).then_some((x, area))
}

/// Metric tensor of the inverse map on a face: `(dx/du)^T (dx/du)`.
fn face_metric(patch: &Patch, uv: &[Vec2], face: usize) -> Option<(Metric, f64)> {
    let (x, area) = face_columns(patch, uv, face)?;
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

impl SizedField {
    /// Metrics of the faces averaged to the vertices by chart area, so that for a conformal map the metric at a vertex is the
    /// ratio of areas around it.
    fn new(patch: &Patch, uv: &[Vec2], sizes: &[f64]) -> SizedField {
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
        SizedField { values, faces }
    }

    /// The metric over squared size at a point of the chart.
    #[inline]
    fn at(&self, locator: &Locator<'_>, point: &SurfacePoint) -> Metric {
        let [a, b, c, size] = locator.at(point, &self.values);
        let [x, y, z, w] = self.faces[point.face as usize];
        let s = 1.0 / (size * size);
        [s * (a + w * (x - a)), s * (b + w * (y - b)), s * (c + w * (z - c))]
    }
}

/// Logarithms of the pulled-back tensors: what is linear between the vertices.
pub(super) struct TensorField {
    values: Vec<[f64; 3]>,
    /// Of large faces, whose own map counts: the logarithms at their corners and the weight against the smoothed ones.
    faces: Vec<Option<([Metric; 3], f64)>>,
}

impl TensorField {
    /// Each corner's tensor is pulled back through the map of its face; at a vertex the logarithms are averaged by chart area.
    fn new(patch: &Patch, uv: &[Vec2], sizes: &[f64], corners: &[[Sym3; 3]]) -> TensorField {
        let mut values = vec![[0.0; 3]; patch.positions.len()];
        let mut weight = vec![0.0; values.len()];
        let mut faces = vec![None; patch.triangles.len()];
        let least = least_areas(patch, uv);
        for (f, corners) in corners.iter().enumerate() {
            let Some((x, area)) = face_columns(patch, uv, f).filter(|x| x.1 > least(f)) else { continue };
            let logs = corners.map(|t| tensor::log(pulled_back(&t, &x)));
            if logs.as_flattened().iter().any(|v| !v.is_finite()) {
                continue;
            }
            let share = face_weight(patch, f, sizes);
            faces[f] = (share > 0.0).then_some((logs, share));
            for (k, &v) in patch.triangles[f].iter().enumerate() {
                (0..3).for_each(|i| values[v as usize][i] += area * logs[k][i]);
                weight[v as usize] += area;
            }
        }
        for (value, weight) in values.iter_mut().zip(weight).filter(|x| x.1 > 0.0) {
            value.iter_mut().for_each(|x| *x /= weight);
        }
        TensorField { values, faces }
    }

    #[inline]
    fn at(&self, locator: &Locator<'_>, point: &SurfacePoint) -> Metric {
        let smooth = locator.at(point, &self.values);
        let Some((logs, share)) = self.faces[point.face as usize] else { return tensor::exp(smooth) };
        let own = |i: usize| (0..3).map(|k| point.barycentric[k] * logs[k][i]).sum::<f64>();
        tensor::exp([0, 1, 2].map(|i| smooth[i] + share * (own(i) - smooth[i])))
    }
}

/// What a tensor in space says of the plane: `X^T T X` for the columns `X` of the inverse map.
fn pulled_back(t: &Sym3, x: &[Vec3; 2]) -> Metric {
    let row = |b: Vec3| {
        [t[0] * b[0] + t[1] * b[1] + t[2] * b[2], t[1] * b[0] + t[3] * b[1] + t[4] * b[2], t[2] * b[0] + t[4] * b[1] + t[5] * b[2]]
    };
    [dot(x[0], row(x[0])), dot(x[0], row(x[1])), dot(x[1], row(x[1]))]
}

impl MetricField {
    /// The field of a size, or of tensors at the corners of the faces.
    pub(super) fn new(patch: &Patch, uv: &[Vec2], sizes: &[f64], tensors: Option<&[[Sym3; 3]]>) -> MetricField {
        match tensors {
            None => MetricField::Sized(SizedField::new(patch, uv, sizes)),
            Some(corners) => MetricField::Tensor(TensorField::new(patch, uv, sizes, corners)),
        }
    }

    /// The metric at a point of the chart.
    #[inline]
    pub(super) fn at(&self, locator: &Locator<'_>, point: &SurfacePoint) -> Metric {
        match self {
            MetricField::Sized(field) => field.at(locator, point),
            MetricField::Tensor(field) => field.at(locator, point),
        }
    }
}
