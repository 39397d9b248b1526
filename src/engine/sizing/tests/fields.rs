//! Each kind of field against closed forms, and how they compose.

use super::super::*;
use crate::bvh::TriangleBvh;
use crate::features::FeatureSpec;
use crate::vector::{Vec3, norm};
use crate::work::CancelToken;
use std::f64::consts::TAU;
use std::sync::Arc;

struct Model {
    mesh: SurfaceMesh,
    topology: Topology,
    features: Features,
}

fn model(mesh: SurfaceMesh) -> Model {
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let cancel = CancelToken::new();
    let features = crate::features::detect_features(&mesh, &topology, &FeatureSpec::default(), &Work::silent(&cancel)).unwrap();
    Model { mesh, topology, features }
}

fn try_evaluate(model: &Model, spec: ComposedSize) -> Result<SizeField> {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let Model { mesh, topology, features } = model;
    let tree = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    let taken: Vec<Option<Measured>> =
        spec.fields.iter().map(|f| f.measure().map(|m| measure(mesh, topology, features, Some(&tree), m, &work).unwrap())).collect();
    let measured: Vec<Option<&Measured>> = taken.iter().map(Option::as_ref).collect();
    let own = [0u32, 1];
    let patch_vertices = |identity: Fingerprint| (identity == Fingerprint([7; 16])).then_some(own.as_slice());
    let input = SizeInput { mesh, topology, features, patch_vertices: &patch_vertices, measured: &measured };
    evaluate_size(&input, &SizeSpec::Composed(spec), &work)
}

fn evaluate(model: &Model, spec: ComposedSize) -> Vec<f64> {
    try_evaluate(model, spec).unwrap().vertex_size
}

fn coarse(fields: Vec<SizeFieldSpec>) -> ComposedSize {
    ComposedSize { base: SizeBase::Uniform(100.0), fields, min_size: Some(1e-3), max_size: None, growth_rate: None }
}

/// A grid of `n` by `m` cells, taken to space by `place` of [0, 1]^2; the columns may close.
fn sheet(n: u32, m: u32, closed: bool, place: impl Fn(f64, f64) -> Vec3) -> SurfaceMesh {
    let columns = if closed { n } else { n + 1 };
    let grid = |j: u32| (0..columns).map(move |i| (i, j));
    let positions = (0..=m).flat_map(grid).map(|(i, j)| place(f64::from(i) / f64::from(n), f64::from(j) / f64::from(m))).collect();
    let at = |i: u32, j: u32| j * columns + i % columns;
    let cells = (0..m).flat_map(|j| (0..n).map(move |i| (i, j)));
    let split = |(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    SurfaceMesh::from_parts(positions, cells.flat_map(split).collect())
}

fn square() -> SurfaceMesh {
    sheet(20, 20, false, |u, v| [u, v, 0.0])
}

fn tube(r: f64, length: f64) -> SurfaceMesh {
    sheet(48, 60, true, move |u, v| [r * (TAU * u).cos(), r * (TAU * u).sin(), length * v])
}

fn joined(a: SurfaceMesh, b: SurfaceMesh) -> SurfaceMesh {
    let first = a.positions.len() as u32;
    let triangles = a.triangles.into_iter().chain(b.triangles.into_iter().map(|t| t.map(|v| v + first))).collect();
    SurfaceMesh::from_parts(a.positions.into_iter().chain(b.positions).collect(), triangles)
}

fn proximity(elements_per_gap: f64, sides: Sides, reach: Option<f64>) -> SizeFieldSpec {
    SizeFieldSpec::Proximity(ProximitySize { elements_per_gap, sides, reach })
}

/// The unit square below its mirror image at height `g`, which look at each other.
fn plates(g: f64) -> Model {
    model(joined(square(), sheet(17, 13, false, move |u, v| [v, u, g])))
}

#[test]
fn gap_of_two_plates_over_its_elements() {
    let plates = plates(0.25);
    for (sides, expected) in [(Sides::Both, 0.25 / 4.0), (Sides::Outside, 0.25 / 4.0), (Sides::Inside, 100.0)] {
        let sizes = evaluate(&plates, coarse(vec![proximity(4.0, sides, None)]));
        assert!(sizes.iter().all(|h| (h - expected).abs() < 1e-9), "{sides:?}: {sizes:?}");
    }
    let near = evaluate(&plates, coarse(vec![proximity(4.0, Sides::Both, Some(0.2))]));
    assert!(near.iter().all(|h| *h == 100.0), "beyond the reach");
}

#[test]
fn walls_of_a_tilted_wedge_face_each_other_but_those_of_a_corner_do_not() {
    let wedge = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        // Two squares that share no vertex, with the angle between them: from z = 0 upwards.
        model(joined(square(), sheet(20, 20, false, move |u, v| [v * cos + 0.01, u, v * sin + 0.01])))
    };
    let sizes = |angle: f64| evaluate(&wedge(angle), coarse(vec![proximity(1.0, Sides::Outside, None)]));
    let narrow = sizes(0.5);
    assert!(narrow.iter().filter(|h| **h < 1.0).count() > 700);
    assert!(sizes(1.4).iter().all(|h| *h == 100.0));
}

