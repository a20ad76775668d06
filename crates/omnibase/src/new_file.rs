//! Files that mustn't exist yet: what is there is left alone, be it the only copy of something.

use anyhow::Context;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Whether a new file can be made there, told before anything else is done for it.
pub fn check(path: &Path) -> anyhow::Result<()> {
    let made = File::create_new(path).and_then(|_| std::fs::remove_file(path));
    made.with_context(|| refusal(path))
}

/// Writes a new file, and has it on the disk for certain.
pub fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let kept = File::create_new(path).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    kept.with_context(|| refusal(path))
}

fn refusal(path: &Path) -> String {
    format!("writing `{}`, a new file: nothing that exists is written over", path.display())
}
