//! The page of HTML that shows a run, and the recording from which it is made.

use super::calendar::Moment;
use crate::commands::report;
use anyhow::Context;
use omnibase_measure::Summary;
use omnibase_record::report::MEASURED;
use omnibase_record::run::{BEGUN, RunRecorded};
use omnibase_robot::Registry;
use omnibase_run::RunError;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The page that a run shall have.
///
/// Where nobody asked for a recording there is one all the same, beside the page, that there is room for it. It goes
/// when the page is written, and when the run fails before its first cycle; else it stays.
pub struct Page {
    path: PathBuf,
    recording: PathBuf,
    /// Nobody asked for the recording.
    is_spare: bool,
    /// The recording holds nothing worth keeping.
    is_empty: bool,
}

impl Page {
    /// Looks whether the page can be written where it shall be, before anything moves.
    pub fn begin(path: &Path, recording: Option<&Path>) -> anyhow::Result<Self> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        anyhow::ensure!(
            folder.is_dir(),
            "--report {}: there is no folder `{}`",
            path.display(),
            folder.display()
        );
        let is_file = std::fs::metadata(path).map_or(true, |there| there.is_file());
        anyhow::ensure!(is_file, "--report {}: expected a regular file", path.display());
        let mut beside = OsString::from(path);
        beside.push(".mcap");
        Ok(Page {
            path: path.to_owned(),
            recording: recording.map_or_else(|| PathBuf::from(beside), Path::to_owned),
            is_spare: recording.is_none(),
            is_empty: true,
        })
    }

    /// Where the run is recorded.
    pub fn recording(&self) -> &Path {
        &self.recording
    }

    /// From now on the recording is worth keeping.
    pub fn keep(&mut self) {
        self.is_empty = false;
    }

    /// Writes the page of a run that is over.
    pub fn write(mut self, registry: &Registry) -> anyhow::Result<()> {
        report::write(&self.recording, &self.path, registry, None).with_context(|| {
            let stays = if self.recording.exists() { "stays" } else { "was" };
            format!("the page can't be written, the recording {stays} in `{}`", self.recording.display())
        })?;
        self.is_empty = true;
        Ok(())
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        if self.is_spare && self.is_empty && !std::thread::panicking() {
            // It may not have been made yet.
            let _ = std::fs::remove_file(&self.recording);
        }
    }
}

/// What a recording is told at the begin of its run: when it was, and what was asked for.
pub fn first_words() -> BTreeMap<String, String> {
    let command: Vec<String> = std::env::args().collect();
    let now = SystemTime::now();
    let begun_unix_ns = now.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let words = [("date", utc(now)), (BEGUN, begun_unix_ns.to_string()), ("command", command.join(" "))];
    words.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
}

/// What a recording is told at the end of its run: what no column has.
pub fn last_words(
    summary: &Summary,
    ended: &Result<(), RunError>,
    recorded: &RunRecorded,
) -> BTreeMap<String, String> {
    let mut words = vec![
        ("cycles", summary.cycles.to_string()),
        ("lost_frames", summary.lost_frames.to_string()),
        ("overruns", summary.overruns.to_string()),
        ("records_dropped", recorded.dropped.to_string()),
        ("realtime_factor", summary.realtime_factor.to_string()),
    ];
    let timing = &summary.timing;
    let worst = [
        ("worst_wake_up", &timing.wake_up_ns),
        ("worst_round_trip", &timing.round_trip_ns),
        ("worst_compute", &timing.compute_ns),
        ("worst_dc_phase", &timing.dc_phase_ns),
    ];
    words.extend(
        worst.into_iter().filter_map(|(key, measured)| Some((key, measured.as_ref()?.worst.to_string()))),
    );
    if let Some(measured) = &summary.measured {
        let pose = measured.pose.map(|number| number.to_string());
        words.push((MEASURED, pose.join(" ")));
    }
    if let Err(error) = ended {
        words.push(("ended_early", error.to_string()));
    }
    words.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
}

/// An instant as `2026-11-21 07:30 UTC`.
fn utc(instant: SystemTime) -> String {
    let Moment { year, month, day, hour, minute, .. } = Moment::of(instant);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, UNIX_EPOCH};

    #[test]
    fn a_recording_goes_with_the_run_that_had_no_cycle_unless_somebody_asked_for_it() {
        let folder = std::env::temp_dir().join(format!("omnibase-page-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (path, asked_for) = (folder.join("run.html"), folder.join("run.mcap"));
        let left = |recording: Option<&Path>, had_cycles: &[()]| {
            let mut page = Page::begin(&path, recording).unwrap();
            let recording = page.recording().to_owned();
            std::fs::write(&recording, "a recording").unwrap();
            had_cycles.iter().for_each(|()| page.keep());
            drop(page);
            recording.exists()
        };
        assert!(!left(None, &[]));
        assert!(left(None, &[()]));
        assert!(left(Some(&asked_for), &[]));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn days_are_those_of_the_calendar() {
        // By `date -u -d @SECONDS`.
        for (seconds, expected) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_399, "2000-02-28 23:59 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
            (1_798_761_599, "2026-12-31 23:59 UTC"),
        ] {
            assert_eq!(utc(UNIX_EPOCH + Duration::from_secs(seconds)), expected);
        }
    }
}
