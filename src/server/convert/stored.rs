//! Inputs of a session as they are kept, in parts: each part once under its digest. Both directions; reading back gives the same inputs to the last
//! bit, whatever the defaults of the version that reads are.

use super::from_proto::{self, plane, required};
use super::{charts, meshers, metric, sizes, sources, to_proto};
use prost::Message;
use remesh_engine::EngineError;
use remesh_engine::engine::Engine;
use remesh_engine::error::{Reason, Result};
use remesh_engine::fingerprint::{Feeder, Fingerprint};
use remesh_engine::partition::{PatchEdit, SplitMethod};
use remesh_engine::planar::Mesher;
use remesh_engine::session::{Change, MeshSource, Snapshot};
use remesh_proto::v1;
use std::sync::Arc;
use v1::stored_part::Part;

/// Name of a part: the first bytes of the BLAKE3 digest of it, serialised.
pub(crate) type PartId = [u8; 16];

/// The name of a serialised part.
pub(crate) fn part_id(bytes: &[u8]) -> PartId {
    let mut id = PartId::default();
    id.copy_from_slice(&blake3::hash(bytes).as_bytes()[..16]);
    id
}

/// One input, or a kind of inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Slot {
    Mesh,
    Features,
    Partition,
    Charts,
    PatchCharts,
    PatchEdits,
    Size,
    Lock,
    // The metric comes before the mesher, since it chooses one.
    Metric,
    Mesher,
    Optimize,
}

/// All, in the order in which they apply.
const SLOTS: [Slot; 11] = [
    Slot::Mesh,
    Slot::Features,
    Slot::Partition,
    Slot::Charts,
    Slot::PatchCharts,
    Slot::PatchEdits,
    Slot::Size,
    Slot::Lock,
    Slot::Metric,
    Slot::Mesher,
    Slot::Optimize,
];

/// Inputs and the names of their parts.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    snapshot: Arc<Snapshot>,
    ids: [Vec<PartId>; SLOTS.len()],
}

impl Parts {
    /// The names, in the order in which the parts apply.
    pub(crate) fn ids(&self) -> impl Iterator<Item = PartId> {
        self.ids.iter().flatten().copied()
    }
}

/// The names of the parts of some inputs, and the parts that other inputs do not have. Inputs that both have are not looked at again.
pub(crate) fn parts(
    snapshot: &Arc<Snapshot>,
    mesh: Option<v1::MeshSummary>,
    former: Option<&Parts>,
) -> Result<(Parts, Vec<(PartId, Vec<u8>)>)> {
    let mut fresh = Vec::new();
    let mut add = |part: Part| {
        let bytes = v1::StoredPart { part: Some(part) }.encode_to_vec();
        let id = part_id(&bytes);
        fresh.push((id, bytes));
        id
    };
    let mut ids: [Vec<PartId>; SLOTS.len()] = Default::default();
    for (i, slot) in SLOTS.into_iter().enumerate() {
        ids[i] = match former.filter(|former| same(slot, &former.snapshot, snapshot)) {
            Some(former) => former.ids[i].clone(),
            None => write(slot, snapshot, mesh.as_ref())?.into_iter().map(&mut add).collect(),
        };
    }
    Ok((Parts { snapshot: snapshot.clone(), ids }, fresh))
}

/// Identity of a surface and of how it is read.
fn source_of(snapshot: &Snapshot) -> (Option<Fingerprint>, String) {
    let source = snapshot.source.as_ref().map(|source| {
        let mut feeder = Feeder::new();
        source.feed(&mut feeder);
        feeder.finish()
    });
    (source, format!("{:?}", snapshot.import))
}

fn same(slot: Slot, a: &Snapshot, b: &Snapshot) -> bool {
    match slot {
        Slot::Mesh => source_of(a) == source_of(b),
        Slot::Features => a.features == b.features,
        Slot::Partition => a.partition == b.partition,
        Slot::Charts => a.chart == b.chart,
        Slot::PatchCharts => Arc::ptr_eq(&a.patch_charts, &b.patch_charts),
        Slot::PatchEdits => Arc::ptr_eq(&a.patch_edits, &b.patch_edits),
        Slot::Size => a.size == b.size,
        Slot::Lock => a.lock == b.lock,
        Slot::Mesher => a.mesher == b.mesher,
        Slot::Metric => Arc::ptr_eq(&a.metric, &b.metric),
        Slot::Optimize => a.optimize == b.optimize,
    }
}

