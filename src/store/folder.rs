//! The folder itself: who has it, which format it has, and where things are in it.

use crate::error::{Result, StoreError};
use std::fs::{self, DirBuilder, File, OpenOptions, TryLockError};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The format that this version writes and reads.
const FORMAT: &str = "remeshd-store 1\n";

/// What may be in a folder before it is opened: what this version makes, and what file systems put there.
const OWN_NAMES: [&str; 7] = ["format", "lock", "records.redb", "records.new", "blobs", "incoming", "reserve"];
const FOUND_ANYWHERE: [&str; 1] = ["lost+found"];

/// A folder that this process has locked.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    lock: File,
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

/// Refuses a folder that somebody else uses: one with anything in it that this version does not make, or of another format.
fn check_own(path: &Path) -> Result<()> {
    let told = |e| StoreError::io("read", path, e);
    for entry in fs::read_dir(path).map_err(told)? {
        let name = entry.map_err(told)?.file_name();
        if !OWN_NAMES.iter().chain(&FOUND_ANYWHERE).any(|known| name == *known) {
            return Err(StoreError::Foreign { path: path.to_owned(), entry: name.to_string_lossy().into_owned() });
        }
    }
    match fs::read_to_string(path.join("format")) {
        Ok(found) if !found.is_empty() && found != FORMAT => Err(other_format(path, &found)),
        _ => Ok(()),
    }
}

fn other_format(path: &Path, found: &str) -> StoreError {
    StoreError::Format { path: path.to_owned(), found: found.trim_end().to_owned(), known: FORMAT.trim_end() }
}

impl Folder {
    /// Makes it if need be, locks it, checks its format. Changes nothing in a folder that holds anything else.
    pub(crate) fn open(path: &Path) -> Result<Folder> {
        private_folder(path)?;
        check_own(path)?;
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
        let folder = Folder { path: path.to_owned(), lock };
        folder.check_format()?;
        private_folder(&folder.blobs())?;
        private_folder(&folder.incoming())?;
        sync_folder(path)?;
        Ok(folder)
    }

    /// Whether the folder is still where it was opened: what is written to one that was moved or removed is lost.
    ///
    /// # Errors
    /// [`StoreError::Gone`].
    pub(crate) fn check_present(&self) -> Result<()> {
        let gone = || StoreError::Gone { path: self.path.clone() };
        let there = fs::metadata(self.path.join("lock")).map_err(|_| gone())?;
        let own = self.lock.metadata().map_err(|_| gone())?;
        if (there.dev(), there.ino()) == (own.dev(), own.ino()) { Ok(()) } else { Err(gone()) }
    }

    fn check_format(&self) -> Result<()> {
        let path = self.path.join("format");
        match fs::read_to_string(&path) {
            Ok(found) if found == FORMAT => Ok(()),
            // Empty: a crash came between the making and the writing of the file, before anything else was made.
            Ok(found) if !found.is_empty() || self.records().exists() => Err(other_format(&self.path, &found)),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).expect("there").permissions().mode() & 0o777
    }

    #[test]
    fn a_folder_of_somebody_else_is_left_as_it_is() {
        for (name, contents) in [("mine.txt", "hello"), ("format", "something else 7\n")] {
            let folder = tempfile::tempdir().expect("folder");
            fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("sets");
            fs::write(folder.path().join(name), contents).expect("writes");
            let refused = Folder::open(folder.path()).expect_err("refused");
            assert!(refused.to_string().contains(if name == "format" { "something else 7" } else { name }), "{refused}");
            assert_eq!(mode(folder.path()), 0o755);
            assert_eq!(fs::read_dir(folder.path()).expect("reads").count(), 1);
        }
    }

    #[test]
    fn an_empty_folder_is_taken_and_made_private() {
        let folder = tempfile::tempdir().expect("folder");
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("sets");
        fs::create_dir(folder.path().join("lost+found")).expect("makes");
        drop(Folder::open(folder.path()).expect("opens"));
        assert_eq!(mode(folder.path()), 0o700);
        Folder::open(folder.path()).expect("opens again");
    }

    #[test]
    fn a_folder_that_was_removed_or_replaced_is_noticed() {
        let outer = tempfile::tempdir().expect("folder");
        let path = outer.path().join("data");
        let folder = Folder::open(&path).expect("opens");
        folder.check_present().expect("there");
        fs::remove_dir_all(&path).expect("removes");
        assert!(matches!(folder.check_present(), Err(StoreError::Gone { .. })));
        let other = Folder::open(&path).expect("opens another");
        assert!(matches!(folder.check_present(), Err(StoreError::Gone { .. })));
        other.check_present().expect("there");
    }
}
