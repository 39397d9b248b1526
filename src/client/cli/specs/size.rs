//! Sizes on the command line put into messages; files are read and uploaded.

use super::packed;
use crate::arrays::pack_f64;
use crate::cli::args::{FieldArg, SizeArgs};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::files;
use crate::{Client, v1};
use std::path::Path;
use v1::size_field::Field;
use v1::size_spec::Size;

/// A size on the command line, before its files are read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum SizeChoice<'a> {
    Uniform(f64),
    Triangles(u64),
    PerVertex { file: &'a Path, min: Option<f64>, max: Option<f64>, growth: Option<f64> },
    Graded(v1::GradedSize),
    Composed(&'a SizeArgs),
}

/// Which of the ways to give a size was taken; `None` if there is no size on the command line.
pub(crate) fn size_choice(args: &SizeArgs) -> Outcome<Option<SizeChoice<'_>>> {
    let usage = |message: &str| Err(Failure::Usage(message.into()));
    let bounds = args.min_size.is_some() || args.max_size.is_some() || args.growth_rate.is_some();
    let composed = !args.fields.is_empty();
    let ways = [args.size.is_some(), args.triangles.is_some(), args.sizes.is_some() && !composed];
    if ways.iter().filter(|on| **on).count() > 1 {
        return usage("--size, --triangles and --sizes exclude one another");
    }
    if let (Some(min), Some(max)) = (args.min_size, args.max_size)
        && min > max
    {
        return usage("--min-size is greater than --max-size");
    }
    if composed {
        if args.size.is_none() && args.triangles.is_none() && args.max_size.is_none() {
            return usage("--field needs --size, --triangles or --max-size for where it asks for nothing");
        }
        return Ok(Some(SizeChoice::Composed(args)));
    }
    if bounds && (args.size.is_some() || args.triangles.is_some()) {
        return usage("--min-size, --max-size and --growth-rate do not go with --size or --triangles, unless there is a --field");
    }
    if let Some(size) = args.size {
        return Ok(Some(SizeChoice::Uniform(size)));
    }
    if let Some(triangles) = args.triangles {
        return Ok(Some(SizeChoice::Triangles(triangles)));
    }
    if let Some(file) = &args.sizes {
        return Ok(Some(SizeChoice::PerVertex { file, min: args.min_size, max: args.max_size, growth: args.growth_rate }));
    }
    match (args.min_size, args.max_size, args.growth_rate) {
        (None, None, None) => Ok(None),
        (Some(min_size), Some(max_size), Some(growth_rate)) => {
            Ok(Some(SizeChoice::Graded(v1::GradedSize { min_size, max_size, growth_rate })))
        }
        _ => usage("--min-size, --max-size and --growth-rate go together"),
    }
}

/// The message that a command without a size prints.
pub(crate) fn missing_size() -> Failure {
    Failure::Usage("which size? Give --size LENGTH, --triangles N, --sizes FILE, or --min-size, --max-size and --growth-rate".into())
}

/// The size spec; reads and uploads the files it names.
pub(crate) async fn size_spec(client: &Client, choice: SizeChoice<'_>) -> Outcome<v1::SizeSpec> {
    let size = match choice {
        SizeChoice::Uniform(length) => Size::Uniform(length),
        SizeChoice::Triangles(count) => Size::Triangles(count),
        SizeChoice::Graded(graded) => Size::Graded(graded),
        SizeChoice::PerVertex { file, min, max, growth } => {
            let sizes = packed(client, pack_f64(&files::read_numbers(file)?)).await?;
            Size::PerVertex(v1::PerVertexSize { sizes: Some(sizes), min_size: min, max_size: max, growth_rate: growth })
        }
        SizeChoice::Composed(args) => Size::Composed(composed(client, args).await?),
    };
    Ok(v1::SizeSpec { size: Some(size) })
}

