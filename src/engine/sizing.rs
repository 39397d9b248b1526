//! Size fields: the wanted edge length at every vertex of the input surface.

mod check;
mod compose;
mod cone;
mod measure;
mod place;
mod spec;

pub use measure::{MeasureSpec, Measured, measure};
pub use spec::{
    Centerline, CenterlineMeasure, CenterlineSize, ComposedSize, CurvatureSize, DistanceSize, DistanceSource, MAX_FIELDS, MAX_POINTS,
    ProximitySize, RegionChoice, Shape, ShapeSize, Sides, SizeBase, SizeFieldSpec, SizeSpec,
};

use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder, Fingerprint};
use crate::lock::{LockSpec, locked_sizes, locked_vertices};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{angle_between, area_vector_twice, distance};
use crate::work::Work;
use check::{ordered, positive, slope};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Wanted edge length at each vertex of the input surface; linear inside faces.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeField {
    /// One positive length per vertex.
    pub vertex_size: Vec<f64>,
    /// The common value, if all are equal.
    pub uniform: Option<f64>,
    /// By what the fields were multiplied to meet a number of triangles ([`SizeBase::Triangles`]); 1 if they were taken as they are.
    pub fields_scaled_by: f64,
    /// For each vertex whether it is locked; empty if none is.
    pub locked: Vec<bool>,
}

impl Default for SizeField {
    fn default() -> Self {
        SizeField { vertex_size: Vec::new(), uniform: None, fields_scaled_by: 1.0, locked: Vec::new() }
    }
}

impl SizeField {
    /// A field from its lengths.
    pub fn new(vertex_size: Vec<f64>) -> SizeField {
        let first = vertex_size.first().copied();
        let uniform = first.filter(|f| vertex_size.iter().all(|s| s == f));
        SizeField { vertex_size, uniform, ..SizeField::default() }
    }

    /// Feeds which vertices are locked.
    pub fn feed_locked(&self, into: &mut Feeder) {
        into.raw(&self.locked.iter().map(|&l| u8::from(l)).collect::<Vec<u8>>());
    }
}

/// What a size specification is evaluated on.
pub struct SizeInput<'a> {
    /// The surface.
    pub mesh: &'a SurfaceMesh,
    /// Its adjacency.
    pub topology: &'a Topology,
    /// Its features.
    pub features: &'a Features,
    /// Vertices of the patch of this identity, if the partition has it.
    pub patch_vertices: &'a (dyn Fn(Fingerprint) -> Option<&'a [u32]> + 'a),
    /// For each field of a composed specification what [`SizeFieldSpec::measure`] asks for, taken by [`measure()`].
    pub measured: &'a [Option<&'a Measured>],
}

impl Contents for SizeField {
    fn feed(&self, into: &mut Feeder) {
        into.f64s(&self.vertex_size);
        self.feed_locked(into);
    }

    fn bytes(&self) -> usize {
        self.vertex_size.len() * 8 + self.locked.len()
    }
}

/// Most triangles a size field may ask for (about area / (sqrt(3)/4 size^2), or half of the elements along boundary and features); more is
/// refused with [`Reason::LimitReached`].
pub const MAX_EXPECTED_TRIANGLES: f64 = 2.0e7;

