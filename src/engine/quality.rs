//! Quality of a mesh and its fidelity to the input, by the definitions of DESIGN section 5. The one implementation in the project.

mod distance;
mod edges;
pub mod intersect;
mod quads;
pub mod seams;
mod shape;

pub use quads::{QuadQuality, eta_of_pair};

use crate::bvh::TriangleBvh;
use crate::diagnose::topology_numbers;
use crate::error::{EngineError, MAX_LOCATIONS, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::work::Work;

/// Wanted edge length for the size measures.
#[derive(Debug, Clone, PartialEq)]
pub enum TargetSize {
    /// One length everywhere.
    Uniform(f64),
    /// A length at each vertex of the output.
    PerVertex(Vec<f64>),
    /// A tensor at each vertex of the output (`xx xy xz yy yz zz`), whose quadratic form is the squared length in elements.
    Metric(Vec<[f64; 6]>),
}

/// Shape and size of the elements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShapeQuality {
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Smallest kappa (P1 eq. 3).
    pub kappa_min: f64,
    /// Mean kappa.
    pub kappa_mean: f64,
    /// First percentile of kappa.
    pub kappa_p01: f64,
    /// Counts of kappa in 20 equal bins of `[0, 1]`.
    pub kappa_histogram: Vec<u64>,
    /// Smallest angle, degrees.
    pub min_angle_deg: f64,
    /// Mean over the triangles of their smallest angle, degrees.
    pub mean_min_angle_deg: f64,
    /// Largest angle, degrees.
    pub max_angle_deg: f64,
    /// Equiangle skewness, mean (0 is best).
    pub skewness_mean: f64,
    /// Equiangle skewness, largest.
    pub skewness_max: f64,
    /// Efficiency index in percent (P1 eq. 5); `None` without a target size.
    pub tau: Option<f64>,
    /// Share of edges with length over size in [1/sqrt 2, sqrt 2]; `None` without a target size.
    pub edge_ratio_ok: Option<f64>,
}

/// Topological numbers of a mesh that need not be manifold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TopologyNumbers {
    /// V - E + F.
    pub euler: i64,
    /// Connected components.
    pub components: u32,
    /// Boundary loops.
    pub boundary_loops: u32,
    /// Handles, if manifold and orientable.
    pub genus: Option<u32>,
    /// Edges with more than two faces.
    pub non_manifold_edges: u32,
    /// Vertices with more than one fan.
    pub non_manifold_vertices: u32,
    /// Edges along which both faces run the same way.
    pub inconsistent_edges: u32,
}

/// Distances between output and input, and what else compares them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fidelity {
    /// Diagonal of the input's bounding box, to which the distances are relative.
    pub diagonal: f64,
    /// Largest distance, two-sided, over `diagonal`.
    pub hausdorff_max_rel: f64,
    /// Root mean square distance (area integral, both directions averaged), over `diagonal`.
    pub hausdorff_rms_rel: f64,
    /// Largest distance output to input, over `diagonal`.
    pub out_to_in_max_rel: f64,
    /// Largest distance input to output, over `diagonal`.
    pub in_to_out_max_rel: f64,
    /// Largest distance between the boundary curves, two-sided, over `diagonal`; `None` if one has no boundary.
    pub boundary_deviation_rel: Option<f64>,
    /// Output area over input area.
    pub area_ratio: f64,
}

/// The whole report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct QualityReport {
    /// Elements of the output.
    pub shape: ShapeQuality,
    /// Elements of the input, for comparison.
    pub input_shape: ShapeQuality,
    /// Distances; `None` if they were not asked for.
    pub fidelity: Option<Fidelity>,
    /// Topology of the input.
    pub topology_input: TopologyNumbers,
    /// Topology of the output.
    pub topology_output: TopologyNumbers,
    /// Whether topology is the same and nothing became non-manifold.
    pub topology_kept: bool,
    /// Pairs of output faces that meet in more than what they share; `None` if not asked for.
    pub self_intersections: Option<u64>,
    /// Some of those pairs, at most [`crate::error::MAX_LOCATIONS`].
    pub intersecting_pairs: Vec<[u32; 2]>,
    /// The quadrangles, if the output has any.
    pub quads: Option<QuadQuality>,
    /// The worst faces by kappa, worst first, at most 20.
    pub worst_faces: Vec<u32>,
    /// Elements at seams between patches apart from the others; `None` where no patches are known (two files are compared).
    pub seams: Option<seams::SeamQuality>,
}

/// A mesh to measure.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredMesh<'a> {
    /// The mesh.
    pub mesh: &'a SurfaceMesh,
    /// How many pairs of its first faces are halves of quadrangles (see [`crate::optimize::Remeshed::quads`]).
    pub quads: u32,
}

