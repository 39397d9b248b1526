//! Pictures side by side, with captions.

use crate::colour::{INK, WHITE};
use crate::error::{RenderError, Result};
use crate::image::Image;
use crate::text::{Anchor, Font};

/// Pixels between neighbours.
const GAP: u32 = 12;

/// Puts images in a row, tops aligned, a caption (if given) above each. `captions` is empty or has one line an image.
///
/// # Errors
/// [`RenderError::Empty`] for no image, [`RenderError::LengthMismatch`] for captions that do not fit the images,
/// [`RenderError::ImageSize`] if the row gets larger than [`crate::MAX_SIDE`].
pub fn side_by_side(images: &[Image], captions: &[&str]) -> Result<Image> {
    let tallest = images.iter().map(|i| i.height).max().ok_or(RenderError::Empty { what: "row of images" })?;
    if !captions.is_empty() && captions.len() != images.len() {
        return Err(RenderError::LengthMismatch { what: "captions", found: captions.len(), expected: images.len() });
    }
    let font = Font::plain(images[0].width.max(tallest)).bold();
    let top = if captions.is_empty() { 0 } else { font.line() + 8 };
    let width = images.iter().fold(0u32, |sum, i| sum.saturating_add(i.width)).saturating_add(GAP * (images.len() as u32 - 1));
    let mut row = Image::filled(width, tallest.saturating_add(top), WHITE)?;
    let mut left = 0;
    for (k, image) in images.iter().enumerate() {
        row.paste(image, left, top);
        if let Some(caption) = captions.get(k) {
            font.draw(&mut row, caption, f64::from(left) + 0.5 * f64::from(image.width), 6.0, Anchor::Middle, INK);
        }
        left += image.width + GAP;
    }
    Ok(row)
}
