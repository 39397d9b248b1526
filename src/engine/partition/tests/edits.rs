//! Splits, merges and moved faces: what they leave alone, what they refuse, and the replay of a log.

use super::*;
use crate::fingerprint::{Feeder, Fingerprint};
use std::collections::BTreeSet;
use std::sync::Arc;

const BOUND: f64 = 4.0;

impl Case {
    fn ground(&self) -> Ground<'_> {
        Ground { mesh: &self.mesh, topology: &self.topology, features: &self.features }
    }

    fn edit(&self, partition: &Partition, request: &PatchRequest) -> Result<Partition> {
        let token = CancelToken::new();
        let after = edit_partition(self.ground(), partition, request, BOUND, &Work::silent(&token))?;
        self.check(&after);
        Ok(after)
    }

    fn replay(&self, partition: &Partition, log: &[PatchEdit]) -> Partition {
        let token = CancelToken::new();
        let log: Vec<Arc<PatchEdit>> = log.iter().cloned().map(Arc::new).collect();
        apply_edits(self.ground(), partition, &log, BOUND, &Work::silent(&token)).unwrap()
    }

    fn identities(&self, partition: &Partition) -> BTreeSet<Fingerprint> {
        patch_identities(&self.mesh, partition).into_iter().collect()
    }

    fn name(&self, partition: &Partition, request: &PatchRequest) -> PatchEdit {
        name_edit(partition, &patch_identities(&self.mesh, partition), request).unwrap()
    }

    /// Patches with a common border.
    fn neighbours(&self, partition: &Partition) -> BTreeSet<[u32; 2]> {
        let label = &partition.face_patch;
        let across = (0..self.topology.halfedge_count() as u32).filter_map(|h| self.topology.twin(h).map(|t| [h / 3, t / 3]));
        across.map(|fs| fs.map(|f| label[f as usize])).filter(|[p, q]| p < q).collect()
    }
}

fn split(patch: u32, method: SplitMethod) -> PatchRequest {
    PatchRequest::Split { patch, method }
}

fn cut_at(point: Vec3, normal: Vec3) -> SplitMethod {
    SplitMethod::Plane(Plane { point, normal })
}

/// The patches of a square of n x n little squares (two faces each) in equal vertical stripes, by hand.
fn stripes(case: &Case, n: usize, count: usize) -> Partition {
    let label: Vec<u32> = (0..2 * n * n).map(|f| ((f / 2 % n) * count / n) as u32).collect();
    let surface = Surface::new(&case.mesh, &case.topology, &case.features);
    let token = CancelToken::new();
    finish(&surface, label, edit::NO_LIMITS, &Work::silent(&token)).unwrap()
}

#[test]
fn a_split_leaves_other_patches_alone_and_a_merge_takes_it_back() {
    for (name, case) in family() {
        let before = case.partition(&PartitionSpec { max_patch_faces: 400, ..PartitionSpec::default() });
        for method in [SplitMethod::Balanced, SplitMethod::Laplace] {
            let chosen = before.patches.len() as u32 / 2;
            if before.patches[chosen as usize].faces < 2 {
                continue;
            }
            let after = case.edit(&before, &split(chosen, method)).unwrap();
            assert_eq!(after.patches.len(), before.patches.len() + 1, "{name} {method:?}");
            let parts: Vec<u32> =
                (0..after.patches.len() as u32).filter(|&p| after.patches[p as usize].origin == PatchOrigin::Split).collect();
            assert_eq!(parts.len(), 2, "{name}");
            let (kept, all) = (case.identities(&before), case.identities(&after));
            assert_eq!(kept.intersection(&all).count(), before.patches.len() - 1, "{name}");
            // The parts meet without a feature between them, so their union is a patch again, the same as before.
            let merged = case.edit(&after, &PatchRequest::Merge { patches: parts }).unwrap();
            assert_eq!(merged.face_patch, before.face_patch, "{name} {method:?}");
        }
    }
}