impl<'a> From<&'a SurfaceMesh> for MeasuredMesh<'a> {
    fn from(mesh: &'a SurfaceMesh) -> Self {
        MeasuredMesh { mesh, quads: 0 }
    }
}

/// What to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QualityScope {
    /// Elements and topology only: O(F).
    Elements,
    /// Also distances and self-intersections: O(F log F).
    Full,
}

impl Contents for QualityReport {
    fn feed(&self, into: &mut Feeder) {
        into.text(&format!("{self:?}"));
    }

    fn bytes(&self) -> usize {
        2048
    }
}

/// Measures `output` against `input`. Lengths in the size field are integrals of 1 / size along the edge, the size being linear on
/// it (P1 eq. 6). Distances: the maximum runs over vertices, edge midpoints, centroids and samples, mean squares over the samples only
/// (spread evenly over the area, the same at every call); both directions.
///
/// # Errors
/// Cancellation; [`crate::error::Reason::BadParameter`] for a target size of the wrong length or with a size that is not positive.
pub fn measure_quality<'a>(
    input: &SurfaceMesh,
    input_bvh: &TriangleBvh,
    output: impl Into<MeasuredMesh<'a>>,
    target: Option<&TargetSize>,
    scope: QualityScope,
    work: &Work<'_>,
) -> Result<QualityReport> {
    let MeasuredMesh { mesh: output, quads } = output.into();
    check_target(target, output)?;
    if quads as usize > output.triangles.len() / 2 {
        return Err(EngineError::bad_parameter("quads", "there are not two faces for each"));
    }
    let output_edges = edges::edge_table(output);
    work.check()?;
    let input_edges = edges::edge_table(input);
    work.check()?;
    let mut report = QualityReport { shape: shape::measure_shape(output, &output_edges, target), ..QualityReport::default() };
    work.check()?;
    report.input_shape = shape::measure_shape(input, &input_edges, None);
    work.check()?;
    report.topology_input = topology_numbers(&input.triangles, input.positions.len());
    work.check()?;
    report.topology_output = topology_numbers(&output.triangles, output.positions.len());
    work.check()?;
    report.quads = (quads > 0).then(|| quads::measure_quads(output, quads as usize, &output_edges, target));
    report.worst_faces = shape::worst_faces(output, 20);
    report.topology_kept = topology_kept(&report.topology_input, &report.topology_output);
    work.step(1, 10)?;
    if scope == QualityScope::Full {
        let output_bvh = TriangleBvh::build(&output.positions, &output.triangles);
        work.step(2, 10)?;
        let (count, pairs) = intersect::self_intersections(output, &output_bvh, MAX_LOCATIONS, work)?;
        (report.self_intersections, report.intersecting_pairs) = (Some(count), pairs);
        work.step(3, 10)?;
        let a = distance::Side { mesh: input, bvh: input_bvh, edges: &input_edges };
        let b = distance::Side { mesh: output, bvh: &output_bvh, edges: &output_edges };
        report.fidelity = Some(distance::measure_fidelity(&a, &b, target, work)?);
    }
    work.step(10, 10)?;
    Ok(report)
}

fn check_target(target: Option<&TargetSize>, output: &SurfaceMesh) -> Result<()> {
    let bad = |message: String| Err(EngineError::bad_parameter("target", message));
    let positive = |s: &f64| s.is_finite() && *s > 0.0;
    match target {
        Some(TargetSize::Uniform(size)) if !positive(size) => bad(format!("size {size} is not positive")),
        Some(TargetSize::PerVertex(sizes)) if sizes.len() != output.positions.len() => {
            bad(format!("{} sizes for {} vertices", sizes.len(), output.positions.len()))
        }
        Some(TargetSize::Metric(tensors)) if tensors.len() != output.positions.len() => {
            bad(format!("{} tensors for {} vertices", tensors.len(), output.positions.len()))
        }
        Some(TargetSize::PerVertex(sizes)) => match sizes.iter().position(|s| !positive(s)) {
            Some(v) => bad(format!("size {} at vertex {v} is not positive", sizes[v])),
            None => Ok(()),
        },
        _ => Ok(()),
    }
}

/// Same numbers, and nothing that became non-manifold or inconsistent.
fn topology_kept(before: &TopologyNumbers, after: &TopologyNumbers) -> bool {
    let numbers = |t: &TopologyNumbers| (t.euler, t.components, t.boundary_loops, t.genus);
    numbers(before) == numbers(after)
        && after.non_manifold_edges <= before.non_manifold_edges
        && after.non_manifold_vertices <= before.non_manifold_vertices
        && after.inconsistent_edges <= before.inconsistent_edges
}

#[cfg(test)]
mod tests;
