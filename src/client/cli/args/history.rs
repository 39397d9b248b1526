//! The options of `remesh undo`, `redo` and `watch`.

use super::SessionName;
use clap::{Args, Subcommand};

/// Verbs on the history of a session.
#[derive(Debug, Subcommand)]
pub(crate) enum HistoryVerb {
    /// Take the last change of a session back
    Undo(StepArgs),
    /// Take the last undo back
    Redo(StepArgs),
    /// Tell what happens to a session, line by line, until it ends (or Ctrl-C)
    Watch(WatchArgs),
}

#[derive(Debug, Args)]
pub(crate) struct StepArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Only if the session is at this revision
    #[arg(long, value_name = "REVISION")]
    pub(crate) base: Option<u64>,
}

#[derive(Debug, Args)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(crate) session: SessionName,
    /// Begin after this revision was made; 0: with the oldest event that is kept [default: now]
    #[arg(long, value_name = "REVISION", conflicts_with = "after_event")]
    pub(crate) after_revision: Option<u64>,
    /// Begin after the event with this number
    #[arg(long, value_name = "N")]
    pub(crate) after_event: Option<u64>,
    /// Leave out what stages do
    #[arg(long)]
    pub(crate) no_stages: bool,
    /// End after so many events
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
}
