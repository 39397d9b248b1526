//! Implicit bodies: a smooth union of vessels and sheets, given by distances.

use crate::vector::{Vec3, add_scaled, dot, norm, sub};

/// A building block of a body.
#[derive(Debug, Clone)]
pub(super) enum Primitive {
    /// A polyline with a radius at each point, linear between.
    Strand(Vec<(Vec3, f64)>),
    /// Triangles thickened by a radius.
    Sheet(Vec<[Vec3; 3]>, f64),
}

/// A smooth union of primitives; negative inside.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub(super) primitives: Vec<Primitive>,
    /// Distance within which two primitives blend.
    pub(super) blend: f64,
}

/// Bound of the slope of every primitive's distance.
pub(super) const SLOPE: f64 = 1.25;

impl Primitive {
    /// Signed distance-like value: exact for constant radii, slope at most [`SLOPE`].
    pub(super) fn distance(&self, p: Vec3) -> f64 {
        match self {
            Primitive::Strand(points) => points.windows(2).map(|w| segment_distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min),
            Primitive::Sheet(triangles, radius) => triangles.iter().map(|t| triangle_distance(p, t)).fold(f64::INFINITY, f64::min) - radius,
        }
    }

    /// Points and radii whose balls, swept, cover the primitive.
    pub(super) fn balls(&self) -> Vec<(Vec3, f64)> {
        match self {
            Primitive::Strand(points) => points.clone(),
            Primitive::Sheet(triangles, radius) => triangles.iter().flatten().map(|&c| (c, *radius)).collect(),
        }
    }

    /// Area of its surface alone, roughly.
    pub(super) fn area(&self) -> f64 {
        match self {
            Primitive::Strand(points) => {
                points.windows(2).map(|w| std::f64::consts::PI * (w[0].1 + w[1].1) * norm(sub(w[1].0, w[0].0))).sum()
            }
            Primitive::Sheet(triangles, _) => triangles.iter().map(|[a, b, c]| 2.5 * crate::vector::triangle_area(*a, *b, *c)).sum(),
        }
    }
}

impl Field {
    /// The same body with no part thinner than a radius.
    pub(super) fn thickened(&self, least: f64) -> Field {
        let thick = |p: &Primitive| match p {
            Primitive::Strand(points) => Primitive::Strand(points.iter().map(|&(c, r)| (c, r.max(least))).collect()),
            Primitive::Sheet(triangles, r) => Primitive::Sheet(triangles.clone(), r.max(least)),
        };
        Field { primitives: self.primitives.iter().map(thick).collect(), blend: self.blend }
    }

    /// Value from those primitives named in `among`. A primitive farther than the nearest by `blend` adds exactly nothing, so
    /// any list that holds all nearer ones gives the same bits.
    pub(super) fn value(&self, p: Vec3, among: &[u16], scratch: &mut Vec<f64>) -> f64 {
        scratch.clear();
        scratch.extend(among.iter().map(|&i| self.primitives[i as usize].distance(p)));
        let nearest = scratch.iter().copied().fold(f64::INFINITY, f64::min);
        let pull: f64 = scratch.iter().map(|d| (1.0 - (d - nearest) / self.blend).max(0.0).powi(2)).sum();
        nearest - 0.25 * self.blend * (pull - 1.0)
    }
}

fn segment_distance(p: Vec3, a: (Vec3, f64), b: (Vec3, f64)) -> f64 {
    let along = sub(b.0, a.0);
    let t = (dot(sub(p, a.0), along) / dot(along, along)).clamp(0.0, 1.0);
    norm(sub(p, add_scaled(a.0, along, t))) - (a.1 + t * (b.1 - a.1))
}

fn triangle_distance(p: Vec3, c: &[Vec3; 3]) -> f64 {
    let normal = crate::vector::area_vector_twice(c[0], c[1], c[2]);
    let inside = (0..3).all(|k| {
        let edge = sub(c[(k + 1) % 3], c[k]);
        dot(crate::vector::cross(normal, edge), sub(p, c[k])) >= 0.0
    });
    if inside {
        return dot(normal, sub(p, c[0])).abs() / norm(normal);
    }
    (0..3).map(|k| segment_distance(p, (c[k], 0.0), (c[(k + 1) % 3], 0.0))).fold(f64::INFINITY, f64::min)
}
