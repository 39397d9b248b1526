//! Sizes and locks on the wire, in both directions. Ranges of numbers in fields are the engine's to check; simple sizes are checked here.

use super::from_proto::{bounds, f64_rows, known, positive, required, u32_rows};
use super::sources::packed;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::fingerprint::Fingerprint;
use remesh_engine::lock::LockSpec;
use remesh_engine::sizing::{
    Centerline, CenterlineMeasure, CenterlineSize, ComposedSize, CurvatureSize, DistanceSize, DistanceSource, MAX_FIELDS, ProximitySize,
    RegionChoice, Shape, ShapeSize, Sides, SizeBase, SizeFieldSpec, SizeSpec,
};
use remesh_engine::vector::Vec3;
use remesh_proto::v1;
use std::sync::Arc;

/// Passes of averaging that a curvature field gets if it does not say.
const USUAL_SMOOTHING: u32 = 2;

/// Numbers of patches that a size names, in order of its fields.
pub(crate) fn patch_numbers(spec: &v1::SizeSpec) -> Vec<u32> {
    use v1::patch_size::Patch;
    let Some(v1::size_spec::Size::Composed(composed)) = &spec.size else { return Vec::new() };
    let number = |field: &v1::SizeField| match &field.field {
        Some(v1::size_field::Field::Patch(v1::PatchSize { patch: Some(Patch::Number(number)), .. })) => Some(*number),
        _ => None,
    };
    composed.fields.iter().filter_map(number).collect()
}

/// Puts identities in the place of patch numbers.
pub(crate) fn name_patches(spec: &mut v1::SizeSpec, identity: impl Fn(u32) -> Result<Fingerprint>) -> Result<()> {
    use v1::patch_size::Patch;
    let Some(v1::size_spec::Size::Composed(composed)) = &mut spec.size else { return Ok(()) };
    for field in &mut composed.fields {
        if let Some(v1::size_field::Field::Patch(v1::PatchSize { patch, .. })) = &mut field.field
            && let Some(Patch::Number(number)) = *patch
        {
            *patch = Some(Patch::Identity(identity(number)?.to_string()));
        }
    }
    Ok(())
}

/// Which sizes. Patches must be named by identity: see [`name_patches`].
pub(crate) fn size(engine: &Engine, spec: &v1::SizeSpec) -> Result<SizeSpec> {
    use v1::size_spec::Size;
    match required(spec.size.as_ref(), "size")? {
        Size::Uniform(size) => positive(*size, "size.uniform").map(|()| SizeSpec::Uniform { size: *size }),
        Size::Triangles(0) => Err(EngineError::bad_parameter("size.triangles", "must be positive")),
        Size::Triangles(triangles) => Ok(SizeSpec::TriangleCount { triangles: *triangles }),
        Size::PerVertex(per_vertex) => {
            let array = required(per_vertex.sizes.as_ref(), "size.per_vertex.sizes")?;
            let sizes = numbers(engine, array, "size.per_vertex.sizes")?;
            if let Some(bad) = sizes.iter().position(|s| !(*s > 0.0 && s.is_finite())) {
                let message = format!("the size of vertex {bad} is not positive and finite");
                return Err(EngineError::bad_parameter("size.per_vertex.sizes", message));
            }
            bounds(per_vertex.min_size, per_vertex.max_size, per_vertex.growth_rate, "size.per_vertex")?;
            Ok(SizeSpec::PerVertex {
                sizes,
                min_size: per_vertex.min_size,
                max_size: per_vertex.max_size,
                growth_rate: per_vertex.growth_rate,
            })
        }
        Size::Graded(v1::GradedSize { min_size, max_size, growth_rate }) => {
            bounds(Some(*min_size), Some(*max_size), Some(*growth_rate), "size.graded")?;
            Ok(SizeSpec::Graded { min_size: *min_size, max_size: *max_size, growth_rate: *growth_rate })
        }
        Size::Composed(spec) => {
            let spec = SizeSpec::Composed(composed(engine, spec)?);
            spec.validate().map_err(|error| super::charts::within("size.composed", error))?;
            Ok(spec)
        }
    }
}

fn numbers(engine: &Engine, array: &v1::PackedArray, field: &str) -> Result<Vec<f64>> {
    f64_rows::<1>(engine, array, field).map(<Vec<[f64; 1]>>::into_flattened)
}

