//! Engine results to wire messages. Nothing here can fail.

use super::{charts, meshers, patches, sizes, sources};
use crate::status::location;
use remesh_engine::diagnose::{Defect, Diagnosis, Finding};
use remesh_engine::features::{FeatureSpec, RegionBorders};
use remesh_engine::import::{Format, ImportReport};
use remesh_engine::mesh::{LengthUnit, Region, SurfaceMesh};
use remesh_engine::optimize::{OptimizeSpec, SurfaceFit};
use remesh_engine::partition::{BorderSmoothing, PartitionSpec, PartitionStrategy, PatchSummary, Plane};
use remesh_engine::quality::seams::{PartQuality, SeamSplit};
use remesh_engine::quality::{Fidelity, QuadQuality, QualityReport, ShapeQuality, TopologyNumbers};
use remesh_engine::session::Snapshot;
use remesh_engine::stage::{Outcome, StageRecord, Subject};
use remesh_engine::vector::bounds;
use remesh_proto::v1;
use std::time::SystemTime;

pub(crate) fn time(at: SystemTime) -> prost_types::Timestamp {
    at.into()
}

fn point([x, y, z]: [f64; 3]) -> v1::Point {
    v1::Point { x, y, z }
}

pub(crate) fn outcome(outcome: Outcome) -> v1::StageOutcome {
    match outcome {
        Outcome::Hit => v1::StageOutcome::Hit,
        Outcome::Run => v1::StageOutcome::Run,
    }
}

pub(crate) fn subject(subject: Subject) -> String {
    match subject {
        Subject::Surface => String::new(),
        Subject::Patch(number) => format!("patch {number}"),
        Subject::Curve(number) => format!("curve {number}"),
    }
}

pub(crate) fn summary(records: &[StageRecord], milliseconds: f64) -> v1::RunSummary {
    let stages: Vec<_> = records.iter().map(stage_record).collect();
    let hits = records.iter().filter(|r| r.outcome == Outcome::Hit).count() as u32;
    v1::RunSummary { hits, runs: stages.len() as u32 - hits, stages, milliseconds }
}

fn stage_record(record: &StageRecord) -> v1::StageRecord {
    v1::StageRecord {
        stage: record.stage.name().to_owned(),
        subject: subject(record.subject),
        outcome: outcome(record.outcome).into(),
        milliseconds: record.milliseconds,
        bytes: record.bytes,
    }
}

/// A plan: its stages, how many are cached, how many would run, and the sum of the estimated times.
pub(crate) fn plan(records: &[StageRecord]) -> (Vec<v1::PlannedStage>, u32, u32, f64) {
    let hits = records.iter().filter(|r| r.outcome == Outcome::Hit).count() as u32;
    let milliseconds = records.iter().map(|r| r.milliseconds).sum();
    (records.iter().map(planned_stage).collect(), hits, records.len() as u32 - hits, milliseconds)
}

fn planned_stage(record: &StageRecord) -> v1::PlannedStage {
    v1::PlannedStage {
        stage: record.stage.name().to_owned(),
        subject: subject(record.subject),
        outcome: outcome(record.outcome).into(),
        estimated_milliseconds: record.milliseconds,
        bytes: record.bytes,
    }
}

pub(crate) fn unit(unit: LengthUnit) -> v1::LengthUnit {
    match unit {
        LengthUnit::Unspecified => v1::LengthUnit::Unspecified,
        LengthUnit::Metre => v1::LengthUnit::Metre,
        LengthUnit::Centimetre => v1::LengthUnit::Centimetre,
        LengthUnit::Millimetre => v1::LengthUnit::Millimetre,
        LengthUnit::Micrometre => v1::LengthUnit::Micrometre,
        LengthUnit::Inch => v1::LengthUnit::Inch,
        LengthUnit::Foot => v1::LengthUnit::Foot,
    }
}

pub(super) fn format(format: Format) -> v1::MeshFormat {
    match format {
        Format::Stl => v1::MeshFormat::Stl,
        Format::Obj => v1::MeshFormat::Obj,
        Format::Ply => v1::MeshFormat::Ply,
        Format::Off => v1::MeshFormat::Off,
        Format::Msh => v1::MeshFormat::Msh,
        Format::Gltf => v1::MeshFormat::Gltf,
        Format::Vtu => v1::MeshFormat::Vtu,
    }
}

