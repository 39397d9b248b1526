//! Static condensation: eliminates most unknowns of a real symmetric positive semidefinite matrix and leaves a dense problem on
//! the kept ones (their Schur complement). One elimination then serves every problem that differs on the kept unknowns only.

use crate::check::view;
use crate::order::{Order, kept_last};
use crate::{BACKWARD_ERROR_LIMIT, RealMatrix, SolveError};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::linalg::matmul::triangular::{BlockStructure, matmul as triangular_matmul};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Accum, MatMut, MatRef, Par, Side};
use std::sync::Arc;

/// What depends on the pattern alone: order and structure of the factor. Shared by all matrices of that pattern.
#[derive(Debug)]
pub struct CondensationPlan {
    symbolic: SymbolicCholesky<u32>,
    /// New place of each unknown; the kept ones are last.
    place: Vec<u32>,
    kept: Vec<u32>,
    entries: usize,
}

impl CondensationPlan {
    /// Analyses the pattern of `matrix` (entries with row <= column; values do not matter), keeping the unknowns `kept`.
    ///
    /// # Errors
    /// [`SolveError::Shape`], also for kept unknowns that are repeated or out of range; [`SolveError::Resources`].
    pub fn new(matrix: &RealMatrix, kept: &[u32]) -> Result<Self, SolveError> {
        let starts = matrix.proper_indptr();
        let a = view(matrix, &starts)?;
        let size = a.ncols();
        let mut sorted = kept.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() != kept.len() || sorted.last().is_some_and(|&v| v as usize >= size) {
            return Err(SolveError::Shape { rows: size, columns: kept.len() });
        }
        let Order { forward, inverse } = kept_last(&starts, matrix.indices(), kept)?;
        let params =
            CholeskySymbolicParams { supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL, ..Default::default() };
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&forward, &inverse, size));
        let symbolic =
            factorize_symbolic_cholesky(a.symbolic(), Side::Upper, ordering, params).map_err(|e| SolveError::Resources(e.to_string()))?;
        Ok(CondensationPlan { symbolic, place: inverse, kept: kept.to_vec(), entries: matrix.nnz() })
    }

    /// The kept unknowns, in the order of the rows of the Schur complement.
    pub fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// Number of all unknowns.
    pub fn size(&self) -> usize {
        self.place.len()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let s = supernodal(&self.symbolic);
        let structure = s.map_or(0, |s| s.row_idx().len() + 4 * s.n_supernodes());
        4 * (structure + 3 * self.place.len() + self.kept.len())
    }
}

fn supernodal(symbolic: &SymbolicCholesky<u32>) -> Option<&SymbolicSupernodalCholesky<u32>> {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Supernodal(s) => Some(s),
        SymbolicCholeskyRaw::Simplicial(_) => None,
    }
}

/// A matrix with all unknowns but the kept ones eliminated.
#[derive(Debug)]
pub struct Condensation {
    plan: Arc<CondensationPlan>,
    values: Vec<f64>,
    schur: Vec<f64>,
    error: f64,
}

