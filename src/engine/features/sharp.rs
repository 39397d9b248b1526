//! Sharp edges by the angle between face normals, made safe against slivers whose normals mean nothing.

use super::{Mark, set_mark};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, angle_between, area_vector_twice, distance, norm, unit};
use crate::work::Work;

/// A face whose height is below this share of its longest edge is a sliver.
const SLIVER_HEIGHT: f64 = 0.03;
/// A sliver whose normal is within this angle (radians) of a neighbour's is believed.
const AGREEMENT: f64 = 0.35;
/// Slivers that touch only slivers are settled in at most this many sweeps.
const SWEEPS: usize = 4;

/// Marks every interior edge whose faces' normals (see [`reference_normals`]) differ by at least `angle` radians.
pub(super) fn mark_sharp(topology: &Topology, normals: &[Vec3], angle: f64, marks: &mut [Mark], work: &Work<'_>) -> Result<()> {
    for h in 0..topology.halfedge_count() as u32 {
        if h.is_multiple_of(65_536) {
            work.check()?;
        }
        let Some(t) = topology.twin(h).filter(|&t| h < t) else { continue };
        let (a, b) = (normals[topology.face(h) as usize], normals[topology.face(t) as usize]);
        // Rounding must not lose edges of exactly the threshold (a cube at 90 degrees).
        if marks[h as usize] == Mark::None && angle_between(a, b) >= angle - 1e-9 {
            set_mark(topology, marks, h, Mark::Sharp);
        }
    }
    Ok(())
}

/// Unit normals; those of slivers that agree with no neighbour are replaced by the best fitting neighbour's.
/// So an edge beside such a sliver is sharp only if the faces on its two sides are.
pub(super) fn reference_normals(mesh: &SurfaceMesh, topology: &Topology, work: &Work<'_>) -> Result<Vec<Vec3>> {
    let count = topology.face_count();
    let mut normals = Vec::with_capacity(count);
    let mut doubtful = Vec::new();
    for f in 0..count {
        let [a, b, c] = mesh.corners(f);
        let twice = area_vector_twice(a, b, c);
        let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
        if norm(twice) < SLIVER_HEIGHT * longest * longest {
            doubtful.push(f as u32);
        }
        normals.push(unit(twice));
    }
    work.check()?;
    let angle_to = |normals: &[Vec3], f: u32, g: u32| {
        let (a, b) = (normals[f as usize], normals[g as usize]);
        // A zero normal fits nothing and everything equally badly.
        if norm(a) == 0.0 || norm(b) == 0.0 { std::f64::consts::PI } else { angle_between(a, b) }
    };
    let neighbours = |f: u32| (3 * f..3 * f + 3).filter_map(|h| topology.twin(h)).map(|t| topology.face(t));
    doubtful.retain(|&f| neighbours(f).all(|g| angle_to(&normals, f, g) > AGREEMENT));
    let mut unsettled = vec![false; count];
    for &f in &doubtful {
        unsettled[f as usize] = true;
    }
    for _ in 0..SWEEPS {
        let adopted: Vec<(u32, Vec3)> = doubtful
            .iter()
            .filter_map(|&f| {
                let fits = neighbours(f).filter(|&g| !unsettled[g as usize]);
                let best = fits.min_by(|&g, &k| angle_to(&normals, f, g).total_cmp(&angle_to(&normals, f, k)).then(g.cmp(&k)))?;
                Some((f, normals[best as usize]))
            })
            .collect();
        for &(f, n) in &adopted {
            normals[f as usize] = n;
            unsettled[f as usize] = false;
        }
        doubtful.retain(|&f| unsettled[f as usize]);
        work.check()?;
    }
    Ok(normals)
}
