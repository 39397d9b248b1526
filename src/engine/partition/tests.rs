//! Invariants over families of generated surfaces: discs, spheres, tori, plates with handles, boxes, tubes, several components.

use super::*;
use crate::features::{FeatureSpec, detect_features};
use crate::patch::extract_patches;
use crate::vector::Vec3;
use crate::work::CancelToken;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

mod edits;
mod strategies;
mod two_way;

/// A grid whose ends in either direction may be joined; `place` maps `[0, 1]^2` into space.
fn grid([nu, nv]: [u32; 2], [join_u, join_v]: [bool; 2], place: impl Fn(f64, f64) -> Vec3) -> SurfaceMesh {
    let (cu, cv) = (nu + u32::from(!join_u), nv + u32::from(!join_v));
    let positions =
        (0..cv).flat_map(|j| (0..cu).map(move |i| (i, j))).map(|(i, j)| place(f64::from(i) / f64::from(nu), f64::from(j) / f64::from(nv)));
    let at = |i: u32, j: u32| (j % cv) * cu + i % cu;
    let triangles = (0..nv)
        .flat_map(|j| (0..nu).map(move |i| (i, j)))
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
    let triangles: Vec<[u32; 3]> = triangles.collect();
    SurfaceMesh::from_parts(positions.collect(), triangles)
}

fn disc(n: u32) -> SurfaceMesh {
    grid([n, n], [false, false], |u, v| [u, v, 0.1 * (7.0 * u).sin() * (5.0 * v).cos()])
}

fn tube(n: u32, aspect: f64) -> SurfaceMesh {
    let along = (f64::from(n) * aspect / 3.0) as u32;
    grid([n, along], [true, false], |u, v| [(TAU * u).cos(), (TAU * u).sin(), 2.0 * aspect * v])
}

fn torus(n: u32) -> SurfaceMesh {
    grid([2 * n, n], [true, true], |u, v| {
        let r = 3.0 + (TAU * v).cos();
        [r * (TAU * u).cos(), r * (TAU * u).sin(), (TAU * v).sin()]
    })
}

/// The surface of a set of unit cubes, every side cut in two triangles. The cubes must not touch in an edge or corner alone.
fn cubes(solid: impl Fn([i32; 3]) -> bool, size: [i32; 3]) -> SurfaceMesh {
    let mut index: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let inside = |c: [i32; 3]| (0..3).all(|k| c[k] >= 0 && c[k] < size[k]) && solid(c);
    for c in (0..size[2]).flat_map(|z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z]))) {
        for (axis, up) in (0..3).flat_map(|k| [(k, 0), (k, 1)]) {
            let mut beyond = c;
            beyond[axis] += 2 * up - 1;
            if !inside(c) || inside(beyond) {
                continue;
            }
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| {
                let mut q = c;
                q[axis] += up;
                q[a] += i;
                q[b] += j;
                *index.entry(q).or_insert_with(|| {
                    positions.push(q.map(f64::from));
                    positions.len() as u32 - 1
                })
            });
            if up == 0 {
                quad.reverse();
            }
            triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
    }
    SurfaceMesh::from_parts(positions, triangles)
}

/// A plate with `g` holes through it: genus g.
fn plate(g: i32) -> SurfaceMesh {
    cubes(|[x, y, _]| !(x % 6 >= 2 && x % 6 < 4 && (2..4).contains(&y) && x < 6 * g), [6 * g + 2, 6, 3])
}

fn sphere(n: i32) -> SurfaceMesh {
    let mut mesh = cubes(|_| true, [n, n, n]);
    let centre = 0.5 * f64::from(n);
    for p in &mut mesh.positions {
        *p = crate::vector::unit(p.map(|x| x - centre));
    }
    mesh
}

fn joined(parts: &[SurfaceMesh]) -> SurfaceMesh {
    let mut all = SurfaceMesh::from_parts(Vec::new(), Vec::new());
    for part in parts {
        let base = all.positions.len() as u32;
        all.positions.extend(&part.positions);
        all.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + base)));
    }
    SurfaceMesh::from_parts(all.positions, all.triangles)
}

struct Case {
    mesh: SurfaceMesh,
    topology: Topology,
    features: Features,
}

