//! Point location in the triangulated chart: a walk from the last hit, a box tree where the walk leaves the chart, and clamping to
//! the nearest face for points outside.

use super::SurfacePoint;
use crate::patch::Patch;
use crate::topology::Topology;
use crate::vector::Vec2;
use std::cell::OnceCell;

const LEAF: usize = 4;
/// A point this far outside a face, by barycentric coordinates, that came in over that edge is on it.
const ROUNDING: f64 = 1e-9;

struct Node {
    low: Vec2,
    high: Vec2,
    /// Leaf: range in `order`. Inner: `first` is the right child (the left one follows its parent), `count` is 0.
    first: u32,
    count: u32,
}

/// Boxes over the faces of a chart.
struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// Finds the face of a chart that holds a point of the plane.
pub(super) struct Locator<'a> {
    patch: &'a Patch,
    uv: &'a [Vec2],
    topology: &'a Topology,
    /// Made when first a walk leaves the chart.
    tree: OnceCell<Tree>,
}

/// Twice the signed area.
#[inline]
pub(super) fn area2(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Closest point of a triangle as barycentric coordinates with the squared distance.
fn closest(t: [Vec2; 3], p: Vec2) -> ([f64; 3], f64) {
    let w = [area2(t[1], t[2], p), area2(t[2], t[0], p), area2(t[0], t[1], p)];
    let sum = w[0] + w[1] + w[2];
    if w.iter().all(|x| *x >= 0.0) && sum > 0.0 {
        return (w.map(|x| x / sum), 0.0);
    }
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for k in 0..3 {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let d = [b[0] - a[0], b[1] - a[1]];
        let e = [p[0] - a[0], p[1] - a[1]];
        let length = d[0] * d[0] + d[1] * d[1];
        let s = if length > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
        let r = [e[0] - s * d[0], e[1] - s * d[1]];
        let distance = r[0] * r[0] + r[1] * r[1];
        if distance < best.1 {
            let mut w = [0.0; 3];
            w[k] = 1.0 - s;
            w[(k + 1) % 3] = s;
            best = (w, distance);
        }
    }
    best
}

impl Tree {
    fn build(&mut self, boxes: &[(Vec2, Vec2)], from: usize, to: usize) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &f in &self.order[from..to] {
            let (l, h) = boxes[f as usize];
            for k in 0..2 {
                low[k] = low[k].min(l[k]);
                high[k] = high[k].max(h[k]);
            }
        }
        let me = self.nodes.len();
        if to - from <= LEAF {
            self.nodes.push(Node { low, high, first: from as u32, count: (to - from) as u32 });
            return;
        }
        self.nodes.push(Node { low, high, first: 0, count: 0 });
        let k = usize::from(high[1] - low[1] > high[0] - low[0]);
        let middle = (from + to) / 2;
        let centre = |f: &u32| boxes[*f as usize].0[k] + boxes[*f as usize].1[k];
        self.order[from..to].select_nth_unstable_by(middle - from, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
        self.build(boxes, from, middle);
        self.nodes[me].first = self.nodes.len() as u32;
        self.build(boxes, middle, to);
    }
}

impl<'a> Locator<'a> {
    pub(super) fn new(patch: &'a Patch, uv: &'a [Vec2], topology: &'a Topology) -> Self {
        Locator { patch, uv, topology, tree: OnceCell::new() }
    }

    fn tree(&self) -> Tree {
        let mut tree = Tree { nodes: Vec::new(), order: (0..self.patch.triangles.len() as u32).collect() };
        let mut boxes: Vec<(Vec2, Vec2)> = Vec::with_capacity(tree.order.len());
        for f in 0..self.patch.triangles.len() {
            let t = self.corners(f as u32);
            let of = |pick: fn(f64, f64) -> f64| [0, 1].map(|k| pick(pick(t[0][k], t[1][k]), t[2][k]));
            boxes.push((of(f64::min), of(f64::max)));
        }
        let count = tree.order.len();
        if count > 0 {
            tree.build(&boxes, 0, count);
        }
        tree
    }

    fn corners(&self, face: u32) -> [Vec2; 3] {
        self.patch.triangles[face as usize].map(|v| self.uv[v as usize])
    }

    /// The face of the chart nearest to `p`, by the tree.
    fn nearest(&self, p: Vec2) -> SurfacePoint {
        let mut best = (SurfacePoint { face: 0, barycentric: [1.0, 0.0, 0.0] }, f64::INFINITY);
        let reach = |n: &Node| {
            let d = [0, 1].map(|k| (n.low[k] - p[k]).max(p[k] - n.high[k]).max(0.0));
            d[0] * d[0] + d[1] * d[1]
        };
        let tree = self.tree.get_or_init(|| self.tree());
        let mut stack = vec![0usize];
        while let Some(at) = stack.pop() {
            let Some(node) = tree.nodes.get(at) else { continue };
            if reach(node) >= best.1 {
                continue;
            }
            if node.count == 0 {
                let (left, right) = (at + 1, node.first as usize);
                let left_first = reach(&tree.nodes[left]) <= reach(&tree.nodes[right]);
                stack.extend(if left_first { [right, left] } else { [left, right] });
                continue;
            }
            for &face in &tree.order[node.first as usize..(node.first + node.count) as usize] {
                let (barycentric, distance) = closest(self.corners(face), p);
                if distance < best.1 {
                    best = (SurfacePoint { face, barycentric }, distance);
                }
            }
        }
        best.0
    }

    /// The face at `p`, walking from `hint`; the nearest face if `p` is outside the chart.
    pub(super) fn locate(&self, p: Vec2, hint: u32) -> SurfacePoint {
        let mut face = hint;
        // The edge the walk came in by need not be looked at: `p` is on this side of it.
        let mut entry = usize::MAX;
        for _ in 0..256 {
            let t = self.corners(face);
            let mut w = [0.0; 3];
            let mut worst = usize::MAX;
            for k in 0..3 {
                w[k] = area2(t[(k + 1) % 3], t[(k + 2) % 3], p);
                if w[k] < 0.0 && k != entry && (worst == usize::MAX || w[k] < w[worst]) {
                    worst = k;
                }
            }
            if worst == usize::MAX {
                let sum = w[0] + w[1] + w[2];
                if sum > 0.0 && w.iter().all(|x| *x >= -ROUNDING * sum) {
                    let w = w.map(|x| x.max(0.0));
                    let sum = w[0] + w[1] + w[2];
                    return SurfacePoint { face, barycentric: w.map(|x| x / sum) };
                }
                break;
            }
            // Across the edge opposite the corner of the most negative weight.
            match self.topology.twin(3 * face + (worst as u32 + 1) % 3) {
                Some(twin) => {
                    face = self.topology.face(twin);
                    entry = (twin as usize + 2) % 3;
                }
                None => break,
            }
        }
        self.nearest(p)
    }

    /// Linear interpolation of vertex values at a point.
    pub(super) fn at<const N: usize>(&self, point: &SurfacePoint, values: &[[f64; N]]) -> [f64; N] {
        let [a, b, c] = self.patch.triangles[point.face as usize].map(|v| &values[v as usize]);
        let [x, y, z] = point.barycentric;
        std::array::from_fn(|k| x * a[k] + y * b[k] + z * c[k])
    }
}
