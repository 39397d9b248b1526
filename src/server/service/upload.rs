//! Taking a file in chunks, within the limits at every chunk. Bytes go from the transport through a short queue to a thread that writes them into the
//! data folder, or into memory without one. What came of an upload that breaks is parked, to be gone on with.

use crate::caller::Caller;
use crate::config::CHUNK_BYTES;
use crate::guarded::next_message;
use crate::state::Shared;
use crate::status::Fault;
use bytes::Bytes;
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::session::Blob;
use remesh_proto::v1;
use remesh_store::{Incoming, Leftover};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::sync::{mpsc, oneshot};
use tonic::Streaming;

/// Uploads that broke and are kept, of all callers together; the oldest make room.
const MOST_PARKED: usize = 64;
/// Chunks between the transport and the thread that writes.
const QUEUE: usize = 4;
/// Most digests in one question.
pub(crate) const MOST_DIGESTS: usize = 1000;

/// Uploads that are under way, and those that broke.
#[derive(Debug, Default)]
pub(crate) struct Uploads {
    /// Bytes in memory.
    held: Arc<AtomicUsize>,
    parked: Mutex<Vec<Parked>>,
}

/// What an upload that broke is found again by: who sent it, and the digest of the whole file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Ticket {
    /// Digits of the hash of the name of the caller.
    caller: String,
    digest: String,
}

impl Ticket {
    fn new(caller: &Caller, digest: &str) -> Self {
        let caller = blake3::hash(caller.name().as_bytes()).to_hex();
        Ticket { caller: caller[..16].to_owned(), digest: digest.to_owned() }
    }

    /// The label of the file in the data folder.
    fn label(&self) -> String {
        format!("{}-{}", self.digest, self.caller)
    }

    fn of_label(label: &str) -> Option<Self> {
        let (digest, caller) = label.split_once('-')?;
        Some(Ticket { caller: caller.to_owned(), digest: digest.to_owned() })
    }
}

#[derive(Debug)]
struct Parked {
    ticket: Ticket,
    since: SystemTime,
    file: Broken,
}

#[derive(Debug)]
enum Broken {
    Staged(Staged),
    Left(Leftover),
}

impl Broken {
    fn bytes(&self) -> u64 {
        match self {
            Broken::Staged(staged) => staged.bytes(),
            Broken::Left(leftover) => leftover.bytes,
        }
    }
}

/// A file that is not complete.
#[derive(Debug)]
pub(crate) enum Staged {
    /// In memory.
    Memory(Held),
    /// In the data folder.
    File(Box<Incoming>),
}

/// Bytes in memory, counted with those of all uploads.
#[derive(Debug)]
pub(crate) struct Held {
    all: Arc<AtomicUsize>,
    bytes: Vec<u8>,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.all.fetch_sub(self.bytes.len(), Ordering::Relaxed);
    }
}

impl Held {
    fn write(&mut self, data: &[u8], limit: usize) -> EngineResult<()> {
        let all = self.all.fetch_add(data.len(), Ordering::Relaxed) + data.len();
        if all > limit {
            self.all.fetch_sub(data.len(), Ordering::Relaxed);
            let message = format!("uploads under way would take {all} bytes, the limit is {limit}");
            return Err(EngineError::new(Reason::LimitReached, message).with_metadata("retry", "when other uploads have ended"));
        }
        self.bytes.extend_from_slice(data);
        Ok(())
    }
}

impl Staged {
    /// An empty file where files are kept.
    pub(crate) fn begin(shared: &Shared, label: Option<&str>) -> EngineResult<Staged> {
        match shared.keeper.begin(label) {
            Some(incoming) => Ok(Staged::File(Box::new(incoming?))),
            None => Ok(Staged::Memory(Held { all: shared.uploads.held.clone(), bytes: Vec::new() })),
        }
    }

