//! Which chart is wanted of a patch: the method and its boundary conditions (P1 sections 2 to 4).

use crate::error::{Element, EngineError, Location, Result};
use crate::patch::{Patch, PatchMap};
use crate::vector::Vec2;

/// A map to the plane: the five linear maps of P1 section 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ChartMethod {
    /// Smallest non-zero generalized eigenvector of the conformal energy and the boundary mass (P1 eq. 29).
    SpectralConformal,
    /// Least squares conformal map with pinned vertices, the "finite element conformal map" (P1 section 2.3).
    LeastSquaresConformal,
    /// Mean value convex combination map onto a given boundary (P1 eq. 14; Floater).
    MeanValue,
    /// Harmonic map with cotangent weights onto a given boundary (P1 section 2.1).
    Harmonic,
    /// Barycentric convex combination map onto a given boundary (P1 eq. 12; Tutte).
    Barycentric,
}

impl ChartMethod {
    /// All methods.
    pub const ALL: [ChartMethod; 5] = [
        ChartMethod::SpectralConformal,
        ChartMethod::LeastSquaresConformal,
        ChartMethod::MeanValue,
        ChartMethod::Harmonic,
        ChartMethod::Barycentric,
    ];

    /// Whether the method takes the plane positions of the whole outer loop (Dirichlet), rather than leaving it free.
    pub fn has_fixed_boundary(self) -> bool {
        matches!(self, ChartMethod::MeanValue | ChartMethod::Harmonic | ChartMethod::Barycentric)
    }

    /// Name in records, messages and logs.
    pub fn name(self) -> &'static str {
        match self {
            ChartMethod::SpectralConformal => "spectral conformal",
            ChartMethod::LeastSquaresConformal => "least squares conformal",
            ChartMethod::MeanValue => "mean value",
            ChartMethod::Harmonic => "harmonic",
            ChartMethod::Barycentric => "barycentric",
        }
    }
}

/// Which chart is wanted. The default lets the engine choose (P1 figure 23).
///
/// Vertices are those of the imported mesh in the spec of a session, and local ones in the spec of a [`Patch`]
/// (see [`ChartSpec::localised`]).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChartSpec {
    /// The method; `None` for spectral conformal, LSCM, mean value: the first that passes the checks. A named method is used or
    /// refused, never replaced.
    pub method: Option<ChartMethod>,
    /// Which loop is the outer one.
    pub outer: OuterLoop,
    /// What is done about the other loops.
    pub holes: Holes,
    /// Pins; for [`ChartMethod::LeastSquaresConformal`] only.
    pub pins: Pins,
    /// Where the outer loop goes; for methods with a fixed boundary only.
    pub boundary: Boundary,
}

/// Which loop of a patch becomes the outer boundary of the chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum OuterLoop {
    /// The longest.
    #[default]
    Longest,
    /// The one through this vertex. Methods with a free boundary then fill the other loops: only so does it come out outside.
    Through(u32),
}

/// What is done about the inner loops of a patch while it is mapped. Filling never reaches the chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Holes {
    /// Whatever passes the checks first: free, then filled with a vertex in the centre, then with a mesh of the mean plane; for methods that
    /// hold the outer loop, and for a chosen outer loop, filled first.
    #[default]
    Automatic,
    /// Free (zero Neumann boundary, P1 eq. 30).
    Open,
    /// A fan of triangles to the centroid of the loop (P3 section 4.1).
    CentreVertex,
    /// A Delaunay mesh of the loop in its mean plane (P1 section 8).
    MeanPlane,
}

/// Pins of a least squares conformal map.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Pins {
    /// The choices below one after the other, until a chart passes the checks.
    #[default]
    Automatic,
    /// The two vertices of the outer loop farthest apart in space.
    Farthest,
    /// The two vertices of the outer loop at the ends of the patch's principal axis of inertia (P1 section 6.4).
    Inertia,
    /// These, at least two. Two without targets fix a similarity, and the chart is scaled to the area of the patch; with targets
    /// the chart goes exactly there. More need targets: a constrained LSCM.
    Given(Vec<Pin>),
}

/// A vertex that is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pin {
    /// The vertex; inside the patch or on its boundary.
    pub vertex: u32,
    /// Where it goes.
    pub target: Option<Vec2>,
}

/// Positions of the outer loop (Dirichlet conditions, P1 section 4).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Boundary {
    /// The curve.
    pub shape: BoundaryShape,
    /// How vertices are spread along it.
    pub spacing: Spacing,
    /// The vertex of the outer loop that goes to the start of the curve: angle 0, or the first corner. Default: the first vertex
    /// of the loop. Not with `corners`, which say it too, nor with [`BoundaryShape::MeanPlane`].
    pub start: Option<u32>,
}

