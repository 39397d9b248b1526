//! Messages as JSON for `--json`: the field names of the protocol, enums in lower case, absent fields as null.

use super::failure::Failure;
use super::stages::{self, Group};
use super::summary;
use crate::error::Place;
use crate::v1;
use serde_json::{Value, json};

fn point(point: &Option<v1::Point>) -> Value {
    point.as_ref().map_or(Value::Null, |p| json!([p.x, p.y, p.z]))
}

/// `SOME_PREFIX_NAME` as `name`.
pub(super) fn enum_name(name: &str, prefix: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase()
}

fn place(place: &Place) -> Value {
    json!({ "element": format!("{:?}", place.element).to_ascii_lowercase(), "ids": place.ids, "position": place.position })
}

pub(crate) fn mesh(mesh: &v1::MeshSummary) -> Value {
    let regions: Vec<Value> = mesh.regions.iter().map(|r| json!({ "id": r.id, "name": r.name })).collect();
    json!({
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "regions": regions,
        "unit": summary::unit_name(mesh.unit()),
        "low": point(&mesh.low),
        "high": point(&mesh.high),
    })
}

pub(crate) fn report(report: &v1::ImportReport) -> Value {
    json!({
        "format": report.format,
        "faces_read": report.faces_read,
        "vertices_read": report.vertices_read,
        "vertices_welded": report.vertices_welded,
        "duplicate_faces_dropped": report.duplicate_faces_dropped,
        "degenerate_faces_dropped": report.degenerate_faces_dropped,
        "unused_vertices_dropped": report.unused_vertices_dropped,
        "faces_flipped": report.faces_flipped,
        "vertices_split": report.vertices_split,
        "warnings": report.warnings,
    })
}

pub(crate) fn topology(numbers: &v1::TopologyNumbers) -> Value {
    json!({
        "euler": numbers.euler,
        "components": numbers.components,
        "boundary_loops": numbers.boundary_loops,
        "genus": numbers.genus,
        "non_manifold_edges": numbers.non_manifold_edges,
        "non_manifold_vertices": numbers.non_manifold_vertices,
        "inconsistent_edges": numbers.inconsistent_edges,
    })
}

fn finding(finding: &v1::Finding) -> Value {
    let places: Vec<Value> = finding.locations.iter().map(|location| place(&Place::from(location))).collect();
    json!({
        "defect": enum_name(finding.defect().as_str_name(), "DEFECT_"),
        "count": finding.count,
        "prevents_remeshing": finding.prevents_remeshing,
        "locations": places,
    })
}

pub(crate) fn diagnosis(diagnosis: &v1::Diagnosis) -> Value {
    json!({
        "remeshable": diagnosis.remeshable,
        "findings": diagnosis.findings.iter().map(finding).collect::<Vec<_>>(),
        "topology": diagnosis.topology.as_ref().map(topology),
        "low": point(&diagnosis.low),
        "high": point(&diagnosis.high),
        "area": diagnosis.area,
    })
}

/// How a stage ended: `hit`, `run`, or `unspecified` while it has not.
pub(crate) fn outcome_name(outcome: v1::StageOutcome) -> String {
    enum_name(outcome.as_str_name(), "STAGE_OUTCOME_")
}

pub(crate) fn shape(shape: &v1::ShapeQuality) -> Value {
    json!({
        "vertices": shape.vertices,
        "triangles": shape.triangles,
        "kappa_min": shape.kappa_min,
        "kappa_mean": shape.kappa_mean,
        "kappa_p01": shape.kappa_p01,
        "kappa_histogram": shape.kappa_histogram,
        "min_angle": shape.min_angle,
        "mean_min_angle": shape.mean_min_angle,
        "max_angle": shape.max_angle,
        "skewness_mean": shape.skewness_mean,
        "skewness_max": shape.skewness_max,
        "tau": shape.tau,
        "edge_ratio_ok": shape.edge_ratio_ok,
    })
}

pub(crate) fn quads(quads: &v1::QuadQuality) -> Value {
    json!({
        "quads": quads.quads,
        "triangles": quads.triangles,
        "eta_min": quads.eta_min,
        "eta_mean": quads.eta_mean,
        "eta_p01": quads.eta_p01,
        "eta_histogram": quads.eta_histogram,
        "tau": quads.tau,
        "edge_ratio_ok": quads.edge_ratio_ok,
    })
}