#[test]
fn radius_and_thickness_of_a_tube() {
    let (r, length) = (0.7, 9.0);
    for look in ["outwards", "inwards"] {
        let mut mesh = tube(r, length);
        if look == "inwards" {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        radius_and_thickness_are_those_of(&model(mesh), r);
    }
}

fn radius_and_thickness_are_those_of(tube: &Model, r: f64) {
    let around = |n| SizeFieldSpec::Centerline(CenterlineSize { lines: None, measure: CenterlineMeasure::Radius, elements_around: n });
    for h in evaluate(tube, coarse(vec![around(24.0)])) {
        assert!((h * 24.0 / TAU / r - 1.0).abs() < 0.03, "radius {}", h * 24.0 / TAU);
    }
    for h in evaluate(tube, coarse(vec![SizeFieldSpec::Thickness { elements: 5.0 }])) {
        assert!((h * 5.0 / (2.0 * r) - 1.0).abs() < 0.1, "thickness {}", h * 5.0);
    }
    for h in evaluate(tube, coarse(vec![proximity(3.0, Sides::Inside, None)])) {
        assert!((h * 3.0 / (2.0 * r) - 1.0).abs() < 0.01, "gap {}", h * 3.0);
    }
}

#[test]
fn given_centerlines_tell_radius_and_distance() {
    let tube = model(tube(0.5, 4.0));
    let line = Centerline { points: vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 5.0]], radii: vec![1.0, 1.0, 3.0] };
    let field = |measure| {
        let lines = Some(Arc::new(vec![line.clone()]));
        coarse(vec![SizeFieldSpec::Centerline(CenterlineSize { lines, measure, elements_around: 10.0 })])
    };
    let (radius, distance) = (evaluate(&tube, field(CenterlineMeasure::Radius)), evaluate(&tube, field(CenterlineMeasure::Distance)));
    for (v, p) in tube.mesh.positions.iter().enumerate() {
        let expected = 1.0 + 0.5 * (p[2] - 1.0).max(0.0);
        assert!((radius[v] * 10.0 / TAU - expected).abs() < 1e-9 && (distance[v] * 10.0 / TAU - 0.5).abs() < 1e-9);
    }
}

