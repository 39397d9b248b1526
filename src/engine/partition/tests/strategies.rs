//! Strategies: handle loops, planes, the choice between them, and borders along shortest paths.

use super::*;
use crate::partition::depth::expected_charts;
use crate::partition::homology::handle_loops;
use crate::partition::surface::Surface;
use crate::partition::{BorderSmoothing, PartitionStrategy, Plane};
use crate::vector::distance;

const STRATEGIES: [PartitionStrategy; 6] = [
    PartitionStrategy::Auto,
    PartitionStrategy::Multilevel,
    PartitionStrategy::Handles,
    PartitionStrategy::Plane { plane: None },
    PartitionStrategy::Laplace,
    PartitionStrategy::Pants,
];

fn by(strategy: &PartitionStrategy) -> PartitionSpec {
    PartitionSpec { strategy: *strategy, ..PartitionSpec::default() }
}

/// Beams along the lines of a grid of `n` nodes: genus beams - nodes + 1.
fn lattice(n: [i32; 3]) -> (SurfaceMesh, u32) {
    let mesh = cubes(|c| c.iter().filter(|x| **x % 3 == 0).count() >= 2, n.map(|k| 3 * k - 2));
    let [x, y, z] = n;
    let beams = (x - 1) * y * z + x * (y - 1) * z + x * y * (z - 1);
    (mesh, (beams - x * y * z + 1) as u32)
}

#[test]
fn every_strategy_gives_valid_patches() {
    for (name, case) in family() {
        for strategy in &STRATEGIES {
            for (max_patch_faces, borders) in [(12_000, BorderSmoothing::Vote), (150, BorderSmoothing::Shortest)] {
                let spec = PartitionSpec { max_patch_faces, borders, ..by(strategy) };
                let partition = case.partition(&spec);
                assert_eq!(partition, case.partition(&spec), "{name}, {strategy:?}: deterministic");
                assert_ne!(partition.strategy, PartitionStrategy::Auto);
                assert!(!partition.reason.is_empty());
            }
        }
    }
}

#[test]
fn two_hundred_handles() {
    let (mesh, genus) = lattice([6, 5, 5]);
    let case = case(mesh, None);
    assert_eq!((case.topology.totals().1, genus), (216, 216));
    for strategy in &STRATEGIES {
        let partition = case.partition(&by(strategy));
        assert!(partition.patches.len() >= 2);
    }
}

#[test]
fn auto_has_the_fewest_patches_of_those_it_compares() {
    for (name, case) in family() {
        let [auto, multilevel] = [0, 1].map(|i| case.partition(&by(&STRATEGIES[i])));
        assert!(auto.patches.len() <= multilevel.patches.len(), "{name}");
        if auto.strategy == PartitionStrategy::Multilevel {
            assert_eq!(auto.face_patch, multilevel.face_patch, "{name}");
        } else {
            let same = case.partition(&by(&auto.strategy));
            assert!(auto.patches.len() < multilevel.patches.len() || same.patches.len() <= auto.patches.len(), "{name}");
        }
        let counted = auto.reason.contains(&format!("{}", multilevel.patches.len()));
        let settled = auto.strategy == PartitionStrategy::Handles && auto.reason.contains("none can have fewer");
        assert!(counted || settled || auto.reason.contains("no piece"), "{name}: {}", auto.reason);
    }
    for (mesh, strategy) in [(disc(20), "no piece"), (sphere(8), "no piece"), (plate(3), "3 handles"), (tube(24, 14.0), "a long piece")] {
        let auto = case(mesh, None).partition(&PartitionSpec::default());
        assert!(auto.reason.contains(strategy), "{}", auto.reason);
    }
    // A number that is asked for leaves nothing to choose.
    let given = case(plate(3), None).partition(&PartitionSpec { patches: Some(9), ..PartitionSpec::default() });
    assert_eq!(given.strategy, PartitionStrategy::Multilevel);
}

