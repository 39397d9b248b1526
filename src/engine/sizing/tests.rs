//! Size fields on a flat grid, against closed forms.

mod fields;

use super::*;
use crate::work::CancelToken;

/// A strip of `n` cells of side 1.
fn strip(n: u32) -> (SurfaceMesh, Topology, Features) {
    let positions = (0..=n).flat_map(|i| [[f64::from(i), 0.0, 0.0], [f64::from(i), 1.0, 0.0]]).collect();
    let triangles: Vec<[u32; 3]> = (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
    let topology = Topology::build(&triangles, 2 * n as usize + 2).unwrap();
    let features = Features { is_feature: vec![false; topology.halfedge_count()], corners: Vec::new(), ..Features::default() };
    (SurfaceMesh::from_parts(positions, triangles), topology, features)
}

fn evaluate(spec: &SizeSpec) -> Result<SizeField> {
    let (mesh, topology, features) = strip(40);
    let cancel = CancelToken::new();
    let input = SizeInput { mesh: &mesh, topology: &topology, features: &features, patch_vertices: &|_| None, measured: &[] };
    evaluate_size(&input, spec, &Work::silent(&cancel))
}

#[test]
fn uniform_and_count() {
    assert_eq!(evaluate(&SizeSpec::Uniform { size: 0.5 }).unwrap().uniform, Some(0.5));
    let size = evaluate(&SizeSpec::TriangleCount { triangles: 1000 }).unwrap().uniform.unwrap();
    assert!((1000.0 * 3f64.sqrt() / 4.0 * size * size - 40.0).abs() < 1e-9);
}

#[test]
fn curves_of_a_surface_narrower_than_its_elements_count() {
    let positions = vec![[0.0, 0.0, 0.0], [1e9, 0.0, 0.0], [0.0, 1e-3, 0.0], [1e9, 1e-3, 0.0]];
    let mesh = SurfaceMesh::from_parts(positions, vec![[0, 1, 2], [1, 3, 2]]);
    let topology = Topology::build(&mesh.triangles, 4).unwrap();
    let features = Features { is_feature: vec![false; 6], ..Features::default() };
    let input = SizeInput { mesh: &mesh, topology: &topology, features: &features, patch_vertices: &|_| None, measured: &[] };
    let token = CancelToken::new();
    let evaluate = |spec: &SizeSpec| evaluate_size(&input, spec, &Work::silent(&token));
    // Two sides of 1e9, half an element of each counted: 500 triangles are 500 elements of 2e6 a side.
    let field = evaluate(&SizeSpec::TriangleCount { triangles: 500 }).unwrap();
    assert!((field.vertex_size[0] / 2e6 - 1.0).abs() < 1e-9, "{}", field.vertex_size[0]);
    let composed = ComposedSize { base: SizeBase::Triangles(500), ..ComposedSize::default() };
    let field = evaluate(&SizeSpec::Composed(composed)).unwrap();
    assert!((field.vertex_size[0] / 2e6 - 1.0).abs() < 0.01, "{}", field.vertex_size[0]);
    // By the area alone one triangle were enough.
    assert_eq!(evaluate(&SizeSpec::Uniform { size: 10.0 }).unwrap_err().reason(), Reason::LimitReached);
}

#[test]
fn growth_follows_the_distance_law() {
    let mut sizes = vec![50.0; 82];
    sizes[0] = 0.2;
    let spec = SizeSpec::PerVertex { sizes, min_size: Some(0.1), max_size: Some(3.0), growth_rate: Some(1.3) };
    let field = evaluate(&spec).unwrap().vertex_size;
    for i in 0..=40 {
        let bound = (0.2 + 1.3f64.ln() * i as f64).min(3.0);
        assert!((field[2 * i] - bound).abs() < 1e-12, "{i}: {} {bound}", field[2 * i]);
    }
    let flat = SizeSpec::PerVertex { sizes: vec![0.7; 82], min_size: None, max_size: None, growth_rate: Some(1.0) };
    assert_eq!(evaluate(&flat).unwrap().uniform, Some(0.7));
}

#[test]
fn graded_is_finest_on_curves() {
    let field = evaluate(&SizeSpec::Graded { min_size: 0.3, max_size: 2.0, growth_rate: 1.2 }).unwrap();
    // Every vertex of a strip is on the boundary.
    assert_eq!(field.uniform, Some(0.3));
}

#[test]
fn graded_on_a_closed_surface_starts_at_one_vertex() {
    let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]];
    let positions = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.2], [0.0, 0.0, -1.0]];
    let mesh = SurfaceMesh::from_parts(positions, triangles.to_vec());
    let topology = Topology::build(&triangles, 6).unwrap();
    let features = Features { is_feature: vec![false; 24], corners: Vec::new(), ..Features::default() };
    let cancel = CancelToken::new();
    let spec = SizeSpec::Graded { min_size: 0.1, max_size: 0.2, growth_rate: 1.5 };
    let input = SizeInput { mesh: &mesh, topology: &topology, features: &features, patch_vertices: &|_| None, measured: &[] };
    let field = evaluate_size(&input, &spec, &Work::silent(&cancel)).unwrap();
    let fine: Vec<usize> = (0..6).filter(|&v| field.vertex_size[v] == 0.1).collect();
    assert_eq!(fine, [4]);
}

#[test]
fn wrong_parameters_are_named() {
    let sizes = || vec![1.0; 82];
    let cases = [
        SizeSpec::Uniform { size: 0.0 },
        SizeSpec::Uniform { size: f64::NAN },
        SizeSpec::TriangleCount { triangles: 0 },
        SizeSpec::PerVertex { sizes: vec![1.0; 3], min_size: None, max_size: None, growth_rate: None },
        SizeSpec::PerVertex { sizes: vec![-1.0; 82], min_size: None, max_size: None, growth_rate: None },
        SizeSpec::PerVertex { sizes: sizes(), min_size: Some(2.0), max_size: Some(1.0), growth_rate: None },
        SizeSpec::PerVertex { sizes: sizes(), min_size: None, max_size: None, growth_rate: Some(0.9) },
        SizeSpec::Graded { min_size: 1.0, max_size: 0.5, growth_rate: 1.2 },
        SizeSpec::Graded { min_size: 0.5, max_size: 1.0, growth_rate: 1.0 },
    ];
    for spec in cases {
        assert_eq!(evaluate(&spec).unwrap_err().reason(), Reason::BadParameter, "{spec:?}");
    }
    assert_eq!(evaluate(&SizeSpec::Uniform { size: 1e-6 }).unwrap_err().reason(), Reason::LimitReached);
}
