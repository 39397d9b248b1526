//! Generated charts with closed-form maps, and the invariants every patch mesh must have.

mod meshers;

use super::*;
use crate::curve::{CurveKind, CurvePolyline, mesh_curve};
use crate::parametrize::{ChartMethod, Distortion};
use crate::vector::{distance, kappa};
use crate::work::CancelToken;

/// A fine triangulation of the ring `inner <= r <= outer` (a disc for `inner` = 0) in polar grid form, mapped by `place`.
fn polar(rings: usize, sectors: usize, inner: f64, outer: f64, place: &dyn Fn(Vec2) -> Vec3) -> (Patch, Vec<Vec2>) {
    let mut uv = Vec::new();
    let first = usize::from(inner == 0.0);
    if first == 1 {
        uv.push([0.0, 0.0]);
    }
    for i in first..=rings {
        let r = inner + (outer - inner) * i as f64 / rings as f64;
        for j in 0..sectors {
            let a = std::f64::consts::TAU * (j as f64 + 0.5 * (i % 2) as f64) / sectors as f64;
            uv.push([r * a.cos(), r * a.sin()]);
        }
    }
    let at = |i: usize, j: usize| (first + (i - first) * sectors + j % sectors) as u32;
    let mut triangles = Vec::new();
    if first == 1 {
        (0..sectors).for_each(|j| triangles.push([0, at(1, j), at(1, j + 1)]));
    }
    for i in first..rings {
        for j in 0..sectors {
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
            if i % 2 == 1 {
                triangles.extend([[a, d, b], [a, c, d]]);
            } else {
                triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    let mut loops = vec![(0..sectors).map(|j| at(rings, j)).collect::<Vec<u32>>()];
    if first == 0 {
        loops.push((0..sectors).rev().map(|j| at(0, j)).collect());
    }
    (Patch { positions: uv.iter().map(|p| place(*p)).collect(), triangles, loops }, uv)
}

fn chart(uv: Vec<Vec2>) -> Chart {
    Chart { uv, method: ChartMethod::SpectralConformal, attempts: Vec::new(), distortion: Distortion::default() }
}

/// One closed curve per loop.
fn loop_curves(patch: &Patch, sizes: &[f64]) -> Vec<(Vec<u32>, CurveMesh)> {
    let cancel = CancelToken::new();
    let closed = |ring: &Vec<u32>| {
        let mut path = ring.clone();
        path.push(ring[0]);
        let polyline = CurvePolyline {
            points: path.iter().map(|&v| patch.positions[v as usize]).collect(),
            sizes: path.iter().map(|&v| sizes[v as usize]).collect(),
            closed: true,
            kind: CurveKind::Boundary,
            min_edges: 3,
            locked: Vec::new(),
        };
        (path, mesh_curve(&polyline, &Work::silent(&cancel)).unwrap())
    };
    patch.loops.iter().map(closed).collect()
}

fn uses(curves: &[(Vec<u32>, CurveMesh)]) -> Vec<CurveUse<'_>> {
    curves.iter().enumerate().map(|(i, (path, mesh))| CurveUse { path: path.clone(), mesh, curve: i as u32 }).collect()
}

fn meshed(patch: &Patch, uv: &[Vec2], curves: &[(Vec<u32>, CurveMesh)], sizes: &[f64]) -> (PlanarMesh, LiftedPatch) {
    let cancel = CancelToken::new();
    let uses = uses(curves);
    let planar = mesh_chart(patch, &chart(uv.to_vec()), &uses, sizes, Mesher::Frontal, &Work::silent(&cancel)).unwrap();
    let lifted = lift(patch, &planar, &uses);
    check(patch, &planar, &lifted, curves);
    (planar, lifted)
}

/// What must hold for every patch mesh, at any size.
fn check(patch: &Patch, planar: &PlanarMesh, lifted: &LiftedPatch, curves: &[(Vec<u32>, CurveMesh)]) {
    let topology = Topology::build(&planar.triangles, planar.uv.len()).unwrap();
    assert_eq!(topology.components.len(), 1);
    assert_eq!(topology.components[0].euler(), 2 - patch.loops.len() as i64);
    assert_eq!(topology.loops.len(), patch.loops.len());
    let find = |curve: u32, point: u32| planar.origins.iter().position(|o| *o == VertexOrigin::Curve { curve, point }).map(|v| v as u32);
    let mut boundary_points = 0;
    for (c, (path, mesh)) in curves.iter().enumerate() {
        let count = mesh.points.len();
        let closed = path[0] == path[path.len() - 1];
        let is_loop = closed && patch.loops.iter().any(|l| l.contains(&path[0]) && l.contains(&path[1]));
        for i in 0..count - 1 {
            let next = if closed && i + 2 == count { 0 } else { i + 1 };
            let (Some(a), Some(b)) = (find(c as u32, i as u32), find(c as u32, next as u32)) else { continue };
            assert_eq!(lifted.positions[a as usize], mesh.points[i].position);
            let there = topology.outgoing(a).find(|&h| topology.target(h) == b);
            let back = topology.outgoing(b).find(|&h| topology.target(h) == a);
            if is_loop {
                assert!(there.is_some_and(|h| topology.twin(h).is_none()) && back.is_none(), "curve {c} point {i}");
                boundary_points += 1;
            } else {
                assert!(there.is_some() && back.is_some());
            }
        }
    }
    assert_eq!(boundary_points, topology.loops.iter().map(Vec::len).sum::<usize>());
    for (v, point) in planar.points.iter().enumerate() {
        assert!(point.barycentric.iter().all(|w| *w >= 0.0) && (point.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let gap = distance(lifted.positions[v], point_in_space(patch, point));
        assert!(gap < 1e-9, "vertex {v} is {gap} off its face");
    }
}

fn assert_counter_clockwise(planar: &PlanarMesh) {
    for t in &planar.triangles {
        let [a, b, c] = t.map(|v| planar.uv[v as usize]);
        assert!(triangulation::orientation(a, b, c) > 0.0);
    }
}

fn mean_kappa(lifted: &LiftedPatch) -> f64 {
    let all = lifted.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| lifted.positions[v as usize]);
        kappa(a, b, c)
    });
    all.clone().sum::<f64>() / all.count() as f64
}

fn mean_edge_over(lifted: &LiftedPatch, size: &dyn Fn(Vec3) -> f64) -> f64 {
    let lengths: Vec<f64> = lifted
        .triangles
        .iter()
        .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])))
        .map(|(a, b)| {
            let (a, b) = (lifted.positions[a as usize], lifted.positions[b as usize]);
            distance(a, b) / size(crate::vector::lerp(a, b, 0.5))
        })
        .collect();
    lengths.iter().sum::<f64>() / lengths.len() as f64
}

