//! Cholesky factorizations L L^H of real symmetric and complex Hermitian positive definite matrices:
//! approximate minimum degree ordering, supernodal where that pays.

use crate::check::{Scalar, Stored, check_solve, view};
use crate::{Complex, ComplexMatrix, RealMatrix, SolveError};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};
use sprs::CsMatI;

#[derive(Debug)]
struct Factor<T> {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<T>,
    error: f64,
}

impl<T: Scalar> Factor<T> {
    fn new(matrix: &CsMatI<T, u32>) -> Result<Self, SolveError> {
        let starts = matrix.proper_indptr();
        let a = view(matrix, &starts)?;
        let size = a.ncols();
        let params = CholeskySymbolicParams { supernodal_flop_ratio_threshold: SupernodalThreshold::AUTO, ..Default::default() };
        let symbolic = factorize_symbolic_cholesky(a.symbolic(), Side::Upper, SymmetricOrdering::Amd, params)
            .map_err(|e| SolveError::Resources(e.to_string()))?;
        let mut values = Vec::new();
        let refuse = |_| SolveError::Resources(format!("{} values", symbolic.len_val()));
        values.try_reserve_exact(symbolic.len_val()).map_err(refuse)?;
        values.resize(symbolic.len_val(), T::real(0.0));
        let mut buffer = MemBuffer::try_new(symbolic.factorize_numeric_llt_scratch::<T>(Par::Seq, Default::default()))
            .map_err(|_| SolveError::Resources("work space".to_owned()))?;
        let stack = MemStack::new(&mut buffer);
        symbolic
            .factorize_numeric_llt(&mut values, a, Side::Upper, LltRegularization::default(), Par::Seq, stack, Default::default())
            .map_err(|LltError::NonPositivePivot { index }| SolveError::NotPositiveDefinite { index, size })?;
        let mut factor = Factor { symbolic, values, error: 0.0 };
        factor.error = check_solve(a, Stored::UpperTriangle, |x| factor.solve(x, 1))?;
        Ok(factor)
    }

    fn solve(&self, rhs: &mut [T], columns: usize) {
        let size = self.symbolic.ncols();
        assert_eq!(rhs.len(), size * columns, "the right-hand side does not fit the factor");
        if size == 0 {
            return;
        }
        let mut buffer = MemBuffer::new(self.symbolic.solve_in_place_scratch::<T>(columns, Par::Seq));
        let rhs = MatMut::from_column_major_slice_mut(rhs, size, columns);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut buffer));
    }

    fn bytes(&self) -> usize {
        let indices = match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => s.row_idx().len() + s.col_ptr().len(),
            SymbolicCholeskyRaw::Supernodal(s) => {
                s.row_idx().len() + 2 * s.supernode_begin().len() + s.col_ptr_for_row_idx().len() + s.col_ptr_for_val().len()
            }
        };
        self.values.len() * size_of::<T>() + 4 * (indices + 2 * self.symbolic.ncols())
    }
}

/// Factor of a real symmetric positive definite matrix.
#[derive(Debug)]
pub struct RealCholesky(Factor<f64>);

impl RealCholesky {
    /// Factorizes `matrix`; only entries with row <= column are read.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`], [`SolveError::Inaccurate`], [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(matrix: &RealMatrix) -> Result<Self, SolveError> {
        Factor::new(matrix).map(RealCholesky)
    }

    /// Replaces the `columns` right-hand sides in `rhs` (one after another) by the solutions.
    ///
    /// # Panics
    /// If the length of `rhs` is not `columns` times the size of the matrix.
    pub fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        self.0.solve(rhs, columns);
    }

    /// Backward error of the check solve.
    pub fn backward_error(&self) -> f64 {
        self.0.error
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.0.bytes()
    }
}

/// Factor of a complex Hermitian positive definite matrix.
#[derive(Debug)]
pub struct HermitianCholesky(Factor<Complex>);

impl HermitianCholesky {
    /// Factorizes `matrix`; only entries with row <= column are read.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`], [`SolveError::Inaccurate`], [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(matrix: &ComplexMatrix) -> Result<Self, SolveError> {
        Factor::new(matrix).map(HermitianCholesky)
    }

    /// Replaces the `columns` right-hand sides in `rhs` (one after another) by the solutions.
    ///
    /// # Panics
    /// If the length of `rhs` is not `columns` times the size of the matrix.
    pub fn solve_in_place(&self, rhs: &mut [Complex], columns: usize) {
        self.0.solve(rhs, columns);
    }

    /// Backward error of the check solve.
    pub fn backward_error(&self) -> f64 {
        self.0.error
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.0.bytes()
    }
}

#[cfg(test)]
mod tests;
