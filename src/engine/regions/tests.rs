//! Regions of a finer or coarser mesh over a plate of stripes.

use super::*;
use crate::mesh::Region;
use crate::work::CancelToken;

/// A plate of n x n squares over the unit square; `region` of each face by its centroid.
fn plate(n: u32, regions: u32, region: impl Fn([f64; 3]) -> u32) -> SurfaceMesh {
    let at = |i: u32, j: u32| j * (n + 1) + i;
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| [f64::from(i) / f64::from(n), f64::from(j) / f64::from(n), 0.0])).collect();
    let squares = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
    let triangles =
        squares.flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]).collect();
    let mut mesh = SurfaceMesh::from_parts(positions, triangles);
    mesh.regions = (0..regions).map(|r| Region { id: i64::from(r) + 1, name: format!("face {r}") }).collect();
    mesh.face_region = (0..mesh.triangles.len()).map(|f| region(centroid(&mesh, f))).collect();
    mesh
}

fn assign(input: &SurfaceMesh, output: &mut SurfaceMesh, freedom: RegionFreedom<'_>) -> Vec<u32> {
    let token = CancelToken::new();
    let bvh = TriangleBvh::build(&input.positions, &input.triangles);
    assign_regions(input, &bvh, output, &[], freedom, &Work::silent(&token)).unwrap()
}

#[test]
fn regions_follow_the_input_below_them() {
    let input = plate(30, 3, |c| (c[0] * 2.99) as u32);
    let mut output = plate(17, 3, |_| 0);
    let all = Compounds { group: vec![0; 3], list: Vec::new() };
    assert_eq!(assign(&input, &mut output, RegionFreedom::new(&all, RegionBorders::Keep)), Vec::<u32>::new());
    for f in 0..output.triangles.len() {
        let c = centroid(&output, f);
        let (low, high) = (((c[0] - 0.06) * 3.0).max(0.0) as u32, (((c[0] + 0.06) * 3.0) as u32).min(2));
        assert!((low..=high).contains(&output.face_region[f]), "{c:?} has {}", output.face_region[f]);
    }
    let topology = Topology::build(&output.triangles, output.positions.len()).unwrap();
    let ragged = (0..output.triangles.len()).filter(|&f| {
        let other = (3 * f as u32..3 * f as u32 + 3)
            .filter_map(|h| topology.twin(h))
            .filter(|&t| output.face_region[topology.face(t) as usize] != output.face_region[f]);
        other.count() > 1
    });
    assert_eq!(ragged.count(), 0, "no face is surrounded by another region");
}

#[test]
fn regions_of_other_compounds_keep_their_faces() {
    let input = plate(30, 3, |c| (c[0] * 2.99) as u32);
    let mut output = plate(16, 3, |c| if c[0] < 0.5 { 0 } else { 2 });
    let some = Compounds { group: vec![0, 0, 2], list: Vec::new() };
    assign(&input, &mut output, RegionFreedom::new(&some, RegionBorders::Keep));
    for f in 0..output.triangles.len() {
        assert_eq!(output.face_region[f] == 2, centroid(&output, f)[0] > 0.5);
    }
    assert!(output.face_region.contains(&1));
}

#[test]
fn a_strip_thinner_than_elements_keeps_its_name_and_a_speck_is_told() {
    // A strip of width 1/40 across the middle, and one face of a corner.
    let input = plate(40, 3, |c| {
        if (c[1] - 0.5125).abs() < 0.0125 {
            1
        } else if c[0] + 2.0 * c[1] < 0.035 {
            2
        } else {
            0
        }
    });
    assert_eq!(input.face_region.iter().filter(|&&r| r == 2).count(), 1);
    let mut output = plate(8, 3, |_| 0);
    let all = Compounds { group: vec![0; 3], list: Vec::new() };
    let lost = assign(&input, &mut output, RegionFreedom::new(&all, RegionBorders::Keep));
    assert_eq!(lost, [2]);
    let strip = output.face_region.iter().filter(|&&r| r == 1).count();
    // Area 1/40 of the plate; a face has 1/128.
    assert!((2..=4).contains(&strip), "{strip}");
}
