//! Two-way cuts of a graph: coarsening, greedy growth on the coarsest graph, Fiduccia-Mattheyses refinement on the way back.

use super::graph::{Graph, Scramble, coarsen};
use crate::error::Result;
use crate::work::Work;
use std::collections::BinaryHeap;

/// Coarsening stops at this many nodes.
const COARSEST: usize = 80;
/// Growths tried on the coarsest graph.
const GROWTHS: usize = 12;
/// Refinement passes per level at most.
const PASSES: usize = 6;

/// What part of the node weight side 0 (`false`) should and may have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    /// Least weight allowed.
    pub(super) low: u64,
    /// Aim of the first growth.
    pub(super) aim: u64,
    /// Most weight allowed.
    pub(super) high: u64,
}

impl Share {
    /// How far a weight lies outside.
    fn excess(&self, weight: u64) -> u64 {
        self.low.saturating_sub(weight).max(weight.saturating_sub(self.high))
    }
}

/// Cuts a graph in two. Returns the side of each node. The sides need not be connected. O(edges log nodes).
pub(super) fn bisect(graph: Graph, share: Share, work: &Work<'_>) -> Result<Vec<bool>> {
    let mut scramble = Scramble(0x9E37_79B9_7F4A_7C15);
    let mut levels = vec![graph];
    let mut maps: Vec<Vec<u32>> = Vec::new();
    let heaviest = (levels[0].total() * 3 / (2 * COARSEST as u64)).max(2);
    while let Some(last) = levels.last().filter(|g| g.len() > COARSEST) {
        work.check()?;
        let (coarse, map) = coarsen(last, heaviest, &mut scramble);
        if coarse.len() * 20 > last.len() * 19 {
            break; // nothing left to match
        }
        levels.push(coarse);
        maps.push(map);
    }
    let Some(coarsest) = levels.last() else { return Ok(Vec::new()) };
    let mut side = first_cut(coarsest, share, &mut scramble, work)?;
    for level in (0..maps.len()).rev() {
        work.check()?;
        side = maps[level].iter().map(|&c| side[c as usize]).collect();
        refine(&levels[level], share, &mut side, work)?;
    }
    Ok(side)
}

/// The best of several growths from different seeds.
fn first_cut(graph: &Graph, share: Share, scramble: &mut Scramble, work: &Work<'_>) -> Result<Vec<bool>> {
    let n = graph.len();
    let mut best: Option<((u64, u64), Vec<bool>)> = None;
    for _ in 0..GROWTHS.min(n) {
        let mut side = grow(graph, share, scramble.below(n) as u32);
        refine(graph, share, &mut side, work)?;
        let key = (share.excess(weight_of_first(graph, &side)), cut_of(graph, &side));
        if best.as_ref().is_none_or(|(k, _)| key < *k) {
            best = Some((key, side));
        }
    }
    Ok(best.map_or_else(|| vec![false; n], |(_, side)| side))
}

fn weight_of_first(graph: &Graph, side: &[bool]) -> u64 {
    graph.node_weight.iter().zip(side).filter(|(_, s)| !**s).map(|(w, _)| *w).sum()
}

fn cut_of(graph: &Graph, side: &[bool]) -> u64 {
    (0..graph.len() as u32)
        .map(|u| graph.row(u).filter(|&(v, _)| v > u && side[u as usize] != side[v as usize]).map(|(_, w)| u64::from(w)).sum::<u64>())
        .sum()
}

/// Grows side 0 from a seed, always by the node that adds least to the cut, until it has the wanted weight.
fn grow(graph: &Graph, share: Share, seed: u32) -> Vec<bool> {
    let n = graph.len();
    let mut side = vec![true; n];
    let mut heap = BinaryHeap::new();
    let mut inner = vec![0i64; n];
    let outer = |u: u32| graph.row(u).map(|(_, w)| i64::from(w)).sum::<i64>();
    heap.push((0i64, std::cmp::Reverse(seed)));
    let mut weight = 0;
    let mut next_seed = 0;
    while weight < share.aim {
        let Some((_, std::cmp::Reverse(u))) = heap.pop() else {
            // The graph is not connected: go on elsewhere.
            let Some(u) = (next_seed..n as u32).find(|&u| side[u as usize]) else { break };
            next_seed = u + 1;
            heap.push((0, std::cmp::Reverse(u)));
            continue;
        };
        if !side[u as usize] {
            continue;
        }
        let after = weight + graph.node_weight[u as usize];
        if weight > 0 && after > share.high {
            continue;
        }
        side[u as usize] = false;
        weight = after;
        for (v, w) in graph.row(u) {
            if side[v as usize] {
                inner[v as usize] += i64::from(w);
                heap.push((2 * inner[v as usize] - outer(v), std::cmp::Reverse(v)));
            }
        }
    }
    side
}

