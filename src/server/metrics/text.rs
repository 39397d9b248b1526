//! The text format of Prometheus (version 0.0.4).

use super::{BOUNDS, Histogram};
use crate::state::Shared;
use std::fmt::{Display, Write};
use std::sync::atomic::Ordering;

/// A page of metrics. Names and codes hold no character that would need an escape.
struct Page(String);

impl Page {
    fn head(&mut self, name: &str, kind: &str, help: &str) {
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "# HELP remeshd_{name} {help}\n# TYPE remeshd_{name} {kind}");
    }

    fn row(&mut self, name: &str, labels: &str, value: impl Display) {
        let labels = if labels.is_empty() { String::new() } else { format!("{{{labels}}}") };
        let _ = writeln!(self.0, "remeshd_{name}{labels} {value}");
    }

    fn single(&mut self, name: &str, kind: &str, help: &str, value: impl Display) {
        self.head(name, kind, help);
        self.row(name, "", value);
    }

    fn histogram(&mut self, name: &str, labels: &str, histogram: &Histogram) {
        let mut below = 0;
        for (bound, count) in BOUNDS.iter().zip(histogram.counts) {
            below += count;
            self.row(&format!("{name}_bucket"), &format!("{labels},le=\"{bound}\""), below);
        }
        self.row(&format!("{name}_bucket"), &format!("{labels},le=\"+Inf\""), histogram.count());
        self.row(&format!("{name}_sum"), labels, histogram.sum);
        self.row(&format!("{name}_count"), labels, histogram.count());
    }
}

/// Resident memory of the process, where the system tells it.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// All metrics.
pub(super) fn page(shared: &Shared) -> String {
    let mut page = Page(String::with_capacity(1 << 14));
    let cache = shared.engine.cache.usage();
    let (blobs, blob_bytes) = shared.engine.blob_usage();
    let sessions = shared.engine.sessions(shared.config.clock.now()).len();
    page.head("build_info", "gauge", "Version of the daemon.");
    page.row("build_info", &format!("version=\"{}\"", env!("CARGO_PKG_VERSION")), 1);
    if let Some(bytes) = resident_bytes() {
        page.single("resident_memory_bytes", "gauge", "Memory of the process.", bytes);
    }
    page.single("cache_bytes", "gauge", "Bytes of stage outputs held.", cache.bytes);
    page.single("cache_capacity_bytes", "gauge", "Bytes of stage outputs that may be held.", cache.budget_bytes);
    page.single("cache_entries", "gauge", "Stage outputs held.", cache.entries);
    page.single("cache_hits_total", "counter", "Lookups of stage outputs that hit.", cache.hits);
    page.single("cache_misses_total", "counter", "Stage outputs that had to be computed.", cache.runs);
    page.single("cache_evictions_total", "counter", "Stage outputs dropped for want of room.", cache.evictions);
    page.single("blob_bytes", "gauge", "Bytes of uploaded files held.", blob_bytes);
    page.single("store_bytes", "gauge", "Bytes of the data folder on the disk.", shared.keeper.used_bytes());
    page.single("blobs", "gauge", "Uploaded files held.", blobs);
    page.single("sessions", "gauge", "Open sessions.", sessions);
    page.single("running", "gauge", "Computations that run.", shared.pool.running());
    page.single("queued", "gauge", "Calls that wait to compute.", shared.pool.queued());
    page.single("watchers", "gauge", "Open streams of session events.", shared.watchers.load(Ordering::Relaxed));
    let metrics = &shared.metrics;
    page.single("upload_bytes_total", "counter", "Bytes of uploads received.", metrics.upload_bytes.load(Ordering::Relaxed));
    let refused = metrics.unauthenticated.load(Ordering::Relaxed);
    page.single("unauthenticated_total", "counter", "Calls refused for want of a valid token or certificate.", refused);
    let tables = metrics.tables();
    page.head("revisions_total", "counter", "Revisions of sessions by what changed.");
    tables.revisions.iter().for_each(|(name, count)| page.row("revisions_total", &format!("change=\"{name}\""), count));
    page.head("stage_hits_total", "counter", "Stage outputs found in the cache.");
    tables.hits.iter().for_each(|(stage, count)| page.row("stage_hits_total", &format!("stage=\"{stage}\""), count));
    page.head("stage_seconds", "histogram", "Time of stages that ran.");
    tables.stages.iter().for_each(|(stage, times)| page.histogram("stage_seconds", &format!("stage=\"{stage}\""), times));
    page.head("rpc_seconds", "histogram", "Time of calls, until the answer or the begin of a stream of data.");
    let labels = |(method, code): &(&str, &str)| format!("method=\"{method}\",code=\"{code}\"");
    tables.calls.iter().for_each(|(key, times)| page.histogram("rpc_seconds", &labels(key), times));
    page.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_cumulative_and_end_with_all() {
        let mut times = Histogram::default();
        [0.0005, 0.001, 0.3, 1000.0].into_iter().for_each(|seconds| times.add(seconds));
        let mut page = Page(String::new());
        page.histogram("x", "a=\"b\"", &times);
        for line in [
            "remeshd_x_bucket{a=\"b\",le=\"0.001\"} 2\n",
            "remeshd_x_bucket{a=\"b\",le=\"0.5\"} 3\n",
            "remeshd_x_bucket{a=\"b\",le=\"300\"} 3\n",
            "remeshd_x_bucket{a=\"b\",le=\"+Inf\"} 4\n",
            "remeshd_x_sum{a=\"b\"} 1000.3015\n",
            "remeshd_x_count{a=\"b\"} 4\n",
        ] {
            assert!(page.0.contains(line), "{line}: {}", page.0);
        }
    }
}
