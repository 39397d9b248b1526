//! Closed-form cases: plane grids, wedge, spheres, broken topology, crossing faces.

use super::intersect::faces_intersect;
use super::*;
use crate::error::Reason;
use crate::vector::{Vec3, norm, scale, unit};
use crate::work::CancelToken;

/// Sheared grid of 2 n m triangles with unit steps; the height and shear of equilateral triangles.
fn equilateral_grid(n: u32, m: u32) -> SurfaceMesh {
    let mut positions = Vec::new();
    for i in 0..=n {
        for j in 0..=m {
            positions.push([f64::from(i) + 0.5 * f64::from(j), 0.75f64.sqrt() * f64::from(j), 0.0]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let a = i * (m + 1) + j;
            let (b, c, d) = (a + m + 1, a + m + 2, a + 1);
            triangles.extend([[a, b, d], [b, c, d]]);
        }
    }
    SurfaceMesh::from_parts(positions, triangles)
}

/// Octahedron cut 4:1, on the unit sphere.
fn sphere(levels: u32) -> SurfaceMesh {
    let mut positions: Vec<Vec3> = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let mut triangles: Vec<[u32; 3]> = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middle = std::collections::BTreeMap::new();
        let mut fine = Vec::new();
        for t in &triangles {
            let m = [0, 1, 2].map(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    positions.push(unit(crate::vector::add(positions[a as usize], positions[b as usize])));
                    positions.len() as u32 - 1
                })
            });
            fine.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        triangles = fine;
    }
    SurfaceMesh::from_parts(positions, triangles)
}

fn moved(mesh: &SurfaceMesh, map: impl Fn(Vec3) -> Vec3) -> SurfaceMesh {
    SurfaceMesh { positions: mesh.positions.iter().map(|p| map(*p)).collect(), ..mesh.clone() }
}

fn report(input: &SurfaceMesh, output: &SurfaceMesh, size: f64) -> QualityReport {
    let token = CancelToken::new();
    let bvh = TriangleBvh::build(&input.positions, &input.triangles);
    let target = TargetSize::Uniform(size);
    measure_quality(input, &bvh, output, Some(&target), QualityScope::Full, &Work::silent(&token)).unwrap()
}

fn near(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "got {got}, want {want}");
}

#[test]
fn equilateral_grid_is_perfect() {
    let flat = equilateral_grid(12, 9);
    let r = report(&flat, &flat, 1.0);
    near(r.shape.kappa_min, 1.0, 1e-9);
    near(r.shape.kappa_p01, 1.0, 1e-9);
    near(r.shape.tau.unwrap(), 100.0, 1e-9);
    near(r.shape.min_angle_deg, 60.0, 1e-9);
    near(r.shape.skewness_max, 0.0, 1e-9);
    assert_eq!(r.shape.edge_ratio_ok, Some(1.0));
    assert_eq!(r.shape.kappa_histogram[19], 216);
    assert_eq!((r.topology_output.euler, r.topology_output.boundary_loops, r.topology_output.genus), (1, 1, Some(0)));
    assert!(r.topology_kept);
    assert_eq!(r.self_intersections, Some(0));
    let f = r.fidelity.unwrap();
    near(f.hausdorff_max_rel + f.hausdorff_rms_rel + f.boundary_deviation_rel.unwrap(), 0.0, 1e-12);
    near(f.area_ratio, 1.0, 1e-12);
    for size in [2.0, 0.5] {
        near(report(&flat, &flat, size).shape.tau.unwrap(), 100.0 * (-0.5f64).exp(), 1e-9);
    }
}

#[test]
fn sizes_per_vertex_follow_the_integral() {
    near(shape::length_in_field(3.0, 1.5, 1.5), 2.0, 1e-12);
    near(shape::length_in_field(1.0, 1.0, 2.0), 2.0f64.ln(), 1e-12);
    near(shape::length_in_field(1.0, 2.0, 1.0), 2.0f64.ln(), 1e-12);
    near(shape::length_in_field(1.0, 1.0, 1.0 + 1e-5), 1.0, 1e-5);
    let flat = equilateral_grid(3, 3);
    let token = CancelToken::new();
    let bvh = TriangleBvh::build(&flat.positions, &flat.triangles);
    let measure = |target: TargetSize| measure_quality(&flat, &bvh, &flat, Some(&target), QualityScope::Elements, &Work::silent(&token));
    assert_eq!(measure(TargetSize::PerVertex(vec![1.0; 16])).unwrap(), measure(TargetSize::Uniform(1.0)).unwrap());
    for bad in [TargetSize::PerVertex(vec![1.0; 15]), TargetSize::PerVertex(vec![0.0; 16]), TargetSize::Uniform(f64::NAN)] {
        assert_eq!(measure(bad).unwrap_err().reason(), Reason::BadParameter);
    }
}

