//! What `exchange`, `doctor` and `scan` say of a segment and its cycles, as a user runs them.

use super::{Simulator, json, omnibase, scratch, segment, sim, text};
use omnibase_ethercat_wire::sii;
use omnibase_host::Namespace;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

#[test]
fn a_simulator_that_dies_is_noticed() {
    let Some(namespace) = Namespace::for_test("a_simulator_that_dies_is_noticed") else { return };
    namespace.run(|| {
        let (simulator, _) = Simulator::start(&[&segment("three-servos")]);
        let exchange = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["exchange", Namespace::NEAR, "--cycle-us", "5000", "--cycles", "100000000"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(500));
        drop(simulator);
        let output = exchange.wait_with_output().unwrap();
        let words = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(words.contains("no frame has come back for 5"), "{words}");
        assert!(words.contains("or the simulator that answered has ended"), "{words}");
    });
}

#[test]
fn a_second_simulator_on_one_interface_is_refused() {
    let Some(namespace) = Namespace::for_test("a_second_simulator_on_one_interface_is_refused") else {
        return;
    };
    namespace.run(|| {
        let (_simulator, _) = Simulator::start(&[&segment("three-servos")]);
        let second = omnibase(&["simulate", &segment("three-sgdv"), "--interface", Namespace::FAR]);
        let words = text(&second.stderr);
        assert_eq!(second.status.code(), Some(1), "{words}");
        assert!(words.contains("is in use by process"), "{words}");
    });
}

/// A frame damaged five times a second on its way to SubDevice 1, for longer than the busiest machine takes for a test.
fn now_and_then() -> impl Iterator<Item = String> {
    (0..3000).map(|number| format!("crc-errors@1:{:.1}:1", 0.2 * f64::from(number)))
}

/// The segment of a file behind the cable, with what goes wrong in it.
fn simulated(file: &str, faults: impl Iterator<Item = String>) -> Simulator {
    let faults: Vec<String> = faults.flat_map(|fault| ["--fault".to_owned(), fault]).collect();
    let arguments: Vec<&str> = std::iter::once(file).chain(faults.iter().map(String::as_str)).collect();
    Simulator::start(&arguments).0
}

/// Whoever stands beside it unplugs a drive by a line, whenever he likes; a line that says nothing ends nothing.
#[test]
fn a_fault_that_is_typed_comes_at_once() {
    let Some(namespace) = Namespace::for_test("a_fault_that_is_typed_comes_at_once") else { return };
    namespace.run(|| {
        let (mut simulator, _) = Simulator::start(&[&segment("three-servos"), "--fault", "-"]);
        let mut lines = simulator.process.stdin.take().unwrap();
        let found =
            || json(&omnibase(&["scan", Namespace::NEAR, "--json"]))["subdevices"].as_array().map(Vec::len);
        for (line, count) in [("fire@1", 3), ("power-off@2", 2), ("power-on@2", 3)] {
            writeln!(lines, "{line}").unwrap();
            assert!((0..100).any(|_| found() == Some(count)), "{line}");
        }
        drop(lines);
        assert_eq!((found(), simulator.interrupt().0), (Some(3), Some(0)));
    });
}

/// Frames that are damaged now and then cost exchanges: their end says where, by the counters of the chips.
#[test]
fn an_exchange_says_where_frames_were_damaged() {
    let Some(namespace) = Namespace::for_test("an_exchange_says_where_frames_were_damaged") else { return };
    namespace.run(|| {
        let _simulator = simulated(&segment("three-servos"), now_and_then());
        let second = ["exchange", Namespace::NEAR, "--cycle-us", "10000", "--cycles", "100", "--json"];
        // Where the machine pauses a run may not get as far, or end with drives that its watchdogs took out of OP: it tells of
        // damage all the same, and of other things as well.
        let told = (0..100).find_map(|_| {
            let report: serde_json::Value = serde_json::from_slice(&omnibase(&second).stdout).ok()?;
            let told = report["damage"].as_array()?.iter().filter_map(serde_json::Value::as_str);
            told.filter(|told| told.contains("damaged frames (")).map(String::from).next()
        });
        let told = told.expect("damage is seen within a hundred runs");
        assert!(told.starts_with("SubDevice 1: "), "{told}");
    });
}

