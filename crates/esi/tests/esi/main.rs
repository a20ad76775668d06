//! ESI files: a made-up maker's, real makers' from `../shared/esi`, and what is wrong in all kinds of ways.

mod doubts;

use std::path::{Path, PathBuf};

use omnibase_esi::model::SmUse;
use omnibase_esi::{Assembly, AssemblyError, EsiError, EsiFile, Why, image};
use omnibase_ethercat_wire::sii::{Image, SyncManagerUsage};

const MADE_UP: &str = include_str!("../../../../segments/maker.xml");

fn made_up() -> EsiFile {
    EsiFile::parse(MADE_UP.as_bytes()).unwrap()
}

/// Files of real makers; `None` (said aloud) where they aren't there.
fn real() -> Option<Vec<(PathBuf, EsiFile)>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/esi");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!("SKIPPED: real makers' ESI files: {} isn't there", folder.display());
        return None;
    };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "xml"));
    paths.sort();
    Some(paths.into_iter().map(|path| (path.clone(), EsiFile::read(&path).unwrap())).collect())
}

#[test]
fn a_device_has_everything_that_its_file_says() {
    let file = made_up();
    assert_eq!((file.vendor.id, file.vendor.name.english()), (Some(0x0F0F), "Made Up"));
    assert_eq!(file.groups, [("Drives".to_owned(), "Drives".to_owned())]);
    let servo = &file.devices[0];
    assert_eq!(
        (servo.type_name.as_str(), servo.product_code, servo.revision),
        ("MU-SERVO", Some(0x0402), Some(0x1_0000))
    );
    assert_eq!((servo.names.english(), servo.names.in_language(1031)), ("Servo drive", "Servoantrieb"));
    assert_eq!(servo.hides, [(None, 1)]);
    assert_eq!(servo.profiles, [402]);
    assert_eq!((servo.timeouts.pre_op_ms, servo.timeouts.response_ms), (Some(3000), Some(6000)));
    let [position, velocity] = [&servo.rx_pdos[1], &servo.rx_pdos[0]];
    assert_eq!((position.sync_manager, velocity.sync_manager), (None, Some(2)));
    assert_eq!(velocity.excludes[0].index, 0x1601);
    assert_eq!((velocity.bits(), velocity.entries[2].is_gap()), (16 + 8 + 8 + 32 + 16 + 16, true));
    assert!(servo.tx_pdos[0].mandatory && !servo.tx_pdos[0].fixed);
    let coe = servo.mailbox.as_ref().unwrap().coe.as_ref().unwrap();
    assert_eq!(coe.commands[0].data, [3, 0]);
    assert_eq!(coe.commands[2].transitions, ["SO"]);
    let mode = &servo.dc_modes[1];
    assert_eq!((mode.assign_activate, mode.sync1.factor, mode.sync1.shift_ns), (0x0700, Some(-1), 20_000));
    let terminal = &file.devices[1];
    assert_eq!(terminal.sync_managers[0].usage, SmUse::Outputs);
    assert!(terminal.sync_managers[0].op_only && !terminal.sync_managers[0].is_virtual);
    assert!(terminal.sync_managers[1].is_virtual && !terminal.sync_managers[1].enabled);
    assert_eq!(file.notes.problems, []);
    let unknown: Vec<_> = file.notes.unread().filter(|one| one.why == Why::Unknown).collect();
    assert_eq!(unknown, []);
}

