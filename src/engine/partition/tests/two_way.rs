//! The two-way strategies: conditions, balance, depth, failure of the max-cut, cancellation.

use super::*;
use crate::sample::{SampleKind, SampleSpec, generate};

fn laplace() -> PartitionSpec {
    PartitionSpec { strategy: PartitionStrategy::Laplace, max_patch_faces: u32::MAX, ..PartitionSpec::default() }
}

impl Case {
    fn cut(&self, strategy: PartitionStrategy) -> Result<TwoWayCut> {
        let faces: Vec<u32> = (0..self.mesh.triangles.len() as u32).collect();
        let token = CancelToken::new();
        cut_in_two(&self.mesh, &self.topology, &self.features, &faces, strategy, &Work::silent(&token))
    }

    /// Cuts in two and checks what a cut promises: two connected parts of genus 0 with a border.
    fn halves(&self) -> (TwoWayCut, Vec<PatchSummary>) {
        let cut = self.cut(PartitionStrategy::Laplace).unwrap();
        assert_eq!(cut, self.cut(PartitionStrategy::Laplace).unwrap(), "deterministic");
        assert_eq!(cut.verdict, Verdict::Usable);
        let surface = Surface::new(&self.mesh, &self.topology, &self.features);
        let mut label: Vec<u32> = cut.second.iter().map(|&s| u32::from(s)).collect();
        renumber(&mut label);
        let limits = Limits { faces: u32::MAX, loops: u32::MAX, aspect_ratio: f64::INFINITY };
        let token = CancelToken::new();
        let partition = finish(&surface, label.clone(), limits, &Work::silent(&token)).unwrap();
        assert_eq!((partition.patches.len(), &partition.face_patch), (2, &label), "both parts are valid as they are");
        self.check(&partition);
        (cut, partition.patches)
    }
}

fn sample(spec: &SampleSpec) -> Case {
    let token = CancelToken::new();
    case(generate(spec, &Work::silent(&token)).unwrap(), None)
}

/// A half sphere with bumps, open below.
fn dome(n: u32) -> SurfaceMesh {
    grid([4 * n, n], [true, false], |u, v| {
        let (lift, r) = ((0.01 + 0.49 * v) * std::f64::consts::PI, 1.0 + 0.1 * (9.0 * u).sin() * v);
        [r * lift.sin() * (TAU * u).cos(), r * lift.sin() * (TAU * u).sin(), lift.cos()]
    })
}

/// Fingers of a tree of height over width `aspect` on a plate.
fn comb(fingers: u32, aspect: u32) -> SurfaceMesh {
    let solid = |[x, y, z]: [i32; 3]| z < 1 || (x % 3 == 1 && y == 1);
    let all = cubes(solid, [3 * fingers as i32, 3, 1 + aspect as i32]);
    let open: Vec<[u32; 3]> = all.triangles.iter().copied().filter(|t| t.iter().any(|&v| all.positions[v as usize][2] > 0.0)).collect();
    SurfaceMesh::from_parts(all.positions, open)
}

#[test]
fn laplace_patches_satisfy_the_conditions_for_every_size() {
    for (name, case) in family() {
        for max_patch_faces in [12_000, 300, 40, 1] {
            let spec = PartitionSpec { max_patch_faces, ..laplace() };
            let partition = case.partition(&spec);
            assert_eq!(partition, case.partition(&spec), "{name}: deterministic");
        }
    }
}

#[test]
fn long_surfaces_are_cut_lengthwise_in_two() {
    for aspect in [6.0, 14.0, 25.0] {
        let tube = case(tube(24, aspect), None);
        assert_eq!(tube.partition(&laplace()).patches.len(), 2, "aspect ratio {aspect}");
        let (cut, halves) = tube.halves();
        assert!((0.4..0.6).contains(&cut.second_share), "{}", cut.second_share);
        assert!(halves.iter().all(|h| h.loops == 1 && h.aspect_ratio < 0.5), "{halves:?}");
        // Two straight lines along the tube, up to the directions that edges offer.
        assert!(cut.length < 1.08 * 2.0 * 2.0 * aspect, "{} for {aspect}", cut.length);
    }
    let artery = sample(&SampleSpec { outlets: Some(12), ..SampleSpec::new(SampleKind::Artery, 12_000) });
    assert_eq!(artery.partition(&laplace()).patches.len(), 2);
}

