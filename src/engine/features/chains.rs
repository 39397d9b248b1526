//! Chains of sharp edges: free branches and components that are too short are noise (scans, slivers) and lose their marks.

use super::{Mark, set_mark};
use crate::error::Result;
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::{bounding_diagonal, distance};
use crate::work::Work;

/// Drops sharp branches with a free end, then sharp components, shorter than `shortest`. Given marks are never dropped and
/// hold the sharp edges that touch them. O(F).
pub(super) fn drop_noise(mesh: &SurfaceMesh, topology: &Topology, shortest: f64, marks: &mut [Mark], work: &Work<'_>) -> Result<()> {
    prune_branches(mesh, topology, shortest, marks);
    work.check()?;
    drop_components(mesh, topology, shortest, marks);
    work.check()
}

/// Marked halfedges that leave `v`, boundary edges of the surface not among them. For an edge whose other half leaves `v`
/// from the far side of the umbrella, that is the twin: every marked edge of `v` occurs once.
fn marked_at(topology: &Topology, marks: &[Mark], v: u32) -> impl Iterator<Item = u32> {
    topology.outgoing(v).filter(move |&h| marks[h as usize] != Mark::None)
}

fn length_of(mesh: &SurfaceMesh, topology: &Topology, h: u32) -> f64 {
    distance(mesh.positions[topology.origin(h) as usize], mesh.positions[topology.target(h) as usize])
}

/// Removes, again and again, sharp branches from a free end to a junction that are shorter than `shortest`.
fn prune_branches(mesh: &SurfaceMesh, topology: &Topology, shortest: f64, marks: &mut [Mark]) {
    let mut ends: Vec<u32> = (0..topology.vertex_count() as u32).filter(|&v| marked_at(topology, marks, v).count() == 1).collect();
    let mut branch = Vec::new();
    while let Some(end) = ends.pop() {
        branch.clear();
        let mut length = 0.0;
        let mut at = end;
        let mut came = None;
        // A junction ends the walk; so does an edge that stays anyway, or enough length.
        let junction = loop {
            let mut onward = marked_at(topology, marks, at).filter(|&h| Some(h) != came);
            let (Some(h), None) = (onward.next(), onward.next()) else { break at };
            if marks[h as usize] == Mark::Given || length >= shortest {
                break at;
            }
            branch.push(h);
            length += length_of(mesh, topology, h);
            at = topology.target(h);
            came = topology.twin(h);
        };
        let free = marked_at(topology, marks, junction).count() == 1;
        if length >= shortest || branch.is_empty() || free {
            continue; // long enough, nothing there, or a component of its own (judged as a whole below)
        }
        for &h in &branch {
            set_mark(topology, marks, h, Mark::None);
        }
        if marked_at(topology, marks, junction).count() == 1 {
            ends.push(junction);
        }
    }
}

/// Removes connected components of sharp edges that hold no given edge and are shorter or less wide than `shortest` asks.
fn drop_components(mesh: &SurfaceMesh, topology: &Topology, shortest: f64, marks: &mut [Mark]) {
    let mut seen = vec![false; topology.vertex_count()];
    let (mut stack, mut edges, mut points) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..topology.vertex_count() as u32 {
        if seen[seed as usize] || marked_at(topology, marks, seed).next().is_none() {
            continue;
        }
        edges.clear();
        points.clear();
        seen[seed as usize] = true;
        stack.push(seed);
        let mut held = false;
        let mut twice_length = 0.0;
        while let Some(v) = stack.pop() {
            points.push(mesh.positions[v as usize]);
            for h in marked_at(topology, marks, v) {
                held |= marks[h as usize] == Mark::Given;
                twice_length += length_of(mesh, topology, h);
                edges.push(h);
                let to = topology.target(h);
                if !seen[to as usize] {
                    seen[to as usize] = true;
                    stack.push(to);
                }
            }
        }
        // A closed chain of length l spans at least l / pi; a ragged cluster of noise spans less than a chain of its length.
        let noise = 0.5 * twice_length < shortest || bounding_diagonal(&points) < shortest / std::f64::consts::PI;
        if noise && !held {
            for &h in &edges {
                set_mark(topology, marks, h, Mark::None);
            }
        }
    }
}
