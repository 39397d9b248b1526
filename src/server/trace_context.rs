//! Calls as parts of the traces of their callers (`traceparent` of W3C in the metadata of a request), with their stages beneath.

use opentelemetry::propagation::{Extractor, TextMapPropagator};
use opentelemetry::trace::Status as Ended;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use remesh_engine::pipeline::{Event, Progress};
use remesh_engine::stage::{Outcome, Stage, StageRecord, Subject};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use tonic::metadata::{KeyRef, MetadataMap};
use tracing::{Level, Span};
use tracing_opentelemetry::OpenTelemetrySpanExt;

struct Metadata<'a>(&'a MetadataMap);

impl Extractor for Metadata<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.to_str().ok()
    }

    fn keys(&self) -> Vec<&str> {
        let text = |key| if let KeyRef::Ascii(key) = key { Some(key.as_str()) } else { None };
        self.0.keys().filter_map(text).collect()
    }
}

/// Makes a span a child of the caller's, if the caller names one; without a collector that does nothing.
pub(crate) fn adopt(span: &Span, metadata: &MetadataMap) {
    if metadata.contains_key("traceparent") {
        // It fails only where nobody collects spans.
        let _ = span.set_parent(TraceContextPropagator::new().extract(&Metadata(metadata)));
    }
}

/// Tells the outcome of a call: the name of its code, and whether that is the fault of the server.
pub(crate) fn ended(span: &Span, code: &'static str) {
    span.set_attribute("rpc.grpc.status", code);
    if matches!(code, "Internal" | "Unknown" | "DataLoss" | "Unavailable" | "DeadlineExceeded") {
        span.set_status(Ended::error(code));
    }
}

/// The stages of one computation as spans beneath that of its call. Stages begin and end on several threads.
pub(crate) struct StageSpans {
    call: Span,
    open: Mutex<HashMap<(Stage, Subject), Span>>,
}

impl StageSpans {
    /// Under the span of a call.
    pub(crate) fn of(call: &Span) -> Self {
        StageSpans { call: call.clone(), open: Mutex::default() }
    }

    /// Takes an event, from any thread. Costs nothing but a look where nobody collects spans.
    pub(crate) fn on(&self, event: &Event) {
        match event.progress {
            Progress::Started if tracing::enabled!(Level::DEBUG) => self.begin(event.stage, event.subject),
            Progress::Finished(record) if tracing::enabled!(Level::DEBUG) => self.end(record),
            _ => {}
        }
    }

    fn begin(&self, stage: Stage, subject: Subject) {
        let empty = tracing::field::Empty;
        let name = stage.name();
        let span = tracing::debug_span!(parent: &self.call, "stage", otel.name = name, ?subject, outcome = empty, milliseconds = empty, bytes = empty);
        self.open.lock().unwrap_or_else(PoisonError::into_inner).insert((stage, subject), span);
    }

    /// A stage that was found at once has no span of its own, only an event.
    fn end(&self, record: StageRecord) {
        let span = self.open.lock().unwrap_or_else(PoisonError::into_inner).remove(&(record.stage, record.subject));
        let outcome = if record.outcome == Outcome::Hit { "hit" } else { "run" };
        let (stage, subject, milliseconds) = (record.stage.name(), record.subject, record.milliseconds);
        match span {
            None => tracing::debug!(parent: &self.call, stage, ?subject, outcome, milliseconds, "stage done"),
            Some(span) => drop(span.record("outcome", outcome).record("milliseconds", milliseconds).record("bytes", record.bytes)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opentelemetry::trace::TraceContextExt;

    #[test]
    fn the_parent_is_read_from_the_metadata_and_nonsense_is_none() {
        let of = |text: &str| {
            let mut metadata = MetadataMap::new();
            metadata.insert("traceparent", text.parse().expect("ascii"));
            let context = TraceContextPropagator::new().extract(&Metadata(&metadata));
            let parent = context.span().span_context().clone();
            parent.is_valid().then(|| (parent.trace_id().to_string(), parent.span_id().to_string(), parent.is_sampled()))
        };
        let (trace, span) = ("4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7");
        assert_eq!(of(&format!("00-{trace}-{span}-01")), Some((trace.to_owned(), span.to_owned(), true)));
        for bad in ["", "00", "00-0-0-01", "00-00000000000000000000000000000000-00f067aa0ba902b7-01", "zz-4bf9-00f0-01"] {
            assert_eq!(of(bad), None, "{bad}");
        }
    }
}
