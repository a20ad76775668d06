//! What a drive holds that lost its supply meanwhile.

use omnibase_ethercat_sim::Fault;

use super::*;

/// Holds the key; takes the supply of one drive while it is enabled, or where it is asked for.
struct Switches<'a> {
    injector: &'a Injector,
    cycles: u32,
    is_dark: bool,
}

impl Hand for Switches<'_> {
    fn ask(&mut self, question: &Question) -> Answer {
        let said = match question.id.split(' ').next().unwrap() {
            "name" => "alias",
            "alias" => "",
            // Said too early first: it is asked again.
            "power" | "release" => {
                let fault =
                    if std::mem::replace(&mut self.is_dark, true) { Fault::PowerOn } else { Fault::PowerOff };
                self.injector.inject(0, fault);
                "done"
            }
            "stopped" => "yes",
            other => panic!("{other}"),
        };
        Answer::Said(said.to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        self.cycles += 1;
        if self.cycles == 600 {
            self.injector.inject(0, Fault::PowerOff);
        }
        crate::Key::Beat
    }
}

/// Switched off and on for its alias, or by the emergency stop, a drive holds what is stored in it: that stays, not what it held before.
/// But one that stores by itself holds the jog's limit: that isn't its own.
#[test]
fn a_drive_that_lost_its_supply_keeps_what_is_stored_in_it() {
    for (is_stop, is_jogs) in [(false, false), (true, false), (false, true), (true, true)] {
        let tables = "[[subdevice]]\nkind = \"servo\"\n[[subdevice]]\nkind = \"servo\"\nalias = 9\ncount = 1\n\
                      [[subdevice]]\nkind = \"servo\"\n";
        let (link, clock, injector) = faulty_segment_of(tables);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let stored = max_torques(&link, &clock)[0];
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        for position in 0..3 {
            by_tool(&link, &clock).sdo_write(position, torque, &1100_u16.to_le_bytes()).unwrap();
        }
        let mut hand = Switches { injector: &injector, cycles: 0, is_dark: false };
        with_found(BASE, &mut open, &mut hand, |guide| {
            let wheels = if is_stop { &["wheel_1"][..] } else { &["wheel_1", "wheel_2", "wheel_3"] };
            for (drive, wheel) in guide.record.drives.iter_mut().zip(wheels) {
                drive.wheel = Some((*wheel).to_owned());
            }
            if is_jogs {
                guide.wished.torque_per_mille = stored;
            }
            guide.operational().unwrap();
            assert_eq!(guide.note_who_lost_supply(3).unwrap(), Ok(Vec::new()));
            assert!(if is_stop { guide.stop_all() } else { guide.name_all() }.unwrap());
            assert_eq!(guide.record.drives[0].is_stopped, is_stop.then_some(true));
            guide.leave_as_found();
            assert_eq!(guide.record.jogged, []);
        });
        assert_ne!(stored, 1100);
        let first = if is_jogs { 1100 } else { stored };
        assert_eq!(max_torques(&link, &clock), [first, 1100, 1100], "{is_stop} {is_jogs}");
    }
}

/// Left while it was dark: what is stored in it counts all the same, for the first look shows that its supply was gone.
#[test]
fn a_drive_that_lost_its_supply_while_the_set_up_was_left_keeps_what_is_stored_in_it() {
    let tables = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\nserial = 1\n";
    let (link, clock, injector) = faulty_segment_of(tables);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let stored = max_torques(&link, &clock)[0];
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    by_tool(&link, &clock).sdo_write(0, torque, &1100_u16.to_le_bytes()).unwrap();
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        (guide.record.done, guide.record.robot) = (vec![Step::Find], Some(guide.robot()));
        record = guide.record.clone();
    });
    // Told while it was dark; and found as two drives of three, as a set-up begun anew then has them.
    let mut dark = || -> Result<(Box<dyn Link>, VirtualClock), String> { Err("nobody answers".to_owned()) };
    with_record(BASE, record.clone(), &mut dark, &mut Nobody, |guide| {
        guide.leave_as_found();
        record = guide.record.clone();
    });
    assert_eq!(record.findings.len(), 1, "{:?}", record.findings);
    for is_anew in [false, true] {
        for fault in [Fault::PowerOff, Fault::PowerOn] {
            injector.inject(0, fault);
        }
        let mut record = record.clone();
        if is_anew {
            record.done.clear();
            record.drives.remove(0);
            record.drives.iter_mut().for_each(|drive| drive.position -= 1);
        }
        with_record(BASE, record, &mut open, &mut Nobody, |guide| {
            assert_eq!(guide.run().unwrap(), Ended::Left(None));
            assert_eq!(
                (guide.record.jogged.len(), guide.record.findings.len()),
                (0, 0),
                "{:?}",
                guide.record
            );
        });
        assert_eq!(max_torques(&link, &clock), [stored; 3]);
    }
    assert_ne!(stored, 1100);
}

/// What was lost before is no emergency stop of now, and nothing is put into who couldn't be asked since.
#[test]
fn who_lost_its_supply_before_is_not_stopped_now_and_nothing_is_put_into_it_unasked() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Says("done"), |guide| {
        guide.operational().unwrap();
        guide.record.lost_supply = vec![0];
        let mut bus = by_tool(&link, &clock);
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        bus.sdo_write(0, torque, &2500_u16.to_le_bytes()).unwrap();
        let mut bus = guide.bus().unwrap();
        guide.put_back(&mut bus);
        drop(bus);
        assert_eq!(max_torques(&link, &clock), [2500, 3000, 3000]);
        assert_eq!(
            (guide.record.jogged.len(), guide.record.findings.len()),
            (1, 1),
            "{:?}",
            guide.record.findings
        );
        assert_eq!(guide.are_up("release 0".to_owned(), String::new()).unwrap(), Some(Vec::new()));
        assert_eq!((guide.record.jogged.len(), guide.record.findings.len()), (0, 0));
        assert_eq!(max_torques(&link, &clock), [2500, 3000, 3000]);
    });
}