#[test]
fn splits_are_balanced_or_follow_the_plane() {
    let case = case(disc(24), None);
    let whole = case.partition(&PartitionSpec::default());
    assert_eq!(whole.patches.len(), 1);
    for method in [SplitMethod::Balanced, SplitMethod::Laplace] {
        let after = case.edit(&whole, &split(0, method)).unwrap();
        let share = after.patches[0].area / whole.patches[0].area;
        assert!((0.25..=0.75).contains(&share), "{method:?}: {share}");
    }
    let after = case.edit(&whole, &split(0, cut_at([0.25, 0.0, 0.0], [2.0, 0.0, 0.0]))).unwrap();
    for (f, &p) in after.face_patch.iter().enumerate() {
        let x = case.mesh.face_location(f).position[0];
        assert_eq!(p == after.face_patch[0], x < 0.25, "face {f} at {x}");
    }
    let beside = case.edit(&whole, &split(0, cut_at([2.0, 0.0, 0.0], [1.0, 0.0, 0.0]))).unwrap_err();
    assert_eq!(beside.reason(), Reason::BadParameter);
    let flat = case.edit(&whole, &split(0, cut_at([0.0; 3], [0.0; 3]))).unwrap_err();
    assert_eq!(flat.reason(), Reason::BadParameter);
    assert_eq!(case.edit(&whole, &split(1, SplitMethod::Balanced)).unwrap_err().reason(), Reason::PatchNotFound);
}

#[test]
fn unions_that_are_no_patches_are_refused_with_the_reason_and_the_place() {
    let refused = |case: &Case, partition: &Partition, patches: &[u32], word: &str| {
        let error = case.edit(partition, &PatchRequest::Merge { patches: patches.to_vec() }).unwrap_err();
        assert_eq!(error.reason(), Reason::PatchTopology, "{error}");
        assert!(error.message().contains(word) && error.location_total() > 0, "{word}: {error}");
    };
    let ring = case(torus(16), None);
    let partition = ring.partition(&PartitionSpec { patches: Some(6), ..PartitionSpec::default() });
    let all: Vec<u32> = (0..partition.patches.len() as u32).collect();
    refused(&ring, &partition, &all, "closed");
    let token = CancelToken::new();
    let loose = edit_partition(ring.ground(), &partition, &PatchRequest::Merge { patches: all[1..].to_vec() }, 1e9, &Work::silent(&token));
    assert!(loose.is_err_and(|e| e.message().contains("genus 1") && e.location_total() > 0));
    let square = case(disc(12), None);
    let three = stripes(&square, 12, 3);
    refused(&square, &three, &[0, 2], "connected");
    let two = square.edit(&three, &PatchRequest::Merge { patches: vec![2, 1] }).unwrap();
    assert_eq!((two.patches.len(), two.patches[1].origin, two.patches[0].origin), (2, PatchOrigin::Merge, PatchOrigin::Strategy));
    // Six sides of a cube are closed off by its edges.
    let cube = case(cubes(|_| true, [4, 4, 4]), Some(40.0));
    let sides = cube.partition(&PartitionSpec::default());
    refused(&cube, &sides, &[0, 1], "feature edges");
    // A long tube cut across is slender as a whole.
    let long = case(tube(24, 8.0), None);
    let parts = long.partition(&PartitionSpec { max_aspect_ratio: 1.0, ..PartitionSpec::default() });
    let all: Vec<u32> = (0..parts.patches.len() as u32).collect();
    refused(&long, &parts, &all, "aspect ratio");
    for patches in [vec![], vec![0], vec![0, 0]] {
        let error = square.edit(&three, &PatchRequest::Merge { patches }).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter);
    }
    let missing = square.edit(&three, &PatchRequest::Merge { patches: vec![0, 7] }).unwrap_err();
    assert_eq!(missing.reason(), Reason::PatchNotFound);
}

#[test]
fn faces_move_only_if_all_patches_stay_whole() {
    let n = 12;
    let case = case(disc(n as u32), None);
    let three = stripes(&case, n, 3);
    let square = |i: usize, j: usize| [2 * (j * n + i) as u32, 2 * (j * n + i) as u32 + 1];
    let column = |i: usize| (0..n).flat_map(|j| square(i, j)).collect::<Vec<u32>>();
    let to = |faces: Vec<u32>, to: u32| PatchRequest::Reassign { faces, to };
    let moved = case.edit(&three, &to(column(4), 0)).unwrap();
    assert_eq!(moved.patches.iter().map(|p| p.faces).collect::<Vec<_>>(), [120, 72, 96]);
    assert_eq!(moved.patches[2].origin, PatchOrigin::Strategy);
    assert_eq!(moved.patches[0].origin, PatchOrigin::Reassigned);
    let error = |request: PatchRequest, reason: Reason, word: &str| {
        let error = case.edit(&three, &request).unwrap_err();
        assert_eq!(error.reason(), reason, "{error}");
        assert!(error.message().contains(word), "{word}: {error}");
        error
    };
    // A column inside of the middle patch is no neighbour of patch 0; moving it also cuts the middle patch.
    let apart = error(to(column(5), 0), Reason::PatchTopology, "patch 0 would not be connected");
    assert!(apart.metadata().contains(&("patch".to_owned(), "0".to_owned())));
    // A row through the middle patch hangs together with patch 0 and cuts patch 1.
    let row: Vec<u32> = (4..8).flat_map(|i| square(i, 6)).collect();
    let cut = error(to(row.clone(), 0), Reason::PatchTopology, "patch 1 would not be connected");
    assert!(cut.location_total() > 1);
    error(to((4..8).flat_map(column).collect(), 0), Reason::PatchTopology, "patch 1 would be left without faces");
    error(to(column(0), 0), Reason::BadParameter, "in patch 0 already");
    error(to(vec![], 0), Reason::BadParameter, "no face");
    error(to(vec![9999], 0), Reason::BadParameter, "no face 9999");
    error(to(column(4), 9), Reason::PatchNotFound, "no patch 9");
    // From several patches at once.
    let both = case.edit(&three, &to([column(3), column(8)].concat(), 1)).unwrap();
    assert_eq!(both.patches.iter().map(|p| p.faces).collect::<Vec<_>>(), [72, 144, 72]);
}

