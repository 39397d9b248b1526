//! Round trips through every format and pair of formats, and readers fed with broken files.

use super::{Encoding, Exported, FaceData, export_mesh};
use crate::error::Reason;
use crate::import::{Format, ImportOptions, Imported, import_mesh};
use crate::mesh::{LengthUnit, Region, SurfaceMesh};
use crate::repair::shapes::{Lcg, band, torus};
use crate::work::{CancelToken, Work};
use std::collections::{BTreeMap, BTreeSet};

/// How much of a region survives.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum Keeps {
    Grouping,
    Names,
    All,
}

/// Every variant that is read back, with what it keeps.
const VARIANTS: [(Format, Encoding, Keeps); 11] = [
    (Format::Stl, Encoding::Ascii, Keeps::Names),
    (Format::Obj, Encoding::Default, Keeps::Names),
    (Format::Ply, Encoding::Ascii, Keeps::All),
    (Format::Ply, Encoding::Binary, Keeps::All),
    (Format::Off, Encoding::Ascii, Keeps::Grouping),
    (Format::Msh, Encoding::Ascii, Keeps::All),
    (Format::Msh, Encoding::Binary, Keeps::All),
    (Format::Msh, Encoding::Msh22, Keeps::All),
    (Format::Gltf, Encoding::Ascii, Keeps::Names),
    (Format::Gltf, Encoding::Binary, Keeps::Names),
    (Format::Stl, Encoding::Default, Keeps::Names),
];

fn write(mesh: &SurfaceMesh, format: Format, encoding: Encoding) -> Exported {
    export_mesh(mesh, FaceData::default(), format, encoding).unwrap()
}

fn read(bytes: &[u8]) -> Imported {
    import_mesh(bytes, &ImportOptions::default(), &Work::silent(&CancelToken::new())).unwrap()
}

/// Each face by the coordinates of its corners, rotated to begin with the least, and its region.
fn faces(mesh: &SurfaceMesh) -> BTreeMap<[[u32; 3]; 3], (i64, String)> {
    let corner = |v: u32| mesh.positions[v as usize].map(|x| (x as f32 + 0.0).to_bits());
    let face = |(t, &r): (&[u32; 3], &u32)| {
        let p = t.map(corner);
        let least = (0..3).map(|k| [p[k], p[(k + 1) % 3], p[(k + 2) % 3]]).min().unwrap();
        let region = &mesh.regions[r as usize];
        (least, (region.id, region.name.clone()))
    };
    mesh.triangles.iter().zip(&mesh.face_region).map(face).collect()
}

fn assert_same(before: &SurfaceMesh, after: &SurfaceMesh, keeps: Keeps, what: &str) {
    let (a, b) = (faces(before), faces(after));
    assert_eq!(a.len(), before.triangles.len(), "{what}");
    assert!(a.keys().eq(b.keys()), "{what}: other faces");
    match keeps {
        Keeps::All => assert_eq!(a, b, "{what}"),
        // A region without a name keeps its number; one with a name may get another.
        Keeps::Names => assert!(a.iter().zip(&b).all(|((_, r), (_, s))| r.1 == s.1 && (!r.1.is_empty() || r.0 == s.0)), "{what}"),
        Keeps::Grouping => {
            let pairs: BTreeSet<_> = a.values().zip(b.values()).collect();
            assert_eq!(pairs.len(), before.regions.len(), "{what}");
            assert_eq!(after.regions.len(), before.regions.len(), "{what}");
        }
    }
}

#[test]
fn every_variant_gives_the_surface_back() {
    for mesh in [torus(9, 5), band(7, 0)] {
        for (format, encoding, keeps) in VARIANTS {
            let back = read(&write(&mesh, format, encoding).bytes).mesh;
            assert_same(&mesh, &back, keeps.min_for(&mesh), &format!("{format:?} {encoding:?}"));
            if !matches!(format, Format::Stl | Format::Gltf) {
                assert_eq!(mesh.positions, back.positions, "{format:?}: all digits and the order are kept");
            }
        }
    }
}

impl Keeps {
    /// A single region without a name is nothing to lose.
    fn min_for(self, mesh: &SurfaceMesh) -> Keeps {
        if mesh.regions.len() == 1 && self != Keeps::All { Keeps::Names } else { self }.without_number(mesh)
    }

    /// MSH counts regions from 1, so the number 0 cannot survive there.
    fn without_number(self, mesh: &SurfaceMesh) -> Keeps {
        if mesh.regions[0].id == 0 { Keeps::Grouping } else { self }
    }
}

#[test]
fn every_pair_of_variants_keeps_what_both_keep() {
    let mesh = torus(6, 4);
    for (format, encoding, keeps) in VARIANTS {
        let first = read(&write(&mesh, format, encoding).bytes).mesh;
        for (second_format, second_encoding, second_keeps) in VARIANTS {
            let second = read(&write(&first, second_format, second_encoding).bytes).mesh;
            let both = if keeps < second_keeps { keeps } else { second_keeps };
            assert_same(&mesh, &second, both, &format!("{format:?} {encoding:?} then {second_format:?} {second_encoding:?}"));
        }
    }
}

#[test]
fn binary_stl_keeps_one_name_and_may_begin_with_solid() {
    let mut mesh = band(9, 0);
    mesh.regions[0].name = "Gefäß".to_owned();
    let written = write(&mesh, Format::Stl, Encoding::Binary);
    assert_eq!(read(&written.bytes).mesh.regions[0].name, "Gefäß");
    let mut bytes = written.bytes;
    bytes[..11].copy_from_slice(b"solid hello");
    let back = read(&bytes);
    assert_eq!((back.report.format.as_str(), back.mesh.triangles.len()), ("STL binary", 18));
}

