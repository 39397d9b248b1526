//! Bounding volume tree over triangles: closest point, box overlap and self-join queries.

mod ray;

pub use ray::RayHit;

use crate::vector::{Vec3, add_scaled, area_vector_twice, cross, dot, scale, sub};

/// Triangles per leaf, at most.
const LEAF: usize = 4;

/// The point of a triangulated surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// Face that holds it.
    pub face: u32,
    /// The point.
    pub position: Vec3,
    /// Squared distance to the query.
    pub distance_squared: f64,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// First triangle of a leaf, or the first of two neighbouring children.
    first: u32,
    /// Number of triangles of a leaf; 0 for inner nodes.
    count: u32,
}

/// A static tree over the triangles of a surface: median splits of the longest axis, four triangles a leaf. Holds a copy of what
/// it needs (72 bytes a triangle and 28 for its share of the nodes).
#[derive(Debug, Clone, Default)]
pub struct TriangleBvh {
    nodes: Vec<Node>,
    /// Corners in leaf order.
    corners: Vec<[Vec3; 3]>,
    /// Face of each entry of `corners`.
    faces: Vec<u32>,
    /// Entry of `corners` of each face.
    slot: Vec<u32>,
}

impl TriangleBvh {
    /// Builds the tree in O(F log F).
    pub fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
        let mut items: Vec<(Vec3, u32)> = triangles
            .iter()
            .enumerate()
            .map(|(f, t)| {
                let (low, high) = triangle_box(&corners(t));
                (std::array::from_fn(|k| low[k] + high[k]), f as u32)
            })
            .collect();
        let mut nodes = Vec::with_capacity(triangles.len() / LEAF * 3 + 1);
        if !items.is_empty() {
            nodes.push(Node { low: [0.0; 3], high: [0.0; 3], first: 0, count: items.len() as u32 });
        }
        let mut at = 0;
        while at < nodes.len() {
            let (first, count) = (nodes[at].first as usize, nodes[at].count as usize);
            if count > LEAF {
                let middle = split(&mut items[first..first + count]);
                let child = nodes.len() as u32;
                for (first, count) in [(first, middle), (first + middle, count - middle)] {
                    nodes.push(Node { low: [0.0; 3], high: [0.0; 3], first: first as u32, count: count as u32 });
                }
                (nodes[at].first, nodes[at].count) = (child, 0);
            }
            at += 1;
        }
        let faces: Vec<u32> = items.iter().map(|item| item.1).collect();
        let mut slot = vec![0; faces.len()];
        for (i, &f) in faces.iter().enumerate() {
            slot[f as usize] = i as u32;
        }
        let corners: Vec<[Vec3; 3]> = faces.iter().map(|&f| corners(&triangles[f as usize])).collect();
        let mut tree = TriangleBvh { nodes, corners, faces, slot };
        tree.fit_boxes();
        tree
    }

    /// Boxes from the leaves up; children come after their parents.
    fn fit_boxes(&mut self) {
        for at in (0..self.nodes.len()).rev() {
            let Node { first, count, .. } = self.nodes[at];
            let first = first as usize;
            let (low, high) = if count == 0 {
                let (a, b) = (&self.nodes[first], &self.nodes[first + 1]);
                join((a.low, a.high), (b.low, b.high))
            } else {
                let own = &self.corners[first..first + count as usize];
                own.iter().skip(1).map(triangle_box).fold(triangle_box(&own[0]), join)
            };
            (self.nodes[at].low, self.nodes[at].high) = (low, high);
        }
    }

    /// Closest point of the surface; `None` only for an empty tree. O(log F) near the surface.
    pub fn closest(&self, point: Vec3) -> Option<ClosestPoint> {
        self.closest_below(point, f64::INFINITY, 0.0)
    }

    /// Closest point, searched from the bound the face `hint` gives, which makes it several times faster where the hint is near.
    /// Ends early with any point that is not farther than `stop_squared` (squared distance; 0 for the exact answer).
    /// `None` if there is no face `hint`.
    pub fn closest_from(&self, point: Vec3, hint: u32, stop_squared: f64) -> Option<ClosestPoint> {
        let slot = *self.slot.get(hint as usize)?;
        let position = closest_on_triangle(point, &self.corners[slot as usize]).0;
        let offset = sub(point, position);
        let seed = ClosestPoint { face: hint, position, distance_squared: dot(offset, offset) };
        Some(self.search(point, seed.distance_squared, stop_squared).unwrap_or(seed))
    }

    /// Closest point if it is nearer than `within_squared` (squared distance). The search ends early with any point that is not
    /// farther than `stop_squared`: enough to know that a maximum is not exceeded.
    pub fn closest_below(&self, point: Vec3, within_squared: f64, stop_squared: f64) -> Option<ClosestPoint> {
        self.search(point, within_squared, stop_squared)
    }

    fn search(&self, point: Vec3, within: f64, stop: f64) -> Option<ClosestPoint> {
        let root = self.nodes.first()?;
        let mut best = None;
        let mut bound = within;
        if bound <= stop {
            return None;
        }
        let mut stack = [(0u32, 0f64); 64];
        let mut depth = 1;
        stack[0] = (0, box_distance_squared(point, root));
        while depth > 0 {
            depth -= 1;
            let (at, distance) = stack[depth];
            if distance >= bound {
                continue;
            }
            let node = &self.nodes[at as usize];
            let first = node.first as usize;
            if node.count == 0 {
                let a = (node.first, box_distance_squared(point, &self.nodes[first]));
                let b = (node.first + 1, box_distance_squared(point, &self.nodes[first + 1]));
                let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
                // Halving keeps the depth below 32, so two entries a level always fit.
                for entry in [far, near] {
                    if entry.1 < bound {
                        stack[depth] = entry;
                        depth += 1;
                    }
                }
                continue;
            }
            for slot in first..first + node.count as usize {
                let position = closest_on_triangle(point, &self.corners[slot]).0;
                let offset = sub(point, position);
                let distance_squared = dot(offset, offset);
                if distance_squared < bound {
                    bound = distance_squared;
                    best = Some(ClosestPoint { face: self.faces[slot], position, distance_squared });
                    if bound <= stop {
                        return best;
                    }
                }
            }
        }
        best
    }

    /// Calls `visit` with each face whose box meets the box `low..high` (closed).
    pub fn faces_in_box(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(u32)) {
        let mut stack = Vec::new();
        if !self.nodes.is_empty() {
            stack.push(0u32);
        }
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            if !overlap((node.low, node.high), (low, high)) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first + 1, node.first]);
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                if overlap(triangle_box(&self.corners[slot]), (low, high)) {
                    visit(self.faces[slot]);
                }
            }
        }
    }

    /// Calls `visit` once with each pair of different faces whose boxes meet. Near-linear for surfaces that do not crowd.
    /// Stops at the first error of `visit`.
    ///
    /// # Errors
    /// Those of `visit`.
    pub fn overlapping_pairs<E>(&self, mut visit: impl FnMut(u32, u32) -> Result<(), E>) -> Result<(), E> {
        let boxes: Vec<(Vec3, Vec3)> = self.corners.iter().map(triangle_box).collect();
        let mut stack = Vec::new();
        if !self.nodes.is_empty() {
            stack.push((0u32, 0u32));
        }
        while let Some((a, b)) = stack.pop() {
            let (x, y) = (&self.nodes[a as usize], &self.nodes[b as usize]);
            if a != b && !overlap((x.low, x.high), (y.low, y.high)) {
                continue;
            }
            match (x.count, y.count) {
                (0, _) if a == b => stack.extend([(x.first, x.first), (x.first, x.first + 1), (x.first + 1, x.first + 1)]),
                (0, 0) => stack.extend([(x.first, y.first), (x.first, y.first + 1), (x.first + 1, y.first), (x.first + 1, y.first + 1)]),
                (0, _) => stack.extend([(x.first, b), (x.first + 1, b)]),
                (_, 0) => stack.extend([(a, y.first), (a, y.first + 1)]),
                _ => {
                    for i in x.first as usize..(x.first + x.count) as usize {
                        let from = if a == b { i + 1 } else { y.first as usize };
                        for j in from..(y.first + y.count) as usize {
                            if overlap(boxes[i], boxes[j]) {
                                visit(self.faces[i], self.faces[j])?;
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Corners of a face.
    #[inline]
    pub(crate) fn corners_of(&self, face: u32) -> &[Vec3; 3] {
        &self.corners[self.slot[face as usize] as usize]
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * std::mem::size_of::<Node>() + self.corners.len() * (72 + 8)
    }
}

/// Parts the items at the median of the longest axis of their centres; returns the size of the first part, a multiple of [`LEAF`].
fn split(items: &mut [(Vec3, u32)]) -> usize {
    let start = (items[0].0, items[0].0);
    let (low, high) = items.iter().fold(start, |bounds, item| join(bounds, (item.0, item.0)));
    let extent = sub(high, low);
    let axis = (0..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best });
    let middle = (items.len() / 2).div_ceil(LEAF) * LEAF;
    items.select_nth_unstable_by(middle, |x, y| x.0[axis].total_cmp(&y.0[axis]).then(x.1.cmp(&y.1)));
    middle
}

fn triangle_box([a, b, c]: &[Vec3; 3]) -> (Vec3, Vec3) {
    (std::array::from_fn(|k| a[k].min(b[k]).min(c[k])), std::array::from_fn(|k| a[k].max(b[k]).max(c[k])))
}

fn join(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> (Vec3, Vec3) {
    (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k])))
}

#[inline]
fn overlap(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> bool {
    (0..3).all(|k| a.0[k] <= b.1[k] && b.0[k] <= a.1[k])
}

#[inline]
fn box_distance_squared(p: Vec3, node: &Node) -> f64 {
    let mut sum = 0.0;
    for k in 0..3 {
        let d = (node.low[k] - p[k]).max(p[k] - node.high[k]).max(0.0);
        sum += d * d;
    }
    sum
}

/// Closest point of the segment `a b`: its parameter, 0 at `a`.
#[inline]
fn closest_on_segment(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let along = sub(b, a);
    let length = dot(along, along);
    if length > 0.0 { (dot(sub(p, a), along) / length).clamp(0.0, 1.0) } else { 0.0 }
}

/// Closest point of a triangle and its barycentric coordinates: not negative, exactly 0 at a corner that does not take part.
/// Degenerate triangles are treated as their edges.
#[inline]
pub fn closest_on_triangle(p: Vec3, corners: &[Vec3; 3]) -> (Vec3, [f64; 3]) {
    let [a, b, c] = *corners;
    let normal = area_vector_twice(a, b, c);
    let square = dot(normal, normal);
    let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
    let longest = dot(ab, ab).max(dot(bc, bc)).max(dot(ca, ca));
    let flat = square <= 1e-20 * longest * longest;
    // Twice the signed areas of the sub-triangles opposite each corner, times the normal's length.
    let weight = [dot(normal, cross(bc, sub(p, b))), dot(normal, cross(ca, sub(p, c))), dot(normal, cross(ab, sub(p, a)))];
    if !flat && weight.iter().all(|w| *w > 0.0) {
        let height = dot(sub(p, a), normal) / square;
        let total = 1.0 / (weight[0] + weight[1] + weight[2]);
        return (add_scaled(p, normal, -height), weight.map(|w| w * total));
    }
    // Outside: the closest point is on an edge that sees the query.
    let mut best = (f64::INFINITY, a, [1.0, 0.0, 0.0]);
    for k in 0..3 {
        if !flat && weight[k] > 0.0 {
            continue;
        }
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let t = closest_on_segment(p, corners[i], corners[j]);
        let at = add_scaled(scale(corners[i], 1.0 - t), corners[j], t);
        let offset = sub(p, at);
        let distance = dot(offset, offset);
        if distance < best.0 {
            let mut barycentric = [0.0; 3];
            (barycentric[i], barycentric[j]) = (1.0 - t, t);
            best = (distance, at, barycentric);
        }
    }
    (best.1, best.2)
}

#[cfg(test)]
mod tests;
