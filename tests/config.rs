//! Settings of `remeshd` from all four places, `check-config` and `health`, as a process.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A file of one test; removed when it ends.
struct File(PathBuf);

impl File {
    fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("remeshd-{}-{name}.toml", std::process::id()));
        std::fs::write(&path, text).expect("written");
        File(path)
    }

    fn path(&self) -> &str {
        self.0.to_str().expect("UTF-8")
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn remeshd(arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_remeshd")).args(arguments).envs(variables.iter().copied()).output().expect("runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn flags_win_over_the_environment_that_over_the_file_that_over_the_binary() {
    let file = File::new("layers", "cache_mb = 11\nmax_sessions = 12\nmax_queued = 13\n");
    let variables = [("REMESHD_MAX_SESSIONS", "22"), ("REMESHD_MAX_QUEUED", "23")];
    // Before and after the verb is the same.
    for arguments in
        [["--config", file.path(), "--max-queued", "33", "check-config"], ["check-config", "--config", file.path(), "--max-queued", "33"]]
    {
        let output = remeshd(&arguments, &variables);
        assert!(output.status.success(), "{output:?}");
        let told = text(&output.stdout);
        let line = |key: &str| told.lines().find(|l| l.starts_with(key)).unwrap_or_else(|| panic!("{key}: {told}")).to_owned();
        assert!(line("max_running = 2 ").ends_with("# default"), "{told}");
        assert!(line("cache_mb = 11 ").contains("# file ") && line("cache_mb").ends_with(file.path()), "{told}");
        assert!(line("max_sessions = 22 ").ends_with("# environment REMESHD_MAX_SESSIONS"), "{told}");
        assert!(line("max_queued = 33 ").ends_with("# flag --max-queued"), "{told}");
        // What is printed is a file with the same settings.
        let again = File::new("again", &told);
        let output = remeshd(&["check-config"], &[("REMESHD_CONFIG", again.path())]);
        assert!(output.status.success(), "{output:?}");
        assert!(text(&output.stdout).contains("max_queued = 33 "), "{output:?}");
    }
}

#[test]
fn wrong_keys_and_values_are_named_and_end_the_daemon() {
    for (content, expected) in [
        ("max_sesions = 3\n", "line 1: unknown key `max_sesions`; the nearest one is `max_sessions`"),
        ("cache_mb = 4\nlisten = \"nowhere\"\n", "line 2: `listen`: invalid value 'nowhere'"),
        ("cache_mb = = 4\n", "line 1"),
    ] {
        let file = File::new("wrong", content);
        for arguments in [vec!["--config", file.path()], vec!["check-config", "--config", file.path()]] {
            let output = remeshd(&arguments, &[]);
            let told = text(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{told}");
            assert!(told.contains(file.path()) && told.contains(expected), "{expected}: {told}");
        }
    }
    let absent = remeshd(&["--config", "/no/such/file.toml"], &[]);
    assert!(absent.status.code() == Some(2) && text(&absent.stderr).contains("/no/such/file.toml"), "{absent:?}");
    let variable = remeshd(&["check-config"], &[("REMESHD_MAX_FACES", "many")]);
    assert!(variable.status.code() == Some(2) && text(&variable.stderr).contains("--max-faces"), "{variable:?}");
}

#[test]
fn health_is_asked_through_the_binary() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_remeshd"));
    command.env("REMESHD_LISTEN", "127.0.0.1:0");
    let mut daemon = Daemon::spawn(command);
    let address = daemon.address.clone();
    for probe in ["liveness", "readiness"] {
        let output = remeshd(&["health", "--probe", probe], &[("REMESHD_LISTEN", &address)]);
        assert!(output.status.success() && text(&output.stdout).contains("is well"), "{output:?}");
    }
    daemon.signal("-KILL");
    let output = remeshd(&["health", "--timeout", "1"], &[("REMESHD_LISTEN", &address)]);
    assert!(output.status.code() == Some(1) && text(&output.stderr).contains("nobody answers"), "{output:?}");
}
