//! Dense Cholesky factorizations of real symmetric and complex Hermitian positive definite matrices, for boundary problems.

use crate::check::Scalar;
use crate::{Complex, SolveError};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltParams, LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::cholesky::llt::solve::solve_in_place_with_conj;
use faer::{Conj, MatMut, MatRef, Par, Spec};

#[derive(Debug)]
struct Factor<T> {
    size: usize,
    /// Columns of L; above the diagonal whatever was there.
    values: Vec<T>,
}

impl<T: Scalar> Factor<T> {
    fn new(mut values: Vec<T>, size: usize) -> Result<Self, SolveError> {
        if values.len() != size * size {
            return Err(SolveError::Shape { rows: values.len() / size.max(1), columns: size });
        }
        let params: Spec<LltParams, T> = Spec::default();
        let mut buffer = MemBuffer::try_new(cholesky_in_place_scratch::<T>(size, Par::Seq, params))
            .map_err(|_| SolveError::Resources("work space".to_owned()))?;
        let matrix = MatMut::from_column_major_slice_mut(&mut values, size, size);
        cholesky_in_place(matrix, LltRegularization::default(), Par::Seq, MemStack::new(&mut buffer), params)
            .map_err(|LltError::NonPositivePivot { index }| SolveError::NotPositiveDefinite { index, size })?;
        if (0..size).any(|k| !values[k * size + k].magnitude().is_finite()) {
            return Err(SolveError::Inaccurate { error: f64::NAN, limit: crate::BACKWARD_ERROR_LIMIT });
        }
        Ok(Factor { size, values })
    }

    fn solve(&self, rhs: &mut [T], columns: usize) {
        assert_eq!(rhs.len(), self.size * columns, "the right-hand side does not fit the factor");
        if rhs.is_empty() {
            return;
        }
        let factor = MatRef::from_column_major_slice(&self.values, self.size, self.size);
        let rhs = MatMut::from_column_major_slice_mut(rhs, self.size, columns);
        solve_in_place_with_conj(factor, Conj::No, rhs, Par::Seq, MemStack::new(&mut MemBuffer::new(Default::default())));
    }
}

/// Dense factor of a real symmetric positive definite matrix.
#[derive(Debug)]
pub struct DenseReal(Factor<f64>);

/// Dense factor of a complex Hermitian positive definite matrix.
#[derive(Debug)]
pub struct DenseHermitian(Factor<Complex>);

impl DenseReal {
    /// Factorizes the matrix of `size` columns, one after another; only entries with row >= column are read. O(size^3).
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`], [`SolveError::Inaccurate`] (not finite), [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(values: Vec<f64>, size: usize) -> Result<Self, SolveError> {
        Factor::new(values, size).map(DenseReal)
    }

    /// Replaces the `columns` right-hand sides in `rhs` (one after another) by the solutions. O(size^2) for each.
    ///
    /// # Panics
    /// If the length of `rhs` is not `columns` times the size.
    pub fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        self.0.solve(rhs, columns);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.0.values.len() * size_of::<f64>()
    }
}

impl DenseHermitian {
    /// As [`DenseReal::new`].
    ///
    /// # Errors
    /// As [`DenseReal::new`].
    pub fn new(values: Vec<Complex>, size: usize) -> Result<Self, SolveError> {
        Factor::new(values, size).map(DenseHermitian)
    }

    /// As [`DenseReal::solve_in_place`].
    ///
    /// # Panics
    /// If the length of `rhs` is not `columns` times the size.
    pub fn solve_in_place(&self, rhs: &mut [Complex], columns: usize) {
        self.0.solve(rhs, columns);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.0.values.len() * size_of::<Complex>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_satisfy_the_system() {
        for size in [1usize, 2, 7, 40, 131] {
            let entry = |i: usize, j: usize| {
                let (low, high) = (i.min(j), i.max(j));
                let im = if i == j { 0.0 } else { ((low * 3 + high) % 7) as f64 - 3.0 };
                Complex::new(((low + 2 * high) % 5) as f64 - 2.0, if i < j { im } else { -im })
            };
            let diagonal = 8.0 * size as f64;
            let at = |i: usize, j: usize| if i == j { Complex::new(diagonal, 0.0) } else { entry(i, j) };
            let values: Vec<Complex> = (0..size * size).map(|k| at(k % size, k / size)).collect();
            let factor = DenseHermitian::new(values, size).unwrap();
            let b: Vec<Complex> = (0..2 * size).map(|k| Complex::new((k as f64).sin(), (k as f64).cos())).collect();
            let mut x = b.clone();
            factor.solve_in_place(&mut x, 2);
            for c in 0..2 {
                for i in 0..size {
                    let row: Complex = (0..size).map(|j| at(i, j) * x[c * size + j]).sum();
                    assert!((row - b[c * size + i]).norm() < 1e-12, "{size}");
                }
            }
            let real: Vec<f64> = (0..size * size).map(|k| at(k % size, k / size).re).collect();
            let mut y: Vec<f64> = (0..size).map(|k| k as f64).collect();
            DenseReal::new(real.clone(), size).unwrap().solve_in_place(&mut y, 1);
            for i in 0..size {
                let row: f64 = (0..size).map(|j| real[j * size + i] * y[j]).sum();
                assert!((row - i as f64).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(matches!(DenseReal::new(vec![1.0, 2.0, 2.0, 1.0], 2), Err(SolveError::NotPositiveDefinite { index: 1, size: 2 })));
        assert!(DenseReal::new(vec![f64::NAN, 0.0, 0.0, 1.0], 2).is_err());
        assert!(matches!(DenseReal::new(vec![1.0; 3], 2), Err(SolveError::Shape { .. })));
    }
}
