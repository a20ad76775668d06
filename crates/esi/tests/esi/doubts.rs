//! What contradicts itself in a file, lacks, or can't be read.

use omnibase_esi::model::SmUse;
use omnibase_esi::{Assembly, AssemblyError, Doubt, EsiFile, image};
use omnibase_ethercat_wire::sii;

use super::MADE_UP;

/// A device of made-up numbers with these elements.
fn with_device(elements: &str) -> EsiFile {
    let text = format!(
        "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device>\n\
        <Type ProductCode=\"2\" RevisionNo=\"3\">A</Type><Sm StartAddress=\"#x1000\">Outputs</Sm>\n{elements}\n\
        </Device></Devices></Descriptions></EtherCATInfo>"
    );
    EsiFile::parse(text.as_bytes()).unwrap()
}

fn doubts(file: &EsiFile) -> Vec<String> {
    Assembly::new(&file.devices[0], Vec::new()).unwrap().doubts().iter().map(ToString::to_string).collect()
}

#[test]
fn a_number_that_cannot_be_read_is_never_a_fact() {
    let entry = |text: &str| format!("<RxPdo Sm=\"0\"><Index>#x1600</Index><Entry>{text}</Entry></RxPdo>");
    let whole = "<Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen>";
    assert!(!with_device(&entry(whole)).devices[0].rx_pdos[0].is_unclear());
    for wrong in [whole.replace(">8<", ">300<"), whole.replace(">1<", ">300<"), whole.replace("#x7000", "#x")]
    {
        let file = with_device(&entry(&wrong));
        assert!(file.devices[0].rx_pdos[0].is_unclear() && !file.notes.problems.is_empty(), "{wrong}");
        // Nobody has to look for it in the other lines.
        let told: Vec<String> = file.notes.problems.iter().map(ToString::to_string).collect();
        assert_eq!(doubts(&file), told, "{wrong}");
    }
    // Whatever it is: told with the device whose it is.
    for wrong in [
        "<RxPdo Sm=\"0\"><Index>x</Index></RxPdo>",
        "<Info><StateMachine><Timeout><PreopTimeout>-3</PreopTimeout></Timeout></StateMachine></Info>",
        "<Mailbox><CoE><InitCmd><Transition>PS</Transition><Index>x</Index></InitCmd></CoE></Mailbox>",
        "<Eeprom><ByteSize>-1</ByteSize></Eeprom>",
        "<Slots SlotPdoIncrement=\"-1\"/>",
    ] {
        let file = with_device(wrong);
        let problems = &file.devices[0].problems;
        assert!(!problems.is_empty() && *problems == file.notes.problems, "{wrong}");
        assert_eq!(doubts(&file), problems.iter().map(ToString::to_string).collect::<Vec<_>>(), "{wrong}");
    }
    let managers = |attributes: &str| with_device(&format!("<Sm {attributes}/>")).devices[0].sync_managers[1];
    let manager = managers("StartAddress=\"-4\" DefaultSize=\"-128\" ControlByte=\"zz\"");
    assert_eq!((manager.start, manager.default_size, manager.control), (None, None, None));
    assert_eq!(manager.usage, SmUse::Unused);
    let manager = managers("StartAddress=\"#x1800\"");
    assert_eq!((manager.start, manager.default_size, manager.control), (Some(0x1800), Some(0), Some(0)));
    let file =
        EsiFile::parse(MADE_UP.replace("SlotPdoIncrement=\"1\"", "SlotPdoIncrement=\"-1\"").as_bytes())
            .unwrap();
    let refusal = Assembly::new(&file.devices[2], vec![&file.modules[0]]).unwrap_err();
    assert!(matches!(refusal, AssemblyError::UnclearSlots { .. }), "{refusal}");
    let mode = |activate: &str| {
        let file =
            with_device(&format!("<Dc><OpMode><AssignActivate>{activate}</AssignActivate></OpMode></Dc>"));
        file.devices[0].dc_modes[0].is_unclear
    };
    assert!(!mode("#x300") && mode("#x30000"));
    let commands = |subindex: &str, data: &str| {
        let file = with_device(&format!(
            "<Mailbox><CoE><InitCmd><Transition>PS</Transition><Index>#x8000</Index><SubIndex>{subindex}</SubIndex>\
            <Data>{data}</Data></InitCmd></CoE></Mailbox>"
        ));
        file.devices[0].mailbox.as_ref().unwrap().coe.as_ref().unwrap().commands.len()
    };
    // A wrong subindex would be another object.
    assert_eq!((commands("1", "03"), commands("300", "03"), commands("1", "030")), (1, 0, 0));
    let file = with_device("<HideType RevisionNo=\"#x1\"/><HideType RevisionNo=\"x\"/>");
    assert_eq!(file.devices[0].hides, [(None, 1)]);
    let made_up = MADE_UP.replace("ModuleIdent=\"#x00000101\"", "");
    let file = EsiFile::parse(made_up.as_bytes()).unwrap();
    let refusal = Assembly::new(&file.devices[2], vec![&file.modules[0]]).unwrap_err();
    assert!(matches!(refusal, AssemblyError::NoIdent { slot: 1, .. }), "{refusal}");
}

