//! `remeshd`: the remeshing daemon. Settings, bind, serve, drain.

use clap::{Parser, ValueEnum};
use remesh_server::{ServerConfig, serve};
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::time::Duration;
use tokio::net::TcpListener;
use tracing_subscriber::EnvFilter;

/// Remeshing daemon: gRPC service remesh.v1 with sessions and a cache of every stage.
///
/// There is no authentication: whoever reaches the port can use the daemon. It therefore listens on the loopback interface unless
/// told otherwise.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Address and port to listen on; port 0 picks a free one, which the log tells
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:50061")]
    listen: SocketAddr,
    /// Threads that one call may compute with [default: all]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Megabytes of stage outputs kept
    #[arg(long, value_name = "MB", default_value_t = 2048)]
    cache_mb: usize,
    /// Sessions open at a time
    #[arg(long, value_name = "N", default_value = "256")]
    max_sessions: NonZeroUsize,
    /// Most faces of an imported surface
    #[arg(long, value_name = "N", default_value_t = 10_000_000, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_faces: u64,
    /// Megabytes of one uploaded file
    #[arg(long, value_name = "MB", default_value = "1024")]
    max_upload_mb: NonZeroUsize,
    /// Megabytes of all uploaded files together
    #[arg(long, value_name = "MB", default_value = "4096")]
    max_uploads_mb: NonZeroUsize,
    /// Megabytes of a file inside a RemeshMesh message
    #[arg(long, value_name = "MB", default_value = "64")]
    max_inline_mb: NonZeroUsize,
    /// Long calls that compute at the same time
    #[arg(long, value_name = "N", default_value = "2")]
    max_running: NonZeroUsize,
    /// Calls that wait for their turn; more are refused
    #[arg(long, value_name = "N", default_value_t = 64)]
    max_queued: usize,
    /// Minutes a session lives without being used, if its creator does not say
    #[arg(long, value_name = "MINUTES", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=525_600))]
    session_ttl_minutes: u64,
    /// Seconds that running calls may go on after SIGTERM or SIGINT
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(0..=3600))]
    grace_seconds: u64,
    /// What is logged: error, warn, info, debug, or a filter as in `info,remesh_engine=debug`
    #[arg(long, value_name = "FILTER", default_value = "info")]
    log: String,
    /// How it is logged, on standard error
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    log_format: LogFormat,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    /// Lines for people
    Text,
    /// One JSON object a line
    Json,
}

const MEGABYTE: usize = 1 << 20;

fn megabytes(count: usize) -> usize {
    count.saturating_mul(MEGABYTE)
}

fn config_of(arguments: &Arguments) -> ServerConfig {
    let mut config = ServerConfig::default();
    let engine = &mut config.engine;
    engine.threads = arguments.threads.map_or(engine.threads, usize::from);
    engine.cache_bytes = megabytes(arguments.cache_mb);
    engine.max_sessions = arguments.max_sessions.get();
    engine.max_faces = arguments.max_faces;
    engine.max_blob_bytes = megabytes(arguments.max_upload_mb.get());
    engine.max_total_blob_bytes = megabytes(arguments.max_uploads_mb.get());
    engine.default_ttl = Duration::from_secs(60 * arguments.session_ttl_minutes);
    engine.max_ttl = engine.max_ttl.max(engine.default_ttl);
    config.max_inline_bytes = megabytes(arguments.max_inline_mb.get());
    config.max_running = arguments.max_running.get();
    config.max_queued = arguments.max_queued;
    config.grace = Duration::from_secs(arguments.grace_seconds);
    config
}

fn start_log(arguments: &Arguments) -> Result<(), String> {
    // The transport tells every frame at debug level; who wants that names it.
    let directives = format!("h2=info,hyper_util=info,tower=info,{}", arguments.log);
    let filter = EnvFilter::try_new(directives).map_err(|e| format!("--log {:?} is not a filter: {e}", arguments.log))?;
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match arguments.log_format {
        LogFormat::Text => log.with_ansi(std::io::stderr().is_terminal()).init(),
        LogFormat::Json => log.json().flatten_event(true).init(),
    }
    // A panic inside a computation fails one call; where it happened belongs in the log, in the log's format.
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let payload = info.payload();
        let message = payload.downcast_ref::<&str>().copied().or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        tracing::error!(place, "panic: {}", message.unwrap_or("(no message)"));
    }));
    Ok(())
}

/// Catches signals from now on; the future resolves at SIGTERM or SIGINT.
fn stop_signal() -> impl Future<Output = ()> {
    use tokio::signal::unix::{SignalKind, signal};
    let signals = signal(SignalKind::terminate()).and_then(|terminate| Ok((terminate, signal(SignalKind::interrupt())?)));
    async {
        let (mut terminate, mut interrupt) = match signals {
            Ok(signals) => signals,
            Err(error) => {
                tracing::error!(%error, "signals cannot be caught; the daemon will not drain when it is stopped");
                return std::future::pending().await;
            }
        };
        tokio::select! {
            _ = terminate.recv() => tracing::info!("SIGTERM"),
            _ = interrupt.recv() => tracing::info!("SIGINT"),
        }
    }
}

async fn run(arguments: &Arguments) -> Result<(), String> {
    // Caught before the address is told, so that a signal right after it drains too.
    let stop = stop_signal();
    let listener = TcpListener::bind(arguments.listen).await.map_err(|error| format!("cannot listen on {}: {error}", arguments.listen))?;
    let address = listener.local_addr().map_err(|error| format!("the socket has no address: {error}"))?;
    let config = config_of(arguments);
    tracing::info!(%address, threads = config.engine.threads, cache_mb = arguments.cache_mb, version = env!("CARGO_PKG_VERSION"), "listening");
    if !address.ip().is_loopback() {
        tracing::warn!(%address, "the daemon has no authentication and is reachable from other machines");
    }
    serve(listener, config, stop).await.map_err(|error| error.to_string())?;
    tracing::info!("stopped");
    Ok(())
}

/// Time that blocking threads have to reach a checkpoint after everything else has ended.
const LAST_CHECKPOINT: Duration = Duration::from_secs(2);

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = start_log(&arguments).and_then(|()| {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
        let runtime = runtime.map_err(|error| format!("no threads for the daemon: {error}"))?;
        let outcome = runtime.block_on(run(&arguments));
        runtime.shutdown_timeout(LAST_CHECKPOINT);
        outcome
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("remeshd: {message}");
            ExitCode::FAILURE
        }
    }
}
