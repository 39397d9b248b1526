//! The methods a surface can be partitioned by, and the choice between them.

use super::depth::expected_charts;
use super::surface::{Limits, Scratch, Surface, measure};
use super::{Partition, PartitionSpec, face_groups, handles, multilevel, plane};
use crate::error::{EngineError, Reason, Result};
use crate::vector::{Vec3, norm};
use crate::work::Work;

/// How handles are opened and surfaces divided.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum PartitionStrategy {
    /// The strategy with the fewest patches that satisfies the conditions; of equal numbers (or hardly more) the one whose patches are
    /// expected to need (far) fewer charts. A surface whose pieces between features have no handles goes by `Multilevel`. Strategies that topology rules out, or that could save
    /// next to nothing, are not tried.
    #[default]
    Auto,
    /// Recursive cuts of the dual graph until every part has genus 0 (P2 section 4).
    Multilevel,
    /// Short handle loops are found (P3 algorithms 1 and 2), and every piece with handles is cut in two pieces of genus 0 such that
    /// each loop has one on either side. These are divided further where size or aspect ratio ask for it.
    Handles,
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
    #[default]
    Vote,
    /// Then every border is laid anew along the shortest edge path within a band around it.
    Shortest,
}

/// A strategy is tried if it could save this share of the patches or charts.
const WORTH_TRYING: f64 = 0.1;

/// So many times the patches are taken for fewer charts ...
const HARDLY_MORE: f64 = 1.25;
/// ... if only this share of the charts is expected. Patches that cannot be mapped are split until they can, so fewer is not better then.
const FAR_FEWER: f64 = 0.5;
/// A plane that leaves more than this share of the handles is no use.
const HANDLES_LEFT: f64 = 0.25;

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

/// A partition with what it is judged by.
struct Trial {
    partition: Partition,
    strategy: PartitionStrategy,
    name: &'static str,
    /// Charts it is expected to need.
    charts: f64,
}

impl Trial {
    fn new(surface: &Surface<'_>, partition: Partition, strategy: PartitionStrategy, work: &Work<'_>) -> Result<Self> {
        let name = match strategy {
            PartitionStrategy::Handles => "handles",
            PartitionStrategy::Plane { .. } => "plane",
            PartitionStrategy::Auto | PartitionStrategy::Multilevel => "multilevel",
        };
        let charts = expected_charts(surface, &partition, work)?;
        Ok(Trial { partition, strategy, name, charts })
    }

    /// Fewer patches, of equal numbers fewer expected charts; or hardly more patches that are expected to need far fewer charts.
    fn is_better(&self, other: &Trial) -> bool {
        let [own, others] = [self, other].map(|t| t.partition.patches.len() as f64);
        let far_fewer = |a: &Trial, b: &Trial| a.charts < FAR_FEWER * b.charts;
        let hardly_more = |a: f64, b: f64| a > b && a <= HARDLY_MORE * b;
        if hardly_more(own, others) && far_fewer(self, other) {
            return true;
        }
        if hardly_more(others, own) && far_fewer(other, self) {
            return false;
        }
        (own, self.charts) < (others, other.charts)
    }

    /// Whether another strategy could save next to nothing.
    fn is_enough(&self, least: u32) -> bool {
        let count = self.partition.patches.len() as f64;
        f64::from(least) > (1.0 - WORTH_TRYING) * count && self.charts < (1.0 + WORTH_TRYING) * count
    }
}

/// The best of the strategies worth trying, see [`Trial::is_better`]; of equals the first of multilevel, plane, handles.
fn automatic(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let (handles, least) = outlook(surface, spec);
    let first = multilevel(surface, spec, work)?;
    if handles == 0 {
        return Ok(told(first, PartitionStrategy::Multilevel, "no piece of the surface between features has a handle"));
    }
    let first = Trial::new(surface, first, PartitionStrategy::Multilevel, work)?;
    if first.is_enough(least) {
        let reason = format!("{} patches; with these limits no strategy can do with fewer than {least}", first.partition.patches.len());
        return Ok(told(first.partition, first.strategy, &reason));
    }
    let mut trials = vec![first];
    let found = plane::find_plane(surface, work)?;
    let useful = found.handles as f64 <= HANDLES_LEFT * handles as f64;
    if useful {
        let partition = plane::by_found_plane(surface, found.plane, spec, work)?;
        trials.push(Trial::new(surface, partition, PartitionStrategy::Plane { plane: Some(found.plane) }, work)?);
    }
    if !trials.iter().any(|trial| trial.is_enough(least)) {
        let partition = handles::by_handles(surface, spec, work)?;
        trials.push(Trial::new(surface, partition, PartitionStrategy::Handles, work)?);
    }
    let counts: Vec<String> =
        trials.iter().map(|t| format!("{} {} (about {:.0} charts)", t.name, t.partition.patches.len(), t.charts)).collect();
    let mut reason = format!(
        "fewest patches, or far fewer charts with hardly more patches, of {}; {handles} handles, at least {least} patches",
        counts.join(", ")
    );
    if !useful {
        reason.push_str(&format!("; the best plane leaves {} handles", found.handles));
    }
    let best = trials.into_iter().reduce(|best, t| if t.is_better(&best) { t } else { best });
    let best = best.ok_or_else(|| EngineError::invariant("no strategy was tried"))?;
    Ok(told(best.partition, best.strategy, &reason))
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
