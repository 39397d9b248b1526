//! Health by `grpc.health.v1`: liveness (the process answers) told apart from readiness (it takes calls), and the client side of it.

use crate::security::{Pinned, Security};
use hyper_util::rt::TokioIo;
use std::net::SocketAddr;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::ClientConfig;
use tokio_rustls::rustls::crypto::aws_lc_rs;
use tonic::codegen::Service;
use tonic::codegen::http::Uri;
use tonic::transport::Endpoint;
use tonic_health::ServingStatus;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus as Told;
use tonic_health::pb::health_client::HealthClient;
use tonic_health::server::HealthReporter;

/// Most of an answer over HTTP that is read.
const MAX_ANSWER_BYTES: u64 = 4096;

/// What can be asked for, by name of a service. The name `""` and those of the services of `remesh.v1` tell readiness too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Probed {
    /// The process answers.
    Liveness,
    /// It takes calls: not while it shuts down.
    Readiness,
}

impl Probed {
    /// Name in requests.
    pub fn name(self) -> &'static str {
        match self {
            Probed::Liveness => "liveness",
            Probed::Readiness => "readiness",
        }
    }
}

/// Names of all services, as health and reflection know them.
const SERVICES: [&str; 7] = [
    "remesh.v1.CapabilityService",
    "remesh.v1.ChartService",
    "remesh.v1.MeshService",
    "remesh.v1.PartitionService",
    "remesh.v1.QualityService",
    "remesh.v1.RemeshService",
    "remesh.v1.SessionService",
];

/// Tells that the server takes calls, or takes none any more. It is alive in both cases.
pub(crate) async fn set_ready(health: &HealthReporter, is_ready: bool) {
    let status = if is_ready { ServingStatus::Serving } else { ServingStatus::NotServing };
    for name in SERVICES.into_iter().chain(["", Probed::Readiness.name()]) {
        health.set_service_status(name, status).await;
    }
    health.set_service_status(Probed::Liveness.name(), ServingStatus::Serving).await;
}

/// Connects to a daemon that shows the certificate of its own file.
#[derive(Clone)]
struct PinnedConnector {
    address: SocketAddr,
    tls: TlsConnector,
}

impl PinnedConnector {
    fn new(certificate: &Path, address: SocketAddr) -> Result<Self, String> {
        let provider = Arc::new(aws_lc_rs::default_provider());
        let builder = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
        let builder = builder.map_err(|error| error.to_string())?.dangerous();
        let verifier = Arc::new(Pinned::of_file(certificate)?);
        let mut config = builder.with_custom_certificate_verifier(verifier).with_no_client_auth();
        config.alpn_protocols = vec![b"h2".to_vec()];
        Ok(PinnedConnector { address, tls: TlsConnector::from(Arc::new(config)) })
    }
}

impl Service<Uri> for PinnedConnector {
    type Response = TokioIo<TlsStream<TcpStream>>;
    type Error = std::io::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, Self::Error>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let PinnedConnector { address, tls } = self.clone();
        Box::pin(async move {
            let stream = TcpStream::connect(address).await?;
            Ok(TokioIo::new(tls.connect(address.ip().into(), stream).await?))
        })
    }
}

/// Asks on the port for metrics.
///
/// # Errors
/// What is wrong, in words.
pub async fn check_http(address: SocketAddr, service: Probed, timeout: Duration) -> Result<(), String> {
    let path = match service {
        Probed::Liveness => "/livez",
        Probed::Readiness => "/readyz",
    };
    let answer = async {
        let mut stream = TcpStream::connect(address).await.map_err(|_| "nobody answers".to_owned())?;
        let broken = |error: std::io::Error| format!("the connection broke: {error}");
        let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).await.map_err(broken)?;
        let mut text = Vec::new();
        stream.take(MAX_ANSWER_BYTES).read_to_end(&mut text).await.map_err(broken)?;
        let text = String::from_utf8_lossy(&text).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((text.as_str(), ""));
        if head.starts_with("HTTP/1.1 200 ") { Ok(()) } else { Err(format!("{}: {}", service.name(), body.trim())) }
    };
    tokio::time::timeout(timeout, answer).await.unwrap_or_else(|_| Err(format!("no answer within {} s", timeout.as_secs_f64())))
}

/// Asks a daemon with these settings whether it is well.
///
/// # Errors
/// What is wrong, in words.
pub async fn check(address: SocketAddr, security: &Security, service: Probed, timeout: Duration) -> Result<(), String> {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).map_err(|error| error.to_string())?;
    let tls = match security.certificate_file() {
        Some(_) if security.wants_certificates() => {
            return Err("clients must present a certificate, which this check has none of; set metrics_listen and it asks there".to_owned());
        }
        Some(path) => Some(PinnedConnector::new(path, address)?),
        None => None,
    };
    let answer = async {
        let endpoint = endpoint.connect_timeout(timeout);
        let connected = match tls {
            Some(connector) => endpoint.connect_with_connector(connector).await,
            None => endpoint.connect().await,
        };
        let channel = connected.map_err(|_| "nobody answers".to_owned())?;
        let request = HealthCheckRequest { service: service.name().to_owned() };
        HealthClient::new(channel).check(request).await.map_err(|status| status.message().to_owned())
    };
    let answer = tokio::time::timeout(timeout, answer).await.map_err(|_| format!("no answer within {} s", timeout.as_secs_f64()))?;
    match answer?.into_inner().status() {
        Told::Serving => Ok(()),
        Told::NotServing | Told::Unknown | Told::ServiceUnknown => Err(format!("{}: it does not serve", service.name())),
    }
}
