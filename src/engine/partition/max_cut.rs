//! The max-cut partition of Alliez (2002) as P2 section 3 tells it: one harmonic map, one straight line. For comparison: it
//! fails on parts so long that their far ends cannot be told apart in the map.

use super::laplace::harmonic::Harmonic;
use super::laplace::scales::circle;
use super::laplace::sheet::Sheet;
use super::laplace::{axis_of, components, connect};
use super::two_way::{TwoWayCut, Verdict};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;

/// Faces of less area in the unit disk cannot be told apart (P2 figure 2).
const LEAST_AREA: f64 = 1e-15;
/// Share of the surface that may be in such faces, or be flipped, or lie in stray components of a side.
const MOST_LOST: f64 = 0.02;
/// A part with less than this share of the area is no half.
const LEAST_SHARE: f64 = 0.2;

/// Cuts a connected set of faces of genus 0 with a border in two by a line through the centre of gravity of the mapped vertices
/// along their principal axis of inertia, and judges whether the map could carry it.
pub(super) fn cut(sheet: &Sheet, work: &Work<'_>) -> Result<TwoWayCut> {
    let mut harmonic = Harmonic::new(sheet);
    let faces: Vec<u32> = (0..sheet.triangles.len() as u32).collect();
    harmonic.place(sheet, &faces, |_| true, &circle(sheet), work)?;
    let uv = &harmonic.uv;
    let count = uv.len().max(1) as f64;
    let centre = [0, 1].map(|k| uv.iter().map(|p| p[k]).sum::<f64>() / count);
    let (sin, cos) = axis_of(centre, uv.iter().copied()).sin_cos();
    let corners = |f: usize| sheet.triangles[f].map(|v| uv[v as usize]);
    let mut second: Vec<bool> = (0..faces.len())
        .map(|f| corners(f).iter().map(|p| cos * (p[1] - centre[1]) - sin * (p[0] - centre[0])).sum::<f64>() < 0.0)
        .collect();
    let lost: Vec<u32> = faces.iter().copied().filter(|&f| signed_area(corners(f as usize)) < LEAST_AREA).collect();
    let area_of = |set: &[u32]| set.iter().map(|&f| sheet.area[f as usize]).sum::<f64>() / sheet.total_area().max(f64::MIN_POSITIVE);
    let mut pieces: Vec<(bool, f64)> = components(sheet, &second).iter().map(|set| (second[set[0] as usize], area_of(set))).collect();
    pieces.sort_by(|a, b| b.1.total_cmp(&a.1));
    let main: f64 = [false, true].iter().filter_map(|side| pieces.iter().find(|p| p.0 == *side)).map(|p| p.1).sum();
    connect(sheet, &mut second);
    let mut cut = TwoWayCut::measured(sheet, second);
    let collapsed = area_of(&lost);
    cut.verdict = verdict(collapsed, 1.0 - main, cut.second_share);
    cut.collapsed = lost.into_iter().map(|f| sheet.faces[f as usize]).collect();
    Ok(cut)
}

fn verdict(collapsed: f64, stray: f64, share: f64) -> Verdict {
    let percent = |x: f64| format!("{:.1} %", 100.0 * x);
    if collapsed > MOST_LOST {
        return Verdict::Unusable(format!("{} of the area is mapped to triangles below {LEAST_AREA:e} of the disk", percent(collapsed)));
    }
    if stray > MOST_LOST {
        return Verdict::Unusable(format!("{} of the area lies in stray pieces of the two sides", percent(stray)));
    }
    if share.min(1.0 - share) < LEAST_SHARE {
        return Verdict::Unusable(format!("one side has only {} of the area", percent(share.min(1.0 - share))));
    }
    Verdict::Usable
}

fn signed_area([a, b, c]: [Vec2; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}
