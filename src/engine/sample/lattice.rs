//! Level sets on a tetrahedral lattice: marching tetrahedra over the blocks an octree descent finds near the surface.
//!
//! The lattice is the Freudenthal split of a sheared grid (its cells are then those of the body-centred cubic lattice). A level
//! set that passes through no lattice node is a manifold there by construction, each piece inside its own tetrahedron; cuts are
//! kept away from the ends of the lattice edges, so no face is degenerate.

use super::field::{Field, SLOPE};
use crate::error::Result;
use crate::vector::{Vec3, add, add_scaled, norm, scale};
use crate::work::Work;

/// Cells of a leaf block along each axis.
const BLOCK: i32 = 8;
const SIDE: usize = BLOCK as usize + 1;
/// Parts of a block along each axis; each has its own list of primitives.
const PARTS: usize = 3;
/// Closest a cut comes to an end of its lattice edge.
const MARGIN: f64 = 0.015;
const STEP: f64 = 0.25;
/// Share of the quantised value in the value that places a cut.
const QUANTISED: f64 = 0.35;

/// A sheared grid in space: node `(i, j, k)` lies at `i e0 + j e1 + k e2`.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    axes: [Vec3; 3],
    /// Spacing: the longest lattice edge.
    spacing: f64,
}

impl Lattice {
    /// Body-centred lattice of the given spacing, turned so that no axis is special, slices 25 % thicker than wide.
    pub(super) fn new(spacing: f64) -> Self {
        let body = [[-0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.5, 0.5, -0.5]];
        let rows = [[0.8660, -0.4330, 0.25], [0.5, 0.75, -0.4330], [0.0, 0.5 * 1.25, 0.8660 * 1.25]];
        let axes = body.map(|e| rows.map(|row| spacing * (row[0] * e[0] + row[1] * e[1] + row[2] * e[2])));
        Lattice { axes, spacing }
    }

    fn at(&self, node: [i32; 3]) -> Vec3 {
        (0..3).fold([0.0; 3], |sum, k| add_scaled(sum, self.axes[k], f64::from(node[k])))
    }

    fn right_handed(&self) -> bool {
        crate::vector::dot(self.axes[0], crate::vector::cross(self.axes[1], self.axes[2])) > 0.0
    }

    /// Index box of the nodes around a ball.
    fn index_box(&self, centre: Vec3, radius: f64) -> ([i32; 3], [i32; 3]) {
        let [a, b, c] = self.axes;
        let dual = [crate::vector::cross(b, c), crate::vector::cross(c, a), crate::vector::cross(a, b)];
        let volume = crate::vector::dot(a, dual[0]);
        let index = |k: usize, sign: f64| (crate::vector::dot(dual[k], centre) + sign * radius * norm(dual[k]).copysign(volume)) / volume;
        (std::array::from_fn(|k| index(k, -1.0).floor() as i32 - 1), std::array::from_fn(|k| index(k, 1.0).ceil() as i32 + 1))
    }

    /// Radius of the ball around the centre of a block of `size` cells.
    fn block_radius(&self, size: i32) -> f64 {
        let [a, b, c] = self.axes;
        let half = 0.5 * f64::from(size);
        let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        corners.map(|[s, t]| half * norm(add(a, add(scale(b, s), scale(c, t))))).into_iter().fold(0.0, f64::max)
    }
}

struct Sweep<'a> {
    field: &'a Field,
    lattice: &'a Lattice,
    /// Face corners: lattice edge and position along it.
    corners: Vec<(u64, f64)>,
    scratch: Vec<f64>,
    work: &'a Work<'a>,
}