#[test]
fn modules_count_up_with_their_slots() {
    let file = made_up();
    let (coupler, modules) = (&file.devices[2], &file.modules);
    let assembly = Assembly::new(coupler, vec![&modules[0], &modules[1], &modules[0]]).unwrap();
    let indices = |outputs| -> Vec<(u16, u16)> {
        assembly
            .default_pdos(outputs)
            .0
            .iter()
            .map(|pdo| (pdo.index.index, pdo.entries[0].index.index))
            .collect()
    };
    assert_eq!(indices(false), [(0x1A00, 0x6000), (0x1A02, 0x6020)]);
    assert_eq!(indices(true), [(0x1601, 0x7010)]);
    let commands: Vec<(u16, u8, usize)> = assembly
        .commands()
        .iter()
        .map(|one| (one.command.index.index, one.command.subindex, one.command.data.len()))
        .collect();
    let list = [(0xF030, 0, 1), (0xF030, 1, 4), (0xF030, 2, 4), (0xF030, 3, 4), (0xF030, 0, 1)];
    assert_eq!(commands[..5], list);
    assert_eq!(commands[5..], [(0x8000, 2, 8), (0x8020, 2, 8)]);
    assert_eq!(assembly.commands()[2].command.data, 0x201u32.to_le_bytes());
    let wrong = |modules| Assembly::new(coupler, modules).unwrap_err();
    assert!(matches!(wrong(vec![&modules[2]]), AssemblyError::WrongClass { slot: 1, .. }));
    assert!(matches!(wrong(vec![&modules[0]; 9]), AssemblyError::TooMany { most: 8, found: 9, .. }));
    assert!(matches!(Assembly::new(&file.devices[0], vec![&modules[0]]), Err(AssemblyError::NoSlots { .. })));
}

#[test]
fn an_image_says_what_the_file_says() {
    let file = made_up();
    let bytes = image::eeprom(&file.devices[0], 0x0F0F).emit();
    let (image, problems) = Image::parse(&bytes).unwrap();
    assert_eq!(problems, []);
    assert_eq!(bytes.len(), 2048);
    assert_eq!(image.header.identity.product_code, 0x0402);
    assert_eq!((image.header.mailbox.send_offset, image.header.mailbox.send_size), (0x1400, 256));
    assert_eq!(
        (image.header.bootstrap_mailbox.receive_offset, image.header.mailbox_protocols),
        (0x1000, 0b1100)
    );
    let [_, _, outputs, inputs] = image.sync_managers[..] else { panic!("{:?}", image.sync_managers) };
    assert_eq!((outputs.usage, outputs.length, inputs.length), (SyncManagerUsage::Outputs, 12, 16));
    assert_eq!((image.rx_pdos[0].sync_manager, image.rx_pdos[1].sync_manager), (Some(2), None));
    assert_eq!((image.dc_modes[1].assign_activate, image.dc_modes[1].sync1_cycle_factor), (0x0700, -1));
    assert_eq!(image.general.as_ref().unwrap().physical_ports, 0x11);
}

#[test]
fn what_is_wrong_is_told_with_its_line_and_the_rest_is_read() {
    let text = "<EtherCATInfo>\n<Vendor><Id>soon</Id></Vendor>\n<Descriptions><Devices><Device>\n\
        <Type ProductCode=\"#x1FFFFFFFF\">A</Type>\n<Wheel size=\"3\"/>\n<TxPdo Sm=\"99\" Fixed=\"perhaps\"><Index>#x1A00</Index>\
        <Entry><Index>#x6000</Index><BitLen>9999</BitLen></Entry></TxPdo>\n<RxPdo><Name>x</Name></RxPdo>\n\
        <Mailbox><CoE><InitCmd><Transition>XY</Transition><Index>1</Index><Data>0G</Data></InitCmd></CoE></Mailbox>\n\
        </Device></Devices></Descriptions></EtherCATInfo>";
    let file = EsiFile::parse(text.as_bytes()).unwrap();
    let told: Vec<String> = file.notes.problems.iter().map(ToString::to_string).collect();
    let expected = [
        "line 2: EtherCATInfo/Vendor/Id: expected a number from 0 to 4294967295, found \"soon\"",
        "line 4: EtherCATInfo/Descriptions/Devices/Device/Type: attribute ProductCode: expected a number from 0 to 4294967295, found \"#x1FFFFFFFF\"",
        "line 6: EtherCATInfo/Descriptions/Devices/Device/TxPdo: attribute Sm: expected a number from 0 to 31, found \"99\"",
        "line 6: EtherCATInfo/Descriptions/Devices/Device/TxPdo: attribute Fixed: expected 0, 1, true or false, found \"perhaps\"",
        "line 6: EtherCATInfo/Descriptions/Devices/Device/TxPdo/Entry/BitLen: expected a number from 0 to 255, found \"9999\"",
        "line 6: EtherCATInfo/Descriptions/Devices/Device/TxPdo/Entry: the entry has no length of 1 to 255 bits",
        "line 7: EtherCATInfo/Descriptions/Devices/Device/RxPdo: the PDO has no index: it is left out",
        "line 8: EtherCATInfo/Descriptions/Devices/Device/Mailbox/CoE/InitCmd/Transition: expected two of the letters I, P, S, O, B, found \"XY\"",
        "line 8: EtherCATInfo/Descriptions/Devices/Device/Mailbox/CoE/InitCmd/Data: expected at most 4096 bytes in hexadecimal, found \"0G\"",
        "line 8: EtherCATInfo/Descriptions/Devices/Device/Mailbox/CoE/InitCmd: the command can't be read whole: it is left out",
        "line 3: EtherCATInfo/Descriptions/Devices/Device: the device has no product code: nobody can tell it on the bus",
        "line 3: EtherCATInfo/Descriptions/Devices/Device: the device has no revision: nobody can tell it from older ones",
        "line 1: EtherCATInfo: the vendor has no Id that can be read: nobody can tell its devices on the bus",
    ];
    assert_eq!(told, expected);
    let unread: Vec<(String, u32)> = file.notes.unread().map(|one| (one.path, one.line)).collect();
    assert_eq!(unread, [("EtherCATInfo/Descriptions/Devices/Device/Wheel".to_owned(), 5)]);
    assert_eq!(file.devices[0].tx_pdos.len(), 1);
}

