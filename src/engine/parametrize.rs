//! Charts: maps of a patch to the plane. Spectral conformal first (P1 section 4), then LSCM, then mean value on a disk when a
//! check finds flips or overlap (P1 section 8).

mod assembly;
mod conformal;
mod domain;
mod ears;
mod faces;
mod mean_value;
mod mend;
mod outcome;
mod place;
mod spec;
mod validity;

pub use faces::face_distortion;
pub use outcome::{Chart, ChartAttempt, ChartOutcome, Distortion, FaceDistortion, Filling, HoleFilling, Spread};
pub use spec::{Boundary, BoundaryShape, ChartMethod, ChartSpec, Holes, MAX_CORNERS, MAX_PINS, OuterLoop, Pin, Pins, Spacing};

use crate::error::{Element, EngineError, ErrorKind, Location, Reason, Result};
use crate::patch::Patch;
use crate::vector::{Vec2, distance};
use crate::work::Work;
use conformal::{Conformal, as_points};
use domain::{Domain, Filling as Virtual};
use place::{FaceShapes, chart_areas, distortion, place};
use validity::{boundary_overlaps, scale_variation};

/// Largest over smallest local length scale of a usable chart. Conformal maps shrink a tube by e per radius of length: a tube of
/// 3.5 diameters reaches this (P2 section 3 splits at such aspect ratios, too), and past it the planar mesher runs out of room.
pub const MAX_SCALE_VARIATION: f64 = 1e3;

/// A factorization of the conformal operator of a patch, reusable by every conformal map of it.
#[derive(Debug)]
pub struct ConformalFactor {
    conformal: Conformal,
}

impl ConformalFactor {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.conformal.bytes()
    }
}

/// Assembles and factorizes the conformal energy E_D - A of a patch (P1 eq. 17, 22) as one complex Hermitian matrix.
/// Cancellation is seen between assembly and factorization only.
///
/// # Errors
/// [`Reason::SolverSingular`] if a pivot is not positive or the residual check fails (the chart stage then falls back to mean
/// value); [`Reason::LimitReached`] if the factor does not fit into memory; cancellation; broken invariants of the patch.
pub fn factor_conformal(patch: &Patch, work: &Work<'_>) -> Result<ConformalFactor> {
    Ok(ConformalFactor { conformal: Conformal::new(&Domain::new(patch, Virtual::Open)?, work)? })
}

/// Computes and checks the chart of a patch. `factor` is `Err` if the factorization failed.
///
/// Signs are exact, so a chart that is returned is one-to-one. Few flipped faces are mended first (P1 section 5). A patch with
/// several loops is mapped with free inner loops first, then with its holes closed virtually (P1 section 8), and a boundary that
/// runs into itself is held open by virtual triangles over its notches; each costs another factorization. A chart whose length scale varies by more than [`MAX_SCALE_VARIATION`] is not taken; if nothing else is wrong
/// with it the outcome is [`ChartOutcome::MustSplit`], also for an explicit method: the pieces can have it.
///
/// # Errors
/// [`Reason::ChartFailed`] if an explicitly requested method gives no bijective chart, with the flipped faces (patch-local ids);
/// cancellation; broken invariants of the patch.
pub fn parametrize_patch(
    patch: &Patch,
    factor: std::result::Result<&ConformalFactor, &EngineError>,
    spec: &ChartSpec,
    work: &Work<'_>,
) -> Result<ChartOutcome> {
    let mut maps = Maps::new(patch, factor)?;
    let shapes = FaceShapes::of(&maps.open);
    let (mut attempts, mut worst, mut crowded) = (Vec::new(), Vec::new(), None);
    for candidate in candidates(&maps.open, spec) {
        work.check()?;
        // No map of a tube is even: once one is one-to-one and merely crowded, only caps can better it.
        if crowded.is_some() && !matches!(candidate, Candidate::Spectral(Virtual::Caps) | Candidate::Pinned(Virtual::Caps, ..)) {
            continue;
        }
        let trial = match maps.compute(candidate, work) {
            Ok(uv) => examine(&maps.open, &shapes, candidate.method(), uv, work)?,
            Err(e) if stops(&e) => return Err(e),
            Err(e) => Trial::rejected(candidate.method(), e.message()),
        };
        match trial.verdict {
            Verdict::Usable(uv, distortion) => {
                attempts.push(trial.attempt);
                return Ok(ChartOutcome::Mapped(Chart { uv, method: candidate.method(), attempts, distortion }));
            }
            Verdict::Crowded => crowded = Some(trial.attempt.rejected.clone()),
            Verdict::NotBijective(faces) => worst = faces,
        }
        attempts.push(trial.attempt);
    }
    if let Some(reason) = crowded {
        return Ok(ChartOutcome::MustSplit { attempts, reason });
    }
    let tried: Vec<String> = attempts.iter().map(|a| format!("{:?}: {}", a.method, a.rejected)).collect();
    let reason = format!("no chart is one-to-one ({})", tried.join("; "));
    match spec.method {
        None => Ok(ChartOutcome::MustSplit { attempts, reason }),
        Some(method) => Err(EngineError::new(Reason::ChartFailed, format!("the requested method {method:?} fails: {reason}"))
            .with_hint("let the method be chosen automatically, or split the patch")
            .with_locations(worst.into_iter().map(|f| face_location(patch, f)))),
    }
}