impl Condensation {
    /// Eliminates; `matrix` has the pattern of the plan, and only entries with row <= column are read. Its block of eliminated
    /// unknowns must be positive definite, the whole at least semidefinite.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`], [`SolveError::Inaccurate`], [`SolveError::Shape`], [`SolveError::Resources`].
    pub fn new(plan: Arc<CondensationPlan>, matrix: &RealMatrix) -> Result<Self, SolveError> {
        if matrix.nnz() != plan.entries || matrix.cols() != plan.size() {
            return Err(SolveError::Shape { rows: matrix.rows(), columns: matrix.cols() });
        }
        // Doubling the diagonal of the kept unknowns makes the whole definite; the Schur complement is put right afterwards.
        let mut lifted = matrix.clone();
        let lift = lift_kept(&mut lifted, &plan.kept);
        let starts = lifted.proper_indptr();
        let a = view(&lifted, &starts)?;
        let symbolic = &plan.symbolic;
        let mut values = Vec::new();
        let refuse = |_| SolveError::Resources(format!("{} values", symbolic.len_val()));
        values.try_reserve_exact(symbolic.len_val()).map_err(refuse)?;
        values.resize(symbolic.len_val(), 0.0);
        let mut buffer = MemBuffer::try_new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()))
            .map_err(|_| SolveError::Resources("work space".to_owned()))?;
        let (stack, size) = (MemStack::new(&mut buffer), plan.size());
        symbolic
            .factorize_numeric_llt(&mut values, a, Side::Upper, LltRegularization::default(), Par::Seq, stack, Default::default())
            .map_err(|LltError::NonPositivePivot { index }| SolveError::NotPositiveDefinite { index, size })?;
        let mut condensed = Condensation { plan, values, schur: Vec::new(), error: 0.0 };
        condensed.schur = condensed.multiply_last_block(&lift)?;
        condensed.error = condensed.check(matrix)?;
        Ok(condensed)
    }

    /// Backward error of one extension: rows of eliminated unknowns must vanish, the others give what the Schur complement says.
    fn check(&self, matrix: &RealMatrix) -> Result<f64, SolveError> {
        let kept = self.plan.kept.len();
        let values: Vec<[f64; 2]> =
            (0..kept as u32).map(|k| [f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 23) - 1.0, 1.0]).collect();
        let all = self.extend(&values, &[])?;
        let (mut rest, mut row_sums) = (vec![0.0f64; all.len()], vec![0.0f64; all.len()]);
        for (j, column) in matrix.outer_iterator().enumerate() {
            for (i, &a) in column.iter().filter(|(i, _)| *i <= j) {
                rest[i] += a * all[j][0];
                row_sums[i] += a.abs();
                if i != j {
                    rest[j] += a * all[i][0];
                    row_sums[j] += a.abs();
                }
            }
        }
        for (column, value) in self.schur.chunks_exact(kept.max(1)).zip(&values) {
            self.plan.kept.iter().zip(column).for_each(|(&v, s)| rest[v as usize] -= s * value[0]);
        }
        let largest = |x: &[f64]| x.iter().fold(0.0f64, |m, x| if x.is_nan() { f64::NAN } else { m.max(x.abs()) });
        if all.iter().chain(&values).flatten().chain(&rest).any(|x| !x.is_finite()) {
            return Err(SolveError::Inaccurate { error: f64::NAN, limit: BACKWARD_ERROR_LIMIT });
        }
        let scale = largest(&row_sums) * all.iter().fold(0.0f64, |m, x| m.max(x[0].abs()));
        let error = if scale > 0.0 { largest(&rest) / scale } else { 0.0 };
        if error <= BACKWARD_ERROR_LIMIT { Ok(error) } else { Err(SolveError::Inaccurate { error, limit: BACKWARD_ERROR_LIMIT }) }
    }

    fn structure(&self) -> Result<&SymbolicSupernodalCholesky<u32>, SolveError> {
        supernodal(&self.plan.symbolic).ok_or_else(|| SolveError::Resources("the factor is not supernodal".to_owned()))
    }

    /// `L L^T` of the last block of the factor, less what was added to its diagonal.
    fn multiply_last_block(&self, lift: &[f64]) -> Result<Vec<f64>, SolveError> {
        let kept = self.plan.kept.len();
        let inner = self.plan.size() - kept;
        let mut factor = vec![0.0; kept * kept];
        let mut schur = vec![0.0; kept * kept];
        let structure = self.structure()?;
        for s in 0..structure.n_supernodes() {
            let node = Node::of(structure, &self.values, s);
            for (k, column) in (node.begin..node.end).enumerate().filter(|c| c.1 >= inner) {
                let values = node.column(k);
                let target = &mut factor[(column - inner) * kept..][..kept];
                let own = node.end - node.begin;
                (k..own).for_each(|i| target[node.begin + i - inner] = values[i]);
                node.pattern.iter().zip(&values[own..]).for_each(|(&row, &value)| target[row as usize - inner] = value);
            }
        }
        if kept > 0 {
            let l = MatRef::from_column_major_slice(&factor, kept, kept);
            let out = MatMut::from_column_major_slice_mut(&mut schur, kept, kept);
            let (lower, upper) = (BlockStructure::TriangularLower, BlockStructure::TriangularUpper);
            triangular_matmul(out, lower, Accum::Replace, l, lower, l.transpose(), upper, 1.0, Par::Seq);
        }
        for j in 0..kept {
            schur[j * kept + j] -= lift[j];
            for i in j + 1..kept {
                schur[i * kept + j] = schur[j * kept + i];
            }
        }
        Ok(schur)
    }

    /// The Schur complement on the kept unknowns: symmetric, columns one after another, in the order of [`CondensationPlan::kept`].
    pub fn schur(&self) -> &[f64] {
        &self.schur
    }

    /// What the elimination was planned for.
    pub fn plan(&self) -> &CondensationPlan {
        &self.plan
    }

    /// Backward error of the check after the elimination.
    pub fn backward_error(&self) -> f64 {
        self.error
    }

    /// Bytes held, the shared plan apart.
    pub fn bytes(&self) -> usize {
        8 * (self.values.len() + self.schur.len())
    }

    /// The right-hand side `e_v` of an eliminated unknown `v`, carried over to the kept ones.
    /// One forward substitution below `v` in the elimination forest.
    ///
    /// # Errors
    /// [`SolveError::Shape`] if `v` is kept or out of range.
    pub fn load(&self, v: u32) -> Result<Load, SolveError> {
        let inner = self.plan.size() - self.plan.kept.len();
        let first = self.plan.place.get(v as usize).map_or(usize::MAX, |&p| p as usize);
        if first >= inner {
            return Err(SolveError::Shape { rows: self.plan.size(), columns: v as usize });
        }
        let structure = self.structure()?;
        let mut x = vec![0.0; self.plan.size()];
        x[first] = 1.0;
        for s in 0..structure.n_supernodes() {
            let node = Node::of(structure, &self.values, s);
            if node.begin >= inner || node.end <= first {
                continue;
            }
            for (k, column) in (node.begin..node.end).enumerate().filter(|c| c.1 < inner) {
                if x[column] == 0.0 {
                    continue;
                }
                let values = node.column(k);
                let solved = x[column] / values[k];
                x[column] = solved;
                let own = node.end - node.begin;
                (k + 1..own).for_each(|i| x[node.begin + i] -= solved * values[i]);
                node.pattern.iter().zip(&values[own..]).for_each(|(&row, &value)| x[row as usize] -= solved * value);
            }
        }
        let kept = x.split_off(inner);
        Ok(Load { half: x, kept })
    }

    /// Values of all unknowns from those of the kept ones (`kept`, pairs of two real columns) and of loads with their factors.
    /// One backward substitution.
    ///
    /// # Errors
    /// Only a broken invariant of the factor.
    ///
    /// # Panics
    /// If the number of values is not that of the kept unknowns.
    pub fn extend(&self, kept: &[[f64; 2]], loads: &[(&Load, [f64; 2])]) -> Result<Vec<[f64; 2]>, SolveError> {
        assert_eq!(kept.len(), self.plan.kept.len(), "values do not fit the kept unknowns");
        let size = self.plan.size();
        let inner = size - kept.len();
        let mut columns = [vec![0.0; size], vec![0.0; size]];
        for (c, column) in columns.iter_mut().enumerate() {
            for (load, factor) in loads {
                column.iter_mut().zip(&load.half).for_each(|(x, l)| *x += factor[c] * l);
            }
            column[inner..].iter_mut().zip(kept).for_each(|(x, k)| *x = k[c]);
        }
        let structure = self.structure()?;
        let [first, second] = &mut columns;
        let mut gathered: [Vec<f64>; 2] = Default::default();
        for s in (0..structure.n_supernodes()).rev() {
            let node = Node::of(structure, &self.values, s);
            if node.begin >= inner {
                continue;
            }
            let own = node.end - node.begin;
            for (buffer, x) in gathered.iter_mut().zip([&*first, &*second]) {
                buffer.clear();
                buffer.extend_from_slice(&x[node.begin..node.end]);
                buffer.extend(node.pattern.iter().map(|&row| x[row as usize]));
            }
            let [a, b] = &mut gathered;
            for k in (0..own.min(inner - node.begin)).rev() {
                let values = node.column(k);
                let below = dots(&values[k + 1..], &a[k + 1..], &b[k + 1..]);
                let pivot = 1.0 / values[k];
                a[k] = (a[k] - below[0]) * pivot;
                b[k] = (b[k] - below[1]) * pivot;
            }
            first[node.begin..node.end].copy_from_slice(&a[..own]);
            second[node.begin..node.end].copy_from_slice(&b[..own]);
        }
        Ok(self.plan.place.iter().map(|&p| [first[p as usize], second[p as usize]]).collect())
    }
}

