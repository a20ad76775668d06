//! The files in which a machine describes itself.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A machine, by its files below a root.
#[derive(Clone, Debug)]
pub struct Machine {
    root: PathBuf,
}

impl Default for Machine {
    /// This machine.
    fn default() -> Self {
        Machine { root: PathBuf::from("/") }
    }
}

impl Machine {
    /// A machine whose `/proc`, `/sys` and `/dev` stand below `root`.
    pub fn at(root: &Path) -> Self {
        Machine { root: root.to_owned() }
    }

    fn place(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// The text of a file without white space around it; `None` where it can't be read.
    pub(super) fn text(&self, path: &str) -> Option<String> {
        Some(fs::read_to_string(self.place(path)).ok()?.trim().to_owned())
    }

    /// The number in a file.
    pub(super) fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// The names in a folder, sorted, numbers by their value; empty where there is none.
    pub(super) fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.place(path)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort_by_key(|name| (name.len(), name.clone()));
        names
    }

    /// Whether a file or folder is there.
    pub(super) fn has(&self, path: &str) -> bool {
        self.place(path).exists()
    }

    /// The last part of the path to which a link leads.
    pub(super) fn link_name(&self, path: &str) -> Option<String> {
        let target = fs::read_link(self.place(path)).ok()?;
        Some(target.file_name()?.to_string_lossy().into_owned())
    }

    /// The whole path to which a link leads, links on the way resolved.
    pub(super) fn resolved(&self, path: &str) -> Option<String> {
        Some(fs::canonicalize(self.place(path)).ok()?.to_string_lossy().into_owned())
    }

    /// Whether this program may write a file; opens it, writes nothing.
    pub(super) fn may_write(&self, path: &str) -> bool {
        fs::File::options().write(true).open(self.place(path)).is_ok()
    }

    /// Replaces what a file says; kernels refuse it with a reason.
    pub(super) fn write(&self, path: &str, value: &str) -> io::Result<()> {
        fs::write(self.place(path), value)
    }

    /// The numbers of the CPUs that have a folder.
    pub(super) fn cpus(&self) -> Vec<usize> {
        let names = self.names("/sys/devices/system/cpu");
        names.iter().filter_map(|name| name.strip_prefix("cpu")?.parse().ok()).collect()
    }

    /// The value of a kernel option; an empty one for an option without value.
    pub(super) fn kernel_option(&self, name: &str) -> Option<String> {
        let line = self.text("/proc/cmdline")?;
        line.split_whitespace().find_map(|word| {
            let (key, value) = word.split_once('=').unwrap_or((word, ""));
            (key == name).then(|| value.to_owned())
        })
    }
}

/// The word in brackets of a list of choices, as `always [madvise] never`.
pub(super) fn chosen(choices: &str, brackets: [char; 2]) -> Option<&str> {
    let from = choices.find(brackets[0])? + 1;
    let length = choices[from..].find(brackets[1])?;
    Some(&choices[from..from + length])
}

/// The numbers of a list as the kernel writes it: `0,2-4`.
pub(super) fn cpu_list(text: &str) -> Vec<usize> {
    let ranges = text.split(',').filter_map(|part| {
        let (first, last) = part.trim().split_once('-').unwrap_or((part.trim(), part.trim()));
        Some((first.parse::<usize>().ok()?, last.parse::<usize>().ok()?))
    });
    // No machine has more; a made-up range must not fill the memory.
    ranges.flat_map(|(first, last)| first..=last.min(first.saturating_add(8191))).collect()
}
