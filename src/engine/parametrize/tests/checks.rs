//! The checks: folds, crossings, multiple coverings, crowding; and what is done about them.

use super::*;
use crate::parametrize::mend::mend_flips;
use crate::parametrize::validity::flipped_faces;

fn overlaps(loops: &[Vec<u32>], uv: &[Vec2]) -> bool {
    let cancel = CancelToken::new();
    find_overlap(loops, uv, &Work::silent(&cancel)).unwrap().is_some()
}

fn polygon(points: &[Vec2]) -> (Vec<Vec<u32>>, Vec<Vec2>) {
    (vec![(0..points.len() as u32).collect()], points.to_vec())
}

#[test]
fn crossings_touches_and_folds_of_the_boundary_are_found() {
    let cases: [(&[Vec2], bool); 7] = [
        (&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], false),
        (&[[0.0, 0.0], [1.0, 0.0], [0.4, 0.5], [1.0, 1.0], [0.0, 1.0]], false),
        // A corner reaches the opposite side exactly, then crosses it.
        (&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.5], [1.0, 1.0], [0.0, 1.0]], true),
        (&[[0.0, 0.0], [1.0, 0.0], [-0.1, 0.5], [1.0, 1.0], [0.0, 1.0]], true),
        // An edge runs back on the one before.
        (&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], true),
        // Straight corners are fine; a clockwise loop is not.
        (&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], false),
        (&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], true),
    ];
    for (points, wanted) in cases {
        let (loops, uv) = polygon(points);
        assert_eq!(overlaps(&loops, &uv), wanted, "{points:?}");
    }
}

#[test]
fn the_tree_of_boxes_agrees_with_all_pairs() {
    for seed in 0..200u32 {
        let n = 5 + seed % 23;
        let radius = |k: u32| 1.0 - 0.9 * noise(seed * 100 + k) * f64::from(seed % 3);
        let points: Vec<Vec2> = (0..n)
            .map(|k| {
                let angle = TAU * (f64::from(k) + 1.2 * noise(seed * 977 + k)) / f64::from(n);
                [radius(k) * angle.cos(), radius(k) * angle.sin()]
            })
            .collect();
        let (loops, uv) = polygon(&points);
        let at = |k: u32| points[(k % n) as usize];
        let area: f64 = (0..n).map(|k| at(k)[0] * at(k + 1)[1] - at(k)[1] * at(k + 1)[0]).sum();
        let cross = |i: u32, j: u32| {
            let side = |a: Vec2, b: Vec2, c: Vec2| validity::orientation(a, b, c) > 0.0;
            let (a, b, c, d) = (at(i), at(i + 1), at(j), at(j + 1));
            side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
        };
        let any = (0..n).any(|i| (i + 2..n).any(|j| (j + 1) % n != i && cross(i, j)));
        assert_eq!(overlaps(&loops, &uv), any || area <= 0.0, "seed {seed}");
    }
}

#[test]
fn a_double_covering_is_an_overlap_though_no_face_and_no_edge_is_wrong() {
    // An annulus whose both loops run counter-clockwise in the plane, apart from one another.
    let loops = vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]];
    let square = |r: f64| [[-r, -r], [r, -r], [r, r], [-r, r]];
    let uv: Vec<Vec2> = square(2.0).into_iter().chain(square(1.0)).collect();
    assert!(overlaps(&loops, &uv));
    assert!(!overlaps(&[loops[0].clone(), vec![7, 6, 5, 4]], &uv));
}

/// A strip around an axis through `turns` turns that climbs `rise` per turn.
fn ramp(turns: f64, rise: f64) -> Patch {
    grid((40.0 * turns) as u32, 3, false, 0.2, |u, v| {
        let (angle, r) = (TAU * turns * u, 1.0 + 0.3 * v);
        [r * angle.cos(), -r * angle.sin(), rise * turns * u]
    })
}

#[test]
fn a_ramp_of_more_than_one_turn_overlaps_and_falls_back() {
    let long = ramp(1.6, 0.05);
    let error = outcome(&long, ChartSpec::only(ChartMethod::SpectralConformal)).unwrap_err();
    assert_eq!(error.reason(), Reason::ChartFailed);
    let automatic = match outcome(&long, ChartSpec::default()).unwrap() {
        ChartOutcome::Mapped(chart) => {
            assert_promises(&long, &chart);
            chart.attempts
        }
        ChartOutcome::MustSplit { attempts, .. } => attempts,
        ChartOutcome::Refused(error) => panic!("{error}"),
    };
    assert!(automatic[0].method == ChartMethod::SpectralConformal && automatic[0].overlaps && automatic[0].flipped == 0);
    // The order is that of P1 figure 23.
    assert!(automatic.windows(2).all(|w| w[0].method <= w[1].method));
    let short = ramp(0.8, 0.05);
    assert_promises(&short, &chart(&short, ChartSpec::only(ChartMethod::SpectralConformal)));
}

#[test]
fn a_deep_notch_is_held_open() {
    // A spherical cap with a notch: a free boundary tends to close it.
    let patch = grid(40, 8, false, 0.2, |u, v| {
        let (angle, polar) = (0.01 + (TAU - 0.02) * u, 0.15 + 1.9 * v);
        [polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()]
    });
    let chart = chart(&patch, ChartSpec::default());
    assert_promises(&patch, &chart);
}

