//! All borders shortened together: each moves only over faces and past vertices that no other border uses.

use super::Node;
use super::funnel::Strip;
use super::path::{Field, Turn};
use crate::curve::{CurveKind, CurveNetwork, curve_vertices};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;

/// A closed border is free everywhere only after its anchor has moved on this many times.
const ANCHORS: u32 = 5;
/// A border that ends where it starts and has shrunk to this share of its length stays: it would slip off or close in on a bump.
const LEAST_LENGTH: f64 = 0.4;
/// A crossing nearer to a vertex than this share of the edge goes through the vertex.
const SNAP: f64 = 0.12;
/// Nobody's.
const NOBODY: u32 = u32::MAX;
/// Boundary, features and junctions.
const HELD: u32 = u32::MAX - 1;

/// A border with its path.
#[derive(Debug, Clone)]
pub(super) struct Border {
    /// A halfedge of the border at first: the patches beside it are those on its left and right.
    pub(super) first: u32,
    /// The path; closed ones end where they start.
    pub(super) path: Vec<Node>,
    /// Whether it is closed without a junction.
    closed: bool,
    /// Passes in which it did not change.
    still: u32,
    start_length: f64,
}

/// All borders, and who uses what.
pub(super) struct Network<'a> {
    mesh: &'a SurfaceMesh,
    topology: &'a Topology,
    pub(super) borders: Vec<Border>,
    vertex: Vec<u32>,
    face: Vec<u32>,
    edge: Vec<u32>,
}

impl<'a> Network<'a> {
    /// Borders along their edges. O(F).
    pub(super) fn new(mesh: &'a SurfaceMesh, topology: &'a Topology, curves: &CurveNetwork) -> Self {
        let mut network = Network {
            mesh,
            topology,
            borders: Vec::new(),
            vertex: vec![NOBODY; topology.vertex_count()],
            face: vec![NOBODY; topology.face_count()],
            edge: vec![NOBODY; topology.halfedge_count()],
        };
        // Ends of curves first: a closed curve without a junction has none.
        let mut uses = vec![0u32; topology.vertex_count()];
        for curve in &curves.curves {
            curve_vertices(topology, curve).iter().skip(1).for_each(|&v| uses[v as usize] += 1);
            if !curve.closed {
                curve.halfedges.first().into_iter().for_each(|&h| uses[topology.origin(h) as usize] += 1);
            }
        }
        for curve in &curves.curves {
            let vertices = curve_vertices(topology, curve);
            if curve.kind != CurveKind::Seam {
                vertices.iter().for_each(|&v| network.vertex[v as usize] = HELD);
                curve.halfedges.iter().flat_map(|&h| [Some(h), topology.twin(h)]).flatten().for_each(|h| network.edge[h as usize] = HELD);
            } else if let (Some(&first), Some(&start), Some(&end)) = (curve.halfedges.first(), vertices.first(), vertices.last()) {
                let closed = curve.closed && uses[start as usize] == 1;
                if !closed {
                    network.vertex[start as usize] = HELD;
                    network.vertex[end as usize] = HELD;
                }
                let path: Vec<Node> = vertices.into_iter().map(Node::Vertex).collect();
                network.borders.push(Border { first, path, closed, still: 0, start_length: 0.0 });
            }
        }
        for b in 0..network.borders.len() as u32 {
            network.borders[b as usize].start_length = network.length(&network.borders[b as usize].path);
            network.claim(b, b);
        }
        network
    }

    fn length(&self, path: &[Node]) -> f64 {
        Field { mesh: self.mesh, topology: self.topology, free: |_| true, open: |_| true }.length(path)
    }

    /// Total length of all borders.
    pub(super) fn total_length(&self) -> f64 {
        self.borders.iter().map(|border| self.length(&border.path)).sum()
    }

    /// Faces that a path crosses, one for each pair of nodes not joined by an edge. `None` if two nodes share no face.
    fn crossed(&self, path: &[Node]) -> Option<Vec<Option<u32>>> {
        let topology = self.topology;
        let field = Field { mesh: self.mesh, topology, free: |_| true, open: |_| true };
        let face = |pair: &[Node]| match (pair[0], pair[1]) {
            (Node::Vertex(a), Node::Vertex(b)) => field.edge(a, b).or_else(|| field.edge(b, a)).map(|_| None),
            (Node::Vertex(v), Node::Crossing { halfedge, .. }) => {
                (topology.origin(topology.prev(halfedge)) == v).then_some(Some(halfedge / 3))
            }
            (Node::Crossing { halfedge, .. }, next) => {
                let t = topology.twin(halfedge)?;
                let fits = match next {
                    Node::Vertex(v) => topology.origin(topology.prev(t)) == v,
                    Node::Crossing { halfedge: h, .. } => h / 3 == t / 3 && h != t,
                };
                fits.then_some(Some(t / 3))
            }
        };
        path.windows(2).map(face).collect()
    }

