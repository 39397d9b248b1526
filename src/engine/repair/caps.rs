//! Zero-area faces with three different vertices (caps): one corner lies on the opposite edge. CAD exporters stitch T-junctions
//! with them, so dropping them would open slits. Swapping that edge with the neighbour removes them without moving anything.

use super::faces::{has_zero_area, repeats_a_vertex};
use crate::diagnose::edges::{EdgeTable, ends};
use crate::mesh::SurfaceMesh;
use crate::vector::distance;
use std::collections::HashSet;

/// Caps may lie on caps; more rounds than this are not made.
const MOST_ROUNDS: usize = 16;

/// A swap of the long edge of a cap.
struct Swap {
    cap: u32,
    neighbour: u32,
    /// The new faces, oriented as the neighbour.
    faces: [[u32; 3]; 2],
    edge: [u32; 2],
}

/// Swaps the long edges of caps where that gives two proper faces and no edge that is there already. Gives the number of
/// swaps. O(F log F) for each round, and only if there are caps.
pub(crate) fn swap_caps(mesh: &mut SurfaceMesh, factor: f64) -> u64 {
    let mut swaps = 0;
    for _ in 0..MOST_ROUNDS {
        let is_cap = |mesh: &SurfaceMesh, f: u32| {
            let t = &mesh.triangles[f as usize];
            !repeats_a_vertex(t) && has_zero_area(mesh, t, factor)
        };
        let caps: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&f| is_cap(mesh, f)).collect();
        if caps.is_empty() {
            break;
        }
        let done = swap_round(mesh, &caps, factor);
        swaps += done;
        if done == 0 {
            break;
        }
    }
    swaps
}

fn swap_round(mesh: &mut SurfaceMesh, caps: &[u32], factor: f64) -> u64 {
    let edges = EdgeTable::build(&mesh.triangles, mesh.positions.len());
    let mut edge_of_side = vec![0u32; mesh.triangles.len() * 3];
    for edge in 0..edges.len() {
        edges.of(edge).iter().for_each(|&side| edge_of_side[side as usize] = edge as u32);
    }
    let candidates: Vec<Swap> = caps.iter().filter_map(|&cap| candidate(mesh, &edges, &edge_of_side, cap, factor)).collect();
    let wanted: HashSet<[u32; 2]> = candidates.iter().map(|s| s.edge).collect();
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut present: HashSet<[u32; 2]> =
        (0..edges.len()).map(|e| sorted(ends(&mesh.triangles, edges.of(e)[0]))).filter(|e| wanted.contains(e)).collect();
    let mut touched = HashSet::new();
    let mut done = 0;
    for swap in candidates {
        if touched.contains(&swap.cap) || touched.contains(&swap.neighbour) || !present.insert(swap.edge) {
            continue;
        }
        touched.extend([swap.cap, swap.neighbour]);
        mesh.triangles[swap.neighbour as usize] = swap.faces[0];
        mesh.triangles[swap.cap as usize] = swap.faces[1];
        mesh.face_region[swap.cap as usize] = mesh.face_region[swap.neighbour as usize];
        done += 1;
    }
    done
}

fn candidate(mesh: &SurfaceMesh, edges: &EdgeTable, edge_of_side: &[u32], cap: u32, factor: f64) -> Option<Swap> {
    let length = |side: u32| {
        let [a, b] = ends(&mesh.triangles, side).map(|v| mesh.positions[v as usize]);
        distance(a, b)
    };
    let long = (3 * cap..3 * cap + 3).max_by(|&s, &t| length(s).total_cmp(&length(t)))?;
    let middle = mesh.triangles[cap as usize][(long as usize % 3 + 2) % 3];
    let [a, b] = edges.pair(edge_of_side[long as usize] as usize)?;
    let across = if a == long { b } else { a };
    let neighbour = across / 3;
    let [x, y] = ends(&mesh.triangles, across);
    let apex = mesh.triangles[neighbour as usize][(across as usize % 3 + 2) % 3];
    let faces = [[x, middle, apex], [middle, y, apex]];
    let proper = |t: &[u32; 3]| !repeats_a_vertex(t) && !has_zero_area(mesh, t, factor);
    let edge = [middle.min(apex), middle.max(apex)];
    (neighbour != cap && faces.iter().all(proper)).then_some(Swap { cap, neighbour, faces, edge })
}
