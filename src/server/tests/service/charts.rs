//! Charts of single patches: specs of their own, previews, plans, columns; and what is refused.

use crate::harness::{Daemon, assert_refused, column, tube};
use prost_types::FieldMask;
use remesh_proto::v1;
use remesh_proto::v1::boundary_shape::Shape;
use tonic::{Code, Status};
use tonic_types::StatusExt;

const LSCM: v1::ChartMethod = v1::ChartMethod::LeastSquaresConformal;

/// A tube in three or more patches; at revision 2.
async fn open_tube(daemon: &Daemon) -> String {
    let session = daemon.session().await;
    daemon.import(&session, tube(1_500)).await.expect("import");
    let partition = v1::PartitionSpec { patches: Some(3), ..Default::default() };
    daemon.change(&session, None, v1::change::Change::Partition(partition)).await.expect("partition");
    session
}

async fn get(daemon: &Daemon, session: &str, patch: u32) -> Result<v1::GetPatchChartResponse, Status> {
    let request = v1::GetPatchChartRequest { session: session.to_owned(), expected_revision: None, patch };
    daemon.charts().get_patch_chart(request).await.map(tonic::Response::into_inner)
}

/// A request that changes the named parts of the spec of patch 0.
fn edit(session: &str, spec: v1::ChartSpec, paths: &[&str]) -> v1::UpdatePatchChartRequest {
    let update_mask = (!paths.is_empty()).then(|| FieldMask { paths: paths.iter().map(|p| (*p).to_owned()).collect() });
    v1::UpdatePatchChartRequest {
        session: session.to_owned(),
        base_revision: None,
        patch: 0,
        spec: Some(spec),
        update_mask,
        ..Default::default()
    }
}

async fn update(daemon: &Daemon, request: v1::UpdatePatchChartRequest) -> Result<v1::UpdatePatchChartResponse, Status> {
    daemon.charts().update_patch_chart(request).await.map(tonic::Response::into_inner)
}

struct Preview {
    header: v1::ChartPreviewHeader,
    chunks: Vec<v1::DataChunk>,
}

async fn preview(daemon: &Daemon, session: &str, spec: v1::ChartSpec, columns: &[v1::DataColumn]) -> Result<Preview, Status> {
    use v1::preview_patch_chart_response::Part;
    let columns = columns.iter().map(|&c| c.into()).collect();
    let request = v1::PreviewPatchChartRequest { session: session.to_owned(), spec: Some(spec), columns, ..Default::default() };
    let mut stream = daemon.charts().preview_patch_chart(request).await?.into_inner();
    let (mut header, mut chunks) = (None, Vec::new());
    while let Some(message) = stream.message().await? {
        match message.part.expect("part") {
            Part::Header(first) => header = Some(first),
            Part::Chunk(chunk) => chunks.push(chunk),
        }
    }
    Ok(Preview { header: header.expect("header"), chunks })
}

async fn plan(daemon: &Daemon, session: &str, preview: Option<v1::ChartProposal>) -> Result<v1::PlanChartsResponse, Status> {
    let request = v1::PlanChartsRequest { session: session.to_owned(), expected_revision: None, preview };
    daemon.charts().plan_charts(request).await.map(tonic::Response::into_inner)
}

async fn chart_data(daemon: &Daemon, session: &str, columns: &[v1::DataColumn]) -> Result<(v1::ChartSummary, Vec<v1::DataChunk>), Status> {
    use v1::read_chart_data_response::Part;
    let columns = columns.iter().map(|&c| c.into()).collect();
    let request = v1::ReadChartDataRequest { session: session.to_owned(), columns, ..Default::default() };
    let mut stream = daemon.charts().read_chart_data(request).await?.into_inner();
    let (mut chart, mut chunks) = (None, Vec::new());
    while let Some(message) = stream.message().await? {
        match message.part.expect("part") {
            Part::Header(header) => chart = header.chart,
            Part::Chunk(chunk) => chunks.push(chunk),
        }
    }
    Ok((chart.expect("header"), chunks))
}

fn only(method: v1::ChartMethod) -> v1::ChartSpec {
    v1::ChartSpec { method: method.into(), ..Default::default() }
}

fn pinned(pins: &[(u32, Option<[f64; 2]>)]) -> v1::ChartSpec {
    let pin = |&(vertex, target): &(u32, Option<[f64; 2]>)| v1::Pin { vertex, target: target.map(|[u, v]| v1::PlanePoint { u, v }) };
    v1::ChartSpec { pins: Some(v1::PinSpec { choice: 0, given: pins.iter().map(pin).collect() }), ..only(LSCM) }
}

