//! A session as an editor holds it: every edit is made for the revision that was seen last, so that edits of others are noticed.

use crate::charts::ChartEdit;
use crate::connection::Client;
use crate::error::Result;
use crate::history::SessionEvents;
use crate::transfer::Source;
use remesh_proto::v1;
use v1::split_patch_request::How;
use v1::watch_session_request::Start;

/// A session and the revision that its holder has seen. An edit by somebody else in between makes the next edit fail with
/// `STALE_REVISION`; [`EditingSession::refresh`] takes note of it.
#[derive(Debug, Clone)]
pub struct EditingSession {
    client: Client,
    name: String,
    revision: u64,
}

impl EditingSession {
    /// A new session. Errors are those of [`Client::create_session`].
    ///
    /// # Errors
    /// `LIMIT_REACHED`.
    pub async fn create(client: &Client, display_name: &str) -> Result<Self> {
        let made = client.create_session(display_name, None).await?;
        Ok(EditingSession { client: client.clone(), name: made.name, revision: made.revision })
    }

    /// A session that is there already, at its current revision.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`, `SESSION_EXPIRED`.
    pub async fn open(client: &Client, name: &str) -> Result<Self> {
        let found = client.get_session(name).await?;
        Ok(EditingSession { client: client.clone(), name: found.name, revision: found.revision })
    }

    /// `sessions/{id}`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The revision that the next edit is made for.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The client, for calls that edit nothing.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// Takes note of the edits of others and tells the session as it is now.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`, `SESSION_EXPIRED`.
    pub async fn refresh(&mut self) -> Result<v1::Session> {
        let session = self.client.get_session(&self.name).await?;
        self.revision = session.revision;
        Ok(session)
    }

    /// Replaces the surface.
    ///
    /// # Errors
    /// Those of [`Client::import`], `STALE_REVISION`.
    pub async fn import(&mut self, source: Source, options: v1::ImportOptions) -> Result<v1::ImportMeshResponse> {
        let answer = self.client.import_at(&self.name, source, options, Some(self.revision)).await?;
        self.revision = answer.revision;
        Ok(answer)
    }

    /// Changes one input.
    ///
    /// # Errors
    /// Those of [`Client::apply`].
    pub async fn apply(&mut self, change: v1::change::Change) -> Result<u64> {
        self.revision = self.client.apply(&self.name, change, Some(self.revision)).await?;
        Ok(self.revision)
    }

    /// Takes the inputs of an earlier revision.
    ///
    /// # Errors
    /// Those of [`Client::rollback`], `STALE_REVISION`.
    pub async fn rollback(&mut self, to_revision: u64) -> Result<u64> {
        self.apply(v1::change::Change::Rollback(v1::Rollback { to_revision })).await
    }

    /// Takes the last change back.
    ///
    /// # Errors
    /// Those of [`Client::undo`].
    pub async fn undo(&mut self) -> Result<u64> {
        self.revision = self.client.undo(&self.name, Some(self.revision)).await?.revision;
        Ok(self.revision)
    }

    /// Takes the last undo back.
    ///
    /// # Errors
    /// Those of [`Client::redo`].
    pub async fn redo(&mut self) -> Result<u64> {
        self.revision = self.client.redo(&self.name, Some(self.revision)).await?.revision;
        Ok(self.revision)
    }

    /// Cuts a patch in two.
    ///
    /// # Errors
    /// Those of [`Client::split_patch`].
    pub async fn split_patch(&mut self, patch: u32, how: Option<How>) -> Result<v1::SplitPatchResponse> {
        let answer = self.client.split_patch(&self.name, patch, how, Some(self.revision)).await?;
        self.revision = answer.revision;
        Ok(answer)
    }

    /// Makes one patch of several.
    ///
    /// # Errors
    /// Those of [`Client::merge_patches`].
    pub async fn merge_patches(&mut self, patches: &[u32]) -> Result<v1::MergePatchesResponse> {
        let answer = self.client.merge_patches(&self.name, patches, Some(self.revision)).await?;
        self.revision = answer.revision;
        Ok(answer)
    }

    /// Moves faces to a patch.
    ///
    /// # Errors
    /// Those of [`Client::reassign_faces`].
    pub async fn reassign_faces(&mut self, faces: &[u32], patch: u32) -> Result<v1::ReassignFacesResponse> {
        let answer = self.client.reassign_faces(&self.name, faces, patch, Some(self.revision)).await?;
        self.revision = answer.revision;
        Ok(answer)
    }

    /// Takes all edits of patches back.
    ///
    /// # Errors
    /// Those of [`Client::reset_patches`].
    pub async fn reset_patches(&mut self) -> Result<u64> {
        self.revision = self.client.reset_patches(&self.name, Some(self.revision)).await?.revision;
        Ok(self.revision)
    }

    /// Gives a patch a chart spec of its own, or changes it.
    ///
    /// # Errors
    /// Those of [`Client::update_patch_chart`].
    pub async fn update_patch_chart(&mut self, patch: u32, edit: ChartEdit) -> Result<v1::UpdatePatchChartResponse> {
        let answer = self.client.update_patch_chart(&self.name, patch, edit, Some(self.revision)).await?;
        self.revision = answer.revision;
        Ok(answer)
    }

    /// Takes the own chart spec of a patch back.
    ///
    /// # Errors
    /// Those of [`Client::reset_patch_chart`].
    pub async fn reset_patch_chart(&mut self, patch: u32) -> Result<u64> {
        self.revision = self.client.reset_patch_chart(&self.name, patch, Some(self.revision)).await?.revision;
        Ok(self.revision)
    }

    /// The events of the session after the revision that was seen last.
    ///
    /// # Errors
    /// Those of [`Client::watch`].
    pub async fn watch(&self) -> Result<SessionEvents> {
        self.client.watch(&self.name, Some(Start::AfterRevision(self.revision)), false).await
    }

    /// Ends the session.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`.
    pub async fn delete(self) -> Result<u64> {
        self.client.delete_session(&self.name).await
    }
}
