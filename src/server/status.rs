//! The one place that makes a `tonic::Status`: engine errors and faults of the service to canonical codes with typed details.

use prost::Message;
use remesh_engine::error::{Element, EngineError, ErrorKind, Location};
use remesh_proto::{ERROR_DOMAIN, GEOMETRY_LOCATIONS_TYPE_URL, v1};
use std::collections::HashMap;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::pb;

/// Why a call failed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Fault {
    /// The engine refused or failed.
    Engine(EngineError),
    /// Too many calls wait already.
    QueueFull {
        /// How many wait.
        queued: usize,
    },
    /// A client has, or asks for, more than one client may have.
    ClientLimit {
        /// Name of the limit.
        limit: &'static str,
        /// How much it is.
        most: u64,
    },
    /// The session has no such operation.
    OperationNotFound {
        /// Its number.
        number: u64,
    },
    /// As many streams of events are open as may be.
    TooManyWatchers {
        /// How many.
        most: usize,
    },
    /// Nobody that the server knows.
    Unauthenticated {
        /// Stable reason.
        reason: &'static str,
        /// And in words.
        message: String,
    },
    /// The server is shutting down.
    Draining,
    /// The computation panicked; the log has the details under this id.
    Panicked {
        /// Opaque id.
        id: String,
    },
    /// The client broke off an upload, or a message of it could not be decoded.
    UploadBroken {
        /// What the transport says.
        code: Code,
        /// And why.
        cause: String,
    },
    /// An upload ended before all of it came; it may be gone on with.
    UploadIncomplete {
        /// Bytes that were announced.
        announced: u64,
        /// Bytes that came.
        received: u64,
    },
    /// An upload goes on where nothing ended.
    UploadOffset {
        /// Bytes that have arrived.
        received: u64,
    },
    /// The file does not have the digest that the client expected.
    DigestMismatch {
        /// The digest it has.
        actual: String,
    },
}

impl From<EngineError> for Fault {
    fn from(error: EngineError) -> Self {
        Fault::Engine(error)
    }
}

/// When a client that found the server full may try again.
const RETRY_DELAY: Duration = Duration::from_secs(2);

const RETRY_INFO: &str = "type.googleapis.com/google.rpc.RetryInfo";
const ERROR_INFO: &str = "type.googleapis.com/google.rpc.ErrorInfo";
const BAD_REQUEST: &str = "type.googleapis.com/google.rpc.BadRequest";

/// What a status is made of.
struct Parts {
    code: Code,
    reason: &'static str,
    message: String,
    metadata: Vec<(String, String)>,
    retry: bool,
}

/// The status of a fault.
pub(crate) fn status_of(fault: &Fault) -> Status {
    let parts = parts_of(fault);
    let mut details = vec![any(
        ERROR_INFO,
        &pb::ErrorInfo {
            reason: parts.reason.to_owned(),
            domain: ERROR_DOMAIN.to_owned(),
            metadata: parts.metadata.iter().cloned().collect::<HashMap<_, _>>(),
        },
    )];
    if parts.code == Code::InvalidArgument {
        let violations: Vec<_> =
            parts.metadata.iter().filter(|(key, _)| key == "field").map(|(_, field)| violation(field, &parts)).collect();
        if !violations.is_empty() {
            details.push(any(BAD_REQUEST, &pb::BadRequest { field_violations: violations }));
        }
    }
    if parts.retry {
        let retry_delay = prost_types::Duration::try_from(RETRY_DELAY).ok();
        details.push(any(RETRY_INFO, &pb::RetryInfo { retry_delay }));
    }
    if let Fault::Engine(error) = fault
        && let Some(detail) = geometry_locations(error)
    {
        details.push(any(GEOMETRY_LOCATIONS_TYPE_URL, &detail));
    }
    let whole = pb::Status { code: parts.code as i32, message: parts.message.clone(), details };
    Status::with_details(parts.code, parts.message, whole.encode_to_vec().into())
}

fn any(type_url: &str, detail: &impl Message) -> prost_types::Any {
    prost_types::Any { type_url: type_url.to_owned(), value: detail.encode_to_vec() }
}

fn violation(field: &str, parts: &Parts) -> pb::bad_request::FieldViolation {
    pb::bad_request::FieldViolation {
        field: field.to_owned(),
        description: parts.message.clone(),
        reason: parts.reason.to_owned(),
        localized_message: None,
    }
}

