//! What is laid over a chart to show how it maps: a checkerboard, lines of constant u and of constant v (P1 figures 5 and 16).

use crate::colour::{Rgb, lit};
use crate::error::{RenderError, Result};

/// Colour of the lines of constant u. Blue and orange differ for every reader.
pub const ISO_U: Rgb = [21, 101, 192];
/// Colour of the lines of constant v.
pub const ISO_V: Rgb = [230, 110, 0];

/// Half the width of a line, in pixels.
const HALF_WIDTH: f64 = 0.8;

/// A pattern in the coordinates of a chart. Both parts can be drawn together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pattern {
    /// Side of the fields of a checkerboard, in units of the chart.
    pub checkers: Option<f64>,
    /// Distance of the lines of constant u, and of those of constant v, in units of the chart.
    pub iso: Option<f64>,
}

/// The longer side of the box around points of the plane; 0 for none. To ask for a number of fields or lines.
pub fn chart_extent(uv: &[[f64; 2]]) -> f64 {
    let side = |k: usize| {
        let low = uv.iter().fold(f64::INFINITY, |m, p| m.min(p[k]));
        let high = uv.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[k]));
        high - low
    };
    side(0).max(side(1)).max(0.0)
}

impl Pattern {
    pub(crate) fn check(&self) -> Result<()> {
        for (what, value) in [("side of a checkerboard field", self.checkers), ("distance of iso lines", self.iso)] {
            if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(RenderError::BadParameter { what, value });
            }
        }
        Ok(())
    }

    /// The colour where `chart` is at the sample `(x, y)`, with `own` below the pattern.
    pub(crate) fn paint(&self, own: Rgb, chart: &PlaneMap, x: f64, y: f64, samples: f64) -> Rgb {
        let uv = chart.0.map(|[dx, dy, at]| dx * x + dy * y + at);
        let mut colour = own;
        if let Some(side) = self.checkers
            && ((uv[0] / side).floor() + (uv[1] / side).floor()).rem_euclid(2.0) >= 1.0
        {
            colour = lit(own, 0.68);
        }
        if let Some(step) = self.iso {
            for (k, line) in [(0, ISO_U), (1, ISO_V)] {
                let [dx, dy, _] = chart.0[k];
                let places = uv[k] / step;
                let spacing = step / dx.hypot(dy);
                // Lines that crowd get thinner, or nothing would be left between them.
                if (places - places.round()).abs() * spacing < (HALF_WIDTH * samples).min(0.2 * spacing) {
                    colour = line;
                }
            }
        }
        colour
    }
}

/// u and v as affine functions of the place in the picture: slopes along x and y, and the value at the origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneMap(pub(crate) [[f64; 3]; 2]);

impl PlaneMap {
    /// The one that gives `uv` at the corners of a triangle of the picture. Not finite if that is flat, and then never looked at.
    pub(crate) fn of_triangle(corners: [[f64; 3]; 3], uv: [[f64; 2]; 3]) -> PlaneMap {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        PlaneMap(std::array::from_fn(|k| {
            let (p, q) = (uv[1][k] - uv[0][k], uv[2][k] - uv[0][k]);
            let dx = (p * (c[1] - a[1]) - q * (b[1] - a[1])) / area;
            let dy = (q * (b[0] - a[0]) - p * (c[0] - a[0])) / area;
            [dx, dy, uv[0][k] - dx * a[0] - dy * a[1]]
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_determines_the_map() {
        let corners = [[10.0, 20.0, 0.3], [40.0, 25.0, 1.0], [15.0, 60.0, 0.0]];
        let uv = [[0.0, 1.0], [3.0, -1.0], [2.0, 2.5]];
        let map = PlaneMap::of_triangle(corners, uv);
        for (corner, expected) in corners.iter().zip(uv) {
            let found = map.0.map(|[dx, dy, at]| dx * corner[0] + dy * corner[1] + at);
            assert!((found[0] - expected[0]).abs() < 1e-12 && (found[1] - expected[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn fields_alternate_and_lines_have_their_colours() {
        const OWN: Rgb = [200, 200, 200];
        let map = PlaneMap([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]);
        let checkers = Pattern { checkers: Some(1.0), iso: None };
        let at = |x: f64, y: f64| checkers.paint(OWN, &map, x, y, 1.0);
        assert!(at(5.0, 5.0) == OWN && at(15.0, 5.0) != OWN && at(15.0, 15.0) == OWN && at(-5.0, 5.0) != OWN);
        let lines = Pattern { checkers: None, iso: Some(1.0) };
        let at = |x: f64, y: f64| lines.paint(OWN, &map, x, y, 1.0);
        assert_eq!((at(10.3, 5.0), at(5.0, 9.7), at(5.0, 5.0), at(8.0, 5.0)), (ISO_U, ISO_V, OWN, OWN));
        assert!(
            Pattern { iso: Some(0.0), checkers: None }.check().is_err() && Pattern { checkers: Some(f64::NAN), iso: None }.check().is_err()
        );
        assert_eq!(chart_extent(&[[0.0, 1.0], [2.0, -4.0]]), 5.0);
        assert_eq!(chart_extent(&[]), 0.0);
    }
}
