//! Quadrangles: triangles of a finished remesh are joined in pairs over the whole surface by a matching of least cost, the topology is
//! cleaned up and the vertices are smoothed on the input (P1 section 6.2; Remacle et al. 2011, 2012).

mod clean;
mod cover;
mod cross;
mod front;
mod mixed;
mod parity;
mod polish;
mod recombine;
pub(crate) mod shape;
mod smooth;
mod walk;

use crate::bvh::TriangleBvh;
use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;
use crate::optimize::Remeshed;
use crate::optimize::input::{Input, Tree};
use crate::planar::QuadKind;
use crate::quality::intersect::self_intersections;
use crate::sizing::SizeField;
use crate::vector::{Vec3, area_vector_twice, dot, kappa, unit};
use crate::work::Work;
use mixed::{Mixed, NONE, corners_of};
use std::collections::BTreeSet;

/// Rounds of smoothing before and after each clean-up, and at the end.
const ROUNDS: [usize; 2] = [6, 40];
/// Rounds of clean-up.
const CLEANUPS: usize = 4;

/// What the front needs besides sizes and base: the surface that is remeshed.
#[derive(Debug, Clone, Copy)]
pub struct QuadInput<'a> {
    /// The input surface.
    pub mesh: &'a SurfaceMesh,
    /// Its search tree.
    pub tree: &'a TriangleBvh,
    /// Its edges on boundary and feature curves.
    pub curves: &'a [[u32; 2]],
}

/// Makes quadrangles out of `base`, triangles made for `sizes`. Faces `2 q` and `2 q + 1` of the result, for `q` below
/// [`Remeshed::quads`], are the halves of quadrangle `q`; the other faces are triangles that found no partner. With [`QuadKind::All`]
/// the matching is perfect: where a part between curves has an odd number of triangles, one edge of its curves is split before. A triangle
/// is left only where a part is too narrow for any other way, or where all of its curves are locked.
///
/// Topology, curve edges (a few of them split in two for [`QuadKind::All`]) and regions are kept; vertices on curves are not moved. Near-linear;
/// deterministic.
///
/// # Errors
/// Cancellation; those of [`crate::topology::Topology::build`] for a base that is not manifold.
pub fn make_quads(input: QuadInput<'_>, base: &Remeshed, sizes: &SizeField, kind: QuadKind, work: &Work<'_>) -> Result<Remeshed> {
    if base.quads > 0 || sizes.vertex_size.len() != input.mesh.positions.len() {
        return Err(EngineError::invariant("quadrangles are made of triangles, with a size at every vertex of the input"));
    }
    let surface = Input::new(input.mesh, Tree::Made(input.tree), sizes);
    let mut mesh = from_triangles(&input, base)?;
    if kind == QuadKind::All {
        parity::make_even(&mut mesh, &input, |v, below| is_locked(input.mesh, sizes, v, below), work)?;
    }
    align(&mut mesh, &surface, work)?;
    if kind == QuadKind::All {
        parity::loosen(&mut mesh, &surface, work)?;
    }
    work.step(1, 4)?;
    recombine::recombine(&mut mesh, kind, work)?;
    walk::join_triangles(&mut mesh, &surface, kind, work)?;
    work.step(2, 4)?;
    improve(&mut mesh, &surface, work)?;
    work.step(3, 4)?;
    let mut out = to_pairs(input.mesh, &mesh);
    let tree = TriangleBvh::build(&out.mesh.positions, &out.mesh.triangles);
    let (_, pairs) = self_intersections(&out.mesh, &tree, usize::MAX, work)?;
    let mut crossing: Vec<u32> = pairs.into_iter().flatten().collect();
    crossing.sort_unstable();
    crossing.dedup();
    out.crossing_faces = Some(crossing.len() as u32);
    out.lost_regions = base.lost_regions.clone();
    Ok(out)
}

/// Whether a point is a locked vertex of the face of the input below it.
fn is_locked(input: &SurfaceMesh, sizes: &SizeField, point: Vec3, below: u32) -> bool {
    let is_at = |v: u32| sizes.locked.get(v as usize) == Some(&true) && input.positions[v as usize] == point;
    input.triangles[below as usize].into_iter().any(is_at)
}

/// Gives the surface vertices along a field of crosses, so that its triangles are halves of squares.
fn align(mesh: &mut Mixed, surface: &Input<'_>, work: &Work<'_>) -> Result<()> {
    let field = cross::CrossField::new(mesh, work)?;
    let size = |(p, f): (&Vec3, &u32)| surface.size(&surface.walk(*p, *f));
    let sizes: Vec<f64> = mesh.position.iter().zip(&mesh.below).map(size).collect();
    let points = front::place_points(mesh, &field, &sizes, work)?;
    cover::exchange(mesh, &points, work)?;
    for v in 0..mesh.position.len() {
        if !mesh.is_fixed[v] && !mesh.around[v].is_empty() {
            let foot = surface.walk(mesh.position[v], mesh.below[v]);
            (mesh.position[v], mesh.below[v]) = (foot.position, foot.face);
        }
    }
    Ok(())
}

