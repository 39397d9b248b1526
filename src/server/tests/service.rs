//! The service over a real socket on port 0 (and over the private pipe), one file per behaviour.

#[path = "service/harness.rs"]
mod harness;

#[path = "service/cancel.rs"]
mod cancel;
#[path = "service/charts.rs"]
mod charts;
#[path = "service/discovery.rs"]
mod discovery;
#[path = "service/edits.rs"]
mod edits;
#[path = "service/errors.rs"]
mod errors;
#[path = "service/files.rs"]
mod files;
#[path = "service/keeping.rs"]
mod keeping;
#[path = "service/lifecycle.rs"]
mod lifecycle;
#[path = "service/limits.rs"]
mod limits;
#[path = "service/meshers.rs"]
mod meshers;
#[path = "service/operations.rs"]
mod operations;
#[path = "service/patches.rs"]
mod patches;
#[path = "service/priority.rs"]
mod priority;
#[path = "service/security.rs"]
mod security;
#[path = "service/several.rs"]
mod several;
#[path = "service/sizes.rs"]
mod sizes;
#[path = "service/watch.rs"]
mod watch;
