//! Settings of the server. Everything that a test wants to choose is here: limits, the clock, grace periods.

use crate::security::Security;
use remesh_engine::engine::EngineConfig;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// Where the server takes the time of day from (for the life of sessions).
#[derive(Clone)]
pub struct Clock(Arc<dyn Fn() -> SystemTime + Send + Sync>);

impl Clock {
    /// A clock of the caller's own.
    pub fn new(now: impl Fn() -> SystemTime + Send + Sync + 'static) -> Self {
        Clock(Arc::new(now))
    }

    /// The time.
    pub fn now(&self) -> SystemTime {
        (self.0)()
    }
}

impl Default for Clock {
    fn default() -> Self {
        Clock::new(SystemTime::now)
    }
}

impl std::fmt::Debug for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Clock").field(&self.now()).finish()
    }
}

/// Where sessions are kept, and how much.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keeping {
    /// The folder; made if there is none. Only one server can have it.
    pub folder: PathBuf,
    /// Most bytes that it may take on the disk; `None` for what the disk has.
    pub max_bytes: Option<u64>,
    /// Most bytes of it that the sessions and files of one client may take.
    pub max_bytes_per_client: Option<u64>,
    /// How long an uploaded file stays that nobody asks for and no session uses.
    pub blob_grace: Duration,
}

/// Settings of a server.
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// Limits and sizes of the engine.
    pub engine: EngineConfig,
    /// Largest message of most methods, both ways.
    pub max_message_bytes: usize,
    /// Largest file inside a `RemeshMesh` message, both ways.
    pub max_inline_bytes: usize,
    /// Long calls (remesh, partition, import...) that compute at the same time; each uses up to `engine.threads` threads.
    pub max_running: usize,
    /// Short calls (reads, plans, diagnoses) that compute at the same time, beside the long ones.
    pub max_running_short: usize,
    /// Calls of one client that compute or wait to; more are refused.
    pub max_jobs_per_client: usize,
    /// Sessions of one client.
    pub max_sessions_per_client: usize,
    /// Faces of the surfaces of all sessions together.
    pub max_open_faces: u64,
    /// Faces of the surfaces of the sessions of one client together.
    pub max_open_faces_per_client: u64,
    /// Connections that may be open; more are closed as they come.
    pub max_connections: usize,
    /// How long a new connection may take to say its first word.
    pub first_word: Duration,
    /// How long an upload may stand still.
    pub upload_idle: Duration,
    /// Calls that wait for one of those places; more are refused.
    pub max_queued: usize,
    /// Streams of session events that may be open; more are refused.
    pub max_watchers: usize,
    /// How long running calls may go on after shutdown was asked for; then they are cancelled.
    pub grace: Duration,
    /// How often expired sessions are removed.
    pub sweep_interval: Duration,
    /// The time of day.
    pub clock: Clock,
    /// Who may call, and over what; by default anybody, in the clear.
    pub security: Security,
    /// How often the files of `security` are looked at.
    pub reload_interval: Duration,
    /// Where sessions outlive the server; `None` keeps them in memory only.
    pub keeping: Option<Keeping>,
    /// How long an upload that broke may be gone on with.
    pub upload_patience: Duration,
}

impl Default for ServerConfig {
    fn default() -> Self {
        ServerConfig {
            engine: EngineConfig::default(),
            max_message_bytes: 4 << 20,
            max_inline_bytes: 64 << 20,
            max_running: 2,
            max_running_short: 4,
            max_queued: 64,
            max_jobs_per_client: 48,
            max_sessions_per_client: 256,
            max_open_faces: 100_000_000,
            max_open_faces_per_client: 100_000_000,
            max_connections: 1024,
            first_word: Duration::from_secs(10),
            upload_idle: Duration::from_secs(60),
            max_watchers: 1024,
            grace: Duration::from_secs(10),
            sweep_interval: Duration::from_secs(30),
            clock: Clock::default(),
            security: Security::default(),
            reload_interval: Duration::from_secs(10),
            keeping: None,
            upload_patience: Duration::from_secs(3600),
        }
    }
}

/// Largest piece of a file or array in one message of a stream.
pub(crate) const CHUNK_BYTES: usize = 1 << 20;

/// What the wrapping of a file in a message may add to its size.
pub(crate) const MESSAGE_OVERHEAD_BYTES: usize = 1 << 20;
