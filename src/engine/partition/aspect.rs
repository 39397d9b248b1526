//! The aspect ratio of a patch by oriented boxes (P2 section 2), beside that by area and boundary length.

mod boxes;

pub use boxes::{OrientedBox, smallest_box};

use super::surface::Scratch;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, distance};

/// Lower bound of eta = H / D: longest side of the box of a patch over the longest side of the box of its longest border
/// loop (P2 section 2). 0 for a patch without a border or with a border of no extent. O(faces of the patch).
pub(super) fn by_boxes(mesh: &SurfaceMesh, topology: &Topology, label: &[u32], faces: &[u32], scratch: &mut Scratch) -> f64 {
    let Some(p) = faces.first().map(|&f| label[f as usize]) else { return 0.0 };
    scratch.vertices.clear();
    let vertices = faces.iter().flat_map(|&f| mesh.triangles[f as usize]).filter(|&v| scratch.vertices.mark(v));
    let points: Vec<Vec3> = vertices.map(|v| mesh.positions[v as usize]).collect();
    let across = |h: u32| topology.twin(h).filter(|&t| label[t as usize / 3] == p);
    let place = |v: u32| mesh.positions[v as usize];
    let mut longest: (f64, Vec<Vec3>) = (0.0, Vec::new());
    scratch.halfedges.clear();
    for first in faces.iter().flat_map(|&f| 3 * f..3 * f + 3).filter(|&h| across(h).is_none()) {
        let (mut length, mut ring, mut at) = (0.0, Vec::new(), first);
        while scratch.halfedges.mark(at) {
            length += distance(place(topology.origin(at)), place(topology.target(at)));
            ring.push(place(topology.origin(at)));
            at = topology.next(at);
            while let Some(t) = across(at) {
                at = topology.next(t);
            }
        }
        if length > longest.0 {
            longest = (length, ring);
        }
    }
    box_aspect_ratio(&points, &longest.1)
}

/// H / D of a patch given all its vertices and those of its longest border loop; 0 if the loop has no extent. O(points).
pub fn box_aspect_ratio(points: &[Vec3], longest_loop: &[Vec3]) -> f64 {
    let side = |points: &[Vec3]| smallest_box(points).map_or(0.0, |b| b.sides[0]);
    let (height, width) = (side(points), side(longest_loop));
    if width > 0.0 { height / width } else { 0.0 }
}