fn parts_of(fault: &Fault) -> Parts {
    let plain = |code, reason, message: String| Parts { code, reason, message, metadata: Vec::new(), retry: false };
    match fault {
        Fault::Engine(error) => Parts {
            code: code_of(error.kind()),
            reason: error.reason().code(),
            message: error.to_string(),
            metadata: error.metadata().to_vec(),
            retry: error.kind() == ErrorKind::ResourceExhausted && error.metadata().iter().any(|(key, _)| key == "retry"),
        },
        Fault::QueueFull { queued } => Parts {
            metadata: vec![("queued".to_owned(), queued.to_string())],
            retry: true,
            ..plain(Code::ResourceExhausted, "QUEUE_FULL", format!("the daemon is busy: {queued} calls are waiting; try again later"))
        },
        Fault::ClientLimit { limit, most } => Parts {
            metadata: vec![("limit".to_owned(), (*limit).to_owned()), ((*limit).to_owned(), most.to_string())],
            retry: true,
            ..plain(
                Code::ResourceExhausted,
                "LIMIT_REACHED",
                format!("one client may have {most}, no more ({limit}); try again when less is on"),
            )
        },
        Fault::OperationNotFound { number } => {
            let message = format!("the session has no operation {number}: it was never started, or ended long ago");
            plain(Code::NotFound, "OPERATION_NOT_FOUND", message)
        }
        Fault::TooManyWatchers { most } => Parts {
            metadata: vec![("limit".to_owned(), "max_watchers".to_owned())],
            retry: true,
            ..plain(Code::ResourceExhausted, "LIMIT_REACHED", format!("{most} streams of events are open, which is the limit"))
        },
        Fault::Unauthenticated { reason, message } => plain(Code::Unauthenticated, reason, message.clone()),
        Fault::Draining => plain(Code::Unavailable, "SHUTTING_DOWN", "the daemon is shutting down".to_owned()),
        Fault::Panicked { id } => Parts {
            metadata: vec![("incident".to_owned(), id.clone())],
            ..plain(Code::Internal, "PANIC", format!("a bug stopped this call; the daemon's log tells more under {id}"))
        },
        Fault::UploadBroken { code, cause } => plain(*code, "UPLOAD_BROKEN", format!("the upload ended early: {cause}")),
        Fault::UploadIncomplete { announced, received } => Parts {
            metadata: vec![("field".to_owned(), "total_bytes".to_owned()), ("received_bytes".to_owned(), received.to_string())],
            ..plain(Code::InvalidArgument, "BAD_PARAMETER", format!("total_bytes: {announced} bytes were announced, {received} came"))
        },
        Fault::UploadOffset { received } => Parts {
            metadata: vec![("field".to_owned(), "offset".to_owned()), ("received_bytes".to_owned(), received.to_string())],
            ..plain(Code::InvalidArgument, "UPLOAD_OFFSET", format!("offset: {received} bytes of this file have arrived"))
        },
        Fault::DigestMismatch { actual } => Parts {
            metadata: vec![("field".to_owned(), "expected_digest".to_owned()), ("actual".to_owned(), actual.clone())],
            ..plain(Code::InvalidArgument, "DIGEST_MISMATCH", format!("expected_digest: the file has the digest {actual}"))
        },
    }
}

fn code_of(kind: ErrorKind) -> Code {
    match kind {
        ErrorKind::InvalidArgument => Code::InvalidArgument,
        ErrorKind::NotFound => Code::NotFound,
        ErrorKind::FailedPrecondition => Code::FailedPrecondition,
        ErrorKind::Aborted => Code::Aborted,
        ErrorKind::ResourceExhausted => Code::ResourceExhausted,
        ErrorKind::Cancelled => Code::Cancelled,
        ErrorKind::DeadlineExceeded => Code::DeadlineExceeded,
        ErrorKind::Unimplemented => Code::Unimplemented,
        ErrorKind::Internal => Code::Internal,
        ErrorKind::DataLoss => Code::DataLoss,
    }
}

/// The places of an error on the wire, if it has any.
pub(crate) fn geometry_locations(error: &EngineError) -> Option<v1::GeometryLocations> {
    let locations = || error.locations().iter().map(location).collect();
    (error.location_total() > 0).then(|| v1::GeometryLocations { locations: locations(), total: error.location_total() as u64 })
}

/// A place on the surface on the wire.
pub(crate) fn location(from: &Location) -> v1::Location {
    let element = match from.element {
        Element::Vertex => v1::ElementKind::Vertex,
        Element::Edge => v1::ElementKind::Edge,
        Element::Face => v1::ElementKind::Face,
    };
    let [x, y, z] = from.position;
    v1::Location { element: element.into(), ids: from.ids.clone(), position: Some(v1::Point { x, y, z }) }
}

