//! The settings of the daemon and where they come from: defaults in the binary, then the file, then the environment, then flags. All four
//! go through the same parser, so a value is right or wrong everywhere, and says where it came from.

use clap::builder::ValueParser;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Remeshing daemon: gRPC service remesh.v1 with sessions and a cache of every stage.
///
/// Listens on the loopback interface unless told otherwise. Every setting is a flag here (--max-sessions), a variable of the environment
/// (REMESHD_MAX_SESSIONS) and a key of the file (max_sessions = 64); flags win over the environment, that over the file.
#[derive(Debug, Parser)]
#[command(name = "remeshd", version)]
struct CommandLine {
    /// File with settings (TOML), one `key = value` a line; `remeshd check-config` prints one
    #[arg(long, value_name = "FILE", global = true, env = CONFIG_VARIABLE)]
    config: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
    #[command(subcommand)]
    verb: Option<Verb>,
}

const CONFIG_VARIABLE: &str = "REMESHD_CONFIG";

/// What to do instead of serving.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum Verb {
    /// Check the settings and print those that hold, each with where it comes from
    CheckConfig,
    /// Make a bearer token: the token on standard output, its line for --token-file on standard error
    Token {
        /// Whose it is; sessions are visible to those with the same name only
        #[arg(value_name = "NAME")]
        name: String,
    },
    /// Ask the daemon that has these settings whether it is well; exit code 0 if so, 1 if not
    Health {
        /// What to ask for
        #[arg(long, value_name = "WHAT", default_value = "readiness")]
        probe: Probe,
        /// Seconds to wait for an answer
        #[arg(long, value_name = "SECONDS", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=60))]
        timeout: u64,
    },
}

/// A number that must not be 0.
fn at_least_one(text: &str) -> Result<NonZeroUsize, String> {
    let number: usize = text.parse().map_err(|_| "is not a whole number".to_owned())?;
    NonZeroUsize::new(number).ok_or_else(|| "must be at least 1".to_owned())
}

fn collector(text: &str) -> Result<String, String> {
    match text.strip_prefix("http://") {
        Some(rest) if !rest.is_empty() && rest.chars().all(|c| c.is_ascii_graphic()) => Ok(text.to_owned()),
        _ => Err("is not an address as http://127.0.0.1:4317; a collector behind TLS is reached through one on this machine".to_owned()),
    }
}

/// What a health check asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Probe {
    /// Whether it takes calls; not while it shuts down
    Readiness,
    /// Whether it runs at all
    Liveness,
}

