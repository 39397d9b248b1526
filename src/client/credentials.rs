//! How a client shows who it is, and whom it trusts.

use std::fmt;
use std::path::Path;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::transport::{Certificate, ClientTlsConfig, Identity};
use tonic::{Request, Status};

/// Whom a client trusts and how it shows who it is. Nothing of it is printed.
#[derive(Clone, Default)]
pub struct Credentials {
    authority: Option<Vec<u8>>,
    identity: Option<(Vec<u8>, Vec<u8>)>,
    domain: Option<String>,
    token: Option<String>,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials")
            .field("authority", &self.authority.is_some())
            .field("identity", &self.identity.is_some())
            .field("domain", &self.domain)
            .field("token", &self.token.is_some())
            .finish()
    }
}

impl Credentials {
    /// Trusts daemons whose certificate one of these authorities (PEM) has signed.
    #[must_use]
    pub fn trusting(mut self, authorities: Vec<u8>) -> Self {
        self.authority = Some(authorities);
        self
    }

    /// Shows a certificate (PEM chain and private key).
    #[must_use]
    pub fn with_certificate(mut self, chain: Vec<u8>, key: Vec<u8>) -> Self {
        self.identity = Some((chain, key));
        self
    }

    /// Expects this name in the certificate of the daemon instead of that in the endpoint.
    #[must_use]
    pub fn expecting(mut self, domain: impl Into<String>) -> Self {
        self.domain = Some(domain.into());
        self
    }

    /// Sends a bearer token with each call. White space around it is dropped, so a file can be given as it is.
    #[must_use]
    pub fn with_token(mut self, token: &str) -> Self {
        self.token = Some(token.trim().to_owned());
        self
    }

    /// The same from files.
    ///
    /// # Errors
    /// The file that cannot be read, and why.
    pub fn from_files(
        authority: Option<&Path>,
        identity: Option<(&Path, &Path)>,
        domain: Option<&str>,
        token: Option<&Path>,
    ) -> Result<Self, String> {
        let read = |path: &Path| std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()));
        let mut credentials = Credentials { domain: domain.map(str::to_owned), ..Credentials::default() };
        if let Some(path) = authority {
            credentials = credentials.trusting(read(path)?);
        }
        if let Some((chain, key)) = identity {
            credentials = credentials.with_certificate(read(chain)?, read(key)?);
        }
        if let Some(path) = token {
            let token = String::from_utf8(read(path)?).map_err(|_| format!("{} is not UTF-8", path.display()))?;
            credentials = credentials.with_token(&token);
        }
        Ok(credentials)
    }

    /// TLS for an `https` endpoint; `None` if no authority is trusted.
    pub(crate) fn tls(&self) -> Option<ClientTlsConfig> {
        let mut config = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(self.authority.as_ref()?));
        if let Some((chain, key)) = &self.identity {
            config = config.identity(Identity::from_pem(chain, key));
        }
        if let Some(domain) = &self.domain {
            config = config.domain_name(domain);
        }
        Some(config)
    }

    /// Whether they mean anything without TLS.
    pub(crate) fn need_tls(&self) -> bool {
        self.authority.is_some() || self.identity.is_some() || self.domain.is_some()
    }

    /// What goes with each call.
    pub(crate) fn bearer(&self) -> Result<Bearer, String> {
        let Some(token) = &self.token else { return Ok(Bearer(None)) };
        let mut value: MetadataValue<Ascii> =
            format!("Bearer {token}").parse().map_err(|_| "the token has characters that no header may have".to_owned())?;
        value.set_sensitive(true);
        Ok(Bearer(Some(value)))
    }
}

/// Puts the token into each call.
#[derive(Debug, Clone, Default)]
pub struct Bearer(Option<MetadataValue<Ascii>>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(token) = &self.0 {
            request.metadata_mut().insert("authorization", token.clone());
        }
        Ok(request)
    }
}
