//! Cholesky against dense arithmetic, and refusals.

use super::*;
use sprs::TriMatI;

/// Dense Gaussian elimination without pivoting is stable for positive definite matrices.
fn dense_solve<T: Scalar + std::ops::Div<Output = T>>(mut a: Vec<Vec<T>>, mut b: Vec<T>) -> Vec<T> {
    let n = b.len();
    for k in 0..n {
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                let above = a[k][j];
                a[i][j] -= factor * above;
            }
            let above = b[k];
            b[i] -= factor * above;
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            let known = b[j];
            b[k] -= a[k][j] * known;
        }
        let solved = b[k] / a[k][k];
        b[k] = solved;
    }
    b
}

fn grid_edges(side: usize) -> Vec<(usize, usize)> {
    let right = (0..side * side).filter(|v| v % side + 1 < side).map(|v| (v, v + 1));
    let up = (0..side * (side - 1)).map(|v| (v, v + side));
    right.chain(up).collect()
}

#[test]
fn real_grid_laplacian_agrees_with_dense_elimination() {
    for side in [1, 2, 5, 13] {
        let n = side * side;
        let mut dense = vec![vec![0.0; n]; n];
        for (i, j) in grid_edges(side) {
            let w = 1.0 + ((i * 7 + j) % 5) as f64;
            dense[i][i] += w;
            dense[j][j] += w;
            dense[i][j] -= w;
            dense[j][i] -= w;
        }
        (0..n).for_each(|i| dense[i][i] += 0.1);
        let mut entries = TriMatI::<f64, u32>::new((n, n));
        for j in 0..n {
            (0..=j).filter(|&i| dense[i][j] != 0.0).for_each(|i| entries.add_triplet(i, j, dense[i][j]));
        }
        let factor = RealCholesky::new(&entries.to_csc()).unwrap();
        assert!(factor.backward_error() < 1e-14 && factor.bytes() >= 8 * n);
        let b: Vec<f64> = (0..2 * n).map(|i| (i as f64).sin()).collect();
        let mut x = b.clone();
        factor.solve_in_place(&mut x, 2);
        for c in 0..2 {
            let wanted = dense_solve(dense.clone(), b[c * n..(c + 1) * n].to_vec());
            assert!(wanted.iter().zip(&x[c * n..]).all(|(w, x)| (w - x).abs() < 1e-11 * (1.0 + w.abs())));
        }
    }
}

#[test]
fn hermitian_matrix_agrees_with_dense_elimination() {
    let side = 9;
    let n = side * side;
    let zero = Complex::new(0.0, 0.0);
    let mut dense = vec![vec![zero; n]; n];
    for (i, j) in grid_edges(side) {
        let w = Complex::new(-1.0, 0.4 * ((i + 2 * j) as f64).cos());
        dense[i][j] = w;
        dense[j][i] = w.conj();
        dense[i][i] += w.norm();
        dense[j][j] += w.norm();
    }
    (0..n).for_each(|i| dense[i][i] += 0.01);
    let mut entries = TriMatI::<Complex, u32>::new((n, n));
    for j in 0..n {
        (0..=j).filter(|&i| dense[i][j] != zero).for_each(|i| entries.add_triplet(i, j, dense[i][j]));
    }
    let factor = HermitianCholesky::new(&entries.to_csc()).unwrap();
    let b: Vec<Complex> = (0..n).map(|i| Complex::new((i as f64).sin(), (i as f64 * 0.3).cos())).collect();
    let mut x = b.clone();
    factor.solve_in_place(&mut x, 1);
    let wanted = dense_solve(dense, b);
    assert!(wanted.iter().zip(&x).all(|(w, x)| (w - x).norm() < 1e-10 * (1.0 + w.norm())));
}

#[test]
fn an_indefinite_or_oblong_matrix_is_refused() {
    let mut entries = TriMatI::<f64, u32>::new((2, 2));
    [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0)].into_iter().for_each(|(i, j, v)| entries.add_triplet(i, j, v));
    assert!(matches!(RealCholesky::new(&entries.to_csc()).unwrap_err(), SolveError::NotPositiveDefinite { size: 2, .. }));
    let mut entries = TriMatI::<Complex, u32>::new((2, 2));
    [(0, 0, Complex::new(1.0, 0.0)), (0, 1, Complex::new(0.0, 1.5)), (1, 1, Complex::new(1.0, 0.0))]
        .into_iter()
        .for_each(|(i, j, v)| entries.add_triplet(i, j, v));
    assert!(matches!(HermitianCholesky::new(&entries.to_csc()).unwrap_err(), SolveError::NotPositiveDefinite { .. }));
    let oblong = TriMatI::<f64, u32>::new((2, 3)).to_csc();
    assert_eq!(RealCholesky::new(&oblong).unwrap_err(), SolveError::Shape { rows: 2, columns: 3 });
    let mut nan = TriMatI::<f64, u32>::new((1, 1));
    nan.add_triplet(0, 0, f64::NAN);
    assert!(RealCholesky::new(&nan.to_csc()).is_err());
}

#[test]
fn an_empty_matrix_has_an_empty_solution() {
    let factor = RealCholesky::new(&TriMatI::<f64, u32>::new((0, 0)).to_csc()).unwrap();
    factor.solve_in_place(&mut [], 1);
}
