//! Simulated segments from files.

use crate::progress::note;
use crate::small_file;
use omnibase_ethercat_sim::segment_file::{SegmentFile, line_of_images};
use omnibase_ethercat_sim::{Pace, Segment};
use std::path::{Path, PathBuf};

/// Reads a segment file, foreign firmware at this pace; everything that is wrong in it comes at once, each with file, line and column.
pub fn load(path: &Path, pace: Pace) -> anyhow::Result<Segment> {
    let text = small_file::text(path)?;
    let base = path.parent().unwrap_or(Path::new("."));
    let build = |file: SegmentFile| {
        let sockets = file.sub_devices.iter().filter_map(|entry| entry.socket.as_ref());
        let sockets: Vec<_> = sockets.map(|path| path.display().to_string()).collect();
        if pace == Pace::Lockstep && !sockets.is_empty() {
            note(format_args!("waits for the firmware that connects to {}", sockets.join(", ")));
        }
        file.build_paced(base, pace)
    };
    SegmentFile::parse(&text).and_then(build).map_err(|error| {
        let places: Vec<String> =
            error.problems.iter().map(|problem| format!("{}:{problem}", path.display())).collect();
        anyhow::Error::msg(places.join("\n       "))
    })
}

/// Whether a file describes a robot: segment files know no platform and no limits.
pub fn is_robot(path: &Path) -> anyhow::Result<bool> {
    let text = small_file::text(path)?;
    // Where it isn't even TOML, whoever reads it as a segment file says so.
    Ok(text
        .parse::<toml::Table>()
        .is_ok_and(|table| ["platform", "drive", "limits"].iter().any(|key| table.contains_key(*key))))
}

/// A line of devices from SII images.
pub fn from_images(paths: &[PathBuf]) -> anyhow::Result<Segment> {
    let mut images = Vec::with_capacity(paths.len());
    for path in paths {
        images.push(small_file::read(path, small_file::EEPROM)?);
    }
    Ok(line_of_images(&images)?)
}
