//! Chart specs from options.

use crate::cli::args::{BoundaryCurve, ChartMethod, ChartSpecArgs, HoleChoice, OuterLoop, PinChoice, SpacingChoice};
use crate::cli::failure::{Failure, Outcome};
use crate::{ChartEdit, v1};
use v1::boundary_shape::Shape;

pub(crate) fn chart_method(method: ChartMethod) -> v1::ChartMethod {
    match method {
        ChartMethod::Auto => v1::ChartMethod::Automatic,
        ChartMethod::Spectral => v1::ChartMethod::SpectralConformal,
        ChartMethod::Lscm => v1::ChartMethod::LeastSquaresConformal,
        ChartMethod::MeanValue => v1::ChartMethod::MeanValue,
        ChartMethod::Harmonic => v1::ChartMethod::Harmonic,
        ChartMethod::Barycentric => v1::ChartMethod::Barycentric,
    }
}

/// Whether the options name vertices, so that they can only be meant for one patch.
pub(crate) fn names_vertices(args: &ChartSpecArgs) -> bool {
    let outer = matches!(args.outer, Some(OuterLoop::Through(_)));
    outer || !args.pins.is_empty() || !args.corners.is_empty() || args.start.is_some()
}

/// The parts of a spec that the options name. A method takes conditions with it that it does not have: who goes from LSCM to
/// spectral need not take the pins away by hand.
pub(crate) fn chart_edit(args: &ChartSpecArgs) -> Outcome<ChartEdit> {
    let mut edit = ChartEdit::default();
    let mut name = |path: &str| edit.paths.push(path.to_owned());
    let spec = &mut edit.spec;
    if let Some(method) = args.method {
        name("method");
        spec.set_method(chart_method(method));
        if method != ChartMethod::Lscm {
            name("pins");
        }
        if !matches!(method, ChartMethod::MeanValue | ChartMethod::Harmonic | ChartMethod::Barycentric) {
            name("boundary");
        }
    }
    if let Some(holes) = args.holes {
        name("holes");
        spec.set_holes(match holes {
            HoleChoice::Auto => v1::HoleTreatment::Automatic,
            HoleChoice::Open => v1::HoleTreatment::Open,
            HoleChoice::Centre => v1::HoleTreatment::CentreVertex,
            HoleChoice::Plane => v1::HoleTreatment::MeanPlane,
        });
    }
    if let Some(outer) = args.outer {
        name("outer_vertex");
        spec.outer_vertex = match outer {
            OuterLoop::Longest => None,
            OuterLoop::Through(vertex) => Some(vertex),
        };
    }
    if !args.pins.is_empty() || args.choice.is_some() {
        name("pins");
        spec.pins = Some(pins(args));
    }
    if args.boundary.is_some() || args.spacing.is_some() || args.start.is_some() {
        let boundary = spec.boundary.get_or_insert_default();
        if let Some(curve) = &args.boundary {
            name("boundary.shape");
            boundary.shape = Some(v1::BoundaryShape { shape: Some(shape(curve, &args.corners)?) });
        }
        if let Some(spacing) = args.spacing {
            name("boundary.spacing");
            boundary.set_spacing(match spacing {
                SpacingChoice::Arc => v1::BoundarySpacing::ArcLength,
                SpacingChoice::Chord => v1::BoundarySpacing::Chord,
            });
        }
        // Corners say where vertices go, so they take a start from before away.
        if args.start.is_some() || !args.corners.is_empty() {
            name("boundary.start_vertex");
            boundary.start_vertex = args.start;
        }
    }
    Ok(edit)
}

fn pins(args: &ChartSpecArgs) -> v1::PinSpec {
    let choice = args.choice.map_or(v1::PinChoice::Unspecified, |choice| match choice {
        PinChoice::Auto => v1::PinChoice::Automatic,
        PinChoice::Farthest => v1::PinChoice::Farthest,
        PinChoice::Inertia => v1::PinChoice::Inertia,
    });
    let point = |[u, v]: [f64; 2]| v1::PlanePoint { u, v };
    let given = args.pins.iter().map(|pin| v1::Pin { vertex: pin.vertex, target: pin.target.map(point) });
    v1::PinSpec { choice: choice.into(), given: given.collect() }
}