/// The boundary of a body as vertices and outward triangles, in the order of the lattice.
///
/// # Errors
/// Only those of `work`.
pub(super) fn level_set(field: &Field, lattice: &Lattice, work: &Work<'_>) -> Result<(Vec<Vec3>, Vec<[u32; 3]>)> {
    let mut low = [i32::MAX; 3];
    let mut high = [i32::MIN; 3];
    for (centre, radius) in field.primitives.iter().flat_map(|p| p.balls()) {
        let (l, h) = lattice.index_box(centre, radius + field.blend + 2.0 * lattice.spacing);
        low = std::array::from_fn(|k| low[k].min(l[k]));
        high = std::array::from_fn(|k| high[k].max(h[k]));
    }
    let mut size = BLOCK;
    while (0..3).any(|k| high[k] - low[k] > size) {
        size *= 2;
    }
    let everything: Vec<u16> = (0..field.primitives.len() as u16).collect();
    let mut sweep = Sweep { field, lattice, corners: Vec::new(), scratch: Vec::new(), work };
    sweep.descend(low, size, &everything)?;
    Ok(number(&sweep.corners, lattice))
}

impl Sweep<'_> {
    fn descend(&mut self, low: [i32; 3], size: i32, among: &[u16]) -> Result<()> {
        self.work.check()?;
        let centre = self.lattice.at(low.map(|x| x + size / 2));
        let radius = SLOPE * self.lattice.block_radius(size);
        let distances: Vec<f64> = among.iter().map(|&i| self.field.primitives[i as usize].distance(centre)).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let close = nearest + self.field.blend + 2.0 * radius;
        let near: Vec<u16> = among.iter().zip(&distances).filter(|(_, d)| **d <= close).map(|(&i, _)| i).collect();
        let most_pull = 0.25 * self.field.blend * near.len() as f64;
        let rough = 0.5 * self.lattice.spacing;
        if nearest - radius > most_pull + rough || nearest + radius < -rough {
            return Ok(());
        }
        if size == BLOCK {
            self.block(low, &near);
            return Ok(());
        }
        let half = size / 2;
        for child in 0..8 {
            let corner = std::array::from_fn(|k| low[k] + if child >> k & 1 == 1 { half } else { 0 });
            self.descend(corner, half, &near)?;
        }
        Ok(())
    }

    /// The primitives that matter within a radius (times [`SLOPE`]) of a point.
    fn near(&self, centre: Vec3, radius: f64, among: &[u16]) -> Vec<u16> {
        let distances: Vec<f64> = among.iter().map(|&i| self.field.primitives[i as usize].distance(centre)).collect();
        let close = distances.iter().copied().fold(f64::INFINITY, f64::min) + self.field.blend + 2.0 * radius;
        among.iter().zip(&distances).filter(|(_, d)| **d <= close).map(|(&i, _)| i).collect()
    }

    fn block(&mut self, low: [i32; 3], among: &[u16]) {
        let mut values = [0.0; SIDE * SIDE * SIDE];
        for part in 0..PARTS * PARTS * PARTS {
            let first = [part % PARTS, part / PARTS % PARTS, part / PARTS / PARTS].map(|x| x * (SIDE / PARTS));
            let near = self.near(
                self.lattice.at(std::array::from_fn(|k| low[k] + first[k] as i32 + 1)),
                SLOPE * self.lattice.block_radius(2),
                among,
            );
            for k in 0..(SIDE / PARTS).pow(3) {
                let width = SIDE / PARTS;
                let at = [first[0] + k % width, first[1] + k / width % width, first[2] + k / width / width];
                let node = std::array::from_fn(|k| low[k] + at[k] as i32);
                let raw = self.field.value(self.lattice.at(node), &near, &mut self.scratch) / self.lattice.spacing;
                values[at[0] + SIDE * (at[1] + SIDE * at[2])] = scanned(raw, node);
            }
        }
        for cell in 0..(BLOCK * BLOCK * BLOCK) {
            let at = [cell % BLOCK, cell / BLOCK % BLOCK, cell / BLOCK / BLOCK];
            let slot = at[0] as usize + SIDE * (at[1] as usize + SIDE * at[2] as usize);
            let eight: [f64; 8] =
                std::array::from_fn(|bits| values[slot + (bits & 1) + SIDE * (bits >> 1 & 1) + SIDE * SIDE * (bits >> 2 & 1)]);
            let negative = eight.iter().filter(|v| **v < 0.0).count();
            if negative != 0 && negative != 8 {
                self.cell(std::array::from_fn(|k| low[k] + at[k]), &eight);
            }
        }
    }

    /// The six tetrahedra of a cell; each climbs from corner 0 to corner 7 along the axes in another order.
    fn cell(&mut self, at: [i32; 3], eight: &[f64; 8]) {
        const CLIMBS: [([usize; 2], bool); 6] = [
            ([0b001, 0b011], true),
            ([0b010, 0b110], true),
            ([0b100, 0b101], true),
            ([0b001, 0b101], false),
            ([0b010, 0b011], false),
            ([0b100, 0b110], false),
        ];
        for ([first, second], even) in CLIMBS {
            let corners = if even == self.lattice.right_handed() { [0, first, second, 7] } else { [0, second, first, 7] };
            self.tetrahedron(at, eight, corners);
        }
    }

    /// Faces inside one positively oriented tetrahedron of cell corners.
    fn tetrahedron(&mut self, at: [i32; 3], eight: &[f64; 8], corners: [usize; 4]) {
        // Even permutations that bring one corner, or a pair, to the front.
        const ONE: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];
        const TWO: [[usize; 4]; 6] = [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];
        let inside = corners.map(|c| eight[c] < 0.0);
        let cut = |p: usize, q: usize| edge_cut(at, eight, corners[p], corners[q]);
        match inside.iter().filter(|x| **x).count() {
            1 | 3 => {
                let lone = inside.iter().filter(|x| **x).count() == 1;
                let Some([p, q, r, s]) = ONE.into_iter().find(|o| inside[o[0]] == lone) else { return };
                let (a, b, c) = (cut(p, q), cut(p, r), cut(p, s));
                self.corners.extend(if lone { [a, b, c] } else { [a, c, b] });
            }
            2 => {
                let Some([p, q, r, s]) = TWO.into_iter().find(|o| inside[o[0]] && inside[o[1]]) else { return };
                let (a, b, c, d) = (cut(p, r), cut(p, s), cut(q, s), cut(q, r));
                self.corners.extend([a, b, c, a, c, d]);
            }
            _ => {}
        }
    }
}