    /// Bytes that arrived.
    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Staged::Memory(held) => held.bytes.len() as u64,
            Staged::File(incoming) => incoming.bytes(),
        }
    }

    /// Appends bytes. Blocks while the disk works.
    pub(crate) fn write(&mut self, shared: &Shared, data: &[u8]) -> EngineResult<()> {
        match self.try_write(shared, data) {
            // Uploads that broke are the first to make room.
            Err(error) if matches!(error.reason(), Reason::LimitReached | Reason::StoreFull) && shared.uploads.make_room(shared) => {
                self.try_write(shared, data)
            }
            outcome => outcome,
        }
    }

    fn try_write(&mut self, shared: &Shared, data: &[u8]) -> EngineResult<()> {
        match self {
            Staged::Memory(held) => held.write(data, shared.config.engine.max_total_blob_bytes),
            Staged::File(incoming) => incoming.write(data).map_err(|error| crate::keep::told(&error)),
        }
    }

    /// Makes it a blob, if it has the digest that is expected. Blocks while the disk works.
    pub(crate) fn finish(self, shared: &Shared, expected: Option<&str>) -> Result<Arc<Blob>, Fault> {
        let mismatch = |actual: &str| expected.is_some_and(|expected| expected != actual);
        match self {
            Staged::Memory(mut held) => {
                shared.uploads.held.fetch_sub(held.bytes.len(), Ordering::Relaxed);
                let blob = Blob::new(std::mem::take(&mut held.bytes));
                if mismatch(&blob.digest) {
                    return Err(Fault::DigestMismatch { actual: blob.digest });
                }
                Ok(shared.engine.add_blob(blob)?)
            }
            Staged::File(incoming) => {
                let actual = incoming.digest();
                if mismatch(&actual) {
                    incoming.discard();
                    return Err(Fault::DigestMismatch { actual });
                }
                Ok(shared.keeper.finish(&shared.engine, *incoming)?)
            }
        }
    }
}

impl Uploads {
    /// With uploads that broke before the server was started.
    pub(crate) fn of(leftovers: Vec<Leftover>, now: SystemTime) -> Self {
        let parked = leftovers
            .into_iter()
            .filter_map(|left| Some(Parked { ticket: Ticket::of_label(&left.label)?, since: now, file: Broken::Left(left) }));
        Uploads { held: Arc::default(), parked: Mutex::new(parked.collect()) }
    }

    fn parked(&self) -> MutexGuard<'_, Vec<Parked>> {
        self.parked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How much of a file has arrived in an upload of the caller that broke.
    pub(crate) fn received(&self, caller: &Caller, digest: &str) -> u64 {
        let ticket = Ticket::new(caller, digest);
        self.parked().iter().filter(|parked| parked.ticket == ticket).map(|parked| parked.file.bytes()).max().unwrap_or(0)
    }

    fn park(&self, ticket: Ticket, mut staged: Staged, now: SystemTime) {
        if staged.bytes() == 0 {
            return;
        }
        if let Staged::File(incoming) = &mut staged {
            incoming.keep();
        }
        let mut parked = self.parked();
        let mut gone = Vec::new();
        // Of several uploads of the same file that broke the longest is worth keeping.
        if let Some(at) = parked.iter().position(|other| other.ticket == ticket) {
            let other = parked.swap_remove(at);
            let broken = Broken::Staged(staged);
            let (longer, shorter) = if other.file.bytes() > broken.bytes() { (other.file, broken) } else { (broken, other.file) };
            gone.push(shorter);
            parked.push(Parked { ticket, since: now, file: longer });
        } else {
            parked.push(Parked { ticket, since: now, file: Broken::Staged(staged) });
        }
        if parked.len() > MOST_PARKED
            && let Some(oldest) = parked.iter().enumerate().min_by_key(|(_, p)| p.since).map(|(at, _)| at)
        {
            gone.push(parked.swap_remove(oldest).file);
        }
        drop(parked);
        gone.into_iter().for_each(discard);
    }

    /// Lets go of uploads that broke long ago.
    pub(crate) fn expire(&self, shared: &Shared, now: SystemTime, patience: Duration) {
        let mut parked = self.parked();
        let is_late = |p: &Parked| now.duration_since(p.since).is_ok_and(|age| age > patience);
        let (late, kept): (Vec<_>, Vec<_>) = parked.drain(..).partition(is_late);
        *parked = kept;
        drop(parked);
        late.into_iter().for_each(|late| delete(shared, late.file));
    }

    /// Lets go of all uploads that broke; gives whether there were any.
    fn make_room(&self, shared: &Shared) -> bool {
        let gone = std::mem::take(&mut *self.parked());
        let any = !gone.is_empty();
        gone.into_iter().for_each(|parked| delete(shared, parked.file));
        any
    }

