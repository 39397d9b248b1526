//! Harmonic maps at many scales (P2 section 3, steps 1 to 4): faces that a map makes too small are taken out in connected
//! clusters and mapped again, each at its own scale, with the boundary inherited from the map above.
//!
//! Together they are one harmonic map of the sheet onto the unit disk whose coordinates have as many digits as it takes.

use super::harmonic::Harmonic;
use super::sheet::{NONE, Sheet};
use crate::error::Result;
use crate::vector::Vec2;
use crate::work::Work;
use std::f64::consts::{PI, TAU};

/// A face is too small if an equilateral triangle on its longest mapped edge has less than this area in a frame whose domain
/// fits the unit disk. P2 takes the area of the mapped face itself, which a sliver falls short of at any scale.
const LEAST_AREA: f64 = 1e-10;
/// Clusters of fewer faces stay in the map above.
const LEAST_CLUSTER: usize = 16;
/// A cluster is a branch, with a map of its own and a visit of the split line, from this ratio pi A / L^2 on (L the length of the
/// edges it shares with what stays; a hemisphere has 1/2). Others are fringes where faces are about as small as they may be.
const LEAST_ASPECT: f64 = 0.5;
/// Sets of more faces than three times this are first mapped as far as this number of faces reaches from the boundary.
const WINDOW: usize = 16_000;
/// What lies beyond a window must be this small: then it moves what is large enough by less than a millionth of its size.
const BEYOND: f64 = 1e-16;
/// The domain of a cluster reaches this far from the origin of its frame.
const REACH: f64 = 0.9;
/// A cluster whose boundary is smaller than this in the frame above has no digits left to be mapped from.
const LEAST_RADIUS: f64 = 1e-12;
/// Faces that all maps together may have, as a multiple of those of the sheet; deeper clusters stay in the map above.
const MOST_WORK: usize = 200;

/// One map.
#[derive(Debug, Clone, Default)]
pub(in crate::partition) struct Scale {
    /// Origin of its frame in the frame above.
    pub(in crate::partition) centre: Vec2,
    /// Unit of its frame in the frame above.
    pub(in crate::partition) radius: f64,
    /// Maps of its clusters, each with the centre of gravity of the cluster in this frame.
    pub(in crate::partition) children: Vec<u32>,
    /// Border loops that lie in it: centre and radius in its frame.
    pub(in crate::partition) holes: Vec<(Vec2, f64)>,
    /// Centre of gravity (by area on the surface) of the faces that stay in it.
    pub(in crate::partition) gravity: Vec2,
    /// Maps above it.
    pub(in crate::partition) depth: u32,
}

/// All maps of a sheet; the first is that of the whole, parents stand before their children.
#[derive(Debug)]
pub(in crate::partition) struct Scales {
    pub(in crate::partition) maps: Vec<Scale>,
    /// The map that each face stays in.
    pub(in crate::partition) face_map: Vec<u32>,
    /// Where its centroid is in the frame of that map.
    pub(in crate::partition) face_at: Vec<Vec2>,
}

/// A map to be made.
struct Task {
    map: u32,
    faces: Vec<u32>,
    fixed: Vec<(u32, Vec2)>,
}

/// The longest border loop of a sheet on the unit circle, by arc length.
pub(in crate::partition) fn circle(sheet: &Sheet) -> Vec<(u32, Vec2)> {
    let Some(ring) = sheet.loops.first() else { return Vec::new() };
    let step = |h: u32| sheet.length[h as usize].max(f64::MIN_POSITIVE);
    let total: f64 = ring.iter().map(|&h| step(h)).sum();
    let mut run = 0.0;
    ring.iter()
        .map(|&h| {
            let (sin, cos) = (TAU * run / total).sin_cos();
            run += step(h);
            (sheet.origin(h), [cos, sin])
        })
        .collect()
}

/// Maps a sheet with at least one border loop at all scales. One factorization per map; the faces of a map are those of the map
/// above less at least those next to its boundary.
///
/// # Errors
/// Those of [`Harmonic::place`].
pub(in crate::partition) fn map_scales(sheet: &Sheet, work: &Work<'_>) -> Result<Scales> {
    let count = sheet.triangles.len();
    let mut build = Build {
        sheet,
        harmonic: Harmonic::new(sheet),
        scales: Scales { maps: vec![Scale { radius: 1.0, ..Scale::default() }], face_map: vec![0; count], face_at: vec![[0.0; 2]; count] },
        cluster: vec![NONE; count],
        window: vec![NONE; count],
        windows: 0,
        reach: WINDOW,
        seen: vec![NONE; sheet.vertices],
    };
    let mut tasks = vec![Task { map: 0, faces: (0..count as u32).collect(), fixed: circle(sheet) }];
    let mut spent = 0;
    while let Some(task) = tasks.pop() {
        spent += task.faces.len();
        let deeper = spent < MOST_WORK * count;
        tasks.extend(build.map(&task, deeper, work)?);
    }
    build.place_holes();
    Ok(build.scales)
}

