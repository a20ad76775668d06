//! Drives as makers deliver them: other maps, other clocks, other modes.

use omnibase_ethercat_sim::SegmentFile;

use super::*;
use crate::Key;
use crate::jog::JogEnd;

const MAKER: &str = include_str!("../../../../../segments/maker.xml");
const TARGET_TORQUE: &str = "<Entry><Index>#x6071</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Target torque</Name><DataType>INT</DataType></Entry>";
const MODE_SHOWN: &str = "<Entry><Index>#x6061</Index><SubIndex>0</SubIndex><BitLen>8</BitLen><Name>Modes of operation display</Name><DataType>SINT</DataType></Entry>\n          <Entry><Index>#x0</Index><BitLen>8</BitLen></Entry>";

/// Three drives of that maker's file, in which these words are others.
fn made(others: &[(&str, &str)]) -> (Powered, VirtualClock) {
    let folder = tempfile::tempdir().unwrap();
    let mut text = MAKER.to_owned();
    for (words, other) in others {
        assert!(text.contains(words), "{words}");
        text = text.replacen(words, other, 1);
    }
    std::fs::write(folder.path().join("maker.xml"), text).unwrap();
    let segment =
        "[[subdevice]]\nkind = \"esi\"\nesi = \"maker.xml\"\ndevice = \"0x00000402:0x00010000\"\ncount = 3\n";
    let segment = SegmentFile::parse(segment).unwrap().build(folder.path()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    (Powered(Rc::new(RefCell::new(link))), clock)
}

/// A robot's file for such drives, synchronised so, with the map of a jog or with none.
fn base(synchronisation: &str, has_map: bool) -> String {
    let mut document: toml_edit::DocumentMut = BASE.parse().unwrap();
    document["bus"]["synchronisation"] = toml_edit::value(synchronisation);
    let maps = match has_map {
        true => {
            "outputs = [{ pdo = \"0x1600\", map = \"6040:16 6060:8 pad:8 60FF:32 6071:16 6072:16\" }]\n\
             inputs = [{ pdo = \"0x1A00\", map = \"6041:16 6061:8 pad:8 6064:32 606C:32 6077:16 603F:16\" }]\n"
        }
        // A law of torque has none of speeds.
        false => {
            "outputs = [{ pdo = \"0x1600\", map = \"6040:16 6060:8 pad:8 6071:16 6072:16\" }]\n\
             inputs = [{ pdo = \"0x1A00\", map = \"6041:16 6061:8 pad:8 6064:32 606C:32 6077:16 603F:16\" }]\n"
        }
    };
    let defaults: toml_edit::DocumentMut = format!(
        "device = \"cia402\"\n{maps}counts_per_revolution = 1048576\ngear_ratio = 1.0\nrated_torque_nm = 7.0\npeak_torque_nm = 21.0\n"
    )
    .parse()
    .unwrap();
    document["drive_defaults"] = toml_edit::Item::Table(defaults.as_table().clone());
    if !has_map {
        document["controller"]["kind"] = toml_edit::value("adaptive_torque");
    }
    document.to_string()
}

/// Holds the key for some cycles of a jog.
struct Holds(u32);

impl Hand for Holds {
    fn ask(&mut self, _: &Question) -> Answer {
        Answer::Leave
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {
        self.0 = 0;
    }

    fn key(&mut self) -> Key {
        self.0 += 1;
        if self.0 < 600 { Key::Beat } else { Key::LetGo }
    }
}

/// A jog of the second of these drives; an error in words.
fn jogged<L: Link + Clone + 'static>(base: &str, link: &L, clock: &VirtualClock) -> Result<JogEnd, String> {
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut ended = Err("no jog".to_owned());
    with_found(base, &mut open, &mut Holds(0), |guide| {
        let jog = guide.jog(1, jogging::Motion::Turns, "hold the key");
        ended = jog.map(|jog| jog.end).map_err(|error| error.to_string());
        guide.leave_as_found();
        assert_eq!(guide.record.findings, [] as [&str; 0]);
    });
    ended
}

/// What an object of a drive holds.
fn held(bus: &mut Bus<Powered, VirtualClock>, position: u16, index: u16) -> u32 {
    let bytes = bus.sdo_read(position, ObjectAddress::new(index, 0), SdoAccess::Entry).unwrap();
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// What else a drive maps stands in each frame as it was: a quick stop's deceleration of 0 would be none. What are commands, of another
/// axis too, is nothing, whoever gave them last.
#[test]
fn what_else_a_drive_maps_is_as_it_was_behind_a_jog_and_commands_are_nothing() {
    const KEPT: [(u16, u8, u32); 4] =
        [(0x6085, 32, 33_377_208), (0x6084, 32, 66_754_416), (0x60E0, 16, 1500), (0x6885, 32, 77)];
    const COMMANDS: [(u16, u8, u32); 3] = [(0x60B1, 32, 9_999), (0x6840, 16, 15), (0x68FF, 32, 100_000)];
    let all = [&KEPT[..], &COMMANDS[..]].concat();
    let entry = |(index, bits, _): &(u16, u8, u32)| {
        format!("<Entry><Index>#x{index:04X}</Index><SubIndex>0</SubIndex><BitLen>{bits}</BitLen></Entry>")
    };
    let more: String = all.iter().map(entry).collect();
    let (link, clock) = made(&[(TARGET_TORQUE, &format!("{TARGET_TORQUE}{more}"))]);
    let mut bus = by_tool(&link, &clock);
    for (index, bits, value) in &all {
        for position in 0..3 {
            let bytes = &value.to_le_bytes()[..usize::from(bits / 8)];
            bus.sdo_write(position, ObjectAddress::new(*index, 0), bytes).unwrap();
        }
    }
    drop(bus);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    // Its own map will do, so it stays.
    with_found(&base("sync0", true), &mut open, &mut Holds(0), |guide| {
        assert_eq!(
            guide.jog_limited(1, jogging::Motion::Turns, "hold the key").unwrap().0.end,
            JogEnd::LetGo
        );
        let mut bus = by_tool(&link, &clock);
        for position in 0..3 {
            for (index, _, value) in KEPT {
                assert_eq!(held(&mut bus, position, index), value, "{index:04x} of {position}");
            }
            for (index, ..) in COMMANDS {
                assert_eq!(held(&mut bus, position, index), 0, "{index:04x} of {position}");
            }
        }
        drop(bus);
        guide.leave_as_found();
        assert_eq!(held(&mut by_tool(&link, &clock), 1, 0x60B1), 9_999, "what is added is its own again");
    });
}

/// What is mapped and added to a speed is told in each frame: a drive that is busy when it is asked for it isn't jogged.
#[test]
fn what_is_added_to_a_speed_and_mapped_is_known_before_a_jog() {
    let entry = "<Entry><Index>#x60B1</Index><SubIndex>0</SubIndex><BitLen>32</BitLen></Entry>";
    let (link, clock) = made(&[(TARGET_TORQUE, &format!("{TARGET_TORQUE}{entry}"))]);
    let link = refused::Busy { link, object: Rc::default() };
    let object = ObjectAddress::new(0x60B1, 0);
    by_tool(&link.link, &clock).sdo_write(1, object, &9_999_i32.to_le_bytes()).unwrap();
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(&base("sync0", true), &mut open, &mut Nobody, |guide| {
        link.object.set(Some(object));
        let words = guide.operational().map(drop).unwrap_err().to_string();
        assert!(words.contains("its map has 60b1:00, and what stands there can't be read"), "{words}");
        link.object.set(None);
        guide.leave_as_found();
        assert_eq!(held(&mut by_tool(&link.link, &clock), 1, 0x60B1), 9_999);
    });
}

/// It would turn faster than was told, or the other way, as if its encoder counted against its motor.
#[test]
fn what_is_added_to_a_speed_and_is_not_mapped_is_nothing_in_a_jog_and_put_back() {
    let (link, clock) = made(&[]);
    let mut bus = by_tool(&link, &clock);
    bus.sdo_write(1, ObjectAddress::new(0x60B1, 0), &100_000_i32.to_le_bytes()).unwrap();
    bus.sdo_write(1, ObjectAddress::new(0x60B2, 0), &1000_i16.to_le_bytes()).unwrap();
    drop(bus);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(&base("sync0", true), &mut open, &mut Holds(0), |guide| {
        let told: Vec<bool> = ["60B1 is 100000", "60B2 is 1000"]
            .map(|words| {
                guide.record.findings.iter().any(|text| text.starts_with(&format!("SubDevice 1: {words}")))
            })
            .to_vec();
        assert_eq!((told, guide.record.findings.len()), (vec![true; 2], 2));
        let operational = guide.operational().unwrap();
        drop(operational);
        let mut bus = by_tool(&link, &clock);
        assert_eq!([0x60B1, 0x60B2].map(|index| held(&mut bus, 1, index)), [0; 2]);
        drop(bus);
        assert_eq!(guide.jog(1, jogging::Motion::Turns, "hold the key").unwrap().end, JogEnd::LetGo);
        guide.leave_as_found();
    });
    let mut bus = by_tool(&link, &clock);
    assert_eq!([0x60B1, 0x60B2].map(|index| held(&mut bus, 1, index)), [100_000, 1000]);
}

/// Most drives are delivered with a map of positions.
#[test]
fn a_drive_whose_own_map_is_none_for_a_jog_has_the_files() {
    let by_position = [
        ("<RxPdo Sm=\"2\" Fixed=\"0\">", "<RxPdo Was=\"2\" Fixed=\"0\">"),
        ("<RxPdo Fixed=\"0\">", "<RxPdo Sm=\"2\" Fixed=\"0\">"),
    ];
    let (link, clock) = made(&by_position);
    assert_eq!(jogged(&base("sync0", true), &link, &clock), Ok(JogEnd::LetGo));
    let (link, clock) = made(&by_position);
    let refused = jogged(&base("sync0", false), &link, &clock).unwrap_err();
    assert!(refused.contains("SubDevice 0: its map has no 0x60FF of 32 bits"), "{refused}");
    assert!(
        refused.contains("give its drive in the robot's file `outputs` and `inputs` with it"),
        "{refused}"
    );
}

#[test]
fn a_drive_without_sync0_is_jogged_as_the_file_has_it_synchronised() {
    let begins = MAKER.find("<Dc>").unwrap();
    let ends = MAKER.find("</Dc>").unwrap() + "</Dc>".len();
    let no_clocks = [(&MAKER[begins..ends], "")];
    for synchronisation in ["sync_manager_event", "free_run"] {
        let (link, clock) = made(&no_clocks);
        assert_eq!(
            jogged(&base(synchronisation, true), &link, &clock),
            Ok(JogEnd::LetGo),
            "{synchronisation}"
        );
    }
    let (link, clock) = made(&no_clocks);
    let refused = jogged(&base("sync0", true), &link, &clock).unwrap_err();
    assert!(refused.contains("0x0030"), "{refused}");
}

/// Other words in the maker's file, whether the robot's has a map for a jog, which answer is said otherwise, how often, and what comes of it.
type Case<'a> = (Vec<(&'a str, &'a str)>, bool, &'static [u8], &'static [u8], u32, Result<(), &'static str>);

/// In another mode a drive would go where nobody told it; and what can't be read would be overwritten.
#[test]
fn a_drive_that_is_not_as_a_jog_needs_it_has_the_files_map_or_is_not_enabled() {
    /// Says something else in place of so many answers to an SDO.
    #[derive(Clone)]
    struct Lying(Powered, &'static [u8], &'static [u8], Rc<RefCell<u32>>);
    impl Link for Lying {
        fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
            self.0.send(frame)
        }

        fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
            let received = self.0.receive(buffer, deadline)?;
            let Lying(_, truth, lie, left) = self;
            if let Some(at) = buffer.windows(truth.len()).position(|bytes| bytes == *truth)
                && *left.borrow() > 0
            {
                buffer[at..at + lie.len()].copy_from_slice(lie);
                *left.borrow_mut() -= 1;
            }
            Ok(received)
        }
    }
    let unmapped = (MODE_SHOWN, "<Entry><Index>#x0</Index><BitLen>16</BitLen></Entry>");
    let more = format!(
        "{TARGET_TORQUE}<Entry><Index>#x6085</Index><SubIndex>0</SubIndex><BitLen>32</BitLen></Entry>"
    );
    let more = (TARGET_TORQUE, more.as_str());
    // An upload's answer of so many bytes, and the object; an abort.
    const SUPPORTED: &[u8] = &[0x43, 0x02, 0x65, 0x00];
    const SHOWN: &[u8] = &[0x4F, 0x61, 0x60, 0x00];
    const DECELERATION: &[u8] = &[0x43, 0x85, 0x60, 0x00];
    const UNREADABLE: &[u8] = &[0x80, 0x85, 0x60, 0x00, 0x01, 0x00, 0x01, 0x06];
    let all: [Case<'_>; 7] = [
        (vec![unmapped], false, SHOWN, &[0x4F, 0x61, 0x60, 0x00, 9], u32::MAX, Ok(())),
        // It takes its time.
        (vec![unmapped], false, SHOWN, &[0x4F, 0x61, 0x60, 0x00, 0], 5, Ok(())),
        (
            vec![unmapped],
            false,
            SHOWN,
            &[0x4F, 0x61, 0x60, 0x00, 8],
            u32::MAX,
            Err("told mode 9 (csv) and shows 8 (6061:00)"),
        ),
        // The file's map tells it.
        (vec![unmapped], true, SHOWN, &[0x4F, 0x61, 0x60, 0x00, 8], u32::MAX, Ok(())),
        // All but csv.
        (
            vec![],
            true,
            SUPPORTED,
            &[0x43, 0x02, 0x65, 0x00, 0xAD, 2, 0, 0],
            u32::MAX,
            Err("its drive has no csv (0x6502 = 0x000002ad)"),
        ),
        (vec![more], true, DECELERATION, UNREADABLE, u32::MAX, Ok(())),
        (
            vec![more],
            false,
            DECELERATION,
            UNREADABLE,
            u32::MAX,
            Err("its map has 6085:00, and what stands there can't be read"),
        ),
    ];
    for (others, has_map, truth, lie, times, expected) in all {
        let (link, clock) = made(&others);
        let lying = Lying(link, truth, lie, Rc::new(RefCell::new(times)));
        let ended = jogged(&base("sync0", has_map), &lying, &clock);
        match expected {
            Ok(()) => assert_eq!(ended, Ok(JogEnd::LetGo)),
            Err(words) => assert!(ended.as_ref().is_err_and(|found| found.contains(words)), "{ended:?}"),
        }
    }
}
