//! What every reader fills: positions, triangles and regions as the file has them, before any repair.

use crate::error::{EngineError, Reason, Result};
use crate::mesh::{LengthUnit, Region, SurfaceMesh};
use crate::vector::{Vec3, distance};
use crate::work::Work;
use std::collections::{HashMap, HashSet};

/// A surface as a file states it: indices are not checked, nothing is welded.
#[derive(Debug, Default)]
pub(crate) struct RawSurface {
    pub(crate) format: String,
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) face_region: Vec<u32>,
    pub(crate) regions: Regions,
    pub(crate) unit: Option<LengthUnit>,
    pub(crate) warnings: Vec<String>,
    pub(crate) max_faces: u64,
}

impl RawSurface {
    pub(crate) fn new(max_faces: u64) -> Self {
        RawSurface { max_faces, ..Default::default() }
    }

    /// Appends a triangle.
    #[inline]
    pub(crate) fn push_triangle(&mut self, corners: [u32; 3], region: u32) -> Result<()> {
        if self.triangles.len() as u64 >= self.max_faces {
            return Err(EngineError::new(Reason::LimitReached, format!("the file has more than {} faces", self.max_faces))
                .with_hint("raise max_faces if the machine has the memory"));
        }
        self.triangles.push(corners);
        self.face_region.push(region);
        Ok(())
    }

    /// Appends a polygon: a quad cut along its shorter diagonal, larger ones as a fan around their first corner;
    /// fewer than three corners add nothing.
    pub(crate) fn push_polygon(&mut self, corners: &[u32], region: u32) -> Result<()> {
        if let [a, b, c, d] = *corners
            && let [Some(pa), Some(pb), Some(pc), Some(pd)] = [a, b, c, d].map(|v| self.positions.get(v as usize).copied())
            && distance(pb, pd) < distance(pa, pc)
        {
            self.push_triangle([a, b, d], region)?;
            return self.push_triangle([b, c, d], region);
        }
        for k in 1..corners.len().saturating_sub(1) {
            self.push_triangle([corners[0], corners[k], corners[k + 1]], region)?;
        }
        Ok(())
    }

    /// Appends a vertex and gives its index. At most three per accepted face, since instances can multiply them.
    #[inline]
    pub(crate) fn push_vertex(&mut self, position: Vec3) -> Result<u32> {
        let most = self.max_faces.saturating_mul(3).min(u64::from(u32::MAX) - 1);
        if self.positions.len() as u64 >= most {
            return Err(EngineError::new(Reason::LimitReached, format!("the file has more than {most} vertices"))
                .with_hint("raise max_faces if the machine has the memory"));
        }
        self.positions.push(position);
        Ok(self.positions.len() as u32 - 1)
    }

    /// The mesh, with the unit of the file or else the assumed one.
    pub(crate) fn into_mesh(self, assume_unit: LengthUnit) -> SurfaceMesh {
        let mut regions = self.regions.finish();
        if regions.is_empty() {
            regions.push(Region { id: 0, name: String::new() });
        }
        SurfaceMesh {
            positions: self.positions,
            triangles: self.triangles,
            face_region: self.face_region,
            regions,
            unit: self.unit.unwrap_or(assume_unit),
        }
    }
}

/// The regions met so far; a region is found again by its id and name.
#[derive(Debug, Default)]
pub(crate) struct Regions {
    pub(crate) list: Vec<Region>,
    /// Regions that have a name but no number yet.
    unnumbered: Vec<u32>,
    by_key: HashMap<(i64, String), u32>,
    by_name: HashMap<String, u32>,
}

impl Regions {
    /// The index of the region with this id and name, made if it is new.
    pub(crate) fn numbered(&mut self, id: i64, name: &str) -> u32 {
        if let Some(&index) = self.by_key.get(&(id, name.to_owned())) {
            return index;
        }
        let index = self.list.len() as u32;
        self.by_key.insert((id, name.to_owned()), index);
        self.list.push(Region { id, name: name.to_owned() });
        index
    }

    /// The index of the region with this name in a format that has names only; numbers are given by [`Regions::finish`].
    /// A name `region_<n>` is how our writers spell region `n` without a name, and is read back as that.
    pub(crate) fn named(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.by_name.get(name) {
            return index;
        }
        let index = match unnamed_id(name) {
            Some(id) => self.numbered(id, ""),
            None => {
                let index = self.list.len() as u32;
                self.list.push(Region { id: 0, name: name.to_owned() });
                self.unnumbered.push(index);
                index
            }
        };
        self.by_name.insert(name.to_owned(), index);
        index
    }

    /// The regions; those without a number get their place in the list, from 1, or the next number that is free.
    fn finish(mut self) -> Vec<Region> {
        let taken: HashSet<i64> = self.by_key.keys().map(|(id, _)| *id).collect();
        let mut next = 1;
        for &index in &self.unnumbered {
            let id = (next.max(i64::from(index) + 1)..).find(|id| !taken.contains(id)).unwrap_or_default();
            next = id + 1;
            self.list[index as usize].id = id;
        }
        self.list
    }
}

/// The id in a stand-in name made by [`stand_in_name`].
fn unnamed_id(name: &str) -> Option<i64> {
    let id: i64 = name.strip_prefix("region_")?.parse().ok()?;
    (name == format!("region_{id}")).then_some(id)
}

/// How a region is called in a format that has names only: its name, or `region_<id>` if it has none.
pub(crate) fn stand_in_name(region: &Region) -> String {
    if region.name.is_empty() { format!("region_{}", region.id) } else { one_line(&region.name) }
}

/// The text without control characters, so that it fits into a line of a text format.
pub(crate) fn one_line(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>().trim().to_owned()
}

/// Checks for cancellation every 65536th time.
#[inline]
pub(crate) fn checkpoint(work: &Work<'_>, count: usize) -> Result<()> {
    if count & 0xffff == 0 { work.check() } else { Ok(()) }
}