/// Evaluates a size specification. O(F log F) with growth or distances, else O(F).
///
/// Growth: along the surface (measured along mesh edges) lengths grow at most by `ln(growth_rate)` per unit of distance, which is
/// the law under which the lengths of neighbouring elements have the ratio `growth_rate`.
///
/// # Errors
/// [`Reason::BadParameter`] for lengths that are not positive and finite, a wrong array length, `min_size > max_size`, a growth
/// rate below 1, and what else [`SizeSpec::validate`] refuses; [`Reason::LimitReached`] if more than [`MAX_EXPECTED_TRIANGLES`] would
/// result.
pub fn evaluate_size(input: &SizeInput<'_>, spec: &SizeSpec, work: &Work<'_>) -> Result<SizeField> {
    work.check()?;
    spec.validate()?;
    let &SizeInput { mesh, topology, features, .. } = input;
    let count = mesh.positions.len();
    let field = match spec {
        SizeSpec::Uniform { size } => SizeField::new(vec![positive("uniform.size", *size)?; count]),
        SizeSpec::TriangleCount { triangles } => {
            SizeField::new(vec![size_for_count("triangle_count.triangles", input, *triangles)?; count])
        }
        SizeSpec::PerVertex { sizes, min_size, max_size, growth_rate } => {
            let mut field = clamped(sizes, count, *min_size, *max_size)?;
            if let Some(rate) = growth_rate {
                limit_growth(mesh, topology, &mut field, slope("per_vertex.growth_rate", *rate)?, work)?;
            }
            SizeField::new(field)
        }
        SizeSpec::Graded { min_size, max_size, growth_rate } => {
            let low = positive("graded.min_size", *min_size)?;
            let high = positive("graded.max_size", *max_size)?;
            ordered(low, high)?;
            let slope = slope("graded.growth_rate", *growth_rate)?;
            if slope <= 0.0 {
                return Err(EngineError::bad_parameter("graded.growth_rate", "must be above 1"));
            }
            let mut field = vec![high; count];
            for v in graded_sources(mesh, topology, features) {
                field[v as usize] = low;
            }
            limit_growth(mesh, topology, &mut field, slope, work)?;
            SizeField::new(field)
        }
        SizeSpec::Composed(composed) => compose::composed(input, composed, work)?,
    };
    check_count(expected(input, &field.vertex_size))?;
    Ok(field)
}

/// The length at which about so many triangles are expected, see [`expected`].
fn size_for_count(name: &str, input: &SizeInput<'_>, triangles: u64) -> Result<f64> {
    if triangles == 0 {
        return Err(EngineError::bad_parameter(name, "must be at least 1"));
    }
    let by_area = (input.mesh.area() / triangles as f64 * 4.0 / 3f64.sqrt()).sqrt();
    let unit = vec![1.0; input.mesh.positions.len()];
    let by_curves = triangles_at_curves(input.mesh, input.topology, Some(input.features), &unit) / triangles as f64;
    positive(name, by_area.max(by_curves))
}

/// How many triangles a field asks for at least, about: by the area, or by the curves where the surface is narrower than the elements are long.
fn expected(input: &SizeInput<'_>, vertex_size: &[f64]) -> f64 {
    let at_curves = triangles_at_curves(input.mesh, input.topology, Some(input.features), vertex_size);
    expected_triangles(input.mesh, vertex_size).max(at_curves)
}

/// About how many triangles lie along boundary and feature edges: half of their sides, as strips between two curves have a triangle a side and
/// corners may share them.
fn triangles_at_curves(mesh: &SurfaceMesh, topology: &Topology, features: Option<&Features>, vertex_size: &[f64]) -> f64 {
    let is_side = |h: &u32| topology.twin(*h).is_none() || features.is_some_and(|features| features.is_feature[*h as usize]);
    let elements = |h: u32| {
        let [a, b] = [topology.origin(h), topology.target(h)].map(|v| v as usize);
        distance(mesh.positions[a], mesh.positions[b]) / (0.5 * (vertex_size[a] + vertex_size[b]))
    };
    0.5 * (0..topology.halfedge_count() as u32).filter(is_side).map(elements).sum::<f64>()
}

