//! Notes and progress on the standard error; never an error of their own.

use crate::terminal::shown;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

/// What a line on the standard error is about, the gravest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum LogLevel {
    /// What ended the command, or a part of it.
    Error,
    /// What a person should look at.
    Warning,
    /// What happens, and progress.
    #[default]
    Info,
}

/// The least grave that is printed.
static SHOWN: AtomicU8 = AtomicU8::new(LogLevel::Info as u8);

/// From now on nothing is printed that is less grave.
pub fn show(level: LogLevel) {
    SHOWN.store(level as u8, Ordering::Relaxed);
}

/// The least grave that is printed.
pub fn level() -> LogLevel {
    let of = |level: &&LogLevel| **level as u8 == SHOWN.load(Ordering::Relaxed);
    LogLevel::value_variants().iter().find(of).copied().unwrap_or_default()
}

fn is_shown(level: LogLevel) -> bool {
    level as u8 <= SHOWN.load(Ordering::Relaxed)
}

fn say(level: LogLevel, text: &dyn Display) {
    if is_shown(level) {
        // Whoever closed our standard error doesn't want to hear that.
        let _ = writeln!(io::stderr(), "{}", shown(&text.to_string()));
    }
}

/// Prints what happens.
pub fn note(text: impl Display) {
    say(LogLevel::Info, &text);
}

/// Prints what a person should look at.
pub fn warn(text: impl Display) {
    say(LogLevel::Warning, &format_args!("warning: {text}"));
}

/// Prints what went wrong.
pub fn error(text: impl Display) {
    say(LogLevel::Error, &format_args!("error: {text}"));
}

/// Prints another program's line, as grave as it says.
pub fn pass_on(line: String) {
    let level = match line.split(':').next() {
        Some("error") => LogLevel::Error,
        Some("warning") => LogLevel::Warning,
        _ => LogLevel::Info,
    };
    say(level, &line);
}

/// Between two signs of life.
const LOOK: Duration = Duration::from_millis(200);

/// A bar of `total` steps; nothing is drawn where the standard error is no terminal.
pub fn bar(total: u64, what: &str) -> ProgressBar {
    if !is_shown(LogLevel::Info) {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    bar
}

/// Says that something is under way, and for how long, while it is; nothing is drawn where the standard error is no terminal.
pub fn meanwhile<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let spinner = if is_shown(LogLevel::Info) { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
        spinner.set_style(style);
    }
    spinner.set_message(what.to_owned());
    spinner.enable_steady_tick(LOOK);
    let done = work();
    spinner.finish_and_clear();
    done
}