fn case(mesh: SurfaceMesh, feature_angle_deg: Option<f64>) -> Case {
    let token = CancelToken::new();
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let spec = FeatureSpec { feature_angle_deg, ..FeatureSpec::default() };
    let features = detect_features(&mesh, &topology, &spec, &Work::silent(&token)).unwrap();
    Case { mesh, topology, features }
}

impl Case {
    fn partition(&self, spec: &PartitionSpec) -> Partition {
        let token = CancelToken::new();
        let partition = partition_surface(&self.mesh, &self.topology, &self.features, spec, &Work::silent(&token)).unwrap();
        self.check(&partition);
        assert!(partition.patches.iter().all(|p| p.faces <= spec.max_patch_faces));
        assert!(partition.patches.iter().all(|p| p.faces == 1 || p.aspect_ratio <= spec.max_aspect_ratio));
        partition
    }

    fn split(&self, partition: &Partition, patches: &[u32]) -> Result<Partition> {
        let token = CancelToken::new();
        split_patches(&self.mesh, &self.topology, &self.features, partition, patches, &Work::silent(&token))
    }

    /// Everything the types promise, recomputed from the extracted patches.
    fn check(&self, partition: &Partition) {
        let faces = self.mesh.triangles.len();
        assert_eq!(partition.face_patch.len(), faces);
        let mut lowest = vec![usize::MAX; partition.patches.len()];
        for (f, &p) in partition.face_patch.iter().enumerate() {
            lowest[p as usize] = lowest[p as usize].min(f);
        }
        assert!(lowest.is_sorted() && lowest.iter().all(|&f| f < faces), "numbered by lowest face, none empty");
        let extracted = extract_patches(&self.mesh, &self.topology, partition).unwrap();
        assert_eq!(extracted.iter().map(|(patch, _)| patch.triangles.len()).sum::<usize>(), faces);
        for ((patch, map), summary) in extracted.iter().zip(&partition.patches) {
            let own = Topology::build(&patch.triangles, patch.positions.len()).unwrap();
            assert_eq!(own.components.len(), 1, "connected");
            assert_eq!((own.components[0].genus(), summary.genus), (0, 0));
            assert!(!own.loops.is_empty());
            assert_eq!((own.loops.len(), own.loops.len()), (patch.loops.len(), summary.loops as usize));
            assert_eq!(summary.faces as usize, map.faces.len());
            self.check_patch(patch, map, &own, summary);
        }
        self.check_features(partition);
    }

    fn check_patch(&self, patch: &crate::patch::Patch, map: &crate::patch::PatchMap, own: &Topology, summary: &PatchSummary) {
        assert!(map.vertices.is_sorted() && map.faces.is_sorted());
        for (local, &global) in patch.triangles.iter().zip(&map.faces) {
            assert_eq!(local.map(|v| map.vertices[v as usize]), self.mesh.triangles[global as usize]);
        }
        let boundary: std::collections::BTreeSet<[u32; 2]> = own.loops.iter().flatten().map(|&h| [own.origin(h), own.target(h)]).collect();
        let length_of = |ring: &Vec<u32>| -> f64 {
            (0..ring.len())
                .map(|i| {
                    let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
                    assert!(boundary.contains(&[a, b]), "loops run along boundary halfedges");
                    crate::vector::distance(patch.positions[a as usize], patch.positions[b as usize])
                })
                .sum()
        };
        let lengths: Vec<f64> = patch.loops.iter().map(length_of).collect();
        assert!(lengths.is_sorted_by(|a, b| a >= b), "longest first");
        assert_eq!(boundary.len(), patch.loops.iter().map(Vec::len).sum::<usize>());
        let area = SurfaceMesh::from_parts(patch.positions.clone(), patch.triangles.clone()).area();
        assert!((area - summary.area).abs() <= 1e-9 * area);
        assert!((lengths.iter().sum::<f64>() - summary.border_length).abs() <= 1e-9 * summary.border_length);
        assert!((std::f64::consts::PI * area / lengths[0].powi(2) - summary.aspect_ratio).abs() <= 1e-9 * summary.aspect_ratio);
    }

