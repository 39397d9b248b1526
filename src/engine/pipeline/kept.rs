//! Cached outputs that are too large to be hashed: factors, search trees.

use crate::fingerprint::{Contents, Feeder, Fingerprint};

/// An output whose identity is that of what it was made from, since equal inputs give equal outputs.
#[derive(Debug)]
pub(super) struct Kept<T> {
    /// The output.
    pub(super) output: T,
    /// Its identity.
    pub(super) of: Fingerprint,
    /// Its size in memory.
    pub(super) bytes: usize,
}

impl<T> Contents for Kept<T> {
    fn feed(&self, into: &mut Feeder) {
        into.fingerprint(self.of);
    }

    fn bytes(&self) -> usize {
        self.bytes
    }
}
