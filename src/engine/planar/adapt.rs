//! Local modification under the metric: long edges are split, short ones collapsed, edges swapped until Delaunay in the metric,
//! vertices smoothed, until nothing changes.

use super::SurfacePoint;
use super::frontal::{Domain, edge_length};
use super::metric::length;
use super::smooth::{Aim, Guard, Smoothing, ring, smooth};
use super::triangulation::{NONE, Triangulation, next, orientation, previous};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;

/// Edges longer than this many sizes are split.
const LONG: f64 = 1.4;
/// Edges shorter than this many sizes are collapsed.
const SHORT: f64 = 0.7;
/// Rounds of all operations.
const ROUNDS: usize = 8;
/// Sweeps of splits in a round: each halves the longest edges.
const SWEEPS: usize = 48;

/// Adapts the mesh of a chart. Vertices before `first` lie on curves: they stay, and so do the fixed edges. Near-linear: the rounds are
/// bounded, each is O(T log T).
pub(super) fn adapt(
    domain: &Domain<'_>,
    mesh: &mut Triangulation,
    points: &mut Vec<SurfacePoint>,
    first: usize,
    aim: Aim,
    work: &Work<'_>,
) -> Result<()> {
    for round in 0..ROUNDS {
        let split = split_long(domain, mesh, points, work)?;
        if mesh.uv.len() > domain.most {
            break;
        }
        let gone = collapse_short(mesh, points, first, work)?;
        mesh.flip_all();
        smooth(domain, mesh, points, first, Smoothing { rounds: 2, aim, guard: Guard::Orientation }, work)?;
        // Most of what is left to do after the first rounds is exchange of the same few edges.
        if (split + gone) * 200 < mesh.tri.len() && round > 0 {
            break;
        }
    }
    Ok(())
}

/// One `(length, triangle, edge)` for every edge that may be changed and is wanted.
fn edges(mesh: &Triangulation, wanted: impl Fn(f64) -> bool) -> Vec<(f64, u32, u32, u32)> {
    let mut list = Vec::new();
    for t in 0..mesh.tri.len() {
        for k in 0..3 {
            let u = mesh.adj[t][k];
            if u == NONE || mesh.fixed[t][k] || u < t as u32 {
                continue;
            }
            let (a, b) = (mesh.tri[t][next(k)], mesh.tri[t][previous(k)]);
            let l = edge_length(mesh, a, b);
            if wanted(l) {
                list.push((l, t as u32, a, b));
            }
        }
    }
    list
}

/// Splits long edges, longest first, until there are none; returns how many.
fn split_long(domain: &Domain<'_>, mesh: &mut Triangulation, points: &mut Vec<SurfacePoint>, work: &Work<'_>) -> Result<usize> {
    let mut total = 0;
    let mut touched = Vec::new();
    for _ in 0..SWEEPS {
        let mut long = edges(mesh, |l| l > LONG);
        long.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        let before = mesh.uv.len();
        let mut done = vec![false; mesh.tri.len()];
        for (i, &(_, t, a, b)) in long.iter().enumerate() {
            if i.is_multiple_of(1024) {
                work.check()?;
            }
            if mesh.uv.len() > domain.most {
                return Ok(total + mesh.uv.len() - before);
            }
            let Some(k) = mesh.edge_of(t, a, b) else { continue };
            let u = mesh.adj[t as usize][k];
            // One split for a triangle in a sweep: the longest of its edges.
            let is_done = |t: u32| done.get(t as usize).copied().unwrap_or(true);
            if u == NONE || is_done(t) || is_done(u) {
                continue;
            }
            if split_edge(domain, mesh, points, (t, k), &mut touched) {
                touched.iter().for_each(|&t| {
                    if let Some(d) = done.get_mut(t as usize) {
                        *d = true;
                    }
                });
            }
        }
        let added = mesh.uv.len() - before;
        total += added;
        if added == 0 {
            break;
        }
    }
    Ok(total)
}

