//! Closed-form lengths, and tracing on small grids.

use super::*;
use crate::partition::PatchSummary;
use crate::work::CancelToken;

fn meshed(points: Vec<Vec3>, sizes: Vec<f64>, closed: bool, kind: CurveKind) -> CurveMesh {
    let cancel = CancelToken::new();
    let polyline = CurvePolyline { points, sizes, closed, kind, min_edges: if closed { 3 } else { 1 }, locked: Vec::new() };
    mesh_curve(&polyline, &Work::silent(&cancel)).unwrap()
}

fn lengths(mesh: &CurveMesh) -> Vec<f64> {
    mesh.points.windows(2).map(|w| crate::vector::distance(w[0].position, w[1].position)).collect()
}

fn line(count: usize, length: f64) -> Vec<Vec3> {
    (0..count).map(|i| [length * i as f64 / (count - 1) as f64, 0.0, 0.0]).collect()
}

#[test]
fn uniform_line_has_equal_edges() {
    for (size, edges) in [(0.1, 10), (0.3, 3), (0.7, 1), (100.0, 1)] {
        let mesh = meshed(line(7, 1.0), vec![size; 7], false, CurveKind::Feature);
        assert_eq!(mesh.points.len(), edges + 1);
        assert!(lengths(&mesh).iter().all(|l| (l * edges as f64 - 1.0).abs() < 1e-12));
        assert_eq!((mesh.points[0].position, mesh.points[edges].position), ([0.0; 3], [1.0, 0.0, 0.0]));
    }
}

#[test]
fn linear_size_gives_a_geometric_progression() {
    // h = 0.1 + x / 2 on [0, 1]: the measure is 2 ln(1 + 5 x), its whole 2 ln 6 = 3.58, so 4 edges with ratio 6^(1/4).
    let points = line(2, 1.0);
    let mesh = meshed(points, vec![0.1, 0.6], false, CurveKind::Boundary);
    let fine = meshed(line(2000, 1.0), line(2000, 1.0).iter().map(|p| 0.1 + 0.5 * p[0]).collect(), false, CurveKind::Boundary);
    assert_eq!((mesh.points.len(), fine.points.len()), (5, 5));
    let l = lengths(&fine);
    let ratio = 6f64.powf(0.25);
    assert!(l.windows(2).all(|w| (w[1] / w[0] - ratio).abs() < 1e-3), "{l:?}");
}

#[test]
fn closed_curves_have_three_edges_at_least() {
    let ring: Vec<Vec3> = (0..=60)
        .map(|i| {
            let a = std::f64::consts::TAU * (i % 60) as f64 / 60.0;
            [a.cos(), a.sin(), 0.0]
        })
        .collect();
    for kind in [CurveKind::Boundary, CurveKind::Seam] {
        let mesh = meshed(ring.clone(), vec![50.0; 61], true, kind);
        assert_eq!(mesh.points.len(), 4);
        assert_eq!(mesh.points[0].position, mesh.points[3].position);
        let l = lengths(&mesh);
        assert!(l.iter().all(|x| (x / l[0] - 1.0).abs() < 0.05), "{l:?}");
    }
}

#[test]
fn zigzag_seam_is_measured_smoothed() {
    // Steps of 0.02 up and down at 45 degrees: arc length 1.41, but as an edge chain of length 0.1 it is a line of length 1.
    let zigzag: Vec<Vec3> = (0..=100).map(|i| [i as f64 * 0.01, 0.01 * f64::from(i % 2), 0.0]).collect();
    let mesh = meshed(zigzag, vec![0.1; 101], false, CurveKind::Seam);
    assert!((10..=11).contains(&(mesh.points.len() - 1)));
    assert!(lengths(&mesh).iter().all(|l| (0.07..0.13).contains(l)));
}

#[test]
fn corners_of_features_are_not_cut() {
    // A square wave whose corners equal edges would miss.
    let mut points = vec![[0.0; 3]];
    for i in 0..6 {
        let (x, y) = (f64::from(i) * 1.13, if i % 2 == 0 { 0.0 } else { 0.9 });
        points.extend([[x + 1.13, y, 0.0], [x + 1.13, 0.9 - y, 0.0]]);
    }
    let count = points.len();
    let polyline =
        CurvePolyline { points, sizes: vec![0.5; count], closed: false, kind: CurveKind::Feature, min_edges: 1, locked: Vec::new() };
    let cancel = CancelToken::new();
    let mesh = mesh_curve(&polyline, &Work::silent(&cancel)).unwrap();
    for w in mesh.points.windows(2) {
        let (a, b) = (f64::from(w[0].segment) + w[0].t, f64::from(w[1].segment) + w[1].t);
        assert!(a < b && faithful::deviation(&polyline, a, b) < 0.1);
    }
    assert!(lengths(&mesh).iter().all(|l| (0.15..0.9).contains(l)));
}

#[test]
fn bad_sizes_are_refused() {
    let cancel = CancelToken::new();
    for (size, reason) in [(0.0, "BAD_PARAMETER"), (f64::NAN, "BAD_PARAMETER"), (-1.0, "BAD_PARAMETER"), (1e-12, "LIMIT_REACHED")] {
        let polyline = CurvePolyline {
            points: line(2, 1.0),
            sizes: vec![size; 2],
            closed: false,
            kind: CurveKind::Seam,
            min_edges: 1,
            locked: Vec::new(),
        };
        assert_eq!(mesh_curve(&polyline, &Work::silent(&cancel)).unwrap_err().reason().code(), reason);
    }
}

