//! Sessions: the inputs of a remeshing job, their revisions and immutable snapshots. A session holds inputs only; all else is
//! derived and can be dropped and recomputed bit for bit.

mod blob;
mod history;
mod past;

pub use blob::{Blob, ReadBlob};
pub use history::{Edit, Pending, Steps};
pub use past::Past;

use crate::error::{EngineError, Reason, Result};
use crate::features::FeatureSpec;
use crate::fingerprint::{Contents, Feeder, Fingerprint};
use crate::import::ImportOptions;
use crate::lock::LockSpec;
use crate::mesh::SurfaceMesh;
use crate::metric::MetricSpec;
use crate::optimize::OptimizeSpec;
use crate::parametrize::ChartSpec;
use crate::partition::{PartitionSpec, PatchEdit};
use crate::planar::Mesher;
use crate::sample::SampleSpec;
use crate::sizing::SizeSpec;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, SystemTime};

/// Number of a state of a session; 0 is the empty session, every change makes the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Revision(pub u64);

/// Where the surface of a session comes from.
#[derive(Debug, Clone)]
pub enum MeshSource {
    /// A file.
    File(Arc<Blob>),
    /// Arrays of a client.
    Arrays {
        /// The arrays, checked by [`SurfaceMesh::validate`] on import.
        mesh: Arc<SurfaceMesh>,
        /// Their fingerprint.
        fingerprint: Fingerprint,
    },
    /// A generated sample.
    Sample(SampleSpec),
}

impl MeshSource {
    /// A source from arrays.
    pub fn from_arrays(mesh: SurfaceMesh) -> Self {
        MeshSource::Arrays { fingerprint: mesh.fingerprint(), mesh: Arc::new(mesh) }
    }

    /// Bytes held by the source.
    pub fn bytes(&self) -> usize {
        match self {
            MeshSource::File(blob) => blob.len(),
            MeshSource::Arrays { mesh, .. } => mesh.bytes(),
            MeshSource::Sample(_) => std::mem::size_of::<SampleSpec>(),
        }
    }

    /// Feeds the identity of the contents.
    pub fn feed(&self, into: &mut Feeder) {
        match self {
            MeshSource::File(blob) => into.u64(0).text(&blob.digest),
            MeshSource::Arrays { fingerprint, .. } => into.u64(1).fingerprint(*fingerprint),
            MeshSource::Sample(spec) => into.u64(2).text(&format!("{spec:?}")),
        };
    }
}

/// All inputs of a session at one revision. Immutable; results of different revisions never mix.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// Which state this is.
    pub revision: Revision,
    /// The surface, once there is one.
    pub source: Option<MeshSource>,
    /// How it is read.
    pub import: ImportOptions,
    /// Which edges are features.
    pub features: FeatureSpec,
    /// How it is partitioned.
    pub partition: PartitionSpec,
    /// Which charts are wanted of patches without a spec of their own.
    pub chart: ChartSpec,
    /// Specs of single patches, by [`crate::patch::PatchMap::identity`]: a spec stays with its patch whatever number it gets, and
    /// waits for it if an edit of the partition takes it away.
    pub patch_charts: Arc<BTreeMap<Fingerprint, ChartSpec>>,
    /// Edits of single patches, in the order they were made. They are of the patches that have charts, after all splits. An edit whose
    /// patches another specification takes away waits for them.
    pub patch_edits: Arc<Vec<Arc<PatchEdit>>>,
    /// Which sizes are wanted; `None` until set: sizes are never guessed.
    pub size: Option<SizeSpec>,
    /// Which boundary vertices stay.
    pub lock: LockSpec,
    /// The planar mesher.
    pub mesher: Mesher,
    /// What the anisotropic mesher follows; other meshers do not look at it.
    pub metric: Arc<MetricSpec>,
    /// How far to optimise.
    pub optimize: OptimizeSpec,
}