pub(crate) fn regions(regions: &[Region]) -> Vec<v1::Region> {
    regions.iter().map(|r| v1::Region { id: r.id, name: r.name.clone() }).collect()
}

pub(crate) fn mesh_summary(mesh: &SurfaceMesh) -> v1::MeshSummary {
    let corners = bounds(&mesh.positions);
    v1::MeshSummary {
        vertices: mesh.positions.len() as u64,
        faces: mesh.triangles.len() as u64,
        regions: regions(&mesh.regions),
        unit: unit(mesh.unit).into(),
        low: corners.map(|(low, _)| point(low)),
        high: corners.map(|(_, high)| point(high)),
    }
}

pub(crate) fn import_report(report: &ImportReport) -> v1::ImportReport {
    v1::ImportReport {
        format: report.format.clone(),
        faces_read: report.faces_read,
        vertices_read: report.vertices_read,
        vertices_welded: report.vertices_welded,
        duplicate_faces_dropped: report.duplicate_faces_dropped,
        degenerate_faces_dropped: report.degenerate_faces_dropped,
        unused_vertices_dropped: report.unused_vertices_dropped,
        faces_flipped: report.faces_flipped,
        vertices_split: report.vertices_split,
        warnings: report.warnings.clone(),
    }
}

fn finding(finding: &Finding) -> v1::Finding {
    let defect = match finding.defect {
        Defect::NonManifoldEdge => v1::Defect::NonManifoldEdge,
        Defect::NonManifoldVertex => v1::Defect::NonManifoldVertex,
        Defect::NotOrientable => v1::Defect::NotOrientable,
        Defect::FlippedFace => v1::Defect::FlippedFace,
        Defect::DegenerateFace => v1::Defect::DegenerateFace,
        Defect::DuplicateFace => v1::Defect::DuplicateFace,
        Defect::Sliver => v1::Defect::Sliver,
        Defect::Hole => v1::Defect::Hole,
        Defect::Component => v1::Defect::Component,
        Defect::NonFinite => v1::Defect::NonFinite,
        Defect::SelfIntersection => v1::Defect::SelfIntersection,
    };
    v1::Finding {
        defect: defect.into(),
        count: finding.count,
        locations: finding.locations.iter().map(location).collect(),
        prevents_remeshing: finding.prevents_remeshing,
    }
}

pub(crate) fn diagnosis(diagnosis: &Diagnosis) -> v1::Diagnosis {
    v1::Diagnosis {
        findings: diagnosis.findings.iter().map(finding).collect(),
        topology: Some(topology(&diagnosis.topology)),
        low: Some(point(diagnosis.low)),
        high: Some(point(diagnosis.high)),
        area: diagnosis.area,
        remeshable: diagnosis.refusal().is_none(),
    }
}

fn topology(numbers: &TopologyNumbers) -> v1::TopologyNumbers {
    v1::TopologyNumbers {
        euler: numbers.euler,
        components: numbers.components,
        boundary_loops: numbers.boundary_loops,
        genus: numbers.genus,
        non_manifold_edges: numbers.non_manifold_edges,
        non_manifold_vertices: numbers.non_manifold_vertices,
        inconsistent_edges: numbers.inconsistent_edges,
    }
}

pub(crate) fn patch_summary(number: usize, patch: &PatchSummary, box_aspect_ratio: f64) -> v1::PatchSummary {
    v1::PatchSummary {
        patch: number as u32,
        faces: patch.faces,
        area: patch.area,
        loops: patch.loops,
        genus: patch.genus,
        border_length: patch.border_length,
        aspect_ratio: patch.aspect_ratio,
        box_aspect_ratio,
        origin: patches::origin(patch.origin).into(),
    }
}

pub(crate) fn shape(shape: &ShapeQuality) -> v1::ShapeQuality {
    v1::ShapeQuality {
        vertices: shape.vertices,
        triangles: shape.triangles,
        kappa_min: shape.kappa_min,
        kappa_mean: shape.kappa_mean,
        kappa_p01: shape.kappa_p01,
        kappa_histogram: shape.kappa_histogram.clone(),
        min_angle: shape.min_angle_deg,
        mean_min_angle: shape.mean_min_angle_deg,
        max_angle: shape.max_angle_deg,
        skewness_mean: shape.skewness_mean,
        skewness_max: shape.skewness_max,
        tau: shape.tau,
        edge_ratio_ok: shape.edge_ratio_ok,
    }
}