fn f64s(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
}

fn u32s(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect()
}

/// Two vertices of patch 0 far from each other in its list, as the imported mesh numbers them; and one that it does not have.
async fn vertices(daemon: &Daemon, session: &str) -> ([u32; 2], u32) {
    let (_, chunks) = chart_data(daemon, session, &[v1::DataColumn::SourceVertex]).await.expect("chart");
    let own = u32s(&column(&chunks, v1::DataColumn::SourceVertex));
    let foreign = (0..).find(|v| !own.contains(v)).expect("another patch");
    ([own[0], own[own.len() - 1]], foreign)
}

fn field(status: &Status) -> String {
    status.get_error_details().bad_request().map_or_else(String::new, |bad| bad.field_violations[0].field.clone())
}

#[tokio::test]
async fn a_patch_gets_a_spec_of_its_own_and_gives_it_back() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let before = get(&daemon, &session, 0).await.expect("get");
    assert_eq!((before.revision, before.origin()), (2, v1::ChartSpecOrigin::Session));
    assert_eq!(before.spec.as_ref().map(v1::ChartSpec::method), Some(v1::ChartMethod::Automatic));
    let Some(v1::get_patch_chart_response::Chart::Summary(first)) = before.chart else { panic!("{before:?}") };
    assert_eq!(first.origin(), v1::ChartSpecOrigin::Session);
    let distortion = first.distortion.expect("distortion");
    let angle = distortion.angle.expect("spread");
    assert!(angle.min >= 1.0 && angle.min <= angle.mean && angle.mean <= angle.max && angle.mean == distortion.angle_mean);

    let changed = update(&daemon, edit(&session, only(LSCM), &[])).await.expect("update");
    assert_eq!((changed.revision, changed.spec.expect("spec").method()), (3, LSCM));
    let own = get(&daemon, &session, 0).await.expect("get");
    assert_eq!((own.revision, own.origin()), (3, v1::ChartSpecOrigin::Patch));
    let Some(v1::get_patch_chart_response::Chart::Summary(chart)) = own.chart else { panic!("{:?}", own.chart) };
    assert_eq!((chart.method(), chart.origin()), (LSCM, v1::ChartSpecOrigin::Patch));
    let ran: Vec<_> = own.run.expect("run").stages.into_iter().filter(|s| s.outcome() == v1::StageOutcome::Run).collect();
    assert!(ran.iter().all(|s| s.subject == "patch 0"), "other patches keep their charts: {ran:?}");
    let inputs = daemon.sessions().get_session(v1::GetSessionRequest { name: session.clone() }).await.expect("get").into_inner();
    assert_eq!(inputs.session.and_then(|s| s.inputs).map(|i| i.patch_charts), Some(1));

    let reset = v1::ResetPatchChartRequest { session: session.clone(), base_revision: Some(3), patch: 0, ..Default::default() };
    assert_eq!(daemon.charts().reset_patch_chart(reset).await.expect("reset").into_inner().revision, 4);
    let again = v1::ResetPatchChartRequest { session: session.clone(), base_revision: None, patch: 0, ..Default::default() };
    assert_eq!(daemon.charts().reset_patch_chart(again).await.expect("reset").into_inner().revision, 4, "nothing to take back");
    let back = get(&daemon, &session, 0).await.expect("get");
    assert_eq!(back.chart, Some(v1::get_patch_chart_response::Chart::Summary(first)));
    assert_eq!(back.run.map(|r| r.runs), Some(0));
}

