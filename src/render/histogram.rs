//! Histograms of several series (before, after), bars side by side, in per cent of each series.

use crate::colour::{FAINT, INK, Rgb, WHITE};
use crate::error::{RenderError, Result};
use crate::image::Image;
use crate::text::{Anchor, Font};

/// One series of a histogram.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// Values; those outside the range count in the end bins.
    pub values: &'a [f64],
    /// Colour of its bars.
    pub colour: Rgb,
}

/// A histogram to draw.
#[derive(Debug, Clone)]
pub struct Histogram<'a> {
    /// A line at the top.
    pub title: &'a str,
    /// What the horizontal axis is.
    pub axis: &'a str,
    /// Values at the left and the right end.
    pub range: [f64; 2],
    /// Bins, 1 to 200.
    pub bins: u32,
    /// The series, drawn side by side in each bin.
    pub series: &'a [Series<'a>],
    /// Pixels across and down; at least 200 each.
    pub size: [u32; 2],
}

impl<'a> Histogram<'a> {
    /// Twenty bins from 0 to 1, as shape measures have it.
    pub fn of_quality(title: &'a str, series: &'a [Series<'a>]) -> Self {
        Histogram { title, axis: "kappa", range: [0.0, 1.0], bins: 20, series, size: [1000, 600] }
    }
}

/// The plot's rectangle in pixels and its vertical scale.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    base: f64,
    /// Share at the top.
    most: f64,
}

/// Draws a histogram; the height of a bar is the share of its series that falls into the bin. The legend tells the count, the
/// mean and the least value of each series.
///
/// # Errors
/// [`RenderError::Empty`] for no series or one without values, [`RenderError::NonFinite`], [`RenderError::ImageSize`],
/// [`RenderError::BadParameter`] for bins or a range that make no sense.
pub fn render_histogram(histogram: &Histogram<'_>) -> Result<Image> {
    let [width, height] = histogram.size;
    let mut image = Image::filled(width, height, WHITE)?;
    check(histogram)?;
    let shares: Vec<Vec<f64>> = histogram.series.iter().map(|s| bin_shares(s.values, histogram.range, histogram.bins)).collect();
    let highest = shares.iter().flatten().copied().fold(0.0, f64::max);
    let step = tick_step(highest);
    let font = Font::plain(width.max(height));
    let line = f64::from(font.line());
    let frame = Frame {
        left: f64::from(font.width("100 %")) + 1.3 * line,
        right: f64::from(width) - line,
        top: 1.8 * line,
        base: f64::from(height) - 2.6 * line,
        most: (highest / step).ceil() * step,
    };
    draw_axes(&mut image, histogram, &frame, font, step);
    draw_bars(&mut image, histogram, &frame, &shares);
    image.rectangle([frame.left, frame.base - 1.0], [frame.right, frame.base + 0.5], INK);
    draw_legend(&mut image, histogram, &frame, font);
    Ok(image)
}

fn check(histogram: &Histogram<'_>) -> Result<()> {
    let [width, height] = histogram.size;
    if width < 200 || height < 200 {
        return Err(RenderError::ImageSize { width, height });
    }
    if histogram.series.is_empty() || histogram.series.iter().any(|s| s.values.is_empty()) {
        return Err(RenderError::Empty { what: "histogram" });
    }
    if let Some(index) = histogram.series.iter().find_map(|s| s.values.iter().position(|v| !v.is_finite())) {
        return Err(RenderError::NonFinite { what: "histogram value", index });
    }
    if !(1..=200).contains(&histogram.bins) {
        return Err(RenderError::BadParameter { what: "bins", value: f64::from(histogram.bins) });
    }
    let extent = histogram.range[1] - histogram.range[0];
    if !(extent > 0.0 && extent.is_finite()) {
        return Err(RenderError::BadParameter { what: "range", value: extent });
    }
    Ok(())
}