#[test]
fn what_is_lost_is_told() {
    let mut mesh = torus(6, 4);
    mesh.unit = LengthUnit::Millimetre;
    let patch = vec![0; mesh.triangles.len()];
    let all = |format, encoding| {
        let data = FaceData { patch: Some(&patch), ..FaceData::default() };
        export_mesh(&mesh, data, format, encoding).unwrap().warnings.join("; ")
    };
    let stl = all(Format::Stl, Encoding::Binary);
    for lost in ["millimetre", "patch", "32-bit", "3 regions", "numbers"] {
        assert!(stl.contains(lost), "{lost} in {stl}");
    }
    assert!(all(Format::Off, Encoding::Default).contains("without names"));
    assert!(!all(Format::Ply, Encoding::Default).contains("region"));
    assert!(!all(Format::Gltf, Encoding::Default).contains("unit"));
    assert_eq!(export_mesh(&mesh, FaceData::default(), Format::Obj, Encoding::Binary).unwrap_err().reason(), Reason::FormatUnsupported);
    let short = FaceData { patch: Some(&patch[1..]), ..FaceData::default() };
    assert_eq!(export_mesh(&mesh, short, Format::Ply, Encoding::Ascii).unwrap_err().reason(), Reason::BadParameter);
}

#[test]
fn gltf_unit_becomes_metres() {
    let mut mesh = torus(6, 4);
    mesh.unit = LengthUnit::Millimetre;
    let back = read(&write(&mesh, Format::Gltf, Encoding::Default).bytes).mesh;
    assert_eq!(back.unit, LengthUnit::Metre);
    assert!((back.area() / mesh.area() * 1e6 - 1.0).abs() < 1e-6);
}

#[test]
fn face_data_does_not_disturb_reading() {
    let mesh = torus(6, 4);
    let patch: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let kappa = vec![0.5; patch.len()];
    let data = FaceData { patch: Some(&patch), kappa: Some(&kappa), quads: 0 };
    for (format, encoding, keeps) in VARIANTS {
        let bytes = export_mesh(&mesh, data, format, encoding).unwrap().bytes;
        assert_same(&mesh, &read(&bytes).mesh, keeps, &format!("{format:?} {encoding:?}"));
    }
}

#[test]
fn vtu_holds_the_arrays_in_both_encodings() {
    let mut mesh = band(3, 0);
    mesh.regions[0] = Region { id: 4, name: "a<b".to_owned() };
    let kappa: Vec<f64> = (0..6).map(|f| 0.5 + f64::from(f)).collect();
    let data = FaceData { patch: Some(&[0, 1, 2, 3, 4, 5]), kappa: Some(&kappa), quads: 0 };
    let text = |encoding| String::from_utf8(export_mesh(&mesh, data, Format::Vtu, encoding).unwrap().bytes).unwrap();
    let array = |text: &str, name: &str| {
        let begin = text.find(&format!("Name=\"{name}\"")).unwrap();
        let body = &text[begin..];
        body[body.find('>').unwrap() + 1..body.find('<').unwrap()].trim().to_owned()
    };
    let (ascii, binary) = (text(Encoding::Ascii), text(Encoding::Binary));
    assert_eq!(array(&ascii, "kappa"), "0.5 1.5 2.5 3.5 4.5 5.5");
    assert_eq!(array(&ascii, "region a&lt;b"), "4");
    assert_eq!(array(&ascii, "offsets"), "3 6 9 12 15 18");
    let bytes = crate::import::base64::decode(array(&binary, "kappa").as_bytes()).unwrap();
    let expected: Vec<u8> = 48u64.to_le_bytes().into_iter().chain(kappa.iter().flat_map(|k| k.to_le_bytes())).collect();
    assert_eq!(bytes, expected);
}

/// Whatever the bytes: a surface or a typed error.
fn survives(bytes: &[u8], format: Option<Format>) {
    let options = ImportOptions { format, max_faces: 100_000, ..Default::default() };
    if let Ok(imported) = import_mesh(bytes, &options, &Work::silent(&CancelToken::new())) {
        imported.mesh.validate().unwrap();
        let _ = imported.diagnosis.refusal();
    }
}

#[test]
fn truncated_and_damaged_files_are_survived() {
    let mesh = torus(5, 3);
    let patch = vec![1; mesh.triangles.len()];
    let data = FaceData { patch: Some(&patch), ..FaceData::default() };
    let mut random = Lcg(11);
    let binary_stl = (Format::Stl, Encoding::Binary, Keeps::Grouping);
    for (format, encoding, _) in VARIANTS.into_iter().chain([binary_stl]) {
        let whole = export_mesh(&mesh, data, format, encoding).unwrap().bytes;
        for step in 0..120 {
            let length = whole.len() * step / 120;
            survives(&whole[..length], None);
            survives(&whole[..length], Some(format));
        }
        for round in 0..600 {
            let mut bytes = whole.clone();
            for _ in 0..1 + round % 4 {
                let at = if round & 1 == 0 { random.below(bytes.len()) } else { random.below(400.min(bytes.len())) };
                bytes[at] = match random.below(4) {
                    0 => b"0123456789-+.e \n\"{}[]$"[random.below(22)],
                    1 => bytes[at] ^ (1 << random.below(8)),
                    2 => 0xff,
                    _ => random.below(256) as u8,
                };
            }
            survives(&bytes, Some(format));
        }
    }
}
