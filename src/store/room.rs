//! How much room there is: below the bound of the folder, and on the disk.

use crate::error::{Result, StoreError};
use crate::folder::private_file;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What is left free on the disk: the database rewrites a few pages even to delete.
const RESERVE: u64 = 1 << 20;
/// As much is held in a file besides, and given to a delete when others have filled the disk.
const HELD: usize = 1 << 20;

/// Room of one folder.
#[derive(Debug)]
pub(crate) struct Room {
    folder: PathBuf,
    records: PathBuf,
    max_bytes: Option<u64>,
    files: AtomicU64,
    holds: AtomicBool,
}

impl Room {
    /// Of a folder whose files are not counted yet.
    pub(crate) fn new(folder: &Path, records: PathBuf, max_bytes: Option<u64>) -> Self {
        let room = Room { folder: folder.to_owned(), records, max_bytes, files: AtomicU64::new(0), holds: AtomicBool::new(false) };
        let held = std::fs::metadata(room.reserve()).is_ok_and(|file| file.len() == HELD as u64);
        room.holds.store(held, Ordering::Relaxed);
        room
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

    fn reserve(&self) -> PathBuf {
        self.folder.join("reserve")
    }

    /// Holds room for a delete on a full disk, unless it does already or the disk is nearly full. Failing is no error.
    pub(crate) fn hold(&self) {
        if self.holds.load(Ordering::Relaxed) || self.free().is_some_and(|free| free < 2 * RESERVE + HELD as u64) {
            return;
        }
        // Zeros, as a hole would hold nothing.
        let written = private_file().create(true).truncate(true).open(self.reserve()).and_then(|mut file| file.write_all(&vec![0; HELD]));
        match written {
            Ok(()) => self.holds.store(true, Ordering::Relaxed),
            Err(_) => drop(std::fs::remove_file(self.reserve())),
        }
    }

    /// Gives up the room that was held; tells whether there was any.
    pub(crate) fn let_go(&self) -> bool {
        self.holds.swap(false, Ordering::Relaxed) && std::fs::remove_file(self.reserve()).is_ok()
    }

    /// Bytes free on the disk; a disk that does not tell is asked by writing.
    fn free(&self) -> Option<u64> {
        rustix::fs::statvfs(&self.folder).ok().map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize))
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
        let Some(free) = self.free() else { return Ok(()) };
        if free < bytes.saturating_add(RESERVE) {
            return Err(StoreError::Full {
                what: format!("{free} bytes are free on the disk, {bytes} are asked for and {RESERVE} kept free"),
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_held_over_a_restart_and_given_once() {
        let folder = tempfile::tempdir().expect("folder");
        let open = || Room::new(folder.path(), folder.path().join("records.redb"), None);
        let room = open();
        assert!(!room.let_go(), "nothing is held yet");
        room.hold();
        assert_eq!(std::fs::metadata(room.reserve()).expect("there").len(), HELD as u64);
        let again = open();
        assert!(again.let_go() && !again.let_go());
        assert!(!again.reserve().exists());
    }
}