#[test]
fn shapes_hold_exactly_what_is_inside() {
    let square = model(square());
    let shapes = [
        Shape::Box { low: [0.25, 0.5, -1.0], high: [0.5, 1.0, 0.0] },
        Shape::Sphere { center: [0.5, 0.5, 0.0], radius: 0.25 },
        Shape::Cylinder { start: [0.25, 0.5, 0.0], end: [0.75, 0.5, 0.0], radius: 0.125 },
    ];
    let inside = |shape: &Shape, p: Vec3| match shape {
        Shape::Box { low, high } => (0..3).all(|k| low[k] <= p[k] && p[k] <= high[k]),
        Shape::Sphere { center, radius } => norm(std::array::from_fn(|k| p[k] - center[k])) <= *radius,
        Shape::Cylinder { start, end, radius } => start[0] <= p[0] && p[0] <= end[0] && (p[1] - 0.5).abs() <= *radius,
    };
    for shape in shapes {
        let field = |growth_rate| SizeFieldSpec::Shape(ShapeSize { shape, size: 0.5, growth_rate });
        let (hard, soft) = (evaluate(&square, coarse(vec![field(None)])), evaluate(&square, coarse(vec![field(Some(1.5))])));
        let mut count = 0;
        for (v, p) in square.mesh.positions.iter().enumerate() {
            assert_eq!(hard[v] == 0.5, inside(&shape, *p), "{shape:?} {p:?}");
            assert_eq!(hard[v] == 100.0, !inside(&shape, *p));
            assert!((soft[v] - 0.5 - 1.5f64.ln() * shape.distance(*p)).abs() < 1e-12);
            count += usize::from(hard[v] == 0.5);
        }
        assert!(count > 20 && count < 300, "{shape:?}: {count}");
    }
    assert!((Shape::Box { low: [0.0; 3], high: [1.0; 3] }.distance([2.0, 3.0, 0.5]) - 5f64.sqrt()).abs() < 1e-15);
    let cylinder = Shape::Cylinder { start: [0.0; 3], end: [0.0, 0.0, 2.0], radius: 1.0 };
    assert!((cylinder.distance([4.0, 0.0, 6.0]) - 5.0).abs() < 1e-12 && cylinder.distance([0.5, 0.5, 1.0]) == 0.0);
}

#[test]
fn distance_from_points_curves_and_edges() {
    let square = model(square());
    let field = |from| SizeFieldSpec::Distance(DistanceSize { from, size: 0.5, reach: 0.125, growth_rate: Some(2.0) });
    let line = vec![[0.0, 0.5, 0.0], [1.0, 0.5, 0.0]];
    let cases: [(DistanceSource, fn(Vec3) -> f64); 4] = [
        (DistanceSource::Points(Arc::new(vec![[0.0; 3], [9.0; 3]])), norm),
        (DistanceSource::Polylines(Arc::new(vec![line, vec![[0.0, 7.0, 0.0]], vec![]])), |p| (p[1] - 0.5).abs()),
        (DistanceSource::Boundary, |p| p[0].min(p[1]).min(1.0 - p[0]).min(1.0 - p[1])),
        (DistanceSource::Features, |_| f64::INFINITY),
    ];
    for (from, distance) in cases {
        let sizes = evaluate(&square, coarse(vec![field(from.clone())]));
        for (h, p) in sizes.iter().zip(&square.mesh.positions) {
            let d = distance(*p);
            let expected = if d <= 0.125 { 0.5 } else { (0.5 + 2f64.ln() * (d - 0.125)).min(100.0) };
            assert!((h - expected).abs() < 1e-12, "{from:?} at {p:?}: {h} {expected}");
        }
    }
}

#[test]
fn curvature_gives_angle_and_deviation() {
    let tube = model(tube(2.0, 8.0));
    let field = |normal_angle_deg, deviation| SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg, deviation, smoothing: 0 });
    for h in evaluate(&tube, coarse(vec![field(Some(15.0), None)])) {
        assert!((h / (4.0 * 7.5f64.to_radians().sin()) - 1.0).abs() < 0.01, "{h}");
    }
    for h in evaluate(&tube, coarse(vec![field(None, Some(0.01))])) {
        // The sag of the chord.
        let sag = 2.0 - (4.0 - 0.25 * 1.44 * h * h).sqrt();
        assert!(sag <= 0.010_001 && sag > 0.0098, "{h}: {sag}");
    }
    let flat = model(square());
    assert!(evaluate(&flat, coarse(vec![field(Some(15.0), Some(1e-3))])).iter().all(|h| *h == 100.0));
}

