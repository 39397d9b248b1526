//! Welding: vertices at (nearly) the same place become one. Deterministic, and linear in the number of vertices.

use crate::error::Result;
use crate::vector::{Vec3, bounds, distance};
use crate::work::Work;

const EMPTY: u32 = u32::MAX;
/// A longer walk in the hash table means that somebody chose the coordinates to collide; sorting does not mind.
const LONGEST_PROBE: usize = 200;
/// Below this share of the diagonal a tolerance is less than the rounding of the coordinates.
const LEAST_TOLERANCE: f64 = 1e-15;

/// Gives each vertex the first vertex (in order) it is welded to, itself if none.
/// With `tolerance` 0 only bitwise equal positions are welded (`-0 = 0`); otherwise each vertex goes to the first vertex not
/// itself welded that lies within `tolerance` times the diagonal, so that nothing moves further than that.
///
/// # Errors
/// Only cancellation.
pub fn weld(positions: &[Vec3], tolerance: f64, work: &Work<'_>) -> Result<Vec<u32>> {
    let mut target = weld_equal(positions, work)?;
    if tolerance >= LEAST_TOLERANCE
        && let Some((low, high)) = bounds(positions)
        && distance(low, high) > 0.0
    {
        weld_near(positions, low, tolerance * distance(low, high), &mut target, work)?;
    }
    Ok(target)
}

#[inline]
fn key(p: &Vec3) -> [u64; 3] {
    // Adding 0 turns -0 into 0.
    p.map(|x| (x + 0.0).to_bits())
}

#[inline]
fn mix(key: [u64; 3]) -> u64 {
    let mut h = key[0].wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 32) ^ key[1]).wrapping_mul(0xd6e8_feb8_6659_fd93);
    h = (h ^ (h >> 32) ^ key[2]).wrapping_mul(0xa076_1d64_78bd_642f);
    h ^ (h >> 29)
}

/// Open addressing over indices of first vertices; grows with them.
fn weld_equal(positions: &[Vec3], work: &Work<'_>) -> Result<Vec<u32>> {
    let mut target = vec![0u32; positions.len()];
    let mut table = vec![EMPTY; 1 << 12];
    let mut firsts: Vec<u32> = Vec::new();
    for (v, p) in positions.iter().enumerate() {
        if v & 0xffff == 0 {
            work.check()?;
        }
        if firsts.len() * 2 >= table.len() {
            table = vec![EMPTY; table.len() * 4];
            let mask = table.len() - 1;
            for &first in &firsts {
                let mut slot = mix(key(&positions[first as usize])) as usize & mask;
                while table[slot] != EMPTY {
                    slot = (slot + 1) & mask;
                }
                table[slot] = first;
            }
        }
        let mask = table.len() - 1;
        let wanted = key(p);
        let mut slot = mix(wanted) as usize & mask;
        let mut steps = 0;
        target[v] = loop {
            match table[slot] {
                EMPTY => {
                    table[slot] = v as u32;
                    firsts.push(v as u32);
                    break v as u32;
                }
                first if key(&positions[first as usize]) == wanted => break first,
                _ => slot = (slot + 1) & mask,
            }
            steps += 1;
            if steps > LONGEST_PROBE {
                return Ok(weld_equal_by_sorting(positions));
            }
        };
    }
    Ok(target)
}

fn weld_equal_by_sorting(positions: &[Vec3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|&v| (key(&positions[v as usize]), v));
    let mut target = vec![0; positions.len()];
    let mut first = 0;
    for (i, &v) in order.iter().enumerate() {
        if i == 0 || key(&positions[order[i - 1] as usize]) != key(&positions[v as usize]) {
            first = v;
        }
        target[v as usize] = first;
    }
    target
}

/// Cells of two tolerances: the box around a point meets at most eight, and each holds few first vertices, since these are
/// more than a tolerance apart.
fn weld_near(positions: &[Vec3], low: Vec3, radius: f64, target: &mut [u32], work: &Work<'_>) -> Result<()> {
    let cell_of = |p: Vec3, shift: f64| -> [i64; 3] { std::array::from_fn(|k| ((p[k] - low[k] + shift) / (2.0 * radius)).floor() as i64) };
    let buckets = positions.len().next_power_of_two().max(16);
    let slot_of = |cell: [i64; 3]| mix(cell.map(|c| c as u64)) as usize & (buckets - 1);
    let mut head = vec![EMPTY; buckets];
    let mut next = vec![EMPTY; positions.len()];
    for v in 0..positions.len() {
        if v & 0xfff == 0 {
            work.check()?;
        }
        if target[v] != v as u32 {
            // Its first vertex comes earlier and has its final target.
            target[v] = target[target[v] as usize];
            continue;
        }
        let p = positions[v];
        let (from, to) = (cell_of(p, -radius), cell_of(p, radius));
        let mut best = EMPTY;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let mut at = head[slot_of([x, y, z])];
                    while at != EMPTY {
                        if at < best && distance(positions[at as usize], p) <= radius {
                            best = at;
                        }
                        at = next[at as usize];
                    }
                }
            }
        }
        if best == EMPTY {
            let slot = slot_of(cell_of(p, 0.0));
            next[v] = head[slot];
            head[slot] = v as u32;
        } else {
            target[v] = best;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::work::CancelToken;

    fn run(positions: &[Vec3], tolerance: f64) -> Vec<u32> {
        weld(positions, tolerance, &Work::silent(&CancelToken::new())).unwrap()
    }

    fn noise(count: usize, step: f64) -> Vec<Vec3> {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 40) % 9) as f64 * step
        };
        (0..count).map(|_| [next(), next(), next()]).collect()
    }

    #[test]
    fn bitwise_equal_and_signed_zero() {
        assert_eq!(run(&[[0.0, 1.0, 2.0], [-0.0, 1.0, 2.0], [0.0, 1.0, 2.0 + 1e-15]], 0.0), [0, 0, 2]);
    }

    #[test]
    fn hashing_and_sorting_agree() {
        let points = noise(5000, 0.37);
        let target = run(&points, 0.0);
        assert_eq!(target, weld_equal_by_sorting(&points));
        assert!(target.iter().enumerate().all(|(v, &t)| t as usize <= v && points[t as usize] == points[v]));
        assert!(target.iter().enumerate().filter(|&(v, &t)| t as usize == v).count() <= 729);
    }

    #[test]
    fn near_vertices_agree_with_all_pairs() {
        let points: Vec<Vec3> =
            noise(400, 1.0).iter().zip(noise(401, 1e-3).iter().skip(1)).map(|(a, b)| crate::vector::add(*a, *b)).collect();
        let diagonal = crate::vector::bounding_diagonal(&points);
        for tolerance in [1e-6, 3e-4, 1e-3] {
            let mut expected: Vec<u32> = Vec::new();
            for v in 0..points.len() {
                let near = (0..v).find(|&u| expected[u] == u as u32 && distance(points[u], points[v]) <= tolerance * diagonal);
                expected.push(near.unwrap_or(v) as u32);
            }
            assert_eq!(run(&points, tolerance), expected);
        }
    }
}
