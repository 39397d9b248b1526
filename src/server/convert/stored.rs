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
            let one = |(patch, spec): (&Fingerprint, _)| v1::StoredPatchChart { patch: patch.0.to_vec().into(), spec: Some(charts::wire(spec)) };
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
        Edit::Reassign(v1::StoredReassign { faces, from, to }) => {
            PatchEdit::Reassign { faces, from: names(&from)?, to: patch_name(&to)? }
        }
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
