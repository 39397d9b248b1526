//! What all sessions share: the stage cache, the blobs, the sessions themselves and their limits.

use crate::error::{EngineError, Reason, Result};
use crate::session::{Blob, Past, Session};
use crate::stage::StageCache;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, SystemTime};

/// Limits and sizes of an engine.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineConfig {
    /// Bytes of stage outputs kept.
    pub cache_bytes: usize,
    /// Threads one request may use.
    pub threads: usize,
    /// Sessions open at a time.
    pub max_sessions: usize,
    /// Faces of one imported surface.
    pub max_faces: u64,
    /// Bytes of one uploaded file.
    pub max_blob_bytes: usize,
    /// Bytes of all uploaded files together.
    pub max_total_blob_bytes: usize,
    /// Life of a session after its last use, if its creator does not say.
    pub default_ttl: Duration,
    /// Longest life a creator may ask for.
    pub max_ttl: Duration,
}

impl Default for EngineConfig {
    fn default() -> Self {
        EngineConfig {
            cache_bytes: 2 << 30,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            max_sessions: 256,
            max_faces: 10_000_000,
            max_blob_bytes: 1 << 30,
            max_total_blob_bytes: 4 << 30,
            default_ttl: Duration::from_secs(3600),
            max_ttl: Duration::from_secs(7 * 24 * 3600),
        }
    }
}

/// The shared state of a daemon (or of an in-process run). All methods take `&self` and are cheap; long work is in [`crate::pipeline`].
#[derive(Debug)]
pub struct Engine {
    /// Limits and sizes.
    pub config: EngineConfig,
    /// Stage outputs of all sessions.
    pub cache: StageCache,
    sessions: Mutex<HashMap<String, Arc<Session>>>,
    /// Uploaded files, oldest first.
    blobs: Mutex<Vec<Arc<Blob>>>,
}