async fn composed(client: &Client, args: &SizeArgs) -> Outcome<v1::ComposedSize> {
    use v1::composed_size::Base;
    let mut fields = Vec::new();
    for field in &args.fields {
        fields.push(v1::SizeField { field: Some(filled(client, field).await?) });
    }
    if let Some(file) = &args.sizes {
        let sizes = packed(client, pack_f64(&files::read_numbers(file)?)).await?;
        fields.push(v1::SizeField { field: Some(Field::PerVertex(sizes)) });
    }
    Ok(v1::ComposedSize {
        base: args.size.map(Base::Uniform).or(args.triangles.map(Base::Triangles)),
        fields,
        min_size: args.min_size,
        max_size: args.max_size,
        growth_rate: args.growth_rate,
    })
}

/// A field with what its file holds.
async fn filled(client: &Client, arg: &FieldArg) -> Outcome<Field> {
    use v1::distance_size::From;
    let mut field = arg.field.clone();
    let Some(file) = &arg.file else { return Ok(field) };
    match &mut field {
        Field::PerVertex(sizes) => *sizes = packed(client, pack_f64(&files::read_numbers(file)?)).await?,
        Field::Centerline(centerline) => {
            for line in files::read_polylines(file)? {
                let points = Some(packed(client, pack_f64(line.points.as_flattened())).await?);
                let radii = if line.radii.is_empty() { None } else { Some(packed(client, pack_f64(&line.radii)).await?) };
                centerline.lines.push(v1::Centerline { points, radii });
            }
        }
        Field::Distance(distance) => {
            let lines = files::read_polylines(file)?;
            let points: Vec<[f64; 3]> = lines.iter().flat_map(|line| line.points.iter().copied()).collect();
            let points = packed(client, pack_f64(points.as_flattened())).await?;
            distance.from = match distance.from {
                Some(From::Polylines(_)) => {
                    let counts = lines.iter().map(|line| line.points.len() as u32).collect();
                    Some(From::Polylines(v1::Polylines { points: Some(points), counts }))
                }
                _ => Some(From::Points(points)),
            };
        }
        _ => {}
    }
    Ok(field)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    #[test]
    fn one_way_to_give_a_size() {
        let args = |size, triangles, min, max, growth| SizeArgs {
            size,
            triangles,
            min_size: min,
            max_size: max,
            growth_rate: growth,
            ..Default::default()
        };
        let choice = |a: &SizeArgs| size_choice(a).map(|c| format!("{c:?}")).map_err(|e| e.exit_code());
        assert_eq!(choice(&args(None, None, None, None, None)), Ok("None".into()));
        assert_eq!(choice(&args(Some(1.5), None, None, None, None)), Ok("Some(Uniform(1.5))".into()));
        assert!(choice(&args(None, None, Some(0.1), Some(1.0), Some(1.2))).is_ok_and(|c| c.contains("Graded")));
        for bad in [
            args(Some(1.0), Some(10), None, None, None),
            args(Some(1.0), None, Some(0.5), None, None),
            args(None, None, Some(0.5), None, None),
            args(None, None, Some(2.0), Some(1.0), Some(1.2)),
        ] {
            assert_eq!(choice(&bad), Err(2), "{bad:?}");
        }
        let per_vertex = SizeArgs { sizes: Some(PathBuf::from("s.txt")), max_size: Some(2.0), ..Default::default() };
        assert!(matches!(size_choice(&per_vertex), Ok(Some(SizeChoice::PerVertex { max: Some(2.0), min: None, .. }))));
        let field = FieldArg { field: Field::Thickness(v1::ThicknessSize { elements: 3.0 }), file: None };
        let with_field = |args: SizeArgs| SizeArgs { fields: vec![field.clone()], ..args };
        assert!(choice(&with_field(args(Some(1.0), None, Some(0.5), None, Some(1.2)))).is_ok_and(|c| c.contains("Composed")));
        assert_eq!(choice(&with_field(args(None, None, Some(0.5), None, None))), Err(2));
        assert_eq!(choice(&with_field(args(Some(1.0), Some(5), None, None, None))), Err(2));
    }
}
