//! Charts on the wire: specs in both directions, the parts of a spec that a field mask names, and what is told of a chart.

use super::from_proto::known;
use crate::status::geometry_locations;
use prost_types::FieldMask;
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result};
use remesh_engine::parametrize::{
    Boundary, BoundaryShape, ChartAttempt, ChartMethod, ChartSpec, Distortion, Filling, HoleFilling, Holes, OuterLoop, Pin, Pins, Spacing,
    Spread,
};
use remesh_engine::patch::PatchMap;
use remesh_engine::pipeline::SpecOf;
use remesh_proto::v1;

/// Which charts. Field names in errors have no prefix: see [`within`].
pub(crate) fn spec(from: &v1::ChartSpec) -> Result<ChartSpec> {
    Ok(ChartSpec {
        method: method(from.method)?,
        outer: from.outer_vertex.map_or(OuterLoop::Longest, OuterLoop::Through),
        holes: match known(from.holes, "holes")? {
            v1::HoleTreatment::Unspecified | v1::HoleTreatment::Automatic => Holes::Automatic,
            v1::HoleTreatment::Open => Holes::Open,
            v1::HoleTreatment::CentreVertex => Holes::CentreVertex,
            v1::HoleTreatment::MeanPlane => Holes::MeanPlane,
        },
        pins: from.pins.as_ref().map_or(Ok(Pins::default()), pins)?,
        boundary: from.boundary.as_ref().map_or(Ok(Boundary::default()), boundary)?,
    })
}

fn method(number: i32) -> Result<Option<ChartMethod>> {
    Ok(match known(number, "method")? {
        v1::ChartMethod::Unspecified | v1::ChartMethod::Automatic => None,
        v1::ChartMethod::SpectralConformal => Some(ChartMethod::SpectralConformal),
        v1::ChartMethod::LeastSquaresConformal => Some(ChartMethod::LeastSquaresConformal),
        v1::ChartMethod::MeanValue => Some(ChartMethod::MeanValue),
        v1::ChartMethod::Harmonic => Some(ChartMethod::Harmonic),
        v1::ChartMethod::Barycentric => Some(ChartMethod::Barycentric),
    })
}

fn pins(from: &v1::PinSpec) -> Result<Pins> {
    let choice: v1::PinChoice = known(from.choice, "pins.choice")?;
    if !from.given.is_empty() {
        if choice != v1::PinChoice::Unspecified {
            return Err(EngineError::bad_parameter("pins.choice", "pins are given, so there is nothing to choose"));
        }
        let pin = |p: &v1::Pin| Pin { vertex: p.vertex, target: p.target.map(|t| [t.u, t.v]) };
        return Ok(Pins::Given(from.given.iter().map(pin).collect()));
    }
    Ok(match choice {
        v1::PinChoice::Unspecified | v1::PinChoice::Automatic => Pins::Automatic,
        v1::PinChoice::Farthest => Pins::Farthest,
        v1::PinChoice::Inertia => Pins::Inertia,
    })
}

fn boundary(from: &v1::BoundarySpec) -> Result<Boundary> {
    Ok(Boundary {
        shape: from.shape.as_ref().and_then(|s| s.shape.as_ref()).map_or(Ok(BoundaryShape::default()), shape)?,
        spacing: match known(from.spacing, "boundary.spacing")? {
            v1::BoundarySpacing::Unspecified | v1::BoundarySpacing::ArcLength => Spacing::ArcLength,
            v1::BoundarySpacing::Chord => Spacing::Chord,
        },
        start: from.start_vertex,
    })
}

fn shape(from: &v1::boundary_shape::Shape) -> Result<BoundaryShape> {
    use v1::boundary_shape::Shape;
    Ok(match from {
        Shape::Circle(_) => BoundaryShape::Circle,
        Shape::MeanPlane(_) => BoundaryShape::MeanPlane,
        Shape::Ellipse(ellipse) => BoundaryShape::Ellipse { ratio: ellipse.ratio },
        Shape::Rectangle(rectangle) => BoundaryShape::Rectangle {
            ratio: rectangle.ratio,
            corners: match rectangle.corners.as_slice() {
                [] => None,
                &[a, b, c, d] => Some([a, b, c, d]),
                listed => {
                    let message = format!("a rectangle has four corners, {} vertices were given", listed.len());
                    return Err(EngineError::bad_parameter("boundary.shape.rectangle.corners", message));
                }
            },
        },
        Shape::Polygon(polygon) => BoundaryShape::Polygon {
            points: polygon.points.iter().map(|p| [p.u, p.v]).collect(),
            corners: (!polygon.corners.is_empty()).then(|| polygon.corners.clone()),
        },
    })
}

