//! Traces: spans of calls, with the stages that ran beneath them, sent to a collector over OTLP where one is named.

use opentelemetry::KeyValue;
use opentelemetry::trace::{SpanKind, TracerProvider};
use opentelemetry_otlp::WithExportConfig;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::trace::{SdkTracerProvider, SpanData, SpanExporter};
use std::time::Duration;
use tracing::Subscriber;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::registry::LookupSpan;

/// Gives the spans of calls the names of their methods, as collectors expect it; the log has one name for all.
#[derive(Debug)]
struct Named(opentelemetry_otlp::SpanExporter);

fn named(mut span: SpanData) -> SpanData {
    if let Some(method) = span.attributes.iter().find(|attribute| attribute.key.as_str() == "method") {
        (span.name, span.span_kind) = (method.value.to_string().into(), SpanKind::Server);
    }
    span
}

impl SpanExporter for Named {
    async fn export(&self, batch: Vec<SpanData>) -> OTelSdkResult {
        self.0.export(batch.into_iter().map(named).collect()).await
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.0.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.0.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.0.set_resource(resource);
    }
}

/// Sends spans in batches from a thread of its own. Must be called inside a runtime; connects when there is something to send, and drops
/// what no collector takes.
///
/// # Errors
/// What is wrong with the address.
pub(crate) fn provider(endpoint: &str) -> Result<SdkTracerProvider, String> {
    let exporter = opentelemetry_otlp::SpanExporter::builder().with_tonic().with_endpoint(endpoint).build();
    let exporter = exporter.map_err(|error| format!("--otlp-endpoint {endpoint}: {error}"))?;
    let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
    let resource = Resource::builder().with_service_name("remeshd").with_attribute(version).build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(Named(exporter)).with_resource(resource).build())
}

/// What goes into traces: the calls and stages of the server, nothing of the transport (whose spans would tell of sending spans).
pub(crate) fn layer<S>(provider: &SdkTracerProvider) -> impl Layer<S> + use<S>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    let ours = Targets::new().with_target("remesh_server", LevelFilter::DEBUG);
    let layer = tracing_opentelemetry::layer().with_tracer(provider.tracer("remeshd"));
    layer.with_location(false).with_threads(false).with_tracked_inactivity(false).with_filter(ours)
}
