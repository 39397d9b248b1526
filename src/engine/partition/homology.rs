//! Loops through and around the handles of a surface: tree-cotree decomposition with short fundamental cycles (P3 algorithm 1, with one
//! shortest path tree for all loops in place of one path for every cut vertex).

use super::nearest::Nearest;
use crate::error::Result;
use crate::topology::Topology;
use crate::work::Work;

/// Edges at the boundary, and edges at their neighbours, count as this much longer: loops keep away from it where they can.
const BOUNDARY_COST: f64 = 30.0;
const NEAR_COST: f64 = 4.0;
/// Steps between checkpoints.
const CHECK: usize = 1 << 14;

/// A closed chain of edges, a simple cycle of vertices.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Loop {
    /// One halfedge of each edge, in order around the loop (not all in the same direction).
    pub(super) edges: Vec<u32>,
    /// Length.
    pub(super) length: f64,
}

/// A shortest path tree over the vertices, with pointers that find common ancestors in logarithmic time.
struct Tree {
    /// A halfedge of the edge to the parent; none for roots.
    edge: Vec<Option<u32>>,
    parent: Vec<u32>,
    depth: Vec<u32>,
    jump: Vec<u32>,
    distance: Vec<f64>,
}

/// For a connected surface of genus g, 2g loops that no boundary and no other combination of them bounds: a basis of the first homology
/// group of the surface with its holes closed. Each is the cycle that one edge closes in a shortest path tree from `root`, and among all
/// such bases this is the shortest. Sorted by length. `length` has one entry per halfedge. O(F log F).
///
/// # Errors
/// Only those of `work`.
pub(super) fn handle_loops(topology: &Topology, length: &[f64], root: u32, work: &Work<'_>) -> Result<Vec<Loop>> {
    let length = &costs(topology, length);
    let tree = shortest_path_tree(topology, length, root, work)?;
    let mut candidates: Vec<(f64, u32)> = Vec::new();
    for h in (0..topology.halfedge_count() as u32).filter(|&h| topology.is_edge_representative(h)) {
        if h as usize % CHECK < 3 {
            work.check()?;
        }
        let (a, b) = (topology.origin(h), topology.target(h));
        if !tree.has_edge(topology, h, a, b) {
            let top = tree.common_ancestor(a, b);
            let cost = tree.distance[a as usize] + tree.distance[b as usize] - 2.0 * tree.distance[top as usize];
            candidates.push((cost + length[h as usize], h));
        }
    }
    candidates.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(y.1.cmp(&x.1)));
    work.check()?;
    // The cotree: a spanning tree of the dual graph (holes are nodes too) that takes the longest cycles; what closes a circuit in it stays.
    let hole = holes_of(topology);
    let mut sets = DisjointSets::new(topology.face_count() + topology.loops.len());
    let mut left: Vec<(f64, u32)> = Vec::new();
    for &(cost, h) in &candidates {
        let across = topology.twin(h).map_or_else(|| topology.face_count() as u32 + hole[h as usize], |t| t / 3);
        if !sets.join(h / 3, across) {
            left.push((cost, h));
        }
    }
    left.reverse();
    Ok(left.into_iter().map(|(_, h)| tree.cycle(topology, length, h)).collect())
}

/// Boundary loop of each boundary halfedge.
pub(super) fn holes_of(topology: &Topology) -> Vec<u32> {
    let mut hole = vec![u32::MAX; topology.halfedge_count()];
    for (i, ring) in topology.loops.iter().enumerate() {
        ring.iter().for_each(|&h| hole[h as usize] = i as u32);
    }
    hole
}

/// Length of each halfedge, more near the boundary.
fn costs(topology: &Topology, length: &[f64]) -> Vec<f64> {
    let mut toll = vec![1.0; topology.vertex_count()];
    for h in topology.loops.iter().flatten() {
        topology.outgoing(topology.origin(*h)).for_each(|k| toll[topology.target(k) as usize] = NEAR_COST);
    }
    topology.loops.iter().flatten().for_each(|&h| toll[topology.origin(h) as usize] = BOUNDARY_COST);
    let of = |h: u32| toll[topology.origin(h) as usize].max(toll[topology.target(h) as usize]);
    length.iter().zip(0..).map(|(l, h)| l * of(h)).collect()
}