fn clamped(sizes: &[f64], count: usize, low: Option<f64>, high: Option<f64>) -> Result<Vec<f64>> {
    if sizes.len() != count {
        return Err(EngineError::bad_parameter("per_vertex.sizes", format!("{} lengths for {count} vertices", sizes.len())));
    }
    if let Some(bad) = sizes.iter().position(|s| !(s.is_finite() && *s > 0.0)) {
        let message = format!("length {} of vertex {bad} is not positive and finite", sizes[bad]);
        return Err(EngineError::bad_parameter("per_vertex.sizes", message));
    }
    let low = low.map_or(Ok(0.0), |l| positive("per_vertex.min_size", l))?;
    let high = high.map_or(Ok(f64::INFINITY), |h| positive("per_vertex.max_size", h))?;
    ordered(low, high)?;
    Ok(sizes.iter().map(|s| s.clamp(low, high)).collect())
}

/// The ratio of lengths of neighbouring elements next to locked edges, if the specification names none.
pub const GROWTH_AT_LOCKED_EDGES: f64 = 1.3;

/// The field with locked vertices: at those whose boundary edges stay, the length is that of the edges; from there it grows or shrinks by
/// `growth_rate` (default [`GROWTH_AT_LOCKED_EDGES`]). Bounds do not hold there.
///
/// # Errors
/// Those of [`locked_vertices`]; [`Reason::LimitReached`] as in [`evaluate_size`].
pub fn with_locked(
    mesh: &SurfaceMesh,
    topology: &Topology,
    field: SizeField,
    lock: &LockSpec,
    growth_rate: Option<f64>,
    work: &Work<'_>,
) -> Result<SizeField> {
    let locked = locked_vertices(mesh, topology, lock)?;
    if !locked.contains(&true) {
        return Ok(field);
    }
    let mut vertex_size = field.vertex_size;
    let slope = slope("growth_rate", growth_rate.unwrap_or(GROWTH_AT_LOCKED_EDGES))?;
    let own = locked_sizes(mesh, topology, &locked);
    raise_around(mesh, topology, &mut vertex_size, &own, slope.max(GROWTH_AT_LOCKED_EDGES.ln()), work)?;
    for (size, own) in vertex_size.iter_mut().zip(own) {
        *size = own.unwrap_or(*size);
    }
    limit_growth(mesh, topology, &mut vertex_size, slope, work)?;
    check_count(expected_triangles(mesh, &vertex_size).max(triangles_at_curves(mesh, topology, None, &vertex_size)))?;
    Ok(SizeField { locked, fields_scaled_by: field.fields_scaled_by, ..SizeField::new(vertex_size) })
}

/// About how many triangles a field asks for: the integral of ds / (sqrt(3)/4 size^2), by the midpoints of the sides of each face.
pub fn expected_triangles(mesh: &SurfaceMesh, vertex_size: &[f64]) -> f64 {
    let per_face = |f: usize| {
        let [a, b, c] = mesh.corners(f);
        let [x, y, z] = mesh.triangles[f].map(|v| vertex_size[v as usize]);
        let squares = [x + y, y + z, z + x].map(|twice| 1.0 / (0.25 * twice * twice));
        crate::vector::triangle_area(a, b, c) * (squares[0] + squares[1] + squares[2]) / (0.75 * 3f64.sqrt())
    };
    (0..mesh.triangles.len()).map(per_face).sum()
}

/// Refuses fields that ask for too many triangles.
fn check_count(expected: f64) -> Result<()> {
    if expected <= MAX_EXPECTED_TRIANGLES {
        return Ok(());
    }
    Err(EngineError::new(
        Reason::LimitReached,
        format!("the sizes ask for about {expected:.3e} triangles, the limit is {MAX_EXPECTED_TRIANGLES:e}"),
    )
    .with_hint("ask for larger sizes")
    .with_metadata("expected_triangles", expected)
    .with_metadata("limit", MAX_EXPECTED_TRIANGLES))
}

