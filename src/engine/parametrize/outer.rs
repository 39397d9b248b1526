//! Plane positions of the outer loop of a patch (P1 section 4): the Dirichlet conditions of the maps with a fixed boundary.
//!
//! A loop has its patch on the left, so its image runs counter-clockwise.

mod round;

use super::frame::{Normalised, mean_plane};
use super::spec::{Boundary, BoundaryShape};
use crate::error::{Element, EngineError, Location, Result};
use crate::vector::{Vec2, Vec3, lerp};

/// Least ratio of the area of a projected loop to the square of its length.
const MIN_SHADOW: f64 = 1e-10;

/// Plane positions of the vertices `ring` of the outer loop, in loop direction; `positions` are those of all vertices of the patch,
/// in any unit. The image has size of order 1 and runs counter-clockwise. On a circle or an ellipse it is strictly convex, and no
/// two vertices coincide, however short an edge is (lengths are bounded from below by a few 1e-8 of the loop's; in a projection
/// nothing is). O(m log m) at most; about 0.1 microseconds per vertex, up to 1 on an ellipse.
///
/// # Errors
/// [`crate::error::Reason::BadParameter`] with field and vertices (numbers and positions as given here) for a start or corner that
/// is not on the loop, corners out of order, fewer vertices than corners, chords that do not close, a projection without area.
pub(super) fn place_outer(ring: &[u32], positions: &[Vec3], boundary: &Boundary) -> Result<Vec<Vec2>> {
    if ring.len() < 3 || ring.iter().any(|&v| v as usize >= positions.len()) {
        return Err(EngineError::invariant("an outer loop of fewer than three vertices or with indices out of range"));
    }
    let normalised = Normalised::of(ring, positions);
    let outline = Loop { ring, positions, lengths: bounded(normalised.lengths()) };
    let start = boundary.start.map_or(Ok(0), |v| outline.places(&[v], "boundary.start_vertex").map(|p| p[0]))?;
    match &boundary.shape {
        BoundaryShape::Circle => outline.on_round(start, 1.0, boundary),
        BoundaryShape::Ellipse { ratio } => outline.on_round(start, *ratio, boundary),
        BoundaryShape::Rectangle { ratio, corners } => {
            let places = match corners {
                Some(corners) => outline.given_corners(corners)?,
                None => outline.shared_corners(start, &[1.0; 4])?,
            };
            let sides = outline.sides(&places);
            let ratio = ratio.unwrap_or(((sides[0] + sides[2]) / (sides[1] + sides[3])).clamp(1e-3, 1e3));
            let (x, y) = (ratio.sqrt(), 1.0 / ratio.sqrt());
            Ok(outline.on_polygon(&places, &[[-x, -y], [x, -y], [x, y], [-x, y]]))
        }
        BoundaryShape::Polygon { points, corners } => {
            let points = of_order_one(points);
            let places = match corners {
                Some(corners) => outline.given_corners(corners)?,
                None => {
                    let n = points.len();
                    let side = |k: usize| (points[(k + 1) % n][0] - points[k][0]).hypot(points[(k + 1) % n][1] - points[k][1]);
                    outline.shared_corners(start, &(0..n).map(side).collect::<Vec<f64>>())?
                }
            };
            Ok(outline.on_polygon(&places, &points))
        }
        BoundaryShape::MeanPlane => projected(&normalised),
    }
}

/// Lengths none of which is too small to keep neighbours apart and three of them strictly convex on a circle in double precision.
fn bounded(mut lengths: Vec<f64>) -> Vec<f64> {
    let total: f64 = lengths.iter().sum();
    let mean = total / lengths.len() as f64;
    let least = (1e-7 * mean).max((2e-8 * total).min(0.1 * mean)).max(f64::MIN_POSITIVE);
    lengths.iter_mut().for_each(|l| *l = l.max(least));
    lengths
}

