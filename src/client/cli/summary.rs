//! Summaries for people. Pure functions from messages to text, so that they can be tested.

mod chart;

pub(crate) use chart::{chart, chart_method_name, chart_methods, chart_spec, hole_name, pin_choice_name};

use super::stages::{self, Group};
use crate::error::{Place, Short};
use crate::v1;
use std::fmt::Write;

/// A line `label  text`, the label in a column of its own.
pub(crate) fn line(label: &str, text: impl std::fmt::Display) -> String {
    format!("{label:<9} {text}\n")
}

/// A count with its noun: `1 patch`, `12,345 patches`.
pub(crate) fn count(n: u64, one: &str, many: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { one } else { many })
}

/// Digits in groups of three.
pub(crate) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `3.4 MB`.
pub(crate) fn size(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["bytes", "kB", "MB", "GB", "TB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < UNITS.len() {
        value /= 1000.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} bytes") } else { format!("{value:.1} {}", UNITS[unit]) }
}

pub(crate) fn seconds(milliseconds: f64) -> String {
    if milliseconds < 1000.0 { format!("{milliseconds:.0} ms") } else { format!("{:.2} s", milliseconds / 1000.0) }
}

pub(crate) fn unit_name(unit: v1::LengthUnit) -> Option<&'static str> {
    match unit {
        v1::LengthUnit::Unspecified => None,
        v1::LengthUnit::Metre => Some("m"),
        v1::LengthUnit::Centimetre => Some("cm"),
        v1::LengthUnit::Millimetre => Some("mm"),
        v1::LengthUnit::Micrometre => Some("um"),
        v1::LengthUnit::Inch => Some("inch"),
        v1::LengthUnit::Foot => Some("foot"),
    }
}

/// Vertices, triangles, regions and unit of a mesh.
pub(crate) fn mesh(mesh: &v1::MeshSummary) -> String {
    let mut text = format!("{}, {}", count(mesh.vertices, "vertex", "vertices"), count(mesh.faces, "triangle", "triangles"));
    if mesh.regions.len() > 1 || mesh.regions.iter().any(|region| !region.name.is_empty()) {
        let names: Vec<String> = mesh.regions.iter().take(6).map(region_name).collect();
        let more = if mesh.regions.len() > 6 { ", ..." } else { "" };
        let _ = write!(text, ", {} ({}{more})", count(mesh.regions.len() as u64, "region", "regions"), names.join(", "));
    }
    match unit_name(mesh.unit()) {
        Some(unit) => text + ", unit " + unit,
        None => text + ", unit not stated",
    }
}

pub(crate) fn region_name(region: &v1::Region) -> String {
    if region.name.is_empty() { region.id.to_string() } else { region.name.clone() }
}

/// What was done while reading: the file's numbers, then every change with its count.
pub(crate) fn import(name: &str, report: &v1::ImportReport, surface: &v1::MeshSummary) -> String {
    let source = if report.format.is_empty() { name.to_owned() } else { format!("{name} ({})", report.format) };
    let mut text = line("read", format!("{source}: {}", mesh(surface)));
    let changes = [
        (report.vertices_welded, "vertex welded", "vertices welded"),
        (report.duplicate_faces_dropped, "duplicate face dropped", "duplicate faces dropped"),
        (report.degenerate_faces_dropped, "face of zero area dropped", "faces of zero area dropped"),
        (report.unused_vertices_dropped, "unused vertex dropped", "unused vertices dropped"),
        (report.faces_flipped, "face turned", "faces turned"),
        (report.vertices_split, "vertex split", "vertices split"),
    ];
    let done: Vec<String> = changes.iter().filter(|(n, ..)| *n > 0).map(|(n, one, many)| count(*n, one, many)).collect();
    if !done.is_empty() {
        text += &line("", done.join(", "));
    }
    text
}

