//! Joining the lifted patches into one conforming mesh along the shared curve meshes.

use crate::curve::{Curve, CurveKind, CurveMesh, CurveNetwork, CurvePoint};
use crate::error::{Element, EngineError, Location, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::mesh::SurfaceMesh;
use crate::patch::PatchMap;
use crate::planar::{LiftedPatch, VertexOrigin};
use crate::topology::Topology;
use crate::vector::{Vec3, lerp};
use crate::work::Work;

mod unfold;

/// What the optimisation may do with a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VertexClass {
    /// Never moved or removed: ends and junctions of features and boundary, sharp corners.
    Corner,
    /// As a corner; and boundary edges between two such vertices are never split.
    Locked,
    /// May slide along its feature or boundary curve.
    Curve,
    /// May move on the surface (also vertices of seams).
    Free,
}

impl VertexClass {
    /// Whether the vertex is never moved or removed.
    pub fn stays(self) -> bool {
        matches!(self, VertexClass::Corner | VertexClass::Locked)
    }
}

/// A conforming mesh of the whole surface, before optimisation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Assembled {
    /// Vertices in space.
    pub positions: Vec<Vec3>,
    /// Triangles, oriented like the input.
    pub triangles: Vec<[u32; 3]>,
    /// Patch of each face.
    pub face_patch: Vec<u32>,
    /// Region (index into the input's regions) of each face.
    pub face_region: Vec<u32>,
    /// What may be done with each vertex.
    pub vertex_class: Vec<VertexClass>,
    /// Edges on boundary and feature curves (vertex pairs, low first, sorted): to be kept as edges or subdivided along the curve.
    pub curve_edges: Vec<[u32; 2]>,
    /// Face of the input on which each vertex lies: a starting point for projections.
    pub vertex_face: Vec<u32>,
    /// The first so many vertices lie on curves: features, the boundary and seams.
    pub curve_vertices: u32,
}

impl Contents for Assembled {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles).u32s(&self.face_patch).u32s(&self.face_region).tuples(&self.curve_edges);
        into.u64(self.vertex_class.len() as u64);
        for class in &self.vertex_class {
            into.u64(*class as u64);
        }
        into.u32s(&self.vertex_face).u64(u64::from(self.curve_vertices));
    }

    fn bytes(&self) -> usize {
        self.positions.len() * (24 + 1 + 4) + self.triangles.len() * 20 + self.curve_edges.len() * 8
    }
}

/// Joins lifted patches: vertices with the same curve point become one. O(output).
/// `topology` is that of the surface the curves were traced on, which may have been cut along them; `mesh` is the imported one, whose
/// faces the maps of the patches name.
/// `locked` tells of each vertex of the surface whether it stays (empty if none does).
/// `corners` are the corners of the features; ends of feature and boundary curves that are junctions are corners too.
///
/// At sizes far above the width of a patch two patches may join the same two curve points by an edge across their inside, or have
/// the same face. Such edges and faces get a vertex of their own, on the input, so that the result is always a simplicial manifold.
///
/// # Errors
/// [`Reason::Invariant`](crate::error::Reason::Invariant) if the result is not a manifold with the input's topology; cancellation.
pub fn assemble(
    mesh: &SurfaceMesh,
    topology: &Topology,
    corners: &[u32],
    locked: &[bool],
    network: &CurveNetwork,
    curve_meshes: &[std::sync::Arc<CurveMesh>],
    patches: &[(std::sync::Arc<LiftedPatch>, &PatchMap)],
    work: &Work<'_>,
) -> Result<Assembled> {
    let joint = CurveVertices::new(topology, corners, locked, network, curve_meshes)?;
    let mut out = Assembled {
        vertex_face: vec![NONE; joint.positions.len()],
        curve_vertices: joint.positions.len() as u32,
        positions: joint.positions,
        vertex_class: joint.classes,
        ..Assembled::default()
    };
    for (p, (lifted, map)) in patches.iter().enumerate() {
        work.check()?;
        add_patch(mesh, &mut out, &joint.numbers, p as u32, lifted, map)?;
    }
    if out.vertex_face.contains(&NONE) {
        return Err(EngineError::invariant("a curve point is in no patch mesh"));
    }
    out.curve_edges = curve_edges(network, &joint.numbers);
    unfold::unfold(mesh, patches, &mut out, work)?;
    work.check()?;
    check_topology(topology, &out)?;
    Ok(out)
}

