//! The options of `remesh chart`, and those that say which chart is wanted, wherever they occur.

use super::values::{BoundaryCurve, ChartMethod, HoleChoice, OuterLoop, PinArg, PinChoice, SpacingChoice, boundary, outer_loop, pin};
use super::{ImportArgs, InputArgs, SessionName};
use clap::{ArgAction, Args, Subcommand};
use std::path::PathBuf;

/// Which chart is wanted of a patch. Vertices are those of the imported mesh, from 0.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Chart (vertices are those of the imported mesh, from 0)")]
pub(crate) struct ChartSpecArgs {
    /// Map to the plane; `auto` takes the first of spectral, lscm and mean-value that is bijective
    #[arg(long, value_name = "METHOD")]
    pub(crate) method: Option<ChartMethod>,
    /// What is done about inner loops while mapping
    #[arg(long, value_name = "HOW")]
    pub(crate) holes: Option<HoleChoice>,
    /// Loop that becomes the outer boundary: the longest, or the one through a vertex
    #[arg(long, value_name = "longest|VERTEX", value_parser = outer_loop)]
    pub(crate) outer: Option<OuterLoop>,
    /// Hold this vertex, at a point if one is given, as in 17 or 17:0.5,-2; may be repeated (lscm)
    #[arg(long = "pin", value_name = "V[:U,V]", value_parser = pin, action = ArgAction::Append, conflicts_with = "choice")]
    pub(crate) pins: Vec<PinArg>,
    /// Let pins be chosen (lscm)
    #[arg(id = "choice", long = "pins", value_name = "HOW")]
    pub(crate) choice: Option<PinChoice>,
    /// Curve for the outer loop: circle, ellipse:R, square, rectangle[:R], polygon:u,v;u,v;u,v, mean-plane (harmonic, mean-value,
    /// barycentric)
    #[arg(long, value_name = "CURVE", value_parser = boundary)]
    pub(crate) boundary: Option<BoundaryCurve>,
    /// Vertices of the outer loop, in its direction, that become the corners of the curve; repeated or as in 1,2,3,4
    #[arg(long = "corner", value_name = "V", value_delimiter = ',', action = ArgAction::Append, requires = "boundary")]
    pub(crate) corners: Vec<u32>,
    /// How vertices are spread along the curve
    #[arg(long, value_name = "HOW")]
    pub(crate) spacing: Option<SpacingChoice>,
    /// Vertex of the outer loop that goes to the start of the curve
    #[arg(long, value_name = "V", conflicts_with = "corners")]
    pub(crate) start: Option<u32>,
}

/// Where charts are written to.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct ChartOutput {
    /// Write each patch with its uv as DIR/patch-N.obj
    #[arg(long, short, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Write the one patch with its uv as this OBJ file
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    pub(crate) obj: Option<PathBuf>,
}

/// `remesh chart`: a verb on one patch, or the charts of a file or session.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct ChartArgs {
    #[command(subcommand)]
    pub(crate) verb: Option<ChartVerb>,
    #[command(flatten)]
    pub(crate) all: ChartAllArgs,
}

/// The charts of a file or session.
#[derive(Debug, Args)]
pub(crate) struct ChartAllArgs {
    /// A session, or a file (anything with a dot or a slash that is not `sessions/...`); a file needs no daemon
    #[arg(value_name = "SESSION|FILE", required = true)]
    pub(crate) target: Option<String>,
    /// Only this patch; may be repeated
    #[arg(long = "patch", value_name = "N", action = ArgAction::Append)]
    pub(crate) only: Vec<u32>,
    #[command(flatten)]
    pub(crate) output: ChartOutput,
    #[command(flatten)]
    pub(crate) spec: ChartSpecArgs,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
}

/// A patch of a session.
#[derive(Debug, Clone, Args)]
pub(crate) struct PatchOf {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Number of the patch, as `remesh chart SESSION` lists them
    #[arg(value_name = "PATCH")]
    pub(crate) patch: u32,
}

/// A spec for one patch of a session or for all that have none of their own.
#[derive(Debug, Clone, Args)]
pub(crate) struct PatchSpecArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Number of the patch
    #[arg(value_name = "PATCH")]
    pub(crate) patch: Option<u32>,
    #[command(flatten)]
    pub(crate) spec: ChartSpecArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum ChartVerb {
    /// Show the spec that a patch follows, and its chart
    Show {
        #[command(flatten)]
        at: PatchOf,
        #[command(flatten)]
        output: ChartOutput,
    },
    /// Change the chart spec of a patch (or, without PATCH, of all that have none of their own); what is not named stays
    Set(PatchSpecArgs),
    /// Let a patch follow the spec of the session again
    Reset(PatchOf),
    /// Show the chart a patch would have, changing nothing (exit code 1 if it could not be used)
    Preview {
        #[command(flatten)]
        at: PatchOf,
        #[command(flatten)]
        spec: ChartSpecArgs,
        #[command(flatten)]
        output: ChartOutput,
    },
    /// Tell what the charts, or the preview of one, would find in the cache and what they would compute
    Plan(PatchSpecArgs),
}