#[test]
fn single_triangles() {
    let one = |c: Vec3| {
        let mesh = SurfaceMesh::from_parts(vec![[0.0; 3], [1.0, 0.0, 0.0], c], vec![[0, 1, 2]]);
        shape::measure_shape(&mesh, &edges::edge_table(&mesh), None)
    };
    let right = one([0.0, 1.0, 0.0]);
    near(right.kappa_min, 2.0 / (1.0 + 2f64.sqrt()), 1e-12);
    near(right.skewness_max, 0.25, 1e-12);
    let line = one([2.0, 0.0, 0.0]);
    assert_eq!((line.kappa_min, line.max_angle_deg), (0.0, 180.0));
    assert_eq!(line.tau, None);
}

#[test]
fn distances_of_planes() {
    let flat = equilateral_grid(12, 9);
    let diagonal = crate::vector::bounding_diagonal(&flat.positions);
    let f = report(&flat, &moved(&flat, |p| [p[0], p[1], 0.03]), 1.0).fidelity.unwrap();
    for d in [f.hausdorff_max_rel, f.hausdorff_rms_rel, f.in_to_out_max_rel, f.out_to_in_max_rel, f.boundary_deviation_rel.unwrap()] {
        near(d, 0.03 / diagonal, 1e-9);
    }
    // A wedge: the root mean square of a linear function that vanishes at one side is 1 / sqrt 3 of its maximum.
    let top = 1e-3 * 9.0 * 0.75f64.sqrt();
    let f = report(&flat, &moved(&flat, |p| [p[0], p[1], 1e-3 * p[1]]), 1.0).fidelity.unwrap();
    near(f.hausdorff_max_rel * diagonal / top, 1.0, 2e-3);
    near(f.hausdorff_rms_rel * diagonal / top, 3f64.sqrt().recip(), 2e-3);
    // One inner vertex out of the plane.
    let middle = flat.positions[6 * 10 + 4];
    let f = report(&flat, &moved(&flat, |p| if p == middle { [p[0], p[1], 0.25] } else { p }), 1.0).fidelity.unwrap();
    near(f.hausdorff_max_rel, 0.25 / diagonal, 1e-9);
    near(f.boundary_deviation_rel.unwrap(), 0.0, 1e-12);
}

#[test]
fn spheres() {
    let ball = sphere(4);
    let grown = report(&ball, &moved(&ball, |p| scale(p, 1.01)), 0.1);
    let f = grown.fidelity.unwrap();
    near(f.hausdorff_max_rel, 0.01 / 12f64.sqrt(), 1e-9);
    near(f.area_ratio, 1.01f64.powi(2), 1e-9);
    assert_eq!(f.boundary_deviation_rel, None);
    assert_eq!((grown.topology_output.euler, grown.topology_output.genus), (2, Some(0)));
    let coarse = sphere(2);
    let sag = (0..coarse.triangles.len())
        .map(|i| {
            let [a, b, c] = coarse.corners(i);
            1.0 - norm(std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0))
        })
        .fold(0.0, f64::max);
    near(report(&ball, &coarse, 0.4).fidelity.unwrap().hausdorff_max_rel * 12f64.sqrt(), sag, 0.1 * sag);
}

#[test]
fn broken_topology_is_counted() {
    let fan = topology_numbers(&[[0, 1, 2], [0, 1, 3], [0, 1, 4]], 5);
    assert_eq!((fan.non_manifold_edges, fan.genus), (1, None));
    let bow = topology_numbers(&[[0, 1, 2], [0, 3, 4]], 6);
    assert_eq!((bow.non_manifold_vertices, bow.boundary_loops, bow.components, bow.euler), (1, 2, 1, 1));
    let moebius: Vec<[u32; 3]> = (0..12u32)
        .flat_map(|k| {
            let (low, high) = (2 * k, 2 * k + 1);
            let (a, b) = if k < 11 { (2 * k + 2, 2 * k + 3) } else { (1, 0) };
            [[low, a, high], [a, b, high]]
        })
        .collect();
    let moebius = topology_numbers(&moebius, 24);
    assert_eq!((moebius.boundary_loops, moebius.genus, moebius.euler), (1, None, 0));
    let mut turned = equilateral_grid(3, 3);
    turned.triangles[4].swap(0, 1);
    let numbers = topology_numbers(&turned.triangles, 16);
    assert!(numbers.inconsistent_edges > 0 && numbers.genus == Some(0));
    let ring: Vec<[u32; 3]> = (0..20u32)
        .flat_map(|i| {
            (0..10u32).flat_map(move |j| {
                let at = |i: u32, j: u32| (i % 20) * 10 + j % 10;
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            })
        })
        .collect();
    let torus = topology_numbers(&ring, 200);
    assert_eq!((torus.euler, torus.genus, torus.boundary_loops, torus.components), (0, Some(1), 0, 1));
}

