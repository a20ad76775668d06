//! `scan`, `sdo`, `exchange` and `simulate` as a user runs them: on simulated segments in virtual time, and over a
//! virtual cable (skipped loudly without the rights for one).

mod field;
mod memory;

use omnibase_ethercat_wire::sii;
use omnibase_host::Namespace;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

fn omnibase(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_omnibase")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn segment(name: &str) -> String {
    format!("{}/../../segments/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn sim(name: &str) -> String {
    format!("sim:{}", segment(name))
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn scratch(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("omnibase-{}-{name}", std::process::id()))
}

#[test]
fn scan_prints_every_subdevice_as_json_with_numbers_as_numbers() {
    let found = json(&omnibase(&["scan", &sim("three-sgdv"), "--json"]));
    let subdevices = found["subdevices"].as_array().unwrap();
    assert_eq!(subdevices.len(), 3);
    for (position, one) in subdevices.iter().enumerate() {
        let promised = [
            "position",
            "name",
            "vendor_id",
            "product_code",
            "revision",
            "serial",
            "alias",
            "state",
            "ports",
            "sync_managers",
            "fmmus",
            "pdos",
        ];
        for key in promised {
            assert!(!one[key].is_null(), "{key} is missing: {:?}", keys(one));
        }
        assert_eq!(one["position"].as_u64(), Some(position as u64));
        assert_eq!(one["vendor_id"].as_u64(), Some(0x0539));
        assert_eq!(one["product_code"].as_u64(), Some(0x0220_0001));
        assert_eq!(one["alias"].as_u64(), Some(position as u64 + 1));
        assert_eq!(one["state"].as_str(), Some("PRE-OP"));
        assert_eq!(one["sync_managers"].as_array().unwrap().len(), 4);
        assert_eq!(one["pdos"][0]["entries"][0]["index"].as_u64(), Some(0x6040));
        assert!(one.get("dictionary").is_none());
    }
}

#[test]
fn scan_reads_the_dictionary_with_its_values() {
    let found = json(&omnibase(&["scan", &sim("three-sgdv"), "--json", "--dictionary"]));
    let dictionary = found["subdevices"][1]["dictionary"].as_array().unwrap();
    let object =
        |index: u64| dictionary.iter().find(|object| object["index"].as_u64() == Some(index)).unwrap();
    assert_eq!(object(0x1008)["entries"][0]["value"].as_str(), Some("SGDV-OCA01A"));
    assert_eq!(object(0x1018)["entries"][2]["value"].as_u64(), Some(0x0220_0001));
    assert!(dictionary.iter().all(|object| object.get("error").is_none()));
    let words = omnibase(&["scan", &sim("three-sgdv"), "--dictionary"]);
    assert!(text(&words.stdout).contains("6041:00   r--i Statusword"), "{}", text(&words.stdout));
}

#[test]
fn scan_shows_a_tree() {
    let words = text(&omnibase(&["scan", &sim("mixed-tree")]).stdout);
    for expected in
        ["0 Coupler", "hangs at  port 2 of SubDevice 0", "ports     0 MII open; 1 EBUS open; 2 MII open"]
    {
        assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
    }
}

#[test]
fn sdo_reads_and_writes_with_the_types_of_the_dictionary() {
    let target = sim("three-sgdv");
    let read = omnibase(&["sdo", "read", &target, "0", "1008:0", "6064:0", "1018:1"]);
    assert_eq!(read.status.code(), Some(0));
    assert_eq!(text(&read.stdout), "1008:00 \"SGDV-OCA01A\"\n6064:00 524288\n1018:01 1337 (0x00000539)\n");

    let read = json(&omnibase(&["sdo", "read", &target, "0", "6064:0", "--json"]));
    let expected = serde_json::json!({"objects": [
        {"index": 0x6064, "subindex": 0, "type": "i32", "value": 524_288, "data": "00000800"}
    ]});
    assert_eq!(read, expected);

    let write = omnibase(&["sdo", "write", &target, "2", "6060:0", "8", "607a:0", "-5"]);
    assert_eq!(text(&write.stdout), "6060:00 written: 8\n607a:00 written: -5\n", "{}", text(&write.stderr));

    let complete = omnibase(&["sdo", "read", &target, "0", "1c12", "--complete"]);
    assert!(text(&complete.stdout).starts_with("1c12:00 01 00 00 16"), "{}", text(&complete.stdout));
}

#[test]
fn sdo_refusals_come_in_words_and_the_other_objects_all_the_same() {
    let target = sim("three-sgdv");
    let cases: [(&[&str], &str); 5] = [
        (&["sdo", "read", &target, "0", "9999:0", "1008:0"], "0x06020000 the object does not exist"),
        (&["sdo", "read", &target, "7", "1008:0"], "there is no SubDevice 7: the segment has 3"),
        (
            &["sdo", "write", &target, "0", "6060:0", "300"],
            "`300` is no value of type i8 (-128 to 127, or 0x...)",
        ),
        (&["sdo", "write", &target, "0", "6041:0", "0"], "attempt to write a read-only object"),
        (&["sdo", "write", &target, "0", "6060:0", "8", "607a:0"], "the value for `607a:0` is missing"),
    ];
    for (arguments, expected) in cases {
        let output = omnibase(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(text(&output.stderr).contains(expected), "{arguments:?}: {}", text(&output.stderr));
    }
    let partly = omnibase(cases[0].0);
    assert_eq!(text(&partly.stdout), "1008:00 \"SGDV-OCA01A\"\n");
    let partly = omnibase(&["sdo", "write", &target, "0", "6060:0", "8", "6041:0", "0", "--json"]);
    assert_eq!(partly.status.code(), Some(1));
    let written: Value = serde_json::from_slice(&partly.stdout).expect("what was written before it");
    assert_eq!(written["objects"][0]["index"], 0x6060);
    assert_eq!(omnibase(&["sdo", "read", &target, "0", "xyz"]).status.code(), Some(2));
    assert_eq!(omnibase(&["sdo", "read", &target, "0"]).status.code(), Some(2));
}

#[test]
fn exchange_cycles_three_sgdv_with_clocks_and_without_forbidden_commands() {
    let run = || omnibase(&["exchange", &sim("three-sgdv"), "--dc", "--cycles", "2000", "--json"]);
    let first = run();
    let found = json(&first);
    let promised = [
        "operational",
        "cycles",
        "damage",
        "surplus",
        "lost_frames",
        "not_operational",
        "working_counter_errors",
        "frames_per_cycle",
        "round_trip_ns",
        "wakeup_ns",
        "dc_phase_ns",
        "timing",
        "pauses",
        "commands_used",
    ];
    let mut promised = promised.to_vec();
    promised.sort_unstable();
    assert_eq!(keys(&found), promised);
    assert_eq!(found["operational"].as_bool(), Some(true));
    assert_eq!(found["cycles"].as_u64(), Some(2000));
    assert_eq!((found["lost_frames"].as_u64(), found["working_counter_errors"].as_u64()), (Some(0), Some(0)));
    assert_eq!(found["frames_per_cycle"].as_u64(), Some(1));
    for measure in ["round_trip_ns", "wakeup_ns", "dc_phase_ns"] {
        assert_eq!(keys(&found[measure]), ["max", "p50", "p99", "p999"]);
        assert!(found[measure]["max"].is_u64(), "{measure}");
    }
    for (short, name) in [("wakeup_ns", "wake_up_ns"), ("dc_phase_ns", "dc_phase_ns")] {
        assert_eq!(found[short]["p99"], found["timing"][name]["p99"]);
    }
    // Virtual time: within a few microseconds although the drives' clocks drift by 50 ppm.
    assert!(found["dc_phase_ns"]["max"].as_u64().unwrap() < 10_000, "{found}");
    let used: Vec<&str> =
        found["commands_used"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    for needed in ["FRMW", "LWR", "LRD"] {
        assert!(used.contains(&needed), "{used:?}");
    }
    for forbidden in ["LRW", "APRW", "FPRW", "BRW"] {
        assert!(!used.contains(&forbidden), "{used:?}");
    }
    assert_eq!(run().stdout, first.stdout, "the same segment gives the same bytes");
}

/// Names of what was measured of the cycles, as a command prints them.
fn measured_names(arguments: &[&str]) -> Vec<String> {
    let shown = text(&omnibase(arguments).stdout);
    let lines = shown.lines().filter(|line| line.contains(" p50 "));
    lines.map(|line| line[..line.find(" p50 ").unwrap()].trim_end().to_owned()).collect()
}

#[test]
fn exchange_and_run_show_the_same_figures_of_their_cycles_by_the_same_names() {
    let exchange = ["exchange", &sim("three-sgdv"), "--dc", "--cycles", "500"];
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    let run = ["run", robot, "--circle", "radius_m=0.1,duration_s=4"];
    let of_run = measured_names(&run);
    assert_eq!(of_run, ["wake-up late by", "round trip", "computing", "DC phase error"]);
    // Without a robot nothing is computed.
    let shared: Vec<String> = of_run.into_iter().filter(|name| name != "computing").collect();
    assert_eq!(measured_names(&exchange), shared);
    let [of_exchange, of_run] = [&exchange[..], &run]
        .map(|arguments| json(&omnibase(&[arguments, &["--json"]].concat()))["timing"].clone());
    assert_eq!(keys(&of_exchange), keys(&of_run));
    for name in ["wake_up_ns", "round_trip_ns", "dc_phase_ns"] {
        assert_eq!(keys(&of_exchange[name]), keys(&of_run[name]), "{name}");
    }
}

#[test]
fn exchange_uses_lrw_where_all_allow_it_and_says_in_words_what_it_saw() {
    let output = omnibase(&["exchange", &sim("three-servos"), "--cycles", "100", "--cycle-us", "250"]);
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(
        shown.contains("  2 CiA402-Servo             vendor 0x00000f0f product 0x00000402, 128 bits out"),
        "{shown}"
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let words = text(&output.stdout);
    for expected in [
        "operational             yes",
        "cycles                  100 of 250.000 us, 3 SubDevices, 1 frames each",
        "lost frames             0",
        "LRW",
        "round trip              p50",
    ] {
        assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
    }
}

#[test]
fn what_exchange_records_decodes_without_loss() {
    let path = scratch("exchange.pcapng");
    let file = path.to_str().unwrap();
    let run = omnibase(&["exchange", &sim("three-sgdv"), "--dc", "--cycles", "500", "--record", file]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let decoded = json(&omnibase(&["decode", file, "--json", "--summary"]));
    std::fs::remove_file(path).unwrap();
    let summary = &decoded["summary"];
    assert_eq!(summary["requests"], summary["replies"]);
    assert_eq!(summary["matched"], summary["requests"]);
    assert_eq!((summary["lost_frames"].as_u64(), summary["malformed"].as_u64()), (Some(0), Some(0)));
    let period = summary["cycle"]["period_ns"]["p50"].as_u64().unwrap();
    assert!(period.abs_diff(1_000_000) < 1000, "{period}");
}

#[test]
fn broken_segment_files_are_refused_with_file_and_line() {
    let path = scratch("broken.toml");
    std::fs::write(&path, "[[subdevice]]\nkind = \"sgvd\"\n").unwrap();
    for command in [&["scan"][..], &["exchange"], &["sdo", "read"]] {
        let target = format!("sim:{}", path.display());
        let more: &[&str] = if command[0] == "sdo" { &["0", "1008:0"] } else { &[] };
        let output = omnibase(&[command, &[&target], more].concat());
        assert_eq!(output.status.code(), Some(1), "{command:?}");
        let expected =
            format!("{}:2:8: \"sgvd\" is no kind of subdevice; did you mean \"sgdv\"?", path.display());
        assert!(text(&output.stderr).contains(&expected), "{}", text(&output.stderr));
    }
    std::fs::remove_file(path).unwrap();
    let missing = omnibase(&["scan", "sim:/no/such.toml"]);
    assert!(
        text(&missing.stderr).contains("reading `/no/such.toml`: No such file"),
        "{}",
        text(&missing.stderr)
    );
}

#[test]
fn an_exchange_that_would_never_work_is_told_before_it_begins() {
    for (arguments, told) in [
        (
            &["--dc", "--shift-us", "1000"][..],
            "--shift-us 1000: a place in the cycle, less than --cycle-us 1000 either way",
        ),
        (&["--dc", "--shift-us", "-2000"], "--shift-us -2000: a place in the cycle"),
        (
            &["--watchdog-ms", "1"],
            "--watchdog-ms 1: SubDevices would go safe by themselves between two frames 1000 us apart; at least 2, or 0 for none",
        ),
        (&["--cycle-us", "60000", "--watchdog-ms", "100"], "at least 120, or 0 for none"),
    ] {
        let run = omnibase(&[&["exchange", &sim("three-sgdv"), "--cycles", "5"], arguments].concat());
        assert_eq!(run.status.code(), Some(1), "{arguments:?}");
        assert!(text(&run.stderr).contains(told), "{}", text(&run.stderr));
    }
    // Where nothing is said of it, the watchdog is as long as the cycle needs.
    let slow = omnibase(&["exchange", &sim("three-servos"), "--cycles", "5", "--cycle-us", "60000"]);
    assert_eq!(slow.status.code(), Some(0), "{}", text(&slow.stderr));
}

#[test]
fn wrong_usage_is_code_2_and_help_has_examples() {
    let wrong: [&[&str]; 9] = [
        &["scan"],
        &["scan", "sim:"],
        &["exchange", "eth0", "--cycle-us", "1"],
        &["exchange", "eth0", "--busy-poll"],
        &["exchange", "eth0", "--watchdog-ms", "7000"],
        &["simulate", "--interface", "eth0"],
        &["simulate", "a.toml"],
        &["simulate", "a.toml", "--sii", "b.bin", "--interface", "eth0"],
        &["simulate", "a.toml", "--interface", "eth0", "--fault", "fire@1:1"],
    ];
    for arguments in wrong {
        assert_eq!(omnibase(arguments).status.code(), Some(2), "{arguments:?}");
    }
    for command in [
        &["scan"][..],
        &["sdo", "read"],
        &["sdo", "write"],
        &["eeprom", "read"],
        &["eeprom", "write"],
        &["eeprom", "alias"],
        &["foe", "write"],
        &["foe", "read"],
        &["exchange"],
        &["simulate"],
    ] {
        let output = omnibase(&[command, &["--help"]].concat());
        assert_eq!(output.status.code(), Some(0));
        assert!(text(&output.stdout).contains("Examples:"), "{command:?}");
    }
}

/// A simulator that runs until the value goes.
struct Simulator {
    process: Child,
    told: BufReader<ChildStdout>,
}

impl Simulator {
    /// Starts it and waits until it answers. To be called inside the namespace.
    fn start(arguments: &[&str]) -> (Self, Vec<String>) {
        let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .arg("simulate")
            .args(arguments)
            .args(["--interface", Namespace::FAR])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut told = BufReader::new(process.stdout.take().unwrap());
        let mut lines = told.by_ref().lines().map_while(Result::ok);
        let mut shown: Vec<String> = lines.next().into_iter().collect();
        let count: usize = shown[0].split(' ').nth(1).unwrap().parse().unwrap();
        shown.extend(lines.take(count));
        (Simulator { process, told }, shown)
    }

    /// Ends it as Ctrl-C does; its exit code, and what it told at its end.
    fn interrupt(mut self) -> (Option<i32>, String) {
        let status = Command::new("kill").args(["-INT", &self.process.id().to_string()]).status().unwrap();
        assert!(status.success());
        let mut told = String::new();
        self.told.read_to_string(&mut told).unwrap();
        (self.process.wait().unwrap().code(), told)
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn simulate_answers_scan_sdo_and_exchange_over_a_cable() {
    let Some(namespace) = Namespace::for_test("simulate_answers_scan_sdo_and_exchange_over_a_cable") else {
        return;
    };
    namespace.run(|| {
        let (simulator, shown) = Simulator::start(&[&segment("three-servos")]);
        assert_eq!(shown[0], "simulating 3 SubDevices on veth1; Ctrl-C ends");
        assert_eq!(shown.len(), 4, "{shown:?}");

        let found = json(&omnibase(&["scan", Namespace::NEAR, "--json"]));
        assert_eq!(found["subdevices"].as_array().unwrap().len(), 3);

        let read = omnibase(&["sdo", "read", Namespace::NEAR, "2", "1000:0", "--type", "u32"]);
        assert_eq!(text(&read.stdout), "1000:00 131474 (0x00020192)\n", "{}", text(&read.stderr));

        for port in [&[][..], &["--ring"], &["--ring", "--busy-poll"]] {
            let arguments =
                [&["exchange", Namespace::NEAR, "--cycles", "50", "--cycle-us", "5000", "--json"], port];
            let output = omnibase(&arguments.concat());
            let found: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
            assert_eq!(found["cycles"].as_u64(), Some(50), "{port:?}: {}", text(&output.stderr));
            assert_eq!(found["operational"].as_bool(), Some(true), "{port:?}: {}", text(&output.stderr));
        }
        assert_eq!(simulator.interrupt().0, Some(0));
    });
}

#[test]
fn a_segment_of_sii_images_is_scanned_as_the_devices_they_are() {
    let captures = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures");
    let images = format!("{captures}/ek1100-sii.bin,{captures}/el2828-sii.bin,{captures}/el2889-sii.bin");
    if !PathBuf::from(captures).exists() {
        eprintln!("SKIPPED: {captures} is not there");
        return;
    }
    let Some(namespace) = Namespace::for_test("a_segment_of_sii_images_is_scanned") else { return };
    namespace.run(|| {
        let (_simulator, shown) = Simulator::start(&["--sii", &images]);
        assert!(shown[1].contains("EK1100 EtherCAT-Koppler (2A E-Bus)"), "{shown:?}");
        let words = text(&omnibase(&["scan", Namespace::NEAR]).stdout);
        for expected in
            ["0 EK1100 EtherCAT-Koppler", "1 EL2828", "2 EL2889", "hangs at  port 1 of SubDevice 1"]
        {
            assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
        }
    });
}

/// Who taps the interface on the same machine sees what is sent where that is wished (nobody answers here), and nothing of it otherwise.
#[test]
fn what_is_sent_is_seen_on_the_same_machine_where_that_is_wished() {
    let Some(namespace) = Namespace::for_test("what_is_sent_is_seen_on_the_same_machine") else { return };
    namespace.run(|| {
        for (more, origin) in [(&[][..], None), (&["--visible"], Some(omnibase_host::Origin::ThisComputer))] {
            let heard = std::thread::scope(|scope| {
                let tap =
                    scope.spawn(|| omnibase_host::listen(Namespace::NEAR, std::time::Duration::from_secs(3)));
                let scan = omnibase(&[&["scan", Namespace::NEAR], more].concat());
                assert!(text(&scan.stderr).contains("nothing came back"), "{}", text(&scan.stderr));
                tap.join().unwrap().unwrap()
            });
            assert_eq!(heard.map(|heard| heard.origin), origin, "{more:?}: {heard:?}");
        }
    });
}

#[test]
fn no_subdevice_found_says_why() {
    let Some(namespace) = Namespace::for_test("no_subdevice_found_says_why") else { return };
    namespace.run(|| {
        let scan = || {
            let output = omnibase(&["scan", Namespace::NEAR]);
            assert_eq!(output.status.code(), Some(1));
            text(&output.stderr)
        };
        assert!(scan().contains("veth0: no SubDevice found: nothing came back"), "{}", scan());
        namespace.ip("link set veth1 down").unwrap();
        assert!(scan().contains("veth0: no SubDevice found: the link is down"), "{}", scan());
        let output = omnibase(&["scan", "eth77"]);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(text(&output.stderr), "error: no network interface `eth77`; there are: veth1, veth0\n");
    });
}

#[test]
fn missing_rights_name_the_capability_and_the_command_that_grants_it() {
    let program = env!("CARGO_BIN_EXE_omnibase");
    let output = Command::new("setpriv")
        .args(["--reuid=65534", "--clear-groups", program, "scan", "lo"])
        .stdin(Stdio::null())
        .output();
    let output = match output {
        Ok(output) if !text(&output.stderr).contains("setpriv:") => output,
        _ => {
            eprintln!("SKIPPED: setpriv can't take the rights away here");
            return;
        }
    };
    assert_eq!(output.status.code(), Some(1));
    let words = text(&output.stderr);
    let expected = format!(
        "error: no right to send raw frames on `lo`: the capability CAP_NET_RAW is missing; grant it with \
         `sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {program}` or run as root\n"
    );
    assert_eq!(words, expected);
}

#[test]
fn the_clocks_can_follow_the_host() {
    let run =
        omnibase(&["exchange", &sim("three-sgdv"), "--dc", "--clock", "host", "--cycles", "3000", "--json"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["operational"], true);
    // Nothing wakes late in virtual time: the phase stays where it was put.
    assert!(report["dc_phase_ns"]["max"].as_u64().unwrap() < 5_000, "{report}");
    assert!(report["commands_used"].as_array().unwrap().iter().any(|command| command == "FPWR"));
    let alone = omnibase(&["exchange", &sim("three-sgdv"), "--clock", "host"]);
    assert_eq!(alone.status.code(), Some(2), "--clock means nothing without --dc");
}

#[test]
fn a_cycle_shorter_than_its_frames_is_refused_beforehand() {
    let run = omnibase(&["exchange", &sim("hundred-servos"), "--cycle-us", "100"]);
    assert_eq!(run.status.code(), Some(1));
    let words = text(&run.stderr);
    assert!(words.contains("--cycle-us 100") && words.contains("the shortest cycle that fits is"), "{words}");
}

/// A segment of two drives with a SubDevice between them whose EEPROM is this image.
fn with_image(name: &str, image: &[u8]) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("image.bin"), image).unwrap();
    let text = "[[subdevice]]\nkind = \"sgdv\"\n[[subdevice]]\nkind = \"sii\"\nsii = \"image.bin\"\n\
                [[subdevice]]\nkind = \"sgdv\"\n";
    let path = folder.path().join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    let target = format!("sim:{}", path.display());
    (folder, target)
}

/// An image with a mailbox that no controller can have, so that its set-up fails.
fn with_a_mailbox_of(length: u16) -> Vec<u8> {
    let mut image = sii::Image::default();
    let identity = sii::Identity { vendor_id: 0x539, product_code: 7, revision: 1, serial: 1 };
    image.header.identity = identity;
    image.header.checksum = u16::from(image.header.computed_checksum());
    let mut bytes = image.emit();
    for at in [0x18, 0x1A] {
        bytes[2 * at..2 * at + 4].copy_from_slice(&[0x00, 0x10, length as u8, (length >> 8) as u8]);
    }
    bytes[2 * 0x1C] = 4;
    bytes
}

#[test]
fn a_subdevice_that_is_broken_is_named_and_left_out_where_nobody_needs_it() {
    let cases = [
        ("erased", vec![0xFF; 2048], "its EEPROM is erased"),
        ("mailbox", with_a_mailbox_of(9000), "a mailbox of 9000 bytes out and 9000 in can't be used"),
    ];
    for (name, image, cause) in cases {
        let (_folder, target) = with_image(name, &image);
        let scan = omnibase(&["scan", &target, "--json"]);
        assert_eq!(scan.status.code(), Some(1), "{name}: {}", text(&scan.stderr));
        let found: Value = serde_json::from_slice(&scan.stdout).unwrap();
        let subdevices = found["subdevices"].as_array().unwrap();
        let broken: Vec<&str> = subdevices.iter().map(|one| one["broken"].as_str().unwrap_or("")).collect();
        assert!(broken[1].contains(cause) && broken[0].is_empty() && broken[2].is_empty(), "{broken:?}");
        assert_eq!((&subdevices[0]["state"], &subdevices[2]["state"]), (&"PRE-OP".into(), &"PRE-OP".into()));
        for [wish, mark] in [["--visible", "    broken    "], ["--toml", "# BROKEN, so it is left out: "]] {
            let plain = omnibase(&["scan", &target, wish]);
            assert_eq!(plain.status.code(), Some(1), "{name} {wish}: {}", text(&plain.stderr));
            let plain = text(&plain.stdout);
            assert!(plain.contains(mark) && plain.contains(cause), "{plain}");
        }
        // The others don't need it.
        for position in ["0", "2"] {
            let read = omnibase(&["sdo", "read", &target, position, "6041:00"]);
            assert_eq!(read.status.code(), Some(0), "{name}: {}", text(&read.stderr));
            assert!(text(&read.stdout).starts_with("6041:00 "), "{}", text(&read.stdout));
        }
        let read = omnibase(&["sdo", "read", &target, "1", "1000:00"]);
        assert_eq!(read.status.code(), Some(1));
        let said = text(&read.stderr);
        assert!(said.contains("SubDevice 1 can't be used: ") && said.contains(cause), "{said}");
    }
}

#[test]
fn escape_codes_of_a_device_and_of_a_file_are_shown_and_do_not_act() {
    let image = sii::Image {
        strings: vec![b"\x1b[2J\x1b]0;owned\x07\xC2\x9B31m\n9 forged".to_vec()],
        general: Some(sii::General { name: 1, ..sii::General::default() }),
        ..sii::Image::default()
    };
    let (folder, target) = with_image("escapes", &image.emit());
    let acts = |bytes: &[u8]| text(bytes).chars().any(|c| c.is_control() && !matches!(c, '\n' | '\t'));
    let scan = omnibase(&["scan", &target]);
    assert!(!acts(&scan.stdout) && !acts(&scan.stderr), "{scan:?}");
    let said = text(&scan.stdout);
    assert!(said.contains("1 \\x1b[2J\\x1b]0;owned\\x07\\u009b31m\\x0a9 forged"), "{said}");
    let name = &serde_json::from_slice::<Value>(&omnibase(&["scan", &target, "--json"]).stdout).unwrap()["subdevices"]
        [1]["name"];
    assert_eq!(name.as_str().unwrap(), "\\x1b[2J\\x1b]0;owned\\x07\\u009b31m\\x0a9 forged");
    // A robot's file that is wrong in a word with codes, under a name with codes.
    let path = folder.path().join("\x1b[31mrobot.toml");
    std::fs::write(&path, "name = \"a\"\nw\x1b[2Jheel = 1\n").unwrap();
    let check = omnibase(&["check", path.to_str().unwrap()]);
    assert_eq!(check.status.code(), Some(1));
    assert!(!acts(&check.stdout) && !acts(&check.stderr), "{check:?}");
    let said = text(&check.stdout) + &text(&check.stderr);
    assert!(said.contains("\\x1b[31mrobot.toml"), "{said}");
}
