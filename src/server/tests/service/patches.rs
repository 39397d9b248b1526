//! Edits of single patches and compounds: revisions, numbers, what is refused.

use crate::harness::{Daemon, assert_refused, locations, tube};
use remesh_proto::v1;
use tonic::{Code, Status};
use v1::packed_array::Data;
use v1::split_patch_request::How;

/// A tube in three or more patches; at revision 2.
async fn open_tube(daemon: &Daemon) -> String {
    let session = daemon.session().await;
    daemon.import(&session, tube(1_500)).await.expect("import");
    let partition = v1::PartitionSpec { patches: Some(3), ..Default::default() };
    daemon.change(&session, None, v1::change::Change::Partition(partition)).await.expect("partition");
    session
}

async fn partition(daemon: &Daemon, session: &str, with_charts: bool) -> v1::PartitionResult {
    use v1::partition_surface_response::Event;
    let request = v1::PartitionSurfaceRequest { session: session.to_owned(), expected_revision: None, with_charts };
    let mut stream = daemon.partitions().partition_surface(request).await.expect("stream").into_inner();
    while let Some(message) = stream.message().await.expect("message") {
        if let Some(Event::Result(result)) = message.event {
            return result;
        }
    }
    panic!("no result")
}

async fn split(daemon: &Daemon, session: &str, base: Option<u64>, patch: u32, how: Option<How>) -> Result<v1::SplitPatchResponse, Status> {
    let request = v1::SplitPatchRequest { session: session.to_owned(), base_revision: base, patch, how, ..Default::default() };
    daemon.partitions().split_patch(request).await.map(tonic::Response::into_inner)
}

async fn merge(daemon: &Daemon, session: &str, patches: &[u32]) -> Result<v1::MergePatchesResponse, Status> {
    let request =
        v1::MergePatchesRequest { session: session.to_owned(), base_revision: None, patches: patches.to_vec(), ..Default::default() };
    daemon.partitions().merge_patches(request).await.map(tonic::Response::into_inner)
}

async fn reassign(daemon: &Daemon, session: &str, faces: &[u32], patch: u32) -> Result<v1::ReassignFacesResponse, Status> {
    let bytes: Vec<u8> = faces.iter().flat_map(|f| f.to_le_bytes()).collect();
    let faces = Some(v1::PackedArray { data: Some(Data::Inline(bytes.into())) });
    let request = v1::ReassignFacesRequest { session: session.to_owned(), base_revision: None, faces, patch, ..Default::default() };
    daemon.partitions().reassign_faces(request).await.map(tonic::Response::into_inner)
}

fn plane(point: [f64; 3], normal: [f64; 3]) -> Option<How> {
    let at = |[x, y, z]: [f64; 3]| Some(v1::Point { x, y, z });
    Some(How::Plane(v1::CutPlane { point: at(point), normal: at(normal) }))
}

#[tokio::test]
async fn a_patch_is_split_merged_and_reset() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let before = partition(&daemon, &session, true).await;
    assert!(before.with_charts && before.edits.is_empty() && before.patches.iter().all(|p| p.origin() != v1::PatchOrigin::Split));
    let done = split(&daemon, &session, Some(2), 0, None).await.expect("split");
    assert_eq!((done.revision, done.patches.len() as u32), (3, 2 + done.split_again));
    assert_eq!(done.patch_count as usize, before.patches.len() + 1 + done.split_again as usize);
    let after = partition(&daemon, &session, false).await;
    assert!(after.with_charts, "edits are of patches with charts");
    for patch in &done.patches {
        assert_eq!(after.patches[patch.patch as usize], *patch);
        assert!(matches!(patch.origin(), v1::PatchOrigin::Split | v1::PatchOrigin::ChartSplit));
    }
    assert!(matches!(&after.edits[..], [edit] if edit.applied && edit.kind() == v1::PatchEditKind::Split));
    let numbers: Vec<u32> = done.patches.iter().map(|p| p.patch).collect();
    let merged = merge(&daemon, &session, &numbers).await.expect("merge");
    assert_eq!((merged.revision, merged.patch_count as usize), (4, before.patches.len()));
    assert_eq!(merged.patches[0].origin(), v1::PatchOrigin::Merge);
    let reset = |session: String| async {
        daemon.partitions().reset_patches(v1::ResetPatchesRequest { session, base_revision: None, ..Default::default() }).await
    };
    let back = reset(session.clone()).await.expect("reset").into_inner();
    assert_eq!((back.revision, back.edits), (5, 2));
    assert_eq!(reset(session.clone()).await.expect("reset").into_inner().revision, 5, "nothing to take back");
    assert_eq!(partition(&daemon, &session, true).await.patches, before.patches);
    let request = v1::GetSessionRequest { name: session };
    let state = daemon.sessions().get_session(request).await.expect("session").into_inner().session.expect("session");
    assert_eq!(state.inputs.expect("inputs").patch_edits, 0);
}

