//! Where meshes come from: files, arrays and samples, with how they are read.

use super::from_proto::{f64_rows, format, known, required, u32_rows, unit};
use super::to_proto;
use crate::state::blob_digest;
use bytes::Bytes;
use remesh_engine::engine::Engine;
use remesh_engine::error::{EngineError, Reason, Result};
use remesh_engine::import::{ImportOptions, ObjRegions};
use remesh_engine::mesh::{Region, SurfaceMesh};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::MeshSource;
use remesh_proto::v1;
use std::borrow::Cow;

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

/// The surface of a session that was kept; a file by its digest.
pub(super) fn stored_source(engine: &Engine, source: Option<v1::stored_mesh::Source>) -> Result<MeshSource> {
    use v1::stored_mesh::Source;
    match required(source, "source")? {
        Source::Blob(digest) => Ok(MeshSource::File(engine.blob(&digest)?)),
        Source::Arrays(wire) => Ok(MeshSource::from_arrays(arrays(engine, &wire)?)),
        Source::Sample(spec) => Ok(MeshSource::Sample(sample(engine, &spec)?)),
    }
}

/// Numbers as a packed array in the message.
pub(super) fn packed<const B: usize>(numbers: impl Iterator<Item = [u8; B]>) -> v1::PackedArray {
    let bytes: Vec<u8> = numbers.flatten().collect();
    v1::PackedArray { data: Some(v1::packed_array::Data::Inline(bytes.into())) }
}

/// Arrays of a client, back.
pub(super) fn wire_arrays(mesh: &SurfaceMesh) -> v1::MeshArrays {
    v1::MeshArrays {
        positions: Some(packed(mesh.positions.as_flattened().iter().map(|x| x.to_le_bytes()))),
        triangles: Some(packed(mesh.triangles.as_flattened().iter().map(|v| v.to_le_bytes()))),
        face_regions: Some(packed(mesh.face_region.iter().map(|r| r.to_le_bytes()))),
        regions: to_proto::regions(&mesh.regions),
        unit: to_proto::unit(mesh.unit).into(),
    }
}

/// Which sample, back.
pub(super) fn wire_sample(spec: &SampleSpec) -> v1::SampleSpec {
    let kind = match spec.kind {
        SampleKind::Artery => v1::SampleKind::Artery,
        SampleKind::Pelvis => v1::SampleKind::Pelvis,
        SampleKind::Brake => v1::SampleKind::Brake,
        SampleKind::CadPart => v1::SampleKind::CadPart,
        SampleKind::Tube => v1::SampleKind::Tube,
        SampleKind::Lattice => v1::SampleKind::Lattice,
    };
    v1::SampleSpec {
        kind: kind.into(),
        triangles: Some(spec.triangles),
        genus: spec.genus,
        outlets: spec.outlets,
        aspect_ratio: spec.aspect_ratio,
    }
}

/// How to read, back. The limit of faces is that of the daemon.
pub(super) fn wire_options(options: &ImportOptions) -> v1::ImportOptions {
    let ImportOptions { format, weld_tolerance, assume_unit, obj_regions, only_regions, max_faces: _ } = options;
    let obj_regions = match obj_regions {
        ObjRegions::Automatic => v1::ObjRegions::Automatic,
        ObjRegions::Group => v1::ObjRegions::Group,
        ObjRegions::Object => v1::ObjRegions::Object,
        ObjRegions::Material => v1::ObjRegions::Material,
    };
    v1::ImportOptions {
        format: format.map_or(v1::MeshFormat::Unspecified, to_proto::format).into(),
        weld_tolerance: *weld_tolerance,
        assume_unit: to_proto::unit(*assume_unit).into(),
        obj_regions: obj_regions.into(),
        only_regions: only_regions.clone(),
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
