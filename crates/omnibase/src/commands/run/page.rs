//! The page of HTML that shows a run, and the recording from which it is made.

use crate::commands::report;
use omnibase_record::run::RunRecorded;
use omnibase_run::Summary;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The recording for a page where none was asked for: beside the page, that there is room for it.
pub fn recording_for(page: &Path) -> PathBuf {
    let mut name = OsString::from(page);
    name.push(".mcap");
    PathBuf::from(name)
}

/// Writes the page of a run that is over. A recording that nobody asked for goes; it stays where the page fails.
pub fn write(page: &Path, recording: Option<&Path>) -> anyhow::Result<()> {
    if let Some(recording) = recording {
        return report::write(recording, page).map(|_| ());
    }
    let recording = recording_for(page);
    report::write(&recording, page)?;
    Ok(std::fs::remove_file(recording)?)
}

/// What a recording is told of its run at the end: what no column has.
pub fn last_words(summary: &Summary, recorded: RunRecorded) -> BTreeMap<String, String> {
    let words = [
        ("cycles", summary.cycles.to_string()),
        ("lost_frames", summary.lost_frames.to_string()),
        ("overruns", summary.overruns.to_string()),
        ("records_dropped", recorded.dropped.to_string()),
        ("realtime_factor", summary.realtime_factor.to_string()),
    ];
    words.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
}
