//! Borders laid anew: every interface curve is replaced by the shortest edge path within a band around it (a discrete geodesic), between
//! the same ends and past no feature, boundary or other border.

use super::faces_by_patch;
use super::surface::{Limits, Scratch, Stamps, Surface, measure};
use crate::error::Result;
use crate::work::Work;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Times that all borders are gone through. Closed borders are held in two vertices, other ones each time.
const PASSES: usize = 4;
/// Width of the band on either side, in edges.
const RINGS: u32 = 8;
/// A border must become shorter by this share.
const GAIN: f64 = 1e-6;
/// No patch loses more than this share of its faces.
const LOSS: f64 = 0.3;
/// A shorter border makes a patch more slender; those nearer to the limit than this factor keep theirs.
const ETA_MARGIN: f64 = 1.4;

/// Shortens all borders between patches that are not features. Junctions and ends stay. Patches stay connected and keep their topology,
/// none grows over `limits.faces`. Deterministic. O(F) for each of a few passes, and O(b log b) for the band b around each border.
pub(super) fn straighten_borders(surface: &Surface<'_>, label: &mut [u32], limits: Limits, work: &Work<'_>) -> Result<()> {
    let faces = faces_by_patch(label);
    let mut scratch = Scratch::new(surface.topology);
    let fixed: Vec<bool> = (0..faces.len())
        .map(|p| measure(surface, label, &faces[p], p as u32, &mut scratch).aspect_ratio() * ETA_MARGIN > limits.aspect_ratio)
        .collect();
    let size: Vec<u32> = faces.iter().map(|set| set.len() as u32).collect();
    let least = size.iter().map(|&n| (f64::from(n) * (1.0 - LOSS)).ceil() as u32).collect();
    let vertices = surface.topology.vertex_count();
    let mut state = Straightener {
        surface,
        label,
        size,
        least,
        most: limits.faces,
        seams: vec![0; vertices],
        held: vec![false; vertices],
        depth: vec![u32::MAX; vertices],
        distance: vec![f64::INFINITY; vertices],
        from: vec![0; vertices],
        on_path: Stamps::new(surface.topology.halfedge_count()),
        in_region: Stamps::new(surface.topology.face_count()),
        part: vec![0; surface.topology.face_count()],
    };
    for (h, &feature) in surface.features.is_feature.iter().enumerate() {
        if feature || surface.topology.twin(h as u32).is_none() {
            state.held[surface.topology.origin(h as u32) as usize] = true;
            state.held[surface.topology.target(h as u32) as usize] = true;
        }
    }
    for pass in 0..PASSES {
        let mut changed = false;
        for chain in state.chains() {
            work.check()?;
            let [p, q] = state.sides(chain.halfedges[0]);
            if fixed[p as usize] || fixed[q as usize] {
                continue;
            }
            for arc in chain.arcs(pass) {
                changed |= state.straighten(&arc);
            }
        }
        if !changed {
            break;
        }
    }
    Ok(())
}

/// Halfedges one after another between the same two patches.
struct Chain {
    halfedges: Vec<u32>,
    closed: bool,
}

impl Chain {
    /// The chain, or if it is closed its two halves, cut elsewhere in each pass.
    fn arcs(&self, pass: usize) -> Vec<Vec<u32>> {
        let n = self.halfedges.len();
        if !self.closed {
            return vec![self.halfedges.clone()];
        }
        let mut turned = self.halfedges.clone();
        // A quarter further each time, then the eighths between.
        turned.rotate_left((n * (pass % 2) / 4 + n * (pass / 2) / 8) % n);
        let second = turned.split_off(n / 2);
        vec![turned, second]
    }
}

struct Straightener<'a> {
    surface: &'a Surface<'a>,
    label: &'a mut [u32],
    size: Vec<u32>,
    least: Vec<u32>,
    most: u32,
    /// Border edges (not features) at each vertex.
    seams: Vec<u8>,
    /// Vertices on features and boundaries.
    held: Vec<bool>,
    /// Rings from the arc at hand; `u32::MAX` outside of its band.
    depth: Vec<u32>,
    distance: Vec<f64>,
    from: Vec<u32>,
    on_path: Stamps,
    in_region: Stamps,
    part: Vec<u32>,
}

