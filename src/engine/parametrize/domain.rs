//! What the maps are computed on: the patch in normalised coordinates, perhaps with virtual triangles where it is not convex.
//!
//! - A *cap* closes a hole (P1 section 8 fills holes, too): one more vertex at the centroid of the loop and the fan of triangles
//!   to it. It makes every patch a disc: an annulus has no second conformal map (z and 1/z) to be confused with the first, inner
//!   loops cannot run across one another, and the convex combination theorem holds. Where a loop is no hole in a wall but a cut
//!   far from any plane, a cap distorts the map for nothing, and the open patch does better.
//! - An *ear* closes a reflex corner of the outer loop (see [`super::ears`]), which keeps the two sides of a notch from crossing.
//!
//! Virtual triangles only add to the operators; they never leave the callers of this module.

use super::outcome::{Filling, HoleFilling};
use super::{ears, hole};
use crate::error::{EngineError, Result};
use crate::patch::Patch;
use crate::vector::{Vec2, Vec3, add, bounds, cross, distance, dot, norm, scale, sub};
use crate::work::Work;

/// Smallest height over longest side with which a triangle enters an operator. Thinner ones are taken as this thick: the
/// operator stays an exact finite element one, of a slightly thicker triangle, and no weight exceeds its inverse.
const MIN_HEIGHT: f64 = 1e-5;

/// A triangle laid into the plane: corner `base` at the origin, the next at `(length, 0)`, the third at `(foot, height)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Flat {
    /// The corner that the longest side leaves.
    pub(super) base: usize,
    /// The longest side.
    pub(super) length: f64,
    /// Where the height meets it.
    pub(super) foot: f64,
    /// The height; 0 for a degenerate triangle.
    pub(super) height: f64,
}

impl Flat {
    /// Lays out a triangle of three points that do not all coincide.
    pub(super) fn of(p: [Vec3; 3]) -> Flat {
        let sides = [distance(p[0], p[1]), distance(p[1], p[2]), distance(p[2], p[0])];
        let base = (0..3).fold(0, |best, k| if sides[k] > sides[best] { k } else { best });
        let (a, b, c) = (p[base], p[(base + 1) % 3], p[(base + 2) % 3]);
        let length = sides[base].max(f64::MIN_POSITIVE);
        // The height from the shorter of the other two sides: less cancellation.
        let from = if sides[(base + 2) % 3] <= sides[(base + 1) % 3] { a } else { b };
        let height = norm(cross(sub(b, a), sub(c, from))) / length;
        let foot = (dot(sub(b, a), sub(c, a)) / length).clamp(0.0, length);
        Flat { base, length, foot, height }
    }

    /// The triangle as the operators see it: not thinner than they can bear.
    pub(super) fn thickened(self) -> Flat {
        Flat { height: self.height.max(MIN_HEIGHT * self.length), ..self }
    }

    /// Cotangents of the angles at the three corners. `height` must not be 0.
    pub(super) fn cotangents(self) -> [f64; 3] {
        let rest = self.length - self.foot;
        let mut cot = [0.0; 3];
        cot[self.base] = self.foot / self.height;
        cot[(self.base + 1) % 3] = rest / self.height;
        cot[(self.base + 2) % 3] = (self.height * self.height - self.foot * rest) / (self.length * self.height);
        cot
    }

    /// Lengths of the sides; side `k` runs from corner `k` to the next.
    pub(super) fn sides(self) -> [f64; 3] {
        let mut sides = [0.0; 3];
        sides[self.base] = self.length;
        sides[(self.base + 1) % 3] = root_of_squares(self.length - self.foot, self.height);
        sides[(self.base + 2) % 3] = root_of_squares(self.foot, self.height);
        sides
    }

    /// The columns of the linear map that takes this layout to the corners `uv`. `height` must not be 0.
    pub(super) fn jacobian(self, uv: [Vec2; 3]) -> [Vec2; 2] {
        let at = |k: usize| uv[(self.base + k) % 3];
        let (a, b, c) = (at(0), at(1), at(2));
        let along = [(b[0] - a[0]) / self.length, (b[1] - a[1]) / self.length];
        let across = [(c[0] - a[0] - self.foot * along[0]) / self.height, (c[1] - a[1] - self.foot * along[1]) / self.height];
        [along, across]
    }

    /// Area.
    pub(super) fn area(self) -> f64 {
        0.5 * self.length * self.height
    }
}

/// A patch in coordinates of order 1, perhaps filled up.
#[derive(Debug)]
pub(super) struct Domain<'a> {
    /// The patch.
    pub(super) patch: &'a Patch,
    /// Normalised positions: those of the patch, then the centres of the caps.
    pub(super) positions: Vec<Vec3>,
    /// The virtual triangles.
    pub(super) virtual_triangles: Vec<[u32; 3]>,
    /// The outer loop, without the vertices behind ears.
    pub(super) outer: Vec<u32>,
}

