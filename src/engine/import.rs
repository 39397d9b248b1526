//! Reading files into the surface model: format detection, readers, then repair of what is harmless to repair.

use crate::diagnose::Diagnosis;
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::{LengthUnit, SurfaceMesh};
use crate::work::Work;

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
    let _ = (bytes, options, work);
    Err(EngineError::new(Reason::NotBuilt, "import"))
}

/// The same for arrays that a client or the sample generator gives: weld, drop, orient, diagnose.
///
/// # Errors
/// As [`import_mesh`], without the format errors.
pub fn import_arrays(mesh: SurfaceMesh, options: &ImportOptions, work: &Work<'_>) -> Result<Imported> {
    let _ = (mesh, options, work);
    Err(EngineError::new(Reason::NotBuilt, "import of arrays"))
}
