//! Commands on files that need no remesh: `diagnose`, `quality` of two files, `sample`, and `status` of the daemon.

use super::args::{DiagnoseArgs, QualityArgs, SampleArgs};
use super::context::Context;
use super::failure::{Failure, Outcome};
use super::files::{self, Target};
use super::run::{exported_json, written};
use super::ui::Report;
use super::{json, specs, summary};
use crate::{Source, v1};
use serde_json::json;
use std::path::Path;

/// The diagnosis and whether the surface can be remeshed.
pub(crate) async fn diagnose(context: &Context, args: &DiagnoseArgs) -> Outcome<(Report, bool)> {
    if let Some(session) = &args.session {
        let diagnosis = context.client.diagnose(session).await?.diagnosis.unwrap_or_default();
        let report =
            Report { text: summary::diagnosis(&diagnosis, args.places), json: json!({ "diagnosis": json::diagnosis(&diagnosis) }) };
        return Ok((report, diagnosis.remeshable));
    }
    let Some(file) = &args.file else { return Err(Failure::Usage("which file?".into())) };
    let session = context.temporary_session(&format!("remesh diagnose {}", files::short_name(file))).await?;
    let mut imported = context.import_file(&session, file, &args.import).await?;
    let diagnosis = context.client.diagnose(&session).await?.diagnosis.unwrap_or_default();
    imported.diagnosis = Some(diagnosis.clone());
    let report = Report { text: imported_text(file, &imported, args.places), json: imported_json(&imported) };
    Ok((report, diagnosis.remeshable))
}

/// What was read, and everything that is wrong with it.
pub(crate) fn imported_text(file: &Path, imported: &v1::ImportMeshResponse, places: usize) -> String {
    let mesh = imported.mesh.clone().unwrap_or_default();
    let report = imported.report.clone().unwrap_or_default();
    let diagnosis = imported.diagnosis.clone().unwrap_or_default();
    summary::import(&files::short_name(file), &report, &mesh) + &summary::diagnosis(&diagnosis, places)
}

pub(crate) fn imported_json(imported: &v1::ImportMeshResponse) -> serde_json::Value {
    json!({
        "revision": imported.revision,
        "mesh": imported.mesh.as_ref().map(json::mesh),
        "report": imported.report.as_ref().map(json::report),
        "diagnosis": imported.diagnosis.as_ref().map(json::diagnosis),
        "work": json::run(&imported.summary),
    })
}

pub(crate) async fn quality(context: &Context, args: &QualityArgs) -> Outcome<Report> {
    let scope = if args.elements_only { v1::QualityScope::Elements } else { v1::QualityScope::Full };
    let (report, run) = match (&args.session, &args.input, &args.output) {
        (Some(session), ..) => {
            let _spinner = context.ui.spinner("quality");
            let answer = context.client.quality(session, scope).await?;
            (answer.report, answer.summary)
        }
        (None, Some(input), Some(output)) => {
            // The reading options are about the input; of the output everything is measured, in the same unit.
            let options = specs::import_options(&args.import);
            let output_options = v1::ImportOptions { assume_unit: options.assume_unit, ..Default::default() };
            let request = v1::CompareMeshesRequest {
                input: Some(mesh_file(context, input, options).await?),
                output: Some(mesh_file(context, output, output_options).await?),
                size: args.size,
                scope: scope.into(),
            };
            let _spinner = context.ui.spinner("quality");
            let answer = context.client.compare(request).await?;
            (answer.report, answer.summary)
        }
        _ => return Err(Failure::Usage("which mesh? Give INPUT and OUTPUT, or --session".into())),
    };
    let report = report.unwrap_or_default();
    let shape = report.shape.clone().unwrap_or_default();
    let elements =
        format!("{}, {}", summary::count(shape.vertices, "vertex", "vertices"), summary::count(shape.triangles, "triangle", "triangles"));
    let text = summary::line("mesh", elements) + &summary::elements(Some(&shape), report.quads.as_ref()) + &summary::quality(&report);
    Ok(Report { text, json: json!({ "quality": json::quality(&report), "work": json::run(&run) }) })
}

async fn mesh_file(context: &Context, path: &Path, options: v1::ImportOptions) -> Outcome<v1::MeshFile> {
    let blob = context.upload(path).await?;
    Ok(v1::MeshFile { source: Some(v1::mesh_file::Source::Blob(blob)), options: Some(options) })
}

