//! `CapabilityService`: what this daemon can do and how full it is.

use crate::config::CHUNK_BYTES;
use crate::dispatch::Call;
use crate::state::Shared;
use remesh_proto::v1;
use remesh_proto::v1::capability_service_server::CapabilityService;
use std::sync::Arc;
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Capabilities(pub(crate) Arc<Shared>);

const READ: [v1::MeshFormat; 6] =
    [v1::MeshFormat::Stl, v1::MeshFormat::Obj, v1::MeshFormat::Ply, v1::MeshFormat::Off, v1::MeshFormat::Msh, v1::MeshFormat::Gltf];

fn saturated(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn limits(shared: &Shared) -> v1::Limits {
    let (config, engine) = (&shared.config, &shared.config.engine);
    v1::Limits {
        max_message_bytes: config.max_message_bytes as u64,
        max_inline_bytes: config.max_inline_bytes as u64,
        max_chunk_bytes: CHUNK_BYTES as u64,
        max_blob_bytes: engine.max_blob_bytes as u64,
        max_blob_store_bytes: engine.max_total_blob_bytes as u64,
        max_faces: engine.max_faces,
        max_sessions: saturated(engine.max_sessions),
        max_ttl: prost_types::Duration::try_from(engine.max_ttl).ok(),
        default_ttl: prost_types::Duration::try_from(engine.default_ttl).ok(),
        max_running: saturated(config.max_running),
        max_queued: saturated(config.max_queued),
        max_jobs_per_client: saturated(config.max_jobs_per_client),
        max_sessions_per_client: saturated(config.max_sessions_per_client),
        max_open_faces: config.max_open_faces,
        max_open_faces_per_client: config.max_open_faces_per_client,
    }
}

fn capabilities(shared: &Shared) -> v1::GetCapabilitiesResponse {
    v1::GetCapabilitiesResponse {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        apis: vec!["remesh.v1".to_owned()],
        read_formats: READ.map(i32::from).to_vec(),
        write_formats: READ.into_iter().chain([v1::MeshFormat::Vtu]).map(i32::from).collect(),
        limits: Some(limits(shared)),
        threads: saturated(shared.config.engine.threads),
    }
}

fn usage(shared: &Shared) -> v1::GetCacheUsageResponse {
    let cache = shared.engine.cache.usage();
    let (blobs, blob_bytes) = shared.engine.blob_usage();
    v1::GetCacheUsageResponse {
        cache_bytes: cache.bytes,
        cache_capacity_bytes: cache.budget_bytes,
        cache_entries: cache.entries,
        hits: cache.hits,
        runs: cache.runs,
        evictions: cache.evictions,
        blob_bytes,
        blobs,
        sessions: saturated(shared.engine.sessions(shared.config.clock.now()).len()),
        running: saturated(shared.pool.running()),
        queued: saturated(shared.pool.queued()),
        store_bytes: shared.keeper.is_on().then(|| shared.keeper.used_bytes()),
        store_capacity_bytes: shared.config.keeping.as_ref().and_then(|keeping| keeping.max_bytes),
    }
}

#[tonic::async_trait]
impl CapabilityService for Capabilities {
    async fn get_capabilities(
        &self,
        request: Request<v1::GetCapabilitiesRequest>,
    ) -> Result<Response<v1::GetCapabilitiesResponse>, Status> {
        Call::begin(&self.0, "GetCapabilities", &request)?.finish(Ok(capabilities(&self.0)))
    }

    async fn get_cache_usage(&self, request: Request<v1::GetCacheUsageRequest>) -> Result<Response<v1::GetCacheUsageResponse>, Status> {
        Call::begin(&self.0, "GetCacheUsage", &request)?.finish(Ok(usage(&self.0)))
    }
}
