//! Principal curvatures and directions of a triangulated surface, from finite differences of vertex normals
//! (Rusinkiewicz 2004). Nothing is averaged over a feature edge: there a vertex has a tensor for each side.

mod fit;
mod normals;
mod sectors;
mod smooth;
#[cfg(test)]
mod tests;

pub(crate) use normals::tangents;
pub use sectors::Sectors;

use crate::error::Result;
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, dot};
use crate::work::Work;

/// The second fundamental form at a point. `d1`, `d2` and `normal` are unit vectors and right-handed in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvatureTensor {
    /// The larger principal curvature, 1/unit; positive where the surface bends away from its normal, as a sphere does.
    pub k1: f64,
    /// The smaller principal curvature.
    pub k2: f64,
    /// Direction of `k1`, up to sign.
    pub d1: Vec3,
    /// Direction of `k2`.
    pub d2: Vec3,
    /// Outward normal that the tensor belongs to.
    pub normal: Vec3,
}

impl CurvatureTensor {
    /// Largest absolute normal curvature.
    pub fn largest(&self) -> f64 {
        self.k1.abs().max(self.k2.abs())
    }

    /// Normal curvature in a tangential direction (need not be unit; its normal part does not count).
    pub fn along(&self, direction: Vec3) -> f64 {
        let (x, y) = (dot(direction, self.d1), dot(direction, self.d2));
        let square = x * x + y * y;
        if square > 0.0 { (self.k1 * x * x + self.k2 * y * y) / square } else { 0.0 }
    }
}

/// Curvature of every sector: of each vertex, and of each side of the feature edges at it.
#[derive(Debug, Clone, PartialEq)]
pub struct Curvature {
    /// The sectors.
    pub sectors: Sectors,
    /// One tensor for each sector.
    pub tensors: Vec<CurvatureTensor>,
}

impl Curvature {
    /// The tensor at a corner of a face (halfedge `3 f + k` leaves corner `k`).
    pub fn at_corner(&self, corner: u32) -> &CurvatureTensor {
        &self.tensors[self.sectors.of_corner(corner) as usize]
    }

    /// For each vertex the tensor of its most curved sector; flat for vertices without a face.
    pub fn per_vertex(&self) -> Vec<CurvatureTensor> {
        let of = |v: usize| {
            let own = &self.tensors[self.sectors.of_vertex(v as u32)];
            let flat = CurvatureTensor { k1: 0.0, k2: 0.0, d1: [1.0, 0.0, 0.0], d2: [0.0, 1.0, 0.0], normal: [0.0, 0.0, 1.0] };
            own.iter().copied().reduce(|best, t| if t.largest() > best.largest() { t } else { best }).unwrap_or(flat)
        };
        (0..self.sectors.vertex_count()).map(of).collect()
    }
}

impl Contents for Curvature {
    fn feed(&self, into: &mut Feeder) {
        into.u64(self.tensors.len() as u64);
        for t in &self.tensors {
            into.f64(t.k1).f64(t.k2).points(&[t.d1, t.d2, t.normal]);
        }
        self.sectors.feed(into);
    }

    fn bytes(&self) -> usize {
        self.tensors.len() * size_of::<CurvatureTensor>() + self.sectors.bytes()
    }
}

/// The curvature at every vertex, on each side of features apart. O(F).
///
/// Exact (to rounding) on spheres and cylinders whatever the triangulation, as long as the edges of a vertex differ in length by less than
/// a factor of ten; at boundaries and features the normals are found from those of the neighbours, not from half a fan. Noise of the
/// surface is noise of its curvature; `smoothing` passes over neighbouring tensors (0 for none) lower it.
///
/// # Errors
/// Only cancellation.
pub fn curvature(mesh: &SurfaceMesh, topology: &Topology, features: &Features, smoothing: u32, work: &Work<'_>) -> Result<Curvature> {
    let sectors = Sectors::build(topology, features);
    let normals = normals::sector_normals(mesh, topology, &sectors, work)?;
    let forms = fit::second_forms(mesh, topology, &sectors, &normals, work)?;
    let forms = smooth::smoothed(topology, &sectors, forms, smoothing, work)?;
    let tensors = forms.iter().map(fit::Form::principal).collect();
    Ok(Curvature { sectors, tensors })
}

/// Principal curvatures and directions of each vertex without smoothing; on features those of the most curved side. O(F).
///
/// # Errors
/// Only cancellation.
pub fn vertex_curvature(mesh: &SurfaceMesh, topology: &Topology, features: &Features, work: &Work<'_>) -> Result<Vec<CurvatureTensor>> {
    Ok(curvature(mesh, topology, features, 0, work)?.per_vertex())
}
