//! The input surface as the optimisation sees it: projection by walking from a face nearby, normals, wanted sizes.

use crate::bvh::{TriangleBvh, closest_on_triangle};
use crate::mesh::SurfaceMesh;
use crate::sizing::SizeField;
use crate::vector::{Vec3, add, add_scaled, area_vector_twice, dot, norm, scale, sub, unit};
use std::cell::OnceCell;

/// A point of the input.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot {
    pub(crate) face: u32,
    pub(crate) position: Vec3,
    pub(crate) barycentric: [f64; 3],
    pub(crate) distance_squared: f64,
}

/// A search tree over the faces of the input.
pub(crate) enum Tree<'a> {
    /// Made before.
    Made(&'a TriangleBvh),
    /// Made when it is first asked for, which seldom happens.
    Lazy(OnceCell<TriangleBvh>),
}

/// The input with its faces by vertex.
pub(crate) struct Input<'a> {
    mesh: &'a SurfaceMesh,
    tree: Tree<'a>,
    sizes: &'a SizeField,
    first: Vec<u32>,
    faces: Vec<u32>,
    face_normal: Vec<Vec3>,
    vertex_normal: Vec<Vec3>,
}

/// Steps of a walk before it gives up; a walk moves less than an element, across a few input faces.
const MOST_STEPS: usize = 200;

/// Coordinates below this are 0.
const NOTHING: f64 = 1e-60;

