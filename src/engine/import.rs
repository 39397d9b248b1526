//! Reading files into the surface model: format detection, readers, then repair of what is harmless to repair.

pub(crate) mod base64;
mod binary;
mod detect;
mod gltf_file;
mod msh;
mod obj;
mod off;
mod ply;
pub(crate) mod raw;
mod select;
pub(crate) mod stl;
#[cfg(test)]
mod tests;
mod text;

use crate::diagnose::{Diagnosis, diagnose};
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::{LengthUnit, SurfaceMesh};
use crate::repair::repair;
use crate::work::Work;
use raw::RawSurface;

/// A file format. glTF and GLB are one format (JSON with embedded or data-URI buffers, or binary).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Format {
    /// STL, ascii (many named solids) or binary; told apart by content.
    Stl,
    /// Wavefront OBJ (g / o / usemtl groups).
    Obj,
    /// Stanford PLY, ascii and binary.
    Ply,
    /// Object file format.
    Off,
    /// Gmsh MSH; 2.2 and 4.1, ascii and binary, told apart by content.
    Msh,
    /// glTF 2.0, JSON or GLB.
    Gltf,
    /// VTK XML unstructured grid; written only.
    Vtu,
}

impl Format {
    /// By file extension (without dot, any case).
    pub fn from_extension(extension: &str) -> Option<Format> {
        Some(match extension.to_ascii_lowercase().as_str() {
            "stl" => Format::Stl,
            "obj" => Format::Obj,
            "ply" => Format::Ply,
            "off" => Format::Off,
            "msh" => Format::Msh,
            "gltf" | "glb" => Format::Gltf,
            "vtu" => Format::Vtu,
            _ => return None,
        })
    }
}

/// What of an OBJ file becomes the regions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ObjRegions {
    /// The first of `usemtl`, `g`, `o` that distinguishes faces.
    #[default]
    Automatic,
    /// `g`
    Group,
    /// `o`
    Object,
    /// `usemtl`
    Material,
}

/// How to read.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// `None` detects by content.
    pub format: Option<Format>,
    /// Vertices closer than this share of the bounding box diagonal become one. 0 merges only bitwise equal ones (-0 = 0).
    pub weld_tolerance: f64,
    /// Unit of the file, where the format has none.
    pub assume_unit: LengthUnit,
    /// Source of regions in OBJ files.
    pub obj_regions: ObjRegions,
    /// Names or ids of the regions to keep; empty keeps all. (An MSH file may hold several surfaces.)
    pub only_regions: Vec<String>,
    /// Most faces accepted.
    pub max_faces: u64,
}

impl Default for ImportOptions {
    fn default() -> Self {
        ImportOptions {
            format: None,
            weld_tolerance: 0.0,
            assume_unit: LengthUnit::Unspecified,
            obj_regions: ObjRegions::Automatic,
            only_regions: Vec::new(),
            max_faces: 20_000_000,
        }
    }
}

/// What was done between the file and the surface. All counts are told, never only logged.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImportReport {
    /// The format found, as in "STL binary", "MSH 4.1 ascii".
    pub format: String,
    /// Faces in the file, polygons fanned to triangles.
    pub faces_read: u64,
    /// Vertices in the file.
    pub vertices_read: u64,
    /// Vertices that vanished by welding.
    pub vertices_welded: u64,
    /// Exact duplicate faces dropped (same three vertices, whatever the direction).
    pub duplicate_faces_dropped: u64,
    /// Faces of zero area or with a repeated vertex dropped.
    pub degenerate_faces_dropped: u64,
    /// Vertices that no face uses, dropped.
    pub unused_vertices_dropped: u64,
    /// Faces turned to make the orientation consistent.
    pub faces_flipped: u64,
    /// Non-manifold vertices split into copies, one per fan (bow ties), if that was done.
    pub vertices_split: u64,
    /// What else a user should know: data of the file that was not read, groupings that were not used.
    pub warnings: Vec<String>,
}

/// A surface as imported: repaired where that is harmless, diagnosed, perhaps not fit for remeshing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Imported {
    /// The surface.
    pub mesh: SurfaceMesh,
    /// What was done to it.
    pub report: ImportReport,
    /// What is (still) wrong with it, measured on `mesh`.
    pub diagnosis: Diagnosis,
}

