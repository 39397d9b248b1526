//! `SessionService`: the life of sessions and changes of their inputs.

use super::partition::check_patch;
use super::transfer;
use crate::answers::{Open, open_edit};
use crate::caller::Caller;
use crate::convert::{from_proto, sizes, to_proto};
use crate::desk::Desk;
use crate::dispatch::{Call, Intent};
use crate::feed::{Seat, Start, follow};
use crate::state::{Shared, Target, session_name};
use crate::status::Fault;
use crate::stream::Watch;
use remesh_engine::EngineError;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::pipeline::{self, Run};
use remesh_engine::session::{Edit, Pending, Revision, Session, Steps};
use remesh_proto::v1;
use remesh_proto::v1::session_service_server::SessionService;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tonic::{Request, Response, Status, Streaming};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Sessions(pub(crate) Arc<Shared>);

/// Longest name for people.
const MAX_DISPLAY_NAME: usize = 200;
const DEFAULT_PAGE: usize = 100;
const MAX_PAGE: usize = 1000;

/// A session without what it holds.
fn brief(session: &Session, desk: &Desk) -> v1::Session {
    let Steps { undo, redo } = session.steps();
    v1::Session {
        name: session_name(session),
        revision: session.revision().0,
        create_time: Some(to_proto::time(session.created)),
        expire_time: Some(to_proto::time(session.expires())),
        ttl: prost_types::Duration::try_from(session.ttl()).ok(),
        display_name: desk.display_name.clone(),
        mesh: None,
        inputs: None,
        oldest_revision: session.oldest_revision().0,
        undo_steps: undo as u32,
        redo_steps: redo as u32,
    }
}

fn whole(session: &Session, desk: &Desk) -> v1::Session {
    let snapshot = session.snapshot();
    v1::Session {
        revision: snapshot.revision.0,
        mesh: desk.mesh_summary(&snapshot),
        inputs: Some(to_proto::inputs(&snapshot)),
        ..brief(session, desk)
    }
}

fn bounded_ttl(shared: &Shared, ttl: prost_types::Duration) -> EngineResult<Duration> {
    let ttl = from_proto::duration(ttl, "ttl")?;
    if ttl.is_zero() {
        return Err(EngineError::bad_parameter("ttl", "must be positive"));
    }
    Ok(ttl.min(shared.config.engine.max_ttl))
}

/// Refuses a name for people that is too long.
pub(crate) fn check_display_name(name: &str) -> EngineResult<()> {
    if name.chars().count() > MAX_DISPLAY_NAME {
        return Err(EngineError::bad_parameter("display_name", format!("has more than {MAX_DISPLAY_NAME} characters")));
    }
    Ok(())
}

fn create(
    shared: &Shared,
    request: v1::CreateSessionRequest,
    caller: &Caller,
    client: &Arc<str>,
) -> Result<v1::CreateSessionResponse, Fault> {
    check_display_name(&request.display_name)?;
    let ttl = request.ttl.map(|ttl| bounded_ttl(shared, ttl)).transpose()?;
    // Expired sessions must not keep new ones out.
    shared.expire();
    let (session, desk) = shared.create_session(ttl, request.display_name, caller, client)?;
    Ok(v1::CreateSessionResponse { session: Some(whole(&session, &desk)) })
}

/// The place of a session in the list: creation time, then id.
fn page_key(session: &Session) -> (u128, &str) {
    (session.created.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos()), &session.id)
}

fn list(shared: &Shared, request: &v1::ListSessionsRequest, caller: &Caller) -> EngineResult<v1::ListSessionsResponse> {
    let size = match usize::try_from(request.page_size) {
        Err(_) => return Err(EngineError::bad_parameter("page_size", "must not be negative")),
        Ok(0) => DEFAULT_PAGE,
        Ok(size) => size.min(MAX_PAGE),
    };
    let after: Option<(u128, &str)> = match request.page_token.as_str() {
        "" => None,
        token => {
            let parts = token.split_once('-').and_then(|(nanos, id)| Some((u128::from_str_radix(nanos, 16).ok()?, id)));
            Some(parts.ok_or_else(|| EngineError::bad_parameter("page_token", "is not a token of this method"))?)
        }
    };
    let all = shared.engine.sessions(shared.config.clock.now());
    let rest = all.iter().filter(|s| after.is_none_or(|after| page_key(s) > after));
    let mut rest = rest.filter_map(|s| Some((s, shared.desk(s, caller)?)));
    let page: Vec<_> = rest.by_ref().take(size).collect();
    let next_page_token = match (page.last(), rest.next()) {
        (Some((last, _)), Some(_)) => {
            let (nanos, id) = page_key(last);
            format!("{nanos:x}-{id}")
        }
        _ => String::new(),
    };
    Ok(v1::ListSessionsResponse { sessions: page.iter().map(|(s, desk)| brief(s, desk)).collect(), next_page_token })
}

