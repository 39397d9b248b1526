//! One patch as a mesh of its own, in local numbers, so that its fingerprint depends on nothing but its content.

use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::partition::{Partition, box_aspect_ratio};
use crate::topology::Topology;
use crate::vector::{Vec3, distance};

/// A connected piece of surface of genus 0 with at least one boundary loop, manifold by itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patch {
    /// Local vertex positions, in increasing order of global vertex (then of copy, where the patch touches itself in a vertex).
    pub positions: Vec<Vec3>,
    /// Local vertex indices of each face, in increasing order of global face, corners in the global corner order.
    pub triangles: Vec<[u32; 3]>,
    /// Boundary loops as local vertices in halfedge direction (the patch lies on the left); the longest first.
    pub loops: Vec<Vec<u32>>,
}

/// Where the local elements of a patch are in the surface. On a surface that was cut along its borders, splits have made vertices that the
/// imported mesh does not have; they are numbered after its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchMap {
    /// Global vertex of each local vertex. A global vertex occurs twice if the patch touches itself there.
    pub vertices: Vec<u32>,
    /// Imported vertex that names each local vertex: the same, but for a vertex that a split has made the nearer end of its edge.
    pub named: Vec<u32>,
    /// Imported face of each local face. Increasing, but for faces that splits have made, which follow.
    pub faces: Vec<u32>,
}

impl Patch {
    /// Lower bound of eta: longest side of the oriented box over that of the longest loop (P2 section 2). O(vertices).
    pub fn box_aspect_ratio(&self) -> f64 {
        let ring = self.loops.first().map_or(&[][..], |ring| ring);
        let ring: Vec<Vec3> = ring.iter().map(|&v| self.positions[v as usize]).collect();
        box_aspect_ratio(&self.positions, &ring)
    }
}

impl Contents for Patch {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles);
    }

    fn bytes(&self) -> usize {
        self.positions.len() * 24 + self.triangles.len() * 12 + self.loops.iter().map(|l| l.len() * 4 + 24).sum::<usize>()
    }
}

/// Cuts every patch out of the surface. O(F). A vertex in which a patch touches itself is doubled, so that every patch is manifold.
///
/// # Errors
/// Only broken invariants of `partition`.
pub fn extract_patches(mesh: &SurfaceMesh, topology: &Topology, partition: &Partition) -> Result<Vec<(Patch, PatchMap)>> {
    let label = &partition.face_patch;
    let count = partition.patches.len();
    if label.len() != topology.face_count() || mesh.triangles.len() != label.len() {
        return Err(EngineError::invariant(format!("{} patch numbers for {} faces", label.len(), topology.face_count())));
    }
    if let Some(f) = label.iter().position(|&p| p as usize >= count) {
        return Err(EngineError::invariant(format!("face {f} is in patch {} of {count}", label[f])));
    }
    let mut out = vec![(Patch::default(), PatchMap::default()); count];
    let local = number_vertices(mesh, topology, label, &mut out);
    for f in 0..label.len() {
        let (patch, map) = &mut out[label[f] as usize];
        patch.triangles.push([local[3 * f], local[3 * f + 1], local[3 * f + 2]]);
        map.faces.push(f as u32);
    }
    trace_loops(topology, label, &local, &mut out);
    if let Some(p) = out.iter().position(|(patch, _)| patch.loops.is_empty()) {
        return Err(EngineError::invariant(format!("patch {p} is empty or closed")));
    }
    out.iter_mut().for_each(|(_, map)| map.named.clone_from(&map.vertices));
    Ok(out)
}

/// Gives every fan of faces of one patch around a vertex a local vertex; returns the local vertex of each corner.
fn number_vertices(mesh: &SurfaceMesh, topology: &Topology, label: &[u32], out: &mut [(Patch, PatchMap)]) -> Vec<u32> {
    let mut local = vec![0u32; topology.halfedge_count()];
    // Fans of the vertex at hand: (patch, lowest corner, range in `corners`).
    let mut fans: Vec<(u32, u32, usize, usize)> = Vec::new();
    let mut corners: Vec<u32> = Vec::new();
    for v in 0..topology.vertex_count() as u32 {
        corners.clear();
        corners.extend(topology.outgoing(v));
        if !topology.is_boundary_vertex(v) {
            // Start at a change of patch, so that no fan is cut in two.
            let n = corners.len();
            let patch_at = |i: usize| label[topology.face(corners[i % n]) as usize];
            let start = (0..n).find(|&i| patch_at(i) != patch_at(i + n - 1)).unwrap_or(0);
            corners.rotate_left(start);
        }
        fans.clear();
        for (i, &h) in corners.iter().enumerate() {
            let p = label[topology.face(h) as usize];
            match fans.last_mut() {
                Some(last) if last.0 == p => (last.1, last.3) = (last.1.min(h), i + 1),
                _ => fans.push((p, h, i, i + 1)),
            }
        }
        fans.sort_unstable();
        for &(p, _, begin, end) in &fans {
            let (patch, map) = &mut out[p as usize];
            for &h in &corners[begin..end] {
                local[h as usize] = map.vertices.len() as u32;
            }
            map.vertices.push(v);
            patch.positions.push(mesh.positions[v as usize]);
        }
    }
    local
}

/// Walks the boundary loops of all patches.
fn trace_loops(topology: &Topology, label: &[u32], local: &[u32], out: &mut [(Patch, PatchMap)]) {
    let patch_of = |h: u32| label[topology.face(h) as usize];
    let across = |h: u32| topology.twin(h).filter(|&t| patch_of(t) == patch_of(h));
    let mut seen = vec![false; topology.halfedge_count()];
    for first in 0..topology.halfedge_count() as u32 {
        if seen[first as usize] || across(first).is_some() {
            continue;
        }
        let mut ring = Vec::new();
        let mut at = first;
        while !seen[at as usize] {
            seen[at as usize] = true;
            ring.push(local[at as usize]);
            at = topology.next(at);
            while let Some(t) = across(at) {
                at = topology.next(t);
            }
        }
        out[patch_of(first) as usize].0.loops.push(ring);
    }
    for (patch, _) in out {
        let length = |ring: &Vec<u32>| -> f64 {
            let point = |i: usize| patch.positions[ring[i % ring.len()] as usize];
            (0..ring.len()).map(|i| distance(point(i), point(i + 1))).sum()
        };
        let mut keyed: Vec<(f64, Vec<u32>)> = std::mem::take(&mut patch.loops).into_iter().map(|l| (length(&l), l)).collect();
        keyed.sort_by(|a, b| b.0.total_cmp(&a.0));
        patch.loops = keyed.into_iter().map(|(_, l)| l).collect();
    }
}