/// An unguessable name.
fn random_id() -> Result<String> {
    let mut random = [0u8; 16];
    getrandom::fill(&mut random).map_err(|e| EngineError::invariant(format!("no randomness for a session id: {e}")))?;
    Ok(random.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn guard<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

impl Engine {
    /// An engine without sessions.
    pub fn new(config: EngineConfig) -> Arc<Engine> {
        let cache = StageCache::new(config.cache_bytes);
        Arc::new(Engine { config, cache, sessions: Mutex::default(), blobs: Mutex::default() })
    }

    /// Opens a session; `ttl` is bounded by the configuration.
    ///
    /// # Errors
    /// [`Reason::LimitReached`] when too many are open; [`Reason::Invariant`] if the system gives no randomness.
    pub fn create_session(&self, ttl: Option<Duration>, now: SystemTime) -> Result<Arc<Session>> {
        let ttl = ttl.unwrap_or(self.config.default_ttl).min(self.config.max_ttl);
        self.add_session(Session::new(random_id()?, ttl, now))
    }

    /// Opens a new session with the past of another.
    ///
    /// # Errors
    /// Those of [`Engine::create_session`] and of [`Session::resume`].
    pub fn restore_session(&self, ttl: Option<Duration>, now: SystemTime, past: Past) -> Result<Arc<Session>> {
        let ttl = ttl.unwrap_or(self.config.default_ttl).min(self.config.max_ttl);
        self.add_session(Session::resume(random_id()?, now, ttl, now, past)?)
    }

    fn add_session(&self, session: Session) -> Result<Arc<Session>> {
        let mut sessions = guard(&self.sessions);
        if sessions.len() >= self.config.max_sessions {
            let message = format!("{} sessions are open, which is the limit", sessions.len());
            return Err(EngineError::new(Reason::LimitReached, message).with_hint("delete a session or wait for one to expire"));
        }
        let session = Arc::new(session);
        sessions.insert(session.id.clone(), session.clone());
        Ok(session)
    }

    /// Takes a session back that was open before the program started. There may then be more than the limit allows to be opened.
    pub fn reopen_session(&self, session: Session) -> Arc<Session> {
        let session = Arc::new(session);
        guard(&self.sessions).insert(session.id.clone(), session.clone());
        session
    }

    /// A session by id; marks it as used.
    ///
    /// # Errors
    /// [`Reason::SessionNotFound`], [`Reason::SessionExpired`].
    pub fn session(&self, id: &str, now: SystemTime) -> Result<Arc<Session>> {
        let found = guard(&self.sessions).get(id).cloned();
        let session = found.ok_or_else(|| {
            EngineError::new(Reason::SessionNotFound, "no such session").with_hint("it was never made, was deleted, or has expired")
        })?;
        if session.expires() < now {
            return Err(EngineError::new(Reason::SessionExpired, "the session has expired").with_hint("create a new session"));
        }
        session.touch(now);
        Ok(session)
    }

    /// All sessions that have not expired, by creation time, then id.
    pub fn sessions(&self, now: SystemTime) -> Vec<Arc<Session>> {
        let mut all: Vec<_> = guard(&self.sessions).values().filter(|s| s.expires() >= now).cloned().collect();
        all.sort_by(|a, b| (a.created, &a.id).cmp(&(b.created, &b.id)));
        all
    }

    /// Closes a session.
    ///
    /// # Errors
    /// [`Reason::SessionNotFound`].
    pub fn delete_session(&self, id: &str) -> Result<()> {
        let removed = guard(&self.sessions).remove(id);
        removed.map(drop).ok_or_else(|| EngineError::new(Reason::SessionNotFound, "no such session"))
    }

    /// Removes expired sessions and gives how many there were; brings the cache back under its budget.
    pub fn sweep(&self, now: SystemTime) -> usize {
        self.cache.trim();
        let mut sessions = guard(&self.sessions);
        let before = sessions.len();
        sessions.retain(|_, session| session.expires() >= now);
        before - sessions.len()
    }

    /// Keeps an uploaded file; the same file is kept once. Files that no session uses make room, oldest first.
    ///
    /// # Errors
    /// [`Reason::LimitReached`] if the file, or all files in use together, are too large.
    pub fn put_blob(&self, bytes: Vec<u8>) -> Result<Arc<Blob>> {
        if bytes.len() > self.config.max_blob_bytes {
            let message = format!("the file has {} bytes, the limit is {}", bytes.len(), self.config.max_blob_bytes);
            return Err(EngineError::new(Reason::LimitReached, message));
        }
        self.add_blob(Blob::new(bytes))
    }

    /// Keeps a file, wherever its contents are; the same file is kept once. Only what is in memory counts against the limit.
    ///
    /// # Errors
    /// [`Reason::LimitReached`] if all files in use together are too large.
    pub fn add_blob(&self, blob: Blob) -> Result<Arc<Blob>> {
        let blob = Arc::new(blob);
        let mut blobs = guard(&self.blobs);
        if let Some(at) = blobs.iter().position(|b| b.digest == blob.digest) {
            let known = blobs.remove(at);
            blobs.push(known.clone());
            return Ok(known);
        }
        let mut total: usize = blob.held_bytes() + blobs.iter().map(|b| b.held_bytes()).sum::<usize>();
        blobs.retain(|b| {
            let held = b.held_bytes();
            let drop_it = total > self.config.max_total_blob_bytes && held > 0 && Arc::strong_count(b) == 1;
            total -= if drop_it { held } else { 0 };
            !drop_it
        });
        if total > self.config.max_total_blob_bytes {
            let message = format!("uploaded files in use would take {total} bytes, the limit is {}", self.config.max_total_blob_bytes);
            return Err(EngineError::new(Reason::LimitReached, message).with_hint("delete sessions that are no longer needed"));
        }
        blobs.push(blob.clone());
        Ok(blob)
    }

    /// Lets go of files that no session and no call uses and of which `is_old` says so; gives their digests.
    pub fn drop_unused_blobs(&self, is_old: impl Fn(&Blob) -> bool) -> Vec<String> {
        let mut dropped = Vec::new();
        guard(&self.blobs).retain(|blob| {
            // Whoever finds the blob from now on does so under this lock.
            let keep = Arc::strong_count(blob) > 1 || !is_old(blob);
            if !keep {
                dropped.push(blob.digest.clone());
            }
            keep
        });
        dropped
    }

    /// How many uploaded files are kept, and their bytes.
    pub fn blob_usage(&self) -> (u64, u64) {
        let blobs = guard(&self.blobs);
        (blobs.len() as u64, blobs.iter().map(|b| b.len() as u64).sum())
    }

    /// An uploaded file by digest.
    ///
    /// # Errors
    /// [`Reason::BlobNotFound`].
    pub fn blob(&self, digest: &str) -> Result<Arc<Blob>> {
        guard(&self.blobs).iter().find(|b| b.digest == digest).cloned().ok_or_else(|| {
            EngineError::new(Reason::BlobNotFound, format!("no uploaded file has the digest {digest:?}")).with_hint("upload it (again)")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Arc<Engine> {
        Engine::new(EngineConfig { max_sessions: 2, max_blob_bytes: 10, max_total_blob_bytes: 15, ..EngineConfig::default() })
    }

    #[test]
    fn sessions_expire_and_are_swept() {
        let engine = small();
        let start = SystemTime::UNIX_EPOCH;
        let session = engine.create_session(Some(Duration::from_secs(10)), start).unwrap();
        assert!(engine.session(&session.id, start + Duration::from_secs(9)).is_ok());
        let late = start + Duration::from_secs(20);
        assert_eq!(engine.session(&session.id, late).unwrap_err().reason(), Reason::SessionExpired);
        assert_eq!(engine.sweep(late), 1);
        assert_eq!(engine.session(&session.id, late).unwrap_err().reason(), Reason::SessionNotFound);
    }

    #[test]
    fn session_count_is_limited_and_ids_differ() {
        let engine = small();
        let now = SystemTime::UNIX_EPOCH;
        let (a, b) = (engine.create_session(None, now).unwrap(), engine.create_session(None, now).unwrap());
        assert_ne!(a.id, b.id);
        assert_eq!(engine.create_session(None, now).unwrap_err().reason(), Reason::LimitReached);
        engine.delete_session(&a.id).unwrap();
        assert!(engine.create_session(None, now).is_ok());
    }

    #[test]
    fn blobs_are_kept_once_and_unused_ones_make_room() {
        let engine = small();
        let first = engine.put_blob(vec![1; 8]).unwrap();
        assert!(Arc::ptr_eq(&first, &engine.put_blob(vec![1; 8]).unwrap()));
        assert_eq!(engine.put_blob(vec![2; 8]).unwrap_err().reason(), Reason::LimitReached, "the first is in use");
        let digest = first.digest.clone();
        drop(first);
        engine.put_blob(vec![2; 8]).unwrap();
        assert_eq!(engine.blob(&digest).unwrap_err().reason(), Reason::BlobNotFound);
        assert_eq!(engine.put_blob(vec![0; 11]).unwrap_err().reason(), Reason::LimitReached);
    }
}
