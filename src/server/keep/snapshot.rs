//! A session as one file: writing it piece by piece, and reading one of which nothing is believed.

use super::ledger::{Entry, Whole, stored_revision};
use super::rebuild;
use crate::convert::stored::{part_id, parts};
use crate::desk::Desk;
use crate::service::upload::Staged;
use crate::state::Shared;
use crate::status::Fault;
use bytes::Bytes;
use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result};
use remesh_engine::session::{Blob, KEPT_REVISIONS, MeshSource, Past, Session, Snapshot};
use remesh_proto::v1;
use std::collections::BTreeMap;
use std::io::Read;
use std::sync::Arc;
use v1::snapshot_record::Record;

const MAGIC: &[u8] = b"remesh-session\n";
const FORMAT: u32 = 1;
/// Bytes of a file in one record.
const BLOB_PIECE: usize = 1 << 20;
/// Largest record: a part can hold the arrays of a mesh.
const MOST_RECORD_BYTES: usize = 512 << 20;
const MOST_REVISIONS: usize = 3 * KEPT_REVISIONS;
const MOST_PARTS: usize = 1 << 16;
const MOST_FILES: usize = MOST_REVISIONS;

/// A session and the files it rests on.
pub(crate) struct Picture {
    header: v1::SnapshotHeader,
    whole: Whole,
    blobs: Vec<Arc<Blob>>,
}

impl Picture {
    /// Of a session as it is now.
    ///
    /// # Errors
    /// Never seen.
    pub(crate) fn of(session: &Session, desk: &Desk) -> Result<Picture> {
        let past = session.past();
        let numbers = |states: &[Arc<Snapshot>]| states.iter().map(|s| s.revision.0).collect();
        let current = past.history.last().map_or(0, |s| s.revision.0);
        let head = v1::StoredHead { revision: current, undo: numbers(&past.undo), redo: numbers(&past.redo) };
        let mut whole = Whole { head: head.clone(), ..Whole::default() };
        let states = past.history.iter().chain(&past.undo).chain(&past.redo);
        let states: BTreeMap<u64, &Arc<Snapshot>> = states.map(|s| (s.revision.0, s)).filter(|(number, _)| *number > 0).collect();
        let mut blobs: BTreeMap<String, Arc<Blob>> = BTreeMap::new();
        let mut former = None;
        for (number, snapshot) in states {
            if let Some(MeshSource::File(blob)) = &snapshot.source {
                blobs.insert(blob.digest.clone(), blob.clone());
            }
            let (named, fresh) = parts(snapshot, desk.mesh_summary(snapshot), former.as_ref())?;
            whole.parts.extend(fresh);
            let entry = Entry { changes: &[], author: "", request_id: "", answer: None };
            whole.revisions.push(stored_revision(number, &named, &entry, None));
            former = Some(named);
        }
        let session = v1::StoredSession {
            display_name: desk.display_name.clone(),
            create_time: Some(session.created.into()),
            ttl: prost_types::Duration::try_from(session.ttl()).ok(),
            ..Default::default()
        };
        let header = v1::SnapshotHeader { format: FORMAT, session: Some(session), head: Some(head) };
        Ok(Picture { header, whole, blobs: blobs.into_values().collect() })
    }

    /// Its current revision.
    pub(crate) fn revision(&self) -> u64 {
        self.whole.head.revision
    }