/// A map to try.
#[derive(Debug, Clone, Copy)]
enum Candidate {
    Spectral(Virtual),
    Pinned(Virtual, u32, u32),
    MeanValue,
}

impl Candidate {
    fn method(self) -> ChartMethod {
        match self {
            Candidate::Spectral(_) => ChartMethod::SpectralConformal,
            Candidate::Pinned(..) => ChartMethod::LeastSquaresConformal,
            Candidate::MeanValue => ChartMethod::MeanValue,
        }
    }
}

/// The maps to try, in the order of P1 figure 23. LSCM has two choices of pins (P1 section 5): the boundary vertices farthest
/// apart, and a vertex with the one half around the boundary from it. Each map is tried on the bare patch first, then with
/// virtual triangles; every filling costs one more factorization.
fn candidates(domain: &Domain<'_>, spec: &ChartSpec) -> Vec<Candidate> {
    let ring = &domain.outer;
    let (p, q) = farthest_pair(domain, ring);
    let opposite = (p + half_way(domain, p)) % ring.len();
    let fillings = match domain.patch.loops.len() {
        1 => &[Virtual::Open, Virtual::Ears][..],
        _ => &[Virtual::Open, Virtual::Caps, Virtual::Ears, Virtual::CapsAndEars],
    };
    let mut all: Vec<Candidate> = fillings.iter().map(|&f| Candidate::Spectral(f)).collect();
    all.push(Candidate::Pinned(Virtual::Open, ring[p], ring[q]));
    if opposite != q && opposite != p {
        all.push(Candidate::Pinned(Virtual::Open, ring[p], ring[opposite]));
    }
    all.extend(fillings[1..].iter().map(|&f| Candidate::Pinned(f, ring[p], ring[q])));
    all.push(Candidate::MeanValue);
    match spec.method {
        None => all,
        Some(method) => all.into_iter().filter(|c| c.method() == method).collect(),
    }
}

/// The operators on a patch; those with virtual triangles are made when they are needed.
struct Maps<'a> {
    open: Domain<'a>,
    factor: std::result::Result<&'a Conformal, &'a EngineError>,
    filled: Vec<(Virtual, Result<Conformal>)>,
}

impl<'a> Maps<'a> {
    fn new(patch: &'a Patch, factor: std::result::Result<&'a ConformalFactor, &'a EngineError>) -> Result<Self> {
        let open = Domain::new(patch, Virtual::Open)?;
        let factor = factor.map(|f| &f.conformal);
        if factor.is_ok_and(|c| c.size() != open.size()) {
            return Err(EngineError::invariant("the factor belongs to another patch"));
        }
        Ok(Maps { open, factor, filled: Vec::new() })
    }

    fn compute(&mut self, candidate: Candidate, work: &Work<'_>) -> Result<Vec<Vec2>> {
        let patch = self.open.patch;
        let count = patch.positions.len();
        match candidate {
            Candidate::Spectral(filling) => Ok(as_points(&self.conformal(filling, work)?.spectral(work)?.0, count)),
            Candidate::Pinned(filling, p, q) => Ok(as_points(&self.conformal(filling, work)?.pinned(p, q, work)?, count)),
            Candidate::MeanValue => mean_value::mean_value(&Domain::new(patch, Virtual::Caps)?, work),
        }
    }

    fn conformal(&mut self, filling: Virtual, work: &Work<'_>) -> Result<&Conformal> {
        if filling == Virtual::Open {
            return self.factor.map_err(Clone::clone);
        }
        let at = match self.filled.iter().position(|f| f.0 == filling) {
            Some(at) => at,
            None => {
                let made = Domain::new(self.open.patch, filling).and_then(|domain| Conformal::new(&domain, work));
                self.filled.push((filling, made));
                self.filled.len() - 1
            }
        };
        self.filled[at].1.as_ref().map_err(Clone::clone)
    }
}

