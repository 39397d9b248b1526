//! Feature edges: sharp by angle, borders of regions, and edges the user names.

use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
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
}

impl Contents for Features {
    fn feed(&self, into: &mut Feeder) {
        let marked: Vec<u32> = (0..self.is_feature.len() as u32).filter(|&h| self.is_feature[h as usize]).collect();
        into.u64(self.is_feature.len() as u64).u32s(&marked).u32s(&self.corners);
    }

    fn bytes(&self) -> usize {
        self.is_feature.len() + self.corners.len() * 4
    }
}

/// Finds the feature edges. O(F).
///
/// # Errors
/// [`Reason::BadParameter`] for an angle outside (0, 180) or an explicit edge that is not an edge of the mesh.
pub fn detect_features(mesh: &SurfaceMesh, topology: &Topology, spec: &FeatureSpec, work: &Work<'_>) -> Result<Features> {
    let _ = (mesh, topology, spec, work);
    Err(EngineError::new(Reason::NotBuilt, "feature detection"))
}
