//! From a specification to tensors: curvature or given tensors, bounded by sizes and stretch, agreeing along features, graded.

use super::tensor::{self, Frame, Sym2};
use super::{MetricSource, MetricSpec, SurfaceMetric, gradation};
use crate::curvature::{Curvature, CurvatureTensor};
use crate::error::{EngineError, Reason, Result};
use crate::features::Features;
use crate::mesh::SurfaceMesh;
use crate::sizing::{MAX_EXPECTED_TRIANGLES, SizeField};
use crate::topology::Topology;
use crate::vector::{Vec3, dot, sub, triangle_area, unit};
use crate::work::Work;

/// Evaluates a metric. `curvature` is that of the same surface and features; lengths are bounded from above by `sizes`. O(F) but for
/// the gradation, which is O(F) times the number of times a tensor is lowered.
///
/// # Errors
/// [`Reason::BadParameter`] as [`MetricSpec::validate`], for a wrong array length or a tensor that is not positive in its tangent plane;
/// [`Reason::LimitReached`] if more than [`MAX_EXPECTED_TRIANGLES`] would result; cancellation.
pub fn evaluate_metric(
    mesh: &SurfaceMesh,
    topology: &Topology,
    features: &Features,
    curvature: &Curvature,
    sizes: &SizeField,
    spec: &MetricSpec,
    work: &Work<'_>,
) -> Result<SurfaceMetric> {
    spec.validate()?;
    work.check()?;
    let sectors = curvature.sectors.clone();
    if curvature.tensors.len() != sectors.count() || sizes.vertex_size.len() != mesh.positions.len() {
        return Err(EngineError::invariant("curvature or sizes are not of this surface"));
    }
    if let MetricSource::PerVertex { tensors } = &spec.source
        && tensors.len() != mesh.positions.len()
    {
        let message = format!("{} tensors for {} vertices", tensors.len(), mesh.positions.len());
        return Err(EngineError::bad_parameter("mesher.metric.tensors", message));
    }
    let frames: Vec<Frame> = curvature.tensors.iter().map(|t| frame_of(t.normal)).collect();
    let mut forms = Vec::with_capacity(frames.len());
    for v in 0..sectors.vertex_count() as u32 {
        let most = sizes.vertex_size[v as usize].min(spec.max_size.unwrap_or(f64::INFINITY));
        for s in sectors.of_vertex(v) {
            let raw = match &spec.source {
                MetricSource::Curvature { deviation, normal_angle_deg } => {
                    from_curvature(&curvature.tensors[s], &frames[s], *deviation, *normal_angle_deg, most)
                }
                MetricSource::PerVertex { tensors } => given(v, &tensors[v as usize], &frames[s])?,
            };
            forms.push(bounded(raw, spec, most));
        }
    }
    let mut metric = SurfaceMetric { sectors, frames, forms };
    agree_along_features(mesh, topology, features, &mut metric);
    if let Some(rate) = spec.growth_rate {
        gradation::grade(mesh, topology, &mut metric, rate, work)?;
        let limit =
            |(form, v): (&Sym2, u32)| bounded(*form, spec, sizes.vertex_size[v as usize].min(spec.max_size.unwrap_or(f64::INFINITY)));
        let vertex_of: Vec<u32> =
            (0..metric.sectors.vertex_count() as u32).flat_map(|v| metric.sectors.of_vertex(v).map(move |_| v)).collect();
        metric.forms = metric.forms.iter().zip(vertex_of).map(limit).collect();
    }
    check_count(mesh, &metric)?;
    Ok(metric)
}

fn frame_of(normal: Vec3) -> Frame {
    if dot(normal, normal) > 0.5 { Frame::of(unit(normal)) } else { Frame::of([0.0, 0.0, 1.0]) }
}

/// Length that keeps both bounds on a normal curvature.
fn length_on(curvature: f64, deviation: Option<f64>, normal_angle_deg: Option<f64>, most: f64) -> f64 {
    let k = curvature.abs();
    let by_deviation = deviation.map_or(f64::INFINITY, |d| (6.0 * d / k).sqrt());
    let by_angle = normal_angle_deg.map_or(f64::INFINITY, |a| 2.0 * (0.5 * a.to_radians()).sin() / k);
    let length = by_deviation.min(by_angle).min(most);
    if length > 0.0 { length } else { most }
}