    fn take(&self, shared: &Shared, ticket: &Ticket, offset: u64) -> Result<Staged, Fault> {
        let mut parked = self.parked();
        let at = parked.iter().position(|p| p.ticket == *ticket && p.file.bytes() == offset);
        let received = parked.iter().find(|p| p.ticket == *ticket).map_or(0, |p| p.file.bytes());
        let found = at.map(|at| parked.swap_remove(at).file).ok_or(Fault::UploadOffset { received })?;
        drop(parked);
        match found {
            Broken::Staged(staged) => Ok(staged),
            Broken::Left(left) => match shared.keeper.resume(&left) {
                Some(incoming) => Ok(Staged::File(Box::new(incoming?))),
                None => Err(Fault::UploadOffset { received: 0 }),
            },
        }
    }
}

fn delete(shared: &Shared, broken: Broken) {
    match broken {
        Broken::Left(left) => shared.keeper.resume(&left).into_iter().flatten().for_each(Incoming::discard),
        staged => discard(staged),
    }
}

fn discard(broken: Broken) {
    match broken {
        Broken::Staged(Staged::File(incoming)) => incoming.discard(),
        // Found again at the next start.
        Broken::Staged(Staged::Memory(_)) | Broken::Left(_) => {}
    }
}

fn too_large(bytes: u64, limit: usize) -> Fault {
    let error = EngineError::new(Reason::LimitReached, format!("the file has {bytes} bytes or more, the limit is {limit}"));
    error.with_metadata("limit", "max_blob_bytes").with_metadata("max_blob_bytes", limit).into()
}

/// A digest in a request, in the spelling of the engine.
pub(crate) fn digest(text: &str, field: &str) -> EngineResult<String> {
    if text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Ok(text.to_ascii_lowercase());
    }
    Err(EngineError::bad_parameter(field, "is not a BLAKE3 digest of 64 hexadecimal digits"))
}

/// What goes to the thread that writes.
enum Piece {
    Data(Bytes),
    /// The end: the file is asked for.
    End(oneshot::Sender<Staged>),
}

/// Writes until the end; parks what came if there is none, unless the upload was refused.
fn write_all(
    shared: &Shared,
    ticket: Option<&Ticket>,
    refused: &AtomicBool,
    mut staged: Staged,
    mut pieces: mpsc::Receiver<Piece>,
) -> EngineResult<()> {
    let broken = loop {
        match pieces.blocking_recv() {
            Some(Piece::Data(data)) => staged.write(shared, &data)?,
            Some(Piece::End(reply)) => match reply.send(staged) {
                Ok(()) => return Ok(()),
                Err(staged) => break staged,
            },
            None => break staged,
        }
    };
    if let Some(ticket) = ticket.filter(|_| !refused.load(Ordering::Acquire)) {
        shared.uploads.park(ticket.clone(), broken, shared.config.clock.now());
    }
    Ok(())
}

/// A whole file and the digest that its sender expects.
pub(crate) struct Upload {
    pub(crate) file: Staged,
    pub(crate) expected: Option<String>,
}

fn gone() -> Fault {
    EngineError::invariant("the thread that writes an upload ended").into()
}

/// Reads all chunks. Memory follows what arrives, never what is announced, and is bounded where there is a data folder.
pub(crate) async fn receive(
    shared: &Arc<Shared>,
    caller: &Caller,
    client: &str,
    mut stream: Streaming<v1::UploadMeshRequest>,
) -> Result<Upload, Fault> {
    let first = next_message(&mut stream, shared.config.upload_idle).await?.unwrap_or_default();
    let limit = shared.config.engine.max_blob_bytes;
    let (announced, offset) = (first.total_bytes, first.offset);
    if let Some(total) = announced.filter(|&total| total > limit as u64) {
        return Err(too_large(total, limit));
    }
    let expected = match first.expected_digest.as_str() {
        "" => None,
        text => Some(digest(text, "expected_digest")?),
    };
    let ticket = expected.as_ref().map(|digest| Ticket::new(caller, digest));
    let staged = match (&ticket, offset) {
        (None, 1..) => return Err(EngineError::bad_parameter("offset", "needs expected_digest").into()),
        (Some(ticket), 1..) => shared.uploads.take(shared, ticket, offset)?,
        (ticket, 0) => Staged::begin(shared, ticket.as_ref().map(Ticket::label).as_deref())?,
    };
    let (queue, pieces) = mpsc::channel(QUEUE);
    let refused = Arc::new(AtomicBool::new(false));
    let (writer_shared, writer_refused) = (shared.clone(), refused.clone());
    let writer = tokio::task::spawn_blocking(move || write_all(&writer_shared, ticket.as_ref(), &writer_refused, staged, pieces));
    let passing = Passing { shared, client, limit, announced, expected: expected.clone(), queue };
    match passing.all(stream, first).await {
        Ok(Some(file)) => Ok(Upload { file, expected }),
        // The thread ended early, and says why.
        Ok(None) => Err(writer.await.map_or_else(|_| gone(), |ended| ended.err().map_or_else(gone, Fault::from))),
        Err(fault) => {
            let may_go_on = matches!(fault, Fault::UploadBroken { .. } | Fault::UploadIncomplete { .. });
            refused.store(!may_go_on, Ordering::Release);
            drop(passing);
            Err(fault)
        }
    }
}