/// Which of both is right nobody knows; no other file is needed to see it.
#[test]
fn what_contradicts_itself_is_told() {
    let entry = |text: &str| format!("<RxPdo Sm=\"0\"><Index>#x1600</Index><Entry>{text}</Entry></RxPdo>");
    let object = "<Index>#x7000</Index><SubIndex>1</SubIndex>";
    let entry_path = "line 3: EtherCATInfo/Descriptions/Devices/Device/RxPdo/Entry";
    let twice = "it stands there more than once: nobody knows which is meant";
    for (text, told) in [
        (entry(&format!("{object}<BitLen>16</BitLen><BitLen>8</BitLen>")), format!("{entry_path}/BitLen: {twice}")),
        (entry("<SubIndex>1</SubIndex><BitLen>16</BitLen>"), format!("{entry_path}: the entry has no index; a gap has 0")),
        (
            "<Slots><Slot MinInstances=\"5\" MaxInstances=\"1\"/></Slots>".to_owned(),
            "line 3: EtherCATInfo/Descriptions/Devices/Device/Slots/Slot: at least 5 modules are to be there (MinInstances), and at most 1 (MaxInstances)".to_owned(),
        ),
        (
            "<Mailbox/><Mailbox/>".to_owned(),
            format!("line 3: EtherCATInfo/Descriptions/Devices/Device/Mailbox: {twice}"),
        ),
    ] {
        let file = with_device(&text);
        assert_eq!(doubts(&file), std::slice::from_ref(&told), "{text}");
        assert_eq!(file.notes.problems.len(), 1, "{text}");
    }
    let of_type = |bits: u8, kind: &str| {
        doubts(&with_device(&entry(&format!("{object}<BitLen>{bits}</BitLen><DataType>{kind}</DataType>"))))
    };
    let told =
        "the PDO of line 3 has 0x7000 with 8 bits, and says that it is of the type UDINT: the bits are taken";
    assert_eq!(of_type(8, "UDINT"), [told]);
    // A type of the maker's own has any length.
    for (bits, kind) in [(32, "UDINT"), (1, "BOOL"), (8, "DT1600")] {
        assert_eq!(of_type(bits, kind), Vec::<String>::new(), "{bits} {kind}");
    }
}

/// Three buffers of 100 bytes from 0x1000 on end at 0x112C.
#[test]
fn process_data_that_reach_into_the_next_area_are_told() {
    let entries = "<Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>200</BitLen></Entry>".repeat(4);
    let told = |next: &str| {
        let elements = format!(
            "<Sm StartAddress=\"{next}\">Inputs</Sm><RxPdo Sm=\"0\"><Index>#x1600</Index>{entries}</RxPdo>"
        );
        let doubts = doubts(&with_device(&elements));
        doubts.into_iter().filter(|one| one.contains("keeps them")).collect::<Vec<_>>()
    };
    assert_eq!(
        told("#x112B"),
        [
            "SyncManager 0 has 100 bytes and keeps them 3 times from 0x1000 on, but the area of another begins at 0x112B: \
          the device will refuse that; take fewer modules or PDOs"
        ]
    );
    assert_eq!(told("#x112C"), Vec::<String>::new());
}