fn improve(mesh: &mut Mixed, surface: &Input<'_>, work: &Work<'_>) -> Result<()> {
    for _ in 0..CLEANUPS {
        smooth::smooth(mesh, surface, ROUNDS[0], work)?;
        clean::clean(mesh, surface, 3, work)?;
    }
    smooth::smooth(mesh, surface, ROUNDS[1], work)?;
    polish::chase(mesh, surface, work)?;
    polish::polish(mesh, surface, work)
}

fn from_triangles(input: &QuadInput<'_>, base: &Remeshed) -> Result<Mixed> {
    let mesh = &base.mesh;
    let mut mixed = Mixed {
        position: mesh.positions.clone(),
        is_fixed: vec![false; mesh.positions.len()],
        faces: mesh.triangles.iter().map(|&[a, b, c]| [a, b, c, NONE]).collect(),
        label: base.face_patch.iter().zip(&mesh.face_region).map(|(p, r)| [*p, *r]).collect(),
        curve_edges: base.curve_edges.clone(),
        ..Mixed::default()
    };
    for p in &mesh.positions {
        let hit = input.tree.closest(*p).ok_or_else(|| EngineError::invariant("the search tree is empty"))?;
        mixed.below.push(hit.face);
    }
    mixed.curve_edges.extend(region_borders(mesh));
    mixed.curve_edges.sort_unstable();
    mixed.curve_edges.dedup();
    for &v in mixed.curve_edges.as_flattened() {
        mixed.is_fixed[v as usize] = true;
    }
    mixed.index();
    Ok(mixed)
}

/// Edges between faces of different regions, low vertex first: curves even where they are no features.
fn region_borders(mesh: &SurfaceMesh) -> Vec<[u32; 2]> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(mesh.triangles.len() * 3);
    for (&[a, b, c], &region) in mesh.triangles.iter().zip(&mesh.face_region) {
        sides.extend([[a, b], [b, c], [c, a]].map(|[u, v]| ([u.min(v), u.max(v)], region)));
    }
    sides.sort_unstable();
    sides.windows(2).filter(|w| w[0].0 == w[1].0 && w[0].1 != w[1].1).map(|w| w[0].0).collect()
}

/// Quadrangles cut along their better diagonal, first; then the triangles.
fn to_pairs(input: &SurfaceMesh, mixed: &Mixed) -> Remeshed {
    let mut number = vec![NONE; mixed.position.len()];
    let mut out = Remeshed::default();
    let (mut positions, mut triangles, mut face_region) = (Vec::new(), Vec::new(), Vec::new());
    for v in 0..mixed.position.len() {
        if !mixed.around[v].is_empty() {
            number[v] = positions.len() as u32;
            positions.push(mixed.position[v]);
        }
    }
    let mut edges = edges_of_elements(mixed);
    for wants_quad in [true, false] {
        for f in 0..mixed.faces.len() as u32 {
            if !mixed.is_face(f) || mixed.is_quad(f) != wants_quad {
                continue;
            }
            let corners = corners_of(&mixed.faces[f as usize]);
            let at = |k: usize| number[corners[k] as usize];
            if wants_quad {
                let better = better_diagonal(mixed, corners);
                let diagonal = |k: usize| low_first([corners[k], corners[k + 2]]);
                // Around a neck a diagonal may be an edge of others: two halves more there would not be a surface.
                let k = if edges.contains(&diagonal(better)) && !edges.contains(&diagonal(1 - better)) { 1 - better } else { better };
                edges.insert(diagonal(k));
                triangles.extend([[at(k), at(k + 1), at(k + 2)], [at(k), at(k + 2), at((k + 3) % 4)]]);
                out.quads += 1;
            } else {
                triangles.push([at(0), at(1), at(2)]);
            }
            let [patch, region] = mixed.label[f as usize];
            out.face_patch.resize(triangles.len(), patch);
            face_region.resize(triangles.len(), region);
        }
    }
    out.curve_edges = mixed.curve_edges.iter().map(|e| e.map(|v| number[v as usize])).collect();
    out.curve_edges.iter_mut().for_each(|e| e.sort_unstable());
    out.curve_edges.sort_unstable();
    out.mesh = SurfaceMesh { positions, triangles, face_region, regions: input.regions.clone(), unit: input.unit };
    out
}

/// The edges of all elements, low vertex first.
fn edges_of_elements(mixed: &Mixed) -> BTreeSet<[u32; 2]> {
    let faces = (0..mixed.faces.len() as u32).filter(|&f| mixed.is_face(f)).map(|f| corners_of(&mixed.faces[f as usize]));
    faces.flat_map(|c| (0..c.len()).map(move |k| low_first([c[k], c[(k + 1) % c.len()]]))).collect()
}

fn low_first([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// 0 for the diagonal from the first corner, 1 for that from the second: the one with less fold and better halves.
fn better_diagonal(mixed: &Mixed, corners: &[u32]) -> usize {
    let p: Vec<_> = corners.iter().map(|&v| mixed.position[v as usize]).collect();
    let score = |k: usize| {
        let (a, b, c, d) = (p[k], p[k + 1], p[k + 2], p[(k + 3) % 4]);
        let fold = dot(unit(area_vector_twice(a, b, c)), unit(area_vector_twice(a, c, d)));
        kappa(a, b, c).min(kappa(a, c, d)) + 2.0 * fold
    };
    usize::from(score(1) > score(0) + 1e-9)
}
