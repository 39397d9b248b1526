//! How much room there is: below the bound of the folder, and on the disk.

use crate::error::{Result, StoreError};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// What is left free on the disk: the database rewrites a few pages even to delete.
const RESERVE: u64 = 1 << 20;

/// Room of one folder.
#[derive(Debug)]
pub(crate) struct Room {
    folder: PathBuf,
    records: PathBuf,
    max_bytes: Option<u64>,
    files: AtomicU64,
}

impl Room {
    /// Of a folder whose files are not counted yet.
    pub(crate) fn new(folder: &Path, records: PathBuf, max_bytes: Option<u64>) -> Self {
        Room { folder: folder.to_owned(), records, max_bytes, files: AtomicU64::new(0) }
    }

    /// Counts bytes of files.
    pub(crate) fn add(&self, bytes: u64) {
        self.files.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Counts bytes of files that are gone.
    pub(crate) fn give_back(&self, bytes: u64) {
        self.files.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Bytes in use.
    pub(crate) fn used(&self) -> u64 {
        self.files.load(Ordering::Relaxed) + self.records()
    }

    /// Bytes of the file of records. It has holes, so its blocks count, not its length.
    pub(crate) fn records(&self) -> u64 {
        std::fs::metadata(&self.records).map_or(0, |m| 512 * m.blocks())
    }

    /// Whether `bytes` more would fit.
    ///
    /// # Errors
    /// [`StoreError::Full`].
    pub(crate) fn check(&self, bytes: u64) -> Result<()> {
        if bytes == 0 {
            return Ok(());
        }
        if let Some(max) = self.max_bytes {
            let used = self.used();
            if used.saturating_add(bytes) > max {
                return Err(StoreError::Full { what: format!("{used} bytes of at most {max} are in use, {bytes} more are asked for") });
            }
        }
        // A disk that does not tell is asked by writing.
        let Ok(disk) = rustix::fs::statvfs(&self.folder) else { return Ok(()) };
        let free = disk.f_bavail.saturating_mul(disk.f_frsize);
        if free < bytes.saturating_add(RESERVE) {
            return Err(StoreError::Full {
                what: format!("{free} bytes are free on the disk, {bytes} are asked for and {RESERVE} kept free"),
            });
        }
        Ok(())
    }
}
