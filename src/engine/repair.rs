//! Repairs that change no geometry: welding, dropping duplicate and zero-area faces, orienting, splitting bow-tie vertices.

mod caps;
pub(crate) mod faces;
pub(crate) mod orient;
#[cfg(test)]
pub(crate) mod shapes;
#[cfg(test)]
mod tests;
pub mod weld;

use crate::diagnose::edges::EdgeTable;
use crate::error::{Element, EngineError, Location, Reason, Result};
use crate::import::ImportReport;
use crate::mesh::SurfaceMesh;
use crate::vector::bounding_diagonal;
use crate::work::Work;

/// Coordinates outside of this range (or a diagonal below its inverse) would overflow or vanish in products of four lengths.
const LARGEST: f64 = 1e60;

/// Repairs arrays as a file gives them (repeated indices, unused vertices, any orientation), in this order:
/// 1. weld vertices ([`weld::weld`]);
/// 2. swap the long edges of zero-area faces with a corner on an edge, which keeps the surface closed there; drop the faces that
///    repeat a vertex or still have zero area, then exact duplicates (same three vertices in any direction; the first stays);
/// 3. orient each part (faces joined across edges with two faces) by the majority of its faces. Closed parts that point inwards
///    stay so - they may be cavities - and are told in a warning; parts that have no orientation stay as they are;
/// 4. split bow-tie vertices: a vertex whose faces form several fans, none of them at an edge with more than two faces, becomes one
///    vertex per fan at the same place. Without it such a surface cannot be remeshed at all. It changes V, not the surface: the
///    Euler characteristic grows by one per copy, and parts that touch in such a vertex only become components of their own;
/// 5. drop vertices that no face uses; the others keep their order.
///
/// Counts and warnings are added to `report`. O(F log F).
///
/// # Errors
/// [`Reason::NonFinite`] and [`Reason::IndexOutOfRange`] with the places, [`Reason::BadParameter`] for coordinates beyond 1e60,
/// [`Reason::EmptyMesh`] if no face is left, [`Reason::LimitReached`], and cancellation.
pub fn repair(mesh: &mut SurfaceMesh, weld_tolerance: f64, report: &mut ImportReport, work: &Work<'_>) -> Result<()> {
    check_arrays(mesh)?;
    let target = weld::weld(&mesh.positions, weld_tolerance, work)?;
    report.vertices_welded = target.iter().enumerate().filter(|&(v, &t)| v as u32 != t).count() as u64;
    if report.vertices_welded > 0 {
        mesh.triangles.iter_mut().flatten().for_each(|v| *v = target[*v as usize]);
    }
    drop(target);
    report.unused_vertices_dropped = faces::drop_unused_vertices(mesh).saturating_sub(report.vertices_welded);
    work.check()?;
    drop_faces(mesh, report);
    work.check()?;
    if mesh.triangles.is_empty() {
        return Err(empty(report));
    }
    let edges = EdgeTable::build(&mesh.triangles, mesh.positions.len());
    work.check()?;
    let (turn, not_orientable) = orient::faces_to_turn(&mesh.triangles, &edges);
    report.faces_flipped = turn.iter().filter(|&&t| t).count() as u64;
    if not_orientable > 0 {
        report.warnings.push(format!("{not_orientable} parts of the surface have no consistent orientation and were left as they are"));
    }
    work.check()?;
    // Sides are numbered by the corners as they were, so fans are split before faces are turned.
    report.vertices_split = orient::split_fans(mesh, &edges);
    for (t, _) in mesh.triangles.iter_mut().zip(&turn).filter(|(_, turned)| **turned) {
        t.swap(1, 2);
    }
    work.check()?;
    // Which faces share an edge is still as in the table: splitting and turning do not change it.
    let inward = orient::inward_parts(mesh, &edges);
    if inward > 0 {
        report.warnings.push(format!("{inward} closed parts have their faces pointing inwards; they were left so (they may be cavities)"));
    }
    report.unused_vertices_dropped += faces::drop_unused_vertices(mesh);
    Ok(())
}

/// Refuses what no later step can work with.
fn check_arrays(mesh: &SurfaceMesh) -> Result<()> {
    if mesh.positions.len() >= u32::MAX as usize || mesh.triangles.len() >= u32::MAX as usize / 3 {
        return Err(EngineError::new(Reason::LimitReached, "more vertices or faces than 32-bit indices can number"));
    }
    let is_bad = |p: &[f64; 3]| p.iter().any(|x| !x.is_finite());
    let bad: Vec<usize> = (0..mesh.positions.len()).filter(|&v| is_bad(&mesh.positions[v])).collect();
    if let Some(first) = bad.first() {
        let locations = bad.iter().map(|&v| Location { element: Element::Vertex, ids: vec![v as u32], position: mesh.positions[v] });
        let message = format!("{} vertices have a coordinate that is NaN or infinite, the first is vertex {first}", bad.len());
        return Err(EngineError::new(Reason::NonFinite, message)
            .with_locations(locations)
            .with_hint("write the file again from its source; ids count the vertices of the file from 0"));
    }
    let count = mesh.positions.len();
    if let Some(face) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
        let message = format!("face {face} names vertices {:?}, but there are {count}", mesh.triangles[face]);
        return Err(EngineError::new(Reason::IndexOutOfRange, message).with_metadata("face", face));
    }
    let diagonal = bounding_diagonal(&mesh.positions);
    let largest = mesh.positions.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > LARGEST || (diagonal > 0.0 && diagonal < 1.0 / LARGEST) {
        let message =
            format!("coordinates up to {largest:e} with a bounding box diagonal of {diagonal:e} are outside of the range computed with");
        return Err(EngineError::new(Reason::BadParameter, message).with_hint("scale the surface to a size between 1e-60 and 1e60"));
    }
    Ok(())
}

fn drop_faces(mesh: &mut SurfaceMesh, report: &mut ImportReport) {
    let factor = faces::normalizer(bounding_diagonal(&mesh.positions));
    let swaps = caps::swap_caps(mesh, factor);
    if swaps > 0 {
        report
            .warnings
            .push(format!("{swaps} zero-area faces with a corner on an edge were removed by swapping that edge, not by dropping"));
    }
    let good: Vec<bool> = mesh.triangles.iter().map(|t| !faces::repeats_a_vertex(t) && !faces::has_zero_area(mesh, t, factor)).collect();
    report.degenerate_faces_dropped = faces::retain(mesh, |f| good[f]);
    let first = faces::first_equal_face(&mesh.triangles, mesh.positions.len());
    let other_region = (0..first.len()).filter(|&f| mesh.face_region[f] != mesh.face_region[first[f] as usize]).count();
    report.duplicate_faces_dropped = faces::retain(mesh, |f| first[f] as usize == f);
    if other_region > 0 {
        report
            .warnings
            .push(format!("{other_region} of the dropped duplicate faces belonged to another region than the face that was kept"));
    }
}

fn empty(report: &ImportReport) -> EngineError {
    let message = if report.faces_read == 0 {
        "the surface has no face".to_owned()
    } else {
        format!("none of the {} faces has an area", report.faces_read)
    };
    EngineError::new(Reason::EmptyMesh, message)
}
