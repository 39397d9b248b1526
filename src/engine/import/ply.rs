//! PLY, ascii and binary in both byte orders: vertices, faces, triangle strips; regions from a face property
//! `region` or `patch_id`, with names in comments `region ID NAME`.

use super::binary::{ByteOrder, ByteReader};
use super::raw::{RawSurface, checkpoint};
use super::text::{Lines, Words, name_of};
use crate::error::{EngineError, Reason, Result};
use crate::work::Work;
use std::collections::HashMap;

/// Type of a number in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(word: &[u8]) -> Option<Kind> {
        Some(match word {
            b"char" | b"int8" => Kind::I8,
            b"uchar" | b"uint8" => Kind::U8,
            b"short" | b"int16" => Kind::I16,
            b"ushort" | b"uint16" => Kind::U16,
            b"int" | b"int32" => Kind::I32,
            b"uint" | b"uint32" => Kind::U32,
            b"float" | b"float32" => Kind::F32,
            b"double" | b"float64" => Kind::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Kind::I8 | Kind::U8 => 1,
            Kind::I16 | Kind::U16 => 2,
            Kind::I32 | Kind::U32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }
}

#[derive(Debug)]
struct Property {
    name: Vec<u8>,
    kind: Kind,
    /// Type of the length, for a list.
    list: Option<Kind>,
}

#[derive(Debug)]
struct ElementKind {
    name: Vec<u8>,
    count: u64,
    properties: Vec<Property>,
}

impl ElementKind {
    fn property(&self, names: &[&[u8]]) -> Option<usize> {
        names.iter().find_map(|name| self.properties.iter().position(|p| p.name == *name))
    }

    /// Least number of bytes of one element in a binary file.
    fn least_bytes(&self) -> usize {
        self.properties.iter().map(|p| p.list.unwrap_or(p.kind).size()).sum()
    }
}

/// Numbers of the body, one after the other.
enum Numbers<'a> {
    Text(Lines<'a>, Words<'a>),
    Binary(ByteReader<'a>),
}

impl Numbers<'_> {
    #[inline]
    fn next(&mut self, kind: Kind) -> Result<f64> {
        match self {
            Numbers::Text(lines, words) => loop {
                if let Some(word) = words.next() {
                    return fast_float2::parse(word).map_err(|_| lines.malformed(format!("{:?} is not a number", name_of(word))));
                }
                *words = Words::new(lines.next().ok_or_else(|| lines.ends_early("more numbers"))?);
            },
            Numbers::Binary(bytes) => Ok(match kind {
                Kind::I8 => f64::from(bytes.i8()?),
                Kind::U8 => f64::from(bytes.u8()?),
                Kind::I16 => f64::from(bytes.i16()?),
                Kind::U16 => f64::from(bytes.u16()?),
                Kind::I32 => f64::from(bytes.i32()?),
                Kind::U32 => f64::from(bytes.u32()?),
                Kind::F32 => f64::from(bytes.f32()?),
                Kind::F64 => bytes.f64()?,
            }),
        }
    }

    fn malformed(&self, message: impl std::fmt::Display) -> EngineError {
        match self {
            Numbers::Text(lines, _) => lines.malformed(message),
            Numbers::Binary(bytes) => bytes.malformed(message),
        }
    }
}

struct Header {
    order: Option<ByteOrder>,
    elements: Vec<ElementKind>,
    region_names: Vec<(i64, String)>,
}

pub(crate) fn read(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut lines = Lines::new(bytes);
    let header = read_header(&mut lines)?;
    let mut numbers = match header.order {
        None => Numbers::Text(lines, Words::new(b"")),
        Some(order) => Numbers::Binary(ByteReader::new(lines.rest(), lines.offset(), order)),
    };
    raw.format = match header.order {
        None => "PLY ascii",
        Some(ByteOrder::Little) => "PLY binary little endian",
        Some(ByteOrder::Big) => "PLY binary big endian",
    }
    .to_owned();
    for element in &header.elements {
        if let Numbers::Binary(bytes) = &numbers {
            bytes.fits(element.count, element.least_bytes(), "elements")?;
        }
        if element.properties.is_empty() {
            continue;
        }
        match element.name.as_slice() {
            b"vertex" => read_vertices(element, &mut numbers, raw, work)?,
            b"face" => read_faces(element, &header.region_names, &mut numbers, raw, work)?,
            b"tristrips" => read_strips(element, &mut numbers, raw, work)?,
            _ => skip_element(element, &mut numbers, work)?,
        }
    }
    Ok(())
}

