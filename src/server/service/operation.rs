//! `OperationService`: long work that outlives the call that started it.

use super::quality::measure;
use super::remesh::{check_listed, remesh_all, remesh_listed};
use crate::answers::open_edit;
use crate::convert::from_proto;
use crate::dispatch::Call;
use crate::operations::Operation;
use crate::state::{Shared, Target, session_name};
use crate::status::Fault;
use remesh_engine::EngineError;
use remesh_engine::error::Result as EngineResult;
use remesh_engine::pipeline::Run;
use remesh_proto::v1;
use remesh_proto::v1::operation_service_server::OperationService;
use std::sync::Arc;
use std::time::Duration;
use tonic::{Request, Response, Status};
use v1::operation::Outcome;
use v1::start_operation_request::Work;

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct OperationsService(pub(crate) Arc<Shared>);

const DEFAULT_WAIT: Duration = Duration::from_secs(30);
const LONGEST_WAIT: Duration = Duration::from_secs(3600);
/// So much earlier than the deadline of the call a wait answers.
const BEFORE_DEADLINE: Duration = Duration::from_millis(20);

/// The session and the number in the name of an operation.
fn parsed(name: &str) -> EngineResult<(&str, u64)> {
    if name.is_empty() {
        return Err(EngineError::bad_parameter("name", "is required"));
    }
    let parts = name.split_once("/operations/").and_then(|(session, number)| Some((session, number.parse().ok()?)));
    parts.ok_or_else(|| EngineError::bad_parameter("name", "an operation is named `sessions/{id}/operations/{number}`"))
}

/// The operation of a name, and the name of its session.
fn find(shared: &Shared, call: &Call, name: &str) -> Result<(String, Arc<Operation>), Fault> {
    let (session, number) = parsed(name)?;
    let (session, desk) = shared.session(session, "name", call.caller())?;
    let found = desk.operations.find(number);
    Ok((session_name(&session), found.ok_or(Fault::OperationNotFound { number })?))
}

fn carry_out(shared: &Shared, run: &Run<'_>, target: &Target, work: Work) -> EngineResult<Outcome> {
    match work {
        Work::Remesh(v1::RemeshWork { patches }) if patches.is_empty() => remesh_all(shared, run, &target.snapshot).map(Outcome::Remesh),
        Work::Remesh(v1::RemeshWork { patches }) => remesh_listed(shared, run, &target.snapshot, &patches).map(Outcome::Remesh),
        Work::Quality(v1::QualityWork { scope }) => {
            let measured = measure(shared, run, target, scope)?;
            measured.report.map(Outcome::Quality).ok_or_else(|| EngineError::invariant("a measure without a report"))
        }
    }
}

fn check_work(work: Option<Work>) -> EngineResult<Work> {
    let work = work.ok_or_else(|| EngineError::bad_parameter("work", "is required"))?;
    match &work {
        Work::Remesh(remesh) => check_listed(&remesh.patches)?,
        Work::Quality(quality) => drop(from_proto::scope(quality.scope, "quality.scope")?),
    }
    Ok(work)
}

/// A copy without its result.
fn brief(mut operation: v1::Operation) -> v1::Operation {
    if !matches!(operation.outcome, Some(Outcome::Error(_))) {
        operation.outcome = None;
    }
    operation
}

#[tonic::async_trait]
impl OperationService for OperationsService {
    async fn start_operation(&self, request: Request<v1::StartOperationRequest>) -> Result<Response<v1::StartOperationResponse>, Status> {
        let mut call = Call::begin(&self.0, "StartOperation", &request)?;
        let request = request.into_inner();
        let open = open_edit!(call, request);
        let target = call.target_of_edit(&request.session, request.expected_revision, &open)?;
        let work = call.check(check_work(request.work))?;
        let name = session_name(&target.session);
        let started = call.start(&target, move |shared, run, target| carry_out(shared, run, target, work));
        let answer = started.map(|operation| open.keep(v1::StartOperationResponse { operation: Some(operation.told(&name)) }));
        call.finish(answer)
    }

    async fn get_operation(&self, request: Request<v1::GetOperationRequest>) -> Result<Response<v1::GetOperationResponse>, Status> {
        let call = Call::begin(&self.0, "GetOperation", &request)?;
        let found = find(&self.0, &call, &request.into_inner().name);
        let answer = found.map(|(session, operation)| v1::GetOperationResponse { operation: Some(operation.told(&session)) });
        call.finish(answer)
    }

    async fn list_operations(&self, request: Request<v1::ListOperationsRequest>) -> Result<Response<v1::ListOperationsResponse>, Status> {
        let call = Call::begin(&self.0, "ListOperations", &request)?;
        let found = self.0.session(&request.into_inner().session, "session", call.caller());
        let answer = found.map(|(session, desk)| {
            let name = session_name(&session);
            v1::ListOperationsResponse { operations: desk.operations.all().iter().map(|o| brief(o.told(&name))).collect() }
        });
        call.finish(answer.map_err(Into::into))
    }

    async fn wait_operation(&self, request: Request<v1::WaitOperationRequest>) -> Result<Response<v1::WaitOperationResponse>, Status> {
        let mut call = Call::begin(&self.0, "WaitOperation", &request)?;
        let request = request.into_inner();
        let timeout = request.timeout.map(|timeout| from_proto::duration(timeout, "timeout")).transpose();
        let timeout = call.check(timeout)?.unwrap_or(DEFAULT_WAIT).min(LONGEST_WAIT);
        let left = call.time_left().map_or(timeout, |left| left.saturating_sub(BEFORE_DEADLINE));
        let found = find(&self.0, &call, &request.name);
        let (session, operation) = match found {
            Ok(found) => found,
            Err(fault) => return call.finish(Err(fault)),
        };
        // A timeout is an answer, too: the operation as it stands then.
        let _ = tokio::time::timeout(timeout.min(left), operation.ended()).await;
        call.finish(Ok(v1::WaitOperationResponse { operation: Some(operation.told(&session)) }))
    }

    async fn cancel_operation(
        &self,
        request: Request<v1::CancelOperationRequest>,
    ) -> Result<Response<v1::CancelOperationResponse>, Status> {
        let call = Call::begin(&self.0, "CancelOperation", &request)?;
        let found = find(&self.0, &call, &request.into_inner().name);
        let answer = found.map(|(session, operation)| {
            operation.cancel();
            tracing::info!(target: "audit", action = "cancel", session = session.get(9..17), author = call.caller().name());
            v1::CancelOperationResponse { operation: Some(operation.told(&session)) }
        });
        call.finish(answer)
    }
}
