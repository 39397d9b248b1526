//! Meshing a chart: frontal Delaunay in the plane under the metric of the map (P1 eq. 2) and the size field, then the lift of the
//! planar mesh to the input surface.

use crate::curve::CurveMesh;
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::parametrize::Chart;
use crate::patch::Patch;
use crate::topology::Topology;
use crate::vector::{Vec2, Vec3, triangle_area};
use crate::work::Work;
use frontal::Filled;
use std::collections::BTreeMap;

mod adapt;
mod boundary;
mod delaunay;
mod flexible;
mod frontal;
mod locate;
mod metric;
mod reduce;
mod smooth;
mod triangulation;

/// A curve as one patch sees it: a boundary curve of the patch, or a feature inside it.
#[derive(Debug, Clone)]
pub struct CurveUse<'a> {
    /// Local vertices of the patch along the curve in the direction of `mesh` (the polyline's points).
    /// A curve with the patch on both sides that is a border (not inside) comes twice, once for each side.
    pub path: Vec<u32>,
    /// The shared one-dimensional mesh.
    pub mesh: &'a CurveMesh,
    /// Number of the curve in the network; only carried to the origin of the vertices.
    pub curve: u32,
}

/// Where a vertex of a patch mesh comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VertexOrigin {
    /// Point `point` of the mesh of curve `curve` of the network.
    Curve {
        /// Curve of the network.
        curve: u32,
        /// Index in [`CurveMesh::points`].
        point: u32,
    },
    /// Inside the patch.
    Interior,
}

/// A point on a face of the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Face.
    pub face: u32,
    /// Barycentric coordinates, not negative, of sum 1.
    pub barycentric: [f64; 3],
}

/// The mesh of a chart in the plane. Every curve point is a vertex, every curve edge is an edge.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanarMesh {
    /// Vertices in the plane.
    pub uv: Vec<Vec2>,
    /// Counter-clockwise triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Where each vertex comes from.
    pub origins: Vec<VertexOrigin>,
    /// Where each vertex lies on the patch (local face).
    pub points: Vec<SurfacePoint>,
}

impl Contents for PlanarMesh {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.uv).tuples(&self.triangles);
    }

    fn bytes(&self) -> usize {
        self.uv.len() * (16 + 40 + 12) + self.triangles.len() * 12
    }
}

/// A patch mesh in space, with the same vertices and triangles as its planar mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LiftedPatch {
    /// Vertices in space, on the input surface.
    pub positions: Vec<Vec3>,
    /// Triangles, oriented like the patch.
    pub triangles: Vec<[u32; 3]>,
    /// Where each vertex comes from.
    pub origins: Vec<VertexOrigin>,
    /// Where each vertex lies on the patch (local face).
    pub points: Vec<SurfacePoint>,
}

impl Contents for LiftedPatch {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles).u64(self.origins.len() as u64);
        for origin in &self.origins {
            match *origin {
                VertexOrigin::Interior => into.u64(0),
                VertexOrigin::Curve { curve, point } => into.u64(1).u64(u64::from(curve)).u64(u64::from(point)),
            };
        }
        into.u64(self.points.len() as u64);
        for point in &self.points {
            into.u64(u64::from(point.face)).points(&[point.barycentric]);
        }
    }

    fn bytes(&self) -> usize {
        self.positions.len() * (24 + 40 + 12) + self.triangles.len() * 12
    }
}

/// Planar mesher options.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Mesher {
    /// Delaunay with points placed from the front (Rebay 1993), the default.
    #[default]
    Frontal,
    /// Delaunay refinement (Ruppert, Chew): circumcentres of triangles too large or too sharp.
    Delaunay {
        /// Least angle on the surface, in degrees, from 0 to [`MAX_MIN_ANGLE_DEG`]; held but where curves leave no choice.
        min_angle_deg: f64,
    },
    /// Local operations under the metric: split, collapse, swap, smooth.
    MeshAdapt,
    /// Follows a metric that asks for different lengths in different directions (see [`crate::metric`]).
    Anisotropic,
    /// Frontal triangles, of which quadrangles are made on the whole surface (see [`crate::quads`]).
    Quads(QuadKind),
}

/// What becomes of triangles that find no partner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum QuadKind {
    /// They stay: the result has quadrangles and a few triangles.
    #[default]
    Mixed,
    /// None is left, but where a part between curves is too narrow or all its edges are locked: the matching is perfect, after single edges
    /// of curves were split where a part between curves has an odd number.
    All,
}

/// Largest least angle that Delaunay refinement can be asked for, in degrees: beyond it need not end.
pub const MAX_MIN_ANGLE_DEG: f64 = 33.0;
/// Least angle of [`Mesher::Delaunay`] where none is named, in degrees.
pub const DEFAULT_MIN_ANGLE_DEG: f64 = 28.0;

