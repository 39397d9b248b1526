//! Wire messages to engine inputs. Checks what the wire cannot express (required fields, known enum numbers, whole rows of packed
//! arrays); ranges of numbers are the engine's to check.

use super::charts::{self, within};
use super::patches;
use crate::state::blob_digest;
use bytes::Bytes;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::export::Encoding;
use remesh_engine::features::{FeatureSpec, RegionBorders};
use remesh_engine::import::{Format, ImportOptions, ObjRegions};
use remesh_engine::mesh::{LengthUnit, Region, SurfaceMesh};
use remesh_engine::optimize::OptimizeSpec;
use remesh_engine::parametrize::ChartSpec;
use remesh_engine::partition::{BorderSmoothing, PartitionSpec, PartitionStrategy, Plane};
use remesh_engine::planar::{Mesher, QuadKind};
use remesh_engine::quality::QualityScope;
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource, Revision};
use remesh_engine::sizing::SizeSpec;
use remesh_proto::v1;
use std::borrow::Cow;
use std::time::Duration;

fn required<T>(value: Option<T>, field: &str) -> Result<T> {
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

fn format(number: i32, field: &str) -> Result<Option<Format>> {
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

fn unit(number: i32, field: &str) -> Result<LengthUnit> {
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
        v1::packed_array::Data::Blob(name) => read(&engine.blob(blob_digest(name, field)?)?.bytes),
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

fn f64_rows<const N: usize>(engine: &Engine, array: &v1::PackedArray, field: &str) -> Result<Vec<[f64; N]>> {
    with_packed(engine, array, field, |bytes| rows(bytes, field, f64::from_le_bytes))
}

fn u32_rows<const N: usize>(engine: &Engine, array: &v1::PackedArray, field: &str) -> Result<Vec<[u32; N]>> {
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

fn positive(value: f64, field: &str) -> Result<()> {
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

/// Which sizes.
pub(crate) fn size(engine: &Engine, spec: &v1::SizeSpec) -> Result<SizeSpec> {
    use v1::size_spec::Size;
    match required(spec.size.as_ref(), "size")? {
        Size::Uniform(size) => positive(*size, "size.uniform").map(|()| SizeSpec::Uniform { size: *size }),
        Size::Triangles(0) => Err(EngineError::bad_parameter("size.triangles", "must be positive")),
        Size::Triangles(triangles) => Ok(SizeSpec::TriangleCount { triangles: *triangles }),
        Size::PerVertex(per_vertex) => {
            let array = required(per_vertex.sizes.as_ref(), "size.per_vertex.sizes")?;
            let sizes: Vec<[f64; 1]> = f64_rows(engine, array, "size.per_vertex.sizes")?;
            if let Some(bad) = sizes.iter().position(|[s]| !(*s > 0.0 && s.is_finite())) {
                let message = format!("the size of vertex {bad} is not positive and finite");
                return Err(EngineError::bad_parameter("size.per_vertex.sizes", message));
            }
            bounds(per_vertex.min_size, per_vertex.max_size, per_vertex.growth_rate, "size.per_vertex")?;
            Ok(SizeSpec::PerVertex {
                sizes: sizes.into_flattened(),
                min_size: per_vertex.min_size,
                max_size: per_vertex.max_size,
                growth_rate: per_vertex.growth_rate,
            })
        }
        Size::Graded(v1::GradedSize { min_size, max_size, growth_rate }) => {
            bounds(Some(*min_size), Some(*max_size), Some(*growth_rate), "size.graded")?;
            Ok(SizeSpec::Graded { min_size: *min_size, max_size: *max_size, growth_rate: *growth_rate })
        }
    }
}

fn bounds(min_size: Option<f64>, max_size: Option<f64>, growth_rate: Option<f64>, field: &str) -> Result<()> {
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

/// Which mesher.
pub(crate) fn mesher(spec: &v1::MesherSpec) -> Result<Mesher> {
    let mesher = match known(spec.kind, "mesher.kind")? {
        v1::MesherKind::Unspecified | v1::MesherKind::Frontal => Mesher::Frontal,
        v1::MesherKind::Quads => Mesher::Quads(if spec.all_quads { QuadKind::All } else { QuadKind::Mixed }),
    };
    if spec.all_quads && mesher.quads().is_none() {
        return Err(EngineError::bad_parameter("mesher.all_quads", "goes with the mesher MESHER_KIND_QUADS only"));
    }
    Ok(mesher)
}

/// Most rounds of optimisation that make any sense.
const MAX_ROUNDS: u32 = 100;

/// How to optimise.
pub(crate) fn optimize(spec: &v1::OptimizeSpec) -> Result<OptimizeSpec> {
    let default = OptimizeSpec::default();
    let spec = OptimizeSpec { rounds: spec.rounds.unwrap_or(default.rounds), min_kappa: spec.min_kappa.unwrap_or(default.min_kappa) };
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
        Wire::Size(spec) => Change::Size(size(engine, &spec)?),
        Wire::Mesher(spec) => Change::Mesher(mesher(&spec)?),
        Wire::Optimize(spec) => Change::Optimize(optimize(&spec)?),
        Wire::Rollback(rollback) => Change::Rollback(Revision(rollback.to_revision)),
    })
}

/// How to read.
pub(crate) fn import_options(engine: &Engine, options: Option<v1::ImportOptions>) -> Result<ImportOptions> {
    let options = options.unwrap_or_default();
    if !(0.0..=0.1).contains(&options.weld_tolerance) {
        let message = format!("{} is not in [0, 0.1] (a share of the bounding box diagonal)", options.weld_tolerance);
        return Err(EngineError::bad_parameter("options.weld_tolerance", message));
    }
    Ok(ImportOptions {
        format: format(options.format, "options.format")?,
        weld_tolerance: options.weld_tolerance,
        assume_unit: unit(options.assume_unit, "options.assume_unit")?,
        obj_regions: match known(options.obj_regions, "options.obj_regions")? {
            v1::ObjRegions::Unspecified | v1::ObjRegions::Automatic => ObjRegions::Automatic,
            v1::ObjRegions::Group => ObjRegions::Group,
            v1::ObjRegions::Object => ObjRegions::Object,
            v1::ObjRegions::Material => ObjRegions::Material,
        },
        only_regions: options.only_regions,
        max_faces: engine.config.max_faces,
    })
}

/// Triangles of a sample for which no number is given.
const SAMPLE_TRIANGLES: u64 = 20_000;

/// Which sample.
pub(crate) fn sample(engine: &Engine, spec: &v1::SampleSpec) -> Result<SampleSpec> {
    let triangles = spec.triangles.unwrap_or(SAMPLE_TRIANGLES);
    if triangles > engine.config.max_faces {
        let message = format!("a sample of {triangles} triangles is beyond the limit of {}", engine.config.max_faces);
        return Err(EngineError::new(Reason::LimitReached, message));
    }
    Ok(SampleSpec {
        kind: match known(spec.kind, "sample.kind")? {
            v1::SampleKind::Unspecified => return Err(EngineError::bad_parameter("sample.kind", "is required")),
            v1::SampleKind::Artery => SampleKind::Artery,
            v1::SampleKind::Pelvis => SampleKind::Pelvis,
            v1::SampleKind::Brake => SampleKind::Brake,
            v1::SampleKind::CadPart => SampleKind::CadPart,
            v1::SampleKind::Tube => SampleKind::Tube,
            v1::SampleKind::Lattice => SampleKind::Lattice,
        },
        triangles,
        genus: spec.genus,
        outlets: spec.outlets,
        aspect_ratio: spec.aspect_ratio,
    })
}

fn arrays(engine: &Engine, arrays: &v1::MeshArrays) -> Result<SurfaceMesh> {
    let positions = f64_rows(engine, required(arrays.positions.as_ref(), "arrays.positions")?, "arrays.positions")?;
    let triangles: Vec<[u32; 3]> = u32_rows(engine, required(arrays.triangles.as_ref(), "arrays.triangles")?, "arrays.triangles")?;
    let regions: Vec<Region> = match arrays.regions.as_slice() {
        [] => vec![Region { id: 0, name: String::new() }],
        listed => listed.iter().map(|r| Region { id: r.id, name: r.name.clone() }).collect(),
    };
    let face_region: Vec<u32> = match &arrays.face_regions {
        None => vec![0; triangles.len()],
        Some(array) => u32_rows::<1>(engine, array, "arrays.face_regions")?.into_flattened(),
    };
    if face_region.len() != triangles.len() {
        let message = format!("there are {} entries for {} faces", face_region.len(), triangles.len());
        return Err(EngineError::bad_parameter("arrays.face_regions", message));
    }
    if let Some(face) = face_region.iter().position(|&r| r as usize >= regions.len()) {
        let message = format!("face {face} names region {} of {}", face_region[face], regions.len());
        return Err(EngineError::new(Reason::IndexOutOfRange, message).with_metadata("field", "arrays.face_regions"));
    }
    Ok(SurfaceMesh { positions, triangles, face_region, regions, unit: unit(arrays.unit, "arrays.unit")? })
}

/// A file in a message: put among the blobs, so that equal files are kept once.
fn inline_file(engine: &Engine, bytes: Bytes) -> Result<MeshSource> {
    Ok(MeshSource::File(engine.put_blob(bytes.into())?))
}

fn blob_file(engine: &Engine, name: &str, field: &str) -> Result<MeshSource> {
    Ok(MeshSource::File(engine.blob(blob_digest(name, field)?)?))
}

/// Where the surface of an import comes from. Copies arrays: call on the compute pool.
pub(crate) fn import_source(engine: &Engine, source: Option<v1::import_mesh_request::Source>) -> Result<MeshSource> {
    use v1::import_mesh_request::Source;
    match required(source, "source")? {
        Source::Blob(name) => blob_file(engine, &name, "blob"),
        Source::Inline(bytes) => inline_file(engine, bytes),
        Source::Arrays(wire) => Ok(MeshSource::from_arrays(arrays(engine, &wire)?)),
        Source::Sample(spec) => Ok(MeshSource::Sample(sample(engine, &spec)?)),
    }
}

/// The surface of a one-call remesh.
pub(crate) fn one_call_source(engine: &Engine, source: Option<v1::remesh_mesh_request::Source>) -> Result<MeshSource> {
    use v1::remesh_mesh_request::Source;
    match required(source, "source")? {
        Source::Data(bytes) => inline_file(engine, bytes),
        Source::Blob(name) => blob_file(engine, &name, "blob"),
        Source::Sample(spec) => Ok(MeshSource::Sample(sample(engine, &spec)?)),
    }
}

/// A file to compare.
pub(crate) fn mesh_file(engine: &Engine, file: Option<v1::MeshFile>, field: &str) -> Result<(MeshSource, ImportOptions)> {
    use v1::mesh_file::Source;
    let file = required(file, field)?;
    let inside = |name: &str| -> Cow<'static, str> { format!("{field}.{name}").into() };
    let source = match required(file.source, &inside("source"))? {
        Source::Blob(name) => blob_file(engine, &name, &inside("blob"))?,
        Source::Inline(bytes) => inline_file(engine, bytes)?,
        Source::Sample(spec) => MeshSource::Sample(sample(engine, &spec)?),
    };
    Ok((source, import_options(engine, file.options)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::engine::EngineConfig;

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
        let cases: Vec<(Result<SizeSpec>, &str)> = vec![
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

    #[test]
    fn arrays_must_fit_each_other() {
        let engine = Engine::new(EngineConfig::default());
        let packed = |bytes: Vec<u8>| Some(v1::PackedArray { data: Some(v1::packed_array::Data::Inline(bytes.into())) });
        let positions: Vec<u8> = [0.0f64, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|x| x.to_le_bytes()).collect();
        let triangles: Vec<u8> = [0u32, 1, 2].iter().flat_map(|x| x.to_le_bytes()).collect();
        let good = v1::MeshArrays { positions: packed(positions), triangles: packed(triangles), ..Default::default() };
        assert_eq!(arrays(&engine, &good).expect("good").positions[1], [1.0, 0.0, 0.0]);
        let ragged = v1::MeshArrays { positions: packed(vec![0; 25]), ..good.clone() };
        assert_eq!(field_of(&arrays(&engine, &ragged).expect_err("ragged")), "arrays.positions");
        let far = v1::MeshArrays { face_regions: packed(7u32.to_le_bytes().to_vec()), ..good };
        assert_eq!(arrays(&engine, &far).expect_err("far").reason(), Reason::IndexOutOfRange);
    }
}
