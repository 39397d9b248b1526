//! From elements of a patch to elements of the surface: what an error names on its way out of a patch stage.

use super::PatchSet;
use super::context::Halt;
use crate::error::{Element, EngineError, Location};
use crate::parametrize::ChartOutcome;
use crate::patch::PatchMap;

/// The same halt with elements of the surface in place of those of a patch.
pub(super) fn on_surface(halt: Halt, map: &PatchMap) -> Halt {
    match halt {
        Halt::Error(error) => Halt::Error(named_on_surface(error, map)),
        Halt::Unknown => Halt::Unknown,
    }
}

/// The same error with elements of the surface in place of those of a patch.
fn named_on_surface(error: EngineError, map: &PatchMap) -> EngineError {
    let name = |table: &[u32], id: u32| table.get(id as usize).copied().unwrap_or(id);
    error.map_locations(|location| {
        let table = if location.element == Element::Face { &map.faces } else { &map.named };
        Location { ids: location.ids.iter().map(|&id| name(table, id)).collect(), ..location }
    })
}

/// Why a chart is refused, with elements of the surface.
pub(super) fn refusal(chart: &ChartOutcome, patches: &PatchSet, p: usize) -> Option<EngineError> {
    match chart {
        ChartOutcome::Refused(error) => {
            Some(named_on_surface(error.clone(), &patches.patches[p].2).about(&format!("patch {p}")).with_metadata("patch", p))
        }
        ChartOutcome::Mapped(_) | ChartOutcome::MustSplit { .. } => None,
    }
}
