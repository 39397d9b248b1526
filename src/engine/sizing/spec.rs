//! What sizes can be asked for: plain data, and which numbers in it make sense.

use crate::error::Result;
use crate::fingerprint::{Feeder, Fingerprint};
use crate::vector::Vec3;
use std::sync::Arc;

/// Most fields of one specification.
pub const MAX_FIELDS: usize = 256;
/// Most points of the curves and point sets of one specification.
pub const MAX_POINTS: usize = 2_000_000;

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
    /// The least of a base and any number of fields, clamped and then limited in growth.
    Composed(ComposedSize),
}

/// The least of a base and of fields at every point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ComposedSize {
    /// The length where no field asks for a smaller one.
    pub base: SizeBase,
    /// The fields.
    pub fields: Vec<SizeFieldSpec>,
    /// Lower bound, if any; required by fields that can ask for 0 (proximity, thickness, centerlines).
    pub min_size: Option<f64>,
    /// Upper bound, if any.
    pub max_size: Option<f64>,
    /// Largest ratio of lengths of neighbouring elements (at least 1), over the whole surface; `None` does not limit.
    pub growth_rate: Option<f64>,
}

/// The length where no field asks for a smaller one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum SizeBase {
    /// The upper bound, which is then required.
    #[default]
    MaxSize,
    /// This length.
    Uniform(f64),
    /// The length with which the finished field asks for about this many triangles. If the fields alone ask for more, all are made larger
    /// by a common factor ([`crate::sizing::SizeField::fields_scaled_by`]).
    Triangles(u64),
}

/// One field. Lengths are in units of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum SizeFieldSpec {
    /// A length on a region.
    Region {
        /// The region.
        region: RegionChoice,
        /// Length there.
        size: f64,
    },
    /// A length on a patch; waits while the partition has no such patch.
    Patch {
        /// [`crate::patch::PatchMap::identity`] of the patch.
        patch: Fingerprint,
        /// Length there.
        size: f64,
    },
    /// A length for each vertex of the imported mesh.
    PerVertex {
        /// One positive length per vertex.
        sizes: Arc<Vec<f64>>,
    },
    /// Small where the surface is bent.
    Curvature(CurvatureSize),
    /// Small where another sheet of the surface is near.
    Proximity(ProximitySize),
    /// In proportion to the thickness of the body.
    Thickness {
        /// Elements across the thickness.
        elements: f64,
    },
    /// In proportion to the radius of a vessel.
    Centerline(CenterlineSize),
    /// Small inside a box, sphere or cylinder.
    Shape(ShapeSize),
    /// Small near points or curves.
    Distance(DistanceSize),
}

/// A region by what the source calls it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RegionChoice {
    /// [`crate::mesh::Region::id`].
    Id(i64),
    /// [`crate::mesh::Region::name`]; of several regions of that name all are meant.
    Name(String),
}

/// Lengths from curvature; the smaller of both where both are given, one of which is required.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvatureSize {
    /// Largest angle between the normals at the ends of an edge, in degrees, in (0, 180): 360 over the elements of a full circle.
    pub normal_angle_deg: Option<f64>,
    /// Largest distance of elements from the surface.
    pub deviation: Option<f64>,
    /// Passes of averaging over neighbours, against noise; at most 100.
    pub smoothing: u32,
}

/// On which side of the surface another sheet counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sides {
    /// Both.
    #[default]
    Both,
    /// Through the body: walls.
    Inside,
    /// Through the space around it: slots.
    Outside,
}

/// Lengths from gaps: distances of sheets that face each other to within 60 degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProximitySize {
    /// Elements across a gap.
    pub elements_per_gap: f64,
    /// Which gaps.
    pub sides: Sides,
    /// Widest gap that counts; `None` for any.
    pub reach: Option<f64>,
}

/// What of a centerline gives the length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CenterlineMeasure {
    /// The radius of the vessel.
    #[default]
    Radius,
    /// The distance of the wall from the line.
    Distance,
}

/// Lengths from centerlines: 2 pi times the measure over `elements_around`.
#[derive(Debug, Clone, PartialEq)]
pub struct CenterlineSize {
    /// The lines; `None` computes the radius of the vessel at each vertex instead: that of inscribed spheres, averaged around.
    pub lines: Option<Arc<Vec<Centerline>>>,
    /// Which measure.
    pub measure: CenterlineMeasure,
    /// Edges around the circumference.
    pub elements_around: f64,
}

/// A polyline with a radius at each point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Centerline {
    /// Its points.
    pub points: Vec<Vec3>,
    /// One radius per point; may be empty if only distances count.
    pub radii: Vec<f64>,
}

/// A body in space; its boundary belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Parallel to the axes.
    Box {
        /// Lowest corner.
        low: Vec3,
        /// Highest corner.
        high: Vec3,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// Its radius.
        radius: f64,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Middle of one end.
        start: Vec3,
        /// Middle of the other.
        end: Vec3,
        /// Its radius.
        radius: f64,
    },
}

