//! Repair and diagnosis of surfaces with known defects.

use super::shapes::{Lcg, band, torus};
use crate::diagnose::{Defect, diagnose, topology_numbers};
use crate::error::{MAX_LOCATIONS, Reason};
use crate::import::{ImportOptions, Imported, import_arrays};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::{CancelToken, Work};

fn import(mesh: SurfaceMesh) -> Imported {
    import_arrays(mesh, &ImportOptions::default(), &Work::silent(&CancelToken::new())).unwrap()
}

fn count(imported: &Imported, defect: Defect) -> u64 {
    imported.diagnosis.finding(defect).map_or(0, |f| f.count)
}

#[test]
fn a_good_surface_is_left_alone() {
    let mesh = torus(12, 8);
    let imported = import(mesh.clone());
    assert_eq!(imported.mesh, mesh);
    assert!(imported.report.warnings.is_empty() && imported.diagnosis.findings.is_empty());
    assert_eq!(imported.diagnosis.topology.genus, Some(1));
}

#[test]
fn numbers_agree_with_the_halfedge_structure() {
    for mesh in [torus(9, 5), band(11, 0), band(8, 2)] {
        let numbers = topology_numbers(&mesh.triangles, mesh.positions.len());
        let (euler, genus, loops, components) = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap().totals();
        assert_eq!((numbers.euler, numbers.genus), (euler, Some(genus)));
        assert_eq!((numbers.boundary_loops, numbers.components), (loops, components));
    }
}

#[test]
fn turned_faces_are_turned_back_by_majority() {
    let good = torus(14, 9);
    let mut random = Lcg(3);
    for share in [1usize, 5, 30, 49] {
        let mut mesh = good.clone();
        let mut turned = 0;
        for t in &mut mesh.triangles {
            if random.below(100) < share {
                t.swap(0, 1);
                turned += 1;
            }
        }
        assert!(2 * turned < good.triangles.len());
        let inconsistent = topology_numbers(&mesh.triangles, mesh.positions.len()).inconsistent_edges;
        let before = diagnose(&mesh, &Work::silent(&CancelToken::new())).unwrap();
        assert_eq!(before.finding(Defect::FlippedFace).map_or(0, |f| f.count), turned as u64);
        assert!(before.finding(Defect::NotOrientable).is_none() && (turned == 0) == (inconsistent == 0));
        let imported = import(mesh);
        assert_eq!(imported.report.faces_flipped, turned as u64);
        let rotated = |t: &[u32; 3]| (0..3).map(|k| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]).min().unwrap();
        assert!(imported.mesh.triangles.iter().zip(&good.triangles).all(|(a, b)| rotated(a) == rotated(b)));
    }
}

#[test]
fn closed_parts_that_point_inwards_are_told_and_left() {
    let mut mesh = torus(8, 6);
    mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let imported = import(mesh.clone());
    assert_eq!(imported.mesh.triangles, mesh.triangles);
    assert!(imported.report.warnings[0].contains("inwards"));
}

#[test]
fn moebius_strip_is_refused_with_places() {
    let imported = import(band(15, 1));
    let error = imported.diagnosis.refusal().unwrap();
    assert_eq!(error.reason(), Reason::NotOrientable);
    assert!(count(&imported, Defect::NotOrientable) > 0 && error.locations().len() as u64 == count(&imported, Defect::NotOrientable));
    assert_eq!(imported.diagnosis.topology.genus, None);
}

#[test]
fn duplicates_and_degenerate_faces_are_counted() {
    let mut mesh = torus(8, 6);
    let faces = mesh.triangles.len();
    let [a, b, c] = mesh.triangles[5];
    mesh.positions.push([9.0; 3]);
    let middle = mesh.positions.len() as u32;
    mesh.positions.push([-1.0, 0.0, 0.0]);
    mesh.positions.extend([[1.0, 0.0, 0.0], [0.0; 3]]);
    mesh.triangles.extend([[b, a, c], [c, a, b], [a, a, b], [middle, middle + 1, middle + 2]]);
    mesh.face_region.extend([2, mesh.face_region[5], 0, 0]);
    let imported = import(mesh);
    let report = &imported.report;
    assert_eq!((report.duplicate_faces_dropped, report.degenerate_faces_dropped), (2, 2));
    assert_eq!((report.unused_vertices_dropped, imported.mesh.triangles.len()), (4, faces));
    assert!(report.warnings.iter().any(|w| w.contains("another region")));
}

