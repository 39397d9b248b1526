//! Shortening a path over a surface: where it bends at a vertex by less than a straight angle on one side, it is led around the vertex on
//! that side; the strips between the vertices that are left are then drawn tight.

use super::Node;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, angle_between, distance, lerp, sub};
use std::f64::consts::PI;

/// Angles nearer to straight than this are straight.
const STRAIGHT: f64 = 1e-7;
/// No vertex with more edges is gone around.
const MOST_EDGES: usize = 4096;

/// The direction in which a path leaves a vertex: along a halfedge that leaves it, or inside the face on the left of that halfedge.
#[derive(Debug, Clone, Copy)]
struct Way {
    halfedge: u32,
    inside: bool,
    toward: Vec3,
}

/// The surface with what paths on it may pass.
pub(super) struct Field<'a, E, F> {
    pub(super) mesh: &'a SurfaceMesh,
    pub(super) topology: &'a Topology,
    /// Whether a path may go around a vertex.
    pub(super) free: E,
    /// Whether a path may enter a face.
    pub(super) open: F,
}

/// Which bends are gone around at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Turn {
    /// All.
    All,
    /// Every other vertex of the path.
    Even,
    /// The others.
    Odd,
}

impl<E: Fn(u32) -> bool, F: Fn(u32) -> bool> Field<'_, E, F> {
    /// A point of a path.
    pub(super) fn place(&self, node: Node) -> Vec3 {
        let at = |v: u32| self.mesh.positions[v as usize];
        match node {
            Node::Vertex(v) => at(v),
            Node::Crossing { halfedge, t } => lerp(at(self.topology.origin(halfedge)), at(self.topology.target(halfedge)), t),
        }
    }

    /// Length of a path.
    pub(super) fn length(&self, path: &[Node]) -> f64 {
        path.windows(2).map(|pair| distance(self.place(pair[0]), self.place(pair[1]))).sum()
    }

    /// The halfedge from a vertex to another.
    pub(super) fn edge(&self, from: u32, to: u32) -> Option<u32> {
        self.topology.outgoing(from).find(|&h| self.topology.target(h) == to)
    }

    fn way(&self, v: u32, node: Node, backwards: bool) -> Option<Way> {
        let toward = self.place(node);
        match node {
            Node::Vertex(w) => Some(Way { halfedge: self.edge(v, w)?, inside: false, toward }),
            Node::Crossing { halfedge, .. } => {
                let of_face = if backwards { self.topology.twin(halfedge)? } else { halfedge };
                let first = self.topology.prev(of_face);
                (self.topology.origin(first) == v).then_some(Way { halfedge: first, inside: true, toward })
            }
        }
    }

    /// The next halfedge that leaves the same vertex, counter-clockwise.
    fn turned(&self, h: u32) -> Option<u32> {
        self.topology.twin(self.topology.prev(h))
    }

    /// Halfedges that leave `v` strictly between two directions, counter-clockwise, and the angle between the two.
    fn sector(&self, v: u32, from: Way, to: Way) -> Option<(Vec<u32>, f64)> {
        let centre = self.mesh.positions[v as usize];
        let angle = |a: Vec3, b: Vec3| angle_between(sub(a, centre), sub(b, centre));
        let tip = |h: u32| self.mesh.positions[self.topology.target(h) as usize];
        let mut between = Vec::new();
        let turn_in_face = |way: &Way| if way.inside { angle(tip(way.halfedge), way.toward) } else { 0.0 };
        let within_face = from.halfedge == to.halfedge && to.inside && turn_in_face(&from) < turn_in_face(&to);
        let mut at = from.halfedge;
        while !within_face {
            at = self.turned(at)?;
            if at == to.halfedge && !to.inside {
                break;
            }
            between.push(at);
            if at == to.halfedge {
                break;
            }
            if between.len() > MOST_EDGES {
                return None;
            }
        }
        let mut sum = 0.0;
        let mut last = from.toward;
        for point in between.iter().map(|&h| tip(h)).chain([to.toward]) {
            sum += angle(last, point);
            last = point;
        }
        Some((between, sum))
    }

    /// Gates around vertex `i` of a path on its shorter side, if that is less than straight and open; `true` if it is the left one.
    fn around(&self, path: &[Node], i: usize) -> Option<(bool, Vec<u32>)> {
        let Node::Vertex(v) = path[i] else { return None };
        if !(self.free)(v) || self.topology.is_boundary_vertex(v) || path[i - 1] == path[i + 1] {
            return None;
        }
        let (back, on) = (self.way(v, path[i - 1], true)?, self.way(v, path[i + 1], false)?);
        let (left, right) = (self.sector(v, on, back)?, self.sector(v, back, on)?);
        let mut sides = [(true, left), (false, right)];
        sides.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
        for (is_left, (between, angle)) in sides {
            if angle >= PI - STRAIGHT {
                return None;
            }
            let faces = between.iter().flat_map(|&h| [Some(h), self.topology.twin(h)]);
            if faces.flatten().all(|h| (self.open)(h / 3)) {
                let gates = if is_left {
                    between.into_iter().rev().collect()
                } else {
                    between.into_iter().map(|h| self.topology.twin(h)).collect::<Option<Vec<u32>>>()?
                };
                return Some((is_left, gates));
            }
        }
        None
    }

    /// The path led around the vertices where it bends, not yet drawn tight; `None` if there is none to go around.
    pub(super) fn turned_around(&self, path: &[Node], which: Turn) -> Option<Vec<Node>> {
        let chosen = |i: usize| which == Turn::All || (i % 2 == 0) == (which == Turn::Even);
        let last = path.len().checked_sub(1)?;
        let mut around: Vec<Option<(bool, Vec<u32>)>> =
            (0..path.len()).map(|i| if i > 0 && i < last && chosen(i) { self.around(path, i) } else { None }).collect();
        if around.iter().all(Option::is_none) {
            return None;
        }
        let gate = |h: u32| Node::Crossing { halfedge: h, t: 0.5 };
        let mut out: Vec<Node> = Vec::with_capacity(2 * path.len());
        let mut side_before = None;
        for (i, &node) in path.iter().enumerate() {
            let (Node::Vertex(v), Some((is_left, gates))) = (node, around[i].take()) else {
                out.push(node);
                side_before = None;
                continue;
            };
            // From the left of one end of an edge to the right of the other, the edge itself is crossed.
            if let (Some((u, was_left)), true) = (side_before, i > 0)
                && was_left != is_left
                && let Some(h) = self.edge(u, v)
            {
                out.push(gate(if was_left { h } else { self.topology.twin(h)? }));
            }
            out.extend(gates.into_iter().map(gate));
            side_before = Some((v, is_left));
        }
        Some(self.reduced(&out))
    }

    /// Without gates that are crossed there and back, and without gates that end in a vertex of the path beside them.
    fn reduced(&self, path: &[Node]) -> Vec<Node> {
        let touches = |h: u32, v: u32| self.topology.origin(h) == v || self.topology.target(h) == v;
        let mut out: Vec<Node> = Vec::with_capacity(path.len());
        for &node in path {
            match (out.last().copied(), node) {
                (Some(Node::Crossing { halfedge, .. }), Node::Crossing { halfedge: h, .. })
                    if self.topology.twin(halfedge) == Some(h) && out.len() > 1 =>
                {
                    out.pop();
                }
                (Some(Node::Vertex(v)), Node::Crossing { halfedge, .. }) if touches(halfedge, v) => {}
                (_, Node::Vertex(v)) => {
                    while let Some(&Node::Crossing { halfedge, .. }) = out.last()
                        && out.len() > 1
                        && touches(halfedge, v)
                    {
                        out.pop();
                    }
                    if out.last() != Some(&node) || out.len() == 1 {
                        out.push(node);
                    }
                }
                _ => out.push(node),
            }
        }
        out
    }
}
