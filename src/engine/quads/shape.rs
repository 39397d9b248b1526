//! Shape of quadrangles and triangles in space, and the square (or equilateral triangle) nearest to one.

use crate::vector::{Vec3, add, add_scaled, area_vector_twice, cross, dot, norm, scale, sub, unit};

/// Normal of a polygon, with length twice its (projected) area.
pub(crate) fn area_vector(corners: &[Vec3]) -> Vec3 {
    match corners {
        [a, b, c] => area_vector_twice(*a, *b, *c),
        [a, b, c, d] => cross(sub(*c, *a), sub(*d, *b)),
        _ => [0.0; 3],
    }
}

/// `eta = max(1 - 2/pi max |pi/2 - angle|, 0)` of a quadrangle (P1 eq. 4): 1 for rectangles, 0 if an angle is 0, 180 degrees or
/// more, measured against the normal of the whole.
pub(crate) fn eta(corners: &[Vec3; 4]) -> f64 {
    1.0 - std::f64::consts::FRAC_2_PI * worst_deviation(corners, std::f64::consts::FRAC_PI_2).min(std::f64::consts::FRAC_PI_2)
}

/// The same measure for a triangle against 60 degrees, scaled so that flat triangles have 0.
fn evenness(corners: &[Vec3; 3]) -> f64 {
    let ideal = std::f64::consts::FRAC_PI_3;
    (1.0 - worst_deviation(corners, ideal) / ideal).max(0.0)
}

/// Shape of an element of 3 or 4 corners from 0 (bad) to 1.
pub(crate) fn quality(corners: &[Vec3]) -> f64 {
    match corners {
        [a, b, c] => evenness(&[*a, *b, *c]),
        [a, b, c, d] => eta(&[*a, *b, *c, *d]),
        _ => 0.0,
    }
}

fn worst_deviation(corners: &[Vec3], ideal: f64) -> f64 {
    let normal = unit(area_vector(corners));
    let count = corners.len();
    let mut worst = 0.0f64;
    for k in 0..count {
        let out = sub(corners[(k + 1) % count], corners[k]);
        let back = sub(corners[(k + count - 1) % count], corners[k]);
        let side = cross(out, back);
        let (sine, cosine) = (norm(side), dot(out, back));
        let angle = sine.atan2(cosine);
        // A corner that turns the other way is re-entrant.
        let angle = if dot(side, normal) < 0.0 { std::f64::consts::TAU - angle } else { angle };
        worst = worst.max((angle - ideal).abs());
        if sine == 0.0 {
            worst = std::f64::consts::PI;
        }
    }
    worst
}

/// The corners of the regular polygon nearest to an element (least squares over place and turn), its sides moved by the share `towards`
/// from their best length to `size`.
pub(crate) fn nearest_regular(corners: &[Vec3], size: f64, towards: f64, out: &mut [Vec3; 4]) {
    let count = corners.len();
    let centre = scale(corners.iter().fold([0.0; 3], |s, p| add(s, *p)), 1.0 / count as f64);
    let normal = unit(area_vector(corners));
    let first = sub(corners[0], centre);
    let x = unit(add_scaled(first, normal, -dot(first, normal)));
    let y = cross(normal, x);
    // First Fourier coefficient: mean of the corners turned back.
    let (mut re, mut im) = (0.0, 0.0);
    let turn = std::f64::consts::TAU / count as f64;
    for (k, p) in corners.iter().enumerate() {
        let d = sub(*p, centre);
        let (px, py) = (dot(d, x), dot(d, y));
        let (s, c) = turns(k, count, turn);
        re += px * c + py * s;
        im += py * c - px * s;
    }
    (re, im) = (re / count as f64, im / count as f64);
    let radius = (re * re + im * im).sqrt();
    let wanted = size / (2.0 * (0.5 * turn).sin());
    let stretch = if radius > 0.0 { 1.0 + towards * (wanted / radius - 1.0) } else { 0.0 };
    for (k, place) in out.iter_mut().enumerate().take(count) {
        let (s, c) = turns(k, count, turn);
        let (px, py) = (stretch * (re * c - im * s), stretch * (re * s + im * c));
        *place = add_scaled(add_scaled(centre, x, px), y, py);
    }
}

/// Sine and cosine of `k` turns.
fn turns(k: usize, count: usize, turn: f64) -> (f64, f64) {
    if count == 4 { [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][k] } else { (k as f64 * turn).sin_cos() }
}
