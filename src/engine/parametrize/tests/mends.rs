//! Repair of flips: inside, at the boundary, several adjacent, and what it must never do.

use super::*;
use crate::parametrize::mend::{Mended, mend_flips};
use crate::parametrize::validity::{find_overlap, flipped_faces};

fn sheet(n: u32) -> (Patch, Vec<Vec2>) {
    let patch = grid(n, n, false, 0.4, |u, v| [u, v, 0.0]);
    let uv = patch.positions.iter().map(|p| [p[0], p[1]]).collect();
    (patch, uv)
}

fn mend(patch: &Patch, uv: &mut [Vec2]) -> Mended {
    mend_flips(patch, &[], uv, &Work::silent(&CancelToken::new())).unwrap()
}

/// Mends and checks what is promised of every repair.
fn mend_checked(patch: &Patch, uv: &mut [Vec2]) -> Mended {
    let (before, places) = (flipped_faces(&patch.triangles, uv), uv.to_vec());
    let mended = mend(patch, uv);
    let after = flipped_faces(&patch.triangles, uv);
    assert_eq!(mended.flipped, after);
    assert!(after.iter().all(|f| before.contains(f)), "a face was flipped by the repair");
    let moved: Vec<u32> = (0..uv.len()).filter(|&v| uv[v] != places[v]).map(|v| v as u32).collect();
    assert!(moved.iter().all(|v| mended.moved.contains(v)));
    mended
}

#[test]
fn single_flips_inside_are_mended_by_a_vertex_or_two() {
    let (patch, flat) = sheet(20);
    for v in (0..400u32).filter(|v| v % 7 == 3).map(|v| 21 * (1 + v % 19) + 1 + v % 17) {
        let mut uv = flat.clone();
        // Just across the edges of its ring: a few flips.
        uv[v as usize] = [uv[v as usize][0] + 0.08 * (noise(v) - 0.2), uv[v as usize][1] + 0.07];
        let flips = flipped_faces(&patch.triangles, &uv).len();
        let mended = mend_checked(&patch, &mut uv);
        assert!(mended.flipped.is_empty() && mended.moved.len() <= 2 && (flips == 0) == mended.moved.is_empty(), "{v}: {flips} {mended:?}");
    }
}

#[test]
fn flips_at_the_boundary_are_mended_along_the_projection_line() {
    let (patch, flat) = sheet(20);
    for k in 1..20u32 {
        let mut uv = flat.clone();
        // A boundary vertex pushed inside, across the opposite edge of one of its faces.
        uv[k as usize] = [uv[k as usize][0] + 0.01, 0.11];
        assert!(!flipped_faces(&patch.triangles, &uv).is_empty());
        let mended = mend_checked(&patch, &mut uv);
        assert!(mended.flipped.is_empty());
        assert_eq!(find_overlap(&patch.loops, &uv, &Work::silent(&CancelToken::new())).unwrap(), None);
    }
    // All but flat: the boundary vertex of a face lies a little inside the line of its neighbours.
    let strip = patch_of_strip();
    let mut uv: Vec<Vec2> = strip.positions.iter().map(|p| [p[0], p[1]]).collect();
    uv[1] = [1.0, 1.0 + 1e-3];
    assert_eq!(mend_checked(&strip, &mut uv), Mended { flipped: vec![], moved: vec![1] });
    assert!(uv[1][1] < 1.0 && (uv[1][0] - 1.0).abs() < 1e-12, "{:?}", uv[1]);
}

/// Three triangles; vertex 1 has one of its own, with base 0 - 2 above it.
fn patch_of_strip() -> Patch {
    let positions = vec![[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]];
    patch(positions, vec![[0, 1, 2], [0, 2, 3], [2, 4, 3]])
}

#[test]
fn adjacent_flips_are_mended_as_a_cavity() {
    let (patch, flat) = sheet(30);
    let mut mended_all = 0;
    for seed in 0..60u32 {
        let mut uv = flat.clone();
        // Several neighbours inside are thrown about within their neighbourhood.
        let (i, j) = (4 + (noise(seed) * 20.0) as u32, 4 + (noise(seed + 999) * 20.0) as u32);
        for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let v = (31 * (j + dj) + i + di) as usize;
            uv[v] = [0, 1].map(|c| uv[v][c] + 0.09 * (noise(17 * seed + 5 * v as u32 + c as u32) - 0.5));
        }
        let before = flipped_faces(&patch.triangles, &uv).len();
        let after = mend_checked(&patch, &mut uv);
        assert!(after.flipped.is_empty(), "seed {seed}: {before} flips, {:?}", after.flipped);
        mended_all += usize::from(before > 1);
    }
    assert!(mended_all > 40, "{mended_all} cases had flips");
}

#[test]
fn a_collapsed_ring_is_mended() {
    // A vertex and its neighbours all in one place: every face there is flat.
    let (patch, flat) = sheet(30);
    let mut uv = flat.clone();
    let centre = 31 * 15 + 15;
    for dv in [0i32, 1, -1, 31, -31] {
        uv[(centre + dv) as usize] = flat[centre as usize];
    }
    assert!(flipped_faces(&patch.triangles, &uv).len() > 4);
    assert!(mend_checked(&patch, &mut uv).flipped.is_empty());
}

#[test]
fn random_ruins_never_get_worse() {
    let (patch, flat) = sheet(12);
    for seed in 0..300u32 {
        let mut uv = flat.clone();
        for k in 0..1 + seed % 3 {
            let v = (noise(seed * 31 + k) * uv.len() as f64) as usize;
            uv[v] = [0, 1].map(|c| uv[v][c] + 0.5 * (noise(seed * 57 + 2 * k + c as u32) - 0.5));
        }
        mend_checked(&patch, &mut uv);
    }
}