/// Name of the status code of a fault, in metrics.
pub(crate) fn code_name(fault: &Fault) -> &'static str {
    match parts_of(fault).code {
        Code::Ok => "OK",
        Code::Cancelled => "Cancelled",
        Code::Unknown => "Unknown",
        Code::InvalidArgument => "InvalidArgument",
        Code::DeadlineExceeded => "DeadlineExceeded",
        Code::NotFound => "NotFound",
        Code::AlreadyExists => "AlreadyExists",
        Code::PermissionDenied => "PermissionDenied",
        Code::ResourceExhausted => "ResourceExhausted",
        Code::FailedPrecondition => "FailedPrecondition",
        Code::Aborted => "Aborted",
        Code::OutOfRange => "OutOfRange",
        Code::Unimplemented => "Unimplemented",
        Code::Internal => "Internal",
        Code::Unavailable => "Unavailable",
        Code::DataLoss => "DataLoss",
        Code::Unauthenticated => "Unauthenticated",
    }
}

/// A fault in an event.
#[derive(Debug, Default)]
pub(crate) struct Told {
    pub(crate) code: i32,
    pub(crate) reason: String,
    pub(crate) message: String,
}

impl Told {
    pub(crate) fn of(fault: &Fault) -> Self {
        let Parts { code, reason, message, .. } = parts_of(fault);
        Told { code: code as i32, reason: reason.to_owned(), message }
    }
}

/// Writes the end of a call to the log, at the level of who is to blame for it.
pub(crate) fn log_end(fault: Option<&Fault>, milliseconds: f64) {
    let Some(fault) = fault else { return tracing::info!(code = "OK", milliseconds, "call done") };
    let Parts { code: kind, reason, message, .. } = parts_of(fault);
    let code = format!("{kind:?}");
    match kind {
        Code::Cancelled => tracing::debug!(code, reason, milliseconds, "call cancelled"),
        Code::Internal | Code::Unknown | Code::DataLoss => tracing::error!(code, reason, message, milliseconds, "call failed"),
        Code::ResourceExhausted | Code::Unavailable | Code::DeadlineExceeded => {
            tracing::warn!(code, reason, message, milliseconds, "call refused")
        }
        _ => tracing::info!(code, reason, message, milliseconds, "call refused"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::error::Reason;
    use tonic_types::StatusExt;

    #[test]
    fn a_bad_field_is_told_as_reason_and_violation() {
        let status = status_of(&EngineError::bad_parameter("size.uniform", "must be positive").into());
        assert_eq!(status.code(), Code::InvalidArgument);
        let details = status.get_error_details();
        let info = details.error_info().expect("error info");
        assert_eq!((info.reason.as_str(), info.domain.as_str()), ("BAD_PARAMETER", ERROR_DOMAIN));
        assert_eq!(details.bad_request().expect("bad request").field_violations[0].field, "size.uniform");
    }

    #[test]
    fn places_come_as_a_detail_of_our_own() {
        let place = Location { element: Element::Edge, ids: vec![3, 4], position: [1.0, 2.0, 3.0] };
        let error = EngineError::new(Reason::NonManifoldEdge, "edge").with_locations(vec![place; 150]);
        let status = status_of(&error.into());
        let whole = pb::Status::decode(status.details()).expect("google.rpc.Status");
        let detail = whole.details.iter().find(|d| d.type_url == GEOMETRY_LOCATIONS_TYPE_URL).expect("locations");
        let locations = v1::GeometryLocations::decode(&*detail.value).expect("decodes");
        assert_eq!((locations.total, locations.locations.len()), (150, 100));
        assert_eq!(locations.locations[0].ids, [3, 4]);
    }

    /// Texts in UPPER_SNAKE of a source file.
    fn reasons(source: &str) -> Vec<&str> {
        let snake = |text: &&str| text.len() > 4 && text.bytes().all(|b| b.is_ascii_uppercase() || b == b'_');
        source.split('"').filter(snake).collect()
    }

    #[test]
    fn every_reason_is_in_the_list_for_people() {
        let list = include_str!("../../docs/errors.md");
        let ours = include_str!("status.rs").split("#[cfg(test)]").next().expect("code");
        let sources = [include_str!("../engine/error.rs"), ours, include_str!("security.rs")];
        let all: Vec<&str> = sources.into_iter().flat_map(reasons).collect();
        assert!(all.len() > 30 && all.contains(&"STALE_REVISION") && all.contains(&"TOKEN_MISSING"), "{all:?}");
        for reason in all {
            assert!(list.contains(&format!("`{reason}`")), "{reason} is not in docs/errors.md");
        }
    }

    #[test]
    fn a_full_queue_tells_when_to_retry() {
        let details = status_of(&Fault::QueueFull { queued: 3 }).get_error_details();
        assert_eq!(details.retry_info().and_then(|r| r.retry_delay), Some(RETRY_DELAY));
    }
}