    /// Gives border `b` (or with [`NOBODY`] takes from it) what its path uses, ends that are held aside.
    fn claim(&mut self, b: u32, owner: u32) {
        let path = std::mem::take(&mut self.borders[b as usize].path);
        for (pair, face) in path.windows(2).zip(self.crossed(&path).unwrap_or_default()) {
            if let (Node::Vertex(u), Node::Vertex(w)) = (pair[0], pair[1]) {
                let field = Field { mesh: self.mesh, topology: self.topology, free: |_| true, open: |_| true };
                for h in [field.edge(u, w), field.edge(w, u)].into_iter().flatten() {
                    self.edge[h as usize] = owner;
                }
            }
            face.into_iter().for_each(|f| self.face[f as usize] = owner);
        }
        for node in &path {
            if let Node::Vertex(v) = *node
                && self.vertex[v as usize] != HELD
            {
                self.vertex[v as usize] = owner;
            }
        }
        self.borders[b as usize].path = path;
    }

    /// Whether a path is simple, ends where it starts if it is to, and uses nothing of others. Its own claims must have been dropped.
    fn is_clear(&mut self, path: &[Node], closed: bool) -> bool {
        // Going there and back over the crossing where a closed path starts takes its end away.
        if closed && path.first() != path.last() {
            return false;
        }
        let Some(faces) = self.crossed(path) else { return false };
        let field = Field { mesh: self.mesh, topology: self.topology, free: |_| true, open: |_| true };
        let mut crossed: Vec<u32> = faces.iter().flatten().copied().collect();
        let mut vertices: Vec<u32> = path.iter().filter_map(|n| if let Node::Vertex(v) = n { Some(*v) } else { None }).collect();
        if closed && matches!(path.first(), Some(Node::Vertex(_))) {
            vertices.pop();
        }
        let (count, vertex_count) = (crossed.len(), vertices.len());
        crossed.sort_unstable();
        crossed.dedup();
        vertices.sort_unstable();
        vertices.dedup();
        let loop_at_junction = !closed && path.len() > 2 && path.first() == path.last();
        let edges_free = path.windows(2).all(|pair| match (pair[0], pair[1]) {
            (Node::Vertex(u), Node::Vertex(w)) => field.edge(u, w).is_some_and(|h| self.edge[h as usize] == NOBODY),
            _ => true,
        });
        let inner = &path[1..path.len().max(2) - 1];
        edges_free
            && crossed.len() == count
            && vertices.len() + usize::from(loop_at_junction) == vertex_count
            && crossed.iter().all(|&f| self.face[f as usize] == NOBODY)
            && inner.iter().all(|n| !matches!(n, Node::Vertex(v) if self.vertex[*v as usize] != NOBODY))
    }

    /// Shortens every border in at most so many passes; none leaves it as it is. Each pass moves a border past one row of vertices at most, so
    /// that is the width of its band. Deterministic. O(passes x nodes of the paths).
    pub(super) fn shorten(&mut self, passes: &[u32], work: &Work<'_>) -> Result<()> {
        for pass in 0..passes.iter().copied().max().unwrap_or(0) {
            let mut active = false;
            for (b, _) in passes.iter().enumerate().filter(|(_, most)| pass < **most) {
                work.check()?;
                let limit = if self.borders[b].closed { ANCHORS } else { 1 };
                if self.borders[b].still < limit {
                    self.step(b as u32);
                    active |= self.borders[b].still < limit;
                }
            }
            if !active {
                break;
            }
        }
        for (b, _) in passes.iter().enumerate().filter(|(_, most)| **most > 0) {
            work.check()?;
            self.snap(b as u32);
        }
        Ok(())
    }

