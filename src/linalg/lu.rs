//! LU factorization with partial pivoting of a real matrix without symmetry (mean value maps).

use crate::check::{Stored, check_solve, view};
use crate::{RealMatrix, SolveError};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::linalg::{LuError, SupernodalThreshold};
use faer::{Conj, MatMut, Par};

/// Factor of a real square matrix.
#[derive(Debug)]
pub struct RealLu {
    symbolic: SymbolicLu<u32>,
    numeric: NumericLu<u32, f64>,
    error: f64,
}

impl RealLu {
    /// Factorizes `matrix`. Dear compared with Cholesky: about five times the time and the memory.
    ///
    /// # Errors
    /// [`SolveError::Singular`], [`SolveError::Inaccurate`], [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(matrix: &RealMatrix) -> Result<Self, SolveError> {
        let starts = matrix.proper_indptr();
        let a = view(matrix, &starts)?;
        // The simplicial variant panics on a zero pivot (faer-rs issue 232); the supernodal one gives a solution that is not
        // finite, which the check below sees.
        let params = LuSymbolicParams { supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL, ..Default::default() };
        let symbolic = factorize_symbolic_lu(a.symbolic(), params).map_err(|e| SolveError::Resources(e.to_string()))?;
        let mut numeric = NumericLu::new();
        let mut buffer = MemBuffer::try_new(symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default()))
            .map_err(|_| SolveError::Resources("work space".to_owned()))?;
        symbolic.factorize_numeric_lu(&mut numeric, a, Par::Seq, MemStack::new(&mut buffer), Default::default()).map_err(|e| match e {
            LuError::SymbolicSingular { index } => SolveError::Singular { index },
            LuError::Generic(e) => SolveError::Resources(e.to_string()),
        })?;
        let mut factor = RealLu { symbolic, numeric, error: 0.0 };
        factor.error = check_solve(a, Stored::Full, |x| factor.solve_in_place(x, 1))?;
        Ok(factor)
    }

    /// Replaces the `columns` right-hand sides in `rhs` (one after another) by the solutions.
    ///
    /// # Panics
    /// If the length of `rhs` is not `columns` times the size of the matrix.
    pub fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        let size = self.symbolic.ncols();
        assert_eq!(rhs.len(), size * columns, "the right-hand side does not fit the factor");
        if size == 0 {
            return;
        }
        let mut buffer = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
        let rhs = MatMut::from_column_major_slice_mut(rhs, size, columns);
        let factor = LuRef::new_unchecked(&self.symbolic, &self.numeric);
        factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut buffer));
    }

    /// Bytes held, estimated: the factor does not tell its size. Meshes of 10^3 to 10^5 vertices need about 130 n log2(n) bytes.
    pub fn bytes(&self) -> usize {
        let size = self.symbolic.ncols();
        130 * size * (size + 1).ilog2() as usize
    }

    /// Backward error of the check solve.
    pub fn backward_error(&self) -> f64 {
        self.error
    }
}

#[cfg(test)]
mod tests;
