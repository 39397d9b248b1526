//! Fillings of loops: discs with exactly the loop as boundary, graded, in the plane; refusals with places.

use super::*;
use crate::topology::Topology;
use crate::vector::{add_scaled, area_vector_twice, distance, dot, norm};
use crate::work::CancelToken;
use std::f64::consts::TAU;

fn fill(ring: &[u32], positions: &[Vec3]) -> Result<HoleMesh> {
    mean_plane_fill(ring, positions, &Work::silent(&CancelToken::new()))
}

/// A closed curve as a loop.
fn curve(m: u32, at: impl Fn(f64) -> Vec3) -> (Vec<u32>, Vec<Vec3>) {
    ((0..m).collect(), (0..m).map(|k| at(TAU * f64::from(k) / f64::from(m))).collect())
}

/// All promises of a filling, checked with the topology of the engine.
fn assert_fills(ring: &[u32], mesh: &HoleMesh) {
    let m = ring.len();
    let count = m + mesh.positions.len();
    let topology = Topology::build(&mesh.triangles, count).unwrap();
    assert_eq!(topology.loops.len(), 1);
    let border: Vec<[u32; 2]> = topology.loops[0].iter().map(|&h| [topology.origin(h), topology.target(h)]).collect();
    assert_eq!(border.len(), m);
    assert!(border.iter().all(|&[a, b]| a == (b + 1) % m as u32), "the loop is not run through against its direction");
    assert_eq!(2 * (count - 1) - m, mesh.triangles.len());
    let mut used: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    assert_eq!(used.len(), count);
}

fn points(ring: &[u32], positions: &[Vec3], mesh: &HoleMesh) -> Vec<Vec3> {
    ring.iter().map(|&v| positions[v as usize]).chain(mesh.positions.iter().copied()).collect()
}

#[test]
fn flat_and_wavy_loops_of_any_size_and_pose_are_filled() {
    for (m, wave, size) in [(3, 0.0, 1.0), (4, 0.4, 1.0), (12, 0.3, 1e-150), (60, 0.5, 1e6), (200, 0.0, 1e-9), (2000, 0.2, 3.0)] {
        let (ring, positions) = curve(m, |t| {
            let p = [2.0 * t.cos(), t.sin(), wave * (3.0 * t).cos()];
            add_scaled([7.0 * size, 0.0, size], [p[0] * 0.6 - p[2] * 0.8, p[1], p[0] * 0.8 + p[2] * 0.6], size)
        });
        let mesh = fill(&ring, &positions).unwrap();
        assert_fills(&ring, &mesh);
        assert!(mesh.positions.len() <= 3 * m as usize + 10, "{m}: {}", mesh.positions.len());
        // New vertices lie in the mean plane, which by symmetry goes through the centre with the normal of the flat curve.
        for p in &mesh.positions {
            let d = [p[0] - 7.0 * size, p[1], p[2] - size];
            if m % 3 == 0 || wave == 0.0 {
                assert!(dot(d, [-0.8, 0.0, 0.6]).abs() < 0.08 * size, "{m} {}", dot(d, [-0.8, 0.0, 0.6]) / size);
            }
        }
    }
}

#[test]
fn areas_angles_and_grading_of_a_flat_filling() {
    // An ellipse with edges ten times finer on one side.
    let m = 400;
    let (ring, positions) = curve(m, |t| [3.0 * (t + 0.8 * t.sin()).cos(), 2.0 * (t + 0.8 * t.sin()).sin(), 1.0]);
    let mesh = fill(&ring, &positions).unwrap();
    assert_fills(&ring, &mesh);
    let all = points(&ring, &positions, &mesh);
    let at = |t: &[u32; 3]| t.map(|v| all[v as usize]);
    let filled: f64 = mesh.triangles.iter().map(at).map(|[a, b, c]| area_vector_twice(a, b, c)[2]).sum();
    let outline: f64 = (0..m as usize).map(|k| (all[k], all[(k + 1) % m as usize])).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    // Seen from above the loop runs counter-clockwise, the filling clockwise.
    assert!((filled + outline).abs() < 1e-10 * outline.abs());
    let sharp = |[a, b, c]: [Vec3; 3]| {
        let sines = [(a, b, c), (b, c, a), (c, a, b)].map(|(p, q, r)| norm(area_vector_twice(p, q, r)) / (distance(p, q) * distance(p, r)));
        sines.into_iter().fold(1.0, f64::min).asin().to_degrees()
    };
    let least = mesh.triangles.iter().map(at).map(sharp).fold(90.0, f64::min);
    assert!(least > 15.0, "least angle {least}");
    // Graded: far fewer vertices than triangles of the finest size would need.
    assert!(mesh.positions.len() < 900 && mesh.positions.len() > 50, "{}", mesh.positions.len());
}