/// Dijkstra from `root`, then from the lowest vertex not reached, until all are.
fn shortest_path_tree(topology: &Topology, length: &[f64], root: u32, work: &Work<'_>) -> Result<Tree> {
    let n = topology.vertex_count();
    let own: Vec<u32> = (0..n as u32).collect();
    let mut tree = Tree { edge: vec![None; n], parent: own.clone(), depth: vec![0; n], jump: own, distance: Vec::new() };
    let mut nearest = Nearest::new(n);
    for start in [root].into_iter().chain(0..n as u32).filter(|&v| (v as usize) < n) {
        if nearest.distance[start as usize].is_finite() {
            continue;
        }
        nearest.source(start);
        while let Some(v) = nearest.take(work)? {
            tree.parent[v as usize] = nearest.from[v as usize];
            tree.settle(v);
            let mut relax = |w: u32, h: u32| {
                if nearest.reach(v, w, length[h as usize]) {
                    tree.edge[w as usize] = Some(h);
                }
            };
            for h in topology.outgoing(v) {
                relax(topology.target(h), h);
                let into = topology.prev(h);
                if topology.twin(into).is_none() {
                    relax(topology.origin(into), into);
                }
            }
        }
    }
    tree.distance = nearest.distance;
    Ok(tree)
}

impl Tree {
    /// Fills in depth and jump of a vertex whose parent is final.
    fn settle(&mut self, v: u32) {
        let (v, p) = (v as usize, self.parent[v as usize] as usize);
        if v == p {
            return;
        }
        self.depth[v] = self.depth[p] + 1;
        let (j, jj) = (self.jump[p] as usize, self.jump[self.jump[p] as usize] as usize);
        // Skew-binary jumps: twice the same length back to back make one of the sum.
        let equal = self.depth[p] - self.depth[j] == self.depth[j] - self.depth[jj];
        self.jump[v] = if equal { jj as u32 } else { p as u32 };
    }

    fn has_edge(&self, topology: &Topology, h: u32, a: u32, b: u32) -> bool {
        let is = |e: Option<u32>| e.is_some_and(|e| e == h || topology.twin(e) == Some(h));
        is(self.edge[a as usize]) || is(self.edge[b as usize])
    }

    /// The lowest common ancestor of two vertices of the same tree.
    fn common_ancestor(&self, mut a: u32, mut b: u32) -> u32 {
        if self.depth[a as usize] < self.depth[b as usize] {
            std::mem::swap(&mut a, &mut b);
        }
        let aim = self.depth[b as usize];
        while self.depth[a as usize] > aim {
            let jump = self.jump[a as usize];
            a = if self.depth[jump as usize] >= aim { jump } else { self.parent[a as usize] };
        }
        while a != b {
            let (i, j) = (self.jump[a as usize], self.jump[b as usize]);
            (a, b) = if i == j { (self.parent[a as usize], self.parent[b as usize]) } else { (i, j) };
        }
        a
    }

    /// The cycle that edge `h` closes in the tree.
    fn cycle(&self, topology: &Topology, length: &[f64], h: u32) -> Loop {
        let (a, b) = (topology.origin(h), topology.target(h));
        let top = self.common_ancestor(a, b);
        let climb = |mut v: u32| {
            let mut edges = Vec::new();
            while v != top
                && let Some(e) = self.edge[v as usize]
            {
                edges.push(e);
                v = self.parent[v as usize];
            }
            edges
        };
        let mut edges = climb(a);
        edges.reverse();
        edges.push(h);
        edges.extend(climb(b));
        let length = edges.iter().map(|&e| length[e as usize]).sum();
        Loop { edges, length }
    }
}

/// Union-find with path halving.
#[derive(Debug)]
pub(super) struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    pub(super) fn new(count: usize) -> Self {
        DisjointSets { parent: (0..count as u32).collect() }
    }

    pub(super) fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            self.parent[x as usize] = self.parent[self.parent[x as usize] as usize];
            x = self.parent[x as usize];
        }
        x
    }

    /// Joins the sets of two elements; `false` if they were in one.
    pub(super) fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        if a == b {
            return false;
        }
        // The lower one stays: deterministic, and near enough to balanced with path halving.
        self.parent[a.max(b) as usize] = a.min(b);
        true
    }
}
