//! Calls as parts of the traces of their callers: the `traceparent` of W3C in the metadata of a request.

use opentelemetry::propagation::{Extractor, TextMapPropagator};
use opentelemetry_sdk::propagation::TraceContextPropagator;
use remesh_engine::pipeline::{Event, Progress};
use tonic::metadata::{KeyRef, MetadataMap};
use tracing::Span;
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

/// A stage that has ended, as an event of the span of its call; stages run on several threads.
pub(crate) fn tell(call: &Span, event: &Event) {
    if let Progress::Finished(record) = event.progress {
        let (stage, outcome) = (record.stage.name(), record.outcome);
        tracing::debug!(parent: call, stage, subject = ?record.subject, ?outcome, milliseconds = record.milliseconds, "stage done");
    }
}

/// Makes a span a child of the caller's, if the caller names one; without a collector that does nothing.
pub(crate) fn adopt(span: &Span, metadata: &MetadataMap) {
    if metadata.contains_key("traceparent") {
        // It fails only where nobody collects spans.
        let _ = span.set_parent(TraceContextPropagator::new().extract(&Metadata(metadata)));
    }
}
