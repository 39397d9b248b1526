//! The choice of a strategy: the one with the fewest patches that satisfy the conditions (P2 eq. 5), tried only where strategies can differ.

use super::depth::expected_charts;
use super::pants::fewest_pants;
use super::surface::{Limits, Piece, Scratch, Surface, measure};
use super::{Partition, PartitionSpec, PartitionStrategy, cuts, face_groups, handles, laplace, multilevel, plane};
use crate::error::{Reason, Result};
use crate::work::Work;

/// Trials cost time: they are made only if they could save more than this share of the patches.
const LEAST_GAIN: f64 = 0.25;

/// Partitions by `Multilevel`; where handles or long parts, rather than size, make the number of patches, by the strategies that
/// serve those until none can have fewer patches, and takes the fewest, of equal numbers what is expected to need fewer charts. The
/// reason names what was compared.
///
/// # Errors
/// Those of `Multilevel`; a trial that fails is named in the reason.
pub(super) fn automatic(surface: &Surface<'_>, spec: &PartitionSpec, work: &Work<'_>) -> Result<Partition> {
    let by_multilevel = |reason: &str, first| Ok(chosen(first, PartitionStrategy::Multilevel, reason.into()));
    if spec.patches.is_some() {
        return by_multilevel("the number of patches is given", multilevel(surface, spec, work)?);
    }
    let pieces = pieces(surface);
    let handles: i64 = pieces.iter().map(|p| p.genus().max(0)).sum();
    let long = pieces.iter().filter(|p| is_long(p, spec)).count();
    let least = pieces.iter().map(|p| least_patches(p, spec)).sum::<usize>();
    if handles == 0 && long == 0 {
        return by_multilevel("no piece of the surface between features has a handle or is long", multilevel(surface, spec, work)?);
    }
    let what = match (handles, long) {
        (0, 1) => "a long piece".to_owned(),
        (0, n) => format!("{n} long pieces"),
        (1, _) => "1 handle".to_owned(),
        (n, _) => format!("{n} handles"),
    };
    // Along loops first, where they alone ask for more than a patch a piece: of equal numbers its patches need the fewest charts. No other
    // trial is needed once none can have fewer patches.
    let along_loops = (handles > 0 && least <= 2 * pieces.len()).then(|| handles::by_handles(surface, spec, work));
    if let Some(Ok(trial)) = &along_loops
        && trial.patches.len() <= least
        && most_loops(trial) <= Limits::LOOPS
    {
        let reason = format!("the fewest patches for {what} (handles {least}, none can have fewer)");
        return Ok(chosen(trial.clone(), PartitionStrategy::Handles, reason));
    }
    let first = multilevel(surface, spec, work)?;
    let count = first.patches.len();
    let most_gain = |least: usize| (count.saturating_sub(least)) as f64 / count as f64;
    if most_gain(least) <= LEAST_GAIN {
        return by_multilevel(&format!("{count} patches, where none can do with fewer than {least} of the size allowed"), first);
    }
    let mut contest =
        Contest { surface, work, best: first, strategy: PartitionStrategy::Multilevel, told: vec![format!("multilevel {count}")] };
    let halved: usize = pieces.iter().map(|p| halvings(p, spec)).sum();
    if long > 0 && handles == 0 {
        if most_gain(halved) > LEAST_GAIN {
            contest.enter(PartitionStrategy::Laplace, "laplace", cuts::partition(surface, spec, laplace::cut, work))?;
        } else {
            contest.told.push(format!("laplace, which halves, about {halved}"));
        }
    }
    if handles > 0 {
        let along_loops = along_loops.unwrap_or_else(|| handles::by_handles(surface, spec, work));
        contest.enter(PartitionStrategy::Handles, "handles", along_loops)?;
        if contest.best.patches.len() > least {
            let found = plane::find_plane(surface, work)?;
            let by_plane = PartitionStrategy::Plane { plane: Some(found.plane) };
            contest.enter(by_plane, "plane", plane::by_found_plane(surface, found.plane, spec, work))?;
        }
        if contest.best.patches.len() > least {
            contest.enter(PartitionStrategy::Laplace, "laplace", cuts::partition(surface, spec, laplace::cut, work))?;
        }
        contest.told.push(format!("pants at least {}", fewest_pants(pieces.iter().map(|p| (p.genus(), p.loops)))));
    }
    if contest.best.patches.len() <= least {
        contest.told.push("none can have fewer".to_owned());
    }
    let reason = format!("the fewest patches for {what} ({})", contest.told.join(", "));
    Ok(chosen(contest.best, contest.strategy, reason))
}

/// Loops of the patch that has most of them.
fn most_loops(partition: &Partition) -> u32 {
    partition.patches.iter().map(|s| s.loops).max().unwrap_or(0)
}

/// The best partition so far and what is told of all.
struct Contest<'a> {
    surface: &'a Surface<'a>,
    work: &'a Work<'a>,
    best: Partition,
    strategy: PartitionStrategy,
    told: Vec<String>,
}

impl Contest<'_> {
    fn enter(&mut self, strategy: PartitionStrategy, name: &str, trial: Result<Partition>) -> Result<()> {
        let trial = match trial {
            Ok(trial) => trial,
            Err(error) if matches!(error.reason(), Reason::Cancelled | Reason::DeadlineExceeded) => return Err(error),
            Err(_) => {
                self.told.push(format!("{name} fails"));
                return Ok(());
            }
        };
        let loops = most_loops(&trial);
        if loops > Limits::LOOPS {
            self.told.push(format!("{name} {}, but with up to {loops} loops", trial.patches.len()));
            return Ok(());
        }
        self.told.push(format!("{name} {}", trial.patches.len()));
        let (count, least) = (trial.patches.len(), self.best.patches.len());
        let expected = |p: &Partition| expected_charts(self.surface, p, self.work);
        if count < least || count == least && expected(&trial)? < expected(&self.best)? {
            (self.best, self.strategy) = (trial, strategy);
        }
        Ok(())
    }
}

fn chosen(partition: Partition, strategy: PartitionStrategy, reason: String) -> Partition {
    Partition { strategy, reason, ..partition }
}

/// The pieces between features. O(F).
fn pieces(surface: &Surface<'_>) -> Vec<Piece> {
    let mut scratch = Scratch::new(surface.topology);
    let groups = face_groups(surface);
    let mut label = vec![0u32; surface.topology.face_count()];
    for (p, group) in groups.iter().enumerate() {
        group.iter().for_each(|&f| label[f as usize] = p as u32);
    }
    groups.iter().enumerate().map(|(p, group)| measure(surface, &label, group, p as u32, &mut scratch)).collect()
}

/// Genus 0, with a border, and of too large an aspect ratio.
fn is_long(piece: &Piece, spec: &PartitionSpec) -> bool {
    piece.genus() == 0 && piece.loops > 0 && piece.aspect_ratio() > spec.max_aspect_ratio
}

/// Fewest patches that a piece can become by its size and topology.
fn least_patches(piece: &Piece, spec: &PartitionSpec) -> usize {
    let by_size = (piece.faces as usize).div_ceil(spec.max_patch_faces as usize);
    let whole = piece.is_valid(&Limits { loops: u32::MAX, ..Limits::new(spec) });
    by_size.max(if whole { 1 } else { 2 })
}

/// Parts of a piece cut into halves until they are small enough.
fn halvings(piece: &Piece, spec: &PartitionSpec) -> usize {
    least_patches(piece, spec).next_power_of_two()
}