fn composed(engine: &Engine, spec: &v1::ComposedSize) -> Result<ComposedSize> {
    use v1::composed_size::Base;
    if spec.fields.len() > MAX_FIELDS {
        let message = format!("{} size fields, the limit is {MAX_FIELDS}", spec.fields.len());
        return Err(EngineError::new(Reason::LimitReached, message).with_metadata("field", "size.composed.fields"));
    }
    let field = |(i, field): (usize, &v1::SizeField)| size_field(engine, field, &format!("size.composed.fields[{i}]"));
    Ok(ComposedSize {
        base: match spec.base {
            None => SizeBase::MaxSize,
            Some(Base::Uniform(size)) => SizeBase::Uniform(size),
            Some(Base::Triangles(triangles)) => SizeBase::Triangles(triangles),
        },
        fields: spec.fields.iter().enumerate().map(field).collect::<Result<_>>()?,
        min_size: spec.min_size,
        max_size: spec.max_size,
        growth_rate: spec.growth_rate,
    })
}

fn size_field(engine: &Engine, field: &v1::SizeField, at: &str) -> Result<SizeFieldSpec> {
    use v1::size_field::Field;
    Ok(match required(field.field.as_ref(), at)? {
        Field::Region(v1::RegionSize { region, size }) => {
            let region = match required(region.as_ref(), &format!("{at}.region.region"))? {
                v1::region_size::Region::Id(id) => RegionChoice::Id(*id),
                v1::region_size::Region::Name(name) => RegionChoice::Name(name.clone()),
            };
            SizeFieldSpec::Region { region, size: *size }
        }
        Field::Patch(v1::PatchSize { patch, size }) => {
            let at = format!("{at}.patch");
            SizeFieldSpec::Patch { patch: patch_identity(required(patch.as_ref(), &at)?, &at)?, size: *size }
        }
        Field::PerVertex(array) => SizeFieldSpec::PerVertex { sizes: Arc::new(numbers(engine, array, &format!("{at}.per_vertex.sizes"))?) },
        Field::Curvature(v1::CurvatureSize { normal_angle, deviation, smoothing }) => SizeFieldSpec::Curvature(CurvatureSize {
            normal_angle_deg: *normal_angle,
            deviation: *deviation,
            smoothing: smoothing.unwrap_or(USUAL_SMOOTHING),
        }),
        Field::Proximity(spec) => SizeFieldSpec::Proximity(ProximitySize {
            elements_per_gap: spec.elements_per_gap,
            sides: match known(spec.sides, &format!("{at}.proximity.sides"))? {
                v1::GapSides::Unspecified | v1::GapSides::Both => Sides::Both,
                v1::GapSides::Inside => Sides::Inside,
                v1::GapSides::Outside => Sides::Outside,
            },
            reach: spec.reach,
        }),
        Field::Thickness(spec) => SizeFieldSpec::Thickness { elements: spec.elements },
        Field::Centerline(spec) => SizeFieldSpec::Centerline(centerline(engine, spec, &format!("{at}.centerline"))?),
        Field::Shape(spec) => SizeFieldSpec::Shape(shape(spec, at)?),
        Field::Distance(spec) => SizeFieldSpec::Distance(distance(engine, spec, &format!("{at}.distance"))?),
    })
}

fn patch_identity(patch: &v1::patch_size::Patch, at: &str) -> Result<Fingerprint> {
    use v1::patch_size::Patch;
    let text = match patch {
        Patch::Identity(text) => text,
        Patch::Number(number) => {
            let message = format!("patch {number} has no meaning without a session");
            return Err(EngineError::bad_parameter(&format!("{at}.number"), message).with_hint("name the patch by its identity"));
        }
    };
    let digits = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
    let value = u128::from_str_radix(text, 16).ok().filter(|_| digits);
    let value = value.ok_or_else(|| EngineError::bad_parameter(&format!("{at}.identity"), "is not made of 32 hexadecimal digits"))?;
    Ok(Fingerprint(value.to_be_bytes()))
}

