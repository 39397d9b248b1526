//! OFF: regions, if there are several, as face colours.

use super::Exported;
use super::write::{elements, has_only_default_region, put, put_point};
use crate::mesh::SurfaceMesh;
use std::io::Write;

/// A colour for a region, different for the first 2^24 of them: the bits of the number spread from the top over the channels.
fn colour(region: u32) -> [u8; 3] {
    let mut channels = [0u8; 3];
    for bit in 0..24 {
        channels[bit % 3] |= ((region >> bit & 1) as u8) << (7 - bit / 3);
    }
    channels
}

pub(crate) fn write(mesh: &SurfaceMesh, quads: u32, out: &mut Exported) {
    let bytes = &mut out.bytes;
    put!(bytes, "OFF\n{} {} 0\n", mesh.positions.len(), mesh.triangles.len() - quads as usize);
    for p in &mesh.positions {
        put_point(bytes, p);
        bytes.push(b'\n');
    }
    let coloured = mesh.regions.len() > 1;
    for element in elements(mesh, quads) {
        put!(bytes, "{}", element.corners().len());
        element.corners().iter().for_each(|v| put!(bytes, " {v}"));
        if coloured {
            let [r, g, b] = colour(mesh.face_region[element.face] + 1);
            put!(bytes, " {r} {g} {b}");
        }
        bytes.push(b'\n');
    }
    if coloured {
        out.warnings.push("OFF has no regions; they were written as face colours, without names and numbers".to_owned());
    } else if !has_only_default_region(mesh) {
        out.warnings.push("OFF has no regions; name and number of the only one were not written".to_owned());
    }
}