fn update(shared: &Shared, request: v1::UpdateSessionRequest, caller: &Caller) -> EngineResult<v1::UpdateSessionResponse> {
    let (session, desk) = shared.session(&request.name, "name", caller)?;
    let ttl = request.ttl.ok_or_else(|| EngineError::bad_parameter("ttl", "is required"))?;
    let (before, ttl) = (session.ttl(), bounded_ttl(shared, ttl)?);
    session.set_ttl(ttl);
    if let Err(error) = shared.keeper.put_session(&session, &desk) {
        session.set_ttl(before);
        return Err(error);
    }
    Ok(v1::UpdateSessionResponse { session: Some(whole(&session, &desk)) })
}

fn delete(shared: &Shared, request: &v1::DeleteSessionRequest, caller: &Caller) -> EngineResult<v1::DeleteSessionResponse> {
    if shared.delete_unreadable(&request.name, caller)? {
        return Ok(v1::DeleteSessionResponse::default());
    }
    let (session, _) = shared.session(&request.name, "name", caller)?;
    shared.delete_session(&session, caller)?;
    Ok(v1::DeleteSessionResponse { revision: session.revision().0 })
}

fn watch(
    shared: &Shared,
    request: &v1::WatchSessionRequest,
    caller: &Caller,
    time_left: Option<Duration>,
) -> Result<Watch<v1::WatchSessionResponse>, Fault> {
    use v1::watch_session_request::Start as Wanted;
    let (_, desk) = shared.session(&request.session, "session", caller)?;
    let start = match request.start {
        None => Start::Now,
        Some(Wanted::AfterSequence(sequence)) => Start::AfterSequence(sequence),
        Some(Wanted::AfterRevision(revision)) => Start::AfterRevision(revision),
    };
    let most = shared.config.max_watchers;
    let seat = Seat::take(&shared.watchers, most).ok_or(Fault::TooManyWatchers { most })?;
    Ok(follow(desk.feed.clone(), start, request.without_stages, seat, time_left))
}

/// Whether a change names patches by number, which are looked up first.
fn names_patches(change: Option<&v1::Change>) -> bool {
    match change.and_then(|c| c.change.as_ref()) {
        Some(v1::change::Change::Size(spec)) => !sizes::patch_numbers(spec).is_empty(),
        _ => false,
    }
}

fn applied(made: &Pending) -> v1::ApplyChangeResponse {
    v1::ApplyChangeResponse { revision: made.next.revision.0 }
}

/// Applies a size that names patches by number.
fn apply_patch_sizes(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: v1::ApplyChangeRequest,
    open: Open,
) -> EngineResult<v1::ApplyChangeResponse> {
    let mut change = request.change;
    let layout = pipeline::layout(&shared.engine, &target.snapshot, run)?.value;
    if let Some(v1::change::Change::Size(spec)) = change.as_mut().and_then(|c| c.change.as_mut()) {
        sizes::name_patches(spec, |number| Ok(layout.patches.identities[check_patch(&layout, number)?]))?;
    }
    let change = from_proto::change(&shared.engine, change)?;
    // On the revision that the numbers were looked up in: in another one they may be other patches.
    target.apply(Some(target.snapshot.revision), &[change], open, applied)
}

#[tonic::async_trait]
impl SessionService for Sessions {
    async fn create_session(&self, request: Request<v1::CreateSessionRequest>) -> Result<Response<v1::CreateSessionResponse>, Status> {
        let call = Call::begin(&self.0, "CreateSession", &request)?;
        let (caller, client) = (call.caller().clone(), call.client().clone());
        call.on_disk(move |shared| create(shared, request.into_inner(), &caller, &client)).await
    }

