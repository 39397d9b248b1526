//! Charts that libigl computed of two generated patches, to compare ours with. The numbers are measured facts; what they satisfy is
//! checked here with formulas of our own, so that a wrong table cannot teach a wrong map.

use super::*;
use crate::parametrize::outer::place_outer;

/// Written by `benches/libigl_reference.py`.
#[rustfmt::skip]
mod data;

/// A patch with libigl's charts of it.
pub(super) struct Reference {
    /// For messages.
    pub(super) name: &'static str,
    /// The patch.
    pub(super) patch: Patch,
    /// Both with targets.
    pub(super) pins: [Pin; 2],
    /// `igl.lscm` with these pins: one point per vertex.
    pub(super) lscm: Vec<Vec2>,
    /// The vertex of the boundary that `igl.map_vertices_to_circle` puts at angle 0.
    pub(super) start: u32,
    /// Vertices of the boundary, in loop direction from `start`, and where that function puts them on the unit circle.
    pub(super) circle: Vec<(u32, Vec2)>,
    /// `igl.harmonic` (k = 1, cotangent weights) with that boundary: one point per vertex.
    pub(super) harmonic: Vec<Vec2>,
}

/// A dome (84 vertices) and a wavy sheet (112), both discs with irregular triangles.
pub(super) fn references() -> [Reference; 2] {
    let of = |name, positions: &[Vec3], triangles: &[[u32; 3]], ring: &[u32], circle: &[Vec2]| Reference {
        name,
        patch: patch(positions.to_vec(), triangles.to_vec()),
        pins: [Pin { vertex: 0, target: None }; 2],
        lscm: Vec::new(),
        start: ring[0],
        circle: ring.iter().copied().zip(circle.iter().copied()).collect(),
        harmonic: Vec::new(),
    };
    let pins = |vertices: [u32; 2], targets: [Vec2; 2]| [0, 1].map(|k| Pin { vertex: vertices[k], target: Some(targets[k]) });
    [
        Reference {
            pins: pins(data::DOME_PINS, data::DOME_TARGETS),
            lscm: data::DOME_LSCM.to_vec(),
            harmonic: data::DOME_HARMONIC.to_vec(),
            ..of("dome", &data::DOME_POSITIONS, &data::DOME_TRIANGLES, &data::DOME_LOOP, &data::DOME_CIRCLE)
        },
        Reference {
            pins: pins(data::WAVES_PINS, data::WAVES_TARGETS),
            lscm: data::WAVES_LSCM.to_vec(),
            harmonic: data::WAVES_HARMONIC.to_vec(),
            ..of("waves", &data::WAVES_POSITIONS, &data::WAVES_TRIANGLES, &data::WAVES_LOOP, &data::WAVES_CIRCLE)
        },
    ]
}

/// Largest distance of corresponding points, over the largest distance of a point of `wanted` from their mean.
pub(super) fn deviation(points: &[Vec2], wanted: &[Vec2]) -> f64 {
    assert_eq!(points.len(), wanted.len());
    let centre = mean(wanted);
    let far = |a: &Vec2, b: &Vec2| (a[0] - b[0]).hypot(a[1] - b[1]);
    let size = wanted.iter().map(|p| far(p, &centre)).fold(0.0, f64::max);
    points.iter().zip(wanted).map(|(p, q)| far(p, q)).fold(0.0, f64::max) / size
}

/// [`deviation`] after the rotation, scaling and shift (no reflection) of `points` that fits `wanted` best by least squares: what is
/// left when two charts of the same shape are scaled and placed differently.
pub(super) fn deviation_aligned(points: &[Vec2], wanted: &[Vec2]) -> f64 {
    let (from, to) = (mean(points), mean(wanted));
    let (mut re, mut im, mut norm) = (0.0, 0.0, 0.0);
    for (p, q) in points.iter().zip(wanted) {
        let (x, y, u, v) = (p[0] - from[0], p[1] - from[1], q[0] - to[0], q[1] - to[1]);
        (re, im, norm) = (re + u * x + v * y, im + v * x - u * y, norm + x * x + y * y);
    }
    let (a, b) = (re / norm, im / norm);
    let moved = |p: &Vec2| {
        let (x, y) = (p[0] - from[0], p[1] - from[1]);
        [to[0] + a * x - b * y, to[1] + b * x + a * y]
    };
    deviation(&points.iter().map(moved).collect::<Vec<Vec2>>(), wanted)
}

fn mean(points: &[Vec2]) -> Vec2 {
    let n = points.len() as f64;
    points.iter().fold([0.0; 2], |s, p| [s[0] + p[0] / n, s[1] + p[1] / n])
}

/// Gradient of the Dirichlet energy (cotangents from scalar and vector products), one vector per vertex.
fn dirichlet_gradient(patch: &Patch, uv: &[Vec2]) -> Vec<Vec2> {
    let mut out = vec![[0.0; 2]; uv.len()];
    for t in &patch.triangles {
        for k in 0..3 {
            let [apex, i, j] = [0, 1, 2].map(|s| t[(k + s) % 3] as usize);
            let (a, b) = (sub(patch.positions[i], patch.positions[apex]), sub(patch.positions[j], patch.positions[apex]));
            let weight = 0.5 * dot(a, b) / norm(cross(a, b));
            for c in 0..2 {
                let flow = weight * (uv[i][c] - uv[j][c]);
                out[i][c] += flow;
                out[j][c] -= flow;
            }
        }
    }
    out
}

