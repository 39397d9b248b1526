//! Makes the joined mesh simplicial where patches are only a few elements wide: edges and faces that two patches have between the same
//! curve points get a vertex of their own.

use super::{Assembled, VertexClass};
use crate::bvh::TriangleBvh;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::patch::PatchMap;
use crate::planar::LiftedPatch;
use crate::vector::Vec3;
use crate::work::Work;
use std::sync::Arc;

struct Unfolder<'a> {
    mesh: &'a SurfaceMesh,
    patches: &'a [(Arc<LiftedPatch>, &'a PatchMap)],
    out: &'a mut Assembled,
    /// Search trees over the faces of patches, made when they are first asked for.
    trees: Vec<Option<TriangleBvh>>,
}

impl Unfolder<'_> {
    /// A vertex at the closest point of the patch.
    fn add_vertex(&mut self, patch: u32, near: Vec3) -> u32 {
        let faces = &self.patches[patch as usize].1.faces;
        let tree = self.trees[patch as usize].get_or_insert_with(|| {
            let triangles: Vec<[u32; 3]> = faces.iter().map(|&f| self.mesh.triangles[f as usize]).collect();
            TriangleBvh::build(&self.mesh.positions, &triangles)
        });
        let (position, face) =
            tree.closest(near).map_or((near, faces.first().copied().unwrap_or(0)), |hit| (hit.position, faces[hit.face as usize]));
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
    fn split_double_edges(&mut self, work: &Work<'_>) -> Result<bool> {
        work.check()?;
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
            work.check()?;
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
        Ok(any)
    }

    fn split_double_faces(&mut self, work: &Work<'_>) -> Result<()> {
        work.check()?;
        let sorted = |t: [u32; 3]| {
            let mut s = t;
            s.sort_unstable();
            s
        };
        let mut keys: Vec<([u32; 3], u32)> = self.out.triangles.iter().enumerate().map(|(f, t)| (sorted(*t), f as u32)).collect();
        keys.sort_unstable();
        let double: Vec<u32> = keys.chunk_by(|x, y| x.0 == y.0).filter(|g| g.len() > 1).flatten().map(|k| k.1).collect();
        for f in double {
            work.check()?;
            self.split_face(f);
        }
        Ok(())
    }
}

/// Most passes over the mesh; each splits at least one double edge, nearly always all.
const PASSES: usize = 16;

pub(super) fn unfold(mesh: &SurfaceMesh, patches: &[(Arc<LiftedPatch>, &PatchMap)], out: &mut Assembled, work: &Work<'_>) -> Result<()> {
    let mut unfolder = Unfolder { mesh, patches, out, trees: patches.iter().map(|_| None).collect() };
    for _ in 0..PASSES {
        if !unfolder.split_double_edges(work)? {
            break;
        }
    }
    unfolder.split_double_faces(work)
}
