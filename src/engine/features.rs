//! Feature edges: sharp by angle, borders of regions, and edges the user names.

mod border_graph;
mod chains;
mod compounds;
mod corners;
mod sharp;
#[cfg(test)]
mod tests;

pub use compounds::{Compound, CompoundRule, CompoundSpec, Compounds};

use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::bounding_diagonal;
use crate::work::Work;

/// Which edges are features.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureSpec {
    /// Edges whose faces' normals differ by at least this angle (degrees) are sharp; `None` finds none by angle.
    pub feature_angle_deg: Option<f64>,
    /// Connected chains of sharp edges shorter than this share of the bounding box diagonal are noise and dropped
    /// (0 keeps all). Never applies to region borders and explicit edges.
    pub min_chain_share: f64,
    /// Whether edges between faces of different regions are features.
    pub region_borders: RegionBorders,
    /// Edges named by their two vertex indices (of the imported mesh).
    pub explicit_edges: Vec<[u32; 2]>,
    /// Regions that are parametrized as one.
    pub compounds: CompoundSpec,
}

/// What a border between two regions is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RegionBorders {
    /// A feature: kept as edges of the output.
    Keep,
    /// Ignored: the output's regions may move by about half an element.
    Ignore,
}

impl Default for FeatureSpec {
    fn default() -> Self {
        FeatureSpec {
            feature_angle_deg: Some(40.0),
            min_chain_share: 0.02,
            region_borders: RegionBorders::Keep,
            explicit_edges: Vec::new(),
            compounds: CompoundSpec::default(),
        }
    }
}

/// Feature edges of a surface. Boundary edges are curves anyway and are not listed here.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Features {
    /// For each halfedge of the surface whether its edge is a feature; equal on both halves, `false` on the boundary.
    pub is_feature: Vec<bool>,
    /// Vertices where a feature or boundary curve must not be rounded: ends, junctions and sharp turns. Sorted.
    pub corners: Vec<u32>,
    /// Regions that are parametrized as one. No part of the fingerprint.
    pub compounds: Compounds,
}

impl Contents for Features {
    fn feed(&self, into: &mut Feeder) {
        let marked: Vec<u32> = (0..self.is_feature.len() as u32).filter(|&h| self.is_feature[h as usize]).collect();
        into.u64(self.is_feature.len() as u64).u32s(&marked).u32s(&self.corners);
    }

    fn bytes(&self) -> usize {
        self.is_feature.len() + self.corners.len() * 4 + self.compounds.group.len() * 8
    }
}

/// What a mark on an edge rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mark {
    /// Not a feature.
    None,
    /// Sharp by angle: dropped again if its chain is noise.
    Sharp,
    /// A region border or an edge the user named: stays.
    Given,
}