fn centerline(engine: &Engine, spec: &v1::CenterlineSize, at: &str) -> Result<CenterlineSize> {
    let line = |(i, line): (usize, &v1::Centerline)| -> Result<Centerline> {
        let at = format!("{at}.lines[{i}]");
        let points = f64_rows(engine, required(line.points.as_ref(), &format!("{at}.points"))?, &format!("{at}.points"))?;
        let radii = line.radii.as_ref().map_or(Ok(Vec::new()), |array| numbers(engine, array, &format!("{at}.radii")))?;
        Ok(Centerline { points, radii })
    };
    let lines: Vec<Centerline> = spec.lines.iter().enumerate().map(line).collect::<Result<_>>()?;
    Ok(CenterlineSize {
        lines: (!lines.is_empty()).then(|| Arc::new(lines)),
        measure: match known(spec.measure, &format!("{at}.measure"))? {
            v1::CenterlineMeasure::Unspecified | v1::CenterlineMeasure::Radius => CenterlineMeasure::Radius,
            v1::CenterlineMeasure::Distance => CenterlineMeasure::Distance,
        },
        elements_around: spec.elements_around,
    })
}

fn point(value: Option<v1::Point>, field: &str) -> Result<Vec3> {
    required(value, field).map(|v1::Point { x, y, z }| [x, y, z])
}

fn shape(spec: &v1::ShapeSize, at: &str) -> Result<ShapeSize> {
    let at = format!("{at}.shape");
    use v1::shape_size::Shape as Wire;
    let shape = match required(spec.shape.as_ref(), &at)? {
        Wire::Box(v1::BoxShape { low, high }) => {
            Shape::Box { low: point(*low, &format!("{at}.box.low"))?, high: point(*high, &format!("{at}.box.high"))? }
        }
        Wire::Sphere(v1::SphereShape { center, radius }) => {
            Shape::Sphere { center: point(*center, &format!("{at}.sphere.center"))?, radius: *radius }
        }
        Wire::Cylinder(v1::CylinderShape { start, end, radius }) => Shape::Cylinder {
            start: point(*start, &format!("{at}.cylinder.start"))?,
            end: point(*end, &format!("{at}.cylinder.end"))?,
            radius: *radius,
        },
    };
    Ok(ShapeSize { shape, size: spec.size, growth_rate: spec.growth_rate })
}

fn distance(engine: &Engine, spec: &v1::DistanceSize, at: &str) -> Result<DistanceSize> {
    use v1::distance_size::From;
    let from = match required(spec.from.as_ref(), &format!("{at}.from"))? {
        From::Points(array) => DistanceSource::Points(Arc::new(f64_rows(engine, array, &format!("{at}.points"))?)),
        From::Polylines(v1::Polylines { points, counts }) => {
            let field = format!("{at}.polylines");
            let points: Vec<Vec3> = f64_rows(engine, required(points.as_ref(), &format!("{field}.points"))?, &format!("{field}.points"))?;
            let total: u64 = counts.iter().map(|&n| u64::from(n)).sum();
            if total != points.len() as u64 {
                let message = format!("are {total} points in all, but {} are given", points.len());
                return Err(EngineError::bad_parameter(&format!("{field}.counts"), message));
            }
            let mut rest = points.as_slice();
            let lines = counts.iter().map(|&n| {
                let (line, after) = rest.split_at(n as usize);
                rest = after;
                line.to_vec()
            });
            DistanceSource::Polylines(Arc::new(lines.collect()))
        }
        From::Curves(curves) => match known(*curves, &format!("{at}.curves"))? {
            v1::SurfaceCurves::Unspecified => return Err(EngineError::bad_parameter(&format!("{at}.curves"), "is required")),
            v1::SurfaceCurves::Features => DistanceSource::Features,
            v1::SurfaceCurves::Boundary => DistanceSource::Boundary,
        },
    };
    Ok(DistanceSize { from, size: spec.size, reach: spec.reach, growth_rate: spec.growth_rate })
}

/// A size as it is told back: without its arrays.
pub(crate) fn wire(spec: &SizeSpec) -> v1::SizeSpec {
    use v1::size_spec::Size;
    let size = match spec {
        SizeSpec::Uniform { size } => Size::Uniform(*size),
        SizeSpec::TriangleCount { triangles } => Size::Triangles(*triangles),
        &SizeSpec::PerVertex { min_size, max_size, growth_rate, .. } => {
            Size::PerVertex(v1::PerVertexSize { sizes: None, min_size, max_size, growth_rate })
        }
        &SizeSpec::Graded { min_size, max_size, growth_rate } => Size::Graded(v1::GradedSize { min_size, max_size, growth_rate }),
        SizeSpec::Composed(composed) => Size::Composed(v1::ComposedSize {
            base: match composed.base {
                SizeBase::MaxSize => None,
                SizeBase::Uniform(size) => Some(v1::composed_size::Base::Uniform(size)),
                SizeBase::Triangles(triangles) => Some(v1::composed_size::Base::Triangles(triangles)),
            },
            fields: composed.fields.iter().map(|field| v1::SizeField { field: Some(wire_field(field)) }).collect(),
            min_size: composed.min_size,
            max_size: composed.max_size,
            growth_rate: composed.growth_rate,
        }),
    };
    v1::SizeSpec { size: Some(size) }
}

