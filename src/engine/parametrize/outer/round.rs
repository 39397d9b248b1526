//! Points on a circle or an ellipse whose arcs or chords have given proportions.

use crate::parametrize::spec::Spacing;
use crate::vector::Vec2;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Least step of the angle, if there is room: three points a step apart are strictly convex in double precision.
const MIN_STEP: f64 = 1e-7;

/// Points on the ellipse with semi-axes `sqrt(ratio)` and `1 / sqrt(ratio)`, the first at angle 0, the rest counter-clockwise at
/// arcs or chords proportional to `lengths` (all positive; the last leads back to the first). `None` if no chords with these
/// proportions close, or none were found on the ellipse.
pub(super) fn spread(lengths: &[f64], ratio: f64, spacing: Spacing) -> Option<Vec<Vec2>> {
    let (a, b) = (ratio.sqrt(), 1.0 / ratio.sqrt());
    let point = |t: f64| [a * t.cos(), b * t.sin()];
    let mut image: Vec<Vec2> = match spacing {
        Spacing::ArcLength if ratio == 1.0 => runs(lengths, TAU).map(point).collect(),
        Spacing::ArcLength if a > b => {
            let arc = Quarter::new(a, b);
            runs(lengths, 4.0 * arc.length()).map(|s| point(arc.parameter(s))).collect()
        }
        Spacing::ArcLength => {
            // The quarter starts at the end of the larger axis, which is a quarter turn behind angle 0.
            let arc = Quarter::new(b, a);
            let quarter = arc.length();
            let point = |t: f64| [-a * t.sin(), b * t.cos()];
            let from_axis = |s: f64| if s < quarter { s + 3.0 * quarter } else { s - quarter };
            runs(lengths, 4.0 * quarter).map(|s| point(arc.parameter(from_axis(s)))).collect()
        }
        Spacing::Chord if ratio == 1.0 => runs(&stepped(inscribed(lengths)?), TAU).map(point).collect(),
        Spacing::Chord => runs(&stepped(Chords { a, b, lengths }.solve()?), TAU).map(point).collect(),
    };
    image[0] = [a, 0.0];
    Some(image)
}

/// Running sums from 0, scaled so that all lengths together are `total`.
fn runs(lengths: &[f64], total: f64) -> impl Iterator<Item = f64> + '_ {
    let scale = total / lengths.iter().sum::<f64>();
    let mut run = 0.0;
    lengths.iter().map(move |l| {
        let at = scale * run;
        run += l;
        at
    })
}

fn stepped(mut steps: Vec<f64>) -> Vec<f64> {
    let least = MIN_STEP.min(0.1 * TAU / steps.len() as f64);
    steps.iter_mut().for_each(|s| *s = s.max(least));
    steps
}

/// The root of an increasing function between `low`, where it is not positive, and `high`, where it is not negative: Newton with
/// bisection for steps that leave the bracket or do not halve it in two turns.
fn root(mut low: f64, mut high: f64, start: f64, of: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut x = start.clamp(low, high);
    for turn in 0..200 {
        let (value, slope) = of(x);
        let before = high - low;
        if value == 0.0 {
            return x;
        }
        if value < 0.0 {
            low = x
        } else {
            high = x
        }
        let newton = x - value / slope;
        let inside = newton > low && newton < high;
        let slow = turn > 8 && turn % 2 == 0 && high - low > 0.5 * before;
        let next = if inside && !slow { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 2e-16 * x.abs() || next <= low && x == low || next >= high && x == high {
            return next;
        }
        x = next;
    }
    x
}

/// Central angles of the polygon inscribed in a circle whose sides have these proportions; `None` if one side is as long as all
/// others together.
///
/// With phi half the angle of the longest side L, the others are 2 asin((l / L) sin(phi)), also where phi > pi/2 (the centre lies
/// outside the polygon): a smooth equation in phi with one root in (0, pi). It is solved for the angle to the nearer end.
fn inscribed(lengths: &[f64]) -> Option<Vec<f64>> {
    let longest = (0..lengths.len()).fold(0, |best, k| if lengths[k] > lengths[best] { k } else { best });
    let ratios: Vec<f64> = lengths.iter().map(|l| l / lengths[longest]).collect();
    let others = || ratios.iter().enumerate().filter(|e| e.0 != longest).map(|e| *e.1);
    let sum: f64 = others().sum();
    if sum <= 1.0 {
        return None;
    }
    // Sum of the half angles of the others for the angle x, and its derivative.
    let halves = |x: f64| {
        let (sin, cos) = x.sin_cos();
        others().fold((0.0, 0.0), |(value, slope), r| {
            let s = (r * sin).min(1.0);
            (value + s.asin(), slope + r * cos / (1.0 - s * s).sqrt().max(1e-8))
        })
    };
    let half = if halves(FRAC_PI_2).0 >= FRAC_PI_2 {
        // The asin of s is at least s, so this is not below the root.
        let high = (PI / (1.0 + sum)).min(1.0).asin();
        root(0.0, high, high, |x| {
            let (value, slope) = halves(x);
            (value + x - PI, slope + 1.0)
        })
    } else {
        let low = (5.9 * (1.0 - 1.0 / sum)).sqrt().min(FRAC_PI_2);
        let outside = root(low, FRAC_PI_2, low, |x| {
            let (value, slope) = halves(x);
            (x - value, 1.0 - slope)
        });
        PI - outside
    };
    let sin = half.sin();
    let angle = |(k, r): (usize, &f64)| 2.0 * if k == longest { half } else { (r * sin).min(1.0).asin() };
    Some(ratios.iter().enumerate().map(angle).collect())
}

/// Nodes and weights of the Gauss rule of six points on [-1, 1], positive half.
const GAUSS: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_4),
];

