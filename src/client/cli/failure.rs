//! Why a command did not succeed, what the person at the terminal reads, and the exit code.

use super::summary;
use crate::error::ClientError;
use crate::v1;
use std::path::{Path, PathBuf};
use tonic::Code;

/// Result of a command.
pub(crate) type Outcome<T> = Result<T, Failure>;

/// Exit codes; documented in `remesh --help`.
pub(crate) mod exit {
    pub(crate) const FAILED: u8 = 1;
    pub(crate) const USAGE: u8 = 2;
    pub(crate) const REFUSED: u8 = 3;
    pub(crate) const UNREACHABLE: u8 = 4;
    pub(crate) const INTERRUPTED: u8 = 130;
}

/// Reasons of errors that refuse the surface itself, whatever the options.
const REFUSALS: [&str; 6] =
    ["NON_MANIFOLD_EDGE", "NON_MANIFOLD_VERTEX", "NOT_ORIENTABLE", "NON_FINITE", "INDEX_OUT_OF_RANGE", "EMPTY_MESH"];

/// Exit code of work that failed for a reason.
pub(crate) fn exit_of_reason(reason: &str) -> u8 {
    if REFUSALS.contains(&reason) { exit::REFUSED } else { exit::FAILED }
}

/// Why a command did not succeed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line asks for something impossible.
    Usage(String),
    /// A call failed.
    Client(ClientError),
    /// The surface cannot be remeshed.
    Refused { what: String, diagnosis: Box<v1::Diagnosis> },
    /// A file cannot be read or written.
    File { action: &'static str, path: PathBuf, cause: std::io::Error },
    /// Anything else, with what to do about it.
    Other(String),
    /// Ctrl-C.
    Interrupted,
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error.call() {
            Some(call) if call.code == Code::Cancelled => Failure::Other("the work was cancelled".into()),
            _ => Failure::Client(error),
        }
    }
}

impl Failure {
    /// A file that cannot be read.
    pub(crate) fn read(path: &Path, cause: std::io::Error) -> Self {
        Failure::File { action: "read", path: path.to_owned(), cause }
    }

    /// A file that cannot be written.
    pub(crate) fn write(path: &Path, cause: std::io::Error) -> Self {
        Failure::File { action: "write", path: path.to_owned(), cause }
    }

    /// The exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Failure::Usage(_) => exit::USAGE,
            Failure::Client(ClientError::Unreachable { .. }) => exit::UNREACHABLE,
            Failure::Client(ClientError::BadEndpoint { .. }) => exit::USAGE,
            Failure::Client(error) => error.reason().map_or(exit::FAILED, exit_of_reason),
            Failure::Refused { .. } => exit::REFUSED,
            Failure::Interrupted => exit::INTERRUPTED,
            Failure::File { .. } | Failure::Other(_) => exit::FAILED,
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Usage(message) | Failure::Other(message) => f.write_str(message),
            Failure::Client(error) => write!(f, "{error}"),
            Failure::Refused { what, diagnosis } => {
                let findings = diagnosis.findings.iter().filter(|finding| finding.prevents_remeshing);
                write!(f, "{what} cannot be remeshed")?;
                findings.take(8).try_for_each(|finding| write!(f, "\n{}", summary::finding(finding, 5)))?;
                write!(f, "\nRepair these places, or keep only sound regions with --only-region; `remesh diagnose` lists more places.")
            }
            Failure::File { action, path, cause } => write!(f, "cannot {action} {}: {cause}", path.display()),
            Failure::Interrupted => f.write_str("interrupted"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::CallError;

    fn call(reason: &str, code: Code) -> Failure {
        let error = CallError {
            code,
            reason: Some(reason.into()),
            message: "m".into(),
            hint: None,
            metadata: Default::default(),
            fields: Vec::new(),
            retry_after: None,
            places: Vec::new(),
            place_total: 0,
        };
        ClientError::Call(Box::new(error)).into()
    }

    #[test]
    fn exit_codes_are_as_documented() {
        assert_eq!(call("NON_MANIFOLD_EDGE", Code::FailedPrecondition).exit_code(), exit::REFUSED);
        assert_eq!(call("FORMAT_MALFORMED", Code::InvalidArgument).exit_code(), exit::FAILED);
        assert_eq!(call("BAD_PARAMETER", Code::InvalidArgument).exit_code(), exit::FAILED);
        assert_eq!(Failure::Client(ClientError::Unreachable { endpoint: None, cause: String::new() }).exit_code(), exit::UNREACHABLE);
        assert_eq!(Failure::Usage(String::new()).exit_code(), exit::USAGE);
        assert_eq!(Failure::Interrupted.exit_code(), 130);
        assert_eq!(Failure::read(Path::new("x"), std::io::ErrorKind::NotFound.into()).exit_code(), exit::FAILED);
    }

    #[test]
    fn a_refusal_says_what_and_where() {
        let location =
            v1::Location { element: v1::ElementKind::Edge.into(), ids: vec![3, 8], position: Some(v1::Point { x: 1.5, y: 0.0, z: 2.0 }) };
        let finding =
            v1::Finding { defect: v1::Defect::NonManifoldEdge.into(), count: 12, locations: vec![location], prevents_remeshing: true };
        let harmless = v1::Finding { defect: v1::Defect::Hole.into(), count: 2, ..Default::default() };
        let diagnosis = v1::Diagnosis { findings: vec![finding, harmless], ..Default::default() };
        let text = Failure::Refused { what: "a.stl".into(), diagnosis: Box::new(diagnosis) }.to_string();
        assert!(text.contains("12 edges with more than two faces"), "{text}");
        assert!(text.contains("edge 3-8 at (1.5, 0, 2)") && !text.contains("hole"), "{text}");
    }
}