impl Snapshot {
    /// No surface, and defaults of all else.
    fn empty() -> Self {
        Snapshot {
            revision: Revision(0),
            source: None,
            import: ImportOptions::default(),
            features: FeatureSpec::default(),
            partition: PartitionSpec::default(),
            chart: ChartSpec::default(),
            patch_charts: Arc::default(),
            patch_edits: Arc::default(),
            size: None,
            lock: LockSpec::default(),
            mesher: Mesher::default(),
            metric: Arc::default(),
            optimize: OptimizeSpec::default(),
        }
    }

    /// The same inputs with one more edit of patches. Of the same revision: for looking at what would be.
    ///
    /// # Errors
    /// [`Reason::LimitReached`] for more than [`MAX_PATCH_EDITS`] edits or [`MAX_EDITED_FACES`] listed faces.
    pub fn with_patch_edit(&self, edit: PatchEdit) -> Result<Snapshot> {
        let mut next = self.clone();
        add_patch_edit(&mut next, edit)?;
        Ok(next)
    }

    /// Applies changes in order; `kept` gives the inputs of earlier revisions.
    fn change(&mut self, changes: &[Change], kept: impl Fn(Revision) -> Result<Arc<Snapshot>>) -> Result<()> {
        for change in changes {
            match change {
                Change::Mesh { source, options } => (self.source, self.import) = (Some(source.clone()), options.clone()),
                Change::Features(spec) => self.features = spec.clone(),
                Change::Partition(spec) => self.partition = spec.clone(),
                Change::Chart(spec) => self.chart = session_wide(spec)?,
                Change::PatchChart { patch, spec } => set_patch_chart(self, *patch, spec.as_ref())?,
                Change::PatchEdit(edit) => add_patch_edit(self, edit.clone())?,
                Change::ResetPatchEdits => self.patch_edits = Arc::default(),
                Change::Size(spec) => {
                    spec.validate()?;
                    self.size = Some(spec.clone());
                }
                Change::Lock(spec) => self.lock = spec.clone(),
                Change::Mesher(mesher) => {
                    mesher.validate()?;
                    self.mesher = *mesher;
                }
                Change::Anisotropic(spec) => {
                    spec.validate()?;
                    (self.mesher, self.metric) = (Mesher::Anisotropic, Arc::new(spec.clone()));
                }
                Change::Optimize(spec) => self.optimize = spec.clone(),
                Change::Rollback(revision) => *self = Snapshot::clone(&*kept(*revision)?),
            }
        }
        Ok(())
    }
}

/// One edit of a session's inputs.
#[derive(Debug, Clone)]
pub enum Change {
    /// Replace the surface and how it is read. All other inputs stay.
    Mesh {
        /// The surface.
        source: MeshSource,
        /// How to read it.
        options: ImportOptions,
    },
    /// Replace the feature specification.
    Features(FeatureSpec),
    /// Replace the partition specification.
    Partition(PartitionSpec),
    /// Replace the chart specification of patches without one of their own.
    Chart(ChartSpec),
    /// Replace the chart specification of one patch; `None` takes it back.
    PatchChart {
        /// [`crate::patch::PatchMap::identity`] of the patch.
        patch: Fingerprint,
        /// The specification, with vertices of the imported mesh.
        spec: Option<ChartSpec>,
    },
    /// Edit patches, after all edits made before.
    PatchEdit(PatchEdit),
    /// Take all edits of patches back.
    ResetPatchEdits,
    /// Replace the size specification.
    Size(SizeSpec),
    /// Replace which boundary vertices stay.
    Lock(LockSpec),
    /// Replace the planar mesher.
    Mesher(Mesher),
    /// Take the anisotropic mesher, with what it follows.
    Anisotropic(MetricSpec),
    /// Replace the optimisation specification.
    Optimize(OptimizeSpec),
    /// Take all inputs of an earlier revision that is still kept (undo).
    Rollback(Revision),
}

/// How many past revisions a session keeps for rollback.
pub const KEPT_REVISIONS: usize = 64;

/// Most patches of a session with a chart specification of their own.
pub const MAX_PATCH_CHARTS: usize = 4096;

/// Most edits of patches in a session.
pub const MAX_PATCH_EDITS: usize = 256;