/// The same error with the field it names inside of `field`.
pub(crate) fn within(field: &str, error: EngineError) -> EngineError {
    let inner = error.metadata().iter().find(|(key, _)| key == "field").map(|(_, name)| name.clone());
    if !matches!(error.reason(), Reason::BadParameter | Reason::NonFinite) || inner.as_ref().is_some_and(|name| name.starts_with(field)) {
        return error;
    }
    let path = inner.map_or_else(|| field.to_owned(), |name| format!("{field}.{name}"));
    let others = error.metadata().iter().filter(|(key, _)| key != "field");
    let told = EngineError::new(error.reason(), error.message()).with_hint(error.hint()).with_locations(error.locations().iter().cloned());
    others.fold(told.with_metadata("field", path), |told, (key, value)| told.with_metadata(key, value))
}

/// A spec on the wire, defaults filled in. Reading it back gives the same spec.
pub(crate) fn wire(spec: &ChartSpec) -> v1::ChartSpec {
    let outer_vertex = match spec.outer {
        OuterLoop::Longest => None,
        OuterLoop::Through(vertex) => Some(vertex),
    };
    let holes = match spec.holes {
        Holes::Automatic => v1::HoleTreatment::Automatic,
        Holes::Open => v1::HoleTreatment::Open,
        Holes::CentreVertex => v1::HoleTreatment::CentreVertex,
        Holes::MeanPlane => v1::HoleTreatment::MeanPlane,
    };
    v1::ChartSpec {
        method: spec.method.map_or(v1::ChartMethod::Automatic, wire_method).into(),
        outer_vertex,
        holes: holes.into(),
        pins: (spec.method == Some(ChartMethod::LeastSquaresConformal)).then(|| wire_pins(&spec.pins)),
        boundary: spec.method.is_some_and(ChartMethod::has_fixed_boundary).then(|| wire_boundary(&spec.boundary)),
    }
}

fn wire_method(method: ChartMethod) -> v1::ChartMethod {
    match method {
        ChartMethod::SpectralConformal => v1::ChartMethod::SpectralConformal,
        ChartMethod::LeastSquaresConformal => v1::ChartMethod::LeastSquaresConformal,
        ChartMethod::MeanValue => v1::ChartMethod::MeanValue,
        ChartMethod::Harmonic => v1::ChartMethod::Harmonic,
        ChartMethod::Barycentric => v1::ChartMethod::Barycentric,
    }
}

fn plane_point([u, v]: [f64; 2]) -> v1::PlanePoint {
    v1::PlanePoint { u, v }
}

fn wire_pins(pins: &Pins) -> v1::PinSpec {
    let chosen = |choice: v1::PinChoice| v1::PinSpec { choice: choice.into(), given: Vec::new() };
    match pins {
        Pins::Automatic => chosen(v1::PinChoice::Automatic),
        Pins::Farthest => chosen(v1::PinChoice::Farthest),
        Pins::Inertia => chosen(v1::PinChoice::Inertia),
        Pins::Given(pins) => {
            let pin = |p: &Pin| v1::Pin { vertex: p.vertex, target: p.target.map(plane_point) };
            v1::PinSpec { choice: v1::PinChoice::Unspecified.into(), given: pins.iter().map(pin).collect() }
        }
    }
}

fn wire_boundary(boundary: &Boundary) -> v1::BoundarySpec {
    use v1::boundary_shape::Shape;
    let shape = match &boundary.shape {
        BoundaryShape::Circle => Shape::Circle(v1::CircleShape {}),
        BoundaryShape::MeanPlane => Shape::MeanPlane(v1::MeanPlaneShape {}),
        BoundaryShape::Ellipse { ratio } => Shape::Ellipse(v1::EllipseShape { ratio: *ratio }),
        BoundaryShape::Rectangle { ratio, corners } => {
            Shape::Rectangle(v1::RectangleShape { ratio: *ratio, corners: corners.map_or_else(Vec::new, |c| c.to_vec()) })
        }
        BoundaryShape::Polygon { points, corners } => Shape::Polygon(v1::PolygonShape {
            points: points.iter().map(|&p| plane_point(p)).collect(),
            corners: corners.clone().unwrap_or_default(),
        }),
    };
    let spacing = match boundary.spacing {
        Spacing::ArcLength => v1::BoundarySpacing::ArcLength,
        Spacing::Chord => v1::BoundarySpacing::Chord,
    };
    v1::BoundarySpec { shape: Some(v1::BoundaryShape { shape: Some(shape) }), spacing: spacing.into(), start_vertex: boundary.start }
}