#[test]
fn fields_compose_by_minimum_then_clamp_then_growth() {
    let square = model(square());
    let one = SizeFieldSpec::Shape(ShapeSize { shape: Shape::Sphere { center: [0.0; 3], radius: 0.5 }, size: 0.2, growth_rate: Some(1.3) });
    let many = SizeFieldSpec::PerVertex { sizes: Arc::new(square.mesh.positions.iter().map(|p| 0.1 + 0.3 * p[0]).collect()) };
    let patch = SizeFieldSpec::Patch { patch: Fingerprint([7; 16]), size: 0.05 };
    let gone = SizeFieldSpec::Patch { patch: Fingerprint([8; 16]), size: 0.001 };
    let alone: Vec<Vec<f64>> = [&one, &many, &patch].map(|f| evaluate(&square, coarse(vec![f.clone()]))).to_vec();
    let all = vec![one, many, patch, gone];
    let together = evaluate(&square, coarse(all.clone()));
    let bounded = ComposedSize { min_size: Some(0.12), max_size: Some(0.25), ..coarse(all) };
    let clamped = evaluate(&square, bounded.clone());
    let grown = evaluate(&square, ComposedSize { growth_rate: Some(1.05), ..bounded });
    for v in 0..together.len() {
        assert_eq!(together[v], alone.iter().map(|a| a[v]).fold(f64::INFINITY, f64::min));
        assert_eq!(clamped[v], together[v].clamp(0.12, 0.25));
        assert!(grown[v] <= clamped[v] && grown[v] >= 0.12);
    }
    for t in &square.mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let d = distance(square.mesh.positions[a as usize], square.mesh.positions[b as usize]);
            assert!((grown[a as usize] - grown[b as usize]).abs() <= 1.05f64.ln() * d + 1e-15);
        }
    }
    assert!(grown != clamped);
}

#[test]
fn regions_by_name_and_number() {
    let mut mesh = square();
    mesh.regions = vec![crate::mesh::Region { id: 4, name: "wall".into() }, crate::mesh::Region { id: 9, name: "inlet".into() }];
    mesh.face_region = mesh.triangles.iter().map(|t| u32::from(mesh.positions[t[0] as usize][0] > 0.49)).collect();
    let model = model(mesh);
    let on = |region| coarse(vec![SizeFieldSpec::Region { region, size: 0.1 }]);
    let by_name = evaluate(&model, on(RegionChoice::Name("inlet".into())));
    assert_eq!(by_name, evaluate(&model, on(RegionChoice::Id(9))));
    for (h, p) in by_name.iter().zip(&model.mesh.positions) {
        assert_eq!(*h == 0.1, p[0] > 0.49, "{p:?}");
    }
    let error = try_evaluate(&model, on(RegionChoice::Name("outlet".into()))).unwrap_err();
    assert!(error.metadata().contains(&("field".into(), "fields[0].region.region".into())) && error.to_string().contains("inlet"));
}

#[test]
fn a_number_of_triangles_is_met_by_the_base_or_by_coarser_fields() {
    let tube = model(tube(1.0, 6.0));
    let fields = vec![
        SizeFieldSpec::Shape(ShapeSize { shape: Shape::Sphere { center: [1.0, 0.0, 3.0], radius: 0.7 }, size: 0.05, growth_rate: None }),
        SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg: Some(30.0), deviation: None, smoothing: 2 }),
    ];
    let spec = |triangles| ComposedSize {
        base: SizeBase::Triangles(triangles),
        fields: fields.clone(),
        min_size: Some(0.01),
        max_size: None,
        growth_rate: Some(1.3),
    };
    for (triangles, scaled) in [(20_000, false), (6_000, false), (400, true)] {
        let field = try_evaluate(&tube, spec(triangles)).unwrap();
        let expected = expected_triangles(&tube.mesh, &field.vertex_size);
        assert!((expected / triangles as f64 - 1.0).abs() < 0.01, "{triangles}: {expected}");
        assert_eq!(field.fields_scaled_by > 1.0, scaled, "{}", field.fields_scaled_by);
    }
    let plain = ComposedSize { base: SizeBase::Triangles(5000), ..ComposedSize::default() };
    let field = try_evaluate(&tube, plain).unwrap();
    assert!((expected_triangles(&tube.mesh, &field.vertex_size) / 5000.0 - 1.0).abs() < 0.005 && field.uniform.is_some());
}

