//! Regions of the remeshed surface: every face gets the region of the input below it, among the regions it may have.

use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Result};
use crate::features::{Compounds, RegionBorders};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, triangle_area};
use crate::work::Work;

/// Which regions may change places in the output.
#[derive(Debug, Clone, Copy)]
pub struct RegionFreedom<'a> {
    /// For each region what stands for all that are parametrized with it.
    group: &'a [u32],
    borders: RegionBorders,
}

impl<'a> RegionFreedom<'a> {
    /// With kept borders only regions of the same compound; otherwise all.
    pub fn new(compounds: &'a Compounds, borders: RegionBorders) -> Self {
        RegionFreedom { group: &compounds.group, borders }
    }

    /// Whether any region may take a place of another.
    pub fn is_none(&self) -> bool {
        match self.borders {
            RegionBorders::Ignore => self.group.len() < 2,
            RegionBorders::Keep => self.group.iter().enumerate().all(|(r, &g)| r as u32 == g),
        }
    }

    fn group_of(&self, region: u32) -> u32 {
        if self.borders == RegionBorders::Ignore { 0 } else { self.group[region as usize] }
    }

    /// Group of every region: part of the key of what depends on it.
    pub fn groups(&self) -> Vec<u32> {
        (0..self.group.len() as u32).map(|r| self.group_of(r)).collect()
    }
}

/// Sweeps that straighten borders.
const SWEEPS: usize = 4;
/// A region keeps at least this share of the faces that lie on it.
const LEAST_KEPT: f64 = 0.6;

/// Gives each face whose region may change the region of the input face nearest to its centroid, straightens borders by majority, and
/// gives a region that has no face, but at least half the area of the smallest face over it, the faces that it covers most.
/// Returns the regions of the input that are left without a face, increasing. `fixed` tells edges (vertex pairs, low first, sorted)
/// across which faces do not vote. Near-linear.
///
/// # Errors
/// Cancellation; those of [`Topology::build`]; broken invariants.
pub fn assign_regions(
    input: &SurfaceMesh,
    bvh: &TriangleBvh,
    output: &mut SurfaceMesh,
    fixed: &[[u32; 2]],
    freedom: RegionFreedom<'_>,
    work: &Work<'_>,
) -> Result<Vec<u32>> {
    if freedom.group.len() != input.regions.len() || output.regions.len() != input.regions.len() {
        return Err(EngineError::invariant("the regions of input, output and compounds do not fit each other"));
    }
    if !freedom.is_none() {
        let topology = Topology::build(&output.triangles, output.positions.len())?;
        project(input, bvh, output, freedom, work)?;
        straighten(output, &topology, fixed, freedom, work)?;
        give_back(input, output, freedom, work)?;
    }
    let (before, after) = (faces_of(input), faces_of(output));
    Ok((0..before.len() as u32).filter(|&r| before[r as usize] > 0 && after[r as usize] == 0).collect())
}

fn faces_of(mesh: &SurfaceMesh) -> Vec<u32> {
    let mut count = vec![0u32; mesh.regions.len()];
    mesh.face_region.iter().for_each(|&r| count[r as usize] += 1);
    count
}

fn centroid(mesh: &SurfaceMesh, f: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(f);
    std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0)
}

/// The group of a face is right, since no flip crosses the border of a compound; which of its regions is asked of the input. Where
/// two sheets are close, a face of the other sheet is nearest at times: its region is not of the group, and the old one stays.
fn project(input: &SurfaceMesh, bvh: &TriangleBvh, output: &mut SurfaceMesh, freedom: RegionFreedom<'_>, work: &Work<'_>) -> Result<()> {
    let mut many = vec![0u32; input.regions.len()];
    (0..many.len() as u32).for_each(|r| many[freedom.group_of(r) as usize] += 1);
    for f in 0..output.triangles.len() {
        if f.is_multiple_of(1024) {
            work.check()?;
        }
        let group = freedom.group_of(output.face_region[f]);
        if many[group as usize] < 2 {
            continue;
        }
        let hit = bvh.closest(centroid(output, f)).ok_or_else(|| EngineError::invariant("the search tree is empty"))?;
        let region = input.face_region[hit.face as usize];
        if freedom.group_of(region) == group {
            output.face_region[f] = region;
        }
    }
    Ok(())
}