/// Most faces that the edits of a session list together.
pub const MAX_EDITED_FACES: usize = 1 << 20;

fn add_patch_edit(next: &mut Snapshot, edit: PatchEdit) -> Result<()> {
    let edits = Arc::make_mut(&mut next.patch_edits);
    edits.push(Arc::new(edit));
    let faces: usize = edits.iter().map(|e| e.listed_faces()).sum();
    let message = if edits.len() > MAX_PATCH_EDITS {
        format!("the session has {MAX_PATCH_EDITS} edits of patches already")
    } else if faces > MAX_EDITED_FACES {
        format!("the edits of patches list {faces} faces together; at most {MAX_EDITED_FACES} are kept")
    } else {
        return Ok(());
    };
    Err(EngineError::new(Reason::LimitReached, message).with_hint("take the edits back, or partition in another way"))
}

fn session_wide(spec: &ChartSpec) -> Result<ChartSpec> {
    spec.validate()?;
    if spec.names_vertices() {
        return Err(EngineError::bad_parameter("charts", "the specification names vertices, which are of one patch")
            .with_hint("set it for that patch"));
    }
    Ok(spec.clone())
}

fn set_patch_chart(next: &mut Snapshot, patch: Fingerprint, spec: Option<&ChartSpec>) -> Result<()> {
    let charts = Arc::make_mut(&mut next.patch_charts);
    match spec {
        None => charts.remove(&patch),
        Some(spec) => {
            spec.validate()?;
            charts.insert(patch, spec.clone())
        }
    };
    if charts.len() > MAX_PATCH_CHARTS {
        let message = format!("more than {MAX_PATCH_CHARTS} patches have a chart specification of their own");
        return Err(EngineError::new(Reason::LimitReached, message).with_hint("set the method for all patches instead"));
    }
    Ok(())
}

struct State {
    /// Kept snapshots, oldest first; the last is the current one. Never empty.
    history: VecDeque<Arc<Snapshot>>,
    /// Where undo and redo lead.
    steps: history::Stacks,
    ttl: Duration,
    last_used: SystemTime,
}

/// A session: one writer ([`Session::apply`]), any number of readers with snapshots.
pub struct Session {
    /// Unguessable name.
    pub id: String,
    /// When it was made.
    pub created: SystemTime,
    /// Held while a revision is made; readers do not wait for it.
    writer: Mutex<()>,
    state: Mutex<State>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("created", &self.created).field("revision", &self.revision()).finish_non_exhaustive()
    }
}

impl Session {
    /// An empty session; lives for `ttl` after its last use.
    pub fn new(id: String, ttl: Duration, now: SystemTime) -> Self {
        let history = VecDeque::from([Arc::new(Snapshot::empty())]);
        let state = State { history, steps: history::Stacks::default(), ttl, last_used: now };
        Session { id, created: now, writer: Mutex::default(), state: Mutex::new(state) }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// The current inputs.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        self.lock().history.back().expect("history is never empty").clone()
    }

    /// The current revision.
    pub fn revision(&self) -> Revision {
        self.snapshot().revision
    }

    /// Oldest revision that a rollback can name.
    pub fn oldest_revision(&self) -> Revision {
        self.lock().history.front().expect("history is never empty").revision
    }

    /// Applies changes, all or none, and gives the new revision. With `base`, only if that is still the current one.
    /// O(1): nothing is computed here; a change that cannot be carried out shows when results are asked for.
    ///
    /// # Errors
    /// [`Reason::StaleRevision`] with the current revision as metadata; [`Reason::BadParameter`] for an unknown rollback revision or a
    /// chart specification that contradicts itself; [`Reason::LimitReached`] for more than [`MAX_PATCH_CHARTS`] or [`MAX_PATCH_EDITS`].
    pub fn apply(&self, base: Option<Revision>, changes: &[Change]) -> Result<Revision> {
        self.edit(base, Edit::Changes(changes), |_| Ok(()), |_| ())
    }