const PATHS: &str = "method, outer_vertex, holes, pins, boundary, boundary.shape, boundary.spacing, boundary.start_vertex or *";

/// `current` with the parts of `given` that the mask names; all of `given` without a mask.
pub(crate) fn merged(current: v1::ChartSpec, given: Option<v1::ChartSpec>, mask: Option<&FieldMask>) -> Result<v1::ChartSpec> {
    let given = given.ok_or_else(|| EngineError::bad_parameter("spec", "is required"))?;
    let paths = mask.map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() {
        return Ok(given);
    }
    let mut merged = current;
    let part = given.boundary.clone().unwrap_or_default();
    for path in paths {
        let boundary = &mut merged.boundary;
        match path.as_str() {
            "*" => merged = given.clone(),
            "method" => merged.method = given.method,
            "outer_vertex" => merged.outer_vertex = given.outer_vertex,
            "holes" => merged.holes = given.holes,
            "pins" => merged.pins = given.pins.clone(),
            "boundary" => *boundary = given.boundary.clone(),
            "boundary.shape" => boundary.get_or_insert_default().shape = part.shape.clone(),
            "boundary.spacing" => boundary.get_or_insert_default().spacing = part.spacing,
            "boundary.start_vertex" => boundary.get_or_insert_default().start_vertex = part.start_vertex,
            other => {
                let shown: String = other.chars().take(80).collect();
                return Err(EngineError::bad_parameter("update_mask", format!("`{shown}` is not a path of a chart spec: use {PATHS}")));
            }
        }
    }
    Ok(merged)
}

/// Whose spec a patch follows, and which.
pub(crate) fn origin(of: SpecOf<'_>) -> (v1::ChartSpecOrigin, &ChartSpec) {
    match of {
        SpecOf::Patch(spec) => (v1::ChartSpecOrigin::Patch, spec),
        SpecOf::Session(spec) => (v1::ChartSpecOrigin::Session, spec),
    }
}

/// What is told of a map of a patch, but for whose spec it follows.
pub(crate) fn summary(patch: u32, map: &PatchMap, attempts: &[ChartAttempt], distortion: &Distortion) -> v1::ChartSummary {
    let taken = attempts.last().map_or(v1::ChartMethod::Unspecified, |attempt| wire_method(attempt.method));
    v1::ChartSummary {
        patch,
        method: taken.into(),
        attempts: attempts.iter().map(|a| attempt(a, map)).collect(),
        distortion: Some(wire_distortion(distortion)),
        vertices: map.vertices.len() as u64,
        faces: map.faces.len() as u64,
        origin: v1::ChartSpecOrigin::Unspecified.into(),
    }
}

fn attempt(attempt: &ChartAttempt, map: &PatchMap) -> v1::ChartAttempt {
    v1::ChartAttempt {
        method: wire_method(attempt.method).into(),
        flipped: attempt.flipped,
        overlaps: attempt.overlaps,
        rejected: attempt.rejected.clone(),
        filling: Some(filling(attempt.filling)),
        pins: attempt.pins.iter().filter_map(|&local| map.named.get(local as usize).copied()).collect(),
        flipped_before: attempt.flipped_before,
    }
}

fn filling(filling: Filling) -> v1::ChartFilling {
    let holes = match filling.holes {
        HoleFilling::Open => v1::HoleTreatment::Open,
        HoleFilling::CentreVertex => v1::HoleTreatment::CentreVertex,
        HoleFilling::MeanPlane => v1::HoleTreatment::MeanPlane,
    };
    v1::ChartFilling { holes: holes.into(), ears: filling.ears }
}

fn wire_distortion(d: &Distortion) -> v1::Distortion {
    let spread = |s: Spread| Some(v1::Spread { min: s.min, mean: s.mean, max: s.max });
    v1::Distortion {
        angle_mean: d.angle.mean,
        angle_max: d.angle.max,
        area_min: d.area.min,
        area_max: d.area.max,
        angle: spread(d.angle),
        area: spread(d.area),
        stretch: spread(d.stretch),
    }
}

