//! From a listener to a running server, and back to silence: routes, health, reflection, drain.

use crate::config::{MESSAGE_OVERHEAD_BYTES, ServerConfig};
use crate::guarded::guarded;
use crate::health;
use crate::metrics::serve_metrics;
use crate::security::TlsIncoming;
use crate::service::capability::Capabilities;
use crate::service::chart::ChartMaps;
use crate::service::mesh::Meshes;
use crate::service::operation::OperationsService;
use crate::service::partition::Partitions;
use crate::service::quality::Qualities;
use crate::service::remesh::Remeshes;
use crate::service::session::Sessions;
use crate::state::Shared;
use crate::status::status_of;
use crate::undecoded::Undecoded;
use hyper_util::rt::TokioIo;
use remesh_proto::FILE_DESCRIPTOR_SET;
use remesh_proto::v1::capability_service_server::CapabilityServiceServer;
use remesh_proto::v1::chart_service_server::ChartServiceServer;
use remesh_proto::v1::mesh_service_server::MeshServiceServer;
use remesh_proto::v1::operation_service_server::OperationServiceServer;
use remesh_proto::v1::partition_service_server::PartitionServiceServer;
use remesh_proto::v1::quality_service_server::QualityServiceServer;
use remesh_proto::v1::remesh_service_server::RemeshServiceServer;
use remesh_proto::v1::session_service_server::SessionServiceServer;
use remesh_store::StoreError;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::DuplexStream;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, watch};
use tokio_stream::wrappers::UnboundedReceiverStream;
use tonic::codegen::Service;
use tonic::codegen::http::Uri;
use tonic::service::interceptor::InterceptedService;
use tonic::service::{Interceptor, Routes};
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Endpoint, Server};
use tonic::{Request, Status};
use tonic_health::server::HealthReporter;

/// Why a server did not start or did not go on.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The transport failed.
    #[error("the transport failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The descriptors of the API could not be served.
    #[error("reflection is not possible: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The data folder could not be opened.
    #[error("the data folder cannot be opened: {0}")]
    Store(#[from] StoreError),
}

/// Time that cancelled calls have to say so before their connections are cut.
const LAST_WORDS: Duration = Duration::from_secs(2);
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(30);
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);
/// Calls on one connection at a time.
const MAX_STREAMS: u32 = 1024;
/// Headers of a call together; a JWT fits.
const MAX_HEADER_BYTES: u32 = 32 << 10;
/// Frames that are taken; those of uploads then come whole.
const MAX_FRAME_BYTES: u32 = 1 << 20;
/// Calls that a client took back before they were begun; a connection with more is cut.
const MAX_RESETS: usize = 64;
/// Bytes in flight on a private pipe.
const PIPE_BYTES: usize = 1 << 20;

/// Serves on `listener` until `shutdown` resolves: then health says NOT_SERVING, new calls are refused, running ones have
/// `config.grace` to end and are cancelled after it.
///
/// # Errors
/// [`ServeError`] if the transport fails or the data folder cannot be opened.
pub async fn serve(listener: TcpListener, config: ServerConfig, shutdown: impl Future<Output = ()>) -> Result<(), ServeError> {
    serve_with_metrics(listener, None, config, shutdown).await
}

/// The same, and tells numbers for Prometheus, liveness and readiness over HTTP on a socket of its own, which asks for no token.
///
/// # Errors
/// [`ServeError`] if the transport fails or the data folder cannot be opened.
pub async fn serve_with_metrics(
    listener: TcpListener,
    metrics: Option<TcpListener>,
    config: ServerConfig,
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServeError> {
    let shared = Shared::new(config)?;
    let metrics = metrics.map(|listener| tokio::spawn(serve_metrics(listener, shared.clone())));
    let security = shared.config.security.clone();
    let (health, routes) = routes(&shared, Reflection::On).await?;
    let sweeper = tokio::spawn(sweep(shared.clone()));
    let (drain, mut draining) = watch::channel(false);
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true)).with_keepalive(Some(KEEPALIVE_INTERVAL));
    let stopped = async move {
        // An error means that the sender is gone, which ends serving too.
        let _ = draining.wait_for(|&is| is).await;
    };
    let router = builder().add_routes(routes);
    let mut server: Pin<Box<dyn Future<Output = Result<(), tonic::transport::Error>> + Send>> = if security.is_encrypted() {
        Box::pin(router.serve_with_incoming_shutdown(guarded(&shared, TlsIncoming::new(incoming, security.clone())), stopped))
    } else {
        Box::pin(router.serve_with_incoming_shutdown(guarded(&shared, incoming), stopped))
    };
    let outcome = tokio::select! {
        ended = &mut server => ended.map_err(ServeError::from),
        () = shutdown => {
            tracing::info!(grace_seconds = shared.config.grace.as_secs_f64(), "shutting down");
            shared.pool.drain();
            shared.close_feeds();
            health::set_ready(&health, false).await;
            let _ = drain.send(true);
            wind_down(&shared, server.as_mut()).await
        }
    };
    sweeper.abort();
    shared.note_uses();
    metrics.iter().for_each(tokio::task::JoinHandle::abort);
    outcome
}

/// Waits for running calls, then cancels them, then gives up on them.
async fn wind_down(
    shared: &Shared,
    mut server: Pin<&mut (dyn Future<Output = Result<(), tonic::transport::Error>> + Send)>,
) -> Result<(), ServeError> {
    if let Ok(ended) = tokio::time::timeout(shared.config.grace, &mut server).await {
        return Ok(ended?);
    }
    let cancelled = shared.pool.cancel_all();
    tracing::warn!(cancelled, "calls did not end within the grace period");
    match tokio::time::timeout(LAST_WORDS, server).await {
        Ok(ended) => Ok(ended?),
        Err(_) => {
            tracing::warn!("connections are still open; they are cut");
            Ok(())
        }
    }
}

