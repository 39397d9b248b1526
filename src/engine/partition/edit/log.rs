//! The edits of a session: a log that names patches by identity, and its replay on a partition.

use super::{Editor, Ground, PatchRequest, SplitMethod};
use crate::error::{EngineError, Reason, Result};
use crate::fingerprint::{Feeder, Fingerprint};
use crate::mesh::SurfaceMesh;
use crate::partition::{Partition, faces_by_patch};
use crate::work::Work;
use std::collections::BTreeMap;
use std::sync::Arc;

/// An edit of patches, by their identities ([`crate::patch::PatchMap::identity`]): it means the same faces whatever numbers they get.
#[derive(Debug, Clone, PartialEq)]
pub enum PatchEdit {
    /// Cut a patch in two.
    Split {
        /// The patch.
        patch: Fingerprint,
        /// How.
        method: SplitMethod,
    },
    /// Make one patch of several.
    Merge {
        /// The patches.
        patches: Vec<Fingerprint>,
    },
    /// Move faces to a patch.
    Reassign {
        /// The faces that leave their patches.
        faces: Vec<u32>,
        /// The patches that they leave.
        from: Vec<Fingerprint>,
        /// The patch that gets them.
        to: Fingerprint,
    },
}

impl PatchEdit {
    /// The patches that it needs.
    pub fn patches(&self) -> Vec<Fingerprint> {
        match self {
            PatchEdit::Split { patch, .. } => vec![*patch],
            PatchEdit::Merge { patches } => patches.clone(),
            PatchEdit::Reassign { from, to, .. } => from.iter().chain([to]).copied().collect(),
        }
    }

    /// Faces that it lists.
    pub fn listed_faces(&self) -> usize {
        match self {
            PatchEdit::Reassign { faces, .. } => faces.len(),
            PatchEdit::Split { .. } | PatchEdit::Merge { .. } => 0,
        }
    }

    /// One word for what it does.
    pub fn verb(&self) -> &'static str {
        match self {
            PatchEdit::Split { .. } => "split",
            PatchEdit::Merge { .. } => "merge",
            PatchEdit::Reassign { .. } => "reassign",
        }
    }

    /// Feeds it into the key of what depends on it.
    pub fn feed(&self, into: &mut Feeder) {
        into.text(self.verb());
        self.patches().into_iter().for_each(|p| {
            into.fingerprint(p);
        });
        match self {
            PatchEdit::Split { method, .. } => into.text(&format!("{method:?}")),
            PatchEdit::Merge { .. } => into,
            PatchEdit::Reassign { faces, .. } => into.u32s(faces),
        };
    }
}

/// What became of an edit.
#[derive(Debug, Clone, PartialEq)]
pub enum EditState {
    /// It is in the partition.
    Applied,
    /// It is not: a patch of it is not there, or the edit is not valid under the present features and limits. Why, one sentence.
    Waiting(String),
}

/// Identity of each patch of a partition, as [`crate::patch::PatchMap::identity`]. O(F).
pub fn patch_identities(mesh: &SurfaceMesh, partition: &Partition) -> Vec<Fingerprint> {
    faces_by_patch(&partition.face_patch).iter().map(|faces| identity(mesh, faces)).collect()
}

fn identity(mesh: &SurfaceMesh, faces: &[u32]) -> Fingerprint {
    let triples: Vec<[u32; 3]> = faces.iter().map(|&f| mesh.triangles[f as usize]).collect();
    let mut feeder = Feeder::new();
    feeder.tuples(&triples);
    feeder.finish()
}

