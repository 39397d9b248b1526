//! A small oriented box around points: many first guesses from extreme points, each improved by turning the box about its axes
//! in turn to the smallest rectangle of the projection, until nothing gains (the local step of Chang, Gorissen and Melchior 2011,
//! which P2 cites, with fixed starts of the kind of Larsson and Kaellberg 2011 in place of a genetic search).

use crate::vector::{Vec2, Vec3, add_scaled, cross, distance, dot, norm, scale, sub, unit};

/// A box with three orthogonal axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// Its centre.
    pub centre: Vec3,
    /// Unit vectors along its sides, longest side first, right-handed.
    pub axes: [Vec3; 3],
    /// Lengths of its sides, the longest first.
    pub sides: [f64; 3],
}

/// Directions in which extreme points are taken.
const DIRECTIONS: u32 = 96;
/// First guesses that are improved.
const IMPROVED: usize = 6;
/// Rounds of turning about all three axes at most.
const ROUNDS: usize = 12;
/// Sides count as at least this share of the diagonal, so that among flat boxes the smallest area wins, and among
/// those without width the shortest.
const THICKNESS: f64 = 1e-6;

/// A box around all points whose volume is near the least possible (exact for boxes; the least is not guaranteed). `None` for no
/// points. Deterministic; 200 scalar products per point and about a millisecond.
pub fn smallest_box(points: &[Vec3]) -> Option<OrientedBox> {
    let origin = *points.first()?;
    let extremes = extremes(points);
    let diagonal = extremes.iter().map(|&p| distance(p, origin)).fold(0.0, f64::max);
    let turned = guesses(&extremes).into_iter().map(|axes| turned(&extremes, axes, 0, diagonal));
    let mut guesses: Vec<(f64, [Vec3; 3])> = turned.map(|axes| (size(&extremes, &axes, diagonal), axes)).collect();
    guesses.sort_by(|a, b| a.0.total_cmp(&b.0));
    guesses.truncate(IMPROVED);
    let improved = guesses.into_iter().map(|(_, axes)| improved(&extremes, axes, diagonal));
    // The extreme points are not all points: measure on these.
    let (_, axes) = improved.map(|axes| (size(points, &axes, diagonal), axes)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(boxed(points, axes))
}

/// Some points that touch planes in evenly spread directions.
fn extremes(points: &[Vec3]) -> Vec<Vec3> {
    if points.len() <= 2 * DIRECTIONS as usize {
        return points.to_vec();
    }
    let mut chosen: Vec<u32> = Vec::new();
    for k in 0..DIRECTIONS {
        // A spiral over the half sphere.
        let z = (f64::from(k) + 0.5) / f64::from(DIRECTIONS);
        let (sin, cos) = (2.399_963_229_728_653 * f64::from(k)).sin_cos();
        let r = (1.0 - z * z).sqrt();
        let direction = [r * cos, r * sin, z];
        let (mut low, mut high) = ((f64::INFINITY, 0), (f64::NEG_INFINITY, 0));
        for (i, &p) in points.iter().enumerate() {
            let along = dot(p, direction);
            if along < low.0 {
                low = (along, i as u32);
            }
            if along > high.0 {
                high = (along, i as u32);
            }
        }
        chosen.extend([low.1, high.1]);
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|i| points[i as usize]).collect()
}

fn farthest(points: &[Vec3], far: impl Fn(Vec3) -> f64) -> Vec3 {
    points.iter().fold(([0.0; 3], f64::NEG_INFINITY), |best, &p| if far(p) > best.1 { (p, far(p)) } else { best }).0
}

/// Axes to start from: those of the coordinates, and for two tetrahedra over a large triangle those along each edge, along each
/// normal, and across each pair of opposite edges (the smallest box has two sides that each hold an edge of the hull).
fn guesses(points: &[Vec3]) -> Vec<[Vec3; 3]> {
    let mut all = vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]];
    let Some(&start) = points.first() else { return all };
    let a = farthest(points, |p| distance(p, start));
    let b = farthest(points, |p| distance(p, a));
    let along = unit(sub(b, a));
    let off = |p: Vec3| norm(sub(sub(p, a), scale(along, dot(sub(p, a), along))));
    let c = farthest(points, off);
    let normal = unit(cross(sub(b, a), sub(c, a)));
    let above = farthest(points, |p| dot(sub(p, a), normal));
    let below = farthest(points, |p| -dot(sub(p, a), normal));
    for apex in [above, below] {
        for (p, q, r) in [(a, b, c), (a, b, apex), (b, c, apex), (c, a, apex)] {
            all.extend([(p, q, r), (q, r, p), (r, p, q)].map(|(x, y, z)| frame(sub(y, x), sub(z, x))));
            all.push(frame(cross(sub(q, p), sub(r, p)), sub(q, p)));
        }
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            all.push(frame(cross(sub(q, p), sub(apex, r)), sub(q, p)));
        }
    }
    all
}

