//! Daemons with a data folder.

pub(crate) use crate::process::Daemon;
use remesh_client::Client;
use std::path::Path;
use std::process::Command;

impl Daemon {
    /// Starts it on a folder with more settings.
    pub(crate) fn on(folder: &Path, settings: &[&str]) -> Daemon {
        let mut command = Command::new(env!("CARGO_BIN_EXE_remeshd"));
        command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(folder).args(settings);
        Daemon::spawn(command)
    }

    /// The same, and no file of it may become larger than so many bytes.
    pub(crate) fn with_small_files(folder: &Path, bytes: u64) -> Daemon {
        let mut command = Command::new("sh");
        // Writing beyond the limit is then an error, as on a full disk, and no signal.
        let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" --listen 127.0.0.1:0 --data-dir \"$1\"", bytes / 512);
        command.arg("-c").arg(script).arg(env!("CARGO_BIN_EXE_remeshd")).arg(folder);
        Daemon::spawn(command)
    }

    /// A connection to it.
    pub(crate) async fn connect(&self) -> Client {
        Client::connect(&self.address).await.expect("connects")
    }

    /// `kill -9`.
    pub(crate) fn kill(mut self) {
        self.signal("-KILL");
    }

    /// SIGTERM, and its end.
    pub(crate) fn stop(mut self) {
        assert!(self.signal("-TERM").success());
    }

    /// Whether it has not ended.
    pub(crate) fn is_alive(&mut self) -> bool {
        self.child.try_wait().expect("asked").is_none()
    }
}

/// Numbers that look random and are the same each time.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// A number below `bound`.
    pub(crate) fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) % bound
    }
}
