//! Size fields: the wanted edge length at every vertex of the input surface.

use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::work::Work;

/// Which edge lengths are wanted.
#[derive(Debug, Clone, PartialEq)]
pub enum SizeSpec {
    /// The same everywhere.
    Uniform {
        /// Edge length in units of the mesh.
        size: f64,
    },
    /// The same everywhere, chosen so that about this many equilateral triangles cover the surface:
    /// N sqrt(3)/4 size^2 = area.
    TriangleCount {
        /// Wanted number of triangles.
        triangles: u64,
    },
    /// A length for each vertex of the imported mesh, clamped and then limited in growth.
    PerVertex {
        /// One positive length per vertex.
        sizes: Vec<f64>,
        /// Lower bound, if any.
        min_size: Option<f64>,
        /// Upper bound, if any.
        max_size: Option<f64>,
        /// Largest ratio of lengths of neighbouring elements (at least 1); `None` does not limit.
        growth_rate: Option<f64>,
    },
    /// `min_size` on feature and boundary curves (at the flattest spot, where there is neither), growing away from them by
    /// `growth_rate` per element up to `max_size`.
    Graded {
        /// Smallest length.
        min_size: f64,
        /// Largest length.
        max_size: f64,
        /// Ratio of lengths of neighbouring elements, above 1.
        growth_rate: f64,
    },
}

/// Wanted edge length at each vertex of the input surface; linear inside faces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SizeField {
    /// One positive length per vertex.
    pub vertex_size: Vec<f64>,
    /// The common value, if all are equal.
    pub uniform: Option<f64>,
}

impl Contents for SizeField {
    fn feed(&self, into: &mut Feeder) {
        into.f64s(&self.vertex_size);
    }

    fn bytes(&self) -> usize {
        self.vertex_size.len() * 8
    }
}

/// Most triangles a size field may ask for (about area / (sqrt(3)/4 size^2)); more is refused with [`Reason::LimitReached`].
pub const MAX_EXPECTED_TRIANGLES: f64 = 2.0e7;

/// Evaluates a size specification. O(F log F) with growth, else O(F).
///
/// # Errors
/// [`Reason::BadParameter`] for lengths that are not positive and finite, a wrong array length, `min_size > max_size` or a growth
/// rate below 1; [`Reason::LimitReached`] if more than [`MAX_EXPECTED_TRIANGLES`] would result.
pub fn evaluate_size(mesh: &SurfaceMesh, topology: &Topology, features: &Features, spec: &SizeSpec, work: &Work<'_>) -> Result<SizeField> {
    let _ = (mesh, topology, features, spec, work);
    Err(EngineError::new(Reason::NotBuilt, "size field"))
}
