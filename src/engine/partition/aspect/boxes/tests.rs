use super::*;

/// Numbers in `[-1, 1)` that depend on the seed alone.
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn random_axes(seed: &mut u64) -> [Vec3; 3] {
    let mut vector = || [noise(seed), noise(seed), noise(seed)];
    frame(vector(), vector())
}

fn place(axes: &[Vec3; 3], p: Vec3) -> Vec3 {
    (0..3).fold([3.0, -7.0, 11.0], |sum, k| add_scaled(sum, axes[k], p[k]))
}

fn volume(b: &OrientedBox) -> f64 {
    b.sides.iter().product()
}

fn check(b: &OrientedBox, points: &[Vec3]) {
    for i in 0..3 {
        for j in 0..3 {
            assert!((dot(b.axes[i], b.axes[j]) - f64::from(u8::from(i == j))).abs() < 1e-9);
        }
        for &p in points {
            assert!(dot(sub(p, b.centre), b.axes[i]).abs() <= 0.5 * b.sides[i] + 1e-9 * b.sides[0], "a point is outside");
        }
    }
    assert!(b.sides[0] >= b.sides[1] && b.sides[1] >= b.sides[2]);
    assert!(dot(cross(b.axes[0], b.axes[1]), b.axes[2]) > 0.99);
}

#[test]
fn a_turned_box_is_found_exactly() {
    let mut seed = 5;
    for round in 0..40 {
        let axes = random_axes(&mut seed);
        let sides = [10.0, 10.0 * (1.05 + noise(&mut seed)), 3.0];
        let mut points: Vec<Vec3> = (0..8).map(|c| [0, 1, 2].map(|k| if c >> k & 1 == 0 { 0.5 } else { -0.5 } * sides[k])).collect();
        points.extend((0..300).map(|_| [0, 1, 2].map(|k| 0.5 * sides[k] * noise(&mut seed))));
        let points: Vec<Vec3> = points.into_iter().map(|p| place(&axes, p)).collect();
        let found = smallest_box(&points).unwrap();
        check(&found, &points);
        let exact: f64 = sides.iter().product();
        assert!((volume(&found) / exact - 1.0).abs() < 1e-6, "round {round}: {} of {exact}", volume(&found));
    }
}

#[test]
fn a_regular_tetrahedron_fits_a_cube() {
    let mut seed = 9;
    for _ in 0..20 {
        let axes = random_axes(&mut seed);
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let points: Vec<Vec3> = corners.iter().map(|&c| place(&axes, c)).collect();
        let found = smallest_box(&points).unwrap();
        check(&found, &points);
        assert!((volume(&found) - 8.0).abs() < 1e-6, "{}", volume(&found));
    }
}

#[test]
fn a_cylinder_is_boxed_within_a_percent() {
    let mut seed = 2;
    for (height, flat) in [(30.0, false), (0.2, false), (2.0, true)] {
        let axes = random_axes(&mut seed);
        let ring = (0..4000).map(|i| {
            let (sin, cos) = (0.01 * f64::from(i)).sin_cos();
            [cos, if flat { 0.0 } else { sin }, 0.5 * height * noise(&mut seed)]
        });
        let points: Vec<Vec3> = ring.collect::<Vec<_>>().into_iter().map(|p| place(&axes, p)).collect();
        let found = smallest_box(&points).unwrap();
        check(&found, &points);
        let mut sides = [2.0, if flat { 0.0 } else { 2.0 }, height];
        sides.sort_by(|a, b| b.total_cmp(a));
        assert!((0..3).all(|k| (found.sides[k] - sides[k]).abs() < 0.02 * sides[0]), "{:?} for {sides:?}", found.sides);
    }
}

#[test]
fn degenerate_points_have_a_box() {
    assert!(smallest_box(&[]).is_none());
    let point = smallest_box(&[[1.0, 2.0, 3.0]; 5]).unwrap();
    assert_eq!((point.sides, point.centre), ([0.0; 3], [1.0, 2.0, 3.0]));
    let line: Vec<Vec3> = (0..50).map(|i| scale([1.0, 2.0, -2.0], f64::from(i))).collect();
    let found = smallest_box(&line).unwrap();
    check(&found, &line);
    assert!((found.sides[0] - 147.0).abs() < 1e-9 && found.sides[1] < 1e-9);
}
