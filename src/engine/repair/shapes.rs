//! Small surfaces for the tests of import, export, repair and diagnosis.

use crate::mesh::{Region, SurfaceMesh};
use std::f64::consts::TAU;

/// A torus of `m` times `n` quads, each cut in two, in three regions along the large circle.
pub(crate) fn torus(m: u32, n: u32) -> SurfaceMesh {
    let mut positions = Vec::new();
    for i in 0..m {
        for j in 0..n {
            let (u, v) = (TAU * f64::from(i) / f64::from(m), TAU * f64::from(j) / f64::from(n));
            let r = 2.0 + 0.7 * v.cos();
            positions.push([r * u.cos(), r * u.sin(), 0.7 * v.sin()]);
        }
    }
    let at = |i: u32, j: u32| (i % m) * n + j % n;
    let (mut triangles, mut face_region) = (Vec::new(), Vec::new());
    for i in 0..m {
        for j in 0..n {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            face_region.extend([i * 3 / m; 2]);
        }
    }
    let region = |id: i64, name: &str| Region { id, name: name.to_owned() };
    let regions = vec![region(7, "inlet"), region(3, ""), region(12, "outer wall")];
    SurfaceMesh { positions, triangles, face_region, regions, ..Default::default() }
}

/// A band of `n` quads around a circle, with half a twist if `twisted` is 1.
pub(crate) fn band(n: u32, half_twists: u32) -> SurfaceMesh {
    let mut positions = Vec::new();
    for i in 0..n {
        let u = TAU * f64::from(i) / f64::from(n);
        let turn = 0.5 * f64::from(half_twists) * u;
        for side in [-0.4, 0.4] {
            let r = 1.0 + side * turn.cos();
            positions.push([r * u.cos(), r * u.sin(), side * turn.sin()]);
        }
    }
    let at = |i: u32, side: u32| {
        let crossed = if i == n { half_twists % 2 } else { 0 };
        2 * (i % n) + (side ^ crossed)
    };
    let triangles = (0..n).flat_map(|i| [[at(i, 0), at(i + 1, 0), at(i + 1, 1)], [at(i, 0), at(i + 1, 1), at(i, 1)]]).collect();
    SurfaceMesh::from_parts(positions, triangles)
}

/// Numbers that look random, the same on each run.
pub(crate) struct Lcg(pub(crate) u64);

impl Lcg {
    /// A number below `limit`.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % limit.max(1) as u64) as usize
    }
}
