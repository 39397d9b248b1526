//! Planar smoothing: free vertices move to the length-weighted mean of their neighbours in the metric, then flips.

use super::SurfacePoint;
use super::frontal::{Domain, edge_length, minus};
use super::metric::{Metric, inner, length};
use super::triangulation::{NONE, Triangulation, next, orientation, previous};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;

/// Neighbours of a free vertex in order; `None` if its fan is open or it lies on a fixed edge.
pub(super) fn ring(mesh: &Triangulation, v: u32, start: u32, out: &mut Vec<u32>) -> Option<()> {
    out.clear();
    let mut t = start;
    loop {
        let k = mesh.corner(t, v);
        let i = t as usize;
        if mesh.tri[i][k] != v || mesh.fixed[i][next(k)] || mesh.fixed[i][previous(k)] {
            return None;
        }
        out.push(mesh.tri[i][next(k)]);
        t = mesh.adj[i][next(k)];
        if t == NONE || out.len() > 64 {
            return None;
        }
        if t == start {
            return Some(());
        }
    }
}

/// What a move must keep.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Guard {
    /// Only the orientation of the triangles.
    Orientation,
    /// Also this least angle in the metric, in degrees, where it is kept before.
    Angle(f64),
}

/// Largest cosine in the metric around a vertex at `p` with metric `m`.
fn largest_cosine(mesh: &Triangulation, p: Vec2, m: Metric, neighbours: &[u32]) -> f64 {
    let count = neighbours.len();
    let at = |i: usize| mesh.uv[neighbours[i % count] as usize];
    let mut most = -1.0f64;
    for i in 0..count {
        let (a, b) = (minus(at(i), p), minus(at(i + 1), p));
        let e = minus(b, a);
        let (la, lb, le) = (length(m, a), length(m, b), length(m, e));
        most = most.max(inner(m, a, b) / (la * lb)).max(-inner(m, a, e) / (la * le)).max(inner(m, b, e) / (lb * le));
    }
    if most.is_nan() { 1.0 } else { most }
}

/// Where a vertex is moved to.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Aim {
    /// The mean of its neighbours, weighted by the lengths of the edges.
    Mean,
    /// The mean of the places at which each of its edges would be one element long.
    UnitEdges,
}

/// How to smooth.
#[derive(Clone, Copy)]
pub(super) struct Smoothing {
    pub(super) rounds: usize,
    pub(super) aim: Aim,
    pub(super) guard: Guard,
}

impl Smoothing {
    /// Towards the weighted mean, without a guard.
    pub(super) fn plain(rounds: usize) -> Smoothing {
        Smoothing { rounds, aim: Aim::Mean, guard: Guard::Orientation }
    }
}

/// Edges shorter than this push no harder.
const SHORTEST_PULL: f64 = 0.2;

/// Smooths the vertices from `first` on (those before are on curves).
pub(super) fn smooth(
    domain: &Domain<'_>,
    mesh: &mut Triangulation,
    points: &mut [SurfacePoint],
    first: usize,
    how: Smoothing,
    work: &Work<'_>,
) -> Result<()> {
    let Smoothing { rounds, aim, guard } = how;
    let mut neighbours = Vec::new();
    for _ in 0..rounds {
        let mut start = vec![NONE; mesh.uv.len()];
        for (t, v) in mesh.tri.iter().enumerate() {
            v.iter().for_each(|&v| start[v as usize] = t as u32);
        }
        for v in first..mesh.uv.len() {
            if v % 4096 == 0 {
                work.check()?;
            }
            if start[v] == NONE || ring(mesh, v as u32, start[v], &mut neighbours).is_none() {
                continue;
            }
            let mut sum = [0.0; 3];
            let x = mesh.uv[v];
            for &w in &neighbours {
                let l = edge_length(mesh, v as u32, w);
                let p = mesh.uv[w as usize];
                let (weight, at) = match aim {
                    Aim::Mean => (l, p),
                    Aim::UnitEdges => (1.0, [0, 1].map(|k| p[k] + (x[k] - p[k]) / l.max(SHORTEST_PULL))),
                };
                sum = [sum[0] + weight * at[0], sum[1] + weight * at[1], sum[2] + weight];
            }
            if sum[2].is_nan() || sum[2] <= 0.0 {
                continue;
            }
            let goal = [sum[0] / sum[2], sum[1] / sum[2]];
            let here = mesh.uv[v];
            for share in [1.0, 0.5] {
                let p = [0, 1].map(|k| here[k] + share * (goal[k] - here[k]));
                let count = neighbours.len();
                let corner = |i: usize| mesh.uv[neighbours[i] as usize];
                if (0..count).all(|i| orientation(p, corner(i), corner((i + 1) % count)) > 0.0) {
                    let (point, metric) = domain.sample(p, points[v].face);
                    if let Guard::Angle(angle) = guard {
                        let before = largest_cosine(mesh, here, mesh.metric[v], &neighbours);
                        if largest_cosine(mesh, p, metric, &neighbours) > before.max(angle.to_radians().cos()) {
                            continue;
                        }
                    }
                    points[v] = point;
                    mesh.uv[v] = p;
                    mesh.metric[v] = metric;
                    break;
                }
            }
        }
        mesh.flip_all();
    }
    Ok(())
}
