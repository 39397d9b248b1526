//! A block of gyroid lattice, as printed parts have it: struts along the net whose nodes all have three neighbours (srs), cut to the genus
//! asked for.

use super::field::{Field, Primitive};
use super::scan::Body;
use crate::vector::{Vec3, distance};
use std::collections::BTreeMap;

/// Side of the cubic cell of the net, mm.
const CELL: f64 = 10.0;
/// Radius of a strut and of the rounding where struts meet, mm.
const RADIUS: f64 = 1.05;
const BLEND: f64 = 1.0;
/// Nodes of a cell, in eighths of its side (space group I 4_1 3 2, position 8a).
const NODES: [[i32; 3]; 8] = [[1, 1, 1], [3, 7, 5], [7, 5, 3], [5, 3, 7], [5, 5, 5], [7, 3, 1], [3, 1, 7], [1, 7, 3]];
/// Squared distance of neighbours in eighths.
const NEIGHBOUR: i32 = 8;
/// Genus at full size, and the triangles from which a lattice has it.
const FULL_GENUS: u32 = 240;
const FULL_FROM: u64 = 60_000;

/// Genus of a lattice of `triangles` triangles if nothing else is asked: 240 from 60,000 on, in proportion below.
pub(super) fn usual_genus(triangles: u64) -> u32 {
    let share = triangles.min(FULL_FROM) as f64 / FULL_FROM as f64;
    ((f64::from(FULL_GENUS) * share) as u32).clamp(3, FULL_GENUS)
}

/// A closed lattice of the given genus (at least 1), about as wide as high.
pub(super) fn body(genus: u32) -> Body {
    let mut net = Net::default();
    for cells in 2.. {
        net = Net::block(cells);
        if net.genus() >= genus {
            break;
        }
    }
    net.reduce(genus);
    let place = |v: usize| net.nodes[v].map(|x| f64::from(x) * CELL / 8.0);
    let strut = |&[a, b]: &[usize; 2]| Primitive::Strand(vec![(place(a), RADIUS), (place(b), RADIUS)]);
    let primitives = net.struts.iter().map(strut).collect();
    Body { field: Field { primitives, blend: BLEND }, openings: Vec::new(), genus, name: "lattice" }
}

/// Nodes in eighths of a cell, and struts between them. Connected, no node has a single strut.
#[derive(Debug, Default)]
struct Net {
    nodes: Vec<[i32; 3]>,
    struts: Vec<[usize; 2]>,
}

impl Net {
    fn block(cells: i32) -> Net {
        let mut index: BTreeMap<[i32; 3], usize> = BTreeMap::new();
        let corners = (0..cells).flat_map(|z| (0..cells).flat_map(move |y| (0..cells).map(move |x| [x, y, z])));
        let nodes: Vec<[i32; 3]> = corners.flat_map(|c| NODES.map(|n| std::array::from_fn(|k| 8 * c[k] + n[k]))).collect();
        nodes.iter().enumerate().for_each(|(i, &n)| {
            index.insert(n, i);
        });
        let steps = (-2..=2).flat_map(|x| (-2..=2).flat_map(move |y| (-2..=2).map(move |z| [x, y, z])));
        let steps: Vec<[i32; 3]> = steps.filter(|s| s.iter().map(|x| x * x).sum::<i32>() == NEIGHBOUR).collect();
        let mut struts = Vec::new();
        for (i, n) in nodes.iter().enumerate() {
            let around = steps.iter().filter_map(|s| index.get(&std::array::from_fn(|k| n[k] + s[k])));
            struts.extend(around.filter(|&&j| i < j).map(|&j| [i, j]));
        }
        let mut net = Net { nodes, struts };
        net.trim();
        net
    }

    /// Independent cycles; the net is connected.
    fn genus(&self) -> u32 {
        let mut used = vec![false; self.nodes.len()];
        self.struts.iter().flatten().for_each(|&v| used[v] = true);
        (self.struts.len() + 1).saturating_sub(used.iter().filter(|u| **u).count()) as u32
    }

    /// Keeps the largest connected part and takes off struts that end nowhere.
    fn trim(&mut self) {
        let part = self.parts();
        let mut size: BTreeMap<usize, usize> = BTreeMap::new();
        self.struts.iter().for_each(|s| *size.entry(part[s[0]]).or_default() += 1);
        let largest = size.iter().max_by_key(|(part, n)| (**n, std::cmp::Reverse(**part))).map(|x| *x.0);
        self.struts.retain(|s| Some(part[s[0]]) == largest);
        loop {
            let mut degree = vec![0; self.nodes.len()];
            self.struts.iter().flatten().for_each(|&v| degree[v] += 1);
            let before = self.struts.len();
            self.struts.retain(|s| s.iter().all(|&v| degree[v] > 1));
            if self.struts.len() == before {
                break;
            }
        }
    }

    /// The lowest node of the connected part of each node.
    fn parts(&self) -> Vec<usize> {
        let mut part: Vec<usize> = (0..self.nodes.len()).collect();
        let find = |part: &mut Vec<usize>, mut v: usize| {
            while part[v] != v {
                part[v] = part[part[v]];
                v = part[v];
            }
            v
        };
        for &[a, b] in &self.struts {
            let (a, b) = (find(&mut part, a), find(&mut part, b));
            part[a.max(b)] = a.min(b);
        }
        (0..part.len()).map(|v| find(&mut part, v)).collect()
    }

    /// Takes off struts, those farthest from the middle first, until `genus` cycles are left. Struts that hold the net together stay.
    fn reduce(&mut self, genus: u32) {
        let low: Vec3 = std::array::from_fn(|k| self.nodes.iter().map(|n| f64::from(n[k])).fold(f64::INFINITY, f64::min));
        let high: Vec3 = std::array::from_fn(|k| self.nodes.iter().map(|n| f64::from(n[k])).fold(f64::NEG_INFINITY, f64::max));
        let centre: Vec3 = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        while self.genus() > genus {
            let far = |s: &[usize; 2]| {
                let [a, b] = s.map(|v| self.nodes[v].map(f64::from));
                distance(a, centre) + distance(b, centre)
            };
            // The one farthest out lies on a cycle: bridges to nothing but single struts are trimmed, others are tried next.
            let mut order: Vec<usize> = (0..self.struts.len()).collect();
            order.sort_by(|&i, &j| far(&self.struts[j]).total_cmp(&far(&self.struts[i])).then(i.cmp(&j)));
            let Some(removed) = order.into_iter().find_map(|i| self.without(i)) else { break };
            *self = removed;
        }
    }

    /// The net without a strut, if it stays connected.
    fn without(&self, i: usize) -> Option<Net> {
        let mut struts = self.struts.clone();
        let [a, b] = struts.remove(i);
        let mut net = Net { nodes: self.nodes.clone(), struts };
        let part = net.parts();
        (part[a] == part[b]).then(|| {
            net.trim();
            net
        })
    }
}
