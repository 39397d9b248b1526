//! TLS, certificates of clients, bearer tokens, and sessions that only their owner sees; over a socket, with certificates of the test's own.

use crate::harness::{assert_refused, size_of_count, small_config, tube};
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use remesh_proto::v1;
use remesh_proto::v1::chart_service_client::ChartServiceClient;
use remesh_proto::v1::mesh_service_client::MeshServiceClient;
use remesh_proto::v1::remesh_service_client::RemeshServiceClient;
use remesh_proto::v1::session_service_client::SessionServiceClient;
use remesh_server::health::{self, Probed};
use remesh_server::security::new_token;
use remesh_server::{Security, SecurityFiles, serve};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio::net::TcpListener;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};
use tonic::{Code, Request, Status};

/// A folder of one test; removed when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("remesh-security-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).expect("a temporary directory");
        Folder(path)
    }

    fn write(&self, name: &str, content: &str) -> Option<PathBuf> {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("written");
        Some(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// An authority that signs certificates.
struct Authority {
    issuer: Issuer<'static, KeyPair>,
    pem: String,
}

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).expect("params");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().expect("key");
        let pem = params.self_signed(&key).expect("signed").pem();
        Authority { issuer: Issuer::new(params, key), pem }
    }

    /// A certificate for a name, and its key.
    fn sign(&self, name: &str) -> (String, String) {
        let key = KeyPair::generate().expect("key");
        let params = CertificateParams::new(vec![name.to_owned()]).expect("params");
        (params.signed_by(&key, &self.issuer).expect("signed").pem(), key.serialize_pem())
    }
}

/// A server; it stops with the test.
async fn start(security: Security) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = listener.local_addr().expect("address");
    let mut config = small_config();
    config.security = security;
    config.reload_interval = Duration::from_millis(20);
    tokio::spawn(serve(listener, config, std::future::pending()));
    address
}

async fn connect(address: SocketAddr, tls: Option<ClientTlsConfig>) -> Result<Channel, tonic::transport::Error> {
    let scheme = if tls.is_some() { "https" } else { "http" };
    let endpoint = Endpoint::from_shared(format!("{scheme}://localhost:{}", address.port())).expect("uri");
    let endpoint = match tls {
        Some(tls) => endpoint.tls_config(tls).expect("TLS"),
        None => endpoint,
    };
    endpoint.connect_timeout(Duration::from_secs(5)).connect().await
}

fn trusting(authority: &Authority) -> ClientTlsConfig {
    ClientTlsConfig::new().ca_certificate(Certificate::from_pem(&authority.pem))
}

#[derive(Clone)]
struct Token(Option<MetadataValue<Ascii>>);

impl Interceptor for Token {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert("authorization", value.clone());
        }
        Ok(request)
    }
}

type Sessions = SessionServiceClient<InterceptedService<Channel, Token>>;

fn with(channel: &Channel, header: &str) -> InterceptedService<Channel, Token> {
    let value = (!header.is_empty()).then(|| header.parse().expect("a header"));
    InterceptedService::new(channel.clone(), Token(value))
}

fn sessions(channel: &Channel, header: &str) -> Sessions {
    SessionServiceClient::new(with(channel, header))
}

async fn create(client: &mut Sessions) -> Result<String, Status> {
    let made = client.create_session(v1::CreateSessionRequest::default()).await?;
    Ok(made.into_inner().session.expect("session").name)
}

async fn list(client: &mut Sessions) -> Vec<String> {
    let page = client.list_sessions(v1::ListSessionsRequest::default()).await.expect("list").into_inner();
    page.sessions.into_iter().map(|s| s.name).collect()
}