/// Arc length of a quarter of an ellipse from the end of its larger axis, in panels on which the Gauss rule is exact to rounding:
/// their widths are a fifth of the distance to the nearest singularity of the speed, near `i b / a`.
struct Quarter {
    a: f64,
    b: f64,
    /// Parameter and arc length at the ends of the panels.
    ends: Vec<(f64, f64)>,
}

impl Quarter {
    /// `a >= b > 0`.
    fn new(a: f64, b: f64) -> Quarter {
        let mut quarter = Quarter { a, b, ends: vec![(0.0, 0.0)] };
        let (mut t, mut s) = (0.0, 0.0);
        while t < FRAC_PI_2 {
            let next = t + 0.2 * (b / a).hypot(t);
            let next = if next > FRAC_PI_2 - 0.01 { FRAC_PI_2 } else { next };
            s += quarter.integral(t, next);
            t = next;
            quarter.ends.push((t, s));
        }
        quarter
    }

    fn length(&self) -> f64 {
        self.ends.last().map_or(0.0, |e| e.1)
    }

    /// Speed and its derivative.
    fn speed(&self, t: f64) -> (f64, f64) {
        let (sin, cos) = t.sin_cos();
        let (x, y) = (self.a * sin, self.b * cos);
        let speed = (x * x + y * y).sqrt();
        (speed, (self.a * self.a - self.b * self.b) * sin * cos / speed)
    }

    fn integral(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        half * GAUSS.iter().map(|(x, w)| w * (self.speed(middle - half * x).0 + self.speed(middle + half * x).0)).sum::<f64>()
    }

    /// The parameter at an arc length from 0 to four quarters.
    fn parameter(&self, s: f64) -> f64 {
        let quarter = self.length();
        let turns = (s / quarter).floor().clamp(0.0, 3.0);
        let rest = s - turns * quarter;
        if turns % 2.0 == 0.0 { FRAC_PI_2 * turns + self.within(rest) } else { FRAC_PI_2 * (turns + 1.0) - self.within(quarter - rest) }
    }

    fn within(&self, s: f64) -> f64 {
        let k = self.ends.partition_point(|e| e.1 <= s).clamp(1, self.ends.len() - 1);
        let ((t0, s0), (t1, s1)) = (self.ends[k - 1], self.ends[k]);
        let wanted = (s - s0).clamp(0.0, s1 - s0);
        let mut t = t0 + (t1 - t0) * wanted / (s1 - s0);
        for _ in 0..8 {
            let (speed, bend) = self.speed(t);
            let newton = (self.integral(t0, t) - wanted) / speed;
            // Halley's step: its error is of the third order.
            let step = newton / (1.0 - 0.5 * newton * bend / speed);
            t = (t - step).clamp(t0, t1);
            if step.abs() <= 1e-5 * (t1 - t0) {
                break;
            }
        }
        t
    }
}

/// Chords of an ellipse, one after the other around it.
struct Chords<'a> {
    a: f64,
    b: f64,
    lengths: &'a [f64],
}