/// Whoever is plugged in while it runs is told, and makes nobody else's operation none.
#[test]
fn an_exchange_tells_who_was_plugged_in_meanwhile() {
    let Some(namespace) = Namespace::for_test("an_exchange_tells_who_was_plugged_in_meanwhile") else {
        return;
    };
    let faults = (0..120).map(|n| 1.7 * f64::from(n));
    let faults = faults.flat_map(|n| [format!("power-off@2:{n:.1}"), format!("power-on@2:{:.1}", n + 0.8)]);
    let report = |run: &Output| -> serde_json::Value { serde_json::from_slice(&run.stdout).unwrap() };
    namespace.run(|| {
        let _simulator = simulated(&segment("three-servos"), faults);
        let half_a_second = ["exchange", Namespace::NEAR, "--cycle-us", "10000", "--cycles", "50", "--json"];
        // It is lost in the midst of most runs, and where the machine pauses drives leave OP by their watchdogs.
        let mut runs = (0..60).map(|_| omnibase(&half_a_second)).filter(|run| run.stdout.starts_with(b"{"));
        let is_told = |run: &Output| {
            (&report(run)["surplus"], &report(run)["operational"]) == (&1.into(), &true.into())
        };
        let told = runs.find(is_told).expect("a run meets one that is plugged in");
        assert_eq!(told.status.code(), Some(0));
    });
}

/// Firmware that hangs now and then, behind a chip that answers from OP all the same.
#[test]
fn an_exchange_says_whose_firmware_hung() {
    let Some(namespace) = Namespace::for_test("an_exchange_says_whose_firmware_hung") else { return };
    let faults =
        (0..120).map(f64::from).flat_map(|n| [format!("freeze@1:{n}"), format!("unfreeze@1:{:.1}", n + 0.4)]);
    namespace.run(|| {
        let _simulator = simulated(&segment("three-servos"), faults);
        let two_seconds = ["exchange", Namespace::NEAR, "--cycle-us", "10000", "--cycles", "200", "--json"];
        // Who freezes on its way to OP ends a run early.
        let mut runs = (0..30).map(|_| omnibase(&two_seconds)).filter(|run| run.stdout.starts_with(b"{"));
        let told = runs.find_map(|run| {
            let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
            let all =
                ["damage", "not_operational"].map(|key| report[key].as_array().unwrap().clone()).concat();
            all.iter()
                .filter_map(|told| told.as_str())
                .find(|told| told.contains("PDI watchdog"))
                .map(String::from)
        });
        let told = told.expect("a run of two seconds meets a freeze");
        assert!(told.starts_with("SubDevice 1 (") && told.contains("its firmware h"), "{told}");
    });
}

/// What was found of the machine may be the reason why nobody answers: it is told all the same.
#[test]
fn doctor_tells_of_the_machine_where_nobody_answers() {
    let Some(namespace) = Namespace::for_test("doctor_tells_of_the_machine_where_nobody_answers") else {
        return;
    };
    namespace.run(|| {
        let doctor = omnibase(&["doctor", Namespace::NEAR, "--segment", "--pauses-s", "0", "--json"]);
        let words = text(&doctor.stderr);
        let page: serde_json::Value =
            serde_json::from_slice(&doctor.stdout).unwrap_or_else(|_| panic!("{words}"));
        let findings = page["findings"].as_array().unwrap();
        let segment: Vec<_> = findings.iter().filter(|one| one["check"] == "segment").collect();
        assert!(segment.len() == 1 && segment[0]["verdict"] == "bad", "{findings:?}");
        assert!(findings.len() > 5 && doctor.status.code() == Some(1), "{findings:?}");
    });
}