/// Orthonormal right-handed axes, the first along `x`, the second in the plane of `x` and `y`.
fn frame(x: Vec3, y: Vec3) -> [Vec3; 3] {
    let first = match unit(x) {
        x if norm(x) > 0.5 => x,
        _ => [1.0, 0.0, 0.0],
    };
    let orthogonal = |y: Vec3| add_scaled(y, first, -dot(y, first));
    let mut second = unit(orthogonal(unit(y)));
    if norm(second) < 0.5 || dot(second, first).abs() > 1e-6 {
        // Parallel: the coordinate direction farthest from the first.
        let k = (0..3).fold(0, |k, j| if first[j].abs() < first[k].abs() { j } else { k });
        second = unit(orthogonal(std::array::from_fn(|j| f64::from(u8::from(j == k)))));
    }
    [first, second, cross(first, second)]
}

fn spans(points: &[Vec3], axes: &[Vec3; 3]) -> [[f64; 2]; 3] {
    axes.map(|axis| {
        points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |s, &p| {
            let along = dot(p, axis);
            [s[0].min(along), s[1].max(along)]
        })
    })
}

/// Volume, with sides of at least [`THICKNESS`].
fn size(points: &[Vec3], axes: &[Vec3; 3], diagonal: f64) -> f64 {
    spans(points, axes).iter().map(|s| s[1] - s[0] + THICKNESS * diagonal).product()
}

/// Turns a box about each of its axes to the smallest rectangle until that gains nothing.
fn improved(points: &[Vec3], start: [Vec3; 3], diagonal: f64) -> [Vec3; 3] {
    let (mut axes, mut best) = (start, size(points, &start, diagonal));
    for _ in 0..ROUNDS {
        let before = best;
        for k in 0..3 {
            let turned = turned(points, axes, k, diagonal);
            let turned_size = size(points, &turned, diagonal);
            if turned_size < best {
                (axes, best) = (turned, turned_size);
            }
        }
        if best > before * (1.0 - 1e-9) {
            break;
        }
    }
    axes
}

/// The box turned about one of its axes to the smallest rectangle around the projection.
fn turned(points: &[Vec3], axes: [Vec3; 3], k: usize, diagonal: f64) -> [Vec3; 3] {
    let (u, v, w) = (axes[(k + 1) % 3], axes[(k + 2) % 3], axes[k]);
    let flat: Vec<Vec2> = points.iter().map(|&p| [dot(p, u), dot(p, v)]).collect();
    let along = smallest_rectangle(&flat, THICKNESS * diagonal);
    let first = unit(add_scaled(scale(u, along[0]), v, along[1]));
    frame(first, cross(w, first))
}

/// Direction of a side of the smallest rectangle around points: one of its sides lies on an edge of their convex hull.
fn smallest_rectangle(points: &[Vec2], thickness: f64) -> Vec2 {
    let hull = hull(points);
    let (mut best, mut direction) = (f64::INFINITY, [1.0, 0.0]);
    for i in 0..hull.len() {
        let (p, q) = (hull[i], hull[(i + 1) % hull.len()]);
        let length = (q[0] - p[0]).hypot(q[1] - p[1]);
        if length <= 0.0 {
            continue;
        }
        let u = [(q[0] - p[0]) / length, (q[1] - p[1]) / length];
        let span = |x: f64, y: f64| {
            let ends = hull.iter().map(|h| h[0] * x + h[1] * y).fold([f64::INFINITY, f64::NEG_INFINITY], |s, a| [s[0].min(a), s[1].max(a)]);
            ends[1] - ends[0] + thickness
        };
        let area = span(u[0], u[1]) * span(-u[1], u[0]);
        if area < best {
            (best, direction) = (area, u);
        }
    }
    direction
}

/// Convex hull by monotone chains; rounding may drop points that hardly matter.
fn hull(points: &[Vec2]) -> Vec<Vec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    let mut hull: Vec<Vec2> = Vec::new();
    for half in 0..2 {
        let base = hull.len();
        for &p in &sorted {
            while hull.len() >= base + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        if half == 0 {
            sorted.reverse();
        }
        if hull.len() > 1 {
            hull.pop();
        }
    }
    hull
}

fn boxed(points: &[Vec3], axes: [Vec3; 3]) -> OrientedBox {
    let spans = spans(points, &axes);
    let centre = (0..3).fold([0.0; 3], |c, k| add_scaled(c, axes[k], 0.5 * (spans[k][0] + spans[k][1])));
    let mut order = [0, 1, 2];
    let side = |k: usize| spans[k][1] - spans[k][0];
    order.sort_by(|&a, &b| side(b).total_cmp(&side(a)));
    let (first, second) = (axes[order[0]], axes[order[1]]);
    OrientedBox { centre, axes: [first, second, cross(first, second)], sides: order.map(side) }
}

#[cfg(test)]
mod tests;