#[test]
fn files_that_would_hurt_are_refused_by_name() {
    let refusal = |text: &[u8]| EsiFile::parse(text).unwrap_err().to_string();
    assert!(refusal(b"").starts_with("it is no XML"), "{}", refusal(b""));
    assert!(refusal(b"<EtherCATInfo><Vendor>").starts_with("it is no XML"));
    assert_eq!(refusal(b"\xFF\xFEx"), "it is no text in UTF-16: byte 2 can't be read; save it as UTF-8");
    assert_eq!(refusal(b"<a>\xFC</a>"), "it is no text in UTF-8: byte 3 can't be read; save it as UTF-8");
    assert!(
        refusal(b"<html/>").ends_with("expected the element EtherCATInfo or EtherCATModule, found \"html\"")
    );
    let bomb = b"<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><EtherCATInfo>&b;</EtherCATInfo>";
    assert!(refusal(bomb).contains("DTD"), "{}", refusal(bomb));
    let deep = format!("<EtherCATInfo>{}{}</EtherCATInfo>", "<a>".repeat(70), "</a>".repeat(70));
    assert_eq!(refusal(deep.as_bytes()), "line 1: elements stand more than 64 deep in one another");
    let large = vec![b' '; (omnibase_esi::SIZE_LIMIT + 1) as usize];
    assert!(matches!(EsiFile::parse(&large), Err(EsiError::TooLarge { .. })));
}

#[test]
fn many_elements_of_no_meaning_are_counted_and_bounded() {
    let mut text = String::from("<EtherCATInfo>");
    for number in 0..1500 {
        text += &format!("<a{number}/><Wheel/>");
    }
    text += "</EtherCATInfo>";
    let notes = EsiFile::parse(text.as_bytes()).unwrap().notes;
    assert_eq!(notes.unread().count(), 1000);
    let wheel = notes.unread().find(|one| one.path == "EtherCATInfo/Wheel").unwrap();
    assert_eq!((wheel.count, notes.beyond), (1500, 501));
}