/// A length inside a shape, growing with the straight distance outside of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSize {
    /// The shape.
    pub shape: Shape,
    /// Length inside.
    pub size: f64,
    /// Growth outside; `None` takes that of the specification, without which nothing is asked for outside.
    pub growth_rate: Option<f64>,
}

/// From what distances are measured.
#[derive(Debug, Clone, PartialEq)]
pub enum DistanceSource {
    /// Points.
    Points(Arc<Vec<Vec3>>),
    /// Polylines.
    Polylines(Arc<Vec<Vec<Vec3>>>),
    /// Feature edges of the surface.
    Features,
    /// Boundary edges of the surface.
    Boundary,
}

/// A length near points or curves, growing with the straight distance.
#[derive(Debug, Clone, PartialEq)]
pub struct DistanceSize {
    /// From what.
    pub from: DistanceSource,
    /// Length there.
    pub size: f64,
    /// Up to this distance the length is `size`.
    pub reach: f64,
    /// Growth beyond; as in [`ShapeSize::growth_rate`].
    pub growth_rate: Option<f64>,
}

impl SizeSpec {
    /// Feeds all that the field depends on besides the surface.
    pub fn feed(&self, into: &mut Feeder) {
        match self {
            SizeSpec::PerVertex { sizes, min_size, max_size, growth_rate } => {
                into.text("per vertex").f64s(sizes).option_f64(*min_size).option_f64(*max_size).option_f64(*growth_rate);
            }
            SizeSpec::Composed(composed) => {
                into.text(&format!("{:?}", composed.base));
                into.option_f64(composed.min_size).option_f64(composed.max_size).option_f64(composed.growth_rate);
                into.u64(composed.fields.len() as u64);
                composed.fields.iter().for_each(|field| field.feed(into));
            }
            simple => {
                into.text(&format!("{simple:?}"));
            }
        }
    }

    /// Its limit of growth, if it has one.
    pub fn growth_rate(&self) -> Option<f64> {
        match self {
            SizeSpec::Uniform { .. } | SizeSpec::TriangleCount { .. } => None,
            SizeSpec::PerVertex { growth_rate, .. } => *growth_rate,
            SizeSpec::Graded { growth_rate, .. } => Some(*growth_rate),
            SizeSpec::Composed(composed) => composed.growth_rate,
        }
    }

    /// The patches named by it.
    pub fn named_patches(&self) -> Vec<Fingerprint> {
        let SizeSpec::Composed(composed) = self else { return Vec::new() };
        let patch = |field: &SizeFieldSpec| match field {
            SizeFieldSpec::Patch { patch, .. } => Some(*patch),
            _ => None,
        };
        composed.fields.iter().filter_map(patch).collect()
    }

    /// Checks what can be checked without the surface.
    ///
    /// # Errors
    /// [`crate::error::Reason::BadParameter`] that names the field; [`crate::error::Reason::LimitReached`] beyond [`MAX_FIELDS`] or [`MAX_POINTS`].
    pub fn validate(&self) -> Result<()> {
        match self {
            SizeSpec::Composed(composed) => composed.validate(),
            // Evaluation checks the others, as it needs the surface for most of it.
            _ => Ok(()),
        }
    }
}

impl SizeFieldSpec {
    /// Name of the kind, as on the wire.
    pub fn name(&self) -> &'static str {
        match self {
            SizeFieldSpec::Region { .. } => "region",
            SizeFieldSpec::Patch { .. } => "patch",
            SizeFieldSpec::PerVertex { .. } => "per_vertex",
            SizeFieldSpec::Curvature(_) => "curvature",
            SizeFieldSpec::Proximity(_) => "proximity",
            SizeFieldSpec::Thickness { .. } => "thickness",
            SizeFieldSpec::Centerline(_) => "centerline",
            SizeFieldSpec::Shape(_) => "shape",
            SizeFieldSpec::Distance(_) => "distance",
        }
    }

    fn feed(&self, into: &mut Feeder) {
        into.text(self.name());
        match self {
            SizeFieldSpec::PerVertex { sizes } => {
                into.f64s(sizes);
            }
            SizeFieldSpec::Centerline(CenterlineSize { lines, measure, elements_around }) => {
                into.u64(*measure as u64).f64(*elements_around).u64(lines.as_ref().map_or(0, |lines| lines.len() as u64 + 1));
                lines.iter().flat_map(|lines| lines.iter()).for_each(|line| {
                    into.points(&line.points).f64s(&line.radii);
                });
            }
            SizeFieldSpec::Distance(DistanceSize { from, size, reach, growth_rate }) => {
                into.f64(*size).f64(*reach).option_f64(*growth_rate);
                match from {
                    DistanceSource::Points(points) => into.u64(0).points(points),
                    DistanceSource::Polylines(lines) => {
                        into.u64(1).u64(lines.len() as u64);
                        lines.iter().for_each(|line| {
                            into.points(line);
                        });
                        into
                    }
                    DistanceSource::Features => into.u64(2),
                    DistanceSource::Boundary => into.u64(3),
                };
            }
            small => {
                into.text(&format!("{small:?}"));
            }
        }
    }
}
