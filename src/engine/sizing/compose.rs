//! The least of a base and of all fields, clamped, limited in growth, and fitted to a number of triangles.

use super::check::slope;
use super::measure::Measured;
use super::place;
use super::spec::{ComposedSize, CurvatureSize, RegionChoice, SizeBase, SizeFieldSpec};
use super::{SizeField, SizeInput, expected, limit_growth, size_for_count};
use crate::error::{EngineError, Result};
use crate::vector::bounding_diagonal;
use crate::work::Work;
use std::f64::consts::TAU;

/// How close the expected number of triangles comes to the one asked for.
const COUNT_TOLERANCE: f64 = 0.002;
/// Bisections of the base length.
const BASE_STEPS: usize = 40;
/// Bisections of the factor on the fields, each of which limits the growth anew.
const FACTOR_STEPS: usize = 14;

/// Evaluates a composed field.
pub(super) fn composed(input: &SizeInput<'_>, spec: &ComposedSize, work: &Work<'_>) -> Result<SizeField> {
    let least = least_of_fields(input, spec, work)?;
    let slope = spec.growth_rate.map(|rate| slope("growth_rate", rate)).transpose()?;
    let (low, high) = (spec.min_size.unwrap_or(0.0), spec.max_size.unwrap_or(f64::INFINITY));
    let finished = |factor: f64, base: f64| -> Result<Vec<f64>> {
        let mut sizes: Vec<f64> = least.iter().map(|h| (h * factor).min(base).clamp(low, high)).collect();
        if let Some(slope) = slope {
            limit_growth(input.mesh, input.topology, &mut sizes, slope, work)?;
        }
        Ok(sizes)
    };
    let (vertex_size, fields_scaled_by) = match spec.base {
        SizeBase::Uniform(size) => (finished(1.0, size)?, 1.0),
        SizeBase::MaxSize => (finished(1.0, high)?, 1.0),
        SizeBase::Triangles(triangles) => fitted(input, triangles, [low, high], &finished)?,
    };
    Ok(SizeField { fields_scaled_by, ..SizeField::new(vertex_size) })
}

/// Bisects the base, or a factor on the fields if they alone ask for more triangles. Growth is limited but once for the base: it leaves
/// constants alone, so limiting the least of a field and a constant is the least of the limited field and the constant.
fn fitted(
    input: &SizeInput<'_>,
    triangles: u64,
    [low, high]: [f64; 2],
    finished: &dyn Fn(f64, f64) -> Result<Vec<f64>>,
) -> Result<(Vec<f64>, f64)> {
    let wanted = triangles as f64;
    let even = size_for_count("triangles", input, triangles)?.clamp(low, high);
    let widest = high.min(bounding_diagonal(&input.mesh.positions).max(even));
    let fields = finished(1.0, high)?;
    let with_base = |base: f64| -> Vec<f64> { fields.iter().map(|h| h.min(base.clamp(low, high))).collect() };
    if expected(input, &with_base(widest)) <= wanted * (1.0 + COUNT_TOLERANCE) {
        let (mut fine, mut coarse) = (even, widest);
        for _ in 0..BASE_STEPS {
            let middle = (fine * coarse).sqrt();
            let count = expected(input, &with_base(middle));
            if (count / wanted - 1.0).abs() < COUNT_TOLERANCE {
                (fine, coarse) = (middle, middle);
                break;
            }
            *(if count > wanted { &mut fine } else { &mut coarse }) = middle;
        }
        return Ok((with_base((fine * coarse).sqrt()), 1.0));
    }
    let (mut fine, mut coarse) = (1.0, 2.0);
    let mut best = finished(coarse, widest)?;
    while expected(input, &best) > wanted && coarse < 1e6 {
        (fine, coarse) = (coarse, 2.0 * coarse);
        best = finished(coarse, widest)?;
    }
    for _ in 0..FACTOR_STEPS {
        let middle = f64::sqrt(fine * coarse);
        best = finished(middle, widest)?;
        let count = expected(input, &best);
        if (count / wanted - 1.0).abs() < COUNT_TOLERANCE {
            return Ok((best, middle));
        }
        *(if count > wanted { &mut fine } else { &mut coarse }) = middle;
    }
    Ok((best, (fine * coarse).sqrt()))
}

/// At each vertex the least length that a field asks for; infinite where none does.
fn least_of_fields(input: &SizeInput<'_>, spec: &ComposedSize, work: &Work<'_>) -> Result<Vec<f64>> {
    let mut least = vec![f64::INFINITY; input.mesh.positions.len()];
    for (i, field) in spec.fields.iter().enumerate() {
        work.check()?;
        let at = |name: &str| format!("fields[{i}].{}.{name}", field.name());
        let lengths = lengths_of(input, spec, i, field, &at, work)?;
        least.iter_mut().zip(lengths).for_each(|(h, own)| *h = h.min(own));
    }
    Ok(least)
}

