//! Who may call, and over what: TLS, certificates of clients, bearer tokens. All of it comes from files, which are read again when they
//! change; a file that is wrong then leaves what held before.

mod jwt;
mod names;
mod tls;
mod tokens;

pub use tokens::new_token;

use crate::caller::Caller;
use crate::status::Fault;
use jwt::JwtKeys;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::SystemTime;
pub(crate) use tls::{Pinned, TlsIncoming};
use tokens::TokenTable;
use tokio_rustls::rustls;
use tonic::Request;

/// The files that security is made of, and what JWTs must say.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SecurityFiles {
    /// Certificate chain of the server, PEM; TLS is on with it.
    pub tls_cert: Option<PathBuf>,
    /// Its private key, PEM.
    pub tls_key: Option<PathBuf>,
    /// Authorities whose certificates clients must present, PEM.
    pub tls_client_ca: Option<PathBuf>,
    /// Names and hashes of bearer tokens, see [`new_token`].
    pub tokens: Option<PathBuf>,
    /// Public keys of JWTs: a JWK set, or PEM.
    pub jwt_keys: Option<PathBuf>,
    /// What `iss` of a JWT must be.
    pub jwt_issuer: Option<String>,
    /// What `aud` of a JWT must hold.
    pub jwt_audience: Option<String>,
}

#[derive(Debug, Default)]
struct State {
    tls: Option<Arc<rustls::ServerConfig>>,
    tokens: Option<TokenTable>,
    jwt: Option<JwtKeys>,
}

/// What holds now. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Security(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    files: SecurityFiles,
    state: RwLock<Arc<State>>,
    /// When the files changed last, as far as known.
    seen: Mutex<Vec<Option<SystemTime>>>,
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("{} cannot be read: {error}", path.display()))
}

fn about(path: &Path) -> impl Fn(String) -> String {
    move |what| format!("{}: {what}", path.display())
}

impl SecurityFiles {
    fn state(&self) -> Result<State, String> {
        let tls = match (&self.tls_cert, &self.tls_key) {
            (Some(cert), Some(key)) => Some(Arc::new(tls::server_config(cert, key, self.tls_client_ca.as_deref())?)),
            (None, None) if self.tls_client_ca.is_none() => None,
            _ => return Err("TLS needs a certificate and its key".to_owned()),
        };
        let tokens = match &self.tokens {
            Some(path) => Some(TokenTable::parse(&read(path)?).map_err(about(path))?),
            None => None,
        };
        let jwt = match &self.jwt_keys {
            Some(path) => {
                let keys = JwtKeys::parse(&read(path)?, self.jwt_issuer.as_deref(), self.jwt_audience.as_deref());
                Some(keys.map_err(about(path))?)
            }
            None if self.jwt_issuer.is_some() || self.jwt_audience.is_some() => {
                return Err("an issuer or audience of JWTs needs a file of keys".to_owned());
            }
            None => None,
        };
        Ok(State { tls, tokens, jwt })
    }

    fn changed(&self) -> Vec<Option<SystemTime>> {
        let all = [&self.tls_cert, &self.tls_key, &self.tls_client_ca, &self.tokens, &self.jwt_keys];
        all.map(|path| std::fs::metadata(path.as_ref()?).and_then(|m| m.modified()).ok()).to_vec()
    }
}

impl Security {
    /// Reads all files.
    ///
    /// # Errors
    /// What is wrong, with the file.
    pub fn load(files: SecurityFiles) -> Result<Security, String> {
        let seen = Mutex::new(files.changed());
        let state = RwLock::new(Arc::new(files.state()?));
        Ok(Security(Arc::new(Inner { files, state, seen })))
    }

    fn state(&self) -> Arc<State> {
        self.0.state.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Reads all files again. Connections that are open go on as they are; tokens hold from the next call on.
    ///
    /// # Errors
    /// What is wrong; then what held before holds on.
    pub fn reload(&self) -> Result<(), String> {
        *self.0.seen.lock().unwrap_or_else(PoisonError::into_inner) = self.0.files.changed();
        let fresh = Arc::new(self.0.files.state()?);
        *self.0.state.write().unwrap_or_else(PoisonError::into_inner) = fresh;
        Ok(())
    }

    /// Reads the files again if one has changed, and logs how that went.
    pub(crate) fn reload_if_changed(&self) {
        let before = self.0.seen.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if before == self.0.files.changed() || before.is_empty() {
            return;
        }
        match self.reload() {
            Ok(()) => tracing::info!(target: "audit", action = "reload", "certificates, tokens and keys were read again"),
            Err(error) => tracing::error!(error, "certificates, tokens or keys cannot be read again; the old ones hold on"),
        }
    }

    /// Whether a caller must show who it is.
    pub fn is_required(&self) -> bool {
        let files = &self.0.files;
        files.tokens.is_some() || files.jwt_keys.is_some() || files.tls_client_ca.is_some()
    }

    /// Whether connections are encrypted.
    pub fn is_encrypted(&self) -> bool {
        self.0.files.tls_cert.is_some()
    }

    /// TLS for the next connection.
    pub(crate) fn tls(&self) -> Option<Arc<rustls::ServerConfig>> {
        self.state().tls.clone()
    }

    /// The certificate that the server shows; for a health check of itself.
    pub(crate) fn certificate_file(&self) -> Option<&Path> {
        self.0.files.tls_cert.as_deref()
    }

    /// Whether clients must present a certificate.
    pub(crate) fn wants_certificates(&self) -> bool {
        self.0.files.tls_client_ca.is_some()
    }

    /// Who makes a request: by its bearer token, or else by the certificate of its connection.
    pub(crate) fn caller(&self, request: &Request<()>) -> Result<Caller, Fault> {
        if !self.is_required() {
            return Ok(Caller::default());
        }
        let refused = |reason, message: &str| Fault::Unauthenticated { reason, message: message.to_owned() };
        let Some(header) = request.metadata().get("authorization") else {
            let certificates = request.peer_certs().filter(|_| self.wants_certificates());
            let name = certificates.and_then(|chain| chain.first().map(names::of_certificate));
            return name
                .map(Caller::named)
                .ok_or_else(|| refused("TOKEN_MISSING", "a bearer token is required: `authorization: Bearer ...`"));
        };
        let invalid = || refused("TOKEN_INVALID", "the bearer token is not valid");
        let text = header.to_str().map_err(|_| invalid())?;
        let (scheme, token) = text.split_once(' ').ok_or_else(invalid)?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(invalid());
        }
        let (state, token) = (self.state(), token.trim());
        if let Some(name) = state.tokens.as_ref().and_then(|table| table.name_of(token)) {
            return Ok(Caller::named(format!("token:{name}")));
        }
        match state.jwt.as_ref().map(|keys| keys.subject_of(token)) {
            Some(Ok(subject)) => Ok(Caller::named(format!("jwt:{subject}"))),
            Some(Err(jwt::Refusal::Expired)) => Err(refused("TOKEN_EXPIRED", "the bearer token has expired")),
            Some(Err(jwt::Refusal::Invalid)) | None => Err(invalid()),
        }
    }
}