#[test]
fn real_makers_files_are_read_whole() {
    let Some(files) = real() else { return };
    let (mut devices, mut modules, mut pdos, mut commands) = (0, 0, 0, 0);
    for (path, file) in &files {
        // Two attributes of safety modules are this maker's own: they are told, nothing else is.
        let unknown = file.notes.unread().filter(|one| one.why == Why::Unknown).map(|one| one.path);
        let unknown: Vec<_> = unknown
            .filter(|path| {
                !path.ends_with("/Module/@Crc32") && !path.ends_with("/Type/@SRA_ParameterSupported")
            })
            .collect();
        assert_eq!(unknown, Vec::<String>::new(), "{}", path.display());
        assert_eq!(file.notes.problems, [], "{}", path.display());
        devices += file.devices.len();
        modules += file.modules.len();
        pdos += file.modules.iter().map(|module| module.rx_pdos.len() + module.tx_pdos.len()).sum::<usize>();
        let of_modules = file.modules.iter().filter_map(|module| module.mailbox.as_ref()?.coe.as_ref());
        commands += of_modules.map(|coe| coe.commands.len()).sum::<usize>();
        for device in &file.devices {
            let (_, problems) = Image::parse(&image::eeprom(device, 2).emit()).unwrap();
            assert_eq!(problems, [], "{}: {}", path.display(), device.type_name);
        }
    }
    assert_eq!((devices, modules, pdos, commands), (27, 84, 128, 168));
}

#[test]
fn files_in_makers_other_codes_are_read() {
    let name = "Gr\u{fc}\u{df}e \u{2013} \u{20ac}";
    let text = |code: &str| {
        format!(
            "<?xml version=\"1.0\" encoding=\"{code}\"?><EtherCATInfo><Vendor><Id>1</Id><Name>{name}</Name></Vendor></EtherCATInfo>"
        )
    };
    let vendor = |bytes: &[u8]| EsiFile::parse(bytes).unwrap().vendor.name.english().to_owned();
    let western = |code: &str| -> Vec<u8> {
        let byte = |letter| match letter {
            '\u{2013}' => 0x96,
            '\u{20ac}' => 0x80,
            letter => u8::try_from(letter).unwrap(),
        };
        text(code).chars().map(byte).collect()
    };
    assert_eq!(vendor(&western("ISO-8859-1")), name);
    assert_eq!(vendor(&western("windows-1252")), name);
    assert_eq!(vendor(text("UTF-8").as_bytes()), name);
    assert_eq!(vendor(&[&[0xEF, 0xBB, 0xBF], text("utf-8").as_bytes()].concat()), name);
    let units = |bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        std::iter::once(0xFEFF).chain(text("UTF-16").encode_utf16()).flat_map(bytes).collect()
    };
    assert_eq!(vendor(&units(u16::to_le_bytes)), name);
    assert_eq!(vendor(&units(u16::to_be_bytes)), name);
    let refusal = EsiFile::parse(text("Shift_JIS").as_bytes()).unwrap_err().to_string();
    assert_eq!(refusal, "its encoding \"Shift_JIS\" isn't read here; save it as UTF-8");
}

#[test]
fn many_devices_and_attributes_take_no_more_than_their_share() {
    // Each device's line is told. Counted from the top of the file, that would be 20,000 x 10,000 lines of 100 bytes.
    let device = "<Device><Type ProductCode=\"2\" RevisionNo=\"#xNUMBER\">A device of which there are many in a file</Type></Device>\n";
    let mut text = String::from("<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices>\n");
    for number in 0..20_000 {
        text += &device.replace("NUMBER", &format!("{number:x}"));
    }
    text += "</Devices></Descriptions></EtherCATInfo>";
    let file = EsiFile::parse(text.as_bytes()).unwrap();
    assert_eq!(file.devices.len(), 20_000);
    assert!((2..).zip(&file.devices).all(|(line, device)| device.line == line));

    let attributes =
        |count: usize| -> String { (0..count).map(|number| format!(" a{number}=\"'>\"")).collect() };
    let element =
        |count: usize| format!("<EtherCATInfo>\n<!-- <a> --><a{}/></EtherCATInfo>", attributes(count));
    assert!(EsiFile::parse(element(256).as_bytes()).is_ok());
    let refusal = |text: String| EsiFile::parse(text.as_bytes()).unwrap_err().to_string();
    let told = "line 2: there are more than 256 attributes in one element, which is as many as an ESI file may have here";
    assert_eq!(refusal(element(257)), told);
    assert_eq!(refusal(element(1_000_000).replace("/></EtherCATInfo>", "")), told);
}