#[test]
fn pants_have_three_loops_and_are_as_many_as_topology_says() {
    let holed = |n: u32| {
        let mut mesh = disc(48);
        let inside = |p: Vec3, k: u32| (p[0] - (f64::from(k) + 0.5) / f64::from(n)).hypot(p[1] - 0.5) < 0.2 / f64::from(n);
        let keep = |t: &[u32; 3]| (0..n).all(|k| !t.iter().all(|&v| inside(mesh.positions[v as usize], k)));
        let triangles = mesh.triangles.iter().copied().filter(keep).collect();
        mesh = SurfaceMesh::from_parts(mesh.positions, triangles);
        mesh
    };
    // Discs with n holes: n - 1 pairs of pants. The loops of a pair that are not borders of the surface are seams.
    for n in [2, 3, 5] {
        let case = case(holed(n), None);
        let partition = case.partition(&by(&PartitionStrategy::Pants));
        assert_eq!(partition.patches.len() as u32, n - 1);
        assert!(partition.patches.iter().all(|p| p.loops == 3), "{n}: {:?}", partition.patches);
    }
    // A fine plate of genus g: at least 2 g - 2, a few more where a pair is glued to itself.
    for g in [2, 3, 4] {
        let case = case(finer(&finer(&plate(g))), None);
        let pants = case.partition(&by(&PartitionStrategy::Pants)).patches.len() as i32;
        assert!((2 * g - 2..=3 * g).contains(&pants), "genus {g}: {pants}");
    }
    for whole in [disc(10), tube(24, 1.0)] {
        assert_eq!(case(whole, None).partition(&by(&PartitionStrategy::Pants)).patches.len(), 1, "no loop is cut");
    }
}

/// Every triangle in four.
fn finer(mesh: &SurfaceMesh) -> SurfaceMesh {
    let mut positions = mesh.positions.clone();
    let mut middle: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut triangles = Vec::new();
    for t in &mesh.triangles {
        let m: [u32; 3] = std::array::from_fn(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *middle.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                positions.push(crate::vector::lerp(mesh.positions[a as usize], mesh.positions[b as usize], 0.5));
                positions.len() as u32 - 1
            })
        });
        triangles.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
    }
    SurfaceMesh::from_parts(positions, triangles)
}

#[test]
fn loops_are_a_basis_that_leaves_the_surface_connected() {
    let (beams, _) = lattice([3, 3, 2]);
    for mesh in [torus(24), plate(3), beams, sphere(6), disc(8)] {
        let case = case(mesh, None);
        let surface = Surface::new(&case.mesh, &case.topology, &case.features);
        let token = CancelToken::new();
        let loops = handle_loops(&case.topology, &surface.length, 0, &Work::silent(&token)).unwrap();
        assert_eq!(loops.len() as u32, 2 * case.topology.totals().1);
        assert!(loops.is_sorted_by(|a, b| a.length <= b.length));
        let mut cut = vec![false; case.topology.halfedge_count()];
        for found in &loops {
            let mut degree: BTreeMap<u32, u32> = BTreeMap::new();
            for &h in &found.edges {
                *degree.entry(case.topology.origin(h)).or_default() += 1;
                *degree.entry(case.topology.target(h)).or_default() += 1;
                cut[h as usize] = true;
                case.topology.twin(h).into_iter().for_each(|t| cut[t as usize] = true);
            }
            assert!(degree.values().all(|&d| d == 2) && degree.len() == found.edges.len(), "a simple cycle");
        }
        let mut seen = vec![false; case.mesh.triangles.len()];
        let mut stack = vec![0u32];
        seen[0] = true;
        while let Some(f) = stack.pop() {
            for g in (3 * f..3 * f + 3).filter(|&h| !cut[h as usize]).filter_map(|h| case.topology.twin(h)).map(|t| t / 3) {
                if !std::mem::replace(&mut seen[g as usize], true) {
                    stack.push(g);
                }
            }
        }
        assert!(seen.iter().all(|s| *s), "no combination of the loops bounds");
    }
}

#[test]
fn the_shortest_loops_of_a_torus_are_its_circles() {
    let case = case(torus(40), None);
    let surface = Surface::new(&case.mesh, &case.topology, &case.features);
    let token = CancelToken::new();
    let loops = handle_loops(&case.topology, &surface.length, 7, &Work::silent(&token)).unwrap();
    // Around the tube 2 pi; along it at least the inner circle, 4 pi.
    assert!((0.98 * TAU..1.15 * TAU).contains(&loops[0].length), "{}", loops[0].length);
    assert!((1.98 * TAU..5.0 * TAU).contains(&loops[1].length), "{}", loops[1].length);
}

#[test]
fn a_plane_halves_a_plate_of_83_holes() {
    let case = case(plate(83), None);
    let middle = Plane { point: [0.0, 0.0, 1.5], normal: [0.0, 0.0, 2.0] };
    for plane in [None, Some(middle)] {
        let strategy = PartitionStrategy::Plane { plane };
        let partition = case.partition(&PartitionSpec { max_patch_faces: 100_000, ..by(&strategy) });
        assert_eq!(partition.patches.iter().map(|p| p.loops).collect::<Vec<_>>(), [84, 84]);
    }
}

