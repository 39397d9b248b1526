//! The tree against brute force.

use super::*;
use crate::vector::distance;

/// Deterministic numbers in `[0, 1)`.
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self) -> Vec3 {
        [self.next(), self.next(), self.next()]
    }
}

fn soup(count: usize, extent: f64, seed: u64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut random = Lcg(seed);
    let mut positions = Vec::new();
    for _ in 0..count {
        let at = random.point();
        for _ in 0..3 {
            positions.push(add_scaled(at, random.point(), extent));
        }
    }
    (positions, (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

#[test]
fn closest_agrees_with_brute_force() {
    for (count, extent) in [(1, 0.5), (3, 0.5), (5, 0.3), (17, 0.3), (300, 0.1), (300, 1e-9)] {
        let (positions, triangles) = soup(count, extent, 7 + count as u64);
        let tree = TriangleBvh::build(&positions, &triangles);
        let mut random = Lcg(99);
        for query in 0..100u32 {
            let p = random.point();
            let brute = triangles
                .iter()
                .map(|t| distance(p, closest_on_triangle(p, &t.map(|v| positions[v as usize])).0))
                .fold(f64::INFINITY, f64::min);
            let found = tree.closest(p).unwrap();
            assert!((found.distance_squared.sqrt() - brute).abs() < 1e-12);
            assert!((distance(p, found.position) - brute).abs() < 1e-12);
            let hinted = tree.closest_from(p, query % count as u32, 0.0).unwrap();
            assert_eq!(hinted.distance_squared, found.distance_squared);
            assert!(tree.closest_below(p, found.distance_squared, 0.0).is_none());
        }
    }
    assert!(TriangleBvh::build(&[], &[]).closest([0.0; 3]).is_none());
}

#[test]
fn closest_on_triangle_is_optimal_and_barycentric() {
    let mut random = Lcg(3);
    for case in 0..2000 {
        let squash = [1.0, 1e-3, 1e-8, 0.0][case % 4];
        let (a, b) = (random.point(), random.point());
        let along = random.next() * 1.4 - 0.2;
        let c = add_scaled(add_scaled(scale(a, 1.0 - along), b, along), random.point(), squash);
        let p = scale(sub(random.point(), [0.5; 3]), 3.0);
        let corners = [a, b, c];
        let (q, w) = closest_on_triangle(p, &corners);
        let sum = (0..3).fold([0.0; 3], |s, k| add_scaled(s, corners[k], w[k]));
        assert!(w.iter().all(|x| *x >= 0.0) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(distance(q, sum) < 1e-6, "{case}: {q:?} {sum:?}");
        for _ in 0..30 {
            let (r, s) = (random.next().sqrt(), random.next());
            let other = add_scaled(add_scaled(scale(a, 1.0 - r), b, r * (1.0 - s)), c, r * s);
            assert!(distance(p, q) <= distance(p, other) + 1e-9);
        }
    }
}

#[test]
fn box_queries_agree_with_brute_force() {
    let (positions, triangles) = soup(200, 0.15, 5);
    let tree = TriangleBvh::build(&positions, &triangles);
    let boxes: Vec<_> = triangles.iter().map(|t| triangle_box(&t.map(|v| positions[v as usize]))).collect();
    let mut pairs = Vec::new();
    tree.overlapping_pairs(|a, b| {
        pairs.push((a.min(b), a.max(b)));
        Ok::<(), ()>(())
    })
    .unwrap();
    pairs.sort_unstable();
    let brute: Vec<_> = (0..200u32)
        .flat_map(|i| (i + 1..200).map(move |j| (i, j)))
        .filter(|&(i, j)| overlap(boxes[i as usize], boxes[j as usize]))
        .collect();
    assert_eq!(pairs, brute);
    let (low, high) = ([0.3; 3], [0.5; 3]);
    let mut inside = Vec::new();
    tree.faces_in_box(low, high, |f| inside.push(f));
    inside.sort_unstable();
    assert_eq!(inside, (0..200u32).filter(|&f| overlap(boxes[f as usize], (low, high))).collect::<Vec<_>>());
}
