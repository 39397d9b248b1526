//! Wavefront OBJ. `tobj` parses positions and faces; groups are our own scan, since `tobj` does not tell `g` from `o` and
//! forgets materials whose library is not there (we open no other file).
//!
//! `tobj` is fed the `v` and `f` statements only, with texture and normal indices cut off: it numbers vertices by first
//! use, so the first face it gets is one polygon over all vertices, which keeps them in the order of the file.

use super::raw::{RawSurface, checkpoint};
use super::text::{Lines, Words, malformed_at_line, name_of};
use crate::error::{EngineError, Reason, Result};
use crate::import::ObjRegions;
use crate::work::Work;
use std::collections::HashMap;
use std::io::{BufRead, Read};

/// Statements of the file: lines, with those that end with a backslash joined to the next.
struct Statements<'a> {
    lines: Lines<'a>,
    joined: Vec<u8>,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Statements { lines: Lines::new(bytes), joined: Vec::new() }
    }

    fn next(&mut self) -> Option<&[u8]> {
        let line = self.lines.next()?;
        if line.last() != Some(&b'\\') {
            return Some(line);
        }
        self.joined.clear();
        let mut part = line;
        while let Some(head) = part.strip_suffix(b"\\") {
            self.joined.extend_from_slice(head);
            self.joined.push(b' ');
            part = self.lines.next().unwrap_or_default();
        }
        self.joined.extend_from_slice(part);
        Some(&self.joined)
    }
}

/// One of the three ways to group faces.
#[derive(Default)]
struct Grouping {
    names: Vec<String>,
    known: HashMap<String, u32>,
    current: u32,
    of_face: Vec<u32>,
}

impl Grouping {
    fn new() -> Self {
        Grouping { names: vec![String::new()], known: HashMap::from([(String::new(), 0)]), ..Default::default() }
    }

    fn enter(&mut self, name: &[u8]) {
        let name = name_of(name);
        self.current = match self.known.get(&name) {
            Some(&label) => label,
            None => {
                let label = self.names.len() as u32;
                self.known.insert(name.clone(), label);
                self.names.push(name);
                label
            }
        };
    }

    /// How many groups have faces.
    fn distinct(&self) -> usize {
        let mut used = vec![false; self.names.len()];
        self.of_face.iter().for_each(|&label| used[label as usize] = true);
        used.iter().filter(|&&u| u).count()
    }

    fn names_a_face(&self) -> bool {
        self.of_face.iter().any(|&label| label != 0)
    }
}

struct Scan {
    vertices: usize,
    material: Grouping,
    group: Grouping,
    object: Grouping,
    skipped: u64,
}

/// First pass: counts vertices and notes the groups of each face with at least three corners.
fn scan(bytes: &[u8], work: &Work<'_>) -> Result<Scan> {
    let mut found = Scan { vertices: 0, material: Grouping::new(), group: Grouping::new(), object: Grouping::new(), skipped: 0 };
    let mut statements = Statements::new(bytes);
    let mut count = 0usize;
    while let Some(statement) = statements.next() {
        count += 1;
        checkpoint(work, count)?;
        let mut words = Words::new(statement);
        match words.next() {
            Some(b"v") => found.vertices += 1,
            Some(b"f") if words.clone().nth(2).is_some() => {
                for grouping in [&mut found.material, &mut found.group, &mut found.object] {
                    grouping.of_face.push(grouping.current);
                }
            }
            Some(b"f" | b"l" | b"p" | b"curv" | b"curv2" | b"surf") => found.skipped += 1,
            Some(b"usemtl") => found.material.enter(words.rest()),
            Some(b"g") => found.group.enter(words.rest()),
            Some(b"o") => found.object.enter(words.rest()),
            _ => {}
        }
    }
    Ok(found)
}

/// What `tobj` reads: one polygon over all vertices, then the cut-down statements.
struct Feed<'a> {
    statements: Statements<'a>,
    buffer: Vec<u8>,
    at: usize,
}

impl<'a> Feed<'a> {
    fn new(bytes: &'a [u8], vertices: usize) -> Self {
        let mut buffer = b"f".to_vec();
        for vertex in 1..=vertices {
            buffer.push(b' ');
            buffer.extend_from_slice(vertex.to_string().as_bytes());
        }
        buffer.push(b'\n');
        Feed { statements: Statements::new(bytes), buffer, at: 0 }
    }

    fn refill(&mut self) {
        self.buffer.clear();
        self.at = 0;
        while let Some(statement) = self.statements.next() {
            let mut words = Words::new(statement);
            match words.next() {
                Some(b"v") => {
                    self.buffer.push(b'v');
                    words.take(3).for_each(|word| append(&mut self.buffer, word));
                }
                Some(b"f") if words.clone().nth(2).is_some() => {
                    self.buffer.push(b'f');
                    words.for_each(|corner| append(&mut self.buffer, corner.split(|&b| b == b'/').next().unwrap_or(corner)));
                }
                _ => continue,
            }
            self.buffer.push(b'\n');
            return;
        }
    }
}

fn append(buffer: &mut Vec<u8>, word: &[u8]) {
    buffer.push(b' ');
    buffer.extend_from_slice(word);
}

