//! Why something could not be kept.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Why something could not be kept or read.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Another process has the folder open.
    #[error("{} is in use by another process", path.display())]
    Locked {
        /// The folder.
        path: PathBuf,
    },
    /// The folder was made by a version that this one does not know.
    #[error("{} has format {found:?}; this version reads {known:?}", path.display())]
    Format {
        /// The folder.
        path: PathBuf,
        /// The format it has.
        found: String,
        /// The format that is read.
        known: &'static str,
    },
    /// The folder holds what is not the store's.
    #[error("{} is no data folder: it holds {entry:?}; name an empty folder, or one that was made as a data folder", path.display())]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// An entry that is not the store's.
        entry: String,
    },
    /// The folder was removed, moved or replaced while it was open.
    #[error("{} is not the folder that was opened any more", path.display())]
    Gone {
        /// The folder.
        path: PathBuf,
    },
    /// There is no room: the disk is full, or the bound of the folder is reached.
    #[error("no room: {what}")]
    Full {
        /// What is full.
        what: String,
    },
    /// What was read is not what was written.
    #[error("damaged: {what}")]
    Corrupt {
        /// What is damaged.
        what: String,
    },
    /// The system refused.
    #[error("{doing} {}: {cause}", path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file or folder.
        path: PathBuf,
        /// What the system said.
        cause: Arc<io::Error>,
    },
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, StoreError>;

impl StoreError {
    /// An error of the system: no room, or another.
    pub(crate) fn io(doing: &'static str, path: &Path, cause: io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        match cause.kind() {
            StorageFull | QuotaExceeded | FileTooLarge => StoreError::Full { what: format!("{doing} {}: {cause}", path.display()) },
            _ => StoreError::Io { doing, path: path.to_owned(), cause: Arc::new(cause) },
        }
    }

    /// An error of the embedded database.
    pub(crate) fn database(path: &Path, error: redb::Error) -> Self {
        match error {
            redb::Error::Io(cause) => StoreError::io("write to", path, cause),
            redb::Error::Corrupted(what) => StoreError::Corrupt { what: format!("{}: {what}", path.display()) },
            other => StoreError::io("write to", path, io::Error::other(other.to_string())),
        }
    }
}