/// All settings.
#[derive(Debug, Clone, Args)]
pub(crate) struct Settings {
    /// Address and port to listen on; port 0 picks a free one, which the log tells
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:50061")]
    pub(crate) listen: SocketAddr,
    /// Threads that one call may compute with [default: all]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Megabytes that the daemon may take in all, as the limit of its container; half of them become the cache unless cache_mb is set
    #[arg(long, value_name = "MB", value_parser = at_least_one)]
    pub(crate) memory_mb: Option<NonZeroUsize>,
    /// Megabytes of stage outputs kept [default: half of memory_mb, or 2048]
    #[arg(long, value_name = "MB")]
    pub(crate) cache_mb: Option<usize>,
    /// Sessions open at a time
    #[arg(long, value_name = "N", default_value = "256", value_parser = at_least_one)]
    pub(crate) max_sessions: NonZeroUsize,
    /// Most faces of an imported surface
    #[arg(long, value_name = "N", default_value_t = 10_000_000, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    pub(crate) max_faces: u64,
    /// Megabytes of one uploaded file
    #[arg(long, value_name = "MB", default_value = "1024", value_parser = at_least_one)]
    pub(crate) max_upload_mb: NonZeroUsize,
    /// Megabytes of all uploaded files together
    #[arg(long, value_name = "MB", default_value = "4096", value_parser = at_least_one)]
    pub(crate) max_uploads_mb: NonZeroUsize,
    /// Megabytes of a file inside a RemeshMesh message
    #[arg(long, value_name = "MB", default_value = "64", value_parser = at_least_one)]
    pub(crate) max_inline_mb: NonZeroUsize,
    /// Long calls that compute at the same time
    #[arg(long, value_name = "N", default_value = "2", value_parser = at_least_one)]
    pub(crate) max_running: NonZeroUsize,
    /// Calls that wait for their turn; more are refused
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub(crate) max_queued: usize,
    /// Calls of one client that compute or wait to; more are refused. A client is a name, or an address if callers have no names
    #[arg(long, value_name = "N", default_value = "48", value_parser = at_least_one)]
    pub(crate) max_jobs_per_client: NonZeroUsize,
    /// Sessions of one client
    #[arg(long, value_name = "N", default_value = "256", value_parser = at_least_one)]
    pub(crate) max_sessions_per_client: NonZeroUsize,
    /// Faces of the surfaces of all sessions together
    #[arg(long, value_name = "N", default_value_t = 100_000_000)]
    pub(crate) max_open_faces: u64,
    /// Faces of the surfaces of the sessions of one client together
    #[arg(long, value_name = "N", default_value_t = 100_000_000)]
    pub(crate) max_open_faces_per_client: u64,
    /// Connections open at a time; more are closed as they come
    #[arg(long, value_name = "N", default_value = "1024", value_parser = at_least_one)]
    pub(crate) max_connections: NonZeroUsize,
    /// Streams of session events open at a time
    #[arg(long, value_name = "N", default_value_t = 1024)]
    pub(crate) max_watchers: usize,
    /// Minutes a session lives without being used, if its creator does not say
    #[arg(long, value_name = "MINUTES", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=525_600))]
    pub(crate) session_ttl_minutes: u64,
    /// Folder that keeps sessions and uploaded files over a restart; made if there is none, for its owner only [default: none, in memory]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) data_dir: Option<PathBuf>,
    /// Megabytes that the data folder may take [default: what the disk has]
    #[arg(long, value_name = "MB", requires = "data_dir")]
    pub(crate) max_store_mb: Option<NonZeroUsize>,
    /// Megabytes of the data folder that sessions and files of one client may take [default: no bound but --max-store-mb]
    #[arg(long, value_name = "MB", requires = "data_dir")]
    pub(crate) max_store_mb_per_client: Option<NonZeroUsize>,
    /// Minutes that an uploaded file stays in the data folder although no session uses it, and that a broken upload can be gone on with
    #[arg(long, value_name = "MINUTES", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=525_600))]
    pub(crate) upload_grace_minutes: u64,
    /// Seconds that running calls may go on after SIGTERM or SIGINT
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub(crate) grace_seconds: u64,
    /// Address and port for Prometheus metrics and health over HTTP (/metrics, /livez, /readyz), without authentication [default: none]
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) metrics_listen: Option<SocketAddr>,
    /// Collector that gets traces over OTLP (gRPC), as in http://127.0.0.1:4317; spans of calls with their stages [default: none]
    #[arg(long, value_name = "URL", value_parser = collector)]
    pub(crate) otlp_endpoint: Option<String>,
    /// Certificate chain (PEM); with it and --tls-key the daemon speaks TLS only. Files of certificates, tokens and keys are read again
    /// when they change, and on SIGHUP
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    pub(crate) tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub(crate) tls_key: Option<PathBuf>,
    /// Authorities (PEM); clients must present a certificate of theirs
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub(crate) tls_client_ca: Option<PathBuf>,
    /// Bearer tokens: a name and the hash of a token on each line, as `remeshd token NAME` makes them
    #[arg(long, value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// Public keys (JWK set or PEM) of bearer tokens that are JWTs
    #[arg(long, value_name = "FILE")]
    pub(crate) jwt_keys: Option<PathBuf>,
    /// What `iss` of a JWT must be
    #[arg(long, value_name = "TEXT", requires = "jwt_keys")]
    pub(crate) jwt_issuer: Option<String>,
    /// What `aud` of a JWT must hold
    #[arg(long, value_name = "TEXT", requires = "jwt_keys")]
    pub(crate) jwt_audience: Option<String>,
    /// Listen beyond the loopback interface although everybody may call
    #[arg(long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true", default_value = "false",
        action = ArgAction::Set)]
    pub(crate) insecure: bool,
    /// What is logged: error, warn, info, debug, or a filter as in `info,remesh_engine=debug`; changes are logged by the target `audit`
    #[arg(long, value_name = "FILTER", default_value = "info", value_parser = ValueParser::string())]
    pub(crate) log: String,
    /// How it is logged, on standard error
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub(crate) log_format: LogFormat,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// Lines for people
    Text,
    /// One JSON object a line
    Json,
}

