//! The calls of a session: inputs, stages with progress, plan, quality, and the daemon's own state.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{Backoff, Repeat, new_request_id, send};
use remesh_proto::v1;
use std::time::Duration;

/// Drains a stream of progress messages that ends with a result. What it computes stays cached, so it may come twice.
macro_rules! drive {
    ($client:ident . $stub:ident . $method:ident ($request:expr), $event:ident, $on_progress:expr) => {{
        let request = $request;
        let mut backoff = Backoff::new($client.retry_policy(), Repeat::Free);
        loop {
            let tried = async {
                let mut stream = $client.$stub().$method(request.clone()).await?.into_inner();
                let mut result = None;
                while let Some(message) = stream.message().await? {
                    match message.event {
                        Some(v1::$event::Event::Progress(progress)) => $on_progress(&progress),
                        Some(v1::$event::Event::Result(found)) => result = Some(found),
                        None => {}
                    }
                }
                result.ok_or_else(|| ClientError::protocol("a stream that ended without its result"))
            };
            match tried.await {
                Ok(result) => break Ok(result),
                Err(error) => backoff.after(error).await?,
            }
        }
    }};
}

fn session_of(session: Option<v1::Session>) -> Result<v1::Session> {
    session.ok_or_else(|| ClientError::protocol("an answer without the session"))
}

fn wire_duration(duration: Duration) -> prost_types::Duration {
    prost_types::Duration { seconds: duration.as_secs().min(i64::MAX as u64) as i64, nanos: duration.subsec_nanos() as i32 }
}

impl Client {
    /// Opens an empty session. `display_name` is for people; without `ttl` the daemon's default holds.
    ///
    /// # Errors
    /// `LIMIT_REACHED` if the daemon holds as many sessions as it may.
    pub async fn create_session(&self, display_name: &str, ttl: Option<Duration>) -> Result<v1::Session> {
        let request = v1::CreateSessionRequest { display_name: display_name.to_owned(), ttl: ttl.map(wire_duration) };
        session_of(send!(self.sessions.create_session(request), IfRefused).session)
    }

    /// The state of a session; counts as a use of it.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`, `SESSION_EXPIRED`.
    pub async fn get_session(&self, name: &str) -> Result<v1::Session> {
        let request = v1::GetSessionRequest { name: name.to_owned() };
        session_of(send!(self.sessions.get_session(request)).session)
    }