    /// Gives the file to `send`, in pieces of at most about `piece` bytes. Holds one uploaded file at a time in memory.
    ///
    /// # Errors
    /// Those of reading uploaded files, and of `send`.
    pub(crate) fn write(self, piece: usize, send: impl FnMut(Bytes) -> Result<()>) -> Result<()> {
        let mut frames = Frames { hasher: blake3::Hasher::new(), buffer: Vec::new(), piece, send };
        frames.bytes(MAGIC)?;
        frames.record(Record::Header(self.header))?;
        for blob in &self.blobs {
            let bytes = blob.bytes()?;
            frames.record(Record::Blob(v1::SnapshotBlob { digest: blob.digest.clone(), bytes: bytes.len() as u64 }))?;
            for data in bytes.chunks(BLOB_PIECE) {
                frames.record(Record::BlobData(Bytes::copy_from_slice(data)))?;
            }
        }
        for part in self.whole.parts.into_values() {
            frames.record(Record::Part(part.into()))?;
        }
        for revision in self.whole.revisions {
            frames.record(Record::Revision(revision))?;
        }
        let digest = frames.hasher.finalize().as_bytes().to_vec().into();
        frames.record(Record::End(v1::SnapshotEnd { digest }))?;
        frames.flush()
    }
}

/// Frames on their way out.
struct Frames<S> {
    hasher: blake3::Hasher,
    buffer: Vec<u8>,
    piece: usize,
    send: S,
}

impl<S: FnMut(Bytes) -> Result<()>> Frames<S> {
    fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        self.hasher.update(bytes);
        for part in bytes.chunks(self.piece) {
            if self.buffer.len() + part.len() > self.piece {
                self.flush()?;
            }
            self.buffer.extend_from_slice(part);
        }
        Ok(())
    }

    fn record(&mut self, record: Record) -> Result<()> {
        let bytes = v1::SnapshotRecord { record: Some(record) }.encode_to_vec();
        let length = u32::try_from(bytes.len()).ok().filter(|&length| length as usize <= MOST_RECORD_BYTES);
        let length = length.ok_or_else(|| EngineError::new(Reason::LimitReached, "an input of the session is too large for a snapshot"))?;
        self.bytes(&length.to_le_bytes())?;
        self.bytes(&bytes)
    }

    fn flush(&mut self) -> Result<()> {
        match std::mem::take(&mut self.buffer) {
            nothing if nothing.is_empty() => Ok(()),
            piece => (self.send)(piece.into()),
        }
    }
}

/// What a file held.
pub(crate) struct Restored {
    pub(crate) session: v1::StoredSession,
    pub(crate) whole: Whole,
    pub(crate) past: Past,
    pub(crate) meshes: Vec<(Arc<Snapshot>, v1::MeshSummary)>,
    /// Held until the session holds them.
    pub(crate) _blobs: Vec<Arc<Blob>>,
}

fn invalid(what: impl Into<String>) -> EngineError {
    EngineError::new(Reason::SnapshotInvalid, format!("this is no whole snapshot: {}", what.into()))
}

/// A file on its way in.
struct Reading<R> {
    input: R,
    hasher: blake3::Hasher,
    limit: usize,
}

impl<R: Read> Reading<R> {
    /// Exactly so many bytes; memory follows what arrives.
    fn bytes(&mut self, count: usize) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(count.min(1 << 20));
        let read = (&mut self.input).take(count as u64).read_to_end(&mut bytes);
        match read {
            Ok(read) if read == count => Ok(bytes),
            _ => Err(invalid("it ends too early")),
        }
    }

    /// The next record, and the digest of all that came before it.
    fn record(&mut self) -> Result<(Record, blake3::Hash)> {
        let before = self.hasher.finalize();
        let prefix = self.bytes(4)?;
        let length = prefix.first_chunk::<4>().map_or(0, |prefix| u32::from_le_bytes(*prefix)) as usize;
        if length > self.limit {
            return Err(invalid(format!("a record of {length} bytes")));
        }
        let bytes = self.bytes(length)?;
        self.hasher.update(&prefix).update(&bytes);
        let record = v1::SnapshotRecord::decode(Bytes::from(bytes)).map_err(|error| invalid(error.to_string()))?;
        Ok((record.record.ok_or_else(|| invalid("a record of no known kind"))?, before))
    }
}