/// A server in this process that only the returned channel reaches: no port, no file. It ends when the last clone of the channel is
/// dropped. Must be called inside a Tokio runtime.
///
/// # Errors
/// [`ServeError::Store`] if there is a data folder and it cannot be opened.
pub async fn in_process(config: ServerConfig) -> Result<Channel, ServeError> {
    let shared = Shared::new(config)?;
    let (_health, routes) = routes(&shared, Reflection::Off).await?;
    let (connections, accepted) = mpsc::unbounded_channel::<std::io::Result<DuplexStream>>();
    tokio::spawn(async move {
        let sweeper = tokio::spawn(sweep(shared));
        let served = builder().add_routes(routes).serve_with_incoming(UnboundedReceiverStream::new(accepted)).await;
        if let Err(error) = served {
            tracing::error!(%error, "the private server failed");
        }
        sweeper.abort();
    });
    let endpoint = Endpoint::from_static("http://in-process.invalid");
    Ok(endpoint.connect_with_connector_lazy(PipeConnector { connections }))
}

fn builder() -> Server {
    Server::builder()
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
        .max_concurrent_streams(Some(MAX_STREAMS))
        .http2_max_header_list_size(Some(MAX_HEADER_BYTES))
        .max_frame_size(Some(MAX_FRAME_BYTES))
        .http2_max_pending_accept_reset_streams(Some(MAX_RESETS))
}

/// Opens pipes to the private server.
struct PipeConnector {
    connections: mpsc::UnboundedSender<std::io::Result<DuplexStream>>,
}

impl Service<Uri> for PipeConnector {
    type Response = TokioIo<DuplexStream>;
    type Error = std::io::Error;
    type Future = std::future::Ready<Result<Self::Response, Self::Error>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let (ours, theirs) = tokio::io::duplex(PIPE_BYTES);
        let sent = self.connections.send(Ok(theirs));
        std::future::ready(sent.map(|()| TokioIo::new(ours)).map_err(|_| std::io::ErrorKind::BrokenPipe.into()))
    }
}

/// What is done from time to time.
async fn sweep(shared: Arc<Shared>) {
    // Not at once: nothing has grown old yet.
    let every = |interval: Duration| {
        let interval = interval.max(Duration::from_millis(1));
        tokio::time::interval_at(tokio::time::Instant::now() + interval, interval)
    };
    let (mut sweeps, mut reloads) = (every(shared.config.sweep_interval), every(shared.config.reload_interval));
    loop {
        tokio::select! {
            _ = sweeps.tick() => {
                let shared = shared.clone();
                // The disk may be slow.
                let _ = tokio::task::spawn_blocking(move || shared.sweep()).await;
            }
            _ = reloads.tick() => shared.config.security.reload_if_changed(),
        }
    }
}

/// Puts the name of the caller into each request, or refuses it.
#[derive(Clone)]
struct Guard(Arc<Shared>);

impl Interceptor for Guard {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        match self.0.config.security.caller(&request) {
            Ok(caller) => {
                request.extensions_mut().insert(caller);
                Ok(request)
            }
            Err(fault) => {
                self.0.metrics.unauthenticated();
                let peer = request.remote_addr().map_or_else(String::new, |peer| peer.to_string());
                tracing::warn!(target: "audit", action = "refuse", peer, ?fault, "a call without a valid name");
                Err(status_of(&fault))
            }
        }
    }
}

/// Whether clients may ask for the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reflection {
    On,
    /// The client of this process was compiled with it; making it ready takes milliseconds.
    Off,
}

/// All services with their message limits, health, and reflection in both versions.
async fn routes(shared: &Arc<Shared>, offered: Reflection) -> Result<(HealthReporter, Routes), ServeError> {
    let usual = shared.config.max_message_bytes;
    // A response holds arrays of a bounded number of entries beside its chunks; a one-call message a whole file.
    let large = shared.config.max_inline_bytes.saturating_add(MESSAGE_OVERHEAD_BYTES);
    let (health, health_service) = tonic_health::server::health_reporter();
    let mut routes = Routes::builder();
    routes.add_service(health_service);
    macro_rules! add {
        ($server:ident, $service:expr, $limit:expr) => {{
            let service = $server::new($service).max_decoding_message_size($limit).max_encoding_message_size($limit);
            // Health and reflection are open to all: they tell nothing of sessions.
            routes.add_service(InterceptedService::new(Undecoded(service), Guard(shared.clone())));
        }};
    }
    add!(CapabilityServiceServer, Capabilities(shared.clone()), usual);
    add!(ChartServiceServer, ChartMaps(shared.clone()), usual);
    add!(MeshServiceServer, Meshes(shared.clone()), usual);
    add!(OperationServiceServer, OperationsService(shared.clone()), usual);
    add!(PartitionServiceServer, Partitions(shared.clone()), usual);
    add!(QualityServiceServer, Qualities(shared.clone()), usual);
    add!(RemeshServiceServer, Remeshes(shared.clone()), large);
    add!(SessionServiceServer, Sessions(shared.clone()), usual);
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(FILE_DESCRIPTOR_SET)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
            .register_encoded_file_descriptor_set(tonic_types::pb::FILE_DESCRIPTOR_SET)
    };
    if offered == Reflection::On {
        routes.add_service(reflection().build_v1()?);
        routes.add_service(reflection().build_v1alpha()?);
    }
    health::set_ready(&health, true).await;
    Ok((health, routes.routes()))
}
