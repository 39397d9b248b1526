//! Partition by a plane through the handles (P3 section 5, the brake block): given, or the best of a few found by itself.

use super::handles::{Loops, open_handles};
use super::strategy::Plane;
use super::surface::{Limits, Surface};
use super::{Partition, PartitionSpec, complete, connected_sets, face_groups, smooth};
use crate::error::{EngineError, Result};
use crate::features::Features;
use crate::vector::{Vec3, add_scaled, bounds, cross, dot, norm, scale, sub, unit};
use crate::work::Work;

/// Parts that are smaller than this share of the area of the neighbour they are an island of go with it.
const ISLAND: f64 = 0.02;
/// Sweeps of the Jacobi eigenvalue method.
const SWEEPS: usize = 12;

/// A plane with what it does to the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FoundPlane {
    pub(super) plane: Plane,
    /// Handles left in all parts together.
    pub(super) handles: u64,
    /// Parts.
    pub(super) parts: u32,
}

/// Limits of a partition by planes or handles: as few patches as can be have as many loops as it takes.
pub(super) fn limits_of(spec: &PartitionSpec) -> Limits {
    Limits { loops: u32::MAX, ..Limits::new(spec) }
}

/// Partition by a plane found by [`find_plane`]; parts are merged across it where that is valid.
pub(super) fn by_found_plane(surface: &Surface<'_>, plane: Plane, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let limits = limits_of(spec);
    let side = cleaned_sides(surface, sides(surface, plane), limits, work)?;
    let parts = connected_sets(surface, |f, g| side[f as usize] == side[g as usize]);
    complete(surface, open_handles(surface, parts, Loops::Shortest, work)?, limits, spec, work)
}

/// Partition by a given plane, whose cut is kept as if it were a feature.
pub(super) fn by_given_plane(surface: &Surface<'_>, plane: Plane, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let limits = limits_of(spec);
    let side = sides(surface, plane);
    if side.windows(2).all(|pair| pair[0] == pair[1]) {
        return Err(EngineError::bad_parameter("strategy.plane", "all of the surface is on one side of the plane"));
    }
    let side = cleaned_sides(surface, side, limits, work)?;
    let features = with_borders(surface, &side);
    let cut = Surface { features: &features, length: surface.length.clone(), area: surface.area.clone(), ..*surface };
    complete(&cut, open_handles(&cut, face_groups(&cut), Loops::Shortest, work)?, limits, spec, work)
}

/// The features and all edges between faces of different labels.
fn with_borders(surface: &Surface<'_>, label: &[u32]) -> Features {
    let mut features = surface.features.clone();
    for h in 0..surface.topology.halfedge_count() as u32 {
        if surface.topology.twin(h).is_some_and(|t| label[h as usize / 3] != label[t as usize / 3]) {
            features.is_feature[h as usize] = true;
        }
    }
    features
}

/// Side of each face (0 or 1), islands given to what surrounds them, the border smoothed. O(F).
fn cleaned_sides(surface: &Surface<'_>, mut side: Vec<u32>, limits: Limits, work: &Work<'_>) -> Result<Vec<u32>> {
    work.check()?;
    let sets = connected_sets(surface, |f, g| side[f as usize] == side[g as usize]);
    let mut label = vec![0u32; side.len()];
    for (p, set) in sets.iter().enumerate() {
        set.iter().for_each(|&f| label[f as usize] = p as u32);
    }
    let area: Vec<f64> = sets.iter().map(|set| set.iter().map(|&f| surface.area[f as usize]).sum()).collect();
    for (p, set) in sets.iter().enumerate() {
        work.check()?;
        if let Some(around) = only_neighbour(surface, &label, set, p as u32).filter(|&q| area[p] < ISLAND * area[q as usize]) {
            let other = side[sets[around as usize][0] as usize];
            set.iter().for_each(|&f| side[f as usize] = other);
        }
    }
    smooth::smooth_borders(surface, &mut side, Limits { faces: u32::MAX, ..limits }, work)?;
    Ok(side)
}

/// The one set that a set borders on, if it borders on one other alone and lies in it as a disc.
fn only_neighbour(surface: &Surface<'_>, label: &[u32], set: &[u32], p: u32) -> Option<u32> {
    let mut around = None;
    let mut first = None;
    let mut border = 0usize;
    for h in set.iter().flat_map(|&f| 3 * f..3 * f + 3).filter(|&h| surface.on_border(label, h, p)) {
        let q = label[surface.crossing(h)? as usize];
        if *around.get_or_insert(q) != q {
            return None;
        }
        first.get_or_insert(h);
        border += 1;
    }
    // One loop: walking on from any border edge meets all of them.
    let inside = |f: u32| label[f as usize] == p;
    let first = first?;
    let (mut at, mut met) = (surface.next_on_border(first, inside), 1);
    while at != first && met <= border {
        at = surface.next_on_border(at, inside);
        met += 1;
    }
    around.filter(|_| met == border)
}

