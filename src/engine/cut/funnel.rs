//! The shortest path through a strip of faces: the strip unfolded into the plane, and a funnel drawn through its gates.

use super::Node;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec2, cross, dot, norm, sub};

/// Share of an edge that a path keeps from an end that it must not touch.
const CLEARANCE: f64 = 0.2;
/// Steps of the funnel per gate at most.
const MOST_STEPS: usize = 64;

fn minus(a: Vec2, b: Vec2) -> Vec2 {
    [a[0] - b[0], a[1] - b[1]]
}

fn wedge(a: Vec2, b: Vec2) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn between(a: Vec2, b: Vec2, t: f64) -> Vec2 {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

/// A gate unfolded: an edge that the path crosses, with the vertices on its right and left.
#[derive(Debug, Clone, Copy)]
struct Gate {
    halfedge: u32,
    right: Vec2,
    left: Vec2,
    /// Shares of the edge, from its right end, between which the path may pass.
    range: [f64; 2],
}

impl Gate {
    fn at(&self, t: f64) -> Vec2 {
        between(self.right, self.left, t)
    }
}

/// The strip between two nodes.
pub(super) struct Strip<'a, F> {
    pub(super) mesh: &'a SurfaceMesh,
    pub(super) topology: &'a Topology,
    /// Whether a path must keep off a vertex.
    pub(super) blocked: F,
}

impl<F: Fn(u32) -> bool> Strip<'_, F> {
    /// The vertex of the face of `h` that is not on `h`, unfolded to one side of the edge from `right` to `left`: 1 to the right of it,
    /// -1 to the left. `right` and `left` are the ends of `h` or of its twin.
    fn third(&self, h: u32, ends: [u32; 2], [right, left]: [Vec2; 2], side: f64) -> Vec2 {
        let place = |v: u32| self.mesh.positions[v as usize];
        let apex = place(self.topology.origin(self.topology.prev(h)));
        let along = sub(place(ends[1]), place(ends[0]));
        let reach = sub(apex, place(ends[0]));
        let square = dot(along, along).max(f64::MIN_POSITIVE);
        let share = dot(reach, along) / square;
        // Height over the edge in units of its length.
        let height = side * norm(cross(along, reach)) / square;
        let d = minus(left, right);
        [right[0] + share * d[0] + height * d[1], right[1] + share * d[1] - height * d[0]]
    }

    fn gate(&self, halfedge: u32, right: Vec2, left: Vec2) -> Gate {
        let keep = |v: u32| if (self.blocked)(v) { CLEARANCE } else { 0.0 };
        let range = [keep(self.topology.origin(halfedge)), 1.0 - keep(self.topology.target(halfedge))];
        Gate { halfedge, right, left, range }
    }

    fn ends(&self, h: u32) -> [u32; 2] {
        [self.topology.origin(h), self.topology.target(h)]
    }

    fn first_gate(&self, h: u32) -> Gate {
        let [a, b] = self.ends(h).map(|v| self.mesh.positions[v as usize]);
        self.gate(h, [0.0, 0.0], [0.0, norm(sub(b, a))])
    }

    /// The gate after another, `None` if no face has both.
    fn next_gate(&self, gate: &Gate, h: u32) -> Option<Gate> {
        let t = self.topology.twin(gate.halfedge)?;
        let apex = || self.third(t, self.ends(gate.halfedge), [gate.right, gate.left], 1.0);
        if self.topology.next(t) == h {
            Some(self.gate(h, gate.right, apex()))
        } else if self.topology.prev(t) == h {
            Some(self.gate(h, apex(), gate.left))
        } else {
            None
        }
    }

    /// Nodes of the shortest path from `from` to `to` through gates, both ends left out. `None` if the gates are no strip of faces from
    /// one to the other.
    pub(super) fn shortest(&self, from: Node, gates: &[u32], to: Node) -> Option<Vec<Node>> {
        if gates.is_empty() {
            return Some(Vec::new());
        }
        let mut chain: Vec<Gate> = Vec::with_capacity(gates.len());
        let start = match from {
            Node::Vertex(v) => {
                let first = self.first_gate(gates[0]);
                if self.topology.origin(self.topology.prev(first.halfedge)) != v {
                    return None;
                }
                chain.push(first);
                self.third(first.halfedge, self.ends(first.halfedge), [first.right, first.left], -1.0)
            }
            Node::Crossing { halfedge, t } => {
                let before = self.first_gate(halfedge);
                chain.push(self.next_gate(&before, gates[0])?);
                before.at(t)
            }
        };
        for &h in &gates[1..] {
            let last = *chain.last()?;
            chain.push(self.next_gate(&last, h)?);
        }
        let last = *chain.last()?;
        let end = match to {
            Node::Vertex(v) => {
                let t = self.topology.twin(last.halfedge)?;
                if self.topology.origin(self.topology.prev(t)) != v {
                    return None;
                }
                self.third(t, self.ends(last.halfedge), [last.right, last.left], 1.0)
            }
            Node::Crossing { halfedge, t } => self.next_gate(&last, halfedge)?.at(t),
        };
        let corners = funnel(start, &chain, end)?;
        Some(self.nodes(start, &chain, end, &corners))
    }

    /// Crossings of the polyline through some corners; a corner in a vertex takes the place of the gates around it.
    fn nodes(&self, start: Vec2, chain: &[Gate], end: Vec2, corners: &[Corner]) -> Vec<Node> {
        let mut nodes = Vec::with_capacity(chain.len());
        let mut vertex_at: Vec<Option<u32>> = vec![None; chain.len()];
        let mut dropped = vec![false; chain.len()];
        for corner in corners {
            let gate = &chain[corner.gate];
            let [right, left] = self.ends(gate.halfedge);
            let v = if corner.left { left } else { right };
            if (self.blocked)(v) {
                continue;
            }
            vertex_at[corner.gate] = Some(v);
            let touches = |i: usize| self.ends(chain[i].halfedge).contains(&v);
            (corner.gate..chain.len()).take_while(|&i| touches(i)).for_each(|i| dropped[i] = true);
            (0..corner.gate).rev().take_while(|&i| touches(i)).for_each(|i| dropped[i] = true);
        }
        let mut a = start;
        let mut ahead = corners.iter().peekable();
        for (i, gate) in chain.iter().enumerate() {
            let mut t = None;
            while let Some(corner) = ahead.next_if(|corner| corner.gate == i) {
                t = Some(gate.range[usize::from(corner.left)]);
                a = corner.point;
            }
            let b = ahead.peek().map_or(end, |corner| corner.point);
            if let Some(v) = vertex_at[i] {
                nodes.push(Node::Vertex(v));
            }
            if dropped[i] {
                continue;
            }
            let t = t.unwrap_or_else(|| {
                let (edge, way) = (minus(gate.left, gate.right), minus(b, a));
                let share = wedge(minus(a, gate.right), way) / wedge(edge, way);
                if share.is_finite() { share.clamp(gate.range[0], gate.range[1]) } else { 0.5 }
            });
            nodes.push(Node::Crossing { halfedge: gate.halfedge, t });
        }
        nodes
    }
}

