//! Dropping faces that add nothing: repeated vertices, zero area, exact duplicates; and vertices that no face uses.

use crate::mesh::SurfaceMesh;
use crate::vector::{area_vector_twice, scale, sub};

/// Whether a face repeats a vertex.
#[inline]
pub(crate) fn repeats_a_vertex(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// A power of two that brings lengths near one, so that products of them neither overflow nor vanish.
pub(crate) fn normalizer(diagonal: f64) -> f64 {
    if diagonal > 0.0 { diagonal.log2().round().clamp(-1000.0, 1000.0).exp2().recip() } else { 1.0 }
}

/// Whether the computed area of a face is zero, with lengths scaled by `factor`.
#[inline]
pub(crate) fn has_zero_area(mesh: &SurfaceMesh, t: &[u32; 3], factor: f64) -> bool {
    let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
    area_vector_twice([0.0; 3], scale(sub(b, a), factor), scale(sub(c, a), factor)) == [0.0; 3]
}

/// Keeps the faces for which `keep` holds, in order, with their regions.
pub(crate) fn retain(mesh: &mut SurfaceMesh, mut keep: impl FnMut(usize) -> bool) -> u64 {
    let mut kept = 0;
    for face in 0..mesh.triangles.len() {
        if keep(face) {
            mesh.triangles[kept] = mesh.triangles[face];
            mesh.face_region[kept] = mesh.face_region[face];
            kept += 1;
        }
    }
    let dropped = mesh.triangles.len() - kept;
    mesh.triangles.truncate(kept);
    mesh.face_region.truncate(kept);
    dropped as u64
}

/// For each face the first face with the same vertices (itself if none before), whatever the direction. O(F log F).
pub(crate) fn first_equal_face(triangles: &[[u32; 3]], vertex_count: usize) -> Vec<u32> {
    let sorted = |t: &[u32; 3]| {
        let mut s = *t;
        s.sort_unstable();
        s
    };
    // Bucket by the least vertex, then sort the short buckets by the other two.
    let mut start = vec![0u32; vertex_count + 1];
    for t in triangles {
        start[sorted(t)[0] as usize + 1] += 1;
    }
    for v in 0..vertex_count {
        start[v + 1] += start[v];
    }
    let mut bucket = vec![(0u64, 0u32); triangles.len()];
    for (f, t) in triangles.iter().enumerate() {
        let s = sorted(t);
        let slot = &mut start[s[0] as usize];
        bucket[*slot as usize] = (u64::from(s[1]) << 32 | u64::from(s[2]), f as u32);
        *slot += 1;
    }
    let mut first: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut begin = 0;
    for v in 0..vertex_count {
        let part = &mut bucket[begin..start[v] as usize];
        part.sort_unstable();
        for i in 1..part.len() {
            if part[i].0 == part[i - 1].0 {
                first[part[i].1 as usize] = first[part[i - 1].1 as usize];
            }
        }
        begin = start[v] as usize;
    }
    first
}

/// Drops vertices that no face uses; the others keep their order. Gives their number.
pub(crate) fn drop_unused_vertices(mesh: &mut SurfaceMesh) -> u64 {
    let mut number = vec![u32::MAX; mesh.positions.len()];
    for t in &mesh.triangles {
        t.iter().for_each(|&v| number[v as usize] = 0);
    }
    let mut kept = 0;
    for v in 0..number.len() {
        if number[v] == 0 {
            number[v] = kept as u32;
            mesh.positions[kept] = mesh.positions[v];
            kept += 1;
        }
    }
    let dropped = mesh.positions.len() - kept;
    if dropped > 0 {
        mesh.positions.truncate(kept);
        mesh.positions.shrink_to_fit();
        mesh.triangles.iter_mut().flatten().for_each(|v| *v = number[*v as usize]);
    }
    dropped as u64
}
