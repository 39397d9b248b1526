//! Consistent orientation of each part of a surface, and bow-tie vertices split into one copy per fan.

use crate::diagnose::edges::{EdgeTable, ends, umbrellas};
use crate::mesh::SurfaceMesh;
use crate::vector::{add, cross, dot};

/// For each face whether it has to be turned so that each part (faces joined across edges with two faces) is consistently
/// oriented. The orientation that more faces of the part have wins; with a tie, that of its first face.
/// A part that cannot be oriented is left as it is and counted in the second result.
pub(crate) fn faces_to_turn(triangles: &[[u32; 3]], edges: &EdgeTable) -> (Vec<bool>, u32) {
    let faces = triangles.len();
    if (0..edges.len()).all(|e| edges.pair(e).is_none_or(|[a, b]| ends(triangles, a)[0] != ends(triangles, b)[0])) {
        return (vec![false; faces], 0);
    }
    let neighbours = neighbours(triangles, edges);
    let mut turn = vec![false; faces];
    let mut seen = vec![false; faces];
    let mut part = Vec::new();
    let mut not_orientable = 0;
    for seed in 0..faces {
        if std::mem::replace(&mut seen[seed], true) {
            continue;
        }
        part.clear();
        part.push(seed as u32);
        let mut turned = 0;
        let mut conflict = false;
        let mut next = 0;
        while let Some(&face) = part.get(next) {
            next += 1;
            for k in 0..3 {
                let code = neighbours[3 * face as usize + k];
                if code == NONE {
                    continue;
                }
                let (other, against) = (code >> 1, code & 1 == 1);
                let wanted = turn[face as usize] ^ against;
                if !std::mem::replace(&mut seen[other as usize], true) {
                    turn[other as usize] = wanted;
                    turned += usize::from(wanted);
                    part.push(other);
                } else {
                    conflict |= turn[other as usize] != wanted;
                }
            }
        }
        if conflict {
            not_orientable += 1;
            part.iter().for_each(|&f| turn[f as usize] = false);
        } else if 2 * turned > part.len() {
            part.iter().for_each(|&f| turn[f as usize] ^= true);
        }
    }
    (turn, not_orientable)
}

const NONE: u32 = u32::MAX;

/// For each side the face across it, times two, plus one if that face runs along the edge the same way.
fn neighbours(triangles: &[[u32; 3]], edges: &EdgeTable) -> Vec<u32> {
    let mut across = vec![NONE; triangles.len() * 3];
    for edge in 0..edges.len() {
        if let Some([a, b]) = edges.pair(edge) {
            let same = u32::from(ends(triangles, a)[0] == ends(triangles, b)[0]);
            across[a as usize] = (b / 3) << 1 | same;
            across[b as usize] = (a / 3) << 1 | same;
        }
    }
    across
}

/// Splits each vertex whose faces form several fans into one copy per fan, if none of its edges has more than two faces.
/// The fan with the first face keeps the vertex; copies are appended. Gives the number of split vertices.
pub(crate) fn split_fans(mesh: &mut SurfaceMesh, edges: &EdgeTable) -> u64 {
    let vertices = mesh.positions.len();
    let mut sets = umbrellas(&mesh.triangles, edges);
    let corner_count = mesh.triangles.len() * 3;
    let mut fans = vec![0u32; vertices];
    for corner in 0..corner_count as u32 {
        if sets.find(corner) == corner {
            fans[ends(&mesh.triangles, corner)[0] as usize] += 1;
        }
    }
    if fans.iter().all(|&n| n <= 1) {
        return 0;
    }
    for edge in 0..edges.len() {
        if edges.of(edge).len() > 2 {
            ends(&mesh.triangles, edges.of(edge)[0]).iter().for_each(|&v| fans[v as usize] = 0);
        }
    }
    // The least corner of a fan stands for it, so fans are met in the order of their first faces.
    let mut owner = vec![NONE; vertices];
    let mut copy = std::collections::HashMap::new();
    for corner in 0..corner_count as u32 {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let vertex = mesh.triangles[face][k] as usize;
        if fans.get(vertex).is_none_or(|&n| n < 2) {
            continue;
        }
        let fan = sets.find(corner);
        if owner[vertex] == NONE {
            owner[vertex] = fan;
        }
        if owner[vertex] != fan {
            let positions = &mut mesh.positions;
            mesh.triangles[face][k] = *copy.entry(fan).or_insert_with(|| {
                positions.push(positions[vertex]);
                positions.len() as u32 - 1
            });
        }
    }
    fans.iter().filter(|&&n| n > 1).count() as u64
}

/// How many closed parts have faces that point inwards: a signed volume below 0. Of `edges` only the faces are used.
pub(crate) fn inward_parts(mesh: &SurfaceMesh, edges: &EdgeTable) -> u64 {
    let mut sets = crate::diagnose::edges::DisjointSets::new(mesh.triangles.len());
    let mut open_faces = Vec::new();
    for edge in 0..edges.len() {
        match edges.pair(edge) {
            Some([a, b]) => {
                sets.join(a / 3, b / 3);
            }
            None => open_faces.extend(edges.of(edge).iter().map(|s| s / 3)),
        }
    }
    let mut volume = vec![0.0f64; mesh.triangles.len()];
    let mut open = vec![false; mesh.triangles.len()];
    open_faces.iter().for_each(|&f| open[sets.find(f) as usize] = true);
    let origin = mesh.positions.first().map_or([0.0; 3], |p| p.map(|x| -x));
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f).map(|p| add(p, origin));
        volume[sets.find(f as u32) as usize] += dot(a, cross(b, c));
    }
    (0..volume.len()).filter(|&f| !open[f] && volume[f] < 0.0).count() as u64
}
