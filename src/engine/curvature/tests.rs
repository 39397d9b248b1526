//! Curvature against closed forms: spheres, cylinders, tori, saddles, in uneven and open triangulations.

use super::*;
use crate::features::FeatureSpec;
use crate::vector::{add, cross, norm, scale, unit};
use crate::work::CancelToken;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// A small generator of numbers in [-1, 1).
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn measured(mesh: &SurfaceMesh, features: Option<&FeatureSpec>) -> (Topology, Curvature) {
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let none = Features { is_feature: vec![false; topology.halfedge_count()], ..Features::default() };
    let features = features.map_or(none, |spec| crate::features::detect_features(mesh, &topology, spec, &work).unwrap());
    let curvature = curvature(mesh, &topology, &features, 0, &work).unwrap();
    (topology, curvature)
}

/// A sphere of radius `r`, subdivided `level` times, with its vertices crowded towards the south and shaken.
fn uneven_sphere(r: f64, level: u32) -> SurfaceMesh {
    let mut points: Vec<Vec3> = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let mut faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5u32]];
    for _ in 0..level {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let [x, y, z] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push(unit(add(points[p as usize], points[q as usize])));
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
        faces = finer;
    }
    let mut seed = 7;
    let step = 0.2 / f64::from(1 << level);
    let place = |p: &Vec3| {
        let shaken = std::array::from_fn(|k| p[k] + step * noise(&mut seed));
        scale(unit(add(unit(shaken), [0.0, 0.0, -0.6])), r)
    };
    let positions = points.iter().map(place).collect();
    SurfaceMesh::from_parts(positions, faces)
}

/// A grid of `n` by `m` cells over [0, 1]^2, shaken inside, taken to space by `place`; the columns may close.
fn sheet(n: u32, m: u32, closed: bool, place: impl Fn(f64, f64) -> Vec3) -> SurfaceMesh {
    let mut seed = 3;
    let columns = if closed { n } else { n + 1 };
    let mut positions = Vec::new();
    for j in 0..=m {
        for i in 0..columns {
            let (mut u, mut v) = (f64::from(i), f64::from(j));
            let (x, y) = (0.3 * noise(&mut seed), 0.3 * noise(&mut seed));
            u += if closed || (i > 0 && i < n) { x } else { 0.0 };
            v += if j > 0 && j < m { y } else { 0.0 };
            positions.push(place(u / f64::from(n), v / f64::from(m)));
        }
    }
    let at = |i: u32, j: u32| j * columns + i % columns;
    let cells = (0..m).flat_map(|j| (0..n).map(move |i| (i, j)));
    let split = |(i, j): (u32, u32)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    SurfaceMesh::from_parts(positions, cells.flat_map(split).collect())
}

fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

#[test]
fn sphere_has_one_over_r_everywhere() {
    for (r, level) in [(2.0, 3), (0.01, 4), (5.0, 1)] {
        let mesh = uneven_sphere(r, level);
        let (_, curvature) = measured(&mesh, None);
        for t in &curvature.per_vertex() {
            assert!((t.k1 * r - 1.0).abs() < 1e-5 && (t.k2 * r - 1.0).abs() < 1e-5, "{t:?}");
        }
        for (t, p) in curvature.per_vertex().iter().zip(&mesh.positions) {
            assert!(norm(cross(t.normal, unit(*p))) < 1e-6 && dot(t.normal, *p) > 0.0);
        }
    }
}

#[test]
fn an_open_sphere_has_it_at_its_rim_too() {
    let mut mesh = uneven_sphere(1.0, 4);
    mesh.triangles.retain(|t| t.iter().all(|&v| mesh.positions[v as usize][0] < 0.5));
    mesh.face_region.truncate(mesh.triangles.len());
    let (topology, curvature) = measured(&mesh, None);
    let tensors = curvature.per_vertex();
    let used = (0..mesh.positions.len()).filter(|&v| topology.outgoing(v as u32).next().is_some());
    let miss = worst(used.map(|v| (tensors[v].k1 - 1.0).abs().max((tensors[v].k2 - 1.0).abs())));
    assert!(miss < 0.02, "{miss}");
}

#[test]
fn cylinder_with_caps_keeps_both_sides_of_its_rims_apart() {
    let (r, n) = (0.5, 24u32);
    // Rings of long thin faces, closed by fans: as CAD writes it.
    let mut positions: Vec<Vec3> = Vec::new();
    for z in [0.0, 6.0] {
        positions.extend((0..n).map(|i| {
            let a = TAU * f64::from(i) / f64::from(n);
            [r * a.cos(), r * a.sin(), z]
        }));
    }
    positions.extend([[0.0, 0.0, 0.0], [0.0, 0.0, 6.0]]);
    let mut faces = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        faces.extend([[i, j, n + j], [i, n + j, n + i], [j, i, 2 * n], [n + i, n + j, 2 * n + 1]]);
    }
    let mesh = SurfaceMesh::from_parts(positions, faces);
    let (topology, curvature) = measured(&mesh, Some(&FeatureSpec::default()));
    for v in 0..2 * n {
        assert_eq!(curvature.sectors.of_vertex(v).len(), 2);
        let mut both: Vec<_> = curvature.tensors[curvature.sectors.of_vertex(v)].to_vec();
        both.sort_by(|a, b| a.largest().total_cmp(&b.largest()));
        assert!(both[0].largest() < 1e-9 && both[0].normal[2].abs() > 0.999_999, "{both:?}");
        let side = both[1];
        assert!((side.k1 * r - 1.0).abs() < 1e-3 && side.k2.abs() * r < 1e-3, "{side:?}");
        assert!(side.d2[2].abs() > 0.9999 && side.d1[2].abs() < 0.01);
        assert!((curvature.per_vertex()[v as usize].k1 * r - 1.0).abs() < 1e-3);
    }
    assert!(topology.totals().0 == 2);
}

