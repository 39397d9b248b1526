//! The edges of any set of triangles, manifold or not, with the number of faces at each.

use crate::mesh::SurfaceMesh;

/// An edge of a mesh that need not be manifold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Edge {
    /// Its vertices, low first.
    pub(super) ends: [u32; 2],
    /// How many faces have it.
    pub(super) faces: u32,
}

/// All edges, sorted. O(F) for bounded valence.
pub(super) fn edge_table(mesh: &SurfaceMesh) -> Vec<Edge> {
    let count = mesh.positions.len();
    let mut start = vec![0u32; count + 1];
    let sides = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| (a.min(b), a.max(b)));
    for t in &mesh.triangles {
        for (low, _) in sides(t) {
            start[low as usize + 1] += 1;
        }
    }
    for v in 0..count {
        start[v + 1] += start[v];
    }
    let mut fill = start.clone();
    let mut bucket = vec![0u32; mesh.triangles.len() * 3];
    for t in &mesh.triangles {
        for (low, high) in sides(t) {
            bucket[fill[low as usize] as usize] = high;
            fill[low as usize] += 1;
        }
    }
    let mut edges: Vec<Edge> = Vec::with_capacity(bucket.len() / 2 + 1);
    for v in 0..count {
        let part = &mut bucket[start[v] as usize..start[v + 1] as usize];
        part.sort_unstable();
        for (i, &high) in part.iter().enumerate() {
            match edges.last_mut() {
                Some(last) if i > 0 && part[i - 1] == high => last.faces += 1,
                _ => edges.push(Edge { ends: [v as u32, high], faces: 1 }),
            }
        }
    }
    edges
}