impl Mesher {
    /// The kind of quadrangles it makes, if it does.
    pub fn quads(self) -> Option<QuadKind> {
        match self {
            Mesher::Quads(kind) => Some(kind),
            _ => None,
        }
    }

    /// The mesher that meshes the charts: quadrangles are made of frontal triangles, and share them.
    pub fn of_charts(self) -> Mesher {
        if self.quads().is_some() { Mesher::Frontal } else { self }
    }

    /// # Errors
    /// [`Reason::BadParameter`](crate::error::Reason::BadParameter) for a least angle out of range.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Mesher::Delaunay { min_angle_deg } if !(0.0..=MAX_MIN_ANGLE_DEG).contains(&min_angle_deg) => {
                Err(EngineError::bad_parameter("mesher.min_angle", format!("{min_angle_deg} is not in [0, {MAX_MIN_ANGLE_DEG}]")))
            }
            _ => Ok(()),
        }
    }
}

/// Rounds of smoothing in the plane after the front has closed.
const SMOOTHING_ROUNDS: usize = 3;
/// The same after refinement, which leaves less even triangles.
const DELAUNAY_SMOOTHING_ROUNDS: usize = 6;

/// A patch mesh of more than this many times the vertices that the area of the patch asks for is not one of the chart.
const VERTICES_OVER_WANTED: f64 = 4.0;

/// Most vertices of a mesh of a patch: what its area asks for at the wanted lengths, several times over, and its curves.
fn most_vertices(patch: &Patch, vertex_size: &[f64], curves: &[CurveUse<'_>]) -> usize {
    let on_curves: usize = curves.iter().map(|c| c.mesh.points.len()).sum();
    let wanted: f64 = patch
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| patch.positions[v as usize]);
            let size = t.iter().map(|&v| vertex_size[v as usize]).sum::<f64>() / 3.0;
            // Twice the area of an equilateral triangle for each vertex.
            triangle_area(a, b, c) / (0.75f64.sqrt() * size * size)
        })
        .sum();
    64 + 4 * on_curves + (VERTICES_OVER_WANTED * wanted) as usize
}

/// Meshes a chart. `vertex_size` is the wanted length in space at each patch vertex. Deterministic; near-linear.
///
/// Always delivers a mesh of the patch's topology with exactly the curve points on its boundary and curves, at any size: where
/// chords of the curve points cross in the chart the mesh is made with more boundary vertices, which are then collapsed
/// away in space. Around such places triangles of the result may overlap in the plane and are not pretty.
///
/// # Errors
/// [`Reason::Invariant`](crate::error::Reason::Invariant) if the curves do not fit the patch;
/// [`Reason::PlanarMeshFailed`](crate::error::Reason::PlanarMeshFailed) if a boundary loop has fewer than three points; cancellation.
pub fn mesh_chart(
    patch: &Patch,
    chart: &Chart,
    curves: &[CurveUse<'_>],
    vertex_size: &[f64],
    mesher: Mesher,
    work: &Work<'_>,
) -> Result<PlanarMesh> {
    mesh_chart_in(patch, chart, curves, &Lengths { vertex_size, tensors: None }, mesher, work)
}

/// Which lengths are wanted on a patch.
#[derive(Debug, Clone, Copy)]
pub struct Lengths<'a> {
    /// Wanted length in space at each patch vertex; with tensors the smallest of all directions.
    pub vertex_size: &'a [f64],
    /// Tensors at the corners of each face (`xx xy xz yy yz zz`), in the plane of the face, whose quadratic form is the squared length in
    /// elements; `None` where all directions are alike.
    pub tensors: Option<&'a [[[f64; 6]; 3]]>,
}

