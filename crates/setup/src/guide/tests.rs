//! What the guide believes of drives that it sees again, and how a jog begins.

use std::cell::RefCell;
use std::rc::Rc;

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, LinkError};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::VirtualClock;

use super::*;

const BASE: &str = include_str!("../../../../robots/bmm.toml");

/// A guide that found what is on a bus, looked at.
fn with_found(
    base: &str,
    open: Open<'_, VirtualClock>,
    hand: &mut dyn Hand,
    look: impl FnOnce(&mut Guide<'_, VirtualClock>),
) {
    with_record(base, Record::default(), open, hand, |guide| {
        guide.find().unwrap();
        look(guide);
    });
}

/// One that is taken up from a record.
fn with_record(
    base: &str,
    record: Record,
    open: Open<'_, VirtualClock>,
    hand: &mut dyn Hand,
    look: impl FnOnce(&mut Guide<'_, VirtualClock>),
) {
    let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let outside = Outside { hand, keep: &mut keep, back_up: &mut back_up };
    let mut guide = Guide::new(Wished::new(base.to_owned()), record, open, outside).unwrap();
    look(&mut guide);
}

struct Nobody;

impl Hand for Nobody {
    fn ask(&mut self, _: &Question) -> Answer {
        Answer::Leave
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}

/// Answers so whatever is asked, and holds no key.
struct Says(&'static str);

impl Hand for Says {
    fn ask(&mut self, _: &Question) -> Answer {
        Answer::Said(self.0.to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}

/// A file with two products: a drive is told the speed of its own wheel or product, and the least where neither is known.
#[test]
fn each_drive_has_its_own_scale() {
    let mut document: toml_edit::DocumentMut = BASE.parse().unwrap();
    let drives = document["drive"].as_array_of_tables_mut().unwrap();
    for (table, (gear, product)) in drives.iter_mut().zip([(10.0, 1), (1.0, 2), (5.0, 2)]) {
        table["gear_ratio"] = toml_edit::value(gear);
        table["product_code"] = toml_edit::value(format!("0x{product}"));
    }
    let (mut hand, mut keep) = (Nobody, |_: &Record| Ok(()));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Err("nothing is opened".to_owned()) };
    let mut back_up = |_: u16, _: &[u8]| Ok(());
    let outside = Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up };
    let guide = Guide::new(Wished::new(document.to_string()), Record::default(), &mut open, outside).unwrap();
    let gear = |wheel: Option<&str>, product_code| {
        let identity = guide.plan.drives[0].identity;
        let drive = FoundDrive {
            wheel: wheel.map(str::to_owned),
            vendor_id: identity.vendor_id.unwrap_or_default(),
            product_code,
            ..FoundDrive::default()
        };
        guide.scale_of(&drive).gear_ratio
    };
    assert_eq!([1, 2, 3].map(|product| gear(None, product)), [10.0, 1.0, 1.0]);
    assert_eq!(["wheel_1", "wheel_2", "wheel_3"].map(|wheel| gear(Some(wheel), 2)), [10.0, 1.0, 5.0]);
}

/// Drives are known by what tells them apart; an alias that was written counts as its own.
#[test]
fn a_drive_is_known_by_its_numbers_alias_and_switch() {
    let was = FoundDrive { serial: 1, alias: Some(5), written_alias: Some(7), ..FoundDrive::default() };
    let with = |alias| FoundDrive { alias, written_alias: None, ..was.clone() };
    assert!(is_it(&was, &with(Some(5))) && is_it(&was, &with(Some(7))));
    assert!(!is_it(&was, &with(Some(6))) && !is_it(&was, &with(None)));
    assert!(!is_it(&was, &FoundDrive { serial: 2, ..was.clone() }));
    let shows = |identification| FoundDrive { identification, ..was.clone() };
    assert!(is_it(&was, &shows(Some(3))), "a switch that wasn't chosen");
    assert!(!is_it(&shows(Some(3)), &shows(Some(4))));
}

/// An alias that was written is believed once its drive alone has it: who is no drive has it, too.
#[test]
fn a_written_alias_that_another_has_is_not_believed() {
    let segment = |alias_of_another: u16| {
        let text = format!(
            "[[subdevice]]\nkind = \"servo\"\nalias = 7\n[[subdevice]]\nkind = \"servo\"\ncount = 2\n\
             [[subdevice]]\nkind = \"digital-io\"\ninputs = 8\nalias = {alias_of_another}\n"
        );
        omnibase_ethercat_sim::SegmentFile::parse(&text).unwrap().build(std::path::Path::new(".")).unwrap()
    };
    for (another, expected) in [(8, (Some(7), None)), (7, (None, Some(7)))] {
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            let (link, clock) = omnibase_ethercat_sim::in_process(segment(another));
            Ok((Box::new(link), clock))
        };
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            (guide.record.drives[0].alias, guide.record.drives[0].written_alias) = (None, Some(7));
            guide.compare().unwrap();
            let drive = &guide.record.drives[0];
            assert_eq!((drive.alias, drive.written_alias), expected, "the other one has {another}");
        });
    }
}

/// Says that drives may have been swapped.
struct Doubting(Vec<String>);

impl Hand for Doubting {
    fn ask(&mut self, question: &Question) -> Answer {
        self.0.push(question.text.clone());
        Answer::Said("jog again".to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}

/// Nobody knows whether drives that look alike were swapped while the set-up was left: it is asked, and they are jogged again.
#[test]
fn drives_that_look_alike_are_jogged_again_where_nobody_knows_their_places() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(link), clock))
    };
    let mut hand = Doubting(Vec::new());
    with_found(BASE, &mut open, &mut hand, |guide| {
        guide.record.done = vec![Step::Find, Step::Jog, Step::Name];
        for (drive, serial) in guide.record.drives.iter_mut().zip([0, 0, 9]) {
            (drive.wheel, drive.serial) = (Some(format!("wheel_{}", drive.position + 1)), serial);
        }
        assert!(guide.are_in_their_places().unwrap());
        assert_eq!(guide.record.done, [Step::Find]);
        assert!(guide.record.drives.iter().all(|drive| drive.wheel.is_none()));
    });
    assert!(hand.0.len() == 1 && hand.0[0].contains("SubDevices 0, 1 from others"), "{:?}", hand.0);
}

