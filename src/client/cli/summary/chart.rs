//! Charts and their specs in words.

use super::{count, line};
use crate::error::Short;
use crate::v1;

pub(crate) fn chart_method_name(method: v1::ChartMethod) -> &'static str {
    match method {
        v1::ChartMethod::Unspecified | v1::ChartMethod::Automatic => "auto",
        v1::ChartMethod::SpectralConformal => "spectral",
        v1::ChartMethod::LeastSquaresConformal => "lscm",
        v1::ChartMethod::MeanValue => "mean-value",
        v1::ChartMethod::Harmonic => "harmonic",
        v1::ChartMethod::Barycentric => "barycentric",
    }
}

pub(crate) fn hole_name(holes: v1::HoleTreatment) -> &'static str {
    match holes {
        v1::HoleTreatment::Unspecified | v1::HoleTreatment::Automatic => "auto",
        v1::HoleTreatment::Open => "open",
        v1::HoleTreatment::CentreVertex => "centre",
        v1::HoleTreatment::MeanPlane => "plane",
    }
}

pub(crate) fn pin_choice_name(choice: v1::PinChoice) -> &'static str {
    match choice {
        v1::PinChoice::Unspecified | v1::PinChoice::Automatic => "auto",
        v1::PinChoice::Farthest => "farthest",
        v1::PinChoice::Inertia => "inertia",
    }
}

/// Methods of the charts, in words: `12 spectral, 1 mean-value`.
pub(crate) fn chart_methods(charts: &[v1::ChartSummary]) -> String {
    let methods = [
        v1::ChartMethod::SpectralConformal,
        v1::ChartMethod::LeastSquaresConformal,
        v1::ChartMethod::MeanValue,
        v1::ChartMethod::Harmonic,
        v1::ChartMethod::Barycentric,
    ];
    let number = |method| charts.iter().filter(|chart| chart.method() == method).count();
    let used = methods.into_iter().map(|m| (number(m), chart_method_name(m))).filter(|(n, _)| *n > 0);
    used.map(|(n, name)| format!("{n} {name}")).collect::<Vec<_>>().join(", ")
}

fn vertices(listed: &[u32]) -> String {
    let shown: Vec<String> = listed.iter().take(6).map(u32::to_string).collect();
    let more = if listed.len() > 6 { format!(", ... ({} in all)", listed.len()) } else { String::new() };
    shown.join(", ") + &more
}

/// What a map was made under: filling and pins.
fn conditions(attempt: &v1::ChartAttempt) -> String {
    let filling = attempt.filling.unwrap_or_default();
    let mut text = format!("holes {}", hole_name(filling.holes()));
    if filling.ears {
        text += ", notches bridged";
    }
    if !attempt.pins.is_empty() {
        text += &format!(", pins {}", vertices(&attempt.pins));
    }
    text
}

fn checks(attempt: &v1::ChartAttempt) -> String {
    let flips = match (attempt.flipped_before, attempt.flipped) {
        (0, 0) => "no flips".to_owned(),
        (before, after) => format!("{} before repair, {after} after", count(before.into(), "flip", "flips")),
    };
    format!("{flips}, {}", if attempt.overlaps { "OVERLAPS" } else { "no overlap" })
}

/// A chart in three lines and one for each attempt that failed.
pub(crate) fn chart(chart: &v1::ChartSummary) -> String {
    let last = chart.attempts.last();
    let size = format!("{}, {}", count(chart.faces, "face", "faces"), count(chart.vertices, "vertex", "vertices"));
    let own = if chart.origin() == v1::ChartSpecOrigin::Patch { " (spec of its own)" } else { "" };
    let under = last.map(|attempt| format!(", {}", conditions(attempt))).unwrap_or_default();
    let method = chart_method_name(chart.method());
    let mut text = line(&format!("patch {}", chart.patch), format!("{size}: {method}{own}{under}"));
    text += &last.map(|attempt| line("", checks(attempt))).unwrap_or_default();
    let d = chart.distortion.unwrap_or_default();
    let spread = |s: Option<v1::Spread>| {
        let s = s.unwrap_or_default();
        format!("{} {} {}", Short(s.min), Short(s.mean), Short(s.max))
    };
    // Numbers of a map that does not exist would only mislead.
    if d.angle.is_some_and(|s| s.max > 0.0) {
        let told = format!("angle {}, area {}, stretch {} (min, mean, max)", spread(d.angle), spread(d.area), spread(d.stretch));
        text += &line("", told);
    }
    for attempt in chart.attempts.iter().filter(|attempt| !attempt.rejected.is_empty()) {
        let method = chart_method_name(attempt.method());
        text += &line("", format!("{method} ({}) was tried: {}", conditions(attempt), attempt.rejected));
    }
    text
}

