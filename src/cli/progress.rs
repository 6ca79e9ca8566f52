//! What the user sees while waiting, and logs, which share stderr with it.

use super::args::{Machine, ProgressWord};
use crate::renderer::Progress;
use crate::text;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::Cell;
use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::time::Duration;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::fmt::format::debug_fn;

/// The bar that messages have to get out of the way of.
static BAR: OnceLock<ProgressBar> = OnceLock::new();

/// Shows progress as the user wants it.
pub(super) struct Reporter {
    json: bool,
    quiet: bool,
    stage: Cell<&'static str>,
    /// Hundredths of the stage last reported.
    reported: Cell<u32>,
}

impl Reporter {
    /// Starts progress and logs.
    pub(super) fn new(args: &Machine) -> Self {
        let json = args.progress == ProgressWord::Json;
        let terminal = io::stderr().is_terminal();
        let bar = match args.progress {
            ProgressWord::Auto if args.quiet || !terminal => ProgressBar::hidden(),
            ProgressWord::Auto | ProgressWord::Bar => {
                let target = ProgressDrawTarget::term_like_with_hz(Box::new(console::Term::stderr()), 20);
                ProgressBar::with_draw_target(Some(1000), target)
            }
            ProgressWord::Json | ProgressWord::None => ProgressBar::hidden(),
        };
        let _ = BAR.set(bar);
        let level = match (args.quiet, args.verbose) {
            (true, _) => LevelFilter::ERROR,
            (_, 0) => LevelFilter::WARN,
            (_, 1) => LevelFilter::INFO,
            _ => LevelFilter::TRACE,
        };
        let color = terminal && std::env::var_os("NO_COLOR").is_none();
        let logs = tracing_subscriber::fmt()
            .with_max_level(level)
            .with_writer(move || Log { json })
            .with_ansi(color && !json)
            .fmt_fields(debug_fn(|out, field, value| {
                let name = if field.name() == "message" { String::new() } else { format!(" {field}=") };
                write!(out, "{name}{}", text::line(&format!("{value:?}")))
            }));
        let _ = logs.with_target(false).without_time().try_init();
        Self { json, quiet: args.quiet, stage: Cell::new(""), reported: Cell::new(0) }
    }

    /// Begins a stage whose end is not foreseen.
    pub(super) fn stage(&self, stage: &'static str, what: &str) {
        self.stage.set(stage);
        if self.json {
            object(&serde_json::json!({ "stage": stage, "what": text::shortened(what) }));
        }
        if let Some(bar) = BAR.get().filter(|bar| !bar.is_hidden()) {
            bar.set_style(style("{spinner} {msg}"));
            bar.set_message(text::line(&format!("{stage} {what}")));
            bar.enable_steady_tick(Duration::from_millis(100));
        }
    }

    /// Tells how far the stage is.
    pub(super) fn progress(&self, progress: Progress<'_>) {
        let hundredths = (progress.done.clamp(0.0, 1.0) * 100.0) as u32;
        if self.json && self.reported.replace(hundredths) != hundredths {
            let stage = self.stage.get();
            object(&serde_json::json!({ "stage": stage, "pass": progress.pass, "done": progress.done }));
        }
        if let Some(bar) = BAR.get().filter(|bar| !bar.is_hidden()) {
            if bar.position() == 0 {
                bar.set_style(style("{bar:40} {percent:>3} %  {elapsed} of {duration}  {msg}"));
            }
            bar.set_message(text::line(progress.pass));
            bar.set_position((progress.done * 1000.0) as u64);
        }
    }

    /// Ends what is shown.
    pub(super) fn clear(&self) {
        if let Some(bar) = BAR.get() {
            bar.finish_and_clear();
        }
    }

    /// Says, even to a user who wants errors only, what makes a result doubtful.
    pub(super) fn warning(&self, warning: &str) {
        match self.json {
            true => line(&serde_json::json!({ "warning": warning }).to_string()),
            false => line(&format!("warning: {warning}")),
        }
    }

    /// Says something once that the user should know.
    pub(super) fn note(&self, note: &str) {
        match (self.quiet, self.json) {
            (true, _) => {}
            (_, true) => object(&serde_json::json!({ "note": text::shortened(note) })),
            _ => line(&format!("note: {}", text::line(note))),
        }
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        self.clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn object(object: &serde_json::Value) {
    line(&text::json(&object.to_string()));
}

fn line(text: &str) {
    let _ = Log { json: false }.write_all(format!("{text}\n").as_bytes());
}

/// stderr, with the bar out of the way for a moment.
struct Log {
    /// Wrap what is written in a JSON object.
    json: bool,
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let log = || serde_json::json!({ "log": String::from_utf8_lossy(bytes).trim_end() });
        let object = self.json.then(|| format!("{}\n", text::json(&log().to_string())));
        let text = object.as_ref().map_or(bytes, String::as_bytes);
        let write = || io::stderr().write_all(text).map(|()| bytes.len());
        match BAR.get() {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
