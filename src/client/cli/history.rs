//! `remesh undo`, `redo`, `watch`.

use super::args::{HistoryVerb, StepArgs, WatchArgs};
use super::context::Context;
use super::failure::Outcome;
use super::ui::Report;
use super::{json, summary};
use crate::v1;
use serde_json::{Value, json};
use v1::watch_session_request::Start;
use v1::watch_session_response::Event;

pub(crate) async fn verb(context: &Context, verb: &HistoryVerb) -> Outcome<Report> {
    match verb {
        HistoryVerb::Undo(StepArgs { session, base }) => {
            let done = context.client.undo(&session.session, *base).await?;
            Ok(stepped(&session.session, done.revision, [done.undo_steps, done.redo_steps]))
        }
        HistoryVerb::Redo(StepArgs { session, base }) => {
            let done = context.client.redo(&session.session, *base).await?;
            Ok(stepped(&session.session, done.revision, [done.undo_steps, done.redo_steps]))
        }
        HistoryVerb::Watch(args) => watch(context, args).await,
    }
}

fn stepped(session: &str, revision: u64, [undo, redo]: [u32; 2]) -> Report {
    let text = summary::line("revision", format!("{revision} ({undo} changes can be undone, {redo} redone)"));
    Report { text, json: json!({ "session": session, "revision": revision, "undo_steps": undo, "redo_steps": redo }) }
}

/// Every event is a line, with `--json` an object, as it comes.
async fn watch(context: &Context, args: &WatchArgs) -> Outcome<Report> {
    let start = args.after_revision.map(Start::AfterRevision).or(args.after_event.map(Start::AfterSequence));
    let mut events = context.client.watch(&args.session.session, start, args.no_stages).await?;
    let mut left = args.count.unwrap_or(u64::MAX);
    while left > 0
        && let Some(event) = events.next().await?
    {
        left -= 1;
        let Some(kind) = &event.event else { continue };
        let (text, mut object) = told(event.revision, kind);
        object["sequence"] = event.sequence.into();
        object["revision"] = event.revision.into();
        context.ui.report(&Report { text: format!("{:>6}  {text}", event.sequence), json: object }, true);
    }
    Ok(Report::default())
}

fn told(revision: u64, event: &Event) -> (String, Value) {
    match event {
        Event::RevisionMade(made) => {
            let by = if made.author.is_empty() { String::new() } else { format!(" by {}", made.author) };
            let text = format!("revision {revision}: {}{by}", made.changes.join(", "));
            (text, json!({ "event": "revision", "changes": made.changes, "author": made.author, "request_id": made.request_id }))
        }
        Event::StageMoved(moved) => {
            let progress = moved.progress.clone().unwrap_or_default();
            let outcome = match progress.outcome() {
                v1::StageOutcome::Unspecified => format!("{:.0} %", 100.0 * progress.fraction),
                other => json::outcome_name(other),
            };
            let text = format!("call {}: {} {} {outcome}", moved.call, progress.stage, progress.subject);
            let object = json!({
                "event": "stage", "call": moved.call, "stage": progress.stage, "subject": progress.subject,
                "fraction": progress.fraction, "outcome": json::outcome_name(progress.outcome()),
            });
            (text, object)
        }
        Event::WorkEnded(end) => {
            let how = if end.code == 0 { "done".to_owned() } else { format!("{}: {}", end.reason, end.message) };
            let text = format!("call {}: {} {how} after {}", end.call, end.method, summary::seconds(end.milliseconds));
            let object = json!({
                "event": "end", "call": end.call, "method": end.method, "code": end.code, "reason": end.reason, "message": end.message,
                "milliseconds": end.milliseconds,
            });
            (text, object)
        }
        Event::Lagged(lagged) => {
            let many = if lagged.missed == 0 { "events".to_owned() } else { summary::count(lagged.missed, "event", "events") };
            (format!("{many} were missed"), json!({ "event": "lagged", "missed": lagged.missed }))
        }
        Event::SessionClosed(closed) => {
            let why = json::enum_name(closed.reason().as_str_name(), "SESSION_END_");
            (format!("the session is over: {why}"), json!({ "event": "closed", "reason": why }))
        }
    }
}
