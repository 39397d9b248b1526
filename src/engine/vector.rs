//! Small fixed-size vector arithmetic on `[f64; 3]` and `[f64; 2]`.

/// A point or vector in space.
pub type Vec3 = [f64; 3];
/// A point or vector in the plane of a chart.
pub type Vec2 = [f64; 2];

/// `a + b`
#[inline]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`
#[inline]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `s a`
#[inline]
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + s b`
#[inline]
pub fn add_scaled(a: Vec3, b: Vec3, s: f64) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// `(1 - t) a + t b`
#[inline]
pub fn lerp(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])]
}

/// Scalar product.
#[inline]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length.
#[inline]
pub fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Distance of two points.
#[inline]
pub fn distance(a: Vec3, b: Vec3) -> f64 {
    norm(sub(a, b))
}

/// `a / |a|`, or the zero vector if `a` is zero.
#[inline]
pub fn unit(a: Vec3) -> Vec3 {
    let n = norm(a);
    if n > 0.0 { scale(a, 1.0 / n) } else { [0.0; 3] }
}

/// Normal of the triangle `a b c` with length twice its area.
#[inline]
pub fn area_vector_twice(a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    cross(sub(b, a), sub(c, a))
}

/// Area of the triangle `a b c`.
#[inline]
pub fn triangle_area(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    0.5 * norm(area_vector_twice(a, b, c))
}

/// Angle between two vectors in radians, `[0, pi]`, accurate for small angles.
#[inline]
pub fn angle_between(a: Vec3, b: Vec3) -> f64 {
    norm(cross(a, b)).atan2(dot(a, b))
}

/// Shape measure `kappa = 4 sinA sinB sinC / (sinA + sinB + sinC)` of a triangle (P1 eq. 3):
/// 1 for equilateral, 0 for flat or degenerate triangles.
#[inline]
pub fn kappa(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    let (x, y, z) = (distance(b, c), distance(c, a), distance(a, b));
    let twice = area_vector_twice(a, b, c);
    let below = (x + y + z) * x * y * z;
    if below > 0.0 { 4.0 * dot(twice, twice) / below } else { 0.0 }
}

/// The axis-aligned box of some points as `(low, high)`; `None` for no points.
pub fn bounds(points: &[Vec3]) -> Option<(Vec3, Vec3)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(mut low, mut high), p| {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
        (low, high)
    }))
}

/// Length of the diagonal of the bounding box; 0 for no points.
pub fn bounding_diagonal(points: &[Vec3]) -> f64 {
    bounds(points).map_or(0.0, |(low, high)| distance(low, high))
}
