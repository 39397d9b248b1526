//! How far edges and stars cut below or above the input.

use super::input::Foot;
use super::state::{BENT, SAG, State};
use crate::vector::{Vec3, dot, lerp};

/// How far from the input a star may come when its vertex moves, in the measure of [`State::star_sag`].
#[derive(Debug, Clone, Copy)]
pub(super) enum SagLimit {
    /// The star is flat enough for any move.
    None,
    /// This far, or as far as the star is now, which is not known yet: it is dear to know and seldom asked for.
    Unless(f64),
    /// This far.
    AtMost(f64),
}

impl State<'_> {
    /// Distance from the input to the middle of a segment that starts at a vertex.
    pub(super) fn sag(&self, from: u32, p: Vec3, q: Vec3) -> f64 {
        self.input.walk(lerp(p, q, 0.5), self.foot[from as usize]).distance_squared.sqrt()
    }

    /// The same for a segment of the mesh as it is, not overestimated.
    pub(super) fn present_sag(&self, from: u32, p: Vec3, q: Vec3) -> f64 {
        let x = lerp(p, q, 0.5);
        let foot = self.input.walk(x, self.foot[from as usize]);
        self.input.true_distance_squared(x, &foot, SAG * self.size[from as usize]).sqrt()
    }

    /// Whether the faces around a vertex look in clearly different ways: the vertex may sit on a crest that a move would cut off.
    fn is_bent(&self, v: u32, normal: Vec3) -> bool {
        self.mesh.around(v).any(|h| {
            let n = self.mesh.area_vector(h / 3);
            let along = dot(n, normal);
            along <= 0.0 || along * along < BENT * BENT * dot(n, n)
        })
    }

    /// Largest distance from the input to the middles of the edges around a vertex, were it at `p`.
    pub(super) fn star_sag(&self, v: u32, p: Vec3) -> f64 {
        self.largest_sag(v, p, f64::INFINITY, |_, foot| foot.distance_squared)
    }

    /// The largest value, or the first whose square is more than `enough`.
    fn largest_sag(&self, v: u32, p: Vec3, enough: f64, distance_squared: impl Fn(Vec3, &Foot) -> f64) -> f64 {
        let mut from = self.foot[v as usize];
        let near = (SAG * self.size[v as usize]).powi(2);
        let mut largest = 0f64;
        for h in self.mesh.around(v) {
            let x = lerp(p, self.mesh.at(self.mesh.to(h)), 0.5);
            let foot = self.input.walk(x, from);
            let found = distance_squared(x, &foot);
            if found > enough {
                return found.sqrt();
            }
            largest = largest.max(found);
            // The next place is nearer to this one than to the vertex; but not from where a walk may have been caught.
            from = if foot.distance_squared <= near { foot.face } else { self.foot[v as usize] };
        }
        largest.sqrt()
    }

    fn star_stays_within(&self, v: u32, p: Vec3, most: f64) -> bool {
        self.largest_sag(v, p, most * most, |_, foot| foot.distance_squared) <= most
    }

    /// What a move of a vertex must not exceed.
    pub(super) fn sag_limit(&self, v: u32, normal: Vec3) -> SagLimit {
        if self.is_bent(v, normal) { SagLimit::Unless(0.5 * SAG * self.size[v as usize]) } else { SagLimit::None }
    }

    /// Whether the star of a vertex moved to `p` keeps a limit.
    pub(super) fn keeps_limit(&self, v: u32, p: Vec3, limit: &mut SagLimit) -> bool {
        match *limit {
            SagLimit::None => true,
            SagLimit::AtMost(most) => self.star_stays_within(v, p, most),
            SagLimit::Unless(small) => {
                if self.star_stays_within(v, p, small) {
                    return true;
                }
                let most = self.present_star_sag(v).max(small);
                *limit = SagLimit::AtMost(most);
                most > small && self.star_stays_within(v, p, most)
            }
        }
    }

    /// [`State::star_sag`] of the star as it is, not overestimated.
    pub(super) fn present_star_sag(&self, v: u32) -> f64 {
        let small = 0.5 * SAG * self.size[v as usize];
        self.largest_sag(v, self.mesh.at(v), f64::INFINITY, |x, foot| self.input.true_distance_squared(x, foot, small))
    }
}
