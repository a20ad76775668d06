//! The program as a user runs it: what it prints, and its exit codes.

use omnibase_ethercat_wire::frame::{FrameBuilder, PROCESSED_BIT};
use omnibase_ethercat_wire::{Address, Command as Datagram};
use omnibase_record::{Direction, PcapngWriter};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures");

fn omnibase(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_omnibase")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A file of the test's own that vanishes with it.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str, content: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("omnibase-{}-{name}", std::process::id()));
        std::fs::write(&path, content).unwrap();
        Scratch(path)
    }

    fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A recording of one answered and one lost read of AL status, and one SDO that is refused.
fn recording() -> Vec<u8> {
    let mut writer = PcapngWriter::new(Vec::new(), "eth0").unwrap();
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Datagram::Fprd, 1, Address::station(0x1001, 0x0130), 6).unwrap();
    writer.write(1_000_000, Direction::Outbound, frame.bytes()).unwrap();
    let mut reply = frame.bytes().to_vec();
    reply[6] |= PROCESSED_BIT;
    reply[26] = 0x14;
    reply[30] = 0x1B;
    reply[32] = 1;
    writer.write(1_100_000, Direction::Inbound, &reply).unwrap();
    frame.bytes_mut()[17] = 2;
    writer.write(2_000_000, Direction::Outbound, frame.bytes()).unwrap();
    let mut mailbox = FrameBuilder::new();
    let abort = [10, 0, 0, 0, 0, 0x23, 0, 0x30, 0x80, 0x12, 0x1C, 1, 0, 0, 2, 6];
    mailbox.push(Datagram::Fprd, 3, Address::station(0x1001, 0x1080), &abort).unwrap();
    writer.write(3_000_000, Direction::Outbound, mailbox.bytes()).unwrap();
    let end = mailbox.bytes().len();
    mailbox.bytes_mut()[end - 2] = 1;
    writer.write(3_050_000, Direction::Inbound, mailbox.bytes()).unwrap();
    writer.finish().unwrap()
}

#[test]
fn decode_shows_datagrams_in_words_and_a_summary() {
    let file = Scratch::new("words.pcapng", &recording());
    let output = omnibase(&["decode", file.path()]);
    assert_eq!(output.status.code(), Some(0));
    let text = text(&output.stdout);
    for expected in [
        "     2    0.000100000 <- #01 FPRD stn 0x1001 0x0130 AL status          len    6 wkc   1  14 00 00 00 1b 00  | in SAFE-OP + ERROR; AL status code 0x001b SyncManager watchdog",
        "mailbox CoE #2: SDO ABORT 1c12:01, 0x06020000 the object does not exist in the object dictionary",
        "frames           5 (3 requests, 2 replies) with 5 datagrams in 0.002050 s",
        "matched          2, lost 1, open at the end 0, replies without request 0",
        "event            frame 2: in SAFE-OP + ERROR",
        "commands         FPRD 3",
    ] {
        assert!(text.contains(expected), "`{expected}` is missing in\n{text}");
    }
    let summary = omnibase(&["decode", "--summary", file.path()]);
    assert!(text.ends_with(&String::from_utf8(summary.stdout).unwrap()));
}