/// Fiduccia-Mattheyses passes until one brings nothing. Keeps or restores the share.
fn refine(graph: &Graph, share: Share, side: &mut [bool], work: &Work<'_>) -> Result<()> {
    let mut state = Refinement::new(graph, share, side);
    for _ in 0..PASSES {
        work.check()?;
        if !state.pass(side) {
            break;
        }
    }
    Ok(())
}

struct Refinement<'a> {
    graph: &'a Graph,
    share: Share,
    /// Decrease of the cut if the node changed sides.
    gain: Vec<i64>,
    locked: Vec<bool>,
    weight: u64,
}

impl<'a> Refinement<'a> {
    fn new(graph: &'a Graph, share: Share, side: &[bool]) -> Self {
        let gain = (0..graph.len() as u32)
            .map(|u| graph.row(u).map(|(v, w)| if side[v as usize] == side[u as usize] { -i64::from(w) } else { i64::from(w) }).sum())
            .collect();
        Refinement { graph, share, gain, locked: vec![false; graph.len()], weight: weight_of_first(graph, side) }
    }

    /// One pass: moves nodes, best gain first, each once, and takes back what came after the best state.
    fn pass(&mut self, side: &mut [bool]) -> bool {
        let graph = self.graph;
        let mut heaps: [BinaryHeap<(i64, std::cmp::Reverse<u32>)>; 2] = Default::default();
        for u in 0..graph.len() as u32 {
            if graph.row(u).any(|(v, _)| side[v as usize] != side[u as usize]) {
                heaps[usize::from(side[u as usize])].push((self.gain[u as usize], std::cmp::Reverse(u)));
            }
        }
        let patience = 60 + graph.len() / 50;
        let mut moved: Vec<u32> = Vec::new();
        let (mut gained, mut best, mut kept) = (0i64, (self.share.excess(self.weight), 0i64), 0);
        let start = best;
        while moved.len() < kept + patience {
            let Some(u) = self.pick(&mut heaps, side) else { break };
            gained += self.gain[u as usize];
            self.flip(u, side, Some(&mut heaps));
            moved.push(u);
            let key = (self.share.excess(self.weight), -gained);
            if key < best {
                best = key;
                kept = moved.len();
            }
        }
        for &u in &moved {
            self.locked[u as usize] = false;
        }
        for &u in moved[kept..].iter().rev() {
            self.flip(u, side, None);
            self.locked[u as usize] = false;
        }
        best < start
    }

    /// The node of highest gain whose move keeps the share, or brings it nearer.
    fn pick(&self, heaps: &mut [BinaryHeap<(i64, std::cmp::Reverse<u32>)>; 2], side: &[bool]) -> Option<u32> {
        let mut tops: [Option<(i64, u32)>; 2] = [None; 2];
        for s in 0..2 {
            while let Some(&(gain, std::cmp::Reverse(u))) = heaps[s].peek() {
                let stale = self.locked[u as usize] || usize::from(side[u as usize]) != s || self.gain[u as usize] != gain;
                if !stale && self.allowed(u, side) {
                    tops[s] = Some((gain, u));
                    break;
                }
                heaps[s].pop();
            }
        }
        let first = match tops {
            [Some(a), Some(b)] => {
                // Equal gains: from the heavier side.
                let from_first = (a.0, self.weight) > (b.0, self.share.aim);
                usize::from(!from_first)
            }
            [Some(_), None] => 0,
            [None, Some(_)] => 1,
            [None, None] => return None,
        };
        heaps[first].pop();
        tops[first].map(|(_, u)| u)
    }

    fn allowed(&self, u: u32, side: &[bool]) -> bool {
        let w = self.graph.node_weight[u as usize];
        let after = if side[u as usize] { self.weight + w } else { self.weight - w };
        let excess = self.share.excess(after);
        excess == 0 || excess < self.share.excess(self.weight)
    }

    fn flip(&mut self, u: u32, side: &mut [bool], mut heaps: Option<&mut [BinaryHeap<(i64, std::cmp::Reverse<u32>)>; 2]>) {
        let w = self.graph.node_weight[u as usize];
        if side[u as usize] {
            self.weight += w;
        } else {
            self.weight -= w;
        }
        side[u as usize] = !side[u as usize];
        self.gain[u as usize] = -self.gain[u as usize];
        self.locked[u as usize] = true;
        for (v, w) in self.graph.row(u) {
            let change = 2 * i64::from(w);
            self.gain[v as usize] += if side[v as usize] == side[u as usize] { -change } else { change };
            if let Some(heaps) = heaps.as_deref_mut()
                && !self.locked[v as usize]
            {
                heaps[usize::from(side[v as usize])].push((self.gain[v as usize], std::cmp::Reverse(v)));
            }
        }
    }
}
