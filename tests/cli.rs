//! The program `remesh` as a user runs it: samples, diagnoses, a whole run, pictures, exit codes; and the verbs on a session against
//! a daemon on a free port.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A directory of one test; removed when it ends well.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("remesh-cli-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary directory");
        Scratch(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    fn remesh(&self, arguments: &[&str]) -> Answer {
        let output = Command::new(env!("CARGO_BIN_EXE_remesh"))
            .args(arguments)
            .current_dir(&self.0)
            .env_remove("REMESH_ENDPOINT")
            .output()
            .expect("the program starts");
        Answer::of(output)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }
}

#[derive(Debug)]
struct Answer {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Answer {
    fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Answer { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }
}

fn starts_with(path: &str, magic: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|bytes| bytes.starts_with(magic))
}

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A tetrahedron and a third face on one of its edges.
const FIN: &str = "OFF\n5 5 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 0 1 4\n";

#[test]
fn a_sample_is_written_diagnosed_and_remeshed() {
    let scratch = Scratch::new("run");
    let sampled = scratch.remesh(&["sample", "tube", "--triangles", "3000", "-o", "tube.stl"]).ok();
    assert!(sampled.out.contains("2 boundary loops"), "{sampled:?}");
    assert!(sampled.err.contains("warning: "), "STL has no unit, which is said: {sampled:?}");
    let diagnosed = scratch.remesh(&["diagnose", "tube.stl"]).ok();
    assert!(diagnosed.out.contains("can be remeshed") && diagnosed.out.contains("2 holes"), "{diagnosed:?}");
    let run = scratch.remesh(&["run", "tube.stl", "-o", "out.vtu", "--triangles", "1500", "--quality", "--before-after", "h.png"]).ok();
    for expected in ["read      tube.stl", "patches", "kappa", "tau", "(kept)", "crossings none", "time", "cache"] {
        assert!(run.out.contains(expected), "{expected}: {run:?}");
    }
    assert!(starts_with(&scratch.path("h.png"), PNG) && starts_with(&scratch.path("out.vtu"), b"<?xml"));
    let names = std::fs::read_dir(&scratch.0).expect("listed").count();
    assert_eq!(names, 3, "no temporary file stays");
}

