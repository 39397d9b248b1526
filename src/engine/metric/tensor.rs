//! Symmetric 2 x 2 tensors in tangent planes: eigenvalues, logarithm, intersection, transport from plane to plane.

use crate::vector::{Vec2, Vec3, add_scaled, cross, dot, sub, unit};

/// `[[a, b], [b, c]]` as `[a, b, c]`.
pub(crate) type Sym2 = [f64; 3];
/// `xx xy xz yy yz zz`.
pub(crate) type Sym3 = [f64; 6];

/// Two orthonormal vectors of a tangent plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub(crate) u: Vec3,
    pub(crate) w: Vec3,
}

impl Frame {
    /// A frame of the plane with a unit normal.
    pub(crate) fn of(normal: Vec3) -> Frame {
        let axis = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let u = unit(add_scaled(axis, normal, -dot(axis, normal)));
        Frame { u, w: cross(normal, u) }
    }

    pub(crate) fn normal(&self) -> Vec3 {
        cross(self.u, self.w)
    }

    /// Coordinates of the tangential part of a vector.
    pub(crate) fn coordinates(&self, a: Vec3) -> Vec2 {
        [dot(a, self.u), dot(a, self.w)]
    }

    /// A form of this plane as a matrix in space.
    pub(crate) fn in_space(&self, m: Sym2) -> Sym3 {
        let (u, w) = (self.u, self.w);
        let at = |i: usize, j: usize| m[0] * u[i] * u[j] + m[1] * (u[i] * w[j] + w[i] * u[j]) + m[2] * w[i] * w[j];
        [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)]
    }

    /// What a matrix in space says of this plane.
    pub(crate) fn restrict(&self, t: &Sym3) -> Sym2 {
        let of = |a: Vec3, b: Vec3| {
            let row =
                [t[0] * b[0] + t[1] * b[1] + t[2] * b[2], t[1] * b[0] + t[3] * b[1] + t[4] * b[2], t[2] * b[0] + t[4] * b[1] + t[5] * b[2]];
            dot(a, row)
        };
        [of(self.u, self.u), of(self.u, self.w), of(self.w, self.w)]
    }
}

/// Quadratic form.
#[inline]
pub(crate) fn square(m: Sym2, d: Vec2) -> f64 {
    m[0] * d[0] * d[0] + 2.0 * m[1] * d[0] * d[1] + m[2] * d[1] * d[1]
}

/// Eigenvalues, the larger first; both at least 0 for positive forms whatever the rounding.
pub(crate) fn eigenvalues(m: Sym2) -> [f64; 2] {
    let (mean, half) = (0.5 * (m[0] + m[2]), 0.5 * (m[0] - m[2]));
    let radius = half.hypot(m[1]);
    let large = mean + radius;
    // The product is the determinant: no cancellation.
    let small = if large > 0.0 { (m[0] * m[2] - m[1] * m[1]) / large } else { mean - radius };
    [large, small.max(0.0)]
}

/// The form with the same directions and other eigenvalues.
pub(crate) fn with_eigenvalues(m: Sym2, of: impl Fn([f64; 2]) -> [f64; 2]) -> Sym2 {
    let (mean, half) = (0.5 * (m[0] + m[2]), 0.5 * (m[0] - m[2]));
    let radius = half.hypot(m[1]);
    let [large, small] = of(eigenvalues(m));
    let middle = 0.5 * (large + small);
    if radius <= 1e-14 * mean.abs() {
        return [middle, 0.0, middle];
    }
    let s = 0.5 * (large - small) / radius;
    [middle + s * half, s * m[1], middle - s * half]
}

/// Matrix logarithm of a positive form.
pub(crate) fn log(m: Sym2) -> Sym2 {
    with_eigenvalues(m, |[large, small]| {
        let large = large.max(f64::MIN_POSITIVE);
        [large.ln(), small.max(1e-30 * large).max(f64::MIN_POSITIVE).ln()]
    })
}

/// Matrix exponential of a symmetric matrix.
#[inline]
pub(crate) fn exp(l: Sym2) -> Sym2 {
    let (mean, half) = (0.5 * (l[0] + l[2]), 0.5 * (l[0] - l[2]));
    let radius = half.hypot(l[1]);
    // Far beyond anything wanted, but not beyond the range of floats.
    let mean = mean.clamp(-300.0, 300.0);
    let (up, down) = ((mean + radius.min(300.0)).exp(), (mean - radius.min(300.0)).exp());
    let middle = 0.5 * (up + down);
    let s = if radius > 1e-9 { 0.5 * (up - down) / radius } else { middle };
    [middle + s * half, s * l[1], middle - s * half]
}

/// The largest form whose unit ball lies in both unit balls of the simultaneous reduction: in the directions conjugate to both, the
/// larger value. Contains no length longer than either asks for.
pub(crate) fn intersect(m: Sym2, n: Sym2) -> Sym2 {
    // With m = L L^T, the eigenvectors of L^-1 n L^-T are the conjugate directions.
    if m[0].is_nan() || m[0] <= 0.0 {
        return n;
    }
    let l00 = m[0].sqrt();
    let l10 = m[1] / l00;
    let rest = m[2] - l10 * l10;
    if rest.is_nan() || rest <= 0.0 {
        return n;
    }
    let l11 = rest.sqrt();
    // k = L^-1 n L^-T.
    let a = n[0] / (l00 * l00);
    let b = (n[1] - l10 * n[0] / l00) / (l00 * l11);
    let c = (n[2] - 2.0 * l10 * n[1] / l00 + l10 * l10 * n[0] / (l00 * l00)) / (l11 * l11);
    let k = with_eigenvalues([a, b, c], |[x, y]| [x.max(1.0), y.max(1.0)]);
    // L k L^T.
    let (p, q, r) = (l00 * l00 * k[0], l00 * (l10 * k[0] + l11 * k[1]), l10 * (l10 * k[0] + l11 * k[1]) + l11 * (l10 * k[1] + l11 * k[2]));
    [p, q, r]
}

/// A form of one tangent plane in the frame of another, the planes being turned into one another the short way.
pub(crate) fn transport(from: &Frame, m: Sym2, to: &Frame) -> Sym2 {
    let (a, b) = (from.normal(), to.normal());
    let c = dot(a, b);
    // Where a tangent vector of `to` came from.
    let back = |x: Vec3| {
        let turned = if c > -0.99 { sub(x, add_scaled([0.0; 3], add_scaled(a, b, 1.0), dot(a, x) / (1.0 + c))) } else { x };
        from.coordinates(turned)
    };
    let (p, q) = (back(to.u), back(to.w));
    let cross = m[0] * p[0] * q[0] + m[1] * (p[0] * q[1] + p[1] * q[0]) + m[2] * p[1] * q[1];
    [square(m, p), cross, square(m, q)]
}
