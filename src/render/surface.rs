//! Pictures of surfaces: orthographic view, flat shading from a light beside the camera, edges, thick curves, a legend.

use crate::colour::{INK, Rgb, WHITE, lit, mix, quality_colour};
use crate::error::{RenderError, Result};
use crate::image::Image;
use crate::pattern::{Pattern, PlaneMap};
use crate::raster::{EdgeInk, supersampled};
use crate::text::{Anchor, Font};

/// Colours of the faces.
#[derive(Debug, Clone, Copy)]
pub enum FaceColours<'a> {
    /// All faces alike.
    Uniform(Rgb),
    /// One colour a face.
    PerFace(&'a [Rgb]),
}

/// A line: width in pixels of the finished picture, and colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineStyle {
    /// Width in pixels, above 0 and at most 100.
    pub width: f64,
    /// Colour.
    pub colour: Rgb,
}

/// A legend in the lower left corner.
#[derive(Debug, Clone)]
pub enum Legend {
    /// The bar of [`quality_colour`] from `low` to `high` under a label.
    QualityBar {
        /// What is shown, for example `kappa`.
        label: String,
        /// Value at the red end.
        low: f64,
        /// Value at the blue end.
        high: f64,
    },
    /// Named colours; the first dozen are shown.
    Names(Vec<(String, Rgb)>),
}

/// The pattern of charts on a surface. Patches do not share coordinates, so every corner of a face has its own.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePattern<'a> {
    /// Plane coordinates of the corners of each face; `None` for faces that show no pattern.
    pub corner_uv: &'a [Option<[[f64; 2]; 3]>],
    /// The pattern.
    pub pattern: Pattern,
}

/// A surface to draw.
#[derive(Debug, Clone)]
pub struct Scene<'a> {
    /// Vertices.
    pub positions: &'a [[f64; 3]],
    /// Vertex indices of the faces; both sides are drawn, the inside (clockwise) darker.
    pub triangles: &'a [[u32; 3]],
    /// Face colours before shading.
    pub colours: FaceColours<'a>,
    /// A pattern that is laid over the colours.
    pub pattern: Option<SurfacePattern<'a>>,
    /// Style of all triangle edges, if they are drawn. Edges fade where triangles get as small as a few pixels.
    pub edges: Option<LineStyle>,
    /// For `q` below it faces `2 q` = (a, b, c) and `2 q + 1` = (a, c, d) are the halves of a quadrangle: their diagonal is no edge.
    pub quads: usize,
    /// Edges to draw thick over the surface: interface curves, features.
    pub curves: &'a [[u32; 2]],
    /// Style of `curves`.
    pub curve_style: LineStyle,
    /// A line of text at the top.
    pub title: Option<&'a str>,
    /// What the colours mean.
    pub legend: Option<&'a Legend>,
}

impl<'a> Scene<'a> {
    /// A plain surface without edges.
    pub fn new(positions: &'a [[f64; 3]], triangles: &'a [[u32; 3]]) -> Self {
        Scene {
            positions,
            triangles,
            colours: FaceColours::Uniform([196, 202, 210]),
            pattern: None,
            edges: None,
            quads: 0,
            curves: &[],
            curve_style: LineStyle { width: 2.5, colour: [16, 16, 24] },
            title: None,
            legend: None,
        }
    }
}

/// Which axis points up in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// The y axis, as most graphics meshes have it.
    Y,
    /// The z axis, as CAD and medical meshes have it.
    #[default]
    Z,
}

/// The picture and where it is taken from. The camera looks at the middle of the surface, which fills the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Degrees around the up axis.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub elevation: f64,
    /// Which way is up.
    pub up: UpAxis,
    /// Samples along each side of a pixel, 1 to 4.
    pub supersampling: u32,
    /// Colour behind the surface.
    pub background: Rgb,
}

impl Default for View {
    fn default() -> Self {
        View { width: 1200, height: 900, azimuth: -50.0, elevation: 28.0, up: UpAxis::Z, supersampling: 2, background: WHITE }
    }
}

