//! Every mesher over the families of charts, and what each claims: Delaunay in the metric, least angle, lengths in a metric with
//! directions of its own.

use super::*;
use crate::metric::squared_length;

const ALL: [Mesher; 4] = [Mesher::Frontal, Mesher::Delaunay { min_angle_deg: 28.0 }, Mesher::MeshAdapt, Mesher::Anisotropic];

fn meshed_by(mesher: Mesher, patch: &Patch, uv: &[Vec2], curves: &[(Vec<u32>, CurveMesh)], sizes: &[f64]) -> (PlanarMesh, LiftedPatch) {
    let cancel = CancelToken::new();
    let uses = uses(curves);
    let planar = mesh_chart(patch, &chart(uv.to_vec()), &uses, sizes, mesher, &Work::silent(&cancel)).unwrap();
    let lifted = lift(patch, &planar, &uses);
    check(patch, &planar, &lifted, curves);
    (planar, lifted)
}

fn least_angle(lifted: &LiftedPatch) -> f64 {
    let angle = |a: Vec3, b: Vec3, c: Vec3| crate::vector::angle_between(crate::vector::sub(b, a), crate::vector::sub(c, a)).to_degrees();
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| lifted.positions[v as usize]);
        angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b))
    };
    lifted.triangles.iter().map(of).fold(180.0, f64::min)
}

#[test]
fn every_mesher_fills_every_family() {
    for mesher in ALL {
        for inner in [0.0, 0.3, 0.9] {
            let (patch, uv) = polar(10, 90, inner, 1.0, &flat);
            for size in [0.05, 0.3, 3.0] {
                let sizes = vec![size; uv.len()];
                let curves = loop_curves(&patch, &sizes);
                let (planar, lifted) = meshed_by(mesher, &patch, &uv, &curves, &sizes);
                if size < 0.1 {
                    assert_counter_clockwise(&planar);
                    let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &|_| size));
                    assert!(kappa > 0.92 && (0.85..1.15).contains(&edge), "{mesher:?} {inner}: kappa {kappa} edge {edge}");
                }
            }
        }
        for size in [0.04, 0.2, 0.7, 5.0] {
            let (patch, uv, curves, sizes) = with_inner_feature(size);
            meshed_by(mesher, &patch, &uv, &curves, &sizes);
        }
        let (patch, uv, curves, sizes) = with_inner_feature(0.3);
        let folded: Vec<Vec2> = uv.iter().map(|p| [p[0].abs(), p[1]]).collect();
        meshed_by(mesher, &patch, &folded, &curves, &sizes);
    }
}

#[test]
fn sizes_that_vary_are_met_on_the_surface_by_every_mesher() {
    let sphere = |p: Vec2| {
        let r = p[0] * p[0] + p[1] * p[1];
        [2.0 * p[0] / (1.0 + r), 2.0 * p[1] / (1.0 + r), (1.0 - r) / (1.0 + r)]
    };
    let (patch, uv) = polar(40, 120, 0.0, 1.0, &sphere);
    let wanted = |p: Vec3| 0.02 + 0.08 * (p[0] - 0.3).hypot(p[1]);
    let sizes: Vec<f64> = patch.positions.iter().map(|p| wanted(*p)).collect();
    let curves = loop_curves(&patch, &sizes);
    for mesher in ALL {
        let (planar, lifted) = meshed_by(mesher, &patch, &uv, &curves, &sizes);
        assert_counter_clockwise(&planar);
        let (kappa, edge) = (mean_kappa(&lifted), mean_edge_over(&lifted, &wanted));
        assert!(kappa > 0.93 && (0.85..1.12).contains(&edge), "{mesher:?}: kappa {kappa} edge {edge}");
    }
}

