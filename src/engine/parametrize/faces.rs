//! Distortion of every face of any map of a patch, also of one that is not one-to-one: what a viewer colours a chart by.

use super::outcome::FaceDistortion;
use super::validity::orientation;
use crate::patch::Patch;
use crate::vector::{Vec2, Vec3};

/// Distortion of each face after scaling the map to the area of the patch (its signed area; of a map without any, the sum of the
/// absolute ones). The sign of `area` is that of the exact orientation, so a face is flipped or flat exactly if `area` is not
/// positive. A face without area on the surface has infinite angle, stretch and (unless it is flat in the plane, too) area.
/// O(faces). Empty if `uv` does not have one point for each vertex.
pub fn face_distortion(patch: &Patch, uv: &[Vec2]) -> Vec<FaceDistortion> {
    if uv.len() != patch.positions.len() {
        return Vec::new();
    }
    let (surface, plane) = (unit_of(&patch.positions), unit_of(uv));
    let shapes: Vec<(Flat, Flat)> = patch
        .triangles
        .iter()
        .map(|t| {
            let in_space = t.map(|v| patch.positions[v as usize].map(|x| x / surface));
            let in_plane = t.map(|v| uv[v as usize].map(|x| x / plane));
            (Flat::of_space(in_space), Flat::of_plane(in_plane))
        })
        .collect();
    let wanted: f64 = shapes.iter().map(|(flat, _)| flat.doubled_area()).sum();
    let signed: f64 = shapes.iter().map(|(_, image)| image.doubled_area()).sum();
    let mapped = if signed > 0.0 { signed } else { shapes.iter().map(|(_, image)| image.doubled_area().abs()).sum() };
    let scale = if wanted > 0.0 && mapped > 0.0 { (wanted / mapped).sqrt() } else { 1.0 };
    let sign = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| uv[v as usize]);
        orientation(a, b, c)
    };
    patch.triangles.iter().zip(&shapes).map(|(t, (flat, image))| distortion(flat, image, scale, sign(t))).collect()
}

/// The largest coordinate in size: dividing by it keeps squares from overflow.
fn unit_of<const N: usize>(points: &[[f64; N]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > 0.0 && largest.is_finite() { largest } else { 1.0 }
}

/// Two edges of a face from its first corner, in a plane.
struct Flat([Vec2; 2]);

impl Flat {
    fn of_plane([a, b, c]: [Vec2; 3]) -> Flat {
        Flat([[b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]])
    }

    /// The face laid flat, its first edge along the first axis.
    fn of_space([a, b, c]: [Vec3; 3]) -> Flat {
        let edge = |p: Vec3| -> Vec3 { std::array::from_fn(|k| p[k] - a[k]) };
        let (u, v) = (edge(b), edge(c));
        let dot = |p: Vec3, q: Vec3| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let length = dot(u, u).sqrt();
        if length <= 0.0 {
            return Flat([[0.0; 2], [dot(v, v).sqrt(), 0.0]]);
        }
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        Flat([[length, 0.0], [dot(u, v) / length, dot(n, n).sqrt() / length]])
    }

    fn doubled_area(&self) -> f64 {
        let [u, v] = self.0;
        u[0] * v[1] - u[1] * v[0]
    }
}

fn distortion(flat: &Flat, image: &Flat, scale: f64, sign: f64) -> FaceDistortion {
    let (area, mapped) = (flat.doubled_area(), image.doubled_area());
    let signed = |size: f64| match sign.total_cmp(&0.0) {
        _ if sign == 0.0 => 0.0,
        std::cmp::Ordering::Less => -size.max(f64::MIN_POSITIVE),
        _ => size.max(f64::MIN_POSITIVE),
    };
    if area <= 0.0 {
        return FaceDistortion { angle: f64::INFINITY, area: signed(f64::INFINITY), stretch: f64::INFINITY };
    }
    // The columns of the Jacobian: images of the unit vectors of the flattened face.
    let ([u, v], [p, q]) = (flat.0, image.0);
    let [first, second]: [Vec2; 2] = [
        std::array::from_fn(|k| scale * (p[k] * v[1] - q[k] * u[1]) / area),
        std::array::from_fn(|k| scale * (q[k] * u[0] - p[k] * v[0]) / area),
    ];
    let large = 0.5 * ((first[0] + second[1]).hypot(first[1] - second[0]) + (first[0] - second[1]).hypot(first[1] + second[0]));
    let det = scale * scale * mapped.abs() / area;
    let small = det / large;
    let stretch = (0.5 * (1.0 / (large * large) + 1.0 / (small * small))).sqrt();
    let angle = if det > 0.0 { (large / small).max(1.0) } else { f64::INFINITY };
    FaceDistortion { angle, area: signed(det), stretch: if stretch.is_nan() { f64::INFINITY } else { stretch } }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Patch {
        Patch {
            positions: vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 2.0], [0.0, 0.0, 2.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            loops: vec![vec![0, 1, 2, 3]],
        }
    }

    #[test]
    fn a_stretched_square_has_its_closed_form() {
        for unit in [1e-160, 1.0, 1e160] {
            let mut patch = square();
            patch.positions.iter_mut().flatten().for_each(|x| *x *= unit);
            let uv = [[1.0, 5.0], [4.0, 5.0], [4.0, 6.0], [1.0, 6.0]];
            for face in face_distortion(&patch, &uv) {
                // Singular values 3 and 1 before scaling, sqrt(3) and 1/sqrt(3) after it.
                assert!((face.angle - 3.0).abs() < 1e-12 && (face.area - 1.0).abs() < 1e-12, "{face:?}");
                assert!((face.stretch - (0.5 * (3.0 + 1.0 / 3.0f64)).sqrt()).abs() < 1e-12, "{face:?}");
            }
        }
    }

    #[test]
    fn flipped_and_flat_faces_are_told_by_the_sign() {
        let folded = face_distortion(&square(), &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.5, 0.0]]);
        assert!(folded[0].area > 0.0 && folded[1].area < 0.0, "{folded:?}");
        let flat = face_distortion(&square(), &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.5, 0.5]]);
        assert!(flat[1].area == 0.0 && flat[1].angle.is_infinite() && flat[1].stretch.is_infinite(), "{flat:?}");
        // Too thin for the rounded determinant, not for the exact one.
        let thin = face_distortion(&square(), &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.5, 0.5 + 1e-16]]);
        assert!(thin[1].area > 0.0, "{thin:?}");
        assert!(face_distortion(&square(), &[[0.0; 2]; 3]).is_empty());
    }

    #[test]
    fn faces_without_area_do_not_spoil_the_others() {
        let mut patch = square();
        patch.positions.push([1.0, 0.0, 1.0]);
        patch.triangles.push([0, 4, 2]);
        let uv = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]];
        let faces = face_distortion(&patch, &uv);
        assert!((faces[0].angle - 1.0).abs() < 1e-12 && (faces[0].stretch - 1.0).abs() < 1e-12);
        assert!(faces[2].angle.is_infinite() && faces[2].area == 0.0);
    }
}
