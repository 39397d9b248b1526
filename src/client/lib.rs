//! Client of remeshd: a thin async library over the `remesh.v1` services, and (feature `cli`) the program `remesh`.
//!
//! [`Client`] has one method for each thing a program wants to do; requests and responses are the messages of
//! [`remesh_proto::v1`] (re-exported as [`v1`]), whose comments are the API reference. The library adds what the generated code
//! lacks: chunking of uploads and downloads, progress callbacks, arrays in plain structs and errors that say what and where.
//! It knows nothing of geometry and needs no engine.
//!
//! ```no_run
//! use remesh_client::{Client, Source, v1};
//!
//! # async fn example() -> Result<(), Box<dyn std::error::Error>> {
//! let client = Client::connect("http://127.0.0.1:50061").await?;
//! let session = client.create_session("bunny", None).await?;
//!
//! let blob = client.upload(std::fs::read("bunny.obj")?.into(), |_sent| {}).await?;
//! let imported = client.import(&session.name, Source::Blob(blob), v1::ImportOptions::default()).await?;
//! println!("{} faces", imported.mesh.unwrap_or_default().faces);
//!
//! let size = v1::SizeSpec { size: Some(v1::size_spec::Size::Uniform(1.2)) };
//! client.apply(&session.name, v1::change::Change::Size(size), None).await?;
//! let result = client.remesh(&session.name, &[], |progress| eprintln!("{:.0} %", 100.0 * progress.total_fraction)).await?;
//! println!("{} triangles", result.mesh.unwrap_or_default().faces);
//!
//! let request = v1::ExportMeshRequest { session: session.name.clone(), format: v1::MeshFormat::Stl.into(), ..Default::default() };
//! let file = client.export(request, |_received, _total| {}).await?;
//! std::fs::write("bunny-remeshed.stl", file.bytes)?;
//! client.delete_session(&session.name).await?;
//! # Ok(())
//! # }
//! ```
//!
//! Dropping the future of a call cancels it, on the daemon as well.

mod arrays;
mod calls;
mod charts;
mod connection;
mod credentials;
mod editing;
mod error;
mod history;
mod operations;
mod patches;
mod retry;
mod snapshot;
mod transfer;
mod upload;

#[cfg(feature = "cli")]
pub mod cli;

pub use arrays::{MeshColumns, MeshData, pack_f64, pack_u32};
pub use charts::{ChartData, ChartEdit, ChartPreview, FaceDistortion};
pub use connection::{Client, MAX_MESSAGE_BYTES, Transport};
pub use credentials::{Bearer, Credentials};
pub use editing::EditingSession;
pub use error::{CallError, ClientError, FieldError, Place, PlaceElement, Result};
pub use history::SessionEvents;
pub use remesh_proto::v1;
pub use retry::RetryPolicy;
pub use snapshot::SnapshotStream;
pub use tonic::transport::Channel;
pub use transfer::{Exported, Source};
pub use upload::CHUNK_BYTES;