/// Keeps what is sent.
struct Kept {
    link: omnibase_ethercat_sim::SimLink,
    sent: Rc<RefCell<Vec<Vec<u8>>>>,
}

impl Link for Kept {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent.borrow_mut().push(frame.to_vec());
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// What the file has written at every start is written for a jog, too, where every drive of the product has it.
#[test]
fn a_jog_begins_as_the_robot_does() {
    let of_all = "parameters = [{ object = \"2100\", type = \"u8\", value = 0x51, state = \"safe_op\" }, ";
    let of_one = "[[drive]]\nparameters = [{ object = \"2200\", type = \"u8\", value = 0x52 }]\n";
    let terminal = "[[device]]\nname = \"coupler\"\nposition = 3\nkind = \"io\"\n\
                    outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
                    output = [{ name = \"level\", object = \"7000.1\", type = \"u16\" }]\n\
                    parameters = [{ object = \"8000.1\", type = \"u8\", value = 0x53 }]\n";
    let base = BASE.replacen("parameters = [", of_all, 1).replacen("[[drive]]\n", of_one, 1) + terminal;
    let plan = robot_file::plan(&base, &Registry::with_built_in()).unwrap();
    let sent = Rc::new(RefCell::new(Vec::new()));
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(Kept { link, sent: Rc::clone(&sent) }), clock))
    };
    with_found(&base, &mut open, &mut Nobody, |guide| {
        sent.borrow_mut().clear();
        guide.operational().unwrap();
        let count = |object: [u8; 2], subindex: u8, value: u8| {
            let bytes = [object[1], object[0], subindex, value];
            sent.borrow().iter().filter(|frame| frame.windows(4).any(|part| part == bytes)).count()
        };
        assert_eq!(count([0x21, 0x00], 0, 0x51), 3, "each drive, in SAFE-OP");
        assert_eq!(count([0x80, 0x00], 1, 0x53), 1, "the coupler");
        assert_eq!(count([0x22, 0x00], 0, 0x52), 0, "whose wheel it turns isn't known");
        let was: Vec<u16> = guide.record.drives[0].was.iter().map(|(index, ..)| *index).collect();
        assert!(was.contains(&0x6085) && was.contains(&0x6072) && !was.contains(&0x2100), "{was:04x?}");
    });
}