/// What a scanner makes of a value: a little noise, then partly rounded to steps. Never zero.
fn scanned(value: f64, node: [i32; 3]) -> f64 {
    let key = (node[0] as u32 as u64) | (node[1] as u32 as u64) << 21 | (node[2] as u32 as u64) << 42;
    let noisy = value + 0.12 * (super::noise(key) - 0.5);
    let rounded = ((noisy / STEP).floor() + 0.5) * STEP;
    (1.0 - QUANTISED) * noisy + QUANTISED * rounded
}

/// Key of a lattice edge and the place of the cut on it, from its lower node.
fn edge_cut(at: [i32; 3], eight: &[f64; 8], a: usize, b: usize) -> (u64, f64) {
    // Along a climb one corner's bits contain the other's.
    let (low, high) = (a & b, a | b);
    let node: [u64; 3] = std::array::from_fn(|k| (at[k] + OFFSET + (low >> k & 1) as i32) as u64);
    let key = ((node[2] << 20 | node[1]) << 20 | node[0]) << 3 | (high ^ low) as u64;
    (key, (eight[low] / (eight[low] - eight[high])).clamp(MARGIN, 1.0 - MARGIN))
}

const OFFSET: i32 = 1 << 19;

/// Numbers the cut edges in the order of their keys.
fn number(corners: &[(u64, f64)], lattice: &Lattice) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut order: Vec<(u64, u32)> = corners.iter().enumerate().map(|(i, c)| (c.0, i as u32)).collect();
    order.sort_unstable();
    let mut vertex = vec![0u32; corners.len()];
    let mut positions = Vec::with_capacity(corners.len() / 6);
    let mut last = None;
    for (key, corner) in order {
        if last != Some(key) {
            last = Some(key);
            let node: [i32; 3] = std::array::from_fn(|k| (key >> (3 + 20 * k) & 0xf_ffff) as i32 - OFFSET);
            let end: [i32; 3] = std::array::from_fn(|k| node[k] + (key >> k & 1) as i32);
            positions.push(crate::vector::lerp(lattice.at(node), lattice.at(end), corners[corner as usize].1));
        }
        vertex[corner as usize] = positions.len() as u32 - 1;
    }
    (positions, vertex.as_chunks::<3>().0.to_vec())
}