/// Two places in `ring` far apart in space: farthest from the first, then back and forth until nothing grows.
fn farthest_pair(domain: &Domain<'_>, ring: &[u32]) -> (usize, usize) {
    let from = |k: usize| {
        let centre = domain.positions[ring[k] as usize];
        let far = |k: usize| distance(centre, domain.positions[ring[k] as usize]);
        (0..ring.len()).fold((0, -1.0), |best, k| if far(k) > best.1 { (k, far(k)) } else { best })
    };
    let (mut p, mut q, mut span) = (0, from(0).0, 0.0);
    for _ in 0..8 {
        let (next, length) = from(q);
        if length <= span {
            break;
        }
        (p, q, span) = (q, next, length);
    }
    if p == q { (0, 1) } else { (p, q) }
}

/// How many edges after vertex `p` of the outer loop half of its length is reached.
fn half_way(domain: &Domain<'_>, p: usize) -> usize {
    let lengths = domain.outer_lengths();
    let half = 0.5 * lengths.iter().sum::<f64>();
    let mut run = 0.0;
    (0..lengths.len())
        .take_while(|k| {
            run += lengths[(p + k) % lengths.len()];
            run <= half
        })
        .count()
        .max(1)
}

/// What the checks say of one map.
struct Trial {
    attempt: ChartAttempt,
    verdict: Verdict,
}

enum Verdict {
    Usable(Vec<Vec2>, Distortion),
    Crowded,
    NotBijective(Vec<u32>),
}

impl Trial {
    fn rejected(method: ChartMethod, why: &str) -> Trial {
        let attempt = ChartAttempt {
            method,
            filling: Filling::default(),
            pins: Vec::new(),
            flipped_before: 0,
            flipped: 0,
            overlaps: false,
            rejected: why.to_owned(),
        };
        Trial { attempt, verdict: Verdict::NotBijective(Vec::new()) }
    }
}

fn examine(domain: &Domain<'_>, shapes: &FaceShapes, method: ChartMethod, mut uv: Vec<Vec2>, work: &Work<'_>) -> Result<Trial> {
    let patch = domain.patch;
    let area: f64 = shapes.areas.iter().sum();
    let first = patch.loops[0][0];
    let mut flipped = Vec::new();
    // The second pass puts a mended chart back to size, which may round a hair-thin face flat again.
    for _ in 0..2 {
        if place(&patch.triangles, first, area, &mut uv).is_none() {
            return Ok(Trial::rejected(method, "the chart has no area"));
        }
        let before = validity::flipped_faces(&patch.triangles, &uv);
        flipped = if before.is_empty() { before } else { mend::mend_flips(patch, &mut uv, work)? };
    }
    let overlaps = boundary_overlaps(&patch.loops, &uv, work)?;
    let mut attempt = ChartAttempt {
        method,
        filling: Filling::default(),
        pins: Vec::new(),
        flipped_before: flipped.len() as u32,
        flipped: flipped.len() as u32,
        overlaps,
        rejected: String::new(),
    };
    if !flipped.is_empty() || overlaps {
        attempt.rejected = match (flipped.len(), overlaps) {
            (0, _) => "the boundary runs into itself".to_owned(),
            (n, false) => format!("{n} flipped faces"),
            (n, true) => format!("{n} flipped faces and the boundary runs into itself"),
        };
        return Ok(Trial { attempt, verdict: Verdict::NotBijective(flipped) });
    }
    let variation = scale_variation(&patch.triangles, &shapes.areas, &chart_areas(&patch.triangles, &uv), patch.positions.len());
    if variation > MAX_SCALE_VARIATION {
        attempt.rejected = format!("lengths are scaled by factors that differ {variation:.3e} times");
        return Ok(Trial { attempt, verdict: Verdict::Crowded });
    }
    let distortion = distortion(&patch.triangles, shapes, &uv);
    uv.iter_mut().flatten().for_each(|x| *x *= domain.unit);
    Ok(Trial { attempt, verdict: Verdict::Usable(uv, distortion) })
}

fn stops(e: &EngineError) -> bool {
    matches!(e.kind(), ErrorKind::Cancelled | ErrorKind::DeadlineExceeded | ErrorKind::Internal)
}

fn face_location(patch: &Patch, face: u32) -> Location {
    let corners = patch.triangles[face as usize].map(|v| patch.positions[v as usize]);
    let position = std::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
    Location { element: Element::Face, ids: vec![face], position }
}

#[cfg(test)]
mod tests;