/// A segment that keeps its supply, whoever is at its end.
#[derive(Clone)]
struct Powered(Rc<RefCell<omnibase_ethercat_sim::SimLink>>);

impl Link for Powered {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.0.borrow_mut().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.0.borrow_mut().receive(buffer, deadline)
    }
}

/// The segment in PRE-OP, of whoever has the maker's tool.
fn by_tool(link: &Powered, clock: &VirtualClock) -> Bus<Powered, VirtualClock> {
    let mut bus = Bus::new(link.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    bus
}

/// Max torque of each of three drives, as it is now.
fn max_torques(link: &Powered, clock: &VirtualClock) -> Vec<u16> {
    let mut bus = by_tool(link, clock);
    let object = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    let read = |position| bus.sdo_read(position, object, SdoAccess::Entry).unwrap();
    (0..3).map(read).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]])).collect()
}

/// A drive whose map has no mode isn't turned in the one that it happens to have: by position it would go to 0.
#[test]
fn a_drive_that_maps_no_mode_is_told_it_before() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(omnibase_run::simulated::segment(&plan).unwrap().0);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mode = ObjectAddress::new(0x6060, 0);
    let mut bus = by_tool(&link, &clock);
    let entries: [(u16, u8, &[u8]); 8] = [
        (0x1C12, 0, &[0]),
        (0x1600, 0, &[0]),
        (0x1600, 1, &0x6040_0010_u32.to_le_bytes()),
        (0x1600, 2, &0x607A_0020_u32.to_le_bytes()),
        (0x1600, 3, &0x60FF_0020_u32.to_le_bytes()),
        (0x1600, 0, &[3]),
        (0x1C12, 1, &0x1600_u16.to_le_bytes()),
        (0x1C12, 0, &[1]),
    ];
    for (index, subindex, bytes) in entries {
        bus.sdo_write(1, ObjectAddress::new(index, subindex), bytes).unwrap();
    }
    // Cyclic synchronous position.
    bus.sdo_write(1, mode, &[8]).unwrap();
    drop(bus);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        let operational = guide.operational().unwrap();
        assert!(operational.maps[1].mode.is_none() && operational.maps[0].mode.is_some());
    });
    assert_eq!(by_tool(&link, &clock).sdo_read(1, mode, SdoAccess::Entry).unwrap(), [9]);
}

/// The program was killed in a jog and all drives are found again: what a jog left in them isn't taken for what was there before.
#[test]
fn what_was_there_before_the_first_jog_is_remembered_where_drives_are_found_again() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(omnibase_run::simulated::segment(&plan).unwrap().0);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let max_torque = |record: &Record| {
        let of =
            |drive: &FoundDrive| drive.was.iter().find(|(index, ..)| *index == at_start::MAX_TORQUE).cloned();
        record.drives.iter().map(|drive| of(drive).map(|(.., bytes)| bytes)).collect::<Vec<_>>()
    };
    let as_found = vec![Some(3000_u16.to_le_bytes().to_vec()); 3];
    let mut kept = String::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        assert_eq!(max_torque(&guide.record), as_found);
        kept = guide.record.to_json();
    });
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert_eq!(max_torque(&guide.record), vec![None; 3], "without the record nobody knows it any more");
    });
    with_record(BASE, Record::from_json(&kept).unwrap(), &mut open, &mut Nobody, |guide| {
        guide.record.done.clear();
        guide.find().unwrap();
        assert_eq!(max_torque(&guide.record), as_found);
        // Another drive in the place of one that was jogged isn't touched, and the set-up knows that one is left.
        let serial = std::mem::replace(&mut guide.record.drives[2].serial, 99);
        guide.leave_as_found();
        let words = guide.record.findings.join("\n");
        assert!(words.contains("SubDevice 2 isn't the drive that was jogged"), "{words}");
        assert_eq!(guide.record.jogged.len(), 3);
        guide.record.drives[2].serial = serial;
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        guide.find().unwrap();
        assert_eq!(max_torque(&guide.record), as_found, "as the drives have it now");
    });
}

