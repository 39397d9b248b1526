//! Spacing recomputed from the points alone, convexity with exact signs, refusals.

use super::*;
use crate::error::Reason;
use crate::parametrize::spec::Spacing;
use crate::parametrize::validity::orientation;
use crate::vector::distance;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A deterministic number in [0, 1).
fn noise(seed: u32) -> f64 {
    let x = (seed ^ 0x9E37_79B9).wrapping_mul(0x85EB_CA6B);
    let x = (x ^ (x >> 13)).wrapping_mul(0xC2B2_AE35);
    f64::from((x ^ (x >> 16)) >> 4) / f64::from(1u32 << 28)
}

/// A wavy loop in space with very different edges; `ring` is not the identity.
fn wavy(m: usize, seed: u32) -> (Vec<u32>, Vec<Vec3>) {
    let mut angles: Vec<f64> = (0..m as u32).map(|k| TAU * noise(seed * 7919 + k)).collect();
    angles.sort_by(f64::total_cmp);
    let at = |t: f64| [3.0 + 2.0 * t.cos(), t.sin() + 0.2 * (3.0 * t).sin(), 0.5 * (2.0 * t).sin() + noise(seed)];
    let mut positions = vec![[0.0; 3]; m + 1];
    let ring: Vec<u32> = (0..m).map(|k| ((k * 2 + 1) % (m | 1)) as u32).collect();
    ring.iter().zip(angles).for_each(|(&v, t)| positions[v as usize] = at(t));
    (ring, positions)
}

fn lengths(ring: &[u32], positions: &[Vec3]) -> Vec<f64> {
    let at = |k: usize| positions[ring[k % ring.len()] as usize];
    (0..ring.len()).map(|k| distance(at(k), at(k + 1))).collect()
}

fn image(ring: &[u32], positions: &[Vec3], shape: BoundaryShape, spacing: Spacing, start: Option<u32>) -> Vec<Vec2> {
    place_outer(ring, positions, &Boundary { shape, spacing, start }).unwrap()
}

fn chords(points: &[Vec2]) -> Vec<f64> {
    let m = points.len();
    (0..m).map(|k| (points[(k + 1) % m][0] - points[k][0]).hypot(points[(k + 1) % m][1] - points[k][1])).collect()
}

/// Largest relative deviation of `a` from a multiple of `b`.
fn disproportion(a: &[f64], b: &[f64]) -> f64 {
    let scale = a.iter().sum::<f64>() / b.iter().sum::<f64>();
    a.iter().zip(b).map(|(x, y)| (x / (scale * y) - 1.0).abs()).fold(0.0, f64::max)
}

/// Strictly convex and once around: left turns everywhere that add up to one turn.
fn assert_strictly_convex(points: &[Vec2]) {
    let m = points.len();
    let at = |k: usize| points[k % m];
    assert!((0..m).all(|k| orientation(at(k), at(k + 1), at(k + 2)) > 0.0));
    let direction = |k: usize| (at(k + 1)[1] - at(k)[1]).atan2(at(k + 1)[0] - at(k)[0]);
    let turn: f64 = (0..m).map(|k| (direction(k + 1) - direction(k)).rem_euclid(TAU)).sum();
    assert!((turn - TAU).abs() < 1e-6, "{turn}");
}

#[test]
fn a_circle_has_arcs_or_chords_in_proportion() {
    for (m, seed) in [(3, 1), (4, 2), (17, 3), (600, 4), (20_000, 5)] {
        let (ring, positions) = wavy(m, seed);
        let wanted = bounded(lengths(&ring, &positions));
        for spacing in [Spacing::ArcLength, Spacing::Chord] {
            let start = ring[m / 2];
            let points = image(&ring, &positions, BoundaryShape::Circle, spacing, Some(start));
            assert!(distance([points[m / 2][0], points[m / 2][1], 0.0], [1.0, 0.0, 0.0]) < 1e-15);
            assert!(points.iter().all(|p| (p[0].hypot(p[1]) - 1.0).abs() < 1e-15));
            assert_strictly_convex(&points);
            let sides: Vec<f64> = match spacing {
                Spacing::Chord => chords(&points),
                Spacing::ArcLength => chords(&points).iter().map(|c| 2.0 * (0.5 * c).asin()).collect(),
            };
            // Random loops have edges of 1e-8: those are held apart, and the rest then shares what is left.
            let tolerance = if m < 1000 { 1e-7 } else { 1.1 };
            assert!(disproportion(&sides, &wanted) < tolerance, "{m} {spacing:?} {}", disproportion(&sides, &wanted));
        }
    }
}

