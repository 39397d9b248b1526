//! The command line of `remesh`, as clap sees it.

mod chart;
mod connect;
mod field;
mod history;
mod mesher;
mod operations;
mod patch;
mod values;

pub(crate) use chart::{ChartAllArgs, ChartArgs, ChartOutput, ChartSpecArgs, ChartVerb, PatchOf, PatchSpecArgs};
pub(crate) use field::FieldArg;
pub(crate) use history::{HistoryVerb, StepArgs, WatchArgs};
pub(crate) use mesher::{MesherArgs, MesherName, MetricArgs};
pub(crate) use operations::{OperationVerb, StartArgs};
pub(crate) use patch::{PartitionArgs, PatchArgs, PatchVerb};
#[cfg(test)]
pub(crate) use values::PinArg;
pub(crate) use values::{
    BorderChoice, BoundaryCurve, FitChoice, HoleChoice, LockChoice, OuterLoop, PartitionStrategy, PinChoice, PlaneArg, SpacingChoice,
    SplitChoice, names_session, session_name,
};
pub(crate) use values::{ChartMethod, ColourBy, Encoding, FeatureAngle, ObjRegions, ReadFormat, SampleName, Unit, Up};

use clap::{ArgAction, Args, Parser, Subcommand};
use std::path::PathBuf;
use std::time::Duration;
pub(crate) use values::{LimitArg, RegionListArg};
use values::{duration, feature_angle, limit, lock, not_negative, plane, positive, region_list};

const AFTER_HELP: &str = "\
Exit codes:
  0    done
  1    failed
  2    the command line is wrong
  3    the surface cannot be remeshed; the diagnosis says why and where
  4    the daemon cannot be reached
  130  interrupted (the work is cancelled, on the daemon too)

Environment:
  REMESH_ENDPOINT    daemon to use when --endpoint is not given, as in http://127.0.0.1:50061
  REMESH_TOKEN_FILE  and REMESH_TLS_CA, REMESH_TLS_CERT, REMESH_TLS_KEY, REMESH_TLS_DOMAIN: as the options of that name

Without an endpoint the work is done inside this process. The verbs that take a SESSION need a running daemon (`remeshd`),
because a session lives in it.";

/// Remeshes surface triangulations: poor triangles in, good triangles out, features and regions kept.
#[derive(Debug, Parser)]
#[command(name = "remesh", version, after_help = AFTER_HELP, max_term_width = 120, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) global: GlobalArgs,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Debug, Clone, Args)]
pub(crate) struct GlobalArgs {
    /// Daemon to use, as in http://127.0.0.1:50061
    #[arg(long, global = true, value_name = "URL")]
    pub(crate) endpoint: Option<String>,
    /// Print one JSON object on standard output instead of text
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// No progress bars, and no summary of what succeeded
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Threads that compute, when the work is done inside this process; default: all cores
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    #[command(flatten)]
    pub(crate) connect: connect::ConnectArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Remesh a file: the one command most people need
    Run(RunArgs),
    /// Measure a mesh: kappa, angles, tau, distance to the input, topology, self-intersections
    Quality(QualityArgs),
    /// Tell what is wrong with a surface, and where (exit code 3 if it cannot be remeshed)
    Diagnose(DiagnoseArgs),
    /// Write a generated, deliberately poor surface to try things on
    Sample(SampleArgs),
    /// Draw a surface, a chart or the quality histogram as PNG; needs no display
    Render(RenderArgs),
    /// Create, list, show and delete sessions of a daemon
    Session(SessionArgs),
    /// Read a file into a session
    Import(ImportCommand),
    /// Change inputs of a session; what is not named stays
    Set(SetArgs),
    /// Partition the surface of a session into patches
    Partition(PartitionArgs),
    /// Split and merge patches of a session, move faces between them
    Patch(PatchArgs),
    /// Map patches to the plane: of a session or a file, or one patch with conditions of its own
    Chart(ChartArgs),
    /// Remesh the surface of a session, or mesh some patches of it
    Remesh(PatchesArgs),
    /// Tell what a remesh would find in the cache and what it would compute
    Plan(SessionName),
    /// Write the result (or the input) of a session to a file
    Export(ExportArgs),
    /// Go back to the inputs of an earlier revision of a session
    Rollback(RollbackArgs),
    #[command(flatten)]
    History(HistoryVerb),
    /// Work that goes on without this program: start, list, show, wait, cancel, result
    #[command(subcommand)]
    Operations(OperationVerb),
    /// Tell version, limits and cache usage of the daemon
    Status,
}

