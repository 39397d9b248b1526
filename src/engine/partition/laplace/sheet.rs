//! A connected set of faces as a mesh of its own: what a harmonic map needs, in local numbers.

use crate::partition::surface::Surface;
use crate::vector::{Vec3, cross, distance, dot, norm, sub, unit};

/// No neighbour, no number.
pub(in crate::partition) const NONE: u32 = u32::MAX;

/// Cotangent weights are kept in this range: positive weights make the map one-to-one (Tutte), and needles must not pull
/// vertices together.
const WEIGHTS: [f64; 2] = [0.02, 20.0];

/// Faces glued along their common edges. Where the set touches itself in a vertex, each fan of faces has a vertex of its own.
#[derive(Debug)]
pub(in crate::partition) struct Sheet {
    /// Faces of the surface; local face `i` is `faces[i]`, local halfedge `3 i + k` its halfedge `k`.
    pub(in crate::partition) faces: Vec<u32>,
    /// Local vertices of each face.
    pub(in crate::partition) triangles: Vec<[u32; 3]>,
    /// Opposite local halfedge, [`NONE`] on the border.
    pub(in crate::partition) twin: Vec<u32>,
    /// Whether the halfedge lies on a feature.
    pub(in crate::partition) feature: Vec<bool>,
    /// Positive weight of the edge of each halfedge.
    pub(in crate::partition) weight: Vec<f64>,
    /// Length of each halfedge.
    pub(in crate::partition) length: Vec<f64>,
    /// Area of each face.
    pub(in crate::partition) area: Vec<f64>,
    /// Border loops as local halfedges in their direction, the longest first.
    pub(in crate::partition) loops: Vec<Vec<u32>>,
    /// Number of local vertices.
    pub(in crate::partition) vertices: usize,
}

pub(in crate::partition) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

pub(in crate::partition) fn prev(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl Sheet {
    /// Cuts `faces` out of the surface. `slot` is scratch of one entry per face of the surface; any content. O(`faces`).
    pub(in crate::partition) fn new(surface: &Surface<'_>, faces: Vec<u32>, slot: &mut [u32]) -> Sheet {
        for (i, &f) in faces.iter().enumerate() {
            slot[f as usize] = i as u32;
        }
        let local = |t: u32| {
            let i = slot[t as usize / 3];
            if faces.get(i as usize) == Some(&(t / 3)) { 3 * i + t % 3 } else { NONE }
        };
        let globals = || faces.iter().flat_map(|&f| 3 * f..3 * f + 3);
        let twin: Vec<u32> = globals().map(|h| surface.topology.twin(h).map_or(NONE, local)).collect();
        let (corner, vertices) = number_corners(&twin);
        let cot: Vec<f64> = globals().map(|h| cotangent(surface, h)).collect();
        let weight = (0..twin.len()).map(|h| edge_weight(&cot, &twin, h)).collect();
        let mut sheet = Sheet {
            triangles: corner.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            feature: globals().map(|h| surface.features.is_feature[h as usize]).collect(),
            length: globals().map(|h| surface.length[h as usize]).collect(),
            area: faces.iter().map(|&f| surface.area[f as usize]).collect(),
            loops: Vec::new(),
            weight,
            twin,
            vertices,
            faces,
        };
        sheet.trace_loops();
        sheet
    }

    /// Local vertex a halfedge leaves.
    pub(in crate::partition) fn origin(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// Neighbours of a face across its edges, features included.
    pub(in crate::partition) fn around(&self, f: u32) -> impl Iterator<Item = u32> + '_ {
        self.twin[3 * f as usize..3 * f as usize + 3].iter().filter(|&&t| t != NONE).map(|&t| t / 3)
    }

    /// Neighbours of a face across edges that are no feature.
    pub(in crate::partition) fn crossings(&self, f: u32) -> impl Iterator<Item = u32> + '_ {
        (3 * f..3 * f + 3).filter(|&h| self.twin[h as usize] != NONE && !self.feature[h as usize]).map(|h| self.twin[h as usize] / 3)
    }

    /// Sum of the areas.
    pub(in crate::partition) fn total_area(&self) -> f64 {
        self.area.iter().sum()
    }

    fn trace_loops(&mut self) {
        let mut seen = vec![false; self.twin.len()];
        let mut loops: Vec<(f64, Vec<u32>)> = Vec::new();
        for first in 0..self.twin.len() as u32 {
            if seen[first as usize] || self.twin[first as usize] != NONE {
                continue;
            }
            let (mut ring, mut length, mut at) = (Vec::new(), 0.0, first);
            while !std::mem::replace(&mut seen[at as usize], true) {
                ring.push(at);
                length += self.length[at as usize];
                at = next(at);
                while self.twin[at as usize] != NONE {
                    at = next(self.twin[at as usize]);
                }
            }
            loops.push((length, ring));
        }
        loops.sort_by(|a, b| b.0.total_cmp(&a.0));
        self.loops = loops.into_iter().map(|l| l.1).collect();
    }
}

/// One vertex per fan of corners; the vertex of each corner and how many there are.
fn number_corners(twin: &[u32]) -> (Vec<u32>, usize) {
    let mut corner = vec![NONE; twin.len()];
    let mut count = 0;
    for first in 0..twin.len() as u32 {
        if corner[first as usize] != NONE {
            continue;
        }
        let mut at = first;
        while at != NONE && corner[at as usize] == NONE {
            corner[at as usize] = count;
            at = twin[prev(at) as usize];
        }
        // From the border on the other way round.
        let mut back = if at == NONE { twin[first as usize] } else { NONE };
        while back != NONE && corner[next(back) as usize] == NONE {
            corner[next(back) as usize] = count;
            back = twin[next(back) as usize];
        }
        count += 1;
    }
    (corner, count as usize)
}

/// Cotangent of the angle opposite a halfedge of the surface.
fn cotangent(surface: &Surface<'_>, h: u32) -> f64 {
    let place = |h: u32| -> Vec3 { surface.mesh.positions[surface.topology.origin(h) as usize] };
    let (a, b, apex) = (place(h), place(next(h)), place(prev(h)));
    let (p, q) = (sub(a, apex), sub(b, apex));
    let size = distance(a, b).max(norm(p)).max(norm(q));
    if size > 0.0 {
        let (p, q) = (p.map(|x| x / size), q.map(|x| x / size));
        dot(p, q) / norm(cross(p, q)).max(1e-12)
    } else {
        dot(unit(p), unit(q))
    }
}

fn edge_weight(cot: &[f64], twin: &[u32], h: usize) -> f64 {
    let other = if twin[h] == NONE { 0.0 } else { cot[twin[h] as usize] };
    (0.5 * (cot[h] + other)).clamp(WEIGHTS[0], WEIGHTS[1])
}
