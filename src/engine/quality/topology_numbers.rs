//! Topological numbers of any set of triangles, manifold or not.

use super::TopologyNumbers;

/// Disjoint sets with path halving.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Sets((0..count as u32).collect())
    }

    fn find(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            let up = self.0[self.0[x as usize] as usize];
            self.0[x as usize] = up;
            x = up;
        }
        x
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn count_roots(&self, used: impl Fn(usize) -> bool) -> u32 {
        (0..self.0.len()).filter(|&i| self.0[i] == i as u32 && used(i)).count() as u32
    }
}

/// Halfedges grouped by edge: `(low, high, halfedge)`, sorted; halfedge `3 f + k` runs from corner `k` to corner `k + 1`.
fn sorted_halfedges(triangles: &[[u32; 3]]) -> Vec<(u32, u32, u32)> {
    let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(triangles.len() * 3);
    for (f, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            sides.push((a.min(b), a.max(b), (3 * f + k) as u32));
        }
    }
    sides.sort_unstable();
    sides
}

/// Computes the numbers; vertices without a face do not count. O(F log F).
///
/// An edge is manifold with one or two faces. Faces meet in a fan at a vertex if manifold edges join them; genus is that of the
/// surface cut at its non-manifold vertices.
pub(super) fn topology_numbers(triangles: &[[u32; 3]], vertex_count: usize) -> TopologyNumbers {
    let next = |h: u32| if h % 3 == 2 { h - 2 } else { h + 1 };
    let origin = |h: u32| triangles[h as usize / 3][h as usize % 3];
    let face_count = triangles.len() as u32;
    let sides = sorted_halfedges(triangles);
    let mut fans = Sets::new(triangles.len() * 3);
    let mut pieces = Sets::new(triangles.len());
    let mut cover = Sets::new(triangles.len() * 2);
    let mut parts = Sets::new(vertex_count);
    let (mut edges, mut numbers, mut border) = (0i64, TopologyNumbers::default(), Vec::new());
    for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        edges += 1;
        parts.join(group[0].0, group[0].1);
        match *group {
            [(_, _, h)] => border.push(h),
            [(_, _, g), (_, _, h)] => {
                let same = origin(g) == origin(h);
                let (first, second) = if same { (h, next(h)) } else { (next(h), h) };
                fans.join(g, first);
                fans.join(next(g), second);
                let (f, e) = (g / 3, h / 3);
                pieces.join(f, e);
                let shift = if same { face_count } else { 0 };
                cover.join(f, e + shift);
                cover.join(f + face_count, e + face_count - shift);
                numbers.inconsistent_edges += u32::from(same);
            }
            _ => numbers.non_manifold_edges += 1,
        }
    }
    let mut fans_of = vec![0u32; vertex_count];
    for h in 0..triangles.len() as u32 * 3 {
        if fans.find(h) == h {
            fans_of[origin(h) as usize] += 1;
        }
    }
    numbers.non_manifold_vertices = fans_of.iter().filter(|c| **c > 1).count() as u32;
    numbers.components = parts.count_roots(|v| fans_of[v] > 0);
    numbers.boundary_loops = boundary_loops(&border, &mut fans, next);
    let faces = i64::from(face_count);
    numbers.euler = fans_of.iter().filter(|c| **c > 0).count() as i64 - edges + faces;
    let orientable = (0..face_count).all(|f| cover.find(f) != cover.find(f + face_count));
    if orientable && numbers.non_manifold_edges == 0 {
        let fan_total: i64 = fans_of.iter().map(|c| i64::from(*c)).sum();
        let twice = 2 * i64::from(pieces.count_roots(|_| true)) - i64::from(numbers.boundary_loops) - (fan_total - edges + faces);
        numbers.genus = (twice >= 0 && twice % 2 == 0).then_some(twice as u32 / 2);
    }
    numbers
}

/// Chains of boundary edges, joined where they meet in the same fan.
fn boundary_loops(border: &[u32], fans: &mut Sets, next: impl Fn(u32) -> u32) -> u32 {
    let mut loops = Sets::new(border.len());
    let mut ends: Vec<(u32, u32)> = Vec::with_capacity(border.len() * 2);
    for (i, &h) in border.iter().enumerate() {
        ends.push((fans.find(h), i as u32));
        ends.push((fans.find(next(h)), i as u32));
    }
    ends.sort_unstable();
    for pair in ends.windows(2) {
        if pair[0].0 == pair[1].0 {
            loops.join(pair[0].1, pair[1].1);
        }
    }
    loops.count_roots(|_| true)
}