fn fidelity(fidelity: &v1::Fidelity) -> Value {
    json!({
        "diagonal": fidelity.diagonal,
        "hausdorff_max_rel": fidelity.hausdorff_max_rel,
        "hausdorff_rms_rel": fidelity.hausdorff_rms_rel,
        "out_to_in_max_rel": fidelity.out_to_in_max_rel,
        "in_to_out_max_rel": fidelity.in_to_out_max_rel,
        "boundary_deviation_rel": fidelity.boundary_deviation_rel,
        "area_ratio": fidelity.area_ratio,
    })
}

pub(crate) fn quality(report: &v1::QualityReport) -> Value {
    json!({
        "shape": report.shape.as_ref().map(shape),
        "quads": report.quads.as_ref().map(quads),
        "input_shape": report.input_shape.as_ref().map(shape),
        "fidelity": report.fidelity.as_ref().map(fidelity),
        "topology_input": report.topology_input.as_ref().map(topology),
        "topology_output": report.topology_output.as_ref().map(topology),
        "topology_kept": report.topology_kept,
        "self_intersections": report.self_intersections,
        "intersecting_pairs": report.intersecting_pairs.iter().map(|pair| [pair.first, pair.second]).collect::<Vec<_>>(),
        "worst_faces": report.worst_faces,
        "seams": report.seams.as_ref().map(|q| json!({ "before": q.before.map(seam_split), "after": q.after.map(seam_split) })),
    })
}

fn seam_split(split: v1::SeamSplit) -> Value {
    let part = |part: v1::PartQuality| {
        json!({
            "triangles": part.triangles,
            "kappa_min": part.kappa_min,
            "kappa_mean": part.kappa_mean,
            "below_half": part.below_half,
            "below_four_fifths": part.below_four_fifths,
            "tau": part.tau,
        })
    };
    json!({ "seam": split.seam.map(part), "interior": split.interior.map(part) })
}

fn group(group: &Group) -> Value {
    json!({ "name": group.name, "hits": group.hits, "runs": group.runs, "milliseconds": group.milliseconds })
}

/// What stages did, by groups.
pub(crate) fn work(milliseconds: f64, groups: &[Group]) -> Value {
    json!({
        "milliseconds": milliseconds,
        "hits": groups.iter().map(|g| g.hits).sum::<u64>(),
        "runs": groups.iter().map(|g| g.runs).sum::<u64>(),
        "groups": groups.iter().map(group).collect::<Vec<_>>(),
    })
}

/// What one call did.
pub(crate) fn run(summary: &Option<v1::RunSummary>) -> Value {
    summary.as_ref().map_or(Value::Null, |s| work(s.milliseconds, &stages::groups(&s.stages)))
}

pub(crate) fn patch(patch: &v1::PatchSummary) -> Value {
    json!({
        "patch": patch.patch,
        "faces": patch.faces,
        "area": patch.area,
        "loops": patch.loops,
        "genus": patch.genus,
        "border_length": patch.border_length,
        "aspect_ratio": patch.aspect_ratio,
        "box_aspect_ratio": patch.box_aspect_ratio,
        "origin": origin_name(patch.origin()),
    })
}

/// How a patch came about, in a word.
pub(crate) fn origin_name(origin: v1::PatchOrigin) -> String {
    enum_name(origin.as_str_name(), "PATCH_ORIGIN_")
}

/// Why a region is in a compound, in a word.
pub(crate) fn rule_name(rule: v1::CompoundRule) -> String {
    enum_name(rule.as_str_name(), "COMPOUND_RULE_")
}

/// What an edit of patches does, in a word.
pub(crate) fn edit_name(kind: v1::PatchEditKind) -> String {
    enum_name(kind.as_str_name(), "PATCH_EDIT_KIND_")
}

/// The name of a strategy as on the command line.
pub(crate) fn strategy_name(strategy: v1::PartitionStrategy) -> String {
    enum_name(strategy.as_str_name(), "PARTITION_STRATEGY_").replace('_', "-")
}

/// Point and normal of a plane.
pub(crate) fn plane(plane: Option<v1::CutPlane>) -> Value {
    let vector = |p: Option<v1::Point>| p.map(|p| [p.x, p.y, p.z]);
    plane.map_or(Value::Null, |plane| json!({ "point": vector(plane.point), "normal": vector(plane.normal) }))
}

fn spread(spread: Option<v1::Spread>) -> Value {
    spread.map_or(Value::Null, |s| json!({ "min": s.min, "mean": s.mean, "max": s.max }))
}

