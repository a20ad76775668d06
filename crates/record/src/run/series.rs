//! A run in several files, each of which is read alone: their names, and which of them are kept.

use std::io;
use std::path::{Path, PathBuf};

/// The key under which each file of a run in several files says which one it is, from 1.
pub const FILE_NUMBER: &str = "file_number";
/// Digits of a file's number.
const DIGITS: usize = 5;

/// How long a file may become, and how many of them are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rotation {
    /// Bytes of a file, at most; what is longer goes on in the next one.
    pub file_bytes: u64,
    /// Files that are kept, the open one among them; the oldest goes before another begins. `None`: all.
    pub files: Option<u32>,
}

/// The name of a run's file with that number: `run-00001.mcap`.
pub(super) fn numbered(path: &Path, number: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |text| format!(".{}", text.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number:0DIGITS$}{extension}"))
}

/// Removes the files that an earlier run left under the same name, as a single file would be overwritten.
pub(super) fn remove_all(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let is_of_series = number(path, &entry.path()).is_some();
        if is_of_series && entry.file_type()?.is_file() {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// The number of a file of the series of `path`. One with more digits, as a date, is somebody else's.
fn number(path: &Path, file: &Path) -> Option<u32> {
    let digits = file.file_stem()?.to_str()?.rsplit_once('-')?.1;
    let number = Some(digits)
        .filter(|digits| digits.len() == DIGITS)?
        .parse()
        .ok()
        .filter(|_| digits.bytes().all(|byte| byte.is_ascii_digit()))?;
    (numbered(path, number).file_name() == file.file_name()).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_the_series_go() {
        let folder = std::env::temp_dir().join(format!("omnibase-series-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let of_series = ["run-00001.mcap", "run-00042.mcap"];
        let others = [
            "run.mcap",
            "run-1.mcap",
            "run-00001.txt",
            "run-a0001.mcap",
            "my-run-00001.mcap",
            "run-+0001.mcap",
            "run-20261122.mcap",
        ];
        for name in of_series.iter().chain(&others) {
            std::fs::write(folder.join(name), "").unwrap();
        }
        remove_all(&folder.join("run.mcap")).unwrap();
        let left = |names: &[&str]| names.iter().filter(|name| folder.join(name).exists()).count();
        assert_eq!((left(&of_series), left(&others)), (0, others.len()));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
