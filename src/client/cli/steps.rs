//! The step-by-step verbs on a session of a daemon.

use super::args::{ExportArgs, ImportCommand, PatchesArgs, RollbackArgs, SessionVerb, SetArgs};
use super::context::Context;
use super::failure::{Failure, Outcome};
use super::files::{self, Target};
use super::inspect::{imported_json, imported_text};
use super::run::{exported_json, written};
use super::ui::Report;
use super::{json, specs, summary};
use crate::v1;
use serde_json::json;

/// Places printed for each kind of defect after an import.
const PLACES: usize = 2;

pub(crate) async fn session(context: &Context, verb: &SessionVerb) -> Outcome<Report> {
    let client = &context.client;
    match verb {
        SessionVerb::Create { name, ttl } => {
            let session = client.create_session(name, *ttl).await?;
            Ok(Report { text: session.name.clone(), json: json::session(&session) })
        }
        SessionVerb::List => {
            let sessions = client.list_sessions().await?;
            let line = |s: &v1::Session| format!("{}  revision {}  {}\n", s.name, s.revision, s.display_name);
            let text = if sessions.is_empty() { "no sessions\n".into() } else { sessions.iter().map(line).collect() };
            Ok(Report { text, json: json!({ "sessions": sessions.iter().map(json::session).collect::<Vec<_>>() }) })
        }
        SessionVerb::Show(name) => {
            let session = client.get_session(&name.session).await?;
            Ok(Report { text: session_text(&session), json: json::session(&session) })
        }
        SessionVerb::Delete(name) => {
            let revision = client.delete_session(&name.session).await?;
            let text = format!("{} is deleted", name.session);
            Ok(Report { text, json: json!({ "name": name.session, "revision": revision }) })
        }
        SessionVerb::Snapshot { session, output } => {
            let target = Target::new(output, &[])?;
            let mut stream = client.snapshot_session(&session.session).await?;
            let mut file = Vec::new();
            while let Some(piece) = stream.next().await? {
                file.extend_from_slice(&piece);
            }
            target.write(&file)?;
            let text = format!("{} is in {} ({} bytes)", session.session, output.display(), file.len());
            Ok(Report { text, json: json!({ "name": session.session, "file": output, "bytes": file.len() }) })
        }
        SessionVerb::Restore { input, name } => {
            let session = client.restore_session(files::read(input)?, name).await?;
            Ok(Report { text: session.name.clone(), json: json::session(&session) })
        }
        SessionVerb::SetTtl { session, ttl } => {
            let session = client.set_ttl(&session.session, *ttl).await?;
            let seconds = session.ttl.map_or(0, |ttl| ttl.seconds);
            Ok(Report { text: format!("{} lives {seconds} s from its last use", session.name), json: json::session(&session) })
        }
    }
}

fn session_text(session: &v1::Session) -> String {
    let mut text = summary::line("session", format!("{} {}", session.name, session.display_name));
    text += &summary::line("revision", format!("{} (rollback reaches {})", session.revision, session.oldest_revision));
    text += &summary::line("lives", format!("{} s from its last use", session.ttl.map_or(0, |ttl| ttl.seconds)));
    text += &summary::line("mesh", session.mesh.as_ref().map_or("none yet".into(), summary::mesh));
    if let Some(inputs) = json::session(session)["inputs"].as_object() {
        for (name, value) in inputs.iter().filter(|(_, value)| !value.is_null()) {
            text += &format!("          {name}: {value}\n");
        }
    }
    text
}

pub(crate) async fn import(context: &Context, args: &ImportCommand) -> Outcome<Report> {
    let imported = context.import_file(&args.session.session, &args.file, &args.import).await?;
    let text = imported_text(&args.file, &imported, PLACES) + &revision_line(imported.revision);
    Ok(Report { text, json: imported_json(&imported) })
}

fn revision_line(revision: u64) -> String {
    summary::line("revision", revision)
}

pub(crate) async fn set(context: &Context, args: &SetArgs) -> Outcome<Report> {
    let session = &args.session.session;
    let choice = specs::size_choice(&args.size)?;
    let current = context.client.get_session(session).await?;
    let mut changes = specs::changes(&context.client, &args.inputs, args.method.chart, &current.inputs.unwrap_or_default()).await?;
    if let Some(choice) = choice {
        changes.push(v1::change::Change::Size(specs::size_spec(&context.client, choice).await?));
    }
    // Each change is made for the revision the one before has left, so that nobody's work is overwritten unseen.
    let mut revision = current.revision;
    if changes.is_empty() {
        return Err(Failure::Usage("nothing to set: give a size or another input".into()));
    }
    for change in changes {
        revision = context.client.apply(session, change, Some(revision)).await?;
    }
    Ok(Report { text: revision_line(revision), json: json!({ "session": session, "revision": revision }) })
}

