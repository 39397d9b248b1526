//! Minimum-cost matching in general graphs: Edmonds' primal-dual blossom method, near-linear on
//! sparse graphs such as the dual graph of a triangulation.

mod blossom;
mod search;

use crate::error::{EngineError, Result};
use crate::work::Work;

/// An edge that may be matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MatchingEdge {
    /// Its two vertices.
    pub ends: [u32; 2],
    /// What matching it costs; any sign.
    pub cost: i64,
}

/// What a vertex that stays without a partner costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SingleCost {
    /// This much: a vertex is left alone where every partner, with what it does to the others, is dearer.
    Each(i64),
    /// More than anything else together: as few vertices as possible stay alone (a perfect matching, if there is one).
    Forbidden,
}

/// A matching of least cost.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Matching {
    /// Partner of each vertex.
    pub mate: Vec<Option<u32>>,
    /// Sum of the costs of the matched edges.
    pub cost: i64,
    /// Number of vertices without partner. With [`SingleCost::Forbidden`] a perfect matching exists if and only if this is 0.
    pub single: u32,
}

/// Largest absolute cost of an edge or of a single vertex: sums over any graph that fits in memory stay exact.
pub const MAX_COST: i64 = 1 << 24;

/// Vertices, at most: with [`MAX_COST`] no sum overflows.
const MAX_VERTICES: u32 = 1 << 30;

/// Finds a matching that minimises the costs of its edges and single vertices together. Exact (integers throughout) and deterministic.
///
/// Method: Edmonds (1965) in the form of Galil (1986): trees grow from all unmatched vertices at once, the dual
/// variables of a tree change lazily with one clock, events wait in a heap. A search stays in the part of the graph it needs; after the
/// greedy start these parts shrink with the number of vertices still unmatched, so that dual graphs of
/// triangulations take near-linear time (50,000 triangles: see `docs/quads.md`). Worst case O(n m log n), reached by graphs most of whose
/// vertices cannot be matched.
///
/// Parallel edges are allowed; loops are ignored.
///
/// # Errors
/// [`crate::error::Reason::BadParameter`] for an end that is not a vertex, or a cost beyond [`MAX_COST`]; cancellation.
pub fn least_cost_matching(vertices: u32, edges: &[MatchingEdge], single: SingleCost, work: &Work<'_>) -> Result<Matching> {
    if vertices > MAX_VERTICES {
        return Err(EngineError::bad_parameter("vertices", format!("more than {MAX_VERTICES} vertices")));
    }
    for (i, edge) in edges.iter().enumerate() {
        if edge.ends.iter().any(|&v| v >= vertices) {
            return Err(EngineError::bad_parameter("edges", format!("edge {i} ends at {:?}, of {vertices} vertices", edge.ends)));
        }
        if edge.cost.abs() > MAX_COST {
            return Err(EngineError::bad_parameter("edges", format!("the cost {} of edge {i} is beyond {MAX_COST}", edge.cost)));
        }
    }
    let each = match single {
        SingleCost::Each(cost) if cost.abs() > MAX_COST => {
            return Err(EngineError::bad_parameter("single", format!("the cost {cost} is beyond {MAX_COST}")));
        }
        SingleCost::Each(cost) => cost,
        SingleCost::Forbidden => {
            let (low, high) = edges.iter().fold((0, 0), |(l, h), e| (e.cost.min(l), e.cost.max(h)));
            // One matched edge more outweighs any change of the others.
            (high - low + 1) * (i64::from(vertices) / 2 + 1)
        }
    };
    // Leaving everything single and then matching an edge gains 2 `each` - cost. Four times that keeps all duals whole: the duals
    // in the trees are all even or all odd, as the clock is.
    let gains: Vec<i64> = edges.iter().map(|e| 4 * (2 * each - e.cost)).collect();
    let mate = search::heaviest_matching(vertices as usize, edges, &gains, work)?;
    let mut matching = Matching { mate: vec![None; vertices as usize], cost: 0, single: 0 };
    for (v, partner) in mate.iter().enumerate() {
        match partner {
            Some((w, edge)) => {
                matching.mate[v] = Some(*w);
                if (v as u32) < *w {
                    matching.cost += edges[*edge as usize].cost;
                }
            }
            None => matching.single += 1,
        }
    }
    Ok(matching)
}

#[cfg(test)]
mod tests;
