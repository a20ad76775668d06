//! Writings of an alias that broke off.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::{Fault, SegmentFile, SimLink, VirtualClock, in_process};

use super::*;
use crate::{Answer, FoundDrive, Hand, Key, Outside, Question, Record, Wished};

const BASE: &str = include_str!("../../../../../robots/bmm.toml");
const ALIAS: u16 = 77;

/// A segment that several buses have one after the other; a number of frames after which it is cut.
#[derive(Clone)]
struct Cable {
    link: Rc<RefCell<SimLink>>,
    left: Rc<Cell<Option<u32>>>,
}

impl Link for Cable {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        match self.left.get() {
            Some(0) => return Ok(()),
            left => self.left.set(left.map(|left| left - 1)),
        }
        self.link.borrow_mut().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.borrow_mut().receive(buffer, deadline)
    }
}

/// Says this to whoever asks how to go on, and switches off and on.
struct Person<'a> {
    says: &'a str,
    asked: Vec<String>,
    told: Vec<String>,
    power: &'a dyn Fn(),
}

impl Hand for Person<'_> {
    fn ask(&mut self, question: &Question) -> Answer {
        self.asked.push(question.id.clone());
        if question.id == "power" {
            (self.power)();
            return Answer::Text("done".to_owned());
        }
        Answer::Text(self.says.to_owned())
    }

    fn tell(&mut self, text: &str) {
        self.told.push(text.to_owned());
    }

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> Key {
        Key::Gone
    }
}

/// The cable is cut behind every frame of a writing in turn, and the program is gone with all that it didn't keep: whoever takes
/// the set-up up again has the EEPROM whole, by another name or as it was, wherever it was switched off meanwhile.
#[test]
fn a_writing_that_broke_off_is_made_whole() {
    let wholes = [("the rest", false), ("the rest", true), ("as before", false), ("as before", true)];
    let mut halves = 0;
    for (says, is_switched) in wholes {
        for frames in 0.. {
            let text = "[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
            let mut segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
            let injector = segment.injector();
            let (link, clock) = in_process(segment);
            let (link, left) = (Rc::new(RefCell::new(link)), Rc::new(Cell::new(None)));
            let cable = Cable { link, left: Rc::clone(&left) };
            let power = || {
                for fault in [Fault::PowerOff, Fault::PowerOn] {
                    injector.inject(1, fault);
                }
            };
            let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
                Ok((Box::new(cable.clone()), clock.clone()))
            };
            let mut person = Person { says, asked: Vec::new(), told: Vec::new(), power: &power };
            let mut kept = Record::default().to_json();
            let before = {
                let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
                bus.scan().unwrap();
                bus.read_sii(1).unwrap()
            };
            let written = {
                let record = Record {
                    drives: vec![FoundDrive { position: 1, ..FoundDrive::default() }],
                    ..Record::default()
                };
                let mut keep = |record: &Record| {
                    kept = record.to_json();
                    Ok(())
                };
                let mut back_up = |_: u16, bytes: &[u8]| {
                    assert_eq!(bytes, before);
                    left.set(Some(frames));
                    Ok(())
                };
                let outside = Outside {
                    hand: &mut person,
                    keep: &mut keep,
                    back_up: &mut back_up,
                    write: &mut |_, _| Ok(()),
                };
                let mut guide = Guide::new(Wished::new(BASE.to_owned()), record, &mut open, outside).unwrap();
                let mut bus =
                    Bus::new(Box::new(cable.clone()) as Box<dyn Link>, clock.clone(), BusOptions::default());
                bus.scan().unwrap();
                guide.write_alias(&mut bus, 0, ALIAS)
            };
            let is_over = left.replace(None) != Some(0);
            if is_over {
                assert!(written.unwrap());
                break;
            }
            if let Err(error) = written {
                let error = error.to_string();
                assert!(error.ends_with("The same set-up, taken up again, makes it whole"), "{error}");
            }
            if is_switched {
                power();
            }
            let record = Record::from_json(&kept).unwrap();
            let mut keep = |record: &Record| {
                kept = record.to_json();
                Ok(())
            };
            let mut back_up = |_: u16, _: &[u8]| panic!("what was there before is kept already");
            let outside = Outside {
                hand: &mut person,
                keep: &mut keep,
                back_up: &mut back_up,
                write: &mut |_, _| Ok(()),
            };
            let mut guide = Guide::new(Wished::new(BASE.to_owned()), record, &mut open, outside).unwrap();
            // It goes on as ever: two drives are too few for three wheels.
            let ended = guide.run();
            assert!(matches!(ended, Err(SetupError::TooFewDrives { .. })), "{frames} {says}: {ended:?}");
            let record = guide.record.clone();
            drop(guide);
            assert_eq!((record.writing, Record::from_json(&kept).unwrap().writing), (None, None));

            let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
            bus.scan().unwrap();
            assert!(bus.subdevices().iter().all(|one| one.broken.is_none()), "{frames} {says}");
            let was_half = person.asked.contains(&"finish 1".to_owned());
            assert_eq!(person.asked.contains(&"power".to_owned()), was_half && is_switched);
            let found = bus.read_sii(1).unwrap();
            let is_named = u16::from_le_bytes([found[8], found[9]]) == ALIAS;
            assert_eq!(record.drives[0].written_alias, is_named.then_some(ALIAS));
            assert!(!was_half || is_named == (says == "the rest"), "{frames} {says}");
            assert!(is_named || found == before);
            halves += usize::from(was_half);
        }
    }
    assert!(halves > 40, "{halves} halves");
}