fn write(slot: Slot, snapshot: &Snapshot, mesh: Option<&v1::MeshSummary>) -> Result<Vec<Part>> {
    // A new input must be kept, too: this names all.
    let Snapshot {
        revision: _,
        source,
        import,
        features,
        partition,
        chart,
        patch_charts,
        patch_edits,
        size,
        lock,
        mesher: _,
        metric,
        optimize,
    } = snapshot;
    Ok(match slot {
        Slot::Mesh => match source {
            None => Vec::new(),
            Some(source) => vec![Part::Mesh(v1::StoredMesh {
                source: Some(match source {
                    MeshSource::File(blob) => v1::stored_mesh::Source::Blob(blob.digest.clone()),
                    MeshSource::Arrays { mesh, .. } => v1::stored_mesh::Source::Arrays(sources::wire_arrays(mesh)),
                    MeshSource::Sample(spec) => v1::stored_mesh::Source::Sample(sources::wire_sample(spec)),
                }),
                options: Some(sources::wire_options(import)),
                summary: mesh.cloned(),
            })],
        },
        Slot::Features => vec![Part::Features(to_proto::whole_features(features))],
        Slot::Partition => vec![Part::Partition(to_proto::partition(partition))],
        Slot::Charts => vec![Part::Charts(charts::wire(chart))],
        Slot::PatchCharts if patch_charts.is_empty() => Vec::new(),
        Slot::PatchCharts => {
            let one =
                |(patch, spec): (&Fingerprint, _)| v1::StoredPatchChart { patch: patch.0.to_vec().into(), spec: Some(charts::wire(spec)) };
            vec![Part::PatchCharts(v1::StoredPatchCharts { charts: patch_charts.iter().map(one).collect() })]
        }
        Slot::PatchEdits => patch_edits.iter().map(|edit| Part::PatchEdit(wire_edit(edit))).collect(),
        Slot::Size => size.iter().map(|size| Part::Size(sizes::whole(size))).collect(),
        Slot::Lock => vec![Part::Lock(sizes::whole_lock(lock))],
        Slot::Mesher => vec![Part::Mesher(v1::MesherSpec { metric: None, ..meshers::wire(snapshot) })],
        Slot::Metric => vec![Part::Metric(metric::whole(metric))],
        Slot::Optimize => vec![Part::Optimize(to_proto::optimize(optimize))],
    })
}

fn wire_edit(edit: &PatchEdit) -> v1::StoredPatchEdit {
    use v1::stored_patch_edit::Edit;
    let name = |patch: &Fingerprint| patch.0.to_vec().into();
    let edit = match edit {
        PatchEdit::Split { patch, method } => {
            let (method, plane) = match method {
                SplitMethod::Balanced => (v1::SplitMethod::Balanced, None),
                SplitMethod::Laplace => (v1::SplitMethod::Laplace, None),
                SplitMethod::Plane(plane) => (v1::SplitMethod::Unspecified, Some(to_proto::cut_plane(*plane))),
            };
            Edit::Split(v1::StoredSplit { patch: name(patch), method: method.into(), plane })
        }
        PatchEdit::Merge { patches } => Edit::Merge(v1::StoredMerge { patches: patches.iter().map(name).collect() }),
        PatchEdit::Reassign { faces, from, to } => {
            Edit::Reassign(v1::StoredReassign { faces: faces.clone(), from: from.iter().map(name).collect(), to: name(to) })
        }
    };
    v1::StoredPatchEdit { edit: Some(edit) }
}

fn patch_name(bytes: &[u8]) -> Result<Fingerprint> {
    bytes.try_into().map(Fingerprint).map_err(|_| EngineError::bad_parameter("patch", "is not named by 16 bytes"))
}

