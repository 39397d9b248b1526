//! The CAD part: a flange plate with four bolt holes and a filleted boss around a bore, tessellated in needles.

use super::fit::fit;
use super::layout::{Block, Blocks, steps, strips};
use super::stack::{Face, Layer, Side, Stack, boundary};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::work::Work;

/// Radii, mm: bore, boss, foot of the fillet, bolt hole.
const BORE: f64 = 18.0;
const BOSS: f64 = 30.0;
const FOOT: f64 = 36.0;
const BOLT: f64 = 9.0;
/// Heights, mm: plate and boss.
const PLATE: f64 = 12.0;
const TOP: f64 = 46.0;
const NAMES: [&str; 6] = ["flange", "base", "boss", "inlet", "bore", "bolt_holes"];
const IN_BOSS: u32 = 0;
const IN_FILLET: u32 = 1;
const IN_PLATE: u32 = 2;

/// A plate of 160 x 80 x 12 mm with a boss of 60 mm across; genus 5 (a bore and four bolt holes). Regions `flange`, `base`, `boss`
/// (with the fillet), `inlet` (the ring on top), `bore`, `bolt_holes`.
///
/// # Errors
/// Those of `work`.
pub(super) fn generate(triangles: u64, work: &Work<'_>) -> Result<SurfaceMesh> {
    fit(triangles, (42_000.0 / triangles as f64).sqrt(), |size| part(size, work).map(Some))
}

fn part(size: f64, work: &Work<'_>) -> Result<SurfaceMesh> {
    let cells = steps(20.0, size, 1) as i64;
    let mut blocks = Blocks::new(20.0 / cells as f64);
    let central = [(BORE, IN_BOSS), (BOSS, IN_FILLET), (FOOT, IN_PLATE)];
    blocks.add(&Block { centre: [0, 0], half: 2 * cells, circles: &central }, 2.0 * size);
    for (x, y) in [(-3, -1), (-3, 1), (3, -1), (3, 1)] {
        blocks.add(&Block { centre: [x * cells, y * cells], half: cells, circles: &[(BOLT, IN_PLATE)] }, 2.5 * size);
    }
    let layers = [(PLATE, 7), (TOP - PLATE, 8)].map(|(height, seed)| Layer { strips: strips(steps(height, 3.0 * size, 1), seed) });
    let stack = Stack {
        layout: &blocks.layout,
        layers: &layers,
        solid: &|column, layer| layer == 0 || column == IN_BOSS,
        floor: &floor,
        region: &region,
        region_names: &NAMES,
    };
    boundary(&stack, work)
}

/// The top of the plate rises to the boss in a quarter circle.
fn floor(at: [f64; 2], layer: usize) -> f64 {
    let fillet = FOOT - BOSS;
    let run = (at[0].hypot(at[1]).clamp(BOSS, FOOT) - BOSS - fillet) / fillet;
    match layer {
        0 => 0.0,
        1 => PLATE + fillet * (1.0 - (1.0 - run * run).max(0.0).sqrt()),
        _ => TOP,
    }
}

fn region(face: &Face) -> u32 {
    let radius = face.centre[0].hypot(face.centre[1]);
    let bolt = (face.centre[0].abs() - 60.0).hypot(face.centre[1].abs() - 20.0);
    match (face.side, face.column) {
        (Side::Down, _) => 1,
        (Side::Up, IN_BOSS) => 3,
        (Side::Up, IN_FILLET) => 2,
        (Side::Wall, _) if radius < BORE + 1.0 => 4,
        (Side::Wall, _) if face.layer == 1 => 2,
        (Side::Wall, _) if bolt < BOLT + 1.0 => 5,
        _ => 0,
    }
}
