//! Scan-like samples: an implicit body, extracted at the spacing that gives the wanted count, opened, and checked.

use super::cut::{Opening, cut};
use super::field::{Field, Primitive};
use super::fit::fit;
use super::lattice::{Lattice, level_set};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;

/// Triangles that cover an area of one squared spacing, about.
const DENSITY: f64 = 9.0;

/// Radius of the thinnest part a scan shows, in spacings: as with real scanners, thinner parts come out swollen.
const THINNEST: f64 = 0.62;

/// A body to scan and the topology its surface has.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub(super) field: Field,
    pub(super) openings: Vec<Opening>,
    pub(super) genus: u32,
    /// Name of its one region.
    pub(super) name: &'static str,
}

/// Scans a body with about `target` triangles, finer where a coarse lattice would change its topology.
///
/// # Errors
/// Those of `work`, and [`crate::error::Reason::Invariant`] if no spacing resolves the body.
pub(super) fn generate(body: &Body, target: u64, work: &Work<'_>) -> Result<SurfaceMesh> {
    let area: f64 = body.field.primitives.iter().map(Primitive::area).sum();
    let first = (DENSITY * area / target as f64).sqrt();
    let mut mesh = fit(target, first, |spacing| scan(body, spacing, work))?;
    mesh.regions[0].name = body.name.to_owned();
    Ok(mesh)
}

/// One scan; `None` if the lattice is too coarse to keep the topology of the body.
fn scan(body: &Body, spacing: f64, work: &Work<'_>) -> Result<Option<SurfaceMesh>> {
    let least = THINNEST * spacing;
    let (mut positions, mut triangles) = level_set(&body.field.thickened(least), &Lattice::new(spacing), work)?;
    if !body.openings.is_empty() {
        let openings: Vec<Opening> = body.openings.iter().map(|o| Opening { reach: o.reach.max(2.0 * least), ..o.clone() }).collect();
        triangles = cut(&mut positions, &triangles, &openings, spacing, work)?;
    }
    work.check()?;
    let Ok(topology) = Topology::build(&triangles, positions.len()) else { return Ok(None) };
    let [whole] = topology.components[..] else { return Ok(None) };
    let right = whole.genus() == body.genus && whole.loops as usize == body.openings.len();
    Ok(right.then(|| SurfaceMesh::from_parts(positions, triangles)))
}
