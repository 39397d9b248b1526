//! Distortion of every face of any map of a patch, also of one that is not one-to-one: what a viewer colours a chart by.

use super::domain::Flat;
use super::outcome::FaceDistortion;
use super::place::{self, chart_areas};
use super::validity::orientation;
use crate::patch::Patch;
use crate::vector::Vec2;

/// Distortion of each face after scaling the map to the area of the patch (its signed area; of a map without any, the sum of the
/// absolute ones). The sign of `area` is that of the exact orientation, so a face is flipped or flat exactly if `area` is not
/// positive. A face without area on the surface has infinite angle, stretch and (unless it is flat in the plane, too) area.
/// O(faces). Empty if `uv` does not have one point for each vertex.
pub fn face_distortion(patch: &Patch, uv: &[Vec2]) -> Vec<FaceDistortion> {
    if uv.len() != patch.positions.len() {
        return Vec::new();
    }
    let (surface, plane) = (unit_of(&patch.positions), unit_of(uv));
    let shape = |t: &[u32; 3]| Flat::of(t.map(|v| patch.positions[v as usize].map(|x| x / surface)));
    let shapes: Vec<Flat> = patch.triangles.iter().map(shape).collect();
    let mut image: Vec<Vec2> = uv.iter().map(|p| p.map(|x| x / plane)).collect();
    let areas = chart_areas(&patch.triangles, &image);
    let (signed, absolute) = areas.iter().fold((0.0, 0.0), |(s, a), area| (s + area, a + area.abs()));
    let (wanted, mapped) = (shapes.iter().map(|flat| flat.area()).sum::<f64>(), if signed > 0.0 { signed } else { absolute });
    let scale = if wanted > 0.0 && mapped > 0.0 { (wanted / mapped).sqrt() } else { 1.0 };
    image.iter_mut().flatten().for_each(|x| *x *= scale);
    let distortion = |(t, flat): (&[u32; 3], &Flat)| {
        let [a, b, c] = t.map(|v| uv[v as usize]);
        let face = place::face_distortion(flat, t.map(|v| image[v as usize]));
        let face = face.unwrap_or(FaceDistortion { angle: f64::INFINITY, area: f64::INFINITY, stretch: f64::INFINITY });
        FaceDistortion { area: with_sign_of(face.area.abs(), orientation(a, b, c)), ..face }
    };
    patch.triangles.iter().zip(&shapes).map(distortion).collect()
}

/// A size that is not rounded to 0 unless its sign is 0.
fn with_sign_of(size: f64, sign: f64) -> f64 {
    if sign == 0.0 { 0.0 } else { size.max(f64::MIN_POSITIVE).copysign(sign) }
}

/// The largest coordinate in size: dividing by it keeps squares from overflow.
fn unit_of<const N: usize>(points: &[[f64; N]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > 0.0 && largest.is_finite() { largest } else { 1.0 }
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