impl Settings {
    /// Megabytes of stage outputs kept.
    pub(crate) fn effective_cache_mb(&self) -> usize {
        const USUAL: usize = 2048;
        self.cache_mb.unwrap_or_else(|| self.memory_mb.map_or(USUAL, |all| all.get() / 2))
    }
}

/// The settings that hold.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) settings: Settings,
    pub(crate) verb: Option<Verb>,
    /// All settings as a file, with where each comes from.
    pub(crate) listing: String,
}

/// Why there are no settings.
#[derive(Debug)]
pub(crate) enum Wrong {
    /// The command line or the environment; also asks for help and for the version.
    Usage(clap::Error),
    /// The file.
    File(String),
}

/// Arguments that are no settings.
const NO_SETTINGS: [&str; 3] = ["config", "help", "version"];

fn key_of(id: &str) -> String {
    id.replace('-', "_")
}

fn variable_of(id: &str) -> String {
    format!("REMESHD_{}", id.to_uppercase())
}

fn setting_ids(command: &clap::Command) -> Vec<String> {
    command.get_arguments().map(|a| a.get_id().to_string()).filter(|id| !NO_SETTINGS.contains(&id.as_str())).collect()
}

/// The command line with every setting also in the environment, and good before and after a verb.
fn command() -> clap::Command {
    let mut command = CommandLine::command();
    for id in setting_ids(&command) {
        let variable = variable_of(&id);
        command = command.mut_arg(id, |a| a.global(true).env(variable).hide_env_values(true));
    }
    command
}

/// The file that the arguments or the environment name; looked for before all else is parsed.
fn config_path(arguments: &[OsString], variable: Option<OsString>) -> Option<PathBuf> {
    let mut found = variable.filter(|v| !v.is_empty());
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        if argument == OsStr::new("--config") {
            found = rest.next().cloned();
        } else if let Some(path) = argument.to_str().and_then(|a| a.strip_prefix("--config=")) {
            found = Some(path.into());
        }
    }
    found.map(PathBuf::from)
}

/// Number of single-character edits between two words.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let cost = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = cost.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

fn text_of(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(number) => Some(number.to_string()),
        toml::Value::Float(number) => Some(number.to_string()),
        toml::Value::Boolean(is) => Some(is.to_string()),
        toml::Value::Datetime(_) | toml::Value::Array(_) | toml::Value::Table(_) => None,
    }
}

fn unknown(key: &str, ids: &[String]) -> String {
    let nearest = ids.iter().map(|id| key_of(id)).min_by_key(|known| distance(key, known)).unwrap_or_default();
    format!("unknown key `{key}`; the nearest one is `{nearest}`")
}

/// The values of a file by argument id, each checked as the flag would be.
fn file_values(command: &clap::Command, text: &str) -> Result<BTreeMap<String, String>, String> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    let ids = setting_ids(command);
    let line_of = |key: &str| {
        let names = |line: &str| line.trim_start().trim_start_matches(['[', '"']).starts_with(key);
        text.lines().position(names).map_or(String::new(), |line| format!("line {}: ", line + 1))
    };
    let mut values = BTreeMap::new();
    for (key, value) in &table {
        let at = line_of(key);
        let id = ids.iter().find(|id| key_of(id) == *key).ok_or_else(|| format!("{at}{}", unknown(key, &ids)))?;
        let value = text_of(value).ok_or_else(|| format!("{at}`{key}` takes one text, number, or true or false"))?;
        // Only this flag: what is wrong elsewhere is told elsewhere.
        let flag = OsString::from(format!("--{}={value}", id.replace('_', "-")));
        let alone = CommandLine::command().try_get_matches_from([OsString::from("remeshd"), flag]);
        let refused = alone.err().filter(|error| error.kind() != ErrorKind::MissingRequiredArgument);
        refused.map_or(Ok(()), Err).map_err(|error| {
            let message = error.to_string();
            let first = message.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
            format!("{at}`{key}`: {first}")
        })?;
        values.insert(id.clone(), value);
    }
    Ok(values)
}

