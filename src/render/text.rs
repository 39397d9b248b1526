//! Text in images: anti-aliased glyphs of fixed width.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::colour::Rgb;
use crate::image::Image;

/// Sizes text comes in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Font {
    height: RasterHeight,
    weight: FontWeight,
}

/// Where a point lies on the text drawn at it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Left,
    Middle,
    Right,
}

impl Font {
    /// The plain font that suits an image of this many pixels along its longer side.
    pub(crate) fn plain(longer_side: u32) -> Font {
        let height = match longer_side {
            0..=900 => RasterHeight::Size16,
            901..=1400 => RasterHeight::Size20,
            1401..=2200 => RasterHeight::Size24,
            _ => RasterHeight::Size32,
        };
        Font { height, weight: FontWeight::Regular }
    }

    /// The bold font of the same size.
    pub(crate) fn bold(self) -> Font {
        Font { weight: FontWeight::Bold, ..self }
    }

    /// Pixels from the top of a line to the top of the next.
    pub(crate) fn line(self) -> u32 {
        self.height.val() as u32 + 4
    }

    /// Pixels a text takes across.
    pub(crate) fn width(self, text: &str) -> u32 {
        (text.chars().count() * get_raster_width(self.weight, self.height)) as u32
    }

    /// Draws one line with its top at `y`; characters without a glyph show as `?`.
    pub(crate) fn draw(self, image: &mut Image, text: &str, x: f64, y: f64, anchor: Anchor, colour: Rgb) {
        let width = f64::from(self.width(text));
        let left = match anchor {
            Anchor::Left => x,
            Anchor::Middle => x - 0.5 * width,
            Anchor::Right => x - width,
        };
        let mut at = left.round() as i64;
        for c in text.chars() {
            let glyph = get_raster(c, self.weight, self.height).or_else(|| get_raster('?', self.weight, self.height));
            let Some(glyph) = glyph else { continue };
            for (row, line) in glyph.rows().enumerate() {
                for (column, &share) in line.iter().enumerate() {
                    if share > 0 {
                        image.blend(at + column as i64, y.round() as i64 + row as i64, colour, f64::from(share) / 255.0);
                    }
                }
            }
            at += glyph.width() as i64;
        }
    }
}
