//! Compounds on prisms, whose sides are regions that meet at known angles.

use super::*;
use crate::mesh::Region;

/// The open prism of length 4 over a closed polygon, counter-clockwise; side k, from corner k to the next, is region number 10 + k.
fn prism(polygon: &[[f64; 2]]) -> SurfaceMesh {
    let (n, steps) = (polygon.len() as u32, 8);
    let place = |i: u32| polygon[(i % n) as usize];
    let positions = (0..=steps).flat_map(|j| (0..n).map(move |i| (i, j))).map(|(i, j)| [place(i)[0], place(i)[1], 0.5 * f64::from(j)]);
    let mut mesh = SurfaceMesh::from_parts(positions.collect(), Vec::new());
    for (i, j) in (0..steps).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let at = |i: u32, j: u32| j * n + i % n;
        mesh.triangles.extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
        mesh.face_region.extend([i, i]);
    }
    mesh.regions = (0..n).map(|k| Region { id: 10 + i64::from(k), name: format!("side {k}") }).collect();
    mesh
}

/// A polygon from its sides: lengths and the turns (degrees) after them; the last side closes it.
fn polygon(sides: &[(f64, f64)]) -> Vec<[f64; 2]> {
    let (mut at, mut heading) = ([0.0, 0.0], 0.0f64);
    sides
        .iter()
        .map(|&(length, turn)| {
            let here = at;
            at = [at[0] + length * heading.to_radians().cos(), at[1] + length * heading.to_radians().sin()];
            heading += turn;
            here
        })
        .collect()
}

fn with(compounds: CompoundSpec) -> FeatureSpec {
    FeatureSpec { compounds, ..FeatureSpec::default() }
}

fn groups(features: &Features) -> Vec<Vec<u32>> {
    features.compounds.list.iter().map(|c| c.regions.clone()).collect()
}

/// A square with one corner rounded in three turns of 30 degrees: sides 0, fillet 1 and 2, sides 3, 4 and 5.
fn rounded() -> SurfaceMesh {
    prism(&[[0.0, 0.0], [1.8, 0.0], [1.9732, 0.1], [2.0732, 0.2732], [2.0732, 2.0], [0.0, 2.0]])
}

#[test]
fn listed_regions_lose_the_edges_between_them_and_no_others() {
    let mesh = prism(&polygon(&[(1.0, 90.0); 4]));
    let (topology, plain) = detect(&mesh, &FeatureSpec::default()).unwrap();
    assert_eq!((edges(&topology, &plain), groups(&plain)), (4 * 8, vec![]));
    let spec = with(CompoundSpec { lists: vec![vec![11, 10]], ..CompoundSpec::default() });
    let (_, features) = detect(&mesh, &spec).unwrap();
    assert_eq!((edges(&topology, &features), groups(&features)), (3 * 8, vec![vec![0, 1]]));
    assert_eq!(features.compounds.list[0].rules, [CompoundRule::Listed]);
    assert!((0..topology.halfedge_count()).all(|h| !features.is_feature[h] || plain.is_feature[h]));
    // An edge that the user names stays, and borders that are ignored make no difference to sharp edges.
    let (_, named) = detect(&mesh, &FeatureSpec { explicit_edges: vec![[1, 5]], ..spec.clone() }).unwrap();
    assert_eq!(edges(&topology, &named), 3 * 8 + 1);
    let (_, ignored) = detect(&mesh, &FeatureSpec { region_borders: RegionBorders::Ignore, ..spec }).unwrap();
    assert_eq!(edges(&topology, &ignored), 3 * 8);
}

#[test]
fn smooth_neighbours_are_merged_along_a_fillet() {
    let by_angle = |degrees| with(CompoundSpec { merge_angle_deg: Some(degrees), ..CompoundSpec::default() });
    let octagon = prism(&polygon(&[(1.0, 45.0); 8]));
    let (_, exact) = detect(&octagon, &by_angle(45.0)).unwrap();
    assert_eq!(groups(&exact), Vec::<Vec<u32>>::new(), "45 degrees are not below 45 degrees");
    let (topology, above) = detect(&octagon, &by_angle(45.1)).unwrap();
    assert_eq!((groups(&above), edges(&topology, &above)), (vec![(0..8).collect()], 0));
    let (topology, fillet) = detect(&rounded(), &by_angle(35.0)).unwrap();
    assert_eq!((groups(&fillet), edges(&topology, &fillet)), (vec![vec![0, 1, 2, 3]], 3 * 8));
    assert_eq!(fillet.compounds.list[0].rules, [CompoundRule::Angle]);
}

