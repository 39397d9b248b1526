//! Local repair of a few flipped faces: the interior cavity check and the boundary check of P1 section 5.

use super::validity::{flipped_faces, orientation};
use crate::error::Result;
use crate::patch::Patch;
use crate::vector::Vec2;
use crate::work::Work;

const MAX_ROUNDS: usize = 12;

/// Moves vertices of flipped faces to where all their faces are counter-clockwise, round after round. Returns the flipped faces
/// that remain. O(faces) plus the flipped neighbourhoods.
pub(super) fn mend_flips(patch: &Patch, uv: &mut [Vec2], work: &Work<'_>) -> Result<Vec<u32>> {
    let mut flipped = flipped_faces(&patch.triangles, uv);
    // A failed map has many; moving vertices one by one would not save it.
    if flipped.is_empty() || flipped.len() > 8 + patch.triangles.len() / 50 {
        return Ok(flipped);
    }
    let rings = Rings::of(patch);
    for _ in 0..MAX_ROUNDS {
        work.check()?;
        let mut vertices: Vec<u32> = flipped.iter().flat_map(|&f| patch.triangles[f as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut moved = false;
        for v in vertices {
            moved |= rings.improve(patch, v, uv);
        }
        flipped = flipped_faces(&patch.triangles, uv);
        if flipped.is_empty() || !moved {
            break;
        }
    }
    Ok(flipped)
}

/// Faces around each vertex, and the neighbours of boundary vertices along their loop.
struct Rings {
    start: Vec<u32>,
    faces: Vec<u32>,
    beside: Vec<Option<(u32, u32)>>,
}

impl Rings {
    fn of(patch: &Patch) -> Rings {
        let mut start = vec![0u32; patch.positions.len() + 1];
        patch.triangles.iter().flatten().for_each(|&v| start[v as usize + 1] += 1);
        for v in 0..patch.positions.len() {
            start[v + 1] += start[v];
        }
        let mut next = start.clone();
        let mut faces = vec![0u32; patch.triangles.len() * 3];
        for (f, t) in patch.triangles.iter().enumerate() {
            for &v in t {
                faces[next[v as usize] as usize] = f as u32;
                next[v as usize] += 1;
            }
        }
        let mut beside = vec![None; patch.positions.len()];
        for ring in &patch.loops {
            let n = ring.len();
            (0..n).for_each(|k| beside[ring[k] as usize] = Some((ring[(k + n - 1) % n], ring[(k + 1) % n])));
        }
        Rings { start, faces, beside }
    }

    /// The edges opposite to `v` in its faces, as points.
    fn opposite_edges(&self, patch: &Patch, v: u32, uv: &[Vec2]) -> Vec<[Vec2; 2]> {
        let range = self.start[v as usize] as usize..self.start[v as usize + 1] as usize;
        let edge = |&f: &u32| {
            let t = patch.triangles[f as usize];
            let k = t.iter().position(|&w| w == v).unwrap_or(0);
            [uv[t[(k + 1) % 3] as usize], uv[t[(k + 2) % 3] as usize]]
        };
        self.faces[range].iter().map(edge).collect()
    }

    /// Moves `v` if fewer of its faces are flipped then. Returns whether it moved.
    fn improve(&self, patch: &Patch, v: u32, uv: &mut [Vec2]) -> bool {
        let edges = self.opposite_edges(patch, v, uv);
        let bad = |p: Vec2| edges.iter().filter(|e| orientation(p, e[0], e[1]) <= 0.0).count();
        let now = bad(uv[v as usize]);
        if now == 0 {
            return false;
        }
        let sides = self.beside[v as usize].map(|(a, b)| (uv[a as usize], uv[b as usize]));
        let best = candidates(uv[v as usize], sides, &edges).into_iter().map(|p| (bad(p), p)).min_by_key(|c| c.0);
        match best {
            Some((count, p)) if count < now => {
                uv[v as usize] = p;
                true
            }
            _ => false,
        }
    }
}

/// Places to try, the least change first.
fn candidates(at: Vec2, sides: Option<(Vec2, Vec2)>, edges: &[[Vec2; 2]]) -> Vec<Vec2> {
    let mut places = Vec::new();
    if let Some((a, b)) = sides {
        // P1 figure 11: along the projection line onto the segment between the neighbours, to its other side.
        let d = [b[0] - a[0], b[1] - a[1]];
        let t = ((at[0] - a[0]) * d[0] + (at[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]).max(f64::MIN_POSITIVE);
        let foot = [a[0] + t * d[0], a[1] + t * d[1]];
        places.extend([0.1, 0.5, 1.0, 2.0].map(|s| [foot[0] + s * (foot[0] - at[0]), foot[1] + s * (foot[1] - at[1])]));
    }
    let count = edges.len() as f64;
    places.push(edges.iter().fold([0.0; 2], |s, e| [s[0] + e[0][0] / count, s[1] + e[0][1] / count]));
    places.extend(kernel_centre(edges));
    places
}

/// Centroid of the points that see all `edges` from the left, within a box around them; `None` if there are none.
fn kernel_centre(edges: &[[Vec2; 2]]) -> Option<Vec2> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in edges.iter().flatten() {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let margin = 0.25 * ((high[0] - low[0]) + (high[1] - low[1]));
    let (low, high) = (low.map(|x| x - margin), high.map(|x| x + margin));
    let mut polygon = vec![low, [high[0], low[1]], high, [low[0], high[1]]];
    for &[a, b] in edges {
        let height = |p: Vec2| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (k, &p) in polygon.iter().enumerate() {
            let q = polygon[(k + 1) % polygon.len()];
            let (s, t) = (height(p), height(q));
            if s >= 0.0 {
                kept.push(p);
            }
            if (s > 0.0 && t < 0.0) || (s < 0.0 && t > 0.0) {
                let x = s / (s - t);
                kept.push([p[0] + x * (q[0] - p[0]), p[1] + x * (q[1] - p[1])]);
            }
        }
        polygon = kept;
        if polygon.len() < 3 {
            return None;
        }
    }
    centroid(&polygon)
}

/// Centroid of a convex polygon with an inside.
fn centroid(polygon: &[Vec2]) -> Option<Vec2> {
    let o = polygon[0];
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for pair in polygon[1..].windows(2) {
        let (a, b) = ([pair[0][0] - o[0], pair[0][1] - o[1]], [pair[1][0] - o[0], pair[1][1] - o[1]]);
        let w = a[0] * b[1] - a[1] * b[0];
        area += w;
        sum = [sum[0] + w * (a[0] + b[0]) / 3.0, sum[1] + w * (a[1] + b[1]) / 3.0];
    }
    (area > 0.0).then(|| [o[0] + sum[0] / area, o[1] + sum[1] / area])
}
