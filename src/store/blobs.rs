//! Files named by their BLAKE3 digest, and files on their way in.

use crate::error::{Result, StoreError};
use crate::folder::{Folder, private_file, sync_folder};
use crate::room::Room;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

/// A complete file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredBlob {
    /// BLAKE3 digest of its contents, lower-case hexadecimal.
    pub digest: String,
    /// Its size.
    pub bytes: u64,
}

/// A file that was coming in when the process ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Leftover {
    /// What it was begun with.
    pub label: String,
    /// Bytes that arrived.
    pub bytes: u64,
    path: PathBuf,
}

/// The files of a folder.
#[derive(Debug)]
pub(crate) struct Blobs {
    folder: PathBuf,
    incoming: PathBuf,
    room: Arc<Room>,
    next: AtomicU64,
}

/// Whether a text is a digest as files are named by.
fn is_digest(name: &str) -> bool {
    name.len() == 64 && name.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
}

fn files(folder: &Path) -> Result<Vec<(String, u64)>> {
    let told = |e| StoreError::io("list", folder, e);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(told)? {
        let entry = entry.map_err(told)?;
        let data = entry.metadata().map_err(told)?;
        if let (true, Ok(name)) = (data.is_file(), entry.file_name().into_string()) {
            files.push((name, data.len()));
        }
    }
    files.sort();
    Ok(files)
}

impl Blobs {
    /// What is there; files that came in without a label are deleted.
    pub(crate) fn open(folder: &Folder, room: Arc<Room>) -> Result<(Blobs, Vec<StoredBlob>, Vec<Leftover>)> {
        let blobs = Blobs { folder: folder.blobs(), incoming: folder.incoming(), room, next: AtomicU64::new(0) };
        let complete: Vec<StoredBlob> = files(&blobs.folder)?
            .into_iter()
            .filter(|(name, _)| is_digest(name))
            .map(|(digest, bytes)| StoredBlob { digest, bytes })
            .collect();
        let mut leftovers = Vec::new();
        let mut next = 0;
        for (name, bytes) in files(&blobs.incoming)? {
            let path = blobs.incoming.join(&name);
            match name.split_once('.') {
                Some((number, label)) if !label.is_empty() && bytes > 0 => {
                    next = number.parse().map_or(next, |n: u64| next.max(n.saturating_add(1)));
                    leftovers.push(Leftover { label: label.to_owned(), bytes, path });
                }
                _ => fs::remove_file(&path).map_err(|e| StoreError::io("delete", &path, e))?,
            }
        }
        blobs.next.store(next, Ordering::Relaxed);
        blobs.room.add(complete.iter().map(|blob| blob.bytes).chain(leftovers.iter().map(|left| left.bytes)).sum());
        Ok((blobs, complete, leftovers))
    }

    /// See [`crate::Store::begin`].
    pub(crate) fn begin(&self, label: Option<&str>) -> Result<Incoming> {
        self.room.check(1)?;
        let label: String = label.unwrap_or_default().chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
        let path = self.incoming.join(format!("{}.{label}", self.next.fetch_add(1, Ordering::Relaxed)));
        let file = private_file().create_new(true).open(&path).map_err(|e| StoreError::io("create", &path, e))?;
        Ok(Incoming {
            file,
            path,
            folder: self.folder.clone(),
            room: self.room.clone(),
            hasher: blake3::Hasher::new(),
            bytes: 0,
            left: Left::Deleted,
        })
    }

    /// See [`crate::Store::resume`].
    pub(crate) fn resume(&self, leftover: &Leftover) -> Result<Incoming> {
        let path = leftover.path.clone();
        let told = |e| StoreError::io("read", &leftover.path, e);
        let mut file = private_file().open(&path).map_err(told)?;
        let mut hasher = blake3::Hasher::new();
        let mut buffer = vec![0; 1 << 20];
        let mut bytes = 0;
        loop {
            let read = file.read(&mut buffer).map_err(told)?;
            if read == 0 {
                break;
            }
            hasher.update(&buffer[..read]);
            bytes += read as u64;
        }
        Ok(Incoming { file, path, folder: self.folder.clone(), room: self.room.clone(), hasher, bytes, left: Left::Kept })
    }

