//! The picture type, its PNG encoding, and the few drawing primitives plots need.

use crate::colour::{Rgb, mix};
use crate::error::{RenderError, Result};

/// Most pixels along a side of an image.
pub const MAX_SIDE: u32 = 8192;

/// An RGB picture of 8 bits a channel, sRGB, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height` pixels, row by row from the top left.
    pub pixels: Vec<Rgb>,
}

impl Image {
    /// An image of one colour.
    ///
    /// # Errors
    /// [`RenderError::ImageSize`] for a side of 0 or above [`MAX_SIDE`].
    pub fn filled(width: u32, height: u32, colour: Rgb) -> Result<Image> {
        check_size(width, height)?;
        Ok(Image { width, height, pixels: vec![colour; width as usize * height as usize] })
    }

    /// The pixel `x` from the left and `y` from the top; `None` outside.
    pub fn pixel(&self, x: u32, y: u32) -> Option<Rgb> {
        let inside = x < self.width && y < self.height;
        if inside { self.pixels.get(y as usize * self.width as usize + x as usize).copied() } else { None }
    }

    /// Mixes a colour into a pixel; outside nothing happens.
    pub(crate) fn blend(&mut self, x: i64, y: i64, colour: Rgb, share: f64) {
        if (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y) {
            let at = y as usize * self.width as usize + x as usize;
            self.pixels[at] = mix(self.pixels[at], colour, share);
        }
    }

    /// Fills the rectangle between two corners, its edges anti-aliased.
    pub(crate) fn rectangle(&mut self, low: [f64; 2], high: [f64; 2], colour: Rgb) {
        let covered = |k: i64, from: f64, to: f64| ((k + 1) as f64).min(to) - (k as f64).max(from);
        for y in low[1].floor() as i64..high[1].ceil() as i64 {
            for x in low[0].floor() as i64..high[0].ceil() as i64 {
                let share = covered(x, low[0], high[0]).max(0.0) * covered(y, low[1], high[1]).max(0.0);
                self.blend(x, y, colour, share);
            }
        }
    }

    /// Copies another image with its top left corner at `(x, y)`, clipped.
    pub(crate) fn paste(&mut self, from: &Image, x: u32, y: u32) {
        for row in 0..from.height.min(self.height.saturating_sub(y)) {
            let count = from.width.min(self.width.saturating_sub(x)) as usize;
            let (to, source) = (((y + row) * self.width + x) as usize, (row * from.width) as usize);
            self.pixels[to..to + count].copy_from_slice(&from.pixels[source..source + count]);
        }
    }
}

pub(crate) fn check_size(width: u32, height: u32) -> Result<()> {
    let fits = |side: u32| (1..=MAX_SIDE).contains(&side);
    if fits(width) && fits(height) { Ok(()) } else { Err(RenderError::ImageSize { width, height }) }
}

/// Encodes an image as PNG (8-bit RGB).
///
/// # Errors
/// [`RenderError::ImageSize`] and [`RenderError::LengthMismatch`] if the fields of the image contradict each other,
/// [`RenderError::Png`] from the encoder.
pub fn encode_png(image: &Image) -> Result<Vec<u8>> {
    check_size(image.width, image.height)?;
    let expected = image.width as usize * image.height as usize;
    if image.pixels.len() != expected {
        return Err(RenderError::LengthMismatch { what: "pixels", found: image.pixels.len(), expected });
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}