fn packed_numbers(numbers: &[f64]) -> v1::PackedArray {
    packed(numbers.iter().map(|x| x.to_le_bytes()))
}

fn packed_points(points: &[Vec3]) -> v1::PackedArray {
    packed_numbers(points.as_flattened())
}

/// A size with its arrays.
pub(super) fn whole(spec: &SizeSpec) -> v1::SizeSpec {
    use v1::size_spec::Size;
    let mut told = wire(spec);
    match (spec, &mut told.size) {
        (SizeSpec::PerVertex { sizes, .. }, Some(Size::PerVertex(told))) => told.sizes = Some(packed_numbers(sizes)),
        (SizeSpec::Composed(composed), Some(Size::Composed(told))) => {
            for (field, told) in composed.fields.iter().zip(&mut told.fields) {
                told.field = Some(whole_field(field));
            }
        }
        _ => {}
    }
    told
}

fn whole_field(field: &SizeFieldSpec) -> v1::size_field::Field {
    use v1::size_field::Field;
    let told = wire_field(field);
    match (field, told) {
        (SizeFieldSpec::PerVertex { sizes }, _) => Field::PerVertex(packed_numbers(sizes)),
        (SizeFieldSpec::Centerline(CenterlineSize { lines: Some(lines), .. }), Field::Centerline(mut told)) => {
            let line = |line: &Centerline| v1::Centerline {
                points: Some(packed_points(&line.points)),
                radii: (!line.radii.is_empty()).then(|| packed_numbers(&line.radii)),
            };
            told.lines = lines.iter().map(line).collect();
            Field::Centerline(told)
        }
        (SizeFieldSpec::Distance(DistanceSize { from, .. }), Field::Distance(mut told)) => {
            use v1::distance_size::From;
            match from {
                DistanceSource::Points(points) => told.from = Some(From::Points(packed_points(points))),
                DistanceSource::Polylines(lines) => {
                    let points: Vec<Vec3> = lines.iter().flatten().copied().collect();
                    let counts = lines.iter().map(|line| line.len() as u32).collect();
                    told.from = Some(From::Polylines(v1::Polylines { points: Some(packed_points(&points)), counts }));
                }
                DistanceSource::Features | DistanceSource::Boundary => {}
            }
            Field::Distance(told)
        }
        (_, told) => told,
    }
}

fn wire_field(field: &SizeFieldSpec) -> v1::size_field::Field {
    use v1::size_field::Field;
    let wire_point = |[x, y, z]: Vec3| Some(v1::Point { x, y, z });
    match field {
        SizeFieldSpec::Region { region, size } => {
            let region = match region {
                RegionChoice::Id(id) => v1::region_size::Region::Id(*id),
                RegionChoice::Name(name) => v1::region_size::Region::Name(name.clone()),
            };
            Field::Region(v1::RegionSize { region: Some(region), size: *size })
        }
        SizeFieldSpec::Patch { patch, size } => {
            Field::Patch(v1::PatchSize { patch: Some(v1::patch_size::Patch::Identity(patch.to_string())), size: *size })
        }
        SizeFieldSpec::PerVertex { .. } => Field::PerVertex(v1::PackedArray::default()),
        SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg, deviation, smoothing }) => {
            Field::Curvature(v1::CurvatureSize { normal_angle: *normal_angle_deg, deviation: *deviation, smoothing: Some(*smoothing) })
        }
        SizeFieldSpec::Proximity(ProximitySize { elements_per_gap, sides, reach }) => {
            let sides = match sides {
                Sides::Both => v1::GapSides::Both,
                Sides::Inside => v1::GapSides::Inside,
                Sides::Outside => v1::GapSides::Outside,
            };
            Field::Proximity(v1::ProximitySize { elements_per_gap: *elements_per_gap, sides: sides.into(), reach: *reach })
        }
        SizeFieldSpec::Thickness { elements } => Field::Thickness(v1::ThicknessSize { elements: *elements }),
        SizeFieldSpec::Centerline(CenterlineSize { lines, measure, elements_around }) => {
            let measure = match measure {
                CenterlineMeasure::Radius => v1::CenterlineMeasure::Radius,
                CenterlineMeasure::Distance => v1::CenterlineMeasure::Distance,
            };
            let points = lines.iter().flat_map(|lines| lines.iter()).map(|line| line.points.len() as u64).sum();
            Field::Centerline(v1::CenterlineSize { lines: Vec::new(), measure: measure.into(), elements_around: *elements_around, points })
        }
        SizeFieldSpec::Shape(ShapeSize { shape, size, growth_rate }) => {
            use v1::shape_size::Shape as Wire;
            let shape = match *shape {
                Shape::Box { low, high } => Wire::Box(v1::BoxShape { low: wire_point(low), high: wire_point(high) }),
                Shape::Sphere { center, radius } => Wire::Sphere(v1::SphereShape { center: wire_point(center), radius }),
                Shape::Cylinder { start, end, radius } => {
                    Wire::Cylinder(v1::CylinderShape { start: wire_point(start), end: wire_point(end), radius })
                }
            };
            Field::Shape(v1::ShapeSize { shape: Some(shape), size: *size, growth_rate: *growth_rate })
        }
        SizeFieldSpec::Distance(DistanceSize { from, size, reach, growth_rate }) => {
            use v1::distance_size::From;
            let from = match from {
                DistanceSource::Points(_) => From::Points(v1::PackedArray::default()),
                DistanceSource::Polylines(_) => From::Polylines(v1::Polylines::default()),
                DistanceSource::Features => From::Curves(v1::SurfaceCurves::Features.into()),
                DistanceSource::Boundary => From::Curves(v1::SurfaceCurves::Boundary.into()),
            };
            Field::Distance(v1::DistanceSize { from: Some(from), size: *size, reach: *reach, growth_rate: *growth_rate })
        }
    }
}