fn from_curvature(t: &CurvatureTensor, frame: &Frame, deviation: Option<f64>, angle: Option<f64>, most: f64) -> Sym2 {
    let mut form = [0.0; 3];
    for (k, direction) in [(t.k1, t.d1), (t.k2, t.d2)] {
        let h = length_on(k, deviation, angle, most);
        let d = frame.coordinates(direction);
        let w = 1.0 / (h * h);
        form = [form[0] + w * d[0] * d[0], form[1] + w * d[0] * d[1], form[2] + w * d[1] * d[1]];
    }
    form
}

fn given(v: u32, t: &[f64; 6], frame: &Frame) -> Result<Sym2> {
    let form = frame.restrict(t);
    let determinant = form[0] * form[2] - form[1] * form[1];
    if form[0] + form[2] > 0.0 && determinant > 0.0 && determinant.is_finite() {
        return Ok(form);
    }
    let message = format!("the tensor of vertex {v} is not positive in its tangent plane");
    Err(EngineError::bad_parameter("mesher.metric.tensors", message))
}

/// Lengths into their bounds; the stretch is bounded by shortening the longer one.
fn bounded(form: Sym2, spec: &MetricSpec, most: f64) -> Sym2 {
    let least = spec.min_size.unwrap_or(0.0).min(most);
    let clamp = |x: f64| (1.0 / x.max(f64::MIN_POSITIVE).sqrt()).clamp(least, most).powi(-2);
    tensor::with_eigenvalues(form, |[large, small]| {
        let large = clamp(large);
        [large, clamp(small).max(large / (spec.max_stretch * spec.max_stretch))]
    })
}

/// Both sides of a feature have its edges in common: each takes the shorter of the two lengths along it.
fn agree_along_features(mesh: &SurfaceMesh, topology: &Topology, features: &Features, metric: &mut SurfaceMetric) {
    for h in 0..topology.halfedge_count() as u32 {
        let Some(t) = topology.twin(h).filter(|_| features.is_feature[h as usize]) else { continue };
        let (a, b) = (topology.origin(h), topology.target(h));
        let direction = unit(sub(mesh.positions[b as usize], mesh.positions[a as usize]));
        // Corners of `a` on the side of `h` and across it.
        let (here, there) = (metric.sectors.of_corner(h) as usize, metric.sectors.of_corner(topology.next(t)) as usize);
        raise_along(metric, here, there, direction);
        raise_along(metric, there, here, direction);
    }
}

fn raise_along(metric: &mut SurfaceMetric, of: usize, to: usize, direction: Vec3) {
    if of == to {
        return;
    }
    let along = |s: usize| {
        let d = metric.frames[s].coordinates(direction);
        let n = d[0].hypot(d[1]);
        (n > 0.1).then(|| [d[0] / n, d[1] / n])
    };
    let (Some(d), Some(e)) = (along(of), along(to)) else { return };
    let wanted = tensor::square(metric.forms[to], e);
    if wanted <= tensor::square(metric.forms[of], d) {
        return;
    }
    let faint = 1e-6 * wanted;
    let strip = [wanted * d[0] * d[0] + faint * d[1] * d[1], (wanted - faint) * d[0] * d[1], wanted * d[1] * d[1] + faint * d[0] * d[0]];
    metric.forms[of] = tensor::intersect(metric.forms[of], strip);
}

/// Refuses metrics that ask for too many triangles.
fn check_count(mesh: &SurfaceMesh, metric: &SurfaceMetric) -> Result<()> {
    let expected = expected_triangles(mesh, metric);
    if expected <= MAX_EXPECTED_TRIANGLES {
        return Ok(());
    }
    Err(EngineError::new(
        Reason::LimitReached,
        format!("the metric asks for about {expected:.3e} triangles, the limit is {MAX_EXPECTED_TRIANGLES:e}"),
    )
    .with_hint("ask for a larger deviation, normal_angle or min_size")
    .with_metadata("expected_triangles", expected)
    .with_metadata("limit", MAX_EXPECTED_TRIANGLES))
}

/// Area in the metric over that of the unit equilateral triangle.
pub(super) fn expected_triangles(mesh: &SurfaceMesh, metric: &SurfaceMetric) -> f64 {
    let of = |f: usize| {
        let [a, b, c] = mesh.corners(f);
        let density = |k: u32| {
            let m = metric.forms[metric.sectors.of_corner(3 * f as u32 + k) as usize];
            (m[0] * m[2] - m[1] * m[1]).max(0.0).sqrt()
        };
        triangle_area(a, b, c) * (density(0) + density(1) + density(2)) / 3.0 / (0.25 * 3f64.sqrt())
    };
    (0..mesh.triangles.len()).map(of).sum()
}
