//! The search: alternating trees grow from all unmatched vertices at once, their duals moving with one clock. A tree is taken apart when a
//! path is found that matches its root or leaves another vertex, worth nothing any more, alone in its place.

use super::MatchingEdge;
use super::blossom::{Forest, Label, Link, NONE};
use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What happens next; smaller first at equal times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// An edge becomes tight.
    Tight(u32),
    /// The dual of an odd blossom reaches zero.
    Open(u32),
    /// The dual of an even vertex reaches zero.
    Worthless(u32),
}

struct Search<'a> {
    forest: Forest<'a>,
    /// Edges of vertex `v`: `incident[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    incident: Vec<u32>,
    now: i64,
    events: BinaryHeap<Reverse<(i64, Event)>>,
    /// Nodes that got a label, by the root of their tree.
    touched: Vec<Vec<u32>>,
    /// Root of the tree of each labelled node.
    tree: Vec<u32>,
    /// By root: when the first even vertex of its tree is worthless.
    worthless_at: Vec<i64>,
    leaves: Vec<u32>,
    mark: Vec<u32>,
    marks: u32,
}

/// The matching of largest total gain; by vertex its partner and the edge.
pub(super) fn heaviest_matching(count: usize, edges: &[MatchingEdge], gains: &[i64], work: &Work<'_>) -> Result<Vec<Option<(u32, u32)>>> {
    let forest = solve(count, edges, gains, work)?;
    Ok(forest.mate.iter().map(|link| (link.edge != NONE).then_some((link.to, link.edge))).collect())
}

/// The matching with its duals.
pub(super) fn solve<'a>(count: usize, edges: &'a [MatchingEdge], gains: &'a [i64], work: &Work<'_>) -> Result<Forest<'a>> {
    work.check()?;
    let mut search = Search::new(count, edges, gains);
    search.start_greedily();
    search.run(work)?;
    Ok(search.forest)
}

impl<'a> Search<'a> {
    fn new(count: usize, edges: &'a [MatchingEdge], gains: &'a [i64]) -> Search<'a> {
        let useful = |i: &usize| gains[*i] > 0 && edges[*i].ends[0] != edges[*i].ends[1];
        let mut first = vec![0u32; count + 1];
        for i in (0..edges.len()).filter(useful) {
            edges[i].ends.iter().for_each(|&v| first[v as usize + 1] += 1);
        }
        for v in 0..count {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut incident = vec![0; first[count] as usize];
        for i in (0..edges.len()).filter(useful) {
            for &v in &edges[i].ends {
                incident[next[v as usize] as usize] = i as u32;
                next[v as usize] += 1;
            }
        }
        Search {
            forest: Forest::new(count, edges, gains),
            first,
            incident,
            now: 0,
            events: BinaryHeap::new(),
            touched: vec![Vec::new(); count],
            tree: vec![NONE; count],
            worthless_at: vec![i64::MAX; count],
            leaves: Vec::new(),
            mark: Vec::new(),
            marks: 0,
        }
    }

    fn edges_of(&self, v: u32) -> std::ops::Range<usize> {
        self.first[v as usize] as usize..self.first[v as usize + 1] as usize
    }

    fn link(&self, edge: u32, from: u32) -> Link {
        let [a, b] = self.forest.edges[edge as usize].ends;
        Link { edge, from, to: if a == from { b } else { a } }
    }

    /// Feasible duals, lowered one by one as far as they go; edges that are tight are matched.
    fn start_greedily(&mut self) {
        for v in 0..self.forest.count {
            let best = self.edges_of(v).map(|i| self.forest.gains[self.incident[i] as usize]).max().unwrap_or(0);
            self.forest.dual[v as usize] = best / 2;
        }
        for v in 0..self.forest.count {
            if self.forest.mate[v as usize].edge != NONE {
                continue;
            }
            let mut least = (self.forest.dual[v as usize], NONE);
            for i in self.edges_of(v) {
                let link = self.link(self.incident[i], v);
                let slack = self.forest.dual[v as usize] + self.forest.dual[link.to as usize] - self.forest.gains[link.edge as usize];
                let is_open = self.forest.mate[link.to as usize].edge == NONE;
                if slack < least.0 || (slack == least.0 && is_open) {
                    least = (slack, if is_open { link.edge } else { NONE });
                }
            }
            self.forest.dual[v as usize] -= least.0;
            if least.1 != NONE {
                let link = self.link(least.1, v);
                self.forest.set_mate(link);
            }
        }
    }

