//! One cut of one connected set of faces in two, and what is known of it.

use super::divide::Divider;
use super::laplace::sheet::Sheet;
use super::laplace::{self, share_and_length};
use super::surface::{Limits, Surface, measure};
use super::{PartitionStrategy, check_sizes, max_cut};
use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;

/// Whether a cut can be used.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Verdict {
    /// It is what it should be.
    #[default]
    Usable,
    /// The method failed on this set of faces, and why.
    Unusable(String),
}

/// A set of faces cut in two connected parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TwoWayCut {
    /// For each face of the set, in its order, whether it is in the second part.
    pub second: Vec<bool>,
    /// Share of the area in the second part.
    pub second_share: f64,
    /// Length of the cut along edges, in units of the mesh.
    pub length: f64,
    /// Levels of maps (P2 section 3); 0 if the method makes none.
    pub levels: u32,
    /// Maps at all levels.
    pub maps: u32,
    /// Faces (of the surface) that a single map could not tell apart or flipped; only [`PartitionStrategy::MaxCut`] notes them.
    pub collapsed: Vec<u32>,
    /// Whether it can be used.
    pub verdict: Verdict,
}

impl TwoWayCut {
    pub(super) fn measured(sheet: &Sheet, second: Vec<bool>) -> TwoWayCut {
        let (second_share, length) = share_and_length(sheet, &second);
        TwoWayCut { second, second_share, length, levels: 1, maps: 1, ..TwoWayCut::default() }
    }

    /// The error of a partition that needs this cut.
    pub(super) fn refusal(&self, mesh: &SurfaceMesh, sheet: &Sheet, reason: &str) -> EngineError {
        EngineError::new(Reason::PatchTopology, format!("the max-cut of a part of {} faces fails: {reason}", sheet.faces.len()))
            .with_hint("use the strategy laplace or multilevel")
            .with_metadata("collapsed_faces", self.collapsed.len())
            .with_locations(self.collapsed.iter().map(|&f| mesh.face_location(f as usize)))
    }
}

/// Cuts a set of faces (connected without crossing a feature, of genus 0 and with a border for all but
/// [`PartitionStrategy::Multilevel`]) in two parts. [`PartitionStrategy::Auto`] takes the Laplace cut. A failing max-cut is
/// returned with its [`Verdict`], for comparison. Deterministic.
///
/// # Errors
/// [`Reason::BadParameter`] for fewer than two faces, faces out of range or listed twice, and for strategies that make no two-way cut; [`Reason::PatchTopology`] if the set is
/// not as it must be; [`Reason::SolverSingular`]; cancellation.
pub fn cut_in_two(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    faces: &[u32],
    strategy: PartitionStrategy,
    work: &Work<'_>,
) -> Result<TwoWayCut> {
    check_sizes(mesh, topology, features)?;
    check_faces(faces, topology.face_count())?;
    if matches!(strategy, PartitionStrategy::Handles | PartitionStrategy::Pants | PartitionStrategy::Plane { .. }) {
        return Err(EngineError::bad_parameter("strategy", "handles, pants and plane partition surfaces; they cut no set of faces in two"));
    }
    let surface = Surface::new(mesh, topology, features);
    let limits = Limits { faces: u32::MAX, loops: u32::MAX, aspect_ratio: f64::INFINITY };
    let mut divider = Divider::new(&surface, limits, f64::from(u32::MAX));
    let p = divider.name(faces);
    let piece = measure(&surface, &divider.label, faces, p, &mut divider.scratch);
    let mut slot = vec![0; topology.face_count()];
    let sheet = Sheet::new(&surface, faces.to_vec(), &mut slot);
    if laplace::components(&sheet, &vec![false; faces.len()]).len() > 1 {
        return Err(EngineError::new(Reason::PatchTopology, "the faces to cut are not connected"));
    }
    if strategy == PartitionStrategy::Multilevel {
        let (_, chosen) = divider.halve(faces, 1.0, work)?;
        let q = divider.name(&chosen);
        let second = faces.iter().map(|&f| divider.label[f as usize] == q).collect();
        return Ok(TwoWayCut { levels: 0, maps: 0, ..TwoWayCut::measured(&sheet, second) });
    }
    if piece.genus() != 0 || piece.loops == 0 {
        let message = format!("the faces to cut have genus {} and {} border loops", piece.genus(), piece.loops);
        return Err(EngineError::new(Reason::PatchTopology, message).with_hint("use the strategy multilevel"));
    }
    match strategy {
        PartitionStrategy::MaxCut => max_cut::cut(&sheet, work),
        _ => laplace::cut(&sheet, work),
    }
}

fn check_faces(faces: &[u32], count: usize) -> Result<()> {
    if faces.len() < 2 {
        return Err(EngineError::bad_parameter("faces", "a cut needs at least 2 faces"));
    }
    let mut seen = vec![false; count];
    for &f in faces {
        match seen.get_mut(f as usize) {
            None => return Err(EngineError::bad_parameter("faces", format!("there is no face {f}; there are {count}"))),
            Some(true) => return Err(EngineError::bad_parameter("faces", format!("face {f} is listed twice"))),
            Some(seen) => *seen = true,
        }
    }
    Ok(())
}
