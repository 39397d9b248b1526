//! What is factorized once for a patch: the elimination of its interior. Every symmetric map is then a problem on the boundary loops,
//! whatever its method, pins, boundary shape, outer loop and fillings (DESIGN section 3).
//!
//! The dense boundary problem of m loop vertices costs O(m^3). A patch with long loops for its size (a strip, a lace) is kept whole
//! instead: nothing is eliminated and the boundary problem is sparse, over all vertices.

use super::domain::{Domain, Flat, check_patch};
use super::operator::{Weights, stiffness};
use super::outcome::Filling;
use super::place::FaceShapes;
use crate::error::{EngineError, Reason, Result};
use crate::patch::Patch;
use crate::sparse::solver_error;
use crate::work::Work;
use remesh_linalg::{CholeskyPlan, Condensation, CondensationPlan};
use std::sync::Arc;

/// Largest number of loop vertices of a dense boundary problem, and its largest multiple of the root of the number of vertices.
const MAX_DENSE: usize = 1500;
const MAX_DENSE_PER_ROOT: f64 = 9.0;

/// Elimination order and structure of the factor of a patch: depends on its connectivity only.
#[derive(Debug)]
pub struct ChartSystem {
    pub(super) plan: Plan,
}

#[derive(Debug)]
pub(super) enum Plan {
    /// The interior is eliminated.
    Condensed(Arc<CondensationPlan>),
    /// Nothing is eliminated; the plan is that of the bare patch.
    Whole(Arc<CholeskyPlan>),
}

impl ChartSystem {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match &self.plan {
            Plan::Condensed(plan) => plan.bytes(),
            Plan::Whole(plan) => plan.bytes(),
        }
    }
}

/// Analyses the connectivity of a patch. O(n log n) in practice (approximate minimum degree).
///
/// # Errors
/// [`Reason::PatchTopology`] for a patch that is closed, has a handle or is not connected; [`Reason::LimitReached`] if the structure does not
/// fit into memory; cancellation; broken invariants of the patch.
pub fn plan_system(patch: &Patch, work: &Work<'_>) -> Result<ChartSystem> {
    let kept = patch.loops.iter().map(Vec::len).sum::<usize>();
    let dense = kept <= MAX_DENSE && kept as f64 <= MAX_DENSE_PER_ROOT * (patch.positions.len() as f64).sqrt();
    plan_as(patch, if dense { Form::Condensed } else { Form::Whole }, work)
}

/// How a patch is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// Interior eliminated.
    Condensed,
    /// Nothing eliminated.
    Whole,
}

pub(super) fn plan_as(patch: &Patch, form: Form, work: &Work<'_>) -> Result<ChartSystem> {
    check_topology(patch)?;
    check_patch(patch)?;
    let pattern = stiffness(&patch.triangles, |_| Flat::default(), patch.positions.len(), |v| v, Weights::Uniform)?;
    work.check()?;
    let plan = match form {
        Form::Condensed => Plan::Condensed(Arc::new(CondensationPlan::new(&pattern, &loop_vertices(patch)).map_err(|e| solver_error(&e))?)),
        Form::Whole => Plan::Whole(Arc::new(CholeskyPlan::new(&pattern).map_err(|e| solver_error(&e))?)),
    };
    Ok(ChartSystem { plan })
}

/// Charts exist of connected patches of genus 0 with a boundary: V - E + F = 2 - loops.
fn check_topology(patch: &Patch) -> Result<()> {
    let wrong = |what: String| {
        let error =
            EngineError::new(Reason::PatchTopology, what).with_hint("partition the surface into patches of genus 0 with a boundary");
        error.with_locations(patch.triangles.first().map(|_| super::choose::face_location(patch, 0)))
    };
    if patch.loops.is_empty() {
        return Err(wrong("the patch is closed".to_owned()));
    }
    let boundary: usize = patch.loops.iter().map(Vec::len).sum();
    let (vertices, faces, loops) = (patch.positions.len() as i64, patch.triangles.len() as i64, patch.loops.len() as i64);
    let edges = (3 * faces + boundary as i64) / 2;
    match vertices - edges + faces + loops - 2 {
        0 => Ok(()),
        excess if excess < 0 => Err(wrong(format!("the patch has {} handles", -excess / 2))),
        excess => Err(wrong(format!("the patch has {} components", 1 + excess / 2))),
    }
}

