//! Which regions share a border, how sharp it is, and the merging of regions along borders.

use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, angle_between, distance, triangle_area};
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// The common border of two regions or groups of regions.
#[derive(Debug, Clone, Default)]
struct Border {
    /// Angle between the normals (radians) and length of each edge.
    edges: Vec<(f64, f64)>,
    /// The angle that counts.
    angle: f64,
    length: f64,
    /// Length, each edge weighted with (1 + cos angle) / 2.
    contact: f64,
    /// Counts changes.
    version: u32,
}

impl Border {
    fn update(&mut self, sharper_share: f64) {
        self.edges.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
        self.length = self.edges.iter().map(|e| e.1).sum();
        self.contact = self.edges.iter().map(|e| e.1 * 0.5 * (1.0 + e.0.cos())).sum();
        let mut sharper = 0.0;
        let counts = self.edges.iter().find(|e| {
            sharper += e.1;
            sharper > sharper_share * self.length
        });
        self.angle = counts.or(self.edges.last()).map_or(0.0, |e| e.0);
        self.version += 1;
    }
}

/// Groups of regions with their common borders. Merging small groups into large ones, it moves every border log(regions) times.
#[derive(Debug)]
pub(super) struct BorderGraph {
    /// Group of each region: a region of it.
    group: Vec<u32>,
    members: Vec<Vec<u32>>,
    /// Neighbour groups of each group, with the number of the border.
    neighbours: Vec<BTreeMap<u32, u32>>,
    borders: Vec<Border>,
    area: Vec<f64>,
    perimeter: Vec<f64>,
    sharper_share: f64,
}

