//! Optimisation of the assembled mesh on the input surface, across seams that are not features: flips, splits, collapses and
//! tangential smoothing with projection to the input.

mod activity;
mod anisotropic;
mod capture;
mod chase;
mod fit;
pub(crate) mod input;
mod interior;
mod kernel;
mod polish;
mod reconnect;
mod rescue;
mod rounds;
mod sag;
mod state;
mod untangle;

pub use anisotropic::optimize_in_metric;

use crate::assemble::Assembled;
use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::patch::Patch;
use crate::planar::LiftedPatch;
use crate::sizing::SizeField;
use crate::work::Work;
use activity::{Activity, FIRST_SWEEP};
use input::{Input, Tree};
use kernel::Kernel;
use rescue::Effort;
use rounds::FlipGoal;
use state::{Curves, State};
use std::cell::OnceCell;

/// How far to optimise.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizeSpec {
    /// Rounds of split, collapse, flip and smoothing over the whole mesh; 0 leaves the assembled mesh as it is.
    pub rounds: u32,
    /// Triangles below this kappa are chased one by one afterwards, those that resist by trying what makes things worse at first.
    pub min_kappa: f64,
    /// How the mesh lies about the input.
    pub fit: SurfaceFit,
}

/// Where free vertices lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SurfaceFit {
    /// Off the input by at most 0.08 of the local size, such that the faces lie to both sides of it: about half the root mean square
    /// distance, volumes and radii kept.
    #[default]
    Faces,
    /// On the input. Faces cut below its bulges.
    Vertices,
}

impl Default for OptimizeSpec {
    fn default() -> Self {
        OptimizeSpec { rounds: 3, min_kappa: 0.77, fit: SurfaceFit::default() }
    }
}

/// Triangles of a smaller kappa are worth a warning.
pub const FLAT: f64 = 0.1;

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
    /// Triangles with kappa below [`FLAT`]; 0 where a metric asks for long ones, and of quadrangles.
    pub flat_faces: u32,
    /// Number of quadrangles: for `q` below it faces `2 q` = (a, b, c) and `2 q + 1` = (a, c, d) are the halves of quadrangle (a, b, c, d).
    pub quads: u32,
    /// Regions of the input (indices, increasing) without a face in the result; filled in after the optimisation.
    pub lost_regions: Vec<u32>,
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

/// What was done to the inside of the patches before they were joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interiors {
    /// They are as the mesher left them.
    Raw,
    /// [`optimize_patch`] was at them: only what lies within two rings of a curve is new.
    Optimized,
}

/// Optimises. Keeps topology, corners, and curves as curves; never flips a face against the input's normal; deterministic.
///
/// Free vertices end on the input ([`SurfaceFit::Vertices`]) or at most 0.08 of the local size off it ([`SurfaceFit::Faces`]), off its boundary (a
/// few may be lifted by up to 0.1 of the local size where two sheets would otherwise cross). Curve vertices slide or go only where their curve moves by at most 0.04 of the local size, 0.085 where a needle vanishes;
/// sharp turns fainter than that, off the boundary, do not count as corners; the boundary moves by at most 0.01 of it a step. Crests
/// and tips of the input missed by more than 0.25 % of its diagonal (0.12 to 0.25 of the local size) get a vertex where one fits.
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
    interiors: Interiors,
    sizes: &SizeField,
    spec: &OptimizeSpec,
    work: &Work<'_>,
) -> Result<Remeshed> {
    check(input, assembled, sizes)?;
    let activity = |mesh: &Kernel| match interiors {
        Interiors::Raw => Activity::new(mesh.vertex_slots() as usize),
        Interiors::Optimized => Activity::around(mesh, 0..assembled.curve_vertices, SEAM_RINGS),
    };
    let surface = Input::new(input, Tree::Made(bvh), sizes);
    work.check()?;
    let mut state = State::new(&surface, assembled, Curves::Flexible, activity)?;
    work.check()?;
    let mut crossing = None;
    if spec.rounds > 0 {
        size_rounds(&mut state, spec.rounds, work)?;
        capture::capture(&mut state, work)?;
        shape_rounds(&mut state, work)?;
        chase::chase(&mut state, spec.min_kappa, work)?;
        let (captured, nearby) = capture::capture(&mut state, work)?;
        if captured > 0 {
            chase::chase(&mut state, spec.min_kappa, work)?;
        }
        rescue::rescue(&mut state, spec.min_kappa, Effort::Whole(&nearby), work)?;
        polish::polish(&mut state, spec.min_kappa, &nearby, work)?;
        let fitted = match spec.fit {
            SurfaceFit::Faces => fit::fit(&mut state, spec.min_kappa, work)?,
            SurfaceFit::Vertices => Vec::new(),
        };
        crossing = Some(untangle::untangle(&mut state, &fitted, work)? as u32);
    }
    let flat = state.mesh.faces_left().filter(|&f| state.kappa(f) < FLAT).count();
    Ok(Remeshed { crossing_faces: crossing, flat_faces: flat as u32, ..finish(input, &state) })
}