fn edit_of(stored: v1::StoredPatchEdit) -> Result<PatchEdit> {
    use v1::stored_patch_edit::Edit;
    let names = |list: &[bytes::Bytes]| list.iter().map(|patch| patch_name(patch)).collect::<Result<Vec<_>>>();
    Ok(match required(stored.edit, "edit")? {
        Edit::Split(split) => {
            let method = match (&split.plane, from_proto::known(split.method, "method")?) {
                (Some(wire), _) => SplitMethod::Plane(plane(wire, "plane")?),
                (None, v1::SplitMethod::Laplace) => SplitMethod::Laplace,
                (None, v1::SplitMethod::Balanced) => SplitMethod::Balanced,
                (None, v1::SplitMethod::Unspecified) => return Err(EngineError::bad_parameter("method", "is required")),
            };
            PatchEdit::Split { patch: patch_name(&split.patch)?, method }
        }
        Edit::Merge(merge) => PatchEdit::Merge { patches: names(&merge.patches)? },
        Edit::Reassign(v1::StoredReassign { faces, from, to }) => PatchEdit::Reassign { faces, from: names(&from)?, to: patch_name(&to)? },
    })
}

/// A part as it was read.
#[derive(Debug)]
pub(crate) struct ReadPart {
    /// The changes of inputs that it stands for.
    pub(crate) changes: Vec<Change>,
    /// The numbers of the mesh, for a mesh.
    pub(crate) mesh: Option<v1::MeshSummary>,
}