    /// One pass over a border.
    fn step(&mut self, b: u32) {
        let border = &self.borders[b as usize];
        if border.path.len() < 3 {
            self.borders[b as usize].still = ANCHORS;
            return;
        }
        let before = self.length(&border.path);
        if border.path.first() == border.path.last() && before < LEAST_LENGTH * border.start_length {
            self.borders[b as usize].still = ANCHORS;
            return;
        }
        self.claim(b, NOBODY);
        let closed = self.borders[b as usize].closed;
        let mut changed = false;
        for which in [Turn::All, Turn::Even, Turn::Odd] {
            let shorter = self.shorter(&self.borders[b as usize].path, which, closed);
            let Some(path) = shorter else { break };
            let length = self.length(&path);
            if path.len() > 1 && length <= before * (1.0 + 1e-12) && length > 0.0 && self.is_clear(&path, closed) {
                changed = length < before * (1.0 - 1e-9) || !closed;
                self.borders[b as usize].path = path;
                break;
            }
        }
        self.claim(b, b);
        let border = &mut self.borders[b as usize];
        border.still = if changed { 0 } else { border.still + 1 };
        if closed && border.path.len() > 3 {
            border.path.pop();
            let by = border.path.len() * 2 / 5 + 1;
            border.path.rotate_left(by);
            border.path.extend(border.path.first().copied());
        }
    }

    /// The path led around its bends and drawn tight.
    fn shorter(&self, path: &[Node], which: Turn, closed: bool) -> Option<Vec<Node>> {
        let free = |v: u32| self.vertex[v as usize] == NOBODY;
        let field = Field { mesh: self.mesh, topology: self.topology, free, open: |f: u32| self.face[f as usize] == NOBODY };
        let around = field.turned_around(path, which);
        // The anchor of a closed border has moved, so that it may become shorter without a bend in a vertex.
        let loose = match around {
            Some(around) => around,
            None if closed => path.to_vec(),
            None => return None,
        };
        let strip = Strip { mesh: self.mesh, topology: self.topology, blocked: |v: u32| self.vertex[v as usize] != NOBODY };
        let (&start, &end) = (loose.first()?, loose.last()?);
        let mut out = vec![start];
        let mut from = start;
        let mut gates: Vec<u32> = Vec::new();
        for &node in &loose[1..loose.len() - 1] {
            match node {
                Node::Crossing { halfedge, .. } => gates.push(halfedge),
                Node::Vertex(_) => {
                    out.extend(strip.shortest(from, &gates, node)?);
                    out.push(node);
                    from = node;
                    gates.clear();
                }
            }
        }
        out.extend(strip.shortest(from, &gates, end)?);
        out.push(end);
        Some(out)
    }

    /// Leads a border through vertices that it passes closely.
    fn snap(&mut self, b: u32) {
        self.claim(b, NOBODY);
        let mut path = std::mem::take(&mut self.borders[b as usize].path);
        let before = path.clone();
        let closed = self.borders[b as usize].closed;
        // A closed path is cut open in a vertex, or else where it crosses an edge well inside, so that its ends may stay.
        let stays = |n: &Node| match n {
            Node::Vertex(_) => true,
            Node::Crossing { t, .. } => (SNAP..=1.0 - SNAP).contains(t),
        };
        let vertex = path.iter().position(|n| matches!(n, Node::Vertex(_)));
        if closed && let Some(at) = vertex.or_else(|| path.iter().position(stays)) {
            path.pop();
            path.rotate_left(at);
            path.extend(path.first().copied());
        }
        let topology = self.topology;
        let touches = |node: &Node, v: u32| match node {
            Node::Crossing { halfedge, .. } => topology.origin(*halfedge) == v || topology.target(*halfedge) == v,
            Node::Vertex(_) => false,
        };
        let mut i = 1;
        while i + 1 < path.len() {
            let near = match path[i] {
                Node::Crossing { halfedge, t } if t < SNAP => Some(topology.origin(halfedge)),
                Node::Crossing { halfedge, t } if t > 1.0 - SNAP => Some(topology.target(halfedge)),
                _ => None,
            };
            if let Some(v) = near.filter(|&v| self.vertex[v as usize] == NOBODY && !path.contains(&Node::Vertex(v))) {
                let from = (1..i).rev().take_while(|&k| touches(&path[k], v)).last().unwrap_or(i);
                let to = (i..path.len() - 1).take_while(|&k| touches(&path[k], v)).last().unwrap_or(i);
                path.splice(from..=to, [Node::Vertex(v)]);
                i = from;
            }
            i += 1;
        }
        self.borders[b as usize].path = if self.is_clear(&path, closed) { path } else { before };
        self.claim(b, b);
    }
}
