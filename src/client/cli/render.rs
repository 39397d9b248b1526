//! `remesh render`: pictures of a surface, a chart or the quality histogram, from arrays read over the protocol.

mod chart;

use super::args::{ColourBy, RenderArgs, Up};
use super::context::Context;
use super::failure::{Failure, Outcome};
use super::files::{self, Target};
use super::ui::Report;
use super::{specs, summary};
use crate::{MeshColumns, MeshData, v1};
use remesh_render::{
    FaceColours, Histogram, Image, Legend, LineStyle, RenderError, Rgb, Scene, Series, UpAxis, View, categorical, encode_png,
    quality_colour, render_histogram, render_surface,
};
use serde_json::json;
use std::collections::BTreeSet;

const BEFORE: Rgb = [178, 178, 178];
const AFTER: Rgb = [31, 119, 180];
const EDGE: LineStyle = LineStyle { width: 0.8, colour: [40, 40, 40] };

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        Failure::Other(format!("cannot draw: {error}"))
    }
}

pub(crate) async fn render(context: &Context, args: &RenderArgs) -> Outcome<Report> {
    let is_png = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if !is_png {
        return Err(Failure::Usage(format!("{} must end in .png", args.output.display())));
    }
    let target = Target::new(&args.output, &args.file.iter().map(|file| file.as_path()).collect::<Vec<_>>())?;
    chart::check(args)?;
    let (session, name) = prepare(context, args).await?;
    let (png, what) = if args.histogram {
        let _spinner = context.ui.spinner("remesh");
        (histogram_png(context, &session, Some([args.width, args.height])).await?, "histogram of kappa before and after".to_owned())
    } else if args.chart_on_surface {
        let (image, what) = chart::draw_on_surface(context, args, &session, &name).await?;
        (encode_png(&image)?, what)
    } else if let Some(patch) = args.chart {
        let (image, what) = chart::draw_in_plane(context, args, &session, patch).await?;
        (encode_png(&image)?, what)
    } else {
        let (image, what) = draw_surface(context, args, &session, &name).await?;
        (encode_png(&image)?, what)
    };
    target.write(&png)?;
    let text = summary::line("drew", what.as_str()) + &summary::line("wrote", target.path().display());
    Ok(Report { text, json: json!({ "drew": what, "output": { "path": target.path().display().to_string(), "bytes": png.len() } }) })
}

/// The session to draw from, with its inputs set, and what to call it.
async fn prepare(context: &Context, args: &RenderArgs) -> Outcome<(String, String)> {
    if let Some(session) = &args.session {
        return Ok((session.clone(), session.clone()));
    }
    let Some(file) = &args.file else { return Err(Failure::Usage("which file?".into())) };
    let choice = specs::size_choice(&args.size)?;
    let needs_result = args.result || args.histogram;
    if needs_result && choice.is_none() {
        return Err(specs::missing_size());
    }
    let by_size = args.by == ColourBy::Size;
    if by_size && choice.is_none() {
        return Err(specs::missing_size());
    }
    if choice.is_some() && !needs_result && !by_size {
        return Err(Failure::Usage("a size is for --result, --histogram or --by size; the input is drawn as it is".into()));
    }
    let session = context.temporary_session(&format!("remesh render {}", files::short_name(file))).await?;
    let needs_soundness =
        needs_result || args.chart.is_some() || args.chart_on_surface || matches!(args.by, ColourBy::Patch | ColourBy::Size);
    if needs_soundness {
        context.import_sound(&session, file, &args.import).await?;
    } else {
        context.import_file(&session, file, &args.import).await?;
    }
    let mut changes = specs::changes(&context.client, &args.inputs, None, &v1::SessionInputs::default()).await?;
    if let Some(choice) = choice {
        changes.push(v1::change::Change::Size(specs::size_spec(&context.client, choice).await?));
    }
    context.apply_all(&session, changes).await?;
    if needs_result {
        let bar = context.ui.bar("remesh");
        context.client.remesh(&session, &[], |progress| bar.progress(progress)).await?;
    }
    Ok((session, files::short_name(file)))
}

fn columns(by: ColourBy) -> MeshColumns {
    match by {
        ColourBy::Patch => MeshColumns { patch: true, ..Default::default() },
        ColourBy::Kappa => MeshColumns { kappa: true, ..Default::default() },
        ColourBy::Region => MeshColumns { region: true, ..Default::default() },
        ColourBy::Size => MeshColumns { size: true, ..Default::default() },
    }
}

fn view(args: &RenderArgs) -> View {
    let up = match args.up {
        Up::Y => UpAxis::Y,
        Up::Z => UpAxis::Z,
    };
    View { width: args.width, height: args.height, azimuth: args.azimuth, elevation: args.elevation, up, ..Default::default() }
}

