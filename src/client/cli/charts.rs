//! `remesh chart`: charts of a session or a file, and the spec of one patch.

use super::args::{
    ChartAllArgs, ChartOutput, ChartSpecArgs, ChartVerb, ImportArgs, InputArgs, PatchOf, PatchSpecArgs, names_session, session_name,
};
use super::context::Context;
use super::failure::{Failure, Outcome, exit};
use super::files::{self, Target};
use super::ui::Report;
use super::{json, specs, steps, summary};
use crate::{ChartData, ChartEdit, v1};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What a verb has found out, and the exit code: charts that cannot be used are told, not thrown.
type Told = Outcome<(Report, u8)>;

pub(crate) async fn verb(context: &Context, verb: &ChartVerb) -> Told {
    match verb {
        ChartVerb::Show { at, output } => show(context, at, output).await,
        ChartVerb::Set(PatchSpecArgs { session, patch, spec }) => Ok((set(context, &session.session, *patch, spec).await?, 0)),
        ChartVerb::Reset(at) => {
            let reset = context.client.reset_patch_chart(&at.session.session, at.patch, None).await?;
            Ok((revision_report(at, reset.revision, reset.spec), 0))
        }
        ChartVerb::Preview { at, spec, output } => {
            let places = Places::new(output, &[at.patch], None)?;
            let edit = specs::chart_edit(spec)?;
            let _spinner = context.ui.spinner("chart");
            let found = preview(context, &at.session.session, at.patch, edit).await?;
            finish(context, vec![found], places, None)
        }
        ChartVerb::Plan(PatchSpecArgs { session, patch, spec }) => {
            let edit = specs::chart_edit(spec)?;
            let proposal = match (patch, edit.paths.is_empty()) {
                (None, false) => return Err(Failure::Usage("which patch? The chart options are for a preview of one".into())),
                (None, true) => None,
                (Some(patch), _) => Some((*patch, whole_if_empty(edit))),
            };
            let plan = context.client.plan_charts(&session.session, proposal).await?;
            Ok((steps::plan_report(plan.revision, &plan.stages, [plan.hits, plan.runs], plan.estimated_milliseconds), 0))
        }
    }
}

/// An edit that names nothing means "as it is", not "all defaults".
fn whole_if_empty(edit: ChartEdit) -> ChartEdit {
    if edit.paths.is_empty() { ChartEdit { spec: edit.spec, paths: vec!["method".into()] } } else { edit }
}

fn revision_report(at: &PatchOf, revision: u64, spec: Option<v1::ChartSpec>) -> Report {
    let spec = spec.unwrap_or_default();
    let text = summary::line("revision", revision) + &summary::line("chart", summary::chart_spec(&spec));
    Report {
        text,
        json: json!({ "session": at.session.session, "revision": revision, "patch": at.patch, "spec": json::chart_spec(&spec) }),
    }
}

async fn set(context: &Context, session: &str, patch: Option<u32>, args: &ChartSpecArgs) -> Outcome<Report> {
    let edit = specs::chart_edit(args)?;
    if edit.paths.is_empty() {
        return Err(Failure::Usage("nothing to set: give --method or another chart option".into()));
    }
    let client = &context.client;
    let (revision, spec) = match patch {
        Some(patch) => {
            let updated = client.update_patch_chart(session, patch, edit, None).await?;
            (updated.revision, updated.spec.unwrap_or_default())
        }
        None => {
            let current = client.get_session(session).await?;
            let spec = specs::merged_chart(current.inputs.and_then(|i| i.charts).unwrap_or_default(), edit);
            (client.apply(session, v1::change::Change::Charts(spec.clone()), Some(current.revision)).await?, spec)
        }
    };
    let text = summary::line("revision", revision) + &summary::line("chart", summary::chart_spec(&spec));
    Ok(Report { text, json: json!({ "session": session, "revision": revision, "patch": patch, "spec": json::chart_spec(&spec) }) })
}

/// A chart with what is to be said about it.
struct Found {
    text: String,
    json: Value,
    /// With a map or without.
    data: Option<ChartData>,
    run: Option<v1::RunSummary>,
    is_usable: bool,
    patch: u32,
}

async fn show(context: &Context, at: &PatchOf, output: &ChartOutput) -> Told {
    let places = Places::new(output, &[at.patch], None)?;
    let session = &at.session.session;
    let spinner = context.ui.spinner("charts");
    let told = context.client.get_patch_chart(session, at.patch).await?;
    let spec = told.spec.clone().unwrap_or_default();
    let mut found = match &told.chart {
        Some(v1::get_patch_chart_response::Chart::Summary(chart)) => of_summary(chart),
        Some(v1::get_patch_chart_response::Chart::Error(error)) => of_failure(error),
        None => return Err(Failure::Other("the daemon told neither a chart nor an error".into())),
    };
    if places.is_wanted() && found.is_usable {
        found.data = Some(context.client.read_chart(session, at.patch).await?);
    }
    drop(spinner);
    let whose = if told.origin() == v1::ChartSpecOrigin::Patch { "its own" } else { "that of the session" };
    found.text += &summary::line("spec", format!("{whose}: {}", summary::chart_spec(&spec)));
    found.json["spec"] = json::chart_spec(&spec);
    found.json["revision"] = json!(told.revision);
    found.run = told.run;
    finish(context, vec![found], places, None)
}