const NONE: u32 = u32::MAX;

/// The vertices on curves: global numbers of the points of each curve.
struct CurveVertices {
    numbers: Vec<Vec<u32>>,
    positions: Vec<Vec3>,
    classes: Vec<VertexClass>,
}

impl CurveVertices {
    /// Points inside curves are their own; ends are shared by all curves that end at the same vertex of the surface.
    fn new(
        topology: &Topology,
        corners: &[u32],
        locked: &[bool],
        network: &CurveNetwork,
        curve_meshes: &[std::sync::Arc<CurveMesh>],
    ) -> Result<CurveVertices> {
        if network.curves.len() != curve_meshes.len() {
            return Err(EngineError::invariant("curves and curve meshes differ in number"));
        }
        let class_of_end = end_classes(topology, corners, network);
        let mut of_vertex = vec![NONE; topology.vertex_count()];
        let mut out = CurveVertices { numbers: Vec::new(), positions: Vec::new(), classes: Vec::new() };
        for (curve, points) in network.curves.iter().zip(curve_meshes) {
            let (Some(&first), Some(&last)) = (curve.halfedges.first(), curve.halfedges.last()) else {
                return Err(EngineError::invariant("a curve without edges"));
            };
            let inner = if curve.kind == CurveKind::Seam { VertexClass::Free } else { VertexClass::Curve };
            let count = points.points.len();
            let mut numbers = Vec::with_capacity(count);
            for (i, point) in points.points.iter().enumerate() {
                let end = if i == 0 { Some(topology.origin(first)) } else { (i + 1 == count).then(|| topology.target(last)) };
                let known = end.map_or(NONE, |v| of_vertex[v as usize]);
                if known != NONE {
                    numbers.push(known);
                    continue;
                }
                let number = out.positions.len() as u32;
                if let Some(v) = end {
                    of_vertex[v as usize] = number;
                }
                numbers.push(number);
                out.positions.push(point.position);
                let at = if curve.kind == CurveKind::Boundary { vertex_at(topology, curve, point) } else { end };
                let stays = at.or(end).is_some_and(|v| locked.get(v as usize).copied().unwrap_or(false));
                let class = end.map_or(inner, |v| class_of_end[v as usize]);
                out.classes.push(if stays { VertexClass::Locked } else { class });
            }
            out.numbers.push(numbers);
        }
        Ok(out)
    }
}

/// The vertex of the surface that a point of a curve is on, if it is on one.
fn vertex_at(topology: &Topology, curve: &Curve, point: &CurvePoint) -> Option<u32> {
    let h = *curve.halfedges.get(point.segment as usize)?;
    match point.t {
        0.0 => Some(topology.origin(h)),
        1.0 => Some(topology.target(h)),
        _ => None,
    }
}

/// Class of the vertices where curves end: corners where feature and boundary curves end, branch or change kind; where one of them
/// only passes (a seam meets it, or a closed curve starts), the vertex may slide.
fn end_classes(topology: &Topology, corners: &[u32], network: &CurveNetwork) -> Vec<VertexClass> {
    let count = topology.vertex_count();
    // Ends of boundary and of feature curves at each vertex.
    let mut ends = vec![[0u32; 2]; count];
    for curve in network.curves.iter().filter(|c| c.kind != CurveKind::Seam) {
        let kind = usize::from(curve.kind == CurveKind::Feature);
        if let (Some(&first), Some(&last)) = (curve.halfedges.first(), curve.halfedges.last()) {
            ends[topology.origin(first) as usize][kind] += 1;
            ends[topology.target(last) as usize][kind] += 1;
        }
    }
    let mut classes: Vec<VertexClass> = ends
        .iter()
        .map(|e| match e {
            [0, 0] => VertexClass::Free,
            [2, 0] | [0, 2] => VertexClass::Curve,
            _ => VertexClass::Corner,
        })
        .collect();
    for &v in corners {
        classes[v as usize] = VertexClass::Corner;
    }
    classes
}

