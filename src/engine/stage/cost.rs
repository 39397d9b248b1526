//! What stages cost, learnt from their runs: time and memory for each unit of size, later runs counting more.

use super::{Stage, Subject};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a run before takes part with when the next one is learnt.
const MEMORY: f64 = 0.8;

/// What a stage is estimated to take.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// Wall time.
    pub milliseconds: f64,
    /// Memory of the output.
    pub bytes: f64,
}

/// Sums over the runs of a stage, older runs less: their quotients are means weighted by size.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    units: f64,
    milliseconds: f64,
    bytes: f64,
}

/// How large the things are that a stage works on.
#[derive(Debug, Clone, Default)]
pub struct Sizes {
    /// Bytes of the source, for the import.
    pub source: f64,
    /// Faces of the imported surface; 0 if not known.
    pub faces: f64,
    /// Faces of each patch; empty if not known.
    pub patches: Vec<f64>,
    /// Triangles that are wanted in all; 0 if not known.
    pub wanted: f64,
}

impl Sizes {
    /// How much work a stage has, in the unit of the stage: bytes for the import, wanted triangles for what works on the result, curves for
    /// curve meshes, faces for the rest. A patch is taken to have the same share of the wanted triangles as of the faces.
    pub fn units(&self, stage: Stage, subject: Subject) -> f64 {
        let patch = |p: u32| self.patches.get(p as usize).copied().unwrap_or_else(|| self.faces / self.patches.len().max(4) as f64);
        let units = match (stage, subject) {
            (Stage::Import, _) => self.source,
            (_, Subject::Curve(_)) => 1.0,
            (Stage::Planar | Stage::Lift | Stage::Interior, Subject::Patch(p)) => {
                if self.wanted > 0.0 && self.faces > 0.0 {
                    self.wanted * patch(p) / self.faces
                } else {
                    patch(p)
                }
            }
            (Stage::Assembly | Stage::Optimize | Stage::Quads | Stage::Quality, _) if self.wanted > 0.0 => self.wanted,
            (_, Subject::Patch(p)) => patch(p),
            (_, Subject::Surface) => self.faces,
        };
        units.max(1.0)
    }
}

/// What was learnt. Before a stage has run, rates of one machine stand in.
#[derive(Debug, Default)]
pub struct CostModel(Mutex<HashMap<Stage, Sums>>);

/// Milliseconds and bytes a unit on one 2.5 GHz core, for stages that have not run yet (a bunny of 70k triangles remeshed with as many).
fn prior(stage: Stage) -> (f64, f64) {
    match stage {
        Stage::Import => (0.0001, 1.0),
        Stage::Topology => (0.0003, 50.0),
        Stage::SearchTree => (0.0006, 130.0),
        Stage::Features => (0.0004, 8.0),
        Stage::Partition => (0.004, 5.0),
        Stage::Cut => (0.003, 120.0),
        Stage::Patches => (0.0006, 80.0),
        Stage::System => (0.002, 60.0),
        Stage::Factor => (0.004, 350.0),
        Stage::Boundary | Stage::Solve => (0.002, 30.0),
        Stage::Chart => (0.002, 20.0),
        Stage::Curvature | Stage::Proximity | Stage::Thickness | Stage::Centerline => (0.005, 10.0),
        Stage::Size => (0.0005, 5.0),
        Stage::Metric => (0.005, 30.0),
        Stage::Curve => (0.1, 10_000.0),
        Stage::Planar => (0.012, 60.0),
        Stage::Lift => (0.0002, 60.0),
        Stage::Interior => (0.01, 60.0),
        Stage::Assembly => (0.0007, 60.0),
        Stage::Optimize => (0.009, 60.0),
        Stage::Quads => (0.05, 60.0),
        Stage::Quality => (0.012, 0.1),
    }
}

impl CostModel {
    fn table(&self) -> MutexGuard<'_, HashMap<Stage, Sums>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a run over.
    pub fn learn(&self, stage: Stage, units: f64, run: Estimate) {
        let mut table = self.table();
        let sums = table.entry(stage).or_default();
        sums.units = MEMORY * sums.units + units.max(1.0);
        sums.milliseconds = MEMORY * sums.milliseconds + run.milliseconds;
        sums.bytes = MEMORY * sums.bytes + run.bytes;
    }

    /// What a run on so many units is likely to take.
    pub fn estimate(&self, stage: Stage, units: f64) -> Estimate {
        let learnt = self.table().get(&stage).copied().filter(|sums| sums.units > 0.0);
        let (milliseconds, bytes) = learnt.map_or_else(|| prior(stage), |s| (s.milliseconds / s.units, s.bytes / s.units));
        Estimate { milliseconds: milliseconds * units, bytes: bytes * units }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_learnt_follows_the_size_and_forgets() {
        let model = CostModel::default();
        assert!(model.estimate(Stage::Planar, 1e5).milliseconds > 100.0, "something is told before anything ran");
        model.learn(Stage::Planar, 1000.0, Estimate { milliseconds: 10.0, bytes: 5000.0 });
        assert_eq!(model.estimate(Stage::Planar, 4000.0), Estimate { milliseconds: 40.0, bytes: 20_000.0 });
        for _ in 0..30 {
            model.learn(Stage::Planar, 1000.0, Estimate { milliseconds: 20.0, bytes: 5000.0 });
        }
        assert!((model.estimate(Stage::Planar, 1000.0).milliseconds - 20.0).abs() < 0.05);
        // A tiny run says little of large ones.
        model.learn(Stage::Planar, 1.0, Estimate { milliseconds: 1.0, bytes: 5.0 });
        assert!(model.estimate(Stage::Planar, 1000.0).milliseconds < 21.0);
    }

    #[test]
    fn sizes_are_of_the_subject() {
        let sizes = Sizes { source: 9.0, faces: 1000.0, patches: vec![600.0, 400.0], wanted: 5000.0 };
        assert_eq!(sizes.units(Stage::Import, Subject::Surface), 9.0);
        assert_eq!(sizes.units(Stage::Factor, Subject::Patch(1)), 400.0);
        assert_eq!(sizes.units(Stage::Planar, Subject::Patch(1)), 2000.0);
        assert_eq!(sizes.units(Stage::Optimize, Subject::Surface), 5000.0);
        assert_eq!(Sizes::default().units(Stage::Optimize, Subject::Surface), 1.0);
    }
}