#[test]
fn a_tube_of_aspect_ratio_100_takes_many_levels() {
    let tube = case(tube(20, 100.0), None);
    let (cut, halves) = tube.halves();
    assert!(cut.levels >= 15, "{} levels", cut.levels);
    assert!((0.4..0.6).contains(&cut.second_share), "{}", cut.second_share);
    assert!(halves.iter().all(|h| h.loops == 1 && h.aspect_ratio < 4.0));
    assert_eq!(tube.partition(&laplace()).patches.len(), 2);
}

#[test]
fn cuts_are_balanced_and_both_parts_are_connected() {
    let square = || grid([40, 40], [false, false], |u, v| [u, v, 0.0]);
    let mut holes = square();
    holes.triangles.retain(|t| {
        let [x, y] = [0, 1].map(|k| t.iter().map(|&v| holes.positions[v as usize][k]).sum::<f64>() / 3.0);
        !(((x * 4.0) % 1.0 - 0.5).abs() < 0.2 && ((y * 4.0) % 1.0 - 0.5).abs() < 0.2)
    });
    let used = compacted(&holes);
    let cases = [
        ("square", case(square(), None)),
        ("square with 16 holes", case(used, None)),
        ("dome", case(dome(20), None)),
        ("disc", case(disc(30), None)),
        ("comb", case(compacted(&comb(5, 6)), None)),
        ("artery", sample(&SampleSpec::new(SampleKind::Artery, 8_000))),
        ("strip", case(grid([300, 6], [false, false], |u, v| [50.0 * u, v, 0.0]), None)),
        (
            "narrow neck",
            case(
                grid([40, 120], [true, false], |u, v| {
                    let r = 0.02 + (6.0 * v).sin().powi(2);
                    [r * (TAU * u).cos(), r * (TAU * u).sin(), 6.0 * v]
                }),
                None,
            ),
        ),
    ];
    for (name, case) in cases {
        let (cut, _) = case.halves();
        assert!((0.3..0.7).contains(&cut.second_share), "{name}: {}", cut.second_share);
    }
}

/// The same mesh without unused vertices.
fn compacted(mesh: &SurfaceMesh) -> SurfaceMesh {
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut positions = Vec::new();
    let triangles = mesh.triangles.iter().map(|t| {
        t.map(|v| {
            if number[v as usize] == u32::MAX {
                number[v as usize] = positions.len() as u32;
                positions.push(mesh.positions[v as usize]);
            }
            number[v as usize]
        })
    });
    let triangles = triangles.collect();
    SurfaceMesh::from_parts(positions, triangles)
}

#[test]
fn slivers_do_not_mislead_the_cut() {
    // Rings of very different widths: triangles up to a thousand times longer than high, and almost flat ones.
    let uneven = |v: f64| v + 0.0099 * (50.0 * TAU * v).sin() / TAU * 2.0;
    let needles = case(
        grid([30, 100], [true, false], |u, v| {
            let z = 24.0 * if ((v * 100.0) as u32).is_multiple_of(2) { v } else { v - 0.00999 };
            [(TAU * u).cos(), (TAU * u).sin(), z]
        }),
        None,
    );
    let waves = case(grid([30, 100], [true, false], |u, v| [(TAU * u).cos(), (TAU * u).sin(), 24.0 * uneven(v)]), None);
    for (name, case) in [("needles", needles), ("waves", waves)] {
        let (cut, halves) = case.halves();
        assert!((0.3..0.7).contains(&cut.second_share), "{name}: {}", cut.second_share);
        assert!(halves.iter().all(|h| h.aspect_ratio < 4.0), "{name}: {halves:?}");
    }
}

#[test]
fn faces_of_no_area_are_survived() {
    let mut mesh = grid([12, 12], [false, false], |u, v| [u, v, 0.0]);
    for v in 40..60 {
        mesh.positions[v] = mesh.positions[40];
    }
    for strategy in [PartitionStrategy::Laplace, PartitionStrategy::MaxCut] {
        let case = case(mesh.clone(), None);
        let cut = case.cut(strategy).unwrap();
        assert!(cut.second.contains(&true) && cut.second.contains(&false));
    }
    mesh.positions.iter_mut().for_each(|p| *p = [1.0, 2.0, 3.0]);
    let point = case(mesh, None);
    let cut = point.cut(PartitionStrategy::Laplace).unwrap();
    assert!(cut.second.contains(&true) && cut.second.contains(&false));
}

