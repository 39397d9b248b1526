//! Records in an embedded database that one thread writes: batches that wait while the disk is busy go to it together.

use crate::error::{Result, StoreError};
use crate::folder::{private_file, sync_folder};
use crate::room::Room;
use redb::backends::FileBackend;
use redb::{Database, ReadableDatabase, ReadableTable, TableDefinition};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;

const TABLE: TableDefinition<'static, &[u8], &[u8]> = TableDefinition::new("records");
/// Memory of the database for pages.
const CACHE_BYTES: usize = 8 << 20;
/// Most batches that go to the disk at once.
const MOST_TOGETHER: usize = 256;
/// What a batch may take on the disk besides its own bytes: pages of the tree that are copied.
const OVERHEAD: u64 = 256 << 10;
/// Bytes of pages for a byte of records, at most: pages come in powers of two.
const PAGES_FOR_BYTES: u64 = 2;
/// A file that is emptier than its contents need by this much is made smaller when it is opened.
const WORTH_COMPACTING: u64 = 16 << 20;

#[derive(Debug)]
enum Step {
    Put(Vec<u8>, Vec<u8>),
    Delete(Vec<u8>),
    DeleteAll(Vec<u8>),
}

/// Records to write and to delete, in order.
#[derive(Debug, Default)]
pub struct Batch {
    steps: Vec<Step>,
    bytes: u64,
}

impl Batch {
    /// Writes a record.
    pub fn put(&mut self, key: Vec<u8>, value: Vec<u8>) {
        self.bytes += (key.len() + value.len()) as u64;
        self.steps.push(Step::Put(key, value));
    }

    /// Deletes a record, if there is one.
    pub fn delete(&mut self, key: Vec<u8>) {
        self.steps.push(Step::Delete(key));
    }

    /// Deletes all records whose keys begin so.
    pub fn delete_all(&mut self, prefix: Vec<u8>) {
        self.steps.push(Step::DeleteAll(prefix));
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }
}

type Reply = mpsc::SyncSender<Result<()>>;

/// The records of a folder.
#[derive(Debug)]
pub(crate) struct Records {
    jobs: Mutex<Option<mpsc::Sender<(Batch, Reply)>>>,
    path: PathBuf,
    writer: Option<JoinHandle<()>>,
}

