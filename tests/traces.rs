//! Traces over OTLP: the real daemon, and a collector of our own that keeps what comes.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{TraceService, TraceServiceServer};
use opentelemetry_proto::tonic::collector::trace::v1::{ExportTraceServiceRequest, ExportTraceServiceResponse};
use opentelemetry_proto::tonic::trace::v1::Span;
use remesh_client::{Client, v1};
use std::process::Command;
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Request, Response, Status};

/// Spans that have come, with the name of the service that sent them.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<(String, Span)>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(&self, request: Request<ExportTraceServiceRequest>) -> Result<Response<ExportTraceServiceResponse>, Status> {
        for resource in request.into_inner().resource_spans {
            let name = format!("{:?}", resource.resource);
            let spans = resource.scope_spans.into_iter().flat_map(|scope| scope.spans);
            self.0.lock().expect("no panic").extend(spans.map(|span| (name.clone(), span)));
        }
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

const TRACE: &str = "4bf92f3577b34da6a3ce929d0e0e4736";
const PARENT: &str = "00f067aa0ba902b7";

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn calls_reach_the_collector_as_parts_of_the_callers_trace() {
    let collector = Collector::default();
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let endpoint = format!("http://{}", listener.local_addr().expect("an address"));
    let service = TraceServiceServer::new(collector.clone());
    tokio::spawn(tonic::transport::Server::builder().add_service(service).serve_with_incoming(TcpListenerStream::new(listener)));
    let mut daemon = Daemon::start(&["--otlp-endpoint", &endpoint]);
    let client = Client::connect(&daemon.address).await.expect("connects");
    let mut request = Request::new(v1::CreateSessionRequest::default());
    request.metadata_mut().insert("traceparent", format!("00-{TRACE}-{PARENT}-01").parse().expect("ascii"));
    let session = client.sessions().create_session(request).await.expect("session").into_inner().session.expect("session").name;
    let sample = v1::SampleSpec { kind: v1::SampleKind::Tube.into(), triangles: Some(800), ..Default::default() };
    let import = v1::ImportMeshRequest {
        session: session.clone(),
        source: Some(v1::import_mesh_request::Source::Sample(sample)),
        ..Default::default()
    };
    client.meshes().import_mesh(import).await.expect("imports");
    assert!(client.remesh(&session, &[], |_| {}).await.is_err(), "no size is set");
    // Drained, so that the last spans are sent.
    assert!(daemon.signal("-TERM").success());
    let spans = collector.0.lock().expect("no panic");
    let of = |name: &str| spans.iter().find(|(_, span)| span.name == name).unwrap_or_else(|| panic!("no span of {name}"));
    let text = |span: &Span, key: &str| span.attributes.iter().find(|a| a.key == key).map(|a| format!("{:?}", a.value)).unwrap_or_default();
    let (sender, made) = of("CreateSession");
    assert!(sender.contains("remeshd"), "{sender}");
    assert_eq!((hex(&made.trace_id), hex(&made.parent_span_id)), (TRACE.to_owned(), PARENT.to_owned()));
    assert!(text(made, "rpc.grpc.status").contains("OK"), "{:?}", made.attributes);
    let (_, imported) = of("ImportMesh");
    assert_ne!(hex(&imported.trace_id), TRACE, "a caller that names no trace begins one");
    // Stages lie beneath their call, in its trace and within its time.
    let beneath: Vec<&Span> = spans.iter().map(|(_, span)| span).filter(|span| span.parent_span_id == imported.span_id).collect();
    assert!(beneath.iter().any(|span| span.name == "import" && text(span, "outcome").contains("run")), "{beneath:?}");
    for stage in beneath {
        assert_eq!(stage.trace_id, imported.trace_id);
        assert!(stage.start_time_unix_nano >= imported.start_time_unix_nano && stage.end_time_unix_nano <= imported.end_time_unix_nano);
        assert_ne!(text(stage, "milliseconds"), "");
    }
    let (_, refused) = of("RemeshSurface");
    assert!(text(refused, "rpc.grpc.status").contains("InvalidArgument"), "{:?}", refused.attributes);
    assert!(spans.iter().all(|(_, span)| span.name != "call"), "all calls have the names of their methods");
}

#[test]
fn a_wrong_address_is_told() {
    for wrong in ["https://host:4317", "nonsense", "http://"] {
        let ended = Command::new(env!("CARGO_BIN_EXE_remeshd")).args(["check-config", "--otlp-endpoint", wrong]).output().expect("runs");
        assert_eq!(ended.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&ended.stderr).contains("--otlp-endpoint"));
    }
}