/// What hangs at the cable is as wrong as a segment gets while it still answers, and a frame is damaged now and then: `doctor`
/// names all of it, by position and port, and says what to do.
#[test]
fn doctor_names_what_is_wrong_behind_a_cable() {
    let Some(namespace) = Namespace::for_test("doctor_names_what_is_wrong_behind_a_cable") else { return };
    let folder = tempfile::tempdir().unwrap();
    let identity = sii::Identity { vendor_id: 0x539, product_code: 7, revision: 1, serial: 1 };
    let mut image = sii::Image::default();
    image.header.identity = identity;
    image.header.mailbox =
        sii::MailboxArea { receive_offset: 0x1000, receive_size: 128, send_offset: 0x1080, send_size: 128 };
    image.header.mailbox_protocols = sii::PROTOCOL_COE | sii::PROTOCOL_EOE | sii::PROTOCOL_SOE;
    std::fs::write(folder.path().join("gateway.bin"), image.emit()).unwrap();
    let file = folder.path().join("segment.toml");
    let tables = "[[subdevice]]\nkind = \"servo\"\nalias = 7\n[[subdevice]]\nkind = \"sii\"\nsii = \"gateway.bin\"\n\
                [[subdevice]]\nkind = \"servo\"\nalias = 7\nentry_port = 1\n";
    std::fs::write(&file, tables).unwrap();
    let page: serde_json::Value = namespace.run(|| {
        // A scan bears that, and some look at the counters meets one.
        let _simulator = simulated(file.to_str().unwrap(), now_and_then());
        let look = || omnibase(&["doctor", Namespace::NEAR, "--segment", "--pauses-s", "0", "--json"]);
        // Where the machine pauses, damage adds up, and a scan finds nobody.
        let mut looks =
            (0..100).map(|_| look()).skip_while(|doctor| !text(&doctor.stdout).contains("damaged frames ("));
        let doctor = looks.next().expect("damage is seen within a hundred looks");
        serde_json::from_slice(&doctor.stdout).unwrap_or_else(|_| panic!("{}", text(&doctor.stderr)))
    });
    let findings = page["findings"].as_array().unwrap();
    let found = |check: &str| -> Vec<&str> {
        let of_check = findings.iter().filter(|finding| finding["check"] == check);
        of_check.map(|finding| finding["found"].as_str().unwrap()).collect()
    };
    let told = found("segment").join("\n");
    for expected in [
        "alias 0x0007 belongs to SubDevices [0, 2]",
        "frames enter SubDevice 2 at port 1, not 0",
        "damaged frames",
        "arrived first at its port 0, from SubDevice 0 (its port 1)",
        "SubDevice 1: speaks EoE",
        "SubDevice 1: speaks SoE",
    ] {
        assert!(told.contains(expected), "`{expected}` is missing in\n{told}");
    }
    // It speaks CoE as well: that other protocols of its aren't spoken here makes no segment worse.
    let spoken = findings.iter().filter(|one| one["found"].as_str().unwrap().contains("SubDevice 1: speaks"));
    assert!(
        spoken.clone().count() == 2 && spoken.clone().all(|one| one["verdict"] == "good"),
        "{findings:?}"
    );
    let cycle = found("shortest cycle")[0].split_once(" us: 1 frame takes ");
    assert!(cycle.is_some_and(|(cycle_us, _)| cycle_us.parse::<u32>().unwrap() > 0), "{findings:?}");
}

/// A cable with a link and no frames behind it, as of a neighbour that isn't ready: `scan` and `doctor` name the port, and say what to do.
#[test]
fn a_link_without_frames_is_named_behind_a_cable() {
    let Some(namespace) = Namespace::for_test("a_link_without_frames_is_named_behind_a_cable") else {
        return;
    };
    let expected = "SubDevice 1: a cable with a link is in its port 1, but no frames pass there";
    let remedy = "power that device up before this one";
    namespace.run(|| {
        let _simulator = simulated(&segment("three-servos"), std::iter::once("link-alone@1:0:1".to_owned()));
        for look in
            [&["scan", Namespace::NEAR][..], &["doctor", Namespace::NEAR, "--segment", "--pauses-s", "0"]]
        {
            // Where the machine pauses, a scan finds nobody.
            let said =
                (0..100).map(|_| text(&omnibase(look).stdout)).find(|said| said.contains("SubDevice 1: "));
            let said = said.expect("a hundred looks see it").split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(said.contains(expected) && said.contains(remedy), "{said}");
        }
    });
}