/// A closed curve in the plane. The chart is scaled to the area of the patch afterwards, so only its shape matters.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum BoundaryShape {
    /// A circle (P1 eq. 26).
    #[default]
    Circle,
    /// An ellipse.
    Ellipse {
        /// First over second axis, positive.
        ratio: f64,
    },
    /// A rectangle.
    Rectangle {
        /// First over second side, positive. Default: that of the lengths between the corners.
        ratio: Option<f64>,
        /// Vertices of the outer loop, in its direction, that become the corners. Default: quarters of the length.
        corners: Option<[u32; 4]>,
    },
    /// A convex polygon.
    Polygon {
        /// Its corners, counter-clockwise, no three on a line.
        points: Vec<Vec2>,
        /// Vertices of the outer loop, in its direction, one for each corner. Default: the shares of the perimeter.
        corners: Option<Vec<u32>>,
    },
    /// The outer loop projected onto its mean plane. Need not be convex.
    MeanPlane,
}

/// How the vertices of the outer loop are spread along a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Spacing {
    /// Lengths along the curve are proportional to the lengths of the edges.
    #[default]
    ArcLength,
    /// Distances of consecutive points (chords) are. On straight sides both are the same.
    Chord,
}

impl ChartSpec {
    /// A spec of one method with default conditions.
    pub fn only(method: ChartMethod) -> ChartSpec {
        ChartSpec { method: Some(method), ..ChartSpec::default() }
    }

    /// Checks what can be checked without a patch: numbers are finite and in range, and no condition is given that the method
    /// would ignore.
    ///
    /// # Errors
    /// [`crate::error::Reason::BadParameter`], naming the field.
    pub fn validate(&self) -> Result<()> {
        let lscm = self.method == Some(ChartMethod::LeastSquaresConformal);
        if self.pins != Pins::Automatic && !lscm {
            return Err(EngineError::bad_parameter("pins", "pins are for the least squares conformal map, which was not asked for")
                .with_hint("set the method to least squares conformal"));
        }
        if self.boundary != Boundary::default() && !self.method.is_some_and(ChartMethod::has_fixed_boundary) {
            return Err(EngineError::bad_parameter("boundary", "the method asked for leaves the boundary free")
                .with_hint("a boundary shape needs the harmonic, barycentric or mean value method"));
        }
        let free = !self.method.is_some_and(ChartMethod::has_fixed_boundary);
        if free && self.holes == Holes::Open && self.outer != OuterLoop::Longest {
            return Err(EngineError::bad_parameter("outer_vertex", "a free boundary comes out outside only if the other loops are filled")
                .with_hint("let holes be filled, or choose a method that holds the outer loop"));
        }
        if let Pins::Given(pins) = &self.pins {
            validate_pins(pins)?;
        }
        self.boundary.validate()
    }

    /// Whether the spec names vertices, so that it can only be meant for one patch.
    pub fn names_vertices(&self) -> bool {
        let corners = match &self.boundary.shape {
            BoundaryShape::Rectangle { corners, .. } => corners.is_some(),
            BoundaryShape::Polygon { corners, .. } => corners.is_some(),
            _ => false,
        };
        corners || self.boundary.start.is_some() || matches!(self.outer, OuterLoop::Through(_)) || matches!(self.pins, Pins::Given(_))
    }

    /// The same spec with vertices of the imported mesh replaced by local ones of a patch.
    ///
    /// # Errors
    /// [`crate::error::Reason::BadParameter`] for a vertex that is not in the patch, with the vertex as location if it exists at all in
    /// `positions` (those of the imported mesh).
    pub fn localised(&self, map: &PatchMap, positions: &[crate::vector::Vec3]) -> Result<ChartSpec> {
        let local = |vertex: u32, field: &str| -> Result<u32> {
            // A vertex in which the patch touches itself has two copies; the first is meant.
            let at = map.vertices.partition_point(|&v| v < vertex);
            if map.vertices.get(at) == Some(&vertex) {
                return Ok(at as u32);
            }
            let place = positions.get(vertex as usize).map(|&position| Location { element: Element::Vertex, ids: vec![vertex], position });
            Err(EngineError::bad_parameter(field, format!("vertex {vertex} is not in the patch"))
                .with_hint("name vertices of the imported mesh that belong to the patch")
                .with_locations(place))
        };
        let mut spec = self.clone();
        if let OuterLoop::Through(v) = &mut spec.outer {
            *v = local(*v, "outer_vertex")?;
        }
        if let Pins::Given(pins) = &mut spec.pins {
            for pin in pins {
                pin.vertex = local(pin.vertex, "pins")?;
            }
        }
        if let Some(v) = &mut spec.boundary.start {
            *v = local(*v, "boundary.start_vertex")?;
        }
        let corners: &mut [u32] = match &mut spec.boundary.shape {
            BoundaryShape::Rectangle { corners: Some(corners), .. } => corners,
            BoundaryShape::Polygon { corners: Some(corners), .. } => corners,
            _ => &mut [],
        };
        for v in corners {
            *v = local(*v, "boundary.corners")?;
        }
        Ok(spec)
    }
}

