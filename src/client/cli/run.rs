//! `remesh run`: file in, good mesh out.

use super::args::RunArgs;
use super::context::Context;
use super::failure::Outcome;
use super::files::{self, Target};
use super::render::histogram_png;
use super::ui::Report;
use super::{json, specs, stages, summary};
use crate::{Exported, v1};
use serde_json::json;
use std::path::Path;

/// Everything a run has found out.
struct Done {
    imported: v1::ImportMeshResponse,
    result: v1::RemeshResult,
    quality: Option<v1::GetQualityResponse>,
    exported: Exported,
}

pub(crate) async fn run(context: &Context, args: &RunArgs) -> Outcome<Report> {
    let choice = specs::size_choice(&args.size)?.ok_or_else(specs::missing_size)?;
    let (format, encoding) = files::output_format(&args.output, args.encoding)?;
    let target = Target::new(&args.output, &[&args.input])?;
    let picture = args.before_after.as_ref().map(|path| Target::new(path, &[&args.input, &args.output])).transpose()?;
    let client = &context.client;

    let session = context.temporary_session(&format!("remesh run {}", files::short_name(&args.input))).await?;
    let imported = context.import_sound(&session, &args.input, &args.import).await?;
    let mut changes = specs::changes(client, &args.inputs, args.method.chart, &v1::SessionInputs::default()).await?;
    changes.push(v1::change::Change::Size(specs::size_spec(client, choice).await?));
    context.apply_all(&session, changes).await?;

    let bar = context.ui.bar("remesh");
    let result = client.remesh(&session, &[], |progress| bar.progress(progress)).await?;
    drop(bar);

    let quality = if args.quality {
        let _spinner = context.ui.spinner("quality");
        Some(client.quality(&session, v1::QualityScope::Full).await?)
    } else {
        None
    };
    if let Some(picture) = &picture {
        picture.write(&histogram_png(context, &session, None).await?)?;
    }
    let bar = context.ui.bar("download");
    let request = v1::ExportMeshRequest { session, format: format.into(), encoding: encoding.into(), ..Default::default() };
    let exported = client.export(request, |received, total| bar.transfer(received, total)).await?;
    drop(bar);

    target.write(&exported.bytes)?;
    result.warnings.iter().chain(&exported.warnings).for_each(|warning| context.ui.warn(warning));
    let done = Done { imported, result, quality, exported };
    Ok(report(args, &done))
}

fn report(args: &RunArgs, done: &Done) -> Report {
    let runs: Vec<&v1::RunSummary> =
        [&done.imported.summary, &done.result.summary].into_iter().flatten().chain(done.quality.iter().flat_map(|q| &q.summary)).collect();
    let groups = stages::groups(stages::joined(&runs));
    let milliseconds = runs.iter().map(|run| run.milliseconds).sum::<f64>();
    let full = done.quality.as_ref().and_then(|q| q.report.as_ref());
    let mesh = done.result.mesh.clone().unwrap_or_default();

    let mut text = summary::import(
        &files::short_name(&args.input),
        &done.imported.report.clone().unwrap_or_default(),
        &done.imported.mesh.clone().unwrap_or_default(),
    );
    if let Some(topology) = done.imported.diagnosis.as_ref().and_then(|d| d.topology.as_ref()) {
        text += &summary::line("surface", summary::topology(topology));
    }
    text += &summary::line("patches", summary::grouped(done.result.patches.len() as u64));
    text += &summary::line("result", summary::mesh(&mesh));
    text += &summary::elements(done.result.shape.as_ref(), done.result.quads.as_ref());
    text += &full.map(summary::quality).unwrap_or_default();
    text += &summary::work(milliseconds, &groups);
    text += &summary::line("wrote", written(&args.output, &done.exported));
    if let Some(path) = &args.before_after {
        text += &summary::line("", path.display());
    }
    let json = json!({
        "input": done.imported.mesh.as_ref().map(json::mesh),
        "report": done.imported.report.as_ref().map(json::report),
        "diagnosis": done.imported.diagnosis.as_ref().map(json::diagnosis),
        "patches": done.result.patches.len(),
        "mesh": json::mesh(&mesh),
        "shape": done.result.shape.as_ref().map(json::shape),
        "quads": done.result.quads.as_ref().map(json::quads),
        "quality": full.map(json::quality),
        "work": json::work(milliseconds, &groups),
        "warnings": done.result.warnings,
        "output": exported_json(&args.output, &done.exported),
        "before_after": args.before_after.as_ref().map(|path| path.display().to_string()),
    });
    Report { text, json }
}

/// `out.stl (1.2 MB)`.
pub(crate) fn written(path: &Path, exported: &Exported) -> String {
    format!("{} ({})", path.display(), summary::size(exported.bytes.len() as u64))
}

/// A written file as JSON.
pub(crate) fn exported_json(path: &Path, exported: &Exported) -> serde_json::Value {
    json!({
        "path": path.display().to_string(),
        "bytes": exported.bytes.len(),
        "vertices": exported.vertices,
        "faces": exported.faces,
        "warnings": exported.warnings,
    })
}
