//! Tests of straight borders on surfaces whose geodesics are known, and what a cut keeps on families of surfaces.

use super::*;
use crate::features::Features;
use crate::partition::{BorderSmoothing, PartitionSpec, partition_surface};
use crate::patch::extract_patches;
use crate::vector::{distance, kappa, triangle_area};
use crate::work::CancelToken;
use std::f64::consts::TAU;

/// A number in [-1, 1] that depends on two.
fn noise(i: usize, j: usize) -> f64 {
    let mut x = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (j as u64 + 7).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    x ^= x >> 29;
    x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x ^= x >> 32;
    (x % 20_001) as f64 / 10_000.0 - 1.0
}

/// A grid of `n` by `m` cells, its rows closed into rings if `ring`, with vertices from cell coordinates.
fn grid(n: usize, m: usize, ring: bool, place: impl Fn(usize, usize) -> [f64; 3]) -> SurfaceMesh {
    let columns = if ring { n } else { n + 1 };
    let positions = (0..=m).flat_map(|j| (0..columns).map(move |i| (i, j))).map(|(i, j)| place(i, j)).collect();
    let at = |i: usize, j: usize| (j * columns + i % columns) as u32;
    let cell = |(i, j): (usize, usize)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    let triangles = (0..m).flat_map(|j| (0..n).map(move |i| (i, j))).flat_map(cell).collect();
    SurfaceMesh::from_parts(positions, triangles)
}

struct Case {
    mesh: SurfaceMesh,
    topology: Topology,
    features: Features,
    partition: Partition,
}

