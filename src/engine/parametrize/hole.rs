//! Fills one loop with a graded Delaunay mesh of its mean plane (P1 section 8), for the operators of a map only.

use super::frame::{Normalised, Plane, largest_shadow, mean_plane};
use super::outer::signed_area;
use super::validity::{Overlap, find_overlap, orientation};
use crate::error::{Element, EngineError, Location, Reason, Result};
use crate::vector::{Vec2, Vec3, lerp};
use crate::work::Work;
use spade::handles::{FixedVertexHandle, InnerTag};
use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation as _};

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Smallest angle asked for, in degrees. Triangles at the loop can have smaller ones: its edges are not divided.
const MIN_ANGLE: f64 = 25.0;

/// Triangles below this part of the box of the loop are left as they are: their circumcentres drown in rounding.
const MIN_AREA: f64 = 1e-14;

/// Least area of a shadow over the squared length of the loop (a circle has 0.08): a loop on edge has no inside worth meshing.
const MIN_SHADOW: f64 = 0.004;

/// Least number of new vertices between two checkpoints. In a large mesh it is an eighth of the vertices: each slice looks at all.
const SLICE: usize = 8192;

/// A mesh of the inside of a loop.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HoleMesh {
    /// New vertices, in the mean plane of the loop.
    pub(super) positions: Vec<Vec3>,
    /// Triangles. Indices below the number of vertices of the loop are places in it, those from there on new vertices. Every edge of the
    /// loop is run through against its direction, so that patch and mesh together are oriented.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Meshes the inside of the loop `ring` (vertices of a patch, which lies on its left). The mesh is a disc whose boundary is the loop;
/// projected onto the plane its triangles do not overlap. Inside, the mesh grades from the lengths of the edges of the loop upwards:
/// about 1.5 new vertices per edge of a round loop, at most 10 per edge and 100. The plane is that of the least squared distances or, if
/// the loop crosses itself there, that of its largest shadow, if that is large enough. O(m log m), about 10 microseconds per edge.
///
/// # Errors
/// [`Reason::ChartFailed`] if neither projection is a simple polygon, with two edges that meet (local ids and positions as given);
/// [`Reason::PlanarMeshFailed`] if the triangulation is not what it should be; cancellation.
pub(super) fn mean_plane_fill(ring: &[u32], positions: &[Vec3], work: &Work<'_>) -> Result<HoleMesh> {
    if ring.len() < 3 || ring.iter().any(|&v| v as usize >= positions.len()) {
        return Err(EngineError::invariant("a hole with fewer than three edges or with indices out of range"));
    }
    let normalised = Normalised::of(ring, positions);
    let (plane, flat) = simple_projection(ring, positions, &normalised, work)?;
    let mut cdt = constrained(&flat)?;
    refine(&mut cdt, flat.len(), work)?;
    let (points, triangles) = inside(&cdt, flat.len())?;
    check_disc(flat.len(), &points, &triangles)?;
    let lift = |p: &Vec2| normalised.restore(plane.lift([p[0] - SHIFT, p[1] - SHIFT]));
    Ok(HoleMesh { positions: points[flat.len()..].iter().map(lift).collect(), triangles })
}

/// Added to plane coordinates, which are within 1 of 0: spade refuses numbers that are nearly 0, and there are none then.
const SHIFT: f64 = 2.0;

/// The loop in a plane in which it is simple and runs clockwise, so that triangles inside are counter-clockwise.
fn simple_projection(ring: &[u32], positions: &[Vec3], normalised: &Normalised, work: &Work<'_>) -> Result<(Plane, Vec<Vec2>)> {
    let places = [(0..ring.len() as u32).rev().collect::<Vec<u32>>()];
    let planes = [Some(mean_plane(&normalised.points)), largest_shadow(&normalised.points)];
    let length: f64 = normalised.lengths().iter().sum();
    let mut first = None;
    for (k, plane) in planes.into_iter().flatten().map(Plane::reversed).enumerate() {
        let flat: Vec<Vec2> = normalised.points.iter().map(|&p| plane.project(p).map(|x| x + SHIFT)).collect();
        if k > 0 && -signed_area(&flat) < MIN_SHADOW * length * length {
            break;
        }
        match find_overlap(&places, &flat, work)? {
            None => return Ok((plane, flat)),
            found => first = first.or(found),
        }
    }
    let edges = match first {
        Some(Overlap::Edges(edges)) => edges.to_vec(),
        _ => Vec::new(),
    };
    let location = |[a, b]: [u32; 2]| {
        let ids = vec![ring[b as usize], ring[a as usize]];
        let position = lerp(positions[ids[0] as usize], positions[ids[1] as usize], 0.5);
        Location { element: Element::Edge, ids, position }
    };
    Err(EngineError::new(
        Reason::ChartFailed,
        format!("the projection of a hole of {} edges onto its mean plane is no simple polygon", ring.len()),
    )
    .with_hint("fill holes with a centre vertex, or leave them open")
    .with_locations(edges.into_iter().map(location)))
}

