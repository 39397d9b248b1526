//! The aspect ratio of a patch by oriented boxes (P2 section 2), beside that by area and boundary length.

mod boxes;

pub use boxes::{OrientedBox, smallest_box};

use super::surface::{Piece, Scratch, Surface};
use crate::vector::Vec3;

/// Lower bound of eta = H / D: longest side of the box of the patch over the longest side of the box of its longest border
/// loop (P2 section 2). 0 for a patch without a border or with a border of no extent. O(faces of the patch).
pub(super) fn by_boxes(surface: &Surface<'_>, label: &[u32], faces: &[u32], piece: &Piece, scratch: &mut Scratch) -> f64 {
    let Some(p) = faces.first().map(|&f| label[f as usize]) else { return 0.0 };
    let topology = surface.topology;
    scratch.vertices.clear();
    let vertices = faces.iter().flat_map(|&f| surface.mesh.triangles[f as usize]).filter(|&v| scratch.vertices.mark(v));
    let points: Vec<Vec3> = vertices.map(|v| surface.mesh.positions[v as usize]).collect();
    let mut longest: (f64, Vec<Vec3>) = (0.0, Vec::new());
    scratch.halfedges.clear();
    for &first in &piece.border {
        let (mut length, mut ring, mut at) = (0.0, Vec::new(), first);
        while scratch.halfedges.mark(at) {
            length += surface.length[at as usize];
            ring.push(surface.mesh.positions[topology.origin(at) as usize]);
            at = surface.next_on_border(at, |f| label[f as usize] == p);
        }
        if length > longest.0 {
            longest = (length, ring);
        }
    }
    let side = |points: &[Vec3]| smallest_box(points).map_or(0.0, |b| b.sides[0]);
    let (height, width) = (side(&points), side(&longest.1));
    if width > 0.0 { height / width } else { 0.0 }
}
