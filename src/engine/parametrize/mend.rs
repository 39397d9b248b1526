//! Local repair of a few flipped faces: the interior cavity check and the boundary check of P1 section 5.
//!
//! A move is only made if it turns no face that was right and sets at least one right that was flipped, with exact signs, so flips never
//! grow. A boundary vertex that moves can make the boundary run into itself: the check for overlaps belongs after the repair.

use super::validity::{flipped_faces, orientation};
use crate::error::Result;
use crate::patch::Patch;
use crate::vector::Vec2;
use crate::work::Work;

const MAX_ROUNDS: usize = 12;

/// How far cavities grow around flipped faces that no single vertex can set right, in rings of vertices.
const CAVITY_RINGS: [usize; 3] = [0, 1, 3];

/// Largest cavity, in vertices.
const MAX_CAVITY: usize = 4096;

/// What a repair did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mended {
    /// Faces that are still flipped, increasing: a part of those that were.
    pub(super) flipped: Vec<u32>,
    /// Vertices that are not where they were, increasing.
    pub(super) moved: Vec<u32>,
}

/// Moves vertices of flipped faces to where more of their faces are counter-clockwise: one by one, round after round, then whole
/// cavities to the averages of their neighbours. Vertices in `held` stay. No face that was counter-clockwise is flipped. Nothing is done where more than 8 faces
/// and 2 % are flipped: such a map failed. O(faces) plus the flipped neighbourhoods.
///
/// # Errors
/// Cancellation.
pub(super) fn mend_flips(patch: &Patch, held: &[u32], uv: &mut [Vec2], work: &Work<'_>) -> Result<Mended> {
    let mut flipped = flipped_faces(&patch.triangles, uv);
    if flipped.is_empty() || flipped.len() > 8 + patch.triangles.len() / 50 {
        return Ok(Mended { flipped, moved: Vec::new() });
    }
    let rings = Rings::of(patch, held);
    let mut changed = Vec::new();
    let mut cavities = CAVITY_RINGS.into_iter();
    for _ in 0..MAX_ROUNDS {
        work.check()?;
        let before = changed.len();
        let vertices = rings.worst_first(patch, &flipped);
        changed.extend(vertices.into_iter().filter(|&v| rings.improve(patch, v, uv)));
        if changed.len() == before {
            let Some(grow) = cavities.next() else { break };
            changed.extend(rings.relax(patch, &flipped, grow, uv, work)?);
        }
        // Only faces of the list can be flipped, as no others ever become so.
        flipped.retain(|&f| is_flipped(patch, f, uv));
        if flipped.is_empty() {
            break;
        }
    }
    changed.sort_unstable();
    changed.dedup();
    Ok(Mended { flipped, moved: changed })
}

fn is_flipped(patch: &Patch, face: u32, uv: &[Vec2]) -> bool {
    let [a, b, c] = patch.triangles[face as usize].map(|v| uv[v as usize]);
    orientation(a, b, c) <= 0.0
}

/// Faces around each vertex, and the neighbours of boundary vertices along their loop.
struct Rings {
    start: Vec<u32>,
    faces: Vec<u32>,
    beside: Vec<Option<(u32, u32)>>,
    /// Vertices that stay where they are.
    held: Vec<bool>,
}

impl Rings {
    fn of(patch: &Patch, held: &[u32]) -> Rings {
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
        let mut stays = vec![false; patch.positions.len()];
        held.iter().for_each(|&v| stays[v as usize] = true);
        Rings { start, faces, beside, held: stays }
    }

