//! SOEM drives the simulated segment over a virtual cable: OP, process data, SDOs of all lengths, dictionary, SYNC0.

use omnibase_ethercat::mailbox::{FileAccess, MailboxRequest};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_host::{MonotonicClock, Namespace, PacketSocket};
use omnibase_peers::{behind_a_cable, drives, makers, soem};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::simulated;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

#[path = "../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;

/// Python with `pysoem`, made by the first test that asks.
fn python() -> Option<&'static Path> {
    static PYTHON: LazyLock<Option<PathBuf>> =
        LazyLock::new(|| python_tools::python("pysoem", &["pysoem==1.1.13"], "import pysoem"));
    PYTHON.as_deref()
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

/// An EEPROM that SOEM wrote is what our MainDevice reads, and the other way round; so is a firmware by FoE.
#[test]
fn what_one_writes_the_other_reads() {
    let Some(namespace) = Namespace::for_test("SOEM over a virtual cable") else { return };
    let Some(python) = python() else { return };
    let firmware: Vec<u8> = (0..3000u32).map(|n| (n % 241) as u8).collect();
    let part = |report: &str, key: &str| -> Vec<u8> {
        let (_, rest) =
            report.split_once(&format!("\"{key}\": \"")).unwrap_or_else(|| panic!("{key}: {report}"));
        let digits = rest.split('"').next().unwrap_or_default();
        let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
        (0..digits.len()).step_by(2).map(byte).collect()
    };
    behind_a_cable(&namespace, drives("servo", 1), || {
        let report = soem::write_into(python, Namespace::NEAR, 0x1234, &firmware).unwrap();
        assert_eq!(part(&report, "firmware"), firmware);
        let socket = PacketSocket::open(Namespace::NEAR).unwrap();
        let mut bus = Bus::new(socket, MonotonicClock, BusOptions::default());
        bus.scan().unwrap();
        let ours = bus.read_sii(0).unwrap();
        assert_eq!(ours[..128], part(&report, "after"));
        assert_eq!(ours[8..10], [0x34, 0x12]);
        // Its checksum is right by our own reckoning, or no alias could be written beside it.
        let wanted = bus.sii_with_alias(0, 0x0777).unwrap().expect("the checksum that SOEM wrote is right");
        bus.write_sii(0, &ours, &wanted).unwrap();
        bus.enter_boot(0).unwrap();
        let file = FileAccess { name: "firmware.bin".to_owned(), password: 0 };
        let read = MailboxRequest::read_file(file, Vec::with_capacity(2 * firmware.len()));
        assert_eq!(bus.transfer_file(0, read, &mut |_| {}).unwrap(), firmware);
        drop(bus);
        let report = soem::write_into(python, Namespace::NEAR, 0x0042, &[]).unwrap();
        assert_eq!(part(&report, "before"), wanted[..128]);
    });
}
