//! Nodes and elements of MSH 2.x.

use super::elements::{Shape, add_face, element_type};
use super::{State, binary, one_number, region_of};
use crate::error::{EngineError, Reason, Result};
use crate::import::binary::ByteReader;
use crate::import::raw::{RawSurface, checkpoint};
use crate::import::text::{Lines, Words};
use crate::work::Work;
use std::collections::HashMap;

pub(crate) fn read_nodes(lines: &mut Lines<'_>, state: &mut State, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let count: u64 = one_number(lines, "the number of nodes")?;
    if let Some(order) = state.order {
        let mut bytes = binary(lines, order);
        for node in 0..bytes.fits(count, 28, "nodes")? {
            checkpoint(work, node)?;
            let tag = u64::from(bytes.u32()?);
            state.nodes.push(tag, [bytes.f64()?, bytes.f64()?, bytes.f64()?], raw)?;
        }
        lines.skip_bytes(bytes.position());
    } else {
        for node in 0..count {
            checkpoint(work, node as usize)?;
            let line = lines.next_content(None).ok_or_else(|| lines.ends_early("a node"))?;
            let mut words = Words::new(line);
            let (Some(tag), Some(point)) = (words.parse(), words.point()) else {
                return Err(lines.malformed("a node should be a number and three coordinates"));
            };
            state.nodes.push(tag, point, raw)?;
        }
    }
    state.nodes.finish();
    Ok(())
}

pub(crate) fn read_elements(lines: &mut Lines<'_>, state: &mut State, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let count: u64 = one_number(lines, "the number of elements")?;
    if let Some(order) = state.order {
        let mut bytes = binary(lines, order);
        read_binary(&mut bytes, count, state, raw, work)?;
        lines.skip_bytes(bytes.position());
        return Ok(());
    }
    let mut region = RegionCache::default();
    for element in 0..count {
        checkpoint(work, element as usize)?;
        let line = lines.next_content(None).ok_or_else(|| lines.ends_early("an element"))?;
        let malformed = || lines.malformed("an element should have a number, a type, tags and nodes");
        let mut words = Words::new(line);
        words.next();
        let kind: i64 = words.parse().ok_or_else(malformed)?;
        let tags: usize = words.parse().ok_or_else(malformed)?;
        let Some(face @ (Shape::Triangle | Shape::Quad, _)) = element_type(kind) else {
            state.tally.others += 1;
            continue;
        };
        let mut first_tags = [0i64; 2];
        for tag in 0..tags.min(line.len()) {
            let value = words.parse().ok_or_else(malformed)?;
            if let Some(slot) = first_tags.get_mut(tag) {
                *slot = value;
            }
        }
        let mut corners = [0; 4];
        for corner in &mut corners[..if face.0 == Shape::Quad { 4 } else { 3 }] {
            *corner = words.parse().ok_or_else(malformed)?;
        }
        let region = region.get(first_tags, state, raw);
        add_face(face, corners, region, &state.nodes, &mut state.tally, raw)?;
    }
    Ok(())
}

/// The regions found so far, by physical and elementary tag; the last one at hand, since elements of a region stand together.
#[derive(Default)]
struct RegionCache {
    last: Option<([i64; 2], u32)>,
    all: HashMap<[i64; 2], u32>,
}

impl RegionCache {
    fn get(&mut self, tags: [i64; 2], state: &State, raw: &mut RawSurface) -> u32 {
        match self.last {
            Some((known, region)) if known == tags => region,
            _ => {
                let region = *self.all.entry(tags).or_insert_with(|| region_of(state, tags[0], tags[1], raw));
                self.last = Some((tags, region));
                region
            }
        }
    }
}

/// Blocks of elements of one type and number of tags.
fn read_binary(bytes: &mut ByteReader<'_>, count: u64, state: &mut State, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut region = RegionCache::default();
    let mut done = 0u64;
    while done < count {
        let (kind, follow, tags) = (bytes.u32()?, bytes.u32()?, bytes.u32()?);
        let Some(face) = element_type(i64::from(kind)) else {
            return Err(EngineError::new(Reason::FormatUnsupported, format!("elements of type {kind} have an unknown size")));
        };
        let size = (1 + u64::from(tags) + face.1 as u64) * 4;
        let follow = bytes.fits(u64::from(follow), usize::try_from(size).unwrap_or(usize::MAX), "elements")?;
        if follow == 0 {
            return Err(bytes.malformed("a block of no elements"));
        }
        done += follow as u64;
        if face.0 == Shape::Other {
            state.tally.others += follow as u64;
            bytes.skip(follow * size as usize)?;
            continue;
        }
        for element in 0..follow {
            checkpoint(work, element)?;
            bytes.u32()?;
            let mut first_tags = [0i64; 2];
            for tag in 0..tags as usize {
                let value = i64::from(bytes.i32()?);
                if let Some(slot) = first_tags.get_mut(tag) {
                    *slot = value;
                }
            }
            let mut corners = [0; 4];
            for node in 0..face.1 {
                let tag = u64::from(bytes.u32()?);
                if let Some(slot) = corners.get_mut(node) {
                    *slot = tag;
                }
            }
            let region = region.get(first_tags, state, raw);
            add_face(face, corners, region, &state.nodes, &mut state.tally, raw)?;
        }
    }
    Ok(())
}
