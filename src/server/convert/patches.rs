//! Compounds, edits of patches and how patches came about, to and from the protocol.

use super::from_proto::{known, patch_faces, plane};
use super::to_proto;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::Result;
use remesh_engine::features::{Compound, CompoundRule, CompoundSpec};
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::partition::{EditState, PatchEdit, PatchOrigin, PatchRequest, SplitMethod};
use remesh_engine::pipeline::Layout;
use remesh_proto::v1;

/// Which regions are merged.
pub(crate) fn compound_spec(spec: &v1::CompoundSpec) -> Result<CompoundSpec> {
    if let Some(angle) = spec.merge_angle.filter(|a| !(*a > 0.0 && *a <= 180.0)) {
        return Err(EngineError::bad_parameter("features.compounds.merge_angle", format!("{angle} is not in (0, 180]")));
    }
    if let Some(size) = spec.merge_below_size.filter(|s| !(*s > 0.0 && s.is_finite())) {
        let message = format!("{size} is not a positive finite length");
        return Err(EngineError::bad_parameter("features.compounds.merge_below_size", message));
    }
    Ok(CompoundSpec {
        lists: spec.lists.iter().map(|list| list.regions.clone()).collect(),
        merge_angle_deg: spec.merge_angle,
        merge_below_size: spec.merge_below_size,
    })
}

/// The same, back.
pub(super) fn compound_spec_wire(spec: &CompoundSpec) -> v1::CompoundSpec {
    v1::CompoundSpec {
        lists: spec.lists.iter().map(|regions| v1::RegionList { regions: regions.clone() }).collect(),
        merge_angle: spec.merge_angle_deg,
        merge_below_size: spec.merge_below_size,
    }
}

/// A compound with its regions by number and name.
pub(crate) fn compound(mesh: &SurfaceMesh, compound: &Compound) -> v1::Compound {
    let region = |&r: &u32| mesh.regions.get(r as usize).map(|r| v1::Region { id: r.id, name: r.name.clone() });
    let rule = |rule: &CompoundRule| match rule {
        CompoundRule::Listed => v1::CompoundRule::Listed.into(),
        CompoundRule::Angle => v1::CompoundRule::Angle.into(),
        CompoundRule::Size => v1::CompoundRule::Size.into(),
    };
    v1::Compound { regions: compound.regions.iter().filter_map(region).collect(), rules: compound.rules.iter().map(rule).collect() }
}

/// How a patch came about.
pub(super) fn origin(origin: PatchOrigin) -> v1::PatchOrigin {
    match origin {
        PatchOrigin::Strategy => v1::PatchOrigin::Strategy,
        PatchOrigin::ChartSplit => v1::PatchOrigin::ChartSplit,
        PatchOrigin::Split => v1::PatchOrigin::Split,
        PatchOrigin::Merge => v1::PatchOrigin::Merge,
        PatchOrigin::Reassigned => v1::PatchOrigin::Reassigned,
    }
}

/// What became of an edit.
pub(crate) fn edit_state(edit: &PatchEdit, state: &EditState) -> v1::PatchEditState {
    let kind = match edit {
        PatchEdit::Split { .. } => v1::PatchEditKind::Split,
        PatchEdit::Merge { .. } => v1::PatchEditKind::Merge,
        PatchEdit::Reassign { .. } => v1::PatchEditKind::Reassign,
    };
    let (applied, waits_for) = match state {
        EditState::Applied => (true, String::new()),
        EditState::Waiting(why) => (false, why.clone()),
    };
    v1::PatchEditState { kind: kind.into(), applied, waits_for }
}

/// What `SplitPatch` asks for.
pub(crate) fn split(request: &v1::SplitPatchRequest) -> Result<PatchRequest> {
    use v1::split_patch_request::How;
    let method = match &request.how {
        None => SplitMethod::Balanced,
        Some(How::Method(method)) => match known(*method, "method")? {
            v1::SplitMethod::Unspecified | v1::SplitMethod::Balanced => SplitMethod::Balanced,
            v1::SplitMethod::Laplace => SplitMethod::Laplace,
        },
        Some(How::Plane(wire)) => SplitMethod::Plane(plane(wire, "plane")?),
    };
    Ok(PatchRequest::Split { patch: request.patch, method })
}

/// What `MergePatches` asks for.
pub(crate) fn merge(request: &v1::MergePatchesRequest) -> PatchRequest {
    PatchRequest::Merge { patches: request.patches.clone() }
}

/// What `ReassignFaces` asks for.
pub(crate) fn reassign(engine: &Engine, request: &v1::ReassignFacesRequest) -> Result<PatchRequest> {
    Ok(PatchRequest::Reassign { faces: patch_faces(engine, request.faces.as_ref())?, to: request.patch })
}

/// Numbers of the listed patches of a layout.
pub(crate) fn summaries(layout: &Layout, listed: &[u32]) -> Vec<v1::PatchSummary> {
    let summary = |&p: &u32| {
        let (patch, _, _) = layout.patches.patches.get(p as usize)?;
        Some(to_proto::patch_summary(p as usize, layout.summaries().get(p as usize)?, patch.box_aspect_ratio()))
    };
    listed.iter().filter_map(summary).collect()
}