/// A switch for its identification, modules in slots, and a SyncManager of 200 bytes of which no PDO tells beside a virtual one over the
/// registers of the clock: seen by `scan`, and all in OP by `exchange`, over a cable.
#[test]
fn identification_modules_and_lengths_without_pdos_are_seen_behind_a_cable() {
    let Some(namespace) = Namespace::for_test("identification_modules_and_lengths") else { return };
    let folder = tempfile::tempdir().unwrap();
    let manager = |usage, start, length, control, enable| sii::SyncManager {
        start,
        length,
        control,
        status: 0,
        enable,
        usage,
    };
    let mut image = sii::Image {
        sync_managers: vec![
            manager(sii::SyncManagerUsage::Inputs, 0x1800, 200, 0x20, sii::SM_ENABLE),
            manager(sii::SyncManagerUsage::Outputs, 0x0980, 1, 0x64, sii::SM_ENABLE | sii::SM_VIRTUAL),
        ],
        general: Some(sii::General::default()),
        fmmus: vec![sii::FmmuUsage::Inputs],
        ..sii::Image::default()
    };
    image.header.checksum = u16::from(image.header.computed_checksum());
    std::fs::write(folder.path().join("long.bin"), image.emit()).unwrap();
    let maker = concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments/maker.xml");
    let tables = format!(
        "[[subdevice]]\nkind = \"servo\"\nidentification = 7\n[[subdevice]]\nkind = \"esi\"\nesi = \"{maker}\"\n\
         device = \"MU-COUPLER\"\nmodules = [\"MU-AI\", \"MU-DO\"]\n[[subdevice]]\nkind = \"sii\"\nsii = \"long.bin\"\n"
    );
    let file = folder.path().join("segment.toml");
    std::fs::write(&file, tables).unwrap();
    namespace.run(|| {
        let (_simulator, _) = Simulator::start(&[file.to_str().unwrap()]);
        let scan = omnibase(&["scan", Namespace::NEAR, "--json"]);
        let said = text(&scan.stderr);
        assert!(said.contains("SubDevice 2") && said.contains("the SII says 200 bytes"), "{said}");
        let found = json(&scan);
        assert_eq!(found["subdevices"][0]["identification"], 7, "{found}");
        assert_eq!(
            found["subdevices"][1]["modules"]["detected"],
            serde_json::json!([0x101, 0x201]),
            "{found}"
        );
        // Frames that a busy machine answers too late cost the exit code, not the state.
        let exchange =
            omnibase(&["exchange", Namespace::NEAR, "--cycles", "20", "--cycle-us", "20000", "--json"]);
        let found: serde_json::Value = serde_json::from_slice(&exchange.stdout).unwrap_or_default();
        assert_eq!(found["operational"], true, "{}", text(&exchange.stderr));
    });
}

/// A long segment: which cycle fits is told, a shorter one is refused beforehand, and that one works.
#[test]
fn the_cycle_that_is_said_to_fit_fits() {
    let path = scratch("long.toml");
    std::fs::write(&path, "[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\noutputs = 8\ncount = 200\n")
        .unwrap();
    let target = format!("sim:{}", path.display());
    let found = json(&omnibase(&["scan", &target, "--json"]));
    let cycle = &found["cycle"];
    assert_eq!(cycle["propagation_is_measured"], true);
    let (shortest, propagation) =
        (cycle["shortest_us"].as_u64().unwrap(), cycle["propagation_us"].as_u64().unwrap());
    // 200 chips of 300 ns, passed twice, and 199 cables of 100 ns both ways.
    assert!((155..=165).contains(&propagation), "{cycle}");
    let run = |cycle_us: u64| {
        omnibase(&["exchange", &target, "--cycles", "50", "--cycle-us", &cycle_us.to_string(), "--json"])
    };
    let short = run(shortest - 1);
    let words = text(&short.stderr);
    assert!(short.status.code() == Some(1) && words.contains("the shortest cycle that fits is"), "{words}");
    let report = json(&run(shortest));
    assert_eq!((&report["operational"], &report["lost_frames"]), (&true.into(), &0.into()), "{report}");
    std::fs::remove_file(path).unwrap();
}

/// Register 0x0420 of the first SubDevice is written: 100 ms in steps of 100 us by default, or what is asked.
#[test]
fn exchange_writes_the_watchdog_of_who_has_outputs() {
    for (more, steps) in [(&[][..], 1000u16), (&["--watchdog-ms", "25"], 250)] {
        let path = scratch("watchdog.pcapng");
        let target = sim("three-servos");
        let file = path.to_str().unwrap();
        let run = omnibase(&[&["exchange", &target, "--cycles", "1", "--record", file], more].concat());
        assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
        let frames = std::fs::read(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        // Address 0x1001:0x0420, two bytes and more datagrams behind them, no event; the value.
        let [low, high] = steps.to_le_bytes();
        let datagram = [0x01, 0x10, 0x20, 0x04, 0x02, 0x80, 0x00, 0x00, low, high];
        assert!(frames.windows(datagram.len()).any(|bytes| bytes == datagram), "{steps} steps");
    }
}

/// The firmware in C that the repository ships, compiled by the first test that asks; `None`, said loudly, where there is no C compiler.
static MAILBOX_FIRMWARE: LazyLock<Option<PathBuf>> = LazyLock::new(|| {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ethercat-sim/c");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mailbox_firmware");
    let compiled = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o"])
        .arg(&program)
        .args([sources.join("mailbox_firmware.c"), sources.join("pdi_client.c")])
        .output();
    let Ok(compiled) = compiled else {
        omnibase_host::skipped("no C compiler (cc), so foreign firmware isn't tested from the command line");
        return None;
    };
    assert!(compiled.status.success(), "{}", text(&compiled.stderr));
    Some(program)
});

