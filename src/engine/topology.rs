//! Adjacency of an oriented manifold triangulation and its topological numbers. Never asks for a position.

use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};

const NO_TWIN: u32 = u32::MAX;

/// Numbers of one connected component of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ComponentTopology {
    /// Faces.
    pub faces: u32,
    /// Vertices.
    pub vertices: u32,
    /// Edges.
    pub edges: u32,
    /// Boundary loops.
    pub loops: u32,
}

impl ComponentTopology {
    /// Euler characteristic V - E + F.
    pub fn euler(&self) -> i64 {
        i64::from(self.vertices) - i64::from(self.edges) + i64::from(self.faces)
    }

    /// Number of handles, from the Euler-Poincare formula (P2 eq. 2).
    pub fn genus(&self) -> u32 {
        ((2 - i64::from(self.loops) - self.euler()) / 2).max(0) as u32
    }
}

/// Halfedge adjacency. Halfedge `3 f + k` runs from corner `k` of face `f` to corner `k + 1`.
/// Exists only for surfaces that are manifold (with boundary) and consistently oriented.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    origin: Vec<u32>,
    twin: Vec<u32>,
    outgoing: Vec<u32>,
    /// Boundary loops, each a list of boundary halfedges, one starting where the one before it ends.
    pub loops: Vec<Vec<u32>>,
    /// Component of each face.
    pub face_component: Vec<u32>,
    /// Numbers of each component.
    pub components: Vec<ComponentTopology>,
}

impl Topology {
    /// Builds the adjacency in O(F log F).
    ///
    /// # Errors
    /// [`Reason::NonManifoldEdge`] if an edge has more than two faces or two faces run along it the same way,
    /// [`Reason::NonManifoldVertex`] if the faces of a vertex form several fans. Messages name vertices; callers that have
    /// positions attach locations.
    pub fn build(triangles: &[[u32; 3]], vertex_count: usize) -> Result<Topology> {
        let n = triangles.len() * 3;
        let origin: Vec<u32> = triangles.as_flattened().to_vec();
        // Counting sort of halfedges by their lower vertex, then match within each short bucket.
        let ends = |h: usize| {
            let (a, b) = (origin[h], origin[if h % 3 == 2 { h - 2 } else { h + 1 }]);
            (a.min(b), a.max(b))
        };
        let mut start = vec![0u32; vertex_count + 1];
        for h in 0..n {
            start[ends(h).0 as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            start[v + 1] += start[v];
        }
        let mut fill = start.clone();
        let mut bucket = vec![(0u32, 0u32); n];
        for h in 0..n {
            let (low, high) = ends(h);
            bucket[fill[low as usize] as usize] = (high, h as u32);
            fill[low as usize] += 1;
        }
        let mut twin = vec![NO_TWIN; n];
        for v in 0..vertex_count {
            let part = &mut bucket[start[v] as usize..start[v + 1] as usize];
            part.sort_unstable();
            let mut i = 0;
            while i < part.len() {
                let mut j = i + 1;
                while j < part.len() && part[j].0 == part[i].0 {
                    j += 1;
                }
                match j - i {
                    1 => {}
                    2 if origin[part[i].1 as usize] != origin[part[i + 1].1 as usize] => {
                        twin[part[i].1 as usize] = part[i + 1].1;
                        twin[part[i + 1].1 as usize] = part[i].1;
                    }
                    count => {
                        return Err(EngineError::new(
                            Reason::NonManifoldEdge,
                            format!("edge ({v}, {}) has {count} faces or faces that run along it the same way", part[i].0),
                        )
                        .with_metadata("edge", format!("{v},{}", part[i].0)));
                    }
                }
                i = j;
            }
        }
        // One outgoing halfedge per vertex; for boundary vertices the boundary halfedge that leaves it.
        let mut outgoing = vec![NO_TWIN; vertex_count];
        let mut degree = vec![0u32; vertex_count];
        for h in 0..n {
            let v = origin[h] as usize;
            degree[v] += 1;
            if outgoing[v] == NO_TWIN || twin[h] == NO_TWIN {
                outgoing[v] = h as u32;
            }
        }
        let mut topology = Topology { origin, twin, outgoing, loops: Vec::new(), face_component: Vec::new(), components: Vec::new() };
        for v in 0..vertex_count {
            if degree[v] > 0 && topology.outgoing(v as u32).count() != degree[v] as usize {
                return Err(EngineError::new(Reason::NonManifoldVertex, format!("the faces around vertex {v} form more than one fan"))
                    .with_metadata("vertex", v));
            }
        }
        topology.trace_loops();
        topology.label_components();
        Ok(topology)
    }

    fn trace_loops(&mut self) {
        let mut seen = vec![false; self.twin.len()];
        for h in 0..self.twin.len() {
            if self.twin[h] != NO_TWIN || seen[h] {
                continue;
            }
            let mut ring = Vec::new();
            let mut at = h as u32;
            while !seen[at as usize] {
                seen[at as usize] = true;
                ring.push(at);
                at = self.outgoing[self.target(at) as usize];
            }
            self.loops.push(ring);
        }
    }

    fn label_components(&mut self) {
        let faces = self.twin.len() / 3;
        let mut component = vec![NO_TWIN; faces];
        let mut numbers: Vec<ComponentTopology> = Vec::new();
        let mut stack = Vec::new();
        for seed in 0..faces {
            if component[seed] != NO_TWIN {
                continue;
            }
            let label = numbers.len() as u32;
            let mut count = ComponentTopology::default();
            let mut twice_edges = 0;
            component[seed] = label;
            stack.push(seed);
            while let Some(f) = stack.pop() {
                count.faces += 1;
                for h in 3 * f..3 * f + 3 {
                    let t = self.twin[h];
                    twice_edges += if t == NO_TWIN { 2 } else { 1 };
                    if t != NO_TWIN && component[t as usize / 3] == NO_TWIN {
                        component[t as usize / 3] = label;
                        stack.push(t as usize / 3);
                    }
                }
            }
            count.edges = twice_edges / 2;
            numbers.push(count);
        }
        for &h in &self.outgoing {
            if h != NO_TWIN {
                numbers[component[h as usize / 3] as usize].vertices += 1;
            }
        }
        for ring in &self.loops {
            numbers[component[ring[0] as usize / 3] as usize].loops += 1;
        }
        self.face_component = component;
        self.components = numbers;
    }

    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.twin.len() / 3
    }

