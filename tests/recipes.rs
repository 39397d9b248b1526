//! The recipes are run as they are written, against a daemon of the test's own.

#[path = "common/daemon.rs"]
mod daemon;

use daemon::Daemon;
use std::path::{Path, PathBuf};
use std::process::Command;

fn recipes(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("recipes").join(folder)
}

fn is_there(program: &str, arguments: &[&str]) -> bool {
    let found = Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("NOT RUN: {program} {} does not work here", arguments.join(" "));
    }
    found
}

/// What a recipe prints; it must succeed.
fn run(command: &mut Command) -> String {
    let output = command.output().expect("runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{command:?}\n{text}\n{}", String::from_utf8_lossy(&output.stderr));
    text
}

#[test]
fn the_grpcurl_recipes_work_as_written() {
    if !is_there("grpcurl", &["-version"]) {
        return;
    }
    let daemon = Daemon::start(&[]);
    let shell = |name: &str, arguments: &[&Path]| {
        run(Command::new("sh").arg(recipes("grpcurl").join(name)).args(arguments).env("REMESHD", &daemon.address))
    };
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recipe.stl");
    assert_eq!(shell("01-one-call.sh", &[&file]), "remeshed\n");
    let stl = std::fs::read(&file).expect("written");
    let count = u32::from_le_bytes(stl[80..84].try_into().expect("four bytes"));
    assert!(stl.len() == 84 + 50 * count as usize && (1000..4000).contains(&count), "{count} triangles");
    let told = shell("02-session.sh", &[]);
    assert!(told.contains("undo makes revision 4\n") && told.contains("the result as OFF has "), "{told}");
    assert!(!told.contains("runs: \n") && !told.contains("would run:  stages"), "{told}");
    assert_eq!(shell("03-operation.sh", &[]), "outcome: OPERATION_STATE_SUCCEEDED\noutcome: OPERATION_STATE_CANCELLED\n");
    assert_eq!(shell("04-errors.sh", &[]), "STALE_REVISION\nBAD_PARAMETER\nSESSION_NOT_FOUND\n");
    let health = shell("05-health.sh", &[]);
    assert!(health.starts_with("liveness: SERVING\nreadiness: SERVING\n") && health.contains("remesh.v1.OperationService"), "{health}");
    let tried = ["01-one-call.sh", "02-session.sh", "03-operation.sh", "04-errors.sh", "05-health.sh", "common.sh"];
    let mut there: Vec<String> = std::fs::read_dir(recipes("grpcurl"))
        .expect("folder")
        .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    there.sort();
    assert_eq!(there, tried, "every recipe is run here");
}

#[test]
fn the_python_recipe_works_as_written() {
    if !is_there("python3", &["-c", "import grpc, grpc_tools, numpy"]) {
        return;
    }
    let daemon = Daemon::start(&[]);
    let told = run(Command::new("python3").arg(recipes("python").join("remesh_to_numpy.py")).arg(&daemon.address));
    let lines: Vec<&str> = told.lines().collect();
    assert!(lines.len() == 2 && lines[0].contains(" triangles, mean kappa 0.9") && lines[1].contains(" vertices, "), "{told}");
}