/// Draws a surface. Cost: about the faces plus the samples covered; memory 7 bytes a sample, at most 170 MB beside the image.
///
/// # Errors
/// [`RenderError::Empty`], [`RenderError::NonFinite`], [`RenderError::IndexOutOfRange`], [`RenderError::LengthMismatch`],
/// [`RenderError::ImageSize`], [`RenderError::BadParameter`].
pub fn render_surface(scene: &Scene<'_>, view: &View) -> Result<Image> {
    let mut image = Image::filled(view.width, view.height, view.background)?;
    check(scene, view)?;
    let camera = Camera::fit(scene, view);
    let seen: Vec<[f64; 3]> = scene.positions.iter().map(|&p| camera.project(p)).collect();
    let samples = f64::from(view.supersampling);
    let ink = scene.edges.and_then(|style| edge_ink(style, &seen, scene.triangles, samples));
    supersampled(&mut image, view.supersampling, view.background, |band| {
        for (f, t) in scene.triangles.iter().enumerate() {
            let corners = t.map(|v| seen[v as usize]);
            let own = match scene.colours {
                FaceColours::Uniform(colour) => colour,
                FaceColours::PerFace(colours) => colours[f],
            };
            let light = Light::on(corners);
            let ink = ink.map(|ink| EdgeInk { sides: drawn_sides(f, scene.quads), ..ink });
            match scene.pattern.and_then(|p| Some((p.pattern, PlaneMap::of_triangle(corners, p.corner_uv[f]?)))) {
                None => {
                    let shaded = light.shade(own);
                    band.triangle(corners, ink, |_, _| shaded);
                }
                Some((pattern, map)) => band.triangle(corners, ink, |x, y| light.shade(pattern.paint(own, &map, x, y, samples))),
            }
        }
        let half_width = 0.5 * scene.curve_style.width * samples;
        for curve in scene.curves {
            let [from, to] = curve.map(|v| seen[v as usize]);
            band.line(from, to, half_width, 2.0 * half_width, scene.curve_style.colour);
        }
    });
    let font = Font::plain(view.width.max(view.height));
    if let Some(title) = scene.title {
        font.bold().draw(&mut image, title, 0.5 * f64::from(view.width), 8.0, Anchor::Middle, ink_on(view.background));
    }
    if let Some(legend) = scene.legend {
        draw_legend(&mut image, legend, font, ink_on(view.background));
    }
    Ok(image)
}

fn check(scene: &Scene<'_>, view: &View) -> Result<()> {
    if scene.triangles.is_empty() {
        return Err(RenderError::Empty { what: "surface" });
    }
    if let Some(index) = scene.positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(RenderError::NonFinite { what: "vertex", index });
    }
    let count = scene.positions.len();
    if let Some(index) = scene.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
        return Err(RenderError::IndexOutOfRange { what: "triangle", index });
    }
    if let Some(index) = scene.curves.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
        return Err(RenderError::IndexOutOfRange { what: "curve edge", index });
    }
    if let FaceColours::PerFace(colours) = scene.colours
        && colours.len() != scene.triangles.len()
    {
        return Err(RenderError::LengthMismatch { what: "face colours", found: colours.len(), expected: scene.triangles.len() });
    }
    if let Some(SurfacePattern { corner_uv, pattern }) = scene.pattern {
        pattern.check()?;
        if corner_uv.len() != scene.triangles.len() {
            return Err(RenderError::LengthMismatch { what: "chart corners", found: corner_uv.len(), expected: scene.triangles.len() });
        }
        let finite = |uv: &Option<[[f64; 2]; 3]>| uv.is_none_or(|uv| uv.as_flattened().iter().all(|x| x.is_finite()));
        if let Some(index) = corner_uv.iter().position(|uv| !finite(uv)) {
            return Err(RenderError::NonFinite { what: "chart of face", index });
        }
    }
    if !(1..=4).contains(&view.supersampling) {
        return Err(RenderError::BadParameter { what: "supersampling", value: f64::from(view.supersampling) });
    }
    for (what, value) in [("azimuth", view.azimuth), ("elevation", view.elevation)] {
        if !value.is_finite() {
            return Err(RenderError::BadParameter { what, value });
        }
    }
    let widths = scene.edges.iter().chain([&scene.curve_style]).map(|s| s.width);
    match widths.into_iter().find(|w| !(*w > 0.0 && *w <= 100.0)) {
        Some(value) => Err(RenderError::BadParameter { what: "line width", value }),
        None => Ok(()),
    }
}

/// Maps space to samples: x to the right, y down, third coordinate larger where nearer.
struct Camera {
    right: [f64; 3],
    up: [f64; 3],
    toward: [f64; 3],
    /// Middle of the surface along the three directions.
    middle: [f64; 3],
    scale: f64,
    centre: [f64; 2],
}

impl Camera {
    fn fit(scene: &Scene<'_>, view: &View) -> Camera {
        let (sa, ca) = view.azimuth.to_radians().sin_cos();
        let (se, ce) = view.elevation.to_radians().sin_cos();
        let turned = |v: [f64; 3]| match view.up {
            UpAxis::Z => v,
            UpAxis::Y => [v[1], v[2], v[0]],
        };
        let (toward, right, up) = (turned([ce * ca, ce * sa, se]), turned([-sa, ca, 0.0]), turned([-se * ca, -se * sa, ce]));
        let mut camera = Camera { right, up, toward, middle: [0.0; 3], scale: 1.0, centre: [0.0; 2] };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in scene.triangles.as_flattened().iter().map(|&v| camera.along(scene.positions[v as usize])) {
            low = std::array::from_fn(|k| low[k].min(p[k]));
            high = std::array::from_fn(|k| high[k].max(p[k]));
        }
        let samples = f64::from(view.supersampling);
        let size = [f64::from(view.width) * samples, f64::from(view.height) * samples];
        let line = f64::from(Font::plain(view.width.max(view.height)).line()) * samples;
        let top = if scene.title.is_some() { 1.4 * line } else { 0.0 };
        let bottom = if scene.legend.is_some() { 1.6 * line } else { 0.0 };
        let room = [0.94 * size[0], 0.94 * (size[1] - top - bottom).max(0.3 * size[1])];
        let extent = |k: usize| 0.5 * high[k] - 0.5 * low[k];
        let fits = (0.5 * room[0] / extent(0)).min(0.5 * room[1] / extent(1));
        camera.middle = std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
        camera.scale = if fits.is_finite() { fits } else { 1.0 };
        camera.centre = [0.5 * size[0], 0.5 * (size[1] + top - bottom)];
        camera
    }

