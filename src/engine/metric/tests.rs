//! Algebra of tensors against definitions, metrics of surfaces with known curvature, gradation.

use super::tensor::{Frame, Sym2, eigenvalues, exp, intersect, log, square, transport};
use super::*;
use crate::curvature::curvature;
use crate::features::{FeatureSpec, detect_features};
use crate::sizing::SizeField;
use crate::topology::Topology;
use crate::vector::{cross, norm};
use crate::work::{CancelToken, Work};

/// Forms with many stretches and directions.
fn family() -> Vec<Sym2> {
    let mut all = Vec::new();
    for (i, stretch) in [1.0f64, 1.0001, 3.0, 50.0, 1e4].into_iter().enumerate() {
        for j in 0..7 {
            let (sin, cos) = (0.45 * f64::from(j) + 0.1 * i as f64).sin_cos();
            let (x, y) = (3f64.powi(j - 3), 3f64.powi(j - 3) / stretch);
            all.push([x * cos * cos + y * sin * sin, (x - y) * sin * cos, x * sin * sin + y * cos * cos]);
        }
    }
    all
}

fn close(a: Sym2, b: Sym2, tolerance: f64) -> bool {
    let size = a[0].abs() + a[2].abs();
    (0..3).all(|k| (a[k] - b[k]).abs() <= tolerance * size)
}

#[test]
fn exponential_undoes_logarithm() {
    for m in family() {
        assert!(close(m, exp(log(m)), 1e-10), "{m:?} {:?}", exp(log(m)));
    }
    assert!(close(exp([0.0, 0.0, 0.0]), [1.0, 0.0, 1.0], 1e-15));
}

#[test]
fn an_intersection_asks_for_no_longer_lengths() {
    for m in family() {
        for n in family() {
            let both = intersect(m, n);
            for j in 0..24 {
                let (sin, cos) = (f64::from(j) * 0.131).sin_cos();
                let d = [cos, sin];
                assert!(square(both, d) >= square(m, d).max(square(n, d)) * (1.0 - 1e-6), "{m:?} {n:?}");
            }
            // In the directions conjugate to both it asks for no more than needed: the determinant is bounded by the larger ones.
            assert!(close(intersect(both, m), both, 1e-6) && close(intersect(both, n), both, 1e-6));
        }
        assert!(close(intersect(m, m), m, 1e-9));
        assert!(close(intersect(m, m.map(|x| 0.3 * x)), m, 1e-9));
    }
}

#[test]
fn transport_keeps_eigenvalues_and_turns_with_the_plane() {
    for (i, m) in family().into_iter().enumerate() {
        let at = |k: f64| crate::vector::unit([(0.7 * k).sin(), (1.3 * k).cos(), 1.1]);
        let (from, to) = (Frame::of(at(i as f64)), Frame::of(at(i as f64 + 0.8)));
        let there = transport(&from, m, &to);
        let (a, b) = (eigenvalues(m), eigenvalues(there));
        assert!((a[0] - b[0]).abs() < 1e-9 * a[0] && (a[1] - b[1]).abs() < 1e-9 * a[0]);
        // The axis of the turn keeps its length.
        let axis = cross(from.normal(), to.normal());
        assert!(norm(axis) > 0.0);
        let (p, q) = (square(m, from.coordinates(axis)), square(there, to.coordinates(axis)));
        assert!((p - q).abs() < 1e-9 * a[0]);
    }
}

/// A cylinder of radius 1 around z, open, `n` segments around and `rows` along its length.
fn cylinder(n: u32, rows: u32, length: f64) -> SurfaceMesh {
    let mut positions = Vec::new();
    for j in 0..=rows {
        for i in 0..n {
            let a = std::f64::consts::TAU * (f64::from(i) + 0.5 * f64::from(j % 2)) / f64::from(n);
            positions.push([a.cos(), a.sin(), length * f64::from(j) / f64::from(rows)]);
        }
    }
    let mut triangles = Vec::new();
    for (j, i) in (0..rows).flat_map(|j| (0..n).map(move |i| (j, i))) {
        let at = |i: u32, j: u32| j * n + i % n;
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
        triangles.extend(if j % 2 == 0 { [[a, b, c], [b, d, c]] } else { [[a, b, d], [a, d, c]] });
    }
    SurfaceMesh::from_parts(positions, triangles)
}

fn metric_of(mesh: &SurfaceMesh, spec: &MetricSpec, size: f64) -> Result<(Topology, SurfaceMetric)> {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let topology = Topology::build(&mesh.triangles, mesh.positions.len())?;
    let features = detect_features(mesh, &topology, &FeatureSpec::default(), &work)?;
    let curvature = curvature(mesh, &topology, &features, 0, &work)?;
    let sizes = SizeField::new(vec![size; mesh.positions.len()]);
    let metric = evaluate_metric(mesh, &topology, &features, &curvature, &sizes, spec, &work)?;
    Ok((topology, metric))
}

