//! What drives don't take back, don't tell, or can't be asked for.

use omnibase_ethercat_sim::Fault;

use super::*;
use crate::record::AliasWrite;

const TORQUE: ObjectAddress = ObjectAddress::new(at_start::MAX_TORQUE, 0);
const OFFSET: ObjectAddress = ObjectAddress::new(at_start::OFFSETS[0].0, 0);
const SERVOS: &str = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\n";
/// No drive has it, so none takes it back.
const NOWHERE: (u16, u8, Vec<u8>) = (0x5FFF, 0, Vec::new());

/// A drive that refuses one value each time: what somebody sets between two motions is its own all the same.
#[test]
fn what_is_set_in_a_drive_that_refuses_another_value_stays() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let offset = |value: i32| by_tool(&link, &clock).sdo_write(2, OFFSET, &value.to_le_bytes()).unwrap();
    let offset_now = || by_tool(&link, &clock).sdo_read(2, OFFSET, SdoAccess::Entry).unwrap();
    offset(5000);
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.written[2].drive.was.push(NOWHERE);
        assert_eq!(guide.leave_as_found().len(), 1);
        assert_eq!(offset_now(), 5000_i32.to_le_bytes());
        offset(0);
        by_tool(&link, &clock).sdo_write(2, TORQUE, &2500_u16.to_le_bytes()).unwrap();
        for _ in 0..2 {
            guide.operational().unwrap();
            assert_eq!(guide.leave_as_found().len(), 1, "it refuses again");
            let jogged: Vec<u16> = guide.record.jogged.iter().map(|one| one.position).collect();
            assert_eq!((jogged, guide.written.len()), (vec![2], 1));
            assert_eq!(offset_now(), 0_i32.to_le_bytes());
            assert_eq!(max_torques(&link, &clock), [3000, 3000, 0], "its limit waits for what it refuses");
        }
        guide.written[0].drive.was.retain(|one| *one != NOWHERE);
        assert!(guide.leave_as_found().is_empty());
        assert_eq!(max_torques(&link, &clock), [3000, 3000, 2500]);
    });
}

/// What a drive refuses once and takes later is what it held, not what a jog left there meanwhile; and what somebody sets there stays.
#[test]
fn what_was_refused_once_is_put_back_later_or_stays_as_somebody_set_it() {
    for is_set in [false, true] {
        let (link, clock) = drives_of(BASE);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let set = |value: i32| by_tool(&link, &clock).sdo_write(2, OFFSET, &value.to_le_bytes()).unwrap();
        set(5000);
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            let remember = |guide: &mut Guide<'_, VirtualClock>, bytes: &[u8]| {
                let all = guide.written.iter_mut().filter(|one| one.drive.position == 2);
                let mut objects = all.flat_map(|one| &mut one.drive.was);
                let its = objects.find(|one| one.0 == OFFSET.index).unwrap();
                its.2 = bytes.to_vec();
            };
            guide.operational().unwrap();
            // No drive takes three bytes of four.
            remember(guide, &[1, 2, 3]);
            assert_eq!(guide.leave_as_found().len(), 1);
            if is_set {
                set(777);
                assert!(guide.leave_as_found().is_empty());
            } else {
                guide.operational().unwrap();
                remember(guide, &5000_i32.to_le_bytes());
                assert!(guide.leave_as_found().is_empty());
            }
            assert!(guide.record.jogged.is_empty());
        });
        let expected = if is_set { 777_i32 } else { 5000 };
        let now = by_tool(&link, &clock).sdo_read(2, OFFSET, SdoAccess::Entry).unwrap();
        assert_eq!(now, expected.to_le_bytes());
        assert_eq!(max_torques(&link, &clock), [3000; 3]);
    }
}

/// Its limit waits for what the last motion wrote, too, though what an earlier one left is taken back by now.
#[test]
fn a_limit_waits_for_all_that_a_drive_refuses() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    by_tool(&link, &clock).sdo_write(2, OFFSET, &5000_i32.to_le_bytes()).unwrap();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.written[2].drive.was.push(NOWHERE);
        assert_eq!(guide.leave_as_found().len(), 1);
        guide.operational().unwrap();
        for one in &mut guide.written {
            one.drive.was.retain(|object| *object != NOWHERE);
            if one.drive.position == 2 {
                let offsets = one.drive.was.iter_mut().filter(|object| object.0 == OFFSET.index);
                offsets.for_each(|object| object.2 = vec![1, 2, 3]);
            }
        }
        assert_eq!(guide.leave_as_found().len(), 1);
        assert_eq!(max_torques(&link, &clock), [3000, 3000, 0]);
    });
}

