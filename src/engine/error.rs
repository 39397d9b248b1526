//! The one error type of the engine: what went wrong, where on the surface, and what to do about it.

use std::fmt;

/// Result of every engine function that can fail.
pub type Result<T> = std::result::Result<T, EngineError>;

/// Who can recover from an error, and how; the server maps each kind to one gRPC status code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// A request field or a file is malformed; the same call always fails.
    InvalidArgument,
    /// The named thing does not exist (or has expired).
    NotFound,
    /// The state of the session does not allow the call (for example: the surface cannot be remeshed).
    FailedPrecondition,
    /// Somebody else changed the session first; read again and retry.
    Aborted,
    /// A limit on memory, size or count was reached.
    ResourceExhausted,
    /// The caller went away or asked to stop.
    Cancelled,
    /// The time the caller allowed has passed.
    DeadlineExceeded,
    /// Not built.
    Unimplemented,
    /// A bug: an invariant of the engine did not hold.
    Internal,
    /// What was kept is damaged or cannot be read.
    DataLoss,
}

/// Machine-readable cause of an error; its [`Reason::code`] is stable across releases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Reason {
    /// A parameter is out of range or contradictory.
    BadParameter,
    /// A file ends early or does not follow its format.
    FormatMalformed,
    /// The file format is unknown or a feature of it is not read.
    FormatUnsupported,
    /// A coordinate is NaN or infinite.
    NonFinite,
    /// An index points outside its array.
    IndexOutOfRange,
    /// No usable triangle is left.
    EmptyMesh,
    /// An edge has more than two faces.
    NonManifoldEdge,
    /// The faces around a vertex form more than one fan.
    NonManifoldVertex,
    /// The surface has no consistent orientation (for example a Moebius strip).
    NotOrientable,
    /// A patch is not of genus 0 with a boundary and could not be split further.
    PatchTopology,
    /// No bijective chart exists for the patch with the requested method.
    ChartFailed,
    /// A factorization met a pivot that is not positive, or its residual is too large.
    SolverSingular,
    /// The planar mesher could not mesh a chart.
    PlanarMeshFailed,
    /// The session does not hold a mesh yet.
    NoMesh,
    /// The named session does not exist.
    SessionNotFound,
    /// The session existed and has expired.
    SessionExpired,
    /// The named blob does not exist.
    BlobNotFound,
    /// The named patch does not exist.
    PatchNotFound,
    /// The base revision of a change is not the current one.
    StaleRevision,
    /// There is nothing to undo or to redo.
    NothingToStepTo,
    /// A memory, size or count limit was reached.
    LimitReached,
    /// There is no room to keep a change.
    StoreFull,
    /// A change could not be kept for another reason.
    StoreFailed,
    /// What is kept of a session cannot be read.
    SessionUnreadable,
    /// The file of a session is not whole, or not as it was written.
    SnapshotInvalid,
    /// The caller cancelled the work.
    Cancelled,
    /// The deadline passed.
    DeadlineExceeded,
    /// The method is not built.
    NotBuilt,
    /// An invariant of the engine did not hold.
    Invariant,
}

