//! Pins of patches with a known long axis, and of degenerate ones.

use super::*;
use std::f64::consts::TAU;

/// A fan around vertex 0 whose ring is an ellipse with axes `a`, `b` along given directions.
fn fan(a: f64, b: f64, n: u32) -> (Vec<u32>, Vec<Vec3>, Vec<[u32; 3]>) {
    let at = |k: u32| TAU * f64::from(k) / f64::from(n);
    let (u, v) = ([0.6, 0.8, 0.0], [0.0, 0.0, 1.0]);
    let centre = [5.0, 5.0, 5.0];
    let mut positions = vec![centre];
    positions.extend((0..n).map(|k| add_scaled(add_scaled(centre, u, a * at(k).cos()), v, b * at(k).sin())));
    ((1..=n).collect(), positions, (0..n).map(|k| [0, 1 + k, 1 + (k + 1) % n]).collect())
}

#[test]
fn an_elongated_patch_is_pinned_at_its_ends() {
    for (a, b, ends) in [(3.0, 1.0, [1, 21]), (1.0, 2.5, [11, 31])] {
        let (ring, positions, triangles) = fan(a, b, 40);
        let sorted = |(p, q): (u32, u32)| [p.min(q), p.max(q)];
        assert_eq!(sorted(inertia(&ring, &positions, &triangles)), ends);
        assert_eq!(sorted(farthest(&ring, &positions)), ends);
        assert_eq!(half_way(&ring, &positions, ends[0]), ends[1]);
        assert_eq!(half_way(&ring, &positions, ends[1]), ends[0]);
    }
}

#[test]
fn a_thin_spike_moves_the_farthest_pins_and_not_those_of_the_inertia() {
    // A long thin needle at one side of a wide rectangle: no mass, so the axis stays that of the rectangle.
    let positions =
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0], [2.01, 1.0, 0.0], [2.0, 9.0, 0.0], [1.99, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = [[0, 1, 3], [1, 2, 3], [3, 4, 5], [0, 3, 5], [0, 5, 6]];
    let ring: Vec<u32> = (0..7).collect();
    let (p, q) = farthest(&ring, &positions);
    assert!(p == 4 || q == 4);
    let (p, q) = inertia(&ring, &positions, &triangles);
    assert!(p != 4 && q != 4 && (positions[p as usize][0] - positions[q as usize][0]).abs() == 4.0);
}

#[test]
fn pins_are_distinct_on_anything() {
    let triangles = [[0, 1, 2]];
    let line = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let spot = vec![[1.0; 3]; 3];
    let regular = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let twins = vec![[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]];
    for positions in [line, spot, regular, twins] {
        let ring = [0, 1, 2];
        for (p, q) in [farthest(&ring, &positions), inertia(&ring, &positions, &triangles)] {
            assert!(p != q && p < 3 && q < 3);
        }
        assert!(ring.iter().all(|&v| half_way(&ring, &positions, v) != v));
    }
}
