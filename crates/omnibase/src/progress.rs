//! Notes and progress on the standard error; never an error of their own.

use crate::terminal::shown;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::{self, Write};

/// Prints a line for a person.
pub fn note(text: impl Display) {
    // Whoever closed our standard error doesn't want to hear that.
    let _ = writeln!(io::stderr(), "{}", shown(&text.to_string()));
}

/// A bar of `total` steps; nothing is drawn where the standard error is no terminal.
pub fn bar(total: u64, what: &str) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    bar
}
