//! What the partitioner knows of the surface, and the numbers of a patch under given face labels.

use super::{PartitionSpec, PatchSummary};
use crate::features::Features;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::distance;
use std::f64::consts::PI;

/// The surface with the lengths and areas that are asked for again and again.
#[derive(Debug)]
pub(super) struct Surface<'a> {
    pub(super) mesh: &'a SurfaceMesh,
    pub(super) topology: &'a Topology,
    pub(super) features: &'a Features,
    /// Length of each halfedge.
    pub(super) length: Vec<f64>,
    /// Area of each face.
    pub(super) area: Vec<f64>,
}

impl<'a> Surface<'a> {
    pub(super) fn new(mesh: &'a SurfaceMesh, topology: &'a Topology, features: &'a Features) -> Self {
        let place = |v: u32| mesh.positions[v as usize];
        let length =
            (0..topology.halfedge_count() as u32).map(|h| distance(place(topology.origin(h)), place(topology.target(h)))).collect();
        let area = (0..mesh.triangles.len())
            .map(|f| {
                let [a, b, c] = mesh.corners(f);
                crate::vector::triangle_area(a, b, c)
            })
            .collect();
        Surface { mesh, topology, features, length, area }
    }

    /// The face across a halfedge, unless the surface ends there or the edge is a feature.
    #[inline]
    pub(super) fn crossing(&self, h: u32) -> Option<u32> {
        self.topology.twin(h).filter(|_| !self.features.is_feature[h as usize]).map(|t| t / 3)
    }

    /// Whether a halfedge of a face of patch `p` is on the border of the patch.
    #[inline]
    pub(super) fn on_border(&self, label: &[u32], h: u32, p: u32) -> bool {
        self.topology.twin(h).is_none_or(|t| label[t as usize / 3] != p)
    }

    /// The border halfedge of `p` after border halfedge `h`, turning around its target inside the patch.
    #[inline]
    pub(super) fn next_on_border(&self, h: u32, inside: impl Fn(u32) -> bool) -> u32 {
        let mut at = self.topology.next(h);
        while let Some(t) = self.topology.twin(at).filter(|&t| inside(t / 3)) {
            at = self.topology.next(t);
        }
        at
    }
}

/// A patch under construction: what merging and checking need.
#[derive(Debug, Clone, Default)]
pub(super) struct Piece {
    pub(super) faces: u32,
    pub(super) area: f64,
    /// Vertices all of whose faces are in the patch.
    pub(super) inner_vertices: u32,
    /// Border halfedges (of faces of the patch), in no particular order.
    pub(super) border: Vec<u32>,
    pub(super) loops: u32,
    pub(super) border_length: f64,
    pub(super) longest_loop: f64,
}

impl Piece {
    /// Euler characteristic, a vertex counted once per fan: every border halfedge opens one fan.
    pub(super) fn euler(&self) -> i64 {
        i64::from(self.inner_vertices) + (self.border.len() as i64 - i64::from(self.faces)) / 2
    }

    /// Handles (P2 eq. 2).
    pub(super) fn genus(&self) -> i64 {
        (2 - i64::from(self.loops) - self.euler()) / 2
    }

    /// eta = pi A / L^2; infinite for a closed patch.
    pub(super) fn aspect_ratio(&self) -> f64 {
        if self.longest_loop > 0.0 { PI * self.area / (self.longest_loop * self.longest_loop) } else { f64::INFINITY }
    }

    /// Whether the conditions of P2 eq. 5 and the limits hold.
    pub(super) fn is_valid(&self, limits: &Limits) -> bool {
        self.faces <= limits.faces
            && self.loops >= 1
            && self.loops <= limits.loops
            && self.genus() == 0
            && self.aspect_ratio() <= limits.aspect_ratio
            || self.faces == 1
    }

    pub(super) fn summary(&self) -> PatchSummary {
        PatchSummary {
            faces: self.faces,
            area: self.area,
            loops: self.loops,
            genus: self.genus().max(0) as u32,
            border_length: self.border_length,
            aspect_ratio: self.aspect_ratio(),
            ..PatchSummary::default()
        }
    }
}

/// What every patch must keep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) faces: u32,
    pub(super) loops: u32,
    pub(super) aspect_ratio: f64,
}

impl Limits {
    /// A chart with very many holes costs the planar mesher more than a seam does.
    pub(super) const LOOPS: u32 = 24;

    pub(super) fn new(spec: &PartitionSpec) -> Self {
        Limits { faces: spec.max_patch_faces, loops: Limits::LOOPS, aspect_ratio: spec.max_aspect_ratio }
    }
}

/// Marks of elements that are cleared by counting on.
#[derive(Debug)]
pub(super) struct Stamps {
    stamp: Vec<u32>,
    now: u32,
}

impl Stamps {
    pub(super) fn new(count: usize) -> Self {
        Stamps { stamp: vec![0; count], now: 0 }
    }

    /// Forgets all marks.
    pub(super) fn clear(&mut self) {
        self.now = self.now.checked_add(1).unwrap_or_else(|| {
            self.stamp.fill(0);
            1
        });
    }

    /// Marks an element; `true` if it was not marked.
    #[inline]
    pub(super) fn mark(&mut self, i: u32) -> bool {
        std::mem::replace(&mut self.stamp[i as usize], self.now) != self.now
    }

    /// Whether an element is marked.
    #[inline]
    pub(super) fn is_marked(&self, i: u32) -> bool {
        self.stamp[i as usize] == self.now
    }
}

/// Scratch of the measuring functions.
#[derive(Debug)]
pub(super) struct Scratch {
    pub(super) vertices: Stamps,
    pub(super) halfedges: Stamps,
}

impl Scratch {
    pub(super) fn new(topology: &Topology) -> Self {
        Scratch { vertices: Stamps::new(topology.vertex_count()), halfedges: Stamps::new(topology.halfedge_count()) }
    }
}

/// Measures patch `p`, which has exactly the given faces. O(faces).
pub(super) fn measure(surface: &Surface<'_>, label: &[u32], faces: &[u32], p: u32, scratch: &mut Scratch) -> Piece {
    let topology = surface.topology;
    let mut piece = Piece { faces: faces.len() as u32, ..Piece::default() };
    scratch.vertices.clear();
    for &f in faces {
        piece.area += surface.area[f as usize];
        for h in 3 * f..3 * f + 3 {
            if surface.on_border(label, h, p) {
                piece.border.push(h);
                scratch.vertices.mark(topology.origin(h));
            }
        }
    }
    for &f in faces {
        for h in 3 * f..3 * f + 3 {
            piece.inner_vertices += u32::from(scratch.vertices.mark(topology.origin(h)));
        }
    }
    trace(surface, &mut piece, |f| label[f as usize] == p, scratch);
    piece
}

/// Fills in the loops of a piece from its border. O(border).
pub(super) fn trace(surface: &Surface<'_>, piece: &mut Piece, inside: impl Fn(u32) -> bool, scratch: &mut Scratch) {
    (piece.loops, piece.border_length, piece.longest_loop) = (0, 0.0, 0.0);
    scratch.halfedges.clear();
    for &first in &piece.border {
        if !scratch.halfedges.mark(first) {
            continue;
        }
        let mut length = surface.length[first as usize];
        let mut at = surface.next_on_border(first, &inside);
        while scratch.halfedges.mark(at) {
            length += surface.length[at as usize];
            at = surface.next_on_border(at, &inside);
        }
        piece.loops += 1;
        piece.border_length += length;
        piece.longest_loop = piece.longest_loop.max(length);
    }
}
