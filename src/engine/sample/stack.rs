//! CAD-like bodies: prisms over a planar quad layout, stacked in layers; the boundary is triangulated with uneven diagonals.

use crate::error::Result;
use crate::mesh::{Region, SurfaceMesh};
use crate::vector::{Vec3, add, scale};
use crate::work::Work;

/// A planar layout of counter-clockwise quads, each in a column.
#[derive(Debug, Clone, Default)]
pub(super) struct Layout {
    pub(super) nodes: Vec<[f64; 2]>,
    pub(super) quads: Vec<[u32; 4]>,
    pub(super) column: Vec<u32>,
}

/// One layer of prisms, cut into strips.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    /// Places of the cuts, from 0 to 1.
    pub(super) strips: Vec<f64>,
}

/// Which way a boundary quad faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Up,
    Down,
    Wall,
}

/// A boundary quad, for its region: the solid prism behind it and its middle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    pub(super) side: Side,
    pub(super) column: u32,
    pub(super) layer: usize,
    pub(super) centre: Vec3,
}

/// What a stack is made of. Solid prisms must not touch along a mere edge.
pub(super) struct Stack<'a> {
    pub(super) layout: &'a Layout,
    pub(super) layers: &'a [Layer],
    /// Whether the prism over a column is solid in a layer.
    pub(super) solid: &'a dyn Fn(u32, usize) -> bool,
    /// Height of the bottom of a layer (or, for one past the last, the top of all) over a point of the plane.
    pub(super) floor: &'a dyn Fn([f64; 2], usize) -> f64,
    pub(super) region: &'a dyn Fn(&Face) -> u32,
    pub(super) region_names: &'a [&'a str],
}

struct Builder<'a> {
    stack: &'a Stack<'a>,
    /// First level of each layer, and the number of levels.
    first_level: Vec<usize>,
    levels: usize,
    quads: Vec<([u64; 4], u32)>,
}

/// Triangulates the boundary of a stack, outward.
///
/// # Errors
/// Only those of `work`.
pub(super) fn boundary(stack: &Stack<'_>, work: &Work<'_>) -> Result<SurfaceMesh> {
    let mut first_level = vec![0];
    for layer in stack.layers {
        first_level.push(first_level[first_level.len() - 1] + layer.strips.len() - 1);
    }
    let levels = first_level[stack.layers.len()] + 1;
    let mut builder = Builder { stack, first_level, levels, quads: Vec::new() };
    builder.floors(work)?;
    builder.walls(work)?;
    work.check()?;
    Ok(builder.finish())
}

impl Builder<'_> {
    fn solid(&self, quad: Option<u32>, layer: usize) -> bool {
        quad.is_some_and(|q| (self.stack.solid)(self.stack.layout.column[q as usize], layer))
    }

    fn place(&self, corner: u64) -> Vec3 {
        let (node, level) = ((corner / self.levels as u64) as usize, (corner % self.levels as u64) as usize);
        let layer = self.first_level.partition_point(|&l| l <= level).min(self.stack.layers.len()) - 1;
        let at = self.stack.layout.nodes[node];
        let t = self.stack.layers[layer].strips[level - self.first_level[layer]];
        let (low, high) = ((self.stack.floor)(at, layer), (self.stack.floor)(at, layer + 1));
        [at[0], at[1], low + t * (high - low)]
    }

    fn push(&mut self, nodes: [(u32, usize); 4], side: Side, quad: u32, layer: usize) {
        let corners = nodes.map(|(node, level)| u64::from(node) * self.levels as u64 + level as u64);
        let centre = scale(corners.iter().fold([0.0; 3], |sum, &c| add(sum, self.place(c))), 0.25);
        let face = Face { side, column: self.stack.layout.column[quad as usize], layer, centre };
        self.quads.push((corners, (self.stack.region)(&face)));
    }

    fn floors(&mut self, work: &Work<'_>) -> Result<()> {
        let layers = self.stack.layers.len();
        for (q, &[a, b, c, d]) in self.stack.layout.quads.iter().enumerate() {
            if q.is_multiple_of(1024) {
                work.check()?;
            }
            for edge in 0..=layers {
                let below = edge > 0 && self.solid(Some(q as u32), edge - 1);
                let above = edge < layers && self.solid(Some(q as u32), edge);
                let level = self.first_level[edge];
                match (below, above) {
                    (true, false) => self.push([a, b, c, d].map(|n| (n, level)), Side::Up, q as u32, edge - 1),
                    (false, true) => self.push([d, c, b, a].map(|n| (n, level)), Side::Down, q as u32, edge),
                    _ => {}
                }
            }
        }
        Ok(())
    }

    fn walls(&mut self, work: &Work<'_>) -> Result<()> {
        // One record per side of a quad, sorted so that the two sides of an edge meet.
        let mut sides: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(4 * self.stack.layout.quads.len());
        for (q, quad) in self.stack.layout.quads.iter().enumerate() {
            for k in 0..4 {
                let (a, b) = (quad[k], quad[(k + 1) % 4]);
                sides.push((a.min(b), a.max(b), q as u32, a < b));
            }
        }
        sides.sort_unstable();
        let mut i = 0;
        while i < sides.len() {
            if i % 1024 < 2 {
                work.check()?;
            }
            let (low, high, quad, forward) = sides[i];
            let across = sides.get(i + 1).filter(|s| (s.0, s.1) == (low, high)).map(|s| s.2);
            let (a, b) = if forward { (low, high) } else { (high, low) };
            self.wall(a, b, quad, across);
            i += 1 + usize::from(across.is_some());
        }
        Ok(())
    }

    /// Walls over the edge `a b`, counter-clockwise in `left`.
    fn wall(&mut self, a: u32, b: u32, left: u32, right: Option<u32>) {
        for layer in 0..self.stack.layers.len() {
            let (near, far) = (self.solid(Some(left), layer), self.solid(right, layer));
            let (from, to, quad) = match (near, far, right) {
                (true, false, _) => (a, b, left),
                (false, true, Some(right)) => (b, a, right),
                _ => continue,
            };
            for level in self.first_level[layer]..self.first_level[layer + 1] {
                self.push([(from, level), (to, level), (to, level + 1), (from, level + 1)], Side::Wall, quad, layer);
            }
        }
    }

    fn finish(self) -> SurfaceMesh {
        let mut corners: Vec<u64> = self.quads.iter().flat_map(|(quad, _)| *quad).collect();
        corners.sort_unstable();
        corners.dedup();
        let number = |corner: u64| corners.partition_point(|&c| c < corner) as u32;
        let positions = corners.iter().map(|&c| self.place(c)).collect();
        let mut mesh = SurfaceMesh { positions, ..SurfaceMesh::default() };
        for (i, (quad, region)) in self.quads.iter().enumerate() {
            let [a, b, c, d] = quad.map(number);
            let pair = if super::noise(i as u64) < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            mesh.triangles.extend(pair);
            mesh.face_region.extend([*region; 2]);
        }
        mesh.regions =
            self.stack.region_names.iter().enumerate().map(|(i, n)| Region { id: i as i64 + 1, name: (*n).to_owned() }).collect();
        mesh
    }
}