fn flat(p: Vec2) -> Vec3 {
    [p[0], p[1], 0.0]
}

/// A face that the map presses flat has no density of its own: next to it the mesh is that of its neighbours.
#[test]
fn faces_squeezed_flat_do_not_multiply_the_mesh() {
    let (patch, mut uv) = polar(8, 24, 0.3, 1.0, &|p| [p[0], p[1], 0.0]);
    for ring in &patch.loops {
        // The third corner of the face on an edge of the loop comes almost onto the edge.
        let (a, b) = (ring[3], ring[4]);
        let face = patch.triangles.iter().find(|t| t.contains(&a) && t.contains(&b)).unwrap();
        let apex = face.iter().copied().find(|v| ![a, b].contains(v)).unwrap() as usize;
        let (p, q) = (uv[a as usize], uv[b as usize]);
        let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        let off = [uv[apex][0] - middle[0], uv[apex][1] - middle[1]];
        uv[apex] = [middle[0] + 1e-15 * off[0], middle[1] + 1e-15 * off[1]];
    }
    let size = 0.25;
    let sizes = vec![size; uv.len()];
    let (planar, _) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    let area = std::f64::consts::PI * (1.0 - 0.09);
    let wanted = area / (0.75f64.sqrt() * size * size);
    assert!((planar.uv.len() as f64) < 3.0 * wanted, "{} vertices where {wanted} are wanted", planar.uv.len());
}