impl Chords<'_> {
    /// Steps of the parameter that close.
    fn solve(&self) -> Option<Vec<f64>> {
        let total: f64 = self.lengths.iter().sum();
        let larger = self.a.max(self.b);
        // Chords as long as the arcs would be reach around at least once.
        let (mut low, mut high) = (0.0, 4.0 * Quarter::new(larger, self.a.min(self.b)).length() / total);
        let (mut scale, mut last) = (high, None);
        for turn in 0..90 {
            let excess = self.march(scale, &mut |_| {}).map(|end| end - TAU);
            if excess.is_some_and(|e| e.abs() <= 1e-13) {
                break;
            }
            if excess.is_some_and(|e| e < 0.0) {
                low = scale
            } else {
                high = scale
            }
            if high - low <= 1e-15 * high {
                break;
            }
            // The secant through the last two ends; at first the line through 0.
            let next = match (excess, last) {
                (Some(e), Some((s, f))) if turn < 12 => scale - e * (scale - s) / (e - f),
                (Some(e), None) => scale * TAU / (e + TAU),
                _ => f64::NAN,
            };
            last = excess.map(|e| (scale, e));
            scale = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        let mut steps = Vec::with_capacity(self.lengths.len());
        let end = self.march(scale, &mut |step| steps.push(step))?;
        // A jump of the end, at a place where the chord across a sharp tip is shorter than one before it, is no solution.
        ((end - TAU).abs() <= 1e-9).then_some(steps)
    }

    /// Lays chords of `scale` times the lengths; returns where the last ends. `None` if one is longer than the ellipse has there.
    fn march(&self, scale: f64, each: &mut dyn FnMut(f64)) -> Option<f64> {
        let (mut t, mut ratio) = (0.0f64, 0.5 / self.a.max(self.b));
        for l in self.lengths {
            let chord = scale * l;
            let half = self.half_step(t, chord, ratio * chord)?;
            ratio = half / chord;
            each(2.0 * half);
            t += 2.0 * half;
            if t > 2.0 * TAU {
                break;
            }
        }
        Some(t)
    }

    /// Length of the chord from `t` to `t + 2 h`, and its derivative by `h`. `at` is the sine and cosine of `t`.
    fn chord(&self, at: (f64, f64), h: f64) -> (f64, f64) {
        let (sin, cos) = h.sin_cos();
        let (s, c) = (at.0 * cos + at.1 * sin, at.1 * cos - at.0 * sin);
        let speed = (self.a * self.a * s * s + self.b * self.b * c * c).sqrt();
        let bend = (self.a * self.a - self.b * self.b) * s * c / speed;
        (2.0 * sin * speed, 2.0 * (cos * speed + sin * bend))
    }

    fn half_step(&self, t: f64, chord: f64, guess: f64) -> Option<f64> {
        let at = t.sin_cos();
        let mut h = guess;
        for _ in 0..20 {
            let (value, slope) = self.chord(at, h);
            let step = (value - chord) / slope;
            if !(slope > 0.0 && step.abs() <= 0.5) {
                break;
            }
            h -= step;
            if !(h > 0.0 && h < PI) {
                break;
            }
            if step.abs() <= 1e-9 * h {
                return Some(h);
            }
        }
        // Around a sharp tip the chord does not grow evenly: the first place where it is long enough.
        let count = 4096;
        let place = |k: usize| PI * k as f64 / f64::from(count);
        let k = (1..count as usize).find(|&k| self.chord(at, place(k)).0 >= chord)?;
        let (mut low, mut high) = (place(k - 1), place(k));
        while high - low > 1e-16 + 4e-16 * high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.chord(at, middle).0 >= chord { high = middle } else { low = middle }
        }
        Some(high)
    }
}

/// For tests: the length of the ellipse, and the largest relative error of arc lengths to inverted parameters, recomputed in steps.
#[cfg(test)]
pub(super) fn inverse_errors(a: f64, b: f64) -> (f64, f64) {
    let arc = Quarter::new(a, b);
    let total = 4.0 * arc.length();
    // Between fine steps from the start the rule is exact whatever the panels are.
    let to = |t: f64| {
        let n = 3000;
        let place = |k: usize| t * (k as f64 / f64::from(n)).powi(3);
        (1..=n as usize).map(|k| arc.integral(place(k - 1), place(k))).sum::<f64>()
    };
    let error = |k: i32| {
        let s = 0.25 * total * (f64::from(k) / 200.0).powi(2);
        (to(arc.parameter(s)) / s - 1.0).abs()
    };
    (total, (1..=200).map(error).fold(0.0, f64::max))
}
