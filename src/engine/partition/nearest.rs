//! Shortest path distances from several sources at once (Dijkstra), as a queue that its user feeds: who the neighbours of a node are, how
//! far, and what a node takes over from its predecessor is the user's business.

use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Nodes taken between checkpoints.
const CHECK: u32 = 1 << 14;

/// Distances of nodes `0..count`, some of them final.
#[derive(Debug)]
pub(super) struct Nearest {
    /// Shortest distance found so far; infinite for nodes not reached.
    pub(super) distance: Vec<f64>,
    /// The node before on the shortest path; the node itself for sources and nodes not reached.
    pub(super) from: Vec<u32>,
    /// Bits of a distance (those of a positive number order as the number does) and a node; entries that a shorter one has overtaken
    /// stay until they are met.
    heap: BinaryHeap<(Reverse<u64>, Reverse<u32>)>,
    taken: u32,
}

impl Nearest {
    /// Nothing reached yet.
    pub(super) fn new(count: usize) -> Self {
        Nearest { distance: vec![f64::INFINITY; count], from: (0..count as u32).collect(), heap: BinaryHeap::new(), taken: 0 }
    }

    /// Makes a node a source, also one that was reached before.
    pub(super) fn source(&mut self, node: u32) {
        self.distance[node as usize] = 0.0;
        self.from[node as usize] = node;
        self.heap.push((Reverse(0), Reverse(node)));
    }

    /// The nearest node not taken yet, whose distance is final unless sources are added; equal distances by number. `None` at the end.
    ///
    /// # Errors
    /// Only those of `work`.
    #[inline]
    pub(super) fn take(&mut self, work: &Work<'_>) -> Result<Option<u32>> {
        while let Some((Reverse(bits), Reverse(node))) = self.heap.pop() {
            if bits != self.distance[node as usize].to_bits() {
                continue;
            }
            self.taken = self.taken.wrapping_add(1);
            if self.taken.is_multiple_of(CHECK) {
                work.check()?;
            }
            return Ok(Some(node));
        }
        Ok(None)
    }

    /// Tells of a way of length `step` (not negative) from a taken node to another; `true` if it is the shortest to there so far.
    #[inline]
    pub(super) fn reach(&mut self, from: u32, to: u32, step: f64) -> bool {
        let distance = self.distance[from as usize] + step;
        let shorter = distance < self.distance[to as usize];
        if shorter {
            self.distance[to as usize] = distance;
            self.from[to as usize] = from;
            self.heap.push((Reverse(distance.to_bits()), Reverse(to)));
        }
        shorter
    }

    /// Forgets the queue and what was found for some nodes.
    pub(super) fn forget(&mut self, nodes: impl IntoIterator<Item = u32>) {
        self.heap.clear();
        for node in nodes {
            self.distance[node as usize] = f64::INFINITY;
            self.from[node as usize] = node;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::work::CancelToken;

    #[test]
    fn distances_on_a_ring_from_two_sources() {
        let (token, n) = (CancelToken::new(), 24u32);
        let mut nearest = Nearest::new(n as usize);
        nearest.source(3);
        nearest.source(13);
        let mut last = 0.0;
        while let Some(i) = nearest.take(&Work::silent(&token)).unwrap() {
            assert!(nearest.distance[i as usize] >= last, "nearest first");
            last = nearest.distance[i as usize];
            nearest.reach(i, (i + 1) % n, 0.5);
            nearest.reach(i, (i + n - 1) % n, 0.5);
        }
        for i in 0..n {
            let ring = |s: u32| i.abs_diff(s).min(n - i.abs_diff(s));
            assert_eq!(nearest.distance[i as usize], 0.5 * f64::from(ring(3).min(ring(13))));
        }
        nearest.forget(0..n);
        assert!(nearest.distance.iter().all(|d| d.is_infinite()) && nearest.take(&Work::silent(&token)).unwrap().is_none());
        token.cancel();
        let mut line = Nearest::new(2 * CHECK as usize);
        line.source(0);
        let walk = (0..2 * CHECK - 1).try_for_each(|i| {
            line.take(&Work::silent(&token))?;
            line.reach(i, i + 1, 1.0);
            Ok(())
        });
        assert!(walk.is_err(), "stops when cancelled");
        let _: Result<()> = walk;
    }
}
