//! LU: solutions by substitution back, and refusals.

use super::*;
use sprs::TriMatI;

#[test]
fn solutions_satisfy_the_equations() {
    for n in [1usize, 2, 7, 300] {
        let mut entries = TriMatI::<f64, u32>::new((n, n));
        for i in 0..n {
            entries.add_triplet(i, i, 2.0);
            if n > 1 {
                entries.add_triplet(i, (i + 1) % n, -1.5);
                entries.add_triplet((i * 5 + 1) % n, i, 0.25);
            }
        }
        let matrix: RealMatrix = entries.to_csc();
        let factor = RealLu::new(&matrix).unwrap();
        assert!(factor.backward_error() < 1e-13);
        let b: Vec<f64> = (0..n).map(|i| (i as f64 * 1.7).sin()).collect();
        let mut x = b.clone();
        factor.solve_in_place(&mut x, 1);
        let mut residual = b;
        for (a, (i, j)) in &matrix {
            residual[i as usize] -= a * x[j as usize];
        }
        assert!(residual.iter().all(|r| r.abs() < 1e-11));
    }
}

#[test]
fn a_singular_matrix_is_refused() {
    // Structurally singular: an empty column. Numerically singular: equal rows.
    let mut empty = TriMatI::<f64, u32>::new((3, 3));
    [(0, 0), (1, 0), (2, 2)].into_iter().for_each(|(i, j)| empty.add_triplet(i, j, 1.0));
    assert!(RealLu::new(&empty.to_csc()).is_err());
    let mut equal = TriMatI::<f64, u32>::new((3, 3));
    (0..9).for_each(|k| equal.add_triplet(k / 3, k % 3, [1.0, 2.0, 3.0][k % 3]));
    assert!(RealLu::new(&equal.to_csc()).is_err());
}
