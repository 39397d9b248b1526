//! Gmsh MSH 2.x and 4.1, ascii and binary: sections, physical groups, nodes. The elements are in `msh22` and `msh41`.

mod elements;
mod v22;
mod v41;

use super::binary::{ByteOrder, ByteReader};
use super::raw::RawSurface;
use super::text::{Lines, Words, name_of};
use crate::error::{EngineError, Reason, Result};
use crate::vector::Vec3;
use crate::work::Work;
use std::collections::{BTreeMap, HashMap};

/// What is known while reading.
struct State {
    /// Byte order of a binary file, `None` for ascii.
    order: Option<ByteOrder>,
    /// Bytes of a `size_t` in a binary file.
    size_t: usize,
    version4: bool,
    /// Names of the physical groups of surfaces, in the order of the file.
    physical_names: Vec<(i64, String)>,
    name_of_physical: HashMap<i64, String>,
    /// First physical group of each surface entity (4.1).
    physical_of_surface: BTreeMap<i64, i64>,
    nodes: Nodes,
    tally: elements::Tally,
    several_groups: u64,
}

/// Nodes by their tags.
#[derive(Default)]
struct Nodes {
    tags: Vec<u64>,
    /// Sorted tags with indices, made when the tags do not simply count up.
    sorted: Vec<(u64, u32)>,
    counts_up: bool,
}

impl Nodes {
    fn push(&mut self, tag: u64, position: Vec3, raw: &mut RawSurface) -> Result<()> {
        self.tags.push(tag);
        raw.push_vertex(position).map(|_| ())
    }

    fn finish(&mut self) {
        self.counts_up = self.tags.windows(2).all(|w| w[0].checked_add(1) == Some(w[1]));
        if !self.counts_up {
            self.sorted = self.tags.iter().enumerate().map(|(index, &tag)| (tag, index as u32)).collect();
            self.sorted.sort_unstable();
        }
    }

    #[inline]
    fn index(&self, tag: u64) -> Option<u32> {
        if self.counts_up {
            let offset = tag.checked_sub(*self.tags.first()?)?;
            return (offset < self.tags.len() as u64).then_some(offset as u32);
        }
        let at = self.sorted.partition_point(|&(t, _)| t < tag);
        self.sorted.get(at).filter(|&&(t, _)| t == tag).map(|&(_, index)| index)
    }
}

pub(crate) fn read(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let mut lines = Lines::new(bytes);
    let mut state = State {
        order: None,
        size_t: 8,
        version4: false,
        physical_names: Vec::new(),
        name_of_physical: HashMap::new(),
        physical_of_surface: BTreeMap::new(),
        nodes: Nodes::default(),
        tally: elements::Tally::default(),
        several_groups: 0,
    };
    let mut skipped = Vec::new();
    let mut has_elements = false;
    while let Some(line) = lines.next_content(None) {
        work.check()?;
        let Some(name) = line.strip_prefix(b"$") else {
            return Err(lines.malformed("a section should begin here, with a $"));
        };
        let name = name.trim_ascii();
        if raw.format.is_empty() && name != b"MeshFormat" && name != b"Comments" {
            let shown = name_of(name);
            return Err(EngineError::new(
                Reason::FormatUnsupported,
                format!("the file begins with ${shown}, not with $MeshFormat (MSH 1?)"),
            )
            .with_hint("convert it with: gmsh -save -format msh41"));
        }
        match name {
            b"MeshFormat" => read_format(&mut lines, &mut state, raw)?,
            b"PhysicalNames" => read_names(&mut lines, &mut state)?,
            b"Entities" => v41::read_entities(&mut lines, &mut state)?,
            b"Nodes" if state.version4 => v41::read_nodes(&mut lines, &mut state, raw, work)?,
            b"Nodes" => v22::read_nodes(&mut lines, &mut state, raw, work)?,
            b"Elements" => {
                has_elements = true;
                declare_regions(&state, raw);
                if state.version4 {
                    v41::read_elements(&mut lines, &mut state, raw, work)?;
                } else {
                    v22::read_elements(&mut lines, &mut state, raw, work)?;
                }
            }
            other => {
                if other != b"Comments" && !skipped.contains(&other) {
                    skipped.push(other);
                }
            }
        }
        skip_to_end(&mut lines, name)?;
    }
    if !has_elements {
        return Err(EngineError::new(Reason::FormatMalformed, "the file has no $Elements"));
    }
    tell(&state, &skipped, raw);
    Ok(())
}

