//! Uploaded files, by digest: in memory, or where they can be read again.

use crate::error::Result;
use std::fmt;
use std::sync::{Arc, PoisonError, RwLock};

/// Reads the contents of a file that is kept outside of memory.
pub type ReadBlob = Box<dyn Fn() -> Result<Vec<u8>> + Send + Sync>;

enum Contents {
    Held(Arc<Vec<u8>>),
    Elsewhere(ReadBlob),
}

/// An uploaded file.
pub struct Blob {
    /// BLAKE3 digest of the file, lower-case hexadecimal.
    pub digest: String,
    len: usize,
    contents: RwLock<Contents>,
}

impl fmt::Debug for Blob {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Blob").field("digest", &self.digest).field("len", &self.len).field("held", &self.held_bytes()).finish()
    }
}

impl Blob {
    /// Takes a file into memory and digests it.
    pub fn new(bytes: Vec<u8>) -> Self {
        let digest = blake3::hash(&bytes).to_hex().to_string();
        Blob { digest, len: bytes.len(), contents: RwLock::new(Contents::Held(Arc::new(bytes))) }
    }

    /// A file of this digest and length that `read` gives whenever it is needed.
    pub fn elsewhere(digest: String, len: usize, read: ReadBlob) -> Self {
        Blob { digest, len, contents: RwLock::new(Contents::Elsewhere(read)) }
    }

    /// Lets go of the contents in memory: from now on `read` gives them.
    pub fn move_elsewhere(&self, read: ReadBlob) {
        *self.contents.write().unwrap_or_else(PoisonError::into_inner) = Contents::Elsewhere(read);
    }

    /// Bytes of the file.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the file is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes in memory.
    pub fn held_bytes(&self) -> usize {
        match &*self.contents.read().unwrap_or_else(PoisonError::into_inner) {
            Contents::Held(bytes) => bytes.len(),
            Contents::Elsewhere(_) => 0,
        }
    }

    /// The file.
    ///
    /// # Errors
    /// Those of reading it, if it is not in memory.
    pub fn bytes(&self) -> Result<Arc<Vec<u8>>> {
        match &*self.contents.read().unwrap_or_else(PoisonError::into_inner) {
            Contents::Held(bytes) => Ok(bytes.clone()),
            Contents::Elsewhere(read) => read().map(Arc::new),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_may_move_out_of_memory() {
        let blob = Blob::new(vec![1, 2, 3]);
        assert_eq!((blob.held_bytes(), blob.bytes().unwrap().as_slice()), (3, [1u8, 2, 3].as_slice()));
        blob.move_elsewhere(Box::new(|| Ok(vec![1, 2, 3])));
        assert_eq!((blob.held_bytes(), blob.len(), blob.bytes().unwrap().as_slice()), (0, 3, [1u8, 2, 3].as_slice()));
    }
}
