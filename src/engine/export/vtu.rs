//! VTK XML unstructured grid, for ParaView: triangles and quadrangles with region, patch and kappa as cell data, region names as field data.

use super::write::{Element, element_shape, elements, put};
use super::{Exported, FaceData};
use crate::import::base64;
use crate::import::raw::stand_in_name;
use crate::mesh::SurfaceMesh;
use std::io::Write;

/// How the arrays are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    Ascii,
    Base64,
}

/// VTK's number for a triangle.
const TRIANGLE: u8 = 5;
/// VTK's number for a quadrangle.
const QUAD: u8 = 9;

/// Numbers of a data array.
trait Item: Copy {
    const TYPE: &'static str;
    fn append(self, bytes: &mut Vec<u8>);
    fn print(self, text: &mut Vec<u8>);
}

macro_rules! item {
    ($type:ty, $name:literal) => {
        impl Item for $type {
            const TYPE: &'static str = $name;
            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
            fn print(self, text: &mut Vec<u8>) {
                put!(text, "{self:?}");
            }
        }
    };
}

item!(f64, "Float64");
item!(i64, "Int64");
item!(u8, "UInt8");

fn put_array<T: Item>(name: &str, tuple: usize, values: &[T], style: Style, out: &mut Vec<u8>) {
    let format = if style == Style::Ascii { "ascii" } else { "binary" };
    put!(out, "<DataArray type=\"{}\" Name=\"{name}\" NumberOfComponents=\"{tuple}\" format=\"{format}\">\n", T::TYPE);
    match style {
        Style::Ascii => {
            for (index, value) in values.iter().enumerate() {
                value.print(out);
                out.push(if (index + 1).is_multiple_of(tuple.max(12 / tuple * tuple)) { b'\n' } else { b' ' });
            }
        }
        Style::Base64 => {
            let mut bytes = Vec::with_capacity(std::mem::size_of_val(values) + 8);
            bytes.extend_from_slice(&(std::mem::size_of_val(values) as u64).to_le_bytes());
            values.iter().for_each(|v| v.append(&mut bytes));
            out.extend_from_slice(&base64::encode(&bytes));
        }
    }
    out.extend_from_slice(b"\n</DataArray>\n");
}

pub(crate) fn write(mesh: &SurfaceMesh, data: FaceData<'_>, style: Style, out: &mut Exported) {
    let bytes = &mut out.bytes;
    let list: Vec<Element> = elements(mesh, data.quads).collect();
    let cells = list.len();
    bytes.extend_from_slice(b"<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n");
    put_region_names(mesh, bytes);
    put!(bytes, "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{cells}\">\n<Points>\n", mesh.positions.len());
    put_array("Points", 3, mesh.positions.as_flattened(), style, bytes);
    bytes.extend_from_slice(b"</Points>\n<Cells>\n");
    let corners: Vec<i64> = list.iter().flat_map(|e| e.corners()).map(|&v| i64::from(v)).collect();
    put_array("connectivity", 1, &corners, style, bytes);
    let mut end = 0;
    let ends = list.iter().map(|e| {
        end += e.corners().len() as i64;
        end
    });
    put_array("offsets", 1, &ends.collect::<Vec<_>>(), style, bytes);
    let types: Vec<u8> = list.iter().map(|e| if e.corners().len() == 4 { QUAD } else { TRIANGLE }).collect();
    put_array("types", 1, &types, style, bytes);
    bytes.extend_from_slice(b"</Cells>\n<CellData>\n");
    let region: Vec<i64> = list.iter().map(|e| mesh.regions[mesh.face_region[e.face] as usize].id).collect();
    put_array("region_id", 1, &region, style, bytes);
    if let Some(patch) = data.patch {
        put_array("patch_id", 1, &list.iter().map(|e| i64::from(patch[e.face])).collect::<Vec<_>>(), style, bytes);
    }
    if let Some((name, values)) = element_shape(mesh, data) {
        put_array(name, 1, &values, style, bytes);
    }
    bytes.extend_from_slice(b"</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
}

/// One number for each region under the name `region NAME`: VTK's own arrays of strings are not read by other programs.
fn put_region_names(mesh: &SurfaceMesh, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(b"<FieldData>\n");
    for region in &mesh.regions {
        let name = escaped(&stand_in_name(region));
        put!(
            bytes,
            "<DataArray type=\"Int64\" Name=\"region {name}\" NumberOfTuples=\"1\" format=\"ascii\">\n{}\n</DataArray>\n",
            region.id
        );
    }
    bytes.extend_from_slice(b"</FieldData>\n");
}

/// Text for an attribute of XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