/// What is wrong with the spec of a patch.
pub(crate) fn error(patch: u32, error: &EngineError) -> v1::ChartError {
    v1::ChartError { patch, reason: error.reason().code().to_owned(), message: error.to_string(), locations: geometry_locations(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn specs() -> Vec<ChartSpec> {
        let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let shapes = [
            BoundaryShape::Circle,
            BoundaryShape::MeanPlane,
            BoundaryShape::Ellipse { ratio: 2.5 },
            BoundaryShape::Rectangle { ratio: None, corners: Some([4, 0, 9, 2]) },
            BoundaryShape::Rectangle { ratio: Some(0.5), corners: None },
            BoundaryShape::Polygon { points: square.clone(), corners: None },
            BoundaryShape::Polygon { points: square, corners: Some(vec![0, 1, 2, 3]) },
        ];
        let mut specs: Vec<ChartSpec> = ChartMethod::ALL.map(ChartSpec::only).to_vec();
        specs.push(ChartSpec::default());
        for shape in shapes {
            let boundary = Boundary { shape, spacing: Spacing::Chord, start: Some(0) };
            specs.push(ChartSpec { boundary, outer: OuterLoop::Through(0), holes: Holes::Open, ..ChartSpec::only(ChartMethod::Harmonic) });
        }
        let given = Pins::Given(vec![Pin { vertex: 0, target: Some([0.0, -1.5]) }, Pin { vertex: 7, target: None }]);
        for (pins, holes) in [(Pins::Farthest, Holes::MeanPlane), (Pins::Inertia, Holes::CentreVertex), (given, Holes::Automatic)] {
            specs.push(ChartSpec { pins, holes, ..ChartSpec::only(ChartMethod::LeastSquaresConformal) });
        }
        specs
    }

    #[test]
    fn every_spec_goes_round() {
        for expected in specs() {
            assert_eq!(spec(&wire(&expected)), Ok(expected));
        }
        assert_eq!(spec(&v1::ChartSpec::default()), Ok(ChartSpec::default()));
    }

    #[test]
    fn a_mask_names_what_changes() {
        let current = wire(&specs()[8]);
        let given = v1::ChartSpec { method: v1::ChartMethod::MeanValue.into(), ..Default::default() };
        let with = |paths: &[&str]| {
            let mask = FieldMask { paths: paths.iter().map(|p| (*p).to_owned()).collect() };
            merged(current.clone(), Some(given.clone()), Some(&mask))
        };
        let method = with(&["method"]).expect("known");
        assert_eq!(method, v1::ChartSpec { method: given.method, ..current.clone() });
        let shape = with(&["boundary.shape"]).expect("known").boundary.expect("kept");
        assert_eq!((shape.shape, shape.start_vertex), (None, Some(0)), "not set means default");
        assert_eq!(with(&["boundary", "outer_vertex"]).expect("known").boundary, None);
        assert_eq!((with(&[]), with(&["*"])), (Ok(given.clone()), Ok(given.clone())));
        for bad in ["boundry", "", "pins.given", "boundary.shape.circle", "Method"] {
            let error = with(&["method", bad]).expect_err(bad);
            assert!(error.message().contains(&format!("`{bad}`")), "{error}");
        }
        assert!(merged(current, None, None).is_err(), "a spec is required");
    }

    #[test]
    fn fields_are_named_inside_of_the_request() {
        let mut bad = wire(&specs()[1]);
        bad.pins = Some(v1::PinSpec { choice: v1::PinChoice::Inertia.into(), given: vec![v1::Pin::default()] });
        let field = |error: EngineError| error.metadata().iter().find(|(key, _)| key == "field").map(|(_, name)| name.clone());
        assert_eq!(field(within("spec", spec(&bad).expect_err("both"))).as_deref(), Some("spec.pins.choice"));
        bad.pins = Some(v1::PinSpec { given: vec![v1::Pin::default()], choice: 0 });
        let one = spec(&bad).expect("reads").validate().expect_err("one pin");
        assert_eq!(field(within("spec", one)).as_deref(), Some("spec.pins"));
        let other = EngineError::new(Reason::PatchNotFound, "no");
        assert_eq!(field(within("spec", other)), None);
    }
}
