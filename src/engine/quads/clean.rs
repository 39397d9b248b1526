//! Topological clean-up: doublets and diamonds vanish, edges turn where valences gain. Never touches curve edges or vertices on curves.

use super::mixed::{Corners, Mixed, NONE};
use crate::error::Result;
use crate::optimize::input::Input;
use crate::vector::{Vec3, add, angle_between, lerp, scale, sub};
use crate::work::Work;

/// Faces an operation makes must be at least this good, or no worse than those it removes.
const LEAST: f64 = 0.15;

/// What a flat corner between two curve edges weighs beside squared deviations of counts.
const FLAT: i64 = 20;

struct Cleaner<'a, 'b> {
    mesh: &'a mut Mixed,
    input: &'a Input<'b>,
    /// Wanted number of faces at each vertex.
    ideal: Vec<u32>,
}

/// Wanted number of faces: 4 inside, by the angle on curves.
fn ideal_counts(mesh: &Mixed) -> Vec<u32> {
    let angle_at = |v: u32, f: u32| {
        let (a, b) = mesh.beside(f, v);
        let p = mesh.position[v as usize];
        angle_between(sub(mesh.position[a as usize], p), sub(mesh.position[b as usize], p))
    };
    let count = |v: u32| {
        if !mesh.is_fixed[v as usize] {
            return 4;
        }
        let total: f64 = mesh.around[v as usize].iter().map(|&f| angle_at(v, f)).sum();
        ((total / std::f64::consts::FRAC_PI_2).round() as u32).max(1)
    };
    (0..mesh.position.len() as u32).map(count).collect()
}

impl Cleaner<'_, '_> {
    fn count(&self, v: u32) -> u32 {
        self.mesh.around[v as usize].len() as u32
    }

    /// Squared deviation from the ideal count after a change; too few faces weigh double.
    fn energy(&self, v: u32, change: i64) -> i64 {
        let d = i64::from(self.count(v)) + change - i64::from(self.ideal[v as usize]);
        let inside = !self.mesh.is_fixed[v as usize];
        d * d + if inside && i64::from(self.count(v)) + change < 3 { 20 } else { 0 }
    }