pub(crate) fn quads(quads: &QuadQuality) -> v1::QuadQuality {
    v1::QuadQuality {
        quads: quads.quads,
        triangles: quads.triangles,
        eta_min: quads.eta_min,
        eta_mean: quads.eta_mean,
        eta_p01: quads.eta_p01,
        eta_histogram: quads.eta_histogram.clone(),
        tau: quads.tau,
        edge_ratio_ok: quads.edge_ratio_ok,
    }
}

fn fidelity(fidelity: &Fidelity) -> v1::Fidelity {
    v1::Fidelity {
        diagonal: fidelity.diagonal,
        hausdorff_max_rel: fidelity.hausdorff_max_rel,
        hausdorff_rms_rel: fidelity.hausdorff_rms_rel,
        out_to_in_max_rel: fidelity.out_to_in_max_rel,
        in_to_out_max_rel: fidelity.in_to_out_max_rel,
        boundary_deviation_rel: fidelity.boundary_deviation_rel,
        area_ratio: fidelity.area_ratio,
    }
}

pub(crate) fn quality(report: &QualityReport) -> v1::QualityReport {
    v1::QualityReport {
        shape: Some(shape(&report.shape)),
        input_shape: Some(shape(&report.input_shape)),
        fidelity: report.fidelity.as_ref().map(fidelity),
        topology_input: Some(topology(&report.topology_input)),
        topology_output: Some(topology(&report.topology_output)),
        topology_kept: report.topology_kept,
        self_intersections: report.self_intersections,
        intersecting_pairs: report.intersecting_pairs.iter().map(|&[first, second]| v1::FacePair { first, second }).collect(),
        worst_faces: report.worst_faces.clone(),
        quads: report.quads.as_ref().map(quads),
        seams: report.seams.as_ref().map(|q| v1::SeamQuality { before: Some(seam_split(&q.before)), after: Some(seam_split(&q.after)) }),
    }
}

fn seam_split(split: &SeamSplit) -> v1::SeamSplit {
    let part = |part: &PartQuality| v1::PartQuality {
        triangles: part.triangles,
        kappa_min: part.kappa_min,
        kappa_mean: part.kappa_mean,
        below_half: part.below_half,
        below_four_fifths: part.below_four_fifths,
        tau: part.tau,
    };
    v1::SeamSplit { seam: Some(part(&split.seam)), interior: Some(part(&split.interior)) }
}

/// All inputs but the mesh. Arrays are not repeated back.
pub(crate) fn inputs(snapshot: &Snapshot) -> v1::SessionInputs {
    v1::SessionInputs {
        features: Some(features(&snapshot.features)),
        partition: Some(partition(&snapshot.partition)),
        charts: Some(charts::wire(&snapshot.chart)),
        size: snapshot.size.as_ref().map(sizes::wire),
        mesher: Some(meshers::wire(snapshot)),
        optimize: Some(optimize(&snapshot.optimize)),
        patch_charts: snapshot.patch_charts.len() as u32,
        patch_edits: snapshot.patch_edits.len() as u32,
        lock: Some(sizes::wire_lock(&snapshot.lock)),
    }
}

fn features(spec: &FeatureSpec) -> v1::FeatureSpec {
    use v1::feature_spec::SharpEdges;
    let borders = match spec.region_borders {
        RegionBorders::Keep => v1::RegionBorders::Keep,
        RegionBorders::Ignore => v1::RegionBorders::Ignore,
    };
    v1::FeatureSpec {
        sharp_edges: Some(spec.feature_angle_deg.map_or(SharpEdges::NoSharpEdges(true), SharpEdges::FeatureAngle)),
        min_chain_share: Some(spec.min_chain_share),
        region_borders: borders.into(),
        explicit_edges: None,
        compounds: Some(patches::compound_spec_wire(&spec.compounds)),
    }
}

