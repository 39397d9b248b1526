//! Charts of surfaces whose maps are known, and of surfaces made to defeat them.

use super::domain::Domain;
use super::system::{Form, plan_as};
use super::validity::{self, find_overlap};
use super::*;
use crate::error::Reason;
use crate::topology::Topology;
use crate::vector::{Vec2, Vec3, add, cross, distance, dot, norm, scale, sub, triangle_area};
use crate::work::CancelToken;
use remesh_linalg::Complex;
use std::f64::consts::TAU;

mod checks;
mod conditions;
mod injective;
mod maps;
mod mends;
mod reference;

const METHODS: [ChartMethod; 5] = ChartMethod::ALL;
const FREE: [ChartMethod; 2] = [ChartMethod::SpectralConformal, ChartMethod::LeastSquaresConformal];

fn patch(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Patch {
    let topology = Topology::build(&triangles, positions.len()).unwrap();
    let mut loops: Vec<Vec<u32>> = topology.loops.iter().map(|l| l.iter().map(|&h| topology.origin(h)).collect()).collect();
    let length =
        |l: &Vec<u32>| (0..l.len()).map(|k| distance(positions[l[k] as usize], positions[l[(k + 1) % l.len()] as usize])).sum::<f64>();
    loops.sort_by(|a, b| length(b).total_cmp(&length(a)));
    Patch { positions, triangles, loops }
}

/// A deterministic number in [0, 1).
fn noise(seed: u32) -> f64 {
    let mut x = seed.wrapping_mul(0x9E37_79B9) ^ 0x5bd1_e995;
    for _ in 0..3 {
        x ^= x << 13;
        x ^= x >> 17;
        x ^= x << 5;
    }
    f64::from(x >> 4) / f64::from(1u32 << 28)
}

/// A grid of `nu` x `nv` quads over the unit square with jittered inner vertices and random diagonals, mapped by `to`.
/// With `wrapped`, u = 1 is u = 0.
fn grid(nu: u32, nv: u32, wrapped: bool, jitter: f64, to: impl Fn(f64, f64) -> Vec3) -> Patch {
    let columns = if wrapped { nu } else { nu + 1 };
    let id = |i: u32, j: u32| j * columns + i % columns;
    let mut positions = Vec::new();
    for j in 0..=nv {
        for i in 0..columns {
            let inner = (wrapped || (i > 0 && i < nu)) && j > 0 && j < nv;
            let shake = |s: u32| if inner { jitter * (noise(2 * id(i, j) + s) - 0.5) } else { 0.0 };
            positions.push(to((f64::from(i) + shake(0)) / f64::from(nu), (f64::from(j) + shake(1)) / f64::from(nv)));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..nv {
        for i in 0..nu {
            let (a, b, c, d) = (id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
            let halves = if noise(7919 * (j * nu + i)) < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            triangles.extend(halves);
        }
    }
    patch(positions, triangles)
}

/// A rotation, a scaling and a shift of space.
fn pose(seed: u32, size: f64, p: Vec3) -> Vec3 {
    let axis = |k: u32| [0, 1, 2].map(|c| noise(100 * seed + 10 * k + c) - 0.5);
    let first = scale(axis(0), 1.0 / norm(axis(0)));
    let second = cross(first, axis(1));
    let second = scale(second, 1.0 / norm(second));
    let third = cross(first, second);
    let turned = add(add(scale(first, p[0]), scale(second, p[1])), scale(third, p[2]));
    add(scale(turned, size), scale(axis(2), 3.0 * size))
}

fn outcome(patch: &Patch, spec: ChartSpec) -> Result<ChartOutcome> {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    parametrize_patch(patch, &spec, &work)
}

fn chart(patch: &Patch, spec: ChartSpec) -> Chart {
    match outcome(patch, spec).unwrap() {
        ChartOutcome::Mapped(chart) => chart,
        other => panic!("no chart: {other:?}"),
    }
}

fn plane_area(uv: &[Vec2], t: [u32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| uv[v as usize]);
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}

/// What every chart promises: orientation, area, injectivity by counting the faces over random points.
fn assert_promises(patch: &Patch, chart: &Chart) {
    let surface: f64 = patch
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| patch.positions[v as usize]);
            triangle_area(a, b, c)
        })
        .sum();
    let plane: f64 = patch.triangles.iter().map(|&t| plane_area(&chart.uv, t)).sum();
    assert!((plane / surface - 1.0).abs() < 1e-6, "areas {plane} and {surface}");
    assert!(patch.triangles.iter().all(|&t| plane_area(&chart.uv, t) > 0.0));
    let last = chart.attempts.last().unwrap();
    assert!(last.rejected.is_empty() && last.method == chart.method && last.flipped == 0 && !last.overlaps);
    for k in 0..40 {
        let t = patch.triangles[(noise(k) * patch.triangles.len() as f64) as usize].map(|v| chart.uv[v as usize]);
        let p = [0, 1].map(|c| 0.31 * t[0][c] + 0.46 * t[1][c] + 0.23 * t[2][c]);
        let holds = |t: &&[u32; 3]| {
            let c = t.map(|v| chart.uv[v as usize]);
            (0..3).all(|k| validity::orientation(c[k], c[(k + 1) % 3], p) > 0.0)
        };
        assert!(patch.triangles.iter().filter(holds).count() <= 1, "a point is covered twice");
    }
}

/// Largest relative deviation of a chart edge from the surface edge.
fn length_error(patch: &Patch, chart: &Chart) -> f64 {
    let edge = |&[a, b]: &[u32; 2]| {
        let (p, q) = (chart.uv[a as usize], chart.uv[b as usize]);
        let plane = (p[0] - q[0]).hypot(p[1] - q[1]);
        (plane / distance(patch.positions[a as usize], patch.positions[b as usize]) - 1.0).abs()
    };
    patch.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).map(|e| edge(&e)).fold(0.0, f64::max)
}
