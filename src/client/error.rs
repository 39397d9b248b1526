//! Errors of calls, decoded: what went wrong, which fields, where on the surface, and when to try again.

use prost::Message;
use remesh_proto::{ERROR_DOMAIN, GEOMETRY_LOCATIONS_TYPE_URL, v1};
use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Result of every call.
pub type Result<T> = std::result::Result<T, ClientError>;

/// Why a call did not succeed.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The endpoint is not a URL that can be connected to.
    #[error("'{endpoint}' is not an endpoint: {cause} (expected something like http://127.0.0.1:50061)")]
    BadEndpoint {
        /// What was given.
        endpoint: String,
        /// What is wrong with it.
        cause: String,
    },
    /// No daemon answers, or the connection broke.
    #[error("cannot reach the daemon{}: {cause}", at(.endpoint))]
    Unreachable {
        /// Where it was looked for, if known.
        endpoint: Option<String>,
        /// What happened.
        cause: String,
    },
    /// The daemon answered with an error.
    #[error("{0}")]
    Call(Box<CallError>),
    /// The answer does not follow the protocol: another version, or a bug of the daemon.
    #[error("the daemon sent an answer that does not follow the protocol: {0}")]
    Protocol(String),
}

fn at(endpoint: &Option<String>) -> String {
    endpoint.as_ref().map(|e| format!(" at {e}")).unwrap_or_default()
}

impl ClientError {
    /// The decoded error of the daemon, if it was one.
    pub fn call(&self) -> Option<&CallError> {
        match self {
            ClientError::Call(call) => Some(call),
            _ => None,
        }
    }

    /// The stable reason (`NON_MANIFOLD_EDGE`, `SESSION_NOT_FOUND`, ...) if the daemon gave one.
    pub fn reason(&self) -> Option<&str> {
        self.call()?.reason.as_deref()
    }

    /// An answer that does not follow the protocol.
    pub(crate) fn protocol(what: impl Into<String>) -> Self {
        ClientError::Protocol(what.into())
    }
}

/// A field of the request that was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldError {
    /// Path of the field, as in `size.graded.growth_rate`.
    pub field: String,
    /// What is wrong with it.
    pub description: String,
}

/// What the ids of a [`Place`] are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceElement {
    /// One vertex.
    Vertex,
    /// The two vertices of an edge.
    Edge,
    /// One face.
    Face,
    /// A kind this client does not know.
    Unknown,
}

/// A place on the surface: an element of the imported mesh and a point of it, in the unit of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// What `ids` are.
    pub element: PlaceElement,
    /// Indices in the imported mesh.
    pub ids: Vec<u32>,
    /// A point of the element.
    pub position: [f64; 3],
}

impl From<&v1::Location> for Place {
    fn from(location: &v1::Location) -> Self {
        let element = match location.element() {
            v1::ElementKind::Vertex => PlaceElement::Vertex,
            v1::ElementKind::Edge => PlaceElement::Edge,
            v1::ElementKind::Face => PlaceElement::Face,
            v1::ElementKind::Unspecified => PlaceElement::Unknown,
        };
        let point = location.position.unwrap_or_default();
        Place { element, ids: location.ids.clone(), position: [point.x, point.y, point.z] }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ids: Vec<String> = self.ids.iter().map(u32::to_string).collect();
        let name = match self.element {
            PlaceElement::Vertex => "vertex",
            PlaceElement::Edge => "edge",
            PlaceElement::Face => "face",
            PlaceElement::Unknown => "element",
        };
        let [x, y, z] = self.position;
        write!(f, "{name} {} at ({}, {}, {})", ids.join("-"), Short(x), Short(y), Short(z))
    }
}

/// A number with six significant digits: enough to find a place, at any scale.
pub(crate) struct Short(pub(crate) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 || !self.0.is_finite() {
            return write!(f, "{}", self.0);
        }
        let magnitude = self.0.abs().log10().floor();
        if !(-4.0..9.0).contains(&magnitude) {
            return write!(f, "{:.5e}", self.0);
        }
        let digits = (5.0 - magnitude).max(0.0) as usize;
        let text = format!("{:.digits$}", self.0);
        let trimmed = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        f.write_str(trimmed)
    }
}

/// An error that the daemon answered with.
#[derive(Debug, Clone, PartialEq)]
pub struct CallError {
    /// The status code.
    pub code: Code,
    /// Stable reason (`google.rpc.ErrorInfo`); `None` if the error does not come from a remeshd.
    pub reason: Option<String>,
    /// What happened.
    pub message: String,
    /// What to do about it, if known.
    pub hint: Option<String>,
    /// Values that belong to the reason.
    pub metadata: BTreeMap<String, String>,
    /// Fields of the request that are wrong.
    pub fields: Vec<FieldError>,
    /// How long to wait before trying again, where that helps.
    pub retry_after: Option<Duration>,
    /// Where on the surface the cause lies; the first places.
    pub places: Vec<Place>,
    /// How many places there are in all.
    pub place_total: u64,
}

