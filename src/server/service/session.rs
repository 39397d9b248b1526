//! `SessionService`: the life of sessions and changes of their inputs.

use super::partition::check_patch;
use crate::answers::open_edit;
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
use remesh_engine::session::{Edit, Revision, Session, Steps};
use remesh_proto::v1;
use remesh_proto::v1::session_service_server::SessionService;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tonic::{Request, Response, Status};

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

fn create(
    shared: &Shared,
    request: v1::CreateSessionRequest,
    caller: &Caller,
    client: &Arc<str>,
) -> Result<v1::CreateSessionResponse, Fault> {
    if request.display_name.chars().count() > MAX_DISPLAY_NAME {
        return Err(EngineError::bad_parameter("display_name", format!("has more than {MAX_DISPLAY_NAME} characters")).into());
    }
    let ttl = request.ttl.map(|ttl| bounded_ttl(shared, ttl)).transpose()?;
    // Expired sessions must not keep new ones out.
    shared.sweep();
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
    session.set_ttl(bounded_ttl(shared, ttl)?);
    Ok(v1::UpdateSessionResponse { session: Some(whole(&session, &desk)) })
}

fn delete(shared: &Shared, request: &v1::DeleteSessionRequest, caller: &Caller) -> EngineResult<v1::DeleteSessionResponse> {
    let (session, _) = shared.session(&request.name, "name", caller)?;
    shared.delete_session(&session, caller)?;
    Ok(v1::DeleteSessionResponse { revision: session.revision().0 })
}

/// Undoes or redoes; gives the new revision and how far both reach now.
fn step(target: &Target, base: Option<u64>, edit: Edit<'_>) -> EngineResult<(u64, u32, u32)> {
    let revision = target.edit(base.map(Revision), edit)?;
    let Steps { undo, redo } = target.session.steps();
    Ok((revision.0, undo as u32, redo as u32))
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

/// Applies a size that names patches by number.
fn apply_patch_sizes(
    shared: &Shared,
    run: &Run<'_>,
    target: &Target,
    request: v1::ApplyChangeRequest,
) -> EngineResult<v1::ApplyChangeResponse> {
    let mut change = request.change;
    let layout = pipeline::layout(&shared.engine, &target.snapshot, run)?.value;
    if let Some(v1::change::Change::Size(spec)) = change.as_mut().and_then(|c| c.change.as_mut()) {
        sizes::name_patches(spec, |number| Ok(layout.patches.identities[check_patch(&layout, number)?]))?;
    }
    let change = from_proto::change(&shared.engine, change)?;
    // On the revision that the numbers were looked up in: in another one they may be other patches.
    let revision = target.apply(Some(target.snapshot.revision), &[change])?;
    Ok(v1::ApplyChangeResponse { revision: revision.0 })
}

#[tonic::async_trait]
impl SessionService for Sessions {
    async fn create_session(&self, request: Request<v1::CreateSessionRequest>) -> Result<Response<v1::CreateSessionResponse>, Status> {
        let call = Call::begin(&self.0, "CreateSession", &request)?;
        let created = create(&self.0, request.into_inner(), call.caller(), call.client());
        call.finish(created)
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
        let updated = update(&self.0, request.into_inner(), call.caller());
        call.finish(updated.map_err(Into::into))
    }

    async fn delete_session(&self, request: Request<v1::DeleteSessionRequest>) -> Result<Response<v1::DeleteSessionResponse>, Status> {
        let call = Call::begin(&self.0, "DeleteSession", &request)?;
        let deleted = delete(&self.0, &request.into_inner(), call.caller());
        call.finish(deleted.map_err(Into::into))
    }

    async fn apply_change(&self, request: Request<v1::ApplyChangeRequest>) -> Result<Response<v1::ApplyChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "ApplyChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        if names_patches(request.change.as_ref()) {
            let work =
                move |shared: &Shared, run: &Run<'_>| apply_patch_sizes(shared, run, &target, request).map(|answer| open.keep(answer));
            return call.compute(Intent::Long, work).await;
        }
        let apply = || {
            let change = from_proto::change(&self.0.engine, request.change)?;
            let revision = target.apply(request.base_revision.map(Revision), &[change])?;
            Ok(open.keep(v1::ApplyChangeResponse { revision: revision.0 }))
        };
        call.finish(apply().map_err(|error: EngineError| error.into()))
    }

    async fn undo_change(&self, request: Request<v1::UndoChangeRequest>) -> Result<Response<v1::UndoChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "UndoChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        let stepped = step(&target, request.base_revision, Edit::Undo)
            .map(|(revision, undo_steps, redo_steps)| open.keep(v1::UndoChangeResponse { revision, undo_steps, redo_steps }));
        call.finish(stepped.map_err(Into::into))
    }

    async fn redo_change(&self, request: Request<v1::RedoChangeRequest>) -> Result<Response<v1::RedoChangeResponse>, Status> {
        let mut call = Call::begin(&self.0, "RedoChange", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.base_revision, &open)?;
        let stepped = step(&target, request.base_revision, Edit::Redo)
            .map(|(revision, undo_steps, redo_steps)| open.keep(v1::RedoChangeResponse { revision, undo_steps, redo_steps }));
        call.finish(stepped.map_err(Into::into))
    }

    type WatchSessionStream = Watch<v1::WatchSessionResponse>;

    async fn watch_session(&self, request: Request<v1::WatchSessionRequest>) -> Result<Response<Self::WatchSessionStream>, Status> {
        let call = Call::begin(&self.0, "WatchSession", &request)?;
        let watched = watch(&self.0, &request.into_inner(), call.caller(), call.time_left());
        call.finish(watched)
    }
}
