//! Makes the joined mesh simplicial where patches are only a few elements wide: edges and faces that two patches have between the same
//! curve points get a vertex of their own.

use super::{Assembled, VertexClass};
use crate::mesh::SurfaceMesh;
use crate::patch::PatchMap;
use crate::planar::LiftedPatch;
use crate::vector::{Vec3, add_scaled, cross, distance, dot, norm, sub};
use std::sync::Arc;

/// Closest point of a triangle.
fn closest_on_triangle([a, b, c]: [Vec3; 3], p: Vec3) -> Vec3 {
    let normal = cross(sub(b, a), sub(c, a));
    let twice = norm(normal);
    if twice > 0.0 {
        let foot = add_scaled(p, normal, -dot(sub(p, a), normal) / (twice * twice));
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(x, y)| dot(cross(sub(*y, *x), sub(foot, *x)), normal) >= 0.0);
        if inside {
            return foot;
        }
    }
    let on_segment = |x: Vec3, y: Vec3| {
        let d = sub(y, x);
        let t = (dot(sub(p, x), d) / dot(d, d).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        add_scaled(x, d, t)
    };
    let candidates = [on_segment(a, b), on_segment(b, c), on_segment(c, a)];
    candidates.into_iter().min_by(|x, y| distance(*x, p).total_cmp(&distance(*y, p))).unwrap_or(a)
}

/// Closest point of the faces of a patch and its face. O(faces of the patch); only for the rare vertices made here.
fn closest_on_patch(mesh: &SurfaceMesh, map: &PatchMap, p: Vec3) -> (Vec3, u32) {
    let mut best = (p, map.faces.first().copied().unwrap_or(0), f64::INFINITY);
    for &f in &map.faces {
        let q = closest_on_triangle(mesh.corners(f as usize), p);
        let d = distance(p, q);
        if d < best.2 {
            best = (q, f, d);
        }
    }
    (best.0, best.1)
}

struct Unfolder<'a> {
    mesh: &'a SurfaceMesh,
    patches: &'a [(Arc<LiftedPatch>, &'a PatchMap)],
    out: &'a mut Assembled,
}

impl Unfolder<'_> {
    fn add_vertex(&mut self, patch: u32, near: Vec3) -> u32 {
        let (position, face) = closest_on_patch(self.mesh, self.patches[patch as usize].1, near);
        self.out.positions.push(position);
        self.out.vertex_class.push(VertexClass::Free);
        self.out.vertex_face.push(face);
        self.out.positions.len() as u32 - 1
    }

    fn add_face(&mut self, like: usize, t: [u32; 3]) {
        self.out.triangles.push(t);
        self.out.face_patch.push(self.out.face_patch[like]);
        self.out.face_region.push(self.out.face_region[like]);
    }

    /// Splits the edge `a b` in the listed faces, all of one patch.
    fn split_edge(&mut self, a: u32, b: u32, faces: &[u32]) {
        let patch = self.out.face_patch[faces[0] as usize];
        let middle = crate::vector::lerp(self.out.positions[a as usize], self.out.positions[b as usize], 0.5);
        let m = self.add_vertex(patch, middle);
        for &f in faces {
            let old = self.out.triangles[f as usize];
            self.out.triangles[f as usize] = old.map(|v| if v == b { m } else { v });
            self.add_face(f as usize, old.map(|v| if v == a { m } else { v }));
        }
    }

    /// Puts a vertex inside a face.
    fn split_face(&mut self, f: u32) {
        let [a, b, c] = self.out.triangles[f as usize];
        let [x, y, z] = [a, b, c].map(|v| self.out.positions[v as usize]);
        let near = std::array::from_fn(|k| (x[k] + y[k] + z[k]) / 3.0);
        let m = self.add_vertex(self.out.face_patch[f as usize], near);
        self.out.triangles[f as usize] = [a, b, m];
        self.add_face(f as usize, [b, c, m]);
        self.add_face(f as usize, [c, a, m]);
    }

    /// Edges with more than two faces: those that are inside a patch are split. Returns whether there were any. The faces split in one
    /// pass are disjoint.
    fn split_double_edges(&mut self) -> bool {
        let mut sides: Vec<(u32, u32, u32, u32)> = Vec::with_capacity(self.out.triangles.len() * 3);
        for (f, t) in self.out.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                sides.push((a.min(b), a.max(b), self.out.face_patch[f], f as u32));
            }
        }
        sides.sort_unstable();
        let mut busy = vec![false; self.out.triangles.len()];
        let mut any = false;
        for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)).filter(|g| g.len() > 2) {
            for inside in group.chunk_by(|x, y| x.2 == y.2).filter(|p| p.len() == 2) {
                let faces = [inside[0].3, inside[1].3];
                any = true;
                if faces.iter().any(|&f| busy[f as usize]) {
                    continue;
                }
                faces.iter().for_each(|&f| busy[f as usize] = true);
                self.split_edge(inside[0].0, inside[0].1, &faces);
            }
        }
        any
    }

    fn split_double_faces(&mut self) {
        let sorted = |t: [u32; 3]| {
            let mut s = t;
            s.sort_unstable();
            s
        };
        let mut keys: Vec<([u32; 3], u32)> = self.out.triangles.iter().enumerate().map(|(f, t)| (sorted(*t), f as u32)).collect();
        keys.sort_unstable();
        let double: Vec<u32> = keys.chunk_by(|x, y| x.0 == y.0).filter(|g| g.len() > 1).flatten().map(|k| k.1).collect();
        double.into_iter().for_each(|f| self.split_face(f));
    }
}

/// Most passes over the mesh; each splits at least one double edge, nearly always all.
const PASSES: usize = 16;

pub(super) fn unfold(mesh: &SurfaceMesh, patches: &[(Arc<LiftedPatch>, &PatchMap)], out: &mut Assembled) {
    let mut unfolder = Unfolder { mesh, patches, out };
    for _ in 0..PASSES {
        if !unfolder.split_double_edges() {
            break;
        }
    }
    unfolder.split_double_faces();
}
