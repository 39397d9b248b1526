//! The findings of a diagnosis: each kind of defect with its first places.

use super::edges::{EdgeTable, ends};
use super::numbers::Counted;
use super::{Defect, Finding};
use crate::error::{Location, MAX_LOCATIONS, Result};
use crate::mesh::SurfaceMesh;
use crate::repair::faces::first_equal_face;
use crate::repair::orient::faces_to_turn;
use crate::vector::{area_vector_twice, distance, kappa, norm};
use crate::work::Work;

/// Kappa below which a face is a sliver.
const SLIVER: f64 = 0.1;
/// Area over the square of the longest edge at or below which a face counts as degenerate.
const DEGENERATE: f64 = 1e-12;

/// Places of one kind, the first of them kept.
struct Places {
    defect: Defect,
    count: u64,
    locations: Vec<Location>,
}

impl Places {
    fn new(defect: Defect) -> Self {
        Places { defect, count: 0, locations: Vec::new() }
    }

    fn add(&mut self, place: impl FnOnce() -> Location) {
        self.count += 1;
        if self.locations.len() < MAX_LOCATIONS {
            self.locations.push(place());
        }
    }
}

/// All kinds of defects that occur, worst first.
pub(crate) fn findings(mesh: &SurfaceMesh, edges: &EdgeTable, counted: &Counted, work: &Work<'_>) -> Result<Vec<Finding>> {
    let mut all = vec![non_finite(mesh), non_manifold_edges(mesh, edges), non_manifold_vertices(mesh, counted)];
    all.extend(orientation(mesh, edges, counted));
    work.check()?;
    all.extend(shapes(mesh));
    work.check()?;
    all.extend([duplicates(mesh), holes(mesh, counted), components(mesh, counted)]);
    all.retain(|p| p.count > 0);
    all.sort_by_key(|p| p.defect.rank());
    let finish =
        |p: Places| Finding { defect: p.defect, count: p.count, locations: p.locations, prevents_remeshing: p.defect.prevents_remeshing() };
    Ok(all.into_iter().map(finish).collect())
}

fn non_finite(mesh: &SurfaceMesh) -> Places {
    let mut places = Places::new(Defect::NonFinite);
    for (v, p) in mesh.positions.iter().enumerate() {
        if p.iter().any(|x| !x.is_finite()) {
            places.add(|| mesh.vertex_location(v as u32));
        }
    }
    places
}

fn non_manifold_edges(mesh: &SurfaceMesh, edges: &EdgeTable) -> Places {
    let mut places = Places::new(Defect::NonManifoldEdge);
    for edge in (0..edges.len()).filter(|&e| edges.of(e).len() > 2) {
        places.add(|| side_location(mesh, edges.of(edge)[0]));
    }
    places
}

fn side_location(mesh: &SurfaceMesh, side: u32) -> Location {
    let [a, b] = ends(&mesh.triangles, side);
    mesh.edge_location(a, b)
}

fn non_manifold_vertices(mesh: &SurfaceMesh, counted: &Counted) -> Places {
    let mut places = Places::new(Defect::NonManifoldVertex);
    counted.non_manifold_vertices.iter().for_each(|&v| places.add(|| mesh.vertex_location(v)));
    places
}

/// Faces to turn, and in parts that have no orientation the edges along which both faces run the same way.
fn orientation(mesh: &SurfaceMesh, edges: &EdgeTable, counted: &Counted) -> [Places; 2] {
    let mut conflicts = Places::new(Defect::NotOrientable);
    let mut flipped = Places::new(Defect::FlippedFace);
    if counted.numbers.inconsistent_edges > 0 {
        let (turn, _) = faces_to_turn(&mesh.triangles, edges);
        for face in (0..turn.len()).filter(|&f| turn[f]) {
            flipped.add(|| mesh.face_location(face));
        }
        for edge in 0..edges.len() {
            let Some([a, b]) = edges.pair(edge) else { continue };
            let same = ends(&mesh.triangles, a)[0] == ends(&mesh.triangles, b)[0];
            if same == (turn[a as usize / 3] == turn[b as usize / 3]) {
                conflicts.add(|| side_location(mesh, a));
            }
        }
    }
    [conflicts, flipped]
}

fn shapes(mesh: &SurfaceMesh) -> [Places; 2] {
    let mut degenerate = Places::new(Defect::DegenerateFace);
    let mut slivers = Places::new(Defect::Sliver);
    for face in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(face);
        if kappa(a, b, c) >= SLIVER {
            continue;
        }
        slivers.add(|| mesh.face_location(face));
        let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
        if 0.5 * norm(area_vector_twice(a, b, c)) <= DEGENERATE * longest * longest {
            degenerate.add(|| mesh.face_location(face));
        }
    }
    [degenerate, slivers]
}

fn duplicates(mesh: &SurfaceMesh) -> Places {
    let mut places = Places::new(Defect::DuplicateFace);
    let first = first_equal_face(&mesh.triangles, mesh.positions.len());
    for face in (0..first.len()).filter(|&f| first[f] as usize != f) {
        places.add(|| mesh.face_location(face));
    }
    places
}

fn holes(mesh: &SurfaceMesh, counted: &Counted) -> Places {
    let mut places = Places::new(Defect::Hole);
    counted.loop_sides.iter().for_each(|&side| places.add(|| side_location(mesh, side)));
    places
}

fn components(mesh: &SurfaceMesh, counted: &Counted) -> Places {
    let mut places = Places::new(Defect::Component);
    counted.component_faces.iter().skip(1).for_each(|&face| places.add(|| mesh.face_location(face as usize)));
    places
}
