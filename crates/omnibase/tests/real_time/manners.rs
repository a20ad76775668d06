//! Whoever comes second at an interface is told so, and a link that is down ends nothing.

use super::support::{PATIENT, Program, Scratch, repository};
use omnibase_ethercat_wire::frame::FrameBuilder;
use omnibase_ethercat_wire::{Address, Command as Datagram, Link};
use omnibase_host::{Namespace, PacketSocket};
use serde_json::Value;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest wait for what has to come; only a test that fails waits so long.
const PATIENCE: Duration = Duration::from_secs(60);

/// A link that is down for 30 ms loses more exchanges than this.
const SHORT_PATIENCE: [&str; 2] = ["--set", "safety.lost_exchanges_tolerated=5"];

/// A robot with its page at the near end of the cable, and the simulator at the far end.
struct Operated {
    run: Program,
    simulator: Program,
    /// Where the command line finds it.
    folder: Scratch,
}

impl Operated {
    fn start(test: &str, more: &[&str]) -> Self {
        let robot = repository("robots/bmm.toml");
        let folder = Scratch::new(test);
        std::fs::create_dir_all(&folder.0).unwrap();
        let simulator = Program::simulate(&[&robot]);
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(["run", &robot, "--interface", Namespace::NEAR, "--realtime", "--json"]);
        command.arg("--dashboard=127.0.0.1:0").args(PATIENT).args(more).env("XDG_RUNTIME_DIR", &folder.0);
        let mut run = Program::start(command);
        run.wait_for("dashboard: ");
        let operated = Operated { run, simulator, folder };
        operated.wait("its cycle runs", |now| now["counts"][0].as_u64() > Some(0));
        operated
    }

