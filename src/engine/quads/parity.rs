//! An even number of triangles in every part between curves: only then can all of them be joined in pairs.

use super::QuadInput;
use super::mixed::{Mixed, NONE};
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::optimize::input::{Input, middle};
use crate::topology::Topology;
use crate::vector::{Vec3, distance, lerp};
use crate::work::Work;
use std::collections::VecDeque;

/// What the length of an edge counts where a face at it has all corners on curves.
const NARROW: f64 = 0.25;

/// Splits edges of curves where a part between curves has an odd number of triangles: at the boundary of the surface, or on the way to
/// another odd part, at most one edge between two parts that meet. Edges between two vertices that stay are not split: `stays` is given
/// their position and the face of the input below.
///
/// The number of triangles of a part and that of the edges around it are both even or both odd, whatever is done inside later.
pub(super) fn make_even(mesh: &mut Mixed, input: &QuadInput<'_>, stays: impl Fn(Vec3, u32) -> bool, work: &Work<'_>) -> Result<()> {
    work.check()?;
    let triangles: Vec<[u32; 3]> = mesh.faces.iter().map(|f| [f[0], f[1], f[2]]).collect();
    let topology = Topology::build(&triangles, mesh.position.len())?;
    work.check()?;
    let edges = Parts::new(mesh, &topology).edges_to_split(mesh, &topology, |v| stays(mesh.position[v as usize], mesh.below[v as usize]));
    if edges.is_empty() {
        return Ok(());
    }
    let segments: Vec<[u32; 3]> = input.curves.iter().map(|&[a, b]| [a, b, b]).collect();
    let curves = TriangleBvh::build(&input.mesh.positions, &segments);
    work.check()?;
    let mut gone = Vec::new();
    let mut halves = Vec::new();
    for h in edges {
        let (a, b) = (topology.origin(h), topology.target(h));
        halves.extend(split(mesh, [a, b], input, &curves));
        gone.push([a.min(b), a.max(b)]);
    }
    gone.sort_unstable();
    mesh.curve_edges.retain(|e| gone.binary_search(e).is_err());
    mesh.curve_edges.extend(halves);
    mesh.curve_edges.sort_unstable();
    Ok(())
}

/// Puts a vertex into every triangle that every possible partner would make a quadrangle with a flat corner on a curve of: those in the
/// middle of a fan of triangles that stand on a curve. Adds two triangles each time, so that parts stay even.
pub(super) fn loosen(mesh: &mut Mixed, surface: &Input<'_>, work: &Work<'_>) -> Result<()> {
    for f in 0..mesh.faces.len() as u32 {
        if f.is_multiple_of(1024) {
            work.check()?;
        }
        if !is_stuck(mesh, f) {
            continue;
        }
        let [a, b, c, _] = mesh.faces[f as usize];
        let foot = surface.walk(middle([a, b, c].map(|v| mesh.position[v as usize])), mesh.below[a as usize]);
        let m = mesh.add_vertex(foot.position, foot.face, false);
        mesh.replace(&[f], &[[a, b, m, NONE], [b, c, m, NONE], [c, a, m, NONE]]);
    }
    Ok(())
}

fn is_stuck(mesh: &Mixed, f: u32) -> bool {
    let [a, b, c, _] = mesh.faces[f as usize];
    let edges = [[a, b, c], [b, c, a], [c, a, b]];
    let is_open = |&[a, b, apex]: &[u32; 3]| {
        let other = mesh.across(f, a, b).filter(|&g| !mesh.is_curve(a, b) && mesh.label[g as usize][1] == mesh.label[f as usize][1]);
        let far = other.and_then(|g| mesh.corners(g).iter().copied().find(|v| *v != a && *v != b));
        far.is_some_and(|far| far != apex && !mesh.is_pinned_flat(&[a, far, b, apex]))
    };
    edges.iter().any(|&[a, b, _]| mesh.is_curve(a, b)) && !edges.iter().any(is_open)
}

/// Parts of a surface between its curves.
struct Parts {
    /// Part of each face.
    of_face: Vec<u32>,
    is_odd: Vec<bool>,
}

impl Parts {
    fn new(mesh: &Mixed, topology: &Topology) -> Parts {
        let mut parts = Parts { of_face: vec![NONE; topology.face_count()], is_odd: Vec::new() };
        let mut stack = Vec::new();
        for first in 0..topology.face_count() as u32 {
            if parts.of_face[first as usize] != NONE {
                continue;
            }
            let part = parts.is_odd.len() as u32;
            parts.of_face[first as usize] = part;
            stack.push(first);
            let mut count = 0usize;
            while let Some(f) = stack.pop() {
                count += 1;
                for h in 3 * f..3 * f + 3 {
                    let Some(g) = topology.twin(h).map(|t| topology.face(t)) else { continue };
                    if parts.of_face[g as usize] == NONE && !mesh.is_curve(topology.origin(h), topology.target(h)) {
                        parts.of_face[g as usize] = part;
                        stack.push(g);
                    }
                }
            }
            parts.is_odd.push(count % 2 == 1);
        }
        parts
    }

