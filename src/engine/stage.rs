//! The stages, their keys and records, and the cache that holds their outputs.

pub mod cache;
pub mod cost;

pub use cache::{CacheUsage, StageCache, Stored};
pub use cost::{CostModel, Estimate};

use crate::fingerprint::{Feeder, Fingerprint};

/// A step of the pipeline whose output is cached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// File, arrays or sample to surface.
    Import,
    /// Adjacency and topological numbers.
    Topology,
    /// Search tree over the input surface.
    SearchTree,
    /// Feature edges and corners.
    Features,
    /// Faces to patches.
    Partition,
    /// Borders straightened and faces split along them.
    Cut,
    /// Patches cut out, curve network traced.
    Patches,
    /// Elimination order of a patch, from its connectivity.
    System,
    /// Elimination of the interior of a patch.
    Factor,
    /// Factorization on the loops of a patch, for one family of maps.
    Boundary,
    /// One map of a patch, solved and checked.
    Solve,
    /// Map of a patch to the plane.
    Chart,
    /// Principal curvatures at the input's vertices, for a size field.
    Curvature,
    /// Distances of facing sheets, for a size field.
    Proximity,
    /// Thickness of the body, for a size field.
    Thickness,
    /// Radius of vessels, for a size field.
    Centerline,
    /// Wanted edge length at the input's vertices.
    Size,
    /// Metric with directions of its own on the input.
    Metric,
    /// One-dimensional mesh of a curve.
    Curve,
    /// Planar mesh of a chart.
    Planar,
    /// Planar mesh lifted to space.
    Lift,
    /// The inside of a patch optimised in space.
    Interior,
    /// Patches joined.
    Assembly,
    /// Optimisation on the surface.
    Optimize,
    /// Quadrangles made of triangles.
    Quads,
    /// Quality report.
    Quality,
}

impl Stage {
    /// All stages in pipeline order.
    pub const ALL: [Stage; 26] = [
        Stage::Import,
        Stage::Topology,
        Stage::SearchTree,
        Stage::Features,
        Stage::Partition,
        Stage::Cut,
        Stage::Patches,
        Stage::System,
        Stage::Factor,
        Stage::Boundary,
        Stage::Solve,
        Stage::Chart,
        Stage::Curvature,
        Stage::Proximity,
        Stage::Thickness,
        Stage::Centerline,
        Stage::Size,
        Stage::Metric,
        Stage::Curve,
        Stage::Planar,
        Stage::Lift,
        Stage::Interior,
        Stage::Assembly,
        Stage::Optimize,
        Stage::Quads,
        Stage::Quality,
    ];

    /// Name in records, logs and metrics.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Import => "import",
            Stage::Topology => "topology",
            Stage::SearchTree => "search_tree",
            Stage::Features => "features",
            Stage::Partition => "partition",
            Stage::Cut => "cut",
            Stage::Patches => "patches",
            Stage::System => "system",
            Stage::Factor => "factor",
            Stage::Boundary => "boundary",
            Stage::Solve => "solve",
            Stage::Chart => "chart",
            Stage::Curvature => "curvature",
            Stage::Proximity => "proximity",
            Stage::Thickness => "thickness",
            Stage::Centerline => "centerline",
            Stage::Size => "size",
            Stage::Metric => "metric",
            Stage::Curve => "curve",
            Stage::Planar => "planar",
            Stage::Lift => "lift",
            Stage::Interior => "interior",
            Stage::Assembly => "assembly",
            Stage::Optimize => "optimize",
            Stage::Quads => "quads",
            Stage::Quality => "quality",
        }
    }

    /// Version of the algorithm; part of every key, so that a changed algorithm never finds an old output.
    fn version(self) -> u64 {
        match self {
            Stage::Optimize => 3,
            Stage::Partition | Stage::Size | Stage::Assembly | Stage::Interior | Stage::Quads => 2,
            _ => 1,
        }
    }
}

/// What a stage worked on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Subject {
    /// The whole surface.
    Surface,
    /// A patch of the current partition.
    Patch(u32),
    /// A curve of the current network.
    Curve(u32),
}

/// Key of a stage output: the stage, its algorithm version and the fingerprint of all that it depends on.
/// Holds contents only, never names or numbers of patches and curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StageKey {
    /// The stage.
    pub stage: Stage,
    /// Fingerprint of upstream outputs, canonical parameters and the algorithm version.
    pub input: Fingerprint,
}

impl StageKey {
    /// A key from what `feed` writes.
    pub fn new(stage: Stage, feed: impl FnOnce(&mut Feeder)) -> StageKey {
        let mut feeder = Feeder::new();
        feeder.text(stage.name()).u64(stage.version());
        feed(&mut feeder);
        StageKey { stage, input: feeder.finish() }
    }
}

/// How a stage output came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// It was in the cache, or somebody else was just computing it.
    Hit,
    /// It was computed now.
    Run,
}

/// What one stage did for one request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageRecord {
    /// The stage.
    pub stage: Stage,
    /// What it worked on.
    pub subject: Subject,
    /// Hit or run. In a plan: cached, or will run.
    pub outcome: Outcome,
    /// Wall time spent in this request, waiting included. In a plan 0 for hits, and for runs an estimate (see [`CostModel`]).
    pub milliseconds: f64,
    /// Size of the output in memory; in a plan an estimate for what will run.
    pub bytes: u64,
}