#[tokio::test]
async fn a_mask_changes_only_what_it_names() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let ([a, b], _) = vertices(&daemon, &session).await;
    update(&daemon, edit(&session, pinned(&[(a, None), (b, None)]), &[])).await.expect("update");
    let open = v1::ChartSpec { holes: v1::HoleTreatment::Open.into(), ..Default::default() };
    let spec = update(&daemon, edit(&session, open, &["holes"])).await.expect("update").spec.expect("spec");
    assert_eq!((spec.method(), spec.holes()), (LSCM, v1::HoleTreatment::Open));
    assert_eq!(spec.pins.map(|p| p.given.len()), Some(2), "not named, so kept");
    let spec = update(&daemon, edit(&session, v1::ChartSpec::default(), &["pins"])).await.expect("update").spec.expect("spec");
    assert_eq!(spec.pins.map(|p| p.choice()), Some(v1::PinChoice::Automatic), "named and not set, so the default");
    let shape = |shape| v1::BoundarySpec { shape: Some(v1::BoundaryShape { shape: Some(shape) }), ..Default::default() };
    let harmonic = v1::ChartSpec {
        boundary: Some(shape(Shape::Rectangle(v1::RectangleShape { ratio: Some(1.0), corners: Vec::new() }))),
        ..only(v1::ChartMethod::Harmonic)
    };
    let status = update(&daemon, edit(&session, harmonic.clone(), &["boundary"])).await;
    let status = assert_refused(status, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(field(&status), "spec.boundary", "the method is still LSCM");
    let chord = v1::BoundarySpec { spacing: v1::BoundarySpacing::Chord.into(), ..Default::default() };
    update(&daemon, edit(&session, harmonic, &["method", "boundary.shape"])).await.expect("update");
    let spacing = v1::ChartSpec { boundary: Some(chord), ..Default::default() };
    let spec = update(&daemon, edit(&session, spacing, &["boundary.spacing"])).await.expect("update").spec.expect("spec");
    let boundary = spec.boundary.expect("boundary");
    assert_eq!(boundary.spacing(), v1::BoundarySpacing::Chord);
    assert!(matches!(boundary.shape.and_then(|s| s.shape), Some(Shape::Rectangle(r)) if r.ratio == Some(1.0)));
}

#[tokio::test]
async fn a_preview_shows_and_changes_nothing() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let every = [
        v1::DataColumn::Uv,
        v1::DataColumn::Positions,
        v1::DataColumn::Triangles,
        v1::DataColumn::FaceAngleDistortion,
        v1::DataColumn::FaceAreaDistortion,
        v1::DataColumn::FaceStretch,
        v1::DataColumn::FaceFlipped,
    ];
    let shown = preview(&daemon, &session, only(LSCM), &every).await.expect("preview");
    let chart = shown.header.chart.clone().expect("chart");
    assert!(shown.header.has_map && shown.header.error.is_none() && shown.header.verdict() == v1::ChartVerdict::Usable);
    assert_eq!((chart.method(), shown.header.spec.as_ref().map(v1::ChartSpec::method)), (LSCM, Some(LSCM)));
    let angle = f64s(&column(&shown.chunks, v1::DataColumn::FaceAngleDistortion));
    let area = f64s(&column(&shown.chunks, v1::DataColumn::FaceAreaDistortion));
    let spreads = chart.distortion.expect("distortion");
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
    assert!(close(angle.iter().copied().fold(0.0, f64::max), spreads.angle_max), "the columns agree with the summary");
    assert!(close(area.iter().copied().fold(f64::INFINITY, f64::min), spreads.area_min));
    assert_eq!(angle.len() as u64, chart.faces);
    assert!(u32s(&column(&shown.chunks, v1::DataColumn::FaceFlipped)).iter().all(|&f| f == 0));
    assert_eq!(column(&shown.chunks, v1::DataColumn::Positions).len() as u64, 24 * chart.vertices);

    let still = get(&daemon, &session, 0).await.expect("get");
    assert_eq!((still.revision, still.origin()), (2, v1::ChartSpecOrigin::Session));
    update(&daemon, edit(&session, only(LSCM), &[])).await.expect("update");
    let taken = get(&daemon, &session, 0).await.expect("get");
    assert_eq!(taken.run.map(|r| r.runs), Some(0), "the preview has computed it");
    let (_, chunks) = chart_data(&daemon, &session, &every).await.expect("chart");
    assert!(chunks == shown.chunks, "bit for bit");
}

#[tokio::test]
async fn a_plan_tells_what_a_preview_would_find() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let proposal = |spec| Some(v1::ChartProposal { patch: 0, spec: Some(spec), update_mask: None });
    let cold = plan(&daemon, &session, proposal(only(LSCM))).await.expect("plan");
    assert!(cold.runs > 0 && !cold.stages.iter().any(|s| s.stage == "chart"), "{cold:?}");
    get(&daemon, &session, 0).await.expect("get");
    let charts = plan(&daemon, &session, None).await.expect("plan");
    assert_eq!(charts.runs, 0);
    let fresh = plan(&daemon, &session, proposal(only(LSCM))).await.expect("plan");
    let runs: Vec<_> = fresh.stages.iter().filter(|s| s.outcome() == v1::StageOutcome::Run).collect();
    assert!(!runs.is_empty() && runs.iter().all(|s| s.subject == "patch 0"), "{runs:?}");
    preview(&daemon, &session, only(LSCM), &[]).await.expect("preview");
    assert_eq!(plan(&daemon, &session, proposal(only(LSCM))).await.expect("plan").runs, 0);
    let status = plan(&daemon, &session, Some(v1::ChartProposal::default())).await;
    assert_eq!(field(&assert_refused(status, Code::InvalidArgument, "BAD_PARAMETER")), "preview.spec");
}

