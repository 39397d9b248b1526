//! Wire messages to engine inputs. Checks what the wire cannot express (required fields, known enum numbers, whole rows of packed
//! arrays); ranges of numbers are the engine's to check.

use super::charts::{self, within};
use super::meshers;
use super::patches;
use super::sizes;
use crate::state::blob_digest;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::Result;
use remesh_engine::export::Encoding;
use remesh_engine::features::{FeatureSpec, RegionBorders};
use remesh_engine::import::Format;
use remesh_engine::mesh::LengthUnit;
use remesh_engine::optimize::{OptimizeSpec, SurfaceFit};
use remesh_engine::parametrize::ChartSpec;
use remesh_engine::partition::{BorderSmoothing, PartitionSpec, PartitionStrategy, Plane};
use remesh_engine::quality::QualityScope;
use remesh_engine::session::{Change, Revision};
use remesh_proto::v1;
use std::time::Duration;

pub(super) fn required<T>(value: Option<T>, field: &str) -> Result<T> {
    value.ok_or_else(|| EngineError::bad_parameter(field, "is required"))
}

/// The enum value of a number on the wire.
pub(super) fn known<E: TryFrom<i32>>(number: i32, field: &str) -> Result<E> {
    E::try_from(number).map_err(|_| EngineError::bad_parameter(field, format!("{number} is not a value of this enumeration")))
}

/// A span of time that is not negative.
pub(crate) fn duration(from: prost_types::Duration, field: &str) -> Result<Duration> {
    Duration::try_from(from).map_err(|_| EngineError::bad_parameter(field, "must not be negative"))
}

/// A format to write.
pub(crate) fn output_format(number: i32, field: &str) -> Result<Format> {
    required(format(number, field)?, field)
}

pub(super) fn format(number: i32, field: &str) -> Result<Option<Format>> {
    Ok(match known(number, field)? {
        v1::MeshFormat::Unspecified => None,
        v1::MeshFormat::Stl => Some(Format::Stl),
        v1::MeshFormat::Obj => Some(Format::Obj),
        v1::MeshFormat::Ply => Some(Format::Ply),
        v1::MeshFormat::Off => Some(Format::Off),
        v1::MeshFormat::Msh => Some(Format::Msh),
        v1::MeshFormat::Gltf => Some(Format::Gltf),
        v1::MeshFormat::Vtu => Some(Format::Vtu),
    })
}

/// The variant of a format.
pub(crate) fn encoding(number: i32, field: &str) -> Result<Encoding> {
    Ok(match known(number, field)? {
        v1::MeshEncoding::Unspecified => Encoding::Default,
        v1::MeshEncoding::Ascii => Encoding::Ascii,
        v1::MeshEncoding::Binary => Encoding::Binary,
        v1::MeshEncoding::Msh22 => Encoding::Msh22,
    })
}

pub(super) fn unit(number: i32, field: &str) -> Result<LengthUnit> {
    Ok(match known(number, field)? {
        v1::LengthUnit::Unspecified => LengthUnit::Unspecified,
        v1::LengthUnit::Metre => LengthUnit::Metre,
        v1::LengthUnit::Centimetre => LengthUnit::Centimetre,
        v1::LengthUnit::Millimetre => LengthUnit::Millimetre,
        v1::LengthUnit::Micrometre => LengthUnit::Micrometre,
        v1::LengthUnit::Inch => LengthUnit::Inch,
        v1::LengthUnit::Foot => LengthUnit::Foot,
    })
}

/// A mesh of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WhichMesh {
    /// As imported.
    Input,
    /// As remeshed.
    Result,
}

/// Which mesh of a session is meant.
pub(crate) fn which_mesh(source: i32) -> Result<WhichMesh> {
    Ok(match known(source, "source")? {
        v1::MeshSource::Input => WhichMesh::Input,
        v1::MeshSource::Unspecified | v1::MeshSource::Result => WhichMesh::Result,
    })
}

/// What to measure.
pub(crate) fn scope(number: i32, field: &str) -> Result<QualityScope> {
    Ok(match known(number, field)? {
        v1::QualityScope::Unspecified | v1::QualityScope::Full => QualityScope::Full,
        v1::QualityScope::Elements => QualityScope::Elements,
    })
}

/// The columns asked for, or `default`; only those in `allowed`, each once.
pub(crate) fn columns(numbers: &[i32], allowed: &[v1::DataColumn], default: &[v1::DataColumn]) -> Result<Vec<v1::DataColumn>> {
    let mut columns = Vec::new();
    for &number in numbers {
        let column: v1::DataColumn = known(number, "columns")?;
        if !allowed.contains(&column) {
            return Err(EngineError::bad_parameter("columns", format!("{} is not a column of this method", column.as_str_name())));
        }
        if columns.contains(&column) {
            return Err(EngineError::bad_parameter("columns", format!("{} is listed twice", column.as_str_name())));
        }
        columns.push(column);
    }
    Ok(if columns.is_empty() { default.to_vec() } else { columns })
}