/// Left in order, then one was set by the maker's tool, and the file got a parameter more: both are as somebody had them in the end.
#[test]
fn what_was_set_while_the_set_up_was_left_is_what_is_put_back() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(omnibase_run::simulated::segment(&plan).unwrap().0);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        record = guide.record.clone();
    });
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    by_tool(&link, &clock).sdo_write(1, torque, &2000_u16.to_le_bytes()).unwrap();
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77 }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let window = ObjectAddress::new(0x6065, 0);
    let before = by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap();
    with_record(&base, record, &mut open, &mut Nobody, |guide| {
        guide.compare().unwrap();
        guide.operational().unwrap();
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
    });
    assert_eq!(max_torques(&link, &clock), [3000, 2000, 3000]);
    assert_eq!(by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap(), before);
}

/// What an earlier jog left in a drive isn't taken for its own where it is looked at again.
#[test]
fn what_a_jog_left_is_not_seen_again() {
    let drive = |was: &[(u16, u16)]| FoundDrive {
        was: was.iter().map(|(index, value)| (*index, 0, value.to_le_bytes().to_vec())).collect(),
        ..FoundDrive::default()
    };
    let mut now = drive(&[(at_start::MAX_TORQUE, 100), (0x6065, 7), (0x6085, 9)]);
    let mut was = drive(&[(0x6085, 8)]);
    reading::see_again(&[drive(&[(0x6085, 8)])], &mut was, &mut now);
    assert_eq!(was, drive(&[(0x6085, 8), (0x6065, 7)]), "0x6072 was none that anybody knows");
    let mut now = drive(&[(at_start::MAX_TORQUE, 100)]);
    let mut was = drive(&[(at_start::MAX_TORQUE, 3000)]);
    let known = [was.clone()];
    reading::see_again(&known, &mut was, &mut now);
    assert_eq!(was, drive(&[(at_start::MAX_TORQUE, 3000)]));
}

/// Nobody knows what a drive's max torque was before it was jogged: what the jog left there isn't stored for ever.
#[test]
fn what_a_jog_left_in_a_drive_is_not_stored() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(omnibase_run::simulated::segment(&plan).unwrap().0);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    // As whoever mapped it left it at its end.
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    by_tool(&link, &clock).sdo_write(0, torque, &[0, 0]).unwrap();
    with_found(BASE, &mut open, &mut Says("store"), |guide| {
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
        }
        guide.operational().unwrap();
        assert!(guide.parameters().unwrap());
        let Record { findings, log, .. } = &guide.record;
        let stored: Vec<&String> = log.iter().filter(|line| line.contains(": stored (0x1010)")).collect();
        assert_eq!(stored, ["wheel_2: stored (0x1010)", "wheel_3: stored (0x1010)"], "{findings:?}");
        assert!(findings.join("\n").contains("wheel_1: not stored: 6072:00 is "), "{findings:?}");
    });
}

/// A file that has drives store what they hold at each start has them store nothing while a jog's torque may be there.
#[test]
fn what_the_file_has_drives_store_is_not_asked_for_by_a_jog() {
    let more = "parameters = [{ object = \"1010.1\", type = \"u32\", value = 1_702_257_011 }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let plan = robot_file::plan(&base, &Registry::with_built_in()).unwrap();
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(link), clock))
    };
    with_found(&base, &mut open, &mut Says("write"), |guide| {
        let at_start = at_start::AtStart::of_drive(&guide.plan, &guide.record.drives[0]);
        let objects: Vec<u16> = at_start.objects().map(|(index, _)| index).collect();
        assert!(objects.contains(&0x6085) && !objects.contains(&at_start::STORE), "{objects:x?}");
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
        }
        assert!(guide.parameters().unwrap());
        let of_store: Vec<&String> = guide.record.log.iter().filter(|line| line.contains("1010")).collect();
        assert!(
            of_store.len() == 3 && of_store.iter().all(|line| line.contains("can't be compared and stored"))
        );
    });
}