#[tokio::test]
async fn what_cannot_be_is_refused_and_named() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let ([a, b], foreign) = vertices(&daemon, &session).await;
    let send = |spec: v1::ChartSpec, paths: &'static [&'static str]| update(&daemon, edit(&session, spec, paths));
    let unknown = v1::UpdatePatchChartRequest { patch: 999, ..edit(&session, only(LSCM), &[]) };
    let status = assert_refused(update(&daemon, unknown).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_eq!(status.get_error_details().error_info().expect("info").metadata["patch"], "999");
    assert_refused(get(&daemon, &session, 999).await, Code::NotFound, "PATCH_NOT_FOUND");

    let status = assert_refused(send(pinned(&[(a, None), (foreign, None)]), &[]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_eq!(field(&status), "spec.pins");
    let places = crate::harness::locations(&status).expect("the vertex exists, so it has a place");
    assert_eq!(places.locations[0].ids, [foreign]);
    let status = assert_refused(send(pinned(&[(a, None), (u32::MAX, None)]), &[]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert!(crate::harness::locations(&status).is_none());

    for pins in [vec![(a, None), (a, None)], vec![(a, None)], vec![(a, Some([1.0, 1.0])), (b, Some([1.0, 1.0]))], vec![(a, None); 300]] {
        let status = assert_refused(send(pinned(&pins), &[]).await, Code::InvalidArgument, "BAD_PARAMETER");
        assert_eq!(field(&status), "spec.pins");
    }
    for wrong in [f64::NAN, f64::INFINITY] {
        let spec = pinned(&[(a, Some([0.0, 0.0])), (b, Some([wrong, 1.0]))]);
        assert_eq!(field(&assert_refused(send(spec, &[]).await, Code::InvalidArgument, "NON_FINITE")), "spec");
    }
    let spectral = v1::ChartSpec { method: v1::ChartMethod::SpectralConformal.into(), ..pinned(&[(a, None), (b, None)]) };
    assert_eq!(field(&assert_refused(send(spectral.clone(), &[]).await, Code::InvalidArgument, "BAD_PARAMETER")), "spec.pins");
    let shown = preview(&daemon, &session, spectral, &[]).await.map(|p| p.header);
    assert_refused(shown, Code::InvalidArgument, "BAD_PARAMETER");
    let status = assert_refused(send(only(LSCM), &["methode"]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert!(field(&status) == "update_mask" && status.message().contains("methode"), "{status:?}");
    let number = v1::ChartSpec { method: 77, ..Default::default() };
    assert_eq!(field(&assert_refused(send(number, &[]).await, Code::InvalidArgument, "BAD_PARAMETER")), "spec.method");

    let stale = v1::UpdatePatchChartRequest { base_revision: Some(0), ..edit(&session, only(LSCM), &[]) };
    assert_refused(update(&daemon, stale).await, Code::Aborted, "STALE_REVISION");
    let named = v1::change::Change::Charts(pinned(&[(a, None), (b, None)]));
    let status = assert_refused(daemon.change(&session, None, named).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert!(status.message().contains("of one patch"), "{status:?}");
    assert_eq!(get(&daemon, &session, 0).await.expect("get").revision, 2, "nothing was changed");
    let columns = [v1::DataColumn::FaceKappa];
    assert_refused(chart_data(&daemon, &session, &columns).await, Code::InvalidArgument, "BAD_PARAMETER");
}

#[tokio::test]
async fn no_mesh_no_charts() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    assert_refused(get(&daemon, &session, 0).await, Code::FailedPrecondition, "NO_MESH");
    assert_refused(plan(&daemon, &session, None).await, Code::FailedPrecondition, "NO_MESH");
    assert_refused(get(&daemon, "sessions/none", 0).await, Code::NotFound, "SESSION_NOT_FOUND");
}