fn add_patch(
    mesh: &SurfaceMesh,
    out: &mut Assembled,
    numbers: &[Vec<u32>],
    patch: u32,
    lifted: &LiftedPatch,
    map: &PatchMap,
) -> Result<()> {
    let mut global = Vec::with_capacity(lifted.positions.len());
    for (v, origin) in lifted.origins.iter().enumerate() {
        let face = map.faces.get(lifted.points[v].face as usize).copied();
        let face = face.ok_or_else(|| EngineError::invariant(format!("patch {patch} names a face that it does not have")))?;
        let number = match *origin {
            VertexOrigin::Interior => {
                out.positions.push(lifted.positions[v]);
                out.vertex_class.push(VertexClass::Free);
                out.vertex_face.push(face);
                out.positions.len() as u32 - 1
            }
            VertexOrigin::Curve { curve, point } => {
                let number = numbers.get(curve as usize).and_then(|c| c.get(point as usize)).copied();
                let number =
                    number.ok_or_else(|| EngineError::invariant(format!("patch {patch} names a curve point that is not there")))?;
                if out.vertex_face[number as usize] == NONE {
                    out.vertex_face[number as usize] = face;
                }
                number
            }
        };
        global.push(number);
    }
    for t in &lifted.triangles {
        let regions = t.map(|v| mesh.face_region[map.faces[lifted.points[v as usize].face as usize] as usize]);
        let majority = if regions[1] == regions[2] { regions[1] } else { regions[0] };
        out.triangles.push(t.map(|v| global[v as usize]));
        out.face_patch.push(patch);
        out.face_region.push(majority);
    }
    Ok(())
}

fn curve_edges(network: &CurveNetwork, numbers: &[Vec<u32>]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = network
        .curves
        .iter()
        .zip(numbers)
        .filter(|(curve, _)| curve.kind != CurveKind::Seam)
        .flat_map(|(_, points)| points.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// An edge at a vertex of a curve that has more than two faces.
fn crowded_edge(out: &Assembled) -> Option<[u32; 2]> {
    let sides = out.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
    let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).filter(|e| e[0] < out.curve_vertices).collect();
    edges.sort_unstable();
    edges.windows(3).find(|w| w[0] == w[2]).map(|w| w[0])
}

/// Manifold, and component for component the input's Euler characteristic and boundary loops.
fn check_topology(input: &Topology, out: &Assembled) -> Result<()> {
    let result = Topology::build(&out.triangles, out.positions.len()).map_err(|e| match crowded_edge(out) {
        Some([a, b]) => EngineError::new(
            Reason::PlanarMeshFailed,
            "at this size the meshes of patches meet, or one meets itself, in more than their curves",
        )
        .with_hint("ask for a smaller size or more triangles")
        .with_locations([Location {
            element: Element::Face,
            ids: vec![out.vertex_face[a as usize]],
            position: lerp(out.positions[a as usize], out.positions[b as usize], 0.5),
        }]),
        None => EngineError::invariant(format!("the patch meshes do not join to a manifold: {}", e.message())),
    })?;
    let numbers = |t: &Topology| {
        let mut list: Vec<(i64, u32)> = t.components.iter().map(|c| (c.euler(), c.loops)).collect();
        list.sort_unstable();
        list
    };
    if numbers(&result) == numbers(input) {
        return Ok(());
    }
    let (a, b) = (input.totals(), result.totals());
    Err(EngineError::invariant(format!("the joined mesh has (Euler, genus, loops, components) {b:?}, the input {a:?}")))
}

#[cfg(test)]
mod tests;