    fn along(&self, p: [f64; 3]) -> [f64; 3] {
        [self.right, self.up, self.toward].map(|d| d[0] * p[0] + d[1] * p[1] + d[2] * p[2])
    }

    fn project(&self, p: [f64; 3]) -> [f64; 3] {
        let at = self.along(p);
        let q: [f64; 3] = std::array::from_fn(|k| (at[k] - self.middle[k]) * self.scale);
        [self.centre[0] + q[0], self.centre[1] - q[1], q[2]]
    }
}

/// Light on a face given in sample coordinates (y down), flat: a lamp up and left of the camera, the inside darker.
#[derive(Debug, Clone, Copy)]
enum Light {
    /// On a face that is seen edge-on.
    Full,
    /// On the outside, with its strength.
    Outside(f64),
    /// On the inside, with its strength.
    Inside(f64),
}

impl Light {
    fn on([a, b, c]: [[f64; 3]; 3]) -> Light {
        const LAMP: [f64; 3] = [-0.28, 0.47, 0.837];
        let edge = |q: [f64; 3]| [q[0] - a[0], a[1] - q[1], q[2] - a[2]];
        let (u, v) = (edge(b), edge(c));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if length == 0.0 || !length.is_finite() {
            return Light::Full;
        }
        let facing = (n[0] * LAMP[0] + n[1] * LAMP[1] + n[2] * LAMP[2]) / length;
        if n[2] >= 0.0 { Light::Outside(0.42 + 0.64 * facing.max(0.0)) } else { Light::Inside(0.30 + 0.36 * (-facing).max(0.0)) }
    }

    fn shade(self, colour: Rgb) -> Rgb {
        match self {
            Light::Full => colour,
            Light::Outside(strength) => lit(colour, strength),
            Light::Inside(strength) => mix(lit(colour, strength), [70, 50, 60], 0.35),
        }
    }
}

/// Edges of a face, by the corner opposite, without the diagonal if it is half of a quadrangle.
fn drawn_sides(face: usize, quads: usize) -> [bool; 3] {
    match (face < 2 * quads, face.is_multiple_of(2)) {
        (false, _) => [true; 3],
        (true, true) => [true, false, true],
        (true, false) => [true, true, false],
    }
}

/// Ink for the edges, weaker where the triangles of the picture are only a few pixels large; `None` where nothing would show.
fn edge_ink(style: LineStyle, seen: &[[f64; 3]], triangles: &[[u32; 3]], samples: f64) -> Option<EdgeInk> {
    let length = |a: [f64; 3], b: [f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let total: f64 =
        triangles.iter().map(|t| t.map(|v| seen[v as usize])).map(|[a, b, c]| length(a, b) + length(b, c) + length(c, a)).sum();
    let pixels = total / (3.0 * triangles.len() as f64 * samples);
    let strength = ((pixels / style.width.max(0.5) - 1.5) / 8.0).clamp(0.0, 0.85);
    let ink = EdgeInk { half_width: 0.5 * style.width * samples, colour: style.colour, strength, sides: [true; 3] };
    (strength > 0.0).then_some(ink)
}

fn ink_on(background: Rgb) -> Rgb {
    let light = background.iter().map(|&c| u32::from(c)).sum::<u32>() > 384;
    if light { INK } else { [232, 232, 238] }
}

fn draw_legend(image: &mut Image, legend: &Legend, font: Font, ink: Rgb) {
    let line = f64::from(font.line());
    let bottom = f64::from(image.height) - 0.5 * line;
    match legend {
        Legend::QualityBar { label, low, high } => {
            let (left, width) = (line, (0.28 * f64::from(image.width)).max(6.0 * line));
            let (top, base) = (bottom - 1.75 * line, bottom - 1.15 * line);
            for x in 0..width as u32 {
                let colour = quality_colour(f64::from(x) / width);
                image.rectangle([left + f64::from(x), top], [left + f64::from(x) + 1.0, base], colour);
            }
            font.draw(image, &format!("{low}"), left, base + 3.0, Anchor::Left, ink);
            font.draw(image, label, left + 0.5 * width, base + 3.0, Anchor::Middle, ink);
            font.draw(image, &format!("{high}"), left + width, base + 3.0, Anchor::Right, ink);
        }
        Legend::Names(names) => {
            let shown = &names[..names.len().min(12)];
            let mut top = bottom - line * shown.len() as f64;
            for (name, colour) in shown {
                image.rectangle([line, top + 3.0], [1.7 * line, top + 0.7 * line], *colour);
                font.draw(image, name, 2.0 * line, top, Anchor::Left, ink);
                top += line;
            }
        }
    }
}