/// The settings that hold, from all four places.
pub(crate) fn load(arguments: Vec<OsString>) -> Result<Loaded, Wrong> {
    let mut command = command();
    let path = config_path(&arguments, std::env::var_os(CONFIG_VARIABLE));
    let values = match &path {
        None => BTreeMap::new(),
        Some(path) => {
            let told = |what: String| Wrong::File(format!("{}: {what}", path.display()));
            let text = std::fs::read_to_string(path).map_err(|error| told(format!("cannot be read: {error}")))?;
            file_values(&command, &text).map_err(told)?
        }
    };
    for (id, value) in &values {
        command = command.mut_arg(id, |a| a.default_value(value.clone()));
    }
    let ids = setting_ids(&command);
    let matches = command.try_get_matches_from(arguments).map_err(Wrong::Usage)?;
    let whole = CommandLine::from_arg_matches(&matches).map_err(Wrong::Usage)?;
    // A verb sees what was given before and after it.
    let innermost = matches.subcommand().map_or(&matches, |(_, inner)| inner);
    let settings = Settings::from_arg_matches(innermost).map_err(Wrong::Usage)?;
    let listing = listing(&ids, innermost, path.as_deref(), &values);
    Ok(Loaded { settings, verb: whole.verb, listing })
}

fn listing(ids: &[String], matches: &ArgMatches, file: Option<&Path>, values: &BTreeMap<String, String>) -> String {
    let row = |id: &String| {
        let raw: Option<String> = matches.get_raw(id).and_then(|mut values| values.next()).map(|v| v.to_string_lossy().into_owned());
        let left = match &raw {
            None => format!("# {} is not set", key_of(id)),
            Some(text) if text.parse::<i64>().is_ok() || text.parse::<bool>().is_ok() => format!("{} = {text}", key_of(id)),
            Some(text) => format!("{} = {}", key_of(id), toml_text(text)),
        };
        let source = match (matches.value_source(id), file) {
            (Some(ValueSource::CommandLine), _) => format!("flag --{}", id.replace('_', "-")),
            (Some(ValueSource::EnvVariable), _) => format!("environment {}", variable_of(id)),
            (_, Some(file)) if values.contains_key(id) => format!("file {}", file.display()),
            _ => "default".to_owned(),
        };
        format!("{left:<42} # {source}\n")
    };
    ids.iter().map(row).collect()
}

/// A text as TOML writes it.
fn toml_text(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted += &format!("\\u{:04x}", c as u32),
            c => quoted.push(c),
        }
    }
    quoted + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Result<BTreeMap<String, String>, String> {
        file_values(&command(), text)
    }

    #[test]
    fn the_file_knows_every_setting_and_checks_it_as_the_flag() {
        let good = values("# all is well\nlisten = \"127.0.0.1:0\"\nmax_sessions = 3\nlog_format = \"json\"\n").expect("good");
        assert_eq!(good["max_sessions"], "3");
        for (text, expected) in [
            ("cache_mb = 1\nmax_sesions = 3", "line 2: unknown key `max_sesions`; the nearest one is `max_sessions`"),
            ("max_sessions = 0", "line 1: `max_sessions`: invalid value '0'"),
            ("\nlisten = \"nowhere\"", "line 2: `listen`: invalid value 'nowhere'"),
            ("threads = [1, 2]", "takes one text"),
            ("[limits]\nmax_faces = 1", "line 1: unknown key `limits`"),
            ("config = \"other.toml\"", "unknown key `config`"),
            ("threads = ", "line 1"),
        ] {
            let error = values(text).expect_err(text);
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn edits_are_counted() {
        assert_eq!([distance("", "abc"), distance("abc", "abc"), distance("listn", "listen"), distance("kitten", "sitting")], [3, 0, 1, 3]);
    }

    #[test]
    fn texts_are_quoted() {
        assert_eq!(toml_text("a\"b\\c\n"), r#""a\"b\\c\u000a""#);
    }
}