/// Reads a file and makes the inputs of it. Blocks while more is to come. Files are checked by their digests and become blobs; no more than
/// the engine allows is taken into memory.
///
/// # Errors
/// [`Reason::SnapshotInvalid`], limits, and those of the data folder.
pub(crate) fn read(shared: &Shared, input: impl Read) -> std::result::Result<Restored, Fault> {
    let most = shared.config.engine.max_blob_bytes;
    let mut reading = Reading { input, hasher: blake3::Hasher::new(), limit: MOST_RECORD_BYTES.min(most.max(4 * BLOB_PIECE)) };
    let magic = reading.bytes(MAGIC.len())?;
    if magic != MAGIC {
        return Err(invalid("it begins otherwise").into());
    }
    reading.hasher.update(&magic);
    let (Record::Header(header), _) = reading.record()? else { return Err(invalid("the header does not come first").into()) };
    if header.format != FORMAT {
        return Err(invalid(format!("it has format {}, this version reads {FORMAT}", header.format)).into());
    }
    let session = header.session.unwrap_or_default();
    let mut whole = Whole { head: header.head.unwrap_or_default(), ..Whole::default() };
    let mut blobs = Vec::new();
    let mut part_bytes = 0;
    loop {
        let (record, before) = reading.record()?;
        match record {
            Record::Header(_) | Record::BlobData(_) => return Err(invalid("records are out of order").into()),
            Record::Blob(begin) if blobs.len() < MOST_FILES => blobs.push(read_blob(shared, &mut reading, &begin)?),
            Record::Part(bytes) if whole.parts.len() < MOST_PARTS => {
                part_bytes += bytes.len();
                if part_bytes > most {
                    let message = format!("the inputs of the session have more than {most} bytes, which is the limit");
                    return Err(EngineError::new(Reason::LimitReached, message).with_metadata("limit", "max_blob_bytes").into());
                }
                whole.parts.insert(part_id(&bytes), bytes.into());
            }
            Record::Revision(revision) if whole.revisions.len() < MOST_REVISIONS => whole.revisions.push(revision),
            Record::Blob(_) | Record::Part(_) | Record::Revision(_) => return Err(invalid("it has too many records").into()),
            Record::End(end) if end.digest.as_ref() == before.as_bytes() => break,
            Record::End(_) => return Err(invalid("its digest is another").into()),
        }
    }
    let mut after = [0];
    if !matches!(reading.input.read(&mut after), Ok(0)) {
        return Err(invalid("something comes after its end").into());
    }
    let (past, meshes) = rebuild(&shared.engine, &whole).map_err(as_invalid)?;
    // What a daemon writes never has more than one of them.
    whole.revisions.sort_by_key(|revision| revision.revision);
    whole.revisions.dedup_by_key(|revision| revision.revision);
    Ok(Restored { session, whole, past, meshes, _blobs: blobs })
}

/// What is wrong with inputs is wrong with the file that they are from; limits stay limits.
fn as_invalid(error: EngineError) -> EngineError {
    match error.reason() {
        Reason::LimitReached | Reason::SnapshotInvalid => error,
        _ => invalid(error.to_string()),
    }
}

fn read_blob(shared: &Shared, reading: &mut Reading<impl Read>, begin: &v1::SnapshotBlob) -> std::result::Result<Arc<Blob>, Fault> {
    let most = shared.config.engine.max_blob_bytes;
    if begin.bytes > most as u64 {
        let message = format!("a file of {} bytes is in it, the limit is {most}", begin.bytes);
        return Err(EngineError::new(Reason::LimitReached, message).with_metadata("limit", "max_blob_bytes").into());
    }
    let mut staged = Staged::begin(shared, None)?;
    while staged.bytes() < begin.bytes {
        let (Record::BlobData(data), _) = reading.record()? else { return Err(invalid("a file in it ends too early").into()) };
        if data.is_empty() || staged.bytes() + data.len() as u64 > begin.bytes {
            return Err(invalid("a file in it has another length").into());
        }
        staged.write(shared, &data)?;
    }
    match staged.finish(shared, Some(&begin.digest)) {
        Err(Fault::DigestMismatch { .. }) => Err(invalid("a file in it has another digest").into()),
        other => other,
    }
}