fn lengths_of(
    input: &SizeInput<'_>,
    spec: &ComposedSize,
    number: usize,
    field: &SizeFieldSpec,
    at: &dyn Fn(&str) -> String,
    work: &Work<'_>,
) -> Result<Vec<f64>> {
    let count = input.mesh.positions.len();
    let measured = || -> Result<&Measured> {
        let found = input.measured.get(number).copied().flatten().filter(|m| m.value.len() == count);
        found.ok_or_else(|| EngineError::invariant(format!("the measure of size field {number} is missing")))
    };
    let in_proportion = |share: f64| -> Result<Vec<f64>> { Ok(measured()?.value.iter().map(|x| x * share).collect()) };
    let growth = |own: Option<f64>| own.or(spec.growth_rate).map(|rate| slope(&at("growth_rate"), rate)).transpose();
    match field {
        SizeFieldSpec::Region { region, size } => on_region(input, region, *size, at),
        SizeFieldSpec::Patch { patch, size } => {
            let mut lengths = vec![f64::INFINITY; count];
            let vertices = (input.patch_vertices)(*patch).unwrap_or_default();
            vertices.iter().for_each(|&v| lengths[v as usize] = *size);
            Ok(lengths)
        }
        SizeFieldSpec::PerVertex { sizes } if sizes.len() != count => {
            Err(EngineError::bad_parameter(&at("sizes"), format!("{} lengths for {count} vertices", sizes.len())))
        }
        SizeFieldSpec::PerVertex { sizes } => Ok(sizes.to_vec()),
        SizeFieldSpec::Curvature(curvature) => Ok(from_curvature(measured()?, curvature)),
        SizeFieldSpec::Proximity(proximity) => in_proportion(1.0 / proximity.elements_per_gap),
        SizeFieldSpec::Thickness { elements } => in_proportion(1.0 / elements),
        SizeFieldSpec::Centerline(centerline) => match &centerline.lines {
            Some(lines) => place::along_centerlines(input, lines, centerline.measure, centerline.elements_around, work),
            None => in_proportion(TAU / centerline.elements_around),
        },
        SizeFieldSpec::Shape(shape) => {
            let distances = input.mesh.positions.iter().map(|p| shape.shape.distance(*p)).collect();
            Ok(place::growing(distances, shape.size, 0.0, growth(shape.growth_rate)?))
        }
        SizeFieldSpec::Distance(distance) => {
            let distances = place::distances(input, distance, work)?;
            Ok(place::growing(distances, distance.size, distance.reach, growth(distance.growth_rate)?))
        }
    }
}

fn on_region(input: &SizeInput<'_>, region: &RegionChoice, size: f64, at: &dyn Fn(&str) -> String) -> Result<Vec<f64>> {
    let regions = &input.mesh.regions;
    let meant: Vec<bool> = regions
        .iter()
        .map(|r| match region {
            RegionChoice::Id(id) => r.id == *id,
            RegionChoice::Name(name) => r.name == *name,
        })
        .collect();
    if !meant.contains(&true) {
        let known: Vec<String> = regions.iter().take(20).map(|r| format!("{} {:?}", r.id, r.name)).collect();
        let asked = match region {
            RegionChoice::Id(id) => format!("of number {id}"),
            RegionChoice::Name(name) => format!("named {name:?}"),
        };
        let message = format!("the surface has no region {asked}; it has {}", known.join(", "));
        return Err(EngineError::bad_parameter(&at("region"), message));
    }
    let mut lengths = vec![f64::INFINITY; input.mesh.positions.len()];
    for (t, &r) in input.mesh.triangles.iter().zip(&input.mesh.face_region) {
        if meant[r as usize] {
            t.iter().for_each(|&v| lengths[v as usize] = size);
        }
    }
    Ok(lengths)
}

/// Edges of the result are up to about this much longer than asked for; where a distance is promised, that is allowed for.
const LONGER: f64 = 1.2;

/// Lengths on a surface of these curvatures. An edge on a circle of radius r turns its normal by the angle a if it is 2 r sin(a/2) long.
/// A triangle of this side is off the surface by at most h^2 k/8 at its sides and h^2 (k1 + k2)/12 in its middle, to second order; the
/// next order is allowed for by 4 d^2.
fn from_curvature(measured: &Measured, spec: &CurvatureSize) -> Vec<f64> {
    let chord = spec.normal_angle_deg.map(|angle| 2.0 * (0.5 * angle.to_radians()).sin());
    let length = |(&k, &sum): (&f64, &f64)| {
        let by_angle = chord.map_or(f64::INFINITY, |chord| chord / k);
        let by_deviation = match spec.deviation {
            Some(d) if d * k < 1.0 => (d / (k / 8.0).max(sum / 12.0) - 4.0 * d * d).max(0.0).sqrt() / LONGER,
            _ => f64::INFINITY,
        };
        by_angle.min(by_deviation)
    };
    measured.value.iter().zip(&measured.second).map(length).collect()
}
