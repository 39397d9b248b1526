//! Planar meshers and what they follow.

use super::from_proto::known;
use super::metric;
use remesh_engine::engine::Engine;
use remesh_engine::error::{EngineError, Result};
use remesh_engine::metric::MetricSpec;
use remesh_engine::planar::{DEFAULT_MIN_ANGLE_DEG, Mesher, QuadKind};
use remesh_engine::session::{Change, Snapshot};
use remesh_proto::v1;

/// Which mesher, and what it follows.
pub(crate) fn change(engine: &Engine, spec: &v1::MesherSpec) -> Result<Change> {
    let kind = known(spec.kind, "mesher.kind")?;
    if spec.min_angle.is_some() && kind != v1::MesherKind::Delaunay {
        return Err(EngineError::bad_parameter("mesher.min_angle", "is for the Delaunay mesher only"));
    }
    if spec.metric.is_some() && kind != v1::MesherKind::Anisotropic {
        return Err(EngineError::bad_parameter("mesher.metric", "is for the anisotropic mesher only"));
    }
    if spec.all_quads && kind != v1::MesherKind::Quads {
        return Err(EngineError::bad_parameter("mesher.all_quads", "is for the mesher MESHER_KIND_QUADS only"));
    }
    let mesher = match kind {
        v1::MesherKind::Unspecified | v1::MesherKind::Frontal => Mesher::Frontal,
        v1::MesherKind::Delaunay => Mesher::Delaunay { min_angle_deg: spec.min_angle.unwrap_or(DEFAULT_MIN_ANGLE_DEG) },
        v1::MesherKind::MeshAdapt => Mesher::MeshAdapt,
        v1::MesherKind::Anisotropic => {
            let spec = spec.metric.as_ref().map_or_else(|| Ok(MetricSpec::default()), |metric| metric::from_wire(engine, metric))?;
            return Ok(Change::Anisotropic(spec));
        }
        v1::MesherKind::Quads => Mesher::Quads(if spec.all_quads { QuadKind::All } else { QuadKind::Mixed }),
    };
    mesher.validate()?;
    Ok(Change::Mesher(mesher))
}

/// The same as a client reads it.
pub(super) fn wire(snapshot: &Snapshot) -> v1::MesherSpec {
    let spec = |kind: v1::MesherKind| v1::MesherSpec { kind: kind.into(), ..Default::default() };
    match snapshot.mesher {
        Mesher::Frontal => spec(v1::MesherKind::Frontal),
        Mesher::Delaunay { min_angle_deg } => v1::MesherSpec { min_angle: Some(min_angle_deg), ..spec(v1::MesherKind::Delaunay) },
        Mesher::MeshAdapt => spec(v1::MesherKind::MeshAdapt),
        Mesher::Quads(kind) => v1::MesherSpec { all_quads: kind == QuadKind::All, ..spec(v1::MesherKind::Quads) },
        Mesher::Anisotropic => v1::MesherSpec { metric: Some(metric::to_wire(&snapshot.metric)), ..spec(v1::MesherKind::Anisotropic) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::engine::EngineConfig;

    fn field_of(error: &EngineError) -> &str {
        error.metadata().iter().find(|(key, _)| key == "field").map_or("", |(_, field)| field)
    }

    #[test]
    fn a_mesher_takes_its_own_options_only() {
        let engine = Engine::new(EngineConfig::default());
        let spec = |kind: v1::MesherKind, min_angle, metric| v1::MesherSpec { kind: kind.into(), min_angle, metric, all_quads: false };
        let metric = |max_stretch| Some(v1::MetricSpec { max_stretch, ..Default::default() });
        assert!(matches!(change(&engine, &v1::MesherSpec::default()), Ok(Change::Mesher(Mesher::Frontal))));
        let angle = change(&engine, &spec(v1::MesherKind::Delaunay, Some(20.0), None));
        assert!(matches!(angle, Ok(Change::Mesher(Mesher::Delaunay { min_angle_deg: 20.0 }))));
        let stretched = change(&engine, &spec(v1::MesherKind::Anisotropic, None, metric(Some(3.0))));
        assert!(matches!(stretched, Ok(Change::Anisotropic(spec)) if spec.max_stretch == 3.0));
        let short = v1::PackedArray { data: Some(v1::packed_array::Data::Inline(vec![0; 40].into())) };
        let rows = v1::MetricSpec { source: Some(v1::metric_spec::Source::Tensors(short)), ..Default::default() };
        let all = v1::MesherSpec { all_quads: true, ..spec(v1::MesherKind::Quads, None, None) };
        assert!(matches!(change(&engine, &all), Ok(Change::Mesher(Mesher::Quads(QuadKind::All)))));
        let cases = [
            (v1::MesherSpec { all_quads: true, ..spec(v1::MesherKind::Frontal, None, None) }, "mesher.all_quads"),
            (spec(v1::MesherKind::Frontal, Some(20.0), None), "mesher.min_angle"),
            (spec(v1::MesherKind::Delaunay, Some(60.0), None), "mesher.min_angle"),
            (spec(v1::MesherKind::Delaunay, Some(f64::NAN), None), "mesher.min_angle"),
            (spec(v1::MesherKind::MeshAdapt, None, metric(None)), "mesher.metric"),
            (spec(v1::MesherKind::Anisotropic, None, metric(Some(0.2))), "mesher.metric.max_stretch"),
            (spec(v1::MesherKind::Anisotropic, None, Some(rows)), "mesher.metric.tensors"),
        ];
        for (spec, field) in cases {
            let error = change(&engine, &spec).unwrap_err();
            assert_eq!(field_of(&error), field, "{spec:?}");
        }
    }
}