    /// Every patch is connected without crossing a feature.
    fn check_features(&self, partition: &Partition) {
        let mut seen = vec![false; partition.face_patch.len()];
        let mut started = vec![false; partition.patches.len()];
        for seed in 0..seen.len() as u32 {
            if std::mem::replace(&mut seen[seed as usize], true) {
                continue;
            }
            let p = partition.face_patch[seed as usize];
            assert!(!std::mem::replace(&mut started[p as usize], true), "patch {p} is cut by a feature");
            let mut stack = vec![seed];
            while let Some(f) = stack.pop() {
                for h in (3 * f..3 * f + 3).filter(|&h| !self.features.is_feature[h as usize]) {
                    let Some(g) = self.topology.twin(h).map(|t| t / 3) else { continue };
                    if partition.face_patch[g as usize] == p && !std::mem::replace(&mut seen[g as usize], true) {
                        stack.push(g);
                    }
                }
            }
        }
    }
}

fn family() -> Vec<(&'static str, Case)> {
    vec![
        ("disc", case(disc(30), None)),
        ("one face", case(disc(1), Some(40.0))),
        ("sphere", case(sphere(12), Some(40.0))),
        ("torus", case(torus(24), Some(40.0))),
        ("genus 2", case(plate(2), None)),
        ("genus 3", case(plate(3), None)),
        ("genus 3 with features", case(plate(3), Some(40.0))),
        ("box", case(cubes(|_| true, [6, 5, 4]), Some(40.0))),
        ("long tube", case(tube(24, 14.0), Some(40.0))),
        ("components", case(joined(&[sphere(6), torus(12), disc(8), plate(1)]), Some(60.0))),
        (
            "tiny closed",
            case(
                SurfaceMesh::from_parts(
                    vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                    vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
                ),
                None,
            ),
        ),
    ]
}

#[test]
fn patches_satisfy_the_conditions_for_every_size() {
    for (name, case) in family() {
        for max_patch_faces in [12_000, 300, 40, 1] {
            let spec = PartitionSpec { max_patch_faces, ..PartitionSpec::default() };
            let partition = case.partition(&spec);
            assert_eq!(partition, case.partition(&spec), "{name}: deterministic");
            let least = case.mesh.triangles.len().div_ceil(max_patch_faces as usize);
            assert!(partition.patches.len() >= least, "{name}");
        }
    }
}

#[test]
fn few_patches_where_few_are_enough() {
    let count = |mesh, angle| case(mesh, angle).partition(&PartitionSpec::default()).patches.len();
    assert_eq!(count(disc(30), None), 1);
    assert_eq!(count(sphere(12), Some(40.0)), 2);
    assert!(count(torus(24), Some(40.0)) <= 3);
    assert!(count(plate(3), None) <= 8);
    assert_eq!(count(cubes(|_| true, [6, 5, 4]), Some(40.0)), 6);
    // eta of the tube is 14, of a patch 4 at most: cut across it needs 4, along it 2.
    let tube = case(tube(24, 14.0), Some(40.0));
    let across = PartitionSpec { strategy: PartitionStrategy::Multilevel, ..PartitionSpec::default() };
    assert!((4..=8).contains(&tube.partition(&across).patches.len()));
    assert_eq!(tube.partition(&PartitionSpec::default()).patches.len(), 2);
}

#[test]
fn wanted_number_of_patches_is_met_on_simple_surfaces() {
    for k in [1, 2, 5, 16] {
        let case = case(disc(40), None);
        let spec = PartitionSpec { patches: Some(k), ..PartitionSpec::default() };
        let partition = case.partition(&spec);
        assert_eq!(partition.patches.len(), k as usize);
        let mean = 3200 / k;
        assert!(partition.patches.iter().all(|p| p.faces * 3 >= mean && p.faces <= 2 * mean), "{k}: {:?}", partition.patches);
    }
}

#[test]
fn cuts_of_a_square_are_short() {
    // Halving a unit square costs a cut of 1, quartering 2; allow for the directions that the triangles offer.
    let case = case(grid([60, 60], [false, false], |u, v| [u, v, 0.0]), None);
    for (k, ideal) in [(2, 1.0), (4, 2.0)] {
        let partition = case.partition(&PartitionSpec { patches: Some(k), ..PartitionSpec::default() });
        let cut = 0.5 * (partition.patches.iter().map(|p| p.border_length).sum::<f64>() - 4.0);
        assert!(cut <= 1.2 * ideal, "{k} parts: cut {cut}");
    }
}