#[test]
fn uniform_disc_is_nearly_hexagonal() {
    let (patch, uv) = polar(20, 80, 0.0, 1.0, &flat);
    for size in [0.2, 0.05, 0.02] {
        let sizes = vec![size; uv.len()];
        let (planar, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
        assert_counter_clockwise(&planar);
        let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &|_| size));
        println!("{size}: {} triangles, kappa {kappa:.4}, edge {edge:.4}", planar.triangles.len());
        assert!(kappa >= 0.97 && (0.9..1.1).contains(&edge), "{size}: kappa {kappa} edge {edge}");
        let expected = std::f64::consts::PI / (0.25 * 3f64.sqrt() * size * size);
        assert!((planar.triangles.len() as f64 / expected - 1.0).abs() < 0.15);
    }
}

#[test]
fn annulus_keeps_its_hole() {
    for inner in [0.3, 0.9] {
        let (patch, uv) = polar(10, 90, inner, 1.0, &flat);
        let sizes = vec![0.05; uv.len()];
        let (planar, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
        assert_counter_clockwise(&planar);
        assert!(mean_kappa(&lifted) > 0.94);
    }
}

#[test]
fn sizes_far_above_the_patch_deliver() {
    for inner in [0.0, 0.3, 0.7, 0.95] {
        let (patch, uv) = polar(6, 40, inner, 1.0, &flat);
        for size in [0.3, 0.6, 1.0, 3.0, 100.0] {
            let sizes = vec![size; uv.len()];
            meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
        }
    }
}

#[test]
fn stereographic_cap_has_even_triangles_in_space() {
    // The plane's unit disc onto the upper half sphere: conformal, scale 2 / (1 + r^2).
    let sphere = |p: Vec2| {
        let r = p[0] * p[0] + p[1] * p[1];
        [2.0 * p[0] / (1.0 + r), 2.0 * p[1] / (1.0 + r), (1.0 - r) / (1.0 + r)]
    };
    let (patch, uv) = polar(40, 120, 0.0, 1.0, &sphere);
    let size = 0.06;
    let sizes = vec![size; uv.len()];
    let (planar, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    assert_counter_clockwise(&planar);
    let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &|_| size));
    assert!(kappa > 0.975 && (0.92..1.05).contains(&edge), "kappa {kappa} edge {edge}");
}

#[test]
fn strong_change_of_scale_is_followed() {
    // w = exp(z) on an annulus of radii 0.02 to 1 comes from a cylinder: scale 1 / r, fifty to one.
    let cylinder = |p: Vec2| {
        let (r, a) = (p[0].hypot(p[1]), p[1].atan2(p[0]));
        [a.cos(), a.sin(), -r.ln()]
    };
    let uv_of = |i: usize, j: usize| {
        let (z, a) = (-50f64.ln() * (1.0 - i as f64 / 60.0), std::f64::consts::TAU * (j as f64 + 0.5 * (i % 2) as f64) / 100.0);
        [z.exp() * a.cos(), z.exp() * a.sin()]
    };
    let (mut patch, mut uv) = polar(60, 100, 0.02, 1.0, &flat);
    for i in 0..=60 {
        for j in 0..100 {
            uv[i * 100 + j] = uv_of(i, j);
            patch.positions[i * 100 + j] = cylinder(uv[i * 100 + j]);
        }
    }
    let size = 0.15;
    let sizes = vec![size; uv.len()];
    let (planar, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    assert_counter_clockwise(&planar);
    let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &|_| size));
    assert!(kappa > 0.96 && (0.9..1.08).contains(&edge), "kappa {kappa} edge {edge}");
}

#[test]
fn stretched_chart_is_undone_by_the_metric() {
    // The chart is three times wider than the surface: far from conformal.
    let (mut patch, uv) = polar(20, 80, 0.0, 1.0, &flat);
    patch.positions.iter_mut().for_each(|p| p[0] /= 3.0);
    let size = 0.04;
    let sizes = vec![size; uv.len()];
    let (_, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &|_| size));
    assert!(kappa > 0.96 && (0.9..1.1).contains(&edge), "kappa {kappa} edge {edge}");
}

#[test]
fn graded_sizes_are_met() {
    let (patch, uv) = polar(40, 120, 0.0, 1.0, &flat);
    let wanted = |p: Vec3| 0.01 + 0.1 * ((p[0] - 0.3).hypot(p[1]));
    let sizes: Vec<f64> = patch.positions.iter().map(|p| wanted(*p)).collect();
    let (planar, lifted) = meshed(&patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    assert_counter_clockwise(&planar);
    let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &wanted));
    assert!(kappa > 0.95 && (0.9..1.1).contains(&edge), "kappa {kappa} edge {edge}");
}

