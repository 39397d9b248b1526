//! The verdict "no flips and no overlaps" against injectivity itself: all pairs of triangles, by another method.

use super::*;
use crate::parametrize::validity::{Overlap, find_overlap, flipped_faces, orientation};
use crate::work::CancelToken;

/// Whether the insides of two counter-clockwise triangles meet: exactly, as no side of either separates them.
fn insides_meet(s: [Vec2; 3], t: [Vec2; 3]) -> bool {
    let separates = |a: [Vec2; 3], b: [Vec2; 3]| (0..3).any(|k| b.iter().all(|&p| orientation(a[k], a[(k + 1) % 3], p) <= 0.0));
    !separates(s, t) && !separates(t, s)
}

/// One-to-one on the closed surface: all triangles counter-clockwise, no two insides meet, and no vertex lies on a triangle it is not
/// a corner of. (Two triangles with disjoint insides that touch, do so in a vertex of one on the other.)
fn injective(patch: &Patch, uv: &[Vec2]) -> bool {
    let corners = |t: &[u32; 3]| t.map(|v| uv[v as usize]);
    let all: Vec<[Vec2; 3]> = patch.triangles.iter().map(corners).collect();
    if all.iter().any(|t| orientation(t[0], t[1], t[2]) <= 0.0) {
        return false;
    }
    let pairs = (0..all.len()).any(|i| (i + 1..all.len()).any(|j| insides_meet(all[i], all[j])));
    let on = |p: Vec2, t: &[Vec2; 3]| (0..3).all(|k| orientation(t[k], t[(k + 1) % 3], p) >= 0.0);
    let touch = |v: u32| patch.triangles.iter().zip(&all).any(|(t, c)| !t.contains(&v) && on(uv[v as usize], c));
    !pairs && !(0..uv.len() as u32).any(touch)
}

fn verdict(patch: &Patch, uv: &[Vec2]) -> (bool, Option<Overlap>) {
    let overlap = find_overlap(&patch.loops, uv, &Work::silent(&CancelToken::new())).unwrap();
    (flipped_faces(&patch.triangles, uv).is_empty() && overlap.is_none(), overlap)
}

/// Both verdicts agree; counts of (one-to-one, overlapping without a flip).
fn compare(patch: &Patch, uv: &[Vec2], label: &str) -> [usize; 2] {
    let (ours, overlap) = verdict(patch, uv);
    assert_eq!(ours, injective(patch, uv), "{label}: {overlap:?}");
    if let Some(Overlap::Edges([[a, b], [c, d]])) = overlap {
        let [p, q, r, s] = [a, b, c, d].map(|v| uv[v as usize]);
        let sides = [orientation(p, q, r) * orientation(p, q, s), orientation(r, s, p) * orientation(r, s, q)];
        assert!(sides[0] <= 0.0 && sides[1] <= 0.0, "{label}: the edges told of do not meet");
        let ring = patch.loops.iter().find(|ring| ring.contains(&a)).unwrap();
        let at = ring.iter().position(|&v| v == a).unwrap();
        assert_eq!(ring[(at + 1) % ring.len()], b);
    }
    [usize::from(ours), usize::from(!ours && flipped_faces(&patch.triangles, uv).is_empty())]
}

fn sum(counts: impl Iterator<Item = [usize; 2]>) -> [usize; 2] {
    counts.fold([0; 2], |s, c| [s[0] + c[0], s[1] + c[1]])
}

#[test]
fn bent_strips_overlap_exactly_when_their_triangles_do() {
    // Strips along random curves: orientation is kept as long as the curvature allows, ends meet or not.
    let counts = sum((0..400u32).map(|seed| {
        let patch = grid(26, 2, false, 0.3, |u, v| [u, v, 0.0]);
        let (bend, wave, width) = (12.0 * noise(seed) - 2.0, 1.2 * noise(seed + 1000), 0.02 + 0.1 * noise(seed + 2000));
        let at = |u: f64, v: f64| {
            // Points on a curve of turning angle bend u + wave sin, the strip on its left.
            let steps = 60;
            let angle = |t: f64| bend * t + wave * (7.0 * t).sin();
            let sum = (0..steps)
                .map(|k| u * (f64::from(k) + 0.5) / f64::from(steps))
                .fold([0.0; 2], |p, t| [p[0] + u / f64::from(steps) * angle(t).cos(), p[1] + u / f64::from(steps) * angle(t).sin()]);
            [sum[0] - width * v * angle(u).sin(), sum[1] + width * v * angle(u).cos()]
        };
        let uv: Vec<Vec2> = patch.positions.iter().map(|p| at(p[0], p[1])).collect();
        compare(&patch, &uv, &format!("strip {seed}"))
    }));
    assert!(counts[0] > 50 && counts[1] > 20, "{counts:?}");
}

#[test]
fn folded_and_shaken_sheets_are_judged_rightly() {
    let counts = sum((0..300u32).map(|seed| {
        let patch = grid(7, 5, false, 0.5, |u, v| [u, v, 0.0]);
        let (fold, shake) = (0.4 + noise(seed), 0.25 * noise(seed + 50) * noise(seed + 60));
        let uv: Vec<Vec2> = patch
            .positions
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let x = fold - (fold - p[0]).abs();
                [0, 1].map(|c| [x, p[1]][c] + shake * (noise(seed * 977 + 2 * k as u32 + c as u32) - 0.5))
            })
            .collect();
        compare(&patch, &uv, &format!("sheet {seed}"))
    }));
    assert!(counts[0] > 50, "{counts:?}");
}

#[test]
fn powers_of_an_annulus_are_judged_rightly() {
    // z^p of a ring, cut open or closed: closed with p = 2 no two boundary edges need to meet.
    let counts = sum((0..120u32).map(|seed| {
        let wrapped = seed % 2 == 0;
        let power = if wrapped { f64::from(1 + seed % 3) } else { 0.5 + 1.2 * noise(seed) };
        let patch = grid(30, 3, wrapped, 0.3, |u, v| [u, v, 0.0]);
        let shift = 0.3 * noise(seed + 7);
        let uv: Vec<Vec2> = (0..patch.positions.len())
            .map(|k| {
                let [u, v, _] = patch.positions[k];
                let (angle, r) = (-TAU * u * power, 0.7 + v);
                [r * angle.cos() + shift * v, r * angle.sin()]
            })
            .collect();
        compare(&patch, &uv, &format!("annulus {seed}"))
    }));
    assert!(counts[0] > 20 && counts[1] > 20, "{counts:?}");
}

#[test]
fn touching_boundaries_count_as_overlaps() {
    // A bent strip of unit squares whose last corner comes to lie on the first ones, on an edge, or beside it: all numbers exact.
    let patch = grid(4, 1, false, 0.0, |u, v| [u, v, 0.0]);
    let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [1.0, 3.0], [1.0, 2.0]];
    let inner = [[0.0, -1.0], [5.0, -1.0], [5.0, 4.0], [0.0, 4.0]];
    for (end, wanted) in [([0.5, 0.5], true), ([0.5, 0.0], false), ([0.0, 0.0], false), ([0.5, -0.25], false), ([0.25, 0.125], true)] {
        let mut uv: Vec<Vec2> = square.iter().chain(&inner).copied().chain([end]).collect();
        // Vertices 0..5 run along the left side of the strip.
        uv.rotate_left(5);
        let agreed = compare(&patch, &uv, &format!("{end:?}"));
        assert_eq!(agreed[0] == 1, wanted, "{end:?}");
    }
}