    /// The dual of an even vertex now.
    fn even_dual(&self, v: u32) -> i64 {
        self.forest.dual[v as usize] - (self.now - self.forest.since[v as usize])
    }

    /// Writes the duals of the vertices of a node down, under the label they had.
    fn settle(&mut self, node: u32, label: Label) {
        let begun = self.forest.since[node as usize];
        let [mut v, last] = self.forest.span[node as usize];
        loop {
            match label {
                Label::Free => {}
                Label::Even => self.forest.dual[v as usize] = self.even_dual(v),
                Label::Odd => self.forest.dual[v as usize] += self.now - begun,
            }
            self.forest.since[v as usize] = self.now;
            if v == last {
                break;
            }
            v = self.forest.next[v as usize];
        }
        self.settle_blossom(node, label);
    }

    fn settle_blossom(&mut self, node: u32, label: Label) {
        let passed = self.now - self.forest.since[node as usize];
        if self.forest.is_blossom(node) {
            self.forest.blossom(node).dual += match label {
                Label::Free => 0,
                Label::Even => 2 * passed,
                Label::Odd => -2 * passed,
            };
            self.forest.since[node as usize] = self.now;
        }
    }

    /// When an edge between different nodes becomes tight; `None` if it never does as things are.
    fn tight_at(&mut self, edge: u32) -> Option<i64> {
        let [a, b] = self.forest.edges[edge as usize].ends;
        let (x, y) = (self.forest.top(a), self.forest.top(b));
        if x == y {
            return None;
        }
        let labels = (self.forest.label[x as usize], self.forest.label[y as usize]);
        let gain = self.forest.gains[edge as usize];
        match labels {
            (Label::Even, Label::Free) => Some(self.now + self.even_dual(a) + self.forest.dual[b as usize] - gain),
            (Label::Free, Label::Even) => Some(self.now + self.forest.dual[a as usize] + self.even_dual(b) - gain),
            (Label::Even, Label::Even) => Some(self.now + (self.even_dual(a) + self.even_dual(b) - gain) / 2),
            _ => None,
        }
    }

    /// Announces when the edges of a vertex become tight.
    fn announce(&mut self, v: u32) {
        for i in self.edges_of(v) {
            let edge = self.incident[i];
            if let Some(time) = self.tight_at(edge) {
                self.events.push(Reverse((time, Event::Tight(edge))));
            }
        }
    }

    fn set_label(&mut self, node: u32, label: Label, entry: Link, tree: u32) {
        self.settle_blossom(node, Label::Free);
        self.forest.since[node as usize] = self.now;
        self.forest.label[node as usize] = label;
        self.forest.entry[node as usize] = entry;
        self.tree[node as usize] = tree;
        self.touched[tree as usize].push(node);
        if label == Label::Odd && self.forest.is_blossom(node) {
            let time = self.now + self.forest.blossom(node).dual / 2;
            self.events.push(Reverse((time, Event::Open(node))));
        }
    }

    /// Announces all that the vertices of a new even node bring; their duals are those of now.
    fn scan(&mut self, node: u32) {
        let mut leaves = std::mem::take(&mut self.leaves);
        leaves.clear();
        self.forest.leaves(node, &mut leaves);
        leaves.iter().for_each(|&v| self.forest.since[v as usize] = self.now);
        // All even vertices of a tree lose alike: only the first to be worthless matters.
        let first = leaves.iter().copied().min_by_key(|&v| (self.forest.dual[v as usize], v));
        if let Some(v) = first {
            let time = self.now + self.forest.dual[v as usize];
            let tree = self.tree[node as usize] as usize;
            if time < self.worthless_at[tree] {
                self.worthless_at[tree] = time;
                self.events.push(Reverse((time, Event::Worthless(v))));
            }
        }
        leaves.iter().for_each(|&v| self.announce(v));
        self.leaves = leaves;
    }

    /// Grows trees from all unmatched vertices that are worth something until none is left.
    fn run(&mut self, work: &Work<'_>) -> Result<()> {
        for v in 0..self.forest.count {
            if self.forest.mate[v as usize].edge == NONE && self.forest.dual[v as usize] > 0 {
                self.set_label(v, Label::Even, Link::NO, v);
            }
        }
        for v in 0..self.forest.count {
            if self.forest.label[v as usize] == Label::Even {
                self.scan(v);
            }
        }
        let mut rounds = 0u32;
        while let Some(Reverse((time, event))) = self.events.pop() {
            rounds = rounds.wrapping_add(1);
            if rounds.is_multiple_of(4096) {
                work.check()?;
            }
            match event {
                Event::Tight(edge) => match self.tight_at(edge) {
                    Some(at) if at > time => self.events.push(Reverse((at, event))),
                    Some(_) => {
                        self.now = time;
                        self.on_tight(edge);
                    }
                    None => {}
                },
                Event::Open(blossom) => {
                    if self.opens(blossom, time) {
                        self.now = time;
                        self.open(blossom);
                    }
                }
                Event::Worthless(v) => {
                    let top = self.forest.top(v);
                    if self.forest.label[top as usize] == Label::Even
                        && self.forest.dual[v as usize] == time - self.forest.since[v as usize]
                    {
                        self.now = time;
                        self.forest.rebase(top, v);
                        self.forest.mate[v as usize] = Link::NO;
                        self.flip_to_root(top);
                        self.take_apart(self.tree[top as usize]);
                    }
                }
            }
        }
        Ok(())
    }

