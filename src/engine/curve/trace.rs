//! Tracing: from marked edges to maximal chains.

use super::{Curve, CurveKind, CurveNetwork};
use crate::features::Features;
use crate::partition::Partition;
use crate::topology::Topology;
use std::collections::BTreeMap;

/// What must be equal for two edges to continue one another: kind and the patches beside the edge, lower first.
type Label = (CurveKind, u32, u32);

const NO_PATCH: u32 = u32::MAX;

fn label(topology: &Topology, features: &Features, partition: &Partition, h: u32) -> Option<Label> {
    let left = partition.face_patch[topology.face(h) as usize];
    let Some(twin) = topology.twin(h) else {
        return Some((CurveKind::Boundary, left, NO_PATCH));
    };
    let right = partition.face_patch[topology.face(twin) as usize];
    let pair = (left.min(right), left.max(right));
    if features.is_feature[h as usize] {
        Some((CurveKind::Feature, pair.0, pair.1))
    } else if left != right {
        Some((CurveKind::Seam, pair.0, pair.1))
    } else {
        None
    }
}

/// The curve edges at the vertices: for each vertex the representatives of its curve edges.
struct Incidence {
    start: Vec<u32>,
    edges: Vec<u32>,
    cut: Vec<bool>,
}

impl Incidence {
    fn new(topology: &Topology, labels: &[Option<Label>], corners: &[u32]) -> Incidence {
        let count = topology.vertex_count();
        let ends = |h: u32| [topology.origin(h) as usize, topology.target(h) as usize];
        let curve_edges = || (0..labels.len() as u32).filter(|&h| labels[h as usize].is_some());
        let mut start = vec![0u32; count + 1];
        for v in curve_edges().flat_map(ends) {
            start[v + 1] += 1;
        }
        for v in 0..count {
            start[v + 1] += start[v];
        }
        let mut fill = start.clone();
        let mut edges = vec![0u32; start[count] as usize];
        for h in curve_edges() {
            for v in ends(h) {
                edges[fill[v] as usize] = h;
                fill[v] += 1;
            }
        }
        let mut cut = vec![false; count];
        for v in 0..count {
            let here = &edges[start[v] as usize..start[v + 1] as usize];
            cut[v] = match here {
                [a, b] => labels[*a as usize] != labels[*b as usize],
                _ => !here.is_empty(),
            };
        }
        for &v in corners {
            cut[v as usize] = true;
        }
        Incidence { start, edges, cut }
    }

    fn at(&self, v: u32) -> &[u32] {
        &self.edges[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }
}

/// A chain of directed edges: `(representative, against)` where `against` tells that the edge runs from target to origin.
type Chain = Vec<(u32, bool)>;

fn end_of(topology: &Topology, step: (u32, bool)) -> u32 {
    if step.1 { topology.origin(step.0) } else { topology.target(step.0) }
}

/// Walks from a directed edge until a cut vertex or back to the first edge.
fn walk(topology: &Topology, incidence: &Incidence, first: (u32, bool), seen: &mut [bool]) -> Chain {
    let mut chain = vec![first];
    seen[first.0 as usize] = true;
    let mut at = first;
    loop {
        let v = end_of(topology, at);
        if incidence.cut[v as usize] {
            return chain;
        }
        let Some(&next) = incidence.at(v).iter().find(|&&h| h != at.0) else { return chain };
        if seen[next as usize] {
            return chain;
        }
        seen[next as usize] = true;
        at = (next, topology.origin(next) != v);
        chain.push(at);
    }
}

/// Writes a chain as halfedges in the deterministic one of its two directions. Boundary halfedges have only one.
fn orient(topology: &Topology, chain: &Chain, kind: CurveKind) -> Vec<u32> {
    let directed = |&(h, against): &(u32, bool)| if against { topology.twin(h).unwrap_or(h) } else { h };
    let opposed = |step: &(u32, bool)| directed(&(step.0, !step.1));
    let against = chain.first().is_some_and(|step| step.1);
    let reversed = match kind {
        CurveKind::Boundary => against,
        _ => chain.last().map(opposed) < chain.first().map(directed),
    };
    if reversed { chain.iter().rev().map(opposed).collect() } else { chain.iter().map(directed).collect() }
}

pub(super) fn trace(topology: &Topology, features: &Features, partition: &Partition) -> CurveNetwork {
    let labels: Vec<Option<Label>> = (0..topology.halfedge_count() as u32)
        .map(|h| if topology.is_edge_representative(h) { label(topology, features, partition, h) } else { None })
        .collect();
    let incidence = Incidence::new(topology, &labels, &features.corners);
    let mut seen = vec![false; labels.len()];
    let mut curves = Vec::new();
    // Open chains start at cut vertices; what is left then are closed chains without one.
    for start_at_cut in [true, false] {
        for h in 0..labels.len() as u32 {
            let Some((kind, _, _)) = labels[h as usize] else { continue };
            if seen[h as usize] {
                continue;
            }
            let first = if incidence.cut[topology.origin(h) as usize] || !start_at_cut {
                (h, false)
            } else if incidence.cut[topology.target(h) as usize] {
                (h, true)
            } else {
                continue;
            };
            let chain = walk(topology, &incidence, first, &mut seen);
            let halfedges = orient(topology, &chain, kind);
            let closed = match (halfedges.first(), halfedges.last()) {
                (Some(&a), Some(&b)) => topology.origin(a) == topology.target(b),
                _ => false,
            };
            curves.push(Curve { kind, halfedges, closed, min_edges: 1 });
        }
    }
    curves.sort_by_key(|c| c.halfedges.iter().copied().min());
    set_min_edges(topology, &mut curves);
    CurveNetwork { curves }
}

/// Closed curves need three edges; of several curves between the same two vertices only the first may be a single edge.
fn set_min_edges(topology: &Topology, curves: &mut [Curve]) {
    let mut met: BTreeMap<(u32, u32), ()> = BTreeMap::new();
    for curve in curves {
        if curve.closed {
            curve.min_edges = 3;
            continue;
        }
        let (Some(&first), Some(&last)) = (curve.halfedges.first(), curve.halfedges.last()) else { continue };
        let (a, b) = (topology.origin(first), topology.target(last));
        if met.insert((a.min(b), a.max(b)), ()).is_some() {
            curve.min_edges = 2;
        }
    }
}
