//! Gmsh MSH 4.1 (ascii and binary) and 2.2 (ascii): one discrete surface per region, regions as physical groups,
//! patch and kappa as element data.

use super::write::{Element, element_shape, elements, faces_by_region, has_only_default_region, put, put_point, region_numbers};
use super::{Exported, FaceData};
use crate::import::raw::one_line;
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, bounds};
use std::io::Write;

/// How MSH 4.1 is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    Ascii,
    Binary,
}

/// Numbers in either encoding; in ascii a space follows each and [`Numbers::end`] ends the line.
struct Numbers<'a> {
    bytes: &'a mut Vec<u8>,
    style: Style,
}

impl Numbers<'_> {
    fn int(&mut self, value: i32) {
        match self.style {
            Style::Ascii => put!(self.bytes, "{value} "),
            Style::Binary => self.bytes.extend_from_slice(&value.to_le_bytes()),
        }
    }

    fn size(&mut self, value: usize) {
        match self.style {
            Style::Ascii => put!(self.bytes, "{value} "),
            Style::Binary => self.bytes.extend_from_slice(&(value as u64).to_le_bytes()),
        }
    }

    fn ints(&mut self, values: &[i32]) {
        values.iter().for_each(|&v| self.int(v));
    }

    fn sizes(&mut self, values: &[usize]) {
        values.iter().for_each(|&v| self.size(v));
    }

    fn point(&mut self, p: &Vec3) {
        match self.style {
            Style::Ascii => {
                put_point(self.bytes, p);
                self.bytes.push(b' ');
            }
            Style::Binary => p.iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes())),
        }
    }

    fn end(&mut self) {
        if self.style == Style::Ascii {
            self.bytes.pop();
            self.bytes.push(b'\n');
        }
    }

    fn section(&mut self, mark: &str) {
        if self.style == Style::Binary && mark.starts_with("$End") {
            self.bytes.push(b'\n');
        }
        put!(self.bytes, "{mark}\n");
    }
}

fn write_names(mesh: &SurfaceMesh, numbers: &[i32], bytes: &mut Vec<u8>) {
    let named: Vec<_> = mesh.regions.iter().zip(numbers).filter(|(r, _)| !r.name.is_empty()).collect();
    if named.is_empty() {
        return;
    }
    put!(bytes, "$PhysicalNames\n{}\n", named.len());
    for (region, number) in named {
        put!(bytes, "2 {number} \"{}\"\n", one_line(&region.name).replace('"', "'"));
    }
    bytes.extend_from_slice(b"$EndPhysicalNames\n");
}

/// Physical numbers, none if there is only the default region.
fn physical(mesh: &SurfaceMesh, out: &mut Exported) -> Option<Vec<i32>> {
    if mesh.regions.iter().any(|r| r.name.contains('"')) {
        out.warnings.push("double quotes in region names were replaced by single ones".to_owned());
    }
    (!has_only_default_region(mesh)).then(|| region_numbers(mesh, 1, &mut out.warnings))
}

pub(crate) fn write41(mesh: &SurfaceMesh, data: FaceData<'_>, style: Style, out: &mut Exported) {
    let physical = physical(mesh, out);
    let bytes = &mut out.bytes;
    put!(bytes, "$MeshFormat\n4.1 {} 8\n", u8::from(style == Style::Binary));
    if style == Style::Binary {
        bytes.extend_from_slice(&1i32.to_le_bytes());
        bytes.push(b'\n');
    }
    bytes.extend_from_slice(b"$EndMeshFormat\n");
    write_names(mesh, physical.as_deref().unwrap_or_default(), bytes);
    let groups = faces_by_region(mesh);
    let mut to = Numbers { bytes, style };
    write_entities(mesh, &groups, physical.as_deref(), &mut to);
    let nodes = mesh.positions.len();
    to.section("$Nodes");
    to.sizes(&[1, nodes, 1, nodes]);
    to.end();
    to.ints(&[2, 1, 0]);
    to.size(nodes);
    to.end();
    for node in 1..=nodes {
        to.size(node);
        to.end();
    }
    for p in &mesh.positions {
        to.point(p);
        to.end();
    }
    to.section("$EndNodes");
    // Elements of each region, triangles and quadrangles apart.
    let mut blocks: Vec<[Vec<(usize, Element)>; 2]> = groups.iter().map(|_| Default::default()).collect();
    for (number, element) in elements(mesh, data.quads).enumerate() {
        blocks[mesh.face_region[element.face] as usize][element.corners().len() - 3].push((number, element));
    }
    let used = blocks.iter().flatten().filter(|block| !block.is_empty()).count();
    let count = mesh.triangles.len() - data.quads as usize;
    to.section("$Elements");
    to.sizes(&[used, count, 1, count]);
    to.end();
    for (region, block) in blocks.iter().enumerate().flat_map(|(region, pair)| pair.iter().map(move |block| (region, block))) {
        let Some((_, first)) = block.first() else { continue };
        to.ints(&[2, region as i32 + 1, first.corners().len() as i32 - 1]);
        to.size(block.len());
        to.end();
        for (number, element) in block {
            to.size(number + 1);
            element.corners().iter().for_each(|&v| to.size(v as usize + 1));
            to.end();
        }
    }
    to.section("$EndElements");
    write_data(mesh, data, style, out);
}

