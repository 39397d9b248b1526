//! The gRPC service of remeshd over the engine: conversion, limits, scheduling, streaming, shutdown.
//!
//! [`serve`] listens on a socket; [`in_process`] is the same service on a private pipe for a program that wants no daemon.
//! Tokio only moves bytes: computation runs on blocking threads under permits ([`dispatch`]). Only [`convert`] sees both engine and
//! wire types, only [`status`] makes a `tonic::Status`.

pub mod config;
pub mod health;

mod answers;
mod caller;
mod convert;
mod desk;
mod dispatch;
mod feed;
mod guarded;
mod jobs;
mod keep;
mod metrics;
mod operations;
mod progress;
pub mod security;
mod serve;
mod service;
mod state;
mod status;
mod stream;
mod trace_context;
mod undecoded;

pub use config::{Clock, Keeping, ServerConfig};
pub use remesh_store::StoreError;
pub use security::{Security, SecurityFiles};
pub use serve::{ServeError, in_process, serve, serve_with_metrics};