/// Which boundary vertices stay.
pub(crate) fn lock(engine: &Engine, spec: &v1::LockSpec) -> Result<LockSpec> {
    use v1::lock_spec::Lock;
    let indices = |array: &v1::PackedArray, field: &str| u32_rows::<1>(engine, array, field).map(<Vec<[u32; 1]>>::into_flattened);
    Ok(match &spec.lock {
        None | Some(Lock::Nothing(_)) => LockSpec::Nothing,
        Some(Lock::Boundary(_)) => LockSpec::Boundary,
        Some(Lock::Loops(array)) => LockSpec::Loops(indices(array, "lock.loops")?),
        Some(Lock::Vertices(array)) => LockSpec::Vertices(indices(array, "lock.vertices")?),
    })
}

/// Locks with their arrays.
pub(super) fn whole_lock(spec: &LockSpec) -> v1::LockSpec {
    use v1::lock_spec::Lock;
    let array = |named: &[u32]| packed(named.iter().map(|v| v.to_le_bytes()));
    let mut told = wire_lock(spec);
    match spec {
        LockSpec::Nothing | LockSpec::Boundary => {}
        LockSpec::Loops(named) => told.lock = Some(Lock::Loops(array(named))),
        LockSpec::Vertices(named) => told.lock = Some(Lock::Vertices(array(named))),
    }
    told
}

