//! All patches of a partition with the curves each must respect: the output of the stage `Patches`.

use crate::curve::{CurveNetwork, PatchCurve};
use crate::fingerprint::{Contents, Feeder, Fingerprint};
use crate::patch::{Patch, PatchMap};
use std::sync::Arc;

/// The patches of a partition, cut out, and the curves between them.
#[derive(Debug, Default)]
pub struct PatchSet {
    /// Each patch with its fingerprint and its place in the surface.
    pub patches: Vec<(Arc<Patch>, Fingerprint, Arc<PatchMap>)>,
    /// Which patch each is (see [`crate::partition::patch_identities`]).
    pub identities: Vec<Fingerprint>,
    /// The curves.
    pub network: CurveNetwork,
    /// For each patch the curves it must respect.
    pub uses: Vec<Vec<PatchCurve>>,
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
        let patches: usize = self.patches.iter().map(|(p, _, m)| p.bytes() + (2 * m.vertices.len() + m.faces.len()) * 4).sum();
        let curves: usize = self.network.curves.iter().map(|c| c.halfedges.len() * 4 + 40).sum();
        patches + curves + self.uses.iter().flatten().map(|u| u.path.len() * 4 + 32).sum::<usize>()
    }
}