    /// Halfedges of the edges to split: along a spanning forest of the parts, rooted at the boundary of the surface where there is
    /// one, from the leaves on.
    fn edges_to_split(&self, mesh: &Mixed, topology: &Topology, stays: impl Fn(u32) -> bool) -> Vec<u32> {
        if !self.is_odd.contains(&true) {
            return Vec::new();
        }
        let links = self.links(mesh, topology, stays);
        let outside = self.is_odd.len() as u32;
        let mut above: Vec<Option<(u32, u32)>> = vec![None; self.is_odd.len() + 1];
        let mut seen = vec![false; self.is_odd.len() + 1];
        let mut order = Vec::new();
        let mut queue = VecDeque::new();
        for root in std::iter::once(outside).chain(0..outside) {
            if std::mem::replace(&mut seen[root as usize], true) {
                continue;
            }
            queue.push_back(root);
            while let Some(part) = queue.pop_front() {
                order.push(part);
                let from = links.partition_point(|l| l.0 < part);
                for &(_, next, h) in links[from..].iter().take_while(|l| l.0 == part) {
                    if !std::mem::replace(&mut seen[next as usize], true) {
                        above[next as usize] = Some((part, h));
                        queue.push_back(next);
                    }
                }
            }
        }
        let mut is_odd = self.is_odd.clone();
        is_odd.push(false);
        let mut out = Vec::new();
        for &part in order.iter().rev() {
            if let Some((parent, h)) = above[part as usize].filter(|_| is_odd[part as usize]) {
                is_odd[parent as usize] ^= true;
                out.push(h);
            }
        }
        out
    }

    /// `(part, other part or outside, halfedge of the longest edge between them)`, both ways, sorted.
    fn links(&self, mesh: &Mixed, topology: &Topology, stays: impl Fn(u32) -> bool) -> Vec<(u32, u32, u32)> {
        let mut all: Vec<(u32, u32, f64, u32)> = Vec::new();
        for h in 0..topology.halfedge_count() as u32 {
            let (a, b) = (topology.origin(h), topology.target(h));
            let here = self.of_face[topology.face(h) as usize];
            let there = topology.twin(h).map_or(self.is_odd.len() as u32, |t| self.of_face[topology.face(t) as usize]);
            if here == there || (stays(a) && stays(b)) {
                continue;
            }
            let tip = |h: u32| topology.target(topology.next(h));
            let in_narrow = std::iter::once(h).chain(topology.twin(h)).any(|h| mesh.is_fixed[tip(h) as usize]);
            let length = distance(mesh.position[a as usize], mesh.position[b as usize]) * if in_narrow { NARROW } else { 1.0 };
            all.push((here, there, length, h));
            if topology.twin(h).is_none() {
                all.push((there, here, length, h));
            }
        }
        all.sort_unstable_by(|x, y| (x.0, x.1).cmp(&(y.0, y.1)).then(y.2.total_cmp(&x.2)).then(x.3.cmp(&y.3)));
        all.dedup_by_key(|l| (l.0, l.1));
        all.into_iter().map(|(from, to, _, h)| (from, to, h)).collect()
    }
}

/// Splits the edge of a halfedge of the mesh before all splits (a face may have been split at another edge since) and lists its halves.
fn split(mesh: &mut Mixed, [a, b]: [u32; 2], input: &QuadInput<'_>, curves: &TriangleBvh) -> [[u32; 2]; 2] {
    let (position, below) = middle_on_curve(mesh, a, b, input, curves);
    let m = mesh.add_vertex(position, below, true);
    let both: Vec<u32> = mesh.around[a as usize].iter().copied().filter(|&f| mesh.corners(f).contains(&b)).collect();
    for f in both {
        let face = mesh.faces[f as usize];
        let with_middle_for = |gone: u32| face.map(|v| if v == gone { m } else { v });
        mesh.replace(&[f], &[with_middle_for(b), with_middle_for(a)]);
    }
    [[a.min(m), a.max(m)], [b.min(m), b.max(m)]]
}

/// The point of the input's curves nearest to the middle of an edge; the middle, on the surface, where that is far from them.
fn middle_on_curve(mesh: &Mixed, a: u32, b: u32, input: &QuadInput<'_>, curves: &TriangleBvh) -> (Vec3, u32) {
    let (p, q) = (mesh.position[a as usize], mesh.position[b as usize]);
    let half = lerp(p, q, 0.5);
    let near = 0.0625 * distance(p, q).powi(2);
    let hit = curves.closest_below(half, near, 0.0).map_or(half, |hit| hit.position);
    input.tree.closest(hit).map_or((half, mesh.below[a as usize]), |on| (on.position, on.face))
}
