//! The edges of any triangle soup with indices: sides grouped by edge, in O(F) plus short sorts.

/// All sides (directed edges of faces), grouped by the undirected edge they run along.
/// Side `3 f + k` runs from corner `k` of face `f` to corner `k + 1`.
#[derive(Debug)]
pub(crate) struct EdgeTable {
    /// Sides, those of one edge next to each other, in ascending order.
    pub(crate) sides: Vec<u32>,
    /// Where the sides of each edge begin; one more at the end.
    pub(crate) start: Vec<u32>,
}

/// Tail and head of a side.
#[inline]
pub(crate) fn ends(triangles: &[[u32; 3]], side: u32) -> [u32; 2] {
    let t = &triangles[side as usize / 3];
    let k = side as usize % 3;
    [t[k], t[if k == 2 { 0 } else { k + 1 }]]
}

impl EdgeTable {
    /// Builds the table. Edges are in ascending order of their vertices (lower first).
    pub(crate) fn build(triangles: &[[u32; 3]], vertex_count: usize) -> EdgeTable {
        let count = triangles.len() * 3;
        let mut first = vec![0u32; vertex_count + 1];
        for t in triangles {
            for k in 0..3 {
                first[t[k].min(t[(k + 1) % 3]) as usize + 1] += 1;
            }
        }
        for v in 0..vertex_count {
            first[v + 1] += first[v];
        }
        // The other end in the high half, so that sorting a bucket groups it by edge.
        let mut bucket = vec![0u64; count];
        for (f, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let slot = &mut first[a.min(b) as usize];
                bucket[*slot as usize] = u64::from(a.max(b)) << 32 | (3 * f + k) as u64;
                *slot += 1;
            }
        }
        let mut table = EdgeTable { sides: Vec::with_capacity(count), start: Vec::with_capacity(count / 2 + 2) };
        let mut begin = 0;
        for v in 0..vertex_count {
            // After filling, `first[v]` is where the bucket of `v` ends.
            let end = first[v] as usize;
            let part = &mut bucket[begin..end];
            part.sort_unstable();
            let mut other = None;
            for &entry in part.iter() {
                if other != Some(entry >> 32) {
                    other = Some(entry >> 32);
                    table.start.push(table.sides.len() as u32);
                }
                table.sides.push(entry as u32);
            }
            begin = end;
        }
        table.start.push(count as u32);
        table
    }

    /// Number of edges.
    pub(crate) fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// The sides along an edge.
    #[inline]
    pub(crate) fn of(&self, edge: usize) -> &[u32] {
        &self.sides[self.start[edge] as usize..self.start[edge + 1] as usize]
    }

    /// The two sides of an edge that has exactly two.
    #[inline]
    pub(crate) fn pair(&self, edge: usize) -> Option<[u32; 2]> {
        match *self.of(edge) {
            [a, b] => Some([a, b]),
            _ => None,
        }
    }
}

/// Disjoint sets of the numbers below some count.
#[derive(Debug)]
pub(crate) struct DisjointSets(Vec<u32>);

impl DisjointSets {
    pub(crate) fn new(count: usize) -> Self {
        DisjointSets((0..count as u32).collect())
    }

    /// The representative of a set, which is its least member.
    #[inline]
    pub(crate) fn find(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            let up = self.0[self.0[x as usize] as usize];
            self.0[x as usize] = up;
            x = up;
        }
        x
    }

    /// Joins two sets; `false` if they were one.
    #[inline]
    pub(crate) fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        if a != b {
            self.0[a.max(b) as usize] = a.min(b);
        }
        a != b
    }
}

/// The umbrellas of a mesh: corners of a vertex joined across manifold edges. Sets over corners `3 f + k`.
pub(crate) fn umbrellas(triangles: &[[u32; 3]], edges: &EdgeTable) -> DisjointSets {
    let mut sets = DisjointSets::new(triangles.len() * 3);
    for edge in 0..edges.len() {
        let Some([a, b]) = edges.pair(edge) else { continue };
        // Corners of side `s` are `s` itself (tail) and the next corner of its face (head).
        let next = |s: u32| if s % 3 == 2 { s - 2 } else { s + 1 };
        if ends(triangles, a)[0] == ends(triangles, b)[0] {
            sets.join(a, b);
            sets.join(next(a), next(b));
        } else {
            sets.join(a, next(b));
            sets.join(next(a), b);
        }
    }
    sets
}
