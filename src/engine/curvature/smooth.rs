//! Smoothing of curvature: each form takes the mean of its own and its neighbours', turned into its tangent plane.

use super::fit::Form;
use super::sectors::Sectors;
use crate::error::Result;
use crate::topology::Topology;
use crate::vector::{Vec3, add, add_scaled, cross, dot, scale, sub};
use crate::work::Work;

/// `v` under the smallest rotation that takes the unit vector `from` to the unit vector `to`.
fn turned(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let below = 1.0 + dot(from, to);
    if below < 1e-6 {
        return v;
    }
    let axis = cross(from, to);
    let once = cross(axis, v);
    add_scaled(add(v, once), cross(axis, once), 1.0 / below)
}

/// A form in the frame of another.
fn carried(form: &Form, to: &Form) -> [f64; 3] {
    let t = turned(form.t, form.normal, to.normal);
    let side = cross(to.normal, to.t);
    let (c, s) = (dot(t, to.t), dot(t, side));
    let [a, b, d] = form.abc;
    // R F R^T with R = [c -s; s c].
    [a * c * c - 2.0 * b * c * s + d * s * s, (a - d) * c * s + b * (c * c - s * s), a * s * s + 2.0 * b * c * s + d * c * c]
}

/// Forms after `passes` of averaging, half own and half the neighbours' of the same sector. O(passes F).
pub(super) fn smoothed(topology: &Topology, sectors: &Sectors, mut forms: Vec<Form>, passes: u32, work: &Work<'_>) -> Result<Vec<Form>> {
    for _ in 0..passes {
        let before = forms.clone();
        let mut sums = vec![([0.0; 3], 0.0); forms.len()];
        for v in 0..topology.vertex_count() as u32 {
            if v.is_multiple_of(16_384) {
                work.check()?;
            }
            for (sector, h) in sectors.corners(topology, v) {
                for corner in [topology.next(h), topology.prev(h)] {
                    let other = carried(&before[sectors.of_corner(corner) as usize], &before[sector]);
                    let sum = &mut sums[sector];
                    *sum = (add(sum.0, other), sum.1 + 1.0);
                }
            }
        }
        for (form, (sum, count)) in forms.iter_mut().zip(sums) {
            if count > 0.0 {
                let mean = scale(sum, 1.0 / count);
                form.abc = add_scaled(form.abc, sub(mean, form.abc), 0.5);
            }
        }
    }
    Ok(forms)
}
