//! Sectors: the parts into which feature edges cut the fan of faces of a vertex.

use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::topology::Topology;
use std::ops::Range;

/// The sectors of all vertices, numbered vertex by vertex, counter-clockwise. A vertex without features has one.
#[derive(Debug, Clone, PartialEq)]
pub struct Sectors {
    of_corner: Vec<u32>,
    /// First sector of each vertex, and their number at the end.
    start: Vec<u32>,
    /// Whether the sector is less than a full fan.
    open: Vec<bool>,
}

impl Sectors {
    /// Cuts the fans. O(F).
    pub(super) fn build(topology: &Topology, features: &Features) -> Sectors {
        let mut of_corner = vec![0u32; topology.halfedge_count()];
        let mut start = Vec::with_capacity(topology.vertex_count() + 1);
        let mut open = Vec::new();
        let mut fan = Vec::new();
        for v in 0..topology.vertex_count() as u32 {
            start.push(open.len() as u32);
            fan.clear();
            fan.extend(topology.outgoing(v));
            let Some(&first) = fan.first() else { continue };
            let cut = |h: u32| topology.twin(h).is_none() || features.is_feature[h as usize];
            let cuts = fan.iter().filter(|&&h| cut(h)).count();
            // One feature that ends inside a full fan does not part it.
            let parted = topology.twin(first).is_none() || cuts > 1;
            if parted && let Some(at) = fan.iter().position(|&h| cut(h)) {
                fan.rotate_left(at);
            }
            for (i, &h) in fan.iter().enumerate() {
                if i == 0 || (parted && cut(h)) {
                    open.push(parted);
                }
                of_corner[h as usize] = open.len() as u32 - 1;
            }
        }
        start.push(open.len() as u32);
        Sectors { of_corner, start, open }
    }

    /// Number of sectors.
    pub fn count(&self) -> usize {
        self.open.len()
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Sector of a corner (halfedge `3 f + k` leaves corner `k`).
    #[inline]
    pub fn of_corner(&self, corner: u32) -> u32 {
        self.of_corner[corner as usize]
    }

    /// Sectors of a vertex.
    pub fn of_vertex(&self, vertex: u32) -> Range<usize> {
        self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize
    }

    /// Whether the sector is less than a full fan: at boundaries and features.
    #[inline]
    pub fn is_open(&self, sector: usize) -> bool {
        self.open[sector]
    }

    /// The corners of a vertex with the sector of each.
    pub(super) fn corners<'a>(&'a self, topology: &'a Topology, vertex: u32) -> impl Iterator<Item = (usize, u32)> + 'a {
        topology.outgoing(vertex).map(|h| (self.of_corner[h as usize] as usize, h))
    }
}

impl Contents for Sectors {
    fn feed(&self, into: &mut Feeder) {
        into.u32s(&self.of_corner).u32s(&self.start);
    }

    fn bytes(&self) -> usize {
        (self.of_corner.len() + self.start.len()) * 4 + self.open.len()
    }
}