/// The half-written one is plugged in where another drive was: that one isn't called by its alias, and no wheel is believed.
#[test]
fn a_half_that_is_plugged_in_elsewhere_has_all_drives_jogged_again() {
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
    let segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
    let (link, clock) = in_process(segment);
    let cable = Cable { link: Rc::new(RefCell::new(link)), left: Rc::default() };
    let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    let before = bus.read_sii(0).unwrap();
    let after = bus.sii_with_alias(0, ALIAS).unwrap().unwrap();
    cable.left.set(Some(20));
    bus.write_sii(0, &before, &after).unwrap_err();
    cable.left.set(None);
    let begins = before[..sii::HEADER].to_vec();
    let drive = |position, wheel: &str| FoundDrive {
        position,
        wheel: Some(wheel.to_owned()),
        ..FoundDrive::default()
    };
    let record = Record {
        drives: vec![drive(0, "wheel_1"), drive(1, "wheel_2")],
        done: vec![crate::Step::Find, crate::Step::Jog],
        writing: Some(AliasWrite { position: 1, alias: ALIAS, begins }),
        ..Record::default()
    };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(cable.clone()), clock.clone())) };
    let mut person = Person { says: "the rest", asked: Vec::new(), told: Vec::new(), power: &|| {} };
    let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let outside =
        Outside { hand: &mut person, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(Wished::new(BASE.to_owned()), record, &mut open, outside).unwrap();
    assert!(matches!(guide.run(), Err(SetupError::TooFewDrives { .. })), "it begins with who is there");
    let record = guide.record.clone();
    assert_eq!((record.drives, record.done, record.writing), (Vec::new(), Vec::new(), None));
    assert!(
        record.findings[0].contains("was SubDevice 1 then and is SubDevice 0 now"),
        "{:?}",
        record.findings
    );
    assert_eq!(person.asked, ["finish 0"]);
}

/// Its drive is dark at the next start: half of an EEPROM is remembered until it was looked at, or somebody says that it is gone.
#[test]
fn a_half_whose_drive_is_dark_is_not_forgotten() {
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
    let mut segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
    let injector = segment.injector();
    let (link, clock) = in_process(segment);
    let cable = Cable { link: Rc::new(RefCell::new(link)), left: Rc::default() };
    let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    let before = bus.read_sii(1).unwrap();
    let after = bus.sii_with_alias(1, ALIAS).unwrap().unwrap();
    cable.left.set(Some(20));
    bus.write_sii(1, &before, &after).unwrap_err();
    cable.left.set(None);
    drop(bus);
    injector.inject(1, Fault::PowerOff);
    let writing = AliasWrite { position: 1, alias: ALIAS, begins: before[..sii::HEADER].to_vec() };
    let left = Record { writing: Some(writing.clone()), ..Record::default() };
    let ends_with = |says: &[Option<&str>], expected: Option<AliasWrite>| {
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(cable.clone()), clock.clone()))
        };
        let mut says = says.iter();
        let mut hand = Asked(|question: &Question| {
            let said = says.next().copied().flatten();
            if question.id == "power" {
                injector.inject(1, Fault::PowerOff);
                injector.inject(1, Fault::PowerOn);
            }
            if said == Some("look again") {
                assert_eq!(question.id, "unseen 1");
                injector.inject(1, Fault::PowerOn);
            }
            said.map_or(Answer::Leave, |said| Answer::Text(said.to_owned()))
        });
        let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
        let outside =
            Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
        let wished = Wished::new(BASE.to_owned());
        let mut guide = Guide::new(wished, left.clone(), &mut open, outside).unwrap();
        let is_done = guide.finish_alias();
        assert_eq!(guide.record.writing, expected);
        is_done.unwrap()
    };
    assert!(!ends_with(&[None], Some(writing.clone())));
    // Another time it is there, and isn't read: the cable is cut behind the scan.
    injector.inject(1, Fault::PowerOn);
    cable.left.set(Some(1000));
    let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    cable.left.set(cable.left.get().map(|left| 1000 - left + 1));
    assert!(!ends_with(&[None], Some(writing)));
    cable.left.set(None);
    injector.inject(1, Fault::PowerOff);
    assert!(ends_with(&[Some("gone")], None));
    assert!(ends_with(&[Some("look again"), Some("as before"), Some("done")], None));
    let mut bus = Bus::new(cable.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    assert_eq!(bus.read_sii(1).unwrap(), before);
}

/// Answers as this says.
struct Asked<F>(F);

impl<F: FnMut(&Question) -> Answer> Hand for Asked<F> {
    fn ask(&mut self, question: &Question) -> Answer {
        (self.0)(question)
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> Key {
        Key::Gone
    }
}
