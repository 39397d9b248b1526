//! What is wrong with a surface, with element ids and coordinates.

pub(crate) mod edges;
mod find;
mod numbers;

use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Location, MAX_LOCATIONS, Reason, Result};
use crate::mesh::SurfaceMesh;
use crate::quality::TopologyNumbers;
use crate::quality::intersect::self_intersections;
use crate::vector::bounds;
use crate::work::Work;
use edges::EdgeTable;

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

impl Defect {
    /// Order of findings: what prevents remeshing, then what hurts it, then what is only worth knowing.
    fn rank(self) -> u8 {
        match self {
            Defect::NonFinite => 0,
            Defect::NonManifoldEdge => 1,
            Defect::NonManifoldVertex => 2,
            Defect::NotOrientable => 3,
            Defect::FlippedFace => 4,
            Defect::SelfIntersection => 5,
            Defect::DuplicateFace => 6,
            Defect::DegenerateFace => 7,
            Defect::Sliver => 8,
            Defect::Hole => 9,
            Defect::Component => 10,
        }
    }

    /// Whether a surface with this defect cannot be remeshed.
    pub fn prevents_remeshing(self) -> bool {
        matches!(
            self,
            Defect::NonManifoldEdge | Defect::NonManifoldVertex | Defect::NotOrientable | Defect::FlippedFace | Defect::NonFinite
        )
    }

    /// What there is of it, for messages: "edges with more than two faces".
    fn plural(self) -> &'static str {
        match self {
            Defect::NonManifoldEdge => "edges with more than two faces",
            Defect::NonManifoldVertex => "vertices with more than one fan of faces",
            Defect::NotOrientable => "edges along which the orientation cannot be made consistent",
            Defect::FlippedFace => "faces against the orientation of their neighbours",
            Defect::DegenerateFace => "faces of nearly zero area",
            Defect::DuplicateFace => "duplicate faces",
            Defect::Sliver => "faces with kappa below 0.1",
            Defect::Hole => "boundary loops",
            Defect::Component => "components besides the first",
            Defect::NonFinite => "vertices with a coordinate that is not finite",
            Defect::SelfIntersection => "pairs of faces that intersect",
        }
    }

    /// Reason of the refusal, and what a user can do; `None` for what does not prevent remeshing.
    fn refusal(self) -> Option<(Reason, &'static str)> {
        Some(match self {
            Defect::NonManifoldEdge => (
                Reason::NonManifoldEdge,
                "keep one sheet of the surface: import only some regions, or delete the inner or doubled faces at these edges",
            ),
            Defect::NonManifoldVertex => {
                (Reason::NonManifoldVertex, "separate the parts that touch in these vertices, or delete the smaller of them")
            }
            Defect::NotOrientable => (Reason::NotOrientable, "the surface has one side only (as a Moebius strip); cut it open"),
            Defect::FlippedFace => (Reason::NotOrientable, "import turns such faces: import the surface instead of using it as it is"),
            Defect::NonFinite => (Reason::NonFinite, "write the file again from its source"),
            _ => return None,
        })
    }
}

impl Diagnosis {
    /// The diagnosis with one more finding, at its place.
    pub fn with(mut self, finding: Finding) -> Diagnosis {
        let place = self.findings.partition_point(|f| f.defect.rank() < finding.defect.rank());
        self.findings.insert(place, finding);
        self
    }

    /// The error that refuses the surface, if some finding prevents remeshing: reason, counts, places, what to do.
    /// It is about the worst finding; the counts of the others are in its message.
    pub fn refusal(&self) -> Option<EngineError> {
        let worst = self.findings.iter().find(|f| f.prevents_remeshing)?;
        let (reason, hint) = worst.defect.refusal()?;
        let told: Vec<String> =
            self.findings.iter().filter(|f| f.prevents_remeshing).map(|f| format!("{} {}", f.count, f.defect.plural())).collect();
        // The places beyond those kept are only counted, so anything may stand for them.
        let uncounted = Location { element: crate::error::Element::Face, ids: Vec::new(), position: [0.0; 3] };
        let rest = (worst.count as usize).saturating_sub(worst.locations.len());
        let rest = if worst.locations.len() == MAX_LOCATIONS { rest } else { 0 };
        let error = EngineError::new(reason, format!("the surface cannot be remeshed: it has {}", told.join(", ")))
            .with_hint(hint)
            .with_locations(worst.locations.iter().cloned().chain(std::iter::repeat_n(uncounted, rest)))
            .with_metadata("count", worst.count);
        Some(error)
    }

    /// The finding of a kind, if it occurs.
    pub fn finding(&self, defect: Defect) -> Option<&Finding> {
        self.findings.iter().find(|f| f.defect == defect)
    }
}

/// Diagnoses any arrays that pass [`SurfaceMesh::validate`]. O(F log F).
/// Self-intersections are not looked for here: [`intersections`] finds them, at a higher cost.
///
/// # Errors
/// Only cancellation.
pub fn diagnose(mesh: &SurfaceMesh, work: &Work<'_>) -> Result<Diagnosis> {
    work.check()?;
    let edges = EdgeTable::build(&mesh.triangles, mesh.positions.len());
    work.check()?;
    let counted = numbers::count(&mesh.triangles, mesh.positions.len(), &edges);
    work.check()?;
    let findings = find::findings(mesh, &edges, &counted, work)?;
    let (low, high) = bounds(&mesh.positions).unwrap_or_default();
    Ok(Diagnosis { findings, topology: counted.numbers, low, high, area: mesh.area() })
}

/// The pairs of faces that intersect each other, if there are any, each at the middle of its lower face. `bvh` is a tree over the mesh.
/// O(F log F) plus the pairs of faces with overlapping boxes.
///
/// # Errors
/// Only cancellation.
pub fn intersections(mesh: &SurfaceMesh, bvh: &TriangleBvh, work: &Work<'_>) -> Result<Option<Finding>> {
    let (count, pairs) = self_intersections(mesh, bvh, MAX_LOCATIONS, work)?;
    let location = |pair: &[u32; 2]| Location { ids: pair.to_vec(), ..mesh.face_location(pair[0] as usize) };
    let defect = Defect::SelfIntersection;
    let found = Finding { defect, count, locations: pairs.iter().map(location).collect(), prevents_remeshing: defect.prevents_remeshing() };
    Ok((count > 0).then_some(found))
}

/// Topological numbers of any triangles with indices below `vertex_count`, manifold or not. Vertices that no triangle uses do
/// not count. An umbrella is a set of corners of one vertex joined across edges with exactly two faces; a vertex with several is not
/// manifold. Boundary loops and genus are those of the surface cut open at such vertices, components those by shared vertices.
/// The genus is that of all parts together, `None` if an edge has more than two faces or the surface has no orientation. O(F log F).
pub fn topology_numbers(triangles: &[[u32; 3]], vertex_count: usize) -> TopologyNumbers {
    let edges = EdgeTable::build(triangles, vertex_count);
    numbers::count(triangles, vertex_count, &edges).numbers
}