/// A closed loop in a plane whose edges have the given lengths: inscribed in no circle on purpose (a star of three directions).
fn loop_of(lengths: &[f64]) -> (Vec<u32>, Vec<Vec3>) {
    // Edges as steps on a line out and back would do for the lengths alone; the positions only matter through distances.
    let m = lengths.len();
    let longest = (0..m).fold(0, |b, k| if lengths[k] > lengths[b] { k } else { b });
    // An isosceles arc: bisect the angle for which the chain of equal turns spans the longest edge.
    let span = |turn: f64| {
        let (mut p, mut angle) = ([0.0f64; 2], 0.0f64);
        for k in 1..m {
            let l = lengths[(longest + k) % m];
            p = [p[0] + l * angle.cos(), p[1] + l * angle.sin()];
            angle += turn;
        }
        p[0].hypot(p[1])
    };
    let (mut low, mut high) = (0.0, TAU / m as f64);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if span(middle) > lengths[longest] { low = middle } else { high = middle }
    }
    let mut positions = vec![[0.0; 3]; m];
    let (mut p, mut angle) = ([0.0f64; 3], 0.0f64);
    for k in 1..m {
        let at = (longest + k) % m;
        positions[at] = p;
        p = [p[0] + lengths[at] * angle.cos(), p[1] + lengths[at] * angle.sin(), 0.0];
        angle += low;
    }
    positions[longest] = p;
    ((0..m as u32).collect(), positions)
}

