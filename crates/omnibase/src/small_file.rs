//! Files of a known kind, whose size is known to have an end.

use anyhow::{Context, anyhow, ensure};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The largest image of an EEPROM, bytes: its size is a word of KiBit (ETG.1000.6, SII).
pub const EEPROM: u64 = 8 << 20;
/// The largest firmware, bytes: more than any SubDevice has memory for.
pub const FIRMWARE: u64 = 256 << 20;
/// The longest file of a robot or a segment, bytes: more than anybody has written.
const TEXT: u64 = 64 << 20;

/// The text of a robot's or a segment's file.
pub fn text(path: &Path) -> anyhow::Result<String> {
    let not_text = |_| anyhow!("`{}` is no text (UTF-8)", path.display());
    String::from_utf8(read(path, TEXT)?).map_err(not_text)
}

/// What a file holds; one of more than `most` bytes is refused, be it endless.
pub fn read(path: &Path, most: u64) -> anyhow::Result<Vec<u8>> {
    let shown = path.display();
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
    read.with_context(|| format!("reading `{shown}`"))?;
    ensure!(
        bytes.len() as u64 <= most,
        "`{shown}` has more than {most} bytes, which is as many as such a file can have"
    );
    Ok(bytes)
}