/// Components, genus and boundary loops.
pub(crate) fn topology(topology: &v1::TopologyNumbers) -> String {
    let genus = topology.genus.map(|genus| format!(", genus {genus}")).unwrap_or_default();
    let components = count(topology.components.into(), "component", "components");
    format!("{components}{genus}, {}", count(topology.boundary_loops.into(), "boundary loop", "boundary loops"))
}

/// The worth of the elements, in three lines.
pub(crate) fn shape(shape: &v1::ShapeQuality) -> String {
    let kappa = format!("min {:.3}, mean {:.3}, first percentile {:.3}", shape.kappa_min, shape.kappa_mean, shape.kappa_p01);
    let angles = format!("min {:.1}, mean of smallest {:.1}, max {:.1} degrees", shape.min_angle, shape.mean_min_angle, shape.max_angle);
    let mut text = line("kappa", kappa) + &line("angles", angles);
    if let Some(tau) = shape.tau {
        let ratio = shape.edge_ratio_ok.map(|ok| format!(" ({:.1} % of the edges near their size)", 100.0 * ok)).unwrap_or_default();
        text += &line("tau", format!("{tau:.1} %{ratio}"));
    }
    text
}

/// The worth of quadrangles, where there are any; the halves of quadrangles say little.
pub(crate) fn elements(triangles: Option<&v1::ShapeQuality>, quads: Option<&v1::QuadQuality>) -> String {
    let Some(quads) = quads else { return triangles.map(shape).unwrap_or_default() };
    let counts = count(quads.quads, "quadrangle", "quadrangles") + ", " + &count(quads.triangles, "triangle", "triangles");
    let eta = format!("min {:.3}, mean {:.3}, first percentile {:.3}", quads.eta_min, quads.eta_mean, quads.eta_p01);
    let mut text = line("quads", counts) + &line("eta", eta);
    if let Some(tau) = quads.tau {
        let ratio = quads.edge_ratio_ok.map(|ok| format!(" ({:.1} % of the edges near their size)", 100.0 * ok)).unwrap_or_default();
        text += &line("tau", format!("{tau:.1} %{ratio}"));
    }
    text
}

/// Elements at seams and away from them, one line each; nothing where there is no seam.
fn seams(quality: &v1::SeamQuality) -> String {
    let part = |part: v1::PartQuality| {
        let tau = part.tau.map_or("-".to_owned(), |tau| format!("{tau:.1} %"));
        let below = format!("{:.2} % below 0.5, {:.1} % below 0.8", 100.0 * part.below_half, 100.0 * part.below_four_fifths);
        format!("kappa min {:.3}, mean {:.4}, {below}, tau {tau} ({})", part.kappa_min, part.kappa_mean, grouped(part.triangles))
    };
    let (before, after) = (quality.before.unwrap_or_default(), quality.after.unwrap_or_default());
    let Some(seam) = after.seam.filter(|seam| seam.triangles > 0) else { return String::new() };
    let mut text = line("seams", part(seam));
    if let Some(interior) = after.interior.filter(|interior| interior.triangles > 0) {
        text += &line("interior", part(interior));
    }
    if let Some(seam) = before.seam.filter(|seam| seam.triangles > 0) {
        text += &line("", format!("seams before the optimisation: {}", part(seam)));
    }
    text
}

/// Distances, topology, seams and intersections of a report; the elements are in [`shape`].
pub(crate) fn quality(report: &v1::QualityReport) -> String {
    let mut text = report.seams.as_ref().map(seams).unwrap_or_default();
    if let Some(fidelity) = &report.fidelity {
        let percent = |value: f64| format!("{:.4} %", 100.0 * value);
        let (max, rms) = (percent(fidelity.hausdorff_max_rel), percent(fidelity.hausdorff_rms_rel));
        text += &line("distance", format!("max {max}, rms {rms} of the diagonal {}", Short(fidelity.diagonal)));
        if let Some(boundary) = fidelity.boundary_deviation_rel {
            text += &line("boundary", format!("moved by at most {} of the diagonal", percent(boundary)));
        }
        text += &line("area", format!("{:+.3} %", 100.0 * (fidelity.area_ratio - 1.0)));
    }
    if let (Some(before), Some(after)) = (&report.topology_input, &report.topology_output) {
        let verdict = if report.topology_kept { "kept".to_owned() } else { format!("CHANGED; it was {}", topology(before)) };
        text += &line("topology", format!("{} ({verdict})", topology(after)));
    }
    if let Some(pairs) = report.self_intersections {
        text += &line("crossings", if pairs == 0 { "none".into() } else { count(pairs, "pair of faces", "pairs of faces") });
        for pair in report.intersecting_pairs.iter().take(5) {
            text += &line("", format!("face {} crosses face {}", pair.first, pair.second));
        }
    }
    text
}