/// Locks as they are told back: without their arrays.
pub(crate) fn wire_lock(spec: &LockSpec) -> v1::LockSpec {
    use v1::lock_spec::Lock;
    let (lock, count) = match spec {
        LockSpec::Nothing => (Lock::Nothing(v1::NoLock {}), 0),
        LockSpec::Boundary => (Lock::Boundary(v1::BoundaryLock {}), 0),
        LockSpec::Loops(named) => (Lock::Loops(v1::PackedArray::default()), named.len()),
        LockSpec::Vertices(named) => (Lock::Vertices(v1::PackedArray::default()), named.len()),
    };
    v1::LockSpec { lock: Some(lock), count: count as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::engine::EngineConfig;
    use v1::size_field::Field;

    fn of(fields: Vec<Field>) -> v1::SizeSpec {
        let fields = fields.into_iter().map(|field| v1::SizeField { field: Some(field) }).collect();
        let composed = v1::ComposedSize { fields, min_size: Some(0.1), max_size: Some(2.0), growth_rate: Some(1.2), ..Default::default() };
        v1::SizeSpec { size: Some(v1::size_spec::Size::Composed(composed)) }
    }

    fn packed(numbers: &[f64]) -> Option<v1::PackedArray> {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        Some(v1::PackedArray { data: Some(v1::packed_array::Data::Inline(bytes.into())) })
    }

    #[test]
    fn fields_go_there_and_back() {
        let engine = Engine::new(EngineConfig::default());
        let point = |x: f64| Some(v1::Point { x, y: 0.0, z: -1.0 });
        let identity = "00112233445566778899aabbccddeeff".to_owned();
        let shape = |shape| Field::Shape(v1::ShapeSize { shape: Some(shape), size: 0.3, growth_rate: None });
        let fields = vec![
            Field::Region(v1::RegionSize { region: Some(v1::region_size::Region::Name("wall".into())), size: 0.5 }),
            Field::Region(v1::RegionSize { region: Some(v1::region_size::Region::Id(-4)), size: 0.5 }),
            Field::Patch(v1::PatchSize { patch: Some(v1::patch_size::Patch::Identity(identity)), size: 0.2 }),
            Field::Curvature(v1::CurvatureSize { normal_angle: Some(12.0), deviation: None, smoothing: Some(3) }),
            Field::Proximity(v1::ProximitySize { elements_per_gap: 3.0, sides: v1::GapSides::Outside.into(), reach: Some(4.0) }),
            Field::Thickness(v1::ThicknessSize { elements: 4.0 }),
            Field::Centerline(v1::CenterlineSize {
                lines: Vec::new(),
                measure: v1::CenterlineMeasure::Radius.into(),
                elements_around: 20.0,
                points: 0,
            }),
            shape(v1::shape_size::Shape::Box(v1::BoxShape { low: point(0.0), high: point(1.0) })),
            shape(v1::shape_size::Shape::Sphere(v1::SphereShape { center: point(0.0), radius: 1.0 })),
            shape(v1::shape_size::Shape::Cylinder(v1::CylinderShape { start: point(0.0), end: point(1.0), radius: 1.0 })),
            Field::Distance(v1::DistanceSize {
                from: Some(v1::distance_size::From::Curves(v1::SurfaceCurves::Boundary.into())),
                size: 0.2,
                reach: 0.5,
                growth_rate: Some(1.5),
            }),
        ];
        let given = of(fields);
        assert_eq!(wire(&size(&engine, &given).expect("good")), given);
    }

    #[test]
    fn bad_fields_are_named() {
        let engine = Engine::new(EngineConfig::default());
        let lines = |points: &[f64], counts: &[u32]| {
            let from = v1::distance_size::From::Polylines(v1::Polylines { points: packed(points), counts: counts.to_vec() });
            Field::Distance(v1::DistanceSize { from: Some(from), size: 0.1, ..Default::default() })
        };
        let patch = |patch| Field::Patch(v1::PatchSize { patch: Some(patch), size: 0.2 });
        let short = v1::Centerline { points: packed(&[0.0; 6]), radii: packed(&[1.0]) };
        let cases = [
            (Field::Region(v1::RegionSize::default()), "region.region"),
            (patch(v1::patch_size::Patch::Identity("xyz".into())), "patch.identity"),
            (patch(v1::patch_size::Patch::Number(0)), "patch.number"),
            (Field::PerVertex(v1::PackedArray::default()), "per_vertex.sizes"),
            (Field::Curvature(v1::CurvatureSize::default()), "curvature.normal_angle"),
            (Field::Proximity(v1::ProximitySize { elements_per_gap: 1.0, sides: 9, reach: None }), "proximity.sides"),
            (Field::Thickness(v1::ThicknessSize { elements: f64::NAN }), "thickness.elements"),
            (
                Field::Centerline(v1::CenterlineSize { lines: vec![short], elements_around: 9.0, ..Default::default() }),
                "centerline.lines[0].radii",
            ),
            (Field::Shape(v1::ShapeSize::default()), "shape"),
            (lines(&[0.0; 6], &[3]), "distance.polylines.counts"),
            (lines(&[], &[]), "distance.polylines"),
            (Field::Distance(v1::DistanceSize::default()), "distance.from"),
        ];
        for (field, name) in cases {
            let error = size(&engine, &of(vec![field])).expect_err(name);
            let told = error.metadata().iter().find(|(key, _)| key == "field").map(|(_, path)| path.clone());
            assert_eq!((error.reason(), told), (Reason::BadParameter, Some(format!("size.composed.fields[0].{name}"))));
        }
        let many = of(vec![Field::Thickness(v1::ThicknessSize { elements: 1.0 }); MAX_FIELDS + 1]);
        assert_eq!(size(&engine, &many).expect_err("many").reason(), Reason::LimitReached);
    }
}
