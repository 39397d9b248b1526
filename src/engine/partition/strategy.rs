//! The methods a surface can be partitioned by, and the choice between them.

use super::surface::Surface;
use super::{Partition, PartitionSpec, auto, cuts, handles, laplace, max_cut, multilevel, pants, plane};
use crate::error::{EngineError, Reason, Result};
use crate::vector::{Vec3, norm};
use crate::work::Work;

/// How handles are opened and surfaces divided.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PartitionStrategy {
    /// The engine chooses: the fewest patches, tried where handles or long parts let strategies differ; [`Partition::reason`] says what
    /// was compared.
    #[default]
    Auto,
    /// Recursive cuts of the dual graph until every part has genus 0 (P2 section 4), then borders are smoothed and patches merged
    /// where their union is still valid.
    Multilevel,
    /// Two-way cuts through the centres of harmonic maps at many scales (P2 section 3): few patches, long ones cut lengthwise.
    /// Surfaces with handles or without a border are cut by `Multilevel` first (P2 section 4). Its borders are laid along shortest
    /// paths in any case.
    Laplace,
    /// Two-way cuts by one line in one harmonic map (Alliez 2002; P2 section 3). For comparison; fails on long patches.
    MaxCut,
    /// Short handle loops are found (P3 algorithms 1 and 2), and every piece with handles is cut in two pieces of genus 0 such that
    /// each loop has one on either side. These are divided further where size or aspect ratio ask for it.
    Handles,
    /// Pants decomposition (P3 algorithms 1 and 2): short loops cut the surface into parts of genus 0 with three loops, `2 g - 2 + b` of them
    /// for genus g and b boundary loops; these are divided further where size or aspect ratio ask for it. Loops are laid along shortest
    /// paths. Spheres, discs and annuli without handles are cut by no loop.
    Pants,
    /// Cut by a plane (P3 section 5, the brake block). Parts that still have handles are opened as by `Handles`; parts that are too
    /// large or too slender are divided further.
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
    Vote,
    /// Then every border is laid anew along the shortest edge path within a band around it.
    Shortest,
    /// Then every border is shortened over the surface to a geodesic nearby, and input triangles are split along it; that is done by
    /// [`crate::cut`], the partition itself has the shortest edge paths.
    #[default]
    Geodesic,
}

/// Partitions by the strategy of `spec`.
pub(super) fn partition_by(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    const ASKED: &str = "asked for";
    match spec.strategy {
        PartitionStrategy::Auto => auto::automatic(surface, spec, work),
        PartitionStrategy::Multilevel => Ok(told(multilevel(surface, spec, work)?, PartitionStrategy::Multilevel, ASKED)),
        PartitionStrategy::Laplace => Ok(told(cuts::partition(surface, spec, laplace::cut, work)?, spec.strategy, ASKED)),
        PartitionStrategy::MaxCut => Ok(told(cuts::partition(surface, spec, max_cut::cut, work)?, spec.strategy, ASKED)),
        PartitionStrategy::Handles => Ok(told(handles::by_handles(surface, spec, work)?, PartitionStrategy::Handles, ASKED)),
        PartitionStrategy::Pants => Ok(told(pants::by_pants(surface, spec, work)?, PartitionStrategy::Pants, ASKED)),
        PartitionStrategy::Plane { plane: Some(plane) } => {
            check_plane(&plane)?;
            Ok(told(plane::by_given_plane(surface, plane, spec, work)?, spec.strategy, ASKED))
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

pub(super) fn check_plane(plane: &Plane) -> Result<()> {
    let length = norm(plane.normal);
    if !(length > 0.0 && length.is_finite() && plane.point.iter().all(|x| x.is_finite())) {
        return Err(EngineError::new(Reason::BadParameter, "the plane needs a finite point and a normal of finite length, not 0")
            .with_metadata("field", "strategy.plane"));
    }
    Ok(())
}
