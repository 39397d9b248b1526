//! Regenerates the committed Rust code and descriptor from the `.proto` files (with a compiler in Rust, no `protoc`) and compares.
//! `REMESH_BLESS=1 cargo test --release -p remesh-proto` rewrites them.

use prost::Message;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

fn proto_files() -> Vec<PathBuf> {
    let folder = root().join("remesh/v1");
    let mut files: Vec<PathBuf> = fs::read_dir(folder).expect("the folder of the proto files").map(|e| e.expect("entry").path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "proto"));
    files.sort();
    files
}

/// A folder of this test's own, removed when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Self {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("codegen-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a scratch folder");
        Scratch(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn generate(into: &Path) {
    let mut compiler = protox::Compiler::new([root()]).expect("include path");
    compiler.include_source_info(true).include_imports(true);
    compiler.open_files(proto_files()).unwrap_or_else(|e| panic!("{e:?}"));
    let set = compiler.file_descriptor_set();
    fs::write(into.join("descriptor.bin"), set.encode_to_vec()).expect("write");
    tonic_prost_build::configure().bytes(".").out_dir(into).compile_fds(set).expect("code generation");
}

#[test]
fn generated_code_is_current() {
    let committed = root().join("generated");
    if std::env::var_os("REMESH_BLESS").is_some() {
        fs::create_dir_all(&committed).expect("folder");
        return generate(&committed);
    }
    let scratch = Scratch::new();
    generate(&scratch.0);
    for file in ["remesh.v1.rs", "descriptor.bin"] {
        let fresh = fs::read(scratch.0.join(file)).expect("generated file");
        let kept = fs::read(committed.join(file)).unwrap_or_default();
        assert!(fresh == kept, "proto/generated/{file} is not what the proto files give; run REMESH_BLESS=1 cargo test -p remesh-proto");
    }
}

/// What `buf lint` (STANDARD and COMMENTS) would complain about, as far as it can be told without buf.
#[test]
fn proto_files_follow_the_rules() {
    let mut compiler = protox::Compiler::new([root()]).expect("include path");
    compiler.include_source_info(true);
    compiler.open_files(proto_files()).unwrap_or_else(|e| panic!("{e:?}"));
    let mut used = Vec::new();
    for file in compiler.file_descriptor_set().file {
        assert_eq!(file.package(), "remesh.v1", "{}", file.name());
        for service in &file.service {
            assert!(service.name().ends_with("Service"), "{}", service.name());
            for method in &service.method {
                let name = method.name();
                assert_eq!(method.input_type(), format!(".remesh.v1.{name}Request"));
                assert_eq!(method.output_type(), format!(".remesh.v1.{name}Response"));
                used.push(name.to_owned());
            }
        }
        assert!(file.service.len() <= 1, "{}: one service a file", file.name());
        for message in &file.message_type {
            for field in &message.field {
                let name = field.name();
                assert!(name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'), "{}.{name}", message.name());
            }
        }
        for kind in &file.enum_type {
            let prefix = upper_snake(kind.name());
            assert_eq!(kind.value[0].name(), format!("{prefix}_UNSPECIFIED"));
            assert!(kind.value.iter().all(|v| v.name().starts_with(&prefix)), "{}", kind.name());
        }
        check_comments(&file);
    }
    let total = used.len();
    used.sort();
    used.dedup();
    assert_eq!(used.len(), total, "method names, and so message names, are unique");
}

fn upper_snake(camel: &str) -> String {
    let mut out = String::new();
    for (i, c) in camel.chars().enumerate() {
        if i > 0 && c.is_ascii_uppercase() {
            out.push('_');
        }
        out.push(c.to_ascii_uppercase());
    }
    out
}

/// Every message, field, enum, value, service and method has a leading comment. Paths as in `SourceCodeInfo`.
fn check_comments(file: &prost_types::FileDescriptorProto) {
    let info = file.source_code_info.as_ref().expect("source info");
    let commented = |path: &[i32]| info.location.iter().any(|l| l.path == path && !l.leading_comments().trim().is_empty());
    for (i, message) in file.message_type.iter().enumerate() {
        assert!(commented(&[4, i as i32]), "{} has no comment", message.name());
        for (k, field) in message.field.iter().enumerate() {
            assert!(commented(&[4, i as i32, 2, k as i32]), "{}.{} has no comment", message.name(), field.name());
        }
    }
    for (i, kind) in file.enum_type.iter().enumerate() {
        assert!(commented(&[5, i as i32]), "{} has no comment", kind.name());
        for (k, value) in kind.value.iter().enumerate() {
            assert!(commented(&[5, i as i32, 2, k as i32]), "{} has no comment", value.name());
        }
    }
    for (i, service) in file.service.iter().enumerate() {
        assert!(commented(&[6, i as i32]), "{} has no comment", service.name());
        for (k, method) in service.method.iter().enumerate() {
            assert!(commented(&[6, i as i32, 2, k as i32]), "{} has no comment", method.name());
        }
    }
}
