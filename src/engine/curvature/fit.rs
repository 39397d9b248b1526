//! The second fundamental form of each sector: the symmetric 2 x 2 form that best takes edges to differences of normals.

use super::CurvatureTensor;
use super::normals::tangents;
use super::sectors::Sectors;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub};
use crate::work::Work;

/// Share of the squared lengths that holds an undetermined form at 0.
const HOLD: f64 = 1e-8;

/// A symmetric form `[a b; b c]` in the frame `t`, `normal x t`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    pub(super) normal: Vec3,
    pub(super) t: Vec3,
    pub(super) abc: [f64; 3],
}

impl Form {
    /// Eigenvalues and eigenvectors.
    pub(super) fn principal(&self) -> CurvatureTensor {
        let [a, b, c] = self.abc;
        let s = cross(self.normal, self.t);
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        let angle = 0.5 * b.atan2(half);
        let d1 = add(scale(self.t, angle.cos()), scale(s, angle.sin()));
        CurvatureTensor { k1: mean + radius, k2: mean - radius, d1, d2: cross(self.normal, d1), normal: self.normal }
    }
}

/// Normal equations of a form.
struct Equations {
    xx: f64,
    xy: f64,
    yy: f64,
    right: [f64; 3],
}

impl Equations {
    fn solve(&self) -> [f64; 3] {
        let hold = HOLD * (self.xx + self.yy);
        let (p, q, r, s) = (self.xx + hold, self.xy, self.xx + self.yy + hold, self.yy + hold);
        // [p q 0; q r q; 0 q s] by elimination of the first and last unknown.
        let middle = r - q * q / p - q * q / s;
        let b = (self.right[1] - q * self.right[0] / p - q * self.right[2] / s) / middle;
        let (a, c) = ((self.right[0] - q * b) / p, (self.right[2] - q * b) / s);
        if [a, b, c].iter().all(|x| x.is_finite()) { [a, b, c] } else { [0.0; 3] }
    }
}

/// Forms of all sectors from all edges of their faces. O(F).
pub(super) fn second_forms(
    mesh: &SurfaceMesh,
    topology: &Topology,
    sectors: &Sectors,
    normals: &[Vec3],
    work: &Work<'_>,
) -> Result<Vec<Form>> {
    let mut forms = Vec::with_capacity(sectors.count());
    let mut sums: Vec<(Vec3, Vec3, Equations)> = Vec::new();
    for v in 0..topology.vertex_count() as u32 {
        if v.is_multiple_of(16_384) {
            work.step(v as usize, topology.vertex_count())?;
        }
        let own = sectors.of_vertex(v);
        sums.clear();
        sums.extend(own.clone().map(|s| {
            let (t, s) = tangents(normals[s]);
            (t, s, Equations { xx: 0.0, xy: 0.0, yy: 0.0, right: [0.0; 3] })
        }));
        for (sector, h) in sectors.corners(topology, v) {
            let (t, s, sum) = &mut sums[sector - own.start];
            for edge in [h, topology.next(h), topology.prev(h)] {
                let e = sub(mesh.positions[topology.target(edge) as usize], mesh.positions[topology.origin(edge) as usize]);
                let ends = [edge, topology.next(edge)].map(|corner| normals[sectors.of_corner(corner) as usize]);
                let turn = sub(ends[1], ends[0]);
                let length = norm(e);
                if length <= 0.0 {
                    continue;
                }
                let w = 1.0 / length;
                let (x, y, p, q) = (dot(*t, e), dot(*s, e), dot(*t, turn), dot(*s, turn));
                (sum.xx, sum.xy, sum.yy) = (sum.xx + w * x * x, sum.xy + w * x * y, sum.yy + w * y * y);
                sum.right = [sum.right[0] + w * x * p, sum.right[1] + w * (y * p + x * q), sum.right[2] + w * y * q];
            }
        }
        forms.extend(own.zip(&sums).map(|(s, (t, _, sum))| Form { normal: normals[s], t: *t, abc: sum.solve() }));
    }
    Ok(forms)
}