#[test]
fn decode_prints_json_with_numbers_as_numbers() {
    let file = Scratch::new("json.pcapng", &recording());
    let output = omnibase(&["decode", file.path(), "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let second = &document["datagrams"][1];
    assert_eq!((second["frame"].as_u64(), second["working_counter"].as_u64()), (Some(2), Some(1)));
    assert_eq!((second["command"].as_str(), second["direction"].as_str()), (Some("FPRD"), Some("reply")));
    assert_eq!((second["adp"].as_u64(), second["ado"].as_u64()), (Some(0x1001), Some(0x0130)));
    assert_eq!(second["data"].as_str(), Some("140000001b00"));
    assert_eq!(document["summary"]["lost_frames"].as_u64(), Some(1));
}

#[test]
fn a_capture_that_is_cut_off_is_shown_as_far_as_it_goes() {
    let whole = recording();
    let file = Scratch::new("cut.pcapng", &whole[..whole.len() - 3]);
    let output = omnibase(&["decode", file.path(), "--summary"]);
    assert_eq!(output.status.code(), Some(1));
    let text = text(&output.stdout);
    assert!(text.contains("frames           4 (3 requests, 1 replies)"), "{text}");
    assert!(
        text.contains("problem          byte") && text.contains("the file ends inside a block"),
        "{text}"
    );
}

#[test]
fn what_cannot_be_read_is_an_error_in_words_and_code_1() {
    let nonsense = Scratch::new("nonsense", b"these are no frames");
    let modules = Scratch::new(
        "modules.xml",
        b"<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Modules><Module><Type ModuleIdent=\"1\">M</Type>\
          </Module></Modules></Descriptions></EtherCATInfo>",
    );
    let long = "n".repeat(245);
    let cases = [
        (vec!["decode", "/no/such/file"], "error: reading `/no/such/file`: No such file or directory"),
        (vec!["decode", nonsense.path()], "not a capture: the file starts with 74 68 65 73"),
        (vec!["decode", "/dev/zero"], "not a capture: the file starts with 00 00 00 00"),
        (vec!["check", "/dev/zero"], "reading `/dev/zero`: expected at most 268435456 bytes, found more"),
        (
            vec!["run", "../../robots/bmm.toml", "--path", "/dev/zero"],
            "reference.points_file = \"/dev/zero\": expected at most 268435456 bytes, found more",
        ),
        (
            vec!["run", "../../robots/bmm.toml", "--reference", "/dev/zero"],
            "reading `/dev/zero`: expected at most 268435456 bytes, found more",
        ),
        (vec!["scan", "sim:/dev/zero"], "reading `/dev/zero`: expected at most 268435456 bytes, found more"),
        (vec!["sii", "/dev/zero"], "reading `/dev/zero`: expected at most 8388608 bytes, found more"),
        (vec!["esi", modules.path(), "--device", "MU-IO"], "the file has no devices; modules go into"),
        (
            vec!["foe", "read", "sim:../../segments/three-servos.toml", "0", "new.bin", "--name", ""],
            "--name is empty: expected the file's name in the SubDevice",
        ),
        (
            vec!["foe", "read", "sim:../../segments/three-servos.toml", "0", "new.bin", "--name", &long],
            "--name has 245 bytes, SubDevice 0's mailbox carries 244 at most",
        ),
        (vec!["sii", "/no/such/file"], "error: reading `/no/such/file`: No such file or directory"),
        (vec!["sii", nonsense.path()], "SII image of 19 bytes is shorter than its fixed part of 128"),
    ];
    for (arguments, expected) in cases {
        let output = omnibase(&arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(text(&output.stderr).contains(expected), "{arguments:?}: {}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn wrong_usage_is_code_2_and_help_has_examples() {
    for arguments in [&[][..], &["decode"], &["no-such-command"], &["sii", "a", "b"]] {
        assert_eq!(omnibase(arguments).status.code(), Some(2), "{arguments:?}");
    }
    for command in ["decode", "sii"] {
        let output = omnibase(&[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        assert!(text(&output.stdout).contains("Examples:"), "{command}");
    }
}

#[test]
fn shells_complete_and_man_shows_every_command() {
    let help = text(&omnibase(&["--help"]).stdout);
    let listed = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let is_name = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let commands: Vec<&str> =
        listed.lines().filter(is_name).filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() > 20 && commands.contains(&"run"), "{commands:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    assert_eq!(omnibase(&["manual", path]).status.code(), Some(0));
    let scripts = ["bash", "zsh", "fish"].map(|shell| text(&omnibase(&["completions", shell]).stdout));
    for command in commands.into_iter().filter(|&command| command != "help") {
        let page = std::fs::read_to_string(folder.path().join(format!("omnibase-{command}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{command}");
        assert!(scripts.iter().all(|script| script.contains(command)), "{command}");
    }
    // Options of registered motions are among them.
    assert!(scripts.iter().all(|script| script.contains("spiral")));
    let unmade = omnibase(&["manual", "/proc/nowhere"]);
    assert_eq!(unmade.status.code(), Some(1));
    assert!(text(&unmade.stderr).starts_with("error: writing manual pages to `/proc/nowhere`"));
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut frames = PcapngWriter::new(Vec::new(), "eth0").unwrap();
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Datagram::Brd, 0, Address::broadcast(0), 4).unwrap();
    for number in 0..5000 {
        frames.write(number, Direction::Outbound, frame.bytes()).unwrap();
    }
    let file = Scratch::new("long.pcapng", &frames.finish().unwrap());
    for json in [&[][..], &["--json"]] {
        let mut program = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["decode", file.path()])
            .args(json)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(program.stdout.take());
        let output = program.wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
    }
}

#[test]
fn sii_images_of_real_devices_come_in_words() {
    let image = format!("{CAPTURES}/akd-sii.bin");
    if !std::path::Path::new(&image).exists() {
        eprintln!("SKIPPED: {image} is not there");
        return;
    }
    let output = omnibase(&["sii", &image]);
    assert_eq!(output.status.code(), Some(0));
    let words = text(&output.stdout);
    for expected in [
        "name             AKD EtherCAT Drive (CoE)",
        "vendor           0x0000006a",
        "checksum         0x10, right",
        "mailbox          from the MainDevice 0x1800 1024 bytes, to the MainDevice 0x1c00 1024 bytes",
        "protocols        EoE, CoE, FoE",
        "SM2              outputs, 0x1100 0 bytes, control 0x24, enable 0x01",
        "TxPDO 1b01       Inputs, SM3, 6 bytes, flags 0x0010",
        "    6041:00  16 bits type 0x06  Statusword",
    ] {
        assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
    }
    let json = omnibase(&["sii", &image, "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(json["identity"]["product_code"].as_u64(), Some(0x0041_4B44));
    assert_eq!(json["tx_pdos"].as_array().unwrap().len(), 12);

    let broken = omnibase(&["sii", &format!("{CAPTURES}/akd-broken-strings-sii.bin")]);
    assert_eq!(broken.status.code(), Some(1));
    let words = text(&broken.stdout);
    assert!(words.contains("vendor           0x0000006a") && words.contains("PROBLEM at byte 0x"), "{words}");
}

#[test]
fn a_new_crate_overwrites_nothing_and_needs_a_name_and_a_source() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (arguments, words) in [
        (vec!["new", &path("Mine")], "is no name for a crate of your own"),
        (vec!["new", &path("omnibase")], "is no name for a crate of your own"),
        (
            vec!["new", &path("mine"), "--omnibase", folder.path().to_str().unwrap()],
            "no source of omnibase in",
        ),
    ] {
        let refused = omnibase(&arguments);
        assert_eq!(refused.status.code(), Some(1));
        assert!(text(&refused.stderr).contains(words), "{}", text(&refused.stderr));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was written");
    }
    let made = omnibase(&["new", &path("mine"), "--omnibase", "https://host.test/omnibase"]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let manifest = std::fs::read_to_string(folder.path().join("mine/Cargo.toml")).unwrap();
    assert!(manifest.contains("omnibase = { git = \"https://host.test/omnibase\" }"), "{manifest}");
    let again = omnibase(&["new", &path("mine")]);
    assert!(text(&again.stderr).contains("making the folder"), "{}", text(&again.stderr));
}