impl Reason {
    /// UPPER_SNAKE code for `google.rpc.ErrorInfo`.
    pub fn code(self) -> &'static str {
        match self {
            Reason::BadParameter => "BAD_PARAMETER",
            Reason::FormatMalformed => "FORMAT_MALFORMED",
            Reason::FormatUnsupported => "FORMAT_UNSUPPORTED",
            Reason::NonFinite => "NON_FINITE",
            Reason::IndexOutOfRange => "INDEX_OUT_OF_RANGE",
            Reason::EmptyMesh => "EMPTY_MESH",
            Reason::NonManifoldEdge => "NON_MANIFOLD_EDGE",
            Reason::NonManifoldVertex => "NON_MANIFOLD_VERTEX",
            Reason::NotOrientable => "NOT_ORIENTABLE",
            Reason::PatchTopology => "PATCH_TOPOLOGY",
            Reason::ChartFailed => "CHART_FAILED",
            Reason::SolverSingular => "SOLVER_SINGULAR",
            Reason::PlanarMeshFailed => "PLANAR_MESH_FAILED",
            Reason::NoMesh => "NO_MESH",
            Reason::SessionNotFound => "SESSION_NOT_FOUND",
            Reason::SessionExpired => "SESSION_EXPIRED",
            Reason::BlobNotFound => "BLOB_NOT_FOUND",
            Reason::PatchNotFound => "PATCH_NOT_FOUND",
            Reason::StaleRevision => "STALE_REVISION",
            Reason::NothingToStepTo => "NOTHING_TO_STEP_TO",
            Reason::LimitReached => "LIMIT_REACHED",
            Reason::StoreFull => "STORE_FULL",
            Reason::StoreFailed => "STORE_FAILED",
            Reason::SessionUnreadable => "SESSION_UNREADABLE",
            Reason::SnapshotInvalid => "SNAPSHOT_INVALID",
            Reason::Cancelled => "CANCELLED",
            Reason::DeadlineExceeded => "DEADLINE_EXCEEDED",
            Reason::NotBuilt => "NOT_BUILT",
            Reason::Invariant => "INVARIANT",
        }
    }

    /// The kind this reason belongs to.
    pub fn kind(self) -> ErrorKind {
        match self {
            Reason::BadParameter
            | Reason::FormatMalformed
            | Reason::FormatUnsupported
            | Reason::NonFinite
            | Reason::IndexOutOfRange
            | Reason::EmptyMesh
            | Reason::SnapshotInvalid => ErrorKind::InvalidArgument,
            Reason::NonManifoldEdge
            | Reason::NonManifoldVertex
            | Reason::NotOrientable
            | Reason::PatchTopology
            | Reason::ChartFailed
            | Reason::SolverSingular
            | Reason::PlanarMeshFailed
            | Reason::NoMesh
            | Reason::NothingToStepTo => ErrorKind::FailedPrecondition,
            Reason::SessionNotFound | Reason::SessionExpired | Reason::BlobNotFound | Reason::PatchNotFound => ErrorKind::NotFound,
            Reason::StaleRevision => ErrorKind::Aborted,
            Reason::LimitReached | Reason::StoreFull => ErrorKind::ResourceExhausted,
            Reason::SessionUnreadable => ErrorKind::DataLoss,
            Reason::Cancelled => ErrorKind::Cancelled,
            Reason::DeadlineExceeded => ErrorKind::DeadlineExceeded,
            Reason::NotBuilt => ErrorKind::Unimplemented,
            Reason::Invariant | Reason::StoreFailed => ErrorKind::Internal,
        }
    }
}

/// Which element an id of a [`Location`] names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Element {
    /// Vertex index.
    Vertex,
    /// Two vertex indices of an edge.
    Edge,
    /// Face (triangle) index.
    Face,
}

/// A place on a surface: the element and a coordinate a person can fly to.
#[derive(Debug, Clone, PartialEq)]
pub struct Location {
    /// What `ids` are.
    pub element: Element,
    /// One vertex, one face, or the two vertices of an edge.
    pub ids: Vec<u32>,
    /// A point of the element, in the units of the mesh.
    pub position: [f64; 3],
}

/// Most locations an error or a diagnosis carries; the total is always told beside them.
pub const MAX_LOCATIONS: usize = 100;

#[derive(Debug, Clone, PartialEq)]
struct ErrorData {
    reason: Reason,
    message: String,
    hint: String,
    locations: Vec<Location>,
    location_total: usize,
    metadata: Vec<(String, String)>,
}

/// An error of the engine. Cheap to move (one pointer).
#[derive(Debug, Clone, PartialEq)]
pub struct EngineError(Box<ErrorData>);

