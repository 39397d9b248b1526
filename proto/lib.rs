//! The wire types of remeshd: package `remesh.v1`, generated from `proto/remesh/v1/*.proto` and committed.
//! The comments of the `.proto` files are the API reference. After an edit run
//! `REMESH_BLESS=1 cargo test --release -p remesh-proto`, which rewrites `proto/generated`.

/// Package `remesh.v1`: messages, clients and servers.
pub mod v1 {
    #![allow(missing_docs, unreachable_pub, clippy::all, rustdoc::all)]
    include!("generated/remesh.v1.rs");
}

/// The compiled `.proto` files with all they import, for server reflection (`google.protobuf.FileDescriptorSet`).
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!("generated/descriptor.bin");

/// The domain of `google.rpc.ErrorInfo` in every error of the daemon.
pub const ERROR_DOMAIN: &str = "remeshd.dev";

/// Type URL of [`v1::GeometryLocations`] as a detail of an error status.
pub const GEOMETRY_LOCATIONS_TYPE_URL: &str = "type.googleapis.com/remesh.v1.GeometryLocations";