fn tell(state: &State, skipped: &[&[u8]], raw: &mut RawSurface) {
    raw.warnings.extend(state.tally.warnings());
    if state.several_groups > 0 {
        raw.warnings.push(format!("{} surfaces are in several physical groups; only the first was used", state.several_groups));
    }
    if !skipped.is_empty() {
        let names: Vec<String> = skipped.iter().take(10).map(|n| name_of(&n[..n.len().min(40)])).collect();
        raw.warnings.push(format!("sections that were not read: {}", names.join(", ")));
    }
}

fn read_format(lines: &mut Lines<'_>, state: &mut State, raw: &mut RawSurface) -> Result<()> {
    let line = lines.next_content(None).ok_or_else(|| lines.ends_early("the version"))?;
    let mut words = Words::new(line);
    let (version, kind, size) = (words.next().unwrap_or_default(), words.parse::<i32>(), words.parse::<usize>());
    state.version4 = version == b"4.1";
    let is_version2 = version == b"2" || version.starts_with(b"2.");
    if !state.version4 && !is_version2 {
        return Err(EngineError::new(Reason::FormatUnsupported, format!("MSH {} is not read, only 2.x and 4.1", name_of(version)))
            .with_hint("convert it with: gmsh -save -format msh41"));
    }
    state.size_t = size.filter(|s| [4, 8].contains(s)).ok_or_else(|| lines.malformed("the data size is neither 4 nor 8"))?;
    if kind == Some(1) {
        state.order = Some(match lines.rest().first_chunk::<4>() {
            Some([1, 0, 0, 0]) => ByteOrder::Little,
            Some([0, 0, 0, 1]) => ByteOrder::Big,
            _ => return Err(lines.malformed("the number one that tells the byte order should follow")),
        });
        lines.skip_bytes(4);
    }
    let encoding = if state.order.is_some() { "binary" } else { "ascii" };
    raw.format = format!("MSH {} {encoding}", if state.version4 { "4.1" } else { "2.2" });
    Ok(())
}

fn read_names(lines: &mut Lines<'_>, state: &mut State) -> Result<()> {
    let count: u64 = one_number(lines, "the number of physical names")?;
    for _ in 0..count {
        let line = lines.next_content(None).ok_or_else(|| lines.ends_early("a physical name"))?;
        let mut words = Words::new(line);
        let (Some(dimension), Some(tag)) = (words.parse::<i64>(), words.parse::<i64>()) else {
            return Err(lines.malformed("a physical name should have a dimension and a number"));
        };
        let name = name_of(words.rest().strip_prefix(b"\"").map_or(words.rest(), |n| n.strip_suffix(b"\"").unwrap_or(n)));
        if dimension == 2 {
            state.name_of_physical.entry(tag).or_insert_with(|| name.clone());
            state.physical_names.push((tag, name));
        }
    }
    Ok(())
}

/// A line with one number.
fn one_number<T: std::str::FromStr>(lines: &mut Lines<'_>, what: &str) -> Result<T> {
    let line = lines.next_content(None).ok_or_else(|| lines.ends_early(what))?;
    Words::new(line).parse().ok_or_else(|| lines.malformed(format!("{what} should stand here")))
}

/// The regions with a name come first, in the order of the file.
fn declare_regions(state: &State, raw: &mut RawSurface) {
    for (tag, name) in &state.physical_names {
        raw.regions.numbered(*tag, name);
    }
}

/// The region of an element: its physical group, or else the entity it lies on.
fn region_of(state: &State, physical: i64, entity: i64, raw: &mut RawSurface) -> u32 {
    let physical = physical.saturating_abs();
    if physical == 0 {
        return raw.regions.numbered(entity, "");
    }
    let name = state.name_of_physical.get(&physical).map_or("", |name| name);
    raw.regions.numbered(physical, name)
}

/// The binary data of a section.
fn binary<'a>(lines: &Lines<'a>, order: ByteOrder) -> ByteReader<'a> {
    ByteReader::new(lines.rest(), lines.offset(), order)
}

/// Goes on behind the line that ends a section.
fn skip_to_end(lines: &mut Lines<'_>, name: &[u8]) -> Result<()> {
    let mark = [b"$End", name].concat();
    let rest = lines.rest();
    let mut from = 0;
    while let Some(at) = rest[from..].iter().position(|&b| b == b'$') {
        from += at;
        if rest[from..].starts_with(&mark) {
            lines.skip_bytes(from);
            lines.next();
            return Ok(());
        }
        from += 1;
    }
    Err(lines.ends_early(&name_of(&mark[..mark.len().min(60)])))
}
