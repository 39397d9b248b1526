//! What the terminal shows: lines of text or one JSON object, and progress bars on standard error.

use crate::v1;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// How a command talks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ui {
    json: bool,
    quiet: bool,
    bars: bool,
}

/// What a command has to say: the text for people and the object for scripts.
#[derive(Debug, Default)]
pub(crate) struct Report {
    pub(crate) text: String,
    pub(crate) json: Value,
}

impl Ui {
    pub(crate) fn new(json: bool, quiet: bool) -> Self {
        Ui { json, quiet, bars: !json && !quiet && std::io::stderr().is_terminal() }
    }

    /// Prints what a command has found out. `--quiet` leaves out the text of commands whose result is a file.
    pub(crate) fn report(&self, report: &Report, is_answer: bool) {
        let text = if self.json { report.json.to_string() } else { report.text.trim_end().to_owned() };
        if text.is_empty() || (self.json && report.json.is_null()) || (self.quiet && !self.json && !is_answer) {
            return;
        }
        // A reader that went away (`| head`) is no failure of ours.
        let _ = writeln!(std::io::stdout(), "{text}");
    }

    /// Prints a warning, in JSON mode not: it is in the object.
    pub(crate) fn warn(&self, text: &str) {
        if !self.json {
            let _ = writeln!(std::io::stderr(), "warning: {text}");
        }
    }

    /// A bar of something whose length is known or becomes known; gone when dropped.
    pub(crate) fn bar(&self, what: &str) -> Bar {
        let bar = if self.bars { ProgressBar::new(1000) } else { ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::hidden()) };
        bar.set_style(style("{prefix:>12} {bar:32} {percent:>3} %  {elapsed}  {msg}"));
        bar.set_prefix(what.to_owned());
        Bar(bar)
    }

    /// A sign of life of something whose length is not known; gone when dropped.
    pub(crate) fn spinner(&self, what: &str) -> Bar {
        let bar = if self.bars { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
        bar.set_style(style("{prefix:>12} {spinner}  {elapsed}  {msg}"));
        bar.set_prefix(what.to_owned());
        if self.bars {
            bar.enable_steady_tick(Duration::from_millis(120));
        }
        Bar(bar)
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}

/// A progress bar; nothing is drawn unless standard error is a terminal.
#[derive(Debug)]
pub(crate) struct Bar(ProgressBar);

impl Bar {
    /// Shows the progress of a call.
    pub(crate) fn progress(&self, progress: &v1::Progress) {
        self.0.set_position((progress.total_fraction.clamp(0.0, 1.0) * 1000.0) as u64);
        self.0.set_message(format!("{} {}", progress.stage.replace('_', " "), progress.subject));
    }

    /// Shows a transfer.
    pub(crate) fn transfer(&self, done: u64, total: u64) {
        self.0.set_position(share(done, total));
    }

    /// A callback for an upload, which outlives this borrow.
    pub(crate) fn on_sent(&self, total: u64) -> impl FnMut(u64) + Send + 'static {
        let bar = self.0.clone();
        move |sent| bar.set_position(share(sent, total))
    }
}

/// Thousandths.
fn share(done: u64, total: u64) -> u64 {
    (done as f64 / total.max(1) as f64 * 1000.0) as u64
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