#[test]
fn loops_with_notches_straight_runs_and_tiny_edges_are_filled() {
    // A comb: straight runs of collinear points and deep notches.
    let mut comb: Vec<Vec3> = Vec::new();
    for k in 0..20 {
        let x = f64::from(k);
        comb.extend([[x, 0.0, 0.0], [x, 10.0, 0.0], [x + 0.5, 10.0, 0.0], [x + 0.5, 0.0, 0.0]]);
    }
    comb.extend((0..=40).map(|k| [19.5 - 0.4875 * f64::from(k), -1.0, 0.0]));
    comb.reverse();
    let star = curve(90, |t| [(1.0 + 0.8 * (9.0 * t).cos()) * t.cos(), (1.0 + 0.8 * (9.0 * t).cos()) * t.sin(), 0.05 * (2.0 * t).sin()]).1;
    let square: Vec<Vec3> = (0..40)
        .map(f64::from)
        .map(|s| (s / 10.0, s % 10.0))
        .map(|(q, r)| match q as i32 {
            0 => [r, 0.0, 0.1],
            1 => [10.0, r, 0.1],
            2 => [10.0 - r, 10.0, 0.1],
            _ => [0.0, 10.0 - r, 0.1],
        })
        .map(|p| [0.6 * p[0] - 0.8 * p[2] + 1.0 / 3.0, p[1] * 1.1, 0.8 * p[0] + 0.6 * p[2]])
        .collect();
    let mut tiny = curve(30, |t| [t.cos(), t.sin(), 0.0]).1;
    tiny.extend([[1.0, -1e-9, 0.0], [1.0, -0.5e-9, 0.0]]);
    for positions in [comb, star, square, tiny] {
        let ring: Vec<u32> = (0..positions.len() as u32).collect();
        let mesh = fill(&ring, &positions).unwrap();
        assert_fills(&ring, &mesh);
        assert!(mesh.positions.len() <= 10 * ring.len() + 100);
    }
}

#[test]
fn a_loop_that_crosses_itself_in_every_plane_is_refused_with_the_place() {
    let eight = curve(41, |t| [t.sin(), (2.0 * t).sin(), 0.01 * t.cos()]);
    let twice = curve(40, |t| [(1.0 + 0.3 * t.cos()) * (2.0 * t).cos(), (1.0 + 0.3 * t.cos()) * (2.0 * t).sin(), 0.3 * t.sin()]);
    let double = (vec![0, 1, 2, 3], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]]);
    let spot = (vec![0, 1, 2], vec![[1.0; 3]; 3]);
    let line = (vec![0, 1, 2], vec![[0.0; 3], [1.0; 3], [3.0; 3]]);
    for (ring, positions) in [eight, twice, double, spot, line] {
        let error = fill(&ring, &positions).unwrap_err();
        assert_eq!(error.reason(), Reason::ChartFailed);
        assert_eq!(error.locations().len(), 2);
        for place in error.locations() {
            assert_eq!((place.ids[0] as usize + 1) % ring.len(), place.ids[1] as usize);
        }
    }
}

#[test]
fn a_second_plane_is_tried() {
    // A saddle so high that the plane of least squares stands upright, where it crosses itself; from above it is a square.
    let (ring, positions) = curve(60, |t| [t.cos(), t.sin(), 2.0 * (2.0 * t).cos()]);
    let mesh = fill(&ring, &positions).unwrap();
    assert_fills(&ring, &mesh);
}

#[test]
fn fillings_are_the_same_every_time_and_can_be_cancelled() {
    let (ring, positions) = curve(300, |t| [t.cos(), t.sin() * (1.2 + t.cos()), 0.1 * (5.0 * t).sin()]);
    let first = fill(&ring, &positions).unwrap();
    assert_eq!(first, fill(&ring, &positions).unwrap());
    let cancel = CancelToken::new();
    cancel.cancel();
    let stopped = mean_plane_fill(&ring, &positions, &Work::silent(&cancel)).unwrap_err();
    assert_eq!(stopped.reason(), Reason::Cancelled);
}