/// Bytes of a packed array: those in the message or those of an uploaded file.
fn with_packed<T>(engine: &Engine, array: &v1::PackedArray, field: &str, read: impl FnOnce(&[u8]) -> Result<T>) -> Result<T> {
    match required(array.data.as_ref(), field)? {
        v1::packed_array::Data::Inline(bytes) => read(bytes),
        v1::packed_array::Data::Blob(name) => read(&engine.blob(blob_digest(name, field)?)?.bytes()?),
    }
}

fn rows<const N: usize, const B: usize, T>(bytes: &[u8], field: &str, value: fn([u8; B]) -> T) -> Result<Vec<[T; N]>>
where
    T: Copy + Default,
{
    let (values, rest) = bytes.as_chunks::<B>();
    if !rest.is_empty() || !values.len().is_multiple_of(N) {
        return Err(EngineError::bad_parameter(field, format!("{} bytes are not whole rows of {} bytes", bytes.len(), N * B)));
    }
    let (tuples, _) = values.as_chunks::<N>();
    Ok(tuples.iter().map(|tuple| tuple.map(value)).collect())
}

pub(super) fn f64_rows<const N: usize>(engine: &Engine, array: &v1::PackedArray, field: &str) -> Result<Vec<[f64; N]>> {
    with_packed(engine, array, field, |bytes| rows(bytes, field, f64::from_le_bytes))
}

pub(super) fn u32_rows<const N: usize>(engine: &Engine, array: &v1::PackedArray, field: &str) -> Result<Vec<[u32; N]>> {
    with_packed(engine, array, field, |bytes| rows(bytes, field, u32::from_le_bytes))
}

/// Which edges are features.
pub(crate) fn features(engine: &Engine, spec: &v1::FeatureSpec) -> Result<FeatureSpec> {
    use v1::feature_spec::SharpEdges;
    let default = FeatureSpec::default();
    Ok(FeatureSpec {
        feature_angle_deg: match spec.sharp_edges {
            None | Some(SharpEdges::NoSharpEdges(false)) => default.feature_angle_deg,
            Some(SharpEdges::NoSharpEdges(true)) => None,
            Some(SharpEdges::FeatureAngle(angle)) => {
                if !(angle > 0.0 && angle < 180.0) {
                    return Err(EngineError::bad_parameter("features.feature_angle", format!("{angle} is not in (0, 180)")));
                }
                Some(angle)
            }
        },
        min_chain_share: match spec.min_chain_share {
            Some(share) if !(0.0..=1.0).contains(&share) => {
                return Err(EngineError::bad_parameter("features.min_chain_share", format!("{share} is not in [0, 1]")));
            }
            share => share.unwrap_or(default.min_chain_share),
        },
        region_borders: match known(spec.region_borders, "features.region_borders")? {
            v1::RegionBorders::Unspecified | v1::RegionBorders::Keep => RegionBorders::Keep,
            v1::RegionBorders::Ignore => RegionBorders::Ignore,
        },
        explicit_edges: match &spec.explicit_edges {
            None => Vec::new(),
            Some(array) => u32_rows(engine, array, "features.explicit_edges")?,
        },
        compounds: spec.compounds.as_ref().map(patches::compound_spec).transpose()?.unwrap_or_default(),
    })
}

/// How to partition.
pub(crate) fn partition(spec: &v1::PartitionSpec) -> Result<PartitionSpec> {
    let default = PartitionSpec::default();
    for (value, field) in [(spec.patches, "partition.patches"), (spec.max_patch_faces, "partition.max_patch_faces")] {
        if value == Some(0) {
            return Err(EngineError::bad_parameter(field, "must be positive"));
        }
    }
    let max_aspect_ratio = spec.max_aspect_ratio.unwrap_or(default.max_aspect_ratio);
    positive(max_aspect_ratio, "partition.max_aspect_ratio")?;
    let max_patch_faces = spec.max_patch_faces.unwrap_or(default.max_patch_faces);
    let strategy = strategy(spec)?;
    let borders = match known(spec.borders, "partition.borders")? {
        v1::PartitionBorders::Vote => BorderSmoothing::Vote,
        v1::PartitionBorders::Shortest => BorderSmoothing::Shortest,
        v1::PartitionBorders::Unspecified | v1::PartitionBorders::Geodesic => BorderSmoothing::Geodesic,
    };
    Ok(PartitionSpec { patches: spec.patches, max_patch_faces, max_aspect_ratio, strategy, borders })
}