#[test]
fn bad_numbers_are_refused_by_name() {
    let square = model(square());
    let nan = f64::NAN;
    let shape = |shape, size| SizeFieldSpec::Shape(ShapeSize { shape, size, growth_rate: None });
    let distance = |from, size, reach| SizeFieldSpec::Distance(DistanceSize { from, size, reach, growth_rate: None });
    let line = |points, radii, n| {
        let lines = Some(Arc::new(vec![Centerline { points, radii }]));
        SizeFieldSpec::Centerline(CenterlineSize { lines, measure: CenterlineMeasure::Radius, elements_around: n })
    };
    let curved =
        |normal_angle_deg, deviation, smoothing| SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg, deviation, smoothing });
    let sphere = |radius| Shape::Sphere { center: [0.0; 3], radius };
    let cases = [
        (SizeFieldSpec::Patch { patch: Fingerprint([0; 16]), size: 0.0 }, "patch.size"),
        (SizeFieldSpec::Region { region: RegionChoice::Id(0), size: nan }, "region.size"),
        (SizeFieldSpec::PerVertex { sizes: Arc::new(vec![1.0, -1.0]) }, "per_vertex.sizes"),
        (SizeFieldSpec::PerVertex { sizes: Arc::new(vec![1.0]) }, "per_vertex.sizes"),
        (curved(None, None, 0), "curvature.normal_angle"),
        (curved(Some(180.0), None, 0), "curvature.normal_angle"),
        (curved(None, Some(f64::INFINITY), 0), "curvature.deviation"),
        (curved(Some(9.0), None, 101), "curvature.smoothing"),
        (proximity(0.0, Sides::Both, None), "proximity.elements_per_gap"),
        (proximity(1.0, Sides::Both, Some(-1.0)), "proximity.reach"),
        (SizeFieldSpec::Thickness { elements: nan }, "thickness.elements"),
        (line(vec![[0.0; 3]], vec![1.0], 0.0), "centerline.elements_around"),
        (line(vec![[0.0; 3]], vec![], 8.0), "centerline.lines[0].radii"),
        (line(vec![[0.0, nan, 0.0]], vec![1.0], 8.0), "centerline.lines[0].points"),
        (line(vec![], vec![], 8.0), "centerline.lines"),
        (shape(sphere(1.0), -1.0), "shape.size"),
        (shape(sphere(0.0), 1.0), "shape.sphere.radius"),
        (shape(Shape::Box { low: [1.0; 3], high: [0.0; 3] }, 1.0), "shape.box.low"),
        (shape(Shape::Cylinder { start: [1.0; 3], end: [1.0; 3], radius: 1.0 }, 1.0), "shape.cylinder.end"),
        (distance(DistanceSource::Points(Arc::default()), 1.0, 0.0), "distance.points"),
        (distance(DistanceSource::Boundary, 1.0, -1.0), "distance.reach"),
        (distance(DistanceSource::Polylines(Arc::new(vec![vec![[nan; 3]]])), 1.0, 0.0), "distance.polylines"),
    ];
    for (field, name) in cases {
        let error = try_evaluate(&square, coarse(vec![field])).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter, "{name}");
        assert!(error.metadata().contains(&("field".into(), format!("fields[0].{name}"))), "{name}: {:?}", error.metadata());
    }
    let bounds = |base, min_size, max_size, growth_rate| ComposedSize { base, fields: Vec::new(), min_size, max_size, growth_rate };
    for (spec, name) in [
        (bounds(SizeBase::MaxSize, None, None, None), "max_size"),
        (bounds(SizeBase::Uniform(nan), None, None, None), "uniform"),
        (bounds(SizeBase::Triangles(0), None, None, None), "triangles"),
        (bounds(SizeBase::Uniform(1.0), Some(0.0), None, None), "min_size"),
        (bounds(SizeBase::Uniform(1.0), Some(2.0), Some(1.0), None), "min_size"),
        (bounds(SizeBase::Uniform(1.0), None, None, Some(0.5)), "growth_rate"),
        (ComposedSize { min_size: None, ..coarse(vec![SizeFieldSpec::Thickness { elements: 3.0 }]) }, "min_size"),
    ] {
        let error = try_evaluate(&square, spec).unwrap_err();
        assert!(error.metadata().contains(&("field".into(), name.into())), "{name}: {error}");
    }
    let many = vec![SizeFieldSpec::Patch { patch: Fingerprint([0; 16]), size: 1.0 }; MAX_FIELDS + 1];
    assert_eq!(try_evaluate(&square, coarse(many)).unwrap_err().reason(), Reason::LimitReached);
}
