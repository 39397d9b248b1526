//! What every command works with: the connection, the terminal, and the session that is deleted when the command ends.

use super::args::{GlobalArgs, ImportArgs};
use super::failure::{Failure, Outcome};
use super::ui::Ui;
use super::{LocalOptions, StartError, files, specs};
use crate::{Client, Credentials, Source, v1};
use std::future::Future;
use std::path::Path;
use std::sync::Mutex;
use tonic::transport::Channel;

/// Files above this size get a bar while they are uploaded.
const SLOW_UPLOAD_BYTES: u64 = 8 << 20;

/// What a command works with.
#[derive(Debug)]
pub(crate) struct Context {
    pub(crate) client: Client,
    pub(crate) ui: Ui,
    /// A session of this command's own.
    temporary: Mutex<Option<String>>,
}

impl Context {
    /// Connects to the daemon, or starts a server in this process.
    pub(crate) async fn open<S, F>(global: &GlobalArgs, ui: Ui, start: S) -> Outcome<Self>
    where
        S: FnOnce(LocalOptions) -> F,
        F: Future<Output = Result<Channel, StartError>>,
    {
        let client = match (&global.endpoint, global.threads) {
            (Some(_), Some(_)) => {
                let message = "--threads is for work inside this process; a daemon has its own setting";
                return Err(Failure::Usage(message.into()));
            }
            (Some(endpoint), None) => {
                let connect = &global.connect;
                let identity = connect.tls_cert.as_deref().zip(connect.tls_key.as_deref());
                let (ca, token) = (connect.tls_ca.as_deref(), connect.token_file.as_deref());
                let credentials = Credentials::from_files(ca, identity, connect.tls_domain.as_deref(), token);
                Client::connect_with(endpoint, &credentials.map_err(Failure::Other)?).await?
            }
            (None, threads) => {
                let channel = start(LocalOptions { threads }).await;
                Client::from_channel(channel.map_err(|error| Failure::Other(format!("cannot start the server in this process: {error}")))?)
            }
        };
        Ok(Context { client, ui, temporary: Mutex::new(None) })
    }

    /// A session that ends with this command.
    pub(crate) async fn temporary_session(&self, display_name: &str) -> Outcome<String> {
        let session = self.client.create_session(display_name, None).await?;
        *self.temporary.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(session.name.clone());
        Ok(session.name)
    }

    /// Deletes the session of this command. Whether that works does not matter: it would expire.
    pub(crate) async fn close(&self) {
        let name = self.temporary.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
        if let Some(name) = name {
            let _ = self.client.delete_session(&name).await;
        }
    }

    /// Uploads a file, with a bar if that takes a while.
    pub(crate) async fn upload(&self, path: &Path) -> Outcome<String> {
        let data = files::read(path)?;
        let total = data.len() as u64;
        if total < SLOW_UPLOAD_BYTES {
            return Ok(self.client.upload(data, |_| {}).await?);
        }
        let bar = self.ui.bar("upload");
        Ok(self.client.upload(data, bar.on_sent(total)).await?)
    }

    /// Uploads and imports a file, and prints the warnings of the reader.
    pub(crate) async fn import_file(&self, session: &str, path: &Path, args: &ImportArgs) -> Outcome<v1::ImportMeshResponse> {
        let blob = self.upload(path).await?;
        let _spinner = self.ui.spinner("import");
        let response = self.client.import(session, Source::Blob(blob), specs::import_options(args)).await?;
        let warnings = response.report.iter().flat_map(|report| &report.warnings);
        warnings.for_each(|warning| self.ui.warn(&format!("{}: {warning}", files::short_name(path))));
        Ok(response)
    }

    /// The same, and refuses a surface that cannot be remeshed.
    pub(crate) async fn import_sound(&self, session: &str, path: &Path, args: &ImportArgs) -> Outcome<v1::ImportMeshResponse> {
        let response = self.import_file(session, path, args).await?;
        let diagnosis = response.diagnosis.clone().unwrap_or_default();
        if !diagnosis.remeshable {
            return Err(Failure::Refused { what: path.display().to_string(), diagnosis: Box::new(diagnosis) });
        }
        Ok(response)
    }

    /// Applies the changes that the options ask for.
    pub(crate) async fn apply_all(&self, session: &str, changes: Vec<v1::change::Change>) -> Outcome<Option<u64>> {
        let mut revision = None;
        for change in changes {
            revision = Some(self.client.apply(session, change, None).await?);
        }
        Ok(revision)
    }
}
