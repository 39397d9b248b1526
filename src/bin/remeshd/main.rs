//! `remeshd`: the remeshing daemon. Settings, bind, serve, drain.

mod settings;
mod traces;

use opentelemetry_sdk::trace::SdkTracerProvider;
use remesh_server::health::{self, Probed};
use remesh_server::security::new_token;
use remesh_server::{Keeping, Security, SecurityFiles, ServerConfig, serve_with_metrics};
use settings::{Loaded, LogFormat, Probe, Settings, Verb, Wrong};
use std::io::{IsTerminal, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::process::ExitCode;
use std::time::Duration;
use tokio::net::TcpListener;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

const MEGABYTE: usize = 1 << 20;

fn megabytes(count: usize) -> usize {
    count.saturating_mul(MEGABYTE)
}

fn config_of(settings: &Settings) -> ServerConfig {
    let mut config = ServerConfig::default();
    let engine = &mut config.engine;
    engine.threads = settings.threads.map_or(engine.threads, usize::from);
    engine.cache_bytes = megabytes(settings.effective_cache_mb());
    engine.max_sessions = settings.max_sessions.get();
    engine.max_faces = settings.max_faces;
    engine.max_blob_bytes = megabytes(settings.max_upload_mb.get());
    engine.max_total_blob_bytes = megabytes(settings.max_uploads_mb.get());
    engine.default_ttl = Duration::from_secs(60 * settings.session_ttl_minutes);
    engine.max_ttl = engine.max_ttl.max(engine.default_ttl);
    config.max_inline_bytes = megabytes(settings.max_inline_mb.get());
    config.max_running = settings.max_running.get();
    config.max_queued = settings.max_queued;
    config.max_watchers = settings.max_watchers;
    config.max_jobs_per_client = settings.max_jobs_per_client.get();
    config.max_sessions_per_client = settings.max_sessions_per_client.get();
    config.max_open_faces = settings.max_open_faces;
    config.max_open_faces_per_client = settings.max_open_faces_per_client;
    config.max_connections = settings.max_connections.get();
    config.grace = Duration::from_secs(settings.grace_seconds);
    config.upload_patience = Duration::from_secs(60 * settings.upload_grace_minutes);
    config.keeping = settings.data_dir.as_ref().map(|folder| Keeping {
        folder: folder.clone(),
        max_bytes: settings.max_store_mb.map(|mb| megabytes(mb.get()) as u64),
        max_bytes_per_client: settings.max_store_mb_per_client.map(|mb| megabytes(mb.get()) as u64),
        blob_grace: config.upload_patience,
    });
    config
}

fn log_filter(settings: &Settings) -> Result<EnvFilter, String> {
    // The transport tells every frame at debug level; who wants that names it.
    let directives = format!("h2=info,hyper_util=info,tower=info,{}", settings.log);
    EnvFilter::try_new(directives).map_err(|e| format!("--log {:?} is not a filter: {e}", settings.log))
}

/// Starts the log, and traces where they are wanted.
fn start_log(settings: &Settings, traces: Option<&SdkTracerProvider>) -> Result<(), String> {
    let filter = log_filter(settings)?;
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let log = match settings.log_format {
        LogFormat::Text => log.with_ansi(std::io::stderr().is_terminal()).with_filter(filter).boxed(),
        LogFormat::Json => log.json().flatten_event(true).with_filter(filter).boxed(),
    };
    tracing_subscriber::registry().with(log).with(traces.map(traces::layer)).init();
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

async fn run(settings: &Settings) -> Result<(), String> {
    // Caught before the address is told, so that a signal right after it drains too.
    let stop = stop_signal();
    let security = security_of(settings)?;
    check_exposure(settings, &security)?;
    let listener = TcpListener::bind(settings.listen).await.map_err(|error| format!("cannot listen on {}: {error}", settings.listen))?;
    let metrics = match settings.metrics_listen {
        None => None,
        Some(at) => {
            let listener = TcpListener::bind(at).await.map_err(|error| format!("cannot listen on {at} for metrics: {error}"))?;
            let address = listener.local_addr().map_err(|error| format!("the socket has no address: {error}"))?;
            tracing::info!(metrics = %address, "metrics");
            Some(listener)
        }
    };
    let address = listener.local_addr().map_err(|error| format!("the socket has no address: {error}"))?;
    let config = ServerConfig { security, ..config_of(settings) };
    tracing::info!(%address, threads = config.engine.threads, cache_mb = settings.effective_cache_mb(), version = env!("CARGO_PKG_VERSION"), "listening");
    tokio::spawn(reload_on_hangup(config.security.clone()));
    serve_with_metrics(listener, metrics, config, stop).await.map_err(|error| error.to_string())?;
    tracing::info!("stopped");
    Ok(())
}

/// Time that blocking threads have to reach a checkpoint after everything else has ended.
const LAST_CHECKPOINT: Duration = Duration::from_secs(2);

fn security_of(settings: &Settings) -> Result<Security, String> {
    let s = settings.clone();
    Security::load(SecurityFiles {
        tls_cert: s.tls_cert,
        tls_key: s.tls_key,
        tls_client_ca: s.tls_client_ca,
        tokens: s.token_file,
        jwt_keys: s.jwt_keys,
        jwt_issuer: s.jwt_issuer,
        jwt_audience: s.jwt_audience,
    })
}

/// Refuses to be open to other machines by accident.
fn check_exposure(settings: &Settings, security: &Security) -> Result<(), String> {
    let listen = settings.listen;
    if listen.ip().is_loopback() {
        return Ok(());
    }
    match (security.is_required(), security.is_encrypted()) {
        (true, true) => {}
        (true, false) => tracing::warn!(%listen, "bearer tokens travel in the clear; set tls_cert, or let a proxy speak TLS"),
        (false, _) if settings.insecure => tracing::warn!(%listen, "reachable from other machines, and everybody may call"),
        (false, _) => {
            return Err(format!(
                "{listen} is reachable from other machines and everybody could call: set token_file, jwt_keys or tls_client_ca, listen on \
                 the loopback interface, or say --insecure"
            ));
        }
    }
    Ok(())
}

/// Reads certificates, tokens and keys again at each SIGHUP.
async fn reload_on_hangup(security: Security) {
    use tokio::signal::unix::{SignalKind, signal};
    let Ok(mut hangup) = signal(SignalKind::hangup()) else { return };
    while hangup.recv().await.is_some() {
        match security.reload() {
            Ok(()) => tracing::info!(target: "audit", action = "reload", "SIGHUP: certificates, tokens and keys were read again"),
            Err(error) => tracing::error!(error, "SIGHUP: cannot be read again; what held before holds on"),
        }
    }
}

/// Where a daemon that listens on `listen` is reached from the same machine.
fn own_address(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}

async fn check_health(settings: &Settings, probe: Probe, timeout: Duration) -> Result<(), String> {
    let service = match probe {
        Probe::Readiness => Probed::Readiness,
        Probe::Liveness => Probed::Liveness,
    };
    let listen = settings.metrics_listen.unwrap_or(settings.listen);
    let address = own_address(listen);
    let outcome = match settings.metrics_listen {
        Some(_) => health::check_http(address, service, timeout).await,
        None => health::check(address, &security_of(settings)?, service, timeout).await,
    };
    outcome.map_err(|error| format!("{address} is not well: {error}"))?;
    println!("{address} is well");
    Ok(())
}

fn execute(loaded: &Loaded) -> Result<(), String> {
    let settings = &loaded.settings;
    let serves = loaded.verb.is_none();
    match &loaded.verb {
        Some(Verb::Token { name }) => {
            let (token, line) = new_token(name)?;
            eprintln!("{line}");
            println!("{token}");
            return Ok(());
        }
        Some(Verb::CheckConfig) => {
            log_filter(settings)?;
            check_exposure(settings, &security_of(settings)?)?;
            // A reader that went away is no failure of ours.
            let _ = write!(std::io::stdout(), "{}", loaded.listing);
            return Ok(());
        }
        Some(Verb::Health { .. }) | None => {}
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("no threads for the daemon: {error}"))?;
    let traces = match settings.otlp_endpoint.as_deref().filter(|_| serves) {
        Some(endpoint) => {
            let _inside = runtime.enter();
            Some(traces::provider(endpoint)?)
        }
        None => None,
    };
    if serves {
        start_log(settings, traces.as_ref())?;
    }
    let outcome = match loaded.verb {
        Some(Verb::Health { probe, timeout }) => runtime.block_on(check_health(settings, probe, Duration::from_secs(timeout))),
        _ => runtime.block_on(run(settings)),
    };
    // The last spans leave while the runtime still carries them.
    if let Some(error) = traces.and_then(|traces| traces.shutdown().err()) {
        tracing::warn!(%error, "the last traces were not sent");
    }
    runtime.shutdown_timeout(if serves { LAST_CHECKPOINT } else { Duration::ZERO });
    outcome
}

/// Tells glibc to keep what is freed for the next call (`mallopt(3)`, "dynamic mmap threshold"): a freed block of this size is the largest
/// that it serves from its own pools from now on, and twice as much may lie free there. Otherwise each preview gives megabytes back to the
/// system and takes them again. Nothing is written to the block; other allocators do nothing.
fn keep_freed_memory() {
    const BYTES: usize = 16 * MEGABYTE;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BYTES)));
}

fn main() -> ExitCode {
    keep_freed_memory();
    let loaded = match settings::load(std::env::args_os().collect()) {
        Ok(loaded) => loaded,
        Err(Wrong::Usage(error)) => {
            // Help and version are errors to clap as well, with exit code 0.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2).into();
        }
        Err(Wrong::File(message)) => {
            eprintln!("remeshd: {message}");
            return ExitCode::from(2);
        }
    };
    match execute(&loaded) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("remeshd: {message}");
            ExitCode::FAILURE
        }
    }
}
