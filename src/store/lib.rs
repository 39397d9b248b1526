//! What a daemon keeps in a folder: small records that change together, and files named by their digest. Knows nothing of what they mean.
//!
//! A folder has one owner at a time (a lock that ends with the process), a format version, nothing else in it, and is for its owner's eyes only
//! (0700).
//! [`Store::commit`] returns when a batch of records is on the disk, all of it; a crash at any moment leaves each batch whole or not there.
//! Files come in through [`Incoming`] and get their name only when they are complete and on the disk.

mod blobs;
mod error;
mod folder;
mod records;
mod room;

pub use blobs::{Incoming, Leftover, StoredBlob};
pub use error::{Result, StoreError};
pub use records::Batch;

use blobs::Blobs;
use folder::Folder;
use records::Records;
use room::Room;
use std::path::Path;
use std::sync::Arc;

/// A folder that is open.
#[derive(Debug)]
pub struct Store {
    // Dropped in this order: the records are closed before the lock is given back.
    records: Records,
    blobs: Blobs,
    room: Arc<Room>,
    folder: Folder,
}

/// What is in a folder when it is opened.
#[derive(Debug)]
pub struct Contents {
    /// All records, by key.
    pub records: Vec<(Vec<u8>, Vec<u8>)>,
    /// Complete files.
    pub blobs: Vec<StoredBlob>,
    /// Files that were coming in and may be gone on with.
    pub leftovers: Vec<Leftover>,
}

impl Store {
    /// Opens a folder, makes it if there is none. `max_bytes` bounds what it may take on the disk. Reads all records.
    ///
    /// # Errors
    /// [`StoreError::Locked`] if another process has it open, [`StoreError::Format`] if a later version made it, [`StoreError::Foreign`] if it
    /// holds anything else, [`StoreError::Corrupt`], [`StoreError::Io`], [`StoreError::Full`].
    pub fn open(path: &Path, max_bytes: Option<u64>) -> Result<(Store, Contents)> {
        let folder = Folder::open(path)?;
        let room = Arc::new(Room::new(path, folder.records(), max_bytes));
        let (blobs, files, leftovers) = Blobs::open(&folder, room.clone())?;
        let (records, listed) = Records::open(folder.records(), room.clone())?;
        let contents = Contents { records: listed, blobs: files, leftovers };
        Ok((Store { records, blobs, room, folder }, contents))
    }

    /// Writes and deletes records, all or none; they are on the disk when this returns. Batches of several threads share a write.
    ///
    /// # Errors
    /// [`StoreError::Full`] if there is no room, [`StoreError::Gone`], [`StoreError::Io`]. Then nothing of the batch holds, and the next
    /// batch is tried anew.
    pub fn commit(&self, batch: Batch) -> Result<()> {
        self.folder.check_present()?;
        self.records.commit(batch)
    }

    /// Begins a file. `label` (letters, digits, `-`) finds it again in [`Contents::leftovers`] after the process ended.
    ///
    /// # Errors
    /// [`StoreError::Full`], [`StoreError::Io`].
    pub fn begin(&self, label: Option<&str>) -> Result<Incoming> {
        self.blobs.begin(label)
    }

    /// Goes on with a file that was left. Reads it once, for its digest.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn resume(&self, leftover: &Leftover) -> Result<Incoming> {
        self.blobs.resume(leftover)
    }

    /// A complete file, checked against its digest.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the contents are not those of the digest, [`StoreError::Io`].
    pub fn read(&self, digest: &str) -> Result<Vec<u8>> {
        self.blobs.read(digest)
    }

    /// Marks a file as used now.
    pub fn touch(&self, digest: &str) {
        self.blobs.touch(digest);
    }

    /// When a file was last marked, if it is there.
    pub fn used_at(&self, digest: &str) -> Option<std::time::SystemTime> {
        self.blobs.used_at(digest)
    }

    /// Deletes a file.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn remove(&self, digest: &str) -> Result<()> {
        self.blobs.remove(digest)
    }

    /// Bytes that all of it takes on the disk.
    pub fn used_bytes(&self) -> u64 {
        self.room.used()
    }
}
