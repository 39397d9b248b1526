//! Principal axes of distributions in space, and the mean plane of a loop.

use crate::vector::{Vec2, Vec3, add, add_scaled, bounds, cross, distance, dot, scale, sub, unit};

/// The points of a loop about the centre of their box, divided by a power of two, so that they are of order 1.
#[derive(Debug)]
pub(super) struct Normalised {
    /// One point per vertex of the loop.
    pub(super) points: Vec<Vec3>,
    centre: Vec3,
    unit: f64,
}

impl Normalised {
    /// Takes the vertices `ring` out of `positions`. O(m).
    pub(super) fn of(ring: &[u32], positions: &[Vec3]) -> Normalised {
        let raw: Vec<Vec3> = ring.iter().map(|&v| positions[v as usize]).collect();
        let (low, high) = bounds(&raw).unwrap_or(([0.0; 3], [0.0; 3]));
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let unit = if extent > 0.0 && extent.is_finite() { extent.log2().ceil().clamp(-1000.0, 1000.0).exp2() } else { 1.0 };
        let centre = [0, 1, 2].map(|k| low[k] + 0.5 * (high[k] - low[k]));
        let points = raw.into_iter().map(|p| scale(sub(p, centre), 1.0 / unit)).collect();
        Normalised { points, centre, unit }
    }

    /// Back to the coordinates of `positions`.
    pub(super) fn restore(&self, p: Vec3) -> Vec3 {
        add_scaled(self.centre, p, self.unit)
    }

    /// Lengths of the edges, edge `k` leaving point `k`.
    pub(super) fn lengths(&self) -> Vec<f64> {
        let p = &self.points;
        (0..p.len()).map(|k| distance(p[k], p[(k + 1) % p.len()])).collect()
    }
}

/// A plane in space with coordinates: `origin + a first + b second`, the two directions orthonormal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    origin: Vec3,
    first: Vec3,
    second: Vec3,
}

impl Plane {
    /// Coordinates of the foot of a point.
    pub(super) fn project(&self, p: Vec3) -> Vec2 {
        let d = sub(p, self.origin);
        [dot(d, self.first), dot(d, self.second)]
    }

    /// The point with these coordinates.
    pub(super) fn lift(&self, q: Vec2) -> Vec3 {
        add_scaled(add_scaled(self.origin, self.first, q[0]), self.second, q[1])
    }

    /// The same plane seen from behind: areas change their sign.
    pub(super) fn reversed(self) -> Plane {
        Plane { origin: self.origin, first: self.second, second: self.first }
    }

    /// Through `origin` with a unit normal; which directions are the axes is an accident.
    fn with_normal(origin: Vec3, normal: Vec3) -> Plane {
        let least = (0..3).fold(0, |best, k| if normal[k].abs() < normal[best].abs() { k } else { best });
        let mut axis = [0.0; 3];
        axis[least] = 1.0;
        let first = unit(cross(axis, normal));
        Plane { origin, first, second: cross(normal, first) }
    }
}

/// The plane with the least squared distances from a closed polygon, integrated along its edges (so it does not depend on how
/// finely they are divided), on the side from which the polygon runs counter-clockwise. First axis: the direction of the largest
/// extent. O(m).
pub(super) fn mean_plane(points: &[Vec3]) -> Plane {
    let edges = || (0..points.len()).map(|k| (points[k], points[(k + 1) % points.len()]));
    let (mut total, mut sum) = (0.0, [0.0; 3]);
    for (a, b) in edges() {
        let l = distance(a, b);
        (total, sum) = (total + l, add_scaled(sum, add(a, b), 0.5 * l));
    }
    let origin = if total > 0.0 { scale(sum, 1.0 / total) } else { points.first().copied().unwrap_or([0.0; 3]) };
    let mut moments = Moments::default();
    for (a, b) in edges() {
        let l = distance(a, b);
        moments.add(sub(scale(add(a, b), 0.5), origin), l);
        moments.add(sub(b, a), l / 12.0);
    }
    let [first, second, normal] = moments.axes();
    let plane = Plane { origin, first, second };
    if dot(area_vector(points), normal) < 0.0 { Plane { second: scale(second, -1.0), ..plane } } else { plane }
}

/// The plane on which the projection of a closed polygon has the largest area, seen from where it runs counter-clockwise; `None`
/// if no projection has area. O(m).
pub(super) fn largest_shadow(points: &[Vec3]) -> Option<Plane> {
    let normal = unit(area_vector(points));
    let origin = mean_plane(points).origin;
    (normal != [0.0; 3]).then(|| Plane::with_normal(origin, normal))
}

/// Twice the vector area of a closed polygon.
fn area_vector(points: &[Vec3]) -> Vec3 {
    let o = points.first().copied().unwrap_or([0.0; 3]);
    points.windows(2).fold([0.0; 3], |sum, w| add(sum, cross(sub(w[0], o), sub(w[1], o))))
}

/// Second moments of a distribution.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments([[f64; 3]; 3]);

impl Moments {
    /// Adds `weight v v^T`.
    pub(super) fn add(&mut self, v: Vec3, weight: f64) {
        for i in 0..3 {
            for j in 0..3 {
                self.0[i][j] += weight * v[i] * v[j];
            }
        }
    }

    /// Orthonormal principal axes, right-handed, largest moment first (Jacobi rotations). Equal moments leave the axes to the
    /// rounding, but always the same.
    pub(super) fn axes(self) -> [Vec3; 3] {
        let mut m = self.0;
        let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for _ in 0..16 {
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut m, &mut axes, p, q);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| m[b][b].total_cmp(&m[a][a]));
        let [first, second] = [axes[order[0]], axes[order[1]]];
        [first, second, unit(cross(first, second))]
    }
}

/// One Jacobi rotation that makes `m[p][q]` zero; row `k` of `axes` is the direction of `m[k][k]`.
fn rotate(m: &mut [[f64; 3]; 3], axes: &mut [Vec3; 3], p: usize, q: usize) {
    if m[p][q] == 0.0 {
        return;
    }
    let (sin, cos) = (0.5 * (2.0 * m[p][q]).atan2(m[p][p] - m[q][q])).sin_cos();
    for k in 0..3 {
        let (a, b) = (m[k][p], m[k][q]);
        (m[k][p], m[k][q]) = (cos * a + sin * b, cos * b - sin * a);
    }
    for k in 0..3 {
        let (a, b) = (m[p][k], m[q][k]);
        (m[p][k], m[q][k]) = (cos * a + sin * b, cos * b - sin * a);
    }
    (m[p][q], m[q][p]) = (0.0, 0.0);
    let (a, b) = (axes[p], axes[q]);
    axes[p] = add_scaled(scale(a, cos), b, sin);
    axes[q] = add_scaled(scale(b, cos), a, -sin);
}
