//! Values on the command line: the choices, and the parsers of numbers, names and times.

use clap::ValueEnum;
use std::time::Duration;

/// Sharp edges by angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FeatureAngle {
    /// At least so many degrees.
    Degrees(f64),
    /// None.
    None,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Encoding {
    Ascii,
    Binary,
    Msh22,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReadFormat {
    Stl,
    Obj,
    Ply,
    Off,
    Msh,
    #[value(alias = "glb")]
    Gltf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Unit {
    M,
    Cm,
    Mm,
    #[value(alias = "micrometre", alias = "micron")]
    Um,
    Inch,
    Foot,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ObjRegions {
    Group,
    Object,
    Material,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ChartMethod {
    Auto,
    Spectral,
    Lscm,
    MeanValue,
    Harmonic,
    Barycentric,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PartitionStrategy {
    /// The engine chooses the fewest patches among the strategies that fit the shape
    Auto,
    /// Recursive cuts of the dual graph
    Multilevel,
    /// Two-way cuts through the centres of harmonic maps at many scales
    Laplace,
    /// Two-way cuts by one line in one map, for comparison; fails on long patches
    MaxCut,
    /// Along short loops around or along handles
    Handles,
    /// Into parts with three loops (pants decomposition)
    Pants,
    /// By a plane through the handles
    Plane,
}

/// What lies on the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FitChoice {
    /// Faces lie to both sides: volumes are kept, distances least
    Faces,
    /// Vertices lie on it, faces below its bulges
    Vertices,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BorderChoice {
    /// Faces change patches where that straightens a border
    Vote,
    /// Then borders are laid along shortest paths within a band
    Shortest,
    /// Then borders are shortened over the surface, and triangles are split along them
    Geodesic,
}

/// A plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlaneArg {
    pub(crate) point: [f64; 3],
    pub(crate) normal: [f64; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum HoleChoice {
    /// Open, then centre, then plane: whatever passes the checks first
    Auto,
    /// Free
    Open,
    /// Filled with a vertex in the centre
    Centre,
    /// Filled with a mesh of the mean plane
    Plane,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PinChoice {
    Auto,
    /// The two boundary vertices farthest apart
    Farthest,
    /// The ends of the principal axis of inertia
    Inertia,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SpacingChoice {
    /// By length along the curve
    Arc,
    /// By distance of consecutive points
    Chord,
}

/// Which loop becomes the outer boundary of a chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OuterLoop {
    Longest,
    Through(u32),
}

/// A vertex that is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PinArg {
    pub(crate) vertex: u32,
    pub(crate) target: Option<[f64; 2]>,
}

/// The curve that the outer loop is put on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum BoundaryCurve {
    Circle,
    Ellipse(f64),
    Rectangle(Option<f64>),
    Polygon(Vec<[f64; 2]>),
    MeanPlane,
}

/// Which boundary vertices stay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum LockChoice {
    Nothing,
    Boundary,
    Loops(Vec<u32>),
    Vertices(Vec<u32>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourBy {
    Patch,
    Kappa,
    Region,
    /// Wanted edge length (needs a size)
    Size,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    Y,
    Z,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SampleName {
    /// Arterial tree with open outlets, marching cubes style
    Artery,
    /// Closed body with handles, marching cubes style
    Pelvis,
    /// Ventilated brake disc of high genus
    Brake,
    /// CAD part with sharp edges, slivers and named regions
    #[value(alias = "cad")]
    CadPart,
    /// Tube, open at both ends
    Tube,
    /// Struts along the net of a gyroid, of high genus, marching cubes style
    Lattice,
}

fn number(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value.is_finite() { Ok(value) } else { Err("not finite".into()) }
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|value| if value > 0.0 { Ok(value) } else { Err("must be greater than 0".into()) })
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|value| if value >= 0.0 { Ok(value) } else { Err("must not be negative".into()) })
}

pub(super) fn feature_angle(text: &str) -> Result<FeatureAngle, String> {
    if text.eq_ignore_ascii_case("none") {
        return Ok(FeatureAngle::None);
    }
    match number(text) {
        Ok(value) if value > 0.0 && value < 180.0 => Ok(FeatureAngle::Degrees(value)),
        _ => Err("must be between 0 and 180 degrees, or `none`".into()),
    }
}

/// How a patch is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SplitChoice {
    /// Along a short cut, with about half of the area on either side
    Balanced,
    /// Through the centres of harmonic maps at many scales: long patches lengthwise
    Laplace,
}

/// A compound, or the word for no compound at all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum RegionListArg {
    Regions(Vec<i64>),
    None,
}

pub(super) fn region_list(text: &str) -> Result<RegionListArg, String> {
    if text == "none" {
        return Ok(RegionListArg::None);
    }
    let number = |part: &str| part.trim().parse::<i64>().map_err(|_| format!("'{part}' is not a region number"));
    text.split(',').map(number).collect::<Result<_, _>>().map(RegionListArg::Regions)
}

/// A positive number, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LimitArg {
    Below(f64),
    None,
}

pub(super) fn limit(text: &str) -> Result<LimitArg, String> {
    if text == "none" { Ok(LimitArg::None) } else { positive(text).map(LimitArg::Below) }
}

/// `x,y,z,nx,ny,nz`.
pub(super) fn plane(text: &str) -> Result<PlaneArg, String> {
    let numbers: Vec<f64> = text.split(',').map(|part| number(part.trim())).collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, z, nx, ny, nz] if [nx, ny, nz] != [0.0; 3] => Ok(PlaneArg { point: [x, y, z], normal: [nx, ny, nz] }),
        [_, _, _, _, _, _] => Err("the normal must not be 0".into()),
        _ => Err(format!("'{text}' is not a plane x,y,z,nx,ny,nz")),
    }
}

