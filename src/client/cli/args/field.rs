//! `--field KIND:KEY=VALUE,...`: one size field on the command line. Values may hold commas themselves, as in `low=0,0,0`.

use crate::v1;
use std::path::PathBuf;
use v1::size_field::Field;

/// A size field. What `file` holds is put into `field` later.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FieldArg {
    pub(crate) field: Field,
    pub(crate) file: Option<PathBuf>,
}

type Parsed<T> = Result<T, String>;

/// The keys and values of a field; each is taken once, and none may be left.
struct Values {
    kind: String,
    pairs: Vec<(String, String)>,
}

impl Values {
    fn new(text: &str) -> Parsed<Values> {
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        let mut pairs: Vec<(String, String)> = Vec::new();
        for part in rest.split(',').filter(|_| !rest.is_empty()) {
            match (part.split_once('='), pairs.last_mut()) {
                (Some((key, value)), _) => pairs.push((key.trim().replace('-', "_"), value.trim().to_owned())),
                (None, Some((_, value))) => *value = format!("{value},{}", part.trim()),
                (None, None) => return Err(format!("'{part}' is not KEY=VALUE")),
            }
        }
        Ok(Values { kind: kind.trim().to_owned(), pairs })
    }

    fn text(&mut self, key: &str) -> Option<String> {
        let at = self.pairs.iter().position(|(k, _)| k == key)?;
        Some(self.pairs.remove(at).1)
    }

    fn number(&mut self, key: &str) -> Parsed<Option<f64>> {
        let parse = |text: String| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("{key}='{text}' is not a finite number")),
        };
        self.text(key).map(parse).transpose()
    }

    fn whole<T: std::str::FromStr>(&mut self, key: &str) -> Parsed<Option<T>> {
        self.text(key).map(|text| text.parse().map_err(|_| format!("{key}='{text}' is not a whole number in range"))).transpose()
    }

    fn needed<T>(&self, value: Option<T>, key: &str) -> Parsed<T> {
        value.ok_or_else(|| format!("{} needs {key}", self.kind))
    }

    fn length(&mut self, key: &str) -> Parsed<f64> {
        let value = self.number(key)?;
        self.needed(value, key)
    }

    fn point(&mut self, key: &str) -> Parsed<Option<v1::Point>> {
        let text = self.text(key);
        let text = self.needed(text, key)?;
        let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).filter(|x: &f64| x.is_finite()).collect();
        match (&numbers[..], text.split(',').count()) {
            (&[x, y, z], 3) => Ok(Some(v1::Point { x, y, z })),
            _ => Err(format!("{key}='{text}' is not a point X,Y,Z")),
        }
    }

    fn choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Parsed<Option<T>> {
        let Some(text) = self.text(key) else { return Ok(None) };
        let found = choices.iter().find(|(name, _)| *name == text).map(|(_, value)| *value);
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        found.map(Some).ok_or_else(|| format!("{key}='{text}' is none of {}", names.join(", ")))
    }

    fn file(&mut self) -> Option<PathBuf> {
        self.text("file").map(PathBuf::from)
    }
}

/// Reads a field.
pub(super) fn field(text: &str) -> Parsed<FieldArg> {
    let mut values = Values::new(text)?;
    let kind = values.kind.clone();
    let (field, file) = match kind.as_str() {
        "region" => (Field::Region(region(&mut values)?), None),
        "patch" => (Field::Patch(patch(&mut values)?), None),
        "vertex" => {
            let file = values.file();
            (Field::PerVertex(v1::PackedArray::default()), Some(values.needed(file, "file")?))
        }
        "curvature" => (Field::Curvature(curvature(&mut values)?), None),
        "proximity" => (Field::Proximity(proximity(&mut values)?), None),
        "thickness" => (Field::Thickness(v1::ThicknessSize { elements: values.length("elements")? }), None),
        "centerline" => {
            let file = values.file();
            (Field::Centerline(centerline(&mut values)?), file)
        }
        "box" | "sphere" | "cylinder" => (Field::Shape(shape(&mut values, &kind)?), None),
        "distance" => {
            let file = values.file();
            (Field::Distance(distance(&mut values, file.is_some())?), file)
        }
        _ => {
            return Err(format!(
                "'{kind}' is no kind of field; use region, patch, vertex, curvature, proximity, thickness, centerline, box, sphere, \
                 cylinder or distance"
            ));
        }
    };
    match values.pairs.first() {
        Some((key, _)) => Err(format!("{kind} has no {key} (or it is given twice)")),
        None => Ok(FieldArg { field, file }),
    }
}

fn region(values: &mut Values) -> Parsed<v1::RegionSize> {
    use v1::region_size::Region;
    let (name, id) = (values.text("name"), values.whole("id")?);
    let region = match (name, id) {
        (Some(name), None) => Region::Name(name),
        (None, Some(id)) => Region::Id(id),
        _ => return Err("region needs name or id".into()),
    };
    Ok(v1::RegionSize { region: Some(region), size: values.length("size")? })
}