impl EngineError {
    /// A new error; `message` says what happened, with its numbers.
    pub fn new(reason: Reason, message: impl Into<String>) -> Self {
        EngineError(Box::new(ErrorData {
            reason,
            message: message.into(),
            hint: String::new(),
            locations: Vec::new(),
            location_total: 0,
            metadata: Vec::new(),
        }))
    }

    /// Adds what the user can do about it.
    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.0.hint = hint.into();
        self
    }

    /// Adds places; only the first [`MAX_LOCATIONS`] are kept, the total is remembered.
    pub fn with_locations(mut self, locations: impl IntoIterator<Item = Location>) -> Self {
        for location in locations {
            self.0.location_total += 1;
            if self.0.locations.len() < MAX_LOCATIONS {
                self.0.locations.push(location);
            }
        }
        self
    }

    /// The same error with a message that begins with what it is about.
    pub fn about(mut self, what: &str) -> Self {
        self.0.message = format!("{what}: {}", self.0.message);
        self
    }

    /// The same error with its locations changed: for ids that get other names.
    pub fn map_locations(mut self, change: impl Fn(Location) -> Location) -> Self {
        self.0.locations = std::mem::take(&mut self.0.locations).into_iter().map(change).collect();
        self
    }

    /// Adds a dynamic value under a stable key.
    pub fn with_metadata(mut self, key: &str, value: impl fmt::Display) -> Self {
        self.0.metadata.push((key.to_owned(), value.to_string()));
        self
    }

    /// A parameter that is out of range; `field` is its path in the request.
    pub fn bad_parameter(field: &str, message: impl fmt::Display) -> Self {
        EngineError::new(Reason::BadParameter, format!("{field}: {message}")).with_metadata("field", field)
    }

    /// Whether it ends the work as a whole rather than one way of doing it: cancelled, out of time or memory, or a bug.
    pub fn stops_work(&self) -> bool {
        matches!(
            self.kind(),
            ErrorKind::Cancelled | ErrorKind::DeadlineExceeded | ErrorKind::Internal | ErrorKind::ResourceExhausted | ErrorKind::DataLoss
        )
    }

    /// Whether it says that one map of a patch cannot be computed while another may: a singular operator, a hole that cannot be filled.
    pub fn fails_one_map(&self) -> bool {
        matches!(self.reason(), Reason::SolverSingular | Reason::ChartFailed | Reason::PlanarMeshFailed)
    }

    /// A broken invariant of the engine.
    pub fn invariant(message: impl Into<String>) -> Self {
        EngineError::new(Reason::Invariant, message)
    }

    /// The machine-readable cause.
    pub fn reason(&self) -> Reason {
        self.0.reason
    }

    /// The kind of the cause.
    pub fn kind(&self) -> ErrorKind {
        self.0.reason.kind()
    }

    /// What happened.
    pub fn message(&self) -> &str {
        &self.0.message
    }

    /// What to do about it; empty if nothing is known.
    pub fn hint(&self) -> &str {
        &self.0.hint
    }

    /// Places, at most [`MAX_LOCATIONS`].
    pub fn locations(&self) -> &[Location] {
        &self.0.locations
    }

    /// How many places there are in all.
    pub fn location_total(&self) -> usize {
        self.0.location_total
    }

    /// Dynamic values by key.
    pub fn metadata(&self) -> &[(String, String)] {
        &self.0.metadata
    }
}

impl fmt::Display for EngineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.message)?;
        if let Some(first) = self.0.locations.first() {
            let [x, y, z] = first.position;
            let element = match first.element {
                Element::Vertex => "vertex",
                Element::Edge => "edge",
                Element::Face => "face",
            };
            let ids = first.ids.iter().map(u32::to_string).collect::<Vec<_>>().join("-");
            write!(f, " (first of {}: {element} {ids} at {x}, {y}, {z})", self.0.location_total)?;
        }
        if !self.0.hint.is_empty() {
            write!(f, "; {}", self.0.hint)?;
        }
        Ok(())
    }
}

impl std::error::Error for EngineError {}