/// Largest component of some vectors at the vertices where `free` says so.
fn largest(vectors: &[Vec2], free: impl Fn(u32) -> bool) -> f64 {
    (0..vectors.len()).filter(|&v| free(v as u32)).flat_map(|v| vectors[v]).fold(0.0, |m: f64, x| m.max(x.abs()))
}

#[test]
fn the_reference_charts_are_stationary_where_they_are_free() {
    for r in references() {
        let ring = &r.patch.loops[0];
        assert_eq!((r.patch.loops.len(), ring.len()), (1, r.circle.len()));
        let harmonic = dirichlet_gradient(&r.patch, &r.harmonic);
        assert!(largest(&harmonic, |v| !ring.contains(&v)) < 1e-13, "{}", r.name);
        assert!(r.circle.iter().all(|&(v, p)| deviation(&[r.harmonic[v as usize], [0.0; 2]], &[p, [0.0; 2]]) < 1e-15));
        // The energy of LSCM is Dirichlet minus area; the area depends on the boundary only (P1 eq. 17 to 22).
        let mut conformal = dirichlet_gradient(&r.patch, &r.lscm);
        for k in 0..ring.len() {
            let (before, after) = (r.lscm[ring[(k + ring.len() - 1) % ring.len()] as usize], r.lscm[ring[(k + 1) % ring.len()] as usize]);
            let gradient = &mut conformal[ring[k] as usize];
            *gradient = [gradient[0] - 0.5 * (after[1] - before[1]), gradient[1] - 0.5 * (before[0] - after[0])];
        }
        assert!(largest(&conformal, |v| r.pins.iter().all(|p| p.vertex != v)) < 1e-13, "{}", r.name);
        assert!(r.pins.iter().all(|p| p.target == Some(r.lscm[p.vertex as usize])));
    }
}

#[test]
fn our_circle_is_that_of_the_reference() {
    for r in references() {
        let ring: Vec<u32> = r.circle.iter().map(|e| e.0).collect();
        let boundary = Boundary { start: Some(r.start), ..Boundary::default() };
        let ours = place_outer(&ring, &r.patch.positions, &boundary).unwrap();
        let theirs: Vec<Vec2> = r.circle.iter().map(|e| e.1).collect();
        assert!(deviation(&ours, &theirs) < 1e-14, "{}: {:e}", r.name, deviation(&ours, &theirs));
    }
}

#[test]
fn similar_charts_are_aligned_and_others_are_not() {
    let [r, _] = references();
    let turned: Vec<Vec2> = r.lscm.iter().map(|p| [3.0 - 2.0 * p[1] + p[0], 2.0 * p[0] + p[1] - 7.0]).collect();
    assert!(deviation_aligned(&turned, &r.lscm) < 1e-14 && deviation(&turned, &r.lscm) > 0.1);
    let mirrored: Vec<Vec2> = r.lscm.iter().map(|p| [-p[0], p[1]]).collect();
    assert!(deviation_aligned(&mirrored, &r.lscm) > 0.1 && deviation_aligned(&r.harmonic, &r.lscm) > 1e-3);
}

/// Compares the charts of a solver with those of libigl: LSCM with pinned targets as it is, LSCM with free targets and the harmonic map
/// after alignment, as charts are scaled to the area of the patch. `solve` returns one point per vertex.
pub(super) fn assert_agree(solve: impl Fn(&Reference, ChartSpec) -> Vec<Vec2>) {
    for r in references() {
        let lscm = |pins: [Pin; 2]| ChartSpec { pins: Pins::Given(pins.to_vec()), ..ChartSpec::only(ChartMethod::LeastSquaresConformal) };
        let held = deviation(&solve(&r, lscm(r.pins)), &r.lscm);
        let free = deviation_aligned(&solve(&r, lscm(r.pins.map(|p| Pin { target: None, ..p }))), &r.lscm);
        let boundary = Boundary { start: Some(r.start), ..Boundary::default() };
        let harmonic = solve(&r, ChartSpec { boundary, ..ChartSpec::only(ChartMethod::Harmonic) });
        let harmonic = deviation_aligned(&harmonic, &r.harmonic);
        assert!(held.max(free).max(harmonic) < 1e-6, "{}: LSCM {held:e} and {free:e}, harmonic {harmonic:e}", r.name);
    }
}

#[test]
fn the_comparison_takes_similar_charts() {
    assert_agree(|r, spec| {
        assert!(spec.validate().is_ok());
        let held = matches!(&spec.pins, Pins::Given(pins) if pins[0].target.is_some());
        let size = if held { 1.0 } else { 2.5 };
        let uv = if spec.method == Some(ChartMethod::Harmonic) { &r.harmonic } else { &r.lscm };
        uv.iter().map(|p| [-size * p[1], size * p[0]]).map(|p| if held { [p[1], -p[0]] } else { p }).collect()
    });
}
