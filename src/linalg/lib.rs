//! Sparse direct solvers for the engine. The only crate that names faer, so that its templates compile once.
//!
//! Matrices come as compressed columns of `sprs` with `u32` indices and are handed to faer without copying. Everything runs on
//! the calling thread: patches are solved in parallel, not the inside of a factorization. Every factorization is checked by the
//! backward error of one solve before it is returned.

mod check;
mod cholesky;
mod condense;
mod dense;
mod lu;
mod order;

pub use cholesky::{CholeskyPlan, HermitianCholesky, RealCholesky};
pub use condense::{Condensation, CondensationPlan, Load};
pub use dense::{DenseHermitian, DenseReal};
pub use faer::c64 as Complex;
pub use lu::RealLu;

/// Real sparse matrix in compressed columns.
pub type RealMatrix = sprs::CsMatI<f64, u32>;
/// Complex sparse matrix in compressed columns.
pub type ComplexMatrix = sprs::CsMatI<Complex, u32>;

/// Largest normwise backward error `|A x - b| / (|A| |x| + |b|)` (maximum norms) a factorization may show in its check solve.
pub const BACKWARD_ERROR_LIMIT: f64 = 1e-10;

/// Why there is no factorization.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The matrix is not square or not stored by columns.
    #[error("the matrix must be square and stored by columns, it is {rows} x {columns}")]
    Shape {
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
    /// A pivot is not positive: the matrix is not positive definite to working precision.
    #[error("pivot {index} of {size} is not positive")]
    NotPositiveDefinite {
        /// The pivot, counted in elimination order.
        index: usize,
        /// Size of the matrix.
        size: usize,
    },
    /// No pivot was found in a column: the matrix is singular.
    #[error("the matrix is singular in column {index}")]
    Singular {
        /// The column.
        index: usize,
    },
    /// The check solve after the factorization was not accurate.
    #[error("backward error {error:e} of the check solve exceeds {limit:e}")]
    Inaccurate {
        /// The backward error found; NaN if the solution was not finite.
        error: f64,
        /// The limit.
        limit: f64,
    },
    /// Not enough memory, or more entries than the index type counts.
    #[error("the factorization does not fit into memory: {0}")]
    Resources(String),
}
