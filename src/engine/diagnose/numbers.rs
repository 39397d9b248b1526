//! Topological numbers of a mesh that need not be manifold.

use super::edges::{DisjointSets, EdgeTable, ends, umbrellas};
use crate::quality::TopologyNumbers;

/// What is counted on the way to [`TopologyNumbers`] and is of use to the diagnosis.
pub(crate) struct Counted {
    pub(crate) numbers: TopologyNumbers,
    /// Vertices with more than one umbrella, ascending.
    pub(crate) non_manifold_vertices: Vec<u32>,
    /// One boundary side for each boundary loop, ascending.
    pub(crate) loop_sides: Vec<u32>,
    /// First face of each component (by shared vertices), ascending.
    pub(crate) component_faces: Vec<u32>,
}

/// Counts everything in O(F log F).
pub(crate) fn count(triangles: &[[u32; 3]], vertex_count: usize, edges: &EdgeTable) -> Counted {
    let mut sets = umbrellas(triangles, edges);
    let mut umbrella_count = vec![0u32; vertex_count];
    let corners = triangles.len() * 3;
    let mut umbrella_total = 0i64;
    for corner in 0..corners as u32 {
        if sets.find(corner) == corner {
            umbrella_count[ends(triangles, corner)[0] as usize] += 1;
            umbrella_total += 1;
        }
    }
    let used = umbrella_count.iter().filter(|&&n| n > 0).count() as i64;
    let non_manifold_vertices: Vec<u32> = (0..vertex_count as u32).filter(|&v| umbrella_count[v as usize] > 1).collect();
    let loop_sides = boundary_loops(edges, &mut sets, corners);
    let component_faces = components(triangles, vertex_count);
    let (cut_components, orientable) = glue(triangles, edges);
    let euler = used - edges.len() as i64 + triangles.len() as i64;
    let non_manifold_edges = (0..edges.len()).filter(|&e| edges.of(e).len() > 2).count() as u32;
    let inconsistent =
        (0..edges.len()).filter(|&e| edges.pair(e).is_some_and(|[a, b]| ends(triangles, a)[0] == ends(triangles, b)[0])).count() as u32;
    let cut_euler = umbrella_total - edges.len() as i64 + triangles.len() as i64;
    let twice_genus = 2 * cut_components - loop_sides.len() as i64 - cut_euler;
    let whole = non_manifold_edges == 0 && orientable && twice_genus >= 0 && twice_genus % 2 == 0;
    Counted {
        numbers: TopologyNumbers {
            euler,
            components: component_faces.len() as u32,
            boundary_loops: loop_sides.len() as u32,
            genus: whole.then_some((twice_genus / 2) as u32),
            non_manifold_edges,
            non_manifold_vertices: non_manifold_vertices.len() as u32,
            inconsistent_edges: inconsistent,
        },
        non_manifold_vertices,
        loop_sides,
        component_faces,
    }
}

/// Boundary loops, each non-manifold vertex cut into its umbrellas: the least side of each.
fn boundary_loops(edges: &EdgeTable, umbrellas: &mut DisjointSets, corners: usize) -> Vec<u32> {
    let border: Vec<u32> = (0..edges.len()).filter(|&e| edges.of(e).len() == 1).map(|e| edges.of(e)[0]).collect();
    if border.is_empty() {
        return Vec::new();
    }
    let mut rings = DisjointSets::new(corners);
    for &side in &border {
        let head = if side % 3 == 2 { side - 2 } else { side + 1 };
        rings.join(umbrellas.find(side), umbrellas.find(head));
    }
    let mut least = vec![u32::MAX; corners];
    for &side in &border {
        let ring = rings.find(umbrellas.find(side)) as usize;
        least[ring] = least[ring].min(side);
    }
    let mut sides: Vec<u32> = least.into_iter().filter(|&s| s != u32::MAX).collect();
    sides.sort_unstable();
    sides
}

fn components(triangles: &[[u32; 3]], vertex_count: usize) -> Vec<u32> {
    let mut sets = DisjointSets::new(vertex_count);
    for t in triangles {
        sets.join(t[0], t[1]);
        sets.join(t[1], t[2]);
    }
    let mut seen = vec![false; vertex_count];
    let is_first = |t: &[u32; 3]| !std::mem::replace(&mut seen[sets.find(t[0]) as usize], true);
    let firsts: Vec<bool> = triangles.iter().map(is_first).collect();
    (0..triangles.len() as u32).filter(|&f| firsts[f as usize]).collect()
}

/// Components of faces joined across manifold edges, and whether all of them can be oriented: in the double cover
/// (each face once per orientation) no face may be joined to its own reverse.
fn glue(triangles: &[[u32; 3]], edges: &EdgeTable) -> (i64, bool) {
    let faces = triangles.len() as u32;
    let mut plain = DisjointSets::new(faces as usize);
    let mut parts = i64::from(faces);
    let mut inconsistent = false;
    for edge in 0..edges.len() {
        let Some([a, b]) = edges.pair(edge) else { continue };
        parts -= i64::from(plain.join(a / 3, b / 3));
        inconsistent |= ends(triangles, a)[0] == ends(triangles, b)[0];
    }
    if !inconsistent {
        return (parts, true);
    }
    let mut cover = DisjointSets::new(2 * faces as usize);
    for edge in 0..edges.len() {
        let Some([a, b]) = edges.pair(edge) else { continue };
        let turn = if ends(triangles, a)[0] == ends(triangles, b)[0] { faces } else { 0 };
        cover.join(a / 3, b / 3 + turn);
        cover.join(a / 3 + faces, b / 3 + faces - turn);
    }
    (parts, (0..faces).all(|f| cover.find(f) != cover.find(f + faces)))
}
