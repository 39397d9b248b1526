//! Cones of rays from the middle of each face: how far the other side is.

use crate::bvh::TriangleBvh;
use crate::curvature::tangents;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, add, add_scaled, area_vector_twice, distance, dot, norm, scale};
use crate::work::Work;
use std::f64::consts::TAU;

/// Faces lower than this share of their longest side have no normal to speak of.
const LEAST_HEIGHT: f64 = 1e-4;
/// Sheets face each other if the cosine of their normals is below this: to within 60 degrees.
const FACING: f64 = -0.5;
/// A sphere through a tangent plane and a hit is not trusted if fewer hits than this say so.
const TRUSTED: usize = 3;

/// The rays of a cone: one along the axis, then rings.
pub(super) struct Cone {
    /// Half angle in degrees and number of rays of each ring.
    rings: &'static [(f64, u32)],
    /// Only faces count whose normal has a cosine below this with that of the face the cone starts from.
    facing: f64,
}

impl Cone {
    /// For gaps.
    pub(super) const NARROW: Cone = Cone { rings: &[(25.0, 4)], facing: FACING };
    /// For the thickness of walls and limbs.
    pub(super) const THICKNESS: Cone = Cone { rings: &[(12.0, 4), (25.0, 8)], facing: 0.0 };
    /// For the radius of tubes.
    pub(super) const WIDE: Cone = Cone { rings: &[(20.0, 6), (40.0, 6)], facing: 0.0 };

    /// Unit directions around the third axis with the cosine of their tilt.
    fn directions(&self) -> Vec<(Vec3, f64)> {
        let ring = |&(degrees, count): &(f64, u32)| {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            (0..count).map(move |i| {
                let angle = TAU * (f64::from(i) + 0.25) / f64::from(count);
                ([sin * angle.cos(), sin * angle.sin(), cos], cos)
            })
        };
        std::iter::once(([0.0, 0.0, 1.0], 1.0)).chain(self.rings.iter().flat_map(ring)).collect()
    }
}

/// What a ray met.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    /// Distance along the ray.
    distance: f64,
    /// Cosine between ray and axis.
    tilt: f64,
}

/// For each face what `conclude` makes of the sights of a cone around `signs[face]` times its normal; infinite for slivers.
pub(super) fn per_face(
    mesh: &SurfaceMesh,
    tree: &TriangleBvh,
    cone: &Cone,
    signs: &[f64],
    reach: f64,
    work: &Work<'_>,
    conclude: fn(&mut [Sight]) -> f64,
) -> Result<Vec<f64>> {
    let directions = cone.directions();
    let normals: Vec<Vec3> = (0..mesh.triangles.len()).map(|f| normal(mesh, f)).collect();
    let mut sights = Vec::with_capacity(directions.len());
    let mut values = Vec::with_capacity(normals.len());
    for (f, n) in normals.iter().enumerate() {
        if f.is_multiple_of(1024) {
            work.step(f, normals.len())?;
        }
        if *n == [0.0; 3] {
            values.push(f64::INFINITY);
            continue;
        }
        let [a, b, c] = mesh.corners(f);
        let middle = scale(add(add(a, b), c), 1.0 / 3.0);
        let axis = scale(*n, signs[f]);
        let (t, s) = tangents(axis);
        sights.clear();
        for (direction, tilt) in &directions {
            let [x, y, z] = *direction;
            let ray = add_scaled(add_scaled(scale(axis, z), t, x), s, y);
            if let Some(hit) = tree.ray(middle, ray, reach, |g| g as usize != f)
                && dot(*n, normals[hit.face as usize]) < cone.facing
            {
                sights.push(Sight { distance: hit.distance, tilt: *tilt });
            }
        }
        values.push(conclude(&mut sights));
    }
    Ok(values)
}

/// Unit normal; 0 for slivers.
fn normal(mesh: &SurfaceMesh, face: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(face);
    let area = area_vector_twice(a, b, c);
    let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
    let size = norm(area);
    if size > LEAST_HEIGHT * longest * longest { scale(area, 1.0 / size) } else { [0.0; 3] }
}

/// Diameter of the smallest sphere that touches the face and a sheet that faces it.
pub(super) fn gap(sights: &mut [Sight]) -> f64 {
    sights.iter().map(|s| s.distance / s.tilt).fold(f64::INFINITY, f64::min)
}

/// Radius of an inscribed sphere: of those that touch the face and what a ray met, one of the smallest, but not the very smallest.
pub(super) fn inscribed_radius(sights: &mut [Sight]) -> f64 {
    sights.sort_by(|a, b| (a.distance / a.tilt).total_cmp(&(b.distance / b.tilt)));
    let chosen = sights.get((TRUSTED - 1).min(sights.len().saturating_sub(1)));
    chosen.map_or(f64::INFINITY, |s| 0.5 * s.distance / s.tilt)
}

/// The shape diameter (Shapira, Shamir, Cohen-Or 2008): mean length of the rays without those that differ from their median by more than
/// their standard deviation.
pub(super) fn thickness(sights: &mut [Sight]) -> f64 {
    if sights.is_empty() {
        return f64::INFINITY;
    }
    sights.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    let count = sights.len() as f64;
    let median = sights[sights.len() / 2].distance;
    let mean = sights.iter().map(|s| s.distance).sum::<f64>() / count;
    let spread = (sights.iter().map(|s| (s.distance - mean).powi(2)).sum::<f64>() / count).sqrt();
    let near = sights.iter().map(|s| s.distance).filter(|d| (d - median).abs() <= spread);
    let (sum, kept) = near.fold((0.0, 0.0), |(sum, kept), d| (sum + d, kept + 1.0));
    if kept > 0.0 { sum / kept } else { median }
}
