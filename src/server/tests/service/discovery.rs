//! What a client can find out: health, reflection in both versions, capabilities.

use crate::harness::Daemon;
use remesh_proto::v1;
use remesh_proto::v1::capability_service_client::CapabilityServiceClient;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;

const SERVICES: [&str; 8] = [
    "grpc.health.v1.Health",
    "remesh.v1.CapabilityService",
    "remesh.v1.ChartService",
    "remesh.v1.MeshService",
    "remesh.v1.PartitionService",
    "remesh.v1.QualityService",
    "remesh.v1.RemeshService",
    "remesh.v1.SessionService",
];

#[tokio::test]
async fn all_services_are_healthy() {
    let daemon = Daemon::usual().await;
    let mut client = HealthClient::new(daemon.channel.clone());
    for service in SERVICES[1..].iter().chain(&[""]) {
        let response = client.check(HealthCheckRequest { service: (*service).to_owned() }).await.expect("known");
        assert_eq!(response.into_inner().status, 1, "{service}");
    }
    assert!(client.check(HealthCheckRequest { service: "nobody".into() }).await.is_err());
}

macro_rules! reflection_lists_everything {
    ($test:ident, $version:ident) => {
        #[tokio::test]
        async fn $test() {
            use tonic_reflection::pb::$version::server_reflection_client::ServerReflectionClient;
            use tonic_reflection::pb::$version::server_reflection_request::MessageRequest;
            use tonic_reflection::pb::$version::server_reflection_response::MessageResponse;
            let daemon = Daemon::usual().await;
            let ask =
                |message| tonic_reflection::pb::$version::ServerReflectionRequest { host: String::new(), message_request: Some(message) };
            let asked = [
                ask(MessageRequest::ListServices(String::new())),
                ask(MessageRequest::FileContainingSymbol("remesh.v1.GeometryLocations".into())),
            ];
            let mut client = ServerReflectionClient::new(daemon.channel.clone());
            let mut answers = client.server_reflection_info(tokio_stream::iter(asked)).await.expect("reflection").into_inner();
            let first = answers.message().await.expect("answer").expect("answer").message_response;
            let Some(MessageResponse::ListServicesResponse(list)) = first else { panic!("{first:?}") };
            for service in SERVICES {
                assert!(list.service.iter().any(|s| s.name == service), "{service}");
            }
            let second = answers.message().await.expect("answer").expect("answer").message_response;
            assert!(matches!(second, Some(MessageResponse::FileDescriptorResponse(_))), "{second:?}");
        }
    };
}

reflection_lists_everything!(reflection_v1_lists_everything, v1);
reflection_lists_everything!(reflection_v1alpha_lists_everything, v1alpha);

#[tokio::test]
async fn capabilities_tell_version_formats_and_limits() {
    let daemon = Daemon::usual().await;
    let mut client = CapabilityServiceClient::new(daemon.channel.clone());
    let told = client.get_capabilities(v1::GetCapabilitiesRequest {}).await.expect("capabilities").into_inner();
    assert_eq!((told.apis, told.threads), (vec!["remesh.v1".to_owned()], 2));
    assert!(told.write_formats.contains(&v1::MeshFormat::Vtu.into()) && !told.read_formats.contains(&v1::MeshFormat::Vtu.into()));
    let limits = told.limits.expect("limits");
    assert_eq!((limits.max_message_bytes, limits.max_inline_bytes), (4 << 20, 64 << 20));
    let usage = client.get_cache_usage(v1::GetCacheUsageRequest {}).await.expect("usage").into_inner();
    assert_eq!((usage.cache_entries, usage.running, usage.sessions), (0, 0, 0));
}
