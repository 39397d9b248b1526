//! The surface model every stage shares: positions, triangles, regions, unit.

use crate::error::{Element, EngineError, Location, Reason, Result};
use crate::fingerprint::{Contents, Feeder};
use crate::vector::Vec3;

/// Unit of the coordinates. Never guessed: a format without units gives [`LengthUnit::Unspecified`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum LengthUnit {
    /// The source did not say.
    #[default]
    Unspecified,
    /// Metre.
    Metre,
    /// Centimetre.
    Centimetre,
    /// Millimetre.
    Millimetre,
    /// Micrometre.
    Micrometre,
    /// Inch.
    Inch,
    /// Foot.
    Foot,
}

/// A named part of the surface: a solid of an STL, a group of an OBJ, a physical group of an MSH file.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Region {
    /// The number the source gave it, kept verbatim.
    pub id: i64,
    /// Its name, UTF-8, case kept; may be empty if the source had only numbers.
    pub name: String,
}

/// A triangulated surface. Positions are finite; indices are in range; no triangle repeats a vertex index.
/// Nothing is promised about manifoldness: see [`crate::topology::Topology`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each face, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// For each face an index into `regions`; same length as `triangles`.
    pub face_region: Vec<u32>,
    /// The regions; at least one if there is a face.
    pub regions: Vec<Region>,
    /// Unit of `positions`.
    pub unit: LengthUnit,
}

impl SurfaceMesh {
    /// A mesh of one unnamed region.
    pub fn from_parts(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let face_region = vec![0; triangles.len()];
        SurfaceMesh {
            positions,
            triangles,
            face_region,
            regions: vec![Region { id: 0, name: String::new() }],
            unit: LengthUnit::Unspecified,
        }
    }

    /// Corner positions of a face.
    #[inline]
    pub fn corners(&self, face: usize) -> [Vec3; 3] {
        self.triangles[face].map(|v| self.positions[v as usize])
    }

    /// Total area.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|f| {
                let [a, b, c] = self.corners(f);
                crate::vector::triangle_area(a, b, c)
            })
            .sum()
    }

    /// A location for an error about a face (its centroid).
    pub fn face_location(&self, face: usize) -> Location {
        let [a, b, c] = self.corners(face);
        let position = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
        Location { element: Element::Face, ids: vec![face as u32], position }
    }

    /// A location for an error about an edge (its midpoint).
    pub fn edge_location(&self, a: u32, b: u32) -> Location {
        let position = crate::vector::lerp(self.positions[a as usize], self.positions[b as usize], 0.5);
        Location { element: Element::Edge, ids: vec![a, b], position }
    }

    /// A location for an error about a vertex.
    pub fn vertex_location(&self, vertex: u32) -> Location {
        Location { element: Element::Vertex, ids: vec![vertex], position: self.positions[vertex as usize] }
    }

    /// Checks the promises of the type.
    ///
    /// # Errors
    /// [`Reason::NonFinite`], [`Reason::IndexOutOfRange`], [`Reason::EmptyMesh`] or [`Reason::Invariant`] (array lengths).
    pub fn validate(&self) -> Result<()> {
        if let Some(bad) = self.positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(EngineError::new(Reason::NonFinite, format!("vertex {bad} has a coordinate that is not finite")));
        }
        if self.triangles.is_empty() {
            return Err(EngineError::new(Reason::EmptyMesh, "the surface has no triangle"));
        }
        let count = self.positions.len();
        for (f, t) in self.triangles.iter().enumerate() {
            if t.iter().any(|&v| v as usize >= count) {
                return Err(EngineError::new(Reason::IndexOutOfRange, format!("face {f} names vertices {t:?} of {count}")));
            }
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                return Err(EngineError::invariant(format!("face {f} repeats a vertex: {t:?}")));
            }
        }
        let regions = self.regions.len();
        if self.face_region.len() != self.triangles.len() || self.face_region.iter().any(|&r| r as usize >= regions) {
            return Err(EngineError::invariant("face_region does not fit triangles and regions"));
        }
        Ok(())
    }
}

impl Contents for SurfaceMesh {
    fn feed(&self, into: &mut Feeder) {
        into.points(&self.positions).tuples(&self.triangles).u32s(&self.face_region).u64(self.unit as u64);
        into.u64(self.regions.len() as u64);
        for region in &self.regions {
            into.u64(region.id as u64).text(&region.name);
        }
    }

    fn bytes(&self) -> usize {
        self.positions.len() * 24 + self.triangles.len() * 16 + self.regions.iter().map(|r| 32 + r.name.len()).sum::<usize>()
    }
}