/// Finds the feature edges. O(F).
///
/// Normals of slivers that agree with no neighbour are taken from the neighbour they fit best, so that a degenerate face does not
/// make an edge sharp. Sharp branches that end freely and sharp components are dropped below `min_chain_share`.
///
/// # Errors
/// [`crate::error::Reason::BadParameter`] for an angle outside (0, 180), a negative `min_chain_share`, an explicit edge that is not an
/// edge of the mesh, or compounds of unknown, repeated or scattered regions (with locations).
pub fn detect_features(mesh: &SurfaceMesh, topology: &Topology, spec: &FeatureSpec, work: &Work<'_>) -> Result<Features> {
    if spec.feature_angle_deg.is_some_and(|a| !(a > 0.0 && a < 180.0)) {
        return Err(EngineError::bad_parameter("feature_angle", "must lie between 0 and 180 degrees"));
    }
    if !(spec.min_chain_share >= 0.0 && spec.min_chain_share.is_finite()) {
        return Err(EngineError::bad_parameter("min_chain_share", "must be a finite number, 0 or more"));
    }
    compounds::check_spec(&spec.compounds)?;
    let merging = !compounds::is_empty(&spec.compounds);
    let needs_normals = spec.feature_angle_deg.is_some() || merging;
    let normals = if needs_normals { sharp::reference_normals(mesh, topology, work)? } else { Vec::new() };
    let compounds = match merging {
        true => compounds::find_compounds(mesh, topology, &normals, &spec.compounds, work)?,
        false => Compounds::none(mesh.regions.len()),
    };
    let mut marks = vec![Mark::None; topology.halfedge_count()];
    if spec.region_borders == RegionBorders::Keep {
        mark_region_borders(mesh, topology, &compounds, &mut marks);
    }
    mark_explicit(mesh, topology, &spec.explicit_edges, &mut marks)?;
    if let Some(angle) = spec.feature_angle_deg {
        sharp::mark_sharp(topology, &normals, angle.to_radians(), &mut marks, work)?;
        clear_inside_compounds(mesh, topology, &compounds, &mut marks);
        let shortest = spec.min_chain_share * bounding_diagonal(&mesh.positions);
        if shortest > 0.0 {
            chains::drop_noise(mesh, topology, &normals, shortest, &mut marks, work)?;
        }
    }
    let is_feature: Vec<bool> = marks.iter().map(|&m| m != Mark::None).collect();
    let corners = corners::find_corners(mesh, topology, &is_feature, work)?;
    Ok(Features { is_feature, corners, compounds })
}

/// Marks both halves of an interior edge; boundary edges are left alone.
fn set_mark(topology: &Topology, marks: &mut [Mark], h: u32, mark: Mark) {
    if let Some(t) = topology.twin(h) {
        marks[h as usize] = mark;
        marks[t as usize] = mark;
    }
}

/// Regions on both sides of an interior edge.
fn regions_beside(mesh: &SurfaceMesh, topology: &Topology, h: u32) -> Option<[u32; 2]> {
    topology.twin(h).map(|t| [h, t].map(|x| mesh.face_region[topology.face(x) as usize]))
}

fn mark_region_borders(mesh: &SurfaceMesh, topology: &Topology, compounds: &Compounds, marks: &mut [Mark]) {
    for h in 0..topology.halfedge_count() as u32 {
        if regions_beside(mesh, topology, h).is_some_and(|[a, b]| a != b && !compounds.joins(a, b)) {
            marks[h as usize] = Mark::Given;
        }
    }
}

/// Takes sharp marks between two regions of a compound back.
fn clear_inside_compounds(mesh: &SurfaceMesh, topology: &Topology, compounds: &Compounds, marks: &mut [Mark]) {
    if compounds.list.is_empty() {
        return;
    }
    for h in 0..topology.halfedge_count() as u32 {
        if marks[h as usize] == Mark::Sharp && regions_beside(mesh, topology, h).is_some_and(|[a, b]| compounds.joins(a, b)) {
            marks[h as usize] = Mark::None;
        }
    }
}

fn mark_explicit(mesh: &SurfaceMesh, topology: &Topology, edges: &[[u32; 2]], marks: &mut [Mark]) -> Result<()> {
    let count = topology.vertex_count() as u32;
    for (i, &[a, b]) in edges.iter().enumerate() {
        let field = format!("explicit_edges[{i}]");
        if a >= count || b >= count {
            return Err(EngineError::bad_parameter(&field, format!("names vertices {a}, {b}; the mesh has {count} vertices")));
        }
        let leaving = |from: u32, to: u32| topology.outgoing(from).find(|&h| topology.target(h) == to);
        match leaving(a, b).or_else(|| leaving(b, a)) {
            Some(h) => set_mark(topology, marks, h, Mark::Given),
            None => {
                return Err(EngineError::bad_parameter(&field, format!("vertices {a} and {b} share no edge"))
                    .with_locations([mesh.vertex_location(a), mesh.vertex_location(b)]));
            }
        }
    }
    Ok(())
}
