//! An elimination order that leaves chosen unknowns for the end: approximate minimum degree on the others, in postorder.

use crate::SolveError;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

const NONE: u32 = u32::MAX;

/// Order of elimination: `forward[new] = old`, `inverse[old] = new`.
pub(crate) struct Order {
    pub(crate) forward: Vec<u32>,
    pub(crate) inverse: Vec<u32>,
}

/// Orders the unknowns of a symmetric pattern (entries with row <= column) so that `kept` come last, in the order given.
/// A postorder of the elimination forest of the others makes columns of equal structure neighbours, which supernodes need.
pub(crate) fn kept_last(starts: &[u32], rows: &[u32], kept: &[u32]) -> Result<Order, SolveError> {
    let size = starts.len() - 1;
    let mut number = vec![0u32; size];
    kept.iter().for_each(|&v| number[v as usize] = NONE);
    let mut others = Vec::with_capacity(size - kept.len());
    for v in 0..size as u32 {
        if number[v as usize] != NONE {
            number[v as usize] = others.len() as u32;
            others.push(v);
        }
    }
    let (inner_starts, inner_rows) = inner_pattern(starts, rows, &others, &number);
    let ranked = minimum_degree(&inner_starts, &inner_rows)?;
    let order = postorder(&parents(&inner_starts, &inner_rows, &ranked));
    let mut forward: Vec<u32> = order.into_iter().map(|k| others[ranked[k as usize] as usize]).collect();
    forward.extend_from_slice(kept);
    let mut inverse = vec![0u32; size];
    forward.iter().enumerate().for_each(|(new, &old)| inverse[old as usize] = new as u32);
    Ok(Order { forward, inverse })
}

fn inner_pattern(starts: &[u32], rows: &[u32], others: &[u32], number: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut inner_starts = Vec::with_capacity(others.len() + 1);
    let mut inner_rows = Vec::with_capacity(rows.len());
    inner_starts.push(0);
    for &v in others {
        let column = starts[v as usize] as usize..starts[v as usize + 1] as usize;
        inner_rows.extend(rows[column].iter().filter(|&&r| r <= v).map(|&r| number[r as usize]).filter(|&r| r != NONE));
        inner_starts.push(inner_rows.len() as u32);
    }
    (inner_starts, inner_rows)
}

fn minimum_degree(starts: &[u32], rows: &[u32]) -> Result<Vec<u32>, SolveError> {
    let size = starts.len() - 1;
    let refuse = |_| SolveError::Resources("work space of the ordering".to_owned());
    let mut buffer = MemBuffer::try_new(amd::order_scratch::<u32>(size, rows.len())).map_err(refuse)?;
    let (mut forward, mut inverse) = (vec![0u32; size], vec![0u32; size]);
    let pattern = SymbolicSparseColMatRef::new_checked(size, size, starts, None, rows);
    amd::order(&mut forward, &mut inverse, pattern, amd::Control::default(), MemStack::new(&mut buffer))
        .map_err(|e| SolveError::Resources(e.to_string()))?;
    Ok(forward)
}

/// Elimination forest of the pattern in the order `forward` (Liu's algorithm with path compression), in new numbers.
fn parents(starts: &[u32], rows: &[u32], forward: &[u32]) -> Vec<u32> {
    let size = forward.len();
    let mut inverse = vec![0u32; size];
    forward.iter().enumerate().for_each(|(new, &old)| inverse[old as usize] = new as u32);
    let pairs = || {
        let entries = (0..size)
            .flat_map(|column| rows[starts[column] as usize..starts[column + 1] as usize].iter().map(move |&row| (row as usize, column)));
        entries.map(|(row, column)| (inverse[row], inverse[column])).filter(|(a, b)| a != b).map(|(a, b)| (a.min(b), a.max(b)))
    };
    // Counting sort of the entries by their later unknown.
    let mut ends = vec![0u32; size + 1];
    pairs().for_each(|(_, later)| ends[later as usize + 1] += 1);
    (0..size).for_each(|j| ends[j + 1] += ends[j]);
    let mut earlier = vec![0u32; ends[size] as usize];
    let mut next = ends.clone();
    for (a, b) in pairs() {
        earlier[next[b as usize] as usize] = a;
        next[b as usize] += 1;
    }
    let (mut parent, mut ancestor) = (vec![NONE; size], vec![NONE; size]);
    for j in 0..size {
        for &start in &earlier[ends[j] as usize..ends[j + 1] as usize] {
            let mut i = start;
            while ancestor[i as usize] != j as u32 {
                let up = std::mem::replace(&mut ancestor[i as usize], j as u32);
                if up == NONE {
                    parent[i as usize] = j as u32;
                    break;
                }
                i = up;
                if i as usize == j {
                    break;
                }
            }
        }
    }
    parent
}

/// Children before parents, subtrees in one piece.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let size = parent.len();
    let (mut first, mut next) = (vec![NONE; size + 1], vec![NONE; size]);
    for v in (0..size).rev() {
        let p = if parent[v] == NONE { size } else { parent[v] as usize };
        next[v] = std::mem::replace(&mut first[p], v as u32);
    }
    let mut order = Vec::with_capacity(size);
    let mut stack: Vec<u32> = Vec::new();
    let mut root = first[size];
    while root != NONE {
        stack.push(root);
        while let Some(&top) = stack.last() {
            let child = first[top as usize];
            if child == NONE {
                order.push(top);
                stack.pop();
            } else {
                first[top as usize] = next[child as usize];
                stack.push(child);
            }
        }
        root = next[root as usize];
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn postorder_visits_children_first_and_keeps_subtrees_together() {
        // 4 is the root of 0, 3; 3 of 1, 2; 5 is alone.
        let order = postorder(&[4, 3, 3, 4, NONE, NONE]);
        assert_eq!(order, [0, 1, 2, 3, 4, 5]);
        let order = postorder(&[3, 4, 4, NONE, 3]);
        assert_eq!(order, [0, 1, 2, 4, 3]);
    }

    #[test]
    fn kept_unknowns_come_last_in_their_order() {
        // A path of 6 vertices, upper triangle with diagonal.
        let starts = [0, 1, 3, 5, 7, 9, 11];
        let rows = [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5];
        let order = kept_last(&starts, &rows, &[4, 1]).unwrap();
        assert_eq!(order.forward[4..], [4, 1]);
        let mut all = order.forward.clone();
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
        assert!((0..6).all(|v| order.forward[order.inverse[v] as usize] == v as u32));
    }
}
