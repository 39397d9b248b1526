//! Two-sided distances of two surfaces and of their boundary curves.

use super::edges::Edge;
use super::{Fidelity, TargetSize};
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, bounding_diagonal, distance, lerp, triangle_area};
use crate::work::Work;

/// Area samples of a surface: two a face, at least this many.
const LEAST_SAMPLES: usize = 20_000;
/// And at most this many: enough for the mean square to three digits.
const MOST_SAMPLES: usize = 200_000;
/// Points between two checks for cancellation.
const CHECK_EVERY: usize = 4096;

/// One of the two surfaces compared.
pub(super) struct Side<'a> {
    pub(super) mesh: &'a SurfaceMesh,
    pub(super) bvh: &'a TriangleBvh,
    pub(super) edges: &'a [Edge],
}

/// Largest and mean squared distance from one surface to another.
struct OneSided {
    max: f64,
    mean_square: f64,
}

/// All distances between input `a` and output `b`.
pub(super) fn measure_fidelity(a: &Side<'_>, b: &Side<'_>, target: Option<&TargetSize>, work: &Work<'_>) -> Result<Fidelity> {
    let diagonal = bounding_diagonal(&a.mesh.positions);
    let relative = |d: f64| if diagonal > 0.0 { d / diagonal } else { 0.0 };
    let out_to_in = one_sided(b, a.bvh, work)?;
    work.step(6, 10)?;
    let in_to_out = one_sided(a, b.bvh, work)?;
    work.step(9, 10)?;
    let (area_in, area_out) = (a.mesh.area(), b.mesh.area());
    Ok(Fidelity {
        diagonal,
        hausdorff_max_rel: relative(out_to_in.max.max(in_to_out.max)),
        hausdorff_rms_rel: relative((0.5 * (out_to_in.mean_square + in_to_out.mean_square)).sqrt()),
        out_to_in_max_rel: relative(out_to_in.max),
        in_to_out_max_rel: relative(in_to_out.max),
        boundary_deviation_rel: boundary_deviation(a, b, target, work)?.map(relative),
        area_ratio: if area_in > 0.0 { area_out / area_in } else { 0.0 },
    })
}

/// Queries come in order along the surface, each from the face the one before it hit.
struct Probe<'a> {
    bvh: &'a TriangleBvh,
    face: u32,
}

impl Probe<'_> {
    /// Squared distance, exact if it is above `stop`.
    fn distance_squared(&mut self, p: Vec3, stop: f64) -> f64 {
        match self.bvh.closest_from(p, self.face, stop) {
            Some(hit) => {
                self.face = hit.face;
                hit.distance_squared
            }
            None => f64::INFINITY,
        }
    }
}

fn one_sided(from: &Side<'_>, to: &TriangleBvh, work: &Work<'_>) -> Result<OneSided> {
    let mesh = from.mesh;
    let mut probe = Probe { bvh: to, face: 0 };
    let (mut max, mut sum) = (0f64, 0.0);
    let samples = area_samples(mesh);
    for (i, p) in samples.iter().enumerate() {
        if i % CHECK_EVERY == 0 {
            work.check()?;
        }
        let d = probe.distance_squared(*p, 0.0);
        sum += d;
        max = max.max(d);
    }
    for (f, t) in mesh.triangles.iter().enumerate() {
        if f % CHECK_EVERY == 0 {
            work.check()?;
        }
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        let centroid = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
        // Points of the faces that share them are visited again: cheap, since they stop at once below the maximum.
        for p in [a, lerp(a, b, 0.5), b, lerp(b, c, 0.5), c, lerp(c, a, 0.5), centroid] {
            max = max.max(probe.distance_squared(p, max));
        }
    }
    Ok(OneSided { max: max.sqrt(), mean_square: sum / samples.len().max(1) as f64 })
}

/// Points spread evenly over the area, stratified along the faces.
fn area_samples(mesh: &SurfaceMesh) -> Vec<Vec3> {
    let count = (2 * mesh.triangles.len()).clamp(LEAST_SAMPLES, MOST_SAMPLES);
    let total = mesh.area();
    if total.is_nan() || total <= 0.0 {
        return Vec::new();
    }
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut samples = Vec::with_capacity(count);
    let (mut face, mut covered) = (0, 0.0);
    let mut area = face_area(mesh, 0);
    for i in 0..count {
        let at = (i as f64 + random()) * total / count as f64;
        while covered + area < at && face + 1 < mesh.triangles.len() {
            covered += area;
            face += 1;
            area = face_area(mesh, face);
        }
        let [a, b, c] = mesh.corners(face);
        let (r, s) = (random().sqrt(), random());
        samples.push(lerp(a, lerp(b, c, s), r));
    }
    samples
}

fn face_area(mesh: &SurfaceMesh, face: usize) -> f64 {
    let [a, b, c] = mesh.corners(face);
    triangle_area(a, b, c)
}

/// Two-sided distance of the boundary curves; `None` if one of the surfaces has none.
fn boundary_deviation(a: &Side<'_>, b: &Side<'_>, target: Option<&TargetSize>, work: &Work<'_>) -> Result<Option<f64>> {
    let (from, to) = (boundary_segments(a), boundary_segments(b));
    if from.is_empty() || to.is_empty() {
        return Ok(None);
    }
    let mean_length = to.iter().map(|[p, q]| distance(*p, *q)).sum::<f64>() / to.len() as f64;
    let step = 0.1
        * match target {
            Some(TargetSize::Uniform(size)) => *size,
            _ => mean_length,
        };
    let one = curve_distance(&from, &to, step, work)?;
    Ok(Some(one.max(curve_distance(&to, &from, step, work)?)))
}

fn boundary_segments(side: &Side<'_>) -> Vec<[Vec3; 2]> {
    let at = |v: u32| side.mesh.positions[v as usize];
    side.edges.iter().filter(|e| e.faces == 1).map(|e| e.ends.map(at)).collect()
}

/// Largest distance from points of `from`, at most `step` apart, to `to`.
fn curve_distance(from: &[[Vec3; 2]], to: &[[Vec3; 2]], step: f64, work: &Work<'_>) -> Result<f64> {
    // A segment is a triangle with two equal corners.
    let ends: Vec<Vec3> = to.as_flattened().to_vec();
    let segments: Vec<[u32; 3]> = (0..to.len() as u32).map(|i| [2 * i, 2 * i + 1, 2 * i + 1]).collect();
    let bvh = TriangleBvh::build(&ends, &segments);
    let mut probe = Probe { bvh: &bvh, face: 0 };
    let mut max = 0f64;
    for [a, b] in from {
        work.check()?;
        let pieces = (distance(*a, *b) / step).ceil().clamp(1.0, 10_000.0);
        max = max.max(probe.distance_squared(*a, max)).max(probe.distance_squared(*b, max));
        for i in 0..pieces as usize {
            let p = lerp(*a, *b, (i as f64 + 0.5) / pieces);
            max = max.max(probe.distance_squared(p, max));
        }
    }
    Ok(max.sqrt())
}
