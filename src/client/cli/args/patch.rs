//! The options of `remesh patch`, and of `remesh partition`.

use super::values::{PlaneArg, SplitChoice, plane};
use super::{PatchOf, SessionName};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// `remesh partition`.
#[derive(Debug, Args)]
pub(crate) struct PartitionArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// After the splits that charts ask for, by the numbers that all other commands use (always so if patches have been edited)
    #[arg(long)]
    pub(crate) with_charts: bool,
}

/// `remesh patch`.
#[derive(Debug, Args)]
pub(crate) struct PatchArgs {
    #[command(subcommand)]
    pub(crate) verb: PatchVerb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum PatchVerb {
    /// Cut a patch in two
    Split {
        #[command(flatten)]
        at: PatchOf,
        /// How it is cut [default: balanced]
        #[arg(long, value_name = "METHOD", conflicts_with = "plane")]
        by: Option<SplitChoice>,
        /// Cut by the plane through a point with a normal
        #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = plane, allow_negative_numbers = true, allow_hyphen_values = true)]
        plane: Option<PlaneArg>,
    },
    /// Make one patch of several that hang together
    Merge {
        #[command(flatten)]
        session: SessionName,
        /// Numbers of the patches, as `remesh chart SESSION` or `remesh partition SESSION --with-charts` lists them
        #[arg(value_name = "PATCH", required = true, num_args = 2..)]
        patches: Vec<u32>,
    },
    /// Move faces to a patch
    Reassign {
        #[command(flatten)]
        at: PatchOf,
        /// Faces of the imported mesh, from 0, as in 17,18,40
        #[arg(long, value_name = "F", value_delimiter = ',', required_unless_present = "faces_from")]
        faces: Vec<u32>,
        /// Text file with numbers of faces
        #[arg(long, value_name = "FILE", conflicts_with = "faces")]
        faces_from: Option<PathBuf>,
    },
    /// Take all edits of patches back (single ones: `remesh rollback`)
    Reset(SessionName),
}
