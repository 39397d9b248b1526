//! Metric fields on the surface: a symmetric positive tensor in the tangent plane says which length is wanted in each direction. From
//! curvature or given by the user, bounded in size and stretch, graded, combined by intersection and interpolated log-Euclidean.

mod evaluate;
mod gradation;
pub(crate) mod tensor;
#[cfg(test)]
mod tests;

use crate::bvh::closest_on_triangle;
use crate::curvature::Sectors;
use crate::error::{EngineError, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::vector::{Vec3, area_vector_twice, dot, unit};
use std::sync::Arc;
use tensor::{Frame, Sym2, Sym3};

pub use evaluate::evaluate_metric;

/// Where the tensors come from.
#[derive(Debug, Clone, PartialEq)]
pub enum MetricSource {
    /// The curvature of the input: along each principal direction the length that keeps both bounds.
    Curvature {
        /// Largest distance between the mesh and the surface, in units of the mesh: a triangle of edges h on curvature k lies within
        /// k h^2 / 6.
        deviation: Option<f64>,
        /// Largest angle between the normals at the ends of an edge, degrees.
        normal_angle_deg: Option<f64>,
    },
    /// A tensor for each vertex of the imported mesh: `xx xy xz yy yz zz` of a symmetric 3 x 3 matrix whose quadratic form of an edge in
    /// the tangent plane is its squared length in elements. What it says of the normal direction does not count.
    PerVertex {
        /// The tensors.
        tensors: Arc<Vec<[f64; 6]>>,
    },
}

/// Which lengths are wanted in which directions. The size field of the session bounds them from above.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricSpec {
    /// The tensors.
    pub source: MetricSource,
    /// Smallest length in any direction.
    pub min_size: Option<f64>,
    /// Largest length in any direction; the size field bounds it, too.
    pub max_size: Option<f64>,
    /// Largest ratio of the lengths wanted at a point in two directions, at least 1.
    pub max_stretch: f64,
    /// Largest ratio of the lengths of neighbouring elements, above 1; `None` does not grade.
    pub growth_rate: Option<f64>,
}

impl Default for MetricSpec {
    fn default() -> Self {
        MetricSpec {
            source: MetricSource::Curvature { deviation: None, normal_angle_deg: Some(20.0) },
            min_size: None,
            max_size: None,
            max_stretch: 10.0,
            growth_rate: Some(1.5),
        }
    }
}

impl MetricSpec {
    /// # Errors
    /// [`Reason::BadParameter`](crate::error::Reason::BadParameter) naming the field.
    pub fn validate(&self) -> Result<()> {
        let bad = |field: &str, message: String| Err(EngineError::bad_parameter(&format!("mesher.metric.{field}"), message));
        let length = |field: &str, value: Option<f64>| match value {
            Some(x) if !(x > 0.0 && x.is_finite()) => bad(field, format!("{x} is not a positive length")),
            _ => Ok(()),
        };
        length("min_size", self.min_size)?;
        length("max_size", self.max_size)?;
        if let (Some(low), Some(high)) = (self.min_size, self.max_size)
            && low > high
        {
            return bad("min_size", format!("{low} is above max_size {high}"));
        }
        if !(self.max_stretch >= 1.0 && self.max_stretch.is_finite()) {
            return bad("max_stretch", format!("{} is not a ratio of at least 1", self.max_stretch));
        }
        if self.growth_rate.is_some_and(|r| !(r > 1.0 && r.is_finite())) {
            return bad("growth_rate", "must be above 1".into());
        }
        match &self.source {
            MetricSource::Curvature { deviation, normal_angle_deg } => {
                length("deviation", *deviation)?;
                if let Some(angle) = normal_angle_deg.filter(|a| !(*a > 0.0 && *a <= 120.0)) {
                    return bad("normal_angle", format!("{angle} is not in (0, 120]"));
                }
                if deviation.is_none() && normal_angle_deg.is_none() {
                    return bad("curvature", "neither a deviation nor a normal_angle is given".into());
                }
                Ok(())
            }
            MetricSource::PerVertex { tensors } => match tensors.iter().position(|t| t.iter().any(|x| !x.is_finite())) {
                Some(v) => bad("tensors", format!("the tensor of vertex {v} is not finite")),
                None => Ok(()),
            },
        }
    }

