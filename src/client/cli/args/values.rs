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
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourBy {
    Patch,
    Kappa,
    Region,
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

pub(super) fn session_name(text: &str) -> Result<String, String> {
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
    fn names_and_times_are_read() {
        assert_eq!(session_name("abc"), Ok("sessions/abc".into()));
        assert_eq!(session_name("sessions/abc"), Ok("sessions/abc".into()));
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("2h"), Ok(Duration::from_secs(7200)));
        assert!(duration("0").is_err() && duration("h").is_err() && duration("99999999999d").is_err());
    }
}
