//! `eeprom` and `foe` as a user runs them: what a device keeps.

use super::{Simulator, json, omnibase, segment, sim, text};
use omnibase_ethercat_wire::sii;
use omnibase_host::Namespace;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
fn checksum_is_right(path: &Path) -> bool {
    let image = std::fs::read(path).unwrap();
    image[14] == sii::checksum(image.first_chunk().unwrap())
}

#[test]
fn an_eeprom_is_read_written_and_given_an_alias_over_a_cable() {
    let Some(namespace) = Namespace::for_test("an_eeprom_is_read_written_and_given_an_alias_over_a_cable")
    else {
        return;
    };
    namespace.run(|| {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let (_simulator, _) = Simulator::start(&[&segment("three-servos")]);
        let run = |arguments: &[&str], path: &Path, more: &[&str]| {
            let all = [&["eeprom"], arguments, &[path.to_str().unwrap()], more].concat();
            let output = omnibase(&all);
            (output.status.code(), text(&output.stdout) + &text(&output.stderr))
        };
        let near = Namespace::NEAR;
        let (code, words) = run(&["read", near, "1"], &file("first.bin"), &[]);
        assert_eq!(code, Some(0), "{words}");
        let first = std::fs::read(file("first.bin")).unwrap();
        assert_eq!(first.len(), 2048);

        let (code, words) = run(&["alias", near, "1", "7", "--backup"], &file("backup.bin"), &[]);
        assert_eq!(code, Some(0), "{words}");
        // The checksum spoiled, the alias, the checksum.
        assert!(words.contains("SubDevice 1: 3 words written and read back"), "{words}");
        assert_eq!(std::fs::read(file("backup.bin")).unwrap(), first);
        let (_, words) = run(&["read", near, "1"], &file("second.bin"), &[]);
        let second = std::fs::read(file("second.bin")).unwrap();
        assert_eq!((second[8], checksum_is_right(&file("second.bin"))), (7, true), "{words}");
        let (_, words) = run(&["alias", near, "1", "7", "--backup"], &file("none.bin"), &[]);
        assert!(words.contains("nothing was written") && !file("none.bin").exists(), "{words}");

        // The whole back, its checksum computed whatever the file says.
        let mut wrong = first.clone();
        wrong[14] ^= 0xFF;
        std::fs::write(file("wrong.bin"), wrong).unwrap();
        let backup = file("again.bin");
        let (code, words) =
            run(&["write", near, "1"], &file("wrong.bin"), &["--backup", backup.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{words}");
        run(&["read", near, "1"], &file("third.bin"), &[]);
        assert_eq!(std::fs::read(file("third.bin")).unwrap(), first);

        // An image of another product, and one that is there already.
        let mut other = first.clone();
        other[16] ^= 1;
        std::fs::write(file("other.bin"), other).unwrap();
        let (code, words) = run(&["write", near, "1"], &file("other.bin"), &[]);
        assert!(code == Some(1) && words.contains("--other-product"), "{words}");
        let (code, words) = run(&["read", near, "1"], &file("first.bin"), &[]);
        assert!(code == Some(1) && words.contains("File exists"), "{words}");
        let (code, words) = run(&["read", "@robot", "1"], &file("robot.bin"), &[]);
        assert!(code == Some(1) && words.contains("a robot runs there: end it first"), "{words}");
    });
}

/// An image that would leave the device broken or one of two that nobody can tell apart: refused before the first word, or told.
#[test]
fn an_image_that_does_not_fit_is_refused_before_it_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let target = sim("three-servos");
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let read = omnibase(&["eeprom", "read", &target, "2", &file("own.bin")]);
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
    let own = std::fs::read(file("own.bin")).unwrap();
    let write = |name: &str, image: &[u8]| {
        std::fs::write(file(name), image).unwrap();
        let (image, backup) = (file(name), file(&format!("before-{name}")));
        let arguments = ["eeprom", "write", &target, "2", &image, "--other-product", "--backup", &backup];
        let output = omnibase(&arguments);
        let words = text(&output.stdout) + &text(&output.stderr);
        (output.status.code(), words, Path::new(&backup).exists())
    };
    // (name, byte and value there, what is said, whether it is written all the same)
    let changed = [
        ("alias", 8, 1, "alias 1 belongs to SubDevice [0] already", false),
        ("serial", 28, 1, "serial number 1 of", true),
        ("revision", 24, 9, "is for revision 0x00010009", true),
    ];
    for (name, at, value, expected, is_written) in changed {
        let mut image = own.clone();
        image[at] = value;
        let (code, words, has_backup) = write(name, &image);
        assert!(words.contains(expected), "{name}: {words}");
        assert_eq!((code == Some(0), has_backup), (is_written, is_written), "{name}: {words}");
    }
    let mut large = own.clone();
    large[0x7C] = 0x1F;
    large.resize(4096, 0xFF);
    let erased = "is the image of an erased EEPROM";
    for (name, image, expected) in [
        ("large", large, "the image has 4096 bytes, the EEPROM of SubDevice 2 has 2048: not written"),
        ("ones", vec![0xFF; 2048], erased),
        ("zeros", vec![0; 2048], erased),
    ] {
        let (code, words, has_backup) = write(name, &image);
        assert!(words.contains(expected), "{name}: {words}");
        assert_eq!((code, has_backup), (Some(1), false), "{name}: {words}");
    }
    let endless = omnibase(&["eeprom", "write", &target, "2", "/dev/zero"]);
    let words = text(&endless.stderr);
    assert_eq!(endless.status.code(), Some(1), "{words}");
    assert!(words.contains("reading `/dev/zero`: expected at most 8388608 bytes"), "{words}");
}

/// An EEPROM that says nothing true of its size, and begins anew behind its end: what is written there would fall on its beginning.
#[test]
fn an_image_for_a_larger_eeprom_than_the_one_that_begins_anew_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mut image = sii::Image::default();
    image.header.identity = sii::Identity { vendor_id: 0x539, product_code: 7, revision: 1, serial: 1 };
    let mut small = image.emit();
    // It says that it has the fixed part alone.
    small[0x7C..0x7E].fill(0);
    small.resize(4096, 0xFF);
    std::fs::write(file("small.bin"), &small).unwrap();
    std::fs::write(file("segment.toml"), "[[subdevice]]\nkind = \"sii\"\nsii = \"small.bin\"\n").unwrap();
    let write = |bytes: usize| {
        let mut other = image.clone();
        other.header.size_kibit_less_one = (bytes / 128 - 1) as u16;
        let mut other = other.emit();
        other.resize(bytes, 0xFF);
        std::fs::write(file("new.bin"), other).unwrap();
        let (target, backup) =
            (format!("sim:{}", file("segment.toml")), file(&format!("before-{bytes}.bin")));
        let output = omnibase(&["eeprom", "write", &target, "0", &file("new.bin"), "--backup", &backup]);
        let words = text(&output.stdout) + &text(&output.stderr);
        (output.status.code(), words, std::fs::metadata(&backup).map_or(0, |backup| backup.len()))
    };
    let (code, words, kept) = write(8192);
    let told =
        "the image has 8192 bytes, the EEPROM of SubDevice 0 4096: it begins anew behind these; not written";
    assert!(words.contains(told), "{words}");
    assert_eq!((code, kept), (Some(1), 0), "{words}");
    let (code, words, kept) = write(4096);
    assert_eq!((code, kept), (Some(0), 4096), "{words}");
}

