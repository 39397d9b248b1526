//! Element types of Gmsh and what becomes of them: triangles and quads of any order by their corners, others are counted.

use super::Nodes;
use crate::error::{EngineError, Reason, Result};
use crate::import::raw::RawSurface;

/// What an element is, as far as a surface is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Triangle,
    Quad,
    Other,
}

/// Shape and number of nodes of an element type; `None` for types we do not know the size of.
pub(crate) fn element_type(kind: i64) -> Option<(Shape, usize)> {
    let nodes = match kind {
        2 => return Some((Shape::Triangle, 3)),
        9 => return Some((Shape::Triangle, 6)),
        20 => return Some((Shape::Triangle, 9)),
        21 => return Some((Shape::Triangle, 10)),
        22 => return Some((Shape::Triangle, 12)),
        23 => return Some((Shape::Triangle, 15)),
        24 => return Some((Shape::Triangle, 15)),
        25 => return Some((Shape::Triangle, 21)),
        3 => return Some((Shape::Quad, 4)),
        10 => return Some((Shape::Quad, 9)),
        16 => return Some((Shape::Quad, 8)),
        36 => return Some((Shape::Quad, 16)),
        37 => return Some((Shape::Quad, 25)),
        38 => return Some((Shape::Quad, 36)),
        39 => return Some((Shape::Quad, 12)),
        40 => return Some((Shape::Quad, 16)),
        41 => return Some((Shape::Quad, 20)),
        15 => 1,
        1 => 2,
        8 => 3,
        4 | 26 => 4,
        7 | 27 => 5,
        6 | 28 => 6,
        5 => 8,
        11 => 10,
        19 => 13,
        14 => 14,
        18 => 15,
        13 => 18,
        17 | 29 => 20,
        12 => 27,
        30 => 35,
        31 => 56,
        92 => 64,
        93 => 125,
        _ => return None,
    };
    Some((Shape::Other, nodes))
}

/// Counts of what could not be taken as it is.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    pub(crate) others: u64,
    pub(crate) curved: u64,
    pub(crate) quads: u64,
}

impl Tally {
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        if self.others > 0 {
            all.push(format!("{} elements that are neither triangles nor quads (points, lines, solids) were not read", self.others));
        }
        if self.curved > 0 {
            all.push(format!("{} elements of higher order were replaced by their corners", self.curved));
        }
        if self.quads > 0 {
            all.push(format!("{} quads were cut into triangles", self.quads));
        }
        all
    }
}

/// Adds a triangle or quad, of which `corners` gives the node tags in order (the corners come first).
pub(crate) fn add_face(
    (shape, count): (Shape, usize),
    corner_tags: [u64; 4],
    region: u32,
    nodes: &Nodes,
    tally: &mut Tally,
    raw: &mut RawSurface,
) -> Result<()> {
    let size = if shape == Shape::Quad { 4 } else { 3 };
    let mut corners = [0; 4];
    for k in 0..size {
        corners[k] = nodes.index(corner_tags[k]).ok_or_else(|| {
            let message = format!("face {} names node {}, which the file does not have", raw.triangles.len(), corner_tags[k]);
            EngineError::new(Reason::IndexOutOfRange, message)
        })?;
    }
    tally.curved += u64::from(count > size);
    tally.quads += u64::from(size == 4);
    raw.push_polygon(&corners[..size], region)
}
