//! SOEM, driven by a Python script through `pysoem`, in a virtual environment below the target folder.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The version of `pysoem` that the tests are written for.
const PYSOEM: &str = "pysoem==1.1.13";

/// A Python with `pysoem`; `Err` says why there is none.
///
/// The environment is made once, in `folder`.
pub fn python(folder: &Path) -> Result<PathBuf, String> {
    let python = folder.join("bin/python");
    let has_pysoem = |python: &Path| {
        Command::new(python)
            .args(["-c", "import pysoem"])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    if has_pysoem(&python) {
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
    run(Command::new(&python).args(["-m", "pip", "install", "--quiet", PYSOEM]))?;
    if has_pysoem(&python) { Ok(python) } else { Err("pysoem was installed but can't be imported".into()) }
}

fn run(command: &mut Command) -> Result<Output, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(output);
    }
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

/// Lets SOEM drive the `count` drives behind `interface`; the script's JSON report, or what failed.
pub fn drive(python: &Path, interface: &str, count: usize) -> Result<String, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/soem.py");
    let output = run(Command::new(python).arg(script).arg(interface).arg(count.to_string()))?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
