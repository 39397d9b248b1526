//! The state of the matching: nested blossoms with their dual variables, and how a matching is turned around inside them.

use super::MatchingEdge;

/// "No vertex", "no node", only inside the solver.
pub(super) const NONE: u32 = u32::MAX;

/// What a top-level node is in the alternating tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Label {
    /// Not in the tree.
    Free,
    /// At even distance from the root: its duals fall.
    Even,
    /// At odd distance: its duals rise.
    Odd,
}

/// An odd cycle of nodes that is seen as one.
#[derive(Debug, Clone, Default)]
pub(super) struct Blossom {
    /// The cycle, from the child that holds the base.
    pub(super) children: Vec<u32>,
    /// `links[i]` joins `children[i]` and the next one: edge, its vertex in the former, its vertex in the latter.
    pub(super) links: Vec<Link>,
    /// Dual variable, at the time of `since` of the node.
    pub(super) dual: i64,
}

/// A directed edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) edge: u32,
    pub(super) from: u32,
    pub(super) to: u32,
}

impl Link {
    pub(super) const NO: Link = Link { edge: NONE, from: NONE, to: NONE };

    pub(super) fn reversed(self) -> Link {
        Link { edge: self.edge, from: self.to, to: self.from }
    }
}

/// Nodes: the vertices, then the blossoms.
pub(super) struct Forest<'a> {
    pub(super) count: u32,
    pub(super) edges: &'a [MatchingEdge],
    pub(super) gains: &'a [i64],
    /// Matched edge of each vertex, from it to its partner.
    pub(super) mate: Vec<Link>,
    /// Dual variable of each vertex, at the time in `since`.
    pub(super) dual: Vec<i64>,
    /// By node: when its dual was last settled; the duals of vertices in odd nodes are as old as the node.
    pub(super) since: Vec<i64>,
    /// By node: what it is; of top-level nodes only.
    pub(super) label: Vec<Label>,
    /// By node: the blossom it is a child of.
    pub(super) parent: Vec<u32>,
    /// By node: a node above it, shortened as it is used; forgotten when a blossom opens.
    pub(super) up: Vec<u32>,
    /// By node: the vertex that may be matched outside.
    pub(super) base: Vec<u32>,
    /// By node: its vertices, from the first to the last along `next`.
    pub(super) span: Vec<[u32; 2]>,
    /// By vertex: the one after it in every node that holds both.
    pub(super) next: Vec<u32>,
    /// By node: the tree edge that leads to it.
    pub(super) entry: Vec<Link>,
    /// By vertex: a node that held it, above which `up` leads on.
    pub(super) home: Vec<u32>,
    pub(super) blossoms: Vec<Blossom>,
    pub(super) unused: Vec<u32>,
}

impl<'a> Forest<'a> {
    pub(super) fn new(count: usize, edges: &'a [MatchingEdge], gains: &'a [i64]) -> Forest<'a> {
        let ids: Vec<u32> = (0..count as u32).collect();
        Forest {
            count: count as u32,
            edges,
            gains,
            mate: vec![Link::NO; count],
            dual: vec![0; count],
            since: vec![0; count],
            label: vec![Label::Free; count],
            parent: vec![NONE; count],
            up: vec![NONE; count],
            base: ids.clone(),
            span: ids.iter().map(|&v| [v, v]).collect(),
            next: vec![NONE; count],
            entry: vec![Link::NO; count],
            home: ids,
            blossoms: Vec::new(),
            unused: Vec::new(),
        }
    }

    /// The blossom of a node that is not a vertex.
    pub(super) fn blossom(&mut self, node: u32) -> &mut Blossom {
        &mut self.blossoms[(node - self.count) as usize]
    }

    pub(super) fn is_blossom(&self, node: u32) -> bool {
        node >= self.count
    }

    /// The outermost node that holds a vertex.
    pub(super) fn top(&mut self, v: u32) -> u32 {
        let first = self.home[v as usize];
        let mut top = first;
        while self.up[top as usize] != NONE {
            top = self.up[top as usize];
        }
        let mut at = first;
        while at != top {
            at = std::mem::replace(&mut self.up[at as usize], top);
        }
        top
    }

    /// The vertices of a node, appended.
    pub(super) fn leaves(&self, node: u32, out: &mut Vec<u32>) {
        let [mut at, last] = self.span[node as usize];
        while at != last {
            out.push(at);
            at = self.next[at as usize];
        }
        out.push(last);
    }

    /// Strings the vertices of children together as those of a node.
    pub(super) fn string(&mut self, node: u32, children: &[u32]) {
        let (Some(first), Some(last)) = (children.first(), children.last()) else { return };
        self.span[node as usize] = [self.span[*first as usize][0], self.span[*last as usize][1]];
        for pair in children.windows(2) {
            self.next[self.span[pair[0] as usize][1] as usize] = self.span[pair[1] as usize][0];
        }
    }

    /// A new blossom, to be filled.
    pub(super) fn new_blossom(&mut self) -> u32 {
        if let Some(node) = self.unused.pop() {
            return node;
        }
        let node = self.base.len() as u32;
        self.blossoms.push(Blossom::default());
        self.since.push(0);
        self.label.push(Label::Free);
        self.parent.push(NONE);
        self.up.push(NONE);
        self.base.push(NONE);
        self.span.push([NONE; 2]);
        self.entry.push(Link::NO);
        node
    }

    /// Makes the children of a blossom nodes of their own.
    pub(super) fn dissolve(&mut self, node: u32) -> Blossom {
        let blossom = std::mem::take(self.blossom(node));
        for &child in &blossom.children {
            self.parent[child as usize] = NONE;
            self.up[child as usize] = NONE;
        }
        self.unused.push(node);
        blossom
    }

    pub(super) fn set_mate(&mut self, link: Link) {
        self.mate[link.from as usize] = link;
        self.mate[link.to as usize] = link.reversed();
    }

    /// Turns the matching inside a node so that `v` is the vertex that is not matched inside.
    pub(super) fn rebase(&mut self, node: u32, v: u32) {
        let mut tasks = vec![(node, v)];
        let mut chain = Vec::new();
        while let Some((node, v)) = tasks.pop() {
            if self.base[node as usize] == v {
                continue;
            }
            chain.clear();
            let mut at = v;
            while at != node {
                chain.push(at);
                at = self.parent[at as usize];
            }
            let mut outer = node;
            while let Some(child) = chain.pop() {
                self.turn(outer, child, &mut tasks);
                self.base[outer as usize] = v;
                outer = child;
            }
        }
    }

    /// Makes `child` the first of the cycle of `node` and matches the others in pairs.
    fn turn(&mut self, node: u32, child: u32, tasks: &mut Vec<(u32, u32)>) {
        let (count, at) = {
            let blossom = self.blossom(node);
            (blossom.children.len(), blossom.children.iter().position(|&c| c == child).unwrap_or(0))
        };
        if at == 0 {
            return;
        }
        // The pairs between the child and the old base along the way of even length.
        let pairs: Vec<usize> = if at.is_multiple_of(2) { (0..at).step_by(2).collect() } else { (at + 1..count).step_by(2).collect() };
        for i in pairs {
            let (link, a, b) = {
                let blossom = self.blossom(node);
                (blossom.links[i], blossom.children[i], blossom.children[(i + 1) % count])
            };
            tasks.push((a, link.from));
            tasks.push((b, link.to));
            self.set_mate(link);
        }
        let blossom = self.blossom(node);
        blossom.children.rotate_left(at);
        blossom.links.rotate_left(at);
    }
}