/// A polygon about the centre of its box with a perimeter of order 1.
fn of_order_one(points: &[Vec2]) -> Vec<Vec2> {
    let range = |k: usize| points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[k]), h.max(p[k])));
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    // Halves first: the difference of two finite numbers need not be finite.
    let unit = (0.5 * x1 - 0.5 * x0).max(0.5 * y1 - 0.5 * y0).max(f64::MIN_POSITIVE).log2().ceil().exp2();
    let at = |x: f64, low: f64, high: f64| (x - (0.5 * low + 0.5 * high)) / unit;
    points.iter().map(|p| [at(p[0], x0, x1), at(p[1], y0, y1)]).collect()
}

fn projected(normalised: &Normalised) -> Result<Vec<Vec2>> {
    let plane = mean_plane(&normalised.points);
    let flat: Vec<Vec2> = normalised.points.iter().map(|&p| plane.project(p)).collect();
    let length: f64 = normalised.lengths().iter().sum();
    if signed_area(&flat) > MIN_SHADOW * length * length {
        return Ok(flat);
    }
    Err(EngineError::bad_parameter("boundary.shape", "the projection of the outer loop onto its mean plane has no area")
        .with_hint("take another shape, or a method with a free boundary"))
}

/// Area inside a closed polygon, positive if it runs counter-clockwise. About its first point, to save digits.
pub(super) fn signed_area(points: &[Vec2]) -> f64 {
    let Some(&o) = points.first() else { return 0.0 };
    let half = |w: &[Vec2]| 0.5 * ((w[0][0] - o[0]) * (w[1][1] - o[1]) - (w[0][1] - o[1]) * (w[1][0] - o[0]));
    points.windows(2).map(half).sum()
}

struct Loop<'a> {
    ring: &'a [u32],
    positions: &'a [Vec3],
    /// Edge `k` leaves vertex `k`; none is 0.
    lengths: Vec<f64>,
}

