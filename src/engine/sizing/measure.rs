//! What of a field is dear to compute and depends on the surface only: kept apart, so that other lengths do not compute it again.

use super::cone::{self, Cone};
use super::spec::{Sides, SizeFieldSpec};
use crate::bvh::TriangleBvh;
use crate::curvature::curvature;
use crate::error::{EngineError, Result};
use crate::features::Features;
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, add, cross, dot, scale, sub, triangle_area};
use crate::work::Work;

/// A measure of the surface that a field rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasureSpec {
    /// Principal curvatures.
    Curvature {
        /// Passes of averaging.
        smoothing: u32,
    },
    /// Distances of facing sheets.
    Gaps {
        /// Which.
        sides: Sides,
        /// Widest that counts.
        reach: Option<f64>,
    },
    /// Thickness of the body.
    Thickness,
    /// Radius of inscribed spheres.
    Radius,
}

/// A measure at the vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Curvature: the largest absolute one; else the length measured, infinite where there is none.
    pub value: Vec<f64>,
    /// Curvature: the sum of both absolute ones; else empty.
    pub second: Vec<f64>,
}

impl Contents for Measured {
    fn feed(&self, into: &mut Feeder) {
        into.f64s(&self.value).f64s(&self.second);
    }

    fn bytes(&self) -> usize {
        (self.value.len() + self.second.len()) * 8
    }
}

impl MeasureSpec {
    /// Whether it is found with rays through a search tree of the surface.
    pub fn needs_tree(&self) -> bool {
        !matches!(self, MeasureSpec::Curvature { .. })
    }
}

impl SizeFieldSpec {
    /// The measure a field rests on.
    pub fn measure(&self) -> Option<MeasureSpec> {
        match self {
            SizeFieldSpec::Curvature(spec) => Some(MeasureSpec::Curvature { smoothing: spec.smoothing }),
            SizeFieldSpec::Proximity(spec) => Some(MeasureSpec::Gaps { sides: spec.sides, reach: spec.reach }),
            SizeFieldSpec::Thickness { .. } => Some(MeasureSpec::Thickness),
            SizeFieldSpec::Centerline(spec) if spec.lines.is_none() => Some(MeasureSpec::Radius),
            _ => None,
        }
    }
}

/// Takes a measure. O(F) for curvature, else O(F log F) for most surfaces. `tree` is the search tree of `mesh`.
///
/// # Errors
/// Cancellation; [`crate::error::Reason::Invariant`] without a tree that is needed.
pub fn measure(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    tree: Option<&TriangleBvh>,
    spec: MeasureSpec,
    work: &Work<'_>,
) -> Result<Measured> {
    let needed = || tree.ok_or_else(|| EngineError::invariant("a measure needs a search tree"));
    let value = match spec {
        MeasureSpec::Curvature { smoothing } => {
            let tensors = curvature(mesh, topology, features, smoothing, work)?.per_vertex();
            let second = tensors.iter().map(|t| t.k1.abs() + t.k2.abs()).collect();
            return Ok(Measured { value: tensors.iter().map(|t| t.largest()).collect(), second });
        }
        MeasureSpec::Gaps { sides, reach } => gaps(mesh, topology, needed()?, sides, reach.unwrap_or(f64::INFINITY), work)?,
        MeasureSpec::Thickness => {
            let per_face =
                cone::per_face(mesh, needed()?, &Cone::THICKNESS, &inwards(mesh, topology), f64::INFINITY, work, cone::thickness)?;
            smoothed(topology, averaged(mesh, &per_face), 3)
        }
        MeasureSpec::Radius => {
            let per_face =
                cone::per_face(mesh, needed()?, &Cone::WIDE, &inwards(mesh, topology), f64::INFINITY, work, cone::inscribed_radius)?;
            smoothed(topology, averaged(mesh, &per_face), 10)
        }
    };
    Ok(Measured { value, second: Vec::new() })
}

