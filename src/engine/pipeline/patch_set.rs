//! All patches of a partition with the curves each must respect: the output of the stage `Patches`.

use crate::curve::CurveNetwork;
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder, Fingerprint};
use crate::partition::Partition;
use crate::patch::{Patch, PatchMap};
use crate::topology::Topology;
use std::sync::Arc;

/// The patches of a partition, cut out, and the curves between them.
#[derive(Debug, Default)]
pub struct PatchSet {
    /// Each patch with its fingerprint and its place in the surface.
    pub patches: Vec<(Arc<Patch>, Fingerprint, Arc<PatchMap>)>,
    /// The curves.
    pub network: CurveNetwork,
    /// For each patch the curves it must respect.
    pub uses: Vec<Vec<PatchCurve>>,
}

/// A curve as a patch sees it.
#[derive(Debug, Clone)]
pub struct PatchCurve {
    /// Curve of the network.
    pub curve: u32,
    /// Local vertices of the patch along the curve.
    pub path: Vec<u32>,
}

impl Contents for PatchSet {
    fn feed(&self, into: &mut Feeder) {
        for (_, fingerprint, map) in &self.patches {
            into.fingerprint(*fingerprint).u32s(&map.vertices);
        }
        for curve in &self.network.curves {
            into.u64(curve.kind as u64).u32s(&curve.halfedges);
        }
    }

    fn bytes(&self) -> usize {
        let patches: usize = self.patches.iter().map(|(p, _, m)| p.bytes() + (m.vertices.len() + m.faces.len()) * 4).sum();
        let curves: usize = self.network.curves.iter().map(|c| c.halfedges.len() * 4 + 40).sum();
        patches + curves + self.uses.iter().flatten().map(|u| u.path.len() * 4 + 32).sum::<usize>()
    }
}

/// The local vertices of each patch along each curve beside or inside it.
pub(super) fn curve_uses(
    topology: &Topology,
    partition: &Partition,
    network: &CurveNetwork,
    cut: &[(Patch, PatchMap)],
) -> Result<Vec<Vec<PatchCurve>>> {
    let mut local_face = vec![0u32; topology.face_count()];
    for (_, map) in cut {
        for (local, &global) in map.faces.iter().enumerate() {
            local_face[global as usize] = local as u32;
        }
    }
    let local_corner = |halfedge: u32| {
        let face = topology.face(halfedge) as usize;
        cut[partition.face_patch[face] as usize].0.triangles[local_face[face] as usize][halfedge as usize % 3]
    };
    let mut uses: Vec<Vec<PatchCurve>> = vec![Vec::new(); cut.len()];
    for (number, curve) in network.curves.iter().enumerate() {
        let curve_number = number as u32;
        let (Some(&first), Some(&last)) = (curve.halfedges.first(), curve.halfedges.last()) else {
            return Err(EngineError::invariant(format!("curve {number} has no edge")));
        };
        let left = partition.face_patch[topology.face(first) as usize];
        let mut path: Vec<u32> = curve.halfedges.iter().map(|&h| local_corner(h)).collect();
        path.push(local_corner(topology.next(last)));
        uses[left as usize].push(PatchCurve { curve: curve_number, path });
        let Some(twin) = topology.twin(first) else { continue };
        let right = partition.face_patch[topology.face(twin) as usize];
        if right == left {
            continue;
        }
        let twins: Option<Vec<u32>> = curve.halfedges.iter().map(|&h| topology.twin(h)).collect();
        let twins = twins.ok_or_else(|| EngineError::invariant(format!("curve {number} runs along the boundary and inside")))?;
        let mut path: Vec<u32> = twins.iter().map(|&t| local_corner(topology.next(t))).collect();
        path.push(local_corner(twins[twins.len() - 1]));
        uses[right as usize].push(PatchCurve { curve: curve_number, path });
    }
    Ok(uses)
}