async fn draw_surface(context: &Context, args: &RenderArgs, session: &str, name: &str) -> Outcome<(Image, String)> {
    let source = if args.result { v1::MeshSource::Result } else { v1::MeshSource::Input };
    let mesh = context.client.read_mesh(session, source, columns(args.by)).await?;
    let colours = face_colours(&mesh, args.by);
    let curves = match args.by {
        ColourBy::Patch => borders(&mesh.triangles, &mesh.patch),
        ColourBy::Region => borders(&mesh.triangles, &mesh.region),
        ColourBy::Kappa | ColourBy::Size => Vec::new(),
    };
    let legend = legend(&mesh, args.by);
    let triangles = match mesh.quads {
        0 => summary::count(mesh.triangles.len() as u64, "triangle", "triangles"),
        quads => summary::count(quads, "quadrangle", "quadrangles"),
    };
    let title = match args.by {
        ColourBy::Patch => format!("{name}: {triangles}, {}", summary::count(distinct(&mesh.patch), "patch", "patches")),
        ColourBy::Region => format!("{name}: {triangles}, {}", summary::count(distinct(&mesh.region), "region", "regions")),
        ColourBy::Kappa => format!("{name}: {triangles}, kappa mean {:.3}", mean(&mesh.kappa)),
        ColourBy::Size => format!("{name}: {triangles}, sizes {:.4} to {:.4}", range(&mesh.size)[0], range(&mesh.size)[1]),
    };
    let mut scene = Scene::new(&mesh.positions, &mesh.triangles);
    scene.colours = FaceColours::PerFace(&colours);
    scene.edges = args.edges.then_some(EDGE);
    scene.quads = mesh.quads as usize;
    scene.curves = &curves;
    scene.title = Some(&title);
    scene.legend = legend.as_ref();
    Ok((render_surface(&scene, &view(args))?, title))
}

fn face_colours(mesh: &MeshData, by: ColourBy) -> Vec<Rgb> {
    match by {
        ColourBy::Patch => mesh.patch.iter().map(|&patch| categorical(patch)).collect(),
        ColourBy::Region => mesh.region.iter().map(|&region| categorical(region)).collect(),
        ColourBy::Kappa => mesh.kappa.iter().map(|&kappa| quality_colour(kappa)).collect(),
        ColourBy::Size => {
            // Equal ratios are equal steps of colour.
            let [low, high] = range(&mesh.size);
            let place = |t: &[u32; 3]| {
                let size = t.iter().map(|&v| mesh.size.get(v as usize).copied().unwrap_or(low)).sum::<f64>() / 3.0;
                if high > low { (size / low).ln() / (high / low).ln() } else { 1.0 }
            };
            mesh.triangles.iter().map(|t| quality_colour(place(t))).collect()
        }
    }
}

fn legend(mesh: &MeshData, by: ColourBy) -> Option<Legend> {
    match by {
        ColourBy::Patch => None,
        ColourBy::Kappa => Some(Legend::QualityBar { label: "kappa".into(), low: 0.0, high: 1.0 }),
        ColourBy::Size => {
            let [low, high] = range(&mesh.size).map(rounded);
            Some(Legend::QualityBar { label: "size, log".into(), low, high })
        }
        ColourBy::Region => {
            let named = mesh.regions.iter().zip(0..).map(|(region, index)| (summary::region_name(region), categorical(index)));
            Some(Legend::Names(named.collect()))
        }
    }
}

fn distinct(labels: &[u32]) -> u64 {
    labels.iter().collect::<BTreeSet<_>>().len() as u64
}

/// To three digits, for a legend.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Smallest and largest.
fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, 0.0], |[low, high], &x| [low.min(x), high.max(x)])
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Edges whose faces have different labels.
fn borders(triangles: &[[u32; 3]], labels: &[u32]) -> Vec<[u32; 2]> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(triangles.len() * 3);
    for (&[a, b, c], &label) in triangles.iter().zip(labels) {
        edges.extend([[a, b], [b, c], [c, a]].map(|[u, v]| ([u.min(v), u.max(v)], label)));
    }
    edges.sort_unstable();
    let mut found: Vec<[u32; 2]> = edges.windows(2).filter(|w| w[0].0 == w[1].0 && w[0].1 != w[1].1).map(|w| w[0].0).collect();
    found.dedup();
    found
}

/// The histogram of kappa before and after remeshing as PNG; without a size in the usual one.
pub(crate) async fn histogram_png(context: &Context, session: &str, size: Option<[u32; 2]>) -> Outcome<Vec<u8>> {
    let kappa = columns(ColourBy::Kappa);
    let before = context.client.read_mesh(session, v1::MeshSource::Input, kappa).await?.kappa;
    let after = context.client.read_mesh(session, v1::MeshSource::Result, kappa).await?.kappa;
    let series = [Series { label: "before", values: &before, colour: BEFORE }, Series { label: "after", values: &after, colour: AFTER }];
    let mut histogram = Histogram::of_quality("Quality of the triangles before and after remeshing", &series);
    histogram.size = size.unwrap_or(histogram.size);
    Ok(encode_png(&render_histogram(&histogram)?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_are_where_labels_differ() {
        let triangles = [[0, 1, 2], [2, 1, 3], [3, 1, 4]];
        assert_eq!(borders(&triangles, &[5, 5, 9]), [[1, 3]]);
        assert!(borders(&triangles, &[1, 1, 1]).is_empty());
    }
}
