//! Writing surfaces to files; what a format cannot carry is said.

mod gltf_file;
mod msh;
mod obj;
mod off;
mod ply;
mod stl;
#[cfg(test)]
mod tests;
mod vtu;
mod write;

use crate::error::{EngineError, Reason, Result};
use crate::import::Format;
use crate::mesh::SurfaceMesh;
use write::told_losses;

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
    /// For `q` below it faces `2 q` = (a, b, c) and `2 q + 1` = (a, c, d) are the halves of quadrangle (a, b, c, d).
    pub quads: u32,
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
/// | format | encodings | regions | face data |
/// | --- | --- | --- | --- |
/// | STL | binary, ascii | ascii: names, one solid each; binary: one name | none |
/// | OBJ | ascii | names, as `g` | none |
/// | PLY | binary (little endian), ascii | number and name | patch, kappa |
/// | OFF | ascii | face colours only | none |
/// | MSH 4.1 | ascii, binary | number and name, as physical groups | patch, kappa |
/// | MSH 2.2 | ascii | number and name, as physical groups | patch, kappa |
/// | glTF | GLB (default, binary), JSON (ascii) | names, as materials | none |
/// | VTU | ascii, binary (base64) | number and name | patch, kappa |
///
/// Quadrangles are written as such in OBJ, PLY, OFF, MSH and VTU, before the triangles, with `shape` (eta, of triangles kappa) in place of
/// `kappa`; STL and glTF get their halves.
///
/// In formats that have names only, a region without a name is called `region_<number>`; [`crate::import`] reads that back.
/// VTU has for each region a field `region NAME` with its number, beside the cell arrays `region_id`, `patch_id` and `kappa`.
/// STL ascii, MSH 4.1 and glTF list faces by region, so their order changes; the others keep it. Vertices keep their order
/// except in STL.
///
/// # Errors
/// [`Reason::FormatUnsupported`] for an encoding the format does not have, [`Reason::BadParameter`] if `data` does not fit the
/// faces, [`Reason::LimitReached`] if the file would exceed what the format can address (STL and GLB: 4 GiB).
pub fn export_mesh(mesh: &SurfaceMesh, data: FaceData<'_>, format: Format, encoding: Encoding) -> Result<Exported> {
    let faces = mesh.triangles.len();
    if data.patch.is_some_and(|p| p.len() != faces) || data.kappa.is_some_and(|k| k.len() != faces) {
        return Err(EngineError::bad_parameter("data", format!("should have one entry for each of the {faces} faces")));
    }
    let is_pair = |pair: &[[u32; 3]]| matches!(pair, [[a, _, c], [x, y, _]] if a == x && c == y);
    if data.quads as usize > faces / 2 || !mesh.triangles.chunks(2).take(data.quads as usize).all(is_pair) {
        return Err(EngineError::bad_parameter("data.quads", "the first faces are not in pairs the halves of quadrangles"));
    }
    let mut out = Exported { bytes: Vec::new(), warnings: told_losses(mesh, data, format) };
    match (format, encoding) {
        (Format::Stl, Encoding::Default) if stl::is_better_as_text(mesh) => stl::write_ascii(mesh, &mut out),
        (Format::Stl, Encoding::Ascii) => stl::write_ascii(mesh, &mut out),
        (Format::Stl, Encoding::Default | Encoding::Binary) => stl::write_binary(mesh, &mut out)?,
        (Format::Obj, Encoding::Default | Encoding::Ascii) => obj::write(mesh, data.quads, &mut out),
        (Format::Ply, Encoding::Default | Encoding::Binary) => ply::write(mesh, data, ply::Style::Binary, &mut out),
        (Format::Ply, Encoding::Ascii) => ply::write(mesh, data, ply::Style::Ascii, &mut out),
        (Format::Off, Encoding::Default | Encoding::Ascii) => off::write(mesh, data.quads, &mut out),
        (Format::Msh, Encoding::Default | Encoding::Ascii) => msh::write41(mesh, data, msh::Style::Ascii, &mut out),
        (Format::Msh, Encoding::Binary) => msh::write41(mesh, data, msh::Style::Binary, &mut out),
        (Format::Msh, Encoding::Msh22) => msh::write22(mesh, data, &mut out),
        (Format::Gltf, Encoding::Default | Encoding::Binary) => gltf_file::write_glb(mesh, &mut out)?,
        (Format::Gltf, Encoding::Ascii) => gltf_file::write_json(mesh, &mut out)?,
        (Format::Vtu, Encoding::Default | Encoding::Ascii) => vtu::write(mesh, data, vtu::Style::Ascii, &mut out),
        (Format::Vtu, Encoding::Binary) => vtu::write(mesh, data, vtu::Style::Base64, &mut out),
        (format, encoding) => {
            let (format, encoding) = (format!("{format:?}").to_uppercase(), format!("{encoding:?}").to_lowercase());
            return Err(EngineError::new(Reason::FormatUnsupported, format!("{format} has no {encoding} encoding")));
        }
    }
    Ok(out)
}
