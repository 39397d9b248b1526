//! Planar layouts for stacked bodies: uneven strips, an annulus, and squares with a round hole.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::stack::Layout;

/// Places from 0 to 1 that cut an interval into `steps` uneven strips, about one in eleven a twentieth of its neighbours.
pub(super) fn strips(steps: usize, seed: u64) -> Vec<f64> {
    let width = |k: usize| {
        let draw = super::noise(seed << 20 | k as u64);
        if steps >= 6 && draw < 0.09 { 0.05 } else { 0.6 + 0.8 * draw }
    };
    let total: f64 = (0..steps).map(width).sum();
    let mut places = vec![0.0];
    let mut sum = 0.0;
    for k in 0..steps - 1 {
        sum += width(k);
        places.push(sum / total);
    }
    places.push(1.0);
    places
}

/// `length / size` rounded, at least `least`.
pub(super) fn steps(length: f64, size: f64, least: usize) -> usize {
    (length / size).round().max(least as f64) as usize
}

/// An annulus from radial and angular lines, `column(i, j)` for radial interval `i` and sector `j`; `turn(r)` turns it.
pub(super) fn annulus(radii: &[f64], angles: &[f64], column: impl Fn(usize, usize) -> u32, turn: impl Fn(f64) -> f64) -> Layout {
    let around = angles.len();
    let mut layout = Layout::default();
    for &r in radii {
        layout.nodes.extend(angles.iter().map(|a| [r * (a + turn(r)).cos(), r * (a + turn(r)).sin()]));
    }
    for i in 0..radii.len() - 1 {
        for j in 0..around {
            let (here, next) = (i * around, (i + 1) * around);
            let k = (j + 1) % around;
            layout.quads.push([here + j, next + j, next + k, here + k].map(|n| n as u32));
            layout.column.push(column(i, j));
        }
    }
    layout
}

/// A square whose sides lie on a shared integer lattice, with a round hole and rings between hole and sides.
pub(super) struct Block<'a> {
    /// Centre in lattice units.
    pub(super) centre: [i64; 2],
    /// Half the side in lattice units.
    pub(super) half: i64,
    /// Radii of circles, outward, and the columns outside each.
    pub(super) circles: &'a [(f64, u32)],
}

/// Collects blocks that share the nodes on their sides.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    pub(super) layout: Layout,
    /// Length of a lattice unit.
    pub(super) unit: f64,
    shared: BTreeMap<[i64; 2], u32>,
}

impl Blocks {
    pub(super) fn new(unit: f64) -> Self {
        Blocks { unit, ..Blocks::default() }
    }

    /// Adds a block, its rings cut into strips about `size` wide.
    pub(super) fn add(&mut self, block: &Block<'_>, size: f64) {
        let around = 8 * block.half;
        let centre = block.centre.map(|c| c as f64 * self.unit);
        let outer: Vec<[i64; 2]> = (0..around).map(|k| on_side(block, k)).collect();
        let mut inner: Vec<u32> = Vec::new();
        for (ring, &(radius, column)) in block.circles.iter().enumerate() {
            let circle = |k: i64, r: f64| {
                let angle = TAU * (k as f64 / around as f64 - 0.125);
                [centre[0] + r * angle.cos(), centre[1] + r * angle.sin()]
            };
            if ring == 0 {
                inner = (0..around).map(|k| self.node(circle(k, radius))).collect();
            }
            let next = block.circles.get(ring + 1).map(|c| c.0);
            let width = next.unwrap_or(block.half as f64 * self.unit * 1.2) - radius;
            let places = strips(steps(width, size, if next.is_some() { 2 } else { 1 }), ring as u64);
            for (i, t) in places.iter().enumerate().skip(1) {
                let last = i + 1 == places.len();
                let outside: Vec<u32> = (0..around)
                    .map(|k| match next {
                        Some(far) => self.node(circle(k, radius + t * (far - radius))),
                        None if last => self.side_node(outer[k as usize]),
                        None => {
                            let (from, to) = (circle(k, radius), outer[k as usize].map(|c| c as f64 * self.unit));
                            self.node([from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])])
                        }
                    })
                    .collect();
                self.ring(&inner, &outside, column);
                inner = outside;
            }
        }
    }

    fn ring(&mut self, inner: &[u32], outer: &[u32], column: u32) {
        for k in 0..inner.len() {
            let l = (k + 1) % inner.len();
            self.layout.quads.push([inner[k], outer[k], outer[l], inner[l]]);
            self.layout.column.push(column);
        }
    }

    fn node(&mut self, at: [f64; 2]) -> u32 {
        self.layout.nodes.push(at);
        self.layout.nodes.len() as u32 - 1
    }

    fn side_node(&mut self, at: [i64; 2]) -> u32 {
        if let Some(&known) = self.shared.get(&at) {
            return known;
        }
        let new = self.node(at.map(|c| c as f64 * self.unit));
        self.shared.insert(at, new);
        new
    }
}

/// Lattice point `k` on the sides of a block, counter-clockwise from the lower right corner.
fn on_side(block: &Block<'_>, k: i64) -> [i64; 2] {
    let (side, half) = (2 * block.half, block.half);
    let along = k % side - half;
    let offset = match k / side {
        0 => [half, along],
        1 => [-along, half],
        2 => [-half, -along],
        _ => [along, -half],
    };
    [block.centre[0] + offset[0], block.centre[1] + offset[1]]
}
