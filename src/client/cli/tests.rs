//! Tests of the program as a whole, without a server: usage errors, exit codes, what needs a daemon.

use super::*;

/// Runs a command line; a server is never available.
fn run(line: &str, variable: Option<&str>) -> u8 {
    let arguments = line.split(' ').map(OsString::from);
    main_from(arguments, variable.map(str::to_owned), |_| async { Err(StartError::from("no server in this test")) })
}

#[test]
fn help_and_version_succeed_and_usage_errors_are_two() {
    assert_eq!(run("remesh --help", None), 0);
    assert_eq!(run("remesh run --help", None), 0);
    assert_eq!(run("remesh --version", None), 0);
    assert_eq!(run("remesh", None), exit::USAGE);
    assert_eq!(run("remesh fly", None), exit::USAGE);
    assert_eq!(run("remesh run a.stl -o b.stl --size -1", None), exit::USAGE);
}

#[test]
fn verbs_on_sessions_need_a_daemon() {
    for line in [
        "remesh session list",
        "remesh plan s",
        "remesh import s a.stl",
        "remesh quality --session s",
        "remesh rollback s 1",
        "remesh undo s",
        "remesh watch s",
    ] {
        assert_eq!(run(line, None), exit::USAGE, "{line}");
    }
    assert_eq!(run("remesh session list", Some("")), exit::USAGE, "an empty variable is no endpoint");
}

#[test]
fn nobody_at_the_endpoint_is_four() {
    // Port 9 (discard) on the loopback interface: refused at once.
    assert_eq!(run("remesh status --endpoint http://127.0.0.1:9", None), exit::UNREACHABLE);
    assert_eq!(run("remesh session list", Some("127.0.0.1:9")), exit::UNREACHABLE);
    assert_eq!(run("remesh status --endpoint unix:///no/such/socket --json", None), exit::UNREACHABLE);
    assert_eq!(run("remesh status --endpoint https://127.0.0.1:9", None), exit::USAGE);
    assert_eq!(run("remesh status --endpoint http://127.0.0.1:9 --threads 2", None), exit::USAGE);
}

#[test]
fn a_server_that_does_not_start_is_a_failure() {
    assert_eq!(run("remesh status", None), exit::FAILED);
}
