//! Which format a file has, by its content.

use super::text::{Lines, Words};
use super::{off, stl};
use crate::error::{EngineError, Reason, Result};
use crate::import::Format;

/// Lines looked at to recognise an OBJ file, which has no header.
const OBJ_LINES: usize = 2000;

/// The format of some bytes.
///
/// # Errors
/// [`Reason::FormatMalformed`] for an empty file, [`Reason::FormatUnsupported`] if no format is recognised.
pub(crate) fn detect(bytes: &[u8]) -> Result<Format> {
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    if start.is_empty() {
        return Err(EngineError::new(Reason::FormatMalformed, "the file is empty"));
    }
    if stl::has_binary_length(bytes) {
        return Ok(Format::Stl);
    }
    let word = Words::new(&start[..start.len().min(64)]).next().unwrap_or_default();
    if word.starts_with(b"#") && first_word_after_comments(start).is_some_and(off::is_keyword) {
        return Ok(Format::Off);
    }
    match word {
        b"ply" => return Ok(Format::Ply),
        _ if word.starts_with(b"$") => return Ok(Format::Msh),
        _ if word.starts_with(b"glTF") || word.starts_with(b"{") => return Ok(Format::Gltf),
        _ if off::is_keyword(word) => return Ok(Format::Off),
        _ if word.starts_with(b"<") => {
            let message = "the file is XML (perhaps VTU), which is written but not read";
            return Err(EngineError::new(Reason::FormatUnsupported, message).with_hint("convert it to PLY, OBJ, STL or MSH"));
        }
        _ => {}
    }
    if stl::looks_ascii(bytes) {
        return Ok(Format::Stl);
    }
    if looks_like_obj(start) {
        return Ok(Format::Obj);
    }
    // What is left with a binary header is a binary STL that was cut off or that something follows.
    if bytes.len() >= 84 && bytes[..bytes.len().min(512)].contains(&0) {
        return Ok(Format::Stl);
    }
    Err(EngineError::new(Reason::FormatUnsupported, "the content is none of STL, OBJ, PLY, OFF, MSH and glTF")
        .with_hint("say the format if it is one of these"))
}

fn first_word_after_comments(bytes: &[u8]) -> Option<&[u8]> {
    Words::new(Lines::new(bytes).next_content(Some(b'#'))?).next()
}

fn looks_like_obj(bytes: &[u8]) -> bool {
    let mut lines = Lines::new(bytes);
    for _ in 0..OBJ_LINES {
        let Some(line) = lines.next_content(Some(b'#')) else { return false };
        let mut words = Words::new(line);
        match words.next() {
            Some(b"v") => return words.point().is_some(),
            Some(b"f" | b"vn" | b"vt" | b"g" | b"o" | b"s" | b"usemtl" | b"mtllib" | b"p" | b"l" | b"cstype" | b"vp") => {}
            _ => return false,
        }
    }
    true
}
