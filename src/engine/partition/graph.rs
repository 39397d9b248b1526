//! Weighted graphs in compressed rows: the dual graph of a set of faces, and its coarser versions by heavy-edge matching.

use super::surface::Surface;

/// An undirected graph. Every edge stands in the rows of both its nodes with the same weight.
#[derive(Debug, Clone, Default)]
pub(super) struct Graph {
    /// First entry of each node in `neighbour` and `edge_weight`; one more at the end.
    pub(super) start: Vec<u32>,
    /// Other node of each entry.
    pub(super) neighbour: Vec<u32>,
    /// Weight of each entry, at least 1.
    pub(super) edge_weight: Vec<u32>,
    /// Weight of each node, at least 1.
    pub(super) node_weight: Vec<u64>,
}

impl Graph {
    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.node_weight.len()
    }

    /// Neighbours of a node with the weights of the edges between.
    #[inline]
    pub(super) fn row(&self, node: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let range = self.start[node as usize] as usize..self.start[node as usize + 1] as usize;
        self.neighbour[range.clone()].iter().copied().zip(self.edge_weight[range].iter().copied())
    }

    /// Sum of the node weights.
    pub(super) fn total(&self) -> u64 {
        self.node_weight.iter().sum()
    }
}

/// What a face weighs when a set of faces is halved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Balance {
    /// Every face the same.
    Faces,
    /// By area.
    Area,
}

/// Shares of the total area are rounded to this many units (plus one per face).
const AREA_UNITS: f64 = (1u64 << 40) as f64;
/// Mean edge length in units of edge weight.
const LENGTH_UNITS: f64 = 256.0;

/// The dual graph of `faces` (node i is `faces[i]`): edges that are not features, weighted by length. `slot` is scratch of one entry
/// per face of the surface; any content. O(`faces`).
pub(super) fn dual_graph(surface: &Surface<'_>, faces: &[u32], balance: Balance, slot: &mut [u32]) -> Graph {
    for (i, &f) in faces.iter().enumerate() {
        slot[f as usize] = i as u32;
    }
    let inside = |f: u32| {
        let i = slot[f as usize];
        (faces.get(i as usize) == Some(&f)).then_some(i)
    };
    let mut graph = Graph::default();
    graph.start.reserve(faces.len() + 1);
    graph.neighbour.reserve(3 * faces.len());
    graph.edge_weight.reserve(3 * faces.len());
    graph.start.push(0);
    let area: f64 = faces.iter().map(|&f| surface.area[f as usize]).sum();
    let per_area = if area > 0.0 { AREA_UNITS / area } else { 0.0 };
    let length: f64 = faces.iter().map(|&f| (3 * f..3 * f + 3).map(|h| surface.length[h as usize]).sum::<f64>()).sum();
    let per_length = if length > 0.0 { LENGTH_UNITS * 3.0 * faces.len() as f64 / length } else { 0.0 };
    for &f in faces {
        for h in 3 * f..3 * f + 3 {
            if let Some(g) = surface.crossing(h).and_then(inside) {
                graph.neighbour.push(g);
                graph.edge_weight.push((surface.length[h as usize] * per_length) as u32 + 1);
            }
        }
        graph.start.push(graph.neighbour.len() as u32);
        graph.node_weight.push(match balance {
            Balance::Faces => 1,
            Balance::Area => (surface.area[f as usize] * per_area) as u64 + 1,
        });
    }
    graph
}

/// A small deterministic generator for visiting orders (xorshift).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scramble(pub(super) u64);

impl Scramble {
    /// A number below `n` (`n > 0`).
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n as u64) as usize
    }
}

/// Matches nodes with neighbours along relatively heavy edges (weight squared over the product of the node weights) and
/// contracts the pairs. Returns the coarser graph and the coarse node of each node. O(nodes + edges).
pub(super) fn coarsen(graph: &Graph, heaviest: u64, scramble: &mut Scramble) -> (Graph, Vec<u32>) {
    const FREE: u32 = u32::MAX;
    let n = graph.len();
    let mut order: Vec<u32> = (0..n as u32).collect();
    // Exchanges within blocks: random enough, and kind to the memory.
    const BLOCK: usize = 64;
    for block in order.chunks_mut(BLOCK) {
        for i in (1..block.len()).rev() {
            block.swap(i, scramble.below(i + 1));
        }
    }
    let mut mate = vec![FREE; n];
    for &u in &order {
        if mate[u as usize] != FREE {
            continue;
        }
        let own = graph.node_weight[u as usize];
        let mut best = (0.0, u);
        for (v, w) in graph.row(u) {
            let other = graph.node_weight[v as usize];
            if mate[v as usize] == FREE && own + other <= heaviest {
                let rating = f64::from(w) * f64::from(w) / (own as f64 * other as f64);
                if rating > best.0 {
                    best = (rating, v);
                }
            }
        }
        mate[u as usize] = best.1;
        mate[best.1 as usize] = u;
    }
    let mut coarse_of = vec![0u32; n];
    let mut count = 0u32;
    for u in 0..n {
        if mate[u] as usize >= u {
            coarse_of[u] = count;
            coarse_of[mate[u] as usize] = count;
            count += 1;
        }
    }
    (contract(graph, &mate, &coarse_of, count as usize), coarse_of)
}

fn contract(graph: &Graph, mate: &[u32], coarse_of: &[u32], count: usize) -> Graph {
    let mut coarse = Graph::default();
    coarse.start.reserve(count + 1);
    coarse.node_weight.reserve(count);
    coarse.start.push(0);
    // Entry of each coarse neighbour in the row under construction; older rows' entries lie below the row's start.
    let mut entry = vec![0u32; count];
    for u in 0..graph.len() as u32 {
        let v = mate[u as usize];
        if v < u {
            continue;
        }
        let own = coarse_of[u as usize];
        let row_start = coarse.neighbour.len() as u32;
        let mut weight = graph.node_weight[u as usize];
        let second = (v != u).then_some(v);
        weight += second.map_or(0, |v| graph.node_weight[v as usize]);
        for node in [Some(u), second].into_iter().flatten() {
            for (other, w) in graph.row(node) {
                let c = coarse_of[other as usize];
                if c == own {
                    continue;
                }
                let at = entry[c as usize];
                if at >= row_start && (at as usize) < coarse.neighbour.len() && coarse.neighbour[at as usize] == c {
                    coarse.edge_weight[at as usize] = coarse.edge_weight[at as usize].saturating_add(w);
                } else {
                    entry[c as usize] = coarse.neighbour.len() as u32;
                    coarse.neighbour.push(c);
                    coarse.edge_weight.push(w);
                }
            }
        }
        coarse.start.push(coarse.neighbour.len() as u32);
        coarse.node_weight.push(weight);
    }
    coarse
}
