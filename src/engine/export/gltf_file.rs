//! glTF 2.0, GLB or JSON with an embedded buffer: one primitive and one material per region.

use super::Exported;
use super::write::{faces_by_region, has_only_default_region, tell_rounding};
use crate::error::{EngineError, Reason, Result};
use crate::import::base64;
use crate::import::raw::stand_in_name;
use crate::mesh::{LengthUnit, SurfaceMesh};
use serde_json::{Value, json};

/// Component types and view targets of glTF.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Metres per unit.
fn metres(unit: LengthUnit) -> Option<f64> {
    Some(match unit {
        LengthUnit::Unspecified | LengthUnit::Metre => return None,
        LengthUnit::Centimetre => 1e-2,
        LengthUnit::Millimetre => 1e-3,
        LengthUnit::Micrometre => 1e-6,
        LengthUnit::Inch => 0.0254,
        LengthUnit::Foot => 0.3048,
    })
}

/// The document without the source of its buffer, and the buffer: positions, then the indices of each region.
fn document(mesh: &SurfaceMesh, out: &mut Exported) -> (Value, Vec<u8>) {
    tell_rounding(mesh, &mut out.warnings);
    if mesh.unit == LengthUnit::Unspecified {
        out.warnings.push("glTF is in metres; the coordinates have no unit and were written as they are".to_owned());
    }
    let mut buffer = Vec::with_capacity(mesh.positions.len() * 12 + mesh.triangles.len() * 12);
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in &mesh.positions {
        for k in 0..3 {
            let x = p[k] as f32;
            low[k] = low[k].min(x);
            high[k] = high[k].max(x);
            buffer.extend_from_slice(&x.to_le_bytes());
        }
    }
    let mut views = vec![json!({"buffer": 0, "byteLength": buffer.len(), "target": ARRAY_BUFFER})];
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": FLOAT, "count": mesh.positions.len(), "type": "VEC3", "min": low, "max": high
    })];
    let (mut primitives, mut materials) = (Vec::new(), Vec::new());
    for (region, faces) in mesh.regions.iter().zip(faces_by_region(mesh)).filter(|(_, f)| !f.is_empty()) {
        let offset = buffer.len();
        faces.iter().flat_map(|&f| mesh.triangles[f as usize]).for_each(|v| buffer.extend_from_slice(&v.to_le_bytes()));
        let view = json!({"buffer": 0, "byteOffset": offset, "byteLength": buffer.len() - offset, "target": ELEMENT_ARRAY_BUFFER});
        accessors.push(json!({
            "bufferView": views.len(), "componentType": UNSIGNED_INT, "count": faces.len() * 3, "type": "SCALAR"
        }));
        views.push(view);
        let mut primitive = json!({"attributes": {"POSITION": 0}, "indices": accessors.len() - 1, "mode": 4});
        if !has_only_default_region(mesh) {
            primitive["material"] = json!(materials.len());
            materials.push(json!({"name": stand_in_name(region), "doubleSided": true}));
        }
        primitives.push(primitive);
    }
    let mut node = json!({"mesh": 0});
    if let Some(factor) = metres(mesh.unit) {
        node["scale"] = json!([factor, factor, factor]);
    }
    let mut root = json!({
        "asset": {"version": "2.0", "generator": "remeshd"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [node],
        "meshes": [{"primitives": primitives}], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": buffer.len()}],
    });
    if !materials.is_empty() {
        root["materials"] = json!(materials);
    }
    (root, buffer)
}

pub(crate) fn write_json(mesh: &SurfaceMesh, out: &mut Exported) -> Result<()> {
    let (mut root, buffer) = document(mesh, out);
    let data = String::from_utf8(base64::encode(&buffer)).map_err(|_| EngineError::invariant("base64 is text"))?;
    root["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{data}"));
    out.bytes = root.to_string().into_bytes();
    Ok(())
}

pub(crate) fn write_glb(mesh: &SurfaceMesh, out: &mut Exported) -> Result<()> {
    let (root, mut buffer) = document(mesh, out);
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + buffer.len();
    let total = u32::try_from(total).map_err(|_| EngineError::new(Reason::LimitReached, "GLB ends at 4 GiB"))?;
    let bytes = &mut out.bytes;
    bytes.reserve_exact(total as usize);
    bytes.extend_from_slice(b"glTF");
    bytes.extend_from_slice(&2u32.to_le_bytes());
    bytes.extend_from_slice(&total.to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &buffer)] {
        bytes.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(chunk);
    }
    Ok(())
}
