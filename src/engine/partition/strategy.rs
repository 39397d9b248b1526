//! The methods a surface can be partitioned by, and the choice between them.

use super::surface::{Limits, Scratch, Surface, measure};
use super::{Partition, PartitionSpec, face_groups, handles, multilevel, plane};
use crate::error::{EngineError, Reason, Result};
use crate::vector::{Vec3, norm};
use crate::work::Work;

/// How handles are opened and surfaces divided.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum PartitionStrategy {
    /// The strategy with the fewest patches that satisfies the conditions; pieces of genus 0 always go by `Multilevel`. Strategies
    /// that topology rules out, or that could save next to nothing, are not tried.
    #[default]
    Auto,
    /// Recursive cuts of the dual graph until every part has genus 0 (P2 section 4).
    Multilevel,
    /// Short handle loops are found (P3 algorithms 1 and 2), and every piece with handles is cut in two pieces of genus 0 such that
    /// each loop has one on either side. These are divided further where size or aspect ratio ask for it.
    Handles,
    /// Cut by a plane (P3 section 5, the brake block), then as `Multilevel`: parts that still have handles, or are too large or too
    /// slender, are divided further.
    Plane {
        /// The plane. `None` tries planes through the centre and the middle, normal to the principal axes and to the coordinate axes,
        /// and takes the one that leaves the fewest handles in the fewest parts. Parts are not merged across a given plane.
        plane: Option<Plane>,
    },
}

/// A plane in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point on it.
    pub point: Vec3,
    /// Its normal; any length but 0.
    pub normal: Vec3,
}

/// What is done to the borders between patches that are not features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BorderSmoothing {
    /// Faces change patches one at a time where that straightens a border.
    #[default]
    Vote,
    /// Then every border is laid anew along the shortest edge path within a band around it.
    Shortest,
}

/// Of the patches of the multilevel partition, the share that another strategy must be able to save to be tried.
const WORTH_TRYING: f64 = 0.1;

/// Partitions by the strategy of `spec`.
pub(super) fn partition_by(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    const ASKED: &str = "asked for";
    match &spec.strategy {
        PartitionStrategy::Auto => automatic(surface, spec, work),
        PartitionStrategy::Multilevel => Ok(told(multilevel(surface, spec, work)?, PartitionStrategy::Multilevel, ASKED)),
        PartitionStrategy::Handles => Ok(told(handles::by_handles(surface, spec, work)?, PartitionStrategy::Handles, ASKED)),
        PartitionStrategy::Plane { plane: Some(plane) } => {
            check_plane(plane)?;
            let strategy = PartitionStrategy::Plane { plane: Some(*plane) };
            Ok(told(plane::by_given_plane(surface, *plane, spec, work)?, strategy, ASKED))
        }
        PartitionStrategy::Plane { plane: None } => {
            let found = plane::find_plane(surface, work)?;
            let reason = format!("asked for; the plane leaves {} handles in {} parts", found.handles, found.parts);
            let strategy = PartitionStrategy::Plane { plane: Some(found.plane) };
            Ok(told(plane::by_found_plane(surface, found.plane, spec, work)?, strategy, &reason))
        }
    }
}

fn told(partition: Partition, strategy: PartitionStrategy, reason: &str) -> Partition {
    Partition { strategy, reason: reason.to_string(), ..partition }
}

fn check_plane(plane: &Plane) -> Result<()> {
    let length = norm(plane.normal);
    if !(length > 0.0 && length.is_finite() && plane.point.iter().all(|x| x.is_finite())) {
        return Err(EngineError::new(Reason::BadParameter, "the plane needs a finite point and a normal of finite length, not 0")
            .with_metadata("field", "strategy.plane"));
    }
    Ok(())
}

/// The strategy with the fewest patches; of equals the first of multilevel, plane, handles.
fn automatic(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let (handles, least) = outlook(surface, spec);
    let first = multilevel(surface, spec, work)?;
    if handles == 0 {
        return Ok(told(first, PartitionStrategy::Multilevel, "no piece of the surface between features has a handle"));
    }
    let count = first.patches.len();
    if f64::from(least) > (1.0 - WORTH_TRYING) * count as f64 {
        let reason = format!("{count} patches; with these limits no strategy can do with fewer than {least}");
        return Ok(told(first, PartitionStrategy::Multilevel, &reason));
    }
    let mut tried = vec![(first, PartitionStrategy::Multilevel, "multilevel")];
    let found = plane::find_plane(surface, work)?;
    let planar = found.handles == 0;
    if planar {
        let partition = plane::by_found_plane(surface, found.plane, spec, work)?;
        tried.push((partition, PartitionStrategy::Plane { plane: Some(found.plane) }, "plane"));
    }
    let enough = f64::from(least) > (1.0 - WORTH_TRYING) * tried.iter().map(|t| t.0.patches.len()).min().unwrap_or(0) as f64;
    if !enough {
        tried.push((handles::by_handles(surface, spec, work)?, PartitionStrategy::Handles, "handles"));
    }
    let counts: Vec<String> = tried.iter().map(|(p, _, name)| format!("{name} {}", p.patches.len())).collect();
    let mut reason = format!("fewest patches of {} ({handles} handles, at least {least} patches by size", counts.join(", "));
    if !planar {
        reason.push_str(&format!("; the best plane leaves {} handles", found.handles));
    }
    reason.push(')');
    // The first of equals.
    let best = tried.into_iter().min_by_key(|(p, ..)| p.patches.len());
    match best {
        Some((partition, strategy, _)) => Ok(told(partition, strategy, &reason)),
        None => Err(EngineError::invariant("no strategy was tried")),
    }
}

/// Handles of all pieces between features, and a number of patches that no strategy can go below. O(F).
fn outlook(surface: &Surface<'_>, spec: &PartitionSpec) -> (u64, u32) {
    let limits = Limits::new(spec);
    let mut scratch = Scratch::new(surface.topology);
    let groups = face_groups(surface);
    let mut label = vec![0u32; surface.topology.face_count()];
    for (p, group) in groups.iter().enumerate() {
        group.iter().for_each(|&f| label[f as usize] = p as u32);
    }
    let (mut handles, mut least) = (0, 0);
    for (p, group) in groups.iter().enumerate() {
        let piece = measure(surface, &label, group, p as u32, &mut scratch);
        let genus = piece.genus().max(0) as u64;
        handles += genus;
        let shape = if genus > 0 || piece.loops == 0 { 2 } else { 1 };
        least += (group.len() as u32).div_ceil(limits.faces).max(shape);
    }
    (handles, least.max(spec.patches.unwrap_or(0)))
}
