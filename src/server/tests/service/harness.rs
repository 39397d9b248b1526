//! A server of the test's own and short ways to call it.

use prost::Message;
use remesh_proto::v1;
use remesh_proto::v1::chart_service_client::ChartServiceClient;
use remesh_proto::v1::mesh_service_client::MeshServiceClient;
use remesh_proto::v1::partition_service_client::PartitionServiceClient;
use remesh_proto::v1::quality_service_client::QualityServiceClient;
use remesh_proto::v1::remesh_service_client::RemeshServiceClient;
use remesh_proto::v1::session_service_client::SessionServiceClient;
use remesh_server::{ServeError, ServerConfig, serve};
use std::net::SocketAddr;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status, Streaming};
use tonic_types::StatusExt;

/// A running server; stops when dropped.
pub(crate) struct Daemon {
    pub(crate) channel: Channel,
    pub(crate) address: SocketAddr,
    pub(crate) stop: Option<oneshot::Sender<()>>,
    pub(crate) served: JoinHandle<Result<(), ServeError>>,
}

impl Daemon {
    pub(crate) async fn start(config: ServerConfig) -> Daemon {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("address");
        let (stop, stopped) = oneshot::channel::<()>();
        let served = tokio::spawn(serve(listener, config, async move {
            let _ = stopped.await;
        }));
        let channel = Endpoint::from_shared(format!("http://{address}")).expect("uri").connect().await.expect("connects");
        Daemon { channel, address, stop: Some(stop), served }
    }

    pub(crate) async fn usual() -> Daemon {
        Daemon::start(small_config()).await
    }

    pub(crate) fn sessions(&self) -> SessionServiceClient<Channel> {
        SessionServiceClient::new(self.channel.clone())
    }

    pub(crate) fn meshes(&self) -> MeshServiceClient<Channel> {
        MeshServiceClient::new(self.channel.clone())
    }

    pub(crate) fn remeshes(&self) -> RemeshServiceClient<Channel> {
        RemeshServiceClient::new(self.channel.clone())
    }

    pub(crate) fn partitions(&self) -> PartitionServiceClient<Channel> {
        PartitionServiceClient::new(self.channel.clone())
    }

    pub(crate) fn charts(&self) -> ChartServiceClient<Channel> {
        ChartServiceClient::new(self.channel.clone())
    }

    pub(crate) fn qualities(&self) -> QualityServiceClient<Channel> {
        QualityServiceClient::new(self.channel.clone())
    }

    /// A new session.
    pub(crate) async fn session(&self) -> String {
        let response = self.sessions().create_session(v1::CreateSessionRequest::default()).await.expect("session");
        response.into_inner().session.expect("session").name
    }

    /// A new session with a tube of about so many triangles and a wanted number of triangles; at revision 2.
    pub(crate) async fn tube(&self, triangles: u64, wanted: u64) -> String {
        let session = self.session().await;
        self.import(&session, tube(triangles)).await.expect("import");
        self.change(&session, None, size_of_count(wanted)).await.expect("size");
        session
    }

    pub(crate) async fn import(&self, session: &str, source: v1::import_mesh_request::Source) -> Result<v1::ImportMeshResponse, Status> {
        let request = v1::ImportMeshRequest { session: session.to_owned(), source: Some(source), ..Default::default() };
        self.meshes().import_mesh(request).await.map(tonic::Response::into_inner)
    }

    pub(crate) async fn change(&self, session: &str, base: Option<u64>, change: v1::change::Change) -> Result<u64, Status> {
        let request = v1::ApplyChangeRequest {
            session: session.to_owned(),
            base_revision: base,
            change: Some(v1::Change { change: Some(change) }),
            ..Default::default()
        };
        self.sessions().apply_change(request).await.map(|r| r.into_inner().revision)
    }

    /// Begins to remesh.
    pub(crate) async fn begin_remesh(&self, session: &str) -> Streaming<v1::RemeshSurfaceResponse> {
        let request = v1::RemeshSurfaceRequest { session: session.to_owned(), ..Default::default() };
        self.remeshes().remesh_surface(request).await.expect("stream").into_inner()
    }

    /// Remeshes and waits.
    pub(crate) async fn remesh(&self, session: &str) -> Result<v1::RemeshResult, Status> {
        let mut stream = self.begin_remesh(session).await;
        let mut last = None;
        while let Some(message) = stream.message().await? {
            last = message.event;
        }
        match last {
            Some(v1::remesh_surface_response::Event::Result(result)) => Ok(result),
            other => panic!("the last message is not the result: {other:?}"),
        }
    }

    pub(crate) async fn plan(&self, session: &str) -> v1::PlanRemeshResponse {
        let request = v1::PlanRemeshRequest { session: session.to_owned(), ..Default::default() };
        self.remeshes().plan_remesh(request).await.expect("plan").into_inner()
    }
}

pub(crate) fn small_config() -> ServerConfig {
    let mut config = ServerConfig::default();
    config.engine.threads = 2;
    config
}

pub(crate) fn tube(triangles: u64) -> v1::import_mesh_request::Source {
    v1::import_mesh_request::Source::Sample(v1::SampleSpec {
        kind: v1::SampleKind::Tube.into(),
        triangles: Some(triangles),
        ..Default::default()
    })
}

pub(crate) fn size_of_count(triangles: u64) -> v1::change::Change {
    v1::change::Change::Size(v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(triangles)) })
}

/// How a stream ends: an error, or `Ok` at its regular end.
pub(crate) async fn end_of(mut stream: Streaming<v1::RemeshSurfaceResponse>) -> Result<(), Status> {
    while stream.message().await?.is_some() {}
    Ok(())
}

/// `ErrorInfo.reason` of a status.
fn reason(status: &Status) -> String {
    status.get_error_details().error_info().map_or_else(String::new, |info| info.reason.clone())
}

#[track_caller]
pub(crate) fn assert_refused<T>(result: Result<T, Status>, code: Code, expected_reason: &str) -> Status {
    let Err(status) = result else { panic!("not refused") };
    assert_eq!((status.code(), reason(&status).as_str()), (code, expected_reason), "{status:?}");
    status
}

/// Our detail about places on the surface.
pub(crate) fn locations(status: &Status) -> Option<v1::GeometryLocations> {
    let whole = tonic_types::pb::Status::decode(status.details()).ok()?;
    let detail = whole.details.into_iter().find(|d| d.type_url == remesh_proto::GEOMETRY_LOCATIONS_TYPE_URL)?;
    v1::GeometryLocations::decode(&*detail.value).ok()
}

/// Bytes of a column in chunks that come in order.
pub(crate) fn column(chunks: &[v1::DataChunk], kind: v1::DataColumn) -> Vec<u8> {
    let mut bytes = Vec::new();
    for chunk in chunks.iter().filter(|c| c.column == i32::from(kind)) {
        assert_eq!(chunk.offset as usize, bytes.len());
        bytes.extend_from_slice(&chunk.data);
    }
    bytes
}