/// Vertices where a graded field is finest: those on feature and boundary edges, in a component without any its flattest vertex.
fn graded_sources(mesh: &SurfaceMesh, topology: &Topology, features: &Features) -> Vec<u32> {
    let mut sources = Vec::new();
    let mut has_source = vec![false; topology.components.len()];
    for h in 0..topology.halfedge_count() as u32 {
        if features.is_feature[h as usize] || topology.twin(h).is_none() {
            sources.extend([topology.origin(h), topology.target(h)]);
            has_source[topology.face_component[topology.face(h) as usize] as usize] = true;
        }
    }
    let mut flattest: Vec<Option<(f64, u32)>> = vec![None; topology.components.len()];
    let normal = |h: u32| {
        let [a, b, c] = mesh.corners(topology.face(h) as usize);
        area_vector_twice(a, b, c)
    };
    for v in 0..topology.vertex_count() as u32 {
        let Some(first) = topology.outgoing(v).next() else { continue };
        let component = topology.face_component[topology.face(first) as usize] as usize;
        if has_source[component] {
            continue;
        }
        let bend = topology.outgoing(v).filter_map(|h| Some(angle_between(normal(h), normal(topology.twin(h)?)))).fold(0.0, f64::max);
        if flattest[component].is_none_or(|(least, _)| bend < least) {
            flattest[component] = Some((bend, v));
        }
    }
    sources.extend(flattest.into_iter().flatten().map(|(_, v)| v));
    sources.sort_unstable();
    sources.dedup();
    sources
}

/// Raises lengths around vertices of given lengths until none is below a neighbour's by more than `slope` times their distance: one sweep
/// in decreasing order of length. O(E log E) of what is raised.
fn raise_around(
    mesh: &SurfaceMesh,
    topology: &Topology,
    sizes: &mut [f64],
    given: &[Option<f64>],
    slope: f64,
    work: &Work<'_>,
) -> Result<()> {
    let mut heap: BinaryHeap<(u64, u32)> = BinaryHeap::new();
    for (v, length) in given.iter().enumerate() {
        if let Some(length) = length.filter(|l| *l > sizes[v]) {
            sizes[v] = length;
            heap.push((length.to_bits(), v as u32));
        }
    }
    let mut done = 0usize;
    while let Some((bits, v)) = heap.pop() {
        if bits != sizes[v as usize].to_bits() {
            continue;
        }
        done += 1;
        if done.is_multiple_of(4096) {
            work.check()?;
        }
        let here = sizes[v as usize];
        for w in neighbours(topology, v) {
            let bound = here - slope * distance(mesh.positions[v as usize], mesh.positions[w as usize]);
            if bound > sizes[w as usize] {
                sizes[w as usize] = bound;
                heap.push((bound.to_bits(), w));
            }
        }
    }
    Ok(())
}

fn neighbours(topology: &Topology, v: u32) -> impl Iterator<Item = u32> + '_ {
    topology.outgoing(v).flat_map(|h| {
        let before = topology.prev(h);
        [Some(topology.target(h)), topology.twin(before).is_none().then(|| topology.origin(before))].into_iter().flatten()
    })
}

/// Lowers lengths until none exceeds a neighbour's by more than `slope` times their distance: one sweep in increasing order
/// of length, as in Dijkstra's algorithm. O(E log E).
fn limit_growth(mesh: &SurfaceMesh, topology: &Topology, sizes: &mut [f64], slope: f64, work: &Work<'_>) -> Result<()> {
    // Positive floats order like their bits.
    let mut heap: BinaryHeap<Reverse<(u64, u32)>> = (0..sizes.len() as u32).map(|v| Reverse((sizes[v as usize].to_bits(), v))).collect();
    let total = sizes.len();
    let mut done = 0usize;
    while let Some(Reverse((bits, v))) = heap.pop() {
        if bits != sizes[v as usize].to_bits() {
            continue;
        }
        done += 1;
        if done.is_multiple_of(4096) {
            work.step(done.min(total), total)?;
        }
        let here = sizes[v as usize];
        for w in neighbours(topology, v) {
            let bound = here + slope * distance(mesh.positions[v as usize], mesh.positions[w as usize]);
            if bound < sizes[w as usize] {
                sizes[w as usize] = bound;
                heap.push(Reverse((bound.to_bits(), w)));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
