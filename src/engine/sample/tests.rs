//! Topology, count, determinism and quality of the samples.

use super::*;
use crate::topology::Topology;
use crate::vector::{Vec3, add, area_vector_twice, dot, kappa, scale};
use crate::work::CancelToken;

fn made(spec: &SampleSpec) -> SurfaceMesh {
    let cancel = CancelToken::new();
    generate(spec, &Work::silent(&cancel)).expect("the sample is generated")
}

/// Checks what every sample promises and returns (genus, loops).
fn numbers(mesh: &SurfaceMesh) -> (u32, u32) {
    mesh.validate().expect("valid arrays");
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).expect("manifold and oriented");
    assert_eq!(topology.components.len(), 1);
    let whole = topology.components[0];
    assert_eq!(whole.vertices as usize, mesh.positions.len(), "no vertex is unused");
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f);
        assert!(kappa(a, b, c) > 1e-4, "face {f} is degenerate: kappa {}", kappa(a, b, c));
    }
    assert!(enclosed_volume(mesh, &topology) > 0.0, "outward");
    (whole.genus(), whole.loops)
}

/// Volume inside the surface, each boundary loop closed by a fan over its mean point.
fn enclosed_volume(mesh: &SurfaceMesh, topology: &Topology) -> f64 {
    let cone = |[a, b, c]: [Vec3; 3]| dot(area_vector_twice(a, b, c), a) / 6.0;
    let mut volume: f64 = (0..mesh.triangles.len()).map(|f| cone(mesh.corners(f))).sum();
    for rim in &topology.loops {
        let ends = |h: u32| [0, 1].map(|k| mesh.corners(h as usize / 3)[(h as usize % 3 + k) % 3]);
        let middle = scale(rim.iter().fold([0.0; 3], |sum, &h| add(sum, ends(h)[0])), 1.0 / rim.len() as f64);
        volume += rim.iter().map(|&h| ends(h)).map(|[from, to]| cone([to, from, middle])).sum::<f64>();
    }
    volume
}

/// pi A / L^2 with the longest boundary loop.
fn eta(mesh: &SurfaceMesh) -> f64 {
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).expect("manifold");
    let ends = |h: u32| [0, 1].map(|k| mesh.corners(h as usize / 3)[(h as usize % 3 + k) % 3]);
    let length = |rim: &Vec<u32>| rim.iter().map(|&h| ends(h)).map(|[a, b]| crate::vector::distance(a, b)).sum::<f64>();
    let longest = topology.loops.iter().map(length).fold(0.0, f64::max);
    std::f64::consts::PI * mesh.area() / (longest * longest)
}

fn near(mesh: &SurfaceMesh, wanted: u64) -> bool {
    let factor = mesh.triangles.len() as f64 / wanted as f64;
    (1.0 / 1.5..1.5).contains(&factor)
}

#[test]
fn arteries_have_one_loop_per_end() {
    for (ends, triangles) in [
        (None, 6_000),
        (None, 30_000),
        (Some(2), 2_000),
        (Some(3), 4_000),
        (Some(5), 6_000),
        (Some(20), 6_000),
        (Some(40), 8_000),
        (Some(41), 40_000),
        (Some(130), 60_000),
    ] {
        let mesh = made(&SampleSpec { outlets: ends, ..SampleSpec::new(SampleKind::Artery, triangles) });
        assert_eq!(numbers(&mesh), (0, ends.unwrap_or(9)));
        assert!(near(&mesh, triangles), "{ends:?}: {} of {triangles}", mesh.triangles.len());
        // P2 section 3 cuts a lung of 129 outlets.
        assert!(ends != Some(130) || eta(&mesh) > 60.0);
    }
}

#[test]
fn pelvis_has_the_genus_asked_for() {
    for (genus, triangles) in [(None, 5_000), (Some(0), 4_000), (Some(1), 4_000), (Some(2), 4_000), (Some(6), 8_000), (Some(20), 20_000)] {
        let mesh = made(&SampleSpec { genus, ..SampleSpec::new(SampleKind::Pelvis, triangles) });
        assert_eq!(numbers(&mesh), (genus.unwrap_or(3), 0));
        assert!(near(&mesh, triangles), "{genus:?}: {} of {triangles}", mesh.triangles.len());
    }
}

#[test]
fn brake_has_the_genus_asked_for() {
    for (genus, triangles) in [(None, 3_000), (Some(2), 2_000), (Some(11), 6_000), (Some(12), 6_000), (None, 60_000), (Some(120), 60_000)] {
        let mesh = made(&SampleSpec { genus, ..SampleSpec::new(SampleKind::Brake, triangles) });
        assert_eq!(numbers(&mesh), (genus.unwrap_or(if triangles < 40_000 { 6 } else { 83 }), 0));
        assert!(near(&mesh, triangles), "{genus:?}: {} of {triangles}", mesh.triangles.len());
    }
}

#[test]
fn lattices_have_the_genus_asked_for() {
    for (genus, triangles) in [(None, 4_000), (Some(1), 1_000), (Some(17), 6_000), (None, 60_000)] {
        let mesh = made(&SampleSpec { genus, ..SampleSpec::new(SampleKind::Lattice, triangles) });
        assert_eq!(numbers(&mesh), (genus.unwrap_or(if triangles < 60_000 { 16 } else { 240 }), 0));
        assert!(near(&mesh, triangles), "{genus:?}: {} of {triangles}", mesh.triangles.len());
    }
}