impl Drop for Records {
    fn drop(&mut self) {
        // The writer ends when nobody can send any more.
        drop(self.jobs.lock().unwrap_or_else(PoisonError::into_inner).take());
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

fn open(path: &Path) -> Result<Database> {
    let file = private_file().create(true).truncate(false).open(path).map_err(|e| StoreError::io("open", path, e))?;
    let opened = catch_unwind(AssertUnwindSafe(|| {
        let backend = FileBackend::new(file)?;
        Database::builder().set_cache_size(CACHE_BYTES).create_with_backend(backend)
    }));
    // The database checks what it reads, but asserts some of it.
    let opened = opened.map_err(|_| StoreError::Corrupt { what: format!("{} cannot be opened", path.display()) })?;
    opened.map_err(|e| StoreError::database(path, e.into()))
}

/// Makes an empty database under another name first: a crash on the way leaves no half of one under its own.
fn create(path: &Path) -> Result<()> {
    let fresh = path.with_extension("new");
    if let Err(error) = std::fs::remove_file(&fresh)
        && error.kind() != std::io::ErrorKind::NotFound
    {
        return Err(StoreError::io("delete", &fresh, error));
    }
    drop(open(&fresh)?);
    std::fs::rename(&fresh, path).map_err(|e| StoreError::io("name", path, e))?;
    path.parent().map_or(Ok(()), sync_folder)
}

fn read_all(database: &Database) -> std::result::Result<Vec<(Vec<u8>, Vec<u8>)>, redb::Error> {
    let reading = database.begin_read()?;
    let table = match reading.open_table(TABLE) {
        Err(redb::TableError::TableDoesNotExist(_)) => return Ok(Vec::new()),
        table => table?,
    };
    let mut all = Vec::new();
    for entry in table.iter()? {
        let (key, value) = entry?;
        all.push((key.value().to_vec(), value.value().to_vec()));
    }
    Ok(all)
}

/// The records that a write replaced or deleted, to have them back.
type Former = Vec<(Vec<u8>, Option<Vec<u8>>)>;

/// Bytes that a write adds to what is kept, after what it replaces and deletes.
fn added(batches: &[Batch], former: &Former) -> i64 {
    let put: u64 = batches.iter().map(|batch| batch.bytes).sum();
    let gone: usize = former.iter().filter_map(|(key, old)| Some(key.len() + old.as_ref()?.len())).sum();
    put as i64 - gone as i64
}

fn write(database: &Database, former: &mut Former, batches: &[Batch]) -> std::result::Result<(), redb::Error> {
    let writing = database.begin_write()?;
    {
        let mut table = writing.open_table(TABLE)?;
        for step in batches.iter().flat_map(|batch| &batch.steps) {
            match step {
                Step::Put(key, value) => {
                    let old = table.insert(key.as_slice(), value.as_slice())?.map(|old| old.value().to_vec());
                    former.push((key.clone(), old));
                }
                Step::Delete(key) => {
                    let old = table.remove(key.as_slice())?.map(|old| old.value().to_vec());
                    former.push((key.clone(), old));
                }
                Step::DeleteAll(prefix) => {
                    let mut gone = Vec::new();
                    for entry in table.range(prefix.as_slice()..)? {
                        let (key, value) = entry?;
                        if !key.value().starts_with(prefix) {
                            break;
                        }
                        gone.push((key.value().to_vec(), value.value().to_vec()));
                    }
                    for (key, value) in gone {
                        table.remove(key.as_slice())?;
                        former.push((key, Some(value)));
                    }
                }
            }
        }
    }
    writing.commit()?;
    Ok(())
}

/// The thread that writes.
struct Writer {
    path: PathBuf,
    room: Arc<Room>,
    /// Gone after an error: what the database holds in memory is then not to be trusted, and it is opened anew.
    database: Option<Database>,
    /// What a write that failed may have changed nevertheless: put back before the next one.
    suspect: Former,
    /// Bytes of all keys and values.
    live: u64,
}

impl Writer {
    fn run(mut self, jobs: &mpsc::Receiver<(Batch, Reply)>) {
        while let Ok(first) = jobs.recv() {
            let together = std::iter::once(first).chain(std::iter::from_fn(|| jobs.try_recv().ok())).take(MOST_TOGETHER);
            let (batches, replies): (Vec<Batch>, Vec<Reply>) = together.unzip();
            let mut outcome = self.commit(&batches);
            let only_deletes = batches.iter().all(|batch| batch.bytes == 0);
            if only_deletes && matches!(outcome, Err(StoreError::Full { .. })) && self.room.let_go() {
                outcome = self.commit(&batches);
            }
            if outcome.is_ok() {
                self.room.hold();
            }
            for reply in replies {
                // A caller that does not wait any more needs no answer.
                let _ = reply.send(outcome.clone());
            }
        }
    }

    fn commit(&mut self, batches: &[Batch]) -> Result<()> {
        let bytes: u64 = batches.iter().map(|batch| batch.bytes).sum();
        // What only deletes makes room and is never refused for want of it.
        if bytes > 0 {
            // The file has room for what was deleted.
            let slack = self.room.records().saturating_sub(PAGES_FOR_BYTES * self.live);
            self.room.check((PAGES_FOR_BYTES * bytes).saturating_add(OVERHEAD).saturating_sub(slack))?;
        }
        self.reopen()?;
        let mut former = Former::new();
        let outcome = self.guarded(|database| write(database, &mut former, batches));
        match &outcome {
            Ok(()) => self.live = self.live.saturating_add_signed(added(batches, &former)),
            Err(_) => {
                self.suspect = former;
                self.suspect.reverse();
            }
        }
        outcome
    }

    /// Opens the database again after an error, and takes back what the failed write may have left.
    fn reopen(&mut self) -> Result<()> {
        if self.database.is_none() {
            self.database = Some(open(&self.path)?);
        }
        if self.suspect.is_empty() {
            return Ok(());
        }
        let mut back = Batch::default();
        for (key, old) in &self.suspect {
            match old {
                Some(old) => back.put(key.clone(), old.clone()),
                None => back.delete(key.clone()),
            }
        }
        self.guarded(|database| write(database, &mut Former::new(), &[back]))?;
        self.suspect.clear();
        Ok(())
    }

    fn guarded(&mut self, work: impl FnOnce(&Database) -> std::result::Result<(), redb::Error>) -> Result<()> {
        let Some(database) = self.database.as_ref() else {
            return Err(StoreError::Corrupt { what: format!("{} is not open", self.path.display()) });
        };
        let outcome = match catch_unwind(AssertUnwindSafe(|| work(database))) {
            Ok(Ok(())) => return Ok(()),
            Ok(Err(error)) => StoreError::database(&self.path, error),
            Err(_) => StoreError::Corrupt { what: format!("writing to {} panicked", self.path.display()) },
        };
        let broken = self.database.take();
        // Closing writes, too, and may fail the same way.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(broken)));
        Err(outcome)
    }
}

/// The database in a smaller file; `None` if that failed, on a full disk perhaps: it is as it was then, and opened anew by the first write.
fn compacted(mut database: Database) -> Option<Database> {
    let done = catch_unwind(AssertUnwindSafe(move || database.compact().map(|_| database)));
    done.ok()?.ok()
}

impl Records {
    /// Opens the file and reads all records.
    pub(crate) fn open(path: PathBuf, room: Arc<Room>) -> Result<(Records, Vec<(Vec<u8>, Vec<u8>)>)> {
        if !path.exists() {
            create(&path)?;
        }
        let database = open(&path)?;
        let listed = catch_unwind(AssertUnwindSafe(|| read_all(&database)));
        let listed = listed.map_err(|_| StoreError::Corrupt { what: format!("{} cannot be read", path.display()) })?;
        let listed = listed.map_err(|e| StoreError::database(&path, e))?;
        let live: u64 = listed.iter().map(|(key, value)| (key.len() + value.len()) as u64).sum();
        let database = match room.records().saturating_sub(2 * PAGES_FOR_BYTES * live) {
            WORTH_COMPACTING.. => compacted(database),
            _ => Some(database),
        };
        room.hold();
        let (jobs, waiting) = mpsc::channel();
        let writer = Writer { path: path.clone(), room, database, suspect: Former::new(), live };
        let spawned = std::thread::Builder::new().name("store".into()).spawn(move || writer.run(&waiting));
        let writer = spawned.map_err(|e| StoreError::io("start the writer of", &path, e))?;
        Ok((Records { jobs: Mutex::new(Some(jobs)), path, writer: Some(writer) }, listed))
    }

    /// See [`crate::Store::commit`].
    pub(crate) fn commit(&self, batch: Batch) -> Result<()> {
        if batch.is_empty() {
            return Ok(());
        }
        let ended = || StoreError::Corrupt { what: format!("the writer of {} has ended", self.path.display()) };
        let (reply, answer) = mpsc::sync_channel(1);
        let jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner).clone();
        jobs.ok_or_else(ended)?.send((batch, reply)).map_err(|_| ended())?;
        answer.recv().map_err(|_| ended())?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(steps: &[(&str, Option<&str>)]) -> Batch {
        let mut batch = Batch::default();
        for (key, value) in steps {
            match value {
                Some(value) => batch.put(key.as_bytes().to_vec(), value.as_bytes().to_vec()),
                None => batch.delete(key.as_bytes().to_vec()),
            }
        }
        batch
    }

    fn at(folder: &Path, max_bytes: Option<u64>) -> (Records, Vec<(Vec<u8>, Vec<u8>)>) {
        let path = folder.join("records.redb");
        Records::open(path.clone(), Arc::new(Room::new(folder, path, max_bytes))).expect("opens")
    }

    #[test]
    fn what_was_committed_is_read_again() {
        let folder = tempfile::tempdir().expect("folder");
        let (records, listed) = at(folder.path(), None);
        assert!(listed.is_empty());
        records.commit(batch(&[("a1", Some("x")), ("a2", Some("y")), ("b", Some("z"))])).expect("commits");
        let mut second = batch(&[("b", Some("zz")), ("c", Some("w")), ("c", None)]);
        second.delete_all(b"a".to_vec());
        records.commit(second).expect("commits");
        drop(records);
        let (_, listed) = at(folder.path(), None);
        assert_eq!(listed, [(b"b".to_vec(), b"zz".to_vec())]);
    }

    #[test]
    fn many_writers_share_the_disk_and_none_is_lost() {
        let folder = tempfile::tempdir().expect("folder");
        let (records, _) = at(folder.path(), None);
        std::thread::scope(|scope| {
            for writer in 0..8 {
                let records = &records;
                scope.spawn(move || {
                    for n in 0..20 {
                        records.commit(batch(&[(&format!("{writer}-{n}"), Some("v"))])).expect("commits");
                    }
                });
            }
        });
        drop(records);
        assert_eq!(at(folder.path(), None).1.len(), 160);
    }

    #[test]
    fn a_full_folder_refuses_and_deleting_is_always_possible() {
        let folder = tempfile::tempdir().expect("folder");
        let (records, _) = at(folder.path(), Some(8 << 20));
        let big = "x".repeat(1 << 20);
        let mut kept = 0;
        let refused = loop {
            match records.commit(batch(&[(&format!("big{kept:02}"), Some(&big))])) {
                Ok(()) => kept += 1,
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, StoreError::Full { .. }) && kept >= 1, "{refused} after {kept}");
        let mut gone = Batch::default();
        gone.delete_all(b"big".to_vec());
        records.commit(gone).expect("makes room");
        drop(records);
        assert!(at(folder.path(), None).1.is_empty());
    }

    #[test]
    fn room_of_deleted_records_is_used_again_and_given_back() {
        let folder = tempfile::tempdir().expect("folder");
        let (records, _) = at(folder.path(), None);
        let big = "x".repeat(1 << 20);
        (0..30).for_each(|n| records.commit(batch(&[(&format!("big{n:02}"), Some(&big))])).expect("commits"));
        drop(records);
        let size = || Room::new(folder.path(), folder.path().join("records.redb"), None).used();
        let full = size();
        let (records, _) = at(folder.path(), Some(full));
        assert!(matches!(records.commit(batch(&[("more", Some(&big))])), Err(StoreError::Full { .. })));
        let mut gone = Batch::default();
        gone.delete_all(b"big".to_vec());
        records.commit(gone).expect("deleting needs no room");
        records.commit(batch(&[("more", Some(&big))])).expect("there is room in the file");
        drop(records);
        let (_, listed) = at(folder.path(), None);
        assert!(listed.len() == 1 && size() < full / 2, "{} of {full}", size());
    }

    #[test]
    fn a_write_that_failed_is_taken_back() {
        let folder = tempfile::tempdir().expect("folder");
        let (records, _) = at(folder.path(), None);
        records.commit(batch(&[("a", Some("1"))])).expect("commits");
        drop(records);
        let path = folder.path().join("records.redb");
        let room = Arc::new(Room::new(folder.path(), path.clone(), None));
        let suspect = vec![(b"a".to_vec(), Some(b"0".to_vec())), (b"b".to_vec(), None)];
        let mut writer = Writer { path, room, database: None, suspect, live: 2 };
        writer.commit(&[batch(&[("c", Some("3"))])]).expect("commits");
        drop(writer);
        assert_eq!(at(folder.path(), None).1, [(b"a".to_vec(), b"0".to_vec()), (b"c".to_vec(), b"3".to_vec())]);
    }
}