/// Discrete surfaces, one per region, each with its box and its physical group.
fn write_entities(mesh: &SurfaceMesh, groups: &[Vec<u32>], physical: Option<&[i32]>, to: &mut Numbers<'_>) {
    to.section("$Entities");
    to.sizes(&[0, 0, groups.len(), 0]);
    to.end();
    for (region, faces) in groups.iter().enumerate() {
        let corners: Vec<Vec3> = faces.iter().flat_map(|&f| mesh.corners(f as usize)).collect();
        let (low, high) = bounds(&corners).unwrap_or_default();
        to.int(region as i32 + 1);
        to.point(&low);
        to.point(&high);
        match physical {
            Some(numbers) => {
                to.size(1);
                to.int(numbers[region]);
            }
            None => to.size(0),
        }
        to.size(0);
        to.end();
    }
    to.section("$EndEntities");
}

pub(crate) fn write22(mesh: &SurfaceMesh, data: FaceData<'_>, out: &mut Exported) {
    let physical = physical(mesh, out);
    let bytes = &mut out.bytes;
    bytes.extend_from_slice(b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
    write_names(mesh, physical.as_deref().unwrap_or_default(), bytes);
    put!(bytes, "$Nodes\n{}\n", mesh.positions.len());
    for (node, p) in mesh.positions.iter().enumerate() {
        put!(bytes, "{} ", node + 1);
        put_point(bytes, p);
        bytes.push(b'\n');
    }
    put!(bytes, "$EndNodes\n$Elements\n{}\n", mesh.triangles.len() - data.quads as usize);
    for (number, element) in elements(mesh, data.quads).enumerate() {
        let region = mesh.face_region[element.face];
        let group = physical.as_ref().map_or(0, |numbers| numbers[region as usize]);
        put!(bytes, "{} {} 2 {group} {}", number + 1, element.corners().len() - 1, region + 1);
        element.corners().iter().for_each(|v| put!(bytes, " {}", v + 1));
        bytes.push(b'\n');
    }
    bytes.extend_from_slice(b"$EndElements\n");
    write_data(mesh, data, Style::Ascii, out);
}

/// One view per face quantity, as Gmsh shows them.
fn write_data(mesh: &SurfaceMesh, data: FaceData<'_>, style: Style, out: &mut Exported) {
    let patch = data.patch.map(|p| ("patch_id", elements(mesh, data.quads).map(|e| f64::from(p[e.face])).collect::<Vec<_>>()));
    for (name, values) in [patch, element_shape(mesh, data)].into_iter().flatten() {
        put!(out.bytes, "$ElementData\n1\n\"{name}\"\n1\n0.0\n3\n0\n1\n{}\n", values.len());
        let mut to = Numbers { bytes: &mut out.bytes, style };
        for (face, value) in values.iter().enumerate() {
            to.int(face as i32 + 1);
            match style {
                Style::Ascii => put!(to.bytes, "{value:?} "),
                Style::Binary => to.bytes.extend_from_slice(&value.to_le_bytes()),
            }
            to.end();
        }
        to.section("$EndElementData");
    }
}
