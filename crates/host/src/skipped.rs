//! Tests that can't run here. Crates without this one take the file itself.

use std::fmt::Display;

/// Says loudly that a test is skipped, and why.
///
/// # Panics
/// Where `OMNIBASE_WITNESSES` is set, as `.ci/run` does: there a test has what it needs.
pub fn skipped(why: impl Display) {
    assert!(std::env::var_os("OMNIBASE_WITNESSES").is_none(), "a test can't run: {why}");
    eprintln!("SKIPPED: {why}");
}