#[test]
fn refinement_is_delaunay_on_the_surface_and_keeps_its_angle() {
    // Conformal and three times wider than the surface: the property holds on the surface, not in the chart.
    for stretch in [1.0, 3.0] {
        let (mut patch, uv) = polar(20, 80, 0.0, 1.0, &flat);
        patch.positions.iter_mut().for_each(|p| p[0] /= stretch);
        let sizes = vec![0.05; uv.len()];
        let curves = loop_curves(&patch, &sizes);
        for min_angle_deg in [0.0, 20.0, 28.0, 33.0] {
            let (planar, lifted) = meshed_by(Mesher::Delaunay { min_angle_deg }, &patch, &uv, &curves, &sizes);
            let least = least_angle(&lifted);
            println!("{stretch} {min_angle_deg}: {least}");
            assert!(least >= min_angle_deg - 1e-6, "{stretch} {min_angle_deg}: {least}");
            let topology = Topology::build(&planar.triangles, planar.uv.len()).unwrap();
            for h in 0..topology.halfedge_count() as u32 {
                let Some(t) = topology.twin(h) else { continue };
                let at = |h: u32| {
                    let [a, b, c] =
                        [topology.origin(topology.prev(h)), topology.origin(h), topology.target(h)].map(|v| lifted.positions[v as usize]);
                    crate::vector::angle_between(crate::vector::sub(b, a), crate::vector::sub(c, a))
                };
                assert!(at(h) + at(t) <= std::f64::consts::PI + 1e-9);
            }
        }
    }
}

#[test]
fn a_least_angle_out_of_range_is_refused() {
    for bad in [-1.0, 33.5, f64::NAN] {
        assert_eq!(Mesher::Delaunay { min_angle_deg: bad }.validate().unwrap_err().reason(), crate::error::Reason::BadParameter);
    }
}

#[test]
fn adapted_edges_are_near_their_length() {
    let (patch, uv) = polar(20, 80, 0.0, 1.0, &flat);
    let sizes = vec![0.05; uv.len()];
    let (_, lifted) = meshed_by(Mesher::MeshAdapt, &patch, &uv, &loop_curves(&patch, &sizes), &sizes);
    for t in &lifted.triangles {
        for k in 0..3 {
            let l = distance(lifted.positions[t[k] as usize], lifted.positions[t[(k + 1) % 3] as usize]) / 0.05;
            assert!((0.5..1.75).contains(&l), "{l}");
        }
    }
}

/// The unit square as a grid with its four sides as curves, meshed to the lengths `tensor` wants along them.
fn square(n: usize, tensor: &dyn Fn(Vec3) -> [f64; 6]) -> (Patch, Vec<Vec2>, Vec<(Vec<u32>, CurveMesh)>) {
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let uv: Vec<Vec2> = (0..=n).flat_map(|j| (0..=n).map(move |i| [i as f64 / n as f64, j as f64 / n as f64])).collect();
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
        triangles.extend(if (i + j) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
    }
    let sides: Vec<Vec<u32>> = vec![
        (0..=n).map(|i| at(i, 0)).collect(),
        (0..=n).map(|j| at(n, j)).collect(),
        (0..=n).rev().map(|i| at(i, n)).collect(),
        (0..=n).rev().map(|j| at(0, j)).collect(),
    ];
    let ring = sides.iter().flat_map(|s| s[..n].iter().copied()).collect();
    let patch = Patch { positions: uv.iter().map(|p| flat(*p)).collect(), triangles, loops: vec![ring] };
    let cancel = CancelToken::new();
    let meshed = |path: Vec<u32>| {
        let points: Vec<Vec3> = path.iter().map(|&v| patch.positions[v as usize]).collect();
        let along = crate::vector::unit(crate::vector::sub(points[n], points[0]));
        let sizes = points.iter().map(|p| 1.0 / squared_length(&tensor(*p), along).sqrt()).collect();
        let polyline = CurvePolyline { points, sizes, closed: false, kind: CurveKind::Boundary, min_edges: 1, locked: Vec::new() };
        let mesh = mesh_curve(&polyline, &Work::silent(&cancel)).unwrap();
        (path, mesh)
    };
    let curves = sides.into_iter().map(meshed).collect();
    (patch, uv, curves)
}

/// Lengths `along` in the direction of an angle and `across` at right angles to it.
fn tensor(angle: f64, along: f64, across: f64) -> [f64; 6] {
    let (sin, cos) = angle.sin_cos();
    let (a, b) = (along.powi(-2), across.powi(-2));
    [a * cos * cos + b * sin * sin, (a - b) * sin * cos, 0.0, a * sin * sin + b * cos * cos, 0.0, 0.0]
}

