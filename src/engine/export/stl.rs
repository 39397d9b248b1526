//! STL: ascii with one solid per region, or binary.

use super::Exported;
use super::write::{faces_by_region, has_only_default_region, put, put_point, tell_rounding};
use crate::error::{EngineError, Reason, Result};
use crate::import::raw::stand_in_name;
use crate::import::stl::NAME_MARK;
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, area_vector_twice, unit};
use std::io::Write;

/// Whether binary STL would lose regions.
pub(crate) fn is_better_as_text(mesh: &SurfaceMesh) -> bool {
    mesh.regions.len() > 1 || mesh.regions.iter().any(|r| !r.name.is_empty())
}

fn normal(mesh: &SurfaceMesh, face: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(face);
    unit(area_vector_twice(a, b, c))
}

pub(crate) fn write_ascii(mesh: &SurfaceMesh, out: &mut Exported) {
    let bytes = &mut out.bytes;
    for (region, faces) in mesh.regions.iter().zip(faces_by_region(mesh)) {
        if faces.is_empty() {
            continue;
        }
        let name = if has_only_default_region(mesh) { String::new() } else { stand_in_name(region) };
        put!(bytes, "solid {name}\n");
        for face in faces {
            let n = normal(mesh, face as usize);
            put!(bytes, "facet normal {:.6} {:.6} {:.6}\nouter loop\n", n[0], n[1], n[2]);
            for p in &mesh.corners(face as usize) {
                bytes.extend_from_slice(b"vertex ");
                put_point(bytes, p);
                bytes.push(b'\n');
            }
            bytes.extend_from_slice(b"endloop\nendfacet\n");
        }
        put!(bytes, "endsolid {name}\n");
    }
}

pub(crate) fn write_binary(mesh: &SurfaceMesh, out: &mut Exported) -> Result<()> {
    let count = u32::try_from(mesh.triangles.len()).map_err(|_| EngineError::new(Reason::LimitReached, "too many faces for STL"))?;
    tell_rounding(mesh, &mut out.warnings);
    let mut header = [0u8; 80];
    let mut title = b"binary STL".to_vec();
    match mesh.regions.as_slice() {
        [_] if has_only_default_region(mesh) => {}
        [only] => {
            title = [NAME_MARK, stand_in_name(only).as_bytes()].concat();
            if title.len() > header.len() {
                out.warnings.push("the name of the region was cut to fit the header of binary STL".to_owned());
                // Not in the middle of a character.
                let end = (0..=header.len()).rev().find(|&n| std::str::from_utf8(&title[..n]).is_ok());
                title.truncate(end.unwrap_or(0));
            }
        }
        several => out.warnings.push(format!("binary STL has one solid; the {} regions were not written", several.len())),
    }
    header[..title.len()].copy_from_slice(&title);
    out.bytes.reserve_exact(84 + 50 * mesh.triangles.len());
    out.bytes.extend_from_slice(&header);
    out.bytes.extend_from_slice(&count.to_le_bytes());
    for face in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(face);
        for x in [normal(mesh, face), a, b, c].as_flattened() {
            out.bytes.extend_from_slice(&(*x as f32).to_le_bytes());
        }
        out.bytes.extend_from_slice(&[0, 0]);
    }
    Ok(())
}