    fn omnibase(&self, arguments: &[&str]) -> std::process::Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(arguments).env("XDG_RUNTIME_DIR", &self.folder.0).output().unwrap()
    }

    fn now(&self) -> Value {
        serde_json::from_slice(&self.omnibase(&["get", "--json"]).stdout).unwrap_or_default()
    }

    fn wait(&self, what: &str, holds: impl Fn(&Value) -> bool) {
        let began = Instant::now();
        while !holds(&self.now()) {
            assert!(began.elapsed() < PATIENCE, "never came true: {what}: {}", self.now());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Enables the drives, whatever stopped them before.
    fn enable(&self) {
        let began = Instant::now();
        while self.now()["phase"] != "holding" {
            self.omnibase(&["call", "acknowledge"]);
            self.omnibase(&["call", "enable"]);
            assert!(began.elapsed() < PATIENCE, "never enabled: {}", self.now());
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    /// Ends the robot, then the simulator; the events of the run.
    fn end(self) -> Vec<String> {
        self.run.signal("INT");
        let run = self.run.end();
        self.simulator.signal("INT");
        self.simulator.end();
        let _ = std::fs::remove_dir_all(&self.folder.0);
        let report = run.json();
        let events = report["events"].as_array().unwrap().iter();
        events.map(|event| event["text"].as_str().unwrap().to_owned()).collect()
    }
}

#[test]
fn a_carrier_that_is_lost_stops_the_robot_and_a_person_goes_on_when_it_is_back() {
    let Some(namespace) = Namespace::for_test("a_carrier_that_is_lost_stops_the_robot") else { return };
    // What happens to the near end, and for how long.
    let pulled = |name: &str| vec![format!("link set {name} down")];
    let back = |name: &str| vec![format!("link set {name} up")];
    let again = || {
        let add = "link add veth0 type veth peer name veth1".to_owned();
        vec![add, "link set veth1 up".to_owned(), "link set veth0 up".to_owned()]
    };
    let cases = [
        ("30 ms", &[][..], pulled(Namespace::NEAR), back(Namespace::NEAR), 30),
        ("2 s", &["--ring"][..], pulled(Namespace::NEAR), back(Namespace::NEAR), 2000),
        ("2 s at the other end", &[][..], pulled(Namespace::FAR), back(Namespace::FAR), 2000),
        ("unplugged", &[][..], vec!["link del veth0".to_owned()], again(), 1000),
        ("unplugged, rings", &["--ring"][..], vec!["link del veth0".to_owned()], again(), 1000),
    ];
    for (what, more, down, up, ms) in cases {
        let words = namespace.run(|| {
            let robot = Operated::start("carrier", &[more, &SHORT_PATIENCE].concat());
            robot.enable();
            down.iter().for_each(|step| namespace.ip(step).unwrap());
            std::thread::sleep(Duration::from_millis(ms));
            up.iter().for_each(|step| namespace.ip(step).unwrap());
            robot.wait("it stopped", |now| now["phase"] == "fault");
            robot.wait("everybody is back", |now| {
                now["bus/not_operational"].as_f64() == Some(0.0) && now["bus/al_status"].as_f64() == Some(8.0)
            });
            // Nothing goes on by itself, and everything by a person.
            assert_eq!(robot.now()["phase"], "fault", "{what}");
            robot.enable();
            robot.end()
        });
        let told = |text: &str| words.iter().any(|event| event.contains(text));
        assert!(told("nothing behind the interface answers"), "{what}: {words:?}");
        assert!(told("something behind the interface answers again"), "{what}: {words:?}");
        assert!(told("the interface sees no link"), "{what}: {words:?}");
        assert!(told("too many exchanges in a row were lost"), "{what}: {words:?}");
    }
}

#[test]
fn who_comes_second_at_an_interface_is_told_who_has_it() {
    let Some(namespace) = Namespace::for_test("who_comes_second_at_an_interface") else { return };
    let robot = repository("robots/bmm.toml");
    namespace.run(|| {
        let operated = Operated::start("second", &[]);
        operated.enable();
        let near = Namespace::NEAR;
        let commands: [&[&str]; 4] = [
            &["scan", near, "--force"],
            &["sdo", "read", near, "0", "6041:00"],
            &["exchange", near],
            &["run", &robot, "--circle", "radius_m=0.3,duration_s=6", "--interface", near],
        ];
        for command in commands {
            let refused = operated.omnibase(command);
            let said = String::from_utf8(refused.stderr).unwrap();
            assert_eq!(refused.status.code(), Some(1), "{command:?}: {said}");
            let holder = format!("`veth0` is in use by process {} (`omnibase run ", operated.run.id());
            assert!(said.contains(&holder) && said.contains("omnibase scan @robot"), "{command:?}: {said}");
        }
        assert_eq!(operated.now()["phase"], "holding", "it was left alone");
        let words = operated.end();
        assert!(!words.iter().any(|text| text.contains(": lost: ")), "{words:?}");
        // The lock went with its holder.
        let _simulator = Program::simulate(&[&robot]);
        let scan = Program::omnibase(&["scan", near]).end();
        assert_eq!(scan.status.code(), Some(0), "{scan:?}");
    });
}

#[test]
fn frames_of_another_main_device_are_heard_before_anything_is_sent() {
    let Some(namespace) = Namespace::for_test("frames_of_another_main_device") else { return };
    namespace.run(|| {
        let _simulator = Program::simulate(&[&repository("robots/bmm.toml")]);
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            // One that keeps to no lock: a broadcast read again and again, as any MainDevice.
            scope.spawn(|| {
                namespace.run(|| {
                    let mut port = PacketSocket::open(Namespace::NEAR).unwrap();
                    let mut frame = FrameBuilder::new();
                    frame.push(Datagram::Brd, 7, Address::broadcast(0x0130), &[0; 2]).unwrap();
                    while !stop.load(Ordering::Relaxed) {
                        port.send(frame.bytes()).unwrap();
                        std::thread::sleep(Duration::from_millis(1));
                    }
                })
            });
            let commands: [&[&str]; 3] = [
                &["scan", Namespace::NEAR],
                &["sdo", "read", Namespace::NEAR, "0", "6041:00"],
                &["exchange", Namespace::NEAR, "--cycles", "10"],
            ];
            let ended = commands.map(|command| (command, Program::omnibase(command).end()));
            let forced = Program::omnibase(&["scan", Namespace::NEAR, "--force"]).end();
            stop.store(true, Ordering::Relaxed);
            for (command, refused) in ended {
                assert_eq!(refused.status.code(), Some(1), "{command:?}: {refused:?}");
                for words in [
                    "`veth0`: another MainDevice drives this segment",
                    "EtherCAT frames in 100 ms",
                    "--force",
                ] {
                    assert!(refused.said.contains(words), "{command:?}: {}", refused.said);
                }
            }
            assert_eq!(forced.status.code(), Some(0), "{forced:?}");
            assert!(forced.said.contains("the segment is taken from another MainDevice"), "{forced:?}");
        });
    });
}

#[test]
fn a_running_robot_answers_scan_and_sdo_beside_its_cycle() {
    let Some(namespace) = Namespace::for_test("a_running_robot_answers_scan_and_sdo") else { return };
    namespace.run(|| {
        let listed = ["--set", "bus.sdo_write_while_enabled=[\"6084\"]"];
        let robot = Operated::start("answers", &listed);
        let said = |arguments: &[&str]| {
            let ended = robot.omnibase(arguments);
            let said = [ended.stdout, ended.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
            (ended.status.code(), said)
        };
        let write = |object: &str| said(&["sdo", "write", "@robot", "1", object, "20000", "--type", "u32"]);
        // No drive is enabled: anything that the cycle doesn't own.
        assert_eq!(write("6083:00"), (Some(0), "6083:00 written: 20000 (0x00004e20)\n".to_owned()));
        robot.enable();
        let (code, scanned) = said(&["scan", "@robot"]);
        assert_eq!((code, scanned.matches("state     OP, station").count()), (Some(0), 3), "{scanned}");
        let (code, read) = said(&["sdo", "read", "@robot", "1", "6083:00", "1008:00"]);
        assert_eq!(code, Some(0), "{read}");
        assert_eq!(read, "6083:00 20000 (0x00004e20)\n1008:00 \"SGDV-OCA01A\"\n");
        for (object, why) in [
            ("6083:00", "the drives are enabled"),
            ("6040:00", "the cycle writes the controlword"),
            ("1c12:00", "the bus decides what is mapped"),
        ] {
            let (code, refused) = write(object);
            assert!(code == Some(1) && refused.contains(why), "{object}: {refused}");
        }
        assert_eq!(write("6084:00").0, Some(0), "the robot's file allows it");
        let (code, called) = said(&["call", "sdo_read", "subdevice=1", "object=6084:00"]);
        assert_eq!((code, called.as_str()), (Some(0), "6084:00 20000 (0x00004e20)\n"));
        let (code, aborted) = said(&["sdo", "read", "@robot", "1", "5fff:00"]);
        assert!(code == Some(1) && aborted.contains("SDO read of 5fff:00: "), "{aborted}");
        // With names and values, while the drives are enabled; a hole is none of its entries.
        let (code, listed) = said(&["sdo", "list", "@robot", "1", "1008", "1c32", "6041", "6083"]);
        assert_eq!(code, Some(0), "{listed}");
        let line = |begin: &str| listed.lines().find(|line| line.trim_start().starts_with(begin)).unwrap();
        assert!(line("1008:00   r---").ends_with("string \"SGDV-OCA01A\""), "{}", line("1008:00"));
        assert!(line("6083:00   rw").contains("u32 20000"), "{}", line("6083:00"));
        assert!(line("6041:00").split_whitespace().count() > 4 && listed.contains("1c32:20"), "{listed}");
        let (code, nobody) = said(&["sdo", "list", "@robot", "7"]);
        assert!(code == Some(1) && nobody.contains("there is no SubDevice 7: the robot has 3"), "{nobody}");
        let (code, nobody) = said(&["sdo", "read", "@robot", "7", "6041:00"]);
        assert!(code == Some(1) && nobody.contains("there is no SubDevice 7: the robot has 3"), "{nobody}");
        let words = robot.end();
        for object in ["6083:00", "6084:00"] {
            let told = format!("SDO: {object} of SubDevice 1 was written");
            assert_eq!(words.iter().filter(|text| text.contains(&told)).count(), 1, "{told}: {words:?}");
        }
        assert!(!words.iter().any(|text| text.contains(": lost: ")), "{words:?}");
    });
}