impl<'a> Domain<'a> {
    /// Normalises a patch with loop `outer` as the outer one, and fills it up. O(size of the patch), and O(m log m) for meshes of m
    /// hole vertices.
    ///
    /// # Errors
    /// A patch without faces or boundary, or with indices out of range (broken invariants); [`crate::error::Reason::ChartFailed`] for
    /// a hole whose mean plane cannot be meshed; cancellation.
    pub(super) fn new(patch: &'a Patch, outer: usize, filling: Filling, work: &Work<'_>) -> Result<Self> {
        check_patch(patch)?;
        let unit = Domain::unit_of(patch)?;
        let (low, high) = bounds(&patch.positions).ok_or_else(|| EngineError::invariant("a patch without vertices"))?;
        let centre = scale(add(low, high), 0.5);
        let positions: Vec<Vec3> = patch.positions.iter().map(|&p| scale(sub(p, centre), 1.0 / unit)).collect();
        let ring = patch.loops.get(outer).ok_or_else(|| EngineError::invariant(format!("the patch has no loop {outer}")))?.clone();
        let mut domain = Domain { patch, positions, virtual_triangles: Vec::new(), outer: ring };
        for ring in patch.loops.iter().enumerate().filter(|(k, _)| *k != outer).map(|(_, ring)| ring) {
            match filling.holes {
                HoleFilling::Open => {}
                HoleFilling::CentreVertex => domain.cap(ring),
                HoleFilling::MeanPlane => domain.mesh_hole(ring, work)?,
            }
        }
        if filling.ears {
            ears::clip(&mut domain);
        }
        Ok(domain)
    }

    /// What a normalised length must be multiplied by; a power of two, so that nothing is rounded.
    pub(super) fn unit_of(patch: &Patch) -> Result<f64> {
        let (low, high) = bounds(&patch.positions).ok_or_else(|| EngineError::invariant("a patch without vertices"))?;
        Ok(power_of_two_near(distance(low, high)))
    }

    fn mesh_hole(&mut self, ring: &[u32], work: &Work<'_>) -> Result<()> {
        let mesh = hole::mean_plane_fill(ring, &self.positions, work)?;
        let first = self.positions.len() as u32;
        let count = ring.len() as u32;
        let vertex = |v: u32| if v < count { ring[v as usize] } else { first + v - count };
        self.virtual_triangles.extend(mesh.triangles.iter().map(|t| t.map(vertex)));
        self.positions.extend(mesh.positions);
        Ok(())
    }

    fn cap(&mut self, ring: &[u32]) {
        let middle = self.positions.len() as u32;
        let sum = ring.iter().fold([0.0; 3], |s, &v| add(s, self.positions[v as usize]));
        self.positions.push(scale(sum, 1.0 / ring.len() as f64));
        // The patch lies left of the loop; the cap runs along it the other way.
        self.virtual_triangles.extend((0..ring.len()).map(|k| [ring[(k + 1) % ring.len()], ring[k], middle]));
    }

    /// Number of vertices, centres of caps included.
    pub(super) fn size(&self) -> usize {
        self.positions.len()
    }

    /// All triangles, virtual ones last.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + Clone + '_ {
        self.patch.triangles.iter().chain(&self.virtual_triangles).copied()
    }

    /// Layout of a triangle.
    pub(super) fn flat(&self, t: [u32; 3]) -> Flat {
        Flat::of(t.map(|v| self.positions[v as usize]))
    }

    /// Lengths of the edges of the outer loop, edge `k` leaving its vertex `k`; none is 0.
    pub(super) fn outer_lengths(&self) -> Vec<f64> {
        let ring = &self.outer;
        let lengths: Vec<f64> = (0..ring.len())
            .map(|k| distance(self.positions[ring[k] as usize], self.positions[ring[(k + 1) % ring.len()] as usize]))
            .collect();
        let least = 1e-7 * lengths.iter().sum::<f64>() / ring.len() as f64;
        lengths.into_iter().map(|l| l.max(least).max(f64::MIN_POSITIVE)).collect()
    }
}

/// # Errors
/// A patch without faces or boundary, or with indices out of range.
pub(super) fn check_patch(patch: &Patch) -> Result<()> {
    let count = patch.positions.len();
    let inside = |v: &u32| (*v as usize) < count;
    if patch.triangles.is_empty() || patch.loops.is_empty() {
        return Err(EngineError::invariant("a patch without faces or without a boundary"));
    }
    if !patch.triangles.iter().flatten().all(inside) || patch.loops.iter().any(|ring| ring.len() < 3 || !ring.iter().all(inside)) {
        return Err(EngineError::invariant("a patch with indices out of range or a boundary loop of fewer than three edges"));
    }
    Ok(())
}

/// Faster than `hypot`, for numbers whose squares are in range.
#[inline]
pub(super) fn root_of_squares(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

/// The power of two at or below a length; 1 for 0 and for what is not finite.
fn power_of_two_near(length: f64) -> f64 {
    if length > 0.0 && length.is_finite() { length.log2().floor().clamp(-1000.0, 1000.0).exp2() } else { 1.0 }
}