/// A square grid of `n` by `n` cells with two triangles each.
fn grid(n: u32) -> Vec<[u32; 3]> {
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    cells.flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]).collect()
}

#[test]
fn curves_of_a_grid_cut_in_quarters() {
    let n = 8u32;
    let triangles = grid(n);
    let topology = Topology::build(&triangles, ((n + 1) * (n + 1)) as usize).unwrap();
    let quarter = |f: usize| {
        let (i, j) = (f as u32 / 2 / n, f as u32 / 2 % n);
        2 * u32::from(i >= n / 2) + u32::from(j >= n / 2)
    };
    let partition = Partition {
        face_patch: (0..triangles.len()).map(quarter).collect(),
        patches: vec![PatchSummary::default(); 4],
        ..Partition::default()
    };
    // A dangling feature of two edges inside the first quarter.
    let mut features = Features {
        is_feature: vec![false; topology.halfedge_count()],
        corners: vec![0, n, n * (n + 1), n * (n + 2)],
        ..Features::default()
    };
    for h in 0..topology.halfedge_count() as u32 {
        let ends = (topology.origin(h), topology.target(h));
        let (a, b) = (ends.0.min(ends.1), ends.0.max(ends.1));
        features.is_feature[h as usize] = (a, b) == (n + 2, n + 3) || (a, b) == (n + 3, n + 4);
    }
    let network = trace_curves(&topology, &features, &partition);
    let count = |kind: CurveKind| network.curves.iter().filter(|c| c.kind == kind).count();
    // The boundary is cut at 4 corners and 4 seam ends, the seams meet in the middle.
    assert_eq!((count(CurveKind::Boundary), count(CurveKind::Seam), count(CurveKind::Feature)), (8, 4, 1));
    let total: usize = network.curves.iter().map(|c| c.halfedges.len()).sum();
    assert_eq!(total, 4 * n as usize + 2 * n as usize + 2);
    for curve in &network.curves {
        assert!(!curve.closed && curve.min_edges == 1);
        assert!(curve.halfedges.windows(2).all(|w| topology.target(w[0]) == topology.origin(w[1])));
        let reverse = curve.halfedges.last().and_then(|&h| topology.twin(h));
        assert!(reverse.is_none_or(|r| curve.halfedges[0] < r));
    }
    assert!(network.curves.windows(2).all(|w| w[0].halfedges.iter().min() < w[1].halfedges.iter().min()));
}

#[test]
fn two_single_edges_between_the_same_ends_are_avoided() {
    // Two triangles of different patches: the diagonal is a seam between the ends of two boundary curves.
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let topology = Topology::build(&triangles, 4).unwrap();
    let partition = Partition { face_patch: vec![0, 1], patches: vec![PatchSummary::default(); 2], ..Partition::default() };
    let features = Features { is_feature: vec![false; 6], corners: Vec::new(), ..Features::default() };
    let network = trace_curves(&topology, &features, &partition);
    let of = |kind: CurveKind| network.curves.iter().filter(|c| c.kind == kind).map(|c| c.min_edges).collect::<Vec<_>>();
    assert_eq!((of(CurveKind::Seam), of(CurveKind::Boundary)), (vec![1], vec![2, 2]));
}

#[test]
fn closed_seam_without_junction_is_one_closed_curve() {
    // An octahedron cut around its equator.
    let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]];
    let topology = Topology::build(&triangles, 6).unwrap();
    let partition =
        Partition { face_patch: vec![0, 0, 0, 0, 1, 1, 1, 1], patches: vec![PatchSummary::default(); 2], ..Partition::default() };
    let features = Features { is_feature: vec![false; 24], corners: Vec::new(), ..Features::default() };
    let network = trace_curves(&topology, &features, &partition);
    assert_eq!(network.curves.len(), 1);
    assert!(network.curves[0].closed && network.curves[0].halfedges.len() == 4 && network.curves[0].min_edges == 3);
}

#[test]
fn small_notches_of_the_boundary_stay() {
    // Teeth of several depths, narrower than a third of an edge.
    let mut points = vec![[0.0, 0.0, 0.0]];
    for (i, depth) in [0.11, 0.13, 0.2, 0.4, 0.09].into_iter().enumerate() {
        let x = 2.3 * (i + 1) as f64;
        points.extend([[x - 0.06, 0.0, 0.0], [x, depth, 0.0], [x + 0.05, 0.01, 0.0]]);
    }
    points.push([14.0, 0.0, 0.0]);
    let sizes = vec![1.0; points.len()];
    let polyline = CurvePolyline { points, sizes, closed: false, kind: CurveKind::Boundary, min_edges: 1, locked: Vec::new() };
    let cancel = CancelToken::new();
    let mesh = mesh_curve(&polyline, &Work::silent(&cancel)).unwrap();
    for p in &polyline.points {
        let chord = |w: &[CurvePoint]| crate::bvh::closest_on_triangle(*p, &[w[0].position, w[1].position, w[1].position]).0;
        let away = mesh.points.windows(2).map(|w| crate::vector::distance(chord(w), *p)).fold(f64::INFINITY, f64::min);
        assert!(away <= 0.1, "{p:?}: {away}");
    }
    assert!(mesh.points.len() < 40);
}