fn sides(surface: &Surface<'_>, plane: Plane) -> Vec<u32> {
    let offset = 3.0 * dot(plane.normal, plane.point);
    let height: Vec<f64> = surface.mesh.positions.iter().map(|&x| dot(plane.normal, x)).collect();
    let high = |t: &[u32; 3]| t.iter().map(|&v| height[v as usize]).sum::<f64>() >= offset;
    surface.mesh.triangles.iter().map(|t| u32::from(high(t))).collect()
}

/// Tries planes normal to the principal axes of the surface (every plane of mirror symmetry is one, unless axes are equal) and to the
/// coordinate axes, through the centroid and through the middle. O(F) for each of at most 12.
///
/// # Errors
/// Only those of `work`.
pub(super) fn find_plane(surface: &Surface<'_>, work: &Work<'_>) -> Result<FoundPlane> {
    let (centre, axes) = principal_axes(surface);
    let mut best: Option<FoundPlane> = None;
    for plane in candidates(surface, centre, axes) {
        work.check()?;
        let side = sides(surface, plane);
        let (handles, parts) = count_handles(surface, &side);
        if best.is_none_or(|b| (handles, parts) < (b.handles, b.parts)) {
            best = Some(FoundPlane { plane, handles, parts });
        }
    }
    let nothing = Plane { point: centre, normal: [0.0, 0.0, 1.0] };
    Ok(best.unwrap_or(FoundPlane { plane: nothing, handles: 0, parts: 1 }))
}

fn candidates(surface: &Surface<'_>, centre: Vec3, axes: [Vec3; 3]) -> Vec<Plane> {
    let mut planes: Vec<Plane> = Vec::new();
    let (low, high) = bounds(&surface.mesh.positions).unwrap_or_default();
    let size = norm(sub(high, low));
    for normal in axes.into_iter().chain([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) {
        let heights = surface.mesh.positions.iter().map(|&x| dot(normal, x));
        let (bottom, top) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        let middle = add_scaled(centre, normal, 0.5 * (bottom + top) - dot(normal, centre));
        for point in [centre, middle] {
            let near = |p: &Plane| norm(cross(p.normal, normal)) < 1e-3 && dot(normal, sub(point, p.point)).abs() < 1e-3 * size;
            if !planes.iter().any(near) {
                planes.push(Plane { point, normal });
            }
        }
    }
    planes
}

/// Handles left within the parts of a labelling with 0 and 1, and the parts. Vertices in which a part touches itself count once per
/// fan. O(F).
fn count_handles(surface: &Surface<'_>, side: &[u32]) -> (u64, u32) {
    let sets = connected_sets(surface, |f, g| side[f as usize] == side[g as usize]);
    let mut label = vec![0u32; side.len()];
    for (p, set) in sets.iter().enumerate() {
        set.iter().for_each(|&f| label[f as usize] = p as u32);
    }
    let mut scratch = super::surface::Scratch::new(surface.topology);
    let mut handles = 0;
    for (p, set) in sets.iter().enumerate() {
        handles += super::surface::measure(surface, &label, set, p as u32, &mut scratch).genus().max(0) as u64;
    }
    (handles, sets.len() as u32)
}

/// Centroid of the surface and the axes of inertia of its area, the thinnest direction first.
fn principal_axes(surface: &Surface<'_>) -> (Vec3, [Vec3; 3]) {
    let corners = |f: usize| surface.mesh.corners(f);
    let (mut area, mut centre) = (0.0, [0.0; 3]);
    for (f, &a) in surface.area.iter().enumerate() {
        area += a;
        centre = corners(f).into_iter().fold(centre, |c, p| add_scaled(c, p, a / 3.0));
    }
    if area > 0.0 {
        centre = scale(centre, 1.0 / area);
    }
    let mut moment = [[0.0; 3]; 3];
    for (f, &a) in surface.area.iter().enumerate() {
        let p = corners(f).map(|x| sub(x, centre));
        let sum = std::array::from_fn(|k| p[0][k] + p[1][k] + p[2][k]);
        for q in p.into_iter().chain([sum]) {
            for i in 0..3 {
                (0..3).for_each(|j| moment[i][j] += a / 12.0 * q[i] * q[j]);
            }
        }
    }
    let (values, vectors) = eigen(moment);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    (centre, order.map(|i| vectors[i]))
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, by Jacobi rotations.
fn eigen(mut m: [[f64; 3]; 3]) -> ([f64; 3], [Vec3; 3]) {
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(3 * SWEEPS) {
        if m[p][q] == 0.0 {
            continue;
        }
        let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
        let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
        let c = 1.0 / t.hypot(1.0);
        let s = t * c;
        for k in 0..3 {
            (m[k][p], m[k][q]) = (c * m[k][p] - s * m[k][q], s * m[k][p] + c * m[k][q]);
        }
        for k in 0..3 {
            (m[p][k], m[q][k]) = (c * m[p][k] - s * m[q][k], s * m[p][k] + c * m[q][k]);
            (v[p][k], v[q][k]) = (c * v[p][k] - s * v[q][k], s * v[p][k] + c * v[q][k]);
        }
    }
    ([m[0][0], m[1][1], m[2][2]], v.map(unit))
}
