//! A mutable surface mesh of quadrangles and triangles: faces with the faces around each vertex, and the edges that have to stay.

use super::shape::{area_vector, quality};
use crate::optimize::input::{Foot, Input};
use crate::vector::{Vec3, add, angle_between, dot, scale, sub, unit};

/// "No corner", "no face": only inside this structure.
pub(super) const NONE: u32 = u32::MAX;

/// Largest angle between curve edges in the corner of a quadrangle: eta 0.4.
const MOST_PINNED: f64 = 0.8 * std::f64::consts::PI;

/// Corners of a face in order; a triangle has [`NONE`] last.
pub(super) type Corners = [u32; 4];

#[derive(Default)]
pub(super) struct Mixed {
    pub(super) position: Vec<Vec3>,
    /// Face of the input below each vertex.
    pub(super) below: Vec<u32>,
    /// Vertices on curves, which stay.
    pub(super) is_fixed: Vec<bool>,
    /// Faces; removed ones start with [`NONE`].
    pub(super) faces: Vec<Corners>,
    /// Patch and region of each face.
    pub(super) label: Vec<[u32; 2]>,
    pub(super) around: Vec<Vec<u32>>,
    /// Edges on curves, low vertex first, sorted.
    pub(super) curve_edges: Vec<[u32; 2]>,
}

/// The corners of a face.
pub(super) fn corners_of(face: &Corners) -> &[u32] {
    if face[3] == NONE { &face[..3] } else { &face[..] }
}

impl Mixed {
    pub(super) fn is_face(&self, f: u32) -> bool {
        self.faces[f as usize][0] != NONE
    }

    pub(super) fn is_quad(&self, f: u32) -> bool {
        self.faces[f as usize][3] != NONE
    }

    pub(super) fn corners(&self, f: u32) -> &[u32] {
        corners_of(&self.faces[f as usize])
    }

    /// Rebuilds the faces around the vertices.
    pub(super) fn index(&mut self) {
        self.around = vec![Vec::new(); self.position.len()];
        for f in 0..self.faces.len() as u32 {
            if self.is_face(f) {
                for &v in corners_of(&self.faces[f as usize]) {
                    self.around[v as usize].push(f);
                }
            }
        }
    }

    pub(super) fn is_curve(&self, a: u32, b: u32) -> bool {
        self.curve_edges.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }

    /// Corner before and after `v` in a face.
    pub(super) fn beside(&self, f: u32, v: u32) -> (u32, u32) {
        let corners = self.corners(f);
        let count = corners.len();
        let k = corners.iter().position(|&c| c == v).unwrap_or(0);
        (corners[(k + count - 1) % count], corners[(k + 1) % count])
    }

    /// The vertices joined to `v` by an edge, sorted.
    pub(super) fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut out: Vec<u32> = self.around[v as usize].iter().flat_map(|&f| <[u32; 2]>::from(self.beside(f, v))).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// The other face along the edge of `f` from `a` to `b`.
    pub(super) fn across(&self, f: u32, a: u32, b: u32) -> Option<u32> {
        self.around[a as usize].iter().copied().find(|&g| g != f && self.corners(g).contains(&b) && self.beside(g, a).0 == b)
    }

    pub(super) fn points(&self, corners: &[u32]) -> ([Vec3; 4], usize) {
        let mut points = [[0.0; 3]; 4];
        for (p, &v) in points.iter_mut().zip(corners) {
            *p = self.position[v as usize];
        }
        (points, corners.len())
    }

    /// Shape of corners, -1 if they look against the surface.
    pub(super) fn quality_of(&self, corners: &[u32], input: &Input<'_>) -> f64 {
        let (points, count) = self.points(corners);
        let points = &points[..count];
        let middle = scale(points.iter().fold([0.0; 3], |s, p| add(s, *p)), 1.0 / count as f64);
        let area = area_vector(points);
        let foot = input.walk(middle, self.below[corners[0] as usize]);
        if looks_with(area, input, &foot) { quality(points) } else { -1.0 }
    }

    /// Whether a quadrangle has a corner between two curve edges that is so flat that nothing can make a good quadrangle of it.
    pub(super) fn is_pinned_flat(&self, corners: &[u32]) -> bool {
        corners.len() == 4 && (0..4).any(|k| self.is_flat_at(corners, k))
    }

    /// Whether this corner of a quadrangle is between two curve edges and that flat.
    pub(super) fn is_flat_at(&self, corners: &[u32], k: usize) -> bool {
        let (before, v, after) = (corners[(k + 3) % 4], corners[k], corners[(k + 1) % 4]);
        let to = |w: u32| sub(self.position[w as usize], self.position[v as usize]);
        self.is_fixed[v as usize]
            && self.is_curve(before, v)
            && self.is_curve(v, after)
            && angle_between(to(before), to(after)) > MOST_PINNED
    }

    /// A vertex without faces yet; returns it.
    pub(super) fn add_vertex(&mut self, position: Vec3, below: u32, is_fixed: bool) -> u32 {
        self.position.push(position);
        self.below.push(below);
        self.is_fixed.push(is_fixed);
        self.around.push(Vec::new());
        self.position.len() as u32 - 1
    }

    /// Removes faces and adds others in their place; those beyond their number are new faces with the label of the first.
    pub(super) fn replace(&mut self, old: &[u32], new: &[Corners]) {
        for &f in old {
            for v in self.faces[f as usize].into_iter().filter(|&v| v != NONE) {
                self.around[v as usize].retain(|&g| g != f);
            }
            self.faces[f as usize] = [NONE; 4];
        }
        let label = self.label[old[0] as usize];
        for (i, corners) in new.iter().enumerate() {
            let f = match old.get(i) {
                Some(&f) => f,
                None => {
                    self.faces.push([NONE; 4]);
                    self.label.push(label);
                    self.faces.len() as u32 - 1
                }
            };
            self.faces[f as usize] = *corners;
            for &v in corners_of(corners) {
                self.around[v as usize].push(f);
            }
        }
    }
}

/// Whether an area vector looks the way of the surface.
pub(super) fn looks_with(area: Vec3, input: &Input<'_>, foot: &Foot) -> bool {
    let n = unit(area);
    dot(n, input.normal(foot)) > 0.1 || dot(n, input.face_normal(foot)) > 0.1
}