/// A drive that didn't take all back keeps the limit of a jog, too, by which it is known among those that look like it.
#[test]
fn drives_that_look_alike_are_known_by_their_limit_until_they_took_all_back() {
    let (link, clock) = segment_of(SERVOS);
    for (position, value) in [(0, 1100_u16), (1, 1200), (2, 1300)] {
        by_tool(&link, &clock).sdo_write(position, TORQUE, &value.to_le_bytes()).unwrap();
    }
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.written[1].drive.was.push(NOWHERE);
        for _ in 0..2 {
            let refused = guide.leave_as_found();
            assert_eq!(refused.len(), 1, "{refused:?}");
            guide.tell_left(&refused);
            let jogged: Vec<u16> = guide.record.jogged.iter().map(|one| one.position).collect();
            assert_eq!((jogged, guide.record.findings.len()), (vec![1], 1));
            assert_eq!(max_torques(&link, &clock), [1100, 0, 1300]);
            guide.operational().unwrap();
        }
    });
}

/// A drive that doesn't answer for a while when it is looked at again takes nothing away that it was found with.
#[test]
fn what_is_not_read_again_takes_no_finding_away() {
    // None from the first: so many frames has a look.
    let (mut frames, mut place, mut broken_off) = (0, None, 0);
    while place.is_none_or(|place| place < frames) {
        let (link, clock) = drives_of(BASE);
        by_tool(&link, &clock).sdo_write(1, OFFSET, &5000_i32.to_le_bytes()).unwrap();
        by_tool(&link, &clock).sdo_write(1, TORQUE, &100_u16.to_le_bytes()).unwrap();
        let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            let found = guide.record.findings.clone();
            assert_eq!(found.len(), 2, "{found:?}");
            let begun = link.sent.get();
            if let Some(place) = place {
                link.lost.set([begun + place, begun + place + 700]);
            }
            broken_off += u32::from(guide.compare().is_err());
            if place.is_none() {
                frames = link.sent.get() - begun;
            }
            assert_eq!(guide.record.findings, found, "{place:?} of {frames}");
        });
        place = Some(place.map_or(0, |place| place + 9));
    }
    assert!(broken_off > 20, "{broken_off}");
}

/// A drive that is busy when it is asked for one object.
#[derive(Clone)]
pub(super) struct Busy {
    pub(super) link: Powered,
    pub(super) object: Rc<std::cell::Cell<Option<ObjectAddress>>>,
}

impl Link for Busy {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let length = self.link.receive(buffer, deadline)?;
        let (Some(length), Some(object)) = (length, self.object.get()) else { return Ok(length) };
        // An SDO response, an expedited upload's, and its object.
        let [low, high] = object.index.to_le_bytes();
        let is_answer = |bytes: &[u8]| {
            bytes[..2] == [0, 0x30] && bytes[2] & 0xF3 == 0x43 && bytes[3..6] == [low, high, object.subindex]
        };
        if let Some(at) = buffer[..length].windows(10).position(is_answer) {
            buffer[at + 2] = 0x80;
            buffer[at + 6..at + 10].copy_from_slice(&0x0800_0021_u32.to_le_bytes());
        }
        Ok(Some(length))
    }
}