#[test]
fn a_given_plane_is_kept_also_where_nothing_asks_for_it() {
    let case = case(disc(20), None);
    let partition = case.partition(&by(&PartitionStrategy::Plane { plane: Some(Plane { point: [0.5; 3], normal: [1.0, 0.0, 0.0] }) }));
    assert_eq!(partition.patches.len(), 2);
    for (f, &p) in partition.face_patch.iter().enumerate() {
        let [a, b, c] = case.mesh.corners(f);
        let x = (a[0] + b[0] + c[0]) / 3.0 - 0.5;
        assert!(x.abs() < 0.15 || (x > 0.0) == (p == partition.face_patch[partition.face_patch.len() - 1]), "face {f} at {x}");
    }
    let token = CancelToken::new();
    let beside = ([1e9; 3], [1.0, 0.0, 0.0]);
    for (point, normal) in [([0.0; 3], [0.0; 3]), ([0.0; 3], [f64::NAN, 0.0, 1.0]), ([0.0; 3], [f64::INFINITY, 0.0, 0.0]), beside] {
        let spec = by(&PartitionStrategy::Plane { plane: Some(Plane { point, normal }) });
        let error = partition_surface(&case.mesh, &case.topology, &case.features, &spec, &Work::silent(&token)).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
    }
}

/// Length of the borders between patches.
fn seam_length(case: &Case, partition: &Partition) -> f64 {
    let patch = |h: u32| partition.face_patch[h as usize / 3];
    (0..case.topology.halfedge_count() as u32)
        .filter(|&h| case.topology.twin(h).is_some_and(|t| patch(t) < patch(h)))
        .map(|h| {
            let [a, b] = [case.topology.origin(h), case.topology.target(h)].map(|v| case.mesh.positions[v as usize]);
            distance(a, b)
        })
        .sum()
}

#[test]
fn shortest_borders_are_shorter() {
    for (name, case) in family() {
        let spec = PartitionSpec { max_patch_faces: 400, ..PartitionSpec::default() };
        let vote = case.partition(&spec);
        let shortest = case.partition(&PartitionSpec { borders: BorderSmoothing::Shortest, ..spec });
        if shortest.patches.len() == vote.patches.len() {
            let [a, b] = [&shortest, &vote].map(|p| seam_length(&case, p));
            assert!(a <= b * (1.0 + 1e-9), "{name}: {a} against {b}");
        }
    }
}

#[test]
fn depth_of_tubes_and_discs() {
    let token = CancelToken::new();
    let charts = |mesh: SurfaceMesh| {
        let case = case(mesh, None);
        let face_patch = vec![0; case.mesh.triangles.len()];
        let whole = Partition { face_patch, patches: Vec::new(), ..Partition::default() };
        expected_charts(&Surface::new(&case.mesh, &case.topology, &case.features), &whole, &Work::silent(&token)).unwrap()
    };
    assert_eq!(charts(disc(30)), 1.0);
    assert_eq!(charts(tube(24, 1.0)), 1.0);
    // Height over circumference is eta / pi, so the scale falls by exp(2 eta); a chart may have a thousand.
    let ten = charts(tube(24, 10.0));
    assert!((2.3..3.5).contains(&ten), "{ten}");
}

#[test]
fn a_deadline_stops_every_strategy_wherever_it_is() {
    let (mesh, _) = lattice([3, 2, 2]);
    let cases = [case(finer(&mesh), None), case(tube(12, 20.0), None)];
    for (case, strategy) in cases.iter().flat_map(|c| STRATEGIES.iter().map(move |s| (c, s))) {
        let whole = case.partition(&by(strategy));
        let mut stopped = 0;
        for k in 0..7 {
            let deadline = std::time::Instant::now() + std::time::Duration::from_micros(100 << k);
            let token = CancelToken::new().with_deadline(deadline);
            match partition_surface(&case.mesh, &case.topology, &case.features, &by(strategy), &Work::silent(&token)) {
                Ok(partition) => assert_eq!(partition, whole),
                Err(error) => {
                    assert_eq!(error.reason(), Reason::DeadlineExceeded, "{strategy:?}");
                    stopped += 1;
                }
            }
        }
        assert!(stopped > 0, "{strategy:?}");
    }
}

#[test]
fn every_strategy_stops_when_cancelled() {
    let case = case(plate(2), None);
    let token = CancelToken::new();
    token.cancel();
    for strategy in &STRATEGIES {
        let run = partition_surface(&case.mesh, &case.topology, &case.features, &by(strategy), &Work::silent(&token));
        assert_eq!(run.unwrap_err().reason(), Reason::Cancelled);
    }
}