fn patch(values: &mut Values) -> Parsed<v1::PatchSize> {
    use v1::patch_size::Patch;
    let (number, identity) = (values.whole("number")?, values.text("identity"));
    let patch = match (number, identity) {
        (Some(number), None) => Patch::Number(number),
        (None, Some(identity)) => Patch::Identity(identity),
        _ => return Err("patch needs number or identity".into()),
    };
    Ok(v1::PatchSize { patch: Some(patch), size: values.length("size")? })
}

fn curvature(values: &mut Values) -> Parsed<v1::CurvatureSize> {
    let (normal_angle, deviation) = (values.number("normal_angle")?, values.number("deviation")?);
    if normal_angle.is_none() && deviation.is_none() {
        return Err("curvature needs normal_angle or deviation".into());
    }
    Ok(v1::CurvatureSize { normal_angle, deviation, smoothing: values.whole("smoothing")? })
}

fn proximity(values: &mut Values) -> Parsed<v1::ProximitySize> {
    let choices = [("both", v1::GapSides::Both), ("inside", v1::GapSides::Inside), ("outside", v1::GapSides::Outside)];
    let sides = values.choice("sides", &choices)?.unwrap_or_default();
    Ok(v1::ProximitySize { elements_per_gap: values.length("elements_per_gap")?, sides: sides.into(), reach: values.number("reach")? })
}

fn centerline(values: &mut Values) -> Parsed<v1::CenterlineSize> {
    let choices = [("radius", v1::CenterlineMeasure::Radius), ("distance", v1::CenterlineMeasure::Distance)];
    let measure = values.choice("measure", &choices)?.unwrap_or_default();
    Ok(v1::CenterlineSize { lines: Vec::new(), measure: measure.into(), elements_around: values.length("elements_around")?, points: 0 })
}

fn shape(values: &mut Values, kind: &str) -> Parsed<v1::ShapeSize> {
    use v1::shape_size::Shape;
    let shape = match kind {
        "box" => Shape::Box(v1::BoxShape { low: values.point("low")?, high: values.point("high")? }),
        "sphere" => Shape::Sphere(v1::SphereShape { center: values.point("center")?, radius: values.length("radius")? }),
        _ => Shape::Cylinder(v1::CylinderShape {
            start: values.point("start")?,
            end: values.point("end")?,
            radius: values.length("radius")?,
        }),
    };
    Ok(v1::ShapeSize { shape: Some(shape), size: values.length("size")?, growth_rate: values.number("growth_rate")? })
}

/// From what distances are measured.
#[derive(Clone, Copy, PartialEq)]
enum From {
    Curves(v1::SurfaceCurves),
    Points,
    Lines,
}

fn distance(values: &mut Values, has_file: bool) -> Parsed<v1::DistanceSize> {
    let choices = [
        ("features", From::Curves(v1::SurfaceCurves::Features)),
        ("boundary", From::Curves(v1::SurfaceCurves::Boundary)),
        ("points", From::Points),
        ("lines", From::Lines),
    ];
    let from = values.choice("from", &choices)?;
    let from = values.needed(from, "from")?;
    if has_file == matches!(from, From::Curves(_)) {
        return Err(if has_file { "features and boundary need no file".into() } else { "distance needs file".into() });
    }
    let from = match from {
        From::Curves(curves) => v1::distance_size::From::Curves(curves.into()),
        From::Points => v1::distance_size::From::Points(v1::PackedArray::default()),
        From::Lines => v1::distance_size::From::Polylines(v1::Polylines::default()),
    };
    Ok(v1::DistanceSize {
        from: Some(from),
        size: values.length("size")?,
        reach: values.number("reach")?.unwrap_or(0.0),
        growth_rate: values.number("growth_rate")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read() {
        let of = |text: &str| field(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        let low = Some(v1::Point { x: 0.0, y: -1.5, z: 2.0 });
        match of("box:low=0,-1.5,2,high=1,1,3,size=0.2,growth-rate=1.3").field {
            Field::Shape(v1::ShapeSize { shape: Some(v1::shape_size::Shape::Box(b)), size, growth_rate }) => {
                assert_eq!((b.low, size, growth_rate), (low, 0.2, Some(1.3)));
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(of("distance:from=lines,file=a,b.txt,size=1").file, Some(PathBuf::from("a,b.txt")));
        assert!(matches!(of("curvature:normal_angle=15").field, Field::Curvature(c) if c.normal_angle == Some(15.0)));
        assert!(matches!(of("proximity:elements_per_gap=3,sides=inside").field, Field::Proximity(p) if p.sides() == v1::GapSides::Inside));
        assert!(matches!(of("patch:number=3,size=0.1").field, Field::Patch(p) if p.patch == Some(v1::patch_size::Patch::Number(3))));
        for bad in [
            "",
            "heat:size=1",
            "curvature",
            "curvature:normal_angle=x",
            "curvature:normal_angle=nan",
            "region:size=1",
            "patch:number=-1,size=1",
            "sphere:center=0,0,radius=1,size=1",
            "sphere:center=0,0,0,0,radius=1,size=1",
            "box:low=0,0,0,high=1,1,1",
            "thickness:elements=3,elements=4",
            "proximity:elements_per_gap=3,sides=up",
            "distance:from=features,file=x,size=1",
            "distance:from=points,size=1",
            "vertex:3",
        ] {
            assert!(field(bad).is_err(), "{bad}");
        }
    }
}