    fn faces(&self, v: u32) -> &[u32] {
        &self.faces[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }

    /// Vertices of some faces, increasing.
    fn corners(&self, patch: &Patch, faces: &[u32]) -> Vec<u32> {
        let mut vertices: Vec<u32> = faces.iter().flat_map(|&f| patch.triangles[f as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices
    }

    /// Vertices of the flipped faces by the share of flipped ones among their faces: the vertex that is out of place has the most, and
    /// the tip of an ear has no other.
    fn worst_first(&self, patch: &Patch, flipped: &[u32]) -> Vec<u32> {
        let mut vertices = self.corners(patch, flipped);
        let bad = |v: u32| self.faces(v).iter().filter(|f| flipped.binary_search(f).is_ok()).count();
        let share = |v: u32| bad(v) as f64 / self.faces(v).len() as f64;
        vertices.sort_by(|&a, &b| share(b).total_cmp(&share(a)));
        vertices
    }

    /// The edges opposite to `v` in its faces, as points.
    fn opposite_edges(&self, patch: &Patch, v: u32, uv: &[Vec2]) -> Vec<[Vec2; 2]> {
        let edge = |&f: &u32| {
            let t = patch.triangles[f as usize];
            let k = t.iter().position(|&w| w == v).unwrap_or(0);
            [uv[t[(k + 1) % 3] as usize], uv[t[(k + 2) % 3] as usize]]
        };
        self.faces(v).iter().map(edge).collect()
    }

    /// Moves `v` if fewer of its faces are flipped then, and none that was not. Returns whether it moved.
    fn improve(&self, patch: &Patch, v: u32, uv: &mut [Vec2]) -> bool {
        if self.held[v as usize] {
            return false;
        }
        let edges = self.opposite_edges(patch, v, uv);
        let at = uv[v as usize];
        let bad = |p: Vec2, e: &[Vec2; 2]| orientation(p, e[0], e[1]) <= 0.0;
        let count = |p: Vec2| edges.iter().filter(|e| bad(p, e)).count();
        let now = count(at);
        if now == 0 {
            return false;
        }
        let spares = |p: &Vec2| edges.iter().all(|e| bad(at, e) || !bad(*p, e));
        let sides = self.beside[v as usize].map(|(a, b)| (uv[a as usize], uv[b as usize]));
        let best = candidates(at, sides, &edges).into_iter().filter(spares).map(|p| (count(p), p)).min_by_key(|c| c.0);
        match best {
            Some((count, p)) if count < now => {
                uv[v as usize] = p;
                true
            }
            _ => false,
        }
    }

    /// Moves the inner vertices around flipped faces, a cavity at a time, to the averages of their neighbours (the barycentric map of
    /// P1 eq. 12 onto the cavity as it lies), and keeps the cavities that have fewer flipped faces then, and none that was not flipped.
    /// Returns the vertices that moved.
    fn relax(&self, patch: &Patch, flipped: &[u32], grow: usize, uv: &mut [Vec2], work: &Work<'_>) -> Result<Vec<u32>> {
        let mut moved = Vec::new();
        for cavity in self.cavities(patch, flipped, grow) {
            work.check()?;
            let mut faces: Vec<u32> = cavity.iter().flat_map(|&v| self.faces(v)).copied().collect();
            faces.sort_unstable();
            faces.dedup();
            let was: Vec<bool> = faces.iter().map(|&f| is_flipped(patch, f, uv)).collect();
            let places: Vec<Vec2> = cavity.iter().map(|&v| uv[v as usize]).collect();
            for _ in 0..20 + 4 * cavity.len().isqrt() {
                cavity.iter().for_each(|&v| uv[v as usize] = average(&self.opposite_edges(patch, v, uv)));
            }
            let is: Vec<bool> = faces.iter().map(|&f| is_flipped(patch, f, uv)).collect();
            if is != was && is.iter().zip(&was).all(|(is, was)| *was || !is) {
                moved.extend(cavity);
            } else {
                cavity.iter().zip(places).for_each(|(&v, p)| uv[v as usize] = p);
            }
        }
        Ok(moved)
    }

    /// Connected sets of inner vertices within so many rings of the vertices of flipped faces, each increasing, those of moderate size.
    fn cavities(&self, patch: &Patch, flipped: &[u32], grow: usize) -> Vec<Vec<u32>> {
        let mut free = self.corners(patch, flipped);
        for _ in 0..grow {
            let faces: Vec<u32> = free.iter().flat_map(|&v| self.faces(v)).copied().collect();
            free = self.corners(patch, &faces);
        }
        free.retain(|&v| self.beside[v as usize].is_none() && !self.held[v as usize]);
        let mut seen = vec![false; free.len()];
        let mut out = Vec::new();
        for k in 0..free.len() {
            if std::mem::replace(&mut seen[k], true) {
                continue;
            }
            let mut cavity = vec![free[k]];
            let mut next = 0;
            while next < cavity.len() {
                for w in self.corners(patch, self.faces(cavity[next])) {
                    if let Ok(at) = free.binary_search(&w)
                        && !std::mem::replace(&mut seen[at], true)
                    {
                        cavity.push(w);
                    }
                }
                next += 1;
            }
            cavity.sort_unstable();
            out.push(cavity);
        }
        out.retain(|cavity| cavity.len() <= MAX_CAVITY);
        out
    }
}

/// Average of the neighbours of an inner vertex, given by the edges around it.
fn average(edges: &[[Vec2; 2]]) -> Vec2 {
    let count = edges.len() as f64;
    edges.iter().fold([0.0; 2], |s, e| [s[0] + e[0][0] / count, s[1] + e[0][1] / count])
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
    places.push(average(edges));
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
