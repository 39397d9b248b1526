//! The real `remeshd` as a process: start, messages for wrong settings, signals, and the real `grpcurl` where it is installed.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use remesh_client::{Client, v1};
use std::process::{Command, Output};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use v1::watch_session_response::Event;

fn grpcurl(daemon: &Daemon, arguments: &[&str], data: &str) -> Output {
    let mut command = Command::new("grpcurl");
    command.arg("-plaintext");
    if !data.is_empty() {
        command.args(["-d", data]);
    }
    let (last, first) = arguments.split_last().expect("arguments");
    command.args(first).arg(&daemon.address).arg(last).output().expect("grpcurl runs")
}

fn call(daemon: &Daemon, method: &str, data: &str) -> String {
    let output = grpcurl(daemon, &[method], data);
    assert!(output.status.success(), "{method}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_remeshd")).args(arguments).output().expect("runs");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn wrong_settings_are_told_and_end_the_daemon() {
    for arguments in [["--listen", "nowhere"], ["--threads", "0"], ["--cache-mb", "much"], ["--log-format", "xml"]] {
        let (code, message) = run(&arguments);
        assert!(code == Some(2) && message.contains(arguments[1]), "{arguments:?}: {code:?} {message}");
    }
    let (_, message) = run(&["--max-sessions", "0"]);
    assert!(message.contains("must be at least 1"), "{message}");
    let (code, message) = run(&["--log", "info,=,"]);
    assert!(code == Some(1) && message.contains("--log"), "{message}");
}

#[test]
fn a_port_in_use_is_told() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("address").to_string();
    let (code, message) = run(&["--listen", &address]);
    assert!(code == Some(1) && message.contains(&format!("cannot listen on {address}")), "{message}");
}

#[test]
fn both_signals_end_it_well() {
    for signal in ["-TERM", "-INT"] {
        assert!(Daemon::start(&[]).signal(signal).success(), "{signal}");
    }
}

/// The text after `"key": "` up to the next quote.
fn field<'a>(json: &'a str, key: &str) -> &'a str {
    let start = json.find(&format!("\"{key}\": \"")).unwrap_or_else(|| panic!("no {key} in {json}")) + key.len() + 5;
    &json[start..start + json[start..].find('"').expect("closed")]
}

