//! PLY: regions as a face property with names in comments, patch and kappa as further properties.

use super::write::{elements, has_only_default_region, put, put_point, region_numbers};
use super::{Exported, FaceData};
use crate::import::raw::one_line;
use crate::mesh::SurfaceMesh;
use std::io::Write;

/// How the body is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    Ascii,
    Binary,
}

pub(crate) fn write(mesh: &SurfaceMesh, data: FaceData<'_>, style: Style, out: &mut Exported) {
    // A file with patches but no regions would be read back with the patches as regions.
    let numbers =
        (!has_only_default_region(mesh) || data.patch.is_some()).then(|| region_numbers(mesh, i64::from(i32::MIN), &mut out.warnings));
    write_header(mesh, data, style, numbers.as_deref(), &mut out.bytes);
    let bytes = &mut out.bytes;
    match style {
        Style::Ascii => {
            for p in &mesh.positions {
                put_point(bytes, p);
                bytes.push(b'\n');
            }
        }
        Style::Binary => mesh.positions.as_flattened().iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes())),
    }
    for element in elements(mesh, data.quads) {
        let face = element.face;
        let corners = element.corners();
        let region = numbers.as_ref().map(|n| n[mesh.face_region[face] as usize]);
        let patch = data.patch.map(|p| p[face] as i32);
        let kappa = data.kappa.map(|k| element.shape(mesh, k));
        if style == Style::Ascii {
            put!(bytes, "{}", corners.len());
            corners.iter().for_each(|v| put!(bytes, " {v}"));
            region.iter().chain(&patch).for_each(|number| put!(bytes, " {number}"));
            kappa.iter().for_each(|k| put!(bytes, " {k:?}"));
            bytes.push(b'\n');
        } else {
            bytes.push(corners.len() as u8);
            corners.iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
            region.iter().chain(&patch).for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
            kappa.iter().for_each(|k| bytes.extend_from_slice(&k.to_le_bytes()));
        }
    }
}

fn write_header(mesh: &SurfaceMesh, data: FaceData<'_>, style: Style, numbers: Option<&[i32]>, bytes: &mut Vec<u8>) {
    put!(bytes, "ply\nformat {} 1.0\n", if style == Style::Ascii { "ascii" } else { "binary_little_endian" });
    for (region, number) in mesh.regions.iter().zip(numbers.unwrap_or_default()) {
        put!(bytes, "comment region {number} {}\n", one_line(&region.name));
    }
    put!(bytes, "element vertex {}\nproperty double x\nproperty double y\nproperty double z\n", mesh.positions.len());
    // The usual type of indices is int, which some readers insist on.
    let index = if mesh.positions.len() <= i32::MAX as usize { "int" } else { "uint" };
    put!(bytes, "element face {}\nproperty list uchar {index} vertex_indices\n", mesh.triangles.len() - data.quads as usize);
    if numbers.is_some() {
        bytes.extend_from_slice(b"property int region\n");
    }
    if data.patch.is_some() {
        bytes.extend_from_slice(b"property int patch_id\n");
    }
    if data.kappa.is_some() {
        put!(bytes, "property double {}\n", if data.quads > 0 { "shape" } else { "kappa" });
    }
    bytes.extend_from_slice(b"end_header\n");
}