    async fn get_session(&self, request: Request<v1::GetSessionRequest>) -> Result<Response<v1::GetSessionResponse>, Status> {
        let call = Call::begin(&self.0, "GetSession", &request)?;
        let found = self.0.session(&request.into_inner().name, "name", call.caller());
        let response = found.map(|(session, desk)| v1::GetSessionResponse { session: Some(whole(&session, &desk)) });
        call.finish(response.map_err(Into::into))
    }

    async fn list_sessions(&self, request: Request<v1::ListSessionsRequest>) -> Result<Response<v1::ListSessionsResponse>, Status> {
        let call = Call::begin(&self.0, "ListSessions", &request)?;
        let page = list(&self.0, &request.into_inner(), call.caller());
        call.finish(page.map_err(Into::into))
    }

    async fn update_session(&self, request: Request<v1::UpdateSessionRequest>) -> Result<Response<v1::UpdateSessionResponse>, Status> {
        let call = Call::begin(&self.0, "UpdateSession", &request)?;
        let caller = call.caller().clone();
        call.on_disk(move |shared| update(shared, request.into_inner(), &caller)).await
    }

    async fn delete_session(&self, request: Request<v1::DeleteSessionRequest>) -> Result<Response<v1::DeleteSessionResponse>, Status> {
        let call = Call::begin(&self.0, "DeleteSession", &request)?;
        let caller = call.caller().clone();
        call.on_disk(move |shared| delete(shared, &request.into_inner(), &caller)).await
    }

    async fn apply_change(&self, request: Request<v1::ApplyChangeRequest>) -> Result<Response<v1::ApplyChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "ApplyChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        if names_patches(request.change.as_ref()) {
            return call.compute(Intent::Long, move |shared, run| apply_patch_sizes(shared, run, &target, request, open)).await;
        }
        call.on_disk(move |shared| {
            let change = from_proto::change(&shared.engine, request.change)?;
            target.apply(request.base_revision.map(Revision), &[change], open, applied)
        })
        .await
    }

    async fn undo_change(&self, request: Request<v1::UndoChangeRequest>) -> Result<Response<v1::UndoChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "UndoChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        call.on_disk(move |_| {
            target.edit(request.base_revision.map(Revision), Edit::Undo, open, |made| {
                let Steps { undo, redo } = made.steps();
                v1::UndoChangeResponse { revision: made.next.revision.0, undo_steps: undo as u32, redo_steps: redo as u32 }
            })
        })
        .await
    }

    async fn redo_change(&self, request: Request<v1::RedoChangeRequest>) -> Result<Response<v1::RedoChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "RedoChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        call.on_disk(move |_| {
            target.edit(request.base_revision.map(Revision), Edit::Redo, open, |made| {
                let Steps { undo, redo } = made.steps();
                v1::RedoChangeResponse { revision: made.next.revision.0, undo_steps: undo as u32, redo_steps: redo as u32 }
            })
        })
        .await
    }

    type WatchSessionStream = Watch<v1::WatchSessionResponse>;

    async fn watch_session(&self, request: Request<v1::WatchSessionRequest>) -> Result<Response<Self::WatchSessionStream>, Status> {
        let call = Call::begin(&self.0, "WatchSession", &request)?;
        let watched = watch(&self.0, &request.into_inner(), call.caller(), call.time_left());
        call.finish(watched)
    }

    type SnapshotSessionStream = Watch<v1::SnapshotSessionResponse>;

    async fn snapshot_session(
        &self,
        request: Request<v1::SnapshotSessionRequest>,
    ) -> Result<Response<Self::SnapshotSessionStream>, Status> {
        let call = Call::begin(&self.0, "SnapshotSession", &request)?;
        let written = transfer::snapshot(&self.0, &request.into_inner().session, call.caller());
        call.finish(written)
    }

    async fn restore_session(
        &self,
        request: Request<Streaming<v1::RestoreSessionRequest>>,
    ) -> Result<Response<v1::RestoreSessionResponse>, Status> {
        let call = Call::begin(&self.0, "RestoreSession", &request)?;
        let (call, restored) = transfer::restore(call, &self.0, request.into_inner()).await;
        let response = restored.map(|(session, desk)| v1::RestoreSessionResponse { session: Some(whole(&session, &desk)) });
        call.finish(response)
    }
}
