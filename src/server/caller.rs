//! Who makes a call, and which sessions are theirs.

use std::sync::Arc;

/// Who makes a call: the name that authentication found. Without authentication everybody is the same nobody.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Caller(Option<Arc<str>>);

impl Caller {
    /// A caller with a name.
    pub(crate) fn named(name: impl Into<Arc<str>>) -> Self {
        Caller(Some(name.into()))
    }

    /// The name, if there is one.
    pub(crate) fn key(&self) -> Option<&str> {
        self.0.as_deref()
    }

    /// The name; empty if there is none.
    pub(crate) fn name(&self) -> &str {
        self.0.as_deref().unwrap_or_default()
    }
}
