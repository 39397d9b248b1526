//! Tests on generated surfaces: what is a feature, what is noise, what is a corner.

use super::*;
use crate::error::Reason;
use crate::vector::Vec3;
use crate::work::CancelToken;

fn detect(mesh: &SurfaceMesh, spec: &FeatureSpec) -> Result<(Topology, Features)> {
    let topology = Topology::build(&mesh.triangles, mesh.positions.len())?;
    let token = CancelToken::new();
    let features = detect_features(mesh, &topology, spec, &Work::silent(&token))?;
    Ok((topology, features))
}

/// A grid of n x n squares over the unit square, lifted by `height`.
fn sheet(n: u32, height: impl Fn(f64, f64) -> f64) -> SurfaceMesh {
    let at = |i: u32, j: u32| j * (n + 1) + i;
    let mut positions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            positions.push([x, y, height(x, y)]);
        }
    }
    let squares = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
    let triangles =
        squares.flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]).collect();
    SurfaceMesh::from_parts(positions, triangles)
}

fn edges(topology: &Topology, features: &Features) -> usize {
    (0..topology.halfedge_count() as u32)
        .inspect(|&h| match topology.twin(h) {
            Some(t) => assert_eq!(features.is_feature[h as usize], features.is_feature[t as usize]),
            None => assert!(!features.is_feature[h as usize]),
        })
        .filter(|&h| features.is_feature[h as usize] && topology.is_edge_representative(h))
        .count()
}

#[test]
fn a_fold_is_a_feature_with_corners_at_its_ends() {
    let mesh = sheet(12, |x, _| (x - 0.5).abs());
    let (topology, features) = detect(&mesh, &FeatureSpec::default()).unwrap();
    assert_eq!(edges(&topology, &features), 12);
    // The four corners of the sheet and the two ends of the fold (every fourth vertex of a row of 13 is not: 6 is the middle).
    assert_eq!(features.corners, [0, 6, 12, 12 * 13, 12 * 13 + 6, 12 * 13 + 12]);
    let steep = FeatureSpec { feature_angle_deg: Some(91.0), ..FeatureSpec::default() };
    let (topology, features) = detect(&mesh, &steep).unwrap();
    assert_eq!(edges(&topology, &features), 0);
}

#[test]
fn a_spike_is_noise_and_a_box_is_not() {
    let spike = sheet(150, |x, y| if (x - 0.5).abs() + (y - 0.5).abs() < 1e-9 { 0.01 } else { 0.0 });
    let (topology, features) = detect(&spike, &FeatureSpec::default()).unwrap();
    assert_eq!(edges(&topology, &features), 0);
    let keep_all = FeatureSpec { min_chain_share: 0.0, ..FeatureSpec::default() };
    let (topology, features) = detect(&spike, &keep_all).unwrap();
    assert!(edges(&topology, &features) > 0);
    let plateau = sheet(60, |x, y| if (x - 0.5).abs().max((y - 0.5).abs()) < 0.2501 { 0.05 } else { 0.0 });
    let (topology, features) = detect(&plateau, &FeatureSpec::default()).unwrap();
    // The rim of the plateau (30 edges a side) and its foot.
    assert!(edges(&topology, &features) >= 4 * 30 + 4 * 30);
}

#[test]
fn degenerate_slivers_make_no_features() {
    // Three nearly collinear points in a plane; the middle one is off the plane by less than the sliver is high, yet enough to
    // turn the sliver's normal by more than 45 degrees.
    let h = 1e-7;
    let positions: Vec<Vec3> = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, h, 3.0 * h], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]];
    let mesh = SurfaceMesh::from_parts(positions, vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 4]]);
    let spec = FeatureSpec { min_chain_share: 0.0, ..FeatureSpec::default() };
    let (topology, features) = detect(&mesh, &spec).unwrap();
    assert_eq!(edges(&topology, &features), 0);
    // Folded along the sliver, one chain runs past it.
    let mut folded = mesh;
    folded.positions[4] = [1.0, -1.0, -2.0];
    let (topology, features) = detect(&folded, &spec).unwrap();
    assert!((1..=2).contains(&edges(&topology, &features)));
}

#[test]
fn region_borders_and_explicit_edges_are_kept_whatever_their_length() {
    let mut mesh = sheet(10, |_, _| 0.0);
    for f in 0..mesh.triangles.len() {
        mesh.face_region[f] = u32::from(f == 90 || f == 91);
    }
    mesh.regions.push(mesh.regions[0].clone());
    let (topology, features) = detect(&mesh, &FeatureSpec::default()).unwrap();
    assert_eq!(edges(&topology, &features), 4);
    let ignore = FeatureSpec { region_borders: RegionBorders::Ignore, explicit_edges: vec![[13, 12]], ..FeatureSpec::default() };
    let (topology, features) = detect(&mesh, &ignore).unwrap();
    assert_eq!(edges(&topology, &features), 1);
    assert!(features.corners.contains(&12) && features.corners.contains(&13));
    for wrong in [[0, 5], [0, 4000]] {
        let spec = FeatureSpec { explicit_edges: vec![wrong], ..FeatureSpec::default() };
        assert_eq!(detect(&mesh, &spec).unwrap_err().reason(), Reason::BadParameter);
    }
    let boundary = FeatureSpec { region_borders: RegionBorders::Ignore, explicit_edges: vec![[0, 1]], ..FeatureSpec::default() };
    let (topology, features) = detect(&mesh, &boundary).unwrap();
    assert_eq!(edges(&topology, &features), 0);
}

#[test]
fn parameters_out_of_range_are_refused() {
    let mesh = sheet(2, |_, _| 0.0);
    for spec in [
        FeatureSpec { feature_angle_deg: Some(0.0), ..FeatureSpec::default() },
        FeatureSpec { feature_angle_deg: Some(180.0), ..FeatureSpec::default() },
        FeatureSpec { feature_angle_deg: Some(f64::NAN), ..FeatureSpec::default() },
        FeatureSpec { min_chain_share: -1.0, ..FeatureSpec::default() },
    ] {
        assert_eq!(detect(&mesh, &spec).unwrap_err().reason(), Reason::BadParameter);
    }
}

#[test]
fn a_staircase_boundary_has_no_corners_on_its_steps() {
    // The half of a grid below its diagonal: the diagonal side is a staircase.
    let n = 20;
    let full = sheet(n, |_, _| 0.0);
    let below: Vec<[u32; 3]> = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .filter(|(i, j)| i + j < n)
        .flat_map(|(i, j)| [2 * (j * n + i), 2 * (j * n + i) + 1])
        .map(|f| full.triangles[f as usize])
        .collect();
    let mut used: Vec<u32> = below.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let local = |v: u32| used.iter().position(|&u| u == v).unwrap() as u32;
    let mesh =
        SurfaceMesh::from_parts(used.iter().map(|&v| full.positions[v as usize]).collect(), below.iter().map(|t| t.map(local)).collect());
    let (_, features) = detect(&mesh, &FeatureSpec::default()).unwrap();
    assert!(features.corners.contains(&0), "the right angle");
    assert!(features.corners.len() <= 7, "only the three sharp ends, not the 20 steps: {:?}", features.corners);
}

mod compounds;
