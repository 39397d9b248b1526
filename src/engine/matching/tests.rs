//! The matching against all matchings of small graphs, and against its own duals (a proof of optimality) on larger ones.

use super::blossom::{Forest, NONE};
use super::*;
use crate::work::CancelToken;

/// A small generator of its own, so that the cases never change.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

fn random_graph(dice: &mut Dice, vertices: u32, edges: usize, spread: u64) -> Vec<MatchingEdge> {
    let end = |dice: &mut Dice| dice.below(u64::from(vertices)) as u32;
    let edge = |dice: &mut Dice| MatchingEdge { ends: [end(dice), end(dice)], cost: dice.below(spread) as i64 - 3 };
    (0..edges).map(|_| edge(dice)).collect()
}

/// Least number of single vertices (if they are forbidden) and least cost, over all matchings.
fn exhaustive(vertices: u32, edges: &[MatchingEdge], single: SingleCost) -> (u32, i64) {
    let each = if let SingleCost::Each(cost) = single { cost } else { 1 << 40 };
    let mut best = vec![(0, 0); 1 << vertices];
    for set in 1usize..1 << vertices {
        let v = set.trailing_zeros();
        let rest = best[set & !(1 << v)];
        let mut here = (rest.0 + 1, rest.1 + each);
        for edge in edges {
            let [a, b] = edge.ends;
            let other = if a == v { b } else { a };
            if (a == v || b == v) && other != v && set & (1 << other) != 0 {
                let rest = best[set & !(1 << v) & !(1 << other)];
                if rest.1 + edge.cost < here.1 {
                    here = (rest.0, rest.1 + edge.cost);
                }
            }
        }
        best[set] = here;
    }
    best[(1 << vertices) - 1]
}

fn check_consistent(edges: &[MatchingEdge], matching: &Matching) {
    let mut single = 0;
    for (v, mate) in matching.mate.iter().enumerate() {
        match mate {
            Some(w) => {
                assert_eq!(matching.mate[*w as usize], Some(v as u32));
                let joins = |e: &&MatchingEdge| e.ends == [v as u32, *w] || e.ends == [*w, v as u32];
                assert!(edges.iter().any(|e| joins(&e)));
            }
            None => single += 1,
        }
    }
    assert_eq!(single, matching.single);
}

#[test]
fn equals_exhaustive_search_on_small_graphs() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let mut dice = Dice(7);
    for case in 0..6000 {
        let vertices = 2 + dice.below(9) as u32;
        let edges = 1 + dice.below(u64::from(vertices) * 3) as usize;
        let spread = [4, 12, 60, 1000][case % 4];
        let graph = random_graph(&mut dice, vertices, edges, spread);
        let single = [SingleCost::Forbidden, SingleCost::Each(spread as i64 / 3), SingleCost::Each(0)][case % 3];
        let found = least_cost_matching(vertices, &graph, single, &work).unwrap();
        check_consistent(&graph, &found);
        let (alone, mut cost) = exhaustive(vertices, &graph, single);
        let paid = if let SingleCost::Each(each) = single { each * i64::from(found.single) } else { 0 };
        if single == SingleCost::Forbidden {
            cost -= i64::from(alone) << 40;
            assert_eq!(alone, found.single, "case {case}: {graph:?}");
        }
        assert_eq!(cost, found.cost + paid, "case {case}, {single:?}: {graph:?}");
    }
}