/// Most pins of one map: each costs a solve and a row of a dense matrix.
pub const MAX_PINS: usize = 64;

fn validate_pins(pins: &[Pin]) -> Result<()> {
    if pins.len() < 2 || pins.len() > MAX_PINS {
        return Err(EngineError::bad_parameter("pins", format!("{} pins were given, 2 to {MAX_PINS} are needed", pins.len())));
    }
    let mut vertices: Vec<u32> = pins.iter().map(|p| p.vertex).collect();
    vertices.sort_unstable();
    if let Some(pair) = vertices.windows(2).find(|w| w[0] == w[1]) {
        return Err(EngineError::bad_parameter("pins", format!("vertex {} is pinned twice", pair[0])));
    }
    let targets: Vec<Vec2> = pins.iter().filter_map(|p| p.target).collect();
    if targets.iter().flatten().any(|x| !x.is_finite()) {
        return Err(EngineError::new(crate::error::Reason::NonFinite, "the target of a pin is not finite"));
    }
    if !(targets.len() == pins.len() || targets.is_empty() && pins.len() == 2) {
        return Err(EngineError::bad_parameter("pins", "either all pins have targets, or there are two and neither has"));
    }
    let mut sorted: Vec<(Vec2, u32)> = pins.iter().filter_map(|p| p.target.map(|t| (t, p.vertex))).collect();
    sorted.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])));
    if let Some(pair) = sorted.windows(2).find(|w| w[0].0 == w[1].0) {
        let message = format!("the pins of vertices {} and {} have the same target", pair[0].1, pair[1].1);
        return Err(EngineError::bad_parameter("pins", message));
    }
    Ok(())
}

/// Most corners of a polygon.
pub const MAX_CORNERS: usize = 1024;

impl Boundary {
    fn validate(&self) -> Result<()> {
        let positive = |ratio: f64| {
            if (1e-3..=1e3).contains(&ratio) {
                Ok(())
            } else {
                Err(EngineError::bad_parameter("boundary.ratio", format!("the ratio must be between 0.001 and 1000, it is {ratio}")))
            }
        };
        let corners = match &self.shape {
            BoundaryShape::Circle => false,
            BoundaryShape::MeanPlane => self.start.is_some() || self.spacing != Spacing::default(),
            BoundaryShape::Ellipse { ratio } => {
                positive(*ratio)?;
                false
            }
            BoundaryShape::Rectangle { ratio, corners } => {
                ratio.map_or(Ok(()), positive)?;
                corners.is_some()
            }
            BoundaryShape::Polygon { points, corners } => {
                validate_polygon(points, corners.as_deref())?;
                corners.is_some()
            }
        };
        match self.start {
            Some(_) if corners => {
                Err(EngineError::bad_parameter("boundary.start_vertex", "the corners or the projection already say where vertices go"))
            }
            None if corners && matches!(self.shape, BoundaryShape::MeanPlane) => {
                Err(EngineError::bad_parameter("boundary.spacing", "a projection leaves nothing to be spaced"))
            }
            _ => Ok(()),
        }
    }
}

fn validate_polygon(points: &[Vec2], corners: Option<&[u32]>) -> Result<()> {
    let n = points.len();
    let bad = |message: String| Err(EngineError::bad_parameter("boundary.polygon", message));
    if !(3..=MAX_CORNERS).contains(&n) {
        return bad(format!("a polygon needs 3 to {MAX_CORNERS} corners, it has {n}"));
    }
    if points.iter().flatten().any(|x| !x.is_finite()) {
        return Err(EngineError::new(crate::error::Reason::NonFinite, "a corner of the polygon is not finite"));
    }
    let turn = |k: usize| super::validity::orientation(points[k], points[(k + 1) % n], points[(k + 2) % n]);
    if let Some(k) = (0..n).find(|&k| turn(k) <= 0.0) {
        return bad(format!("the polygon is not strictly convex and counter-clockwise at corner {}", (k + 1) % n));
    }
    // Left turns everywhere: convex if it turns once, so seen from the first corner the others must come in order.
    if let Some(k) = (1..n - 1).find(|&k| super::validity::orientation(points[0], points[k], points[k + 1]) <= 0.0) {
        return bad(format!("the polygon winds around more than once near corner {k}"));
    }
    match corners {
        Some(corners) if corners.len() != n => bad(format!("{} corner vertices for a polygon of {n} corners", corners.len())),
        _ => Ok(()),
    }
}

/// Checks that a vertex is a local one of the patch.
pub(super) fn check_vertex(patch: &Patch, vertex: u32, field: &str) -> Result<()> {
    if (vertex as usize) < patch.positions.len() {
        return Ok(());
    }
    Err(EngineError::bad_parameter(field, format!("a vertex is not among the {} of the patch", patch.positions.len())))
}
