//! Colours: distinct ones for patches and regions, a quality scale, and their arithmetic in OKLab.

/// Red, green, blue, sRGB, 0 to 255.
pub type Rgb = [u8; 3];

pub(crate) const WHITE: Rgb = [255, 255, 255];
pub(crate) const INK: Rgb = [38, 38, 46];
pub(crate) const FAINT: Rgb = [222, 222, 226];
/// Faces of a chart that are turned over or flat.
pub const FLIPPED: Rgb = [214, 30, 30];

/// Lightness, chroma and hue in degrees (OKLCH) of the quality scale at equal steps from 0 to 1.
const QUALITY: [[f64; 3]; 5] = [[0.44, 0.17, 25.0], [0.63, 0.17, 42.0], [0.86, 0.14, 92.0], [0.76, 0.12, 165.0], [0.60, 0.12, 240.0]];

/// Colour of the patch or region `number`: hues by the golden angle, lightness in three steps, so that numbers close to one
/// another differ in both and stay apart for colour-blind readers. Any number has a colour.
pub fn categorical(number: u32) -> Rgb {
    let hue = 255.0 + 137.507_764 * f64::from(number % 1_000_000);
    let lightness = [0.70, 0.86, 0.55][number as usize % 3];
    let chroma = [0.11, 0.10, 0.12][number as usize % 3];
    from_oklch([lightness, chroma, hue])
}

/// Colour of a quality from 0 (bad, red) over yellow to 1 (good, blue); clamped. Red and blue ends differ in the blue channel
/// too, so the scale reads without red-green vision.
pub fn quality_colour(quality: f64) -> Rgb {
    let place = quality.clamp(0.0, 1.0) * (QUALITY.len() - 1) as f64;
    let step = if place.is_finite() { (place as usize).min(QUALITY.len() - 2) } else { 0 };
    let t = if place.is_finite() { place - step as f64 } else { 0.0 };
    let (a, b) = (QUALITY[step], QUALITY[step + 1]);
    from_oklch(std::array::from_fn(|k| a[k] + t * (b[k] - a[k])))
}

/// `(1 - share) a + share b` by channel.
pub(crate) fn mix(a: Rgb, b: Rgb, share: f64) -> Rgb {
    let s = share.clamp(0.0, 1.0);
    std::array::from_fn(|k| (f64::from(a[k]) + s * (f64::from(b[k]) - f64::from(a[k]))).round() as u8)
}

/// A colour under light of a strength: 1 leaves it, below darkens, above brightens toward white.
pub(crate) fn lit(colour: Rgb, strength: f64) -> Rgb {
    if strength <= 1.0 { mix([0, 0, 0], colour, strength) } else { mix(colour, WHITE, strength - 1.0) }
}

fn from_oklch([lightness, chroma, hue]: [f64; 3]) -> Rgb {
    let (a, b) = (chroma * hue.to_radians().cos(), chroma * hue.to_radians().sin());
    let cube = |x: f64| x * x * x;
    let l = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548 * b);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701 * s,
    ];
    linear.map(|x| {
        let x = x.clamp(0.0, 1.0);
        let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (255.0 * encoded).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(a: Rgb, b: Rgb) -> f64 {
        (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn white_and_black_are_where_oklab_puts_them() {
        assert_eq!(from_oklch([1.0, 0.0, 0.0]), WHITE);
        assert_eq!(from_oklch([0.0, 0.0, 0.0]), [0, 0, 0]);
    }

    #[test]
    fn close_numbers_have_colours_far_apart() {
        for i in 0..300 {
            for j in i + 1..i + 6 {
                assert!(apart(categorical(i), categorical(j)) > 40.0, "{i} {j}: {:?} {:?}", categorical(i), categorical(j));
            }
        }
    }

    #[test]
    fn the_quality_scale_runs_from_red_to_blue() {
        let (bad, good) = (quality_colour(0.0), quality_colour(1.0));
        assert!(bad[0] > 2 * bad[2] && good[2] > 2 * good[0], "{bad:?} {good:?}");
        assert_eq!(quality_colour(-3.0), bad);
        assert_eq!(quality_colour(f64::NAN), bad);
        for k in 0..100 {
            let step = apart(quality_colour(f64::from(k) / 100.0), quality_colour(f64::from(k + 1) / 100.0));
            assert!((0.5..20.0).contains(&step), "{k}: {step}");
        }
    }
}
