//! Readers on small files written by hand: what other programs write and ours do not.

use super::{Format, ImportOptions, Imported, ObjRegions, import_mesh};
use crate::error::{EngineError, Reason};
use crate::work::{CancelToken, Work};

fn try_read(bytes: &[u8]) -> Result<Imported, EngineError> {
    import_mesh(bytes, &ImportOptions::default(), &Work::silent(&CancelToken::new()))
}

fn read(text: &str) -> Imported {
    try_read(text.as_bytes()).unwrap()
}

fn reason(text: &str) -> Reason {
    try_read(text.as_bytes()).unwrap_err().reason()
}

fn names(imported: &Imported) -> Vec<(i64, &str)> {
    imported.mesh.regions.iter().map(|r| (r.id, r.name.as_str())).collect()
}

const OBJ: &str = "# a comment\nmtllib none.mtl\no part\nv 0 0 0 1.0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n\
    g left\nusemtl steel\nf 1/1/1 2//1 \\\n3/1\ng right side\nusemtl \nf -4 -2 -1\nl 1 2\n";

#[test]
fn obj_groups_indices_and_continued_lines() {
    let imported = read(OBJ);
    assert_eq!(imported.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(imported.report.warnings.len(), 2, "{:?}", imported.report.warnings);
    let by = |obj_regions| {
        let options = ImportOptions { obj_regions, ..Default::default() };
        import_mesh(OBJ.as_bytes(), &options, &Work::silent(&CancelToken::new())).unwrap()
    };
    assert_eq!(names(&by(ObjRegions::Group)), [(1, "left"), (2, "right side")]);
    assert_eq!(names(&by(ObjRegions::Object)), [(1, "part")]);
    assert_eq!(names(&by(ObjRegions::Material)), [(1, "steel"), (0, "")]);
}

#[test]
fn obj_polygons_and_errors() {
    let square = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv -1 0.5 0\nf 1 2 3 4 5\n";
    assert_eq!(read(square).mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    let error = try_read(square.replace("f 1 2", "f 1 9").as_bytes()).unwrap_err();
    assert_eq!((error.reason(), error.metadata()[0].1.as_str()), (Reason::IndexOutOfRange, "6"));
    assert_eq!(reason(&square.replace("f 1 2", "f 0 2")), Reason::IndexOutOfRange);
    let error = try_read(square.replace("2 1 0", "2 x 0").as_bytes()).unwrap_err();
    assert_eq!((error.reason(), error.metadata()[0].1.as_str()), (Reason::FormatMalformed, "3"));
    let error = try_read(square.replace("2 1 0", "2 nan 0").as_bytes()).unwrap_err();
    assert_eq!((error.reason(), error.locations()[0].ids[0]), (Reason::NonFinite, 2));
    assert_eq!(reason("v 0 0 0\nv 1 0 0\nv 0 1 0\n"), Reason::EmptyMesh);
}

fn facet(x: f64) -> String {
    format!(" facet normal 0 0 1\n  outer loop\n   vertex {x} 0 0\n   vertex {} 0 0\n   vertex {x} 1 0\n  endloop\n endfacet\n", x + 1.0)
}

#[test]
fn stl_solids_are_regions() {
    let text = format!(
        "solid a\r\n{}endsolid a\nSOLID\n{}ENDSOLID\nsolid a\n{}endsolid\nMerge it;\n",
        facet(0.0).to_uppercase(),
        facet(3.0),
        facet(6.0)
    );
    let imported = read(&text);
    assert_eq!(names(&imported), [(1, "a"), (2, "")]);
    assert_eq!(imported.mesh.face_region, [0, 1, 0]);
    assert!(imported.report.warnings[0].contains("1 lines"));
    assert_eq!(reason("solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n"), Reason::FormatMalformed);
    assert_eq!(reason("solid a\nendsolid a\n"), Reason::EmptyMesh);
    let quads = facet(0.0).replace("   vertex 0 1 0\n", "   vertex 1 1 0\n   vertex 0 1 0\n");
    assert_eq!(read(&format!("solid\n{quads}endsolid\n")).mesh.triangles.len(), 2);
}

#[test]
fn binary_stl_of_wrong_length() {
    let mut bytes = vec![0u8; 84 + 50];
    bytes[80] = 1;
    for (k, x) in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().enumerate() {
        bytes[96 + 4 * k..100 + 4 * k].copy_from_slice(&x.to_le_bytes());
    }
    assert_eq!(try_read(&bytes).unwrap().mesh.triangles.len(), 1);
    bytes.extend([1, 2, 3]);
    assert!(try_read(&bytes).unwrap().report.warnings[0].contains("3 bytes"));
    bytes[80..84].fill(0xff);
    assert_eq!(try_read(&bytes).unwrap_err().reason(), Reason::FormatMalformed);
}

#[test]
fn off_with_comments_colours_and_quads() {
    let text = "# made by hand\nCOFF # colours\n4 2 5\n0 0 0 255 0 0\n1 0 0 255 0 0\n\n1 1 0 255 0 0\n0 1 0\n# faces\n3 0 1 2 0.5 0 0\n3 0 2 3  1 0 0 # red\n";
    let imported = read(text);
    assert_eq!(names(&imported), [(1, "colour 0.5 0 0"), (2, "colour 1 0 0")]);
    assert_eq!(read("OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 0.5 0\n4 0 1 2 3\n").mesh.triangles, [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(reason("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"), Reason::IndexOutOfRange);
    assert_eq!(reason("OFF\n99999999999 1 0\n0 0 0\n"), Reason::FormatMalformed);
    assert_eq!(reason("4OFF\n1 1 0\n"), Reason::FormatUnsupported);
}

#[test]
fn ply_strips_and_both_byte_orders() {
    let head = "ply\nformat ascii 1.0\ncomment region 5 five\nelement vertex 5\nproperty float nx\nproperty float x\nproperty float y\nproperty float z\n";
    let body = "0 0 0 0\n0 1 0 0\n0 0 1 0\n0 1 1 0\n0 0 2 0\n";
    let strips = format!("{head}element tristrips 1\nproperty list int int vertex_indices\nend_header\n{body}8 0 1 2 3 -1 2 3 4\n");
    assert_eq!(read(&strips).mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    let faces = format!(
        "{head}element face 2\nproperty uchar region\nproperty list uchar int vertex_index\nend_header\n{body}5 3 0 1 2\n6 3 2 1 3\n"
    );
    assert_eq!(names(&read(&faces)), [(5, "five"), (6, "")]);
    assert_eq!(reason(&faces.replace("3 0 1 2", "3 0 -1 2")), Reason::IndexOutOfRange);
    assert_eq!(reason(&faces.replace("face 2", "face 3")), Reason::FormatMalformed);
    let mut big = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty short y\nproperty char z\nelement face 1\nproperty list uchar ushort vertex_indices\nend_header\n".to_vec();
    for (x, y, z) in [(0.0f64, 0i16, 1u8), (1.0, 0, 1), (0.0, 300, 1)] {
        big.extend(x.to_be_bytes());
        big.extend(y.to_be_bytes());
        big.push(z);
    }
    big.extend([3, 0, 0, 0, 1, 0, 2]);
    assert_eq!(try_read(&big).unwrap().mesh.positions[2], [0.0, 300.0, 1.0]);
}

#[test]
fn msh22_second_order_quads_and_entity_tags() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n7\n10 0 0 0\n20 1 0 0\n30 1 1 0\n40 0 1 0\n50 2 0 0\n60 2 1 0\n70 3 0 0\n$EndNodes\n\
        $Elements\n4\n1 15 2 0 1 10\n2 9 2 0 4 10 20 30 70 70 70\n3 2 2 0 4 10 30 40\n4 3 2 0 9 20 50 60 30\n$EndElements\n";
    let imported = read(text);
    assert_eq!(imported.mesh.triangles.len(), 4);
    assert_eq!(names(&imported), [(4, ""), (9, "")]);
    assert_eq!(imported.report.warnings.len(), 3, "{:?}", imported.report.warnings);
    assert_eq!(reason(&text.replace("50 60 30", "50 61 30")), Reason::IndexOutOfRange);
    assert_eq!(reason(&text.replace("$EndElements\n", "")), Reason::FormatMalformed);
    assert_eq!(reason(&text.replace("2.2 0 8", "4.0 0 8")), Reason::FormatUnsupported);
}

#[test]
fn msh41_parametric_nodes_and_negative_groups() {
    let text = "$Comments\nx\n$EndComments\n$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 3 \"edge\"\n2 3 \"the wall\"\n$EndPhysicalNames\n\
        $Entities\n0 0 1 0\n17 0 0 0 1 1 0 1 -3 0\n$EndEntities\n\
        $Nodes\n2 4 1 9\n2 17 1 3\n9\n2\n5\n0 0 0 0.1 0.2\n1 0 0 0 0\n1 1 0 0 0\n0 1 0 1\n7\n0 1 0\n$EndNodes\n\
        $Elements\n2 3 1 3\n1 1 1 1\n1 9 2\n2 17 2 2\n2 9 2 5\n3 9 5 7\n$EndElements\n";
    let imported = read(text);
    assert_eq!(names(&imported), [(3, "the wall")]);
    assert_eq!(imported.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn gltf_transforms_strips_and_refusals() {
    let positions: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.].iter().flat_map(|x| x.to_le_bytes()).collect();
    let data = String::from_utf8(super::base64::encode(&positions)).unwrap();
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"children":[1],"translation":[10,0,0]}},{{"mesh":0,"rotation":[0,0,0.70710678,0.70710678],"scale":[2,-1,1]}}],
        "meshes":[{{"name":"leaf","primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}}],"buffers":[{{"byteLength":48,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    );
    let imported = read(&text);
    assert_eq!(names(&imported), [(1, "leaf")]);
    // Scaled, then turned by a right angle, then moved; the mirror image keeps the faces outside.
    let expected = [[10.0, 0.0], [10.0, 2.0], [11.0, 0.0], [11.0, 2.0]];
    assert!(imported.mesh.positions.iter().zip(expected).all(|(p, e)| (p[0] - e[0]).hypot(p[1] - e[1]) < 1e-6));
    assert_eq!(imported.mesh.triangles, [[0, 2, 1], [2, 3, 1]].map(|t: [u32; 3]| t));
    assert_eq!(reason(&text.replace("data:application/octet-stream;base64,", "file.bin?")), Reason::FormatUnsupported);
    assert_eq!(reason(&text.replace("\"children\":[1]", "\"children\":[1,1]")), Reason::FormatMalformed);
    assert_eq!(reason(&text.replace("\"count\":4", "\"count\":5")), Reason::FormatMalformed);
}

#[test]
fn formats_are_told_by_content() {
    assert_eq!(reason(""), Reason::FormatMalformed);
    assert_eq!(reason("  \n "), Reason::FormatMalformed);
    assert_eq!(reason("hello world"), Reason::FormatUnsupported);
    assert_eq!(reason("<?xml version=\"1.0\"?>"), Reason::FormatUnsupported);
    assert_eq!(super::detect::detect(b"\xef\xbb\xbfply\n").unwrap(), Format::Ply);
    assert_eq!(super::detect::detect(b"\xef\xbb\xbfv 0 0 1\nv 1 0 0\n").unwrap(), Format::Obj);
    assert_eq!(super::detect::detect(b"# x\nmtllib y\nv 0 0 0\n").unwrap(), Format::Obj);
    assert_eq!(super::detect::detect(&[0; 200]).unwrap(), Format::Stl);
}
