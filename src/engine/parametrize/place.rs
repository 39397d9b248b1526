//! Size, position and direction of a chart in the plane, and its distortion.

use super::domain::{Domain, Flat, root_of_squares};
use super::outcome::{Distortion, FaceDistortion, Spread};
use crate::vector::Vec2;

/// Layouts and areas of the faces of a patch in normalised coordinates.
#[derive(Debug)]
pub(super) struct FaceShapes {
    pub(super) flats: Vec<Flat>,
    pub(super) areas: Vec<f64>,
}

impl FaceShapes {
    pub(super) fn of(domain: &Domain<'_>) -> FaceShapes {
        let flats: Vec<Flat> = domain.patch.triangles.iter().map(|&t| domain.flat(t)).collect();
        let areas = flats.iter().map(|f| f.area()).collect();
        FaceShapes { flats, areas }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.flats.len() * size_of::<Flat>() + self.areas.len() * 8
    }
}

/// Signed areas of the faces in the plane.
pub(super) fn chart_areas(triangles: &[[u32; 3]], uv: &[Vec2]) -> Vec<f64> {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| uv[v as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    };
    triangles.iter().map(area).collect()
}

/// How a chart is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// Principal axis first.
    Principal,
    /// As it is: its outer loop is where somebody wants it.
    Keep,
}

/// Scales to `area`, moves the centroid to the origin, turns the principal axis of inertia to the first coordinate if wanted. The sense of
/// the axis is that of the third moment; a chart without a principal axis is turned to the first vertex of its boundary.
/// `None` if the area of the chart is not positive and finite.
pub(super) fn place(triangles: &[[u32; 3]], first: u32, area: f64, turn: Turn, uv: &mut [Vec2]) -> Option<()> {
    let areas = chart_areas(triangles, uv);
    let total: f64 = areas.iter().sum();
    if !(total > 0.0 && total.is_finite() && area > 0.0) {
        return None;
    }
    let mut centre = [0.0; 2];
    for (t, w) in triangles.iter().zip(&areas) {
        for &v in t {
            centre = [centre[0] + w / (3.0 * total) * uv[v as usize][0], centre[1] + w / (3.0 * total) * uv[v as usize][1]];
        }
    }
    let size = (area / total).sqrt();
    uv.iter_mut().for_each(|p| *p = [size * (p[0] - centre[0]), size * (p[1] - centre[1])]);
    if turn == Turn::Principal {
        let (cos, sin) = direction(triangles, &areas, first, uv)?;
        uv.iter_mut().for_each(|p| *p = [cos * p[0] + sin * p[1], cos * p[1] - sin * p[0]]);
    }
    uv.iter().flatten().all(|x| x.is_finite()).then_some(())
}

/// Unit vector that is to become the first axis. `uv` is centred.
fn direction(triangles: &[[u32; 3]], areas: &[f64], first: u32, uv: &[Vec2]) -> Option<(f64, f64)> {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (t, w) in triangles.iter().zip(areas) {
        // Midpoints of the sides integrate quadratics exactly.
        for k in 0..3 {
            let (a, b) = (uv[t[k] as usize], uv[t[(k + 1) % 3] as usize]);
            let m = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            (xx, xy, yy) = (xx + w * m[0] * m[0], xy + w * m[0] * m[1], yy + w * m[1] * m[1]);
        }
    }
    let split = (0.5 * (xx - yy)).hypot(xy);
    let towards = uv[first as usize];
    if split < 1e-3 * (xx + yy) {
        let length = towards[0].hypot(towards[1]);
        return Some(if length > 0.0 { (towards[0] / length, towards[1] / length) } else { (1.0, 0.0) });
    }
    let (sin, cos) = (0.5 * xy.atan2(0.5 * (xx - yy))).sin_cos();
    let (mut second, mut third) = (0.0, 0.0);
    for (t, w) in triangles.iter().zip(areas) {
        let along = t.iter().map(|&v| cos * uv[v as usize][0] + sin * uv[v as usize][1]).sum::<f64>() / 3.0;
        (second, third) = (second + w * along * along, third + w * along * along * along);
    }
    let total: f64 = areas.iter().sum();
    let skew = third / total / (second / total).powf(1.5);
    let sense = if skew.abs() > 1e-4 { skew } else { cos * towards[0] + sin * towards[1] };
    Some(if sense < 0.0 { (-cos, -sin) } else { (cos, sin) })
}

/// Distortion of a face from its Jacobian, infinite where the face has no area in the plane; `None` if it has none on the surface.
pub(super) fn face_distortion(flat: &Flat, corners: [Vec2; 3]) -> Option<FaceDistortion> {
    if flat.area() <= 0.0 {
        return None;
    }
    let [a, b] = flat.jacobian(corners);
    let det = a[0] * b[1] - a[1] * b[0];
    let largest = 0.5 * (root_of_squares(a[0] + b[1], a[1] - b[0]) + root_of_squares(a[0] - b[1], a[1] + b[0]));
    if det == 0.0 {
        return Some(FaceDistortion { angle: f64::INFINITY, area: 0.0, stretch: f64::INFINITY });
    }
    let angle = (largest * largest / det.abs()).max(1.0);
    let smallest = det.abs() / largest;
    let stretch = (0.5 * (1.0 / (largest * largest) + 1.0 / (smallest * smallest))).sqrt();
    Some(FaceDistortion { angle, area: det, stretch })
}

/// Distortion of a chart in normalised coordinates after scaling it by `size`. Faces without area are left out.
pub(super) fn distortion(triangles: &[[u32; 3]], shapes: &FaceShapes, uv: &[Vec2], size: f64) -> Distortion {
    let (mut least, mut sums, mut most, mut weight) = ([f64::INFINITY; 3], [0.0; 3], [0.0f64; 3], 0.0);
    for ((t, flat), &area) in triangles.iter().zip(&shapes.flats).zip(&shapes.areas) {
        let Some(face) = face_distortion(flat, t.map(|v| [size * uv[v as usize][0], size * uv[v as usize][1]])) else { continue };
        for (k, value) in [face.angle, face.area, face.stretch].into_iter().enumerate() {
            least[k] = least[k].min(value);
            sums[k] += area * value;
            most[k] = most[k].max(value);
        }
        weight += area;
    }
    let spread = |k: usize| Spread { min: least[k], mean: sums[k] / weight, max: most[k] };
    Distortion { angle: spread(0), area: spread(1), stretch: spread(2) }
}
