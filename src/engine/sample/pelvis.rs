//! A closed pelvis-like body of any genus: ring, two obturator foramina, and a perforated spine for more.

use super::field::{Field, Primitive};
use super::scan::Body;
use crate::vector::Vec3;

/// A body of the given genus: without foramina below 3, with the pubic symphysis apart at 0, and with `genus - 3` holes in a
/// ladder-like spine above 3.
pub(super) fn body(genus: u32) -> Body {
    let mut primitives = vec![Primitive::Sheet(vec![[[-36.0, 52.0, 42.0], [36.0, 52.0, 42.0], [0.0, 74.0, -22.0]]], 9.0)];
    for side in [-1.0, 1.0] {
        let at = |x: f64, y: f64, z: f64| -> Vec3 { [side * x, -y, z] };
        let symphysis = if genus == 0 { at(19.0, 47.0, -38.0) } else { at(0.0, 47.0, -38.0) };
        let below = if genus == 0 { at(20.0, 44.0, -46.0) } else { at(6.0, 44.0, -48.0) };
        // Wing of the ilium, from the sacrum to the acetabulum.
        let (joint, socket, crest) = (at(40.0, -50.0, 34.0), at(64.0, -2.0, 4.0), at(96.0, -16.0, 76.0));
        let (back, front) = (at(66.0, -58.0, 74.0), at(93.0, 24.0, 46.0));
        primitives.push(Primitive::Sheet(vec![[joint, socket, crest], [joint, crest, back], [socket, front, crest]], 5.5));
        // Ring: from the sacrum to the acetabulum, then the superior ramus to the symphysis.
        primitives.push(Primitive::Strand(vec![
            (at(34.0, -52.0, 34.0), 9.0),
            (at(52.0, -34.0, 16.0), 9.5),
            (at(62.0, -4.0, -2.0), 15.0),
            (at(54.0, 20.0, -14.0), 9.0),
            (at(26.0, 42.0, -30.0), 7.0),
            (symphysis, 7.5),
        ]));
        // Obturator foramen: inferior ramus and ischium.
        primitives.push(Primitive::Strand(vec![
            (symphysis, 7.5),
            (below, 6.5),
            (at(28.0, 22.0, -74.0), 6.0),
            (at(50.0, -8.0, -84.0), 11.0),
            (at(62.0, -14.0, -46.0), 9.0),
            (at(63.0, -6.0, -4.0), 13.0),
        ]));
        if genus < 2 || genus == 2 && side > 0.0 {
            let rim = [
                at(26.0, 24.0, -72.0),
                at(10.0, 42.0, -50.0),
                at(24.0, 42.0, -32.0),
                at(53.0, 19.0, -16.0),
                at(62.0, -6.0, -8.0),
                at(62.0, -14.0, -46.0),
                at(49.0, -8.0, -82.0),
            ];
            primitives.push(Primitive::Sheet((1..6).map(|k| [rim[0], rim[k], rim[k + 1]]).collect(), 5.0));
        }
    }
    primitives.extend(spine(genus.saturating_sub(3)));
    Body { field: Field { primitives, blend: 5.0 }, openings: Vec::new(), genus, name: "bone" }
}

/// A ladder of `holes` holes that stands on the sacrum.
fn spine(holes: u32) -> Vec<Primitive> {
    let at = |side: f64, rung: f64| -> Vec3 {
        let bend = (0.35 * rung).sin();
        [side * 18.0, 54.0 - 8.0 * bend, 56.0 + 24.0 * rung]
    };
    let rungs = if holes == 0 { 0..0 } else { 0..holes + 1 };
    let mut parts: Vec<Primitive> =
        rungs.clone().map(f64::from).map(|k| Primitive::Strand(vec![(at(-1.0, k), 4.5), (at(1.0, k), 4.5)])).collect();
    for side in [-1.0, 1.0].into_iter().filter(|_| holes > 0) {
        parts.push(Primitive::Strand(rungs.clone().map(|k| (at(side, f64::from(k)), 4.5)).collect()));
    }
    parts
}
