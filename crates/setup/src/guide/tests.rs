//! What the guide believes of drives that it sees again, and how a jog begins.

use std::cell::RefCell;
use std::rc::Rc;

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, LinkError};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::device::drive::{SERVO_PRODUCT, SERVO_VENDOR};
use omnibase_ethercat_sim::{Injector, VirtualClock};

use super::*;

mod apart;
mod left;
mod maps;
mod motions;
mod passed;
mod refused;
mod standing;
mod supply;
mod written;

/// Simulated servos, which no file here means.
const SERVO: (u32, u32) = (SERVO_VENDOR, SERVO_PRODUCT);
const BASE: &str = include_str!("../../../../robots/bmm.toml");

/// A guide that found what is on a bus, looked at.
fn with_found(
    base: &str,
    open: Open<'_, VirtualClock>,
    hand: &mut dyn Hand,
    look: impl FnOnce(&mut Guide<'_, VirtualClock>),
) {
    with_record(base, Record::default(), open, hand, |guide| {
        assert!(guide.find().unwrap());
        look(guide);
    });
}

/// One that is taken up from a record.
fn with_record(
    base: &str,
    mut record: Record,
    open: Open<'_, VirtualClock>,
    hand: &mut dyn Hand,
    look: impl FnOnce(&mut Guide<'_, VirtualClock>),
) {
    record.products_meant = vec![SERVO];
    let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let outside = Outside { hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
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
        Answer::Text(self.0.to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}

/// Answers by what is asked; notes what it was told, asked, and for what a key was taken. It is gone where one is to be held.
struct Notes<F> {
    answers: F,
    asked: Vec<String>,
    texts: Vec<String>,
    told: Vec<String>,
    keys: Vec<String>,
}

impl<F: FnMut(&str) -> Option<&'static str>> Notes<F> {
    fn new(answers: F) -> Self {
        Notes { answers, asked: Vec::new(), texts: Vec::new(), told: Vec::new(), keys: Vec::new() }
    }
}

impl<F: FnMut(&str) -> Option<&'static str>> Hand for Notes<F> {
    fn ask(&mut self, question: &Question) -> Answer {
        self.asked.push(question.id.clone());
        self.texts.push(question.text.clone());
        (self.answers)(&question.id).map_or(Answer::Leave, |said| Answer::Text(said.to_owned()))
    }

    fn tell(&mut self, text: &str) {
        self.told.push(text.to_owned());
    }

    fn take_key(&mut self, what: &str) {
        self.keys.push(what.to_owned());
    }

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
    let outside =
        Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
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
            // Somebody wished it found by its position meanwhile, or didn't.
            for is_by_position in [true, false] {
                let drive = &mut guide.record.drives[0];
                (drive.alias, drive.written_alias) = (None, Some(7));
                drive.is_by_position = is_by_position;
                guide.compare().unwrap();
                let drive = &guide.record.drives[0];
                assert_eq!((drive.alias, drive.written_alias), expected, "the other one has {another}");
                assert_eq!(drive.is_by_position, is_by_position);
            }
        });
    }
}

/// Says that drives may have been swapped.
struct Doubting(Vec<String>);

impl Hand for Doubting {
    fn ask(&mut self, question: &Question) -> Answer {
        self.0.push(question.text.clone());
        Answer::Text("jog again".to_owned())
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
        // Driven by wheels as they were known then.
        (guide.record.legs, guide.record.takes_calibration) = (vec![crate::Leg::default()], true);
        for (drive, serial) in guide.record.drives.iter_mut().zip([0, 0, 9]) {
            (drive.wheel, drive.serial) = (Some(format!("wheel_{}", drive.position + 1)), serial);
        }
        assert!(guide.are_in_their_places().unwrap());
        assert_eq!(guide.record.done, [Step::Find]);
        assert!(guide.record.legs.is_empty() && !guide.record.takes_calibration);
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
    let of_all = "parameters = [{ object = \"2100\", type = \"u8\", value = 0x51, state = \"safe_op\" }, \
                  { object = \"2345.0\", bytes = \"0100 07\", complete_access = true }, ";
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
        assert!([0x6085, 0x6072, 0x2100].iter().all(|index| was.contains(index)), "{was:04x?}");
        // A whole object isn't read, so nobody could put it back.
        let whole = [0x45, 0x23, 0x00];
        assert!(sent.borrow().iter().all(|frame| frame.windows(3).all(|part| part != whole)));
        let told =
            guide.record.log.iter().filter(|line| line.contains(": jogs don't write 2345:00 as every"));
        assert_eq!(told.count(), 3, "{:?}", guide.record.log);
    });
}

/// The simulated drives of a robot's file.
fn drives_of(base: &str) -> (Powered, VirtualClock) {
    let plan = robot_file::plan(base, &Registry::with_built_in()).unwrap();
    let segment = omnibase_run::simulated::segment(&plan).unwrap().0;
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    (Powered(Rc::new(RefCell::new(link))), clock)
}

/// A segment of these tables that keeps its supply.
fn segment_of(tables: &str) -> (Powered, VirtualClock) {
    let (link, clock, _) = faulty_segment_of(tables);
    (link, clock)
}

/// The same, and what injects faults into it.
fn faulty_segment_of(tables: &str) -> (Powered, VirtualClock, Injector) {
    let segment = omnibase_ethercat_sim::SegmentFile::parse(tables).unwrap();
    let mut segment = segment.build(std::path::Path::new(".")).unwrap();
    let injector = segment.injector();
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    (Powered(Rc::new(RefCell::new(link))), clock, injector)
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
    let (link, clock) = drives_of(BASE);
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
    let (link, clock) = drives_of(BASE);
    let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert!(guide.watch(0, 1.0).unwrap().is_ok());
        // In the middle of a second like that.
        let begun = link.sent.get();
        guide.watch(0, 0.001).unwrap().unwrap();
        let first = link.sent.get() + (link.sent.get() - begun) + 300;
        link.lost.set([first, first + 50]);
        let unseen = guide.watch(0, 1.0).unwrap().unwrap_err();
        assert!(unseen.contains("it is in SAFE-OP with error 0x001a"), "{unseen}");
        assert!(unseen.contains("SubDevice 1, 2 likewise") && unseen.contains("at the cables"), "{unseen}");
        assert!(link.sent.get() > first);
        // Back in time, and for good.
        link.lost.set([0, 0]);
        assert!(guide.watch(0, 1.0).unwrap().is_ok());
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

/// What was taken of an earlier calibration isn't where somebody goes on without one.
#[test]
fn who_goes_on_without_a_calibration_takes_none() {
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> { panic!("nothing is opened") };
    let record = Record { takes_calibration: true, ..Record::default() };
    with_record(BASE, record, &mut open, &mut Says("go on"), |guide| {
        assert!(guide.calibrate().unwrap());
        assert!(!guide.record.takes_calibration);
    });
}