fn strategy(spec: &v1::PartitionSpec) -> Result<PartitionStrategy> {
    let strategy = match known(spec.strategy, "partition.strategy")? {
        v1::PartitionStrategy::Unspecified | v1::PartitionStrategy::Auto => PartitionStrategy::Auto,
        v1::PartitionStrategy::Multilevel => PartitionStrategy::Multilevel,
        v1::PartitionStrategy::Laplace => PartitionStrategy::Laplace,
        v1::PartitionStrategy::MaxCut => PartitionStrategy::MaxCut,
        v1::PartitionStrategy::Handles => PartitionStrategy::Handles,
        v1::PartitionStrategy::Pants => PartitionStrategy::Pants,
        v1::PartitionStrategy::Plane => {
            return Ok(PartitionStrategy::Plane { plane: spec.plane.as_ref().map(|p| plane(p, "partition.plane")).transpose()? });
        }
    };
    match spec.plane {
        None => Ok(strategy),
        Some(_) => Err(EngineError::bad_parameter("partition.plane", "is only for the strategy plane")),
    }
}

/// A plane; `field` is its path in the request.
pub(super) fn plane(plane: &v1::CutPlane, field: &str) -> Result<Plane> {
    let vector = |value: Option<v1::Point>, name: &str| {
        let field = format!("{field}.{name}");
        let v1::Point { x, y, z } = required(value, &field)?;
        if [x, y, z].iter().all(|value| value.is_finite()) {
            Ok([x, y, z])
        } else {
            Err(EngineError::bad_parameter(&field, format!("({x}, {y}, {z}) is not finite")))
        }
    };
    let (point, normal) = (vector(plane.point, "point")?, vector(plane.normal, "normal")?);
    if normal == [0.0; 3] {
        return Err(EngineError::bad_parameter(&format!("{field}.normal"), "must not be 0"));
    }
    Ok(Plane { point, normal })
}

/// The faces that an edit of patches lists.
pub(super) fn patch_faces(engine: &Engine, array: Option<&v1::PackedArray>) -> Result<Vec<u32>> {
    let rows: Vec<[u32; 1]> = u32_rows(engine, required(array, "faces")?, "faces")?;
    Ok(rows.into_flattened())
}

pub(super) fn positive(value: f64, field: &str) -> Result<()> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(EngineError::bad_parameter(field, format!("{value} is not positive and finite")))
    }
}

/// Which charts, for all patches without a spec of their own.
pub(crate) fn charts(spec: &v1::ChartSpec) -> Result<ChartSpec> {
    charts::spec(spec).map_err(|error| within("charts", error))
}

pub(super) fn bounds(min_size: Option<f64>, max_size: Option<f64>, growth_rate: Option<f64>, field: &str) -> Result<()> {
    for (value, name) in [(min_size, "min_size"), (max_size, "max_size")] {
        value.map_or(Ok(()), |value| positive(value, &format!("{field}.{name}")))?;
    }
    if let (Some(min), Some(max)) = (min_size, max_size)
        && min > max
    {
        return Err(EngineError::bad_parameter(&format!("{field}.min_size"), format!("{min} is larger than max_size {max}")));
    }
    match growth_rate {
        Some(rate) if !(rate >= 1.0 && rate.is_finite()) => {
            Err(EngineError::bad_parameter(&format!("{field}.growth_rate"), format!("{rate} is below 1 or not finite")))
        }
        _ => Ok(()),
    }
}

/// Most rounds of optimisation that make any sense.
const MAX_ROUNDS: u32 = 100;

/// How to optimise.
pub(crate) fn optimize(spec: &v1::OptimizeSpec) -> Result<OptimizeSpec> {
    let default = OptimizeSpec::default();
    let fit = match known(spec.fit, "optimize.fit")? {
        v1::SurfaceFit::Unspecified | v1::SurfaceFit::Faces => SurfaceFit::Faces,
        v1::SurfaceFit::Vertices => SurfaceFit::Vertices,
    };
    let spec = OptimizeSpec { rounds: spec.rounds.unwrap_or(default.rounds), min_kappa: spec.min_kappa.unwrap_or(default.min_kappa), fit };
    if spec.rounds > MAX_ROUNDS {
        return Err(EngineError::bad_parameter("optimize.rounds", format!("{} is more than {MAX_ROUNDS}", spec.rounds)));
    }
    if !(0.0..1.0).contains(&spec.min_kappa) {
        return Err(EngineError::bad_parameter("optimize.min_kappa", format!("{} is not in [0, 1)", spec.min_kappa)));
    }
    Ok(spec)
}