#[test]
fn the_real_grpcurl_works() {
    if Command::new("grpcurl").arg("-version").output().is_err() {
        eprintln!("NOT RUN: grpcurl is not installed");
        return;
    }
    let daemon = Daemon::start(&[]);
    let list = call(&daemon, "list", "");
    for service in
        ["CapabilityService", "ChartService", "MeshService", "PartitionService", "QualityService", "RemeshService", "SessionService"]
    {
        assert!(list.contains(&format!("remesh.v1.{service}\n")), "{list}");
    }
    let described = String::from_utf8(grpcurl(&daemon, &["describe"], "").stdout).expect("UTF-8");
    assert!(described.contains("rpc RemeshMesh"), "{described}");
    assert!(call(&daemon, "grpc.health.v1.Health/Check", "").contains("SERVING"));

    let made = call(&daemon, "remesh.v1.SessionService/CreateSession", r#"{"display_name": "grpcurl"}"#);
    let session = field(&made, "name");
    let import = format!(r#"{{"session": "{session}", "sample": {{"kind": "SAMPLE_KIND_TUBE", "triangles": 2000}}}}"#);
    assert_eq!(field(&call(&daemon, "remesh.v1.MeshService/ImportMesh", &import), "revision"), "1");
    let size = format!(r#"{{"session": "{session}", "base_revision": 1, "change": {{"size": {{"triangles": 1500}}}}}}"#);
    assert_eq!(field(&call(&daemon, "remesh.v1.SessionService/ApplyChange", &size), "revision"), "2");
    let named = format!(r#"{{"session": "{session}"}}"#);
    assert!(call(&daemon, "remesh.v1.RemeshService/RemeshSurface", &named).contains("\"kappaMean\""));
    let again = call(&daemon, "remesh.v1.RemeshService/RemeshSurface", &named);
    assert!(!again.contains("STAGE_OUTCOME_RUN"), "everything is cached");

    let patch = format!(r#"{{"session": "{session}", "patch": 0}}"#);
    let chart = call(&daemon, "remesh.v1.ChartService/GetPatchChart", &patch);
    assert!(chart.contains("CHART_SPEC_ORIGIN_SESSION") && chart.contains("\"stretch\""), "{chart}");
    let edit = r#""patch": 0, "spec": {"method": "CHART_METHOD_LEAST_SQUARES_CONFORMAL", "holes": "HOLE_TREATMENT_OPEN"}, "update_mask": "method,holes""#;
    let preview = format!(r#"{{"session": "{session}", {edit}, "columns": ["DATA_COLUMN_UV", "DATA_COLUMN_FACE_FLIPPED"]}}"#);
    // Old releases of grpcurl take a field mask as an object, new ones as text.
    let probe = grpcurl(&daemon, &["remesh.v1.ChartService/PreviewPatchChart"], &preview);
    let is_old = String::from_utf8_lossy(&probe.stderr).contains("expecting start of JSON object");
    let spelled = |request: &str| match is_old {
        true => request.replace(r#""method,holes""#, r#"{"paths": ["method", "holes"]}"#),
        false => request.to_owned(),
    };
    let shown = call(&daemon, "remesh.v1.ChartService/PreviewPatchChart", &spelled(&preview));
    assert!(shown.contains("CHART_VERDICT_") && shown.contains("DATA_COLUMN_UV"), "{shown}");
    let update = format!(r#"{{"session": "{session}", "base_revision": 2, {edit}}}"#);
    let updated = call(&daemon, "remesh.v1.ChartService/UpdatePatchChart", &spelled(&update));
    assert_eq!(field(&updated, "revision"), "3");
    assert!(updated.contains("HOLE_TREATMENT_OPEN"), "{updated}");
    assert_eq!(field(&call(&daemon, "remesh.v1.ChartService/GetPatchChart", &patch), "origin"), "CHART_SPEC_ORIGIN_PATCH");
    let late = grpcurl(&daemon, &["remesh.v1.ChartService/UpdatePatchChart"], &spelled(&update));
    assert!(!late.status.success() && String::from_utf8_lossy(&late.stderr).contains("STALE_REVISION"), "{late:?}");

    let stale = grpcurl(&daemon, &["remesh.v1.SessionService/ApplyChange"], &size);
    let message = String::from_utf8_lossy(&stale.stderr).into_owned();
    assert!(!stale.status.success() && message.contains("Aborted") && message.contains("STALE_REVISION"), "{message}");

    let one_call = r#"{"sample": {"kind": "SAMPLE_KIND_TUBE", "triangles": 2000}, "size": {"triangles": 1000},
        "output_format": "MESH_FORMAT_OFF"}"#;
    let first = call(&daemon, "remesh.v1.RemeshService/RemeshMesh", one_call);
    let file = field(&first, "data");
    let back = format!(r#"{{"data": "{file}", "size": {{"triangles": 800}}, "output_format": "MESH_FORMAT_STL"}}"#);
    assert!(call(&daemon, "remesh.v1.RemeshService/RemeshMesh", &back).contains("\"topologyKept\": true"), "base64 in and out");
}

/// Forwards connections to the daemon until told to cut them; then it takes new ones again.
async fn proxy(listener: TcpListener, target: String, mut cut: watch::Receiver<u32>) {
    while let Ok((mut near, _)) = listener.accept().await {
        let mut far = TcpStream::connect(&target).await.expect("the daemon listens");
        cut.mark_unchanged();
        let mut cut = cut.clone();
        tokio::spawn(async move {
            tokio::select! {
                _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
                _ = cut.changed() => {}
            }
        });
    }
}

#[tokio::test]
async fn a_client_that_watches_goes_on_after_its_connection_broke() {
    let daemon = Daemon::start(&[]);
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let through = listener.local_addr().expect("address").to_string();
    let (cut, cuts) = watch::channel(0);
    tokio::spawn(proxy(listener, daemon.address.clone(), cuts));
    let editor = Client::connect(&daemon.address).await.expect("connects");
    let session = editor.create_session("", None).await.expect("session").name;
    let reader = Client::connect(&through).await.expect("connects");
    let mut events = reader.watch(&session, None, true).await.expect("watch");
    for revision in 1..=30 {
        let features = v1::change::Change::Features(v1::FeatureSpec::default());
        assert_eq!(editor.apply(&session, features, None).await.expect("edit"), revision);
        if revision % 10 == 5 {
            cut.send_replace(revision as u32);
        }
        if revision % 2 == 0 {
            for wanted in [revision - 1, revision] {
                let event = events.next().await.expect("goes on").expect("event");
                assert_eq!((event.sequence, event.revision), (wanted, wanted), "none is missing, none comes twice");
            }
        }
    }
    editor.delete_session(&session).await.expect("deleted");
    assert!(matches!(events.next().await.expect("the end").expect("event").event, Some(Event::SessionClosed(_))));
    assert!(events.next().await.expect("after the end").is_none());
}