struct Build<'a> {
    sheet: &'a Sheet,
    harmonic: Harmonic,
    scales: Scales,
    /// Cluster of each face in the map at hand.
    cluster: Vec<u32>,
    /// Last window that each face was in, and how many there were.
    window: Vec<u32>,
    windows: u32,
    /// Faces that the next window is tried with.
    reach: usize,
    /// Cluster that a vertex was seen in.
    seen: Vec<u32>,
}

/// Marks of faces in `Build::cluster` besides the numbers of clusters.
const STAYS: u32 = NONE - 1;
const SMALL: u32 = NONE - 2;
/// Mark of vertices seen in two clusters, or fixed.
const SHARED: u32 = NONE - 1;

impl Build<'_> {
    fn map(&mut self, task: &Task, deeper: bool, work: &Work<'_>) -> Result<Vec<Task>> {
        self.place(task, deeper, work)?;
        let clusters = if deeper { self.clusters(task) } else { Vec::new() };
        let tasks = self.descend(task, clusters);
        self.settle(task);
        work.check()?;
        Ok(tasks)
    }

    /// Places the vertices of a set, or of a window of it that reaches to where all that follows is tiny.
    fn place(&mut self, task: &Task, deeper: bool, work: &Work<'_>) -> Result<()> {
        let count = task.faces.len();
        let mut most = if deeper && count > 3 * self.reach { self.reach } else { count };
        let first = most;
        loop {
            let faces = if most < count { self.open_window(task, most) } else { self.mark_window(&task.faces) };
            let (window, now) = (&self.window, self.windows);
            self.harmonic.place(self.sheet, &faces, |f| window[f as usize] == now, &task.fixed, work)?;
            let whole = faces.len() == count;
            if whole || faces.iter().filter(|&&f| self.is_at_the_end(task, f)).all(|&f| self.span(f) < BEYOND) {
                // The next map likely needs about as much.
                self.reach = (if most == first { 3 * most / 4 } else { most }).max(WINDOW);
                return Ok(());
            }
            most = if 4 * most < count / 2 { 4 * most } else { count };
        }
    }

    fn mark_window(&mut self, faces: &[u32]) -> Vec<u32> {
        self.windows += 1;
        faces.iter().for_each(|&f| self.window[f as usize] = self.windows);
        faces.to_vec()
    }

    /// The faces nearest to the boundary, by edges crossed.
    fn open_window(&mut self, task: &Task, most: usize) -> Vec<u32> {
        self.windows += 1;
        let now = self.windows;
        task.fixed.iter().for_each(|f| self.seen[f.0 as usize] = SHARED);
        let at_boundary = |f: &&u32| self.sheet.triangles[**f as usize].iter().any(|&v| self.seen[v as usize] == SHARED);
        let mut faces: Vec<u32> = task.faces.iter().filter(at_boundary).copied().collect();
        task.fixed.iter().for_each(|f| self.seen[f.0 as usize] = NONE);
        faces.iter().for_each(|&f| self.window[f as usize] = now);
        let mut head = 0;
        while head < faces.len() && faces.len() < most {
            for g in self.sheet.around(faces[head]) {
                if self.scales.face_map[g as usize] == task.map && self.window[g as usize] != now {
                    self.window[g as usize] = now;
                    faces.push(g);
                }
            }
            head += 1;
        }
        faces
    }

    /// Whether the set goes on across an edge of a face of the window.
    fn is_at_the_end(&self, task: &Task, f: u32) -> bool {
        let open = |g: u32| self.scales.face_map[g as usize] == task.map && self.window[g as usize] != self.windows;
        self.sheet.around(f).any(open)
    }

    /// Area of an equilateral triangle on the longest mapped edge of a face.
    fn span(&self, f: u32) -> f64 {
        let [a, b, c] = self.sheet.triangles[f as usize].map(|v| self.harmonic.uv[v as usize]);
        let square = |p: Vec2, q: Vec2| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
        0.25 * 3f64.sqrt() * square(a, b).max(square(b, c)).max(square(c, a))
    }

    /// Connected sets of faces that are too small, or that such faces cut off from the boundary.
    fn clusters(&mut self, task: &Task) -> Vec<Vec<u32>> {
        let mut any = false;
        for &f in &task.faces {
            let small = self.window[f as usize] != self.windows || self.span(f) < LEAST_AREA;
            any |= small;
            self.cluster[f as usize] = if small { SMALL } else { NONE };
        }
        if !any {
            return Vec::new();
        }
        for set in self.components(task, SMALL).into_iter().filter(|set| set.len() < LEAST_CLUSTER) {
            set.iter().for_each(|&f| self.cluster[f as usize] = NONE);
        }
        self.keep_what_reaches_the_boundary(task);
        for &f in &task.faces {
            let mark = &mut self.cluster[f as usize];
            *mark = if *mark == STAYS { STAYS } else { SMALL };
        }
        let mut sets = self.components(task, SMALL);
        // If nothing stays, there is no finer scale to go to.
        sets.retain(|set| set.len() < task.faces.len() && self.is_branch(task, set));
        sets
    }

    /// Whether a component of the faces that do not stay is far from what stays.
    fn is_branch(&self, task: &Task, set: &[u32]) -> bool {
        let (mut area, mut length) = (0.0, 0.0);
        for &f in set {
            area += self.sheet.area[f as usize];
            for h in 3 * f..3 * f + 3 {
                let t = self.sheet.twin[h as usize];
                let number = |f: u32| self.cluster[f as usize];
                if t != NONE && (self.scales.face_map[t as usize / 3] != task.map || number(t / 3) != number(f)) {
                    length += self.sheet.length[h as usize];
                }
            }
        }
        set.len() >= LEAST_CLUSTER && PI * area >= LEAST_ASPECT * length * length
    }

    /// Marks as staying all large faces that a chain of large faces joins to a fixed vertex.
    fn keep_what_reaches_the_boundary(&mut self, task: &Task) {
        for &(v, _) in &task.fixed {
            self.seen[v as usize] = SHARED;
        }
        let at_boundary = |f: &&u32| self.sheet.triangles[**f as usize].iter().any(|&v| self.seen[v as usize] == SHARED);
        let mut stack: Vec<u32> = task.faces.iter().filter(at_boundary).copied().collect();
        stack.retain(|&f| self.cluster[f as usize] == NONE);
        stack.iter().for_each(|&f| self.cluster[f as usize] = STAYS);
        let inside = |f: u32| self.scales.face_map[f as usize] == task.map;
        while let Some(f) = stack.pop() {
            for g in self.sheet.around(f).filter(|&g| inside(g)) {
                if self.cluster[g as usize] == NONE {
                    self.cluster[g as usize] = STAYS;
                    stack.push(g);
                }
            }
        }
        for &(v, _) in &task.fixed {
            self.seen[v as usize] = NONE;
        }
    }

    /// Components of the faces with a mark, in order of their first face; faces keep the number of their component as mark.
    fn components(&mut self, task: &Task, mark: u32) -> Vec<Vec<u32>> {
        let mut sets: Vec<Vec<u32>> = Vec::new();
        for &seed in &task.faces {
            if self.cluster[seed as usize] != mark {
                continue;
            }
            let number = sets.len() as u32;
            self.cluster[seed as usize] = number;
            let mut set = vec![seed];
            let mut head = 0;
            while head < set.len() {
                for g in self.sheet.around(set[head]) {
                    if self.scales.face_map[g as usize] == task.map && self.cluster[g as usize] == mark {
                        self.cluster[g as usize] = number;
                        set.push(g);
                    }
                }
                head += 1;
            }
            sets.push(set);
        }
        sets
    }

    /// Makes a map of every cluster: its frame, and the places of the vertices it shares with faces outside.
    fn descend(&mut self, task: &Task, clusters: Vec<Vec<u32>>) -> Vec<Task> {
        if clusters.is_empty() {
            return Vec::new();
        }
        task.faces.iter().for_each(|&f| self.cluster[f as usize] = STAYS);
        for (number, set) in clusters.iter().enumerate() {
            set.iter().for_each(|&f| self.cluster[f as usize] = number as u32);
        }
        let vertices = |f: &u32| self.sheet.triangles[*f as usize];
        for f in &task.faces {
            for v in vertices(f) {
                let seen = &mut self.seen[v as usize];
                let number = self.cluster[*f as usize];
                *seen = if *seen == NONE || *seen == number && number != STAYS { number } else { SHARED };
            }
        }
        task.fixed.iter().for_each(|f| self.seen[f.0 as usize] = SHARED);
        let mut tasks = Vec::new();
        for set in clusters {
            let mut fixed: Vec<u32> = set.iter().flat_map(vertices).filter(|&v| self.seen[v as usize] == SHARED).collect();
            fixed.sort_unstable();
            fixed.dedup();
            let Some((centre, radius)) = self.frame(&fixed) else { continue };
            let fixed = fixed.into_iter().map(|v| (v, to_frame(self.harmonic.uv[v as usize], centre, radius))).collect();
            let child = self.scales.maps.len() as u32;
            let depth = self.scales.maps[task.map as usize].depth + 1;
            self.scales.maps.push(Scale { centre, radius, depth, ..Scale::default() });
            self.scales.maps[task.map as usize].children.push(child);
            set.iter().for_each(|&f| self.scales.face_map[f as usize] = child);
            tasks.push(Task { map: child, faces: set, fixed });
        }
        task.faces.iter().flat_map(vertices).for_each(|v| self.seen[v as usize] = NONE);
        tasks
    }

    /// Centre of the box of some vertices and the unit that brings them into the unit disk.
    fn frame(&self, fixed: &[u32]) -> Option<(Vec2, f64)> {
        let places = || fixed.iter().map(|&v| self.harmonic.uv[v as usize]);
        let ends = |k: usize| places().fold([f64::INFINITY, f64::NEG_INFINITY], |e, p| [e[0].min(p[k]), e[1].max(p[k])]);
        let (x, y) = (ends(0), ends(1));
        let centre = [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])];
        let far = places().map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1])).fold(0.0, f64::max);
        (far > LEAST_RADIUS).then_some((centre, far / REACH))
    }

    /// Notes where the faces are that stay in this map.
    fn settle(&mut self, task: &Task) {
        let (mut sum, mut weight) = ([0.0; 2], 0.0);
        self.collapse_beyond_window(task);
        for &f in task.faces.iter().filter(|&&f| self.scales.face_map[f as usize] == task.map) {
            let [a, b, c] = self.sheet.triangles[f as usize].map(|v| self.harmonic.uv[v as usize]);
            let at = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
            self.scales.face_at[f as usize] = at;
            let area = self.sheet.area[f as usize].max(f64::MIN_POSITIVE);
            (sum, weight) = ([sum[0] + area * at[0], sum[1] + area * at[1]], weight + area);
        }
        if weight > 0.0 {
            self.scales.maps[task.map as usize].gravity = sum.map(|x| x / weight);
        }
    }

    /// Faces beyond the window that have no map of their own go where the face lies from which the set goes on to them.
    fn collapse_beyond_window(&mut self, task: &Task) {
        let stays = |this: &Self, f: u32| this.scales.face_map[f as usize] == task.map;
        let mut front: Vec<u32> = task.faces.iter().copied().filter(|&f| stays(self, f) && self.is_at_the_end(task, f)).collect();
        front.retain(|&f| self.window[f as usize] == self.windows);
        while let Some(f) = front.pop() {
            let at = self.harmonic.uv[self.sheet.triangles[f as usize][0] as usize];
            for g in self.sheet.around(f) {
                if stays(self, g) && self.window[g as usize] != self.windows {
                    self.window[g as usize] = self.windows;
                    self.sheet.triangles[g as usize].iter().for_each(|&v| self.harmonic.uv[v as usize] = at);
                    front.push(g);
                }
            }
        }
    }

    /// Gives every inner border loop to the map that holds all faces around it.
    fn place_holes(&mut self) {
        for ring in self.sheet.loops.iter().skip(1) {
            let map = self.scales.face_map[ring[0] as usize / 3];
            if ring.iter().any(|&h| self.scales.face_map[h as usize / 3] != map) {
                continue;
            }
            let at = |h: u32| self.scales.face_at[h as usize / 3];
            let (mut sum, mut weight) = ([0.0; 2], 0.0);
            for &h in ring {
                let (p, w) = (at(h), self.sheet.length[h as usize].max(f64::MIN_POSITIVE));
                (sum, weight) = ([sum[0] + w * p[0], sum[1] + w * p[1]], weight + w);
            }
            let centre = sum.map(|x| x / weight);
            let far = ring.iter().map(|&h| (at(h)[0] - centre[0]).hypot(at(h)[1] - centre[1])).fold(0.0, f64::max);
            self.scales.maps[map as usize].holes.push((centre, far));
        }
    }
}

/// A point of the frame above in the frame of a map.
pub(in crate::partition) fn to_frame(p: Vec2, centre: Vec2, radius: f64) -> Vec2 {
    [(p[0] - centre[0]) / radius, (p[1] - centre[1]) / radius]
}