fn read_header(lines: &mut Lines<'_>) -> Result<Header> {
    let mut header = Header { order: None, elements: Vec::new(), region_names: Vec::new() };
    let mut format_known = false;
    loop {
        let line = lines.next().ok_or_else(|| lines.ends_early("the rest of the PLY header"))?;
        let mut words = Words::new(line);
        match words.next() {
            None | Some(b"ply" | b"obj_info") => {}
            Some(b"comment") => {
                if words.next() == Some(b"region")
                    && let Some(id) = words.parse()
                {
                    header.region_names.push((id, name_of(words.rest())));
                }
            }
            Some(b"format") => {
                format_known = true;
                header.order = match words.next() {
                    Some(b"ascii") => None,
                    Some(b"binary_little_endian") => Some(ByteOrder::Little),
                    Some(b"binary_big_endian") => Some(ByteOrder::Big),
                    other => {
                        let shown = name_of(other.unwrap_or_default());
                        return Err(EngineError::new(Reason::FormatUnsupported, format!("{shown:?} is not a PLY encoding")));
                    }
                };
            }
            Some(b"element") => {
                let name = words.next().unwrap_or_default().to_vec();
                let count = words.parse().ok_or_else(|| lines.malformed("an element has no count"))?;
                header.elements.push(ElementKind { name, count, properties: Vec::new() });
            }
            Some(b"property") => {
                let property = read_property(&mut words).ok_or_else(|| lines.malformed("the property has an unknown type"))?;
                let element = header.elements.last_mut().ok_or_else(|| lines.malformed("a property before any element"))?;
                element.properties.push(property);
            }
            Some(b"end_header") if format_known => return Ok(header),
            Some(b"end_header") => return Err(lines.malformed("the header has no format line")),
            Some(other) => return Err(lines.malformed(format!("{:?} is not a word of a PLY header", name_of(other)))),
        }
    }
}

fn read_property(words: &mut Words<'_>) -> Option<Property> {
    let first = words.next()?;
    let (list, kind) = if first == b"list" { (Some(Kind::of(words.next()?)?), Kind::of(words.next()?)?) } else { (None, Kind::of(first)?) };
    Some(Property { name: words.next()?.to_vec(), kind, list })
}

/// Length of a list, which has to be a whole number.
fn list_length(kind: Kind, numbers: &mut Numbers<'_>) -> Result<u64> {
    let length = numbers.next(kind)?;
    if !(0.0..1e15).contains(&length) || length.fract() != 0.0 {
        return Err(numbers.malformed(format!("{length} is not the length of a list")));
    }
    Ok(length as u64)
}

fn skip_property(property: &Property, numbers: &mut Numbers<'_>) -> Result<()> {
    let count = match property.list {
        Some(kind) => list_length(kind, numbers)?,
        None => 1,
    };
    (0..count).try_for_each(|_| numbers.next(property.kind).map(|_| ()))
}

fn skip_element(element: &ElementKind, numbers: &mut Numbers<'_>, work: &Work<'_>) -> Result<()> {
    for row in 0..element.count {
        checkpoint(work, row as usize)?;
        element.properties.iter().try_for_each(|p| skip_property(p, numbers))?;
    }
    Ok(())
}

fn read_vertices(element: &ElementKind, numbers: &mut Numbers<'_>, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let axis_of = |axis: &[u8]| {
        let found = element.properties.iter().position(|p| p.name == axis && p.list.is_none());
        found.ok_or_else(|| EngineError::new(Reason::FormatMalformed, format!("the vertices have no property {}", name_of(axis))))
    };
    let axes = [axis_of(b"x")?, axis_of(b"y")?, axis_of(b"z")?];
    let axis: Vec<Option<usize>> = (0..element.properties.len()).map(|p| axes.iter().position(|&a| a == p)).collect();
    for row in 0..element.count {
        checkpoint(work, row as usize)?;
        let mut point = [0.0; 3];
        for (property, axis) in element.properties.iter().zip(&axis) {
            match axis {
                Some(k) => point[*k] = numbers.next(property.kind)?,
                None => skip_property(property, numbers)?,
            }
        }
        raw.push_vertex(point)?;
    }
    Ok(())
}