/// `none`, `boundary`, `loops:1,2`, `vertices:1,2`.
pub(super) fn lock(text: &str) -> Result<LockChoice, String> {
    let vertices = |list: &str| list.split(',').map(|v| vertex(v.trim())).collect::<Result<Vec<u32>, String>>();
    match text.split_once(':') {
        None if text == "none" => Ok(LockChoice::Nothing),
        None if text == "boundary" => Ok(LockChoice::Boundary),
        Some(("loops", list)) => vertices(list).map(LockChoice::Loops),
        Some(("vertices", list)) => vertices(list).map(LockChoice::Vertices),
        _ => Err("use none, boundary, loops:V,... or vertices:V,...".into()),
    }
}

fn point(text: &str) -> Result<[f64; 2], String> {
    let (u, v) = text.split_once(',').ok_or_else(|| format!("'{text}' is not a point u,v"))?;
    Ok([number(u.trim())?, number(v.trim())?])
}

fn vertex(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| format!("'{text}' is not a vertex number"))
}

pub(super) fn outer_loop(text: &str) -> Result<OuterLoop, String> {
    if text == "longest" { Ok(OuterLoop::Longest) } else { vertex(text).map(OuterLoop::Through) }
}

/// `17` or `17:0.5,-2`.
pub(super) fn pin(text: &str) -> Result<PinArg, String> {
    match text.split_once(':') {
        None => Ok(PinArg { vertex: vertex(text)?, target: None }),
        Some((name, target)) => Ok(PinArg { vertex: vertex(name)?, target: Some(point(target)?) }),
    }
}

/// `circle`, `ellipse:2`, `square`, `rectangle`, `rectangle:1.5`, `polygon:0,0;1,0;0,1`, `mean-plane`.
pub(super) fn boundary(text: &str) -> Result<BoundaryCurve, String> {
    let (name, value) = text.split_once(':').map_or((text, None), |(name, value)| (name, Some(value)));
    match (name, value) {
        ("circle", None) => Ok(BoundaryCurve::Circle),
        ("square", None) => Ok(BoundaryCurve::Rectangle(Some(1.0))),
        ("mean-plane", None) => Ok(BoundaryCurve::MeanPlane),
        ("rectangle", ratio) => Ok(BoundaryCurve::Rectangle(ratio.map(positive).transpose()?)),
        ("ellipse", Some(ratio)) => positive(ratio).map(BoundaryCurve::Ellipse),
        ("polygon", Some(points)) => points.split(';').map(point).collect::<Result<_, _>>().map(BoundaryCurve::Polygon),
        _ => Err("use circle, ellipse:R, square, rectangle[:R], polygon:u,v;u,v;u,v or mean-plane".into()),
    }
}

/// Whether the positional argument of `remesh chart` names a session rather than a file.
pub(crate) fn names_session(text: &str) -> bool {
    text.starts_with("sessions/") || !text.contains(['.', '/', '\\'])
}

pub(crate) fn session_name(text: &str) -> Result<String, String> {
    let id = text.strip_prefix("sessions/").unwrap_or(text);
    if id.is_empty() || id.contains('/') || id.chars().any(char::is_whitespace) {
        return Err("expected sessions/ID or ID".into());
    }
    Ok(format!("sessions/{id}"))
}

/// `90`, `90s`, `30m`, `2h`, `1d`.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit: u64 = match &text[digits.len()..] {
        "" | "s" => 1,
        "m" | "min" => 60,
        "h" => 3600,
        "d" => 86_400,
        other => return Err(format!("unknown unit '{other}'; use s, m, h or d")),
    };
    let count: u64 = digits.parse().map_err(|_| "expected a time such as 90s, 30m, 2h or 1d".to_owned())?;
    match count.checked_mul(unit) {
        Some(seconds) if seconds > 0 && seconds <= u64::from(u32::MAX) => Ok(Duration::from_secs(seconds)),
        _ => Err("out of range".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_of_charts_are_read() {
        assert_eq!(pin("17"), Ok(PinArg { vertex: 17, target: None }));
        assert_eq!(pin("17:0.5,-2"), Ok(PinArg { vertex: 17, target: Some([0.5, -2.0]) }));
        assert_eq!(boundary("square"), Ok(BoundaryCurve::Rectangle(Some(1.0))));
        assert_eq!(boundary("rectangle"), Ok(BoundaryCurve::Rectangle(None)));
        assert_eq!(boundary("polygon:0,0;1,0;0,1"), Ok(BoundaryCurve::Polygon(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])));
        assert_eq!(lock("loops:3, 4"), Ok(LockChoice::Loops(vec![3, 4])));
        assert!(["", "loops", "loops:", "vertices:1,-2", "all"].iter().all(|bad| lock(bad).is_err()));
        assert_eq!(outer_loop("longest"), Ok(OuterLoop::Longest));
        for bad in ["", "-1", "3:", "3:1", "3:nan,0", "3:1,2,3", "3:inf,0"] {
            assert!(pin(bad).is_err(), "{bad}");
        }
        for bad in ["", "ellipse", "ellipse:0", "circle:2", "polygon:0,0;1", "rectangle:-1", "heart"] {
            assert!(boundary(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_and_times_are_read() {
        assert_eq!(session_name("abc"), Ok("sessions/abc".into()));
        assert_eq!(session_name("sessions/abc"), Ok("sessions/abc".into()));
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("2h"), Ok(Duration::from_secs(7200)));
        assert!(names_session("a1b2") && names_session("sessions/a1") && !names_session("a.stl") && !names_session("./a"));
        assert!(duration("0").is_err() && duration("h").is_err() && duration("99999999999d").is_err());
    }
}