impl Contents for Imported {
    fn feed(&self, into: &mut Feeder) {
        self.mesh.feed(into);
    }

    fn bytes(&self) -> usize {
        self.mesh.bytes() + 4096
    }
}

/// Reads a file: parse, weld, drop duplicates and zero-area faces, orient, diagnose.
/// A surface that cannot be remeshed is still imported; `diagnosis` tells why (and [`Diagnosis::refusal`] makes the error).
///
/// # Errors
/// [`Reason::FormatMalformed`] / [`Reason::FormatUnsupported`] with line or byte offset, [`Reason::NonFinite`],
/// [`Reason::IndexOutOfRange`], [`Reason::EmptyMesh`], [`Reason::LimitReached`]. Never panics, whatever the bytes; memory is bounded
/// by a small multiple of the file's size (counts in headers are not trusted).
pub fn import_mesh(bytes: &[u8], options: &ImportOptions, work: &Work<'_>) -> Result<Imported> {
    check_options(options)?;
    let format = match options.format {
        Some(format) => format,
        None => detect::detect(bytes)?,
    };
    let mut raw = RawSurface::new(options.max_faces);
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match format {
        Format::Stl => stl::read(text, &mut raw, work)?,
        Format::Obj => obj::read(text, options.obj_regions, &mut raw, work)?,
        Format::Off => off::read(text, &mut raw, work)?,
        Format::Ply => ply::read(text, &mut raw, work)?,
        Format::Msh => msh::read(text, &mut raw, work)?,
        Format::Gltf => gltf_file::read(text, &mut raw, work)?,
        Format::Vtu => {
            return Err(EngineError::new(Reason::FormatUnsupported, "VTU is written, but not read").with_hint("convert it to PLY or MSH"));
        }
    }
    let report =
        ImportReport { format: std::mem::take(&mut raw.format), warnings: std::mem::take(&mut raw.warnings), ..Default::default() };
    finish(raw.into_mesh(options.assume_unit), report, options, work)
}

fn check_options(options: &ImportOptions) -> Result<()> {
    if !(0.0..0.1).contains(&options.weld_tolerance) {
        let message = format!("{} is not in [0, 0.1): it is a share of the bounding box diagonal", options.weld_tolerance);
        return Err(EngineError::bad_parameter("weld_tolerance", message));
    }
    Ok(())
}

/// What all sources have in common: selection of regions, repair, diagnosis.
fn finish(mut mesh: SurfaceMesh, mut report: ImportReport, options: &ImportOptions, work: &Work<'_>) -> Result<Imported> {
    report.faces_read = mesh.triangles.len() as u64;
    report.vertices_read = mesh.positions.len() as u64;
    work.check()?;
    select::keep_regions(&mut mesh, &options.only_regions, &mut report)?;
    repair(&mut mesh, options.weld_tolerance, &mut report, work)?;
    select::drop_empty_regions(&mut mesh, &mut report);
    let diagnosis = diagnose(&mesh, work)?;
    Ok(Imported { mesh, report, diagnosis })
}

/// The same for arrays that a client or the sample generator gives: weld, drop, orient, diagnose.
///
/// # Errors
/// As [`import_mesh`], without the format errors.
pub fn import_arrays(mesh: SurfaceMesh, options: &ImportOptions, work: &Work<'_>) -> Result<Imported> {
    check_options(options)?;
    if mesh.triangles.len() as u64 > options.max_faces {
        let message = format!("{} faces are more than the {} accepted", mesh.triangles.len(), options.max_faces);
        return Err(EngineError::new(Reason::LimitReached, message));
    }
    let regions = mesh.regions.len();
    if mesh.face_region.len() != mesh.triangles.len() || mesh.face_region.iter().any(|&r| r as usize >= regions) {
        return Err(EngineError::bad_parameter("face_region", "must name one of the regions for each triangle"));
    }
    let report = ImportReport { format: "arrays".to_owned(), ..Default::default() };
    finish(mesh, report, options, work)
}
