//! Entities, nodes and elements of MSH 4.1. One walk serves both encodings: [`Cursor`] reads numbers from text or bytes.

use super::elements::{Shape, add_face, element_type};
use super::{State, binary, region_of};
use crate::error::{EngineError, Reason, Result};
use crate::import::binary::ByteReader;
use crate::import::raw::{RawSurface, checkpoint};
use crate::import::text::{Lines, Words};
use crate::work::Work;

/// Reads the numbers of a section in either encoding.
enum Cursor<'a, 'b> {
    Text(&'b mut Lines<'a>, Words<'a>),
    Binary(&'b mut Lines<'a>, ByteReader<'a>, usize),
}

impl<'a, 'b> Cursor<'a, 'b> {
    fn new(lines: &'b mut Lines<'a>, state: &State) -> Self {
        match state.order {
            None => Cursor::Text(lines, Words::new(b"")),
            Some(order) => {
                let bytes = binary(lines, order);
                Cursor::Binary(lines, bytes, state.size_t)
            }
        }
    }

    /// Puts the lines behind what was read.
    fn finish(self) {
        if let Cursor::Binary(lines, bytes, _) = self {
            lines.skip_bytes(bytes.position());
        }
    }

    fn text<T: std::str::FromStr>(lines: &mut Lines<'a>, words: &mut Words<'a>) -> Result<T> {
        loop {
            if let Some(word) = words.next() {
                let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
                return value.ok_or_else(|| lines.malformed("something else than the expected number"));
            }
            *words = Words::new(lines.next_content(None).ok_or_else(|| lines.ends_early("more numbers"))?);
        }
    }

    #[inline]
    fn int(&mut self) -> Result<i64> {
        match self {
            Cursor::Text(lines, words) => Self::text(lines, words),
            Cursor::Binary(_, bytes, _) => Ok(i64::from(bytes.i32()?)),
        }
    }

    #[inline]
    fn size(&mut self) -> Result<u64> {
        match self {
            Cursor::Text(lines, words) => Self::text(lines, words),
            Cursor::Binary(_, bytes, 4) => Ok(u64::from(bytes.u32()?)),
            Cursor::Binary(_, bytes, _) => bytes.u64(),
        }
    }

    #[inline]
    fn real(&mut self) -> Result<f64> {
        match self {
            Cursor::Text(lines, words) => loop {
                if let Some(word) = words.next() {
                    return fast_float2::parse(word).map_err(|_| lines.malformed("something else than a coordinate"));
                }
                *words = Words::new(lines.next_content(None).ok_or_else(|| lines.ends_early("a coordinate"))?);
            },
            Cursor::Binary(_, bytes, _) => bytes.f64(),
        }
    }

    fn malformed(&self, message: &str) -> EngineError {
        match self {
            Cursor::Text(lines, _) => lines.malformed(message),
            Cursor::Binary(_, bytes, _) => bytes.malformed(message),
        }
    }

    /// Ends the present line of an ascii file.
    fn end_line(&mut self) {
        if let Cursor::Text(_, words) = self {
            *words = Words::new(b"");
        }
    }

    /// Bytes (or characters) left, a bound for any count.
    fn remaining(&self) -> usize {
        match self {
            Cursor::Text(lines, words) => lines.rest().len() + words.rest().len(),
            Cursor::Binary(_, bytes, _) => bytes.remaining(),
        }
    }
}

/// Notes the first physical group of each surface; of the other entities nothing is needed.
pub(crate) fn read_entities(lines: &mut Lines<'_>, state: &mut State) -> Result<()> {
    let mut cursor = Cursor::new(lines, state);
    let counts = [cursor.size()?, cursor.size()?, cursor.size()?, cursor.size()?];
    for (dimension, &count) in counts.iter().enumerate().take(3) {
        for _ in 0..count {
            let tag = cursor.int()?;
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                cursor.real()?;
            }
            let groups = cursor.size()?;
            for group in 0..groups {
                let physical = cursor.int()?;
                if dimension == 2 && group == 0 {
                    state.physical_of_surface.insert(tag, physical);
                    state.several_groups += u64::from(groups > 1);
                }
            }
            if dimension > 0 {
                for _ in 0..cursor.size()? {
                    cursor.int()?;
                }
            }
        }
    }
    cursor.finish();
    Ok(())
}

pub(crate) fn read_nodes(lines: &mut Lines<'_>, state: &mut State, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut cursor = Cursor::new(lines, state);
    let blocks = cursor.size()?;
    for _ in 0..3 {
        cursor.size()?;
    }
    let mut tags = Vec::new();
    for block in 0..blocks {
        checkpoint(work, block as usize)?;
        let (dimension, _entity, parametric, count) = (cursor.int()?, cursor.int()?, cursor.int()?, cursor.size()?);
        if count > cursor.remaining() as u64 {
            return Err(cursor.malformed("more nodes are announced than the file can hold"));
        }
        tags.clear();
        for node in 0..count {
            checkpoint(work, node as usize)?;
            tags.push(cursor.size()?);
        }
        let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
        for &tag in &tags {
            let point = [cursor.real()?, cursor.real()?, cursor.real()?];
            for _ in 0..parameters {
                cursor.real()?;
            }
            cursor.end_line();
            state.nodes.push(tag, point, raw)?;
        }
    }
    cursor.finish();
    state.nodes.finish();
    Ok(())
}

pub(crate) fn read_elements(lines: &mut Lines<'_>, state: &mut State, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut cursor = Cursor::new(lines, state);
    let blocks = cursor.size()?;
    for _ in 0..3 {
        cursor.size()?;
    }
    for block in 0..blocks {
        checkpoint(work, block as usize)?;
        let (_dimension, entity, kind, count) = (cursor.int()?, cursor.int()?, cursor.int()?, cursor.size()?);
        let face = match element_type(kind) {
            Some(face) => face,
            // In ascii each element has its line, so its size need not be known.
            None if matches!(cursor, Cursor::Text(..)) => (Shape::Other, 0),
            None => return Err(EngineError::new(Reason::FormatUnsupported, format!("elements of type {kind} have an unknown size"))),
        };
        if count > cursor.remaining() as u64 {
            return Err(cursor.malformed("more elements are announced than the file can hold"));
        }
        let physical = state.physical_of_surface.get(&entity).copied().unwrap_or(0);
        let region = if face.0 == Shape::Other { 0 } else { region_of(state, physical, entity, raw) };
        for element in 0..count {
            checkpoint(work, element as usize)?;
            cursor.size()?;
            let mut corners = [0; 4];
            for node in 0..face.1 {
                let tag = cursor.size()?;
                if let Some(slot) = corners.get_mut(node) {
                    *slot = tag;
                }
            }
            cursor.end_line();
            if face.0 == Shape::Other {
                state.tally.others += 1;
            } else {
                add_face(face, corners, region, &state.nodes, &mut state.tally, raw)?;
            }
        }
    }
    cursor.finish();
    Ok(())
}
