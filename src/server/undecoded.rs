//! Errors of messages that the transport could not decode, which no method ever sees, in the form of all others.

use crate::status::{Fault, status_of};
use remesh_engine::error::{EngineError, Reason};
use std::task::{Context, Poll};
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::server::NamedService;
use tonic::{Code, Status};

/// A service whose refusals of undecodable messages are typed.
#[derive(Debug, Clone)]
pub(crate) struct Undecoded<S>(pub(crate) S);

impl<S: NamedService> NamedService for Undecoded<S> {
    const NAME: &'static str = S::NAME;
}

impl<S, B> Service<http::Request<B>> for Undecoded<S>
where
    S: Service<http::Request<B>, Response = http::Response<Body>>,
    S::Future: Send + 'static,
{
    type Response = S::Response;
    type Error = S::Error;
    type Future = BoxFuture<Self::Response, Self::Error>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.0.poll_ready(context)
    }

    fn call(&mut self, request: http::Request<B>) -> Self::Future {
        let answer = self.0.call(request);
        Box::pin(async move { answer.await.map(typed) })
    }
}

/// The answer, with details if it refuses a message that could not be decoded. Its words are those of tonic; a test notices if they change.
fn typed(response: http::Response<Body>) -> http::Response<Body> {
    let Some(status) = Status::from_header_map(response.headers()) else { return response };
    match fault_of(&status) {
        Some(fault) => status_of(&fault).into_http(),
        None => response,
    }
}

fn fault_of(status: &Status) -> Option<Fault> {
    let told = status.message();
    if !status.details().is_empty() {
        return None;
    }
    let error = match status.code() {
        Code::Internal if told.starts_with("failed to decode Protobuf message") => {
            EngineError::new(Reason::BadParameter, format!("the request is not a message of this method: {told}"))
        }
        Code::OutOfRange if told.contains("message length too large") => {
            EngineError::new(Reason::LimitReached, format!("the request is too large: {told}")).with_hint("send files by UploadMesh")
        }
        _ => return None,
    };
    Some(Fault::Engine(error))
}