/// A spec: `lscm, holes auto, pins 3 to (0, 1), 9 to (1, 1)`.
pub(crate) fn chart_spec(spec: &v1::ChartSpec) -> String {
    let mut text = format!("{}, holes {}", chart_method_name(spec.method()), hole_name(spec.holes()));
    if let Some(vertex) = spec.outer_vertex {
        text += &format!(", outer loop through {vertex}");
    }
    if let Some(pins) = &spec.pins {
        let pin = |p: &v1::Pin| match p.target {
            Some(t) => format!("{} to ({}, {})", p.vertex, Short(t.u), Short(t.v)),
            None => p.vertex.to_string(),
        };
        let given: Vec<String> = pins.given.iter().take(6).map(pin).collect();
        let more = if pins.given.len() > 6 { format!(", ... ({} in all)", pins.given.len()) } else { String::new() };
        text += &match given.as_slice() {
            [] => format!(", pins {}", pin_choice_name(pins.choice())),
            _ => format!(", pins {}{more}", given.join(", ")),
        };
    }
    if let Some(boundary) = &spec.boundary {
        text += &format!(", boundary {}", curve(boundary));
    }
    text
}

fn curve(boundary: &v1::BoundarySpec) -> String {
    use v1::boundary_shape::Shape;
    let cornered =
        |name: String, corners: &[u32]| if corners.is_empty() { name } else { format!("{name} with corners {}", vertices(corners)) };
    let mut text = match boundary.shape.as_ref().and_then(|s| s.shape.as_ref()) {
        None | Some(Shape::Circle(_)) => "circle".to_owned(),
        Some(Shape::MeanPlane(_)) => "mean-plane".to_owned(),
        Some(Shape::Ellipse(e)) => format!("ellipse:{}", Short(e.ratio)),
        Some(Shape::Rectangle(r)) => {
            cornered(r.ratio.map_or("rectangle".into(), |ratio| format!("rectangle:{}", Short(ratio))), &r.corners)
        }
        Some(Shape::Polygon(p)) => cornered(format!("polygon of {}", p.points.len()), &p.corners),
    };
    if boundary.spacing() == v1::BoundarySpacing::Chord {
        text += ", spaced by chords";
    }
    if let Some(vertex) = boundary.start_vertex {
        text += &format!(", from vertex {vertex}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_tells_method_conditions_and_checks() {
        let failed = v1::ChartAttempt {
            method: v1::ChartMethod::SpectralConformal.into(),
            rejected: "3 flipped faces".into(),
            flipped: 3,
            flipped_before: 9,
            ..Default::default()
        };
        let filling = Some(v1::ChartFilling { holes: v1::HoleTreatment::MeanPlane.into(), ears: true });
        let taken = v1::ChartAttempt {
            method: v1::ChartMethod::LeastSquaresConformal.into(),
            pins: vec![4, 99],
            flipped_before: 2,
            filling,
            ..Default::default()
        };
        let distortion = v1::Distortion { angle: Some(v1::Spread { min: 1.0, mean: 1.25, max: 4.0 }), ..Default::default() };
        let summary = v1::ChartSummary {
            patch: 7,
            method: taken.method,
            attempts: vec![failed, taken],
            faces: 1,
            distortion: Some(distortion),
            ..Default::default()
        };
        let text = chart(&summary);
        for part in [
            "patch 7   1 face,",
            "lscm, holes plane, notches bridged, pins 4, 99",
            "2 flips before repair, 0 after, no overlap",
            "angle 1 1.25 4",
            "was tried: 3 flipped faces",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn a_spec_is_told_with_its_conditions() {
        let target = Some(v1::PlanePoint { u: 0.0, v: -1.5 });
        let pins = v1::PinSpec { choice: 0, given: vec![v1::Pin { vertex: 3, target }, v1::Pin { vertex: 9, target: None }] };
        let lscm = v1::ChartSpec { method: v1::ChartMethod::LeastSquaresConformal.into(), pins: Some(pins), ..Default::default() };
        assert_eq!(chart_spec(&lscm), "lscm, holes auto, pins 3 to (0, -1.5), 9");
        assert_eq!(chart_spec(&v1::ChartSpec::default()), "auto, holes auto");
    }
}
