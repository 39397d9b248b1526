//! Shape and size of triangles: kappa, angles, skewness, efficiency index (P1 eq. 3, 5, 6).

use super::edges::Edge;
use super::{ShapeQuality, TargetSize};
use crate::mesh::SurfaceMesh;
use crate::metric::squared_length;
use crate::vector::{Vec3, angle_between, kappa, norm, sub};

/// Bins of the histogram of kappa.
const BINS: usize = 20;

/// Angles of a triangle in degrees; 0 or 180 in degenerate ones.
fn angles([a, b, c]: [Vec3; 3]) -> [f64; 3] {
    [(a, b, c), (b, c, a), (c, a, b)].map(|(p, q, r)| angle_between(sub(q, p), sub(r, p)).to_degrees())
}

/// Shape of all triangles and, with a target, sizes of all edges. O(F log F).
pub(super) fn measure_shape(mesh: &SurfaceMesh, edges: &[Edge], target: Option<&TargetSize>) -> ShapeQuality {
    let count = mesh.triangles.len();
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
    let mut quality = ShapeQuality {
        vertices: used.iter().filter(|u| **u).count() as u64,
        triangles: count as u64,
        kappa_min: 1.0,
        kappa_histogram: vec![0; BINS],
        min_angle_deg: 180.0,
        ..ShapeQuality::default()
    };
    if count == 0 {
        return ShapeQuality { kappa_histogram: vec![0; BINS], ..ShapeQuality::default() };
    }
    let mut kappas = Vec::with_capacity(count);
    for f in 0..count {
        let corners = mesh.corners(f);
        let k = kappa(corners[0], corners[1], corners[2]);
        kappas.push(k);
        quality.kappa_min = quality.kappa_min.min(k);
        quality.kappa_mean += k;
        quality.kappa_histogram[((k * BINS as f64) as usize).min(BINS - 1)] += 1;
        let angle = angles(corners);
        let low = angle[0].min(angle[1]).min(angle[2]);
        let high = angle[0].max(angle[1]).max(angle[2]);
        quality.min_angle_deg = quality.min_angle_deg.min(low);
        quality.mean_min_angle_deg += low;
        quality.max_angle_deg = quality.max_angle_deg.max(high);
        let skewness = ((high - 60.0) / 120.0).max((60.0 - low) / 60.0);
        quality.skewness_mean += skewness;
        quality.skewness_max = quality.skewness_max.max(skewness);
    }
    quality.kappa_mean /= count as f64;
    quality.mean_min_angle_deg /= count as f64;
    quality.skewness_mean /= count as f64;
    quality.kappa_p01 = percentile(&mut kappas, 0.01);
    if let Some(target) = target {
        (quality.tau, quality.edge_ratio_ok) = measure_sizes(mesh, edges, target);
    }
    quality
}

/// Linear interpolation between the order statistics.
pub(super) fn percentile(values: &mut [f64], share: f64) -> f64 {
    let at = share * (values.len() - 1) as f64;
    let below = at.floor() as usize;
    let (_, low, rest) = values.select_nth_unstable_by(below, f64::total_cmp);
    let low = *low;
    let high = rest.iter().copied().fold(f64::INFINITY, f64::min);
    if high.is_finite() { low + (at - below as f64) * (high - low) } else { low }
}

/// Length of an edge in a size field that is linear along it: the integral of 1 / size (P1 eq. 6).
pub(super) fn length_in_field(length: f64, size_a: f64, size_b: f64) -> f64 {
    let ratio = (size_b - size_a) / size_a;
    if ratio.abs() < 1e-6 { length / (0.5 * (size_a + size_b)) } else { length * ratio.ln_1p() / (size_b - size_a) }
}

/// Length of the edge between two vertices in elements.
pub(super) fn length_in(target: &TargetSize, positions: &[Vec3], a: usize, b: usize) -> f64 {
    let e = sub(positions[b], positions[a]);
    match target {
        TargetSize::Uniform(size) => norm(e) / size,
        TargetSize::PerVertex(sizes) => length_in_field(norm(e), sizes[a], sizes[b]),
        TargetSize::Metric(tensors) => {
            // As in a size field: the size along the edge is linear between its ends.
            let at = |t: &[f64; 6]| 1.0 / squared_length(t, e).max(f64::MIN_POSITIVE).sqrt();
            length_in_field(1.0, at(&tensors[a]), at(&tensors[b]))
        }
    }
}

pub(super) fn measure_sizes(mesh: &SurfaceMesh, edges: &[Edge], target: &TargetSize) -> (Option<f64>, Option<f64>) {
    let (mut sum, mut fine) = (0.0, 0u64);
    for edge in edges {
        let [a, b] = edge.ends.map(|v| v as usize);
        let l = length_in(target, &mesh.positions, a, b);
        sum += if l < 1.0 { l - 1.0 } else { 1.0 / l - 1.0 };
        fine += u64::from((0.5f64.sqrt()..=2.0f64.sqrt()).contains(&l));
    }
    let count = edges.len().max(1) as f64;
    (Some(100.0 * (sum / count).exp()), Some(fine as f64 / count))
}

/// The `count` faces of least kappa, worst first.
pub(super) fn worst_faces(mesh: &SurfaceMesh, count: usize) -> Vec<u32> {
    let mut faces: Vec<(f64, u32)> = (0..mesh.triangles.len())
        .map(|f| {
            let [a, b, c] = mesh.corners(f);
            (kappa(a, b, c), f as u32)
        })
        .collect();
    let order = |x: &(f64, u32), y: &(f64, u32)| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1));
    if faces.len() > count {
        faces.select_nth_unstable_by(count, order);
        faces.truncate(count);
    }
    faces.sort_unstable_by(order);
    faces.into_iter().map(|(_, f)| f).collect()
}
