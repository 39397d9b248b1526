//! The connection to a daemon and the generated stubs on it.

use crate::credentials::{Bearer, Credentials};
use crate::error::{ClientError, Result, root_cause};
use crate::retry::RetryPolicy;
use remesh_proto::v1;
use std::time::Duration;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use v1::capability_service_client::CapabilityServiceClient;
use v1::chart_service_client::ChartServiceClient;
use v1::mesh_service_client::MeshServiceClient;
use v1::operation_service_client::OperationServiceClient;
use v1::partition_service_client::PartitionServiceClient;
use v1::quality_service_client::QualityServiceClient;
use v1::remesh_service_client::RemeshServiceClient;
use v1::session_service_client::SessionServiceClient;

/// Largest message this client accepts. Bulk data comes in chunks far below it; only the answer of a one-call remesh, which holds a
/// whole file, can be large.
pub const MAX_MESSAGE_BYTES: usize = 1 << 30;

const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
const KEEP_ALIVE: Duration = Duration::from_secs(30);
/// Bulk data comes in pieces of a megabyte; in small frames each of them would be put together from many.
const MAX_FRAME_BYTES: u32 = 1 << 20;
/// Room for a status with a hundred places in its details.
const MAX_HEADER_BYTES: u32 = 256 << 10;

/// What the stubs talk through: a channel that puts the token into each call.
pub type Transport = InterceptedService<Channel, Bearer>;

/// A connection to a daemon. Cheap to clone; clones share the connection, and calls may run at the same time.
#[derive(Debug, Clone)]
pub struct Client {
    channel: Transport,
    endpoint: Option<String>,
    retry: RetryPolicy,
}

impl Client {
    /// Connects to `http://host:port`, `unix:///path` or plain `host:port`, as nobody.
    ///
    /// # Errors
    /// [`ClientError::BadEndpoint`], and [`ClientError::Unreachable`] if nobody answers within five seconds.
    pub async fn connect(endpoint: &str) -> Result<Self> {
        Self::connect_with(endpoint, &Credentials::default()).await
    }

    /// The same with credentials, and to `https://host:port`.
    ///
    /// # Errors
    /// Those of [`Client::connect`]; [`ClientError::BadEndpoint`] also for `https` without authorities to trust, and for certificates
    /// without `https`.
    pub async fn connect_with(endpoint: &str, credentials: &Credentials) -> Result<Self> {
        let url = if endpoint.contains("://") || endpoint.starts_with("unix:") { endpoint.into() } else { format!("http://{endpoint}") };
        let bad = |cause: String| ClientError::BadEndpoint { endpoint: endpoint.to_owned(), cause };
        let is_tls = url.starts_with("https:");
        let mut parsed = Endpoint::new(url).map_err(|error| bad(root_cause(&error)))?;
        match credentials.tls() {
            Some(tls) if is_tls => parsed = parsed.tls_config(tls).map_err(|error| bad(root_cause(&error)))?,
            None if is_tls => return Err(bad("https needs the authorities to trust (--tls-ca)".into())),
            _ if credentials.need_tls() => return Err(bad("certificates are for https".into())),
            _ => {}
        }
        let bearer = credentials.bearer().map_err(bad)?;
        let channel = parsed
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE)
            .http2_max_header_list_size(MAX_HEADER_BYTES)
            .max_frame_size(MAX_FRAME_BYTES)
            .tcp_nodelay(true)
            .connect()
            .await
            .map_err(|error| ClientError::Unreachable { endpoint: Some(endpoint.to_owned()), cause: root_cause(&error) })?;
        Ok(Client { channel: InterceptedService::new(channel, bearer), endpoint: Some(endpoint.to_owned()), retry: RetryPolicy::default() })
    }

    /// Uses a channel that was made elsewhere, for example to a daemon in the same process.
    pub fn from_channel(channel: Channel) -> Self {
        Client { channel: InterceptedService::new(channel, Bearer::default()), endpoint: None, retry: RetryPolicy::default() }
    }

    /// The same connection with another policy for calls that fail.
    pub fn with_retry(mut self, policy: RetryPolicy) -> Self {
        self.retry = policy;
        self
    }

    /// How often and how late calls are tried again.
    pub fn retry_policy(&self) -> RetryPolicy {
        self.retry
    }

    /// What [`Client::connect`] was called with.
    pub fn endpoint(&self) -> Option<&str> {
        self.endpoint.as_deref()
    }

    /// The generated stub of the session service, for calls that have no method here.
    pub fn sessions(&self) -> SessionServiceClient<Transport> {
        SessionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the mesh service.
    pub fn meshes(&self) -> MeshServiceClient<Transport> {
        MeshServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the operation service.
    pub fn operations(&self) -> OperationServiceClient<Transport> {
        OperationServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the partition service.
    pub fn partitions(&self) -> PartitionServiceClient<Transport> {
        PartitionServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the chart service.
    pub fn charts(&self) -> ChartServiceClient<Transport> {
        ChartServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the remesh service.
    pub fn remeshing(&self) -> RemeshServiceClient<Transport> {
        RemeshServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the quality service.
    pub fn qualities(&self) -> QualityServiceClient<Transport> {
        QualityServiceClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// The generated stub of the capability service.
    pub fn capability_service(&self) -> CapabilityServiceClient<Transport> {
        CapabilityServiceClient::new(self.channel.clone())
    }
}