#[tokio::test]
async fn tls_keeps_out_who_does_not_speak_it_or_trusts_others() {
    let (folder, ours, others) = (Folder::new(), Authority::new(), Authority::new());
    let (cert, key) = ours.sign("localhost");
    let files = SecurityFiles { tls_cert: folder.write("c", &cert), tls_key: folder.write("k", &key), ..Default::default() };
    let security = Security::load(files).expect("files");
    let address = start(security.clone()).await;
    let channel = connect(address, Some(trusting(&ours))).await.expect("trusted");
    create(&mut sessions(&channel, "")).await.expect("TLS alone asks for no name");
    assert!(connect(address, Some(trusting(&others))).await.is_err());
    let plain = connect(address, None).await;
    if let Ok(channel) = plain {
        assert!(create(&mut sessions(&channel, "")).await.is_err(), "no plaintext");
    }
    // A client that opens a connection and says nothing keeps nobody out.
    let _silent = tokio::net::TcpStream::connect(address).await.expect("connects");
    connect(address, Some(trusting(&ours))).await.expect("trusted");
    // The binary asks its own daemon, whatever names the certificate has.
    health::check(address, &security, Probed::Readiness, Duration::from_secs(5)).await.expect("well");
    let (cert, key) = others.sign("localhost");
    let other = SecurityFiles { tls_cert: folder.write("oc", &cert), tls_key: folder.write("ok", &key), ..Default::default() };
    let other = Security::load(other).expect("files");
    assert!(health::check(address, &other, Probed::Readiness, Duration::from_secs(5)).await.is_err(), "another certificate");
}

