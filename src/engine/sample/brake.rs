//! The ventilated brake disc: two friction rings joined by curved vanes, a hat and a flange with bolt slots.

use std::f64::consts::TAU;

use super::fit::fit;
use super::layout::{annulus, steps, strips};
use super::stack::{Face, Layer, Side, Stack, boundary};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::work::Work;

/// Genus at full size, and the triangles from which a disc has it.
const FULL_GENUS: u32 = 83;
const FULL_FROM: u64 = 40_000;
/// Radial lines, mm: bore, slots, hat, rings, vanes, rim.
const RADII: [f64; 8] = [30.0, 38.0, 48.0, 60.0, 66.0, 74.0, 122.0, 126.0];
/// Heights, mm: lower ring, gap, upper ring, hat, flange.
const HEIGHTS: [f64; 6] = [0.0, 7.0, 16.0, 23.0, 40.0, 46.0];
/// Share of the pitch a vane takes, and by how much the vanes lean over, radians.
const VANE_SHARE: f64 = 0.4;
const LEAN: f64 = 0.22;
const SLOTS: u32 = 5;
const NAMES: [&str; 5] = ["friction_lower", "friction_upper", "vanes", "hat", "rim"];

/// Genus of a disc of `triangles` triangles if nothing else is asked: 83 from 40,000 on, in proportion below.
pub(super) fn usual_genus(triangles: u64) -> u32 {
    let share = triangles.min(FULL_FROM) as f64 / FULL_FROM as f64;
    ((f64::from(FULL_GENUS) * share) as u32).clamp(4, FULL_GENUS)
}

/// A disc of the given genus (at least 2).
///
/// # Errors
/// Those of `work`.
pub(super) fn generate(genus: u32, triangles: u64, work: &Work<'_>) -> Result<SurfaceMesh> {
    // The lower ring is a solid torus, the upper one with the flange has 1 + slots holes, each vane after the first adds one.
    let slots = if genus >= 12 { SLOTS } else { 0 };
    let vanes = genus - 1 - slots;
    let area = 4.5 * std::f64::consts::PI * (126.0f64.powi(2) - 66.0f64.powi(2)) + 500.0 * f64::from(vanes);
    fit(triangles, (area / triangles as f64).sqrt(), |size| disc(vanes, slots, size, work).map(Some))
}

fn disc(vanes: u32, slots: u32, size: f64, work: &Work<'_>) -> Result<SurfaceMesh> {
    let sectors = 2 * vanes as usize;
    let (angles, sector_of) = angular_lines(vanes, size);
    let mut radii = vec![RADII[0]];
    let mut interval_of = Vec::new();
    for i in 0..RADII.len() - 1 {
        let width = RADII[i + 1] - RADII[i];
        let places = strips(steps(width, 1.5 * size, if i == 5 { 3 } else { 1 }), i as u64);
        radii.extend(places[1..].iter().map(|t| RADII[i] + t * width));
        interval_of.resize(radii.len() - 1, i);
    }
    let column = |i: usize, j: usize| (interval_of[i] * sectors + sector_of[j]) as u32;
    let turn = |r: f64| {
        let t = ((r - RADII[5]) / (RADII[6] - RADII[5])).clamp(0.0, 1.0);
        LEAN * t * t * (3.0 - 2.0 * t)
    };
    let layout = annulus(&radii, &angles, column, turn);
    let layers: Vec<Layer> = (0..HEIGHTS.len() - 1)
        .map(|k| Layer { strips: strips(steps(HEIGHTS[k + 1] - HEIGHTS[k], 1.2 * size, 1), 100 + k as u64) })
        .collect();
    let solid = |column: u32, layer: usize| is_solid(column as usize / sectors, column as usize % sectors, layer, vanes, slots);
    let stack = Stack {
        layout: &layout,
        layers: &layers,
        solid: &solid,
        floor: &|_, layer| HEIGHTS[layer],
        region: &|face| region(face, sectors),
        region_names: &NAMES,
    };
    boundary(&stack, work)
}

/// Angles of the lines around and the sector (vane, gap, vane, ...) behind each.
fn angular_lines(vanes: u32, size: f64) -> (Vec<f64>, Vec<usize>) {
    let pitch = TAU / f64::from(vanes);
    let (mut angles, mut sector_of) = (Vec::new(), Vec::new());
    for sector in 0..2 * vanes as usize {
        let vane = sector.is_multiple_of(2);
        let from = pitch * ((sector / 2) as f64 + if vane { 0.0 } else { VANE_SHARE });
        let width = pitch * if vane { VANE_SHARE } else { 1.0 - VANE_SHARE };
        let least = (width / 0.2).ceil() as usize;
        let places = strips(steps(96.0 * width, size, least), 1000 + sector as u64);
        angles.extend(places[..places.len() - 1].iter().map(|t| from + t * width));
        sector_of.resize(angles.len(), sector);
    }
    (angles, sector_of)
}

fn is_solid(interval: usize, sector: usize, layer: usize, vanes: u32, slots: u32) -> bool {
    match interval {
        1 => layer == 4 && !in_slot(sector, vanes, slots),
        0 | 2 => layer == 4,
        3 => layer >= 2,
        5 => layer == 0 || layer == 2 || layer == 1 && sector.is_multiple_of(2),
        _ => layer == 0 || layer == 2,
    }
}

fn in_slot(sector: usize, vanes: u32, slots: u32) -> bool {
    let around = 2 * vanes as usize;
    let width = (around * 9 / 100).max(1);
    (0..slots as usize).map(|i| i * around / slots as usize).any(|first| (first..first + width).contains(&sector))
}

fn region(face: &Face, sectors: usize) -> u32 {
    let ring = face.column as usize / sectors >= 4;
    let radius = face.centre[0].hypot(face.centre[1]);
    match (face.side, face.layer) {
        (Side::Down, 0) => 0,
        (Side::Up, 2) if ring => 1,
        (Side::Wall, 1) | (Side::Up, 0) => 2,
        (Side::Down, 2) if ring => 2,
        (Side::Wall, 0 | 2) if radius > 100.0 => 4,
        (Side::Wall, 0) => 4,
        _ => 3,
    }
}