/// Reads a part. Files must be among the blobs of the engine.
///
/// # Errors
/// [`Reason::SessionUnreadable`] for bytes that are no part; of the engine for values that it does not take.
pub(crate) fn read_part(engine: &Engine, bytes: &[u8]) -> Result<ReadPart> {
    let unreadable = |what: String| EngineError::new(Reason::SessionUnreadable, what);
    let stored = v1::StoredPart::decode(bytes).map_err(|error| unreadable(format!("a part cannot be decoded: {error}")))?;
    let part = stored.part.ok_or_else(|| unreadable("a part is of a kind that this version does not know".to_owned()))?;
    let mut summary = None;
    let changes = match part {
        Part::Mesh(mesh) => {
            summary = mesh.summary;
            let options = sources::import_options(engine, mesh.options)?;
            vec![Change::Mesh { source: sources::stored_source(engine, mesh.source)?, options }]
        }
        Part::Features(spec) => vec![Change::Features(from_proto::features(engine, &spec)?)],
        Part::Partition(spec) => vec![Change::Partition(from_proto::partition(&spec)?)],
        Part::Charts(spec) => vec![Change::Chart(from_proto::charts(&spec)?)],
        Part::PatchCharts(list) => {
            let one = |stored: v1::StoredPatchChart| -> Result<Change> {
                let spec = charts::spec(&required(stored.spec, "spec")?)?;
                Ok(Change::PatchChart { patch: patch_name(&stored.patch)?, spec: Some(spec) })
            };
            list.charts.into_iter().map(one).collect::<Result<_>>()?
        }
        Part::PatchEdit(edit) => vec![Change::PatchEdit(edit_of(edit)?)],
        Part::Size(spec) => vec![Change::Size(sizes::size(engine, &spec)?)],
        Part::Lock(spec) => vec![Change::Lock(sizes::lock(engine, &spec)?)],
        Part::Mesher(spec) => vec![match meshers::change(engine, &spec)? {
            Change::Anisotropic(_) => Change::Mesher(Mesher::Anisotropic),
            change => change,
        }],
        Part::Metric(spec) => vec![Change::Anisotropic(metric::from_wire(engine, &spec)?)],
        Part::Optimize(spec) => vec![Change::Optimize(from_proto::optimize(&spec)?)],
    };
    Ok(ReadPart { changes, mesh: summary })
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::engine::EngineConfig;
    use remesh_engine::features::{CompoundSpec, FeatureSpec, RegionBorders};
    use remesh_engine::import::ImportOptions;
    use remesh_engine::lock::LockSpec;
    use remesh_engine::mesh::{LengthUnit, Region, SurfaceMesh};
    use remesh_engine::metric::{MetricSource, MetricSpec};
    use remesh_engine::optimize::{OptimizeSpec, SurfaceFit};
    use remesh_engine::parametrize::{ChartMethod, ChartSpec, Pin, Pins};
    use remesh_engine::partition::{BorderSmoothing, PartitionSpec, PartitionStrategy, Plane};
    use remesh_engine::planar::QuadKind;
    use remesh_engine::sample::{SampleKind, SampleSpec};
    use remesh_engine::session::Revision;
    use remesh_engine::sizing::{
        Centerline, CenterlineMeasure, CenterlineSize, ComposedSize, DistanceSize, DistanceSource, SizeBase, SizeFieldSpec, SizeSpec,
    };
    use std::collections::HashMap;

    const PATCH: Fingerprint = Fingerprint([7; 16]);

    fn triangle() -> SurfaceMesh {
        SurfaceMesh {
            positions: vec![[0.0, -0.0, 1e-300], [1.0, 0.0, 0.1], [0.0, 1.0, f64::MAX]],
            triangles: vec![[0, 1, 2]],
            face_region: vec![1],
            regions: vec![Region { id: -3, name: "a".into() }, Region { id: 9, name: String::new() }],
            unit: LengthUnit::Inch,
        }
    }

    fn composed() -> SizeSpec {
        let line = Centerline { points: vec![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], radii: vec![0.5, 0.25] };
        let distance = |from| SizeFieldSpec::Distance(DistanceSize { from, size: 0.5, reach: 1.0, growth_rate: None });
        let lines = vec![vec![[0.0; 3], [1.0; 3]], vec![[2.0; 3], [3.0; 3], [4.0; 3]]];
        SizeSpec::Composed(ComposedSize {
            base: SizeBase::Triangles(99),
            fields: vec![
                SizeFieldSpec::PerVertex { sizes: Arc::new(vec![1.0, 2.0, 0.1]) },
                SizeFieldSpec::Centerline(CenterlineSize {
                    lines: Some(Arc::new(vec![line])),
                    measure: CenterlineMeasure::Distance,
                    elements_around: 12.0,
                }),
                distance(DistanceSource::Points(Arc::new(vec![[0.1, 0.2, 0.3]]))),
                distance(DistanceSource::Polylines(Arc::new(lines))),
                SizeFieldSpec::Patch { patch: PATCH, size: 0.5 },
            ],
            min_size: Some(0.01),
            max_size: Some(3.0),
            growth_rate: Some(1.3),
        })
    }

    /// Every kind of change, with nothing at its default.
    fn changes(engine: &Engine) -> Vec<Change> {
        let blob = engine.put_blob(b"a file".to_vec()).expect("blob");
        let options = ImportOptions {
            weld_tolerance: 1e-5,
            only_regions: vec!["a".into()],
            max_faces: engine.config.max_faces,
            ..Default::default()
        };
        let sample = SampleSpec { kind: SampleKind::Brake, triangles: 77, genus: Some(4), outlets: None, aspect_ratio: None };
        let mesh = |source| Change::Mesh { source, options: options.clone() };
        let plane = Plane { point: [1.0, 2.0, 3.0], normal: [0.0, 0.5, 0.0] };
        let pins = Pins::Given(vec![Pin { vertex: 4, target: Some([0.1, 0.2]) }, Pin { vertex: 0, target: Some([1.0, 0.0]) }]);
        let pinned = ChartSpec { pins, ..ChartSpec::only(ChartMethod::LeastSquaresConformal) };
        let metric = MetricSpec {
            source: MetricSource::PerVertex { tensors: Arc::new(vec![[1.0, 0.0, 0.0, 2.0, 0.0, 3.0]]) },
            min_size: Some(0.1),
            growth_rate: None,
            ..MetricSpec::default()
        };
        vec![
            mesh(MeshSource::File(blob)),
            mesh(MeshSource::from_arrays(triangle())),
            mesh(MeshSource::Sample(sample)),
            Change::Features(FeatureSpec {
                feature_angle_deg: None,
                min_chain_share: 0.5,
                region_borders: RegionBorders::Ignore,
                explicit_edges: vec![[0, 1], [5, 2]],
                compounds: CompoundSpec { lists: vec![vec![5, -1]], merge_angle_deg: Some(20.0), merge_below_size: None },
            }),
            Change::Partition(PartitionSpec {
                patches: Some(3),
                strategy: PartitionStrategy::Plane { plane: Some(plane) },
                borders: BorderSmoothing::Vote,
                ..PartitionSpec::default()
            }),
            Change::Chart(ChartSpec::only(ChartMethod::Harmonic)),
            Change::PatchChart { patch: PATCH, spec: Some(pinned) },
            Change::PatchEdit(PatchEdit::Split { patch: PATCH, method: SplitMethod::Plane(plane) }),
            Change::PatchEdit(PatchEdit::Split { patch: PATCH, method: SplitMethod::Laplace }),
            Change::PatchEdit(PatchEdit::Merge { patches: vec![PATCH, Fingerprint([1; 16])] }),
            Change::PatchEdit(PatchEdit::Reassign { faces: vec![3, 1, 2], from: vec![PATCH], to: Fingerprint([2; 16]) }),
            Change::Size(SizeSpec::PerVertex { sizes: vec![1.0, 0.1 + 0.2], min_size: None, max_size: Some(2.0), growth_rate: None }),
            Change::Size(composed()),
            Change::Lock(LockSpec::Loops(vec![4, 2])),
            Change::Mesher(Mesher::Quads(QuadKind::All)),
            Change::Anisotropic(metric),
            Change::Mesher(Mesher::Delaunay { min_angle_deg: 21.5 }),
            Change::Optimize(OptimizeSpec { rounds: 3, min_kappa: 0.25, fit: SurfaceFit::Vertices }),
            Change::PatchChart { patch: PATCH, spec: None },
            Change::ResetPatchEdits,
        ]
    }

    fn read_back(engine: &Engine, named: &Parts, kept: &HashMap<PartId, Vec<u8>>) -> Snapshot {
        let parts: Vec<ReadPart> = named.ids().map(|id| read_part(engine, &kept[&id]).expect("reads")).collect();
        Snapshot::of_changes(named.snapshot.revision, parts.iter().flat_map(|part| &part.changes)).expect("applies")
    }

    #[test]
    fn every_input_comes_back_to_the_last_bit() {
        let engine = Engine::new(EngineConfig::default());
        let changes = changes(&engine);
        let mut kept = HashMap::new();
        let mut former: Option<Parts> = None;
        for count in 0..=changes.len() {
            let snapshot = Arc::new(Snapshot::of_changes(Revision(count as u64), &changes[..count]).expect("applies"));
            let (named, fresh) = parts(&snapshot, None, former.as_ref()).expect("parts");
            kept.extend(fresh);
            let (whole, all) = parts(&snapshot, None, None).expect("parts");
            assert!(whole.ids().eq(named.ids()), "what is taken over from the former revision is what would be written: {count}");
            assert!(all.iter().all(|(id, bytes)| kept.get(id) == Some(bytes)));
            // Blobs tell no contents, but their digest is all there is to them.
            assert_eq!(format!("{:?}", read_back(&engine, &named, &kept)), format!("{snapshot:?}"));
            former = Some(named);
        }
    }

    #[test]
    fn what_is_no_part_is_told() {
        let engine = Engine::new(EngineConfig::default());
        let part = |part| v1::StoredPart { part: Some(part) }.encode_to_vec();
        let missing = v1::StoredMesh { source: Some(v1::stored_mesh::Source::Blob("00".repeat(32))), ..Default::default() };
        let nameless =
            v1::StoredPatchEdit { edit: Some(v1::stored_patch_edit::Edit::Merge(v1::StoredMerge { patches: vec![vec![1].into()] })) };
        let cases = [
            (vec![0xff; 9], Reason::SessionUnreadable),
            (Vec::new(), Reason::SessionUnreadable),
            (part(Part::Mesh(missing)), Reason::BlobNotFound),
            (part(Part::PatchEdit(nameless)), Reason::BadParameter),
            (part(Part::PatchEdit(v1::StoredPatchEdit::default())), Reason::BadParameter),
        ];
        for (bytes, reason) in cases {
            assert_eq!(read_part(&engine, &bytes).expect_err("refused").reason(), reason);
        }
    }
}