#[test]
fn torus_directions_follow_its_circles() {
    let (big, small) = (3.0, 1.0);
    // An open strip around the hole: three quarters of the small circle, so that rims are tested too.
    let place = |u: f64, v: f64| {
        let (a, b) = (TAU * u, 1.5 * PI * v);
        [(big + small * b.cos()) * a.cos(), (big + small * b.cos()) * a.sin(), small * b.sin()]
    };
    let mesh = sheet(120, 40, true, place);
    let (_, curvature) = measured(&mesh, None);
    let tensors = curvature.per_vertex();
    let mean = tensors.iter().map(|t| (t.k1 - 1.0 / small).abs()).sum::<f64>() / tensors.len() as f64;
    assert!(mean < 0.03, "{mean}");
    for (t, p) in tensors.iter().zip(&mesh.positions) {
        let around = unit([-p[1], p[0], 0.0]);
        let out = p[0].hypot(p[1]) - big;
        let expected = out / small / (big + out);
        // The rims are shaken along themselves, which leaves them a worse estimate.
        let rim = p[2].abs() < 1e-9 || (p[2] + small).abs() < 1e-9;
        assert!((t.k1 - 1.0 / small).abs() < if rim { 0.35 } else { 0.2 }, "{t:?} at {p:?}");
        assert!((t.k2 - expected).abs() < 0.2, "{t:?}: {expected}");
        assert!(dot(t.d2, around).abs() > 0.98, "{t:?} at {p:?}");
        assert!(dot(cross(t.d1, t.d2), t.normal) > 0.999_999);
    }
}

#[test]
fn saddle_has_opposite_signs() {
    let mesh = sheet(30, 30, false, |u, v| {
        let (x, y) = (0.4 * (u - 0.5), 0.4 * (v - 0.5));
        [x, y, 0.5 * (x * x - y * y)]
    });
    let (_, curvature) = measured(&mesh, None);
    for (t, p) in curvature.per_vertex().iter().zip(&mesh.positions) {
        if p[0].hypot(p[1]) < 0.05 {
            // With the normal upwards, z = x^2/2 bends towards it.
            assert!((t.k1 - 1.0).abs() < 0.12 && (t.k2 + 1.0).abs() < 0.12, "{t:?}");
            assert!(t.d1[1].abs() > 0.99 && t.d2[0].abs() > 0.99, "{t:?}");
            assert!((t.along([0.0, 1.0, 0.0]) - 1.0).abs() < 0.12 && t.along([1.0, 1.0, 0.0]).abs() < 0.15);
        }
    }
}

#[test]
fn slivers_and_flat_pieces_are_harmless() {
    // A plane cut into needles and caps.
    let mesh = sheet(40, 3, false, |u, v| [u.powi(6) * 0.01, v, 0.25]);
    let (_, curvature) = measured(&mesh, None);
    assert!(worst(curvature.tensors.iter().map(CurvatureTensor::largest)) < 1e-6);
    // A sphere whose vertices are pushed together in pairs.
    let mut mesh = uneven_sphere(1.0, 3);
    for v in (0..mesh.positions.len()).step_by(9) {
        let t = mesh.triangles.iter().find(|t| t.contains(&(v as u32))).unwrap();
        let to = mesh.positions[*t.iter().find(|&&w| w != v as u32).unwrap() as usize];
        mesh.positions[v] = unit(add(scale(mesh.positions[v], 0.002), scale(to, 0.998)));
    }
    let (_, curvature) = measured(&mesh, None);
    let tensors = curvature.per_vertex();
    let miss = worst(tensors.iter().map(|t| (t.k1 - 1.0).abs().max((t.k2 - 1.0).abs())));
    assert!(miss < 0.25, "{miss}");
}

#[test]
fn smoothing_keeps_spheres_and_lowers_noise() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let mut mesh = uneven_sphere(1.0, 4);
    let spread = |mesh: &SurfaceMesh, passes: u32| {
        let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
        let none = Features { is_feature: vec![false; topology.halfedge_count()], ..Features::default() };
        let tensors = curvature(mesh, &topology, &none, passes, &work).unwrap().per_vertex();
        (tensors.iter().map(|t| (t.k1 - 1.0).powi(2) + (t.k2 - 1.0).powi(2)).sum::<f64>() / tensors.len() as f64).sqrt()
    };
    assert!(spread(&mesh, 3) < 1e-5);
    let mut seed = 5;
    mesh.positions.iter_mut().for_each(|p| *p = scale(*p, 1.0 + 2e-4 * noise(&mut seed)));
    let (rough, smooth) = (spread(&mesh, 0), spread(&mesh, 4));
    assert!(smooth < 0.5 * rough, "{rough} {smooth}");
}

#[test]
fn isolated_vertices_and_lone_faces_are_flat() {
    let mesh = SurfaceMesh::from_parts(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3]], vec![[0, 1, 2]]);
    let (_, curvature) = measured(&mesh, None);
    assert!(curvature.per_vertex().iter().all(|t| t.largest() == 0.0 && norm(t.normal) == 1.0 && norm(t.d1) > 0.99));
}