    fn path(&self, digest: &str) -> Option<PathBuf> {
        is_digest(digest).then(|| self.folder.join(digest))
    }

    /// See [`crate::Store::read`].
    pub(crate) fn read(&self, digest: &str) -> Result<Vec<u8>> {
        let Some(path) = self.path(digest) else { return Err(StoreError::Corrupt { what: format!("{digest:?} is no digest") }) };
        let bytes = fs::read(&path).map_err(|e| StoreError::io("read", &path, e))?;
        if blake3::hash(&bytes).to_hex().as_str() != digest {
            return Err(StoreError::Corrupt { what: format!("{} has other contents than its name says", path.display()) });
        }
        Ok(bytes)
    }

    /// See [`crate::Store::touch`].
    pub(crate) fn touch(&self, digest: &str) {
        let Some(path) = self.path(digest) else { return };
        // A file that cannot be marked is only deleted earlier, if no session uses it.
        let _ = File::options().append(true).open(path).and_then(|file| file.set_modified(SystemTime::now()));
    }

    /// See [`crate::Store::used_at`].
    pub(crate) fn used_at(&self, digest: &str) -> Option<SystemTime> {
        fs::metadata(self.path(digest)?).and_then(|data| data.modified()).ok()
    }

    /// See [`crate::Store::remove`].
    pub(crate) fn remove(&self, digest: &str) -> Result<()> {
        let Some(path) = self.path(digest) else { return Ok(()) };
        let bytes = fs::metadata(&path).map_or(0, |data| data.len());
        match fs::remove_file(&path) {
            Ok(()) => self.room.give_back(bytes),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(StoreError::io("delete", &path, error)),
        }
        Ok(())
    }
}

/// What becomes of a file that is dropped before it is complete.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Left {
    Deleted,
    Kept,
}

/// A file on its way in. Dropped before [`Incoming::finish`] it is deleted, unless it is to be kept.
#[derive(Debug)]
pub struct Incoming {
    file: File,
    path: PathBuf,
    folder: PathBuf,
    room: Arc<Room>,
    hasher: blake3::Hasher,
    bytes: u64,
    left: Left,
}

impl Drop for Incoming {
    fn drop(&mut self) {
        if self.left == Left::Deleted {
            self.room.give_back(self.bytes);
            // What cannot be deleted now is found at the next start.
            let _ = fs::remove_file(&self.path);
        }
    }
}

impl Incoming {
    /// Bytes that arrived.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// [`StoreError::Full`], [`StoreError::Io`]; the file is then as it was.
    pub fn write(&mut self, data: &[u8]) -> Result<()> {
        self.room.check(data.len() as u64)?;
        if let Err(error) = self.file.write_all(data) {
            let back = self.file.set_len(self.bytes).and_then(|()| self.file.seek(SeekFrom::Start(self.bytes)));
            return Err(StoreError::io("write to", &self.path, back.err().unwrap_or(error)));
        }
        self.hasher.update(data);
        self.bytes += data.len() as u64;
        self.room.add(data.len() as u64);
        Ok(())
    }

    /// Leaves the file where it is when this is dropped, for [`crate::Store::resume`] (if it was begun with a label).
    pub fn keep(&mut self) {
        self.left = Left::Kept;
    }

    /// Deletes the file.
    pub fn discard(mut self) {
        self.left = Left::Deleted;
    }

    /// Digest of what arrived, lower-case hexadecimal.
    pub fn digest(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }

    /// Puts the file on the disk and gives it its name; a file of that name that is there stays.
    ///
    /// # Errors
    /// [`StoreError::Full`], [`StoreError::Io`]; the file is then gone.
    pub fn finish(mut self) -> Result<StoredBlob> {
        self.left = Left::Deleted;
        let digest = self.digest();
        let name = self.folder.join(&digest);
        if name.exists() {
            return Ok(StoredBlob { digest, bytes: self.bytes });
        }
        self.file.sync_all().map_err(|e| StoreError::io("sync", &self.path, e))?;
        fs::rename(&self.path, &name).map_err(|e| StoreError::io("name", &name, e))?;
        // Now it is a blob, whatever happens: its bytes stay counted.
        self.left = Left::Kept;
        sync_folder(&self.folder)?;
        Ok(StoredBlob { digest, bytes: self.bytes })
    }
}

