//! Pictures of charts: patches laid out in the plane, flipped faces in red, a pattern on request.

use crate::colour::{FLIPPED, INK, WHITE};
use crate::error::{RenderError, Result};
use crate::image::Image;
use crate::pattern::{Pattern, PlaneMap};
use crate::raster::{EdgeInk, supersampled};
use crate::surface::{FaceColours, LineStyle};
use crate::text::{Anchor, Font};

/// A chart to draw: a triangulation in the plane, u to the right and v up.
#[derive(Debug, Clone)]
pub struct Chart<'a> {
    /// Plane coordinates of the vertices.
    pub uv: &'a [[f64; 2]],
    /// Vertex indices of the faces; a clockwise face is flipped and drawn red, on top.
    pub triangles: &'a [[u32; 3]],
    /// Face colours.
    pub colours: FaceColours<'a>,
    /// Style of the triangle edges, if they are drawn.
    pub edges: Option<LineStyle>,
    /// A pattern that is laid over the colours.
    pub pattern: Option<Pattern>,
    /// A line of text at the top.
    pub title: Option<&'a str>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples along each side of a pixel, 1 to 4.
    pub supersampling: u32,
}

impl<'a> Chart<'a> {
    /// A chart with edges and the usual size.
    pub fn new(uv: &'a [[f64; 2]], triangles: &'a [[u32; 3]]) -> Self {
        Chart {
            uv,
            triangles,
            colours: FaceColours::Uniform([206, 216, 230]),
            edges: Some(LineStyle { width: 1.0, colour: INK }),
            pattern: None,
            title: None,
            size: [900, 900],
            supersampling: 3,
        }
    }
}

/// Draws a chart to fit the picture, with its boundary drawn bold and the number of flipped faces told if there are any.
///
/// # Errors
/// As [`crate::render_surface`]; [`RenderError::BadParameter`] also for a pattern without size.
pub fn render_chart(chart: &Chart<'_>) -> Result<Image> {
    let [width, height] = chart.size;
    let mut image = Image::filled(width, height, WHITE)?;
    check(chart)?;
    let samples = f64::from(chart.supersampling);
    let font = Font::plain(width.max(height));
    let (low, high) = bounds(chart);
    let top = if chart.title.is_some() { 1.4 * f64::from(font.line()) } else { 0.0 };
    let room = [0.94 * f64::from(width), 0.94 * (f64::from(height) - top).max(1.0)];
    let fits = samples * (room[0] / (high[0] - low[0])).min(room[1] / (high[1] - low[1]));
    let scale = if fits.is_finite() { fits } else { 1.0 };
    let centre = [0.5 * samples * f64::from(width), 0.5 * samples * (f64::from(height) + top)];
    let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let seen: Vec<[f64; 3]> =
        chart.uv.iter().map(|p| [centre[0] + scale * (p[0] - middle[0]), centre[1] - scale * (p[1] - middle[1]), 0.0]).collect();
    let plane = PlaneMap([[1.0 / scale, 0.0, middle[0] - centre[0] / scale], [0.0, -1.0 / scale, middle[1] + centre[1] / scale]]);
    let flipped: Vec<bool> = chart.triangles.iter().map(|t| is_flipped(t.map(|v| chart.uv[v as usize]))).collect();
    let ink = chart.edges.map(|e| EdgeInk { half_width: 0.5 * e.width * samples, colour: e.colour, strength: 0.75, sides: [true; 3] });
    let boundary = boundary_edges(chart.triangles);
    supersampled(&mut image, chart.supersampling, WHITE, |band| {
        for (f, t) in chart.triangles.iter().enumerate() {
            let nearness = if flipped[f] { 1.0 } else { 0.0 };
            let corners = t.map(|v| seen[v as usize]).map(|[x, y, _]| [x, y, nearness]);
            let own = match chart.colours {
                _ if flipped[f] => FLIPPED,
                FaceColours::Uniform(colour) => colour,
                FaceColours::PerFace(colours) => colours[f],
            };
            band.triangle(corners, ink, |x, y| chart.pattern.map_or(own, |pattern| pattern.paint(own, &plane, x, y, samples)));
        }
        for edge in &boundary {
            let [from, to] = edge.map(|v| seen[v as usize]);
            band.line(from, to, samples, 2.0, INK);
        }
    });
    if let Some(title) = chart.title {
        font.bold().draw(&mut image, title, 0.5 * f64::from(width), 8.0, Anchor::Middle, INK);
    }
    let count = flipped.iter().filter(|f| **f).count();
    if count > 0 {
        let y = f64::from(height) - f64::from(font.line());
        font.draw(&mut image, &format!("{count} flipped"), 12.0, y, Anchor::Left, FLIPPED);
    }
    Ok(image)
}

fn is_flipped([a, b, c]: [[f64; 2]; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0
}

fn bounds(chart: &Chart<'_>) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &v in chart.triangles.as_flattened() {
        let p = chart.uv[v as usize];
        low = [low[0].min(p[0]), low[1].min(p[1])];
        high = [high[0].max(p[0]), high[1].max(p[1])];
    }
    (low, high)
}

/// Edges of one face only.
fn boundary_edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> =
        triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|run| run.len() == 1).map(|run| run[0]).collect()
}

fn check(chart: &Chart<'_>) -> Result<()> {
    if chart.triangles.is_empty() {
        return Err(RenderError::Empty { what: "chart" });
    }
    if let Some(index) = chart.uv.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(RenderError::NonFinite { what: "chart vertex", index });
    }
    if let Some(index) = chart.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= chart.uv.len())) {
        return Err(RenderError::IndexOutOfRange { what: "triangle", index });
    }
    if let FaceColours::PerFace(colours) = chart.colours
        && colours.len() != chart.triangles.len()
    {
        return Err(RenderError::LengthMismatch { what: "face colours", found: colours.len(), expected: chart.triangles.len() });
    }
    if !(1..=4).contains(&chart.supersampling) {
        return Err(RenderError::BadParameter { what: "supersampling", value: f64::from(chart.supersampling) });
    }
    if let Some(edge) = chart.edges.filter(|e| !(e.width > 0.0 && e.width <= 100.0)) {
        return Err(RenderError::BadParameter { what: "line width", value: edge.width });
    }
    chart.pattern.map_or(Ok(()), |pattern| pattern.check())
}
