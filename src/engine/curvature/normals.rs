//! Normals of sectors. A full fan gives that of the sphere through its vertices (Max 1999); half a fan would lean to its faces, so there
//! the normal is the one whose mean with each neighbour's is orthogonal to the edge between them, which also holds on spheres.

use super::sectors::Sectors;
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, add, add_scaled, area_vector_twice, cross, distance, dot, sub, unit};
use crate::work::Work;

/// Edges shorter than this share of the mean edge of their vertex weigh no more than one of this share: their direction is mostly noise.
const SHORTEST_SHARE: f64 = 0.1;
/// Gauss-Seidel sweeps over the normals at boundaries and features.
const SWEEPS: usize = 10;
/// Weight of an edge to another such vertex against one to a full fan.
const UNCERTAIN: f64 = 0.25;
/// Share of the squared lengths that holds a normal where edges do not determine it.
const HOLD: f64 = 1e-3;
/// A normal found from the neighbours may not lean further from that of the faces than this cosine.
const FARTHEST: f64 = 0.5;

/// Two unit vectors that make a right-handed frame with the unit vector `n`.
pub(crate) fn tangents(n: Vec3) -> (Vec3, Vec3) {
    let axis = (0..3).fold(0, |best, k| if n[k].abs() < n[best].abs() { k } else { best });
    let mut e = [0.0; 3];
    e[axis] = 1.0;
    let t = unit(cross(e, n));
    (t, cross(n, t))
}

/// Normals from the faces, and which of them lean: those of half a fan, and those of a vertex so close to another that both together have
/// the full fan.
fn fan_normals(mesh: &SurfaceMesh, topology: &Topology, sectors: &Sectors, work: &Work<'_>) -> Result<(Vec<Vec3>, Vec<bool>)> {
    let mut sums = vec![([0.0; 3], [0.0; 3]); sectors.count()];
    let mut leans: Vec<bool> = (0..sectors.count()).map(|s| sectors.is_open(s)).collect();
    for v in 0..topology.vertex_count() as u32 {
        if v.is_multiple_of(65_536) {
            work.check()?;
        }
        let at = mesh.positions[v as usize];
        let (count, length) = topology
            .outgoing(v)
            .fold((0usize, 0.0), |(count, sum), h| (count + 1, sum + distance(at, mesh.positions[topology.target(h) as usize])));
        let least = SHORTEST_SHARE * length / count.max(1) as f64;
        for (sector, h) in sectors.corners(topology, v) {
            let (b, c) = (mesh.positions[topology.target(h) as usize], mesh.positions[topology.target(topology.next(h)) as usize]);
            let normal = area_vector_twice(at, b, c);
            let (x, y) = (distance(at, b), distance(at, c));
            leans[sector] |= x.min(y) < least;
            let (x, y) = (x.max(least), y.max(least));
            let weight = 1.0 / (x * x * y * y);
            if weight.is_finite() {
                sums[sector].0 = add_scaled(sums[sector].0, normal, weight);
            }
            sums[sector].1 = add(sums[sector].1, normal);
        }
    }
    // Opposed faces may cancel: any unit vector is better than none.
    let pick = |(weighted, plain): (Vec3, Vec3)| {
        let (a, b) = (unit(weighted), unit(plain));
        let usable = |n: Vec3| n.iter().all(|x| x.is_finite()) && n != [0.0; 3];
        if usable(a) {
            a
        } else if usable(b) {
            b
        } else {
            [0.0, 0.0, 1.0]
        }
    };
    Ok((sums.into_iter().map(pick).collect(), leans))
}

/// The normals of all sectors. O(F).
pub(super) fn sector_normals(mesh: &SurfaceMesh, topology: &Topology, sectors: &Sectors, work: &Work<'_>) -> Result<Vec<Vec3>> {
    let (mut normals, leans) = fan_normals(mesh, topology, sectors, work)?;
    let first_guess = normals.clone();
    let leaning: Vec<u32> = (0..topology.vertex_count() as u32).filter(|&v| sectors.of_vertex(v).any(|s| leans[s])).collect();
    let mut systems: Vec<System> = Vec::new();
    for _ in 0..SWEEPS {
        for (i, &v) in leaning.iter().enumerate() {
            if i % 4096 == 0 {
                work.check()?;
            }
            let own = sectors.of_vertex(v);
            systems.clear();
            systems.extend(own.clone().map(|s| System::new(normals[s])));
            for (sector, h) in sectors.corners(topology, v) {
                // Both edges of the corner; those inside the sector count twice, as they belong to two faces.
                for (edge, corner) in [(topology.target(h), topology.next(h)), (topology.origin(topology.prev(h)), topology.prev(h))] {
                    let e = sub(mesh.positions[edge as usize], mesh.positions[v as usize]);
                    let other = sectors.of_corner(corner) as usize;
                    let weight = if leans[other] { UNCERTAIN } else { 1.0 };
                    systems[sector - own.start].add(e, normals[other], weight);
                }
            }
            for (s, system) in own.zip(&systems) {
                if leans[s]
                    && let Some(normal) = system.solve().filter(|n| dot(*n, first_guess[s]) > FARTHEST)
                {
                    normals[s] = normal;
                }
            }
        }
    }
    Ok(normals)
}

/// Least squares for the normal `n + x t + y s` with `(normal + other) . e = 0` for all edges.
struct System {
    n: Vec3,
    t: Vec3,
    s: Vec3,
    matrix: [f64; 3],
    right: [f64; 2],
}

impl System {
    fn new(n: Vec3) -> System {
        let (t, s) = tangents(n);
        System { n, t, s, matrix: [0.0; 3], right: [0.0; 2] }
    }

    fn add(&mut self, e: Vec3, other: Vec3, weight: f64) {
        let square = dot(e, e);
        if square <= 0.0 {
            return;
        }
        // Of equations of equal noise, longer edges are the better ones; of equations of equal truth, shorter ones.
        let weight = weight / square.sqrt();
        let (x, y, miss) = (dot(self.t, e), dot(self.s, e), -dot(add(self.n, other), e));
        self.matrix = [self.matrix[0] + weight * x * x, self.matrix[1] + weight * x * y, self.matrix[2] + weight * y * y];
        self.right = [self.right[0] + weight * x * miss, self.right[1] + weight * y * miss];
    }

    fn solve(&self) -> Option<Vec3> {
        let hold = HOLD * (self.matrix[0] + self.matrix[2]);
        let (a, b, c) = (self.matrix[0] + hold, self.matrix[1], self.matrix[2] + hold);
        let determinant = a * c - b * b;
        let (x, y) = ((self.right[0] * c - self.right[1] * b) / determinant, (a * self.right[1] - b * self.right[0]) / determinant);
        let normal = unit(add_scaled(add_scaled(self.n, self.t, x), self.s, y));
        (x.is_finite() && y.is_finite()).then_some(normal)
    }
}
