//! Planar smoothing: free vertices move to the length-weighted mean of their neighbours in the metric, then flips.

use super::SurfacePoint;
use super::frontal::{Domain, edge_length};
use super::triangulation::{NONE, Triangulation, next, orientation, previous};
use crate::error::Result;
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

/// Smooths the vertices from `first` on (those before are on curves).
pub(super) fn smooth(
    domain: &Domain<'_>,
    mesh: &mut Triangulation,
    points: &mut [SurfacePoint],
    first: usize,
    rounds: usize,
    work: &Work<'_>,
) -> Result<()> {
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
            for &w in &neighbours {
                let weight = edge_length(mesh, v as u32, w);
                let p = mesh.uv[w as usize];
                sum = [sum[0] + weight * p[0], sum[1] + weight * p[1], sum[2] + weight];
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