    fn worst<'c>(&self, faces: impl Iterator<Item = &'c Corners>) -> f64 {
        faces.map(|c| self.mesh.quality_of(super::mixed::corners_of(c), self.input)).fold(1.0, f64::min)
    }

    fn is_good_enough(&self, old: &[u32], new: &[Corners]) -> bool {
        if new.iter().any(|c| self.mesh.is_pinned_flat(super::mixed::corners_of(c))) {
            return false;
        }
        let before = self.worst(old.iter().map(|&f| &self.mesh.faces[f as usize]));
        self.worst(new.iter()) >= before.min(LEAST)
    }

    /// A free vertex of two faces goes; the two become one.
    fn doublet(&mut self, v: u32) -> bool {
        let &[f, g] = self.mesh.around[v as usize].as_slice() else { return false };
        if self.mesh.is_fixed[v as usize] || !(self.mesh.is_quad(f) || self.mesh.is_quad(g)) {
            return false;
        }
        let (f, g) = if self.mesh.is_quad(f) { (f, g) } else { (g, f) };
        let far = |m: &Mixed, f: u32| {
            let c = m.faces[f as usize];
            let k = c.iter().position(|&x| x == v).unwrap_or(0);
            c[(k + 2) % 4]
        };
        let (before, after) = self.mesh.beside(f, v);
        let x = far(self.mesh, f);
        let new = if self.mesh.is_quad(g) {
            let y = far(self.mesh, g);
            if x == y {
                return false;
            }
            [after, x, before, y]
        } else {
            [after, x, before, NONE]
        };
        self.mesh.replace(&[f, g], &[new]);
        true
    }

    /// A quadrangle with two opposite free corners of few faces is pressed flat: the corners become one.
    fn diamond(&mut self, f: u32) -> bool {
        let q = self.mesh.faces[f as usize];
        for k in 0..2 {
            let (a, b, c, d) = (q[k], q[k + 1], q[k + 2], q[(k + 3) % 4]);
            let (gone, kept) = if self.mesh.is_fixed[a as usize] { (c, a) } else { (a, c) };
            if self.mesh.is_fixed[gone as usize] {
                continue;
            }
            let merged = i64::from(self.count(gone)) - 2;
            let change = self.energy(kept, merged) + self.energy(b, -1) + self.energy(d, -1)
                - self.energy(gone, 0)
                - self.energy(kept, 0)
                - self.energy(b, 0)
                - self.energy(d, 0);
            if change >= 0 || self.count(b) < 3 || self.count(d) < 3 || self.count(gone) + self.count(kept) < 5 {
                continue;
            }
            // The faces around the two corners share this face and the edges to b and d, nothing else.
            let ring = |v: u32| {
                let mut all: Vec<u32> = self.mesh.around[v as usize].iter().flat_map(|&g| self.mesh.corners(g)).copied().collect();
                all.sort_unstable();
                all.dedup();
                all
            };
            let (one, other) = (ring(gone), ring(kept));
            let shared = one.iter().filter(|v| other.binary_search(v).is_ok()).count();
            if shared != 4 {
                continue;
            }
            let old: Vec<u32> = self.mesh.around[gone as usize].iter().copied().filter(|&g| g != f).collect();
            let new: Vec<Corners> = old.iter().map(|&g| self.mesh.faces[g as usize].map(|v| if v == gone { kept } else { v })).collect();
            let held = (self.mesh.position[kept as usize], self.mesh.below[kept as usize]);
            let rest: Vec<u32> = self.mesh.around[kept as usize].iter().copied().filter(|&g| g != f).collect();
            let before = self.worst(old.iter().chain(&rest).chain([&f]).map(|&g| &self.mesh.faces[g as usize]));
            if !self.mesh.is_fixed[kept as usize] {
                let middle = lerp(self.mesh.position[gone as usize], held.0, 0.5);
                let foot = self.input.walk(middle, held.1);
                (self.mesh.position[kept as usize], self.mesh.below[kept as usize]) = (foot.position, foot.face);
            }
            let after = self.worst(new.iter().chain(rest.iter().map(|&g| &self.mesh.faces[g as usize])));
            if after < before.min(LEAST) || new.iter().any(|c| self.mesh.is_pinned_flat(super::mixed::corners_of(c))) {
                (self.mesh.position[kept as usize], self.mesh.below[kept as usize]) = held;
                continue;
            }
            self.mesh.replace(&[f], &[]);
            self.mesh.replace(&old, &new);
            return true;
        }
        false
    }

    /// Turns the edge between two faces to where the valences gain most.
    fn turn(&mut self, f: u32, a: u32, b: u32) -> bool {
        if self.mesh.is_curve(a, b) {
            return false;
        }
        let Some(g) = self.mesh.across(f, a, b) else { return false };
        if self.mesh.label[f as usize][1] != self.mesh.label[g as usize][1] || !(self.mesh.is_quad(f) || self.mesh.is_quad(g)) {
            return false;
        }
        // The polygon around both, from b on through f back to a, then through g.
        let walk = |m: &Mixed, f: u32, from: u32| {
            let corners = m.corners(f);
            let k = corners.iter().position(|&c| c == from).unwrap_or(0);
            (0..corners.len() - 1).map(|i| corners[(k + i) % corners.len()]).collect::<Vec<u32>>()
        };
        let mut ring = walk(self.mesh, f, b);
        let first = ring.len();
        ring.extend(walk(self.mesh, g, a));
        let count = ring.len();
        let unique = ring.iter().enumerate().all(|(i, v)| !ring[..i].contains(v));
        if !unique {
            return false;
        }
        let flat = [f, g].iter().filter(|&&f| self.mesh.is_pinned_flat(self.mesh.corners(f))).count() as i64;
        // Energy of the present edge and of the best other one, which leaves no flat corner.
        let gain_of = |x: u32, y: u32| {
            let ends = [a, b, x, y];
            let change = |v: u32| i64::from(v == x) + i64::from(v == y) - i64::from(v == a) - i64::from(v == b);
            let mut seen: Vec<u32> = Vec::with_capacity(4);
            let mut sum = 0;
            for v in ends {
                if !seen.contains(&v) {
                    seen.push(v);
                    sum += self.energy(v, change(v)) - self.energy(v, 0);
                }
            }
            sum - FLAT * flat
        };
        let mut best: Option<(i64, [Corners; 2])> = None;
        for i in 0..count {
            for j in i + 2..count {
                let sides = (j - i, count - (j - i));
                let splits = sides.0.max(sides.1) <= 3 && sides.0.min(sides.1) >= 2;
                let (x, y) = (ring[i], ring[j]);
                if !splits || (i == 0 && j == first) || self.mesh.neighbours(x).binary_search(&y).is_ok() {
                    continue;
                }
                let gain = gain_of(x, y);
                if gain >= best.as_ref().map_or(0, |b| b.0) {
                    continue;
                }
                let part = |from: usize, sides: usize| {
                    let mut corners = [NONE; 4];
                    (0..=sides).for_each(|s| corners[s] = ring[(from + s) % count]);
                    corners
                };
                let new = [part(i, sides.0), part(j, sides.1)];
                if self.is_good_enough(&[f, g], &new) {
                    best = Some((gain, new));
                }
            }
        }
        match best {
            Some((_, new)) => {
                self.mesh.replace(&[f, g], &new);
                true
            }
            None => false,
        }
    }

    /// A quadrangle with a flat corner on a curve and the one beyond an opposite side become three around a new vertex that is joined to
    /// the corner; where that makes the next corner flat, four around two new vertices. Their shapes may be worse for now: no other step opens
    /// such a corner, and vertices move afterwards.
    fn unpin(&mut self, f: u32) -> bool {
        let q = self.mesh.faces[f as usize];
        let Some(k) = (0..4).find(|&k| self.mesh.is_flat_at(&q, k)) else { return false };
        let [v, b, x, a] = [0, 1, 2, 3].map(|i| q[(k + i) % 4]);
        let first = self.mesh.position.len() as u32;
        let mut best: Option<(f64, u32, Vec<Corners>, Vec<(Vec3, u32)>)> = None;
        for (from, to) in [(x, a), (b, x)] {
            let Some(g) = self.mesh.across(f, from, to).filter(|&g| !self.mesh.is_curve(from, to) && self.mesh.is_quad(g)) else {
                continue;
            };
            let n = self.mesh.faces[g as usize];
            let Some(j) = n.iter().position(|&w| w == from) else { continue };
            // `g` runs from `to` to `from`, so these two follow.
            let (after, last) = (n[(j + 1) % 4], n[(j + 2) % 4]);
            if self.mesh.label[f as usize][1] != self.mesh.label[g as usize][1] || [after, last].iter().any(|w| q.contains(w)) {
                continue;
            }
            let (y, z) = (first, first + 1);
            let choices: [(Vec<Corners>, Vec<Vec<u32>>); 2] = if to == a {
                [
                    (vec![[v, b, x, y], [y, x, after, last], [last, a, v, y]], vec![vec![v, b, x, a, after, last]]),
                    (
                        vec![[v, b, x, y], [a, v, y, z], [last, a, z, after], [after, z, y, x]],
                        vec![vec![v, x, v, x, a], vec![a, after, a, after, v, x]],
                    ),
                ]
            } else {
                [
                    (vec![[v, b, after, y], [y, after, last, x], [x, a, v, y]], vec![vec![v, b, x, a, after, last]]),
                    (
                        vec![[a, v, y, x], [v, b, z, y], [b, after, last, z], [last, x, y, z]],
                        vec![vec![v, x, v, x, b], vec![b, last, b, last, v, x]],
                    ),
                ]
            };
            for (new, means) in choices {
                let places: Vec<(Vec3, u32)> = means.iter().map(|of| self.mean_place(of)).collect();
                places.iter().for_each(|p| self.push(*p));
                let is_flat = new.iter().any(|c| self.mesh.is_pinned_flat(c));
                let worst = self.worst(new.iter());
                places.iter().for_each(|_| self.pop());
                if !is_flat && worst > best.as_ref().map_or(-0.5, |b| b.0 + 0.05) {
                    best = Some((worst, g, new, places));
                }
            }
        }
        let Some((_, g, new, places)) = best else { return false };
        places.iter().for_each(|p| self.push(*p));
        self.mesh.replace(&[f, g], &new);
        true
    }

    /// The point of the surface at the mean of vertices.
    fn mean_place(&self, of: &[u32]) -> (Vec3, u32) {
        let sum = of.iter().fold([0.0; 3], |s, &w| add(s, self.mesh.position[w as usize]));
        let foot = self.input.walk(scale(sum, 1.0 / of.len() as f64), self.mesh.below[of[0] as usize]);
        (foot.position, foot.face)
    }

    fn push(&mut self, (position, below): (Vec3, u32)) {
        self.mesh.add_vertex(position, below, false);
        self.ideal.push(4);
    }

    fn pop(&mut self) {
        self.mesh.position.pop();
        self.mesh.below.pop();
        self.mesh.is_fixed.pop();
        self.mesh.around.pop();
        self.ideal.pop();
    }

    /// Two triangles side by side become a quadrangle.
    fn join(&mut self, f: u32) -> bool {
        let t = self.mesh.faces[f as usize];
        for k in 0..3 {
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let Some(g) = self.mesh.across(f, a, b).filter(|_| !self.mesh.is_curve(a, b)) else { continue };
            if self.mesh.is_quad(g) || self.mesh.label[f as usize][1] != self.mesh.label[g as usize][1] {
                continue;
            }
            let Some(&d) = self.mesh.corners(g).iter().find(|v| **v != a && **v != b) else { continue };
            let quad = [a, d, b, c];
            if d != c && !self.mesh.is_pinned_flat(&quad) && self.mesh.quality_of(&quad, self.input) > 0.3 {
                self.mesh.replace(&[f, g], &[quad]);
                return true;
            }
        }
        false
    }
}