/// Splits an edge where its two halves are equal in the metric, if all four triangles come out positive.
fn split_edge(
    domain: &Domain<'_>,
    mesh: &mut Triangulation,
    points: &mut Vec<SurfacePoint>,
    (t, k): (u32, usize),
    touched: &mut Vec<u32>,
) -> bool {
    let u = mesh.adj[t as usize][k];
    let (a, b) = (mesh.tri[t as usize][next(k)], mesh.tri[t as usize][previous(k)]);
    let (p, q) = (mesh.uv[a as usize], mesh.uv[b as usize]);
    let e = [q[0] - p[0], q[1] - p[1]];
    let (at_a, at_b) = (length(mesh.metric[a as usize], e), length(mesh.metric[b as usize], e));
    if !(at_a > 0.0 && at_b > 0.0) {
        return false;
    }
    let s = (at_b.sqrt() / (at_a.sqrt() + at_b.sqrt())).clamp(0.25, 0.75);
    let x = [p[0] + s * e[0], p[1] + s * e[1]];
    let (c, d) = (mesh.uv[mesh.tri[t as usize][k] as usize], mesh.far_corner(t, u).map(|v| mesh.uv[v as usize]));
    let Some(d) = d else { return false };
    let positive = [(c, p, x), (c, x, q), (d, q, x), (d, x, p)].into_iter().all(|(a, b, c)| orientation(a, b, c) > 0.0);
    if !positive {
        return false;
    }
    let (point, metric) = domain.sample(x, points[a as usize].face);
    touched.clear();
    points.push(point);
    mesh.insert(x, metric, &super::triangulation::Found::OnEdge(t, k), touched);
    true
}

/// Collapses short edges, shortest first, where no edge becomes long and no triangle turns over; returns how many. Renumbers.
fn collapse_short(mesh: &mut Triangulation, points: &mut Vec<SurfacePoint>, first: usize, work: &Work<'_>) -> Result<usize> {
    let mut short = edges(mesh, |l| l < SHORT);
    short.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    let mut start = vec![NONE; mesh.uv.len()];
    for (t, v) in mesh.tri.iter().enumerate() {
        v.iter().for_each(|&v| start[v as usize] = t as u32);
    }
    let mut dead = vec![false; mesh.tri.len()];
    let mut gone = vec![false; mesh.uv.len()];
    let mut count = 0;
    let mut fan = Vec::new();
    for (i, &(_, _, a, b)) in short.iter().enumerate() {
        if i.is_multiple_of(1024) {
            work.check()?;
        }
        for (v, w) in [(a, b), (b, a)] {
            if (v as usize) < first || gone[v as usize] || gone[w as usize] || start[v as usize] == NONE {
                continue;
            }
            if ring(mesh, v, start[v as usize], &mut fan).is_some() && may_collapse(mesh, w, &fan) {
                collapse(mesh, (v, w), &mut start, &mut dead);
                gone[v as usize] = true;
                count += 1;
                break;
            }
        }
    }
    if count > 0 {
        mesh.compact(&dead);
        let kept = mesh.drop_vertices(&gone);
        *points = kept.iter().map(|&v| points[v as usize]).collect();
    }
    Ok(count)
}

/// Whether the vertex in the middle of a fan may go to its neighbour `w`.
fn may_collapse(mesh: &Triangulation, w: u32, fan: &[u32]) -> bool {
    let Some(at) = fan.iter().position(|&x| x == w) else { return false };
    let n = fan.len();
    let p = mesh.uv[w as usize];
    let corner = |i: usize| -> Vec2 { mesh.uv[fan[(at + i) % n] as usize] };
    (1..n - 1).all(|i| orientation(p, corner(i), corner(i + 1)) > 0.0) && (2..n - 1).all(|i| edge_length(mesh, w, fan[(at + i) % n]) < LONG)
}

/// Moves all of `v` to its neighbour `w`.
fn collapse(mesh: &mut Triangulation, (v, w): (u32, u32), start: &mut [u32], dead: &mut [bool]) {
    let begin = start[v as usize];
    let mut fan = Vec::new();
    let mut t = begin;
    loop {
        fan.push(t);
        t = mesh.adj[t as usize][next(mesh.corner(t, v))];
        if t == begin {
            break;
        }
    }
    for &t in &fan {
        let i = t as usize;
        if !mesh.tri[i].contains(&w) {
            continue;
        }
        // The two triangles at the edge close: what lies beyond their other two edges meets.
        let (kv, kw) = (mesh.corner(t, v), mesh.corner(t, w));
        let (beyond_v, beyond_w) = (mesh.adj[i][kw], mesh.adj[i][kv]);
        let fixed = mesh.fixed[i][kv];
        mesh.join(t, (beyond_v, beyond_w), fixed);
        dead[i] = true;
    }
    for &t in &fan {
        if !dead[t as usize] {
            let k = mesh.corner(t, v);
            mesh.tri[t as usize][k] = w;
        }
    }
    for &t in &fan {
        if !dead[t as usize] {
            mesh.tri[t as usize].iter().for_each(|&x| start[x as usize] = t);
        }
    }
    start[v as usize] = NONE;
}
