//! TLS: what a server shows and asks for, connections that have shaken hands, and a check of the server by its own certificate.

use super::{Security, about, read};
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::{Semaphore, mpsc};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use tokio_rustls::rustls::crypto::{CryptoProvider, aws_lc_rs, verify_tls12_signature, verify_tls13_signature};
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use tokio_rustls::rustls::server::WebPkiClientVerifier;
use tokio_rustls::rustls::{DigitallySignedStruct, Error, RootCertStore, ServerConfig, SignatureScheme};
use tokio_rustls::server::TlsStream;
use tokio_stream::{Stream, StreamExt};
use tonic::transport::server::TcpIncoming;

/// How long a client may take to shake hands.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Handshakes at a time; more connections wait in the queue of the system.
const MAX_HANDSHAKES: usize = 256;
/// Pause after a connection could not be accepted, for example for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, String> {
    let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&read(path)?).collect();
    let all = all.map_err(|error| about(path)(format!("is no PEM: {error}")))?;
    if all.is_empty() { Err(about(path)("holds no certificate".to_owned())) } else { Ok(all) }
}

/// What the server shows, and whose certificates it asks for.
pub(super) fn server_config(cert: &Path, key: &Path, client_ca: Option<&Path>) -> Result<ServerConfig, String> {
    let chain = certificates(cert)?;
    let private = PrivateKeyDer::from_pem_slice(&read(key)?).map_err(|error| about(key)(format!("holds no private key: {error}")))?;
    let provider = Arc::new(aws_lc_rs::default_provider());
    let builder = ServerConfig::builder_with_provider(provider.clone()).with_safe_default_protocol_versions();
    let builder = builder.map_err(|error| format!("TLS: {error}"))?;
    let builder = match client_ca {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for authority in certificates(path)? {
                roots.add(authority).map_err(|error| about(path)(error.to_string()))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build();
            builder.with_client_cert_verifier(verifier.map_err(|error| about(path)(error.to_string()))?)
        }
    };
    let mut config = builder.with_single_cert(chain, private).map_err(|error| about(cert)(error.to_string()))?;
    config.alpn_protocols = vec![b"h2".to_vec()];
    Ok(config)
}

/// Connections that have shaken hands. A client that is slow at it keeps nobody else waiting.
pub(crate) struct TlsIncoming(mpsc::Receiver<std::io::Result<TlsStream<TcpStream>>>);

impl TlsIncoming {
    /// Accepts until it is dropped. Each connection gets the certificates that hold when it comes.
    pub(crate) fn new(mut connections: TcpIncoming, security: Security) -> Self {
        let (sender, receiver) = mpsc::channel(16);
        let places = Arc::new(Semaphore::new(MAX_HANDSHAKES));
        tokio::spawn(async move {
            loop {
                let Ok(place) = places.clone().acquire_owned().await else { return };
                let next = tokio::select! {
                    next = connections.next() => next,
                    () = sender.closed() => return,
                };
                let (stream, config) = match (next, security.tls()) {
                    (Some(Ok(stream)), Some(config)) => (stream, config),
                    (Some(Err(error)), _) => {
                        tracing::warn!(%error, "a connection cannot be accepted");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                        continue;
                    }
                    (None, _) | (_, None) => return,
                };
                let sender = sender.clone();
                tokio::spawn(async move {
                    let _place = place;
                    let peer = stream.peer_addr().map_or_else(|_| String::new(), |peer| peer.to_string());
                    match tokio::time::timeout(HANDSHAKE, TlsAcceptor::from(config).accept(stream)).await {
                        Ok(Ok(stream)) => drop(sender.send(Ok(stream)).await),
                        Ok(Err(error)) => tracing::info!(target: "audit", action = "refuse", peer, %error, "no TLS handshake"),
                        Err(_) => tracing::info!(target: "audit", action = "refuse", peer, "the TLS handshake took too long"),
                    }
                });
            }
        });
        TlsIncoming(receiver)
    }
}

impl Stream for TlsIncoming {
    type Item = std::io::Result<TlsStream<TcpStream>>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.0.poll_recv(context)
    }
}

/// Takes one certificate only, whatever names it has: that of the daemon which is asked by its own binary.
#[derive(Debug)]
pub(crate) struct Pinned {
    leaf: CertificateDer<'static>,
    provider: CryptoProvider,
}

impl Pinned {
    /// Takes the first certificate of a file.
    pub(crate) fn of_file(path: &Path) -> Result<Self, String> {
        let leaf = certificates(path)?.swap_remove(0);
        Ok(Pinned { leaf, provider: aws_lc_rs::default_provider() })
    }
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if *end_entity == self.leaf { Ok(ServerCertVerified::assertion()) } else { Err(Error::General("another certificate".to_owned())) }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, cert, dss, &self.provider.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, cert, dss, &self.provider.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}