/// A mailbox of 128 bytes from 0x1000 on ends at 0x1080; two at the same place are told once.
#[test]
fn mailboxes_that_reach_into_the_next_area_are_told() {
    let told = |next: &str| {
        let mailboxes = format!(
            "<Sm StartAddress=\"#x1000\" ControlByte=\"#x26\" DefaultSize=\"128\">MBoxOut</Sm>\
             <Sm StartAddress=\"{next}\" ControlByte=\"#x22\" DefaultSize=\"128\">MBoxIn</Sm>"
        );
        let text = format!(
            "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices>\n<Device><Type ProductCode=\"2\" \
             RevisionNo=\"3\">A</Type>{mailboxes}</Device></Devices></Descriptions></EtherCATInfo>"
        );
        let file = EsiFile::parse(text.as_bytes()).unwrap();
        doubts(&file).into_iter().filter(|one| one.contains("another")).collect::<Vec<_>>()
    };
    for next in ["0x107F", "0x1000"] {
        let expected = format!(
            "the mailbox of SyncManager 0 has 128 bytes from 0x1000 on, but the area of another begins at {next}: \
             the device will refuse that; look for a newer file of its maker"
        );
        assert_eq!(told(&next.replace("0x", "#x")), [expected]);
    }
    assert_eq!(told("#x1080"), Vec::<String>::new());
}