#[test]
fn quadrangles_are_made_measured_drawn_and_written() {
    let scratch = Scratch::new("quads");
    scratch.remesh(&["sample", "tube", "--triangles", "2000", "-o", "tube.stl"]).ok();
    let run = ["run", "tube.stl", "-o", "out.obj", "--triangles", "2000", "--mesher", "quads", "--all-quads", "--json"];
    let run = scratch.remesh(&run).ok();
    assert!(run.out.contains(r#""quads":{"#) && run.out.contains(r#""eta_mean":0."#), "{run:?}");
    let obj = std::fs::read_to_string(scratch.path("out.obj")).expect("written");
    let mut faces = obj.lines().filter(|line| line.starts_with("f ")).map(|line| line.split(' ').count() - 1);
    assert!(faces.all(|corners| corners == 4));
    let refused = scratch.remesh(&["run", "tube.stl", "-o", "o.obj", "--triangles", "500", "--mesher", "frontal", "--all-quads"]);
    assert!(refused.code == Some(2) && refused.err.contains("--all-quads"), "{refused:?}");
}

#[test]
fn the_same_command_gives_the_same_file() {
    let scratch = Scratch::new("same");
    scratch.remesh(&["sample", "cad-part", "--triangles", "2000", "-o", "part.stl"]).ok();
    for (threads, name) in [("1", "a.msh"), ("2", "b.msh")] {
        scratch.remesh(&["run", "part.stl", "-o", name, "--triangles", "1500", "--threads", threads, "--quiet"]).ok();
    }
    let read = |name| std::fs::read(scratch.path(name)).expect("written");
    assert_eq!(read("a.msh"), read("b.msh"));
    let compared = scratch.remesh(&["quality", "part.stl", "a.msh", "--json"]).ok();
    assert!(compared.out.contains(r#""topology_kept":true"#) && compared.out.contains(r#""tau":null"#), "{compared:?}");
}

#[test]
fn size_fields_and_locks_are_given_on_the_command_line() {
    let scratch = Scratch::new("fields");
    scratch.remesh(&["sample", "tube", "--triangles", "2000", "-o", "t.off"]).ok();
    std::fs::write(scratch.path("line.txt"), "0 0 -9 0.4\n0 0 9 0.4\n\n7 7 7 0.2\n").expect("written");
    let fields = ["--field", "curvature:normal_angle=25", "--field", "centerline:elements_around=30,file=line.txt"];
    let run =
        [&["run", "t.off", "-o", "out.vtu", "--triangles", "3000", "--min-size", "0.001", "--lock", "boundary"][..], &fields].concat();
    let done = scratch.remesh(&run).ok();
    assert!(done.out.contains("result"), "{done:?}");
    let ball = "sphere:center=0,0,0,radius=1,size=0.1,growth_rate=1.3";
    scratch.remesh(&["render", "t.off", "-o", "size.png", "--by", "size", "--max-size", "0.5", "--field", ball]).ok();
    assert!(starts_with(&scratch.path("size.png"), PNG));
    for (bad, told) in [
        (["--size", "0.3", "--field", "heat:x=1"], "no kind of field"),
        (["--size", "0.3", "--field", "distance:from=points,size=1"], "needs file"),
        (["--min-size", "0.3", "--field", ball], "--max-size"),
        (["--size", "0.3", "--field", "distance:from=points,size=1,file=absent.txt"], "absent.txt"),
        (["--size", "0.3", "--field", "proximity:elements_per_gap=3"], "min_size"),
        (["--size", "0.3", "--lock", "all"], "boundary"),
    ] {
        let failed = scratch.remesh(&[&["run", "t.off", "-o", "bad.stl"][..], &bad].concat());
        assert!(failed.code != Some(0) && failed.err.contains(told), "{bad:?}: {failed:?}");
    }
}

#[test]
fn json_is_one_object_on_standard_output() {
    let scratch = Scratch::new("json");
    let sampled = scratch.remesh(&["sample", "tube", "--triangles", "800", "-o", "t.off", "--json"]).ok();
    assert!(sampled.out.starts_with('{') && sampled.out.trim_end().ends_with('}') && sampled.out.lines().count() == 1, "{sampled:?}");
    let failed = scratch.remesh(&["diagnose", "absent.stl", "--json"]);
    assert_eq!(failed.code, Some(1));
    assert!(failed.out.starts_with(r#"{"error":{"#) && failed.out.contains("absent.stl"), "{failed:?}");
}

#[test]
fn a_broken_surface_is_refused_with_places() {
    let scratch = Scratch::new("refused");
    std::fs::write(scratch.path("fin.off"), FIN).expect("written");
    let run = scratch.remesh(&["run", "fin.off", "-o", "out.stl", "--size", "0.3"]);
    assert_eq!(run.code, Some(3), "{run:?}");
    assert!(run.err.contains("edge with more than two faces") && run.err.contains(" at (0.5, 0, 0)"), "{run:?}");
    assert!(!Path::new(&scratch.path("out.stl")).exists());
    assert_eq!(scratch.remesh(&["diagnose", "fin.off"]).code, Some(3));
    std::fs::write(scratch.path("cut.stl"), b"solid x\n facet normal 0 0").expect("written");
    let cut = scratch.remesh(&["diagnose", "cut.stl"]);
    assert!(cut.code == Some(1) || cut.code == Some(3), "{cut:?}");
    assert!(cut.err.contains("error: "), "{cut:?}");
}

#[test]
fn faces_that_intersect_are_diagnosed() {
    let scratch = Scratch::new("crossing");
    // Two tetrahedra, the tip of one inside the other.
    let crossing = "OFF\n8 8 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n0.4 0.4 0.4\n3 3 0.4\n0.4 3 3\n3 0.4 3\n\
        3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 4 6 5\n3 4 5 7\n3 5 6 7\n3 6 4 7\n";
    std::fs::write(scratch.path("crossing.off"), crossing).expect("written");
    let told = scratch.remesh(&["diagnose", "crossing.off"]).ok();
    assert!(told.out.contains("can be remeshed") && told.out.contains("3 pairs of faces that intersect"), "{told:?}");
    scratch.remesh(&["sample", "tube", "--triangles", "800", "-o", "t.stl"]).ok();
    assert!(!scratch.remesh(&["diagnose", "t.stl"]).ok().out.contains("intersect"));
}

#[test]
fn mistakes_are_told_before_the_work() {
    let scratch = Scratch::new("usage");
    scratch.remesh(&["sample", "tube", "--triangles", "800", "-o", "t.stl"]).ok();
    let code = |arguments: &[&str]| scratch.remesh(arguments).code;
    assert_eq!(code(&["run", "t.stl", "-o", "./t.stl", "--size", "1"]), Some(2), "the input is not overwritten");
    assert_eq!(code(&["run", "t.stl", "-o", "o.step", "--size", "1"]), Some(2));
    assert_eq!(code(&["run", "t.stl", "-o", "o.stl"]), Some(2), "a size is never guessed");
    assert_eq!(code(&["run", "t.stl", "-o", "o.stl", "--size", "1", "--triangles", "9"]), Some(2));
    assert_eq!(code(&["run", "t.stl", "-o", "no/such/o.stl", "--size", "1"]), Some(1));
    assert_eq!(code(&["run", "absent.stl", "-o", "o.stl", "--size", "1"]), Some(1));
    assert_eq!(code(&["session", "list"]), Some(2), "needs a daemon");
    assert_eq!(code(&["status", "--endpoint", "http://127.0.0.1:9"]), Some(4));
    assert_eq!(code(&["status"]), Some(0));
}

#[test]
fn meshers_are_chosen_and_their_options_go_with_them() {
    let scratch = Scratch::new("meshers");
    scratch.remesh(&["sample", "tube", "--triangles", "800", "-o", "t.stl"]).ok();
    for mesher in ["frontal", "delaunay", "mesh-adapt", "anisotropic"] {
        scratch.remesh(&["run", "t.stl", "-o", "o.stl", "--triangles", "400", "--mesher", mesher]).ok();
    }
    let run = |more: &[&str]| scratch.remesh(&[&["run", "t.stl", "-o", "o.stl", "--triangles", "400"], more].concat()).code;
    assert_eq!(run(&["--mesher", "delaunay", "--min-angle", "25"]), Some(0));
    assert_eq!(run(&["--mesher", "anisotropic", "--metric-normal-angle", "15", "--max-stretch", "4"]), Some(0));
    let written = |fit: &str| {
        assert_eq!(run(&["--fit", fit]), Some(0));
        std::fs::read(scratch.path("o.stl")).expect("written")
    };
    let [faces, vertices] = ["faces", "vertices"].map(written);
    assert_ne!(faces, vertices);
    assert_eq!(run(&["--min-angle", "25"]), Some(2));
    assert_eq!(run(&["--mesher", "frontal", "--max-stretch", "4"]), Some(2));
    std::fs::write(scratch.path("tensors.txt"), "1 0 0 1 0 1\n").expect("written");
    assert_eq!(run(&["--mesher", "anisotropic", "--metric-file", "tensors.txt"]), Some(1), "one tensor for many vertices");
}

#[test]
fn pictures_are_drawn_without_a_display() {
    let scratch = Scratch::new("render");
    scratch.remesh(&["sample", "cad-part", "--triangles", "2000", "-o", "part.off"]).ok();
    let small = ["--width", "300", "--height", "240"];
    let commands: [&[&str]; 7] = [
        &["render", "part.off", "-o", "a.png", "--by", "region", "--edges"],
        &["render", "part.off", "-o", "b.png", "--by", "patch", "--up", "y", "--azimuth", "-20"],
        &["render", "part.off", "-o", "c.png", "--chart", "0", "--by", "kappa"],
        &["render", "part.off", "-o", "d.png", "--histogram", "--triangles", "1000"],
        &["render", "part.off", "-o", "g.png", "--chart", "0", "--checker", "12", "--iso", "6", "--method", "lscm"],
        &["render", "part.off", "-o", "h.png", "--chart-on-surface", "--iso", "20"],
        &["render", "part.off", "-o", "i.png", "--chart-on-surface", "--chart", "1", "--checker", "10"],
    ];
    for command in commands {
        scratch.remesh(&[command, &small].concat()).ok();
        assert!(starts_with(&scratch.path(command[3]), PNG), "{command:?}");
    }
    assert_eq!(scratch.remesh(&["render", "part.off", "-o", "e.png", "--result"]).code, Some(2), "a result needs a size");
    assert_eq!(scratch.remesh(&["render", "part.off", "-o", "e.png", "--checker", "4"]).code, Some(2), "a pattern needs a chart");
    assert_eq!(scratch.remesh(&["render", "part.off", "-o", "f.png", "--chart", "9999"]).code, Some(1), "no such patch");
}

#[test]
fn a_session_of_a_daemon_step_by_step() {
    let scratch = Scratch::new("steps");
    let daemon = Daemon::start(&["--threads", "1"]);
    let at = |arguments: &[&str]| scratch.remesh(&[arguments, &["--endpoint", &daemon.address]].concat());
    let has = |arguments: &[&str], expected: &str| {
        let answer = at(arguments).ok();
        assert!(answer.out.contains(expected), "{expected}: {answer:?}");
    };
    at(&["sample", "cad-part", "--triangles", "3000", "-o", "part.stl"]).ok();
    let created = at(&["session", "create", "--name", "test", "--ttl", "10m"]).ok();
    let session = created.out.trim();
    assert!(session.starts_with("sessions/"), "{created:?}");
    assert_eq!(at(&["remesh", session]).code, Some(1), "no mesh yet");
    let quiet = at(&["import", session, "part.stl", "--quiet"]).ok();
    assert!(quiet.out.is_empty(), "{quiet:?}");
    has(&["import", session, "part.stl"], "can be remeshed");
    assert!(at(&["set", session, "--triangles", "1400", "-q"]).ok().out.is_empty());
    has(&["set", session, "--triangles", "1500", "--feature-angle", "35"], "revision");
    has(&["set", session, "--max-patch-faces", "800", "--min-chain", "0"], "revision");
    has(&["session", "show", session], "feature_angle: 35.0");
    has(&["session", "snapshot", session, "-o", "kept.session"], "kept.session");
    let twin = at(&["session", "restore", "kept.session", "--name", "twin"]).ok().out;
    has(&["session", "show", twin.trim()], "feature_angle: 35.0");
    has(&["session", "list"], "twin");
    has(&["session", "delete", twin.trim()], "deleted");
    let no_session = at(&["session", "restore", "part.stl"]);
    assert!(no_session.code == Some(1) && no_session.err.contains("no whole snapshot"), "{no_session:?}");
    assert_eq!(at(&["set", session]).code, Some(2), "nothing to set");
    has(&["partition", session], "strategy  multilevel: ");
    has(&["set", session, "--partition-strategy", "plane", "--plane", "0,0,0,-1,0,0", "--borders", "shortest"], "revision");
    has(&["session", "show", session], "partition_strategy: \"plane\"");
    has(&["partition", session], "plane     0,0,0,-1,0,0");
    has(&["partition", session, "--json"], "\"box_aspect_ratio\":");
    has(&["set", session, "--partition-strategy", "laplace"], "revision");
    has(&["partition", session, "--json"], "\"strategy\":\"laplace\"");
    has(&["set", session, "--partition-strategy", "pants"], "revision");
    has(&["partition", session, "--json"], "\"strategy\":\"pants\"");
    assert_eq!(at(&["set", session, "--plane", "0,0,0,1,0,0"]).code, Some(1), "a plane is for the strategy plane");
    has(&["set", session, "--partition-strategy", "auto", "--borders", "geodesic"], "revision");
    has(&["session", "show", session], "borders: \"geodesic\"");
    has(&["partition", session], "strategy  multilevel: ");
    has(&["set", session, "--borders", "vote"], "revision");
    has(&["chart", session], "spectral");
    has(&["chart", session, "--patch", "0"], "1 of ");
    chart_of_a_patch(&at, &has, session);
    has(&["plan", session], "will run");
    has(&["remesh", session], "kappa");
    has(&["plan", session], "cached");
    has(&["quality", "--session", session], "(kept)");
    has(&["quality", "--session", session, "--json"], "\"seams\":{\"after\":");
    has(&["export", session, "-o", "out.msh"], "out.msh");
    has(&["render", "--session", session, "--result", "-o", "r.png", "--width", "300", "--height", "240"], "drew");
    assert!(starts_with(&scratch.path("r.png"), PNG));

    let shown = at(&["session", "show", session, "--json"]).ok().out;
    let revision = shown.split(r#""revision":"#).nth(1).and_then(|rest| rest.split([',', '}']).next()).expect("a revision").to_owned();
    has(&["set", session, "--triangles", "600"], "revision");
    has(&["remesh", session], "were cached");
    has(&["rollback", session, &revision], "with the inputs of");
    let undone = at(&["plan", session, "--json"]).ok();
    assert!(undone.out.contains(r#""runs":0"#), "undo is free: {undone:?}");
    let future = at(&["rollback", session, "99"]);
    assert!(future.code == Some(1) && future.err.contains("there is no revision 99 yet"), "{future:?}");
    assert_eq!(at(&["-q", "set", session, "--triangles", "777"]).ok().out, "");
    assert_eq!(at(&["-q", "undo", session]).ok().out, "", "quiet verbs say nothing when all is well");
    assert_eq!(at(&["-q", "redo", session]).ok().out, "");
    has(&["undo", session], "1 redone");
    has(&["redo", session, "--json"], r#""redo_steps":0"#);
    assert_eq!(at(&["redo", session]).code, Some(1), "nothing is undone");
    assert_eq!(at(&["undo", session, "--base", "1"]).code, Some(1), "stale");
    has(&["watch", session, "--after-revision", "0", "--no-stages", "--count", "2"], "revision 1: mesh");
    has(&["watch", session, "--after-revision", "0", "--count", "1", "--json"], r#""event":"#);

    operations(&at, &has, session);
    has(&["session", "list"], session);
    has(&["session", "set-ttl", session, "1h"], "3600 s");
    has(&["status"], "sessions  1 of");
    has(&["status"], "none; all is in memory");
    has(&["status", "--json"], "\"store\":null");
    has(&["session", "delete", session], "is deleted");
    assert_eq!(at(&["plan", session]).code, Some(1), "gone");
    has(&["status"], "sessions  0 of");
}

/// The verbs of `operations`.
fn operations(at: &dyn Fn(&[&str]) -> Answer, has: &dyn Fn(&[&str], &str), session: &str) {
    let started = at(&["operations", "start", session, "--quality"]).ok().out;
    let name = started.trim();
    assert!(name.starts_with(session) && name.contains("/operations/"), "{started}");
    has(&["operations", "wait", name], "succeeded");
    has(&["operations", "result", name], "kappa");
    has(&["operations", "result", name, "--json"], "\"seams\":");
    has(&["operations", "show", name, "--json"], "\"state\":\"succeeded\"");
    let again = at(&["operations", "start", session]).ok().out;
    has(&["operations", "list", session], again.trim());
    at(&["operations", "cancel", again.trim()]).ok();
    // Either it had ended, or it is stopped: both are ends.
    let waited = at(&["operations", "wait", again.trim()]);
    assert!(
        waited.out.contains("succeeded") && waited.code == Some(0) || waited.out.contains("cancelled") && waited.code == Some(1),
        "{waited:?}"
    );
    assert_eq!(at(&["operations", "show", &format!("{session}/operations/99")]).code, Some(1));
}

/// The verbs of `chart` on one patch; the session is as it was afterwards, but for its revision.
fn chart_of_a_patch(at: &dyn Fn(&[&str]) -> Answer, has: &dyn Fn(&[&str], &str), session: &str) {
    has(&["chart", "show", session, "0"], "that of the session: auto");
    has(&["chart", "plan", session, "0", "--method", "lscm"], "will run chart patch 0");
    has(&["chart", "preview", session, "0", "--method", "lscm"], "lscm");
    has(&["chart", "plan", session, "0", "--method", "lscm"], "0 to run");
    has(&["patch", "split", session, "0"], "split");
    has(&["partition", session], "edit 1");
    assert_eq!(at(&["patch", "merge", session, "0"]).code, Some(2), "two patches at least");
    assert_eq!(at(&["patch", "merge", session, "0", "4000"]).code, Some(1));
    assert_eq!(at(&["patch", "reassign", session, "0", "--faces", "4000000"]).code, Some(1));
    has(&["patch", "reset", session], "1 taken back");
    has(&["set", session, "--merge-angle", "20", "--merge-below-size", "none", "--compound", "none"], "revision");
    has(&["set", session, "--merge-angle", "none"], "revision");
    has(&["chart", "set", session, "0", "--method", "lscm", "--pins", "farthest"], "lscm, holes auto, pins farthest");
    has(&["chart", "set", session, "0", "--holes", "open"], "lscm, holes open, pins farthest");
    has(&["chart", "show", session, "0", "--json"], r#""own_spec":true"#);
    has(&["session", "show", session], "patch_charts: 1");
    has(&["chart", "set", session, "0", "--method", "spectral"], "spectral, holes open");
    has(&["chart", "reset", session, "0"], "auto");
    has(&["session", "show", session], "patch_charts: 0");
    has(&["chart", "set", session, "--method", "lscm"], "lscm, holes auto");
    has(&["chart", "set", session, "--method", "auto", "--holes", "auto"], "auto");
    let quiet = at(&["chart", "reset", session, "0", "--quiet"]).ok();
    assert!(quiet.out.is_empty(), "{quiet:?}");
    assert_eq!(at(&["chart", "set", session, "0"]).code, Some(2), "nothing to set");
    assert_eq!(at(&["chart", "show", session, "9999"]).code, Some(1));
    let foreign = at(&["chart", "set", session, "0", "--method", "lscm", "--pin", "4000000", "--pin", "1"]);
    assert!(foreign.code == Some(1) && foreign.err.contains("vertex 4000000 is not in the patch"), "{foreign:?}");
    let moved = at(&["chart", session, "--feature-angle", "30"]);
    assert_eq!(moved.code, Some(2), "inputs of a session are set by `set`: {moved:?}");
}

#[test]
fn charts_of_a_file_need_no_daemon() {
    let scratch = Scratch::new("chart");
    scratch.remesh(&["sample", "tube", "--triangles", "1200", "-o", "tube.off"]).ok();
    let plain = scratch.remesh(&["chart", "tube.off", "-o", "uv"]).ok();
    for expected in ["patch 0", "spectral", "holes", "no flips, no overlap", "angle 1", "stretch", "time", "wrote"] {
        assert!(plain.out.contains(expected), "{expected}: {plain:?}");
    }
    let obj = std::fs::read_to_string(scratch.0.join("uv/patch-0.obj")).expect("written");
    let count = |prefix: &str| obj.lines().filter(|line| line.starts_with(prefix)).count();
    assert!(count("v ") > 100 && count("v ") == count("vt ") && count("f ") > 200);
    let named =
        scratch.remesh(&["chart", "tube.off", "--patches", "3", "--patch", "1", "--method", "lscm", "--obj", "one.obj", "--json"]).ok();
    assert!(named.out.contains(r#""verdict":"usable""#) && named.out.contains(r#""method":"lscm""#), "{named:?}");
    assert!(scratch.0.join("one.obj").is_file());
    let code = |arguments: &[&str]| scratch.remesh(&[&["chart", "tube.off"], arguments].concat()).code;
    assert_eq!(code(&["--patches", "3", "--method", "lscm", "--pin", "1", "--pin", "2"]), Some(2), "pins of which patch?");
    assert_eq!(code(&["--patches", "3", "--obj", "x.obj"]), Some(2), "one file for many patches");
    assert_eq!(code(&["--patch", "999"]), Some(1));
    assert_eq!(scratch.remesh(&["chart", "absent.off"]).code, Some(1));
}