pub(crate) async fn sample(context: &Context, args: &SampleArgs) -> Outcome<Report> {
    let (format, encoding) = files::output_format(&args.output, args.encoding)?;
    let target = Target::new(&args.output, &[])?;
    let session = context.temporary_session("remesh sample").await?;
    let spinner = context.ui.spinner("sample");
    let source = Source::Sample(specs::sample_spec(&args.sample));
    let imported = context.client.import(&session, source, v1::ImportOptions::default()).await?;
    drop(spinner);
    let request = v1::ExportMeshRequest {
        session,
        source: v1::MeshSource::Input.into(),
        format: format.into(),
        encoding: encoding.into(),
        ..Default::default()
    };
    let exported = context.client.export(request, |_, _| {}).await?;
    target.write(&exported.bytes)?;
    exported.warnings.iter().for_each(|warning| context.ui.warn(warning));
    let mesh = imported.mesh.clone().unwrap_or_default();
    let mut text = summary::line("sample", summary::mesh(&mesh));
    if let Some(topology) = imported.diagnosis.as_ref().and_then(|d| d.topology.as_ref()) {
        text += &summary::line("surface", summary::topology(topology));
    }
    text += &summary::line("wrote", written(target.path(), &exported));
    let json =
        json!({ "mesh": json::mesh(&mesh), "output": exported_json(target.path(), &exported), "work": json::run(&imported.summary) });
    Ok(Report { text, json })
}

fn store_line(cache: &v1::GetCacheUsageResponse) -> String {
    let most = cache.store_capacity_bytes.map_or_else(|| "as much as the disk has".to_owned(), summary::size);
    let text = cache.store_bytes.map_or_else(|| "none; all is in memory".to_owned(), |bytes| format!("{} of {most}", summary::size(bytes)));
    summary::line("data folder", text)
}

pub(crate) async fn status(context: &Context) -> Outcome<Report> {
    let capabilities = context.client.capabilities().await?;
    let cache = context.client.cache_usage().await?;
    let limits = capabilities.limits.unwrap_or_default();
    let seconds = |duration: &Option<_>| duration.as_ref().map_or(0, |d: &prost_types::Duration| d.seconds);
    let text = [
        summary::line("remeshd", format!("{} ({})", capabilities.version, capabilities.apis.join(", "))),
        summary::line("where", context.client.endpoint().unwrap_or("in this process")),
        summary::line("threads", capabilities.threads),
        summary::line("sessions", format!("{} of {}", cache.sessions, limits.max_sessions)),
        summary::line("calls", format!("{} computing (at most {}), {} waiting", cache.running, limits.max_running, cache.queued)),
        summary::line(
            "cache",
            format!(
                "{} of {} in {} entries; {} hits, {} runs, {} evictions",
                summary::size(cache.cache_bytes),
                summary::size(cache.cache_capacity_bytes),
                summary::grouped(cache.cache_entries),
                summary::grouped(cache.hits),
                summary::grouped(cache.runs),
                summary::grouped(cache.evictions)
            ),
        ),
        summary::line(
            "files",
            format!("{} uploaded, {} of {}", cache.blobs, summary::size(cache.blob_bytes), summary::size(limits.max_blob_store_bytes)),
        ),
        store_line(&cache),
        summary::line(
            "limits",
            format!(
                "files of {}, {} faces, sessions unused for {} s",
                summary::size(limits.max_blob_bytes),
                summary::grouped(limits.max_faces),
                seconds(&limits.max_ttl)
            ),
        ),
    ]
    .concat();
    let json = json!({
        "version": capabilities.version,
        "apis": capabilities.apis,
        "threads": capabilities.threads,
        "limits": {
            "max_message_bytes": limits.max_message_bytes,
            "max_inline_bytes": limits.max_inline_bytes,
            "max_chunk_bytes": limits.max_chunk_bytes,
            "max_blob_bytes": limits.max_blob_bytes,
            "max_blob_store_bytes": limits.max_blob_store_bytes,
            "max_faces": limits.max_faces,
            "max_sessions": limits.max_sessions,
            "max_ttl_seconds": seconds(&limits.max_ttl),
            "default_ttl_seconds": seconds(&limits.default_ttl),
            "max_running": limits.max_running,
            "max_queued": limits.max_queued,
            "max_jobs_per_client": limits.max_jobs_per_client,
            "max_sessions_per_client": limits.max_sessions_per_client,
            "max_open_faces": limits.max_open_faces,
            "max_open_faces_per_client": limits.max_open_faces_per_client,
        },
        "cache": {
            "bytes": cache.cache_bytes,
            "capacity_bytes": cache.cache_capacity_bytes,
            "entries": cache.cache_entries,
            "hits": cache.hits,
            "runs": cache.runs,
            "evictions": cache.evictions,
            "blob_bytes": cache.blob_bytes,
            "blobs": cache.blobs,
        },
        "store": cache.store_bytes.map(|bytes| json!({ "bytes": bytes, "capacity_bytes": cache.store_capacity_bytes })),
        "sessions": cache.sessions,
        "running": cache.running,
        "queued": cache.queued,
    });
    Ok(Report { text, json })
}
