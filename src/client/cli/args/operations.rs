//! The options of `remesh operations`.

use super::SessionName;
use clap::{Args, Subcommand};

/// Verbs on work that outlives the call that started it.
#[derive(Debug, Subcommand)]
pub(crate) enum OperationVerb {
    /// Start a remesh (or with --quality a remesh and its measure) and go away
    Start(StartArgs),
    /// List the operations of a session: those that run and the last that ended
    List(SessionName),
    /// Tell how an operation stands
    Show(OperationName),
    /// Wait until an operation has ended; exit code as for the work itself
    Wait(OperationName),
    /// Stop an operation at its next checkpoint
    Cancel(OperationName),
    /// Tell the result of an operation that has ended; exit code as for the work itself
    Result(OperationName),
}

#[derive(Debug, Args)]
pub(crate) struct StartArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Measure the result, too
    #[arg(long)]
    pub(crate) quality: bool,
}

#[derive(Debug, Args)]
pub(crate) struct OperationName {
    /// Name of the operation, as `operations list` tells it
    #[arg(value_name = "sessions/ID/operations/N")]
    pub(crate) name: String,
}
