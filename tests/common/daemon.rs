//! The real `remeshd` as a process of its own, for tests and benches.
#![allow(dead_code, reason = "every test uses a part of it")]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};

/// A running daemon; killed when dropped.
pub(crate) struct Daemon {
    /// The process.
    pub(crate) child: Child,
    /// Where it listens, as `127.0.0.1:50061`.
    pub(crate) address: String,
    /// What it logged until it listened.
    log: Vec<String>,
}

/// What follows a key in a line of the log.
fn value(line: &str, key: &str) -> Option<String> {
    Some(line.split_once(key)?.1.split_whitespace().next()?.to_owned())
}

impl Daemon {
    /// Starts it on a free port with these settings besides.
    pub(crate) fn start(settings: &[&str]) -> Daemon {
        let mut command = Command::new(env!("CARGO_BIN_EXE_remeshd"));
        command.args(["--listen", "127.0.0.1:0"]).args(settings);
        Daemon::spawn(command)
    }

    /// Starts it by a command that tells it to listen on a free port.
    pub(crate) fn spawn(mut command: Command) -> Daemon {
        let mut child = command.stderr(Stdio::piped()).spawn().expect("starts");
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
        let mut log = Vec::new();
        let address = lines.by_ref().find_map(|line| {
            let address = value(&line, " address=");
            log.push(line);
            address
        });
        // Somebody must go on reading, or the daemon stops at a full pipe. What it should not say is shown.
        std::thread::spawn(move || {
            for line in lines.filter(|line| line.contains("ERROR") || line.contains("panic")) {
                eprintln!("{line}");
            }
        });
        let address = address.unwrap_or_else(|| panic!("the daemon ended: {log:?}"));
        Daemon { child, address, log }
    }

    /// What it logged under a key (with its `=`) until it listened.
    pub(crate) fn told(&self, key: &str) -> String {
        self.log.iter().find_map(|line| value(line, key)).unwrap_or_else(|| panic!("the log tells no {key}: {:?}", self.log))
    }

    /// Sends it a signal (as `-TERM`) and waits for its end.
    pub(crate) fn signal(&mut self, name: &str) -> ExitStatus {
        let told = Command::new("kill").args([name, &self.child.id().to_string()]).status().expect("kill runs");
        assert!(told.success());
        self.child.wait().expect("ends")
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
