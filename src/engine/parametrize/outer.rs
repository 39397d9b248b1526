//! placeholder until the merge
use super::spec::Boundary;
use crate::error::Result;
use crate::vector::{Vec2, Vec3, distance};

pub(super) fn place_outer(ring: &[u32], positions: &[Vec3], _boundary: &Boundary) -> Result<Vec<Vec2>> {
    let lengths: Vec<f64> = (0..ring.len()).map(|k| distance(positions[ring[k] as usize], positions[ring[(k + 1) % ring.len()] as usize])).collect();
    let total: f64 = lengths.iter().sum();
    let mut run = 0.0;
    Ok(lengths
        .iter()
        .map(|l| {
            let (sin, cos) = (std::f64::consts::TAU * run / total).sin_cos();
            run += l;
            [cos, sin]
        })
        .collect())
}
