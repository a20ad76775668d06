//! Files of the command line, with their names in what is said of them.

use anyhow::Context;
use omnibase_run::small_file;
use std::path::Path;

/// The largest image of an EEPROM, bytes: its size is a word of KiBit (ETG.1000.6, SII).
pub const EEPROM: u64 = 8 << 20;
/// The largest firmware, bytes: more than any SubDevice has memory for.
pub const FIRMWARE: u64 = 256 << 20;

/// The text of a robot's, a segment's or a motion's file.
pub fn text(path: &Path) -> anyhow::Result<String> {
    small_file::text(path).with_context(|| format!("reading `{}`", path.display()))
}

/// What a file holds; one of more than `most` bytes is refused, be it endless.
pub fn read(path: &Path, most: u64) -> anyhow::Result<Vec<u8>> {
    small_file::read(path, most).with_context(|| format!("reading `{}`", path.display()))
}