impl<'a> Input<'a> {
    pub(crate) fn new(mesh: &'a SurfaceMesh, tree: Tree<'a>, sizes: &'a SizeField) -> Self {
        let mut first = vec![0u32; mesh.positions.len() + 1];
        for &v in mesh.triangles.as_flattened() {
            first[v as usize + 1] += 1;
        }
        for v in 0..mesh.positions.len() {
            first[v + 1] += first[v];
        }
        let mut fill = first.clone();
        let mut faces = vec![0; mesh.triangles.len() * 3];
        let mut face_normal = Vec::with_capacity(mesh.triangles.len());
        let mut vertex_normal = vec![[0.0; 3]; mesh.positions.len()];
        for (f, t) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(f);
            let area = area_vector_twice(a, b, c);
            face_normal.push(unit(area));
            for &v in t {
                faces[fill[v as usize] as usize] = f as u32;
                fill[v as usize] += 1;
                vertex_normal[v as usize] = add(vertex_normal[v as usize], area);
            }
        }
        vertex_normal.iter_mut().for_each(|n| *n = unit(*n));
        Input { mesh, tree, sizes, first, faces, face_normal, vertex_normal }
    }

    #[inline]
    fn on_face(&self, p: Vec3, face: u32) -> Foot {
        let (position, barycentric) = match &self.tree {
            // The tree has neighbours next to each other in memory.
            Tree::Made(tree) => closest_on_triangle(p, tree.corners_of(face)),
            Tree::Lazy(_) => closest_on_triangle(p, &self.mesh.corners(face as usize)),
        };
        // Traces of rounding near 0 would underflow in products later.
        let position = position.map(|x| if x.abs() < NOTHING { 0.0 } else { x });
        let offset = sub(p, position);
        Foot { face, position, barycentric, distance_squared: dot(offset, offset) }
    }

    fn faces_of(&self, v: u32) -> &[u32] {
        &self.faces[self.first[v as usize] as usize..self.first[v as usize + 1] as usize]
    }

    /// Descends from a face to the closest point of the surface around: stays on the same sheet where another one is near.
    pub(crate) fn walk(&self, p: Vec3, from: u32) -> Foot {
        let mut best = self.on_face(p, from);
        for _ in 0..MOST_STEPS {
            let corners = self.mesh.triangles[best.face as usize];
            let touched = best.barycentric.map(|w| w > 0.0);
            let better = match touched {
                [true, true, true] => None,
                _ => {
                    let pivot = if touched[0] {
                        0
                    } else if touched[1] {
                        1
                    } else {
                        2
                    };
                    // On an edge only the face across it has the other end too; at a corner every face around may be nearer.
                    let other = (pivot + 1..3).find(|&k| touched[k]).map(|k| corners[k]);
                    self.best_around(p, best, corners[pivot], other)
                }
            };
            match better {
                Some(foot) => best = foot,
                None => break,
            }
        }
        best
    }

    fn tree(&self) -> &TriangleBvh {
        match &self.tree {
            Tree::Made(tree) => tree,
            Tree::Lazy(cell) => cell.get_or_init(|| TriangleBvh::build(&self.mesh.positions, &self.mesh.triangles)),
        }
    }

    fn best_around(&self, p: Vec3, at: Foot, pivot: u32, other: Option<u32>) -> Option<Foot> {
        let mut best: Option<Foot> = None;
        let mut bound = at.distance_squared * (1.0 - 1e-12);
        let centre = self.mesh.positions[pivot as usize];
        let away = sub(p, centre);
        for &f in self.faces_of(pivot) {
            let corners = self.mesh.triangles[f as usize];
            let is_apart = match other {
                Some(v) => !corners.contains(&v),
                // The corner is the closest point of a face none of whose edges leads towards the place.
                None => corners.iter().all(|&v| v == pivot || dot(away, sub(self.mesh.positions[v as usize], centre)) <= 0.0),
            };
            if f == at.face || is_apart {
                continue;
            }
            let foot = self.on_face(p, f);
            if foot.distance_squared < bound {
                bound = foot.distance_squared;
                best = Some(foot);
            }
        }
        best
    }

    /// The closest point by walking, or by the tree where the walk ends farther away than `far` and the tree finds a point at most
    /// half as far on a side that looks the same way.
    pub(crate) fn project(&self, p: Vec3, from: u32, far: f64) -> Foot {
        let foot = self.walk(p, from);
        if foot.distance_squared <= far * far {
            return foot;
        }
        match self.tree().closest_below(p, 0.25 * foot.distance_squared, 0.0) {
            Some(hit) if dot(self.face_normal[hit.face as usize], self.normal(&foot)) > 0.3 => self.on_face(p, hit.face),
            _ => foot,
        }
    }

    /// Squared distance of a point from the whole surface, given that of its foot, if that is above `small`; else the latter. A walk may
    /// end too early, and then says too much.
    pub(crate) fn true_distance_squared(&self, p: Vec3, foot: &Foot, small: f64) -> f64 {
        if foot.distance_squared <= small * small {
            return foot.distance_squared;
        }
        self.tree().closest_below(p, foot.distance_squared, 0.0).map_or(foot.distance_squared, |hit| hit.distance_squared)
    }

    /// Vertices with a face whose normal has a lower cosine with that of the vertex, in order.
    pub(crate) fn sharp_vertices(&self, least_cosine: f64) -> Vec<u32> {
        let sharp = |v: u32| {
            let normal = self.vertex_normal[v as usize];
            self.faces_of(v).iter().any(|&f| dot(self.face_normal[f as usize], normal) < least_cosine)
        };
        (0..self.vertex_normal.len() as u32).filter(|&v| sharp(v)).collect()
    }

    /// A vertex as a foot; `None` for one on the boundary or of no face.
    pub(crate) fn inner_vertex(&self, v: u32) -> Option<Foot> {
        let faces = self.faces_of(v);
        let others = |f: u32| self.mesh.triangles[f as usize].into_iter().filter(|w| *w != v);
        let mut ring: Vec<u32> = faces.iter().flat_map(|&f| others(f)).collect();
        ring.sort_unstable();
        let closed = ring.chunks(2).all(|pair| pair.len() == 2 && pair[0] == pair[1]);
        let first = *faces.first()?;
        closed.then(|| self.on_face(self.mesh.positions[v as usize], first))
    }

    /// Whether a foot lies on the boundary of the input. O(faces at a vertex) for feet on an edge, else O(1).
    pub(crate) fn is_on_boundary(&self, foot: &Foot) -> bool {
        let corners = self.mesh.triangles[foot.face as usize];
        let mut touched = (0..3).filter(|&k| foot.barycentric[k] > 0.0).map(|k| corners[k]);
        match (touched.next(), touched.next(), touched.next()) {
            (Some(a), Some(b), None) => self.faces_of(a).iter().filter(|&&f| self.mesh.triangles[f as usize].contains(&b)).count() < 2,
            (Some(a), None, None) => self.inner_vertex(a).is_none(),
            _ => false,
        }
    }

    /// Position of a vertex.
    pub(crate) fn position(&self, v: u32) -> Vec3 {
        self.mesh.positions[v as usize]
    }

    /// Wanted edge length at a vertex.
    pub(crate) fn vertex_size(&self, v: u32) -> f64 {
        self.sizes.uniform.unwrap_or_else(|| self.sizes.vertex_size[v as usize])
    }

    /// Length of the bounding box's diagonal.
    pub(crate) fn diagonal(&self) -> f64 {
        let bounds = self.mesh.positions.iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
            (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
        });
        norm(sub(bounds.1, bounds.0))
    }

    /// Normal of the face.
    pub(crate) fn face_normal(&self, foot: &Foot) -> Vec3 {
        self.face_normal[foot.face as usize]
    }

    /// Normal interpolated between the vertices, unit length (zero on a knife edge).
    pub(crate) fn normal(&self, foot: &Foot) -> Vec3 {
        let t = self.mesh.triangles[foot.face as usize];
        let sum = (0..3).fold([0.0; 3], |s, k| add_scaled(s, self.vertex_normal[t[k] as usize], foot.barycentric[k]));
        unit(sum)
    }

    /// Wanted edge length.
    pub(crate) fn size(&self, foot: &Foot) -> f64 {
        if let Some(size) = self.sizes.uniform {
            return size;
        }
        let t = self.mesh.triangles[foot.face as usize];
        (0..3).map(|k| foot.barycentric[k] * self.sizes.vertex_size[t[k] as usize]).sum()
    }

    /// Whether a triangle with this area vector looks the way of the surface at the foot of its middle.
    pub(crate) fn agrees(&self, area: Vec3, foot: &Foot, least_cosine: f64) -> bool {
        let n = unit(area);
        dot(n, self.face_normal(foot)) > least_cosine || dot(n, self.normal(foot)) > least_cosine
    }
}

/// Middle of three points.
pub(crate) fn middle([a, b, c]: [Vec3; 3]) -> Vec3 {
    scale(add(add(a, b), c), 1.0 / 3.0)
}
