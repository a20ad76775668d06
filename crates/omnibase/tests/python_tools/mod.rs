//! A Python with packages that a test talks to, and commands that must succeed.

#[path = "../../../host/src/skipped.rs"]
pub mod skipped;

use skipped::skipped;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python with packages: that of `.ci/python` where it has them, else one in an environment of this name that is made once;
/// where it can't be had, the test is skipped and gets `None`.
pub fn python(name: &str, packages: &[&str], imports: &str) -> Option<PathBuf> {
    let lacking = |why: &String| skipped(format_args!("no Python with {}: {why}", packages.join(", ")));
    found_or_made(name, packages, imports).inspect_err(lacking).ok()
}

fn found_or_made(name: &str, packages: &[&str], imports: &str) -> Result<PathBuf, String> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (shared, own) = (target.with_file_name("python"), target.join(name));
    let [shared, python] = [&shared, &own].map(|folder| folder.join("bin/python"));
    let has_packages = |python: &Path| {
        Command::new(python).args(["-c", imports]).output().is_ok_and(|output| output.status.success())
    };
    if has_packages(&shared) {
        return Ok(shared);
    }
    if !has_packages(&python) {
        successful(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&own))?;
        successful(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(packages))?;
        successful(Command::new(&python).args(["-c", imports]))?;
    }
    Ok(python)
}

/// The standard output of a command; `Err` is what it says where it fails.
pub fn successful(command: &mut Command) -> Result<Vec<u8>, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    let says = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(output.stdout) } else { Err(format!("{command:?}: {says}")) }
}
