//! Compounds: regions that are parametrized as one (P1 section 1, P2 figures 16 to 18), by lists, by angle and by size.

use super::border_graph::BorderGraph;
use crate::error::{EngineError, Result};
use crate::mesh::SurfaceMesh;
use crate::topology::Topology;
use crate::vector::Vec3;
use crate::work::Work;
use std::collections::BTreeMap;

/// Which regions are merged into compounds. Inside a compound neither region borders nor sharp edges between two of its regions are
/// features; explicit edges are, and so are sharp edges inside of one region.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CompoundSpec {
    /// Lists of region numbers ([`crate::mesh::Region::id`]), each a compound. A region is in one list at most; the regions of a list
    /// hang together along common borders.
    pub lists: Vec<Vec<i64>>,
    /// Regions that meet below this angle (degrees, in (0, 180]) are merged, the smoothest first. The angle between two regions
    /// (or compounds made so far) is the smallest that is reached along at most a twentieth of their common border.
    pub merge_angle_deg: Option<f64>,
    /// Regions thinner than this length are merged, the thinnest first, into the neighbour with which they have most contact. The
    /// thickness of a region is 2 A / P, its area over half its border length: the width of a strip, half the side of a square.
    pub merge_below_size: Option<f64>,
}

/// Why a region is in a compound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CompoundRule {
    /// It is listed.
    Listed,
    /// It meets another smoothly.
    Angle,
    /// It or a neighbour is thin.
    Size,
}

/// Regions that are parametrized as one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Compound {
    /// Indices of the regions, increasing; two or more.
    pub regions: Vec<u32>,
    /// The rules that merged some of them, in order of the rules.
    pub rules: Vec<CompoundRule>,
}

/// The compounds of a surface.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Compounds {
    /// For each region the lowest region of its compound, or itself.
    pub group: Vec<u32>,
    /// The compounds, by their lowest region.
    pub list: Vec<Compound>,
}

impl Compounds {
    /// Every region by itself.
    pub fn none(regions: usize) -> Self {
        Compounds { group: (0..regions as u32).collect(), list: Vec::new() }
    }

    /// Whether two regions are different and of one compound.
    #[inline]
    pub fn joins(&self, a: u32, b: u32) -> bool {
        a != b && self.group[a as usize] == self.group[b as usize]
    }
}

/// Regions of different compounds may share this part of the length of their border at sharper angles than the one that counts: a
/// sliver whose normal means nothing, or the end of a fillet, does not decide over a long border.
const SHARPER_SHARE: f64 = 0.05;

/// Merges regions: first the lists, then by angle, then by size. O(F + B log^2 B) for B edges on borders of regions. `normals` are
/// those of [`super::sharp::reference_normals`].
pub(super) fn find_compounds(
    mesh: &SurfaceMesh,
    topology: &Topology,
    normals: &[Vec3],
    spec: &CompoundSpec,
    work: &Work<'_>,
) -> Result<Compounds> {
    let mut graph = BorderGraph::new(mesh, topology, normals, SHARPER_SHARE);
    let mut rules: Vec<[bool; 3]> = vec![[false; 3]; mesh.regions.len()];
    let mut note = |graph: &BorderGraph, region: u32, rule: CompoundRule| rules[graph.root(region) as usize][rule as usize] = true;
    for (i, list) in named_regions(mesh, &spec.lists)?.iter().enumerate() {
        check_connected(mesh, &graph, list, &format!("compounds[{i}]"))?;
        // Along the tree that the search follows: neighbours only.
        for &region in &list[1..] {
            graph.join(list[0], region);
        }
        note(&graph, list[0], CompoundRule::Listed);
    }
    work.check()?;
    if let Some(angle) = spec.merge_angle_deg {
        for region in graph.merge_below_angle(angle.to_radians(), work)? {
            note(&graph, region, CompoundRule::Angle);
        }
    }
    if let Some(size) = spec.merge_below_size {
        for region in graph.merge_below_size(size, work)? {
            note(&graph, region, CompoundRule::Size);
        }
    }
    Ok(collect(mesh.regions.len() as u32, &graph, &rules))
}