#[test]
fn faces_that_meet_in_more_than_they_share() {
    let [o, x, y] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let base = [o, x, y];
    let check = |t: [Vec3; 3], want: bool| {
        for turn in 0..3 {
            let turned = [t[turn], t[(turn + 1) % 3], t[(turn + 2) % 3]];
            assert_eq!(faces_intersect(&base, &turned), want, "{t:?}");
            assert_eq!(faces_intersect(&turned, &base), want, "{t:?}");
        }
    };
    check([[0.2, 0.2, -1.0], [0.3, 0.2, 1.0], [0.2, 0.3, 1.0]], true);
    check([[0.2, 0.2, 1e-80], [0.3, 0.2, 1.0], [0.2, 0.3, 1.0]], false);
    check([[0.2, 0.2, 0.0], [0.3, 0.2, 1.0], [0.2, 0.3, 1.0]], true); // touches with a corner
    check([[0.1, 0.1, 0.0], [0.2, 0.1, 0.0], [0.1, 0.2, 0.0]], true); // inside, in the plane
    check([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, 1.0, 0.0]], false); // beside, in the plane
    check([x, o, [0.0, -1.0, 0.1]], false); // hinge
    check([x, o, [0.3, -0.3, 0.0]], false); // flat neighbour
    check([x, o, [0.3, 0.3, 0.0]], true); // folded flat onto it
    check([x, o, [0.3, 0.3, 1e-12]], false); // folded, not flat
    check([o, [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], false); // one corner
    check([o, [1.0, 1.0, -0.5], [1.0, 1.0, 0.5]], true); // one corner, through the face
    check([o, [0.25, 0.25, 0.0], [0.3, 0.25, 0.0]], true); // one corner, inside, in the plane
    check([[2.0, 0.5, 1e-322], [3.0, 0.0, 0.0], [2.0, 1.0, -1e-322]], false); // beside, nearly in the plane
    check([y, o, x], false); // the same face again: a duplicate, told elsewhere
}

/// Corners that are equal within a triangle, whichever of them is shared: no panic, and a triangle does not cross itself.
#[test]
fn triangles_with_equal_corners_are_survived() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let all = |n: usize| [corners[n % 3], corners[n / 3 % 3], corners[n / 9 % 3]];
    let n_corners = |n: usize| (0..3).filter(|c| [n % 3, n / 3 % 3, n / 9 % 3].contains(c)).count();
    for (i, j) in (0..27).flat_map(|i| (0..27).map(move |j| (i, j))) {
        let meet = faces_intersect(&all(i), &all(j));
        assert!(i != j || n_corners(i) < 3 || !meet, "{:?}", all(i));
    }
}

#[test]
fn crossing_balls_are_found() {
    let ball = sphere(3);
    let count = ball.positions.len() as u32;
    let both = |shift: Vec3| {
        let mut mesh = ball.clone();
        mesh.positions.extend(ball.positions.iter().map(|p| crate::vector::add(*p, shift)));
        mesh.triangles.extend(ball.triangles.iter().map(|t| t.map(|v| v + count)));
        let token = CancelToken::new();
        let mesh = SurfaceMesh::from_parts(mesh.positions, mesh.triangles);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let found = intersect::self_intersections(&mesh, &bvh, 5, &Work::silent(&token)).unwrap();
        let brute = (0..mesh.triangles.len())
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .filter(|&(i, j)| faces_intersect(&mesh.corners(i), &mesh.corners(j)))
            .count() as u64;
        assert_eq!(found.0, brute);
        assert!(found.1.len() as u64 == brute.min(5));
        brute
    };
    assert_eq!(both([2.5, 0.0, 0.0]), 0);
    assert!(both([1.5, 0.01, 0.02]) > 20);
}