/// Rings of edges around curves that are worked on after the interiors of the patches.
const SEAM_RINGS: u32 = 2;

/// Edges to their wanted lengths, vertices to their wanted valences.
fn size_rounds(state: &mut State<'_>, rounds: u32, work: &Work<'_>) -> Result<()> {
    let (mut splits, mut collapses, mut valences) = (FIRST_SWEEP, FIRST_SWEEP, FIRST_SWEEP);
    for round in 0..rounds {
        splits = rounds::split_long(state, splits, work)?;
        collapses = rounds::collapse_short(state, collapses, work)?;
        valences = rounds::flip_pass(state, FlipGoal::Valence, valences, work)?;
        rounds::smooth(state, 3, work)?;
        work.step(round as usize + 1, rounds as usize + 1)?;
    }
    Ok(())
}

/// Faces to better shapes.
fn shape_rounds(state: &mut State<'_>, work: &Work<'_>) -> Result<()> {
    let mut shapes = FIRST_SWEEP;
    for _ in 0..3 {
        shapes = rounds::flip_pass(state, FlipGoal::Shape, shapes, work)?;
        rounds::smooth(state, 2, work)?;
    }
    rounds::flip_pass(state, FlipGoal::Shape, FIRST_SWEEP, work)?;
    Ok(())
}

/// Optimises the inside of one patch on the patch alone, so that an edit elsewhere leaves it cached and patches can be worked on at the
/// same time. Vertices and edges on curves stay as they are, bit for bit. `vertex_size` is the wanted length at each vertex of
/// the patch. Near-linear; deterministic. With no rounds the mesh is returned as it is.
///
/// # Errors
/// Cancellation; [`crate::error::Reason::Invariant`] for arrays that do not fit each other.
pub fn optimize_patch(
    patch: &Patch,
    lifted: &LiftedPatch,
    vertex_size: &[f64],
    spec: &OptimizeSpec,
    work: &Work<'_>,
) -> Result<LiftedPatch> {
    if spec.rounds == 0 {
        return Ok(lifted.clone());
    }
    let input = SurfaceMesh::from_parts(patch.positions.clone(), patch.triangles.clone());
    let sizes = SizeField::new(vertex_size.to_vec());
    let mesh = interior::as_assembled(lifted);
    check(&input, &mesh, &sizes)?;
    let all = |mesh: &Kernel| Activity::new(mesh.vertex_slots() as usize);
    let surface = Input::new(&input, Tree::Lazy(OnceCell::new()), &sizes);
    let mut state = State::new(&surface, &mesh, Curves::Held, all)?;
    size_rounds(&mut state, spec.rounds, work)?;
    shape_rounds(&mut state, work)?;
    chase::chase(&mut state, spec.min_kappa, work)?;
    rescue::rescue(&mut state, spec.min_kappa, Effort::Inside, work)?;
    Ok(interior::as_lifted(&state, lifted))
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
