//! Triangles that a matching left alone walk through quadrangles to each other: a triangle and a quadrangle side by side are a pentagon,
//! which can be divided so that the triangle is at any of its sides.

use super::mixed::{Corners, Mixed, NONE};
use crate::error::Result;
use crate::optimize::input::Input;
use crate::planar::QuadKind;
use crate::work::Work;
use std::collections::VecDeque;

/// What binds a walk where triangles may stay.
#[derive(Clone, Copy)]
struct Bounds {
    /// Quadrangles that it may go through.
    reach: u32,
    /// It makes no face worse than this.
    least: f64,
}

const MIXED: Bounds = Bounds { reach: 2, least: 0.1 };

/// Joins triangles in pairs through quadrangles, none of another region or beyond a curve: near ones only, or all, whatever the shapes
/// on the way. Each search ends at the nearest triangle; one that finds none goes through its whole part.
pub(super) fn join_triangles(mesh: &mut Mixed, input: &Input<'_>, kind: QuadKind, work: &Work<'_>) -> Result<()> {
    let bounds = match kind {
        QuadKind::Mixed => Some(MIXED),
        QuadKind::All => None,
    };
    // By face: the search that came to it, and from where.
    let mut seen: Vec<(u32, u32)> = vec![(NONE, NONE); mesh.faces.len()];
    for f in 0..mesh.faces.len() as u32 {
        if f.is_multiple_of(256) {
            work.check()?;
        }
        if mesh.is_face(f)
            && !mesh.is_quad(f)
            && let Some(way) = way_to_triangle(mesh, f, bounds, &mut seen, work)?
        {
            walk(mesh, &way, input, bounds);
        }
    }
    Ok(())
}

/// The faces from triangle `f` to the nearest other one, both included.
fn way_to_triangle(mesh: &Mixed, f: u32, bounds: Option<Bounds>, seen: &mut [(u32, u32)], work: &Work<'_>) -> Result<Option<Vec<u32>>> {
    let mut popped = 0u32;
    let mut queue = VecDeque::from([(f, 0)]);
    seen[f as usize] = (f, NONE);
    while let Some((at, steps)) = queue.pop_front() {
        popped += 1;
        if popped.is_multiple_of(1024) {
            work.check()?;
        }
        let corners = mesh.corners(at);
        for k in 0..corners.len() {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let Some(g) = mesh.across(at, a, b).filter(|_| !mesh.is_curve(a, b)) else { continue };
            if seen[g as usize].0 == f || mesh.label[g as usize][1] != mesh.label[f as usize][1] {
                continue;
            }
            seen[g as usize] = (f, at);
            if !mesh.is_quad(g) {
                let mut way = vec![g];
                while let Some(&from) = way.last().map(|&last| &seen[last as usize].1).filter(|from| **from != NONE) {
                    way.push(from);
                }
                way.reverse();
                return Ok(Some(way));
            }
            if bounds.is_none_or(|b| steps < b.reach) {
                queue.push_back((g, steps + 1));
            }
        }
    }
    Ok(None)
}

/// Moves the triangle at the start of a way to its end, as far as pentagons have five corners.
fn walk(mesh: &mut Mixed, way: &[u32], input: &Input<'_>, bounds: Option<Bounds>) {
    for i in 1..way.len() {
        let (f, g) = (way[i - 1], way[i]);
        let t = mesh.faces[f as usize];
        let Some(k) = (0..3).find(|&k| mesh.across(f, t[k], t[(k + 1) % 3]) == Some(g)) else { return };
        let (a, b, apex) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
        let other = mesh.faces[g as usize];
        let Some(j) = other.iter().position(|&v| v == a) else { return };
        if !mesh.is_quad(g) {
            let far = other[(j + 1) % 3];
            let new = [apex, a, far, b];
            let is_fit = bounds.is_none_or(|b| mesh.quality_of(&new, input) >= b.least && !mesh.is_pinned_flat(&new));
            if far != apex && is_fit {
                mesh.replace(&[f, g], &[new]);
            }
            return;
        }
        // `g` runs from `b` to `a`.
        let ring = [apex, a, other[(j + 1) % 4], other[(j + 2) % 4], b];
        let Some(next) = way.get(i + 1) else { return };
        if (0..5).any(|m| ring[..m].contains(&ring[m])) {
            return;
        }
        let Some(exit) = (1..4).find(|&m| mesh.across(g, ring[m], ring[m + 1]) == Some(*next)) else { return };
        let choices = [exit, exit + 4].map(|first| {
            let at = |m: usize| ring[(first + m) % 5];
            let new: [Corners; 2] = [[at(2), at(3), at(4), at(0)], [at(0), at(1), at(2), NONE]];
            let is_taken = mesh.neighbours(at(0)).binary_search(&at(2)).is_ok();
            let flat = if mesh.is_pinned_flat(&new[0]) { 1.0 } else { 0.0 };
            let worst = mesh.quality_of(&new[0], input).min(mesh.quality_of(&new[1][..3], input));
            ((!is_taken).then_some(worst - flat), new)
        });
        let best = if choices[1].0 > choices[0].0 { &choices[1] } else { &choices[0] };
        if best.0.is_none_or(|worst| bounds.is_some_and(|b| worst < b.least)) {
            return;
        }
        mesh.replace(&[f, g], &best.1);
    }
}
