//! Pictures of charts: one in the plane, or the pattern of one or all on the surface in space.

use super::{BEFORE, EDGE, borders, columns, distinct, face_colours, view};
use crate::cli::args::{ColourBy, RenderArgs};
use crate::cli::context::Context;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::{specs, summary};
use crate::{ChartData, v1};
use remesh_render::{
    Chart, FLIPPED, FaceColours, Image, Pattern, Rgb, Scene, SurfacePattern, categorical, chart_extent, render_chart, render_surface,
};
use std::collections::BTreeSet;

/// Below iso lines, which have colours of their own.
const PALE: Rgb = [236, 238, 242];
/// Fields of the checkerboard on a surface if no pattern is asked for.
const FIELDS: u32 = 20;

fn has_pattern(args: &RenderArgs) -> bool {
    args.checker.is_some() || args.iso.is_some()
}

/// Half way to white: dark fields must be seen on it.
fn light(colour: Rgb) -> Rgb {
    colour.map(|c| 128 + c / 2)
}

/// Options that would be ignored are told.
pub(super) fn check(args: &RenderArgs) -> Outcome<()> {
    if has_pattern(args) && args.chart.is_none() && !args.chart_on_surface {
        return Err(Failure::Usage("--checker and --iso are for --chart PATCH or --chart-on-surface".into()));
    }
    if !specs::chart_edit(&args.spec)?.paths.is_empty() && args.chart.is_none() {
        return Err(Failure::Usage("chart options are for one patch: name it with --chart PATCH".into()));
    }
    Ok(())
}

/// The chart of a patch, or the one it would have.
async fn read(context: &Context, args: &RenderArgs, session: &str, patch: u32) -> Outcome<ChartData> {
    let edit = specs::chart_edit(&args.spec)?;
    if edit.paths.is_empty() {
        return Ok(context.client.read_chart(session, patch).await?);
    }
    let preview = context.client.preview_chart(session, patch, edit).await?;
    let why = preview.error.map(|error| error.message).unwrap_or_default();
    if preview.chart.uv.is_empty() {
        return Err(Failure::Other(format!("there is no map to draw: {why}")));
    }
    if preview.verdict != v1::ChartVerdict::Usable {
        context.ui.warn(&format!("the chart is not usable: {why}"));
    }
    Ok(preview.chart)
}

/// The pattern asked for, in units of charts whose longest side is `extent`.
fn pattern(args: &RenderArgs, extent: f64) -> Option<Pattern> {
    let part = |count: Option<u32>| count.map(|n| extent / f64::from(n));
    let pattern = Pattern { checkers: part(args.checker), iso: part(args.iso) };
    (extent > 0.0 && pattern != Pattern::default()).then_some(pattern)
}

pub(super) async fn draw_in_plane(context: &Context, args: &RenderArgs, session: &str, patch: u32) -> Outcome<(Image, String)> {
    let chart = read(context, args, session, patch).await?;
    let colours = match args.by {
        ColourBy::Patch => {
            let plain = if has_pattern(args) { light(categorical(patch)) } else { categorical(patch) };
            vec![if args.iso.is_some() { PALE } else { plain }; chart.triangles.len()]
        }
        by => {
            let input = context.client.read_mesh(session, v1::MeshSource::Input, columns(by)).await?;
            let whole = face_colours(&input, by);
            chart.source_face.iter().map(|&face| whole.get(face as usize).copied().unwrap_or(BEFORE)).collect()
        }
    };
    let title = title(&chart);
    let mut picture = Chart::new(&chart.uv, &chart.triangles);
    picture.colours = FaceColours::PerFace(&colours);
    picture.pattern = pattern(args, chart_extent(&chart.uv));
    // Edges would hide a pattern.
    if picture.pattern.is_some() && !args.edges {
        picture.edges = None;
    }
    picture.title = Some(&title);
    picture.size = [args.width, args.height];
    Ok((render_chart(&picture)?, title))
}

fn title(chart: &ChartData) -> String {
    let method = summary::chart_method_name(chart.summary.method());
    let triangles = summary::count(chart.triangles.len() as u64, "triangle", "triangles");
    let distortion = chart.summary.distortion.unwrap_or_default();
    format!("patch {}: {method} chart of {triangles}, angle distortion mean {:.3}", chart.summary.patch, distortion.angle_mean)
}

pub(super) async fn draw_on_surface(context: &Context, args: &RenderArgs, session: &str, name: &str) -> Outcome<(Image, String)> {
    let wanted = columns(args.by);
    let mesh = context.client.read_mesh(session, v1::MeshSource::Input, crate::MeshColumns { patch: true, ..wanted }).await?;
    let patches: Vec<u32> = match args.chart {
        Some(patch) => vec![patch],
        None => mesh.patch.iter().copied().collect::<BTreeSet<_>>().into_iter().collect(),
    };
    let mut colours = match args.by {
        ColourBy::Patch if args.iso.is_some() => vec![PALE; mesh.triangles.len()],
        ColourBy::Patch => mesh.patch.iter().map(|&patch| light(categorical(patch))).collect(),
        by => face_colours(&mesh, by),
    };
    let mut corner_uv = vec![None; mesh.triangles.len()];
    let (mut extent, mut flips, mut methods) = (0.0f64, 0, Vec::new());
    for &patch in &patches {
        let chart = read(context, args, session, patch).await?;
        extent = extent.max(chart_extent(&chart.uv));
        for ((&face, corners), &is_flipped) in chart.source_face.iter().zip(&chart.triangles).zip(&chart.flipped) {
            let Some(place) = corner_uv.get_mut(face as usize) else { continue };
            *place = Some(corners.map(|v| chart.uv[v as usize]));
            if is_flipped {
                colours[face as usize] = FLIPPED;
                flips += 1;
            }
        }
        methods.push(chart.summary);
    }
    if args.chart.is_some() && args.by == ColourBy::Patch {
        colours.iter_mut().zip(&corner_uv).filter(|(_, uv)| uv.is_none()).for_each(|(colour, _)| *colour = BEFORE);
    }
    let fallback = Pattern { checkers: Some(extent / f64::from(FIELDS)), iso: None };
    let asked = if has_pattern(args) { pattern(args, extent) } else { (extent > 0.0).then_some(fallback) };
    let flipped = if flips > 0 { format!(", {} flipped", summary::count(flips, "face", "faces")) } else { String::new() };
    let of = summary::count(distinct(&mesh.patch), "patch", "patches");
    let title = format!("{name}: charts of {} of {of} ({}){flipped}", patches.len(), summary::chart_methods(&methods));
    let curves = borders(&mesh.triangles, &mesh.patch);
    let mut scene = Scene::new(&mesh.positions, &mesh.triangles);
    scene.colours = FaceColours::PerFace(&colours);
    scene.pattern = asked.map(|pattern| SurfacePattern { corner_uv: &corner_uv, pattern });
    scene.edges = args.edges.then_some(EDGE);
    scene.curves = &curves;
    scene.title = Some(&title);
    Ok((render_surface(&scene, &view(args))?, title))
}
