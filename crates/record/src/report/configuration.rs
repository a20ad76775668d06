//! The configuration with which the robot ran, as the recording holds it.

use super::sections::section;
use super::signals::Signals;
use super::text::{self, absent, escape};
use crate::run::BEGUN;
use std::fmt::Write;

/// Lines shown of each file.
const MOST_LINES: usize = 150;
/// Longer texts stand below the table.
const LONG: usize = 200;

/// What the head of the page and its summary show already.
const SHOWN: [&str; 12] = [
    "robot",
    "reference",
    "mode",
    "version",
    "date",
    BEGUN,
    "ended_early",
    "cycles",
    "lost_frames",
    "overruns",
    "records_dropped",
    "realtime_factor",
];

/// Everything else that the recording says about itself: short words in a table, files below it.
pub(super) fn html(signals: &Signals<'_>) -> String {
    let description = &signals.run().description;
    if description.is_empty() {
        return section(
            "configuration",
            "Configuration",
            &absent("Configuration", "the recording tells none"),
        );
    }
    let is_long = |text: &str| text.contains('\n') || text.chars().count() > LONG;
    let (mut rows, mut files) = (String::new(), String::new());
    for (key, text) in description.iter().filter(|(key, _)| !SHOWN.contains(&key.as_str())) {
        let name = escape(key);
        if is_long(text) {
            let _ = writeln!(files, "<h3>{name}</h3>\n<pre>{}</pre>", escape(&beginning(text)));
        } else {
            let _ = writeln!(rows, "<tr><th>{name}</th><td>{}</td></tr>", escape(text));
        }
    }
    section("configuration", "Configuration", &format!("<table class=\"pairs\">{rows}</table>\n{files}"))
}

/// The first lines of a file, without tables that are empty.
fn beginning(text: &str) -> String {
    let lines: Vec<&str> = text.trim_end().lines().collect();
    let is_header = |line: &str| line.starts_with('[');
    let is_empty_table = |at: usize| {
        let next = lines[at + 1..].iter().find(|line| !line.trim().is_empty());
        is_header(lines[at]) && !lines[at].starts_with("[[") && next.is_none_or(|line| is_header(line))
    };
    let mut shown: Vec<&str> = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let follows_blank = shown.last().is_none_or(|last| last.trim().is_empty());
        if is_empty_table(at) || (line.trim().is_empty() && follows_blank) {
            continue;
        }
        shown.push(line);
    }
    let mut words = shown.iter().take(MOST_LINES).copied().collect::<Vec<_>>().join("\n");
    if let Some(more @ 1..) = shown.len().checked_sub(MOST_LINES) {
        let _ = write!(words, "\n… and {} more lines in the recording", text::count(more as u64));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_tables_and_endless_files_are_left_out() {
        let text = "[a]\nx = 1\n\n[a.custom]\n\n[[b]]\n\n[b.custom]\n\n[c]\ny = 2\n\n[d]\n";
        assert_eq!(beginning(text), "[a]\nx = 1\n\n[[b]]\n\n[c]\ny = 2\n");
        let path = "0 1 2 3\n".repeat(MOST_LINES + 1200);
        assert!(beginning(&path).ends_with("3\n… and 1\u{202F}200 more lines in the recording"));
    }
}