    /// Number of halfedges.
    pub fn halfedge_count(&self) -> usize {
        self.twin.len()
    }

    /// Number of vertices, isolated ones included.
    pub fn vertex_count(&self) -> usize {
        self.outgoing.len()
    }

    /// The opposite halfedge, `None` on the boundary.
    #[inline]
    pub fn twin(&self, h: u32) -> Option<u32> {
        let t = self.twin[h as usize];
        (t != NO_TWIN).then_some(t)
    }

    /// Next halfedge in the face.
    #[inline]
    pub fn next(&self, h: u32) -> u32 {
        if h % 3 == 2 { h - 2 } else { h + 1 }
    }

    /// Previous halfedge in the face.
    #[inline]
    pub fn prev(&self, h: u32) -> u32 {
        if h.is_multiple_of(3) { h + 2 } else { h - 1 }
    }

    /// Face of a halfedge.
    #[inline]
    pub fn face(&self, h: u32) -> u32 {
        h / 3
    }

    /// Vertex a halfedge leaves.
    #[inline]
    pub fn origin(&self, h: u32) -> u32 {
        self.origin[h as usize]
    }

    /// Vertex a halfedge reaches.
    #[inline]
    pub fn target(&self, h: u32) -> u32 {
        self.origin[self.next(h) as usize]
    }

    /// Whether the halfedge is the one of its edge that stands for it: the boundary one or the lower numbered of two.
    #[inline]
    pub fn is_edge_representative(&self, h: u32) -> bool {
        self.twin(h).is_none_or(|t| h < t)
    }

    /// Outgoing halfedges of a vertex in counter-clockwise order, from the boundary if there is one; empty for isolated vertices.
    pub fn outgoing(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.outgoing[v as usize];
        let mut at = (first != NO_TWIN).then_some(first);
        std::iter::from_fn(move || {
            let h = at?;
            at = self.twin(self.prev(h)).filter(|&next| next != first);
            Some(h)
        })
    }

    /// Whether the vertex lies on a boundary loop.
    #[inline]
    pub fn is_boundary_vertex(&self, v: u32) -> bool {
        let h = self.outgoing[v as usize];
        h != NO_TWIN && self.twin[h as usize] == NO_TWIN
    }

    /// Sum over the components, for reports: (Euler characteristic, genus, boundary loops, components).
    pub fn totals(&self) -> (i64, u32, u32, u32) {
        let sum = |f: &dyn Fn(&ComponentTopology) -> i64| self.components.iter().map(f).sum::<i64>();
        (sum(&|c| c.euler()), sum(&|c| i64::from(c.genus())) as u32, self.loops.len() as u32, self.components.len() as u32)
    }
}

impl Contents for Topology {
    fn feed(&self, into: &mut Feeder) {
        // Everything else follows from the triangles.
        into.u32s(&self.origin).u64(self.outgoing.len() as u64);
    }

    fn bytes(&self) -> usize {
        self.twin.len() * 8
            + self.outgoing.len() * 4
            + self.face_component.len() * 4
            + self.loops.iter().map(|l| l.len() * 4 + 24).sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tetrahedron_is_a_sphere() {
        let t = Topology::build(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], 4).unwrap();
        assert_eq!(t.totals(), (2, 0, 0, 1));
        assert!((0..4).all(|v| t.outgoing(v).count() == 3 && !t.is_boundary_vertex(v)));
    }

    #[test]
    fn fan_has_one_loop_in_order() {
        let t = Topology::build(&[[0, 1, 2], [0, 2, 3], [0, 3, 4]], 5).unwrap();
        assert_eq!(t.totals(), (1, 0, 1, 1));
        let ring = &t.loops[0];
        assert_eq!(ring.len(), 5);
        assert!((0..5).all(|i| t.target(ring[i]) == t.origin(ring[(i + 1) % 5])));
        assert_eq!(t.outgoing(0).map(|h| t.face(h)).collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[test]
    fn bow_tie_and_third_face_are_refused() {
        let bow = Topology::build(&[[0, 1, 2], [0, 3, 4]], 5).unwrap_err();
        assert_eq!(bow.reason(), Reason::NonManifoldVertex);
        let fin = Topology::build(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], 5).unwrap_err();
        assert_eq!(fin.reason(), Reason::NonManifoldEdge);
    }

    #[test]
    fn two_components_and_an_isolated_vertex() {
        let t = Topology::build(&[[0, 1, 2], [3, 4, 5]], 7).unwrap();
        assert_eq!(t.totals(), (2, 0, 2, 2));
        assert_eq!(t.outgoing(6).count(), 0);
    }
}