#[test]
fn the_max_cut_serves_short_surfaces_and_refuses_long_ones() {
    let short = case(tube(24, 2.0), None).cut(PartitionStrategy::MaxCut).unwrap();
    assert_eq!((short.verdict, short.collapsed.len()), (Verdict::Usable, 0));
    let long = case(tube(24, 25.0), None);
    let cut = long.cut(PartitionStrategy::MaxCut).unwrap();
    assert!(matches!(cut.verdict, Verdict::Unusable(_)));
    assert!(cut.collapsed.len() * 10 > 3 * cut.second.len(), "P2 figure 2: about 30 % of the faces, {}", cut.collapsed.len());
    let token = CancelToken::new();
    let spec = PartitionSpec { strategy: PartitionStrategy::MaxCut, ..laplace() };
    let error = partition_surface(&long.mesh, &long.topology, &long.features, &spec, &Work::silent(&token)).unwrap_err();
    assert_eq!(error.reason(), Reason::PatchTopology);
    assert!(!error.locations().is_empty() && !error.hint().is_empty());
    let disc = case(disc(30), None);
    let parts = disc.partition(&PartitionSpec { max_patch_faces: 500, ..spec });
    assert!(parts.patches.len() >= 4);
}

#[test]
fn wanted_numbers_are_reached_by_cutting_the_largest() {
    let case = case(disc(30), None);
    for k in [1, 2, 3, 7] {
        let partition = case.partition(&PartitionSpec { patches: Some(k), ..laplace() });
        assert_eq!(partition.patches.len(), k as usize);
        let largest = partition.patches.iter().map(|p| p.area).fold(0.0, f64::max);
        let smallest = partition.patches.iter().map(|p| p.area).fold(f64::INFINITY, f64::min);
        assert!(largest < 4.0 * smallest, "{k}: {largest} and {smallest}");
    }
    let pieces = case.partition(&PartitionSpec { patches: Some(5_000), ..laplace() });
    assert_eq!(pieces.patches.len(), 1_800, "no more than faces");
}

#[test]
fn both_aspect_ratios_are_told() {
    let long = case(tube(32, 9.0), None);
    let whole = long.partition(&PartitionSpec { max_aspect_ratio: 100.0, ..PartitionSpec::default() });
    let [patch] = &whole.patches[..] else { panic!("one patch") };
    let token = CancelToken::new();
    let boxes = box_aspect_ratios(&long.mesh, &long.topology, &whole, &Work::silent(&token)).unwrap();
    assert!((boxes[0] / 9.0 - 1.0).abs() < 0.05, "{}", boxes[0]);
    let (alone, _) = &extract_patches(&long.mesh, &long.topology, &whole).unwrap()[0];
    assert!((boxes[0] / alone.box_aspect_ratio() - 1.0).abs() < 1e-9);
    assert!((patch.aspect_ratio / 9.0 - 1.0).abs() < 0.02, "{}", patch.aspect_ratio);
}

#[test]
fn what_cannot_be_cut_is_refused() {
    let torus = case(torus(12), None);
    assert_eq!(torus.cut(PartitionStrategy::Laplace).unwrap_err().reason(), Reason::PatchTopology);
    assert!(torus.cut(PartitionStrategy::Multilevel).is_ok());
    let disc = case(disc(6), None);
    let token = CancelToken::new();
    let cut =
        |faces: &[u32]| cut_in_two(&disc.mesh, &disc.topology, &disc.features, faces, PartitionStrategy::Laplace, &Work::silent(&token));
    for faces in [&[3][..], &[1, 2, 1], &[0, 7_000]] {
        assert_eq!(cut(faces).unwrap_err().reason(), Reason::BadParameter, "{faces:?}");
    }
    assert_eq!(cut(&[0, 70]).unwrap_err().reason(), Reason::PatchTopology, "not connected");
    token.cancel();
    assert_eq!(cut(&[0, 1, 2, 3]).unwrap_err().reason(), Reason::Cancelled);
}

#[test]
fn a_deadline_stops_the_maps() {
    let tube = case(tube(40, 60.0), None);
    let token = CancelToken::new().with_deadline(std::time::Instant::now() + std::time::Duration::from_millis(5));
    let error = partition_surface(&tube.mesh, &tube.topology, &tube.features, &laplace(), &Work::silent(&token)).unwrap_err();
    assert_eq!(error.reason(), Reason::DeadlineExceeded);
}