/// An edit of the inputs.
pub(crate) fn change(engine: &Engine, change: Option<v1::Change>) -> Result<Change> {
    use v1::change::Change as Wire;
    Ok(match required(change.and_then(|c| c.change), "change")? {
        Wire::Features(spec) => Change::Features(features(engine, &spec)?),
        Wire::Partition(spec) => Change::Partition(partition(&spec)?),
        Wire::Charts(spec) => Change::Chart(charts(&spec)?),
        Wire::Size(spec) => Change::Size(sizes::size(engine, &spec)?),
        Wire::Lock(spec) => Change::Lock(sizes::lock(engine, &spec)?),
        Wire::Mesher(spec) => meshers::change(engine, &spec)?,
        Wire::Optimize(spec) => Change::Optimize(optimize(&spec)?),
        Wire::Rollback(rollback) => Change::Rollback(Revision(rollback.to_revision)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::engine::EngineConfig;
    use remesh_engine::error::Reason;

    fn field_of(error: &EngineError) -> &str {
        error.metadata().iter().find(|(key, _)| key == "field").map_or("", |(_, field)| field)
    }

    #[test]
    fn unset_fields_take_the_engine_defaults() {
        let engine = Engine::new(EngineConfig::default());
        assert_eq!(features(&engine, &v1::FeatureSpec::default()), Ok(FeatureSpec::default()));
        assert_eq!(partition(&v1::PartitionSpec::default()), Ok(PartitionSpec::default()));
        assert_eq!(charts(&v1::ChartSpec::default()), Ok(ChartSpec::default()));
        assert_eq!(optimize(&v1::OptimizeSpec::default()), Ok(OptimizeSpec::default()));
    }

    #[test]
    fn a_plane_must_be_one_and_go_with_its_strategy() {
        let point = |[x, y, z]: [f64; 3]| Some(v1::Point { x, y, z });
        let plane = |point, normal| Some(v1::CutPlane { point, normal });
        let (origin, up) = (point([0.0; 3]), point([0.0, 0.0, 2.0]));
        let spec = |strategy: v1::PartitionStrategy, plane| v1::PartitionSpec { strategy: strategy.into(), plane, ..Default::default() };
        let by_plane = |plane| partition(&spec(v1::PartitionStrategy::Plane, plane));
        for (bad, field) in [
            (partition(&spec(v1::PartitionStrategy::Unspecified, plane(origin, up))), "partition.plane"),
            (partition(&spec(v1::PartitionStrategy::Handles, plane(origin, up))), "partition.plane"),
            (by_plane(plane(None, up)), "partition.plane.point"),
            (by_plane(plane(origin, None)), "partition.plane.normal"),
            (by_plane(plane(origin, origin)), "partition.plane.normal"),
            (by_plane(plane(point([f64::NAN, 0.0, 0.0]), up)), "partition.plane.point"),
            (by_plane(plane(origin, point([0.0, f64::INFINITY, 0.0]))), "partition.plane.normal"),
            (partition(&v1::PartitionSpec { strategy: 99, ..Default::default() }), "partition.strategy"),
            (partition(&v1::PartitionSpec { borders: -1, ..Default::default() }), "partition.borders"),
        ] {
            let error = bad.expect_err(field);
            assert_eq!((error.reason(), field_of(&error)), (Reason::BadParameter, field));
        }
        for wire in [spec(v1::PartitionStrategy::Plane, plane(origin, up)), spec(v1::PartitionStrategy::Plane, None)] {
            let engine = partition(&wire).expect("valid");
            assert_eq!(partition(&crate::convert::to_proto::partition(&engine)), Ok(engine), "there and back");
        }
    }

    #[test]
    fn bad_fields_are_named() {
        let engine = Engine::new(EngineConfig::default());
        let sized = |size| v1::SizeSpec { size: Some(size) };
        let size = sizes::size;
        let cases: Vec<(Result<remesh_engine::sizing::SizeSpec>, &str)> = vec![
            (size(&engine, &v1::SizeSpec::default()), "size"),
            (size(&engine, &sized(v1::size_spec::Size::Uniform(f64::NAN))), "size.uniform"),
            (size(&engine, &sized(v1::size_spec::Size::Triangles(0))), "size.triangles"),
            (
                size(&engine, &sized(v1::size_spec::Size::Graded(v1::GradedSize { min_size: 2.0, max_size: 1.0, growth_rate: 1.5 }))),
                "size.graded.min_size",
            ),
        ];
        for (result, field) in cases {
            assert_eq!(field_of(&result.expect_err(field)), field);
        }
        assert_eq!(field_of(&output_format(99, "format").expect_err("unknown")), "format");
        let twice = columns(&[1, 1], &[v1::DataColumn::Positions], &[]);
        assert_eq!(field_of(&twice.expect_err("twice")), "columns");
    }
}
