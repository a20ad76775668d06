//! What `omnibase run` says where it can't run.

use super::support::{PATIENT, Program, Scratch, repository};
use omnibase_host::Namespace;
use std::process::Command;

/// What a run along a circle says before it fails.
fn refused(robot: &str, more: &[&str]) -> String {
    let arguments = [&["run", robot, "--circle", "radius_m=0.3,duration_s=6"], more].concat();
    let run = Program::omnibase(&arguments).end();
    assert_eq!(run.status.code(), Some(1), "{run:?}");
    run.said
}

#[track_caller]
fn contains(said: &str, expected: &[&str]) {
    for words in expected {
        assert!(said.contains(words), "`{words}` is missing in\n{said}");
    }
}

#[test]
fn a_cable_without_drives_and_an_interface_that_is_not_there_are_named() {
    let Some(namespace) = Namespace::for_test("a_cable_without_drives") else { return };
    let robot = repository("robots/bmm.toml");
    namespace.run(|| {
        let said = refused(&robot, &["--interface", "eth77"]);
        contains(&said, &["error: no network interface `eth77`; there are: veth1, veth0"]);
        let said = refused(&robot, &["--interface", Namespace::NEAR]);
        contains(&said, &["error: no SubDevice found: nothing came back"]);
        namespace.ip("link set veth1 down").unwrap();
        let said = refused(&robot, &["--interface", Namespace::NEAR]);
        contains(&said, &["error: no SubDevice found: the link is down"]);
    });
}

#[test]
fn missing_rights_name_the_capability_and_the_command() {
    let program = env!("CARGO_BIN_EXE_omnibase");
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--clear-groups", program, "run", &repository("robots/bmm.toml")]);
    command.args(["--circle", "radius_m=0.3,duration_s=6", "--interface", "lo"]);
    let run = Program::start(command).end();
    if run.said.contains("setpriv:") {
        eprintln!("SKIPPED: setpriv can't take the rights away here: {}", run.said);
        return;
    }
    contains(
        &run.said,
        &[
            "CAP_NET_RAW is missing",
            &format!("sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {program}"),
        ],
    );
}

#[test]
fn fewer_more_and_other_subdevices_than_the_file_says_are_named_by_position() {
    let Some(namespace) = Namespace::for_test("fewer_more_and_other_subdevices") else { return };
    let robot = repository("robots/bmm.toml");
    let cases: [(&str, &[&str]); 3] = [
        (
            "[[subdevice]]\nkind = \"sgdv\"\ncount = 2\n",
            &["3 SubDevices are configured, 2 are there", "SubDevice 2", "(wheel_3) is missing"],
        ),
        (
            "[[subdevice]]\nkind = \"sgdv\"\ncount = 4\n",
            &["3 SubDevices are configured, 4 are there", "SubDevice 3 (", "has no configuration"],
        ),
        (
            "[[subdevice]]\nkind = \"sgdv\"\n[[subdevice]]\nkind = \"servo\"\n[[subdevice]]\nkind = \"sgdv\"\n",
            &["SubDevice 1", "(wheel_2)", "0x02200001", "0x00000402"],
        ),
    ];
    for (text, expected) in cases {
        let file = Scratch::new("segment.toml");
        std::fs::write(&file.0, text).unwrap();
        namespace.run(|| {
            let _simulator = Program::simulate(&[file.path()]);
            contains(&refused(&robot, &["--interface", Namespace::NEAR]), expected);
        });
    }
}

#[test]
fn a_drive_that_refuses_a_state_is_named_with_its_status_code() {
    // No SYNC0 of 5 ms for an SGDV, of which the file doesn't know that it is one.
    let changes = [
        "bus.cycle_us=5000",
        "drive_defaults.device=cia402",
        "drive_defaults.vendor_id=\"0x0539\"",
        "drive_defaults.product_code=\"0x02200001\"",
        "drive_defaults.counts_per_revolution=1048576",
    ];
    let more: Vec<&str> = changes.iter().flat_map(|change| ["--set", *change]).collect();
    let said = refused(&repository("robots/bmm.toml"), &more);
    contains(&said, &["SAFE-OP", "SubDevice 0", "0x0035", "cycle"]);
}

#[test]
fn a_drive_in_fault_is_named_with_its_error_code() {
    let robot = repository("robots/bmm.toml");
    let Some(namespace) = Namespace::for_test("a_drive_in_fault_is_named") else { return };
    let said = namespace.run(|| {
        let mut simulator = Program::simulate(&[&robot, "--fault", "drive-fault@1:4:0x7500"]);
        let fixed = ["--interface", Namespace::NEAR, "--realtime"];
        let run = Program::omnibase(
            &[&["run", &robot, "--circle", "radius_m=0.3,duration_s=12"], &fixed[..], &PATIENT].concat(),
        );
        simulator.wait_for("fault: drive-fault@1:4:0x7500");
        run.end().said
    });
    contains(&said, &["error: the robot stopped: ", "wheel_2: ", "it says error 0x7500 (communication"]);
}
