//! One program of ours that writes a file at a time.
//!
//! The lock is a file beside it, locked by `flock`: everybody who sees the folder sees it, from another namespace too, and it
//! is free however its holder ends. What a killed holder leaves is taken over.

use std::fs::{File, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The sole use of a file, as long as the value lives.
#[derive(Debug)]
pub struct FileLock {
    /// Closing it ends the lock.
    _file: File,
    path: PathBuf,
}

/// Why it could not be had.
#[derive(Debug, thiserror::Error)]
pub enum FileLockError {
    /// Another program of ours has it.
    #[error("`{}` is in use by {}", .path.display(), .pid.map_or("another program of omnibase".to_owned(), |pid| format!("process {pid}")))]
    Held {
        /// The file.
        path: PathBuf,
        /// Its process; `None` where that didn't say so yet.
        pid: Option<u32>,
    },
    /// The operating system refused.
    #[error("`{}`: {cause}", .lock.display())]
    System {
        /// The lock beside the file.
        lock: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl FileLock {
    /// Takes a file, which needn't be there yet; its folder must be.
    pub fn take(path: &Path) -> Result<Self, FileLockError> {
        let mut name = path.as_os_str().to_owned();
        name.push(".lock");
        let lock = PathBuf::from(name);
        let failed = |cause| FileLockError::System { lock: lock.clone(), cause };
        loop {
            let options = File::options().create(true).truncate(false).read(true).write(true).open(&lock);
            let mut file = options.map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut text = String::new();
                    let pid = file.read_to_string(&mut text).ok().and_then(|_| text.trim().parse().ok());
                    return Err(FileLockError::Held { path: path.to_owned(), pid });
                }
                Err(TryLockError::Error(cause)) => return Err(failed(cause)),
            }
            // Whoever had it may have removed it in between: then this one locks nothing that others find.
            let own = file.metadata().map_err(failed)?.ino();
            if std::fs::metadata(&lock).is_ok_and(|there| there.ino() == own) {
                file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id())).map_err(failed)?;
                return Ok(FileLock { _file: file, path: lock });
            }
        }
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // Left behind it would lock nothing.
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_of_one_holder_until_this_ends_and_what_a_killed_one_left_is_taken_over() {
        let folder = std::env::temp_dir().join(format!("omnibase-file-lock-{}", std::process::id()));
        std::fs::create_dir(&folder).unwrap();
        let (mine, own) = (folder.join("mine.json"), std::process::id());
        let held = FileLock::take(&mine).unwrap();
        let refused = FileLock::take(&folder.join(".").join("mine.json")).unwrap_err();
        assert!(matches!(refused, FileLockError::Held { pid: Some(pid), .. } if pid == own), "{refused}");
        assert!(
            refused.to_string().ends_with(&format!("mine.json` is in use by process {own}")),
            "{refused}"
        );
        FileLock::take(&folder.join("other.json")).unwrap();
        drop(held);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0, "nothing is left behind");
        std::fs::write(folder.join("mine.json.lock"), "1").unwrap();
        FileLock::take(&mine).unwrap();
        assert!(matches!(FileLock::take(&folder.join("none/mine.json")), Err(FileLockError::System { .. })));
        std::fs::remove_dir(&folder).unwrap();
    }
}
