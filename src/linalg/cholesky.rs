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
use std::sync::Arc;

/// What depends on the pattern of a matrix alone: elimination order and structure of the factor. Shared by all matrices of it.
#[derive(Debug)]
pub struct CholeskyPlan {
    symbolic: SymbolicCholesky<u32>,
    entries: usize,
}

impl CholeskyPlan {
    /// Analyses the pattern of `matrix` (entries with row <= column; values do not matter).
    ///
    /// # Errors
    /// [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(matrix: &RealMatrix) -> Result<Self, SolveError> {
        CholeskyPlan::of(matrix)
    }

    fn of<T: Scalar>(matrix: &CsMatI<T, u32>) -> Result<Self, SolveError> {
        let starts = matrix.proper_indptr();
        let a = view(matrix, &starts)?;
        let params = CholeskySymbolicParams { supernodal_flop_ratio_threshold: SupernodalThreshold::AUTO, ..Default::default() };
        let symbolic = factorize_symbolic_cholesky(a.symbolic(), Side::Upper, SymmetricOrdering::Amd, params)
            .map_err(|e| SolveError::Resources(e.to_string()))?;
        Ok(CholeskyPlan { symbolic, entries: matrix.nnz() })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let indices = match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => s.row_idx().len() + s.col_ptr().len(),
            SymbolicCholeskyRaw::Supernodal(s) => {
                s.row_idx().len() + 2 * s.supernode_begin().len() + s.col_ptr_for_row_idx().len() + s.col_ptr_for_val().len()
            }
        };
        4 * (indices + 2 * self.symbolic.ncols())
    }
}

#[derive(Debug)]
struct Factor<T> {
    plan: Arc<CholeskyPlan>,
    values: Vec<T>,
    error: f64,
}

impl<T: Scalar> Factor<T> {
    fn new(matrix: &CsMatI<T, u32>) -> Result<Self, SolveError> {
        Factor::with_plan(Arc::new(CholeskyPlan::of(matrix)?), matrix)
    }

    fn with_plan(plan: Arc<CholeskyPlan>, matrix: &CsMatI<T, u32>) -> Result<Self, SolveError> {
        let starts = matrix.proper_indptr();
        let a = view(matrix, &starts)?;
        let size = a.ncols();
        if matrix.nnz() != plan.entries || size != plan.symbolic.ncols() {
            return Err(SolveError::Shape { rows: matrix.rows(), columns: size });
        }
        let symbolic = &plan.symbolic;
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
        let mut factor = Factor { plan, values, error: 0.0 };
        factor.error = check_solve(a, Stored::UpperTriangle, |x| factor.solve(x, 1))?;
        Ok(factor)
    }

    fn solve(&self, rhs: &mut [T], columns: usize) {
        let size = self.plan.symbolic.ncols();
        assert_eq!(rhs.len(), size * columns, "the right-hand side does not fit the factor");
        if size == 0 {
            return;
        }
        let mut buffer = MemBuffer::new(self.plan.symbolic.solve_in_place_scratch::<T>(columns, Par::Seq));
        let rhs = MatMut::from_column_major_slice_mut(rhs, size, columns);
        LltRef::new(&self.plan.symbolic, &self.values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut buffer));
    }

    fn bytes(&self) -> usize {
        self.values.len() * size_of::<T>() + self.plan.bytes()
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

    /// As [`HermitianCholesky::new`] for a matrix of the pattern that `plan` was made for.
    ///
    /// # Errors
    /// As [`HermitianCholesky::new`]; [`SolveError::Shape`] also for another pattern.
    pub fn with_plan(plan: Arc<CholeskyPlan>, matrix: &ComplexMatrix) -> Result<Self, SolveError> {
        Factor::with_plan(plan, matrix).map(HermitianCholesky)
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
