//! Options about the connection to a daemon.

use clap::Args;
use std::path::PathBuf;

/// Whom to trust and how to show who one is.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Connection to a daemon")]
pub(crate) struct ConnectArgs {
    /// Authorities (PEM) one of which has signed the certificate of the daemon; needed for https
    #[arg(long, global = true, value_name = "FILE", env = "REMESH_TLS_CA", hide_env_values = true)]
    pub(crate) tls_ca: Option<PathBuf>,
    /// Certificate to show (PEM)
    #[arg(long, global = true, value_name = "FILE", env = "REMESH_TLS_CERT", hide_env_values = true, requires = "tls_key")]
    pub(crate) tls_cert: Option<PathBuf>,
    /// Its private key (PEM)
    #[arg(long, global = true, value_name = "FILE", env = "REMESH_TLS_KEY", hide_env_values = true, requires = "tls_cert")]
    pub(crate) tls_key: Option<PathBuf>,
    /// Name that the certificate of the daemon must have, if it is not that of the endpoint
    #[arg(long, global = true, value_name = "NAME", env = "REMESH_TLS_DOMAIN", hide_env_values = true)]
    pub(crate) tls_domain: Option<String>,
    /// File with a bearer token
    #[arg(long, global = true, value_name = "FILE", env = "REMESH_TOKEN_FILE", hide_env_values = true)]
    pub(crate) token_file: Option<PathBuf>,
}
