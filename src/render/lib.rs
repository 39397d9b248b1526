//! A small CPU rasteriser: surfaces, charts and quality histograms to PNG, without a display and without the engine.
//!
//! Everything takes plain arrays and gives an [`Image`]; [`encode_png`] turns one into bytes. Nothing here reads the clock, the
//! environment or a font file: the same input gives the same pixels.
//!
//! ```
//! use remesh_render::{Scene, View, encode_png, render_surface};
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let image = render_surface(&Scene::new(&positions, &[[0, 1, 2]]), &View::default())?;
//! assert!(!encode_png(&image)?.is_empty());
//! # Ok::<(), remesh_render::RenderError>(())
//! ```

mod chart;
mod colour;
mod compose;
mod error;
mod histogram;
mod image;
mod pattern;
mod raster;
mod surface;
mod text;

pub use chart::{Chart, render_chart};
pub use colour::{FLIPPED, Rgb, categorical, quality_colour};
pub use compose::side_by_side;
pub use error::{RenderError, Result};
pub use histogram::{Histogram, Series, render_histogram};
pub use image::{Image, MAX_SIDE, encode_png};
pub use pattern::{ISO_U, ISO_V, Pattern, chart_extent};
pub use surface::{FaceColours, Legend, LineStyle, Scene, SurfacePattern, UpAxis, View, render_surface};

#[cfg(test)]
mod tests;
