//! That a person stopped the robot under the bridge, kept for the bridge that is started in its place.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::time::SystemTime;

/// By so much two reckonings of when a run began differ at most, ms.
const SAME_RUN_MS: u64 = 1000;

/// A file that is there while `cmd_vel` may move nothing.
pub struct Memory {
    path: PathBuf,
    is_there: bool,
}

impl Memory {
    /// Of a node's full name, for this user.
    pub fn new(node: &str) -> Memory {
        let folder = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
        let folder = folder.map_or_else(std::env::temp_dir, PathBuf::from);
        let user = rustix::process::getuid().as_raw();
        let path = folder.join(format!("omnibase-ros2-{user}{}.stopped", node.replace('/', "-")));
        Memory { path, is_there: false }
    }

    /// Why the bridge before this one had to stop, where that was in the same run; `clock_ms` is the robot's.
    pub fn read(&mut self, clock_ms: u64) -> Option<String> {
        let text = fs::read_to_string(&self.path).ok()?;
        self.is_there = true;
        let (began_ms, why) = text.split_once(' ')?;
        let began_ms: u64 = began_ms.parse().ok()?;
        (began_ms.abs_diff(began(clock_ms)) < SAME_RUN_MS).then(|| why.to_owned())
    }

    /// Keeps it. Where that can't be written the bridge itself knows it still.
    pub fn keep(&mut self, clock_ms: u64, why: &str) {
        let text = format!("{} {why}", began(clock_ms));
        // In a folder that is everybody's the name may be somebody's link to elsewhere.
        let flags = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .mode(0o600)
            .custom_flags(flags)
            .open(&self.path);
        if let Err(error) = file.and_then(|mut file| file.write_all(text.as_bytes())) {
            eprintln!("warning: {}: {error}", self.path.display());
        }
        self.is_there = true;
    }

    /// A person enabled it.
    pub fn forget(&mut self) {
        if std::mem::take(&mut self.is_there) {
            // It may be gone already.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// When a run began, ms since 1970.
fn began(clock_ms: u64) -> u64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    (now.as_millis() as u64).saturating_sub(clock_ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_known_to_the_next_bridge_of_the_same_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stopped");
        let memory = || Memory { path: path.clone(), is_there: false };
        assert_eq!(memory().read(5000), None);
        memory().keep(5000, "a stop was asked for");
        assert_eq!(memory().read(5100).as_deref(), Some("a stop was asked for"));
        // A link isn't followed.
        let (link, elsewhere) = (folder.path().join("link"), folder.path().join("elsewhere"));
        std::os::unix::fs::symlink(&elsewhere, &link).unwrap();
        Memory { path: link, is_there: false }.keep(5000, "a stop was asked for");
        assert!(!elsewhere.exists());
        // Another run.
        assert_eq!(memory().read(100), None);
        let mut next = memory();
        assert!(next.read(5000).is_some());
        next.forget();
        assert_eq!(memory().read(5000), None);
    }
}