/// A chart spec; the conditions that the method does not have are absent.
pub(crate) fn chart_spec(spec: &v1::ChartSpec) -> Value {
    use v1::boundary_shape::Shape;
    let point = |p: &v1::PlanePoint| json!([p.u, p.v]);
    let mut object = json!({
        "method": summary::chart_method_name(spec.method()),
        "outer_vertex": spec.outer_vertex,
        "holes": summary::hole_name(spec.holes()),
    });
    if let Some(pins) = &spec.pins {
        let given = pins.given.iter().map(|p| json!({ "vertex": p.vertex, "target": p.target.as_ref().map(point) }));
        object["pins"] = if pins.given.is_empty() { json!(summary::pin_choice_name(pins.choice())) } else { given.collect() };
    }
    if let Some(boundary) = &spec.boundary {
        let shape = match boundary.shape.as_ref().and_then(|s| s.shape.as_ref()) {
            None | Some(Shape::Circle(_)) => json!("circle"),
            Some(Shape::MeanPlane(_)) => json!("mean-plane"),
            Some(Shape::Ellipse(e)) => json!({ "ellipse": e.ratio }),
            Some(Shape::Rectangle(r)) => json!({ "rectangle": r.ratio, "corners": r.corners }),
            Some(Shape::Polygon(p)) => json!({ "polygon": p.points.iter().map(point).collect::<Vec<_>>(), "corners": p.corners }),
        };
        let spacing = if boundary.spacing() == v1::BoundarySpacing::Chord { "chord" } else { "arc" };
        object["boundary"] = json!({ "shape": shape, "spacing": spacing, "start_vertex": boundary.start_vertex });
    }
    object
}

pub(crate) fn verdict_name(verdict: v1::ChartVerdict) -> String {
    enum_name(verdict.as_str_name(), "CHART_VERDICT_")
}

/// What is wrong with the spec of a patch.
pub(crate) fn chart_error(error: &v1::ChartError) -> Value {
    let places = error.locations.iter().flat_map(|l| &l.locations).map(|location| place(&Place::from(location)));
    json!({
        "patch": error.patch,
        "reason": error.reason,
        "message": error.message,
        "locations": places.collect::<Vec<_>>(),
        "location_total": error.locations.as_ref().map_or(0, |l| l.total),
    })
}

pub(crate) fn chart(chart: &v1::ChartSummary) -> Value {
    let attempt = |attempt: &v1::ChartAttempt| {
        let filling = attempt.filling.unwrap_or_default();
        json!({
            "method": summary::chart_method_name(attempt.method()),
            "holes": summary::hole_name(filling.holes()),
            "ears": filling.ears,
            "pins": attempt.pins,
            "flipped_before": attempt.flipped_before,
            "flipped": attempt.flipped,
            "overlaps": attempt.overlaps,
            "rejected": attempt.rejected,
        })
    };
    let of = |value: fn(&v1::Distortion) -> f64| chart.distortion.as_ref().map(value);
    let distortion = chart.distortion.unwrap_or_default();
    json!({
        "patch": chart.patch,
        "method": summary::chart_method_name(chart.method()),
        "attempts": chart.attempts.iter().map(attempt).collect::<Vec<_>>(),
        "angle_mean": of(|d| d.angle_mean),
        "angle_max": of(|d| d.angle_max),
        "area_min": of(|d| d.area_min),
        "area_max": of(|d| d.area_max),
        "angle": spread(distortion.angle),
        "area": spread(distortion.area),
        "stretch": spread(distortion.stretch),
        "own_spec": chart.origin() == v1::ChartSpecOrigin::Patch,
        "vertices": chart.vertices,
        "faces": chart.faces,
    })
}

fn lock_name(lock: &v1::lock_spec::Lock) -> &'static str {
    use v1::lock_spec::Lock;
    match lock {
        Lock::Nothing(_) => "none",
        Lock::Boundary(_) => "boundary",
        Lock::Loops(_) => "loops",
        Lock::Vertices(_) => "vertices",
    }
}

fn composed_size(size: &v1::ComposedSize) -> Value {
    use v1::composed_size::Base;
    json!({
        "uniform": if let Some(Base::Uniform(length)) = size.base { json!(length) } else { Value::Null },
        "triangles": if let Some(Base::Triangles(count)) = size.base { json!(count) } else { Value::Null },
        "fields": size.fields.iter().map(size_field).collect::<Vec<_>>(),
        "min_size": size.min_size,
        "max_size": size.max_size,
        "growth_rate": size.growth_rate,
    })
}

