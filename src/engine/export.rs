//! Writing surfaces to files; what a format cannot carry is said.

use crate::error::{EngineError, Reason, Result};
use crate::import::Format;
use crate::mesh::SurfaceMesh;

/// Variant of a format, where it has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Encoding {
    /// The usual one: STL binary (ascii if there are named regions), PLY binary, MSH 4.1 ascii, GLB, VTU ascii.
    #[default]
    Default,
    /// Text.
    Ascii,
    /// Binary.
    Binary,
    /// MSH 2.2 ascii.
    Msh22,
}

/// What is written with the surface, where the format can carry it.
#[derive(Debug, Clone, Copy, Default)]
pub struct FaceData<'a> {
    /// Patch of each face.
    pub patch: Option<&'a [u32]>,
    /// Kappa of each face.
    pub kappa: Option<&'a [f64]>,
}

/// A written file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// What it could not carry (region names, units, double precision, patches...), one sentence each.
    pub warnings: Vec<String>,
}

/// Writes a surface.
///
/// # Errors
/// [`Reason::FormatUnsupported`] for an encoding the format does not have.
pub fn export_mesh(mesh: &SurfaceMesh, data: FaceData<'_>, format: Format, encoding: Encoding) -> Result<Exported> {
    let _ = (mesh, data, format, encoding);
    Err(EngineError::new(Reason::NotBuilt, "export"))
}