    fn opens(&mut self, blossom: u32, time: i64) -> bool {
        let b = blossom as usize;
        let is_top = self.forest.parent[b] == NONE && self.forest.label[b] == Label::Odd;
        is_top && self.forest.blossom(blossom).dual == 2 * (time - self.forest.since[b])
    }

    /// An edge of an even node is tight.
    fn on_tight(&mut self, edge: u32) {
        let [a, b] = self.forest.edges[edge as usize].ends;
        let (x, y) = (self.forest.top(a), self.forest.top(b));
        match (self.forest.label[x as usize], self.forest.label[y as usize]) {
            (Label::Even, Label::Even) if self.tree[x as usize] == self.tree[y as usize] => self.shrink(self.link(edge, a)),
            (Label::Even, Label::Even) => self.join(x, y, self.link(edge, a)),
            (Label::Even, _) => self.grow(x, y, self.link(edge, a)),
            _ => self.grow(y, x, self.link(edge, b)),
        }
    }

    /// Matches the roots of two trees along the path through a tight edge.
    fn join(&mut self, x: u32, y: u32, link: Link) {
        let trees = [self.tree[x as usize], self.tree[y as usize]];
        self.forest.rebase(x, link.from);
        self.forest.rebase(y, link.to);
        self.forest.set_mate(link);
        self.flip_to_root(x);
        self.flip_to_root(y);
        trees.into_iter().for_each(|tree| self.take_apart(tree));
    }

    /// Takes the free node `to` into the tree of `from`, or finds the path if it is not matched (a vertex left alone before).
    fn grow(&mut self, from: u32, to: u32, link: Link) {
        let base = self.forest.base[to as usize];
        let out = self.forest.mate[base as usize];
        let tree = self.tree[from as usize];
        if out.edge == NONE {
            self.forest.rebase(to, link.to);
            self.forest.rebase(from, link.from);
            self.forest.set_mate(link);
            self.flip_to_root(from);
            self.take_apart(tree);
            return;
        }
        self.set_label(to, Label::Odd, link, tree);
        let partner = self.forest.top(out.to);
        self.set_label(partner, Label::Even, out, tree);
        self.scan(partner);
    }

    /// Exchanges matched and unmatched edges from an even node, whose inside is done, up to the root.
    fn flip_to_root(&mut self, even: u32) {
        let mut at = even;
        loop {
            let entry = self.forest.entry[at as usize];
            if entry.edge == NONE {
                return;
            }
            let odd = self.forest.top(entry.from);
            let link = self.forest.entry[odd as usize];
            self.forest.rebase(odd, link.to);
            at = self.forest.top(link.from);
            self.forest.rebase(at, link.from);
            self.forest.set_mate(link);
        }
    }

    /// The tree node above another.
    fn above(&mut self, node: u32) -> Option<u32> {
        let entry = self.forest.entry[node as usize];
        (entry.edge != NONE).then(|| self.forest.top(entry.from))
    }

    /// The lowest node above both (or one of them).
    fn meeting(&mut self, x: u32, y: u32) -> u32 {
        self.mark.resize(self.forest.base.len(), 0);
        self.marks += 1;
        let mut at = [Some(x), Some(y)];
        loop {
            for side in 0..2 {
                if let Some(node) = at[side] {
                    if std::mem::replace(&mut self.mark[node as usize], self.marks) == self.marks {
                        return node;
                    }
                    at[side] = self.above(node);
                }
            }
            if at == [None, None] {
                // Even nodes of one tree always meet.
                return x;
            }
        }
    }

