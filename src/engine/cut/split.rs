//! Splitting faces along paths: no face is crossed more than once, so a face becomes two or three.

use super::Node;
use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, kappa, lerp};

/// Where a vertex that a split has made is: inside an edge of the mesh before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgePoint {
    /// The ends of the edge.
    pub ends: [u32; 2],
    /// Share of the way from the first to the second.
    pub t: f64,
}

impl EdgePoint {
    /// The nearer end.
    pub fn nearest(&self) -> u32 {
        self.ends[usize::from(self.t > 0.5)]
    }
}

/// A mesh with faces split along paths.
pub(super) struct Split {
    pub(super) mesh: SurfaceMesh,
    pub(super) new_vertices: Vec<EdgePoint>,
    /// Face of the mesh before of each face. The first face made of a face keeps its number.
    pub(super) face_origin: Vec<u32>,
    /// For each halfedge the one of the mesh before that it is, where it is a whole edge of it.
    pub(super) whole: Vec<Option<u32>>,
    /// Vertices of each path; closed ones end where they start.
    pub(super) paths: Vec<Vec<u32>>,
}

/// Splits. O(F) to copy, plus the paths.
pub(super) fn split(mesh: &SurfaceMesh, topology: &Topology, paths: &[&[Node]]) -> Result<Split> {
    let count = mesh.positions.len();
    let mut out = Split {
        mesh: mesh.clone(),
        new_vertices: Vec::new(),
        face_origin: (0..mesh.triangles.len() as u32).collect(),
        whole: (0..3 * mesh.triangles.len() as u32).map(Some).collect(),
        paths: Vec::with_capacity(paths.len()),
    };
    for path in paths {
        let closed_in_edge = path.len() > 2 && path.first() == path.last() && matches!(path[0], Node::Crossing { .. });
        let mut vertices = Vec::with_capacity(path.len());
        for (i, node) in path.iter().enumerate() {
            vertices.push(match *node {
                Node::Vertex(v) => v,
                Node::Crossing { .. } if closed_in_edge && i + 1 == path.len() => vertices[0],
                Node::Crossing { halfedge, t } => {
                    let ends = [topology.origin(halfedge), topology.target(halfedge)];
                    out.mesh.positions.push(lerp(mesh.positions[ends[0] as usize], mesh.positions[ends[1] as usize], t));
                    out.new_vertices.push(EdgePoint { ends, t });
                    (count + out.new_vertices.len() - 1) as u32
                }
            });
        }
        for (pair, nodes) in vertices.windows(2).zip(path.windows(2)) {
            out.chord(topology, [pair[0], pair[1]], [nodes[0], nodes[1]])?;
        }
        out.paths.push(vertices);
    }
    Ok(out)
}

impl Split {
    fn at(&self, v: u32) -> Vec3 {
        self.mesh.positions[v as usize]
    }

    fn worst(&self, faces: &[[u32; 3]]) -> f64 {
        faces.iter().map(|t| kappa(self.at(t[0]), self.at(t[1]), self.at(t[2]))).fold(f64::INFINITY, f64::min)
    }

    /// Splits the face that two consecutive nodes of a path have in common; nothing if they are joined by an edge.
    fn chord(&mut self, topology: &Topology, [a, b]: [u32; 2], nodes: [Node; 2]) -> Result<()> {
        let lost = || EngineError::invariant("two nodes of a border share no face");
        match nodes {
            [Node::Vertex(_), Node::Vertex(_)] => Ok(()),
            [Node::Vertex(_), Node::Crossing { halfedge, .. }] => self.from_corner(halfedge, b),
            [Node::Crossing { halfedge, .. }, Node::Vertex(_)] => self.from_corner(topology.twin(halfedge).ok_or_else(lost)?, a),
            [Node::Crossing { halfedge: g, .. }, Node::Crossing { halfedge: h, .. }] => {
                let t = topology.twin(g).ok_or_else(lost)?;
                if topology.next(t) == h { self.corner_off(t, a, b) } else { self.corner_off(h, b, a) }
            }
        }
    }

    /// From the corner opposite of `h` to point `m` on `h`.
    fn from_corner(&mut self, h: u32, m: u32) -> Result<()> {
        let f = self.untouched(h / 3)?;
        let (k, t) = (h as usize % 3, self.mesh.triangles[f]);
        let [p, q, r] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
        let base = 3 * f as u32;
        let side = |i: usize| Some(base + ((k + i) % 3) as u32);
        self.replace(f, [m, q, r], [None, side(1), None]);
        self.append(f, [p, m, r], [None, None, side(2)]);
        Ok(())
    }

    /// From point `a` on `h` to point `b` on the halfedge after it.
    fn corner_off(&mut self, h: u32, a: u32, b: u32) -> Result<()> {
        let f = self.untouched(h / 3)?;
        let (k, t) = (h as usize % 3, self.mesh.triangles[f]);
        let [p, q, r] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
        let whole = Some(3 * f as u32 + ((k + 2) % 3) as u32);
        self.replace(f, [a, q, b], [None; 3]);
        // The rest, p a b r, along the better diagonal.
        if self.worst(&[[p, a, r], [a, b, r]]) >= self.worst(&[[p, a, b], [p, b, r]]) {
            self.append(f, [p, a, r], [None, None, whole]);
            self.append(f, [a, b, r], [None; 3]);
        } else {
            self.append(f, [p, a, b], [None; 3]);
            self.append(f, [p, b, r], [None, None, whole]);
        }
        Ok(())
    }

    fn untouched(&self, f: u32) -> Result<usize> {
        let base = 3 * f as usize;
        if (0..3).all(|k| self.whole[base + k] == Some((base + k) as u32)) {
            return Ok(f as usize);
        }
        Err(EngineError::invariant(format!("face {f} is crossed twice")))
    }

    fn replace(&mut self, f: usize, t: [u32; 3], whole: [Option<u32>; 3]) {
        self.mesh.triangles[f] = t;
        self.whole[3 * f..3 * f + 3].copy_from_slice(&whole);
    }

    fn append(&mut self, f: usize, t: [u32; 3], whole: [Option<u32>; 3]) {
        self.mesh.triangles.push(t);
        self.mesh.face_region.push(self.mesh.face_region[f]);
        self.face_origin.push(f as u32);
        self.whole.extend(whole);
    }
}