fn of_summary(chart: &v1::ChartSummary) -> Found {
    let text = summary::chart(chart);
    Found { text, json: json::chart(chart), data: None, run: None, is_usable: true, patch: chart.patch }
}

fn of_failure(error: &v1::ChartError) -> Found {
    let text = summary::line(&format!("patch {}", error.patch), format!("NO CHART: {}", error.message));
    Found { text, json: json::chart_error(error), data: None, run: None, is_usable: false, patch: error.patch }
}

async fn preview(context: &Context, session: &str, patch: u32, edit: ChartEdit) -> Outcome<Found> {
    let preview = context.client.preview_chart(session, patch, whole_if_empty(edit)).await?;
    let is_usable = preview.verdict == v1::ChartVerdict::Usable;
    let summary = &preview.chart.summary;
    let mut text = summary::chart(summary);
    let mut json = json::chart(summary);
    if let Some(error) = &preview.error {
        text += &summary::line("", format!("NOT USABLE: {}", error.message));
        json["error"] = json::chart_error(error);
    }
    json["verdict"] = json!(json::verdict_name(preview.verdict));
    json["spec"] = json::chart_spec(&preview.spec);
    let run = Some(preview.chart.run.clone());
    Ok(Found { text, json, data: Some(preview.chart), run, is_usable, patch })
}

/// Charts of all or of the listed patches of a session or a file. With chart options: those they would have.
pub(crate) async fn all(context: &Context, args: &ChartAllArgs) -> Told {
    let edit = specs::chart_edit(&args.spec)?;
    let target = args.target.as_deref().unwrap_or_default();
    let file = (!names_session(target)).then(|| PathBuf::from(target));
    // An output that cannot be written is told before the work; which patches there are is known only after it.
    let early = Places::new(&args.output, &args.only, file.as_deref());
    if args.output.output.is_some() || !args.only.is_empty() {
        early?;
    }
    let session = match &file {
        Some(file) => open_file(context, args, file).await?,
        None if args.import != ImportArgs::default() || args.inputs != InputArgs::default() => {
            return Err(Failure::Usage(
                "these options are for a file; a session has its inputs by `remesh import` and `remesh set`".into(),
            ));
        }
        None => session_name(target).map_err(|message| Failure::Usage(format!("{target}: {message}")))?,
    };
    let bar = context.ui.bar("charts");
    let result = context.client.parametrize(&session, &args.only, |progress| bar.progress(progress)).await?;
    drop(bar);
    let mut wanted: Vec<u32> = result.charts.iter().map(|c| c.patch).chain(result.failures.iter().map(|f| f.patch)).collect();
    wanted.sort_unstable();
    if specs::names_vertices(&args.spec) && wanted.len() != 1 {
        return Err(Failure::Usage(format!(
            "--outer, --pin, --corner and --start are of one patch: name it with --patch (there are {})",
            result.patches
        )));
    }
    let places = Places::new(&args.output, &wanted, file.as_deref())?;
    let mut found = Vec::with_capacity(wanted.len());
    if edit.paths.is_empty() {
        for chart in &result.charts {
            let data = if places.is_wanted() { Some(context.client.read_chart(&session, chart.patch).await?) } else { None };
            found.push(Found { data, ..of_summary(chart) });
        }
        found.extend(result.failures.iter().map(of_failure));
        found.sort_by_key(|f| f.patch);
    } else {
        let spinner = context.ui.spinner("preview");
        for &patch in &wanted {
            found.push(preview(context, &session, patch, edit.clone()).await?);
        }
        drop(spinner);
    }
    finish(context, found, places, Some(&result))
}

/// A session of this command with the file and the options in it.
async fn open_file(context: &Context, args: &ChartAllArgs, file: &Path) -> Outcome<String> {
    let session = context.temporary_session(&format!("remesh chart {}", files::short_name(file))).await?;
    context.import_sound(&session, file, &args.import).await?;
    let changes = specs::changes(&context.client, &args.inputs, None, &v1::SessionInputs::default()).await?;
    context.apply_all(&session, changes).await?;
    Ok(session)
}

