//! Every importer with damaged files of every format that is written: an error that blames the file, or a mesh that is valid.

use crate::for_a_while;
use crate::random::{Random, damaged};
use remesh_engine::error::Reason;
use remesh_engine::export::{Encoding, FaceData, export_mesh};
use remesh_engine::import::{Format, ImportOptions, import_arrays, import_mesh};
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::sample::{self, SampleKind, SampleSpec};
use remesh_engine::work::{CancelToken, Work};

const KINDS: [(Format, Encoding); 11] = [
    (Format::Stl, Encoding::Ascii),
    (Format::Stl, Encoding::Binary),
    (Format::Obj, Encoding::Default),
    (Format::Ply, Encoding::Ascii),
    (Format::Ply, Encoding::Binary),
    (Format::Off, Encoding::Default),
    (Format::Msh, Encoding::Ascii),
    (Format::Msh, Encoding::Binary),
    (Format::Msh, Encoding::Msh22),
    (Format::Gltf, Encoding::Ascii),
    (Format::Gltf, Encoding::Binary),
];

fn small_mesh(kind: SampleKind, work: &Work<'_>) -> SurfaceMesh {
    let spec = SampleSpec { kind, triangles: 60, genus: None, outlets: None, aspect_ratio: None };
    sample::generate(&spec, work).expect("a sample")
}

#[test]
fn damaged_files_are_refused_or_give_valid_meshes() {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let meshes = [small_mesh(SampleKind::Tube, &work), small_mesh(SampleKind::CadPart, &work)];
    let mut files = Vec::new();
    for mesh in &meshes {
        for (format, encoding) in KINDS {
            let patch = vec![0; mesh.triangles.len()];
            let written = export_mesh(mesh, FaceData { patch: Some(&patch), kappa: None, quads: 0 }, format, encoding).expect("written");
            files.push((format, written.bytes));
        }
    }
    let (mut taken, mut refused) = (0u64, 0u64);
    for_a_while("damaged files", |seed| {
        let mut random = Random::new(seed);
        let (format, file) = random.pick(&files);
        let file = damaged(file.clone(), &mut random);
        let tolerance = *random.pick(&[0.0, 1e-6, 0.1, 1e300]);
        let options = ImportOptions { weld_tolerance: tolerance, ..ImportOptions::default() };
        match import_mesh(&file, &options, &work) {
            Ok(imported) => {
                taken += 1;
                let again = import_arrays(imported.mesh.clone(), &ImportOptions::default(), &work);
                assert!(again.is_ok(), "{format:?}, seed {seed}: what was imported is not valid: {:?}", again.err());
            }
            Err(error) => {
                refused += 1;
                assert!(error.reason() != Reason::Invariant, "{format:?}, seed {seed}: {error}");
            }
        }
    });
    assert!(taken > 0 && refused > 0, "{taken} taken, {refused} refused: the damage is of the wrong size");
}