#[test]
fn chords_close_on_either_side_of_the_centre() {
    // Closed forms: equilateral, right triangle (longest side a diameter), thin obtuse triangle, square, a long side and nine short ones.
    let cases: [&[f64]; 6] = [
        &[1.0, 1.0, 1.0],
        &[3.0, 4.0, 5.0],
        &[1.0, 1.0, 1.999],
        &[1.0; 4],
        &[8.9, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        &[2.0, 1.0, 1.5],
    ];
    for case in cases {
        let (ring, positions) = loop_of(case);
        let points = image(&ring, &positions, BoundaryShape::Circle, Spacing::Chord, None);
        assert!(disproportion(&chords(&points), case) < 1e-9, "{case:?}: {:?}", chords(&points));
        assert_strictly_convex(&points);
    }
    let right = loop_of(cases[1]);
    let sides = chords(&image(&right.0, &right.1, BoundaryShape::Circle, Spacing::Chord, None));
    assert!((sides[2] - 2.0).abs() < 1e-7 && (sides[0] - 1.2).abs() < 1e-7);
}

#[test]
fn an_edge_as_long_as_all_others_together_is_refused_with_chords_and_not_with_arcs() {
    let positions: Vec<Vec3> = [0.0, 1.0, 2.0, 3.0].iter().map(|&x| [x, 0.0, 0.0]).collect();
    let ring = [0, 1, 2, 3];
    for shape in [BoundaryShape::Circle, BoundaryShape::Ellipse { ratio: 2.0 }] {
        let refused = place_outer(&ring, &positions, &Boundary { shape: shape.clone(), spacing: Spacing::Chord, start: None });
        let error = refused.unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
        assert_eq!(error.locations()[0].ids, [3, 0]);
        assert_strictly_convex(&image(&ring, &positions, shape, Spacing::ArcLength, None));
    }
}

/// Perimeter of an ellipse by the arithmetic-geometric mean.
fn perimeter(a: f64, b: f64) -> f64 {
    let (mut x, mut y, mut sum, mut power) = (a, b, a * a - b * b, 0.5);
    sum *= power;
    for _ in 0..40 {
        let c = 0.5 * (x - y);
        (x, y) = (0.5 * (x + y), (x * y).sqrt());
        power *= 2.0;
        sum += power * c * c;
    }
    TAU * (a * a - sum) / x
}

#[test]
fn arcs_of_an_ellipse_are_exact_to_twelve_digits() {
    for ratio in [1e-3f64, 0.02, 0.5, 0.999, 1.001, 3.0, 40.0, 1e3] {
        let (a, b) = (ratio.sqrt(), 1.0 / ratio.sqrt());
        // Points at arcs k / 40 of the perimeter; the arc between two of them by 20000 Gauss points of two each.
        let (ring, positions) = ring_of_equal_edges(40);
        let points = image(&ring, &positions, BoundaryShape::Ellipse { ratio }, Spacing::ArcLength, None);
        let parameters: Vec<f64> = points.iter().map(|p| (p[1] / b).atan2(p[0] / a).rem_euclid(TAU)).collect();
        let speed = |t: f64| (a * t.sin()).hypot(b * t.cos());
        let unit = perimeter(a.max(b), a.min(b)) / 40.0;
        for k in 0..40 {
            let (from, to) = (parameters[k], if k == 39 { TAU } else { parameters[k + 1] });
            let n = 4000;
            let h = (to - from) / f64::from(n);
            let d = 0.5 * h / 3.0f64.sqrt();
            let sum: f64 = (0..n).map(|i| from + h * (f64::from(i) + 0.5)).map(|t| 0.5 * h * (speed(t - d) + speed(t + d))).sum();
            // Near the flat ends the parameter is recovered from the points with an error of 1e-16 over the angle.
            assert!((sum / unit - 1.0).abs() < 2e-11, "ratio {ratio} arc {k}: {:e}", sum / unit - 1.0);
        }
        assert!(distance([points[10][0], points[10][1], 0.0], [0.0, b, 0.0]) < 1e-13 * a.max(b));
        assert_strictly_convex(&points);
    }
}

#[test]
fn the_inverse_of_the_arc_length_is_exact_to_twelve_digits() {
    for ratio in [1.0f64, 1.5, 30.0, 1e3] {
        let (worst_total, worst) = round::inverse_errors(ratio.sqrt(), 1.0 / ratio.sqrt());
        let total = worst_total / perimeter(ratio.sqrt(), 1.0 / ratio.sqrt()) - 1.0;
        assert!(total.abs() < 1e-14 && worst < 1e-13, "{ratio}: {total:e} {worst:e}");
    }
}

fn ring_of_equal_edges(m: u32) -> (Vec<u32>, Vec<Vec3>) {
    let at = |k: u32| TAU * f64::from(k) / f64::from(m);
    ((0..m).collect(), (0..m).map(|k| [at(k).cos(), at(k).sin(), 0.0]).collect())
}

#[test]
fn an_ellipse_has_arcs_or_chords_in_proportion() {
    for (ratio, m) in [(0.2, 300), (1.5, 50), (4.0, 600), (100.0, 2000), (0.01, 2000)] {
        let (ring, positions) = ring_of_equal_edges(m);
        let points = image(&ring, &positions, BoundaryShape::Ellipse { ratio }, Spacing::Chord, Some(7));
        assert!(disproportion(&chords(&points), &vec![1.0; m as usize]) < 1e-9, "{ratio}");
        assert!((points[7][0] - ratio.sqrt()).abs() < 1e-12 && points[7][1].abs() < 1e-12);
        assert_strictly_convex(&points);
    }
    let (ring, positions) = wavy(400, 11);
    let wanted = bounded(lengths(&ring, &positions));
    let points = image(&ring, &positions, BoundaryShape::Ellipse { ratio: 2.0 }, Spacing::Chord, None);
    assert!(disproportion(&chords(&points), &wanted) < 1e-7);
    let round = image(&ring, &positions, BoundaryShape::Ellipse { ratio: 1.0 }, Spacing::Chord, None);
    assert_eq!(round, image(&ring, &positions, BoundaryShape::Circle, Spacing::Chord, None));
}

#[test]
fn vertices_on_the_same_spot_are_held_apart_at_any_scale() {
    for size in [1.0, 1e-170, 1e150] {
        let (ring, mut positions) = ring_of_equal_edges(50);
        for k in 10..30 {
            positions[k] = positions[10];
        }
        positions.iter_mut().flatten().for_each(|x| *x *= size);
        let square = BoundaryShape::Rectangle { ratio: None, corners: None };
        for shape in [BoundaryShape::Circle, BoundaryShape::Ellipse { ratio: 900.0 }, BoundaryShape::Ellipse { ratio: 0.3 }, square] {
            for spacing in [Spacing::ArcLength, Spacing::Chord] {
                let placed = place_outer(&ring, &positions, &Boundary { shape: shape.clone(), spacing, start: None });
                if spacing == Spacing::Chord && shape == (BoundaryShape::Ellipse { ratio: 900.0 }) {
                    // Two fifths of the loop in one edge do not reach around the end of a needle.
                    assert_eq!(placed.unwrap_err().reason(), Reason::BadParameter);
                    continue;
                }
                let points = placed.unwrap();
                assert!(chords(&points).iter().all(|&c| c > 0.0), "{shape:?} {spacing:?} {size}");
                if !matches!(shape, BoundaryShape::Rectangle { .. }) {
                    assert_strictly_convex(&points);
                }
            }
        }
    }
    let all_in_one_place = [[1.0, 2.0, 3.0]; 5];
    assert_strictly_convex(&image(&[0, 1, 2, 3, 4], &all_in_one_place, BoundaryShape::Circle, Spacing::ArcLength, None));
}

#[test]
fn a_rectangle_takes_its_ratio_and_corners_from_the_loop() {
    // The border of a 6 x 2 rectangle in unit edges, from the middle of the first side.
    let border: Vec<Vec3> = (0..16)
        .map(|k| (k + 3) % 16)
        .map(f64::from)
        .map(|s| match s {
            s if s < 6.0 => [s, 0.0, 0.0],
            s if s < 8.0 => [6.0, s - 6.0, 0.0],
            s if s < 14.0 => [14.0 - s, 2.0, 0.0],
            s => [0.0, 16.0 - s, 0.0],
        })
        .collect();
    let ring: Vec<u32> = (0..16).collect();
    let shape = BoundaryShape::Rectangle { ratio: None, corners: Some([13, 3, 5, 11]) };
    for spacing in [Spacing::ArcLength, Spacing::Chord] {
        let points = image(&ring, &border, shape.clone(), spacing, None);
        // The image is the border itself, centred and scaled to sides sqrt(3) and 1 / sqrt(3) (doubled).
        let unit = 2.0 * 3.0f64.sqrt() / 6.0;
        for (p, q) in points.iter().zip(&border) {
            assert!((p[0] - unit * (q[0] - 3.0)).abs() < 1e-14 && (p[1] - unit * (q[1] - 1.0)).abs() < 1e-14);
        }
    }
    // Quarters of the length from the start: every fourth vertex.
    let points = image(&ring, &border, BoundaryShape::Rectangle { ratio: Some(4.0), corners: None }, Spacing::ArcLength, Some(2));
    for (k, corner) in [[-2.0, -0.5], [2.0, -0.5], [2.0, 0.5], [-2.0, 0.5]].into_iter().enumerate() {
        assert_eq!(points[(2 + 4 * k) % 16], corner);
    }
}

#[test]
fn polygon_corners_are_distinct_even_if_one_edge_is_nearly_all() {
    let hexagon: Vec<Vec2> = (0..6).map(|k| f64::from(k) * PI / 3.0).map(|t| [5.0 + 1e9 * t.cos(), 1e9 * t.sin()]).collect();
    for m in [6usize, 7, 40] {
        let mut positions: Vec<Vec3> = (0..m).map(|k| [1e-3 * k as f64, 1e-6 * (k * k) as f64, 0.0]).collect();
        positions[m - 1] = [100.0, 0.0, 0.0];
        let ring: Vec<u32> = (0..m as u32).collect();
        let shape = BoundaryShape::Polygon { points: hexagon.clone(), corners: None };
        let points = image(&ring, &positions, shape, Spacing::ArcLength, Some(1));
        // The six corners lie on the unit circle (the hexagon is scaled to order 1), the rest inside.
        assert_eq!(points.iter().filter(|p| (p[0].hypot(p[1]) / points[1][0].hypot(points[1][1]) - 1.0).abs() < 1e-7).count(), 6);
        assert!(chords(&points).iter().all(|&c| c > 0.0));
        assert!((0..m).all(|k| orientation(points[k], points[(k + 1) % m], points[(k + 2) % m]) > -1e-15));
    }
}

#[test]
fn the_mean_plane_keeps_shape_and_orientation() {
    for seed in 0..20 {
        // An L in a random pose, run counter-clockwise or clockwise as seen from its axes.
        let corner = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let axis = |k: u32| crate::vector::unit([0, 1, 2].map(|c| noise(seed * 100 + 10 * k + c) - 0.5));
        let first = axis(0);
        let second = crate::vector::unit(crate::vector::cross(first, axis(1)));
        let mut positions: Vec<Vec3> = corner.iter().map(|c| [0, 1, 2].map(|k| 50.0 + c[0] * first[k] + c[1] * second[k])).collect();
        if seed % 2 == 1 {
            positions.reverse();
        }
        let points = image(&[0, 1, 2, 3, 4, 5], &positions, BoundaryShape::MeanPlane, Spacing::ArcLength, None);
        let ratio = disproportion(&chords(&points), &lengths(&[0, 1, 2, 3, 4, 5], &positions));
        assert!(ratio < 1e-12, "{ratio}");
        let area: f64 = (0..6).map(|k| points[k][0] * points[(k + 1) % 6][1] - points[k][1] * points[(k + 1) % 6][0]).sum();
        assert!(area > 0.0);
    }
    let straight: Vec<Vec3> = (0..5).map(|k| [f64::from(k), 2.0 * f64::from(k), 1.0]).collect();
    let refused = place_outer(&[0, 1, 2, 3, 4], &straight, &Boundary { shape: BoundaryShape::MeanPlane, ..Boundary::default() });
    assert_eq!(refused.unwrap_err().reason(), Reason::BadParameter);
}

#[test]
fn vertices_that_are_not_where_they_should_be_are_named() {
    let (ring, positions) = ring_of_equal_edges(8);
    let ring = &ring[..7];
    let square: Vec<Vec2> = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let polygon = |corners: &[u32]| BoundaryShape::Polygon { points: square.clone(), corners: Some(corners.to_vec()) };
    let rectangle = |corners| BoundaryShape::Rectangle { ratio: None, corners: Some(corners) };
    let cases: [(BoundaryShape, Option<u32>, &[u32]); 7] = [
        (BoundaryShape::Circle, Some(7), &[7]),
        (BoundaryShape::Circle, Some(99), &[]),
        (rectangle([0, 2, 4, 7]), None, &[7]),
        (rectangle([0, 4, 2, 6]), None, &[4, 2]),
        (rectangle([5, 6, 0, 6]), None, &[0, 6]),
        (polygon(&[0, 0, 2, 3]), None, &[0, 0]),
        (polygon(&[3, 2, 1, 0]), None, &[2, 1]),
    ];
    for (shape, start, ids) in cases {
        let error = place_outer(ring, &positions, &Boundary { shape, spacing: Spacing::ArcLength, start }).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
        let found: Vec<u32> = error.locations().iter().map(|l| l.ids[0]).collect();
        assert_eq!(found, ids, "{error}");
    }
    let triangle = place_outer(
        &ring[..3],
        &positions,
        &Boundary { shape: BoundaryShape::Rectangle { ratio: None, corners: None }, ..Boundary::default() },
    );
    assert_eq!(triangle.unwrap_err().reason(), Reason::BadParameter);
    assert!(place_outer(ring, &positions, &Boundary { shape: rectangle([5, 6, 0, 2]), ..Boundary::default() }).is_ok());
    let quarter = image(ring, &positions, BoundaryShape::Circle, Spacing::ArcLength, Some(2))[2];
    assert!(quarter[1].atan2(quarter[0]).abs() < FRAC_PI_2 * 1e-15);
}
