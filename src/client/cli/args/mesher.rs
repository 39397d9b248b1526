//! Options of the planar mesher.

use super::values::positive;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Planar meshers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MesherName {
    Frontal,
    Delaunay,
    MeshAdapt,
    Anisotropic,
    /// Quadrangles and a few triangles
    Quads,
}

/// How charts are meshed.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Mesher")]
pub(crate) struct MesherArgs {
    /// How charts are meshed [default: frontal]
    #[arg(long, value_name = "MESHER")]
    pub(crate) mesher: Option<MesherName>,
    /// Least angle for `--mesher delaunay`, at most 33 [default: 28]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub(crate) min_angle: Option<f64>,
    /// With `--mesher quads`: no triangle is left, but in parts between curves that are too narrow; a warning tells of them
    #[arg(long)]
    pub(crate) all_quads: bool,
    #[command(flatten)]
    pub(crate) metric: MetricArgs,
}

/// What `--mesher anisotropic` follows; the size bounds it from above.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Metric of --mesher anisotropic (the size is its upper bound)")]
pub(crate) struct MetricArgs {
    /// Largest distance between the mesh and the surface
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) metric_deviation: Option<f64>,
    /// Largest angle between the normals at the ends of an edge [default: 20, if no deviation is given]
    #[arg(long, value_name = "DEGREES", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) metric_normal_angle: Option<f64>,
    /// Text file with six numbers for each vertex of the imported mesh, xx xy xz yy yz zz of its tensor, instead of curvature
    #[arg(long, value_name = "FILE", conflicts_with_all = ["metric_deviation", "metric_normal_angle"])]
    pub(crate) metric_file: Option<PathBuf>,
    /// Smallest length in any direction
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) metric_min_size: Option<f64>,
    /// Largest length in any direction
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) metric_max_size: Option<f64>,
    /// Largest ratio of the lengths in two directions at a point [default: 10]
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) max_stretch: Option<f64>,
    /// Largest ratio of the lengths of neighbouring elements; 1 grades not at all [default: 1.5]
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) metric_growth_rate: Option<f64>,
}
