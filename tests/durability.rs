//! The real `remeshd` with a data folder: killed at any moment, without room, started again.
//!
//! `REMESH_KILLS=100 cargo test --release --test durability -- --nocapture` kills it as often as the issue asks; `REMESH_SEED` chooses the moments.

#[path = "durability/daemon.rs"]
mod daemon;
#[path = "durability/full.rs"]
mod full;
#[path = "durability/kill.rs"]
mod kill;
#[path = "common/daemon.rs"]
mod process;
#[path = "durability/restart.rs"]
mod restart;
#[path = "durability/upload.rs"]
mod upload;
