//! Which lengths the meshers make: the sizes of the session, and the metric of the anisotropic mesher, a stage of its own.

use crate::curvature::curvature;
use crate::curve::{Curve, CurvePolyline, curve_polyline, curve_polyline_in_metric};
use crate::mesh::SurfaceMesh;
use crate::metric::{SurfaceMetric, evaluate_metric};
use crate::patch::{Patch, PatchMap};
use crate::pipeline::Charts;
use crate::pipeline::context::{Context, Step};
use crate::planar::Mesher;
use crate::session::Snapshot;
use crate::sizing::SizeField;
use crate::stage::{Stage, StageKey, Stored, Subject};
use crate::topology::Topology;
use crate::vector::Vec3;

/// Passes over the curvatures of neighbours before a metric is made of them: scans are noisy.
const CURVATURE_SMOOTHING: u32 = 3;

/// The metric of the anisotropic mesher; `None` for the others.
pub(in crate::pipeline) fn metric_step(
    context: &Context<'_>,
    snapshot: &Snapshot,
    charts: &Charts,
    sizes: &Stored<SizeField>,
) -> Step<Option<Stored<SurfaceMetric>>> {
    if snapshot.mesher != Mesher::Anisotropic {
        return Ok(None);
    }
    let (surface, features, spec) = (&charts.surface, &charts.features, &snapshot.metric);
    let key = StageKey::new(Stage::Metric, |f| {
        f.fingerprint(surface.imported.output).fingerprint(features.output).fingerprint(sizes.output);
        spec.feed(f);
    });
    let metric = context.stage(key, Subject::Surface, |work| {
        let mesh = &surface.imported.mesh;
        let curvature = curvature(mesh, &surface.topology, features, CURVATURE_SMOOTHING, work)?;
        evaluate_metric(mesh, &surface.topology, features, &curvature, sizes, spec, work)
    })?;
    Ok(Some(metric))
}

/// What a mesh is made to: sizes, and the metric of the anisotropic mesher.
#[derive(Clone, Copy)]
pub(in crate::pipeline) struct Wanted<'a> {
    /// Lengths at the vertices of the imported surface; while patches are meshed, at those of the surface the patches are cut out of.
    pub(super) vertex_size: &'a [f64],
    /// Whether each vertex of the imported surface stays; empty if none does. Vertices that a cut made are never locked.
    pub(super) locked: &'a [bool],
    pub(super) metric: Option<&'a SurfaceMetric>,
}

impl<'a> Wanted<'a> {
    pub(in crate::pipeline) fn new(sizes: &'a SizeField, metric: Option<&'a SurfaceMetric>) -> Self {
        Wanted { vertex_size: &sizes.vertex_size, locked: &sizes.locked, metric }
    }

    /// Length at each vertex, the smallest of all directions.
    pub(super) fn of_vertices(&self, mesh: &SurfaceMesh) -> Vec<f64> {
        match self.metric {
            None => self.vertex_size.to_vec(),
            Some(metric) => (0..mesh.positions.len() as u32).map(|v| metric.smallest_length(v)).collect(),
        }
    }

    /// A curve of the surface the patches are cut out of, with the lengths wanted along it.
    pub(super) fn polyline(&self, charts: &Charts, mesh: &SurfaceMesh, topology: &Topology, curve: &Curve) -> CurvePolyline {
        let Some(metric) = self.metric else { return curve_polyline(mesh, topology, curve, self.vertex_size, self.locked) };
        let before = charts.surface.imported.mesh.positions.len();
        let split = |v: u32| charts.cut.as_ref().and_then(|cut| cut.new_vertices.get((v as usize).checked_sub(before)?));
        let along = |v: u32, direction: Vec3| match split(v) {
            None => metric.length_along(v, direction),
            Some(p) => {
                let [a, b] = p.ends.map(|v| metric.length_along(v, direction));
                a + p.t * (b - a)
            }
        };
        curve_polyline_in_metric(mesh, topology, curve, self.vertex_size, self.locked, &along)
    }

    /// The metric at the corners of the faces of a patch.
    pub(super) fn tensors(&self, charts: &Charts, patch: &Patch, map: &PatchMap) -> Option<Vec<[[f64; 6]; 3]>> {
        let (metric, imported) = (self.metric?, &charts.surface.imported.mesh);
        let places = patch.triangles.iter().map(|t| t.map(|v| patch.positions[v as usize]));
        Some(map.faces.iter().zip(places).map(|(&f, places)| metric.on_piece(imported, f, places)).collect())
    }
}
