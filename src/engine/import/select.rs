//! Choosing regions of a file, and dropping those that no face has any more.

use super::ImportReport;
use crate::error::{EngineError, Reason, Result};
use crate::mesh::{Region, SurfaceMesh};
use crate::repair::faces::retain;

/// Most regions listed in an error message.
const LISTED: usize = 20;

fn is_wanted(region: &Region, wanted: &[String]) -> bool {
    wanted.iter().any(|w| matches(region, w))
}

fn matches(region: &Region, wanted: &str) -> bool {
    (!region.name.is_empty() && region.name == wanted) || wanted.parse() == Ok(region.id)
}

/// Drops the faces of all regions but those named (by name or by id); an empty list keeps all.
///
/// # Errors
/// [`Reason::BadParameter`] for an entry that names no region.
pub(crate) fn keep_regions(mesh: &mut SurfaceMesh, only: &[String], report: &mut ImportReport) -> Result<()> {
    if only.is_empty() {
        return Ok(());
    }
    for wanted in only {
        if !mesh.regions.iter().any(|r| matches(r, wanted)) {
            let mut list: Vec<String> = mesh.regions.iter().take(LISTED).map(|r| format!("{} {:?}", r.id, r.name)).collect();
            if mesh.regions.len() > LISTED {
                list.push(format!("and {} more", mesh.regions.len() - LISTED));
            }
            let message = format!("no region has the name or number {wanted:?}; there are: {}", list.join(", "));
            return Err(EngineError::bad_parameter("only_regions", message));
        }
    }
    let keep: Vec<bool> = mesh.regions.iter().map(|r| is_wanted(r, only)).collect();
    let face_region = std::mem::take(&mut mesh.face_region);
    mesh.face_region = face_region.clone();
    let dropped = retain(mesh, |f| keep[face_region[f] as usize]);
    if mesh.triangles.is_empty() {
        return Err(EngineError::new(Reason::EmptyMesh, "the chosen regions have no face"));
    }
    if dropped > 0 {
        report.warnings.push(format!("{dropped} faces of regions that were not asked for were left out"));
    }
    retain_regions(mesh, &keep);
    Ok(())
}

/// Drops regions that have no face; the names of those lost by repair are told.
pub(crate) fn drop_empty_regions(mesh: &mut SurfaceMesh, report: &mut ImportReport) {
    let mut used = vec![false; mesh.regions.len()];
    mesh.face_region.iter().for_each(|&r| used[r as usize] = true);
    let lost: Vec<String> =
        mesh.regions.iter().zip(&used).filter(|(_, u)| !**u).take(LISTED).map(|(r, _)| format!("{} {:?}", r.id, r.name)).collect();
    if !lost.is_empty() {
        report.warnings.push(format!("regions without a face were dropped: {}", lost.join(", ")));
        retain_regions(mesh, &used);
    }
}

fn retain_regions(mesh: &mut SurfaceMesh, keep: &[bool]) {
    let mut number = vec![0; keep.len()];
    let mut kept = Vec::new();
    for (index, region) in std::mem::take(&mut mesh.regions).into_iter().enumerate() {
        number[index] = kept.len() as u32;
        if keep[index] {
            kept.push(region);
        }
    }
    mesh.regions = kept;
    mesh.face_region.iter_mut().for_each(|r| *r = number[*r as usize]);
}
