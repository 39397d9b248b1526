//! Which numbers of a size specification make sense.

use super::spec::{
    CenterlineMeasure, CenterlineSize, ComposedSize, CurvatureSize, DistanceSize, DistanceSource, MAX_FIELDS, MAX_POINTS, ProximitySize,
    Shape, ShapeSize, SizeBase, SizeFieldSpec,
};
use crate::error::{EngineError, Reason, Result};
use crate::vector::Vec3;

/// A positive finite length.
pub(super) fn positive(field: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(EngineError::bad_parameter(field, format!("{value} is not positive and finite")))
    }
}

pub(super) fn ordered(low: f64, high: f64) -> Result<()> {
    if low <= high { Ok(()) } else { Err(EngineError::bad_parameter("min_size", format!("{low} is above max_size {high}"))) }
}

/// Growth of the length per unit of distance under which the lengths of neighbouring elements have this ratio.
pub(super) fn slope(field: &str, rate: f64) -> Result<f64> {
    if rate.is_finite() && rate >= 1.0 {
        Ok(rate.ln())
    } else {
        Err(EngineError::bad_parameter(field, format!("{rate} is not a ratio of at least 1")))
    }
}

fn finite(field: &str, point: Vec3) -> Result<()> {
    if point.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        let [x, y, z] = point;
        Err(EngineError::bad_parameter(field, format!("({x}, {y}, {z}) is not finite")))
    }
}

fn count(field: &str, number: usize) -> Result<()> {
    if number == 0 {
        return Err(EngineError::bad_parameter(field, "must not be empty"));
    }
    if number > MAX_POINTS {
        let message = format!("{field} has {number} points, the limit is {MAX_POINTS}");
        return Err(EngineError::new(Reason::LimitReached, message).with_metadata("field", field));
    }
    Ok(())
}

impl ComposedSize {
    pub(super) fn validate(&self) -> Result<()> {
        match self.base {
            SizeBase::Uniform(size) => positive("uniform", size).map(drop)?,
            SizeBase::Triangles(0) => return Err(EngineError::bad_parameter("triangles", "must be at least 1")),
            SizeBase::MaxSize if self.max_size.is_none() => {
                return Err(EngineError::bad_parameter("max_size", "is required without a uniform size or a number of triangles"));
            }
            SizeBase::Triangles(_) | SizeBase::MaxSize => {}
        }
        let low = self.min_size.map_or(Ok(0.0), |size| positive("min_size", size))?;
        let high = self.max_size.map_or(Ok(f64::INFINITY), |size| positive("max_size", size))?;
        ordered(low, high)?;
        self.growth_rate.map_or(Ok(0.0), |rate| slope("growth_rate", rate))?;
        if self.fields.len() > MAX_FIELDS {
            let message = format!("{} size fields, the limit is {MAX_FIELDS}", self.fields.len());
            return Err(EngineError::new(Reason::LimitReached, message).with_metadata("field", "fields"));
        }
        for (i, field) in self.fields.iter().enumerate() {
            let at = |name: &str| format!("fields[{i}].{}.{name}", field.name());
            field.validate(&at)?;
            let reaches_zero =
                matches!(field, SizeFieldSpec::Proximity(_) | SizeFieldSpec::Thickness { .. } | SizeFieldSpec::Centerline(_));
            if reaches_zero && self.min_size.is_none() {
                return Err(EngineError::bad_parameter("min_size", format!("is required with a field {}", field.name()))
                    .with_hint("gaps, walls and vessels may end at nothing: say how small elements may get there"));
            }
        }
        Ok(())
    }
}

impl SizeFieldSpec {
    fn validate(&self, at: &dyn Fn(&str) -> String) -> Result<()> {
        match self {
            SizeFieldSpec::Region { size, .. } | SizeFieldSpec::Patch { size, .. } => positive(&at("size"), *size).map(drop),
            SizeFieldSpec::PerVertex { sizes } => sizes.iter().position(|s| !(s.is_finite() && *s > 0.0)).map_or(Ok(()), |bad| {
                let message = format!("length {} of vertex {bad} is not positive and finite", sizes[bad]);
                Err(EngineError::bad_parameter(&at("sizes"), message))
            }),
            SizeFieldSpec::Curvature(curvature) => curvature.validate(at),
            SizeFieldSpec::Proximity(ProximitySize { elements_per_gap, reach, .. }) => {
                positive(&at("elements_per_gap"), *elements_per_gap)?;
                reach.map_or(Ok(()), |reach| positive(&at("reach"), reach).map(drop))
            }
            SizeFieldSpec::Thickness { elements } => positive(&at("elements"), *elements).map(drop),
            SizeFieldSpec::Centerline(centerline) => centerline.validate(at),
            SizeFieldSpec::Shape(shape) => shape.validate(at),
            SizeFieldSpec::Distance(distance) => distance.validate(at),
        }
    }
}

