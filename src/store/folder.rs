//! The folder itself: who has it, which format it has, and where things are in it.

use crate::error::{Result, StoreError};
use std::fs::{self, DirBuilder, File, OpenOptions, TryLockError};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The format that this version writes and reads.
const FORMAT: &str = "remeshd-store 1\n";

/// A folder that this process has locked.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    _lock: File,
}

/// Writes the entries of a folder to the disk.
pub(crate) fn sync_folder(path: &Path) -> Result<()> {
    File::open(path).and_then(|folder| folder.sync_all()).map_err(|e| StoreError::io("sync", path, e))
}

/// A folder that only its owner may enter.
fn private_folder(path: &Path) -> Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(|e| StoreError::io("create", path, e))
}

/// Options for files that only their owner may read.
pub(crate) fn private_file() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).write(true).mode(0o600);
    options
}

impl Folder {
    /// Makes it if need be, locks it, checks its format.
    pub(crate) fn open(path: &Path) -> Result<Folder> {
        private_folder(path)?;
        // One that was there may be open to others; a folder that is not ours to change is left as it is if nobody else can enter.
        let found = fs::metadata(path).map_err(|e| StoreError::io("look at", path, e))?.permissions().mode();
        if found & 0o077 != 0 {
            fs::set_permissions(path, fs::Permissions::from_mode(0o700)).map_err(|e| StoreError::io("set permissions of", path, e))?;
        }
        let lock_path = path.join("lock");
        let lock = private_file().create(true).truncate(false).open(&lock_path).map_err(|e| StoreError::io("open", &lock_path, e))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::Locked { path: path.to_owned() }),
            Err(TryLockError::Error(e)) => return Err(StoreError::io("lock", &lock_path, e)),
        }
        let folder = Folder { path: path.to_owned(), _lock: lock };
        folder.check_format()?;
        private_folder(&folder.blobs())?;
        private_folder(&folder.incoming())?;
        sync_folder(path)?;
        Ok(folder)
    }

    fn check_format(&self) -> Result<()> {
        let path = self.path.join("format");
        match fs::read_to_string(&path) {
            Ok(found) if found == FORMAT => Ok(()),
            // Empty: a crash came between the making and the writing of the file, before anything else was made.
            Ok(found) if !found.is_empty() || self.records().exists() => {
                Err(StoreError::Format { path: self.path.clone(), found: found.trim_end().to_owned(), known: FORMAT.trim_end() })
            }
            Ok(_) => self.write_format(&path),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && !self.records().exists() => self.write_format(&path),
            Err(error) => Err(StoreError::io("read", &path, error)),
        }
    }

    fn write_format(&self, path: &Path) -> Result<()> {
        let told = |e| StoreError::io("write to", path, e);
        let mut file = private_file().create(true).truncate(true).open(path).map_err(told)?;
        file.write_all(FORMAT.as_bytes()).and_then(|()| file.sync_all()).map_err(told)?;
        sync_folder(&self.path)
    }

    /// The file of records.
    pub(crate) fn records(&self) -> PathBuf {
        self.path.join("records.redb")
    }

    /// Complete files.
    pub(crate) fn blobs(&self) -> PathBuf {
        self.path.join("blobs")
    }

    /// Files that are coming in.
    pub(crate) fn incoming(&self) -> PathBuf {
        self.path.join("incoming")
    }
}