fn gaps(mesh: &SurfaceMesh, topology: &Topology, tree: &TriangleBvh, sides: Sides, reach: f64, work: &Work<'_>) -> Result<Vec<f64>> {
    let mut least = vec![f64::INFINITY; mesh.positions.len()];
    let inwards = inwards(mesh, topology);
    let ways: &[f64] = match sides {
        Sides::Both => &[1.0, -1.0],
        Sides::Inside => &[1.0],
        Sides::Outside => &[-1.0],
    };
    for way in ways {
        let signs: Vec<f64> = inwards.iter().map(|sign| sign * way).collect();
        let per_face = cone::per_face(mesh, tree, &Cone::NARROW, &signs, reach, work, cone::gap)?;
        for (t, gap) in mesh.triangles.iter().zip(per_face) {
            for &v in t {
                least[v as usize] = least[v as usize].min(gap);
            }
        }
    }
    Ok(least)
}

/// Share of area^1.5 below which the volume of a component has no sign: a sheet.
const NO_VOLUME: f64 = 1e-3;

/// For each face the sign that turns its normal inwards. Nobody promises that an open surface looks outwards: inside is where the volume
/// is that its component encloses once every hole is closed by a fan. A flat sheet is taken to look outwards.
fn inwards(mesh: &SurfaceMesh, topology: &Topology) -> Vec<f64> {
    let mut volume = vec![0.0f64; topology.components.len()];
    let mut area = vec![0.0f64; topology.components.len()];
    let origin = mesh.positions.first().copied().unwrap_or_default();
    let six_volumes = |a: Vec3, b: Vec3, c: Vec3| dot(sub(a, origin), cross(sub(b, origin), sub(c, origin)));
    for (f, &component) in topology.face_component.iter().enumerate() {
        let [a, b, c] = mesh.corners(f);
        volume[component as usize] += six_volumes(a, b, c) / 6.0;
        area[component as usize] += triangle_area(a, b, c);
    }
    for ring in &topology.loops {
        let points = || ring.iter().map(|&h| mesh.positions[topology.origin(h) as usize]);
        let middle = scale(points().fold([0.0; 3], add), 1.0 / ring.len().max(1) as f64);
        for &h in ring {
            let component = topology.face_component[topology.face(h) as usize] as usize;
            let [a, b] = [topology.origin(h), topology.target(h)].map(|v| mesh.positions[v as usize]);
            volume[component] += six_volumes(b, a, middle) / 6.0;
        }
    }
    let turned = |c: usize| volume[c] < -NO_VOLUME * area[c].powf(1.5);
    topology.face_component.iter().map(|&c| if turned(c as usize) { 1.0 } else { -1.0 }).collect()
}

/// Mean over the faces of each vertex by area, of those with a finite value.
fn averaged(mesh: &SurfaceMesh, per_face: &[f64]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); mesh.positions.len()];
    for (f, value) in per_face.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let [a, b, c] = mesh.corners(f);
        let area = triangle_area(a, b, c);
        for &v in &mesh.triangles[f] {
            let sum: &mut (f64, f64) = &mut sums[v as usize];
            *sum = (sum.0 + area * value, sum.1 + area);
        }
    }
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { f64::INFINITY }).collect()
}

/// Passes of averaging a vertex with its neighbours, half and half; infinite values take no part and stay.
fn smoothed(topology: &Topology, mut values: Vec<f64>, passes: usize) -> Vec<f64> {
    for _ in 0..passes {
        let before = values.clone();
        for v in 0..values.len() as u32 {
            if !before[v as usize].is_finite() {
                continue;
            }
            let around = topology.outgoing(v).flat_map(|h| [topology.target(h), topology.origin(topology.prev(h))]);
            let finite = around.map(|w| before[w as usize]).filter(|x| x.is_finite());
            let (sum, count) = finite.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
            if count > 0.0 {
                values[v as usize] = 0.5 * (before[v as usize] + sum / count);
            }
        }
    }
    values
}