pub(crate) fn defect_name(defect: v1::Defect) -> (&'static str, &'static str) {
    match defect {
        v1::Defect::Unspecified => ("defect of an unknown kind", "defects of an unknown kind"),
        v1::Defect::NonManifoldEdge => ("edge with more than two faces", "edges with more than two faces"),
        v1::Defect::NonManifoldVertex => ("vertex with more than one fan of faces", "vertices with more than one fan of faces"),
        v1::Defect::NotOrientable => ("edge that no orientation suits", "edges that no orientation suits"),
        v1::Defect::FlippedFace => ("face against its neighbours", "faces against their neighbours"),
        v1::Defect::DegenerateFace => ("face of nearly zero area", "faces of nearly zero area"),
        v1::Defect::DuplicateFace => ("duplicate face", "duplicate faces"),
        v1::Defect::Sliver => ("sliver (kappa below 0.1)", "slivers (kappa below 0.1)"),
        v1::Defect::Hole => ("hole or open boundary", "holes or open boundaries"),
        v1::Defect::Component => ("further component", "further components"),
        v1::Defect::NonFinite => ("coordinate that is not finite", "coordinates that are not finite"),
        v1::Defect::SelfIntersection => ("pair of faces that intersect", "pairs of faces that intersect"),
    }
}

/// One kind of defect with its first places.
pub(crate) fn finding(finding: &v1::Finding, places: usize) -> String {
    let (one, many) = defect_name(finding.defect());
    let mut text =
        format!("  {}{}", count(finding.count, one, many), if finding.prevents_remeshing { "  <- prevents remeshing" } else { "" });
    for location in finding.locations.iter().take(places) {
        let _ = write!(text, "\n    {}", Place::from(location));
    }
    let rest = finding.count.saturating_sub(finding.locations.len().min(places) as u64);
    if rest > 0 && places > 0 && !finding.locations.is_empty() {
        let _ = write!(text, "\n    and {} more", grouped(rest));
    }
    text
}

/// A whole diagnosis.
pub(crate) fn diagnosis(diagnosis: &v1::Diagnosis, places: usize) -> String {
    let mut text = String::new();
    if let Some(numbers) = &diagnosis.topology {
        text += &line("surface", format!("{}, area {}", topology(numbers), Short(diagnosis.area)));
    }
    if let (Some(low), Some(high)) = (&diagnosis.low, &diagnosis.high) {
        let corner = |p: &v1::Point| format!("({}, {}, {})", Short(p.x), Short(p.y), Short(p.z));
        text += &line("box", format!("{} to {}", corner(low), corner(high)));
    }
    if diagnosis.findings.is_empty() {
        text += &line("found", "nothing wrong");
    } else {
        text += &line("found", "");
        diagnosis.findings.iter().for_each(|f| text += &(finding(f, places) + "\n"));
    }
    text + &line("verdict", if diagnosis.remeshable { "can be remeshed" } else { "cannot be remeshed" })
}