fn bin_shares(values: &[f64], [low, high]: [f64; 2], bins: u32) -> Vec<f64> {
    let mut shares = vec![0.0; bins as usize];
    for v in values {
        let place = ((v - low) / (high - low) * f64::from(bins)).clamp(0.0, f64::from(bins - 1));
        shares[place as usize] += 1.0 / values.len() as f64;
    }
    shares
}

/// Spacing of the horizontal lines: four to eight of them up to the highest bar.
fn tick_step(highest: f64) -> f64 {
    [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2].into_iter().find(|step| highest / step <= 7.0).unwrap_or(0.2)
}

fn draw_axes(image: &mut Image, histogram: &Histogram<'_>, frame: &Frame, font: Font, step: f64) {
    let line = f64::from(font.line());
    let middle = 0.5 * (frame.left + frame.right);
    font.bold().draw(image, histogram.title, 0.5 * f64::from(image.width), 8.0, Anchor::Middle, INK);
    let ticks = (frame.most / step).round() as u32;
    for k in 0..=ticks {
        let y = frame.base - (frame.base - frame.top) * f64::from(k) / f64::from(ticks.max(1));
        image.rectangle([frame.left - 6.0, y - 0.5], [frame.right, y + 0.5], FAINT);
        let percent = 100.0 * step * f64::from(k);
        let text = if step < 0.01 { format!("{percent:.1} %") } else { format!("{percent:.0} %") };
        font.draw(image, &text, frame.left - 10.0, y - 0.5 * line + 2.0, Anchor::Right, INK);
    }
    for k in 0..=5 {
        let share = f64::from(k) / 5.0;
        let x = frame.left + share * (frame.right - frame.left);
        image.rectangle([x - 0.5, frame.base], [x + 0.5, frame.base + 6.0], INK);
        let value = histogram.range[0] + share * (histogram.range[1] - histogram.range[0]);
        font.draw(image, &short(value), x, frame.base + 9.0, Anchor::Middle, INK);
    }
    font.draw(image, histogram.axis, middle, frame.base + 9.0 + line, Anchor::Middle, INK);
}

fn draw_bars(image: &mut Image, histogram: &Histogram<'_>, frame: &Frame, shares: &[Vec<f64>]) {
    let bin = (frame.right - frame.left) / f64::from(histogram.bins);
    let bar = 0.86 * bin / shares.len() as f64;
    for (s, series) in shares.iter().enumerate() {
        for (k, share) in series.iter().enumerate() {
            let left = frame.left + bin * (k as f64 + 0.07) + bar * s as f64;
            let top = frame.base - (frame.base - frame.top) * share / frame.most;
            image.rectangle([left, top], [left + bar, frame.base], histogram.series[s].colour);
        }
    }
}

fn draw_legend(image: &mut Image, histogram: &Histogram<'_>, frame: &Frame, font: Font) {
    let line = f64::from(font.line());
    let longest = histogram.series.iter().map(|s| s.label.chars().count()).max().unwrap_or(0);
    let mut top = frame.top + 0.3 * line;
    for series in histogram.series {
        let count = series.values.len();
        let mean = series.values.iter().sum::<f64>() / count as f64;
        let least = series.values.iter().copied().fold(f64::INFINITY, f64::min);
        let text = format!("{:longest$}  n {}  mean {}  min {}", series.label, grouped(count), short(mean), short(least));
        let left = frame.left + 0.8 * line;
        image.rectangle([left - 4.0, top - 2.0], [left + line + f64::from(font.width(&text)), top + line - 2.0], WHITE);
        image.rectangle([left, top + 3.0], [left + 0.7 * line, top + 0.7 * line], series.colour);
        font.draw(image, &text, left + line, top, Anchor::Left, INK);
        top += line;
    }
}

/// Three significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        x if (0.001..0.1).contains(&x) => format!("{value:.4}"),
        x if (0.1..10.0).contains(&x) => format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_owned(),
        x if (10.0..1e5).contains(&x) => format!("{value:.1}"),
        _ => format!("{value:.2e}"),
    }
}

/// A count with commas.
fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(',');
        }
        text.push(c);
    }
    text
}