impl Case {
    /// Faces by the sign of a function of their centres.
    fn by_sign(mesh: SurfaceMesh, patch: impl Fn([f64; 3]) -> u32) -> Case {
        let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
        let features = Features { is_feature: vec![false; topology.halfedge_count()], ..Features::default() };
        let centre = |f: usize| {
            let [a, b, c] = mesh.corners(f);
            [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
        };
        let face_patch: Vec<u32> = (0..mesh.triangles.len()).map(|f| patch(centre(f))).collect();
        let patches = summarize_patches(&mesh, &topology, &features, &face_patch);
        let partition = Partition { face_patch, patches, ..Partition::default() };
        Case { mesh, topology, features, partition }
    }

    fn cut(&self) -> CutSurface {
        let token = CancelToken::new();
        cut_along_borders(&self.mesh, &self.topology, &self.features, &self.partition, 4.0, &Work::silent(&token)).unwrap()
    }

    /// What every cut keeps.
    fn check(&self, cut: &CutSurface, name: &str) {
        let count = self.mesh.positions.len();
        assert_eq!(cut.mesh.positions[..count], self.mesh.positions[..], "{name}");
        assert_eq!(cut.topology.totals(), self.topology.totals(), "{name}");
        for (p, at) in cut.mesh.positions[count..].iter().zip(&cut.new_vertices) {
            let [a, b] = at.ends.map(|v| self.mesh.positions[v as usize]);
            assert!((distance(a, *p) + distance(*p, b) - distance(a, b)).abs() < 1e-12 * distance(a, b), "{name}: off its edge");
        }
        // Every face is covered by the faces made of it.
        let area = |mesh: &SurfaceMesh, f: usize| {
            let [a, b, c] = mesh.corners(f);
            triangle_area(a, b, c)
        };
        let mut covered = vec![0.0; self.mesh.triangles.len()];
        for (f, &origin) in cut.face_origin.iter().enumerate() {
            let [a, b, c] = cut.mesh.corners(f);
            assert!(kappa(a, b, c) > 0.0, "{name}: face {f} is flat");
            covered[origin as usize] += area(&cut.mesh, f);
        }
        for (f, covered) in covered.iter().enumerate() {
            let whole = area(&self.mesh, f);
            assert!((covered - whole).abs() < 1e-9 * whole, "{name}: face {f}");
        }
        let features = |f: &Features| f.is_feature.iter().filter(|m| **m).count();
        assert_eq!(features(&cut.features), features(&self.features), "{name}");
        assert_eq!(cut.partition.patches.len(), self.partition.patches.len(), "{name}");
        for (p, (before, after)) in self.partition.patches.iter().zip(&cut.partition.patches).enumerate() {
            assert_eq!((after.genus, after.loops), (0, before.loops), "{name}: patch {p}");
        }
        assert!(cut.border_length[1] <= cut.border_length[0] * (1.0 + 1e-3), "{name}: {:?}", cut.border_length);
        let parts = extract_patches(&cut.mesh, &cut.topology, &cut.partition).unwrap();
        assert_eq!(parts.len(), self.partition.patches.len(), "{name}");
    }
}

fn square(n: usize, jitter: f64) -> SurfaceMesh {
    grid(n, n, false, |i, j| {
        let inside = |k: usize| k > 0 && k < n;
        let shift = if inside(i) && inside(j) { jitter } else { 0.0 };
        [(i as f64 + shift * noise(i, j)) / n as f64, (j as f64 + shift * noise(j, i + n)) / n as f64, 0.0]
    })
}

#[test]
fn a_zigzag_on_a_square_becomes_the_straight_line() {
    for (n, jitter) in [(20, 0.0), (20, 0.3), (41, 0.35)] {
        let case = Case::by_sign(square(n, jitter), |p| u32::from(p[0] > 0.5 + 0.12 * (18.0 * p[1]).sin()));
        let cut = case.cut();
        let name = format!("{n} {jitter}");
        case.check(&cut, &name);
        let network = trace_curves(&cut.topology, &cut.features, &cut.partition);
        let seams: Vec<_> = network.curves.iter().filter(|c| c.kind == crate::curve::CurveKind::Seam).collect();
        assert_eq!(seams.len(), 1, "{name}");
        let ends = [cut.topology.origin(seams[0].halfedges[0]), cut.topology.target(*seams[0].halfedges.last().unwrap())];
        let straight = distance(cut.mesh.positions[ends[0] as usize], cut.mesh.positions[ends[1] as usize]);
        assert!(cut.border_length[0] > 1.2 * straight, "{name}: {:?}", cut.border_length);
        // Crossings that are led through vertices nearby cost a little.
        assert!((cut.border_length[1] / straight - 1.0).abs() < 4e-3, "{name}: {:?} {straight}", cut.border_length);
    }
}

#[test]
fn a_wavy_cut_of_a_tube_becomes_a_circle() {
    for (n, m, jitter) in [(32, 40, 0.0), (40, 50, 0.3), (64, 60, 0.35)] {
        let length = 4.0;
        let mesh = grid(n, m, true, |i, j| {
            let inner = if j > 0 && j < m { jitter } else { 0.0 };
            let angle = TAU * (i as f64 + inner * noise(i, j)) / n as f64;
            [angle.cos(), angle.sin(), length * (j as f64 + inner * noise(j, i + 99)) / m as f64]
        });
        let case = Case::by_sign(mesh, |p| u32::from(p[2] > 2.0 + 0.5 * (2.0 * p[1].atan2(p[0])).sin()));
        let cut = case.cut();
        let name = format!("{n} {m} {jitter}");
        case.check(&cut, &name);
        assert!(cut.border_length[0] > 1.1 * TAU, "{name}: {:?}", cut.border_length);
        assert!((cut.border_length[1] / TAU - 1.0).abs() < 0.01, "{name}: {:?}", cut.border_length);
    }
}

#[test]
fn a_loop_on_a_cone_does_not_slip_off() {
    let mesh = grid(40, 40, true, |i, j| {
        let (angle, r) = (TAU * i as f64 / 40.0, 1.0 - 0.022 * j as f64);
        [r * angle.cos(), r * angle.sin(), 0.1 * j as f64]
    });
    let case = Case::by_sign(mesh, |p| u32::from(p[2] > 2.0 + 0.3 * (3.0 * p[1].atan2(p[0])).sin()));
    let cut = case.cut();
    case.check(&cut, "cone");
    assert!(cut.border_length[1] < cut.border_length[0]);
}

#[test]
fn cuts_keep_patches_on_a_family_of_surfaces() {
    use crate::sample::{SampleKind, SampleSpec, generate};
    let token = CancelToken::new();
    let work = Work::silent(&token);
    for kind in [SampleKind::Artery, SampleKind::Pelvis, SampleKind::Brake, SampleKind::CadPart, SampleKind::Tube] {
        for (max_patch_faces, angle) in [(12_000, Some(40.0)), (400, None)] {
            let mesh = generate(&SampleSpec::new(kind, 4000), &work).unwrap();
            let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
            let spec = crate::features::FeatureSpec { feature_angle_deg: angle, ..Default::default() };
            let features = crate::features::detect_features(&mesh, &topology, &spec, &work).unwrap();
            let spec = PartitionSpec { max_patch_faces, borders: BorderSmoothing::Geodesic, ..PartitionSpec::default() };
            let partition = partition_surface(&mesh, &topology, &features, &spec, &work).unwrap();
            let case = Case { mesh, topology, features, partition };
            let cut = case.cut();
            case.check(&cut, &format!("{kind:?} {max_patch_faces}"));
            assert_eq!(cut, case.cut());
        }
    }
}

/// Borders that close on themselves and turn back over the crossing they start at (some do here) must not lose their end.
#[test]
fn loops_of_a_body_of_high_genus_stay_closed() {
    use crate::partition::PartitionStrategy;
    use crate::sample::{SampleKind, SampleSpec, generate};
    let token = CancelToken::new();
    let work = Work::silent(&token);
    let spec = SampleSpec { genus: Some(20), ..SampleSpec::new(SampleKind::Pelvis, 30_000) };
    let mesh = generate(&spec, &work).unwrap();
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let features = crate::features::detect_features(&mesh, &topology, &Default::default(), &work).unwrap();
    let spec = PartitionSpec { strategy: PartitionStrategy::Pants, borders: BorderSmoothing::Geodesic, ..PartitionSpec::default() };
    let partition = partition_surface(&mesh, &topology, &features, &spec, &work).unwrap();
    let case = Case { mesh, topology, features, partition };
    case.check(&case.cut(), "pelvis of genus 20");
}
