//! Wavefront OBJ: regions as `g` statements, opened again whenever the region changes.

use super::Exported;
use super::write::{elements, has_only_default_region, put, put_point};
use crate::import::raw::stand_in_name;
use crate::mesh::SurfaceMesh;
use std::io::Write;

pub(crate) fn write(mesh: &SurfaceMesh, quads: u32, out: &mut Exported) {
    let bytes = &mut out.bytes;
    for p in &mesh.positions {
        bytes.extend_from_slice(b"v ");
        put_point(bytes, p);
        bytes.push(b'\n');
    }
    let names: Vec<String> = mesh.regions.iter().map(stand_in_name).collect();
    if names.iter().any(|n| n.contains(char::is_whitespace)) {
        out.warnings.push("region names with spaces may be taken for several groups by other OBJ readers".to_owned());
    }
    let mut open = has_only_default_region(mesh).then_some(0);
    for element in elements(mesh, quads) {
        let region = mesh.face_region[element.face];
        if open != Some(region) {
            put!(bytes, "g {}\n", names[region as usize]);
            open = Some(region);
        }
        bytes.push(b'f');
        element.corners().iter().for_each(|v| put!(bytes, " {}", v + 1));
        bytes.push(b'\n');
    }
}