/// The edit that a request means in a partition. Faces that are where they should be already are left out.
///
/// # Errors
/// [`Reason::PatchNotFound`]; [`Reason::BadParameter`] for a face that is not there.
pub fn name_edit(partition: &Partition, identities: &[Fingerprint], request: &PatchRequest) -> Result<PatchEdit> {
    let name = |p: u32| {
        let count = identities.len();
        identities.get(p as usize).copied().ok_or_else(|| {
            EngineError::new(Reason::PatchNotFound, format!("there is no patch {p}; the surface has {count}"))
                .with_metadata("patch", p)
                .with_metadata("patches", count)
        })
    };
    Ok(match request {
        PatchRequest::Split { patch, method } => PatchEdit::Split { patch: name(*patch)?, method: *method },
        PatchRequest::Merge { patches } => {
            let mut patches = patches.iter().map(|&p| name(p)).collect::<Result<Vec<_>>>()?;
            patches.sort_unstable();
            PatchEdit::Merge { patches }
        }
        PatchRequest::Reassign { faces, to } => {
            let label = &partition.face_patch;
            if let Some(unknown) = faces.iter().find(|&&f| f as usize >= label.len()) {
                return Err(EngineError::bad_parameter("faces", format!("there is no face {unknown}; the mesh has {}", label.len())));
            }
            let target = name(*to)?;
            let mut faces: Vec<u32> = faces.iter().copied().filter(|&f| label[f as usize] != *to).collect();
            faces.sort_unstable();
            faces.dedup();
            let mut from: Vec<u32> = faces.iter().map(|&f| label[f as usize]).collect();
            from.sort_unstable();
            from.dedup();
            let from = from.into_iter().map(name).collect::<Result<_>>()?;
            PatchEdit::Reassign { faces, from, to: target }
        }
    })
}

/// Carries out a log, in its order, as far as that goes before patches may have to be split for want of a chart; what became of the
/// edits is told in [`Partition::edits`]. At least one edit is looked at. An edit whose patches are not there waits if nothing has been
/// edited before it in this call; otherwise the call ends before it, since the splits of the patches made so far may be what it needs.
/// An edit that is not valid waits. O(F + faces of edited patches).
///
/// # Errors
/// Cancellation and broken invariants only.
pub fn apply_edits(
    ground: Ground<'_>,
    partition: &Partition,
    edits: &[Arc<PatchEdit>],
    max_aspect_ratio: f64,
    work: &Work<'_>,
) -> Result<Partition> {
    let surface = ground.surface(partition)?;
    let mut editor = Editor::new(ground, &surface, partition, max_aspect_ratio);
    let identities = patch_identities(ground.mesh, partition);
    let mut known: BTreeMap<Fingerprint, u32> = identities.into_iter().zip(0..).collect();
    let mut states = Vec::new();
    let mut changed = false;
    for edit in edits {
        work.step(states.len(), edits.len())?;
        let Some(request) = request_of(edit, &known) else {
            if changed {
                break;
            }
            let missing = edit.patches().iter().filter(|p| !known.contains_key(p)).count();
            states.push(EditState::Waiting(format!("{missing} of the patches it edits are not in the partition")));
            continue;
        };
        match editor.edit(&request, work) {
            Ok(made) => {
                for gone in edit.patches() {
                    known.remove(&gone);
                }
                for p in made {
                    known.insert(identity(ground.mesh, &editor.faces[p as usize]), p);
                }
                states.push(EditState::Applied);
                changed = true;
            }
            Err(error) if error.stops_work() => return Err(error),
            Err(error) => states.push(EditState::Waiting(error.message().to_owned())),
        }
    }
    let after = if changed { editor.finish(partition, work)? } else { partition.clone() };
    Ok(Partition { edits: states, ..after })
}

/// The edit by the numbers of patches, if they are all there and hold the faces that they should.
fn request_of(edit: &PatchEdit, known: &BTreeMap<Fingerprint, u32>) -> Option<PatchRequest> {
    let number = |p: &Fingerprint| known.get(p).copied();
    Some(match edit {
        PatchEdit::Split { patch, method } => PatchRequest::Split { patch: number(patch)?, method: *method },
        PatchEdit::Merge { patches } => PatchRequest::Merge { patches: patches.iter().map(number).collect::<Option<_>>()? },
        PatchEdit::Reassign { faces, from, to } => {
            from.iter().map(number).collect::<Option<Vec<_>>>()?;
            PatchRequest::Reassign { faces: faces.clone(), to: number(to)? }
        }
    })
}