    /// Feeds what the metric depends on.
    pub fn feed(&self, into: &mut Feeder) {
        match &self.source {
            MetricSource::Curvature { deviation, normal_angle_deg } => into.u64(0).option_f64(*deviation).option_f64(*normal_angle_deg),
            MetricSource::PerVertex { tensors } => into.u64(1).points(tensors),
        };
        into.option_f64(self.min_size).option_f64(self.max_size).f64(self.max_stretch).option_f64(self.growth_rate);
    }
}

/// A metric field on a surface: a tensor for each sector (a vertex, or each side of the features at it).
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMetric {
    pub(crate) sectors: Sectors,
    /// Tangent frame of each sector.
    pub(crate) frames: Vec<Frame>,
    /// The tensor in that frame.
    pub(crate) forms: Vec<Sym2>,
}

impl Contents for SurfaceMetric {
    fn feed(&self, into: &mut Feeder) {
        self.sectors.feed(into);
        into.points(&self.forms);
        for frame in &self.frames {
            into.points(&[frame.u, frame.w]);
        }
    }

    fn bytes(&self) -> usize {
        self.sectors.bytes() + self.forms.len() * (24 + size_of::<Frame>())
    }
}

impl SurfaceMetric {
    /// The tensors at the corners of a face, turned into its plane, in a frame of it. Flat faces get the frame of a corner.
    pub(crate) fn on_face(&self, mesh: &SurfaceMesh, face: u32) -> (Frame, [Sym2; 3]) {
        let [a, b, c] = mesh.corners(face as usize);
        let normal = unit(area_vector_twice(a, b, c));
        let sectors = [0, 1, 2].map(|k| self.sectors.of_corner(3 * face + k) as usize);
        let frame = if dot(normal, normal) > 0.0 { Frame::of(normal) } else { self.frames[sectors[0]] };
        (frame, sectors.map(|s| tensor::transport(&self.frames[s], self.forms[s], &frame)))
    }

    /// The tensors at three points of a face, as matrices in space.
    pub(crate) fn on_piece(&self, mesh: &SurfaceMesh, face: u32, points: [Vec3; 3]) -> [Sym3; 3] {
        let corners = mesh.corners(face as usize);
        if points == corners {
            let (frame, forms) = self.on_face(mesh, face);
            return forms.map(|f| frame.in_space(f));
        }
        points.map(|p| self.at(mesh, face, closest_on_triangle(p, &corners).1))
    }

    /// The tensor at a point of a face, interpolated log-Euclidean between its corners, as a matrix in space that knows nothing of the
    /// face's normal.
    pub fn at(&self, mesh: &SurfaceMesh, face: u32, barycentric: [f64; 3]) -> [f64; 6] {
        let (frame, forms) = self.on_face(mesh, face);
        let mut sum = [0.0; 3];
        for (form, weight) in forms.iter().zip(barycentric) {
            let log = tensor::log(*form);
            (0..3).for_each(|k| sum[k] += weight * log[k]);
        }
        frame.in_space(tensor::exp(sum))
    }

    /// The smallest length wanted at a vertex, in any direction on any side; 1 at a vertex without a face.
    pub fn smallest_length(&self, vertex: u32) -> f64 {
        let most = self.sectors.of_vertex(vertex).map(|s| tensor::eigenvalues(self.forms[s])[0]).fold(0.0, f64::max);
        if most > 0.0 { 1.0 / most.sqrt() } else { 1.0 }
    }

    /// The length wanted at a vertex along a direction, the smallest of all sides.
    pub fn length_along(&self, vertex: u32, direction: Vec3) -> f64 {
        let most = self.sectors.of_vertex(vertex).map(|s| {
            let frame = &self.frames[s];
            let d = [dot(direction, frame.u), dot(direction, frame.w)];
            let square = d[0] * d[0] + d[1] * d[1];
            if square > 0.0 { tensor::square(self.forms[s], d) / square } else { tensor::eigenvalues(self.forms[s])[0] }
        });
        1.0 / most.fold(0.0, f64::max).sqrt()
    }
}

/// Squared length of a vector in a tensor in space (`xx xy xz yy yz zz`).
#[inline]
pub fn squared_length(t: &[f64; 6], e: Vec3) -> f64 {
    let [x, y, z] = e;
    t[0] * x * x + t[3] * y * y + t[5] * z * z + 2.0 * (t[1] * x * y + t[2] * x * z + t[4] * y * z)
}