fn shape(curve: &BoundaryCurve, corners: &[u32]) -> Outcome<Shape> {
    let shape = match curve {
        BoundaryCurve::Rectangle(ratio) => Shape::Rectangle(v1::RectangleShape { ratio: *ratio, corners: corners.to_vec() }),
        BoundaryCurve::Polygon(points) => {
            let points = points.iter().map(|&[u, v]| v1::PlanePoint { u, v }).collect();
            Shape::Polygon(v1::PolygonShape { points, corners: corners.to_vec() })
        }
        _ if !corners.is_empty() => {
            return Err(Failure::Usage("--corner is for --boundary square, rectangle or polygon".into()));
        }
        BoundaryCurve::Circle => Shape::Circle(v1::CircleShape {}),
        BoundaryCurve::Ellipse(ratio) => Shape::Ellipse(v1::EllipseShape { ratio: *ratio }),
        BoundaryCurve::MeanPlane => Shape::MeanPlane(v1::MeanPlaneShape {}),
    };
    Ok(shape)
}

/// The spec of a session with the parts of an edit in it, as the daemon does it for the spec of a patch.
pub(crate) fn merged_chart(current: v1::ChartSpec, edit: ChartEdit) -> v1::ChartSpec {
    let mut merged = current;
    let ChartEdit { spec: given, paths } = edit;
    for path in &paths {
        let boundary = &mut merged.boundary;
        let part = given.boundary.clone().unwrap_or_default();
        match path.as_str() {
            "method" => merged.method = given.method,
            "holes" => merged.holes = given.holes,
            "outer_vertex" => merged.outer_vertex = given.outer_vertex,
            "pins" => merged.pins = given.pins.clone(),
            "boundary" => *boundary = given.boundary.clone(),
            "boundary.shape" => boundary.get_or_insert_default().shape = part.shape,
            "boundary.spacing" => boundary.get_or_insert_default().spacing = part.spacing,
            "boundary.start_vertex" => boundary.get_or_insert_default().start_vertex = part.start_vertex,
            _ => {}
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::PinArg;

    #[test]
    fn options_name_their_parts() {
        let args = ChartSpecArgs {
            pins: vec![PinArg { vertex: 4, target: Some([0.0, 1.0]) }, PinArg { vertex: 9, target: Some([1.0, 1.0]) }],
            holes: Some(HoleChoice::Plane),
            ..Default::default()
        };
        let edit = chart_edit(&args).expect("valid");
        assert_eq!(edit.paths, ["holes", "pins"]);
        assert_eq!(edit.spec.pins.map(|p| (p.given.len(), p.choice())), Some((2, v1::PinChoice::Unspecified)));
        assert!(names_vertices(&args) && !names_vertices(&ChartSpecArgs::default()));
        assert!(chart_edit(&ChartSpecArgs::default()).is_ok_and(|e| e.paths.is_empty()));
        let corners = ChartSpecArgs { boundary: Some(BoundaryCurve::Circle), corners: vec![1], ..Default::default() };
        assert!(chart_edit(&corners).is_err(), "a circle has no corners");
    }

    #[test]
    fn a_new_method_drops_what_it_does_not_have() {
        let harmonic = v1::BoundarySpec { spacing: v1::BoundarySpacing::Chord.into(), ..Default::default() };
        let before = v1::ChartSpec { method: v1::ChartMethod::Harmonic.into(), boundary: Some(harmonic), ..Default::default() };
        let to = |method| {
            merged_chart(before.clone(), chart_edit(&ChartSpecArgs { method: Some(method), ..Default::default() }).expect("valid"))
        };
        assert_eq!(to(ChartMethod::MeanValue).boundary, before.boundary);
        assert_eq!(to(ChartMethod::Lscm), v1::ChartSpec { method: v1::ChartMethod::LeastSquaresConformal.into(), ..Default::default() });
    }
}