/// Elements made over those wanted (area in the metric), efficiency index and share of edges within a factor of sqrt 2.
fn fit(tensor: &dyn Fn(Vec3) -> [f64; 6]) -> (f64, f64, f64) {
    let n = 100;
    let (patch, uv, curves) = square(n, tensor);
    let corners: Vec<[[f64; 6]; 3]> = patch.triangles.iter().map(|t| t.map(|v| tensor(patch.positions[v as usize]))).collect();
    let density = |t: &[f64; 6]| (t[0] * t[3] - t[1] * t[1]).sqrt();
    let wanted: f64 =
        corners.iter().map(|c| c.iter().map(density).sum::<f64>() / 3.0 * 0.5 / (n * n) as f64).sum::<f64>() / (0.25 * 3f64.sqrt());
    let eigen = |p: &Vec3| {
        let t = tensor(*p);
        let (mean, half) = (0.5 * (t[0] + t[3]), 0.5 * (t[0] - t[3]));
        1.0 / (mean + half.hypot(t[1])).sqrt()
    };
    let sizes: Vec<f64> = patch.positions.iter().map(eigen).collect();
    let lengths = Lengths { vertex_size: &sizes, tensors: Some(&corners) };
    let cancel = CancelToken::new();
    let uses = uses(&curves);
    let planar = mesh_chart_in(&patch, &chart(uv), &uses, &lengths, Mesher::Anisotropic, &Work::silent(&cancel)).unwrap();
    let lifted = lift(&patch, &planar, &uses);
    assert_counter_clockwise(&planar);
    let topology = Topology::build(&planar.triangles, planar.uv.len()).unwrap();
    assert_eq!((topology.components.len(), topology.components[0].euler(), topology.loops.len()), (1, 1, 1));
    assert_eq!(topology.loops[0].len(), curves.iter().map(|c| c.1.points.len() - 1).sum::<usize>());
    let (mut sum, mut fine, mut count) = (0.0, 0, 0);
    for t in &lifted.triangles {
        for k in 0..3 {
            let (a, b) = (lifted.positions[t[k] as usize], lifted.positions[t[(k + 1) % 3] as usize]);
            let e = crate::vector::sub(b, a);
            let l = (0..8).map(|i| squared_length(&tensor(crate::vector::lerp(a, b, (i as f64 + 0.5) / 8.0)), e).sqrt() / 8.0).sum::<f64>();
            sum += if l < 1.0 { l - 1.0 } else { 1.0 / l - 1.0 };
            fine += usize::from((0.5f64.sqrt()..2f64.sqrt()).contains(&l));
            count += 1;
        }
    }
    (lifted.triangles.len() as f64 / wanted, 100.0 * (sum / count as f64).exp(), fine as f64 / count as f64)
}

#[test]
fn a_constant_metric_gets_the_elements_it_asks_for() {
    for (angle, stretch) in [(0.0, 1.0), (0.5, 4.0), (1.0, 10.0), (2.5, 20.0)] {
        let (elements, tau, fine) = fit(&|_| tensor(angle, 0.012 * stretch, 0.012));
        println!("angle {angle} stretch {stretch}: elements {elements:.3} tau {tau:.2} fine {fine:.4}");
        assert!((0.85..1.2).contains(&elements) && tau > 88.0 && fine > 0.95, "{angle} {stretch}: {elements} {tau} {fine}");
    }
}

#[test]
fn metrics_that_turn_and_grow_are_followed() {
    // Rings around a point outside; a layer along one side whose height grows from 0.004; a layer along a circle.
    let rings = |p: Vec3| tensor((p[1] + 0.3).atan2(p[0] + 0.2), 0.015, 0.09);
    let layer = |p: Vec3| tensor(0.0, 0.06, 0.004 + 0.1 * p[1]);
    let circle = |p: Vec3| {
        let (x, y) = (p[0] - 0.5, p[1] - 0.5);
        tensor(y.atan2(x), 0.006 + 0.1 * (x.hypot(y) - 0.3).abs(), 0.06)
    };
    let cases: [(&str, &dyn Fn(Vec3) -> [f64; 6]); 3] = [("rings", &rings), ("layer", &layer), ("circle", &circle)];
    for (name, metric) in cases {
        let (elements, tau, fine) = fit(metric);
        println!("{name}: elements {elements:.3} tau {tau:.2} fine {fine:.4}");
        assert!((0.8..1.3).contains(&elements) && tau > 80.0 && fine > 0.75, "{name}: {elements} {tau} {fine}");
    }
}
