//! Exact test whether triangles of a surface meet in more than the vertex or the edge they share.

use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, area_vector_twice};
use crate::work::Work;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Counts the pairs of faces that meet in more than what they share, and lists the first `keep` of them, low face first, sorted.
/// Vertices with equal coordinates count as shared. O(F log F) plus the pairs of faces with overlapping boxes.
///
/// # Errors
/// Cancellation.
pub fn self_intersections(mesh: &SurfaceMesh, bvh: &TriangleBvh, keep: usize, work: &Work<'_>) -> Result<(u64, Vec<[u32; 2]>)> {
    let mut pairs = Vec::new();
    let (mut visited, mut count) = (0u64, 0u64);
    let most = keep.saturating_mul(2).max(4096);
    bvh.overlapping_pairs(|f, g| -> Result<()> {
        visited += 1;
        if visited.is_multiple_of(8192) {
            work.check()?;
        }
        if faces_intersect(&mesh.corners(f as usize), &mesh.corners(g as usize)) {
            count += 1;
            pairs.push([f.min(g), f.max(g)]);
            // A soup has more pairs than memory.
            if pairs.len() > most {
                pairs.sort_unstable();
                pairs.truncate(keep);
            }
        }
        Ok::<(), EngineError>(())
    })?;
    pairs.sort_unstable();
    pairs.truncate(keep);
    Ok((count, pairs))
}

/// Whether two triangles meet in more than the corners they share (corners with equal coordinates). Exact.
/// The same three corners twice are a duplicate face and not counted.
pub fn faces_intersect(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let mut shared = [(0, 0); 3];
    let mut count = 0;
    for i in 0..3 {
        // A corner of a triangle of no area may equal another corner of it: each is shared once.
        if let Some(j) = (0..3).find(|&j| s[i] == t[j] && shared[..count].iter().all(|x| x.1 != j)) {
            shared[count] = (i, j);
            count += 1;
        }
    }
    match count {
        0 => triangles_meet(s, t),
        1 => {
            let (i, j) = shared[0];
            segment_meets(s[(i + 1) % 3], s[(i + 2) % 3], t) || segment_meets(t[(j + 1) % 3], t[(j + 2) % 3], s)
        }
        2 => {
            let (i, j) = (3 - shared[0].0 - shared[1].0, 3 - shared[0].1 - shared[1].1);
            folded_flat(s[shared[0].0], s[shared[1].0], s[i], t[j])
        }
        _ => false,
    }
}

fn sign3(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> i8 {
    let v = orient3d(coord(a), coord(b), coord(c), coord(d));
    i8::from(v > 0.0) - i8::from(v < 0.0)
}

/// The predicates are exact unless products underflow; coordinates that small are taken for 0.
fn coord(p: Vec3) -> Coord3D<f64> {
    let [x, y, z] = p.map(flush);
    Coord3D { x, y, z }
}

fn flush(x: f64) -> f64 {
    if x.abs() < 1e-90 { 0.0 } else { x }
}

/// Two axes onto which a triangle projects well; exact tests stay exact, whichever plane is taken, unless it projects to a line.
fn plane_of(t: &[Vec3; 3]) -> [usize; 2] {
    let n = area_vector_twice(t[0], t[1], t[2]).map(f64::abs);
    let drop = if n[0] >= n[1] && n[0] >= n[2] {
        0
    } else if n[1] >= n[2] {
        1
    } else {
        2
    };
    [(drop + 1) % 3, (drop + 2) % 3]
}

fn sign2([i, j]: [usize; 2], a: Vec3, b: Vec3, c: Vec3) -> i8 {
    let at = |p: Vec3| Coord { x: flush(p[i]), y: flush(p[j]) };
    let v = orient2d(at(a), at(b), at(c));
    i8::from(v > 0.0) - i8::from(v < 0.0)
}

/// Two faces with the common edge `a b` and the third corners `c` and `d`: in one plane, on the same side.
fn folded_flat(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> bool {
    if sign3(a, b, c, d) != 0 {
        return false;
    }
    let plane = plane_of(&[a, b, c]);
    sign2(plane, a, b, c) * sign2(plane, a, b, d) > 0
}

/// Closed triangles without common corner.
fn triangles_meet(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let side = |plane: &[Vec3; 3], of: &[Vec3; 3]| of.map(|p| sign3(plane[0], plane[1], plane[2], p));
    let apart = |signs: [i8; 3]| signs == [1; 3] || signs == [-1; 3];
    if apart(side(s, t)) || apart(side(t, s)) {
        return false;
    }
    (0..3).any(|k| segment_meets(s[k], s[(k + 1) % 3], t) || segment_meets(t[k], t[(k + 1) % 3], s))
}

/// Closed segment and closed triangle.
fn segment_meets(p: Vec3, q: Vec3, t: &[Vec3; 3]) -> bool {
    let (from, to) = (sign3(t[0], t[1], t[2], p), sign3(t[0], t[1], t[2], q));
    if from * to > 0 {
        return false;
    }
    if from == 0 && to == 0 {
        return segment_meets_in_plane(p, q, t);
    }
    let around = [0, 1, 2].map(|k| sign3(p, q, t[k], t[(k + 1) % 3]));
    around.iter().all(|s| *s >= 0) || around.iter().all(|s| *s <= 0)
}

fn segment_meets_in_plane(p: Vec3, q: Vec3, t: &[Vec3; 3]) -> bool {
    let plane = plane_of(t);
    if sign2(plane, t[0], t[1], t[2]) != 0 {
        let inside = |x: Vec3| {
            let s = [0, 1, 2].map(|k| sign2(plane, t[k], t[(k + 1) % 3], x));
            s.iter().all(|s| *s >= 0) || s.iter().all(|s| *s <= 0)
        };
        if inside(p) || inside(q) {
            return true;
        }
    }
    (0..3).any(|k| segments_cross(plane, p, q, t[k], t[(k + 1) % 3]))
}

/// Closed segments in a plane.
fn segments_cross(plane: [usize; 2], p: Vec3, q: Vec3, a: Vec3, b: Vec3) -> bool {
    let (s, t) = (sign2(plane, p, q, a), sign2(plane, p, q, b));
    let (u, v) = (sign2(plane, a, b, p), sign2(plane, a, b, q));
    if s * t > 0 || u * v > 0 {
        return false;
    }
    if s == 0 && t == 0 && u == 0 && v == 0 {
        return (0..3).all(|k| p[k].min(q[k]) <= a[k].max(b[k]) && a[k].min(b[k]) <= p[k].max(q[k]));
    }
    true
}