/// What a busy drive doesn't tell before a motion isn't written by it: nobody could put it back.
#[test]
fn what_a_busy_drive_does_not_tell_is_not_written() {
    for (index, subindex, value) in [
        (at_start::MODE, 0, &[1_u8][..]),
        (0x60B1, 0, &[7, 0, 0, 0]),
        (0x60B2, 0, &[9, 0]),
        (0x1C32, 1, &[1, 0]),
    ] {
        let (link, clock) = drives_of(BASE);
        let link = Busy { link, object: Rc::default() };
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let object = ObjectAddress::new(index, subindex);
        by_tool(&link.link, &clock).sdo_write(1, object, value).unwrap();
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            link.object.set(Some(object));
            // Without its mode and how it is synchronised there is no jog.
            let begun = guide.operational().map(drop);
            assert_eq!(begun.is_err(), [at_start::MODE, 0x1C32].contains(&index), "{object}: {begun:?}");
            link.object.set(None);
            assert!(guide.leave_as_found().is_empty());
        });
        assert_eq!(
            by_tool(&link.link, &clock).sdo_read(1, object, SdoAccess::Entry).unwrap(),
            value,
            "{object}"
        );
    }
}

/// Nor does one that is busy: what it doesn't tell is as it was found.
#[test]
fn what_a_busy_drive_does_not_tell_takes_no_finding_away() {
    for (object, value) in [(OFFSET, &5000_i32.to_le_bytes()[..]), (TORQUE, &100_u16.to_le_bytes())] {
        let (link, clock) = drives_of(BASE);
        let link = Busy { link, object: Rc::default() };
        by_tool(&link.link, &clock).sdo_write(1, object, value).unwrap();
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            guide.tell_found_of(crate::record::GONE_ON, vec!["gone on".to_owned()]);
            let found = guide.record.findings.clone();
            assert_eq!(found.len(), 2, "{found:?}");
            link.object.set(Some(object));
            guide.compare().unwrap();
            guide.look_at_end();
            let mut still = guide.record.findings.clone();
            still.sort();
            // The limits of all are known where an offset isn't.
            let is_over = object == OFFSET;
            assert_eq!(
                still,
                if is_over { vec![found[0].clone()] } else { vec![found[0].clone(), "gone on".to_owned()] }
            );
            link.object.set(None);
            by_tool(&link.link, &clock).sdo_write(1, object, &vec![0xFF; value.len()][..]).unwrap();
            by_tool(&link.link, &clock).sdo_write(1, OFFSET, &[0; 4]).unwrap();
            guide.compare().unwrap();
            assert_eq!(guide.record.findings, Vec::<String>::new());
        });
    }
}

/// Somebody went on with what a jog may have left: that is over once all are known to be free of it.
#[test]
fn what_was_gone_on_with_is_found_until_all_limits_are_known() {
    let (link, clock) = drives_of(BASE);
    let link = Busy { link, object: Rc::default() };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.tell_found_of(crate::record::GONE_ON, vec!["gone on".to_owned()]);
        for (busy, found) in [(Some(TORQUE), &["gone on"][..]), (None, &[])] {
            link.object.set(busy);
            guide.look_at_end();
            assert_eq!(guide.record.findings, found);
        }
    });
}

/// A drive that lost its supply at the emergency stop holds what is stored in it, not what somebody had set before.
#[test]
fn what_was_lost_with_the_supply_is_not_put_back() {
    let (link, clock, injector) = faulty_segment_of(SERVOS);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let offsets = || {
        let mut bus = by_tool(&link, &clock);
        [0, 1, 2].map(|position| bus.sdo_read(position, OFFSET, SdoAccess::Entry).unwrap())
    };
    let (set, stored) = (5000_i32.to_le_bytes().to_vec(), offsets()[1].clone());
    for position in [0, 1, 2] {
        by_tool(&link, &clock).sdo_write(position, OFFSET, &5000_i32.to_le_bytes()).unwrap();
    }
    let mut hand = Notes::new(|_| {
        injector.inject(1, Fault::PowerOff);
        injector.inject(1, Fault::PowerOn);
        Some("done")
    });
    with_found(BASE, &mut open, &mut hand, |guide| {
        guide.operational().unwrap();
        assert_eq!(guide.are_up("release 0".to_owned(), "up?".to_owned()).unwrap(), Some(vec![1]));
        assert!(guide.written.is_empty() && guide.record.jogged.is_empty());
    });
    assert_eq!(offsets(), [set.clone(), stored, set]);
}