/// A disc with a feature along the negative and positive x axis between the radii of two rings.
fn with_inner_feature(size: f64) -> (Patch, Vec<Vec2>, Vec<(Vec<u32>, CurveMesh)>, Vec<f64>) {
    let (patch, uv) = polar(16, 48, 0.0, 1.0, &flat);
    let sizes = vec![size; uv.len()];
    let mut curves = loop_curves(&patch, &sizes);
    // Rings of even number start at angle 0; odd ones half a sector later: a zigzag along the axis.
    let path: Vec<u32> = (0..12).map(|i| if i == 0 { 0 } else { 1 + (i - 1) * 48 }).collect();
    let polyline = CurvePolyline {
        points: path.iter().map(|&v| patch.positions[v as usize]).collect(),
        sizes: vec![size; path.len()],
        closed: false,
        kind: CurveKind::Feature,
        min_edges: 1,
        locked: Vec::new(),
    };
    let cancel = CancelToken::new();
    let mesh = mesh_curve(&polyline, &Work::silent(&cancel)).unwrap();
    curves.push((path, mesh));
    (patch, uv, curves, sizes)
}

#[test]
fn features_inside_a_patch_are_edges() {
    for size in [0.04, 0.2, 0.7, 5.0] {
        let (patch, uv, curves, sizes) = with_inner_feature(size);
        meshed(&patch, &uv, &curves, &sizes);
    }
}

#[test]
fn a_useless_chart_still_delivers() {
    for size in [0.05, 0.3, 10.0] {
        let (patch, uv, curves, sizes) = with_inner_feature(size);
        // Folded, then collapsed to a point.
        let folded: Vec<Vec2> = uv.iter().map(|p| [p[0].abs(), p[1]]).collect();
        let (_, lifted) = meshed(&patch, &folded, &curves, &sizes);
        // Three boundary points around a long feature leave no choice of shape.
        let kappa = mean_kappa(&lifted);
        assert!(size > 1.0 || kappa > 0.5, "{size}: kappa {kappa}");
        meshed(&patch, &vec![[0.0; 2]; uv.len()], &curves, &sizes);
    }
}

#[test]
fn narrow_winding_strip_delivers_at_any_size() {
    // A sine-shaped band of width 0.1: chords cut it at every bend when the size is large.
    let (n, m) = (200usize, 4usize);
    let uv: Vec<Vec2> =
        (0..=n).flat_map(|i| (0..=m).map(move |j| (i as f64 * 0.05, j as f64 * 0.025))).map(|(x, y)| [x, y + (3.0 * x).sin()]).collect();
    let at = |i: usize, j: usize| (i * (m + 1) + j) as u32;
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        triangles.extend([[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]]);
    }
    let mut ring: Vec<u32> = (0..n).map(|i| at(i, 0)).collect();
    ring.extend((0..m).map(|j| at(n, j)));
    ring.extend((1..=n).rev().map(|i| at(i, m)));
    ring.extend((1..=m).rev().map(|j| at(0, j)));
    let patch = Patch { positions: uv.iter().map(|p| flat(*p)).collect(), triangles, loops: vec![ring] };
    for size in [0.05, 0.3, 0.7, 1.3, 4.0, 50.0] {
        let sizes = vec![size; uv.len()];
        let curves = loop_curves(&patch, &sizes);
        meshed(&patch, &uv, &curves, &sizes);
    }
}

#[test]
fn equal_input_gives_equal_output_and_cancelling_stops() {
    let (patch, uv) = polar(20, 80, 0.0, 1.0, &flat);
    let sizes = vec![0.03; uv.len()];
    let curves = loop_curves(&patch, &sizes);
    assert_eq!(meshed(&patch, &uv, &curves, &sizes), meshed(&patch, &uv, &curves, &sizes));
    let cancel = CancelToken::new();
    cancel.cancel();
    let stopped = mesh_chart(&patch, &chart(uv), &uses(&curves), &sizes, Mesher::Frontal, &Work::silent(&cancel));
    assert_eq!(stopped.unwrap_err().reason(), crate::error::Reason::Cancelled);
}