/// Features with their arrays.
pub(super) fn whole_features(spec: &FeatureSpec) -> v1::FeatureSpec {
    let edges = spec.explicit_edges.as_flattened().iter().map(|v| v.to_le_bytes());
    v1::FeatureSpec { explicit_edges: (!spec.explicit_edges.is_empty()).then(|| sources::packed(edges)), ..features(spec) }
}

pub(super) fn partition(spec: &PartitionSpec) -> v1::PartitionSpec {
    let borders = match spec.borders {
        BorderSmoothing::Vote => v1::PartitionBorders::Vote,
        BorderSmoothing::Shortest => v1::PartitionBorders::Shortest,
        BorderSmoothing::Geodesic => v1::PartitionBorders::Geodesic,
    };
    let (strategy, plane) = strategy(spec.strategy);
    v1::PartitionSpec {
        patches: spec.patches,
        max_patch_faces: Some(spec.max_patch_faces),
        max_aspect_ratio: Some(spec.max_aspect_ratio),
        strategy: strategy.into(),
        plane,
        borders: borders.into(),
    }
}

/// A strategy and the plane it has.
pub(crate) fn strategy(strategy: PartitionStrategy) -> (v1::PartitionStrategy, Option<v1::CutPlane>) {
    use v1::PartitionStrategy as Wire;
    match strategy {
        PartitionStrategy::Auto => (Wire::Auto, None),
        PartitionStrategy::Multilevel => (Wire::Multilevel, None),
        PartitionStrategy::Laplace => (Wire::Laplace, None),
        PartitionStrategy::MaxCut => (Wire::MaxCut, None),
        PartitionStrategy::Handles => (Wire::Handles, None),
        PartitionStrategy::Pants => (Wire::Pants, None),
        PartitionStrategy::Plane { plane } => (Wire::Plane, plane.map(cut_plane)),
    }
}

pub(super) fn cut_plane(plane: Plane) -> v1::CutPlane {
    let point = |[x, y, z]: [f64; 3]| Some(v1::Point { x, y, z });
    v1::CutPlane { point: point(plane.point), normal: point(plane.normal) }
}

pub(super) fn optimize(spec: &OptimizeSpec) -> v1::OptimizeSpec {
    let fit = match spec.fit {
        SurfaceFit::Faces => v1::SurfaceFit::Faces,
        SurfaceFit::Vertices => v1::SurfaceFit::Vertices,
    };
    v1::OptimizeSpec { rounds: Some(spec.rounds), min_kappa: Some(spec.min_kappa), fit: fit.into() }
}

/// Which patches' meshes a result holds: triangles and vertices (those on borders count for each patch). O(F).
pub(crate) fn patches_of_result(triangles: &[[u32; 3]], face_patch: &[u32], vertices: usize) -> Vec<v1::PatchMeshSummary> {
    let count = face_patch.iter().max().map_or(0, |&p| p as usize + 1);
    let mut start = vec![0usize; count + 1];
    face_patch.iter().for_each(|&p| start[p as usize + 1] += 1);
    (0..count).for_each(|p| start[p + 1] += start[p]);
    let mut fill = start.clone();
    let mut order = vec![0u32; face_patch.len()];
    for (face, &p) in face_patch.iter().enumerate() {
        order[fill[p as usize]] = face as u32;
        fill[p as usize] += 1;
    }
    let mut last_patch = vec![u32::MAX; vertices];
    let mut summaries = Vec::with_capacity(count);
    for p in 0..count {
        let faces = &order[start[p]..start[p + 1]];
        let mut seen = 0;
        for v in faces.iter().flat_map(|&f| triangles[f as usize]) {
            seen += u64::from(std::mem::replace(&mut last_patch[v as usize], p as u32) != p as u32);
        }
        summaries.push(v1::PatchMeshSummary { patch: p as u32, vertices: seen, triangles: faces.len() as u64 });
    }
    summaries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_on_borders_count_for_each_patch() {
        let summaries = patches_of_result(&[[0, 1, 2], [0, 2, 3], [3, 2, 4]], &[1, 0, 1], 5);
        let numbers: Vec<_> = summaries.iter().map(|s| (s.patch, s.vertices, s.triangles)).collect();
        assert_eq!(numbers, [(0, 3, 1), (1, 5, 2)]);
    }
}
