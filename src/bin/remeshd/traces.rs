//! Traces: spans of calls, with the stages that ran as their events, sent to a collector over OTLP where one is named.

use opentelemetry::KeyValue;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::{SpanExporter, WithExportConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::Subscriber;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::registry::LookupSpan;

/// Sends spans in batches from a thread of its own. Must be called inside a runtime; connects when there is something to send, and drops
/// what no collector takes.
///
/// # Errors
/// What is wrong with the address.
pub(crate) fn provider(endpoint: &str) -> Result<SdkTracerProvider, String> {
    let exporter = SpanExporter::builder().with_tonic().with_endpoint(endpoint).build();
    let exporter = exporter.map_err(|error| format!("--otlp-endpoint {endpoint}: {error}"))?;
    let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
    let resource = Resource::builder().with_service_name("remeshd").with_attribute(version).build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build())
}

/// What goes into traces: the calls and stages of the server, nothing of the transport (whose spans would tell of sending spans).
pub(crate) fn layer<S>(provider: &SdkTracerProvider) -> impl Layer<S>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    let ours = Targets::new().with_target("remesh_server", LevelFilter::DEBUG);
    tracing_opentelemetry::layer().with_tracer(provider.tracer("remeshd")).with_filter(ours)
}