/// Writes the files and puts everything together.
fn finish(context: &Context, found: Vec<Found>, places: Places, all: Option<&v1::ParametrizeResult>) -> Told {
    let mut text = String::new();
    if let Some(result) = all {
        let splits = if result.splits > 0 { format!(", {} split for want of a chart", result.splits) } else { String::new() };
        // Previews tell their methods themselves; the charts that the patches have now are not asked about.
        let is_preview = found.iter().any(|f| f.run.is_some());
        let methods = if is_preview { String::new() } else { format!(": {}", summary::chart_methods(&result.charts)) };
        text += &summary::line("charts", format!("{} of {} patches{splits}{methods}", found.len(), result.patches));
    }
    let mut written = Vec::new();
    for f in &found {
        text += &f.text;
        if let Some(target) = places.target(f.patch) {
            match f.data.as_ref().filter(|data| !data.uv.is_empty()) {
                Some(data) => {
                    let bytes = obj(data);
                    target.write(bytes.as_bytes())?;
                    written.push((target.path().display().to_string(), bytes.len()));
                }
                None => context.ui.warn(&format!("patch {} has no map, so there is nothing to write", f.patch)),
            }
        }
    }
    let runs: Vec<&v1::RunSummary> =
        all.iter().filter_map(|r| r.summary.as_ref()).chain(found.iter().filter_map(|f| f.run.as_ref())).collect();
    let groups = super::stages::groups(super::stages::joined(&runs));
    let milliseconds = runs.iter().map(|run| run.milliseconds).sum();
    text += &summary::work(milliseconds, &groups);
    match written.as_slice() {
        [] => {}
        [(path, bytes)] => text += &summary::line("wrote", format!("{path} ({})", summary::size(*bytes as u64))),
        [(first, _), .., (last, _)] => text += &summary::line("wrote", format!("{} files, {first} to {last}", written.len())),
    }
    let code = if found.iter().all(|f| f.is_usable) { 0 } else { exit::FAILED };
    let json = json!({
        "patches": all.map(|r| r.patches),
        "splits": all.map(|r| r.splits),
        "charts": found.into_iter().map(|f| f.json).collect::<Vec<_>>(),
        "work": json::work(milliseconds, &groups),
        "files": written.iter().map(|(path, bytes)| json!({ "path": path, "bytes": bytes })).collect::<Vec<_>>(),
    });
    Ok((Report { text, json }, code))
}

/// Where the OBJ files of patches go.
struct Places(Vec<(u32, Target)>);

impl Places {
    /// Checked before the work as far as the patches are known.
    fn new(output: &ChartOutput, patches: &[u32], input: Option<&Path>) -> Outcome<Places> {
        let inputs: Vec<&Path> = input.into_iter().collect();
        if let Some(directory) = &output.output {
            if !directory.is_dir() {
                std::fs::create_dir(directory).map_err(|cause| Failure::write(directory, cause))?;
            }
            let place = |&patch: &u32| Ok((patch, Target::new(&directory.join(format!("patch-{patch}.obj")), &inputs)?));
            return Ok(Places(patches.iter().map(place).collect::<Outcome<_>>()?));
        }
        match (&output.obj, patches) {
            (None, _) => Ok(Places(Vec::new())),
            (Some(file), &[patch]) => Ok(Places(vec![(patch, Target::new(file, &inputs)?)])),
            (Some(_), _) => Err(Failure::Usage("--obj writes one patch: name it with --patch, or write all to a directory with -o".into())),
        }
    }

    fn is_wanted(&self) -> bool {
        !self.0.is_empty()
    }

    fn target(&self, patch: u32) -> Option<&Target> {
        self.0.iter().find(|(p, _)| *p == patch).map(|(_, target)| target)
    }
}

/// A patch with its uv as OBJ.
fn obj(chart: &ChartData) -> String {
    let method = summary::chart_method_name(chart.summary.method());
    let mut text = format!("# patch {}: {method} chart; line k of `v` is vertex k-1 of the patch\n", chart.summary.patch);
    // Writing to a string cannot fail.
    for [x, y, z] in &chart.positions {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for [u, v] in &chart.uv {
        let _ = writeln!(text, "vt {u} {v}");
    }
    for t in &chart.triangles {
        let [a, b, c] = t.map(|v| u64::from(v) + 1);
        let _ = writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_has_a_uv_for_each_vertex() {
        let chart = ChartData {
            positions: vec![[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.0, 1.0, 1e-20]],
            uv: vec![[0.0, -1.0], [1.0, 0.25], [0.0, 1.0]],
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        let text = obj(&chart);
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(lines[0], "v 0 0 0.1");
        assert_eq!((lines[4], lines[6]), ("vt 1 0.25", "f 1/1 2/2 3/3"));
        assert_eq!(lines[2].rsplit(' ').next().and_then(|z| z.parse::<f64>().ok()), Some(1e-20), "numbers are read back exactly");
    }

    #[test]
    fn one_file_is_for_one_patch() {
        let output = ChartOutput { output: None, obj: Some(std::env::temp_dir().join("x.obj")) };
        assert!(Places::new(&output, &[4], None).is_ok_and(|p| p.target(4).is_some() && p.target(5).is_none()));
        assert!(Places::new(&output, &[1, 2], None).is_err());
        assert!(!Places::new(&ChartOutput::default(), &[1, 2], None).expect("nothing to write").is_wanted());
    }
}