#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// Surface to remesh: STL, OBJ, PLY, OFF, MSH (2.2, 4.1), glTF/GLB
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write; its extension tells the format (also .vtu, which carries patch, region and kappa of each face)
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Variant of the format: ascii, binary, or msh22 (MSH 2.2)
    #[arg(long)]
    pub(crate) encoding: Option<Encoding>,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    /// Also measure distances to the input and self-intersections
    #[arg(long)]
    pub(crate) quality: bool,
    /// Draw the histogram of kappa before and after
    #[arg(long, value_name = "PNG")]
    pub(crate) before_after: Option<PathBuf>,
}

/// Which edge lengths are wanted, in the unit of the mesh.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(
    next_help_heading = "Size (one of --size, --triangles, --sizes, or --min-size with --max-size and --growth-rate; and any --field)"
)]
pub(crate) struct SizeArgs {
    /// Edge length everywhere
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) size: Option<f64>,
    /// About this many triangles, of equal size
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) triangles: Option<u64>,
    /// Text file with one length for each vertex of the imported mesh, in order
    #[arg(long, value_name = "FILE")]
    pub(crate) sizes: Option<PathBuf>,
    /// Length at features and boundary; with --sizes a lower bound
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) min_size: Option<f64>,
    /// Largest length
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) max_size: Option<f64>,
    /// Largest ratio of the lengths of neighbouring elements, as in 1.2
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) growth_rate: Option<f64>,
    /// A field of smaller sizes, as in curvature:normal_angle=15; may be repeated, and the smallest size counts. Kinds: region, patch,
    /// vertex, curvature, proximity, thickness, centerline, box, sphere, cylinder, distance (see docs/sizes.md)
    #[arg(long = "field", value_name = "KIND:KEY=VALUE,...", value_parser = field::field, action = ArgAction::Append)]
    pub(crate) fields: Vec<FieldArg>,
}

/// How the file is read.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Reading")]
pub(crate) struct ImportArgs {
    /// Format of the file; default: found by its content
    #[arg(long, value_name = "FORMAT")]
    pub(crate) format: Option<ReadFormat>,
    /// Keep only this region (name or number); may be repeated
    #[arg(long, value_name = "NAME|ID", action = ArgAction::Append)]
    pub(crate) only_region: Vec<String>,
    /// Unit of the coordinates, for formats that do not tell it; never guessed
    #[arg(long, value_name = "UNIT")]
    pub(crate) unit: Option<Unit>,
    /// Join vertices closer than this share of the bounding box diagonal; default 0: only equal ones
    #[arg(long, value_name = "SHARE", value_parser = not_negative, allow_negative_numbers = true)]
    pub(crate) weld_tolerance: Option<f64>,
    /// What of an OBJ file becomes the regions
    #[arg(long, value_name = "WHAT")]
    pub(crate) obj_regions: Option<ObjRegions>,
}

/// Which charts all patches get. Apart from the other inputs since `--chart` names a patch in `render`.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct MethodArgs {
    /// Map of the patches to the plane [default: auto, the first of spectral, lscm and mean-value that is bijective]
    #[arg(id = "chart_method", long = "chart", value_name = "METHOD")]
    pub(crate) chart: Option<ChartMethod>,
}