#[cfg(test)]
mod tests {
    use crate::{Contents, Store, StoreError};
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;

    fn open(path: &Path) -> (Store, Contents) {
        Store::open(path, None).expect("opens")
    }

    #[test]
    fn a_folder_is_private_and_has_one_owner() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("data");
        let (store, _) = open(&path);
        assert_eq!(std::fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o700);
        assert!(matches!(Store::open(&path, None), Err(StoreError::Locked { .. })));
        drop(store);
        open(&path);
        std::fs::write(path.join("format"), "remeshd-store 99\n").expect("write");
        assert!(matches!(Store::open(&path, None), Err(StoreError::Format { found, .. }) if found == "remeshd-store 99"));
    }

    #[test]
    fn files_get_their_names_when_they_are_complete() {
        let folder = tempfile::tempdir().expect("folder");
        let (store, _) = open(folder.path());
        let mut incoming = store.begin(None).expect("begins");
        incoming.write(b"hello ").expect("writes");
        incoming.write(b"world").expect("writes");
        let digest = incoming.digest();
        assert!(store.read(&digest).is_err(), "not before it is complete");
        let blob = incoming.finish().expect("finishes");
        assert_eq!((blob.bytes, blob.digest.as_str()), (11, digest.as_str()));
        assert_eq!(store.read(&digest).expect("reads"), b"hello world");
        let used = store.used_bytes();
        let mut twice = store.begin(None).expect("begins");
        twice.write(b"hello world").expect("writes");
        assert_eq!(twice.finish().expect("finishes"), blob);
        assert_eq!(store.used_bytes(), used, "kept once");
        drop(store);
        let (store, contents) = open(folder.path());
        assert_eq!(contents.blobs, [blob]);
        std::fs::write(folder.path().join("blobs").join(&digest), b"hello WORLD").expect("write");
        assert!(matches!(store.read(&digest), Err(StoreError::Corrupt { .. })));
        store.remove(&digest).expect("deletes");
        assert!(store.used_at(&digest).is_none());
        for name in ["../format", "", "blobs", &digest.to_uppercase()] {
            assert!(matches!(store.read(name), Err(StoreError::Corrupt { .. })), "{name}");
        }
    }

    #[test]
    fn files_with_a_label_can_be_gone_on_with_and_others_are_deleted() {
        let folder = tempfile::tempdir().expect("folder");
        let (store, _) = open(folder.path());
        let mut labelled = store.begin(Some("abc-1")).expect("begins");
        labelled.write(b"first ").expect("writes");
        labelled.keep();
        let mut bare = store.begin(None).expect("begins");
        bare.write(b"lost").expect("writes");
        bare.keep();
        drop((labelled, bare, store));
        let (store, contents) = open(folder.path());
        assert_eq!(contents.leftovers.iter().map(|l| (l.label.as_str(), l.bytes)).collect::<Vec<_>>(), [("abc-1", 6)]);
        let mut again = store.resume(&contents.leftovers[0]).expect("resumes");
        again.write(b"second").expect("writes");
        let blob = again.finish().expect("finishes");
        assert_eq!(store.read(&blob.digest).expect("reads"), b"first second");
    }

    #[test]
    fn a_bound_stops_files_and_what_is_given_up_makes_room() {
        let folder = tempfile::tempdir().expect("folder");
        let (store, _) = Store::open(folder.path(), Some(4 << 20)).expect("opens");
        let mut incoming = store.begin(None).expect("begins");
        let chunk = vec![7; 1 << 20];
        let refused = (0..5).find_map(|_| incoming.write(&chunk).err()).expect("refused");
        assert!(matches!(refused, StoreError::Full { .. }), "{refused}");
        incoming.discard();
        store.begin(None).and_then(|mut next| next.write(&chunk)).expect("there is room again");
    }
}