impl Read for Feed<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(into.len());
        into[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Feed<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.at >= self.buffer.len() {
            self.refill();
        }
        Ok(&self.buffer[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

pub(crate) fn read(bytes: &[u8], which: ObjRegions, raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    raw.format = "OBJ".to_owned();
    let found = scan(bytes, work)?;
    if found.group.of_face.len() as u64 > raw.max_faces {
        return Err(EngineError::new(Reason::LimitReached, format!("the file has more than {} faces", raw.max_faces)));
    }
    let faces = found.group.of_face.len();
    if found.vertices < 3 || faces == 0 {
        return Ok(());
    }
    let options = tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };
    let mut feed = Feed::new(bytes, found.vertices);
    let loaded = tobj::load_obj_buf(&mut feed, &options, |_| Ok(Default::default()));
    let line = feed.statements.lines.number();
    work.check()?;
    let (models, _) = loaded.map_err(|error| explain(bytes, line, error))?;
    let model = models.into_iter().next().ok_or_else(|| EngineError::invariant("tobj gave no model"))?;
    for point in model.mesh.positions.as_chunks::<3>().0 {
        raw.push_vertex(*point)?;
    }
    if raw.positions.len() != found.vertices {
        return Err(EngineError::invariant("tobj lost vertices"));
    }
    let label_region = regions(&found, which, raw);
    let labels = chosen(&found, which);
    let mut corners = model.mesh.indices.get(found.vertices..).unwrap_or_default();
    for face in 0..faces {
        checkpoint(work, face)?;
        let size = model.mesh.face_arities.get(face + 1).map_or(3, |&n| n as usize);
        let (polygon, rest) = corners.split_at_checked(size).ok_or_else(|| EngineError::invariant("tobj lost faces"))?;
        corners = rest;
        raw.push_polygon(polygon, label_region[labels.of_face[face] as usize])?;
    }
    if found.skipped > 0 {
        raw.warnings.push(format!("{} points, lines and curves were not read", found.skipped));
    }
    Ok(())
}

/// The grouping that makes the regions.
fn chosen(found: &Scan, which: ObjRegions) -> &Grouping {
    let all = [&found.material, &found.group, &found.object];
    match which {
        ObjRegions::Material => all[0],
        ObjRegions::Group => all[1],
        ObjRegions::Object => all[2],
        ObjRegions::Automatic => {
            let distinguishing = all.iter().find(|g| g.distinct() > 1);
            distinguishing.or_else(|| all.iter().find(|g| g.names_a_face())).unwrap_or(&all[1])
        }
    }
}

/// Makes a region for each group with faces; gives the region of each label.
fn regions(found: &Scan, which: ObjRegions, raw: &mut RawSurface) -> Vec<u32> {
    let grouping = chosen(found, which);
    let mut region = vec![0; grouping.names.len()];
    let mut seen = vec![false; grouping.names.len()];
    for &label in &grouping.of_face {
        if !std::mem::replace(&mut seen[label as usize], true) {
            let name = &grouping.names[label as usize];
            region[label as usize] = if name.is_empty() { raw.regions.numbered(0, "") } else { raw.regions.named(name) };
        }
    }
    for (other, word) in [(&found.material, "usemtl"), (&found.group, "g"), (&found.object, "o")] {
        let count = other.distinct();
        if !std::ptr::eq(other, grouping) && count > 1 && other.of_face != grouping.of_face {
            raw.warnings.push(format!("the {count} groups of the {word} statements were not used as regions"));
        }
    }
    region
}

/// Our error for one of `tobj`, which names neither line nor index.
fn explain(bytes: &[u8], line: usize, error: tobj::LoadError) -> EngineError {
    match error {
        tobj::LoadError::FaceVertexOutOfBounds => out_of_range(bytes),
        tobj::LoadError::PositionParseError => malformed_at_line(line, "a vertex has not three coordinates"),
        tobj::LoadError::FaceParseError => malformed_at_line(line, "a face has something else than vertex indices"),
        tobj::LoadError::ReadError => malformed_at_line(line, "the line is not text"),
        other => malformed_at_line(line, other),
    }
}

/// Finds the first face with an index that names no vertex.
fn out_of_range(bytes: &[u8]) -> EngineError {
    let total = Lines::new(bytes);
    let mut statements = Statements::new(bytes);
    let mut vertices = 0i64;
    let mut all = 0i64;
    let mut lines = total;
    while let Some(line) = lines.next() {
        all += i64::from(Words::new(line).next() == Some(b"v"));
    }
    while let Some(statement) = statements.next() {
        let mut words = Words::new(statement);
        match words.next() {
            Some(b"v") => vertices += 1,
            Some(b"f") => {
                for word in words {
                    let corner = word.split(|&b| b == b'/').next().unwrap_or(word);
                    let index = std::str::from_utf8(corner).ok().and_then(|w| w.parse::<i64>().ok()).unwrap_or(0);
                    let at = if index < 0 { vertices.saturating_add(index) } else { index - 1 };
                    if at < 0 || at >= all {
                        let line = statements.lines.number();
                        let message = format!("line {line}: a face names vertex {index}, but there are {all}");
                        return EngineError::new(Reason::IndexOutOfRange, message).with_metadata("line", line);
                    }
                }
            }
            _ => {}
        }
    }
    EngineError::new(Reason::IndexOutOfRange, format!("a face names a vertex that is not one of the {all}"))
}
