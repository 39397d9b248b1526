//! Every face is divided: a quadrangle into four, a triangle into three quadrangles, so that no triangle is left.

use super::QuadInput;
use super::mixed::{Corners, Mixed, NONE, corners_of};
use crate::bvh::TriangleBvh;
use crate::optimize::input::Input;
use crate::vector::{Vec3, add, lerp, scale};

/// The curves of the input as a tree over segments, written as triangles without area.
fn curve_tree(input: &QuadInput<'_>) -> TriangleBvh {
    let segments: Vec<[u32; 3]> = input.curves.iter().map(|&[a, b]| [a, b, b]).collect();
    TriangleBvh::build(&input.mesh.positions, &segments)
}

/// The points between, found by their edge.
struct Middles {
    /// `(low, high, vertex)`, sorted.
    list: Vec<(u32, u32, u32)>,
}

impl Middles {
    fn new(mesh: &Mixed) -> Middles {
        let mut edges: Vec<(u32, u32, u32)> = Vec::new();
        for f in (0..mesh.faces.len() as u32).filter(|&f| mesh.is_face(f)) {
            let corners = mesh.corners(f);
            for k in 0..corners.len() {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                edges.push((a.min(b), a.max(b), 0));
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let first = mesh.position.len() as u32;
        edges.iter_mut().enumerate().for_each(|(i, e)| e.2 = first + i as u32);
        Middles { list: edges }
    }

    fn of(&self, a: u32, b: u32) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        let at = self.list.partition_point(|e| (e.0, e.1) < (low, high));
        self.list.get(at).map_or(NONE, |e| e.2)
    }
}

/// New vertices lie on the input, those on curve edges on the input's curves (at the middle of the edge where that is far from them).
pub(super) fn divide(mesh: &mut Mixed, input: &QuadInput<'_>, surface: &Input<'_>) {
    let middles = Middles::new(mesh);
    let curves = curve_tree(input);
    let mut curve_edges = Vec::new();
    for &(a, b, m) in &middles.list {
        let (p, q) = (mesh.position[a as usize], mesh.position[b as usize]);
        let half = lerp(p, q, 0.5);
        let on_curve = mesh.is_curve(a, b);
        let near = 0.0625 * crate::vector::distance(p, q).powi(2);
        let (position, below) = match curves.closest_below(half, near, 0.0).filter(|_| on_curve) {
            Some(hit) => (hit.position, input.tree.closest(hit.position).map_or(mesh.below[a as usize], |h| h.face)),
            None => {
                let foot = surface.project(half, mesh.below[a as usize], 0.5 * near.sqrt());
                (foot.position, foot.face)
            }
        };
        push(mesh, position, below, on_curve);
        if on_curve {
            curve_edges.extend([[a, m], [b, m]]);
        }
    }
    let old: Vec<(Corners, [u32; 2])> = mesh.faces.iter().copied().zip(mesh.label.iter().copied()).filter(|f| f.0[0] != NONE).collect();
    (mesh.faces, mesh.label) = (Vec::new(), Vec::new());
    for (face, label) in old {
        let corners = corners_of(&face);
        let count = corners.len();
        let sum: Vec3 = corners.iter().fold([0.0; 3], |s, &v| add(s, mesh.position[v as usize]));
        let size = crate::vector::distance(mesh.position[corners[0] as usize], mesh.position[corners[1] as usize]);
        let foot = surface.project(scale(sum, 1.0 / count as f64), mesh.below[corners[0] as usize], 0.25 * size);
        let centre = mesh.position.len() as u32;
        push(mesh, foot.position, foot.face, false);
        for k in 0..count {
            let (before, here, after) = (corners[(k + count - 1) % count], corners[k], corners[(k + 1) % count]);
            mesh.faces.push([here, middles.of(here, after), centre, middles.of(before, here)]);
            mesh.label.push(label);
        }
    }
    curve_edges.iter_mut().for_each(|e: &mut [u32; 2]| e.sort_unstable());
    curve_edges.sort_unstable();
    mesh.curve_edges = curve_edges;
    mesh.index();
}

fn push(mesh: &mut Mixed, position: Vec3, below: u32, is_fixed: bool) {
    mesh.position.push(position);
    mesh.below.push(below);
    mesh.is_fixed.push(is_fixed);
}