    /// Makes a blossom of the cycle that a tight edge between even nodes closes.
    fn shrink(&mut self, link: Link) {
        let (x, y) = (self.forest.top(link.from), self.forest.top(link.to));
        let peak = self.meeting(x, y);
        let (mut children, mut links) = (Vec::new(), Vec::new());
        let mut at = x;
        while at != peak {
            children.push(at);
            links.push(self.forest.entry[at as usize]);
            at = self.forest.top(self.forest.entry[at as usize].from);
        }
        children.push(peak);
        children.reverse();
        links.reverse();
        links.push(link);
        at = y;
        while at != peak {
            children.push(at);
            links.push(self.forest.entry[at as usize].reversed());
            at = self.forest.top(self.forest.entry[at as usize].from);
        }
        let node = self.forest.new_blossom();
        let b = node as usize;
        self.forest.base[b] = self.forest.base[peak as usize];
        self.forest.entry[b] = self.forest.entry[peak as usize];
        (self.forest.parent[b], self.forest.up[b], self.forest.since[b]) = (NONE, NONE, self.now);
        self.forest.label[b] = Label::Even;
        let tree = self.tree[peak as usize];
        self.tree.resize(self.forest.base.len(), NONE);
        self.tree[b] = tree;
        self.touched[tree as usize].push(node);
        self.forest.string(node, &children);
        let mut were_odd = Vec::new();
        for &child in &children {
            if self.forest.label[child as usize] == Label::Odd {
                self.settle(child, Label::Odd);
                were_odd.push(child);
            } else {
                self.settle_blossom(child, Label::Even);
            }
            self.forest.label[child as usize] = Label::Free;
            self.forest.parent[child as usize] = node;
            self.forest.up[child as usize] = node;
        }
        let blossom = self.forest.blossom(node);
        (blossom.children, blossom.links, blossom.dual) = (children, links, 0);
        for child in were_odd {
            self.scan(child);
        }
    }

    /// Opens an odd blossom: the way from where the tree enters it to its base stays in the tree, the rest becomes free.
    fn open(&mut self, node: u32) {
        self.settle(node, Label::Odd);
        let (entry, tree) = (self.forest.entry[node as usize], self.tree[node as usize]);
        self.forest.label[node as usize] = Label::Free;
        let blossom = self.forest.dissolve(node);
        let mut leaves = Vec::new();
        let mut enters = 0;
        for (i, &child) in blossom.children.iter().enumerate() {
            self.forest.since[child as usize] = self.now;
            leaves.clear();
            self.forest.leaves(child, &mut leaves);
            for &v in &leaves {
                self.forest.home[v as usize] = child;
                if v == entry.to {
                    enters = i;
                }
            }
        }
        let count = blossom.children.len();
        let mut is_free = vec![true; count];
        let mut evens = Vec::new();
        let mut link = entry;
        let mut at = enters;
        let mut label = Label::Odd;
        loop {
            is_free[at] = false;
            self.set_label(blossom.children[at], label, link, tree);
            if label == Label::Even {
                evens.push(blossom.children[at]);
            }
            if at == 0 {
                break;
            }
            label = if label == Label::Odd { Label::Even } else { Label::Odd };
            if enters.is_multiple_of(2) {
                at -= 1;
                link = blossom.links[at].reversed();
            } else {
                link = blossom.links[at];
                at = (at + 1) % count;
            }
        }
        for even in evens {
            self.scan(even);
        }
        for (i, &child) in blossom.children.iter().enumerate() {
            if is_free[i] {
                leaves.clear();
                self.forest.leaves(child, &mut leaves);
                for &v in &leaves {
                    self.announce(v);
                }
            }
        }
    }

    /// Writes the duals of a tree down and sets its nodes free; blossoms stay.
    fn take_apart(&mut self, tree: u32) {
        let touched = std::mem::take(&mut self.touched[tree as usize]);
        let mut leaves = Vec::new();
        for &node in &touched {
            let label = self.forest.label[node as usize];
            if label == Label::Free || self.forest.parent[node as usize] != NONE || self.tree[node as usize] != tree {
                continue;
            }
            self.settle(node, label);
            self.forest.label[node as usize] = Label::Free;
            self.forest.entry[node as usize] = Link::NO;
            let mut tops = vec![node];
            while let Some(top) = tops.pop() {
                let before = leaves.len();
                if self.forest.is_blossom(top) && self.forest.blossom(top).dual == 0 {
                    // Not held together by a dual: it need not be a blossom.
                    tops.extend(self.forest.dissolve(top).children);
                    continue;
                }
                self.forest.leaves(top, &mut leaves);
                leaves[before..].iter().for_each(|&v| self.forest.home[v as usize] = top);
            }
        }
        // Other trees may now reach what this one held.
        leaves.into_iter().for_each(|v| self.announce(v));
    }
}