impl Straightener<'_> {
    /// The face across, if `h` is part of a border between patches that is no feature.
    fn seam(&self, h: u32) -> bool {
        self.surface.crossing(h).is_some_and(|g| self.label[g as usize] != self.label[h as usize / 3])
    }

    /// Patches on the left and the right of a seam halfedge.
    fn sides(&self, h: u32) -> [u32; 2] {
        let left = self.label[h as usize / 3];
        [left, self.surface.topology.twin(h).map_or(left, |t| self.label[t as usize / 3])]
    }

    /// All interface curves, cut where other curves meet them; closed ones last.
    fn chains(&mut self) -> Vec<Chain> {
        let topology = self.surface.topology;
        self.seams.fill(0);
        let seams: Vec<u32> = (0..topology.halfedge_count() as u32).filter(|&h| self.seam(h)).collect();
        for &h in &seams {
            let count = &mut self.seams[topology.origin(h) as usize];
            *count = count.saturating_add(1);
        }
        self.on_path.clear();
        let mut chains = Vec::new();
        for closed in [false, true] {
            for &first in &seams {
                if self.ends_chain(topology.origin(first)) == closed || !self.on_path.mark(first) {
                    continue;
                }
                let mut halfedges = vec![first];
                let mut at = first;
                loop {
                    topology.twin(at).map(|t| self.on_path.mark(t));
                    let v = topology.target(at);
                    if self.ends_chain(v) {
                        break;
                    }
                    let on = topology.outgoing(v).find(|&k| self.seam(k) && topology.twin(k) != Some(at) && topology.twin(at) != Some(k));
                    let Some(next) = on.filter(|&k| self.on_path.mark(k)) else { break };
                    halfedges.push(next);
                    at = next;
                }
                chains.push(Chain { halfedges, closed });
            }
        }
        chains
    }

    fn ends_chain(&self, v: u32) -> bool {
        self.seams[v as usize] != 2 || self.held[v as usize]
    }

    /// Replaces an arc by the shortest path in its band; `true` if there is a shorter one that keeps all topology.
    fn straighten(&mut self, arc: &[u32]) -> bool {
        let (Some(&first), Some(&last)) = (arc.first(), arc.last()) else { return false };
        let topology = self.surface.topology;
        let ends = [topology.origin(first), topology.target(last)];
        if arc.len() < 3 || ends[0] == ends[1] || !arc.iter().all(|&h| self.seam(h)) {
            return false;
        }
        let sides = self.sides(first);
        let band = self.band(arc, ends);
        let path = self.shortest_path(&band, ends);
        let length = |chain: &[u32]| chain.iter().map(|&h| self.surface.length[h as usize]).sum::<f64>();
        let better = path.is_some_and(|path| length(&path) < (1.0 - GAIN) * length(arc) && self.relabel(arc, &path, &band, sides));
        for &v in band.iter().chain(&ends) {
            (self.depth[v as usize], self.distance[v as usize]) = (u32::MAX, f64::INFINITY);
        }
        better
    }

    /// Vertices around an arc that a path may use, its ends aside.
    fn band(&mut self, arc: &[u32], ends: [u32; 2]) -> Vec<u32> {
        let topology = self.surface.topology;
        let mut band: Vec<u32> = arc[1..].iter().map(|&h| topology.origin(h)).collect();
        band.iter().for_each(|&v| self.depth[v as usize] = 0);
        ends.iter().for_each(|&v| self.depth[v as usize] = 0);
        let rings = RINGS.min(1 + arc.len() as u32 / 2);
        let mut head = 0;
        while head < band.len() {
            let v = band[head];
            head += 1;
            let depth = self.depth[v as usize] + 1;
            if depth > rings {
                break;
            }
            for h in topology.outgoing(v) {
                let w = topology.target(h);
                if self.depth[w as usize] == u32::MAX && self.seams[w as usize] == 0 && !self.held[w as usize] {
                    self.depth[w as usize] = depth;
                    band.push(w);
                }
            }
        }
        band
    }

    /// Halfedges of the shortest path between the ends over vertices of the band.
    fn shortest_path(&mut self, band: &[u32], ends: [u32; 2]) -> Option<Vec<u32>> {
        let topology = self.surface.topology;
        band.iter().for_each(|&v| self.distance[v as usize] = f64::INFINITY);
        let mut heap = BinaryHeap::new();
        self.distance[ends[0] as usize] = 0.0;
        heap.push((Reverse(0u64), Reverse(ends[0])));
        while let Some((Reverse(bits), Reverse(v))) = heap.pop() {
            if v == ends[1] {
                break;
            }
            if bits != self.distance[v as usize].to_bits() {
                continue;
            }
            for h in topology.outgoing(v) {
                let w = topology.target(h);
                // From end to end directly may be another curve; through other vertices it is not.
                let open = self.depth[w as usize] != u32::MAX && !(v == ends[0] && w == ends[1]);
                let distance = self.distance[v as usize] + self.surface.length[h as usize];
                if open && distance < self.distance[w as usize] {
                    self.distance[w as usize] = distance;
                    self.from[w as usize] = h;
                    heap.push((Reverse(distance.to_bits()), Reverse(w)));
                }
            }
        }
        let mut path = Vec::new();
        let mut at = ends[1];
        while at != ends[0] {
            if self.distance[at as usize].is_infinite() {
                return None;
            }
            let h = self.from[at as usize];
            path.push(h);
            at = topology.origin(h);
        }
        path.reverse();
        Some(path)
    }

    /// Gives the faces around the band to the sides of the new path they are on. `false`, and nothing changed, if the path does not part
    /// the band as the arc does.
    fn relabel(&mut self, arc: &[u32], path: &[u32], band: &[u32], sides: [u32; 2]) -> bool {
        let topology = self.surface.topology;
        // The old arc is open from now on, the new path closed. Edges of both stay closed.
        self.on_path.clear();
        for &h in path {
            self.on_path.mark(h);
            topology.twin(h).map(|t| self.on_path.mark(t));
        }
        let old: Vec<u32> = arc.iter().copied().filter(|&h| !self.on_path.is_marked(h)).collect();
        self.on_path.clear();
        let region = self.region(band);
        let mut was_arc: Vec<u32> = old.iter().flat_map(|&h| [Some(h), topology.twin(h)]).flatten().collect();
        was_arc.sort_unstable();
        for &h in path {
            self.on_path.mark(h);
            topology.twin(h).map(|t| self.on_path.mark(t));
        }
        const UNSEEN: u32 = u32::MAX;
        region.iter().for_each(|&f| self.part[f as usize] = UNSEEN);
        let mut goes_to: Vec<Option<u32>> = Vec::new();
        for &seed in &region {
            if self.part[seed as usize] != UNSEEN {
                continue;
            }
            let number = goes_to.len() as u32;
            let mut outer: Option<u32> = None;
            self.part[seed as usize] = number;
            let mut stack = vec![seed];
            while let Some(f) = stack.pop() {
                for h in 3 * f..3 * f + 3 {
                    let Some(g) = self.surface.crossing(h) else { continue };
                    let seam = self.label[f as usize] != self.label[g as usize];
                    if self.on_path.is_marked(h) || seam && was_arc.binary_search(&h).is_err() {
                        continue;
                    }
                    if !self.in_region.is_marked(g) {
                        if *outer.get_or_insert(self.label[g as usize]) != self.label[g as usize] {
                            return false;
                        }
                    } else if self.part[g as usize] == UNSEEN {
                        self.part[g as usize] = number;
                        stack.push(g);
                    }
                }
            }
            goes_to.push(outer);
        }
        self.accept(path, &region, &goes_to, sides)
    }

    /// Faces around the vertices of a band; all of them are of one of the two patches.
    fn region(&mut self, band: &[u32]) -> Vec<u32> {
        self.in_region.clear();
        let topology = self.surface.topology;
        let mut region = Vec::new();
        for f in band.iter().flat_map(|&v| topology.outgoing(v)).map(|h| h / 3) {
            if self.in_region.mark(f) {
                region.push(f);
            }
        }
        region
    }

    /// Checks what the parts of a region become, and applies it.
    fn accept(&mut self, path: &[u32], region: &[u32], goes_to: &[Option<u32>], sides: [u32; 2]) -> bool {
        let topology = self.surface.topology;
        // Parts that touch nothing outside go to the side of the path they are on.
        let mut goes_to = goes_to.to_vec();
        for &h in path {
            let Some(t) = topology.twin(h) else { return false };
            for (f, side) in [(h / 3, sides[0]), (t / 3, sides[1])] {
                if !self.in_region.is_marked(f) || *goes_to[self.part[f as usize] as usize].get_or_insert(side) != side {
                    return false;
                }
            }
        }
        let new = |f: u32| goes_to[self.part[f as usize] as usize].unwrap_or(self.label[f as usize]);
        let mut gain = 0i64;
        for &f in region.iter().filter(|&&f| new(f) != self.label[f as usize]) {
            gain += if new(f) == sides[0] { 1 } else { -1 };
        }
        let sizes = [(sides[0], gain), (sides[1], -gain)].map(|(p, change)| (p as usize, i64::from(self.size[p as usize]) + change));
        if sizes.iter().any(|&(p, n)| n > i64::from(self.most.max(self.size[p])) || n < i64::from(self.least[p])) {
            return false;
        }
        for &f in region {
            let to = goes_to[self.part[f as usize] as usize];
            self.label[f as usize] = to.unwrap_or(self.label[f as usize]);
        }
        sizes.iter().for_each(|&(p, n)| self.size[p] = n as u32);
        for v in path[1..].iter().map(|&h| topology.origin(h)) {
            self.seams[v as usize] = 2;
        }
        true
    }
}