/// A drive that took a jogged one's place before all were found again is remembered, too; the one that is gone isn't forgotten.
#[test]
fn a_drive_in_the_place_of_a_jogged_one_is_remembered_and_that_one_is_told() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(link), clock))
    };
    let gone = FoundDrive { serial: 12_345, position: 2, ..FoundDrive::default() };
    let record = Record { jogged: vec![gone.clone()], ..Record::default() };
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        guide.find().unwrap();
        guide.operational().unwrap();
        assert_eq!(guide.record.jogged.len(), 4);
        guide.operational().unwrap();
        assert_eq!(guide.record.jogged.len(), 4, "once each");
        guide.leave_as_found();
        let words = guide.record.findings.join("\n");
        assert!(words.contains("serial 12345 was jogged and isn't among the drives"), "{words}");
        assert!(guide.record.jogged.contains(&gone));
        // What nobody knows isn't put back, so it stays remembered.
        guide.record.jogged.retain(|one| *one != gone);
        let was = guide.record.drives[0].was.clone();
        guide.record.drives[0].was.retain(|(index, ..)| *index != at_start::MAX_TORQUE);
        guide.leave_as_found();
        assert!(guide.record.findings.join("\n").contains("SubDevice 0: not all that it held before"));
        assert_eq!(guide.record.jogged.len(), 3);
        guide.record.drives[0].was = was;
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        // What somebody had written is what is put back.
        let drive = guide.record.drives[1].clone();
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        guide.keep_wished(&drive, torque, &[0xD0, 0x07]);
        let of = |drive: &FoundDrive| {
            drive.was.iter().find(|(index, ..)| *index == at_start::MAX_TORQUE).unwrap().2.clone()
        };
        let torques: Vec<Vec<u8>> = guide.record.drives.iter().map(of).collect();
        assert_eq!(torques, [vec![0xB8, 0x0B], vec![0xD0, 0x07], vec![0xB8, 0x0B]]);
    });
}

/// Its alias is written after its first jog: it is the same drive all the same.
#[test]
fn what_a_drive_was_before_is_remembered_where_it_got_an_alias_since() {
    let drive = |alias, torque: u16| FoundDrive {
        alias,
        was: vec![(at_start::MAX_TORQUE, 0, torque.to_le_bytes().to_vec())],
        ..FoundDrive::default()
    };
    let mut named = drive(Some(77), 100);
    assert!(reading::recall(&[drive(None, 3000)], &mut named).is_empty());
    assert_eq!(named, drive(Some(77), 3000));
    // Where one of them has it, the others aren't meant.
    let mut named = drive(Some(77), 100);
    assert!(reading::recall(&[drive(None, 2500), drive(Some(77), 3000)], &mut named).is_empty());
    assert_eq!(named, drive(Some(77), 3000));
}

/// Of drives that look alike and were different before nobody knows whose is whose: it is told, and nothing is written.
#[test]
fn what_drives_that_look_alike_were_before_is_not_guessed() {
    let drive = |torques: [u8; 2]| FoundDrive {
        was: vec![(at_start::MAX_TORQUE, 0, torques.to_vec()), (0x6060, 0, vec![3])],
        ..FoundDrive::default()
    };
    let jogged = [drive([0xB8, 0x0B]), drive([0xC4, 0x09])];
    let mut of_jog = FoundDrive {
        was: vec![(at_start::MAX_TORQUE, 0, vec![100, 0]), (0x6060, 0, vec![9])],
        ..FoundDrive::default()
    };
    let words = reading::recall(&jogged, &mut of_jog);
    assert_eq!(words.len(), 1);
    assert!(words[0].contains("was 3000 or 2500 before it was jogged"), "{words:?}");
    assert_eq!(of_jog.was, [(0x6060, 0, vec![3])]);
    let mut as_found = drive([0xC4, 0x09]);
    assert!(reading::recall(&jogged, &mut as_found).is_empty());
    assert_eq!(as_found, drive([0xC4, 0x09]));
}