#[test]
fn a_border_that_is_sharp_on_a_part_of_its_length_is_sharp() {
    // Two halves of a sheet that meet flat for y < 1/2 and at up to 45 degrees beyond.
    let mut mesh = sheet(40, |x, y| (x - 0.5).abs() * (y - 0.5).max(0.0) * 0.83);
    mesh.regions.push(Region { id: 1, name: String::new() });
    mesh.face_region = (0..mesh.triangles.len()).map(|f| u32::from(mesh.corners(f).iter().any(|c| c[0] > 0.5))).collect();
    for (degrees, merged) in [(10.0, 0), (30.0, 0), (44.0, 1)] {
        let spec = with(CompoundSpec { merge_angle_deg: Some(degrees), ..CompoundSpec::default() });
        assert_eq!(groups(&detect(&mesh, &spec).unwrap().1).len(), merged, "{degrees}");
    }
}

#[test]
fn thin_regions_go_to_the_neighbour_of_most_contact() {
    // A square with one corner cut off by a side of width 0.1, which meets side 0 at 20 degrees and side 2 at 70.
    let (c, s) = (20f64.to_radians().cos() * 0.1, 20f64.to_radians().sin() * 0.1);
    let mesh = prism(&[[0.0, 0.0], [2.0 - c, 0.0], [2.0, s], [2.0, 2.0], [0.0, 2.0]]);
    let by_size = |size| with(CompoundSpec { merge_below_size: Some(size), ..CompoundSpec::default() });
    // Thickness of the cut: 2 w L / (2 w + 2 L) = 0.1 * 4 / 4.1.
    assert_eq!(groups(&detect(&mesh, &by_size(0.097)).unwrap().1), Vec::<Vec<u32>>::new());
    let (topology, features) = detect(&mesh, &by_size(0.098)).unwrap();
    assert_eq!(groups(&features), [[0, 1]]);
    assert_eq!((edges(&topology, &features), features.compounds.list[0].rules.clone()), (4 * 8, vec![CompoundRule::Size]));
    // Everything is thin: one compound, and no endless loop.
    assert_eq!(groups(&detect(&mesh, &by_size(1e9)).unwrap().1), [[0, 1, 2, 3, 4]]);
}

#[test]
fn rules_add_up() {
    let spec = CompoundSpec { lists: vec![vec![14, 15]], merge_angle_deg: Some(35.0), ..CompoundSpec::default() };
    assert_eq!(groups(&detect(&rounded(), &with(spec)).unwrap().1), [vec![0, 1, 2, 3], vec![4, 5]]);
    let joined = CompoundSpec { lists: vec![vec![13, 14]], merge_angle_deg: Some(35.0), ..CompoundSpec::default() };
    let (_, features) = detect(&rounded(), &with(joined)).unwrap();
    assert_eq!(groups(&features), [[0, 1, 2, 3, 4]]);
    assert_eq!(features.compounds.list[0].rules, [CompoundRule::Listed, CompoundRule::Angle]);
}

#[test]
fn lists_that_make_no_sense_are_refused() {
    let mesh = prism(&polygon(&[(1.0, 90.0); 4]));
    let refused = |spec: CompoundSpec| {
        let error = detect(&mesh, &with(spec)).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
        error
    };
    let lists = |lists: &[&[i64]]| CompoundSpec { lists: lists.iter().map(|l| l.to_vec()).collect(), ..CompoundSpec::default() };
    assert!(refused(lists(&[&[10, 99]])).message().contains("no region 99"));
    assert!(refused(lists(&[&[10, 11, 10]])).message().contains("twice"));
    assert!(refused(lists(&[&[10, 11], &[12, 11]])).message().contains("compounds[0]"));
    assert!(refused(lists(&[&[10]])).message().contains("two regions"));
    let apart = refused(lists(&[&[10, 12]]));
    assert!(apart.message().contains("region 12 has no common border") && apart.location_total() == 2, "{apart}");
    for angle in [0.0, -1.0, 181.0, f64::NAN] {
        refused(CompoundSpec { merge_angle_deg: Some(angle), ..CompoundSpec::default() });
    }
    for size in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        refused(CompoundSpec { merge_below_size: Some(size), ..CompoundSpec::default() });
    }
}