/// A face two of whose three neighbours are of one other region joins them. No region falls below [`LEAST_KEPT`] of its faces.
fn straighten(
    output: &mut SurfaceMesh,
    topology: &Topology,
    fixed: &[[u32; 2]],
    freedom: RegionFreedom<'_>,
    work: &Work<'_>,
) -> Result<()> {
    let mut count = faces_of(output);
    let least: Vec<u32> = count.iter().map(|&n| (LEAST_KEPT * f64::from(n)).ceil().max(1.0) as u32).collect();
    for _ in 0..SWEEPS {
        work.check()?;
        let mut changed = false;
        for f in 0..output.triangles.len() as u32 {
            let own = output.face_region[f as usize];
            let mut beside = [None; 3];
            for (k, h) in (3 * f..3 * f + 3).enumerate() {
                let (a, b) = (topology.origin(h), topology.target(h));
                let open = topology.twin(h).filter(|_| fixed.binary_search(&[a.min(b), a.max(b)]).is_err());
                beside[k] = open.map(|t| output.face_region[topology.face(t) as usize]);
            }
            let twice =
                if beside[0] == beside[1] || beside[0] == beside[2] { beside[0] } else { beside[1].filter(|_| beside[1] == beside[2]) };
            let Some(other) = twice.filter(|&r| r != own && freedom.group_of(r) == freedom.group_of(own)) else { continue };
            if count[own as usize] > least[own as usize] {
                count[own as usize] -= 1;
                count[other as usize] += 1;
                output.face_region[f as usize] = other;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    Ok(())
}

/// Regions without a face get those that they cover most, until they have their area; no region loses its last faces.
fn give_back(input: &SurfaceMesh, output: &mut SurfaceMesh, freedom: RegionFreedom<'_>, work: &Work<'_>) -> Result<()> {
    let (before, mut after) = (faces_of(input), faces_of(output));
    let lost: Vec<u32> = (0..before.len() as u32).filter(|&r| before[r as usize] > 0 && after[r as usize] == 0).collect();
    if lost.is_empty() {
        return Ok(());
    }
    let tree = TriangleBvh::build(&output.positions, &output.triangles);
    let area = |mesh: &SurfaceMesh, f: usize| {
        let [a, b, c] = mesh.corners(f);
        triangle_area(a, b, c)
    };
    // (region, output face, covered area), for all faces of lost regions.
    let mut covered: Vec<(u32, u32, f64)> = Vec::new();
    for f in 0..input.triangles.len() {
        let region = input.face_region[f];
        if lost.binary_search(&region).is_err() {
            continue;
        }
        work.check()?;
        let hit = tree.closest(centroid(input, f)).ok_or_else(|| EngineError::invariant("the result has no faces"))?;
        if freedom.group_of(output.face_region[hit.face as usize]) == freedom.group_of(region) {
            covered.push((region, hit.face, area(input, f)));
        }
    }
    covered.sort_by_key(|c| (c.0, c.1));
    let joined: Vec<(u32, u32, f64)> =
        covered.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(|run| (run[0].0, run[0].1, run.iter().map(|c| c.2).sum())).collect();
    for run in joined.chunk_by(|a, b| a.0 == b.0) {
        let wanted: f64 = run.iter().map(|c| c.2).sum();
        let mut best: Vec<(f64, u32)> = run.iter().map(|c| (c.2 / area(output, c.1 as usize).max(f64::MIN_POSITIVE), c.1)).collect();
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut given = 0.0;
        for (_, face) in best {
            let (size, owner) = (area(output, face as usize), output.face_region[face as usize]);
            if given + 0.5 * size > wanted || after[owner as usize] < 2 {
                continue;
            }
            after[owner as usize] -= 1;
            after[run[0].0 as usize] += 1;
            output.face_region[face as usize] = run[0].0;
            given += size;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