/// Duals that no matching can beat, equal to the gain of this one.
fn check_duals(edges: &[MatchingEdge], gains: &[i64], forest: &Forest<'_>) {
    let above = |v: u32| {
        let mut chain = Vec::new();
        let mut at = forest.parent[v as usize];
        while at != NONE {
            chain.push(at);
            at = forest.parent[at as usize];
        }
        chain
    };
    let dual_of = |b: u32| forest.blossoms[(b - forest.count) as usize].dual;
    for (i, edge) in edges.iter().enumerate() {
        let [a, b] = edge.ends;
        let inside = above(b);
        let shared: i64 = above(a).into_iter().filter(|x| inside.contains(x)).map(dual_of).sum();
        let slack = forest.dual[a as usize] + forest.dual[b as usize] + shared - gains[i];
        assert!(slack >= 0 || a == b, "edge {i} has slack {slack}");
        assert!(forest.mate[a as usize].edge != i as u32 || slack == 0, "a matched edge is not tight");
    }
    let alone = |v: &usize| forest.mate[*v].edge == NONE;
    assert!((0..forest.count as usize).all(|v| forest.dual[v] >= 0 && (!alone(&v) || forest.dual[v] == 0)));
    for b in forest.count..forest.base.len() as u32 {
        let blossom = &forest.blossoms[(b - forest.count) as usize];
        assert!(blossom.dual >= 0 && blossom.children.len() % 2 == usize::from(!blossom.children.is_empty()));
        let mut inside = Vec::new();
        if !blossom.children.is_empty() {
            forest.leaves(b, &mut inside);
            inside.sort_unstable();
            let within = inside.iter().filter(|&&v| {
                let mate = forest.mate[v as usize];
                mate.edge != NONE && inside.binary_search(&mate.to).is_ok()
            });
            assert_eq!(within.count(), inside.len() - 1, "a blossom is full");
        }
    }
}

#[test]
fn duals_prove_larger_matchings() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let mut dice = Dice(3);
    for case in 0..120 {
        let vertices = 20 + dice.below(200) as u32;
        let density = 1 + case % 4;
        let edges = random_graph(&mut dice, vertices, vertices as usize * density, [5, 40, 5000][case % 3]);
        let each = [2, 30, 100_000][case % 3];
        let gains: Vec<i64> = edges.iter().map(|e| 4 * (2 * each - e.cost)).collect();
        let forest = search::solve(vertices as usize, &edges, &gains, &work).unwrap();
        check_duals(&edges, &gains, &forest);
    }
}

/// The dual graph of a triangulated torus of `n` x `n` squares cut by random diagonals.
fn torus(dice: &mut Dice, n: u32) -> (u32, Vec<MatchingEdge>) {
    let face = |i: u32, j: u32, k: u32| 2 * ((i % n) * n + j % n) + k;
    let diagonal: Vec<bool> = (0..n * n).map(|_| dice.below(2) == 0).collect();
    let mut edges = Vec::new();
    for i in 0..n {
        for j in 0..n {
            // Triangle 0 has the lower side, triangle 1 the upper; the diagonal decides who has left and right.
            let is_rising = |i: u32, j: u32| u32::from(diagonal[((i % n) * n + j % n) as usize]);
            let mut add = |a: u32, b: u32| edges.push(MatchingEdge { ends: [a, b], cost: dice.below(1000) as i64 });
            add(face(i, j, 0), face(i, j, 1));
            add(face(i, j, 1), face(i, j + 1, 0));
            add(face(i, j, 1 - is_rising(i, j)), face(i + 1, j, is_rising(i + 1, j)));
        }
    }
    (2 * n * n, edges)
}

#[test]
fn closed_cubic_dual_graphs_have_perfect_matchings() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let mut dice = Dice(11);
    for n in [3, 10, 40] {
        let (faces, edges) = torus(&mut dice, n);
        let matching = least_cost_matching(faces, &edges, SingleCost::Forbidden, &work).unwrap();
        check_consistent(&edges, &matching);
        assert_eq!(matching.single, 0);
        let gains: Vec<i64> = edges.iter().map(|e| 4 * (2 * 2000 - e.cost)).collect();
        check_duals(&edges, &gains, &search::solve(faces as usize, &edges, &gains, &work).unwrap());
    }
}

#[test]
fn bad_costs_and_ends_are_refused_and_empty_graphs_are_not() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let edge = |ends, cost| [MatchingEdge { ends, cost }];
    assert!(least_cost_matching(2, &edge([0, 2], 1), SingleCost::Forbidden, &work).is_err());
    assert!(least_cost_matching(2, &edge([0, 1], MAX_COST + 1), SingleCost::Forbidden, &work).is_err());
    assert!(least_cost_matching(2, &[], SingleCost::Each(-MAX_COST - 1), &work).is_err());
    let alone = least_cost_matching(3, &[], SingleCost::Forbidden, &work).unwrap();
    assert_eq!((alone.single, alone.cost), (3, 0));
    assert_eq!(least_cost_matching(2, &edge([1, 1], -5), SingleCost::Forbidden, &work).unwrap().single, 2);
    cancel.cancel();
    assert!(least_cost_matching(100, &edge([0, 1], 1), SingleCost::Forbidden, &work).is_err());
}