    fn changed(state: &State, current: &Snapshot, changes: &[Change]) -> Result<Snapshot> {
        let mut next = Snapshot::clone(current);
        let oldest = state.history.front().map_or(0, |s| s.revision.0);
        next.change(changes, |revision| {
            let kept = state.history.iter().find(|s| s.revision == revision);
            kept.cloned().ok_or_else(|| {
                let message = if revision > current.revision {
                    format!("there is no revision {} yet; the session is at {}", revision.0, current.revision.0)
                } else {
                    format!("revision {} is not kept; the oldest kept is {oldest}", revision.0)
                };
                EngineError::bad_parameter("rollback", message)
            })
        })?;
        Ok(next)
    }

    /// Marks the session as used.
    pub fn touch(&self, now: SystemTime) {
        let mut state = self.lock();
        state.last_used = state.last_used.max(now);
    }

    /// Sets how long it lives after its last use.
    pub fn set_ttl(&self, ttl: Duration) {
        self.lock().ttl = ttl;
    }

    /// How long it lives after its last use.
    pub fn ttl(&self) -> Duration {
        self.lock().ttl
    }

    /// When it expires if nobody uses it.
    pub fn expires(&self) -> SystemTime {
        let state = self.lock();
        state.last_used.checked_add(state.ttl).unwrap_or(state.last_used)
    }

    /// Bytes of the inputs of all kept revisions; a source shared by several counts once.
    pub fn bytes(&self) -> usize {
        let state = self.lock();
        let mut seen: Vec<Fingerprint> = Vec::new();
        let mut total = 0;
        for source in state.history.iter().chain(state.steps.all()).filter_map(|s| s.source.as_ref()) {
            let mut feeder = Feeder::new();
            source.feed(&mut feeder);
            let fingerprint = feeder.finish();
            if !seen.contains(&fingerprint) {
                seen.push(fingerprint);
                total += source.bytes();
            }
        }
        // Revisions share edits; the longest log is about all of them.
        let edits = state.history.iter().map(|s| s.patch_edits.iter().map(|e| 4 * e.listed_faces() + 256).sum::<usize>()).max();
        total + edits.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session() -> Session {
        Session::new("s".into(), Duration::from_secs(60), SystemTime::UNIX_EPOCH)
    }

    #[test]
    fn one_writer_wins_and_the_other_is_told() {
        let session = session();
        let first = session.apply(Some(Revision(0)), &[Change::Size(SizeSpec::Uniform { size: 1.0 })]).unwrap();
        assert_eq!(first, Revision(1));
        let stale = session.apply(Some(Revision(0)), &[Change::Size(SizeSpec::Uniform { size: 2.0 })]).unwrap_err();
        assert_eq!(stale.reason(), Reason::StaleRevision);
        assert!(stale.metadata().contains(&("current_revision".to_owned(), "1".to_owned())));
    }

    #[test]
    fn snapshots_do_not_change_and_rollback_restores() {
        let session = session();
        let one = session.apply(None, &[Change::Size(SizeSpec::Uniform { size: 1.0 })]).unwrap();
        let held = session.snapshot();
        session.apply(None, &[Change::Size(SizeSpec::Uniform { size: 2.0 })]).unwrap();
        assert_eq!(held.size, Some(SizeSpec::Uniform { size: 1.0 }));
        let back = session.apply(None, &[Change::Rollback(one)]).unwrap();
        assert_eq!((back, session.snapshot().size.clone()), (Revision(3), held.size.clone()));
        assert_eq!(session.apply(None, &[Change::Rollback(Revision(99))]).unwrap_err().reason(), Reason::BadParameter);
        assert_eq!(session.revision(), Revision(3), "a refused change changes nothing");
    }

    #[test]
    fn history_is_bounded() {
        let session = session();
        for n in 0..500 {
            session.apply(None, &[Change::Size(SizeSpec::Uniform { size: f64::from(n + 1) })]).unwrap();
        }
        assert_eq!(session.oldest_revision(), Revision(500 - KEPT_REVISIONS as u64 + 1));
    }
}