pub(crate) async fn rollback(context: &Context, args: &RollbackArgs) -> Outcome<Report> {
    let session = &args.session.session;
    let revision = context.client.rollback(session, args.revision).await?;
    let text = summary::line("revision", format!("{revision}, with the inputs of {}", args.revision));
    Ok(Report { text, json: json!({ "session": session, "revision": revision }) })
}

pub(crate) async fn remesh(context: &Context, args: &PatchesArgs) -> Outcome<Report> {
    let bar = context.ui.bar("remesh");
    let result = context.client.remesh(&args.session.session, &args.patches, |progress| bar.progress(progress)).await?;
    drop(bar);
    result.warnings.iter().for_each(|warning| context.ui.warn(warning));
    Ok(remesh_report(&result))
}

/// What came of a remesh.
pub(crate) fn remesh_report(result: &v1::RemeshResult) -> Report {
    let mut text = summary::line("patches", summary::grouped(result.patches.len() as u64));
    if let Some(mesh) = &result.mesh {
        text += &summary::line("result", summary::mesh(mesh));
    } else {
        for p in &result.patches {
            text += &format!("          patch {}: {}\n", p.patch, summary::count(p.triangles, "triangle", "triangles"));
        }
    }
    text += &summary::elements(result.shape.as_ref(), result.quads.as_ref());
    text += &result.summary.as_ref().map(summary::run).unwrap_or_default();
    let patch = |p: &v1::PatchMeshSummary| json!({ "patch": p.patch, "vertices": p.vertices, "triangles": p.triangles });
    let json = json!({
        "mesh": result.mesh.as_ref().map(json::mesh),
        "patches": result.patches.iter().map(patch).collect::<Vec<_>>(),
        "shape": result.shape.as_ref().map(json::shape),
        "quads": result.quads.as_ref().map(json::quads),
        "work": json::run(&result.summary),
    });
    Report { text, json }
}

pub(crate) async fn plan(context: &Context, session: &str) -> Outcome<Report> {
    let plan = context.client.plan(session).await?;
    Ok(plan_report(plan.revision, &plan.stages, [plan.hits, plan.runs], plan.estimated_milliseconds))
}

/// A plan: its stages, how many are cached and how many would run.
pub(crate) fn plan_report(revision: u64, stages: &[v1::PlannedStage], [hits, runs]: [u32; 2], estimated: f64) -> Report {
    let mut text = String::new();
    for stage in stages {
        let hit = stage.outcome() == v1::StageOutcome::Hit;
        let cost = match stage.estimated_milliseconds {
            ms if !hit && ms > 0.0 => format!("  about {}", summary::seconds(ms)),
            _ => String::new(),
        };
        text += &format!("{:<8} {} {}{cost}\n", if hit { "cached" } else { "will run" }, stage.stage, stage.subject);
    }
    let about = summary::seconds(estimated);
    let bytes: u64 = stages.iter().filter(|s| s.outcome() == v1::StageOutcome::Run).map(|s| s.bytes).sum();
    let memory = summary::size(bytes);
    text += &summary::line("plan", format!("{hits} cached, {runs} to run, about {about} and {memory} as far as known"));
    let stage = |s: &v1::PlannedStage| {
        json!({
            "stage": s.stage,
            "subject": s.subject,
            "outcome": if s.outcome() == v1::StageOutcome::Hit { "hit" } else { "run" },
            "estimated_milliseconds": s.estimated_milliseconds,
            "bytes": s.bytes,
        })
    };
    let json = json!({
        "revision": revision,
        "stages": stages.iter().map(stage).collect::<Vec<_>>(),
        "hits": hits,
        "runs": runs,
        "estimated_milliseconds": estimated,
        "estimated_bytes": bytes,
    });
    Report { text, json }
}

pub(crate) async fn export(context: &Context, args: &ExportArgs) -> Outcome<Report> {
    let (format, encoding) = files::output_format(&args.output, args.encoding)?;
    let target = Target::new(&args.output, &[])?;
    let request = v1::ExportMeshRequest {
        session: args.session.session.clone(),
        source: if args.input { v1::MeshSource::Input } else { v1::MeshSource::Result }.into(),
        format: format.into(),
        encoding: encoding.into(),
        ..Default::default()
    };
    let bar = context.ui.bar("download");
    let exported = context.client.export(request, |received, total| bar.transfer(received, total)).await?;
    drop(bar);
    target.write(&exported.bytes)?;
    exported.warnings.iter().for_each(|warning| context.ui.warn(warning));
    let text = summary::line("wrote", written(target.path(), &exported));
    Ok(Report { text, json: json!({ "output": exported_json(target.path(), &exported), "work": json::run(&Some(exported.summary)) }) })
}
