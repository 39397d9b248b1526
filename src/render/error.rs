//! What can go wrong when drawing.

/// Result of every drawing function.
pub type Result<T> = std::result::Result<T, RenderError>;

/// Why nothing was drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There is no triangle, value or image to draw.
    #[error("nothing to draw: {what} is empty")]
    Empty {
        /// The empty input.
        what: &'static str,
    },
    /// A number is NaN or infinite.
    #[error("{what} {index} is not finite")]
    NonFinite {
        /// What the number belongs to.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
    },
    /// A triangle or an edge names a vertex that does not exist.
    #[error("{what} {index} names a vertex that does not exist")]
    IndexOutOfRange {
        /// Triangle or edge.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
    },
    /// An array has the wrong length.
    #[error("{what} has {found} entries, {expected} are needed")]
    LengthMismatch {
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits.
        expected: usize,
    },
    /// The image would be empty or larger than [`crate::MAX_SIDE`] pixels along a side.
    #[error("an image of {width} x {height} pixels cannot be drawn (1 to {} along each side)", crate::MAX_SIDE)]
    ImageSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A parameter is out of range.
    #[error("{what} is out of range: {value}")]
    BadParameter {
        /// The parameter.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The PNG encoder failed.
    #[error("PNG encoding failed")]
    Png(#[from] png::EncodingError),
}