/// Passes over all faces until nothing gains, at most `passes` times.
pub(super) fn clean(mesh: &mut Mixed, input: &Input<'_>, passes: usize, work: &Work<'_>) -> Result<()> {
    let ideal = ideal_counts(mesh);
    let mut cleaner = Cleaner { mesh, input, ideal };
    for _ in 0..passes {
        let mut changes = 0usize;
        for v in 0..cleaner.mesh.position.len() as u32 {
            changes += usize::from(cleaner.doublet(v));
        }
        for f in 0..cleaner.mesh.faces.len() as u32 {
            if f.is_multiple_of(256) {
                work.check()?;
            }
            if cleaner.mesh.is_face(f) && cleaner.mesh.is_quad(f) && cleaner.diamond(f) {
                changes += 1;
                continue;
            }
            if cleaner.mesh.is_face(f) && !cleaner.mesh.is_quad(f) && cleaner.join(f) {
                changes += 1;
                continue;
            }
            let is_flat = |c: &Cleaner<'_, '_>| c.mesh.is_face(f) && c.mesh.is_pinned_flat(c.mesh.corners(f));
            for k in 0..4 {
                let corners = cleaner.mesh.faces[f as usize];
                let count = if corners[3] == NONE { 3 } else { 4 };
                if corners[0] == NONE || k >= count {
                    break;
                }
                let (a, b) = (corners[k], corners[(k + 1) % count]);
                if cleaner.turn(f, a, b) {
                    changes += 1;
                    break;
                }
            }
            if is_flat(&cleaner) && cleaner.unpin(f) {
                changes += 1;
            }
        }
        if changes == 0 {
            break;
        }
    }
    Ok(())
}