/// A unit right-hand side at an eliminated unknown, half solved.
#[derive(Debug, Clone)]
pub struct Load {
    /// Forward-substituted values of the eliminated unknowns, in elimination order.
    half: Vec<f64>,
    /// The equivalent right-hand side on the kept unknowns. Its entries are also how the value of the eliminated unknown depends on
    /// those of the kept ones.
    pub kept: Vec<f64>,
}

impl Load {
    /// How much the load at `self` moves the unknown of `other` while the kept ones are held: an entry of the inverse of the
    /// eliminated block.
    pub fn response(&self, other: &Load) -> f64 {
        self.half.iter().zip(&other.half).map(|(a, b)| a * b).sum()
    }
}

/// Adds its own value to the diagonal of every kept unknown; returns what was added.
fn lift_kept(matrix: &mut RealMatrix, kept: &[u32]) -> Vec<f64> {
    let mut lift = |v: u32| {
        let Some(diagonal) = matrix.get_mut(v as usize, v as usize) else { return 0.0 };
        let added = diagonal.abs().max(f64::MIN_POSITIVE);
        *diagonal += added;
        added
    };
    kept.iter().map(|&v| lift(v)).collect()
}

/// A supernode: consecutive columns with the same rows below them.
struct Node<'a> {
    begin: usize,
    end: usize,
    pattern: &'a [u32],
    values: &'a [f64],
}

