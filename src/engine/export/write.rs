//! What the writers share: numbers as text, region numbers that fit, and sentences about what is lost.

use super::FaceData;
use crate::import::Format;
use crate::mesh::{LengthUnit, SurfaceMesh};
use crate::quads::shape::eta;
use crate::vector::Vec3;
use std::io::Write;

/// Appends formatted text; writing to memory cannot fail.
macro_rules! put {
    ($out:expr, $($arg:tt)*) => {
        { let _ = write!($out, $($arg)*); }
    };
}
pub(crate) use put;

/// Appends a point, each number with the fewest digits that give it back exactly.
pub(crate) fn put_point(out: &mut Vec<u8>, p: &Vec3) {
    put!(out, "{:?} {:?} {:?}", p[0], p[1], p[2]);
}

/// A quadrangle or triangle to write.
pub(crate) struct Element {
    /// Its (first) face.
    pub(crate) face: usize,
    corners: [u32; 4],
    count: usize,
}

impl Element {
    pub(crate) fn corners(&self) -> &[u32] {
        &self.corners[..self.count]
    }

    /// Eta of a quadrangle, the given kappa of a triangle.
    pub(crate) fn shape(&self, mesh: &SurfaceMesh, kappa: &[f64]) -> f64 {
        match self.count {
            4 => eta(&self.corners.map(|v| mesh.positions[v as usize])).clamp(0.0, 1.0),
            _ => kappa[self.face],
        }
    }
}

/// The elements of a mesh the first faces of which are in pairs the halves of quadrangles.
pub(crate) fn elements(mesh: &SurfaceMesh, quads: u32) -> impl Iterator<Item = Element> {
    let pairs = quads as usize;
    let quad = move |q: usize| {
        let ([a, b, c], [_, _, d]) = (mesh.triangles[2 * q], mesh.triangles[2 * q + 1]);
        Element { face: 2 * q, corners: [a, b, c, d], count: 4 }
    };
    let triangle = move |face: usize| {
        let [a, b, c] = mesh.triangles[face];
        Element { face, corners: [a, b, c, 0], count: 3 }
    };
    (0..pairs).map(quad).chain((2 * pairs..mesh.triangles.len()).map(triangle))
}

/// Name and value by element of the shape measure: kappa, or `shape` if there are quadrangles.
pub(crate) fn element_shape(mesh: &SurfaceMesh, data: FaceData<'_>) -> Option<(&'static str, Vec<f64>)> {
    let kappa = data.kappa?;
    let name = if data.quads > 0 { "shape" } else { "kappa" };
    Some((name, elements(mesh, data.quads).map(|e| e.shape(mesh, kappa)).collect()))
}

/// Faces of each region, regions and faces in order.
pub(crate) fn faces_by_region(mesh: &SurfaceMesh) -> Vec<Vec<u32>> {
    let mut faces = vec![Vec::new(); mesh.regions.len()];
    for (face, &region) in mesh.face_region.iter().enumerate() {
        faces[region as usize].push(face as u32);
    }
    faces
}

/// Whether there is nothing to tell about regions: one without a name and with number 0.
pub(crate) fn has_only_default_region(mesh: &SurfaceMesh) -> bool {
    matches!(mesh.regions.as_slice(), [only] if only.name.is_empty() && only.id == 0)
}

/// Region numbers as the format can hold them: 32 bits, at least `least`, all different. Kept if they already are so,
/// otherwise counted from 1, which is told.
pub(crate) fn region_numbers(mesh: &SurfaceMesh, least: i64, warnings: &mut Vec<String>) -> Vec<i32> {
    let numbers: Vec<i32> = mesh.regions.iter().filter(|r| r.id >= least).filter_map(|r| i32::try_from(r.id).ok()).collect();
    let mut sorted = numbers.clone();
    sorted.sort_unstable();
    sorted.dedup();
    if sorted.len() == mesh.regions.len() {
        return numbers;
    }
    if !has_only_default_region(mesh) {
        warnings.push(format!("region numbers were counted anew from 1: the format needs different numbers from {least} to 2147483647"));
    }
    (1..=mesh.regions.len() as i32).collect()
}

fn unit_name(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Unspecified => "unspecified",
        LengthUnit::Metre => "metre",
        LengthUnit::Centimetre => "centimetre",
        LengthUnit::Millimetre => "millimetre",
        LengthUnit::Micrometre => "micrometre",
        LengthUnit::Inch => "inch",
        LengthUnit::Foot => "foot",
    }
}

/// Number of vertices with a coordinate that is not a 32-bit float.
pub(crate) fn rounded_vertices(mesh: &SurfaceMesh) -> usize {
    mesh.positions.iter().filter(|p| p.iter().any(|&x| f64::from(x as f32) != x)).count()
}

/// The sentence about coordinates rounded to 32 bits, if any are.
pub(crate) fn tell_rounding(mesh: &SurfaceMesh, warnings: &mut Vec<String>) {
    let rounded = rounded_vertices(mesh);
    if rounded > 0 {
        warnings.push(format!("the coordinates of {rounded} vertices were rounded to 32-bit floats"));
    }
}

/// What the format loses whatever the encoding.
pub(crate) fn told_losses(mesh: &SurfaceMesh, data: FaceData<'_>, format: Format) -> Vec<String> {
    let mut warnings = Vec::new();
    if mesh.unit != LengthUnit::Unspecified && format != Format::Gltf {
        warnings.push(format!("the format has no unit; the coordinates are in {}", unit_name(mesh.unit)));
    }
    if data.quads > 0 && matches!(format, Format::Stl | Format::Gltf) {
        warnings.push(format!("the format has triangles only; each of the {} quadrangles was written as two", data.quads));
    }
    let has_face_data = matches!(format, Format::Ply | Format::Msh | Format::Vtu);
    if !has_face_data && data.patch.is_some() {
        warnings.push("the format has no place for the patch of each face".to_owned());
    }
    if !has_face_data && data.kappa.is_some() {
        warnings.push("the format has no place for the quality of each face".to_owned());
    }
    let names_only = matches!(format, Format::Stl | Format::Obj | Format::Gltf);
    let counted = mesh.regions.iter().enumerate().all(|(index, r)| r.name.is_empty() || r.id == index as i64 + 1);
    if names_only && !counted {
        warnings.push("the format has no region numbers; the names are kept".to_owned());
    }
    warnings
}