/// Metadata key of what to do about an error.
const HINT_KEY: &str = "hint";

/// Places that are printed; the others are counted.
const PRINTED_PLACES: usize = 5;

impl CallError {
    /// Decodes a status with its details. Details that cannot be decoded are left out.
    pub fn from_status(status: &Status) -> Self {
        let details = status.get_error_details();
        let info = details.error_info().filter(|info| info.domain == ERROR_DOMAIN);
        let mut metadata: BTreeMap<String, String> =
            info.map(|info| info.metadata.iter().map(|(k, v)| (k.clone(), v.clone())).collect()).unwrap_or_default();
        let fields = details.bad_request().map(|bad| bad.field_violations.as_slice()).unwrap_or_default();
        let (places, place_total) = places_of(status);
        CallError {
            code: status.code(),
            reason: info.map(|info| info.reason.clone()),
            message: if places.is_empty() { status.message().to_owned() } else { without_first_place(status.message()) },
            hint: metadata.remove(HINT_KEY).filter(|hint| !hint.is_empty()),
            metadata,
            fields: fields.iter().map(|v| FieldError { field: v.field.clone(), description: v.description.clone() }).collect(),
            retry_after: details.retry_info().and_then(|retry| retry.retry_delay),
            places,
            place_total,
        }
    }
}

/// The message of a daemon names the first place in brackets, for clients that do not decode the places; here they are listed.
fn without_first_place(message: &str) -> String {
    let cut = message.find(" (first of ").and_then(|start| Some((start, start + message[start..].find(')')?)));
    match cut {
        Some((start, end)) => format!("{}{}", &message[..start], &message[end + 1..]),
        None => message.to_owned(),
    }
}

fn places_of(status: &Status) -> (Vec<Place>, u64) {
    let Ok(decoded) = tonic_types::Status::decode(status.details()) else { return (Vec::new(), 0) };
    let found = decoded.details.iter().find(|any| any.type_url == GEOMETRY_LOCATIONS_TYPE_URL);
    let Some(Ok(locations)) = found.map(|any| v1::GeometryLocations::decode(any.value.as_slice())) else {
        return (Vec::new(), 0);
    };
    let places: Vec<Place> = locations.locations.iter().map(Place::from).collect();
    let total = locations.total.max(places.len() as u64);
    (places, total)
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.message.is_empty() { self.code.description() } else { &self.message })?;
        if let Some(reason) = &self.reason {
            write!(f, " [{reason}]")?;
        }
        for field in self.fields.iter().filter(|field| !self.message.contains(&field.description)) {
            write!(f, "\n  field {}: {}", field.field, field.description)?;
        }
        for place in self.places.iter().take(PRINTED_PLACES) {
            write!(f, "\n  {place}")?;
        }
        let printed = self.places.len().min(PRINTED_PLACES) as u64;
        if self.place_total > printed {
            write!(f, "\n  and {} more", self.place_total - printed)?;
        }
        if let Some(wait) = self.retry_after {
            write!(f, "\n  try again in {:.0} s", wait.as_secs_f64().max(1.0))?;
        }
        if let Some(hint) = self.hint.as_ref().filter(|hint| !self.message.contains(hint.as_str())) {
            write!(f, "\n  {hint}")?;
        }
        Ok(())
    }
}

impl From<Status> for ClientError {
    fn from(status: Status) -> Self {
        let call = CallError::from_status(&status);
        // A daemon that shuts down answers UNAVAILABLE with a reason; without one the status was made on this side. So was one with a cause.
        let is_broken = call.code == Code::Unavailable || std::error::Error::source(&status).is_some();
        if is_broken && call.reason.is_none() {
            return ClientError::Unreachable { endpoint: None, cause: root_cause(&status) };
        }
        ClientError::Call(Box::new(call))
    }
}