#[tokio::test]
async fn edits_that_cannot_be_are_refused() {
    let daemon = Daemon::usual().await;
    let session = open_tube(&daemon).await;
    let patches = partition(&daemon, &session, true).await.patches;
    let count = patches.len() as u32;
    assert_refused(split(&daemon, &session, None, count, None).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_refused(split(&daemon, &session, Some(1), 0, None).await, Code::Aborted, "STALE_REVISION");
    assert_refused(split(&daemon, &session, None, 0, Some(How::Method(99))).await, Code::InvalidArgument, "BAD_PARAMETER");
    let far = plane([1e6, 0.0, 0.0], [1.0, 0.0, 0.0]);
    assert_refused(split(&daemon, &session, None, 0, far).await, Code::InvalidArgument, "BAD_PARAMETER");
    for normal in [[0.0; 3], [f64::NAN, 0.0, 1.0]] {
        assert_refused(split(&daemon, &session, None, 0, plane([0.0; 3], normal)).await, Code::InvalidArgument, "BAD_PARAMETER");
    }
    assert_refused(merge(&daemon, &session, &[0]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_refused(merge(&daemon, &session, &[0, 0]).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_refused(merge(&daemon, &session, &[0, count]).await, Code::NotFound, "PATCH_NOT_FOUND");
    assert_refused(reassign(&daemon, &session, &[4_000_000], 0).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_refused(reassign(&daemon, &session, &[], 0).await, Code::InvalidArgument, "BAD_PARAMETER");
    assert_refused(reassign(&daemon, &session, &[1], count).await, Code::NotFound, "PATCH_NOT_FOUND");
    // All faces of the surface to one patch: the others are left without.
    let request = v1::GetSessionRequest { name: session.clone() };
    let state = daemon.sessions().get_session(request).await.expect("session").into_inner().session.expect("session");
    let all: Vec<u32> = (0..state.mesh.expect("mesh").faces as u32).collect();
    assert_refused(reassign(&daemon, &session, &all, 0).await, Code::FailedPrecondition, "PATCH_TOPOLOGY");
    // A bound that no union keeps.
    let tight = v1::PartitionSpec { patches: Some(6), max_aspect_ratio: Some(0.5), ..Default::default() };
    let slender = open_tube(&daemon).await;
    daemon.change(&slender, None, v1::change::Change::Partition(tight)).await.expect("partition");
    let parts: Vec<u32> = (0..partition(&daemon, &slender, true).await.patches.len() as u32).collect();
    let status = assert_refused(merge(&daemon, &slender, &parts).await, Code::FailedPrecondition, "PATCH_TOPOLOGY");
    assert!(locations(&status).is_some_and(|l| !l.locations.is_empty()), "{status:?}");
    let request = v1::GetSessionRequest { name: session };
    let state = daemon.sessions().get_session(request).await.expect("session").into_inner().session.expect("session");
    assert_eq!(state.revision, 2, "what is refused changes nothing");
}

#[tokio::test]
async fn compounds_are_told_and_checked() {
    let daemon = Daemon::usual().await;
    let session = daemon.session().await;
    let sample = v1::SampleSpec { kind: v1::SampleKind::CadPart.into(), triangles: Some(3_000), ..Default::default() };
    let imported = daemon.import(&session, v1::import_mesh_request::Source::Sample(sample)).await.expect("import");
    let regions = imported.mesh.expect("mesh").regions;
    assert!(regions.len() > 2, "{regions:?}");
    let features =
        |compounds: v1::CompoundSpec| v1::change::Change::Features(v1::FeatureSpec { compounds: Some(compounds), ..Default::default() });
    daemon.change(&session, None, features(v1::CompoundSpec { merge_angle: Some(180.0), ..Default::default() })).await.expect("angle");
    let result = partition(&daemon, &session, false).await;
    let merged: usize = result.compounds.iter().map(|c| c.regions.len()).sum();
    assert_eq!(merged, regions.len(), "everything that hangs together: {:?}", result.compounds);
    assert!(result.compounds.iter().all(|c| c.rules().eq([v1::CompoundRule::Angle])));
    let request = v1::GetSessionRequest { name: session.clone() };
    let state = daemon.sessions().get_session(request).await.expect("session").into_inner().session.expect("session");
    assert_eq!(state.inputs.expect("inputs").features.expect("features").compounds.expect("compounds").merge_angle, Some(180.0));
    for bad in [
        v1::CompoundSpec { merge_angle: Some(0.0), ..Default::default() },
        v1::CompoundSpec { merge_angle: Some(181.0), ..Default::default() },
        v1::CompoundSpec { merge_below_size: Some(-1.0), ..Default::default() },
    ] {
        assert_refused(daemon.change(&session, None, features(bad)).await, Code::InvalidArgument, "BAD_PARAMETER");
    }
    // Which regions there are is known when the features are computed.
    let unknown = v1::CompoundSpec { lists: vec![v1::RegionList { regions: vec![regions[0].id, 987_654] }], ..Default::default() };
    daemon.change(&session, None, features(unknown)).await.expect("nothing is computed yet");
    assert_refused(daemon.remesh(&session).await, Code::InvalidArgument, "BAD_PARAMETER");
}