impl Loop<'_> {
    fn count(&self) -> usize {
        self.ring.len()
    }

    /// Places of vertices in the loop. O(m log m).
    fn places(&self, vertices: &[u32], field: &str) -> Result<Vec<usize>> {
        let mut sorted: Vec<(u32, usize)> = self.ring.iter().enumerate().map(|(k, &v)| (v, k)).collect();
        sorted.sort_unstable();
        let place = |&v: &u32| {
            let at = sorted.partition_point(|e| e.0 < v);
            sorted.get(at).filter(|e| e.0 == v).map(|e| e.1).ok_or_else(|| {
                EngineError::bad_parameter(field, "the vertex is not on the outer loop")
                    .with_hint("name a vertex of the outer loop, or choose the loop through the vertex as the outer one")
                    .with_locations(self.location(v))
            })
        };
        vertices.iter().map(place).collect()
    }

    fn location(&self, vertex: u32) -> Option<Location> {
        let position = *self.positions.get(vertex as usize)?;
        Some(Location { element: Element::Vertex, ids: vec![vertex], position })
    }

    /// Places of corners that were named: distinct and in loop order.
    fn given_corners(&self, corners: &[u32]) -> Result<Vec<usize>> {
        let places = self.places(corners, "boundary.corners")?;
        let ahead = |k: usize| (places[k] + self.count() - places[0]) % self.count();
        match (1..places.len()).find(|&k| ahead(k) <= ahead(k - 1)) {
            None => Ok(places),
            Some(k) => Err(EngineError::bad_parameter(
                "boundary.corners",
                format!("corner {k} does not follow the one before in the direction of the outer loop"),
            )
            .with_hint("name the corners in the direction of the loop, which has the patch on its left, each once")
            .with_locations([corners[k - 1], corners[k]].into_iter().filter_map(|v| self.location(v)))),
        }
    }

    /// Corners where the loop, from `start`, has run through the given shares of its length: the nearest vertices, all distinct.
    fn shared_corners(&self, start: usize, shares: &[f64]) -> Result<Vec<usize>> {
        let (m, n) = (self.count(), shares.len());
        if m < n {
            return Err(EngineError::bad_parameter("boundary.shape", format!("the outer loop has {m} vertices for {n} corners"))
                .with_locations(self.ring.iter().filter_map(|&v| self.location(v))));
        }
        let mut runs = Vec::with_capacity(m);
        let mut run = 0.0;
        for k in 0..m {
            runs.push(run);
            run += self.lengths[(start + k) % m];
        }
        let scale = run / shares.iter().sum::<f64>();
        let (mut corners, mut wanted) = (Vec::with_capacity(n), 0.0);
        for (j, share) in shares.iter().enumerate() {
            let after = runs.partition_point(|&r| r < wanted).min(m - 1);
            let nearest = if after > 0 && wanted - runs[after - 1] < runs[after] - wanted { after - 1 } else { after };
            let least = corners.last().map_or(0, |&k: &usize| k + 1);
            corners.push(if j == 0 { 0 } else { nearest.max(least) });
            wanted += share * scale;
        }
        for j in 0..n {
            corners[j] = (corners[j].min(m - (n - j)) + start) % m;
        }
        Ok(corners)
    }

    /// Lengths of the loop between corners.
    fn sides(&self, places: &[usize]) -> Vec<f64> {
        let m = self.count();
        let side = |j: usize| {
            let (from, to) = (places[j], places[(j + 1) % places.len()]);
            (0..(to + m - from - 1) % m + 1).map(|k| self.lengths[(from + k) % m]).sum()
        };
        (0..places.len()).map(side).collect()
    }

    /// Vertices between corners on the straight sides.
    fn on_polygon(&self, places: &[usize], points: &[Vec2]) -> Vec<Vec2> {
        let m = self.count();
        let mut out = vec![[0.0; 2]; m];
        for (j, side) in self.sides(places).into_iter().enumerate() {
            let (a, b) = (points[j], points[(j + 1) % points.len()]);
            let (from, to) = (places[j], places[(j + 1) % places.len()]);
            let mut run = 0.0;
            for k in 0..(to + m - from - 1) % m + 1 {
                // From the nearer end, so that a vertex near a corner is told from it.
                let near = run <= 0.5 * side;
                let (p, q, t) = if near { (a, b, run / side) } else { (b, a, ((side - run) / side).max(0.0)) };
                let [x, y, _] = lerp([p[0], p[1], 0.0], [q[0], q[1], 0.0], t);
                out[(from + k) % m] = [x, y];
                run += self.lengths[(from + k) % m];
            }
        }
        out
    }

    /// On the ellipse with this ratio of axes, `start` at angle 0.
    fn on_round(&self, start: usize, ratio: f64, boundary: &Boundary) -> Result<Vec<Vec2>> {
        let m = self.count();
        let lengths: Vec<f64> = (0..m).map(|k| self.lengths[(start + k) % m]).collect();
        let mut image = round::spread(&lengths, ratio, boundary.spacing).ok_or_else(|| self.unclosed())?;
        image.rotate_right(start);
        Ok(image)
    }

    fn unclosed(&self) -> EngineError {
        let m = self.count();
        let k = (0..m).fold(0, |best, k| if self.lengths[k] > self.lengths[best] { k } else { best });
        let (a, b) = (self.ring[k], self.ring[(k + 1) % m]);
        let (p, q) = (self.positions[a as usize], self.positions[b as usize]);
        EngineError::bad_parameter(
            "boundary.spacing",
            "no polygon inscribed in the curve has sides proportional to the edges of the outer loop",
        )
        .with_hint("its longest edge is too long beside the others for chords: use arc length spacing")
        .with_locations([Location { element: Element::Edge, ids: vec![a, b], position: lerp(p, q, 0.5) }])
    }
}

#[cfg(test)]
mod tests;
