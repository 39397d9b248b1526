//! STL, ascii and binary. A binary file may begin with the word "solid": the length of the file decides first.

use super::binary::{ByteOrder, ByteReader};
use super::raw::{RawSurface, checkpoint};
use super::text::{Lines, Words, name_of};
use crate::error::{EngineError, Reason, Result};
use crate::work::Work;

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Number of faces that the header of a binary file announces.
fn announced(bytes: &[u8]) -> Option<u64> {
    bytes.get(80..84).and_then(|raw| raw.first_chunk::<4>()).map(|raw| u64::from(u32::from_le_bytes(*raw)))
}

/// Whether the length is exactly that of a binary STL with the announced number of faces.
pub(crate) fn has_binary_length(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|n| HEADER as u64 + RECORD as u64 * n == bytes.len() as u64)
}

/// Whether the file begins like an ascii STL: the word "solid", then text.
pub(crate) fn looks_ascii(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    let head = &start[..start.len().min(512)];
    head.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && head.get(5).is_none_or(u8::is_ascii_whitespace)
        && !head.contains(&0)
}

pub(crate) fn read(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    if !has_binary_length(bytes) && looks_ascii(bytes) { read_ascii(bytes, raw, work) } else { read_binary(bytes, raw, work) }
}

fn read_binary(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    raw.format = "STL binary".to_owned();
    let count = announced(bytes).ok_or_else(|| {
        EngineError::new(Reason::FormatMalformed, format!("a binary STL has a header of {HEADER} bytes; the file has {}", bytes.len()))
    })?;
    let holds = ((bytes.len() - HEADER) / RECORD) as u64;
    if holds < count {
        let message = format!("the header of the binary STL announces {count} faces, but the file ends after {holds}");
        return Err(EngineError::new(Reason::FormatMalformed, message)
            .with_metadata("byte", bytes.len())
            .with_hint("the file was cut off; transfer or write it again"));
    }
    let trailing = bytes.len() - HEADER - RECORD * count as usize;
    if trailing > 0 {
        raw.warnings.push(format!("{trailing} bytes after the last face of the binary STL were not read"));
    }
    raw.positions.reserve_exact(3 * count as usize);
    raw.triangles.reserve_exact(count as usize);
    raw.face_region.reserve_exact(count as usize);
    let name = binary_name(bytes);
    let region = if name.is_empty() { raw.regions.numbered(0, "") } else { raw.regions.named(&name) };
    let mut attributes = 0u64;
    let mut reader = ByteReader::new(&bytes[HEADER..], HEADER, ByteOrder::Little);
    for face in 0..count as usize {
        checkpoint(work, face)?;
        reader.skip(12)?;
        let mut corners = [0; 3];
        for corner in &mut corners {
            let point = [f64::from(reader.f32()?), f64::from(reader.f32()?), f64::from(reader.f32()?)];
            *corner = raw.push_vertex(point)?;
        }
        raw.push_triangle(corners, region)?;
        attributes += u64::from(reader.u16()? != 0);
    }
    if attributes > 0 {
        raw.warnings.push(format!("the 16-bit attributes of {attributes} faces (colours, in some programs) were not read"));
    }
    Ok(())
}

/// The name of the one solid, if our writer put it into the header.
fn binary_name(bytes: &[u8]) -> String {
    let header = &bytes[..80];
    header.strip_prefix(NAME_MARK).map(|rest| name_of(rest.split(|&b| b == 0).next().unwrap_or(rest))).unwrap_or_default()
}

/// What precedes the name of the region in the header of a binary STL that we write.
pub(crate) const NAME_MARK: &[u8] = b"binary STL; region: ";

struct Ascii {
    solids: u32,
    region: Option<u32>,
    facet: Vec<u32>,
    polygons: u64,
    foreign: u64,
    named: bool,
}

fn read_ascii(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    raw.format = "STL ascii".to_owned();
    let mut state = Ascii { solids: 0, region: None, facet: Vec::new(), polygons: 0, foreign: 0, named: false };
    let mut lines = Lines::new(bytes);
    let mut inside_facet = false;
    while let Some(line) = lines.next() {
        checkpoint(work, lines.number())?;
        let mut words = Words::new(line);
        let Some(word) = words.next() else { continue };
        match word.to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let point = words.point().ok_or_else(|| lines.malformed("\"vertex\" is not followed by three numbers"))?;
                if !inside_facet {
                    return Err(lines.malformed("\"vertex\" outside of a facet"));
                }
                let index = raw.push_vertex(point)?;
                state.facet.push(index);
            }
            b"facet" if !inside_facet => inside_facet = true,
            b"facet" => return Err(lines.malformed("a facet begins before the one before it has ended")),
            b"endfacet" => {
                inside_facet = false;
                end_facet(&mut state, raw, &lines)?;
            }
            b"outer" | b"endloop" => {}
            b"solid" => begin_solid(&mut state, raw, words.rest()),
            b"endsolid" => state.region = None,
            // Some programs append statements of their own after the last solid.
            _ if state.solids > 0 && state.region.is_none() && !inside_facet => state.foreign += 1,
            other => {
                let shown = name_of(&other[..other.len().min(40)]);
                return Err(lines.malformed(format!("{shown:?} is not a word of an ascii STL")));
            }
        }
    }
    if inside_facet {
        return Err(lines.ends_early("the rest of a facet"));
    }
    if let ([only], false) = (raw.regions.list.as_mut_slice(), state.named) {
        only.id = 0;
    }
    if state.foreign > 0 {
        raw.warnings.push(format!("{} lines between or after the solids are not STL and were not read", state.foreign));
    }
    if state.polygons > 0 {
        raw.warnings.push(format!("{} facets have more than three corners; they were fanned", state.polygons));
    }
    Ok(())
}

/// Solids of the same name are one region; solids without a name are regions of their own.
fn begin_solid(state: &mut Ascii, raw: &mut RawSurface, name: &[u8]) {
    state.solids += 1;
    let name = name_of(name);
    state.named |= !name.is_empty();
    state.region = Some(if name.is_empty() { raw.regions.numbered(i64::from(state.solids), "") } else { raw.regions.named(&name) });
}

fn end_facet(state: &mut Ascii, raw: &mut RawSurface, lines: &Lines<'_>) -> Result<()> {
    if state.facet.len() < 3 {
        return Err(lines.malformed(format!("a facet has {} vertices", state.facet.len())));
    }
    state.polygons += u64::from(state.facet.len() > 3);
    let region = match state.region {
        Some(region) => region,
        None => *state.region.insert(raw.regions.numbered(0, "")),
    };
    raw.push_polygon(&state.facet, region)?;
    state.facet.clear();
    Ok(())
}