#[tokio::test]
async fn certificates_are_read_again_when_they_change_and_wrong_ones_are_not_taken() {
    let (folder, old, new) = (Folder::new(), Authority::new(), Authority::new());
    let (cert, key) = old.sign("localhost");
    let files = SecurityFiles { tls_cert: folder.write("c", &cert), tls_key: folder.write("k", &key), ..Default::default() };
    let security = Security::load(files).expect("files");
    let address = start(security.clone()).await;
    let open = connect(address, Some(trusting(&old))).await.expect("trusted");
    folder.write("c", "nonsense");
    assert!(security.reload().is_err());
    connect(address, Some(trusting(&old))).await.expect("the old one holds on");
    let (cert, key) = new.sign("localhost");
    folder.write("k", &key);
    folder.write("c", &cert);
    let mut tries = 0;
    while connect(address, Some(trusting(&new))).await.is_err() {
        tries += 1;
        assert!(tries < 200, "the new certificate is never shown");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(connect(address, Some(trusting(&old))).await.is_err());
    create(&mut sessions(&open, "")).await.expect("open connections go on");
}

#[tokio::test]
async fn certificates_of_clients_are_names() {
    let (folder, ours, others) = (Folder::new(), Authority::new(), Authority::new());
    let (cert, key) = ours.sign("localhost");
    let files = SecurityFiles {
        tls_cert: folder.write("c", &cert),
        tls_key: folder.write("k", &key),
        tls_client_ca: folder.write("ca", &ours.pem),
        ..Default::default()
    };
    let address = start(Security::load(files).expect("files")).await;
    let showing = |(cert, key): (String, String)| trusting(&ours).identity(Identity::from_pem(cert, key));
    let alice = connect(address, Some(showing(ours.sign("alice.example")))).await.expect("known");
    let session = create(&mut sessions(&alice, "")).await.expect("session");
    // A renewed certificate is the same name.
    let renewed = connect(address, Some(showing(ours.sign("alice.example")))).await.expect("known");
    assert_eq!(list(&mut sessions(&renewed, "")).await, std::slice::from_ref(&session));
    let bob = connect(address, Some(showing(ours.sign("bob.example")))).await.expect("known");
    let get = sessions(&bob, "").get_session(v1::GetSessionRequest { name: session }).await;
    assert_refused(get, Code::NotFound, "SESSION_NOT_FOUND");
    for tls in [trusting(&ours), showing(others.sign("alice.example"))] {
        // TLS 1.3 tells a refused client only when it talks.
        if let Ok(channel) = connect(address, Some(tls)).await {
            assert!(create(&mut sessions(&channel, "")).await.is_err(), "no certificate, or one of others");
        }
    }
}

/// A daemon with tokens of alice and bob.
async fn with_tokens(folder: &Folder) -> (Security, Channel, String, String) {
    let (alice, a) = new_token("alice").expect("token");
    let (bob, b) = new_token("bob").expect("token");
    let files = SecurityFiles { tokens: folder.write("tokens", &format!("{a}\n{b}\n")), ..Default::default() };
    let security = Security::load(files).expect("files");
    let channel = connect(start(security.clone()).await, None).await.expect("connects");
    (security, channel, format!("Bearer {alice}"), format!("bearer  {bob}"))
}

#[tokio::test]
async fn nobody_calls_without_a_token_that_holds() {
    let folder = Folder::new();
    let (security, channel, alice, bob) = with_tokens(&folder).await;
    create(&mut sessions(&channel, &alice)).await.expect("alice");
    create(&mut sessions(&channel, &bob)).await.expect("bob");
    for (header, reason) in [
        ("", "TOKEN_MISSING"),
        ("Bearer ", "TOKEN_INVALID"),
        ("Bearer wrong", "TOKEN_INVALID"),
        ("Basic YWxpY2U6", "TOKEN_INVALID"),
        (&alice["Bearer ".len()..], "TOKEN_INVALID"),
        (&alice[..alice.len() - 1], "TOKEN_INVALID"),
    ] {
        assert_refused(create(&mut sessions(&channel, header)).await, Code::Unauthenticated, reason);
    }
    // Streams and other services are no way around it.
    let import = v1::ImportMeshRequest { source: Some(tube(500)), ..Default::default() };
    assert_refused(MeshServiceClient::new(channel.clone()).import_mesh(import).await, Code::Unauthenticated, "TOKEN_MISSING");
    let one_call = RemeshServiceClient::new(channel.clone()).remesh_mesh(v1::RemeshMeshRequest::default()).await;
    assert_refused(one_call, Code::Unauthenticated, "TOKEN_MISSING");
    // A token that is taken out of the file holds no longer.
    let (_, other) = new_token("carol").expect("token");
    folder.write("tokens", &other);
    security.reload().expect("reloads");
    assert_refused(create(&mut sessions(&channel, &alice)).await, Code::Unauthenticated, "TOKEN_INVALID");
}

#[tokio::test]
async fn sessions_are_visible_to_their_owner_only() {
    let folder = Folder::new();
    let (_, channel, alice, bob) = with_tokens(&folder).await;
    let (mut owner, mut other) = (sessions(&channel, &alice), sessions(&channel, &bob));
    let session = create(&mut owner).await.expect("session");
    let import = v1::ImportMeshRequest { session: session.clone(), source: Some(tube(500)), ..Default::default() };
    MeshServiceClient::new(with(&channel, &alice)).import_mesh(import.clone()).await.expect("alice may");
    assert_eq!(list(&mut owner).await, std::slice::from_ref(&session));
    assert!(list(&mut other).await.is_empty());
    let none = || (Code::NotFound, "SESSION_NOT_FOUND");
    macro_rules! unseen {
        ($call:expr) => {{
            let (code, reason) = none();
            let status = assert_refused($call.await, code, reason);
            // Nothing tells a session of somebody else from one that never was.
            assert!(status.message().starts_with("no such session"), "{status:?}");
        }};
    }
    let name = || session.clone();
    unseen!(other.get_session(v1::GetSessionRequest { name: name() }));
    let ttl = Some(prost_types::Duration { seconds: 1, nanos: 0 });
    unseen!(other.update_session(v1::UpdateSessionRequest { name: name(), ttl }));
    unseen!(other.delete_session(v1::DeleteSessionRequest { name: name() }));
    let change = Some(v1::Change { change: Some(size_of_count(400)) });
    unseen!(other.apply_change(v1::ApplyChangeRequest { session: name(), change, request_id: "r".into(), ..Default::default() }));
    unseen!(other.undo_change(v1::UndoChangeRequest { session: name(), ..Default::default() }));
    unseen!(other.redo_change(v1::RedoChangeRequest { session: name(), ..Default::default() }));
    unseen!(other.watch_session(v1::WatchSessionRequest { session: name(), ..Default::default() }));
    unseen!(MeshServiceClient::new(with(&channel, &bob)).import_mesh(import));
    let remesh = v1::RemeshSurfaceRequest { session: name(), ..Default::default() };
    unseen!(RemeshServiceClient::new(with(&channel, &bob)).remesh_surface(remesh));
    let chart = v1::GetPatchChartRequest { session: name(), ..Default::default() };
    unseen!(ChartServiceClient::new(with(&channel, &bob)).get_patch_chart(chart));
    unseen!(other.get_session(v1::GetSessionRequest { name: format!("sessions/{}", "0".repeat(32)) }));
    // The events of the owner's session name the author.
    let request =
        v1::WatchSessionRequest { session: name(), start: Some(v1::watch_session_request::Start::AfterSequence(0)), without_stages: true };
    let event = owner.watch_session(request).await.expect("watch").into_inner().message().await.expect("message").expect("event");
    match event.event.expect("event") {
        v1::watch_session_response::Event::RevisionMade(made) => assert_eq!(made.author, "token:alice"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn wrong_files_are_told_with_their_names() {
    let (folder, ours) = (Folder::new(), Authority::new());
    let (cert, key) = ours.sign("localhost");
    let (cert, key, bad) = (folder.write("cert", &cert), folder.write("key", &key), folder.write("bad", "nonsense"));
    let (other_key, absent) = (folder.write("other", &ours.sign("localhost").1), Some(folder.0.join("absent")));
    let none = SecurityFiles::default;
    for (files, expected) in [
        (SecurityFiles { tls_cert: cert.clone(), ..none() }, "a certificate and its key"),
        (SecurityFiles { tls_cert: absent.clone(), tls_key: key.clone(), ..none() }, "absent cannot be read"),
        (SecurityFiles { tls_cert: bad.clone(), tls_key: key.clone(), ..none() }, "bad: holds no certificate"),
        (SecurityFiles { tls_cert: cert.clone(), tls_key: bad.clone(), ..none() }, "bad: holds no private key"),
        (SecurityFiles { tls_cert: cert.clone(), tls_key: other_key, ..none() }, "cert: "),
        (SecurityFiles { tls_cert: cert, tls_key: key, tls_client_ca: bad.clone(), ..none() }, "bad: holds no certificate"),
        (SecurityFiles { tokens: bad.clone(), ..none() }, "bad: line 1"),
        (SecurityFiles { jwt_keys: bad, ..none() }, "bad: key 1 is no public key"),
        (SecurityFiles { jwt_issuer: Some("x".into()), ..none() }, "needs a file of keys"),
    ] {
        let error = Security::load(files).expect_err(expected);
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[tokio::test]
async fn tokens_that_others_signed_are_taken_over_the_wire_until_they_expire() {
    use jsonwebtoken::{Algorithm, EncodingKey, Header, encode, get_current_timestamp};
    let (folder, ours, others) = (Folder::new(), KeyPair::generate().expect("key"), KeyPair::generate().expect("key"));
    let token = |key: &KeyPair, subject: &str, expires: u64, issuer: &str| {
        let claims = serde_json::json!({ "sub": subject, "exp": expires, "iss": issuer });
        let signed = encode(&Header::new(Algorithm::ES256), &claims, &EncodingKey::from_ec_der(&key.serialize_der()));
        format!("Bearer {}", signed.expect("signed"))
    };
    let files = SecurityFiles {
        jwt_keys: folder.write("keys.pem", &ours.public_key_pem()),
        jwt_issuer: Some("https://login.example".into()),
        ..Default::default()
    };
    let address = start(Security::load(files).expect("files")).await;
    let channel = connect(address, None).await.expect("connects");
    let (soon, issuer) = (get_current_timestamp() + 60, "https://login.example");
    let name = create(&mut sessions(&channel, &token(&ours, "alice", soon, issuer))).await.expect("a valid token");
    // Another token of the same name sees the session, another name does not.
    assert_eq!(list(&mut sessions(&channel, &token(&ours, "alice", soon + 60, issuer))).await, [name]);
    assert!(list(&mut sessions(&channel, &token(&ours, "bob", soon, issuer))).await.is_empty());
    let refused = [
        (token(&ours, "alice", get_current_timestamp() - 600, issuer), "TOKEN_EXPIRED"),
        (token(&others, "alice", soon, issuer), "TOKEN_INVALID"),
        (token(&ours, "alice", soon, "https://elsewhere.example"), "TOKEN_INVALID"),
        ("Bearer a.b.c".to_owned(), "TOKEN_INVALID"),
        (String::new(), "TOKEN_MISSING"),
    ];
    for (header, reason) in refused {
        assert_refused(create(&mut sessions(&channel, &header)).await, Code::Unauthenticated, reason);
    }
}