impl CurvatureSize {
    fn validate(&self, at: &dyn Fn(&str) -> String) -> Result<()> {
        if self.normal_angle_deg.is_none() && self.deviation.is_none() {
            return Err(EngineError::bad_parameter(&at("normal_angle"), "is required without a deviation"));
        }
        if let Some(angle) = self.normal_angle_deg.filter(|angle| !(*angle > 0.0 && *angle < 180.0)) {
            return Err(EngineError::bad_parameter(&at("normal_angle"), format!("{angle} is not in (0, 180)")));
        }
        if self.smoothing > 100 {
            return Err(EngineError::bad_parameter(&at("smoothing"), format!("{} is more than 100", self.smoothing)));
        }
        self.deviation.map_or(Ok(()), |deviation| positive(&at("deviation"), deviation).map(drop))
    }
}

impl CenterlineSize {
    fn validate(&self, at: &dyn Fn(&str) -> String) -> Result<()> {
        positive(&at("elements_around"), self.elements_around)?;
        let Some(lines) = &self.lines else { return Ok(()) };
        count(&at("lines"), lines.iter().map(|line| line.points.len()).sum())?;
        for (i, line) in lines.iter().enumerate() {
            line.points.iter().try_for_each(|p| finite(&at(&format!("lines[{i}].points")), *p))?;
            let radii = at(&format!("lines[{i}].radii"));
            let needed = self.measure == CenterlineMeasure::Radius || !line.radii.is_empty();
            if needed && line.radii.len() != line.points.len() {
                let message = format!("{} radii for {} points", line.radii.len(), line.points.len());
                return Err(EngineError::bad_parameter(&radii, message));
            }
            line.radii.iter().try_for_each(|r| positive(&radii, *r).map(drop))?;
        }
        Ok(())
    }
}

impl ShapeSize {
    fn validate(&self, at: &dyn Fn(&str) -> String) -> Result<()> {
        positive(&at("size"), self.size)?;
        self.growth_rate.map_or(Ok(0.0), |rate| slope(&at("growth_rate"), rate))?;
        match self.shape {
            Shape::Box { low, high } => {
                finite(&at("box.low"), low)?;
                finite(&at("box.high"), high)?;
                if (0..3).any(|k| low[k] > high[k]) {
                    return Err(EngineError::bad_parameter(&at("box.low"), "lies above `high` in a coordinate"));
                }
                Ok(())
            }
            Shape::Sphere { center, radius } => {
                finite(&at("sphere.center"), center)?;
                positive(&at("sphere.radius"), radius).map(drop)
            }
            Shape::Cylinder { start, end, radius } => {
                finite(&at("cylinder.start"), start)?;
                finite(&at("cylinder.end"), end)?;
                if start == end {
                    return Err(EngineError::bad_parameter(&at("cylinder.end"), "must not be `start`"));
                }
                positive(&at("cylinder.radius"), radius).map(drop)
            }
        }
    }
}

impl DistanceSize {
    fn validate(&self, at: &dyn Fn(&str) -> String) -> Result<()> {
        positive(&at("size"), self.size)?;
        if !(self.reach >= 0.0 && self.reach.is_finite()) {
            return Err(EngineError::bad_parameter(&at("reach"), format!("{} is negative or not finite", self.reach)));
        }
        self.growth_rate.map_or(Ok(0.0), |rate| slope(&at("growth_rate"), rate))?;
        match &self.from {
            DistanceSource::Points(points) => {
                count(&at("points"), points.len())?;
                points.iter().try_for_each(|p| finite(&at("points"), *p))
            }
            DistanceSource::Polylines(lines) => {
                count(&at("polylines"), lines.iter().map(Vec::len).sum())?;
                lines.iter().flatten().try_for_each(|p| finite(&at("polylines"), *p))
            }
            DistanceSource::Features | DistanceSource::Boundary => Ok(()),
        }
    }
}