/// Chunks on their way to the thread that writes them.
struct Passing<'a> {
    shared: &'a Shared,
    client: &'a str,
    limit: usize,
    announced: Option<u64>,
    expected: Option<String>,
    queue: mpsc::Sender<Piece>,
}

impl Passing<'_> {
    /// Passes all chunks on and asks for the file; `None` if the thread has ended.
    async fn all(&self, mut stream: Streaming<v1::UploadMeshRequest>, first: v1::UploadMeshRequest) -> Result<Option<Staged>, Fault> {
        let mut total = first.offset;
        let mut next = Some(first);
        while let Some(chunk) = next {
            total += chunk.data.len() as u64;
            self.check(chunk.data.len(), total)?;
            if !chunk.data.is_empty() && self.queue.send(Piece::Data(chunk.data)).await.is_err() {
                return Ok(None);
            }
            next = next_message(&mut stream, self.shared.config.upload_idle).await?;
        }
        if total == 0 {
            return Err(EngineError::bad_parameter("data", "the file is empty").into());
        }
        match self.announced {
            Some(announced) if announced > total => return Err(Fault::UploadIncomplete { announced, received: total }),
            Some(announced) if announced < total => {
                let message = format!("{announced} bytes were announced, {total} came");
                return Err(EngineError::bad_parameter("total_bytes", message).into());
            }
            _ => {}
        }
        let (reply, file) = oneshot::channel();
        match self.queue.send(Piece::End(reply)).await {
            Ok(()) => Ok(file.await.ok()),
            Err(_) => Ok(None),
        }
    }

    fn check(&self, chunk: usize, total: u64) -> Result<(), Fault> {
        if chunk > CHUNK_BYTES {
            let message = format!("a chunk has {chunk} bytes, the limit is {CHUNK_BYTES}");
            return Err(EngineError::bad_parameter("data", message).into());
        }
        if total > self.limit as u64 {
            return Err(too_large(total, self.limit));
        }
        let bytes = self.announced.unwrap_or(total).max(total);
        match &self.expected {
            // One that the client has already takes no more.
            Some(digest) => self.shared.keeper.charges.admit(self.client, 0, [&(digest.clone(), bytes)])?,
            None => self.shared.keeper.charges.admit(self.client, bytes, [])?,
        }
        self.shared.metrics.uploaded(chunk);
        Ok(())
    }
}

/// Which of some files are not here, and how much of each has arrived.
pub(crate) fn missing(shared: &Shared, caller: &Caller, digests: &[String]) -> EngineResult<v1::FindMissingBlobsResponse> {
    if digests.len() > MOST_DIGESTS {
        let message = format!("{} digests are asked for, the limit is {MOST_DIGESTS}", digests.len());
        return Err(EngineError::bad_parameter("digests", message));
    }
    let mut missing = Vec::new();
    for text in digests {
        let digest = digest(text, "digests")?;
        match shared.engine.blob(&digest) {
            Ok(_) => shared.keeper.touch(&digest),
            Err(_) => missing.push(v1::MissingBlob { received_bytes: shared.uploads.received(caller, &digest), digest }),
        }
    }
    Ok(v1::FindMissingBlobsResponse { missing })
}
