//! Gradation of a metric: away from a place where short elements are wanted, lengths grow by at most a ratio per element, all directions
//! alike (in the space of metrics, Alauzet 2010).

use super::SurfaceMetric;
use super::tensor::{self, Frame, Sym2};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{Vec3, sub};
use crate::work::Work;
use std::collections::BinaryHeap;

/// Changes of a form by less than this share are not handed on.
const NOTICED: f64 = 0.02;
/// Most times a sector hands its metric on, on average.
const MOST_TURNS: usize = 40;

/// What a metric at one end of an edge demands at its other end.
fn demand(from: &Frame, form: Sym2, edge: Vec3, to: &Frame, slope: f64) -> Sym2 {
    let length = tensor::square(form, from.coordinates(edge)).max(0.0).sqrt();
    let factor = 1.0 / (1.0 + slope * length).powi(2);
    tensor::transport(from, form, to).map(|x| factor * x)
}

/// Grades in place. Sectors hand their metric on, the finest first, until nothing changes by more than 2 %.
pub(super) fn grade(mesh: &SurfaceMesh, topology: &Topology, metric: &mut SurfaceMetric, rate: f64, work: &Work<'_>) -> Result<()> {
    let slope = rate.ln();
    let count = metric.forms.len();
    // Corners of each sector.
    let mut start = vec![0u32; count + 1];
    let corners = topology.halfedge_count() as u32;
    for h in 0..corners {
        start[metric.sectors.of_corner(h) as usize + 1] += 1;
    }
    for s in 0..count {
        start[s + 1] += start[s];
    }
    let mut fill = start.clone();
    let mut list = vec![0u32; corners as usize];
    for h in 0..corners {
        let s = metric.sectors.of_corner(h) as usize;
        list[fill[s] as usize] = h;
        fill[s] += 1;
    }
    // The finest first, as in Dijkstra's algorithm: most sectors hand on once.
    let key = |form: Sym2| tensor::eigenvalues(form)[0].to_bits();
    let mut stamp = vec![0u32; count];
    let mut heap: BinaryHeap<(u64, u32, u32)> = (0..count as u32).map(|s| (key(metric.forms[s as usize]), s, 0)).collect();
    let mut turns = 0usize;
    while let Some((_, s, turn)) = heap.pop() {
        if stamp[s as usize] != turn {
            continue;
        }
        turns += 1;
        if turns.is_multiple_of(4096) {
            work.check()?;
        }
        if turns > MOST_TURNS * count {
            break;
        }
        let s = s as usize;
        for &h in &list[start[s] as usize..start[s + 1] as usize] {
            let here = mesh.positions[topology.origin(h) as usize];
            for corner in [topology.next(h), topology.prev(h)] {
                let to = metric.sectors.of_corner(corner) as usize;
                let edge = sub(mesh.positions[topology.origin(corner) as usize], here);
                let wanted = demand(&metric.frames[s], metric.forms[s], edge, &metric.frames[to], slope);
                let old = metric.forms[to];
                let new = tensor::intersect(old, wanted);
                let change = (new[0] - old[0]).abs().max((new[1] - old[1]).abs()).max((new[2] - old[2]).abs());
                if change > NOTICED * old[0].min(old[2]).max(0.1 * (old[0] + old[2])) {
                    metric.forms[to] = new;
                    stamp[to] += 1;
                    heap.push((key(new), to as u32, stamp[to]));
                }
            }
        }
    }
    Ok(())
}