/// Two programs in C behind two chips, in lockstep: mapped by their own SDO servers, brought to OP, cycled without a loss.
#[test]
fn foreign_firmware_goes_to_op_from_the_command_line() {
    let Some(program) = &*MAILBOX_FIRMWARE else { return };
    let folder = tempfile::tempdir().unwrap();
    let sockets = ["one", "two"].map(|name| folder.path().join(format!("{name}.pdi")));
    let tables: Vec<String> = sockets
        .iter()
        .map(|path| {
            format!(
                "[[subdevice]]\nkind = \"servo\"\nfirmware = \"socket\"\nsocket = \"{}\"\n",
                path.display()
            )
        })
        .collect();
    let file = folder.path().join("foreign.toml");
    std::fs::write(&file, tables.concat()).unwrap();
    let mut exchange = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["exchange", &format!("sim:{}", file.display()), "--cycles", "300", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut firmware = Vec::new();
    for socket in &sockets {
        // Each is waited for before the next socket is made.
        while !socket.exists() && exchange.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        firmware.push(Command::new(program).arg(socket).spawn().unwrap());
    }
    let output = exchange.wait_with_output().unwrap();
    let report = json(&output);
    assert_eq!((&report["operational"], &report["lost_frames"]), (&true.into(), &0.into()), "{report}");
    assert_eq!(report["working_counter_errors"], 0, "{report}");
    for mut one in firmware {
        // Its connection ended with the simulator.
        assert!(one.wait().unwrap().success());
    }
}

/// The shipped segment of two programs in C, free running behind a cable: both reach OP beside each other, and the end tells how far the
/// segment's time was behind the clock.
#[test]
fn foreign_firmware_runs_freely_behind_a_cable() {
    let Some(namespace) = Namespace::for_test("foreign_firmware_runs_freely_behind_a_cable") else { return };
    let Some(program) = &*MAILBOX_FIRMWARE else { return };
    let folder = tempfile::tempdir().unwrap();
    let sockets = ["one", "two"].map(|name| folder.path().join(format!("omnibase-{name}.pdi")));
    let shipped = std::fs::read_to_string(segment("two-foreign")).unwrap();
    let file = folder.path().join("two-foreign.toml");
    std::fs::write(&file, shipped.replace("/tmp", folder.path().to_str().unwrap())).unwrap();
    namespace.run(|| {
        let (simulator, shown) = Simulator::start(&[file.to_str().unwrap()]);
        assert_eq!(shown[0], "simulating 2 SubDevices on veth1; Ctrl-C ends");
        let firmware = sockets.map(|socket| Command::new(program).arg(socket).spawn().unwrap());
        let exchange = ["exchange", Namespace::NEAR, "--cycles", "50", "--cycle-us", "20000", "--json"];
        // Where the machine pauses, watchdogs take them out of OP again.
        let mut runs = (0..30).map(|_| omnibase(&exchange));
        let is_operational = |run: &Output| {
            let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap_or_default();
            report["operational"] == true
        };
        assert!(runs.any(|run| is_operational(&run)), "none of thirty runs ends with both in OP");
        let (code, told) = simulator.interrupt();
        assert_eq!(code, Some(0));
        let lag = told.lines().find_map(|line| line.strip_prefix("the segment's time was "));
        let words: Vec<&str> = lag.expect(&told).split(' ').collect();
        let [behind_ms, "ms", "behind", "the", "clock", .., looks_behind, "of", looks, "looks"] = words[..]
        else {
            panic!("{told}")
        };
        let [looks_behind, looks] = [looks_behind, looks].map(|number| number.parse::<u64>().unwrap());
        assert!(behind_ms.parse::<f64>().unwrap() >= 0.0 && looks_behind <= looks && looks > 0, "{told}");
        for mut one in firmware {
            // Its connection ended with the simulator.
            assert!(one.wait().unwrap().success());
        }
    });
}