/// A first Ctrl-C doesn't leave half an EEPROM or half a firmware: it's told so, and the work goes to its end.
#[test]
fn what_must_be_whole_is_not_broken_off() {
    let Some(namespace) = Namespace::for_test("what_must_be_whole_is_not_broken_off") else { return };
    namespace.run(|| {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let (_simulator, _) = Simulator::start(&[&segment("three-servos")]);
        let near = Namespace::NEAR;
        let read = omnibase(&["eeprom", "read", near, "2", &file("own.bin")]);
        assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
        let own = std::fs::read(file("own.bin")).unwrap();
        // Behind the last category.
        let end = own.iter().rposition(|byte| *byte != 0xFF).unwrap() + 3;
        // Interrupted once it has said `begun`; whether it was told.
        let interrupted = |arguments: &[&str], begun: &str| {
            let mut child = Command::new(env!("CARGO_BIN_EXE_omnibase"))
                .args(arguments)
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
            let before: Vec<String> = lines.by_ref().take_while(|line| !line.contains(begun)).collect();
            assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
            let after: Vec<String> = lines.collect();
            assert_eq!(child.wait().unwrap().code(), Some(0), "{before:?} {after:?}");
            after.iter().any(|line| line.contains("not ended: the device would be left with"))
        };
        std::fs::write(file("firmware"), vec![7; 200_000]).unwrap();
        let is_told = |round: usize| {
            let mut image = own.clone();
            image[end..].fill(round as u8);
            std::fs::write(file("new.bin"), image).unwrap();
            let backup = file(&format!("backup-{round}.bin"));
            let eeprom = ["eeprom", "write", near, "2", &file("new.bin"), "--backup", &backup];
            let foe = ["foe", "write", near, "0", &file("firmware")];
            // On a busy machine it may have been done by then.
            [interrupted(&eeprom, "the present content is in"), interrupted(&foe, "writing 200000 bytes")]
        };
        let mut told = [false; 2];
        for round in 0..20 {
            let now = is_told(round);
            told = [told[0] || now[0], told[1] || now[1]];
            if told == [true; 2] {
                return;
            }
        }
        panic!("told of eeprom and foe: {told:?}");
    });
}