#[test]
fn stitched_t_junctions_stay_closed() {
    // A tetrahedron, one edge of which has two more vertices on the side of one face, stitched with caps.
    let positions = vec![[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
    let triangles = vec![[0, 2, 4], [4, 2, 5], [5, 2, 1], [4, 5, 1], [0, 4, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let imported = import(SurfaceMesh::from_parts(positions, triangles));
    assert_eq!((imported.report.degenerate_faces_dropped, imported.mesh.triangles.len()), (0, 8));
    assert!(imported.report.warnings[0].starts_with("2 zero-area faces"));
    assert_eq!((imported.diagnosis.topology.euler, count(&imported, Defect::Hole)), (2, 0));
    assert!((imported.diagnosis.area - 24.0 - 8.0 * 3f64.sqrt()).abs() < 1e-12);
}

#[test]
fn bow_ties_are_split_unless_at_bad_edges() {
    let bow = vec![[0, 1, 2], [0, 3, 4]];
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]];
    let numbers = topology_numbers(&bow, 5);
    assert_eq!((numbers.euler, numbers.components, numbers.boundary_loops, numbers.non_manifold_vertices), (1, 1, 2, 1));
    let imported = import(SurfaceMesh::from_parts(positions.clone(), bow));
    assert_eq!((imported.report.vertices_split, imported.mesh.positions.len()), (1, 6));
    assert_eq!((imported.diagnosis.topology.euler, imported.diagnosis.topology.components), (2, 2));
    assert!(imported.diagnosis.refusal().is_none());

    let fin = vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]];
    let mut positions = positions;
    positions[3] = [0.5, 0.0, 1.0];
    let imported = import(SurfaceMesh::from_parts(positions, fin));
    assert_eq!((imported.report.vertices_split, imported.diagnosis.topology.non_manifold_edges), (0, 1));
    let error = imported.diagnosis.refusal().unwrap();
    assert_eq!(error.reason(), Reason::NonManifoldEdge);
    assert_eq!(error.locations()[0].position, [0.5, 0.0, 0.0]);
}

#[test]
fn two_tori_that_share_a_vertex_come_apart() {
    let one = torus(7, 5);
    let shift = one.positions.len() as u32;
    let mut mesh = one.clone();
    mesh.positions.extend(one.positions.iter().map(|p| [p[0] + 5.4, p[1], p[2]]));
    // The outermost vertex of the one is welded to the innermost side of the other by naming it.
    mesh.triangles.extend(one.triangles.iter().map(|t| t.map(|v| if v == 0 { 0 } else { v + shift })));
    mesh.face_region.extend(one.face_region.clone());
    let before = topology_numbers(&mesh.triangles, mesh.positions.len());
    assert_eq!((before.euler, before.components, before.genus, before.non_manifold_vertices), (-1, 1, Some(2), 1));
    let after = import(mesh).diagnosis.topology;
    assert_eq!((after.euler, after.components, after.genus, after.non_manifold_vertices), (0, 2, Some(2), 0));
}

#[test]
fn counts_go_on_where_places_end() {
    // Many fins on one row of edges.
    let n = 150u32;
    let positions: Vec<_> = (0..=n)
        .map(|i| [f64::from(i), 0.0, 0.0])
        .chain((0..3 * n).map(|i| {
            let angle = f64::from(i % 3) * 2.0;
            [f64::from(i / 3) + 0.5, angle.cos(), angle.sin()]
        }))
        .collect();
    let triangles = (0..3 * n).map(|i| [i / 3, i / 3 + 1, n + 1 + i]).collect();
    let imported = import(SurfaceMesh::from_parts(positions, triangles));
    assert_eq!(count(&imported, Defect::NonManifoldEdge), 150);
    let error = imported.diagnosis.refusal().unwrap();
    assert_eq!((error.locations().len(), error.location_total()), (MAX_LOCATIONS, 150));
}

#[test]
fn bad_arrays_are_errors() {
    let work_token = CancelToken::new();
    let run = |mesh: SurfaceMesh, options: &ImportOptions| import_arrays(mesh, options, &Work::silent(&work_token)).unwrap_err();
    let plain = ImportOptions::default();
    let mut mesh = torus(5, 4);
    mesh.positions[3][1] = f64::NAN;
    let error = run(mesh, &plain);
    assert_eq!((error.reason(), error.locations()[0].ids.as_slice()), (Reason::NonFinite, &[3u32][..]));
    let mut mesh = torus(5, 4);
    mesh.triangles[2][0] = 999;
    assert_eq!(run(mesh, &plain).reason(), Reason::IndexOutOfRange);
    assert_eq!(run(SurfaceMesh::default(), &plain).reason(), Reason::EmptyMesh);
    assert_eq!(run(torus(5, 4), &ImportOptions { max_faces: 10, ..Default::default() }).reason(), Reason::LimitReached);
    assert_eq!(run(torus(5, 4), &ImportOptions { weld_tolerance: f64::NAN, ..Default::default() }).reason(), Reason::BadParameter);
    assert_eq!(run(torus(5, 4), &ImportOptions { only_regions: vec!["no".into()], ..Default::default() }).reason(), Reason::BadParameter);
}

#[test]
fn only_regions_by_name_or_number() {
    for wanted in ["inlet", "7"] {
        let options = ImportOptions { only_regions: vec![wanted.to_owned()], ..Default::default() };
        let imported = import_arrays(torus(12, 6), &options, &Work::silent(&CancelToken::new())).unwrap();
        assert_eq!((imported.mesh.triangles.len(), imported.mesh.regions.len()), (48, 1));
        assert_eq!((imported.mesh.regions[0].id, count(&imported, Defect::Hole)), (7, 2));
    }
}

#[test]
fn a_cancelled_import_stops() {
    let token = CancelToken::new();
    token.cancel();
    let error = import_arrays(torus(5, 4), &ImportOptions::default(), &Work::silent(&token)).unwrap_err();
    assert_eq!(error.reason(), Reason::Cancelled);
}