/// What drives hold is looked at once more at the end, whatever was found before.
#[test]
fn what_came_up_or_is_over_meanwhile_is_told_at_the_end() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    by_tool(&link, &clock).sdo_write(0, OFFSET, &5000_i32.to_le_bytes()).unwrap();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert_eq!(guide.record.findings.len(), 1, "it adds 5000");
        by_tool(&link, &clock).sdo_write(0, OFFSET, &[0; 4]).unwrap();
        by_tool(&link, &clock).sdo_write(1, TORQUE, &[100, 0]).unwrap();
        guide.look_at_end();
        assert_eq!(guide.record.findings.len(), 1);
        assert!(guide.record.findings[0].starts_with("SubDevice 1: its max torque (6072) is 100 per mille"));
    });
}

/// Breaks off while alias 7 is written into the second EEPROM; what it held.
fn half_written(link: &Powered, clock: &VirtualClock) -> Vec<u8> {
    let link = Interrupted { link: link.clone(), sent: Rc::default(), lost: Rc::default() };
    let mut bus = Bus::new(link.clone(), clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    let before = bus.read_sii(1).unwrap();
    let after = bus.sii_with_alias(1, 7).unwrap().unwrap();
    link.lost.set([link.sent.get() + 20, u32::MAX]);
    bus.write_sii(1, &before, &after).unwrap_err();
    before
}

/// Half of an EEPROM keeps all drives from PRE-OP: who switches them off and on, and who goes on without, comes to where it is made
/// whole, and nobody who is there is called gone.
#[test]
fn a_jog_that_was_cut_off_is_no_end_where_an_eeprom_is_half_written() {
    for says in ["go on", "done"] {
        is_no_end(says);
    }
}

fn is_no_end(says: &'static str) {
    let (link, clock, injector) = faulty_segment_of(SERVOS);
    let mut record = Record::default();
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| record.jogged = vec![guide.record.drives[2].clone()]);
    let before = half_written(&link, &clock);
    let begins = before[..omnibase_ethercat::wire::sii::HEADER].to_vec();
    record.writing = Some(AliasWrite { position: 1, alias: 7, begins });
    let mut hand = Notes::new(|id| match id {
        "jogged" => {
            for position in (0..3).filter(|_| says == "done") {
                injector.inject(position, Fault::PowerOff);
                injector.inject(position, Fault::PowerOn);
            }
            Some(says)
        }
        "power" => {
            injector.inject(1, Fault::PowerOff);
            injector.inject(1, Fault::PowerOn);
            Some("done")
        }
        "finish 1" => Some("as before"),
        _ => None,
    });
    with_record(BASE, record, &mut open, &mut hand, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert_eq!((guide.record.jogged.len(), guide.record.writing.is_some()), (0, false));
        let is_gone_on = guide.record.log.iter().any(|words| words.starts_with("FOUND: gone on though"));
        assert_eq!(is_gone_on, says == "go on", "{:?}", guide.record.log);
    });
    assert_eq!(hand.asked[..2], ["jogged", "finish 1"], "{:?}", hand.asked);
    assert!(!hand.asked.contains(&"gone for good".to_owned()));
    let mut bus = by_tool(&link, &clock);
    assert_eq!(bus.read_sii(1).unwrap(), before);
}

/// Whoever goes on after he switched all off and on, though they can't be asked yet, isn't told that he didn't.
#[test]
fn who_was_switched_off_and_on_is_not_gone_on_with() {
    let (link, clock, injector) = faulty_segment_of(SERVOS);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| record.jogged = vec![guide.record.drives[2].clone()]);
    // An EEPROM that somebody else left half-written: nobody is brought to PRE-OP.
    half_written(&link, &clock);
    let mut times = 0;
    let mut hand = Notes::new(|_| {
        times += 1;
        for position in (0..3).filter(|_| times == 1) {
            injector.inject(position, Fault::PowerOff);
            injector.inject(position, Fault::PowerOn);
        }
        Some(if times == 1 { "done" } else { "go on" })
    });
    with_record(BASE, record, &mut open, &mut hand, |guide| {
        assert!(matches!(guide.run(), Err(SetupError::Bus(_))));
        assert_eq!(guide.record.jogged.len(), 0);
        assert!(guide.record.log.iter().all(|words| !words.contains("gone on")), "{:?}", guide.record.log);
    });
    assert_eq!(hand.asked, ["jogged", "jogged"]);
}
