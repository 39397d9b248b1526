//! The connection to a daemon and the generated stubs on it.

use crate::error::{ClientError, Result, root_cause};
use remesh_proto::v1;
use std::time::Duration;
use tonic::transport::{Channel, Endpoint};
use v1::capability_service_client::CapabilityServiceClient;
use v1::chart_service_client::ChartServiceClient;
use v1::mesh_service_client::MeshServiceClient;
use v1::partition_service_client::PartitionServiceClient;
use v1::quality_service_client::QualityServiceClient;
use v1::remesh_service_client::RemeshServiceClient;
use v1::session_service_client::SessionServiceClient;

/// Largest message this client accepts. Bulk data comes in chunks far below it; only the answer of a one-call remesh, which holds a
/// whole file, can be large.
pub const MAX_MESSAGE_BYTES: usize = 1 << 30;

const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
const KEEP_ALIVE: Duration = Duration::from_secs(30);
/// Room for a status with a hundred places in its details.
const MAX_HEADER_BYTES: u32 = 256 << 10;

/// A connection to a daemon. Cheap to clone; clones share the connection, and calls may run at the same time.
#[derive(Debug, Clone)]
pub struct Client {
    channel: Channel,
    endpoint: Option<String>,
}

impl Client {
    /// Connects to `http://host:port`, `unix:///path` or plain `host:port`.
    ///
    /// # Errors
    /// [`ClientError::BadEndpoint`], and [`ClientError::Unreachable`] if nobody answers within five seconds.
    pub async fn connect(endpoint: &str) -> Result<Self> {
        let url = if endpoint.contains("://") || endpoint.starts_with("unix:") { endpoint.into() } else { format!("http://{endpoint}") };
        let bad = |cause: String| ClientError::BadEndpoint { endpoint: endpoint.to_owned(), cause };
        if url.starts_with("https:") {
            return Err(bad("this client speaks plaintext only; use a proxy or a tunnel for TLS".into()));
        }
        let parsed = Endpoint::new(url).map_err(|error| bad(root_cause(&error)))?;
        let channel = parsed
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE)
            .http2_max_header_list_size(MAX_HEADER_BYTES)
            .tcp_nodelay(true)
            .connect()
            .await
            .map_err(|error| ClientError::Unreachable { endpoint: Some(endpoint.to_owned()), cause: root_cause(&error) })?;
        Ok(Client { channel, endpoint: Some(endpoint.to_owned()) })
    }

    /// Uses a channel that was made elsewhere, for example to a daemon in the same process.
    pub fn from_channel(channel: Channel) -> Self {
        Client { channel, endpoint: None }
    }

    /// What [`Client::connect`] was called with.
    pub fn endpoint(&self) -> Option<&str> {
        self.endpoint.as_deref()
    }

    /// The generated stub of the session service, for calls that have no method here.
    pub fn sessions(&self) -> SessionServiceClient<Channel> {
        SessionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the mesh service.
    pub fn meshes(&self) -> MeshServiceClient<Channel> {
        MeshServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the partition service.
    pub fn partitions(&self) -> PartitionServiceClient<Channel> {
        PartitionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the chart service.
    pub fn charts(&self) -> ChartServiceClient<Channel> {
        ChartServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the remesh service.
    pub fn remeshing(&self) -> RemeshServiceClient<Channel> {
        RemeshServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the quality service.
    pub fn qualities(&self) -> QualityServiceClient<Channel> {
        QualityServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the capability service.
    pub fn capability_service(&self) -> CapabilityServiceClient<Channel> {
        CapabilityServiceClient::new(self.channel.clone())
    }
}