#[test]
fn regions_are_never_shared_by_a_patch() {
    let mut mesh = sphere(10);
    mesh.regions.push(mesh.regions[0].clone());
    for f in 0..mesh.triangles.len() {
        mesh.face_region[f] = u32::from(mesh.corners(f).iter().all(|p| p[2] > 0.3));
    }
    let case = case(mesh, Some(40.0));
    let partition = case.partition(&PartitionSpec::default());
    let mut region = vec![None; partition.patches.len()];
    for (f, &p) in partition.face_patch.iter().enumerate() {
        assert_eq!(*region[p as usize].get_or_insert(case.mesh.face_region[f]), case.mesh.face_region[f]);
    }
}

#[test]
fn splitting_changes_only_the_listed_patches_and_works_down_to_single_faces() {
    for (name, case) in family() {
        let before = case.partition(&PartitionSpec { max_patch_faces: 400, ..PartitionSpec::default() });
        let chosen = before.patches.len() as u32 / 2;
        if before.patches[chosen as usize].faces < 2 {
            continue;
        }
        let after = case.split(&before, &[chosen, chosen]).unwrap();
        case.check(&after);
        assert_eq!(after.patches.len(), before.patches.len() + 1, "{name}");
        let mut image = BTreeMap::new();
        for (f, &p) in before.face_patch.iter().enumerate().filter(|(_, p)| **p != chosen) {
            assert_eq!(*image.entry(p).or_insert(after.face_patch[f]), after.face_patch[f], "{name}: patch {p} stays whole");
        }
    }
    let small = case(disc(4), None);
    let mut partition = small.partition(&PartitionSpec::default());
    while partition.patches.iter().any(|p| p.faces > 1) {
        let larger: Vec<u32> = (0..partition.patches.len() as u32).filter(|&p| partition.patches[p as usize].faces > 1).collect();
        partition = small.split(&partition, &larger).unwrap();
        small.check(&partition);
    }
    assert_eq!(partition.patches.len(), 32);
    assert_eq!(small.split(&partition, &[3]).unwrap_err().reason(), Reason::PatchTopology);
    assert_eq!(small.split(&partition, &[32]).unwrap_err().reason(), Reason::PatchNotFound);
}

#[test]
fn a_vertex_where_a_patch_touches_itself_is_doubled() {
    // Two opposite quarters of a fan around vertex 0 joined by a way around: label by hand.
    let mesh = grid([4, 4], [false, false], |u, v| [u, v, 0.0]);
    let case = case(mesh, None);
    // Patch 1: the two squares that meet in the centre (12) only along the diagonal, with a detour; patch 0: the rest.
    let squares = [(1, 1), (2, 2), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2)];
    let mut face_patch = vec![0; 32];
    for (i, j) in squares {
        let f = 2 * (j * 4 + i);
        (face_patch[f], face_patch[f + 1]) = (1, 1);
    }
    let patches = vec![PatchSummary::default(); 2];
    let extracted = extract_patches(&case.mesh, &case.topology, &Partition { face_patch, patches, ..Partition::default() }).unwrap();
    let (patch, map) = &extracted[1];
    assert_eq!(map.vertices.iter().filter(|&&v| v == 12).count(), 2);
    let own = Topology::build(&patch.triangles, patch.positions.len()).unwrap();
    assert_eq!((own.components.len(), own.components[0].genus()), (1, 0));
}

#[test]
fn wrong_parameters_and_cancelled_work_are_refused() {
    let case = case(disc(4), None);
    let token = CancelToken::new();
    let run = |spec: &PartitionSpec| partition_surface(&case.mesh, &case.topology, &case.features, spec, &Work::silent(&token));
    for spec in [
        PartitionSpec { patches: Some(0), ..PartitionSpec::default() },
        PartitionSpec { max_patch_faces: 0, ..PartitionSpec::default() },
        PartitionSpec { max_aspect_ratio: f64::NAN, ..PartitionSpec::default() },
        PartitionSpec { max_aspect_ratio: 0.1, ..PartitionSpec::default() },
    ] {
        assert_eq!(run(&spec).unwrap_err().reason(), Reason::BadParameter);
    }
    token.cancel();
    assert_eq!(run(&PartitionSpec::default()).unwrap_err().reason(), Reason::Cancelled);
}