/// Drives that look alike and held different torques; the program was killed in a jog, and whoever takes it up again doesn't know
/// whether they were swapped: nothing is written into the wrong one until somebody says that they weren't.
#[test]
fn what_was_in_drives_that_look_alike_is_put_back_once_their_places_are_known() {
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 3\n";
    let segment = omnibase_ethercat_sim::SegmentFile::parse(text).unwrap();
    let segment = segment.build(std::path::Path::new(".")).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    let as_found = [1100_u16, 1200, 1300];
    let mut bus = by_tool(&link, &clock);
    for (position, value) in (0..).zip(as_found) {
        bus.sdo_write(position, torque, &value.to_le_bytes()).unwrap();
    }
    drop(bus);
    let mut kept = String::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.record.done = vec![Step::Find];
        kept = guide.record.to_json();
    });
    let left = max_torques(&link, &clock);
    assert!(left.iter().zip(as_found).all(|(left, was)| *left != was), "{left:?}");
    // Asked where they are, he leaves.
    with_record(BASE, Record::from_json(&kept).unwrap(), &mut open, &mut Nobody, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        let words = guide.record.findings.join("\n");
        assert!(words.contains("SubDevice 0: nobody said that it is where it was"), "{words}");
        assert_eq!(guide.record.jogged.len(), 3);
    });
    assert_eq!(max_torques(&link, &clock), left);
    with_record(BASE, Record::from_json(&kept).unwrap(), &mut open, &mut Says("as before"), |guide| {
        guide.compare().unwrap();
        assert!(guide.are_in_their_places().unwrap());
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
    });
    assert_eq!(max_torques(&link, &clock), as_found);
}

/// Of drives that look alike one is gone when the set-up is begun anew: the others get back what they held, and that one isn't forgotten.
#[test]
fn one_that_is_gone_of_those_that_look_alike_stays_remembered() {
    use omnibase_ethercat_sim::Fault;
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 3\n";
    let segment = omnibase_ethercat_sim::SegmentFile::parse(text).unwrap();
    let mut segment = segment.build(std::path::Path::new(".")).unwrap();
    let injector = segment.injector();
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    let link = Powered(Rc::new(RefCell::new(link)));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let as_found = max_torques(&link, &clock);
    let mut jogged = Vec::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        jogged = guide.record.jogged.clone();
    });
    injector.inject(2, Fault::PowerOff);
    let record = Record { jogged, ..Record::default() };
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        assert!(matches!(guide.run(), Err(SetupError::TooFewDrives { wheels: 3, drives: 2 })));
        let words: Vec<&String> =
            guide.record.findings.iter().filter(|words| words.contains("isn't among the drives")).collect();
        assert_eq!(words.len(), 1, "{:?}", guide.record.findings);
        assert_eq!(guide.record.jogged.len(), 3);
    });
    let mut bus = by_tool(&link, &clock);
    for (position, was) in (0..2).zip(as_found) {
        let now = bus.sdo_read(position, ObjectAddress::new(at_start::MAX_TORQUE, 0), SdoAccess::Entry);
        assert_eq!(now.unwrap(), was.to_le_bytes());
    }
}

/// A segment that takes no frames from one number to another.
#[derive(Clone)]
struct Interrupted {
    link: Powered,
    sent: Rc<std::cell::Cell<u32>>,
    lost: Rc<std::cell::Cell<[u32; 2]>>,
}

impl Link for Interrupted {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let (number, [from, to]) = (self.sent.get(), self.lost.get());
        self.sent.set(number + 1);
        if (from..to).contains(&number) { Ok(()) } else { self.link.send(frame) }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// A wheel that is pushed while nobody hears of it hasn't held.
#[test]
fn a_wheel_that_is_not_seen_for_a_while_has_not_held() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (link, clock) = omnibase_ethercat_sim::in_process(omnibase_run::simulated::segment(&plan).unwrap().0);
    let link = Powered(Rc::new(RefCell::new(link)));
    let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert!(guide.watch(0, 1.0).unwrap().is_some());
        // In the middle of a second like that.
        let begun = link.sent.get();
        guide.watch(0, 0.001).unwrap();
        let first = link.sent.get() + (link.sent.get() - begun) + 300;
        link.lost.set([first, first + 50]);
        assert_eq!(guide.watch(0, 1.0).unwrap(), None);
        assert!(link.sent.get() > first);
        // Back in time, and for good.
        link.lost.set([0, 0]);
        assert!(guide.watch(0, 1.0).unwrap().is_some());
    });
}

/// Drives that were plugged in otherwise since they were jogged drive nobody over the floor: their file tells them by their place.
#[test]
fn another_drive_than_was_jogged_does_not_drive_on_the_floor() {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(link), clock))
    };
    with_found(BASE, &mut open, &mut Says("drive"), |guide| {
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
        }
        guide.record.drives[1].serial = 99;
        let ended = guide.first_metre();
        assert!(matches!(ended, Err(SetupError::Changed { position: 1, .. })), "{ended:?}");
    });
}
