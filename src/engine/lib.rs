//! Geometry, numerics, stage graph and sessions of remeshd. No sockets, no async runtime, no protocol types.
//!
//! The pipeline, in order: [`import`] -> [`topology`] -> [`features`] -> [`partition`] -> [`cut`] -> [`curve`] and [`patch`] ->
//! [`parametrize`] -> [`sizing`] -> [`planar`] -> [`assemble`] -> [`optimize`] -> [`quality`].
//! Every step is a pure function over plain data; [`stage`] ties the functions to cache keys and [`session`] holds inputs.

pub mod error;
pub mod fingerprint;
pub mod matching;
pub mod parallel;
mod sparse;
pub mod vector;
pub mod work;

pub mod diagnose;
pub mod export;
pub mod import;
pub mod mesh;
pub mod repair;
pub mod sample;

pub mod bvh;
pub mod topology;

pub mod curve;
pub mod cut;
pub mod features;
pub mod lock;
pub mod partition;
pub mod patch;

pub mod curvature;

pub mod metric;
pub mod parametrize;
pub mod planar;
pub mod sizing;

pub mod assemble;
pub mod optimize;
pub mod quads;
pub mod quality;
pub mod regions;

pub mod engine;
pub mod pipeline;
pub mod session;
pub mod stage;

pub use error::{EngineError, Result};
