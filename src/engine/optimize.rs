//! Optimisation of the assembled mesh on the input surface, across seams that are not features: flips, splits, collapses and
//! tangential smoothing with projection to the input.

mod activity;
mod capture;
mod chase;
pub(crate) mod input;
mod kernel;
mod rounds;
mod sag;
mod state;
mod untangle;

use crate::assemble::Assembled;
use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::sizing::SizeField;
use crate::work::Work;
use input::Input;
use rounds::FlipGoal;
use state::State;

/// How far to optimise.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizeSpec {
    /// Rounds of split, collapse, flip and smoothing over the whole mesh; 0 leaves the assembled mesh as it is.
    pub rounds: u32,
    /// Triangles below this kappa are chased one by one afterwards.
    pub min_kappa: f64,
}

impl Default for OptimizeSpec {
    fn default() -> Self {
        OptimizeSpec { rounds: 5, min_kappa: 0.5 }
    }
}

/// The finished mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Remeshed {
    /// Surface, with the regions, region names and unit of the input.
    pub mesh: SurfaceMesh,
    /// Patch of each face (of the partition the mesh was made with; approximate along seams).
    pub face_patch: Vec<u32>,
    /// Edges on boundary and feature curves (vertex pairs, low first, sorted).
    pub curve_edges: Vec<[u32; 2]>,
    /// Faces that still intersect others after repair; `None` if that was not checked (no rounds).
    pub crossing_faces: Option<u32>,
    /// Number of quadrangles: for `q` below it faces `2 q` = (a, b, c) and `2 q + 1` = (a, c, d) are the halves of quadrangle (a, b, c, d).
    pub quads: u32,
}

impl Contents for Remeshed {
    fn feed(&self, into: &mut Feeder) {
        self.mesh.feed(into);
        into.u32s(&self.face_patch).tuples(&self.curve_edges).u64(u64::from(self.quads));
    }

    fn bytes(&self) -> usize {
        self.mesh.bytes() + self.face_patch.len() * 4 + self.curve_edges.len() * 8
    }
}

/// Optimises. Keeps topology, corners, and curves as curves; never flips a face against the input's normal; deterministic.
///
/// Free vertices end on the input (a few may be lifted off it by up to 0.1 of the local size where two sheets would otherwise
/// cross). Curve vertices slide or go only where their curve moves by at most 0.04 of the local size, 0.085 where a needle vanishes;
/// sharp turns fainter than that, off the boundary, do not count as corners; the boundary moves by at most 0.01 of it a step. Crests
/// and tips of the input missed by more than 0.3 % of its diagonal (0.12 to 0.25 of the local size) get a vertex where one fits.
/// Near-linear. Not guaranteed: that every face reaches
/// `min_kappa` (corners may be closer than elements are long), nor that no intersection is left where sheets nearly touch.
///
/// # Errors
/// Cancellation; [`crate::error::Reason::Invariant`] for arrays that do not fit each other; those of
/// [`crate::topology::Topology::build`] for a mesh that is not manifold.
pub fn optimize_surface(
    input: &SurfaceMesh,
    bvh: &TriangleBvh,
    assembled: &Assembled,
    sizes: &SizeField,
    spec: &OptimizeSpec,
    work: &Work<'_>,
) -> Result<Remeshed> {
    check(input, assembled, sizes)?;
    let mut state = State::new(Input::new(input, bvh, sizes), assembled)?;
    let stages = 2 * spec.rounds as usize + 4;
    let (mut splits, mut collapses, mut valences, mut shapes) = (0, 0, 0, 0);
    let mut crossing = None;
    for round in 0..spec.rounds {
        splits = rounds::split_long(&mut state, splits, work)?;
        collapses = rounds::collapse_short(&mut state, collapses, work)?;
        valences = rounds::flip_pass(&mut state, FlipGoal::Valence, valences, work)?;
        rounds::smooth(&mut state, 3, work)?;
        work.step(2 * round as usize, stages)?;
    }
    if spec.rounds > 0 {
        capture::capture(&mut state, work)?;
        for _ in 0..3 {
            shapes = rounds::flip_pass(&mut state, FlipGoal::Shape, shapes, work)?;
            rounds::smooth(&mut state, 2, work)?;
        }
        rounds::flip_pass(&mut state, FlipGoal::Shape, 0, work)?;
        chase::chase(&mut state, spec.min_kappa, work)?;
        if capture::capture(&mut state, work)? > 0 {
            chase::chase(&mut state, spec.min_kappa, work)?;
        }
        crossing = Some(untangle::untangle(&mut state, work)? as u32);
    }
    work.step(stages, stages)?;
    Ok(Remeshed { crossing_faces: crossing, ..finish(input, &state) })
}

fn check(input: &SurfaceMesh, assembled: &Assembled, sizes: &SizeField) -> Result<()> {
    let (vertices, faces) = (assembled.positions.len(), assembled.triangles.len());
    let fits = assembled.vertex_class.len() == vertices
        && assembled.vertex_face.len() == vertices
        && assembled.face_patch.len() == faces
        && assembled.face_region.len() == faces
        && sizes.vertex_size.len() == input.positions.len()
        && assembled.vertex_face.iter().all(|&f| (f as usize) < input.triangles.len());
    if fits { Ok(()) } else { Err(EngineError::invariant("the arrays of the assembled mesh do not fit each other or the input")) }
}

/// Numbers what is left in the order it stands.
fn finish(input: &SurfaceMesh, state: &State<'_>) -> Remeshed {
    let kernel = &state.mesh;
    let mut number = vec![u32::MAX; kernel.vertex_slots() as usize];
    let mut positions = Vec::new();
    for v in 0..kernel.vertex_slots() {
        if kernel.is_vertex(v) {
            number[v as usize] = positions.len() as u32;
            positions.push(kernel.at(v));
        }
    }
    let mut remeshed = Remeshed::default();
    let (mut triangles, mut face_region) = (Vec::new(), Vec::new());
    for f in kernel.faces_left() {
        let [patch, region] = kernel.label[f as usize];
        triangles.push(kernel.corners(f).map(|v| number[v as usize]));
        remeshed.face_patch.push(patch);
        face_region.push(region);
        for h in 3 * f..3 * f + 3 {
            if kernel.is_on_curve(h) && kernel.twin(h).is_none_or(|t| h < t) {
                let (a, b) = (number[kernel.from(h) as usize], number[kernel.to(h) as usize]);
                remeshed.curve_edges.push([a.min(b), a.max(b)]);
            }
        }
    }
    remeshed.curve_edges.sort_unstable();
    remeshed.mesh = SurfaceMesh { positions, triangles, face_region, regions: input.regions.clone(), unit: input.unit };
    remeshed
}

#[cfg(test)]
mod tests;