/// A vertex index; `None` for a negative one, which ends a strip.
fn vertex_index(kind: Kind, numbers: &mut Numbers<'_>) -> Result<Option<u32>> {
    let index = numbers.next(kind)?;
    if index < 0.0 {
        return Ok(None);
    }
    if index >= f64::from(u32::MAX) || index.fract() != 0.0 {
        return Err(EngineError::new(Reason::IndexOutOfRange, numbers.malformed(format!("{index} is not a vertex index")).message()));
    }
    Ok(Some(index as u32))
}

fn read_faces(
    element: &ElementKind,
    names: &[(i64, String)],
    numbers: &mut Numbers<'_>,
    raw: &mut RawSurface,
    work: &Work<'_>,
) -> Result<()> {
    let indices = element.property(&[b"vertex_indices", b"vertex_index"]);
    let indices = indices.filter(|&p| element.properties[p].list.is_some());
    let indices = indices.ok_or_else(|| EngineError::new(Reason::FormatMalformed, "the faces have no list vertex_indices"))?;
    let region = element.property(&[b"region", b"patch_id"]).filter(|&p| element.properties[p].list.is_none());
    let mut corners = Vec::new();
    // A region has the first name that the comments give its number.
    let mut known: HashMap<i64, u32> = HashMap::new();
    for (id, name) in names {
        known.entry(*id).or_insert_with(|| raw.regions.numbered(*id, name));
    }
    let mut last = None;
    let mut small = 0u64;
    for row in 0..element.count {
        checkpoint(work, row as usize)?;
        corners.clear();
        let mut id = 0;
        for (index, property) in element.properties.iter().enumerate() {
            match property.list {
                Some(length) if index == indices => {
                    for _ in 0..list_length(length, numbers)? {
                        let corner = vertex_index(property.kind, numbers)?;
                        corners.push(corner.ok_or_else(|| negative_index(numbers))?);
                    }
                }
                None if Some(index) == region => id = numbers.next(property.kind)? as i64,
                _ => skip_property(property, numbers)?,
            }
        }
        small += u64::from(corners.len() < 3);
        let face_region = match last {
            Some((before, region)) if before == id => region,
            _ => *known.entry(id).or_insert_with(|| raw.regions.numbered(id, "")),
        };
        last = Some((id, face_region));
        raw.push_polygon(&corners, face_region)?;
    }
    if small > 0 {
        raw.warnings.push(format!("{small} faces with fewer than three corners were not read"));
    }
    Ok(())
}

fn negative_index(numbers: &Numbers<'_>) -> EngineError {
    EngineError::new(Reason::IndexOutOfRange, numbers.malformed("a face has a negative vertex index").message())
}

/// Strips of triangles separated by -1; every other triangle of a strip runs the other way.
fn read_strips(element: &ElementKind, numbers: &mut Numbers<'_>, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let indices = element.property(&[b"vertex_indices", b"vertex_index"]);
    let indices = indices.filter(|&p| element.properties[p].list.is_some());
    let indices = indices.ok_or_else(|| EngineError::new(Reason::FormatMalformed, "the strips have no list vertex_indices"))?;
    let region = raw.regions.numbered(0, "");
    for _ in 0..element.count {
        for (index, property) in element.properties.iter().enumerate() {
            match property.list {
                Some(length) if index == indices => {
                    let count = list_length(length, numbers)?;
                    let mut strip: [u32; 2] = [0; 2];
                    let mut filled = 0usize;
                    for item in 0..count {
                        checkpoint(work, item as usize)?;
                        let Some(vertex) = vertex_index(property.kind, numbers)? else {
                            filled = 0;
                            continue;
                        };
                        if filled >= 2 {
                            let [a, b] = strip;
                            raw.push_triangle(if filled.is_multiple_of(2) { [a, b, vertex] } else { [b, a, vertex] }, region)?;
                        }
                        strip = [strip[1], vertex];
                        filled += 1;
                    }
                }
                _ => skip_property(property, numbers)?,
            }
        }
    }
    Ok(())
}
