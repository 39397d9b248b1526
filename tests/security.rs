//! Who may call the real daemon: tokens made by it, TLS with the command line client, metrics, and what it refuses to be.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A folder of one test; removed when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("remeshd-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary directory");
        Folder(path)
    }

    fn write(&self, name: &str, content: &str) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("written");
        path.display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn start(arguments: &[&str]) -> Daemon {
    Daemon::start(&[&["--metrics-listen", "127.0.0.1:0"], arguments].concat())
}

fn get(daemon: &Daemon, path: &str) -> String {
    let mut stream = TcpStream::connect(daemon.told("metrics=")).expect("connects");
    write!(stream, "GET {path} HTTP/1.1\r\nHost: x\r\n\r\n").expect("sent");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("read");
    text
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn remeshd(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_remeshd")).args(arguments).output().expect("runs")
}

fn remesh(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_remesh")).args(arguments).output().expect("runs")
}

#[track_caller]
fn ok(output: &Output) -> String {
    assert!(output.status.success(), "{output:?}");
    text(&output.stdout)
}

#[test]
fn tokens_of_the_daemon_let_the_client_in_and_metrics_tell_what_happened() {
    let folder = Folder::new("tokens");
    let made = remeshd(&["token", "alice"]);
    let token = folder.write("token", &ok(&made));
    let table = folder.write("table", &text(&made.stderr));
    let daemon = start(&["--token-file", &table]);
    let at = |arguments: &[&str]| remesh(&[arguments, &["--endpoint", &daemon.address]].concat());
    let refused = at(&["session", "create"]);
    assert!(refused.status.code() == Some(1) && text(&refused.stderr).contains("TOKEN_MISSING"), "{refused:?}");
    let session = ok(&at(&["session", "create", "--token-file", &token])).trim().to_owned();
    let import = folder.write("tube.stl", "");
    ok(&remesh(&["sample", "tube", "--triangles", "500", "-o", &import]));
    ok(&at(&["import", &session, &import, "--token-file", &token]));
    assert!(ok(&at(&["session", "list", "--token-file", &token])).contains(&session));
    assert!(
        ok(&at(&["watch", &session, "--after-revision", "0", "--no-stages", "--count", "1", "--token-file", &token]))
            .contains("by token:alice")
    );
    let metrics = get(&daemon, "/metrics");
    for line in [
        "HTTP/1.1 200 OK",
        "remeshd_unauthenticated_total 1\n",
        "remeshd_sessions 1\n",
        "remeshd_revisions_total{change=\"mesh\"} 1\n",
        "remeshd_stage_seconds_count{stage=\"import\"} 1\n",
        "remeshd_rpc_seconds_count{method=\"CreateSession\",code=\"OK\"} 1\n",
        "remeshd_rpc_seconds_bucket{method=\"ImportMesh\",code=\"OK\",le=\"+Inf\"} 1\n",
    ] {
        assert!(metrics.contains(line), "{line}: {metrics}");
    }
    assert!(metrics.contains("remeshd_upload_bytes_total ") && !metrics.contains("remeshd_upload_bytes_total 0\n"), "{metrics}");
    assert!(!metrics.contains("alice") && !metrics.contains(&session["sessions/".len()..]), "no names in metrics");
    assert!(get(&daemon, "/readyz").contains("200 OK") && get(&daemon, "/livez").contains("200 OK"));
    assert!(get(&daemon, "/secrets").contains("404 Not Found"));
    ok(&remeshd(&["health", "--listen", &daemon.address]));
    ok(&remeshd(&["health", "--metrics-listen", &daemon.told("metrics="), "--probe", "liveness"]));
}

#[test]
fn the_client_speaks_tls_and_shows_its_certificate() {
    let folder = Folder::new("tls");
    let mut params = CertificateParams::new(Vec::new()).expect("params");
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let key = KeyPair::generate().expect("key");
    let ca = folder.write("ca", &params.self_signed(&key).expect("signed").pem());
    let issuer = Issuer::new(params, key);
    let sign = |name: &str| {
        let key = KeyPair::generate().expect("key");
        let params = CertificateParams::new(vec![name.to_owned()]).expect("params");
        let cert = params.signed_by(&key, &issuer).expect("signed").pem();
        (folder.write(&format!("{name}.cert"), &cert), folder.write(&format!("{name}.key"), &key.serialize_pem()))
    };
    let ((cert, key), (client, client_key)) = (sign("remesh.example"), sign("alice.example"));
    let daemon = start(&["--tls-cert", &cert, "--tls-key", &key, "--tls-client-ca", &ca]);
    let endpoint = format!("https://{}", daemon.address);
    let trusting = ["--endpoint", &endpoint, "--tls-ca", &ca, "--tls-domain", "remesh.example"];
    let shows = [&trusting[..], &["--tls-cert", &client, "--tls-key", &client_key]].concat();
    assert!(ok(&remesh(&[&["session", "create"], &shows[..]].concat())).starts_with("sessions/"));
    for (arguments, code) in [
        (vec!["status", "--endpoint", &endpoint], 2),
        (vec!["status", "--endpoint", &endpoint, "--tls-ca", &ca], 4),
        ([&["status"], &trusting[..]].concat(), 4),
        (vec!["status", "--endpoint", "http://127.0.0.1:9", "--tls-ca", &ca], 2),
        (vec!["status", "--endpoint", &endpoint, "--tls-ca", "/no/such"], 1),
    ] {
        let output = remesh(&arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {output:?}");
    }
    let blind = remeshd(&["health", "--listen", &daemon.address, "--tls-cert", &cert, "--tls-key", &key, "--tls-client-ca", &ca]);
    assert!(text(&blind.stderr).contains("set metrics_listen"), "{blind:?}");
}

#[test]
fn the_daemon_is_not_open_to_other_machines_by_accident() {
    let refused = remeshd(&["--listen", "0.0.0.0:0"]);
    assert!(refused.status.code() == Some(1) && text(&refused.stderr).contains("--insecure"), "{refused:?}");
    assert_eq!(remeshd(&["check-config", "--listen", "0.0.0.0:0"]).status.code(), Some(1));
    ok(&remeshd(&["check-config", "--listen", "0.0.0.0:0", "--insecure"]));
    let folder = Folder::new("open");
    let table = folder.write("table", &text(&remeshd(&["token", "a"]).stderr));
    ok(&remeshd(&["check-config", "--listen", "0.0.0.0:0", "--token-file", &table]));
    let wrong = folder.write("wrong", "nonsense");
    let output = remeshd(&["check-config", "--token-file", &wrong]);
    assert!(output.status.code() == Some(1) && text(&output.stderr).contains("wrong: line 1"), "{output:?}");
    assert_eq!(remeshd(&["--tls-cert", &wrong]).status.code(), Some(2), "a key is needed too");
    assert_eq!(remeshd(&["token", "a b"]).status.code(), Some(1));
}
