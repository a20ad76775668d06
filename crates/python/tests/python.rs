//! The Python package as a user has it: the built module in its package, in a Python with numpy, pandas and gymnasium.

use std::path::{Path, PathBuf};
use std::process::Command;

use omnibase_host::Namespace;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Python with what the package is used with, as `.ci/python` makes it.
fn python() -> Option<PathBuf> {
    let python = root().join("target/python/bin/python");
    if !python.is_file() {
        omnibase_host::skipped("Python with numpy, pandas and gymnasium isn't there: .ci/python makes it");
        return None;
    }
    Some(python)
}

/// The package laid out as a wheel does: its sources with the module that cargo built for this test.
fn package(folder: &Path) {
    let built = std::env::current_exe().unwrap().with_file_name("libomnibase_python.so");
    assert!(built.is_file(), "{} is missing: cargo builds it for this test", built.display());
    let package = folder.join("omnibase");
    std::fs::create_dir_all(&package).unwrap();
    for entry in std::fs::read_dir(root().join("crates/python/python/omnibase")).unwrap() {
        let from = entry.unwrap().path();
        if from.is_file() {
            std::fs::copy(&from, package.join(from.file_name().unwrap())).unwrap();
        }
    }
    std::os::unix::fs::symlink(built, package.join("_omnibase.abi3.so")).unwrap();
}

/// Runs the tests of a file of this folder.
fn tests_pass(name: &str) {
    tests_pass_with(name, &[]);
}

/// The same with more in their environment.
fn tests_pass_with(name: &str, more: &[(&str, &str)]) {
    let Some(python) = python() else { return };
    let omnibase = std::env::current_exe().unwrap().parent().unwrap().with_file_name("omnibase");
    assert!(omnibase.is_file(), "{} is missing: cargo build --workspace", omnibase.display());
    let folder = tempfile::tempdir().unwrap();
    let site = folder.path().join("site");
    package(&site);
    let status = Command::new(python)
        .args(["-m", "unittest", "--quiet", name])
        .current_dir(root().join("crates/python/tests"))
        .env("PYTHONPATH", site)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("OMNIBASE_PROGRAM", omnibase)
        .env("OMNIBASE_FOLDER", folder.path())
        .env("XDG_RUNTIME_DIR", folder.path())
        .envs(more.iter().copied())
        .status();
    assert!(status.unwrap().success(), "{name}");
}

#[test]
fn a_robot_is_simulated_cycle_by_cycle() {
    tests_pass("simulation");
}

#[test]
fn many_robots_are_simulated_side_by_side() {
    tests_pass("side_by_side");
}

#[test]
fn recordings_are_arrays_and_tables() {
    tests_pass("recordings");
}

#[test]
fn gymnasium_takes_the_environments_for_its_own() {
    tests_pass("environments");
}

#[test]
fn wheels_poses_and_trajectories_are_computed() {
    tests_pass("geometry");
}

#[test]
fn a_running_robot_is_driven_and_seen() {
    tests_pass("running");
}

#[test]
fn a_bus_is_scanned_read_written_and_exchanged_with() {
    match Namespace::for_test("a_bus_is_scanned_read_written_and_exchanged_with") {
        Some(cable) => cable.run(|| tests_pass_with("bus", &[("OMNIBASE_CABLE", "1")])),
        // What needs no cable is tested all the same.
        None => tests_pass("bus"),
    }
}

#[test]
fn the_notebook_runs_and_the_types_are_those_of_the_module() {
    tests_pass("notebook");
}
