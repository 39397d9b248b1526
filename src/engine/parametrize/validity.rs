//! Is a chart one-to-one, and is it of use? (P1 section 5, P2 section 3)
//!
//! With exact signs: if every face is counter-clockwise, no two boundary edges meet (but neighbours, in their common vertex) and
//! exactly one loop runs counter-clockwise, then the number of faces over a generic point of the plane, which is the sum of the
//! winding numbers of the loops, is 0 or 1 everywhere: the map is injective. The last condition excludes maps like z^2 of an
//! annulus, whose faces and loops are all fine.

use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;
use robust::{Coord, orient2d};

/// Exact sign of twice the area of `a b c`.
#[inline]
pub(super) fn orientation(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let coord = |p: Vec2| Coord { x: p[0], y: p[1] };
    orient2d(coord(a), coord(b), coord(c))
}

/// Faces that are clockwise or flat in the plane.
pub(super) fn flipped_faces(triangles: &[[u32; 3]], uv: &[Vec2]) -> Vec<u32> {
    let bad = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| uv[v as usize]);
        orientation(a, b, c) <= 0.0
    };
    triangles.iter().enumerate().filter(|(_, t)| bad(t)).map(|(f, _)| f as u32).collect()
}

/// Why the boundary of a chart does not bound a one-to-one image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Overlap {
    /// Two boundary edges cross, touch or fold onto one another; each as its two vertices in loop direction.
    Edges([[u32; 2]; 2]),
    /// No two edges meet, but this many loops run counter-clockwise instead of one: a place is covered more than once, or none.
    Winding(usize),
}

/// The first place found where boundary edges cross, touch or fold onto one another (always the same one), or that the loops wind
/// around a place more than once. Exact but for underflow, which can only be taken for an overlap. O(m log m) for m boundary edges
/// that do not crowd.
pub(super) fn find_overlap(loops: &[Vec<u32>], uv: &[Vec2], work: &Work<'_>) -> Result<Option<Overlap>> {
    let edges: Vec<[u32; 2]> = loops.iter().flat_map(|ring| (0..ring.len()).map(move |k| [ring[k], ring[(k + 1) % ring.len()]])).collect();
    if let Some(pair) = Boxes::over(&edges, uv).first_meeting(&edges, uv, work)? {
        return Ok(Some(Overlap::Edges(pair)));
    }
    let positive = loops.iter().filter(|ring| runs_counter_clockwise(ring, uv)).count();
    Ok((positive != 1).then_some(Overlap::Winding(positive)))
}

/// Whether a closed polygon whose edges do not meet runs counter-clockwise: exactly, by the turn at its lowest leftmost vertex, which
/// is convex. That turn cannot be straight, or the two edges there would lie on one another.
pub(super) fn runs_counter_clockwise(ring: &[u32], uv: &[Vec2]) -> bool {
    let at = |k: usize| uv[ring[k % ring.len()] as usize];
    let before = |p: Vec2, q: Vec2| p[0] < q[0] || (p[0] == q[0] && p[1] < q[1]);
    let lowest = (0..ring.len()).fold(0, |best, k| if before(at(k), at(best)) { k } else { best });
    orientation(at(lowest + ring.len() - 1), at(lowest), at(lowest + 1)) > 0.0
}

type Rect = [f64; 4];

/// A complete binary tree of bounding boxes over consecutive edges: neighbours in a loop are neighbours in the plane.
struct Boxes {
    leaves: usize,
    rects: Vec<Rect>,
}

const EMPTY: Rect = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

fn apart(a: &Rect, b: &Rect) -> bool {
    a[0] > b[2] || b[0] > a[2] || a[1] > b[3] || b[1] > a[3]
}

impl Boxes {
    fn over(edges: &[[u32; 2]], uv: &[Vec2]) -> Boxes {
        let leaves = edges.len().next_power_of_two();
        let mut rects = vec![EMPTY; 2 * leaves];
        for (k, edge) in edges.iter().enumerate() {
            let [a, b] = edge.map(|v| uv[v as usize]);
            rects[leaves + k] = [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])];
        }
        for k in (1..leaves).rev() {
            let (a, b) = (rects[2 * k], rects[2 * k + 1]);
            rects[k] = [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
        }
        Boxes { leaves, rects }
    }

    /// Two edges that meet, the one of the lower number first.
    fn first_meeting(&self, edges: &[[u32; 2]], uv: &[Vec2], work: &Work<'_>) -> Result<Option<[[u32; 2]; 2]>> {
        let mut stack = vec![(1usize, 1usize)];
        let mut visited = 0u32;
        while let Some((a, b)) = stack.pop() {
            visited += 1;
            if visited.is_multiple_of(65_536) {
                work.check()?;
            }
            if a == b {
                if a < self.leaves {
                    stack.extend([(2 * a, 2 * a), (2 * a + 1, 2 * a + 1), (2 * a, 2 * a + 1)]);
                }
            } else if !apart(&self.rects[a], &self.rects[b]) {
                if a < self.leaves {
                    stack.extend([(2 * a, 2 * b), (2 * a, 2 * b + 1), (2 * a + 1, 2 * b), (2 * a + 1, 2 * b + 1)]);
                } else if edges_meet(edges[a - self.leaves], edges[b - self.leaves], uv) {
                    return Ok(Some([edges[a - self.leaves], edges[b - self.leaves]]));
                }
            }
        }
        Ok(None)
    }
}

/// Whether two boundary edges have a point in common besides a shared vertex.
fn edges_meet(e: [u32; 2], f: [u32; 2], uv: &[Vec2]) -> bool {
    let at = |v: u32| uv[v as usize];
    // Two edges of a loop of three or more share at most one vertex, and then the end of one is the start of the other.
    for (first, second) in [(e, f), (f, e)] {
        if first[1] == second[0] {
            let (a, m, b) = (at(first[0]), at(first[1]), at(second[1]));
            let ahead = (a[0] - m[0]) * (b[0] - m[0]) + (a[1] - m[1]) * (b[1] - m[1]);
            return orientation(a, m, b) == 0.0 && ahead >= 0.0;
        }
    }
    let ([a, b], [c, d]) = (e.map(at), f.map(at));
    let sides = [orientation(a, b, c), orientation(a, b, d), orientation(c, d, a), orientation(c, d, b)];
    if sides == [0.0; 4] {
        // All on one line: the boxes overlap, so do the segments.
        return true;
    }
    let straddles = |s: f64, t: f64| !(s > 0.0 && t > 0.0 || s < 0.0 && t < 0.0);
    straddles(sides[0], sides[1]) && straddles(sides[2], sides[3])
}

/// Largest over smallest local length scale of a chart, the scale of a vertex being that of the area of its faces. One thin face
/// does not count, a crowded place does. Infinite if a place has no area.
pub(super) fn scale_variation(triangles: &[[u32; 3]], surface_area: &[f64], chart_area: &[f64], vertices: usize) -> f64 {
    let mut sums = vec![[0.0f64; 2]; vertices];
    for (f, t) in triangles.iter().enumerate() {
        for &v in t {
            sums[v as usize][0] += surface_area[f];
            sums[v as usize][1] += chart_area[f];
        }
    }
    let used = sums.iter().filter(|s| s[0] > 0.0);
    let (low, high) = used.fold((f64::INFINITY, 0.0f64), |(low, high), s| (low.min(s[1] / s[0]), high.max(s[1] / s[0])));
    if low > 0.0 && low.is_finite() { (high / low).sqrt() } else { f64::INFINITY }
}