/// Time by group of stages, and what the cache spared.
pub(crate) fn work(milliseconds: f64, groups: &[Group]) -> String {
    let spent: Vec<String> = groups.iter().filter(|g| g.runs > 0).map(|g| format!("{} {}", g.name, seconds(g.milliseconds))).collect();
    let detail = if spent.is_empty() { String::new() } else { format!(" ({})", spent.join(", ")) };
    let (hits, runs) = (groups.iter().map(|g| g.hits).sum::<u64>(), groups.iter().map(|g| g.runs).sum::<u64>());
    let cached: Vec<String> =
        groups.iter().filter(|g| g.hits > 0).map(|g| format!("{} {} of {}", g.name, g.hits, g.hits + g.runs)).collect();
    let cache = match hits {
        0 => "nothing was cached".to_owned(),
        _ => format!("{hits} of {} steps were cached ({})", hits + runs, cached.join(", ")),
    };
    line("time", format!("{}{detail}", seconds(milliseconds))) + &line("cache", cache)
}

/// The same for the summary of one call.
pub(crate) fn run(summary: &v1::RunSummary) -> String {
    work(summary.milliseconds, &stages::groups(&summary.stages))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!(["1", "999", "1,000", "1,234,567"], [1, 999, 1000, 1_234_567].map(grouped)[..]);
        assert_eq!([size(12), size(3_400_000)], ["12 bytes", "3.4 MB"]);
        assert_eq!([seconds(12.4), seconds(1234.0)], ["12 ms", "1.23 s"]);
        assert_eq!([count(1, "patch", "patches"), count(0, "patch", "patches")], ["1 patch", "0 patches"]);
    }

    #[test]
    fn an_import_tells_every_change_with_its_count() {
        let report = v1::ImportReport {
            format: "STL binary".into(),
            vertices_welded: 59_994,
            degenerate_faces_dropped: 1,
            faces_flipped: 3,
            ..Default::default()
        };
        let surface = v1::MeshSummary {
            vertices: 10_002,
            faces: 20_000,
            regions: vec![v1::Region { id: 1, name: "inlet".into() }, v1::Region { id: 2, name: String::new() }],
            ..Default::default()
        };
        let text = import("a.stl", &report, &surface);
        assert_eq!(
            text,
            "read      a.stl (STL binary): 10,002 vertices, 20,000 triangles, 2 regions (inlet, 2), unit not stated\n\
             \x20         59,994 vertices welded, 1 face of zero area dropped, 3 faces turned\n"
        );
    }

    #[test]
    fn quality_names_what_changed() {
        let before = v1::TopologyNumbers { components: 1, genus: Some(2), boundary_loops: 0, ..Default::default() };
        let after = v1::TopologyNumbers { components: 2, genus: Some(1), boundary_loops: 1, ..Default::default() };
        let report = v1::QualityReport {
            topology_input: Some(before),
            topology_output: Some(after),
            self_intersections: Some(1),
            intersecting_pairs: vec![v1::FacePair { first: 4, second: 9 }],
            fidelity: Some(v1::Fidelity { diagonal: 10.0, hausdorff_max_rel: 0.005, area_ratio: 0.999, ..Default::default() }),
            ..Default::default()
        };
        let text = quality(&report);
        assert!(text.contains("2 components, genus 1, 1 boundary loop (CHANGED; it was 1 component, genus 2, 0 boundary loops)"), "{text}");
        assert!(text.contains("1 pair of faces") && text.contains("face 4 crosses face 9"), "{text}");
        assert!(text.contains("max 0.5000 %") && text.contains("-0.100 %"), "{text}");
    }

    #[test]
    fn a_diagnosis_counts_the_places_it_leaves_out() {
        let location = v1::Location { element: v1::ElementKind::Face.into(), ids: vec![7], position: None };
        let slivers = v1::Finding { defect: v1::Defect::Sliver.into(), count: 250, locations: vec![location; 100], ..Default::default() };
        let text = diagnosis(&v1::Diagnosis { findings: vec![slivers], remeshable: true, ..Default::default() }, 3);
        assert_eq!(text.matches("face 7").count(), 3);
        assert!(text.contains("250 slivers") && text.contains("and 247 more") && text.contains("can be remeshed"), "{text}");
    }
}