#[test]
fn a_log_means_faces_not_numbers_and_waits_for_its_patches() {
    let n = 12;
    let case = case(disc(n as u32), None);
    let three = stripes(&case, n, 3);
    let first = split(0, cut_at([0.0, 0.5, 0.0], [0.0, 1.0, 0.0]));
    let one = case.edit(&three, &first).unwrap();
    let last = one.face_patch[2 * n - 1];
    let second = split(last, SplitMethod::Balanced);
    let two = case.edit(&one, &second).unwrap();
    let third = PatchRequest::Merge { patches: vec![two.face_patch[0], two.face_patch[2 * n * (n - 1)]] };
    let log = [case.name(&three, &first), case.name(&one, &second), case.name(&two, &third)];
    let done = case.replay(&three, &log);
    assert_eq!(done.edits, vec![EditState::Applied; 3]);
    assert_eq!(done.face_patch, case.edit(&two, &third).unwrap().face_patch);
    // The second edit does not need the first, whatever numbers patches have; the third does, and the call ends before it so that
    // charts may split what has been edited; asked alone, it waits.
    let part = case.replay(&three, &log[1..]);
    assert_eq!(part.edits, [EditState::Applied]);
    let alone = case.replay(&part, &log[2..]);
    assert!(matches!(&alone.edits[..], [EditState::Waiting(why)] if why.contains("not in the partition")));
    assert_eq!(alone.face_patch, part.face_patch);
    let elsewhere = case.replay(&stripes(&case, n, 2), &log);
    assert!(elsewhere.edits.len() == 3 && elsewhere.edits.iter().all(|e| matches!(e, EditState::Waiting(_))));
    // An edit whose patches are there, but which features forbid now, waits too.
    let mut fenced = Case {
        features: case.features.clone(),
        mesh: case.mesh.clone(),
        topology: Topology::build(&case.mesh.triangles, case.mesh.positions.len()).unwrap(),
    };
    let merge = case.name(&three, &PatchRequest::Merge { patches: vec![0, 1] });
    for h in 0..case.topology.halfedge_count() as u32 {
        let across = case.topology.twin(h).map(|t| three.face_patch[t as usize / 3]);
        fenced.features.is_feature[h as usize] |= across.is_some_and(|p| p != three.face_patch[h as usize / 3]);
    }
    assert_eq!(case.replay(&three, &[merge.clone()]).edits, [EditState::Applied]);
    assert!(matches!(&fenced.replay(&three, &[merge]).edits[..], [EditState::Waiting(why)] if why.contains("feature edges")));
}

#[test]
fn identities_are_those_of_extracted_patches() {
    let case = case(torus(12), None);
    let partition = case.partition(&PartitionSpec { patches: Some(5), ..PartitionSpec::default() });
    let cut = extract_patches(&case.mesh, &case.topology, &partition).unwrap();
    let expected: Vec<Fingerprint> = cut.iter()
        .map(|(patch, map)| {
            let mut feeder = Feeder::new();
            feeder.tuples(&patch.triangles.iter().map(|t| t.map(|v| map.vertices[v as usize])).collect::<Vec<_>>());
            feeder.finish()
        })
        .collect();
    assert_eq!(patch_identities(&case.mesh, &partition), expected);
    assert!(case.neighbours(&partition).len() >= partition.patches.len());
}
