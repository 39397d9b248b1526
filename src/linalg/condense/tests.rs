//! Condensation against elimination of the whole matrix.

use super::*;
use sprs::TriMatI;

/// Laplacian of a jittered grid, upper triangle; singular (constants).
fn laplacian(side: usize) -> RealMatrix {
    let n = side * side;
    let mut dense = vec![0.0; n];
    let mut entries = TriMatI::<f64, u32>::new((n, n));
    let mut edge = |i: usize, j: usize, w: f64| {
        dense[i] += w;
        dense[j] += w;
        entries.add_triplet(i.min(j), i.max(j), -w);
    };
    for v in 0..n {
        let w = 0.5 + (v * 7919 % 13) as f64 / 13.0;
        if v % side + 1 < side {
            edge(v, v + 1, w);
        }
        if v + side < n {
            edge(v, v + side, 1.7 - w);
        }
        if v % side + 1 < side && v + side < n {
            edge(v, v + side + 1, 0.3 * w);
        }
    }
    dense.iter().enumerate().for_each(|(v, &d)| entries.add_triplet(v, v, d));
    entries.to_csc()
}

fn border(side: usize) -> Vec<u32> {
    let n = side * side;
    (0..n as u32)
        .filter(|&v| {
            (v as usize).is_multiple_of(side) || (v as usize + 1).is_multiple_of(side) || (v as usize) < side || v as usize >= n - side
        })
        .collect()
}

fn multiply(matrix: &RealMatrix, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (&w, (i, j)) in matrix {
        y[i as usize] += w * x[j as usize];
        if i != j {
            y[j as usize] += w * x[i as usize];
        }
    }
    y
}

#[test]
fn extensions_are_harmonic_and_the_schur_complement_is_their_flux() {
    for side in [2, 3, 5, 17, 40] {
        let matrix = laplacian(side);
        let kept = border(side);
        let plan = Arc::new(CondensationPlan::new(&matrix, &kept).unwrap());
        let condensed = Condensation::new(plan, &matrix).unwrap();
        let m = kept.len();
        let values: Vec<[f64; 2]> = (0..m).map(|k| [(k as f64 * 0.7).sin(), (k as f64 * 0.3).cos()]).collect();
        let all = condensed.extend(&values, &[]).unwrap();
        for c in 0..2 {
            let x: Vec<f64> = all.iter().map(|v| v[c]).collect();
            let flux = multiply(&matrix, &x);
            for v in 0..side * side {
                match kept.iter().position(|&k| k as usize == v) {
                    None => assert!(flux[v].abs() < 1e-12, "{side} {v}: {}", flux[v]),
                    Some(row) => {
                        assert_eq!(x[v], values[row][c]);
                        let by_schur: f64 = (0..m).map(|k| condensed.schur()[k * m + row] * values[k][c]).sum();
                        assert!((by_schur - flux[v]).abs() < 1e-11, "{side} {v}: {by_schur} {}", flux[v]);
                    }
                }
            }
        }
        let symmetric = (0..m * m).all(|k| condensed.schur()[k] == condensed.schur()[(k % m) * m + k / m]);
        assert!(symmetric && condensed.backward_error() < 1e-13);
    }
}

#[test]
fn loads_solve_the_whole_system() {
    let side = 12;
    let matrix = laplacian(side);
    let kept = border(side);
    let condensed = Condensation::new(Arc::new(CondensationPlan::new(&matrix, &kept).unwrap()), &matrix).unwrap();
    let loads: Vec<Load> = [side as u32 + 3, 5 * side as u32 + 6].iter().map(|&v| condensed.load(v).unwrap()).collect();
    // Kept at zero: A_II x = f.
    let x = condensed.extend(&vec![[0.0; 2]; kept.len()], &[(&loads[0], [2.0, 0.0]), (&loads[1], [-1.0, 3.0])]).unwrap();
    for c in 0..2 {
        let flux = multiply(&matrix, &x.iter().map(|v| v[c]).collect::<Vec<_>>());
        for v in (0..side * side).filter(|v| !kept.contains(&(*v as u32))) {
            let wanted = match v {
                v if v == side + 3 => [2.0, 0.0][c],
                v if v == 5 * side + 6 => [-1.0, 3.0][c],
                _ => 0.0,
            };
            assert!((flux[v] - wanted).abs() < 1e-12);
        }
    }
    let between = loads[0].response(&loads[1]);
    assert!((x[side + 3][1] / 3.0 - between).abs() < 1e-12);
    // A harmonic function takes at v the values that the kept ones have with the weights of the load.
    let values: Vec<[f64; 2]> = (0..kept.len()).map(|k| [(k as f64).sqrt(), 1.0]).collect();
    let all = condensed.extend(&values, &[]).unwrap();
    let by_load: f64 = loads[0].kept.iter().zip(&values).map(|(l, v)| l * v[0]).sum();
    assert!((by_load - all[side + 3][0]).abs() < 1e-11 && (all[side + 3][1] - 1.0).abs() < 1e-12);
    assert!(condensed.load(0).is_err() && condensed.load(10_000).is_err());
}

#[test]
fn another_matrix_of_the_pattern_shares_the_plan_and_bad_ones_are_refused() {
    let matrix = laplacian(9);
    let plan = Arc::new(CondensationPlan::new(&matrix, &border(9)).unwrap());
    let double = matrix.map(|w| 2.0 * w);
    let (one, two) = (Condensation::new(plan.clone(), &matrix).unwrap(), Condensation::new(plan.clone(), &double).unwrap());
    assert!(one.schur().iter().zip(two.schur()).all(|(a, b)| (2.0 * a - b).abs() < 1e-12));
    assert!(matches!(Condensation::new(plan.clone(), &laplacian(8)), Err(SolveError::Shape { .. })));
    assert!(matches!(Condensation::new(plan, &matrix.map(|w| -w)), Err(SolveError::NotPositiveDefinite { .. })));
    assert!(matches!(CondensationPlan::new(&matrix, &[1, 1]), Err(SolveError::Shape { .. })));
    // All kept: the Schur complement is the matrix itself.
    let all: Vec<u32> = (0..81).collect();
    let whole = Condensation::new(Arc::new(CondensationPlan::new(&matrix, &all).unwrap()), &matrix).unwrap();
    for (&w, (i, j)) in &matrix {
        assert!((whole.schur()[j as usize * 81 + i as usize] - w).abs() < 1e-13);
    }
    let definite = Condensation::new(Arc::new(CondensationPlan::new(&matrix, &[40]).unwrap()), &matrix).unwrap();
    assert!(definite.schur()[0].abs() < 1e-12, "what is left of a singular matrix with one unknown");
}
