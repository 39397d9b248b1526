//! Triangles and thick lines into a z-buffer, several samples a pixel, one band of rows after another.

use crate::colour::{Rgb, mix};
use crate::image::Image;

/// Samples held at one time; larger pictures are drawn in bands.
const BAND_SAMPLES: usize = 24_000_000;

/// A band of the picture at sample resolution.
pub(crate) struct Band {
    width: usize,
    first_row: usize,
    rows: usize,
    depth: Vec<f32>,
    colour: Vec<Rgb>,
}

/// How the edges of a triangle are inked: half their width in samples, and how strongly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EdgeInk {
    pub(crate) half_width: f64,
    pub(crate) colour: Rgb,
    pub(crate) strength: f64,
    /// Whether the edge opposite each corner is drawn.
    pub(crate) sides: [bool; 3],
}

/// Draws a picture of `image`'s size with `samples` samples a pixel along each axis: `draw` is called for every band, in sample
/// coordinates, and the bands are averaged into the image.
pub(crate) fn supersampled(image: &mut Image, samples: u32, background: Rgb, mut draw: impl FnMut(&mut Band)) {
    let s = samples as usize;
    let width = image.width as usize * s;
    let pixel_rows = (BAND_SAMPLES / (width * s)).clamp(1, image.height as usize);
    let size = width * pixel_rows * s;
    let mut band = Band { width, first_row: 0, rows: 0, depth: vec![0.0; size], colour: vec![background; size] };
    for top in (0..image.height as usize).step_by(pixel_rows) {
        band.first_row = top * s;
        band.rows = pixel_rows.min(image.height as usize - top) * s;
        band.depth.fill(f32::NEG_INFINITY);
        band.colour.fill(background);
        draw(&mut band);
        band.average(image, top, s);
    }
}

impl Band {
    fn average(&self, image: &mut Image, top: usize, s: usize) {
        let across = image.width as usize;
        for (y, row) in image.pixels[top * across..(top + self.rows / s) * across].chunks_exact_mut(across).enumerate() {
            for (x, pixel) in row.iter_mut().enumerate() {
                let mut sum = [0u32; 3];
                for j in 0..s {
                    let from = (y * s + j) * self.width + x * s;
                    for sample in &self.colour[from..from + s] {
                        (0..3).for_each(|k| sum[k] += u32::from(sample[k]));
                    }
                }
                let count = (s * s) as u32;
                *pixel = sum.map(|c| ((c + count / 2) / count) as u8);
            }
        }
    }

    /// Range of sample rows of this band between two heights, and of columns between two widths.
    fn window(&self, low: [f64; 2], high: [f64; 2]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let clip = |low: f64, high: f64, first: usize, count: usize| {
            let from = (low - 0.5).ceil().clamp(first as f64, (first + count) as f64) as usize;
            let to = ((high - 0.5).floor() + 1.0).clamp(first as f64, (first + count) as f64) as usize;
            from..to.max(from)
        };
        (clip(low[1], high[1], self.first_row, self.rows), clip(low[0], high[0], 0, self.width))
    }

    /// A triangle of corners `(x, y, nearness)`, either way round; `paint` gives the colour at a sample.
    pub(crate) fn triangle(&mut self, corners: [[f64; 3]; 3], ink: Option<EdgeInk>, paint: impl Fn(f64, f64) -> Rgb) {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let low = std::array::from_fn(|k| a[k].min(b[k]).min(c[k]));
        let high = std::array::from_fn(|k| a[k].max(b[k]).max(c[k]));
        let (rows, columns) = self.window(low, high);
        // Barycentric coordinates as planes over the picture, and the height of the triangle over each edge.
        let mut planes = [[0.0; 3]; 3];
        let mut heights = [0.0; 3];
        for k in 0..3 {
            let (p, q) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let (dx, dy) = ((p[1] - q[1]) / area, (q[0] - p[0]) / area);
            planes[k] = [dx, dy, -(dx * p[0] + dy * p[1])];
            heights[k] = 1.0 / dx.hypot(dy);
        }
        for row in rows {
            let y = row as f64 + 0.5;
            for column in columns.clone() {
                let x = column as f64 + 0.5;
                let weights = planes.map(|[dx, dy, at]| dx * x + dy * y + at);
                if weights.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let near = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) as f32;
                let at = (row - self.first_row) * self.width + column;
                if near <= self.depth[at] {
                    continue;
                }
                self.depth[at] = near;
                self.colour[at] = paint(x, y);
                if let Some(ink) = ink
                    && (0..3).any(|k| ink.sides[k] && weights[k] * heights[k] < ink.half_width)
                {
                    self.colour[at] = mix(self.colour[at], ink.colour, ink.strength);
                }
            }
        }
    }

    /// A line with round ends between two points `(x, y, nearness)`, `bias` nearer than it is.
    pub(crate) fn line(&mut self, from: [f64; 3], to: [f64; 3], half_width: f64, bias: f64, colour: Rgb) {
        let low = std::array::from_fn(|k| from[k].min(to[k]) - half_width);
        let high = std::array::from_fn(|k| from[k].max(to[k]) + half_width);
        let (rows, columns) = self.window(low, high);
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0] * along[0] + along[1] * along[1];
        for row in rows {
            for column in columns.clone() {
                let offset = [column as f64 + 0.5 - from[0], row as f64 + 0.5 - from[1]];
                let t = if length > 0.0 { ((offset[0] * along[0] + offset[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
                if (offset[0] - t * along[0]).hypot(offset[1] - t * along[1]) > half_width {
                    continue;
                }
                let near = (from[2] + t * (to[2] - from[2]) + bias) as f32;
                let at = (row - self.first_row) * self.width + column;
                if near > self.depth[at] {
                    self.depth[at] = near;
                    self.colour[at] = colour;
                }
            }
        }
    }
}