fn size_field(field: &v1::SizeField) -> Value {
    use v1::distance_size::From;
    use v1::size_field::Field;
    let Some(field) = &field.field else { return Value::Null };
    match field {
        Field::Region(r) => match &r.region {
            Some(v1::region_size::Region::Id(id)) => json!({ "kind": "region", "id": id, "size": r.size }),
            Some(v1::region_size::Region::Name(name)) => json!({ "kind": "region", "name": name, "size": r.size }),
            None => Value::Null,
        },
        Field::Patch(p) => match &p.patch {
            Some(v1::patch_size::Patch::Number(number)) => json!({ "kind": "patch", "number": number, "size": p.size }),
            Some(v1::patch_size::Patch::Identity(identity)) => json!({ "kind": "patch", "identity": identity, "size": p.size }),
            None => Value::Null,
        },
        Field::PerVertex(_) => json!({ "kind": "vertex" }),
        Field::Curvature(c) => {
            json!({ "kind": "curvature", "normal_angle": c.normal_angle, "deviation": c.deviation, "smoothing": c.smoothing })
        }
        Field::Proximity(p) => {
            let sides = enum_name(p.sides().as_str_name(), "GAP_SIDES_");
            json!({ "kind": "proximity", "elements_per_gap": p.elements_per_gap, "sides": sides, "reach": p.reach })
        }
        Field::Thickness(t) => json!({ "kind": "thickness", "elements": t.elements }),
        Field::Centerline(c) => {
            let measure = enum_name(c.measure().as_str_name(), "CENTERLINE_MEASURE_");
            json!({ "kind": "centerline", "elements_around": c.elements_around, "measure": measure, "points": c.points })
        }
        Field::Shape(s) => {
            let point = |p: &Option<v1::Point>| p.map_or(Value::Null, |p| json!([p.x, p.y, p.z]));
            let (size, growth) = (s.size, s.growth_rate);
            match &s.shape {
                Some(v1::shape_size::Shape::Box(b)) => {
                    json!({ "kind": "box", "low": point(&b.low), "high": point(&b.high), "size": size, "growth_rate": growth })
                }
                Some(v1::shape_size::Shape::Sphere(b)) => {
                    json!({ "kind": "sphere", "center": point(&b.center), "radius": b.radius, "size": size, "growth_rate": growth })
                }
                Some(v1::shape_size::Shape::Cylinder(c)) => json!({
                    "kind": "cylinder", "start": point(&c.start), "end": point(&c.end), "radius": c.radius, "size": size,
                    "growth_rate": growth,
                }),
                None => Value::Null,
            }
        }
        Field::Distance(d) => {
            let from = match &d.from {
                Some(From::Points(_)) => "points",
                Some(From::Polylines(_)) => "lines",
                Some(From::Curves(number)) if *number == i32::from(v1::SurfaceCurves::Boundary) => "boundary",
                _ => "features",
            };
            json!({ "kind": "distance", "from": from, "size": d.size, "reach": d.reach, "growth_rate": d.growth_rate })
        }
    }
}

fn inputs(inputs: &v1::SessionInputs) -> Value {
    use v1::feature_spec::SharpEdges;
    use v1::size_spec::Size;
    let features = inputs.features.clone().unwrap_or_default();
    let partition = inputs.partition.unwrap_or_default();
    let optimize = inputs.optimize.unwrap_or_default();
    let mesher = inputs.mesher.clone().unwrap_or_default();
    let size = inputs.size.as_ref().and_then(|size| size.size.as_ref()).map(|size| match size {
        Size::Uniform(length) => json!({ "uniform": length }),
        Size::Triangles(count) => json!({ "triangles": count }),
        Size::Graded(g) => json!({ "min_size": g.min_size, "max_size": g.max_size, "growth_rate": g.growth_rate }),
        Size::PerVertex(p) => {
            json!({ "per_vertex": true, "min_size": p.min_size, "max_size": p.max_size, "growth_rate": p.growth_rate })
        }
        Size::Composed(c) => composed_size(c),
    });
    json!({
        "feature_angle": match features.sharp_edges {
            Some(SharpEdges::FeatureAngle(degrees)) => json!(degrees),
            Some(SharpEdges::NoSharpEdges(true)) => json!("none"),
            _ => Value::Null,
        },
        "min_chain_share": features.min_chain_share,
        "region_borders": if features.region_borders() == v1::RegionBorders::Ignore { "ignore" } else { "keep" },
        "explicit_edges": features.explicit_edges.is_some(),
        "compounds": features.compounds.as_ref().map(|c| c.lists.iter().map(|l| l.regions.clone()).collect::<Vec<_>>()),
        "merge_angle": features.compounds.as_ref().and_then(|c| c.merge_angle),
        "merge_below_size": features.compounds.as_ref().and_then(|c| c.merge_below_size),
        "patches": partition.patches,
        "max_patch_faces": partition.max_patch_faces,
        "max_aspect_ratio": partition.max_aspect_ratio,
        "partition_strategy": strategy_name(partition.strategy()),
        "plane": plane(partition.plane),
        "borders": enum_name(partition.borders().as_str_name(), "PARTITION_BORDERS_"),
        "chart": inputs.charts.as_ref().map(chart_spec),
        "patch_charts": inputs.patch_charts,
        "patch_edits": inputs.patch_edits,
        "size": size,
        "lock": inputs.lock.as_ref().and_then(|l| l.lock.as_ref()).map(lock_name),
        "locked": inputs.lock.as_ref().map_or(0, |l| l.count),
        "mesher": enum_name(mesher.kind().as_str_name(), "MESHER_KIND_"),
        "min_angle": mesher.min_angle,
        "metric": mesher.metric.as_ref().map(metric),
        "all_quads": mesher.all_quads,
        "rounds": optimize.rounds,
        "min_kappa": optimize.min_kappa,
        "fit": enum_name(optimize.fit().as_str_name(), "SURFACE_FIT_"),
    })
}