/// A file that somebody cut away everything from isn't a sound one; one that points to others is.
#[test]
fn a_file_of_nothing_is_a_problem() {
    let problems = |inner: &str| {
        let file = EsiFile::parse(format!("<EtherCATInfo>{inner}</EtherCATInfo>").as_bytes()).unwrap();
        file.notes.problems.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let told = "line 1: EtherCATInfo: it has no device, no module and no reference to another file";
    assert_eq!(problems(""), [told]);
    assert_eq!(problems("<Descriptions><Devices/></Descriptions>"), [told]);
    assert_eq!(problems("<InfoReference>other.xml</InfoReference>"), Vec::<String>::new());
}

/// A device late in a file of many problems isn't taken for a sound one.
#[test]
fn problems_of_which_no_note_is_kept_count_for_their_device() {
    let wrong = "<Device><Type ProductCode=\"x\" RevisionNo=\"3\">B</Type></Device>\n".repeat(1001);
    let text = format!(
        "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices>\n{wrong}</Devices></Descriptions></EtherCATInfo>"
    );
    let file = EsiFile::parse(text.as_bytes()).unwrap();
    assert_eq!(file.notes.problems.len(), 1000);
    let last = file.devices.last().unwrap().problems.iter().map(ToString::to_string).collect::<Vec<_>>();
    let told = "line 1002: EtherCATInfo/Descriptions/Devices/Device: 2 problems of which there was no room to keep a note";
    assert_eq!(last, [told]);
}

/// A name that two have finds neither; an ident does.
#[test]
fn modules_are_found_by_name_and_ident() {
    let twice = MADE_UP.replace("#x00000201", "#x00000202");
    let (one, two) = (EsiFile::parse(MADE_UP.as_bytes()).unwrap(), EsiFile::parse(twice.as_bytes()).unwrap());
    let coupler = &one.devices[2];
    let ident = |wanted: &str| coupler.module([&one, &two].into_iter(), wanted).map(|module| module.ident);
    assert_eq!(ident("MU-AI"), Ok(Some(0x101)));
    assert_eq!((ident("0x201"), ident("514")), (Ok(Some(0x201)), Ok(Some(0x202))));
    let told = "several modules are called \"MU-DO\": say 0x00000201 or 0x00000202";
    assert_eq!(ident("MU-DO").unwrap_err(), told);
    assert!(ident("0x104").unwrap_err().starts_with("no module is called \"0x104\""));
}

#[test]
fn what_stands_there_twice_is_told_and_the_first_one_is_meant() {
    let device =
        |line: &str| format!("<Device><Type ProductCode=\"2\" RevisionNo=\"3\">{line}</Type></Device>\n");
    let text = |devices: &str| {
        format!(
            "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices>\n{devices}</Devices></Descriptions></EtherCATInfo>"
        )
    };
    let file = EsiFile::parse(text(&(device("A") + &device("B"))).as_bytes()).unwrap();
    assert_eq!(file.device("2:3").unwrap().type_name, "A");
    let told = "product code and revision are those of the device of line 2, which is meant by them";
    assert_eq!((file.notes.problems.len(), file.notes.problems[0].text.as_str()), (1, told));
    let products = device("A") + &device("A").replace("\"2\"", "\"4\"");
    let file = EsiFile::parse(text(&products).as_bytes()).unwrap();
    let refusal = file.device("A").unwrap_err();
    let told = "several products are called \"A\": say 0x00000002:0x00000003 or 0x00000004:0x00000003";
    assert_eq!(refusal, told);
    let revisions = device("A") + &device("A").replace("\"3\"", "\"4\"");
    let file = EsiFile::parse(text(&revisions).as_bytes()).unwrap();
    assert_eq!((file.device("A").unwrap().revision, file.notes.problems.len()), (Some(4), 0));

    let odd = doubts(&with_device("<RxPdo Sm=\"0\"><Index>#x1A00</Index></RxPdo>"));
    assert!(odd[0].contains("is 0x1A00, where those of its direction are 0x1600 to 0x17FF"), "{odd:?}");
    let pdo = "<RxPdo Sm=\"0\"><Index>#x1600</Index></RxPdo>\n";
    let told = "0x1600 stands there twice: the one of line 4 is left out";
    assert_eq!(doubts(&with_device(&format!("{pdo}{pdo}"))), [told]);
}

#[test]
fn modules_whose_indices_do_not_count_up_are_told() {
    let same = MADE_UP.replace("SlotIndexIncrement=\"16\"", "SlotIndexIncrement=\"0\"");
    let told = |text: &str| -> Vec<String> {
        let file = EsiFile::parse(text.as_bytes()).unwrap();
        let modules = vec![&file.modules[0], &file.modules[1], &file.modules[0]];
        let assembly = Assembly::new(&file.devices[2], modules).unwrap();
        let doubts = assembly.doubts().into_iter().filter(|one| matches!(one, Doubt::SameIndices { .. }));
        doubts.map(|one| one.to_string()).collect()
    };
    assert_eq!(told(MADE_UP), Vec::<String>::new());
    let both = "the modules in slots 1 and 3 both have 0x6000: the file doesn't tell them apart";
    assert_eq!(told(&same), [both]);
    // PDOs count up by their own increment, and beyond 0xFFFF nothing does.
    let far = MADE_UP.replace("SlotPdoIncrement=\"1\"", "SlotPdoIncrement=\"#x1000\"");
    let file = EsiFile::parse(far.replace("#x1A00", "#xFA00").as_bytes()).unwrap();
    let refusal = Assembly::new(&file.devices[2], vec![&file.modules[0], &file.modules[0]]).unwrap_err();
    assert_eq!(refusal, AssemblyError::Index { slot: 2, index: 0xFA00 });
}

#[test]
fn commands_that_no_parameter_can_say_are_told() {
    let command = |more: &str, subindex: u8, data: &str| {
        format!(
            "<InitCmd{more}><Transition>PS</Transition><Index>#x8000</Index><SubIndex>{subindex}</SubIndex><Data>{data}</Data></InitCmd>\n"
        )
    };
    let whole = " CompleteAccess=\"1\"";
    let all =
        command("", 1, "") + &command(whole, 2, "0102") + &command("", 1, "03") + &command(whole, 0, "0102");
    let file = with_device(&format!("<Mailbox><CoE>{all}</CoE></Mailbox>"));
    let told = [
        "the command of line 3 to 0x8000 has no data: it isn't sent",
        "the command of line 4 writes 0x8000 at once from subindex 2 on (complete access), which begins at 0 or 1: it isn't sent; write its entries one by one where the device takes them so",
    ];
    assert_eq!(doubts(&file), told);
    let assembly = Assembly::new(&file.devices[0], Vec::new()).unwrap();
    let sent: Vec<u32> =
        assembly.commands().iter().filter(|one| one.is_parameter()).map(|one| one.command.line).collect();
    assert_eq!(sent, [5, 6]);
}

#[test]
fn commands_are_for_states_of_the_way_up() {
    let command = |transitions: &[&str]| {
        let transitions: String =
            transitions.iter().map(|one| format!("<Transition>{one}</Transition>")).collect();
        let object = "<Index>#x8000</Index><SubIndex>0</SubIndex><Data>01</Data>";
        format!("<InitCmd>{transitions}{object}</InitCmd>\n")
    };
    let all = [&["IP"][..], &["PS", "SO"], &["SO"], &["OS"], &["SO", "SP"]].map(command).concat();
    let file = with_device(&format!("<Mailbox><CoE>{all}</CoE></Mailbox>"));
    let assembly = Assembly::new(&file.devices[0], Vec::new()).unwrap();
    let states = assembly.commands().into_iter().map(|one| {
        assert_eq!(one.is_parameter(), one.is_for_pre_op() || one.is_for_safe_op());
        [one.is_for_pre_op(), one.is_for_safe_op()]
    });
    let states: Vec<_> = states.collect();
    assert_eq!(states, [[true, false], [true, true], [false, true], [false, false], [false, true]]);
    let told = |line: u32, transition: &str| {
        format!(
            "the command of line {line} is for {transition}: there it isn't sent, for commands are sent on the way up, \
             in PRE-OP (IP, PS) and SAFE-OP (SO), and on the way down nothing waits for a mailbox"
        )
    };
    assert_eq!(doubts(&file), [told(6, "OS"), told(7, "SP")]);
}

#[test]
fn states_in_which_an_object_may_be_written_are_read() {
    let entry = |restrictions: &str, access: &str| {
        format!(
            "<Object><Index>#x2000</Index><Name>One</Name><Type>USINT</Type><BitSize>8</BitSize>\
             <Flags><Access{restrictions}>{access}</Access></Flags></Object>"
        )
    };
    for (restrictions, access, expected) in [
        ("", "rw", [true; 3]),
        ("", "ro", [false; 3]),
        (" WriteRestrictions=\"PreOP\"", "rw", [true, false, false]),
        (" WriteRestrictions=\"SafeOP\"", "wo", [false, true, false]),
        (" WriteRestrictions=\"PreOP_SafeOP\"", "rw", [true, true, false]),
        (" WriteRestrictions=\"SafeOP_OP\"", "rw", [false, true, true]),
        (" WriteRestrictions=\"SafeOP_Bogus\"", "rw", [true; 3]),
    ] {
        let types = "<DataTypes><DataType><Name>USINT</Name><BitSize>8</BitSize></DataType></DataTypes>";
        let object = entry(restrictions, access);
        let dictionary = format!("<Dictionary>{types}<Objects>{object}</Objects></Dictionary>");
        let file = with_device(&format!("<Profile>{dictionary}</Profile>"));
        let rights = file.devices[0].dictionary[0].entries[0].rights;
        assert_eq!((rights.write_in, rights.read), (expected, access != "wo"), "{restrictions}");
        let told = doubts(&file).iter().any(|told| told.contains("WriteRestrictions: expected PreOP"));
        assert_eq!(told, restrictions.contains("Bogus"), "{:?}", doubts(&file));
    }
}

#[test]
fn an_eeprom_that_is_too_small_is_told() {
    let told = |bytes: u32| doubts(&with_device(&format!("<Eeprom><ByteSize>{bytes}</ByteSize></Eeprom>")));
    assert_eq!(told(2048), Vec::<String>::new());
    assert!(
        told(64)[0].starts_with("its file says that the EEPROM has 64 bytes, and what belongs into it takes")
    );
}

/// Whose values these are, two of which stand there, or something in the midst of them, is told wherever it is.
#[test]
fn nothing_is_dropped_in_silence() {
    let unread = |text: &str| {
        let notes = with_device(text).notes;
        notes.unread().map(|one| one.path.rsplit_once("Device/").unwrap().1.to_owned()).collect::<Vec<_>>()
    };
    let entry = |text: &str| format!("<RxPdo Sm=\"0\"><Index>#x1600</Index><Entry>{text}</Entry></RxPdo>");
    for (text, told) in [
        (entry("<Index>#x7000</Index><BitLen>3<Qux/>2</BitLen>"), "RxPdo/Entry/BitLen/Qux"),
        (entry("<Index>#x7000<Bar>7</Bar></Index><BitLen>8</BitLen>"), "RxPdo/Entry/Index/Bar"),
        (
            entry("<Index>#x7000</Index><SubIndex Baz=\"1\">1</SubIndex><BitLen>8</BitLen>"),
            "RxPdo/Entry/SubIndex/@Baz",
        ),
        (entry("<Index>#x7000</Index>stray<BitLen>8</BitLen>"), "RxPdo/Entry/text()"),
        ("<Sm StartAddress=\"#x1000\" ControlByte=\"#x64\">Outputs</Sm>stray".to_owned(), "text()"),
        (
            entry("<Index>#x7000</Index><BitLen>8</BitLen><x:BitLen xmlns:x=\"u\">9</x:BitLen>"),
            "RxPdo/Entry/BitLen",
        ),
        (
            entry("<Index xmlns:x=\"u\" x:DependOnSlot=\"1\">#x7000</Index><BitLen>8</BitLen>"),
            "RxPdo/Entry/Index/@DependOnSlot",
        ),
        ("<Eeprom AssignToPdi=\"1\"><ByteSize>2048</ByteSize></Eeprom>".to_owned(), "Eeprom/@AssignToPdi"),
    ] {
        assert_eq!(unread(&text), [told], "{text}");
    }
    let twice = "it stands there more than once: nobody knows which is meant";
    for text in [
        "<Mailbox><CoE SdoInfo=\"1\"/><CoE/></Mailbox>",
        "<Info><StateMachine/><StateMachine/></Info>",
        "<Dc><OpMode><AssignActivate>1</AssignActivate><AssignActivate>2</AssignActivate></OpMode></Dc>",
    ] {
        let told = doubts(&with_device(text));
        assert!(told.len() == 1 && told[0].ends_with(twice), "{text}: {told:?}");
    }
    let vendors = MADE_UP.replacen("<Vendor>", "<Vendor><Id>7</Id></Vendor><Vendor>", 1);
    assert!(EsiFile::parse(vendors.as_bytes()).unwrap().notes.problems[0].text.ends_with(twice));
    let modules = MADE_UP.replacen("#x00000201", "#x00000101", 1);
    let told = EsiFile::parse(modules.as_bytes()).unwrap().notes.problems;
    assert!(told[0].text.starts_with("its ModuleIdent is that of the module of line "), "{told:?}");
    let one_mailbox = "<Sm StartAddress=\"#x1800\" ControlByte=\"#x22\">MBoxIn</Sm>";
    assert!(
        doubts(&with_device(one_mailbox))[0]
            .starts_with("0 SyncManagers are for mailboxes to the device and 1 for")
    );
}

/// Slots may stay empty, may have to be filled, and may have their data begin elsewhere than behind each other.
#[test]
fn slots_stay_empty_and_those_that_must_be_filled_are_told() {
    let file =
        EsiFile::parse(MADE_UP.replace("MinInstances=\"0\"", "MinInstances=\"2\"").as_bytes()).unwrap();
    let (coupler, all) = (&file.devices[2], &file.modules);
    assert_ne!(coupler.slots.as_ref().unwrap().slots[0].least, Some(0));
    let with = |modules| Assembly::new(coupler, modules).unwrap();
    let empty = coupler.module([&file].into_iter(), "").unwrap();
    let few =
        |assembly: &Assembly| assembly.doubts().iter().any(|one| matches!(one, Doubt::TooFewModules { .. }));
    assert!(
        few(&with(vec![])) && few(&with(vec![&all[0], empty])) && !few(&with(vec![&all[0], empty, &all[1]]))
    );
    let many = MADE_UP.replace("MaxInstances=\"8\"", "MaxInstances=\"300\"");
    let many = EsiFile::parse(many.as_bytes()).unwrap();
    assert_ne!(MADE_UP.matches("MaxInstances=\"8\"").count(), 0);
    let refused = Assembly::new(&many.devices[2], vec![&many.modules[0]; 256]).map(drop).unwrap_err();
    assert_eq!(refused, AssemblyError::TooMany { device: "MU-COUPLER".into(), most: 255, found: 256 });
    // Addresses of modules that are to be written are in no maker's file.
    let asks = |assembly: &Assembly| assembly.doubts().contains(&Doubt::ModuleAddresses);
    let marked = MADE_UP.replace("<Slots ", "<Slots DownloadModuleAddressList=\"1\" ");
    let file_with = EsiFile::parse(marked.as_bytes()).unwrap();
    let addressed = Assembly::new(&file_with.devices[2], vec![&file_with.modules[0]]).unwrap();
    assert!(asks(&addressed) && !asks(&with(vec![&all[0]])), "{:?}", addressed.doubts());
    // What stands behind an empty slot counts up with its own.
    let (behind, filled) = (with(vec![empty, &all[1]]), with(vec![&all[0], &all[1]]));
    let last = |assembly: &Assembly| assembly.pdos(true).last().map(|pdo| pdo.index.index);
    assert_eq!(last(&behind), last(&filled));
    let told: Vec<_> = behind.commands().iter().map(|one| one.command.data.clone()).collect();
    assert_eq!(told[1], [0; 4], "{told:?}");
    let aligned = MADE_UP.replace("Alignment=\"1\"", "Alignment=\"2\"");
    let file = EsiFile::parse(aligned.as_bytes()).unwrap();
    let assembly = Assembly::new(&file.devices[2], vec![&file.modules[0]]).unwrap();
    assert!(assembly.doubts().iter().any(|one| matches!(one, Doubt::Alignment { bytes: 2, .. })));
}

/// How it is found by a switch, and that it refuses LRW, stand in its EEPROM.
#[test]
fn identification_and_refused_commands_stand_in_the_eeprom() {
    let text = MADE_UP.replacen("<Type ProductCode", "<Type UseLrdLwr=\"1\" ProductCode", 1);
    let text = text.replacen("<Info>", "<Info><IdentificationReg134>true</IdentificationReg134>", 1);
    let file = EsiFile::parse(text.as_bytes()).unwrap();
    let device = file.devices.iter().find(|one| one.identifies_by_al_status).unwrap();
    assert!(file.devices[0].refuses_lrw && file.notes.problems.is_empty(), "{:?}", file.notes.problems);
    let flags = |device| image::eeprom(device, 1).general.unwrap().flags;
    assert_eq!(flags(device) & sii::FLAG_IDENT_AL_STATUS, sii::FLAG_IDENT_AL_STATUS);
    assert_eq!(flags(&file.devices[0]) & sii::FLAG_NO_LRW, sii::FLAG_NO_LRW);
}

/// Elements that come by hundreds are bounded or told, whatever counts them: each that makers repeat, from none to 600 of them.
#[test]
fn elements_by_hundreds_are_told_and_end_nothing() {
    let repeated = [
        "<Sm StartAddress=\"#x1000\" ControlByte=\"#x64\">Outputs</Sm>",
        "<Sm StartAddress=\"#x1000\" ControlByte=\"#x26\" DefaultSize=\"64\">MBoxOut</Sm>",
        "<Fmmu>Outputs</Fmmu>",
        "<RxPdo Sm=\"0\"><Index>#x1600</Index></RxPdo>",
        "<TxPdo><Index>#x1A00</Index><Entry><Index>0</Index><BitLen>1</BitLen></Entry></TxPdo>",
        "<Dc><OpMode><Name>a</Name></OpMode></Dc>",
        "<Mailbox><CoE><InitCmd><Transition>PS</Transition><Index>#x2000</Index><SubIndex>0</SubIndex><Data>00</Data></InitCmd></CoE></Mailbox>",
    ];
    for (element, count) in repeated.iter().flat_map(|one| [0, 31, 32, 254, 255, 256, 600].map(|n| (one, n)))
    {
        let file = with_device(&element.repeat(count));
        let said = doubts(&file);
        let bytes = image::eeprom(&file.devices[0], 1).emit();
        assert!(sii::Image::parse(&bytes).is_ok(), "{element} {count}");
        if element.starts_with("<Sm") {
            // One stands there before.
            let beyond = (1 + count).saturating_sub(32);
            let told =
                file.notes.problems.iter().filter(|one| one.text.contains("more than 32 SyncManagers"));
            assert_eq!(told.count(), beyond.min(file.notes.problems.len()), "{element} {count}");
            assert_eq!(said.iter().any(|one| one.contains("more than 32 SyncManagers")), beyond > 0);
            assert_eq!(file.devices[0].sync_managers.len(), (1 + count).min(32));
        }
    }
    let entries = "<Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen></Entry>".repeat(600);
    let file = with_device(&format!("<RxPdo Sm=\"0\"><Index>#x1600</Index>{entries}</RxPdo>"));
    drop((doubts(&file), image::eeprom(&file.devices[0], 1).emit()));
}