impl<'a> Node<'a> {
    fn of(structure: &'a SymbolicSupernodalCholesky<u32>, values: &'a [f64], s: usize) -> Node<'a> {
        let (begin, end) = (structure.supernode_begin()[s] as usize, structure.supernode_end()[s] as usize);
        let range = structure.col_ptr_for_val()[s] as usize..structure.col_ptr_for_val()[s + 1] as usize;
        Node { begin, end, pattern: structure.supernode(s).pattern(), values: &values[range] }
    }

    /// Column `k` from the first row of the supernode on; entries above `k` mean nothing.
    fn column(&self, k: usize) -> &'a [f64] {
        let rows = self.end - self.begin + self.pattern.len();
        &self.values[k * rows..(k + 1) * rows]
    }
}

/// Two scalar products with the same vector.
fn dots(l: &[f64], a: &[f64], b: &[f64]) -> [f64; 2] {
    const WIDTH: usize = 4;
    let (mut sums_a, mut sums_b) = ([0.0; WIDTH], [0.0; WIDTH]);
    let (chunks_l, chunks_a, chunks_b) = (l.chunks_exact(WIDTH), a.chunks_exact(WIDTH), b.chunks_exact(WIDTH));
    let rest = (chunks_l.remainder(), chunks_a.remainder(), chunks_b.remainder());
    for ((l, a), b) in chunks_l.zip(chunks_a).zip(chunks_b) {
        for k in 0..WIDTH {
            sums_a[k] += l[k] * a[k];
            sums_b[k] += l[k] * b[k];
        }
    }
    let mut out = [sums_a.iter().sum(), sums_b.iter().sum()];
    for ((l, a), b) in rest.0.iter().zip(rest.1).zip(rest.2) {
        out[0] += l * a;
        out[1] += l * b;
    }
    out
}

#[cfg(test)]
mod tests;