#[test]
fn firmware_is_written_compared_and_read_over_a_cable() {
    let Some(namespace) = Namespace::for_test("firmware_is_written_compared_and_read_over_a_cable") else {
        return;
    };
    namespace.run(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let content: Vec<u8> = (0..3000u32).map(|n| (n % 241) as u8).collect();
        std::fs::write(path("new.bin"), &content).unwrap();
        let (_simulator, _) = Simulator::start(&[&segment("three-servos")]);
        let near = Namespace::NEAR;
        let said = |arguments: &[&str]| {
            let output = omnibase(&[&["foe"], arguments].concat());
            (output.status.code(), text(&output.stdout) + &text(&output.stderr))
        };
        let (code, words) = said(&["write", near, "2", &path("new.bin"), "--name", "firmware.bin"]);
        assert_eq!(code, Some(0), "{words}");
        assert!(words.contains("SubDevice 2: 3000 bytes as `firmware.bin`: read back, the same"), "{words}");
        let (code, words) = said(&["read", near, "2", &path("back.bin"), "--name", "firmware.bin"]);
        assert_eq!(code, Some(0), "{words}");
        assert_eq!(std::fs::read(path("back.bin")).unwrap(), content);
        let (code, words) = said(&["read", near, "1", &path("none.bin"), "--name", "nope.bin"]);
        assert!(code == Some(1) && words.contains("FoE error 0x8001 file not found"), "{words}");
        let (code, words) =
            said(&["read", near, "1", &path("none.bin"), "--name", "firmware.bin", "--pre-op"]);
        assert!(code == Some(1) && words.contains("0x8008 in BOOT only"), "{words}");
        let (code, words) =
            said(&["write", near, "1", &path("new.bin"), "--name", "firmware.bin", "--pre-op"]);
        assert!(code == Some(1) && words.contains("0x8008 in BOOT only"), "{words}");
        assert!(words.contains("before its first byte: nothing of it was written"), "{words}");
        // The others were left alone, and everybody works.
        let found = json(&omnibase(&["scan", near, "--json"]));
        // A frame that a busy machine answered too late is none of theirs.
        let trouble = found["trouble"].as_array().unwrap().iter().filter_map(|words| words.as_str());
        let of_devices: Vec<&str> =
            trouble.filter(|words| !words.contains("frames didn't come back")).collect();
        assert_eq!(of_devices, Vec::<&str>::new());
    });
}

/// A read that failed leaves nobody in BOOT: its firmware is untouched.
#[test]
fn a_failed_read_of_a_file_leaves_boot() {
    let Some(namespace) = Namespace::for_test("a_failed_read_of_a_file_leaves_boot") else { return };
    namespace.run(|| {
        let mut simulator = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["simulate", &segment("three-servos"), "--interface", Namespace::FAR])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(simulator.stdout.take().unwrap()).lines().map_while(Result::ok);
        assert!(lines.next().is_some_and(|line| line.starts_with("simulating 3 SubDevices")));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("none.bin");
        let read =
            omnibase(&["foe", "read", Namespace::NEAR, "1", file.to_str().unwrap(), "--name", "nope.bin"]);
        assert!(text(&read.stderr).contains("file not found"), "{}", text(&read.stderr));
        let ended = Command::new("kill").args(["-INT", &simulator.id().to_string()]).status().unwrap();
        assert!(ended.success());
        let ended = simulator.wait_with_output().unwrap();
        let (words, mark) = (text(&ended.stderr), " s  SubDevice 1: ");
        let states: Vec<&str> = words.lines().filter_map(|line| Some(line.split_once(mark)?.1)).collect();
        assert_eq!(states, ["BOOT", "INIT"]);
    });
}
