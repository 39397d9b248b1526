//! Metrics of the anisotropic mesher.

use super::from_proto::f64_rows;
use super::sources::packed;
use remesh_engine::engine::Engine;
use remesh_engine::error::Result;
use remesh_engine::metric::{MetricSource, MetricSpec};
use remesh_proto::v1;
use std::sync::Arc;

/// What to follow.
pub(super) fn from_wire(engine: &Engine, wire: &v1::MetricSpec) -> Result<MetricSpec> {
    use v1::metric_spec::Source;
    let default = MetricSpec::default();
    let source = match &wire.source {
        None => default.source,
        Some(Source::Curvature(v1::CurvatureMetric { deviation: None, normal_angle: None })) => default.source,
        Some(Source::Curvature(c)) => MetricSource::Curvature { deviation: c.deviation, normal_angle_deg: c.normal_angle },
        Some(Source::Tensors(array)) => MetricSource::PerVertex { tensors: Arc::new(f64_rows(engine, array, "mesher.metric.tensors")?) },
    };
    let growth_rate = match wire.growth_rate {
        None => default.growth_rate,
        Some(1.0) => None,
        rate => rate,
    };
    let spec = MetricSpec {
        source,
        min_size: wire.min_size,
        max_size: wire.max_size,
        max_stretch: wire.max_stretch.unwrap_or(default.max_stretch),
        growth_rate,
    };
    spec.validate()?;
    Ok(spec)
}

/// The same with its tensors.
pub(super) fn whole(spec: &MetricSpec) -> v1::MetricSpec {
    use v1::metric_spec::Source;
    let mut wire = to_wire(spec);
    if let MetricSource::PerVertex { tensors } = &spec.source {
        wire.source = Some(Source::Tensors(packed(tensors.as_flattened().iter().map(|x| x.to_le_bytes()))));
    }
    wire
}

/// The same as a client reads it; tensors are not repeated back.
pub(super) fn to_wire(spec: &MetricSpec) -> v1::MetricSpec {
    use v1::metric_spec::Source;
    let source = match &spec.source {
        MetricSource::Curvature { deviation, normal_angle_deg } => {
            Some(Source::Curvature(v1::CurvatureMetric { deviation: *deviation, normal_angle: *normal_angle_deg }))
        }
        MetricSource::PerVertex { .. } => Some(Source::Tensors(v1::PackedArray::default())),
    };
    v1::MetricSpec {
        source,
        min_size: spec.min_size,
        max_size: spec.max_size,
        max_stretch: Some(spec.max_stretch),
        growth_rate: Some(spec.growth_rate.unwrap_or(1.0)),
    }
}