#[test]
fn tubes_have_the_aspect_ratio_asked_for() {
    for (ratio, triangles) in [(None, 1_000), (Some(0.25), 2_000), (Some(1.0), 4_000), (Some(30.0), 20_000)] {
        let mesh = made(&SampleSpec { aspect_ratio: ratio, ..SampleSpec::new(SampleKind::Tube, triangles) });
        assert_eq!(numbers(&mesh), (0, 2));
        assert!(near(&mesh, triangles), "{ratio:?}: {} of {triangles}", mesh.triangles.len());
        let eta = ratio.unwrap_or(3.0);
        let side = std::f64::consts::PI * 20.0 * 20.0 * eta;
        assert!((mesh.area() / side - 1.0).abs() < 0.06, "area {} for {side}", mesh.area());
        let (low, high) = crate::vector::bounds(&mesh.positions).expect("points");
        assert!((high[0] - low[0] - 20.0 * eta).abs() < 0.5);
    }
}

#[test]
fn the_cad_part_has_its_regions_and_genus() {
    for triangles in [1_500, 12_000, 60_000] {
        let mesh = made(&SampleSpec::new(SampleKind::CadPart, triangles));
        assert_eq!(numbers(&mesh), (5, 0));
        assert!(near(&mesh, triangles), "{} of {triangles}", mesh.triangles.len());
        for wanted in ["flange", "base", "boss", "inlet", "bore", "bolt_holes"] {
            let region = mesh.regions.iter().position(|r| r.name == wanted).expect("named region") as u32;
            assert!(mesh.face_region.contains(&region), "{wanted} has faces");
        }
        // The ring on top is flat and its area is that of the annulus, to the chords of the circles.
        let inlet = mesh.regions.iter().position(|r| r.name == "inlet").expect("inlet") as u32;
        let faces = (0..mesh.triangles.len()).filter(|&f| mesh.face_region[f] == inlet);
        let area: f64 = faces.map(|f| crate::vector::triangle_area(mesh.corners(f)[0], mesh.corners(f)[1], mesh.corners(f)[2])).sum();
        let exact = std::f64::consts::PI * (30.0f64.powi(2) - 18.0f64.powi(2));
        assert!((0.9..1.0).contains(&(area / exact)), "{}", area / exact);
    }
}

#[test]
fn samples_are_poor_and_reproducible() {
    use SampleKind::*;
    for kind in [Artery, Pelvis, Brake, CadPart, Tube, Lattice] {
        let spec = SampleSpec::new(kind, 8_000);
        let (one, two) = (made(&spec), made(&spec));
        assert_eq!(one, two);
        let shapes: Vec<f64> = (0..one.triangles.len()).map(|f| one.corners(f)).map(|[a, b, c]| kappa(a, b, c)).collect();
        let mean = shapes.iter().sum::<f64>() / shapes.len() as f64;
        let min = shapes.iter().copied().fold(1.0, f64::min);
        assert!((0.3..0.88).contains(&mean) && min > 0.005 && min < 0.15, "{kind:?}: kappa mean {mean}, min {min}");
    }
}

#[test]
fn senseless_specs_are_refused() {
    let cancel = CancelToken::new();
    let reason = |spec: SampleSpec| generate(&spec, &Work::silent(&cancel)).map(|_| ()).expect_err("refused").reason();
    let plain = |kind| SampleSpec::new(kind, 1_000);
    assert_eq!(reason(SampleSpec::new(SampleKind::Tube, 0)), Reason::BadParameter);
    assert_eq!(reason(SampleSpec::new(SampleKind::Tube, MAX_TRIANGLES + 1)), Reason::LimitReached);
    assert_eq!(reason(SampleSpec { genus: Some(1), ..plain(SampleKind::Artery) }), Reason::BadParameter);
    assert_eq!(reason(SampleSpec { genus: Some(1), ..plain(SampleKind::Brake) }), Reason::BadParameter);
    assert_eq!(reason(SampleSpec { outlets: Some(1), ..plain(SampleKind::Artery) }), Reason::BadParameter);
    assert_eq!(reason(SampleSpec { aspect_ratio: Some(f64::NAN), ..plain(SampleKind::Tube) }), Reason::BadParameter);
    assert_eq!(reason(SampleSpec { aspect_ratio: Some(1.0), ..plain(SampleKind::Brake) }), Reason::BadParameter);
    cancel.cancel();
    assert_eq!(reason(plain(SampleKind::Pelvis)), Reason::Cancelled);
}

#[test]
fn rims_are_flat_and_as_wide_as_their_vessel() {
    for (ends, triangles) in [(9, 40_000), (4, 9_000)] {
        let mesh = made(&SampleSpec { outlets: Some(ends), ..SampleSpec::new(SampleKind::Artery, triangles) });
        let topology = Topology::build(&mesh.triangles, mesh.positions.len()).expect("manifold");
        let edge = (mesh.area() / mesh.triangles.len() as f64 * 2.3).sqrt();
        for rim in &topology.loops {
            let points: Vec<Vec3> = rim.iter().map(|&h| mesh.corners(h as usize / 3)[h as usize % 3]).collect();
            let middle = scale(points.iter().fold([0.0; 3], |sum, &p| add(sum, p)), 1.0 / points.len() as f64);
            let twice =
                (0..points.len()).fold([0.0; 3], |sum, k| add(sum, area_vector_twice(middle, points[k], points[(k + 1) % points.len()])));
            let normal = crate::vector::unit(twice);
            let off = points.iter().map(|&p| dot(normal, crate::vector::sub(p, middle)).abs()).fold(0.0, f64::max);
            assert!(off < 0.15 * edge, "a rim is {off} off its plane with edges of {edge}");
            let radius = (crate::vector::norm(twice) / std::f64::consts::TAU).sqrt();
            assert!((3.0..12.0).contains(&radius), "radius {radius}");
        }
    }
}