fn failed(why: &str) -> EngineError {
    EngineError::new(Reason::PlanarMeshFailed, format!("the mesh of the mean plane of a hole is wrong: {why}"))
        .with_hint("fill holes with a centre vertex, or leave them open")
}

fn constrained(flat: &[Vec2]) -> Result<Cdt> {
    let m = flat.len();
    let vertices = flat.iter().map(|p| Point2::new(p[0], p[1])).collect();
    let edges = (0..m).map(|k| [k, (k + 1) % m]).collect();
    let mut conflict = false;
    let cdt = Cdt::try_bulk_load_cdt(vertices, edges, |_| conflict = true).map_err(|e| failed(&e.to_string()))?;
    if conflict || cdt.num_vertices() != m || cdt.num_constraints() != m { Err(failed("edges of the loop are missing")) } else { Ok(cdt) }
}

/// Inserts circumcentres of bad triangles. The loop stays as it is.
fn refine(cdt: &mut Cdt, edges: usize, work: &Work<'_>) -> Result<()> {
    let most = cdt.num_vertices() + 10 * edges + 100;
    loop {
        work.check()?;
        let room = SLICE.max(cdt.num_vertices() / 8).min(most.saturating_sub(cdt.num_vertices()));
        let parameters = RefinementParameters::<f64>::new()
            .exclude_outer_faces(true)
            .keep_constraint_edges()
            .with_angle_limit(AngleLimit::from_deg(MIN_ANGLE))
            .with_min_required_area(MIN_AREA)
            .with_max_additional_vertices(room);
        if room == 0 || cdt.refine(parameters).refinement_complete {
            return Ok(());
        }
    }
}

/// The triangles on the inner side of the loop, and all vertices they use, those of the loop first.
fn inside(cdt: &Cdt, m: usize) -> Result<(Vec<Vec2>, Vec<[u32; 3]>)> {
    let mut seen = vec![false; cdt.num_all_faces()];
    let mut stack: Vec<spade::handles::FixedFaceHandle<InnerTag>> = Vec::new();
    for k in 0..m {
        let [a, b] = [(k + 1) % m, k].map(FixedVertexHandle::from_index);
        let edge = cdt.get_edge_from_neighbors(a, b).filter(|e| e.is_constraint_edge());
        let face = edge.and_then(|e| e.face().as_inner()).ok_or_else(|| failed("an edge of the loop has no triangle inside"))?;
        if !std::mem::replace(&mut seen[face.index()], true) {
            stack.push(face.fix());
        }
    }
    let mut points: Vec<Vec2> = (0..m).map(|k| cdt.vertex(FixedVertexHandle::from_index(k)).position()).map(|p| [p.x, p.y]).collect();
    let mut number: Vec<Option<u32>> = (0..cdt.num_vertices()).map(|k| (k < m).then_some(k as u32)).collect();
    let mut triangles = Vec::new();
    while let Some(face) = stack.pop() {
        let face = cdt.face(face);
        triangles.push(face.vertices().map(|v| {
            *number[v.index()].get_or_insert_with(|| {
                points.push([v.position().x, v.position().y]);
                points.len() as u32 - 1
            })
        }));
        for edge in face.adjacent_edges().into_iter().filter(|e| !e.is_constraint_edge()) {
            let next = edge.rev().face().as_inner().ok_or_else(|| failed("the loop does not close its inside off"))?;
            if !std::mem::replace(&mut seen[next.index()], true) {
                stack.push(next.fix());
            }
        }
    }
    Ok((points, triangles))
}

/// That the triangles are a disc with the loop, clockwise, as boundary. If all are counter-clockwise and the boundary of their sum is the
/// loop, which is simple, then the number of triangles over a point is the winding number of the reversed loop: they tile its inside.
fn check_disc(m: usize, points: &[Vec2], triangles: &[[u32; 3]]) -> Result<()> {
    if triangles.iter().any(|t| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        orientation(a, b, c) <= 0.0
    }) {
        return Err(failed("a triangle is flat or clockwise"));
    }
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]])).collect();
    // The loop itself closes the chain.
    sides.extend((0..m).map(|k| [k as u32, ((k + 1) % m) as u32]));
    sides.sort_unstable();
    if sides.windows(2).any(|w| w[0] == w[1]) || sides.iter().any(|&[a, b]| sides.binary_search(&[b, a]).is_err()) {
        return Err(failed("its boundary is not the loop"));
    }
    // With V - E + F = 1 for a disc of V vertices and m boundary edges, F = 2 V - 2 - m.
    if triangles.len() + 2 + m != 2 * points.len() { Err(failed("it is no disc")) } else { Ok(()) }
}

#[cfg(test)]
mod tests;
