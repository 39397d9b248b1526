//! The gRPC services. Each method begins a call, converts, hands the work to the pool and converts back.

pub(crate) mod capability;
pub(crate) mod chart;
pub(crate) mod mesh;
pub(crate) mod operation;
pub(crate) mod partition;
pub(crate) mod patch_chart;
pub(crate) mod patch_edit;
pub(crate) mod quality;
pub(crate) mod remesh;
pub(crate) mod session;
pub(crate) mod transfer;
pub(crate) mod upload;