/// Checks what needs no mesh.
pub(super) fn check_spec(spec: &CompoundSpec) -> Result<()> {
    if spec.merge_angle_deg.is_some_and(|a| !(a > 0.0 && a <= 180.0)) {
        return Err(EngineError::bad_parameter("merge_angle", "must be more than 0 and at most 180 degrees"));
    }
    if spec.merge_below_size.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
        return Err(EngineError::bad_parameter("merge_below_size", "must be a positive finite length"));
    }
    Ok(())
}

/// Whether nothing is to be merged.
pub(super) fn is_empty(spec: &CompoundSpec) -> bool {
    spec.lists.is_empty() && spec.merge_angle_deg.is_none() && spec.merge_below_size.is_none()
}

/// The lists as indices of regions; regions that share a number go together.
fn named_regions(mesh: &SurfaceMesh, lists: &[Vec<i64>]) -> Result<Vec<Vec<u32>>> {
    let mut by_id: BTreeMap<i64, Vec<u32>> = BTreeMap::new();
    for (r, region) in mesh.regions.iter().enumerate() {
        by_id.entry(region.id).or_default().push(r as u32);
    }
    let mut listed: BTreeMap<i64, usize> = BTreeMap::new();
    let mut out = Vec::new();
    for (i, list) in lists.iter().enumerate() {
        let field = format!("compounds[{i}]");
        let mut regions = Vec::new();
        for &id in list {
            let Some(named) = by_id.get(&id) else {
                let known = mesh.regions.len();
                return Err(EngineError::bad_parameter(&field, format!("there is no region {id}; the mesh has {known} regions"))
                    .with_hint("`remesh diagnose` lists the regions")
                    .with_metadata("region", id));
            };
            if let Some(before) = listed.insert(id, i) {
                let message = if before == i {
                    format!("region {id} is listed twice")
                } else {
                    format!("region {id} is in compounds[{before}] already")
                };
                return Err(EngineError::bad_parameter(&field, message).with_metadata("region", id));
            }
            regions.extend_from_slice(named);
        }
        if regions.len() < 2 {
            return Err(EngineError::bad_parameter(&field, "a compound needs at least two regions"));
        }
        out.push(regions);
    }
    Ok(out)
}

/// The regions of a list must hang together along common borders.
fn check_connected(mesh: &SurfaceMesh, graph: &BorderGraph, list: &[u32], field: &str) -> Result<()> {
    let mut reached = vec![list[0]];
    let mut left: Vec<u32> = list[1..].to_vec();
    left.sort_unstable();
    let mut head = 0;
    while head < reached.len() {
        for n in graph.neighbours(reached[head]) {
            if let Ok(at) = left.binary_search(&n) {
                reached.push(left.remove(at));
            }
        }
        head += 1;
    }
    let Some(&apart) = left.first() else { return Ok(()) };
    let faces = |region: u32| mesh.face_region.iter().position(|&r| r == region).map(|f| mesh.face_location(f));
    let id = |region: u32| mesh.regions[region as usize].id;
    let message = format!("region {} has no common border with the other regions of the list", id(apart));
    Err(EngineError::bad_parameter(field, message)
        .with_hint("list regions that hang together along edges")
        .with_metadata("region", id(apart))
        .with_locations([faces(apart), faces(list[0])].into_iter().flatten()))
}

fn collect(regions: u32, graph: &BorderGraph, rules: &[[bool; 3]]) -> Compounds {
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for region in 0..regions {
        members.entry(graph.root(region)).or_default().push(region);
    }
    let mut out = Compounds::none(regions as usize);
    // A root may have been merged into another after a rule was noted on it: all its members count.
    for members in members.into_values().filter(|m| m.len() > 1) {
        let noted = |rule: CompoundRule| members.iter().any(|&m| rules[m as usize][rule as usize]);
        let kinds = [CompoundRule::Listed, CompoundRule::Angle, CompoundRule::Size].into_iter().filter(|&rule| noted(rule)).collect();
        members.iter().for_each(|&m| out.group[m as usize] = members[0]);
        out.list.push(Compound { regions: members, rules: kinds });
    }
    out.list.sort_by_key(|c| c.regions[0]);
    out
}