/// Where the shortest path bends: at an end of the range of a gate.
#[derive(Debug, Clone, Copy)]
struct Corner {
    gate: usize,
    left: bool,
    point: Vec2,
}

/// Bends of the shortest path through gates. Near-linear for paths that bend little.
fn funnel(start: Vec2, chain: &[Gate], end: Vec2) -> Option<Vec<Corner>> {
    let portal = |i: usize| chain.get(i).map_or((end, end), |gate| (gate.at(gate.range[1]), gate.at(gate.range[0])));
    let mut corners: Vec<Corner> = Vec::new();
    let mut apex = start;
    let ((mut left, mut right), mut left_at, mut right_at) = (portal(0), 0, 0);
    let mut i = 1;
    let mut steps = 0;
    while i <= chain.len() {
        steps += 1;
        if steps > MOST_STEPS * (chain.len() + 4) {
            return None;
        }
        let (l, r) = portal(i);
        if wedge(minus(right, apex), minus(r, apex)) >= 0.0 {
            if right == apex || left == apex || wedge(minus(left, apex), minus(r, apex)) < 0.0 {
                (right, right_at) = (r, i);
            } else {
                corners.push(Corner { gate: left_at, left: true, point: left });
                (apex, right, i) = (left, left, left_at + 1);
                right_at = left_at;
                continue;
            }
        }
        if wedge(minus(left, apex), minus(l, apex)) <= 0.0 {
            if right == apex || left == apex || wedge(minus(right, apex), minus(l, apex)) > 0.0 {
                (left, left_at) = (l, i);
            } else {
                corners.push(Corner { gate: right_at, left: false, point: right });
                (apex, left, i) = (right, right, right_at + 1);
                left_at = right_at;
                continue;
            }
        }
        i += 1;
    }
    // Bends at the end itself are none.
    corners.retain(|corner| corner.gate < chain.len());
    Some(corners)
}
