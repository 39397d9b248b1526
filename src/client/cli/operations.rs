//! `remesh operations`: work that outlives the call that started it.

use super::args::{OperationVerb, StartArgs};
use super::context::Context;
use super::failure::{Failure, Outcome, exit, exit_of_reason};
use super::ui::Report;
use super::{json, steps, summary};
use crate::v1;
use serde_json::json;
use v1::operation::Outcome as Ended;
use v1::start_operation_request::Work;

/// Runs a verb; gives what to tell and the exit code.
pub(crate) async fn verb(context: &Context, verb: &OperationVerb) -> Outcome<(Report, u8)> {
    let client = &context.client;
    match verb {
        OperationVerb::Start(StartArgs { session, quality }) => {
            let work = if *quality { Work::Quality(v1::QualityWork::default()) } else { Work::Remesh(v1::RemeshWork::default()) };
            let operation = client.start(&session.session, work).await?;
            let json = state(&operation);
            Ok((Report { text: format!("{}\n", operation.name), json }, 0))
        }
        OperationVerb::List(session) => {
            let operations = client.list_operations(&session.session).await?;
            let text = operations.iter().map(|operation| format!("{}  {}\n", operation.name, told(operation))).collect();
            Ok((Report { text, json: json!({ "operations": operations.iter().map(state).collect::<Vec<_>>() }) }, 0))
        }
        OperationVerb::Show(name) => {
            let operation = client.operation(&name.name).await?;
            Ok((Report { text: line(&operation), json: state(&operation) }, 0))
        }
        OperationVerb::Cancel(name) => {
            let operation = client.cancel(&name.name).await?;
            Ok((Report { text: line(&operation), json: state(&operation) }, 0))
        }
        OperationVerb::Wait(name) => {
            let operation = client.wait(&name.name).await?;
            Ok((Report { text: line(&operation), json: state(&operation) }, code(&operation)))
        }
        OperationVerb::Result(name) => result(context, &client.operation(&name.name).await?),
    }
}

fn state_name(operation: &v1::Operation) -> String {
    json::enum_name(operation.state().as_str_name(), "OPERATION_STATE_")
}

/// How it stands, with how far it is or why it ended.
fn told(operation: &v1::Operation) -> String {
    let more = match (&operation.outcome, operation.state(), &operation.progress) {
        (Some(Ended::Error(error)), ..) => format!(": {} {}", error.reason, error.message),
        (_, v1::OperationState::Running, Some(progress)) => format!(": {} {:.0} %", progress.stage, 100.0 * progress.total_fraction),
        _ => String::new(),
    };
    format!("revision {}  {}{more}", operation.revision, state_name(operation))
}

fn line(operation: &v1::Operation) -> String {
    summary::line("operation", format!("{}  {}", operation.name, told(operation)))
}

fn state(operation: &v1::Operation) -> serde_json::Value {
    let error = match &operation.outcome {
        Some(Ended::Error(error)) => json!({ "code": error.code, "reason": error.reason, "message": error.message }),
        _ => serde_json::Value::Null,
    };
    json!({
        "name": operation.name,
        "revision": operation.revision,
        "state": state_name(operation),
        "fraction": operation.progress.as_ref().map(|progress| progress.total_fraction),
        "error": error,
    })
}

fn code(operation: &v1::Operation) -> u8 {
    match &operation.outcome {
        Some(Ended::Error(error)) => exit_of_reason(&error.reason),
        _ if operation.state() == v1::OperationState::Succeeded => 0,
        _ => exit::FAILED,
    }
}

/// What came of an operation, as the call that does the same at once tells it.
fn result(context: &Context, operation: &v1::Operation) -> Outcome<(Report, u8)> {
    let report = match &operation.outcome {
        Some(Ended::Remesh(result)) => {
            result.warnings.iter().for_each(|warning| context.ui.warn(warning));
            steps::remesh_report(result)
        }
        Some(Ended::Quality(report)) => Report { text: summary::quality(report), json: json::quality(report) },
        Some(Ended::Error(_)) => Report { text: line(operation), json: state(operation) },
        None if operation.state() == v1::OperationState::Running => {
            let message = format!("{} has no result yet; wait for it with `remesh operations wait`", operation.name);
            return Err(Failure::Other(message));
        }
        None => Report { text: line(operation), json: state(operation) },
    };
    Ok((report, code(operation)))
}