#[test]
fn a_long_tube_must_be_split() {
    let tube = |length: f64| grid(16, (8.0 * length) as u32, true, 0.0, |u, v| [(TAU * u).cos(), -(TAU * u).sin(), length * v]);
    for method in [ChartMethod::SpectralConformal, ChartMethod::LeastSquaresConformal, ChartMethod::MeanValue] {
        assert_promises(&tube(3.0), &chart(&tube(3.0), ChartSpec::only(method)));
    }
    for spec in [ChartSpec::default(), ChartSpec::only(ChartMethod::SpectralConformal)] {
        assert!(matches!(outcome(&tube(14.0), spec).unwrap(), ChartOutcome::MustSplit { .. }));
    }
}

fn disc() -> (Patch, Vec<Vec2>) {
    let patch = grid(6, 6, false, 0.0, |u, v| [u, v, 0.0]);
    let uv = patch.positions.iter().map(|p| [p[0], p[1]]).collect();
    (patch, uv)
}

#[test]
fn folds_are_found_and_mended() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let (patch, flat) = disc();
    assert!(flipped_faces(&patch.triangles, &flat).is_empty());
    // An inner vertex outside its ring, a boundary vertex inside, a corner across its diagonal, two neighbours exchanged.
    let folds: [&[(usize, Vec2)]; 4] =
        [&[(24, [0.9, 0.9])], &[(3, [0.5, 0.3])], &[(0, [0.2, 0.2])], &[(24, [0.67, 0.5]), (25, [0.5, 0.5])]];
    for fold in folds {
        let mut uv = flat.clone();
        fold.iter().for_each(|&(v, p)| uv[v] = p);
        let before = flipped_faces(&patch.triangles, &uv);
        assert!(!before.is_empty());
        let mended = mend_flips(&patch, &[], &mut uv, &work).unwrap();
        assert_eq!(mended.flipped, Vec::<u32>::new(), "{fold:?}");
        assert!(flipped_faces(&patch.triangles, &uv).is_empty() && !overlaps(&patch.loops, &uv));
    }
}

#[test]
fn a_folded_sheet_is_not_mended_away() {
    let cancel = CancelToken::new();
    let (patch, flat) = disc();
    let mut uv: Vec<Vec2> = flat.iter().map(|p| [0.5 - (p[0] - 0.5).abs(), p[1]]).collect();
    assert!(!mend_flips(&patch, &[], &mut uv, &Work::silent(&cancel)).unwrap().flipped.is_empty());
}

#[test]
fn weights_of_extreme_slivers_do_not_break_the_maps() {
    for thin in [1e-4, 1e-8, 1e-12] {
        let patch = grid(10, 10, false, 0.0, |u, v| {
            let row = if (0.45..0.55).contains(&v) { 0.4 + thin } else { v };
            [u, row, 0.2 * (u * row).sin()]
        });
        assert_promises(&patch, &chart(&patch, ChartSpec::default()));
    }
}

#[test]
fn cancelled_work_stops_and_broken_patches_are_refused() {
    let (patch, _) = disc();
    let cancel = CancelToken::new();
    cancel.cancel();
    let stopped = parametrize_patch(&patch, &ChartSpec::default(), &Work::silent(&cancel)).unwrap_err();
    assert_eq!(stopped.reason(), Reason::Cancelled);
    let fresh = CancelToken::new();
    let empty = Patch::default();
    assert_eq!(plan_system(&empty, &Work::silent(&fresh)).unwrap_err().reason(), Reason::PatchTopology);
}

#[test]
fn virtual_triangles_close_holes_and_notches_and_keep_the_surface_manifold() {
    // A ring with a ragged outer border.
    let ring = grid(48, 5, true, 0.3, |u, v| {
        let k = (48.0 * u).round() as u32;
        let r = 1.0 + v * (1.0 + if v == 1.0 && k % 6 < 2 { -0.15 } else { 0.0 });
        [r * (TAU * u).cos(), -r * (TAU * u).sin(), 0.3 * v]
    });
    let cancel = CancelToken::new();
    let outline = |holes, ears| {
        let domain = Domain::new(&ring, 0, Filling { holes, ears }, &Work::silent(&cancel)).unwrap();
        let all: Vec<[u32; 3]> = domain.triangles().collect();
        let topology = Topology::build(&all, domain.size()).unwrap();
        assert!(topology.loops.iter().any(|l| {
            let mut vertices: Vec<u32> = l.iter().map(|&h| topology.origin(h)).collect();
            let mut outer = domain.outer.clone();
            vertices.sort_unstable();
            outer.sort_unstable();
            vertices == outer
        }));
        (topology.loops.len(), domain.outer.len())
    };
    assert_eq!(outline(HoleFilling::Open, false), (2, 48));
    assert_eq!(outline(HoleFilling::CentreVertex, false), (1, 48));
    let (loops, edges) = outline(HoleFilling::Open, true);
    assert!(loops == 2 && edges < 48, "{edges}");
    assert_eq!(outline(HoleFilling::CentreVertex, true), (1, edges));
}