/// Vertices of all loops, increasing.
fn loop_vertices(patch: &Patch) -> Vec<u32> {
    let mut kept: Vec<u32> = patch.loops.iter().flatten().copied().collect();
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// The elimination of the interior of a patch under symmetric weights.
#[derive(Debug)]
pub struct ChartFactor {
    pub(super) weights: Weights,
    pub(super) reduction: Reduction,
    pub(super) shapes: FaceShapes,
}

#[derive(Debug)]
pub(super) enum Reduction {
    /// Dense on the loop vertices.
    Condensed(Condensation),
    /// Nothing eliminated.
    Whole(Arc<CholeskyPlan>),
}

impl ChartFactor {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let reduction = match &self.reduction {
            Reduction::Condensed(condensation) => condensation.bytes(),
            Reduction::Whole(_) => 0,
        };
        reduction + self.shapes.bytes()
    }
}

/// Assembles the cotangent or uniform Laplacian of a patch and eliminates its interior. O(n^1.5 + m^3) for m loop vertices.
/// Cancellation is seen between assembly and factorization only.
///
/// # Errors
/// [`Reason::SolverSingular`] if a pivot is not positive or the residual check fails; [`Reason::LimitReached`] if the factor does not
/// fit into memory; cancellation; broken invariants.
pub fn factor_system(patch: &Patch, system: &ChartSystem, weights: Weights, work: &Work<'_>) -> Result<ChartFactor> {
    let domain = Domain::new(patch, 0, Filling::default(), work)?;
    let shapes = FaceShapes::of(&domain);
    let reduction = match &system.plan {
        Plan::Whole(plan) => Reduction::Whole(plan.clone()),
        Plan::Condensed(plan) => {
            if plan.size() != patch.positions.len() {
                return Err(EngineError::invariant("the plan belongs to another patch"));
            }
            let matrix = stiffness(&patch.triangles, |f| shapes.flats[f], patch.positions.len(), |v| v, weights)?;
            work.check()?;
            Reduction::Condensed(Condensation::new(plan.clone(), &matrix).map_err(|e| solver_error(&e))?)
        }
    };
    Ok(ChartFactor { weights, reduction, shapes })
}

/// The symmetric operator on the kept vertices of a condensed patch, dense, columns one after another: the Schur complement of the
/// patch and that of the virtual triangles of the domain. Virtual vertices are eliminated.
pub(super) fn condensed_operator(domain: &Domain<'_>, condensation: &Condensation, weights: Weights) -> Result<Vec<f64>> {
    let kept = condensation.plan().kept();
    let mut matrix = condensation.schur().to_vec();
    if !domain.virtual_triangles.is_empty() {
        let (vertices, schur) = condense_virtual(domain, weights)?;
        let slots: Vec<usize> = vertices.iter().map(|&v| kept.partition_point(|&w| w < v)).collect();
        for (j, &column) in slots.iter().enumerate() {
            for (i, &row) in slots.iter().enumerate() {
                matrix[column * kept.len() + row] += schur[j * slots.len() + i];
            }
        }
    }
    Ok(matrix)
}

/// The Schur complement that virtual triangles of a domain add on the vertices of the patch: those vertices, increasing, and the dense
/// symmetric matrix. Virtual vertices are eliminated.
fn condense_virtual(domain: &Domain<'_>, weights: Weights) -> Result<(Vec<u32>, Vec<f64>)> {
    let mut vertices: Vec<u32> = domain.virtual_triangles.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let real = vertices.partition_point(|&v| (v as usize) < domain.patch.positions.len());
    // Every vertex looked up is in the list.
    let slot = |v: u32| vertices.partition_point(|&w| w < v) as u32;
    let matrix = stiffness(&domain.virtual_triangles, |f| domain.flat(domain.virtual_triangles[f]), vertices.len(), slot, weights)?;
    let kept: Vec<u32> = (0..real as u32).collect();
    let plan = CondensationPlan::new(&matrix, &kept).map_err(|e| solver_error(&e))?;
    let condensed = Condensation::new(Arc::new(plan), &matrix).map_err(|e| solver_error(&e))?;
    vertices.truncate(real);
    Ok((vertices, condensed.schur().to_vec()))
}