/// The same under a metric with directions of its own.
///
/// # Errors
/// Those of [`mesh_chart`]; [`Reason::Invariant`](crate::error::Reason::Invariant) for arrays that do not fit the patch.
pub fn mesh_chart_in(
    patch: &Patch,
    chart: &Chart,
    curves: &[CurveUse<'_>],
    lengths: &Lengths<'_>,
    mesher: Mesher,
    work: &Work<'_>,
) -> Result<PlanarMesh> {
    let vertex_size = lengths.vertex_size;
    if vertex_size.len() != patch.positions.len() || lengths.tensors.is_some_and(|t| t.len() != patch.triangles.len()) {
        return Err(EngineError::invariant("the lengths are not of this patch"));
    }
    mesher.validate()?;
    work.check()?;
    let topology = Topology::build(&patch.triangles, patch.positions.len())?;
    let mut outline = boundary::Outline::new(patch, &chart.uv, &topology, curves)?;
    let locator = locate::Locator::new(patch, &chart.uv, &topology);
    let field = metric::MetricField::new(patch, &chart.uv, vertex_size, lengths.tensors);
    let most = most_vertices(patch, vertex_size, curves);
    let domain = frontal::Domain { locator: &locator, field: &field, most };
    let (mesh, points) = loop {
        let Some(mut mesh) = outline.triangulate(patch, &chart.uv, &topology, curves, work)? else {
            return reduce::from_patch(patch, &chart.uv, &topology, curves, vertex_size, &locator, work);
        };
        mesh.metric = outline.metrics(&locator, &field);
        let first_free = mesh.uv.len();
        let mut points = outline.points.clone();
        mesh.flip_all();
        if fill(mesher, &domain, &mut mesh, &mut points, first_free, work)? == Filled::Whole {
            break (mesh, points);
        }
        // Chords of the curves leave the chart, where squeezed faces beside it stand for the metric: follow the curves more closely.
        if outline.refine_all(&chart.uv, &topology, curves)? == 0 {
            return reduce::from_patch(patch, &chart.uv, &topology, curves, vertex_size, &locator, work);
        }
    };
    let mut origins = std::mem::take(&mut outline.origins);
    origins.resize(mesh.uv.len(), VertexOrigin::Interior);
    let planar = PlanarMesh { uv: mesh.uv, triangles: mesh.tri, origins, points };
    if outline.extra.iter().any(|e| *e) {
        return reduce::without_extra(patch, planar, &outline, curves, &locator, work);
    }
    Ok(planar)
}

/// Fills the triangulated outline by one of the meshers. Vertices before `first_free` lie on curves. All stop at the same bound.
fn fill(
    mesher: Mesher,
    domain: &frontal::Domain<'_>,
    mesh: &mut triangulation::Triangulation,
    points: &mut Vec<SurfacePoint>,
    first_free: usize,
    work: &Work<'_>,
) -> Result<Filled> {
    if matches!(mesher, Mesher::Frontal | Mesher::Quads(_) | Mesher::Anisotropic)
        && frontal::fill(domain, mesh, points, work)? == Filled::TooMany
    {
        return Ok(Filled::TooMany);
    }
    match mesher {
        Mesher::Frontal | Mesher::Quads(_) => {
            smooth::smooth(domain, mesh, points, first_free, smooth::Smoothing::plain(SMOOTHING_ROUNDS), work)?;
        }
        Mesher::Delaunay { min_angle_deg } => {
            delaunay::refine(domain, mesh, points, min_angle_deg, delaunay::Goal::SizeAndAngle, work)?;
            let how =
                smooth::Smoothing { rounds: DELAUNAY_SMOOTHING_ROUNDS, aim: smooth::Aim::Mean, guard: smooth::Guard::Angle(min_angle_deg) };
            smooth::smooth(domain, mesh, points, first_free, how, work)?;
            delaunay::refine(domain, mesh, points, min_angle_deg, delaunay::Goal::Angle, work)?;
        }
        Mesher::MeshAdapt => adapt::adapt(domain, mesh, points, first_free, smooth::Aim::Mean, work)?,
        Mesher::Anisotropic => adapt::adapt(domain, mesh, points, first_free, smooth::Aim::UnitEdges, work)?,
    }
    Ok(if mesh.uv.len() > domain.most { Filled::TooMany } else { Filled::Whole })
}

/// Point in space of a point on a face of a patch.
pub fn point_in_space(patch: &Patch, point: &SurfacePoint) -> Vec3 {
    let [a, b, c] = patch.triangles[point.face as usize].map(|v| patch.positions[v as usize]);
    let [x, y, z] = point.barycentric;
    std::array::from_fn(|k| x * a[k] + y * b[k] + z * c[k])
}

/// Lifts a planar mesh to space: curve points take the positions of the curve mesh bit for bit, others lie on their face.
pub fn lift(patch: &Patch, planar: &PlanarMesh, curves: &[CurveUse<'_>]) -> LiftedPatch {
    let by_number: BTreeMap<u32, &CurveMesh> = curves.iter().map(|c| (c.curve, c.mesh)).collect();
    let place = |(origin, point): (&VertexOrigin, &SurfacePoint)| match *origin {
        VertexOrigin::Curve { curve, point: i } if by_number.contains_key(&curve) => by_number[&curve].points[i as usize].position,
        _ => point_in_space(patch, point),
    };
    LiftedPatch {
        positions: planar.origins.iter().zip(&planar.points).map(place).collect(),
        triangles: planar.triangles.clone(),
        origins: planar.origins.clone(),
        points: planar.points.clone(),
    }
}

#[cfg(test)]
mod tests;
