//! OFF (ascii): OFF, COFF, NOFF and their combinations; face colours become regions.

use super::raw::{RawSurface, checkpoint};
use super::text::{Lines, Words, name_of};
use crate::error::{EngineError, Reason, Result};
use crate::work::Work;

/// More distinct colours than this are decoration, not regions.
const MOST_COLOURS: usize = 4096;

/// Whether the word is the keyword of an OFF file that we read or refuse by name.
pub(crate) fn is_keyword(word: &[u8]) -> bool {
    word.ends_with(b"OFF") && word.len() <= 7 && word[..word.len() - 3].iter().all(|b| b"STCN4n".contains(b))
}

pub(crate) fn read(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    raw.format = "OFF ascii".to_owned();
    let mut lines = Lines::new(bytes);
    let mut counts = Vec::new();
    let mut first = true;
    while counts.len() < 2 {
        let line = lines.next_content(Some(b'#')).ok_or_else(|| lines.ends_early("the counts"))?;
        for word in Words::new(before_comment(line)) {
            if std::mem::take(&mut first) && is_keyword(word) {
                check_keyword(word)?;
            } else if word == b"BINARY" {
                return Err(
                    EngineError::new(Reason::FormatUnsupported, "binary OFF is not read").with_hint("convert it to ascii OFF or PLY")
                );
            } else {
                let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<u64>().ok());
                counts.push(number.ok_or_else(|| lines.malformed("the counts of vertices and faces are not numbers"))?);
            }
        }
    }
    read_vertices(&mut lines, counts[0], raw, work)?;
    read_faces(&mut lines, counts[1], raw, work)
}

fn check_keyword(word: &[u8]) -> Result<()> {
    if word.contains(&b'4') || word.contains(&b'n') {
        let message = format!("{} files have points of another dimension than three", name_of(word));
        return Err(EngineError::new(Reason::FormatUnsupported, message));
    }
    Ok(())
}

fn before_comment(line: &[u8]) -> &[u8] {
    line.split(|&b| b == b'#').next().unwrap_or(line)
}

fn read_vertices(lines: &mut Lines<'_>, count: u64, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    for vertex in 0..count {
        checkpoint(work, vertex as usize)?;
        let line = lines.next_content(Some(b'#')).ok_or_else(|| lines.ends_early(&format!("vertex {vertex} of {count}")))?;
        let point = Words::new(line).point().ok_or_else(|| lines.malformed(format!("vertex {vertex} has not three coordinates")))?;
        raw.push_vertex(point)?;
    }
    Ok(())
}

fn read_faces(lines: &mut Lines<'_>, count: u64, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut corners: Vec<u32> = Vec::new();
    let mut colours: Vec<String> = Vec::new();
    let mut colour_of: std::collections::HashMap<Vec<u8>, u32> = std::collections::HashMap::new();
    let mut too_small = 0u64;
    for face in 0..count {
        checkpoint(work, face as usize)?;
        let line = lines.next_content(Some(b'#')).ok_or_else(|| lines.ends_early(&format!("face {face} of {count}")))?;
        let mut words = Words::new(before_comment(line));
        let size: usize = words.parse().ok_or_else(|| lines.malformed(format!("face {face} does not begin with its number of corners")))?;
        corners.clear();
        for _ in 0..size.min(line.len()) {
            corners.push(words.parse().ok_or_else(|| lines.malformed(format!("face {face} has not {size} vertex indices")))?);
        }
        too_small += u64::from(size < 3);
        let colour = words.rest();
        let index = match colour_of.get(colour) {
            Some(&index) => index,
            None if colours.len() > MOST_COLOURS => 0,
            None => {
                colour_of.insert(colour.to_vec(), colours.len() as u32);
                colours.push(name_of(colour));
                colours.len() as u32 - 1
            }
        };
        raw.push_polygon(&corners, index)?;
    }
    if too_small > 0 {
        raw.warnings.push(format!("{too_small} faces with fewer than three corners (points, lines) were not read"));
    }
    colours_to_regions(&colours, raw);
    Ok(())
}

/// One region for each colour if there are several; faces hold the index of their colour until here.
fn colours_to_regions(colours: &[String], raw: &mut RawSurface) {
    if colours.len() < 2 || colours.len() > MOST_COLOURS {
        if colours.len() > 1 {
            raw.warnings.push(format!("the faces have more than {MOST_COLOURS} colours; they were not taken for regions"));
        }
        raw.face_region.fill(0);
        raw.regions.numbered(0, "");
        return;
    }
    for (index, colour) in colours.iter().enumerate() {
        let name = if colour.is_empty() { "no colour".to_owned() } else { format!("colour {colour}") };
        raw.regions.numbered(index as i64 + 1, &name);
    }
    raw.warnings.push(format!("OFF has no regions; the {} face colours were taken for regions", colours.len()));
}