/// The innermost cause of an error: the outer ones of a broken connection only say "transport error".
pub(crate) fn root_cause(error: &(dyn std::error::Error + 'static)) -> String {
    let mut current = error;
    while let Some(source) = current.source() {
        current = source;
    }
    match current.downcast_ref::<Status>() {
        Some(status) => status.message().to_owned(),
        None => current.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use prost_types::Any;
    use std::collections::HashMap;
    use tonic_types::{BadRequest, ErrorDetails, ErrorInfo, RetryInfo};

    fn with_details(code: Code, message: &str, details: Vec<Any>) -> Status {
        let inner = tonic_types::Status { code: code as i32, message: message.into(), details };
        Status::with_details(code, message, Bytes::from(inner.encode_to_vec()))
    }

    fn any(type_url: &str, value: Vec<u8>) -> Any {
        Any { type_url: type_url.into(), value }
    }

    fn info(reason: &str, metadata: &[(&str, &str)]) -> Any {
        let metadata = metadata.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect::<HashMap<_, _>>();
        let message = tonic_types::pb::ErrorInfo { reason: reason.into(), domain: ERROR_DOMAIN.into(), metadata };
        any(ErrorInfo::TYPE_URL, message.encode_to_vec())
    }

    #[test]
    fn geometry_is_decoded_and_printed_with_ids_and_coordinates() {
        let location = |a, b, x| v1::Location {
            element: v1::ElementKind::Edge.into(),
            ids: vec![a, b],
            position: Some(v1::Point { x, y: -0.5, z: 1e-7 }),
        };
        let locations = v1::GeometryLocations { locations: (0..7).map(|i| location(i, 9, 12.345678)).collect(), total: 250 };
        let details = vec![
            info("NON_MANIFOLD_EDGE", &[("hint", "Split the edge or delete a face."), ("count", "250")]),
            any(GEOMETRY_LOCATIONS_TYPE_URL, locations.encode_to_vec()),
        ];
        let error = ClientError::from(with_details(
            Code::FailedPrecondition,
            "250 edges have more than two faces (first of 250: Edge [0, 9] at 12.345678, -0.5, 1e-7)",
            details,
        ));
        assert_eq!(error.reason(), Some("NON_MANIFOLD_EDGE"));
        let call = error.call().expect("an error of a call");
        assert_eq!((call.places.len(), call.place_total), (7, 250));
        assert_eq!(call.places[3], Place { element: PlaceElement::Edge, ids: vec![3, 9], position: [12.345678, -0.5, 1e-7] });
        assert_eq!(call.metadata.get("count").map(String::as_str), Some("250"));
        let text = error.to_string();
        assert!(text.starts_with("250 edges have more than two faces [NON_MANIFOLD_EDGE]\n"), "{text}");
        assert!(text.contains("edge 0-9 at (12.3457, -0.5, 1.00000e-7)"), "{text}");
        assert!(text.contains("and 245 more"), "{text}");
        assert!(text.ends_with("Split the edge or delete a face."), "{text}");
    }

    #[test]
    fn fields_and_retry_are_decoded() {
        let mut details = ErrorDetails::new();
        details.set_error_info("BAD_PARAMETER", ERROR_DOMAIN, HashMap::new());
        details.add_bad_request_violation("size.uniform", "must be positive, not -1");
        details.set_retry_info(Some(Duration::from_secs(3)));
        let error = ClientError::from(Status::with_error_details(Code::InvalidArgument, "the size is wrong", details));
        let call = error.call().expect("an error of a call");
        assert_eq!(call.fields, [FieldError { field: "size.uniform".into(), description: "must be positive, not -1".into() }]);
        assert_eq!(call.retry_after, Some(Duration::from_secs(3)));
        let text = error.to_string();
        assert!(text.contains("field size.uniform: must be positive, not -1") && text.contains("try again in 3 s"), "{text}");
        let _ = (BadRequest::TYPE_URL, RetryInfo::TYPE_URL);
    }

    #[test]
    fn statuses_of_other_origin_are_told_apart() {
        let plain = ClientError::from(Status::unavailable("tcp connect error"));
        assert!(matches!(plain, ClientError::Unreachable { .. }), "{plain}");
        let shutting_down = with_details(Code::Unavailable, "shutting down", vec![info("SHUTTING_DOWN", &[])]);
        assert_eq!(ClientError::from(shutting_down).reason(), Some("SHUTTING_DOWN"));
        let foreign = Any {
            type_url: ErrorInfo::TYPE_URL.into(),
            value: tonic_types::pb::ErrorInfo { reason: "X".into(), domain: "example.com".into(), metadata: HashMap::new() }
                .encode_to_vec(),
        };
        assert_eq!(ClientError::from(with_details(Code::Internal, "proxy", vec![foreign])).reason(), None);
    }

    #[test]
    fn undecodable_details_leave_the_message() {
        let status = Status::with_details(Code::Internal, "broken", Bytes::from_static(b"\xff\xff\xff"));
        assert_eq!(ClientError::from(status).to_string(), "broken");
        let garbage = vec![any(GEOMETRY_LOCATIONS_TYPE_URL, vec![0xff; 5]), info("INVARIANT", &[])];
        let error = ClientError::from(with_details(Code::Internal, "bug", garbage));
        assert_eq!((error.reason(), error.call().map(|c| c.place_total)), (Some("INVARIANT"), Some(0)));
    }

    #[test]
    fn coordinates_are_short() {
        let shown = |x: f64| Short(x).to_string();
        assert_eq!(
            [shown(0.0), shown(1.0), shown(-1234.5678), shown(0.001234567), shown(3.0e12), shown(f64::NAN), shown(100.0)],
            ["0", "1", "-1234.57", "0.00123457", "3.00000e12", "NaN", "100"]
        );
    }
}