    /// All sessions, the oldest first, over as many pages as there are; without their meshes and inputs.
    ///
    /// # Errors
    /// Only those of the connection.
    pub async fn list_sessions(&self) -> Result<Vec<v1::Session>> {
        let mut sessions = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = v1::ListSessionsRequest { page_size: 1000, page_token };
            let page = send!(self.sessions.list_sessions(request));
            sessions.extend(page.sessions);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(sessions);
            }
        }
    }

    /// Sets how long a session lives from now and after each use.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`, `BAD_PARAMETER` beyond the daemon's bound.
    pub async fn set_ttl(&self, name: &str, ttl: Duration) -> Result<v1::Session> {
        let request = v1::UpdateSessionRequest { name: name.to_owned(), ttl: Some(wire_duration(ttl)) };
        session_of(send!(self.sessions.update_session(request)).session)
    }

    /// Ends a session and tells the revision it had.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`.
    pub async fn delete_session(&self, name: &str) -> Result<u64> {
        let request = v1::DeleteSessionRequest { name: name.to_owned() };
        Ok(send!(self.sessions.delete_session(request), IfRefused).revision)
    }

    /// Changes one input and tells the new revision; with `base`, only if that is the current one.
    ///
    /// # Errors
    /// `STALE_REVISION` if somebody changed the session first, `BAD_PARAMETER` with the field.
    pub async fn apply(&self, session: &str, change: v1::change::Change, base: Option<u64>) -> Result<u64> {
        let request = v1::ApplyChangeRequest {
            session: session.to_owned(),
            base_revision: base,
            change: Some(v1::Change { change: Some(change) }),
            request_id: new_request_id(),
        };
        Ok(send!(self.sessions.apply_change(request)).revision)
    }

    /// Takes the inputs of an earlier revision and tells the new one.
    ///
    /// # Errors
    /// `BAD_PARAMETER` if that revision is no longer kept.
    pub async fn rollback(&self, session: &str, to_revision: u64) -> Result<u64> {
        self.apply(session, v1::change::Change::Rollback(v1::Rollback { to_revision }), None).await
    }

    /// What is wrong with the imported surface, and where.
    ///
    /// # Errors
    /// `NO_MESH` before an import.
    pub async fn diagnose(&self, session: &str) -> Result<v1::DiagnoseMeshResponse> {
        let request = v1::DiagnoseMeshRequest { session: session.to_owned(), expected_revision: None };
        Ok(send!(self.meshes.diagnose_mesh(request)))
    }

    /// Partitions the surface; `with_charts` tells the patches after the splits that their charts ask for, and after edits.
    ///
    /// # Errors
    /// `NO_MESH`, and the refusal of a surface that cannot be remeshed, with places.
    pub async fn partition(
        &self,
        session: &str,
        with_charts: bool,
        mut on_progress: impl FnMut(&v1::Progress),
    ) -> Result<v1::PartitionResult> {
        let request = v1::PartitionSurfaceRequest { session: session.to_owned(), expected_revision: None, with_charts };
        drive!(self.partitions.partition_surface(request), partition_surface_response, on_progress)
    }

    /// Maps all patches to the plane and tells the charts of the listed ones, or of all if none are listed.
    ///
    /// # Errors
    /// Those of [`Client::partition`], `PATCH_NOT_FOUND`, `CHART_FAILED`.
    pub async fn parametrize(
        &self,
        session: &str,
        patches: &[u32],
        mut on_progress: impl FnMut(&v1::Progress),
    ) -> Result<v1::ParametrizeResult> {
        let request = v1::ParametrizePatchesRequest { session: session.to_owned(), expected_revision: None, patches: patches.to_vec() };
        drive!(self.charts.parametrize_patches(request), parametrize_patches_response, on_progress)
    }

    /// Remeshes the surface, or meshes only the listed patches.
    ///
    /// # Errors
    /// Those of [`Client::parametrize`]; FAILED_PRECONDITION if no size is set.
    pub async fn remesh(&self, session: &str, patches: &[u32], mut on_progress: impl FnMut(&v1::Progress)) -> Result<v1::RemeshResult> {
        let request = v1::RemeshSurfaceRequest { session: session.to_owned(), expected_revision: None, patches: patches.to_vec() };
        drive!(self.remeshing.remesh_surface(request), remesh_surface_response, on_progress)
    }

    /// What a remesh would find cached and what it would compute; computes nothing.
    ///
    /// # Errors
    /// `NO_MESH`, `SESSION_NOT_FOUND`.
    pub async fn plan(&self, session: &str) -> Result<v1::PlanRemeshResponse> {
        let request = v1::PlanRemeshRequest { session: session.to_owned(), ..Default::default() };
        Ok(send!(self.remeshing.plan_remesh(request)))
    }

    /// Measures the result, which is computed if it is not cached.
    ///
    /// # Errors
    /// Those of [`Client::remesh`].
    pub async fn quality(&self, session: &str, scope: v1::QualityScope) -> Result<v1::GetQualityResponse> {
        let request = v1::GetQualityRequest { session: session.to_owned(), expected_revision: None, scope: scope.into() };
        Ok(send!(self.qualities.get_quality(request)))
    }

    /// Measures one file against another, without a session.
    ///
    /// # Errors
    /// Those of [`Client::import`], for either file.
    pub async fn compare(&self, request: v1::CompareMeshesRequest) -> Result<v1::CompareMeshesResponse> {
        Ok(send!(self.qualities.compare_meshes(request)))
    }

    /// One call: a file in, a remeshed file out, no session. For files up to the daemon's `max_inline_bytes`.
    ///
    /// # Errors
    /// All that import, remesh and export can fail with.
    pub async fn remesh_mesh(&self, request: v1::RemeshMeshRequest) -> Result<v1::RemeshMeshResponse> {
        Ok(send!(self.remeshing.remesh_mesh(request)))
    }

    /// Version, formats and limits of the daemon.
    ///
    /// # Errors
    /// Only those of the connection.
    pub async fn capabilities(&self) -> Result<v1::GetCapabilitiesResponse> {
        Ok(send!(self.capability_service.get_capabilities(v1::GetCapabilitiesRequest {})))
    }

    /// State of the caches.
    ///
    /// # Errors
    /// Only those of the connection.
    pub async fn cache_usage(&self) -> Result<v1::GetCacheUsageResponse> {
        Ok(send!(self.capability_service.get_cache_usage(v1::GetCacheUsageRequest {})))
    }
}