impl BorderGraph {
    /// Every region by itself. O(F + B log B).
    pub(super) fn new(mesh: &SurfaceMesh, topology: &Topology, normals: &[Vec3], sharper_share: f64) -> Self {
        let regions = mesh.regions.len();
        let mut graph = BorderGraph {
            group: (0..regions as u32).collect(),
            members: (0..regions as u32).map(|r| vec![r]).collect(),
            neighbours: vec![BTreeMap::new(); regions],
            borders: Vec::new(),
            area: vec![0.0; regions],
            perimeter: vec![0.0; regions],
            sharper_share,
        };
        for f in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(f);
            graph.area[mesh.face_region[f] as usize] += triangle_area(a, b, c);
        }
        for h in 0..topology.halfedge_count() as u32 {
            let f = topology.face(h);
            let region = mesh.face_region[f as usize];
            let [a, b] = [topology.origin(h), topology.target(h)].map(|v| mesh.positions[v as usize]);
            let across = topology.twin(h).map(|t| topology.face(t));
            let other = across.map(|g| mesh.face_region[g as usize]);
            if other == Some(region) {
                continue;
            }
            let length = distance(a, b);
            graph.perimeter[region as usize] += length;
            if let (Some(g), Some(other)) = (across, other)
                && region < other
            {
                let angle = angle_between(normals[f as usize], normals[g as usize]);
                graph.add_edge(region, other, angle, length);
            }
        }
        graph.borders.iter_mut().for_each(|b| b.update(sharper_share));
        graph
    }

    fn add_edge(&mut self, a: u32, b: u32, angle: f64, length: f64) {
        let next = self.borders.len() as u32;
        let number = *self.neighbours[a as usize].entry(b).or_insert(next);
        self.neighbours[b as usize].insert(a, number);
        if number == next {
            self.borders.push(Border::default());
        }
        self.borders[number as usize].edges.push((angle, length));
    }

    /// The group of a region, named by one of its regions.
    pub(super) fn root(&self, region: u32) -> u32 {
        self.group[region as usize]
    }

    /// Groups that share a border with the group of a region, increasing.
    pub(super) fn neighbours(&self, region: u32) -> impl Iterator<Item = u32> {
        self.neighbours[self.root(region) as usize].keys().copied()
    }

    /// Twice the area over the border; infinite without a border.
    fn thickness(&self, g: u32) -> f64 {
        let perimeter = self.perimeter[g as usize];
        if perimeter > 0.0 { 2.0 * self.area[g as usize] / perimeter } else { f64::INFINITY }
    }

    /// Makes the groups of two regions one, whether or not they share a border; the group that is left.
    pub(super) fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return a;
        }
        let weight = |g: u32| self.neighbours[g as usize].len() + self.members[g as usize].len();
        let (into, from) = if weight(a) >= weight(b) { (a, b) } else { (b, a) };
        let shared = self.neighbours[into as usize].get(&from).map_or(0.0, |&n| self.borders[n as usize].length);
        self.area[into as usize] += self.area[from as usize];
        self.perimeter[into as usize] = (self.perimeter[into as usize] + self.perimeter[from as usize] - 2.0 * shared).max(0.0);
        let moved = std::mem::take(&mut self.members[from as usize]);
        moved.iter().for_each(|&m| self.group[m as usize] = into);
        self.members[into as usize].extend(moved);
        for (n, number) in std::mem::take(&mut self.neighbours[from as usize]) {
            self.neighbours[n as usize].remove(&from);
            if n == into {
                continue;
            }
            match self.neighbours[into as usize].get(&n).copied() {
                Some(kept) => {
                    let edges = std::mem::take(&mut self.borders[number as usize].edges);
                    self.borders[kept as usize].edges.extend(edges);
                    self.borders[kept as usize].update(self.sharper_share);
                }
                None => {
                    self.neighbours[into as usize].insert(n, number);
                    self.neighbours[n as usize].insert(into, number);
                }
            }
        }
        into
    }

    /// Joins neighbours that meet below `limit` (radians), the smoothest first; a region of each join.
    pub(super) fn merge_below_angle(&mut self, limit: f64, work: &Work<'_>) -> Result<Vec<u32>> {
        let mut heap = BinaryHeap::new();
        for g in 0..self.group.len() as u32 {
            self.propose(g, limit, &mut heap, |n| n > g);
        }
        let mut joined = Vec::new();
        while let Some(Reverse((_, a, b, version))) = heap.pop() {
            let current = self.neighbours[a as usize].get(&b).is_some_and(|&n| self.borders[n as usize].version == version);
            if !current || self.root(a) != a || self.root(b) != b {
                continue;
            }
            work.check()?;
            let into = self.join(a, b);
            joined.push(into);
            self.propose(into, limit, &mut heap, |_| true);
        }
        Ok(joined)
    }

    fn propose(&self, g: u32, limit: f64, heap: &mut BinaryHeap<Reverse<(u64, u32, u32, u32)>>, wanted: impl Fn(u32) -> bool) {
        for (&n, &number) in self.neighbours[g as usize].iter().filter(|&(&n, _)| wanted(n)) {
            let border = &self.borders[number as usize];
            // Rounding must not merge what meets at exactly the limit (a cube at 90 degrees).
            if border.angle < limit - 1e-9 {
                // Bits of a number that is not negative order as the number does.
                heap.push(Reverse((border.angle.max(0.0).to_bits(), g.min(n), g.max(n), border.version)));
            }
        }
    }

    /// Joins groups thinner than `limit` to the neighbour of most contact, the thinnest first; a region of each join.
    pub(super) fn merge_below_size(&mut self, limit: f64, work: &Work<'_>) -> Result<Vec<u32>> {
        let key = |graph: &BorderGraph, g: u32| Reverse((graph.thickness(g).to_bits(), g, graph.members[g as usize].len()));
        let groups = (0..self.group.len() as u32).filter(|&g| self.root(g) == g && !self.neighbours[g as usize].is_empty());
        let mut heap: BinaryHeap<_> = groups.map(|g| key(self, g)).collect();
        let mut joined = Vec::new();
        while let Some(Reverse((bits, g, size))) = heap.pop() {
            if f64::from_bits(bits) >= limit {
                break;
            }
            if self.root(g) != g || self.members[g as usize].len() != size {
                continue;
            }
            work.check()?;
            let contact = |number: u32| self.borders[number as usize].contact;
            let best = self.neighbours[g as usize].iter().max_by(|x, y| contact(*x.1).total_cmp(&contact(*y.1)).then(y.0.cmp(x.0)));
            let Some((&best, _)) = best else { continue };
            let into = self.join(g, best);
            joined.push(into);
            heap.push(key(self, into));
        }
        Ok(joined)
    }
}
