//! `remesh patch`: edits of single patches; `remesh partition`: the list of patches.

use super::args::{PartitionArgs, PatchVerb, SplitChoice};
use super::context::Context;
use super::failure::Outcome;
use super::ui::Report;
use super::{files, json, summary};
use crate::error::Short;
use crate::v1;
use serde_json::json;
use v1::split_patch_request::How;

const HEADER: &str = "    patch      faces        area  loops  genus      border   aspect  of box  origin\n";

fn row(p: &v1::PatchSummary) -> String {
    format!(
        "{:>9} {:>10} {:>11} {:>6} {:>6} {:>11} {:>8.2} {:>7.2}  {}\n",
        p.patch,
        summary::grouped(p.faces.into()),
        Short(p.area).to_string(),
        p.loops,
        p.genus,
        Short(p.border_length).to_string(),
        p.aspect_ratio,
        p.box_aspect_ratio,
        json::origin_name(p.origin()),
    )
}

/// "12 top, 13" for regions with and without names.
fn regions(compound: &v1::Compound) -> String {
    let name = |r: &v1::Region| if r.name.is_empty() { r.id.to_string() } else { format!("{} {}", r.id, r.name) };
    compound.regions.iter().map(name).collect::<Vec<_>>().join(", ")
}

pub(crate) async fn partition(context: &Context, args: &PartitionArgs) -> Outcome<Report> {
    let bar = context.ui.bar("partition");
    let result = context.client.partition(&args.session.session, args.with_charts, |progress| bar.progress(progress)).await?;
    drop(bar);
    let mut text = summary::line("patches", result.patches.len());
    text += &summary::line("strategy", format!("{}: {}", json::strategy_name(result.strategy()), result.reason));
    if let Some(v1::CutPlane { point: Some(p), normal: Some(n) }) = &result.plane {
        text += &summary::line("plane", format!("{},{},{},{},{},{}", p.x, p.y, p.z, n.x, n.y, n.z));
    }
    for compound in &result.compounds {
        let rules: Vec<String> = compound.rules().map(json::rule_name).collect();
        text += &summary::line("compound", format!("{} regions ({}): {}", compound.regions.len(), rules.join(", "), regions(compound)));
    }
    for (number, edit) in result.edits.iter().enumerate() {
        let state = if edit.applied { "applied".to_owned() } else { format!("WAITS: {}", edit.waits_for) };
        text += &summary::line(&format!("edit {}", number + 1), format!("{}, {state}", json::edit_name(edit.kind())));
    }
    text += HEADER;
    text.extend(result.patches.iter().map(row));
    text += &result.summary.as_ref().map(summary::run).unwrap_or_default();
    let compound = |c: &v1::Compound| {
        json!({
            "regions": c.regions.iter().map(|r| json!({ "id": r.id, "name": r.name })).collect::<Vec<_>>(),
            "rules": c.rules().map(json::rule_name).collect::<Vec<_>>(),
        })
    };
    let edit = |e: &v1::PatchEditState| json!({ "edit": json::edit_name(e.kind()), "applied": e.applied, "waits_for": e.waits_for });
    let json = json!({
        "patches": result.patches.iter().map(json::patch).collect::<Vec<_>>(),
        "strategy": json::strategy_name(result.strategy()),
        "reason": result.reason,
        "plane": json::plane(result.plane),
        "compounds": result.compounds.iter().map(compound).collect::<Vec<_>>(),
        "edits": result.edits.iter().map(edit).collect::<Vec<_>>(),
        "with_charts": result.with_charts,
        "work": json::run(&result.summary),
    });
    Ok(Report { text, json })
}

pub(crate) async fn verb(context: &Context, verb: &PatchVerb) -> Outcome<Report> {
    let client = &context.client;
    let spinner = context.ui.spinner("charts");
    let report = match verb {
        PatchVerb::Split { at, by, plane } => {
            let point = |[x, y, z]: [f64; 3]| Some(v1::Point { x, y, z });
            let how = match (plane, by) {
                (Some(plane), _) => Some(How::Plane(v1::CutPlane { point: point(plane.point), normal: point(plane.normal) })),
                (None, Some(SplitChoice::Balanced)) => Some(How::Method(v1::SplitMethod::Balanced.into())),
                (None, Some(SplitChoice::Laplace)) => Some(How::Method(v1::SplitMethod::Laplace.into())),
                (None, None) => None,
            };
            let done = client.split_patch(&at.session.session, at.patch, how, None).await?;
            edited(
                context,
                &at.session.session,
                [done.revision, done.patch_count.into(), done.split_again.into()],
                &done.patches,
                done.summary,
            )
        }
        PatchVerb::Merge { session, patches } => {
            let done = client.merge_patches(&session.session, patches, None).await?;
            edited(
                context,
                &session.session,
                [done.revision, done.patch_count.into(), done.split_again.into()],
                &done.patches,
                done.summary,
            )
        }
        PatchVerb::Reassign { at, faces, faces_from } => {
            let read = faces_from.as_deref().map(files::read_indices).transpose()?;
            let faces = read.as_deref().unwrap_or(faces);
            let done = client.reassign_faces(&at.session.session, faces, at.patch, None).await?;
            edited(
                context,
                &at.session.session,
                [done.revision, done.patch_count.into(), done.split_again.into()],
                &done.patches,
                done.summary,
            )
        }
        PatchVerb::Reset(session) => {
            let done = client.reset_patches(&session.session, None).await?;
            let text = summary::line("edits", format!("{} taken back", done.edits)) + &summary::line("revision", done.revision);
            Report { text, json: json!({ "session": session.session, "revision": done.revision, "edits": done.edits }) }
        }
    };
    drop(spinner);
    Ok(report)
}

fn edited(
    context: &Context,
    session: &str,
    [revision, count, split_again]: [u64; 3],
    patches: &[v1::PatchSummary],
    run: Option<v1::RunSummary>,
) -> Report {
    if split_again > 0 {
        context.ui.warn(&format!("a patch that the edit made has no usable chart and was split {split_again} times more"));
    }
    let mut text = summary::line("patches", format!("{count}; new or changed:")) + HEADER;
    text.extend(patches.iter().map(row));
    text += &run.as_ref().map(summary::run).unwrap_or_default();
    text += &summary::line("revision", revision);
    let json = json!({
        "session": session,
        "revision": revision,
        "patch_count": count,
        "patches": patches.iter().map(json::patch).collect::<Vec<_>>(),
        "split_again": split_again,
        "work": json::run(&run),
    });
    Report { text, json }
}
