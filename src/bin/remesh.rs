//! The command line client. Without `--endpoint` it starts the server in its own process and talks to it as to any other.

use remesh_client::Channel;
use remesh_client::cli::{self, LocalOptions, StartError};
use remesh_server::ServerConfig;
use std::process::ExitCode;

/// The service on a private channel of this process.
async fn start(options: LocalOptions) -> Result<Channel, StartError> {
    let mut config = ServerConfig::default();
    if let Some(threads) = options.threads {
        config.engine.threads = threads as usize;
    }
    Ok(remesh_server::in_process(config).await?)
}

fn main() -> ExitCode {
    cli::main(start)
}