/// The other inputs.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct InputArgs {
    /// Edges whose faces' normals differ by at least this many degrees are kept; `none` finds no edges by angle [default: 40]
    #[arg(long, value_name = "DEGREES|none", value_parser = feature_angle, allow_negative_numbers = true)]
    pub(crate) feature_angle: Option<FeatureAngle>,
    /// Drop chains of sharp edges shorter than this share of the bounding box diagonal [default: 0.02]
    #[arg(long, value_name = "SHARE", value_parser = not_negative, allow_negative_numbers = true)]
    pub(crate) min_chain: Option<f64>,
    /// Let borders between regions move by about half an element
    #[arg(long, conflicts_with = "keep_region_borders")]
    pub(crate) ignore_region_borders: bool,
    /// Keep borders between regions (the default)
    #[arg(long)]
    pub(crate) keep_region_borders: bool,
    /// Text file with two vertex numbers (from 0) on each line: edges that are kept whatever their angle
    #[arg(long, value_name = "FILE")]
    pub(crate) feature_edges: Option<PathBuf>,
    /// Parametrize these regions (numbers, as in 3,4,7) as one: no edge between them is kept; may be repeated; `none` forgets all lists
    #[arg(long = "compound", value_name = "ID,ID|none", value_parser = region_list, action = ArgAction::Append, allow_hyphen_values = true)]
    pub(crate) compounds: Vec<RegionListArg>,
    /// Parametrize regions as one that meet below this angle along (19/20 of) their common border
    #[arg(long, value_name = "DEGREES|none", value_parser = limit, allow_negative_numbers = true)]
    pub(crate) merge_angle: Option<LimitArg>,
    /// Parametrize regions thinner than this (2 area / border length) as one with the neighbour of most contact
    #[arg(long, value_name = "LENGTH|none", value_parser = limit, allow_negative_numbers = true)]
    pub(crate) merge_below_size: Option<LimitArg>,
    /// Wanted number of patches; more are made where topology or features ask for it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) patches: Option<u32>,
    /// Split patches until none has more faces than this [default: 12000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) max_patch_faces: Option<u32>,
    /// Bound on pi A / L^2 of a patch (A its area, L its longest border) [default: 4]
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) max_aspect_ratio: Option<f64>,
    /// How handles are opened and the surface is divided [default: auto, which compares them where they can differ]
    #[arg(long, value_name = "STRATEGY")]
    pub(crate) partition_strategy: Option<PartitionStrategy>,
    /// Point and normal of the plane of `--partition-strategy plane`; without it the best of a few planes is taken
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = plane, allow_negative_numbers = true, allow_hyphen_values = true)]
    pub(crate) plane: Option<PlaneArg>,
    /// What is done to the borders between patches [default: geodesic]
    #[arg(long, value_name = "HOW")]
    pub(crate) borders: Option<BorderChoice>,
    /// Boundary vertices that stay bit for bit, with the boundary edges between them: `none`, `boundary` (all), `loops:V,...` (all of the
    /// loops through these vertices) or `vertices:V,...` [default: none]
    #[arg(long, value_name = "WHAT", value_parser = lock)]
    pub(crate) lock: Option<LockChoice>,
    /// Rounds of optimisation across patch borders; 0 leaves the mesh as it was joined [default: 3]
    #[arg(long, value_name = "N")]
    pub(crate) rounds: Option<u32>,
    /// Chase triangles of lower kappa one by one afterwards [default: 0.77]
    #[arg(long, value_name = "KAPPA", value_parser = not_negative, allow_negative_numbers = true)]
    pub(crate) min_kappa: Option<f64>,
    /// What lies on the input: the faces, to both sides of it, or the vertices [default: faces]
    #[arg(long, value_name = "WHAT")]
    pub(crate) fit: Option<FitChoice>,
    #[command(flatten)]
    pub(crate) mesher: MesherArgs,
}

#[derive(Debug, Args)]
pub(crate) struct QualityArgs {
    /// Mesh to compare with
    #[arg(value_name = "INPUT", required_unless_present = "session", requires = "output")]
    pub(crate) input: Option<PathBuf>,
    /// Mesh to measure, from whatever tool
    #[arg(value_name = "OUTPUT")]
    pub(crate) output: Option<PathBuf>,
    /// Measure the result of this session instead of files
    #[arg(long, value_parser = session_name, conflicts_with_all = ["input", "output", "size", "ImportArgs"])]
    pub(crate) session: Option<String>,
    /// Wanted edge length, for tau
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) size: Option<f64>,
    /// Only elements and topology: no distances, no self-intersections
    #[arg(long)]
    pub(crate) elements_only: bool,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
}

#[derive(Debug, Args)]
pub(crate) struct DiagnoseArgs {
    /// Surface to look at
    #[arg(value_name = "FILE", required_unless_present = "session")]
    pub(crate) file: Option<PathBuf>,
    /// Look at the mesh of this session instead
    #[arg(long, value_parser = session_name, conflicts_with_all = ["file", "ImportArgs"])]
    pub(crate) session: Option<String>,
    /// Places to print for each kind of defect, at most 100
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) places: usize,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
}

#[derive(Debug, Args)]
pub(crate) struct SampleArgs {
    #[command(flatten)]
    pub(crate) sample: SampleSpecArgs,
    /// File to write; its extension tells the format
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Variant of the format
    #[arg(long)]
    pub(crate) encoding: Option<Encoding>,
}

