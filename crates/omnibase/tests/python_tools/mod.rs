//! A Python with packages that a test talks to, and commands that must succeed.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python with packages, in an environment of this name that is made once; `Err` says why there is none.
pub fn python(name: &str, packages: &[&str], imports: &str) -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let python = folder.join("bin/python");
    let has_packages =
        || Command::new(&python).args(["-c", imports]).output().is_ok_and(|output| output.status.success());
    if !has_packages() {
        successful(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
        successful(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(packages))?;
    }
    Ok(python)
}

/// The standard output of a command; `Err` is what it says where it fails.
pub fn successful(command: &mut Command) -> Result<Vec<u8>, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    let says = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(output.stdout) } else { Err(format!("{command:?}: {says}")) }
}
