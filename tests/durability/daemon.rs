//! A daemon with a data folder, as a process.

use remesh_client::Client;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// A running daemon; killed when dropped.
pub(crate) struct Daemon {
    child: Child,
    pub(crate) address: String,
}

impl Daemon {
    /// Starts it on a folder with more settings.
    pub(crate) fn start(folder: &Path, settings: &[&str]) -> Daemon {
        let mut command = Command::new(env!("CARGO_BIN_EXE_remeshd"));
        command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(folder).args(settings);
        Daemon::spawn(command)
    }

    /// The same, and no file of it may become larger than so many bytes.
    pub(crate) fn start_with_small_files(folder: &Path, bytes: u64) -> Daemon {
        let mut command = Command::new("sh");
        // Writing beyond the limit is then an error, as on a full disk, and no signal.
        let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" --listen 127.0.0.1:0 --data-dir \"$1\"", bytes / 512);
        command.arg("-c").arg(script).arg(env!("CARGO_BIN_EXE_remeshd")).arg(folder);
        Daemon::spawn(command)
    }

    fn spawn(mut command: Command) -> Daemon {
        let mut child = command.stderr(Stdio::piped()).spawn().expect("starts");
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let mut told = Vec::new();
        let address = lines.by_ref().map_while(Result::ok).find_map(|line| {
            let address = line.split_once("address=").and_then(|(_, rest)| rest.split_whitespace().next().map(str::to_owned));
            told.push(line);
            address
        });
        // Somebody must go on reading, or the daemon stops at a full pipe.
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok).filter(|line| line.contains("ERROR")) {
                eprintln!("{line}");
            }
        });
        let address = address.unwrap_or_else(|| panic!("the daemon ended: {told:?}"));
        Daemon { child, address }
    }

    /// A connection to it.
    pub(crate) async fn connect(&self) -> Client {
        Client::connect(&self.address).await.expect("connects")
    }

    /// `kill -9`.
    pub(crate) fn kill(mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("ended");
    }

    /// SIGTERM, and its end.
    pub(crate) fn stop(mut self) {
        let told = Command::new("kill").arg(self.child.id().to_string()).status().expect("kill runs");
        assert!(told.success() && self.child.wait().expect("ends").success());
    }

    pub(crate) fn is_alive(&mut self) -> bool {
        self.child.try_wait().expect("asked").is_none()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
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
