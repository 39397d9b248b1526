//! Locked boundary vertices: kept bit for bit, with the boundary edges between them.

use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::distance;

/// Which vertices of the boundary stay where they are. Between two neighbours that stay, the boundary edge stays too.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum LockSpec {
    /// None: the boundary is meshed like the rest.
    #[default]
    Nothing,
    /// All.
    Boundary,
    /// Those of the boundary loops through these vertices.
    Loops(Vec<u32>),
    /// These.
    Vertices(Vec<u32>),
}

/// For each vertex whether it is locked. O(F).
///
/// # Errors
/// [`crate::error::Reason::BadParameter`] with the vertex as location for a vertex that is not on the boundary.
pub fn locked_vertices(mesh: &SurfaceMesh, topology: &Topology, spec: &LockSpec) -> Result<Vec<bool>> {
    let mut locked = vec![false; topology.vertex_count()];
    let named = match spec {
        LockSpec::Nothing => return Ok(locked),
        LockSpec::Boundary => {
            topology.loops.iter().flatten().for_each(|&h| locked[topology.origin(h) as usize] = true);
            return Ok(locked);
        }
        LockSpec::Loops(named) | LockSpec::Vertices(named) => named,
    };
    for &v in named {
        if v as usize >= locked.len() {
            return Err(EngineError::bad_parameter("lock", format!("names vertex {v}; the mesh has {}", locked.len())));
        }
        if !topology.is_boundary_vertex(v) {
            return Err(EngineError::bad_parameter("lock", format!("vertex {v} is not on the boundary"))
                .with_hint("only boundary vertices can be locked")
                .with_locations([mesh.vertex_location(v)]));
        }
        locked[v as usize] = true;
    }
    if matches!(spec, LockSpec::Loops(_)) {
        for ring in &topology.loops {
            if ring.iter().any(|&h| locked[topology.origin(h) as usize]) {
                ring.iter().for_each(|&h| locked[topology.origin(h) as usize] = true);
            }
        }
    }
    Ok(locked)
}

/// For each locked vertex the mean length of the boundary edges at it that stay, if any do: the size of the elements there.
pub fn locked_sizes(mesh: &SurfaceMesh, topology: &Topology, locked: &[bool]) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0u32); locked.len()];
    for &h in topology.loops.iter().flatten() {
        let ends = [topology.origin(h), topology.target(h)];
        if ends.iter().all(|&v| locked[v as usize]) {
            let length = distance(mesh.positions[ends[0] as usize], mesh.positions[ends[1] as usize]);
            ends.iter().for_each(|&v| sums[v as usize] = (sums[v as usize].0 + length, sums[v as usize].1 + 1));
        }
    }
    sums.into_iter().map(|(sum, count)| (count > 0 && sum > 0.0).then(|| sum / f64::from(count))).collect()
}
