//! What all factorizations share: the view of a matrix that faer takes and the check of one solve.

use crate::{BACKWARD_ERROR_LIMIT, Complex, SolveError};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::traits::ComplexField;
use sprs::CsMatI;
use std::ops::{Add, Mul, Sub, SubAssign};

/// The two number types of the crate.
pub(crate) trait Scalar:
    ComplexField + Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + SubAssign + 'static
{
    fn real(x: f64) -> Self;
    fn conjugate(self) -> Self;
    fn magnitude(self) -> f64;
}

impl Scalar for f64 {
    fn real(x: f64) -> Self {
        x
    }
    fn conjugate(self) -> Self {
        self
    }
    fn magnitude(self) -> f64 {
        self.abs()
    }
}

impl Scalar for Complex {
    fn real(x: f64) -> Self {
        Complex::new(x, 0.0)
    }
    fn conjugate(self) -> Self {
        self.conj()
    }
    fn magnitude(self) -> f64 {
        self.norm()
    }
}

/// Which entries of a matrix stand for it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stored {
    /// All of them.
    Full,
    /// Those with row <= column; the rest follows by (conjugate) symmetry.
    UpperTriangle,
}

/// The same matrix for faer; nothing is copied. `starts` is `matrix.proper_indptr()`.
pub(crate) fn view<'a, T: Scalar>(matrix: &'a CsMatI<T, u32>, starts: &'a [u32]) -> Result<SparseColMatRef<'a, u32, T>, SolveError> {
    let (rows, columns) = (matrix.rows(), matrix.cols());
    if rows != columns || !matrix.is_csc() || rows >= i32::MAX as usize {
        return Err(SolveError::Shape { rows, columns });
    }
    let symbolic = SymbolicSparseColMatRef::new_checked(rows, columns, starts, None, matrix.indices());
    Ok(SparseColMatRef::new(symbolic, matrix.data()))
}

/// Normwise backward error of `x` as a solution of `A x = b`, in maximum norms; NaN if anything is not finite.
fn backward_error<T: Scalar>(matrix: SparseColMatRef<'_, u32, T>, stored: Stored, x: &[T], b: &[T]) -> f64 {
    let mut residual = b.to_vec();
    let mut row_sums = vec![0.0f64; b.len()];
    for j in 0..matrix.ncols() {
        for (i, &a) in matrix.row_idx_of_col(j).zip(matrix.val_of_col(j)) {
            let off_diagonal = i != j;
            if stored == Stored::UpperTriangle && i > j {
                continue;
            }
            residual[i] -= a * x[j];
            row_sums[i] += a.magnitude();
            if stored == Stored::UpperTriangle && off_diagonal {
                residual[j] -= a.conjugate() * x[i];
                row_sums[j] += a.magnitude();
            }
        }
    }
    let largest = |values: &[T]| values.iter().map(|v| v.magnitude()).fold(0.0, |m: f64, v| if v.is_nan() { v } else { m.max(v) });
    if residual.iter().any(|r| !r.magnitude().is_finite()) {
        return f64::NAN;
    }
    let scale = row_sums.iter().fold(0.0f64, |m, &v| m.max(v)) * largest(x) + largest(b);
    if scale > 0.0 { largest(&residual) / scale } else { 0.0 }
}

/// Solves for one fixed right-hand side with values in [-1, 1] and refuses the factorization if the answer is wrong.
pub(crate) fn check_solve<T: Scalar>(
    matrix: SparseColMatRef<'_, u32, T>,
    stored: Stored,
    solve: impl FnOnce(&mut [T]),
) -> Result<f64, SolveError> {
    let b: Vec<T> =
        (0..matrix.ncols() as u32).map(|i| T::real(f64::from(i.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 23) - 1.0)).collect();
    let mut x = b.clone();
    solve(&mut x);
    let error = backward_error(matrix, stored, &x, &b);
    if error <= BACKWARD_ERROR_LIMIT { Ok(error) } else { Err(SolveError::Inaccurate { error, limit: BACKWARD_ERROR_LIMIT }) }
}