fn metric(metric: &v1::MetricSpec) -> Value {
    use v1::metric_spec::Source;
    let curvature = match &metric.source {
        Some(Source::Curvature(c)) => Some(*c),
        _ => None,
    };
    json!({
        "per_vertex": matches!(metric.source, Some(Source::Tensors(_))),
        "deviation": curvature.and_then(|c| c.deviation),
        "normal_angle": curvature.and_then(|c| c.normal_angle),
        "min_size": metric.min_size,
        "max_size": metric.max_size,
        "max_stretch": metric.max_stretch,
        "growth_rate": metric.growth_rate,
    })
}

pub(crate) fn session(session: &v1::Session) -> Value {
    json!({
        "name": session.name,
        "display_name": session.display_name,
        "revision": session.revision,
        "oldest_revision": session.oldest_revision,
        "create_time": session.create_time.map(|t| t.seconds),
        "expire_time": session.expire_time.map(|t| t.seconds),
        "ttl_seconds": session.ttl.map(|t| t.seconds),
        "mesh": session.mesh.as_ref().map(mesh),
        "inputs": session.inputs.as_ref().map(inputs),
    })
}

/// The object that a failed command prints.
pub(crate) fn failure(failure: &Failure) -> Value {
    let mut error = json!({ "message": failure.to_string(), "exit_code": failure.exit_code() });
    match failure {
        Failure::Client(client) => {
            if let Some(call) = client.call() {
                error["message"] = json!(call.message);
                error["code"] = json!(format!("{:?}", call.code));
                error["reason"] = json!(call.reason);
                error["hint"] = json!(call.hint);
                error["metadata"] = json!(call.metadata);
                let fields = call.fields.iter().map(|f| json!({ "field": f.field, "description": f.description }));
                error["fields"] = fields.collect();
                error["retry_after_seconds"] = json!(call.retry_after.map(|wait| wait.as_secs_f64()));
                error["locations"] = call.places.iter().map(place).collect();
                error["location_total"] = json!(call.place_total);
            }
        }
        Failure::Refused { diagnosis: found, .. } => error["diagnosis"] = diagnosis(found),
        _ => {}
    }
    json!({ "error": error })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_absent_values() {
        let found = v1::Finding { defect: v1::Defect::NonManifoldEdge.into(), count: 2, ..Default::default() };
        assert_eq!(finding(&found)["defect"], "non_manifold_edge");
        assert_eq!(shape(&v1::ShapeQuality::default())["tau"], Value::Null);
        let spec = v1::FeatureSpec { sharp_edges: Some(v1::feature_spec::SharpEdges::NoSharpEdges(true)), ..Default::default() };
        let given = v1::SessionInputs { features: Some(spec), ..Default::default() };
        assert_eq!((inputs(&given)["feature_angle"].as_str(), inputs(&given)["size"].is_null()), (Some("none"), true));
    }

    #[test]
    fn failures_are_objects() {
        let refused = Failure::Refused { what: "a".into(), diagnosis: Box::default() };
        let object = failure(&refused);
        assert_eq!((object["error"]["exit_code"].as_u64(), object["error"]["diagnosis"]["remeshable"].as_bool()), (Some(3), Some(false)));
    }
}
