//! Two half spheres of an octasphere, mapped stereographically, meshed and joined.

use super::*;
use crate::curve::{curve_polyline, mesh_curve, patch_curves, trace_curves};
use crate::features::Features;
use crate::parametrize::{Chart, ChartMethod, Distortion};
use crate::partition::{Partition, PatchSummary};
use crate::patch::Patch;
use crate::planar::{CurveUse, Mesher, lift, mesh_chart};
use crate::vector::{norm, unit};
use crate::work::{CancelToken, Work};
use std::collections::BTreeMap;
use std::sync::Arc;

fn sphere(levels: usize) -> SurfaceMesh {
    let mut points: Vec<Vec3> =
        vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let mut faces: Vec<[u32; 3]> = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middle = BTreeMap::new();
        let mut next = Vec::new();
        for t in &faces {
            let m: [u32; 3] = std::array::from_fn(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push(unit(crate::vector::lerp(points[a as usize], points[b as usize], 0.5)));
                    points.len() as u32 - 1
                })
            });
            next.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        faces = next;
    }
    SurfaceMesh::from_parts(points, faces)
}

/// The faces of one side of the equator as a patch with its stereographic chart, from the pole of the other side.
fn half(mesh: &SurfaceMesh, up: f64) -> (Patch, PatchMap, Chart) {
    let is_mine = |t: &[u32; 3]| t.iter().map(|&v| mesh.positions[v as usize][2]).sum::<f64>() * up > 0.0;
    let mine: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&f| is_mine(&mesh.triangles[f as usize])).collect();
    let mut vertices: Vec<u32> = mine.iter().flat_map(|&f| mesh.triangles[f as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let local = |v: u32| vertices.binary_search(&v).unwrap() as u32;
    let triangles: Vec<[u32; 3]> = mine.iter().map(|&f| mesh.triangles[f as usize].map(local)).collect();
    let positions: Vec<Vec3> = vertices.iter().map(|&v| mesh.positions[v as usize]).collect();
    let topology = Topology::build(&triangles, positions.len()).unwrap();
    let loops = topology.loops.iter().map(|l| l.iter().map(|&h| topology.origin(h)).collect()).collect();
    let uv = positions.iter().map(|p| [p[0] / (1.0 + up * p[2]), up * p[1] / (1.0 + up * p[2])]).collect();
    let chart = Chart { uv, method: ChartMethod::SpectralConformal, attempts: Vec::new(), distortion: Distortion::default() };
    (Patch { positions, triangles, loops }, PatchMap { named: vertices.clone(), vertices: vertices.clone(), faces: mine }, chart)
}

fn joined(size: f64) -> (SurfaceMesh, Result<Assembled>) {
    let mesh = sphere(4);
    let topology = Topology::build(&mesh.triangles, mesh.positions.len()).unwrap();
    let halves = [half(&mesh, 1.0), half(&mesh, -1.0)];
    let mut face_patch = vec![0; mesh.triangles.len()];
    halves[1].1.faces.iter().for_each(|&f| face_patch[f as usize] = 1);
    let partition = Partition { face_patch, patches: vec![PatchSummary::default(); 2], ..Partition::default() };
    let features = Features { is_feature: vec![false; topology.halfedge_count()], corners: Vec::new(), ..Features::default() };
    let network = trace_curves(&topology, &features, &partition);
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let sizes = vec![size; mesh.positions.len()];
    let meshes: Vec<Arc<CurveMesh>> =
        network.curves.iter().map(|c| Arc::new(mesh_curve(&curve_polyline(&mesh, &topology, c, &sizes, &[]), &work).unwrap())).collect();
    let patches: Vec<(Patch, PatchMap)> = halves.iter().map(|h| (h.0.clone(), h.1.clone())).collect();
    let curves = patch_curves(&topology, &network, &partition, &patches);
    let uses: Vec<Vec<CurveUse<'_>>> = curves
        .iter()
        .map(|own| own.iter().map(|c| CurveUse { path: c.path.clone(), mesh: &meshes[c.curve as usize], curve: c.curve }).collect())
        .collect();
    let lifted: Vec<(Arc<LiftedPatch>, &PatchMap)> = halves
        .iter()
        .zip(&uses)
        .map(|((patch, map, chart), uses)| {
            let planar = mesh_chart(patch, chart, uses, &vec![size; patch.positions.len()], Mesher::Frontal, &work).unwrap();
            (Arc::new(lift(patch, &planar, uses)), map)
        })
        .collect();
    let out = assemble(&mesh, &topology, &[], &[], &network, &meshes, &lifted, &work);
    (mesh, out)
}

#[test]
fn two_half_spheres_make_a_sphere_at_any_size() {
    for size in [0.1, 0.3, 1.0, 2.0, 100.0] {
        let (mesh, out) = joined(size);
        let out = out.unwrap();
        let topology = Topology::build(&out.triangles, out.positions.len()).unwrap();
        assert_eq!(topology.totals(), (2, 0, 0, 1), "size {size}");
        assert!(out.curve_edges.is_empty() && out.vertex_class.iter().all(|c| *c == VertexClass::Free));
        assert_eq!((out.face_patch.len(), out.face_region.len()), (out.triangles.len(), out.triangles.len()));
        for (v, p) in out.positions.iter().enumerate() {
            let [a, b, c] = mesh.corners(out.vertex_face[v] as usize);
            let centre: Vec3 = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
            assert!(crate::vector::distance(*p, centre) < 0.1 && (0.98..1.0 + 1e-9).contains(&norm(*p)));
        }
    }
}

#[test]
fn orientation_and_area_are_the_inputs() {
    let (_, out) = joined(0.12);
    let out = out.unwrap();
    let volume: f64 = out
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| out.positions[v as usize]);
            crate::vector::dot(a, crate::vector::cross(b, c)) / 6.0
        })
        .sum();
    let ball = std::f64::consts::PI * 4.0 / 3.0;
    assert!((volume / ball - 1.0).abs() < 0.02, "{volume}");
}
