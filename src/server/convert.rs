//! The border between the wire and the engine: the only files that name types of both.

pub(crate) mod charts;
pub(crate) mod from_proto;
pub(crate) mod meshers;
mod metric;
pub(crate) mod patches;
pub(crate) mod sizes;
pub(crate) mod sources;
pub(crate) mod stored;
pub(crate) mod to_proto;