#[test]
fn a_cylinder_is_short_around_and_long_along() {
    let mesh = cylinder(60, 40, 4.0);
    let source = MetricSource::Curvature { deviation: Some(0.005), normal_angle_deg: None };
    let spec = MetricSpec { source, max_stretch: 4.0, ..MetricSpec::default() };
    let (_, metric) = metric_of(&mesh, &spec, 10.0).unwrap();
    let around = (6.0 * 0.005f64).sqrt();
    for v in 0..mesh.positions.len() as u32 {
        let p = mesh.positions[v as usize];
        let (h, l) = (metric.length_along(v, [-p[1], p[0], 0.0]), metric.length_along(v, [0.0, 0.0, 1.0]));
        assert!((h / around - 1.0).abs() < 0.03, "{h} {around}");
        assert!((l / (4.0 * around) - 1.0).abs() < 0.05, "{l}");
    }
    let bounded = MetricSpec { min_size: Some(0.3), max_size: Some(0.5), ..spec };
    let (_, metric) = metric_of(&mesh, &bounded, 10.0).unwrap();
    assert!((metric.length_along(100, [0.0, 0.0, 1.0]) - 0.5).abs() < 1e-9);
    assert!((metric.smallest_length(100) - 0.3).abs() < 1e-9);
}

#[test]
fn growth_is_bounded() {
    let mesh = cylinder(60, 60, 6.0);
    // Short elements at one end only.
    let of = |p: &[f64; 3]| {
        let w: f64 = if p[2] < 0.3 { 1.0 / 0.0025 } else { 1.0 };
        [w, 0.0, 0.0, w, 0.0, w]
    };
    let tensors = Arc::new(mesh.positions.iter().map(of).collect());
    let spec = MetricSpec { source: MetricSource::PerVertex { tensors }, growth_rate: Some(1.3), ..MetricSpec::default() };
    let (topology, metric) = metric_of(&mesh, &spec, 10.0).unwrap();
    for h in 0..topology.halfedge_count() as u32 {
        let (a, b) = (topology.origin(h), topology.target(h));
        let e = crate::vector::distance(mesh.positions[a as usize], mesh.positions[b as usize]);
        let (x, y) = (metric.smallest_length(a), metric.smallest_length(b));
        assert!(y <= (x + e * 1.3f64.ln()) * 1.03, "{x} {y} {e}");
    }
    assert!(metric.smallest_length(0) < 0.0501);
    let last = metric.smallest_length(mesh.positions.len() as u32 - 1);
    assert!((0.9..=1.0001).contains(&last), "{last}");
}

#[test]
fn a_feature_is_agreed_upon() {
    // The rim of a capped cylinder: the flat cap takes over the length that the side wants along it.
    let mut mesh = cylinder(48, 12, 3.0);
    let centre = mesh.positions.len() as u32;
    mesh.positions.push([0.0, 0.0, 0.0]);
    (0..48).for_each(|i| mesh.triangles.push([centre, (i + 1) % 48, i]));
    let mesh = SurfaceMesh::from_parts(mesh.positions, mesh.triangles);
    let spec = MetricSpec { growth_rate: None, max_stretch: 20.0, ..MetricSpec::default() };
    let (_, metric) = metric_of(&mesh, &spec, 1.0).unwrap();
    let around = 2.0 * 10f64.to_radians().sin();
    let p = mesh.positions[5];
    let tangent = [-p[1], p[0], 0.0];
    assert_eq!(metric.sectors.of_vertex(5).len(), 2);
    for s in metric.sectors.of_vertex(5) {
        let d = metric.frames[s].coordinates(tangent);
        let length = 1.0 / square(metric.forms[s], d).sqrt();
        assert!((length / around - 1.0).abs() < 0.1, "{length} {around}");
    }
}

#[test]
fn bad_metrics_are_named() {
    let mesh = cylinder(12, 4, 1.0);
    let refused = |spec: MetricSpec| metric_of(&mesh, &spec, 1.0).err().map(|e| format!("{} {:?}", e.message(), e.metadata()));
    let tensors = |t: [f64; 6], n: usize| MetricSource::PerVertex { tensors: Arc::new(vec![t; n]) };
    let n = mesh.positions.len();
    let cases = [
        MetricSpec { max_stretch: 0.5, ..MetricSpec::default() },
        MetricSpec { growth_rate: Some(1.0), ..MetricSpec::default() },
        MetricSpec { min_size: Some(2.0), max_size: Some(1.0), ..MetricSpec::default() },
        MetricSpec { source: MetricSource::Curvature { deviation: None, normal_angle_deg: None }, ..MetricSpec::default() },
        MetricSpec { source: MetricSource::Curvature { deviation: Some(-1.0), normal_angle_deg: None }, ..MetricSpec::default() },
        MetricSpec { source: tensors([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], n - 1), ..MetricSpec::default() },
        MetricSpec { source: tensors([-1.0, 0.0, 0.0, 1.0, 0.0, 1.0], n), ..MetricSpec::default() },
        MetricSpec { source: tensors([f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0], n), ..MetricSpec::default() },
    ];
    for spec in cases {
        assert!(refused(spec.clone()).is_some(), "{spec:?}");
    }
    let fine = MetricSpec { source: tensors([1e12, 0.0, 0.0, 1e12, 0.0, 1e12], n), ..MetricSpec::default() };
    assert!(refused(fine).is_some_and(|m| m.contains("limit")));
}
