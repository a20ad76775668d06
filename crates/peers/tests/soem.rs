//! SOEM drives the simulated segment over a virtual cable: OP, process data, SDOs of all lengths, dictionary, SYNC0.

use omnibase_host::Namespace;
use omnibase_peers::{behind_a_cable, drives, makers, soem};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::simulated;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Python with `pysoem`, made by the first test that asks.
fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| {
        let python = soem::python(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("pysoem"));
        python.inspect_err(|reason| eprintln!("SKIPPED: SOEM: {reason}")).ok()
    });
    python.as_deref()
}

fn reaches_op_with(kind: &str, count: usize) {
    let Some(namespace) = Namespace::for_test("SOEM over a virtual cable") else { return };
    let Some(python) = python() else { return };
    let report =
        behind_a_cable(&namespace, drives(kind, count), || soem::drive(python, Namespace::NEAR, count))
            .unwrap();
    assert!(report.contains(&format!("\"subdevices\": {count}")), "{report}");
    assert!(report.contains("\"states\": [33, 35, 39]"), "{report}");
    assert!(report.contains("\"4096\": 4096"), "{report}");
}

#[test]
fn one_servo() {
    reaches_op_with("servo", 1);
}

#[test]
fn three_servos() {
    reaches_op_with("servo", 3);
}

#[test]
fn twenty_servos() {
    reaches_op_with("servo", 20);
}

#[test]
fn one_sgdv() {
    reaches_op_with("sgdv", 1);
}

#[test]
fn three_sgdv() {
    reaches_op_with("sgdv", 3);
}

#[test]
fn twenty_sgdv() {
    reaches_op_with("sgdv", 20);
}

#[test]
fn the_shipped_robot_with_terminals() {
    let Some(namespace) = Namespace::for_test("SOEM over a virtual cable") else { return };
    let Some(python) = python() else { return };
    // With the lift of the other shipped robot behind its wheels.
    let (_, lift) =
        include_str!("../../../robots/bmm_lift.toml").split_once("[[device]]\nname = \"lift\"").unwrap();
    let (lift, _) = lift.split_once("[[drive]]").unwrap();
    let lift = lift.replace("position = 4", "position = 7");
    let io = include_str!("../../../robots/bmm_io.toml");
    let text = format!("{io}\n[[device]]\nname = \"lift\"{lift}");
    let plan = RobotPlan::from_toml(&text, &Registry::with_built_in(), &|name| Err(name.to_owned())).unwrap();
    let (segment, _machine) = simulated::segment(&plan).unwrap();
    let report = behind_a_cable(&namespace, segment, || {
        soem::bring_up_terminals(python, Namespace::NEAR, 8, [1, 2], &[4, 5, 6, 7])
    })
    .unwrap();
    println!("{report}");
    // All eight in OP, the contact that is closed read, and every working counter as SOEM expects it.
    assert!(report.contains("\"states\": [8, 8, 8, 8, 8, 8, 8, 8]"), "{report}");
    assert!(report.contains("\"input\": \"01\"") && report.contains("\"full_cycles\": 100"), "{report}");
}

#[test]
fn all_devices_and_modules_of_real_makers_files() {
    let Some(namespace) = Namespace::for_test("SOEM over a virtual cable") else { return };
    let Some(python) = python() else { return };
    let Some(segments) = makers::segments() else { return };
    for made in segments {
        let makers::MadeOfFiles { segment, count, modules, commands } = made;
        let report =
            behind_a_cable(&namespace, segment, || soem::bring_up_with(python, Namespace::NEAR, &commands))
                .unwrap();
        println!("SOEM: {count} SubDevices with {modules} modules: {report}");
        assert!(report.contains(&format!("\"subdevices\": {count}, \"operational\": {count}")), "{report}");
        assert!(report.contains(&format!("\"commands\": {}", commands.len())), "{report}");
        assert!(report.contains("\"full_cycles\": 50"), "{report}");
    }
}
