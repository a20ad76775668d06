//! From a maker's file or a scan to tables that a robot's file takes.

use crate::command_line::{Folder, omnibase, root, words};
use std::path::Path;

/// A robot's file with three drives, to which tables of SubDevices are added.
fn with_devices(tables: &str) -> String {
    let base = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    base.replace("[platform]", &format!("{tables}\n[platform]"))
}

fn esi(arguments: &[&str]) -> String {
    let output = omnibase(&[&["esi"], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", words(&output.stderr));
    words(&output.stdout)
}

/// Checks a robot's file; what is wrong with it.
fn problems(folder: &Folder, text: &str) -> Option<String> {
    let path = folder.path("robot.toml");
    std::fs::write(&path, text).unwrap();
    let output = omnibase(&["check", &path]);
    (!output.status.success()).then(|| words(&output.stdout) + &words(&output.stderr))
}

#[test]
fn a_makers_file_becomes_tables_that_a_robots_file_takes() {
    let folder = Folder::new("esi");
    let file = "segments/maker.xml";
    let listed = esi(&[file, "--modules"]);
    for expected in
        ["MU-SERVO", "0x00000402:0x00010000", "drive (CiA 402)", "slots for 8 modules", "ident 0x00000101"]
    {
        assert!(listed.contains(expected), "{expected}\n{listed}");
    }
    let slots = ["--slot", "MU-AI", "--slot", "MU-DO"];
    let coupler = esi(&[&[file, "--device", "MU-COUPLER", "--toml"], &slots[..]].concat());
    assert!(coupler.contains("bytes = \"6D6164652075702E\"") && coupler.contains("0xF030.2"), "{coupler}");
    let terminal = esi(&[file, "--device", "MU-IO", "--toml"]);
    assert!(
        terminal.contains("SyncManager 1 is virtual") && terminal.contains("SyncManager 0 is on in OP alone")
    );
    for table in [&coupler, &terminal] {
        let table = table.replace("position = 0", "position = 3");
        assert_eq!(problems(&folder, &with_devices(&table)), None, "{table}");
    }
    // Modes of its clock: the first with SYNC0 is its own, the other one is there to be chosen.
    let drive = esi(&[file, "--device", "0x402:0x10000", "--toml"]);
    let other =
        "dc = { assign_activate = \"0x0700\", sync0_per_cycle = 4, sync1_every = 4, sync1_shift_us = 20 }";
    let own = "dc = { assign_activate = \"0x0300\" }";
    assert!(drive.contains(&format!("\n{own}")) && drive.contains(&format!("\n# {other}")), "{drive}");
    assert!(
        drive.contains("In that mode its maker shifts SYNC0 by 30 us: add that to `bus.sync0_shift_us`"),
        "{drive}"
    );
    let waits = "timeouts = { init_ms = 5000, pre_op_ms = 3000, safe_op_op_ms = 10000, mailbox_ms = 6100 }";
    assert!(drive.contains(&format!("\n{waits}")), "{drive}");
    let warm_up = "{ object = \"0x2100\", type = \"u8\", value = 1, state = \"safe_op\" },";
    assert!(drive.contains(warm_up) && !drive.contains("LOOK AT THIS"), "{drive}");
    // A drive lacks what only its motor's plate tells: that is said, and nothing else.
    let filled = drive.replace(&format!("\n{own}"), &format!("\n{other}"));
    let filled = filled
        .replace("# counts_per", "counts_per")
        .replace("# rated_", "rated_")
        .replace("# peak_", "peak_");
    let base = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    let (before, after) = base.split_once("[[drive]]").unwrap();
    let (_, after) = after.split_once("[[drive]]").unwrap();
    let before = before.replace("rated_torque_nm = 7.0\n", "").replace("peak_torque_nm = 21.0\n", "");
    let both = |drive: &str| format!("{before}{drive}\n[[drive]]{after}");
    let lacking = problems(&folder, &both(&drive)).unwrap();
    assert!(lacking.contains("rated_torque_nm") && lacking.contains("counts_per_revolution"), "{lacking}");
    assert!(problems(&folder, &both(&filled)).is_none_or(|text| !text.contains("drive[0]")), "{filled}");
    let wrong = omnibase(&["esi", file, "--device", "MU-SERVER"]);
    assert!(words(&wrong.stderr).contains("no device of the file is called \"MU-SERVER\"; it has MU-SERVO"));
    let wrong = omnibase(&["esi", file, "--device", "MU-COUPLER", "--slot", "MU-SAFE"]);
    assert!(
        words(&wrong.stderr).contains("slot 1 of MU-COUPLER takes modules of the classes Io"),
        "{}",
        words(&wrong.stderr)
    );
}

#[test]
fn check_tells_what_is_written_in_which_state() {
    let folder = Folder::new("written-in");
    let base = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    let more = "value = 2_500_000 }, { object = \"2100\", type = \"u8\", value = 1, state = \"safe_op\" }]";
    let path = folder.path("robot.toml");
    std::fs::write(&path, base.replace("value = 2_500_000 }]", more)).unwrap();
    let checked = omnibase(&["check", &path]);
    let told = words(&checked.stdout);
    for expected in ["    written in PRE-OP  6007:00 605a:00 6085:00\n", "    written in SAFE-OP 2100:00\n"] {
        assert_eq!(told.matches(expected).count(), 3, "{expected}\n{told}");
    }
}

#[test]
fn what_is_wrong_with_a_makers_file_is_told_with_each_form_of_a_device() {
    let folder = Folder::new("esi-wrong");
    let made_up = std::fs::read_to_string(root().join("segments/maker.xml")).unwrap();
    let wrong = [
        ("<Id>#x0F0F</Id>", "<Id/>"),
        ("RevisionNo=\"#x00010000\"", "RevisionNo=\"#x 0001 0000\""),
        ("<AssignActivate>#x0300<", "<AssignActivate>#x30000<"),
        ("<Data>0300</Data>", "<Data>030</Data>"),
        ("<BitLen>32</BitLen><Name>Target velocity", "<BitLen>300</BitLen><Name>Target velocity"),
        ("<GroupType>Drives</GroupType>", "<GroupType>Drives</GroupType><Wheel/>"),
    ];
    let text = wrong.iter().fold(made_up, |text, (right, wrong)| text.replacen(right, wrong, 1));
    let path = folder.path("wrong.xml");
    std::fs::write(&path, text).unwrap();
    let told = [
        "Vendor/Id: expected a number",
        "attribute RevisionNo: expected a number",
        "AssignActivate: expected a number from 0 to 65535, found \"#x30000\"",
        "InitCmd/Data: expected at most 4096 bytes in hexadecimal, found \"030\"",
        "BitLen: expected a number from 0 to 255, found \"300\"",
        "/Device/Wheel",
    ];
    let mut tables = Vec::new();
    let image = folder.path("image.bin");
    for form in [&[][..], &["--toml"], &["--segment"], &["--json"], &["--sii", &image]] {
        let output = omnibase(&[&["esi", &path, "--device", "MU-SERVO"], form].concat());
        assert_eq!(output.status.code(), Some(1), "{form:?}");
        let stderr = words(&output.stderr);
        for expected in told {
            assert!(stderr.contains(expected), "{form:?}: {expected}\n{stderr}");
        }
        tables.push(words(&output.stdout));
    }
    for expected in told.map(|one| one.rsplit(": ").next().unwrap().replace('"', "\\\"")) {
        assert!(tables[3].contains(&expected), "{expected}\n{}", tables[3]);
    }
    let table = &tables[1];
    for expected in [
        "# vendor_id = \"?\"",
        "LOOK AT THIS: line 80: EtherCATInfo/Descriptions/Devices/Device/Mailbox/CoE/InitCmd: the command can't be read whole: it is left out",
        "# revision = \"?\"",
        "pad:8 ? 6071:16",
        "FILL IN what",
        "has a number that can't be read",
    ] {
        assert!(table.contains(expected), "{expected}\n{table}");
    }
    assert!(!table.contains("\"0x0\"") && !table.contains("without SYNC"), "{table}");
    assert!(tables[0].contains("vendor ?, product 0x00000402, revision ?"), "{}", tables[0]);
    assert!(!Path::new(&image).exists(), "an image without a revision was written");
}

/// Numbers of SyncManagers and PDOs that can't be read: no 0 in any form, no image, and no table of a device that is sound.
#[test]
fn what_cannot_be_read_is_in_no_form_a_zero() {
    let folder = Folder::new("esi-unread");
    let device = |sm: &str, index: &str| {
        format!(
            "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device><Type ProductCode=\"1\" RevisionNo=\"1\">D\
            </Type>{sm}<RxPdo Sm=\"0\"><Index>{index}</Index><Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen>\
            </Entry></RxPdo></Device></Devices></Descriptions></EtherCATInfo>"
        )
    };
    let sound = "<Sm StartAddress=\"#x1200\" ControlByte=\"#x64\">Outputs</Sm>";
    let wrong = "<Sm StartAddress=\"-4\" ControlByte=\"zz\" DefaultSize=\"-128\">Outputs</Sm>";
    let path = folder.path("wrong.xml");
    let image = folder.path("image.bin");
    let form = |form: &[&str]| {
        let output = omnibase(&[&["esi", &path, "--device", "D"], form].concat());
        assert_eq!(output.status.code(), Some(1), "{form:?}");
        (words(&output.stdout), words(&output.stderr))
    };
    std::fs::write(&path, device(wrong, "#x1600")).unwrap();
    assert!(form(&[]).0.contains("outputs, ?, ? bytes, control ?"), "{}", form(&[]).0);
    let json: serde_json::Value = serde_json::from_str(&form(&["--json"]).0).unwrap();
    let unread = serde_json::Value::Null;
    for key in ["start", "default_size", "control"] {
        assert_eq!(json["sync_managers"][0][key], unread, "{json}");
    }
    let (_, said) = form(&["--sii", &image]);
    assert!(said.contains("no image is written of a device that can't be read whole: line 1: "), "{said}");
    assert!(!Path::new(&image).exists());
    let segment = folder.path("segment.toml");
    std::fs::write(&segment, form(&["--segment"]).0).unwrap();
    let scan = omnibase(&["scan", &format!("sim:{segment}")]);
    assert!(words(&scan.stderr).contains("attribute StartAddress: expected"), "{}", words(&scan.stderr));
    // Its only PDO: what it is for isn't known.
    std::fs::write(&path, device(sound, "zz")).unwrap();
    let (table, _) = form(&["--toml"]);
    assert!(!table.contains("ignore") && table.contains("# kind = \"?\""), "{table}");
    assert!(
        table.contains("LOOK AT THIS") && table.contains("the PDO has no index: it is left out"),
        "{table}"
    );
}

#[test]
fn files_are_neither_written_over_nor_read_twice() {
    let folder = Folder::new("esi-kept");
    let file = "segments/maker.xml";
    let copy = folder.path("maker.xml");
    std::fs::copy(root().join(file), &copy).unwrap();
    let output = omnibase(&["esi", &copy, "--device", "MU-IO", "--sii", &copy]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        words(&output.stderr).contains("nothing that exists is written over"),
        "{}",
        words(&output.stderr)
    );
    assert_eq!(std::fs::read(&copy).unwrap(), std::fs::read(root().join(file)).unwrap());
    let image = folder.path("io.bin");
    assert_eq!(esi(&[file, "--device", "MU-IO", "--sii", &image]), "");
    assert_eq!(std::fs::read(&image).unwrap().len(), 2048);
    let small = folder.path("small.xml");
    let text = std::fs::read_to_string(&copy).unwrap();
    std::fs::write(&small, text.replace("<ByteSize>2048<", "<ByteSize>64<")).unwrap();
    let output = omnibase(&["esi", &small, "--device", "MU-IO", "--sii", &folder.path("small.bin")]);
    assert!(
        words(&output.stderr).contains("its file says that the EEPROM has 64 bytes"),
        "{}",
        words(&output.stderr)
    );
    let output = omnibase(&["esi", file, file, "--modules"]);
    assert!(
        words(&output.stderr).contains("`segments/maker.xml` is given twice"),
        "{}",
        words(&output.stderr)
    );
}

#[test]
fn a_makers_drive_is_found_as_one() {
    let folder = Folder::new("esi-drive");
    let segment = esi(&["segments/maker.xml", "--device", "MU-SERVO", "--segment"]);
    let path = folder.path("segment.toml");
    std::fs::write(&path, segment).unwrap();
    let tables = words(&omnibase(&["scan", &format!("sim:{path}"), "--toml"]).stdout);
    assert!(tables.contains("[[drive]]"), "{tables}");
    // One whose map tells no wheel anything.
    let lacks = "put 60FF:32 (target velocity), or 6071:16 (target torque) for a law of torque, into `outputs`: its map lacks both.";
    assert!(!tables.contains(lacks), "{tables}");
    let text = std::fs::read_to_string(root().join("segments/maker.xml")).unwrap();
    let maker = folder.path("maker.xml");
    std::fs::write(&maker, text.replace("#x60FF", "#x2FF0").replace("#x6071", "#x2FF1")).unwrap();
    let segment = format!("[[subdevice]]\nkind = \"esi\"\nesi = \"{maker}\"\ndevice = \"MU-SERVO\"\n");
    std::fs::write(&path, segment).unwrap();
    let tables = words(&omnibase(&["scan", &format!("sim:{path}"), "--toml"]).stdout);
    assert!(tables.contains(lacks), "{tables}");
}

#[test]
fn a_makers_device_is_simulated_and_brought_to_op() {
    let folder = Folder::new("esi-segment");
    let slots = ["--slot", "MU-AI", "--slot", "MU-DO"];
    for arguments in [&["--device", "MU-IO"][..], &[&["--device", "MU-COUPLER"], &slots[..]].concat()] {
        let segment = esi(&[&["segments/maker.xml", "--segment"], arguments].concat());
        let path = folder.path("segment.toml");
        assert!(!segment.contains("module_files"), "{segment}");
        std::fs::write(&path, segment).unwrap();
        let output = omnibase(&["exchange", &format!("sim:{path}"), "--cycles", "10"]);
        assert!(words(&output.stdout).contains("operational             yes"), "{}", words(&output.stderr));
    }
}

#[test]
fn every_device_and_module_of_real_makers_loads() {
    let shared = root().join("../shared/esi");
    if !shared.is_dir() {
        eprintln!("SKIPPED: real makers' ESI files: {} isn't there", shared.display());
        return;
    }
    let folder = Folder::new("esi-real");
    let file = |name: &str| shared.join(name).to_str().unwrap().to_owned();
    let (couplers, modular, modules) =
        (file("Beckhoff_EK11xx.xml"), file("Weidmueller_UR20_FBC.xml"), file("Weidmueller_UR20_IO.xml"));
    let scanned = file("Weidmueller_UR20_FBC_from_IgH.xml");
    let listed = |path: &String, key: &str| -> Vec<serde_json::Value> {
        let output = omnibase(&["esi", path, "--json"]);
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        value["files"][0][key].as_array().unwrap().clone()
    };
    let mut loaded = 0;
    let mut load = |arguments: &[&str]| {
        let table = esi(&[arguments, &["--toml"]].concat()).replace("position = 0", "position = 3");
        assert_eq!(problems(&folder, &with_devices(&table)), None, "{arguments:?}\n{table}");
        loaded += 1;
    };
    for path in [&couplers, &modular, &scanned] {
        for device in listed(path, "devices") {
            let wanted = format!("{}:{}", device["product_code"], device["revision"]);
            load(&[path, "--device", &wanted]);
        }
    }
    let modules_ = listed(&modules, "modules");
    let names: Vec<&str> = modules_.iter().map(|module| module["type"].as_str().unwrap()).collect();
    // Several in a station: each command reads all of the makers' files.
    for some in names.chunks(8) {
        let slots = some.iter().flat_map(|name| ["--slot", name]);
        let station = [&modular, &modules, "--device", "UR20-FBC-EC"].into_iter().chain(slots);
        load(&station.collect::<Vec<_>>());
    }
    assert_eq!((names.len(), loaded), (82, 27 + 11));
}

#[test]
fn a_scan_becomes_tables_that_a_robots_file_takes() {
    let folder = Folder::new("scan-toml");
    let output = omnibase(&["scan", "sim:segments/three-servos.toml", "--toml"]);
    let tables = words(&output.stdout);
    assert_eq!(tables.matches("[[drive]]").count(), 3, "{tables}");
    for expected in [
        "rated_torque_nm = 7.0",
        "peak_torque_nm = 21.0",
        "FILL IN: counts of 0x6064",
        "MEASURE which way its wheel turns",
    ] {
        assert!(tables.contains(expected), "{expected}\n{tables}");
    }
    let base = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    let (_, after) = base.split_once("[platform]").unwrap();
    let file = |tables: &str| {
        format!(
            "name = \"found\"\n\n[bus]\ncycle_us = 1000\nsynchronisation = \"sync0\"\n\n{tables}\n[platform]{after}"
        )
    };
    let lacking = problems(&folder, &file(&tables)).unwrap();
    assert!(lacking.contains("counts_per_revolution"), "{lacking}");
    let filled = tables
        .replace("# counts_per_revolution", "counts_per_revolution")
        .replace("# gear_ratio", "gear_ratio");
    assert_eq!(problems(&folder, &file(&filled)), None, "{filled}");
    let terminals = words(&omnibase(&["scan", "sim:segments/mixed-tree.toml", "--toml"]).stdout);
    assert!(terminals.contains("kind = \"ignore\"") && terminals.contains("kind = \"io\""), "{terminals}");
    assert!(Path::new(&root()).join("docs/guides/any-device.md").is_file());
}

/// What two have can find neither; a switch finds as an alias does; modules, a drive that doesn't tell its profile and an EEPROM that
/// leads out of itself are told in the tables themselves.
#[test]
fn what_a_scan_is_not_sure_of_stands_in_its_tables() {
    use omnibase_ethercat::wire::{coe::ObjectAddress, sii};
    let folder = Folder::new("scan-toml-odd");
    let mut cut = sii::Image::default();
    cut.header.checksum = u16::from(cut.header.computed_checksum());
    let mut bytes = cut.emit();
    // A category of 60 KiB in place of the end of all.
    bytes.truncate(sii::HEADER);
    bytes.extend_from_slice(&[0x00, 0x01, 0x00, 0x78]);
    bytes.resize(2048, 0);
    std::fs::write(folder.path("cut.bin"), bytes).unwrap();
    let inputs = sii::SyncManager {
        start: 0x1100,
        length: 2,
        control: 0,
        status: 0,
        enable: 1,
        usage: sii::SyncManagerUsage::Inputs,
    };
    let object = ObjectAddress::new(0x6000, 1);
    let entries = vec![sii::PdoEntry { object, name: 0, data_type: 0, bit_length: 16, flags: 0 }];
    let pdo =
        sii::Pdo { index: 0x1A00, sync_manager: Some(0), synchronization: 0, name: 0, flags: 0, entries };
    let mut quiet = sii::Image { sync_managers: vec![inputs], tx_pdos: vec![pdo], ..sii::Image::default() };
    quiet.header.checksum = u16::from(quiet.header.computed_checksum());
    std::fs::write(folder.path("quiet.bin"), quiet.emit()).unwrap();
    // An object of no meaning before the one that the dictionary describes.
    let value = "<Entry><Index DependOnSlot=\"1\">#x6000</Index>";
    let dummy = "<Entry><Index>#x0006</Index><SubIndex>0</SubIndex><BitLen>16</BitLen></Entry>";
    let text = std::fs::read_to_string(root().join("segments/maker.xml")).unwrap();
    assert!(text.contains(value));
    let maker = folder.path("maker.xml");
    std::fs::write(&maker, text.replace(value, &format!("{dummy}{value}"))).unwrap();
    let segment = folder.path("segment.toml");
    let servo = |more: &str| format!("[[subdevice]]\nkind = \"servo\"\n{more}\n");
    let text = [
        servo("alias = 7"),
        servo("alias = 7"),
        servo("identification = 5"),
        servo("identification = 6"),
        servo("identification = 6"),
        format!(
            "[[subdevice]]\nkind = \"esi\"\nesi = \"{}\"\ndevice = \"MU-COUPLER\"\nmodules = [\"MU-AI\", \"MU-DO\"]\n",
            maker
        ),
        "[[subdevice]]\nkind = \"sii\"\nsii = \"cut.bin\"\n".to_owned(),
        "[[subdevice]]\nkind = \"sii\"\nsii = \"quiet.bin\"\n".to_owned(),
    ]
    .concat();
    std::fs::write(&segment, text).unwrap();
    let output = omnibase(&["scan", &format!("sim:{}", segment), "--toml"]);
    let tables = words(&output.stdout);
    for expected in [
        "# WARNING: alias 0x0007 belongs to SubDevices [0, 1]",
        "# WARNING: identification 6 is shown by SubDevices [3, 4]",
        "position = 0 ",
        "others have its alias 7, too",
        "identification = 5 ",
        "other switches show its 6, too",
        "object = \"0xF030.1\", type = \"u32\", value = 257",
        "# WARNING: SubDevice 6: EEPROM: ",
        "category 256 announces 61440 bytes",
        "# WARNING: its EEPROM is damaged",
        // The coupler's EEPROM has nothing of its modules: its dictionary tells the type.
        "object = \"6000.1\", type = \"i16\" },",
        "object = \"6000.1\", type = \"u16\" }, # MEASURE: nobody tells whether it has a sign",
    ] {
        assert!(tables.contains(expected), "{expected}\n{tables}\n{}", words(&output.stderr));
    }
    assert!(!tables.contains("\nalias = "), "{tables}");
}