/// Which surface to generate.
#[derive(Debug, Clone, Args)]
pub(crate) struct SampleSpecArgs {
    /// Surface to generate
    #[arg(value_name = "NAME")]
    pub(crate) name: SampleName,
    /// About how many triangles [default: 20000]
    #[arg(long, value_name = "N", conflicts_with = "resolution", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) triangles: Option<u64>,
    /// The same as a linear measure: about 2 N^2 triangles, as N by N squares have
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) resolution: Option<u64>,
    /// Handles (genus) of the pelvis, of the brake or of the lattice
    #[arg(long, value_name = "N")]
    pub(crate) genus: Option<u32>,
    /// Outlets of the artery
    #[arg(long, value_name = "N")]
    pub(crate) outlets: Option<u32>,
    /// Height over diameter of the tube
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) aspect_ratio: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// Surface to draw
    #[arg(value_name = "FILE", required_unless_present = "session")]
    pub(crate) file: Option<PathBuf>,
    /// Draw the surface of this session instead of a file
    #[arg(long, value_parser = session_name, conflicts_with_all = ["file", "SizeArgs", "ImportArgs", "InputArgs"])]
    pub(crate) session: Option<String>,
    /// PNG to write
    #[arg(long, short, value_name = "PNG")]
    pub(crate) output: PathBuf,
    /// What the colours tell
    #[arg(long, value_name = "WHAT", default_value = "patch")]
    pub(crate) by: ColourBy,
    /// Draw the edges of the triangles (a chart always has them)
    #[arg(long)]
    pub(crate) edges: bool,
    /// Draw the remeshed surface, not the input (of a file: needs a size)
    #[arg(long)]
    pub(crate) result: bool,
    /// Draw the chart of this patch in the plane, flipped faces in red; with chart options the one it would have
    #[arg(long, value_name = "PATCH", conflicts_with_all = ["result", "histogram"])]
    pub(crate) chart: Option<u32>,
    /// Draw the pattern of charts on the surface in space: of the patch of --chart, or of all
    #[arg(long, conflicts_with_all = ["result", "histogram"])]
    pub(crate) chart_on_surface: bool,
    /// Lay a checkerboard over the charts, with N fields along the longest side
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) checker: Option<u32>,
    /// Draw lines of constant u (blue) and constant v (orange), N of each along the longest side
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) iso: Option<u32>,
    #[command(flatten)]
    pub(crate) spec: ChartSpecArgs,
    /// Draw the histogram of kappa before and after remeshing (of a file: needs a size)
    #[arg(long, conflicts_with = "result")]
    pub(crate) histogram: bool,
    /// Which axis points up
    #[arg(long, value_name = "AXIS", default_value = "z")]
    pub(crate) up: Up,
    /// Direction to look from, around the axis that points up
    #[arg(long, value_name = "DEGREES", default_value_t = -50.0, allow_negative_numbers = true)]
    pub(crate) azimuth: f64,
    /// Direction to look from, above the horizon
    #[arg(long, value_name = "DEGREES", default_value_t = 28.0, allow_negative_numbers = true)]
    pub(crate) elevation: f64,
    /// Width of the picture
    #[arg(long, value_name = "PIXELS", default_value_t = 1200, value_parser = clap::value_parser!(u32).range(200..=8192))]
    pub(crate) width: u32,
    /// Height of the picture
    #[arg(long, value_name = "PIXELS", default_value_t = 900, value_parser = clap::value_parser!(u32).range(200..=8192))]
    pub(crate) height: u32,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
}

#[derive(Debug, Args)]
pub(crate) struct SessionArgs {
    #[command(subcommand)]
    pub(crate) verb: SessionVerb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum SessionVerb {
    /// Open an empty session and print its name
    Create {
        /// What to call it, for people
        #[arg(long, default_value = "")]
        name: String,
        /// How long it lives unused, as in 90s, 30m, 2h, 1d
        #[arg(long, value_parser = duration)]
        ttl: Option<Duration>,
    },
    /// List the sessions
    List,
    /// Show mesh and inputs of a session
    Show(SessionName),
    /// End a session
    Delete(SessionName),
    /// Write a session to one file: its inputs at all revisions that can be reached, and the files they rest on
    Snapshot {
        #[command(flatten)]
        session: SessionName,
        /// File to write
        #[arg(long, short, value_name = "OUT")]
        output: PathBuf,
    },
    /// Make a new session of such a file, and print its name
    Restore {
        /// File of a snapshot
        #[arg(value_name = "IN")]
        input: PathBuf,
        /// What to call it, for people [default: as in the file]
        #[arg(long, default_value = "")]
        name: String,
    },
    /// Set how long a session lives unused
    SetTtl {
        #[command(flatten)]
        session: SessionName,
        /// As in 90s, 30m, 2h, 1d
        #[arg(value_parser = duration)]
        ttl: Duration,
    },
}

/// A session.
#[derive(Debug, Clone, Args)]
pub(crate) struct SessionName {
    /// `sessions/ID`, or only the ID
    #[arg(value_name = "SESSION", value_parser = session_name)]
    pub(crate) session: String,
}

#[derive(Debug, Args)]
pub(crate) struct ImportCommand {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Surface to read
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
}

#[derive(Debug, Args)]
pub(crate) struct SetArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
}

#[derive(Debug, Args)]
pub(crate) struct PatchesArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Only this patch; may be repeated
    #[arg(long = "patch", value_name = "N", action = ArgAction::Append)]
    pub(crate) patches: Vec<u32>,
}

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// File to write; its extension tells the format
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Write the input, as imported, instead of the result
    #[arg(long)]
    pub(crate) input: bool,
    /// Variant of the format
    #[arg(long)]
    pub(crate) encoding: Option<Encoding>,
}

#[derive(Debug, Args)]
pub(crate) struct RollbackArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// The revision whose inputs are wanted back
    #[arg(value_name = "REVISION")]
    pub(crate) revision: u64,
}

#[cfg(test)]
mod tests;
