//! What jogs write over in drives, and what of it is put back.

use omnibase_ethercat_sim::Fault;

use super::*;

const TORQUE: ObjectAddress = ObjectAddress::new(at_start::MAX_TORQUE, 0);
const SERVOS: &str = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\n";

/// Each drive has what it held right behind each motion, whatever somebody set in it or in the file before that one; while a motion may
/// write, that is kept.
#[test]
fn drives_hold_behind_a_motion_what_they_held_before_it() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77 }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let window = ObjectAddress::new(0x6065, 0);
    let before = by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap();
    let kept = RefCell::new(Vec::new());
    let mut keep = |record: &Record| {
        kept.borrow_mut().push(record.jogged.iter().map(|one| one.position).collect::<Vec<_>>());
        Ok(())
    };
    let (mut hand, mut back_up) = (Nobody, |_: u16, _: &[u8]| Ok(()));
    let outside =
        Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(Wished::new(base), Record::default(), &mut open, outside).unwrap();
    assert!(guide.find().unwrap());
    for torques in [[3000, 3000, 3000], [3000, 2000, 3000]] {
        by_tool(&link, &clock).sdo_write(1, TORQUE, &u16::to_le_bytes(torques[1])).unwrap();
        kept.borrow_mut().clear();
        guide.operational().unwrap();
        assert_eq!(max_torques(&link, &clock), [0, 0, 0], "each maps it, and is told none");
        assert_ne!(by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap(), before);
        guide.leave_as_found();
        assert_eq!(max_torques(&link, &clock), torques);
        assert!(guide.watch(0, 0.01).unwrap().is_ok());
        assert_eq!(guide.jog(0, jogging::Motion::Stands(1.0), "hold the key").unwrap().enabled_cycles, 0);
        assert_eq!(max_torques(&link, &clock), torques);
        assert_eq!(by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap(), before);
        let (all, none) = (vec![0, 1, 2], Vec::new());
        // A jog is kept once more by itself.
        let expected = [&all, &none, &all, &none, &all, &all, &none].map(Clone::clone);
        assert_eq!(*kept.borrow(), expected);
    }
    assert!(guide.record.findings.is_empty(), "{:?}", guide.record.findings);
}

/// Sixty frames are lost from any place of a motion on: what it wrote is put back, or known to be there until it is.
#[test]
fn whatever_frames_are_lost_in_a_motion_is_put_back_or_known() {
    // None from the first: so many has a motion.
    let (mut frames, mut place, mut broken_off) = (0, None, 0);
    while place.is_none_or(|place| place < frames) {
        let (link, clock) = drives_of(BASE);
        let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            let hold = |guide: &mut Guide<'_, VirtualClock>| {
                let mut bus = guide.bus().unwrap();
                let drives = guide.record.drives.iter();
                drives.map(|one| reading::held(&mut bus, &guide.plan, one).unwrap()).collect::<Vec<_>>()
            };
            let before = hold(guide);
            let begun = link.sent.get();
            if let Some(place) = place {
                link.lost.set([begun + place, begun + place + 60]);
            }
            broken_off += u32::from(!matches!(guide.watch(0, 0.01), Ok(Ok(_))));
            if place.is_none() {
                frames = link.sent.get() - begun;
            }
            link.lost.set([0, 0]);
            if !guide.record.jogged.is_empty() {
                assert!(guide.leave_as_found().is_empty(), "{place:?}");
            }
            assert_eq!(hold(guide), before, "{place:?} of {frames}");
        });
        place = Some(place.map_or(0, |place| place + 9));
    }
    assert!(broken_off > 20, "{broken_off}");
}

/// The program was killed in a jog: nothing is written into any drive by whoever takes it up again, for nobody knows who is who; all are
/// to be switched off and on, and until that was seen, nothing goes on unless somebody says so.
#[test]
fn drives_in_which_a_jog_was_cut_off_are_switched_off_and_on() {
    let everybody = [0, 1, 2];
    for (says, switched, is_kept) in [
        (None, &[][..], true),
        (Some("done"), &[], true),
        (Some("done"), &[0, 2], true),
        (Some("done"), &everybody, false),
        (Some("too early"), &everybody, false),
        (Some("go on"), &[], false),
    ] {
        let (link, clock, injector) = faulty_segment_of(SERVOS);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let stored = max_torques(&link, &clock);
        let mut record = Record::default();
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            guide.operational().unwrap();
            guide.record.done = vec![Step::Find];
            guide.tell_left(&before::Refused::new());
            record = guide.record.clone();
        });
        let left = max_torques(&link, &clock);
        assert_ne!(left, stored);
        let record = Record::from_json(&record.to_json()).unwrap();
        let mut was_early = false;
        let mut hand = Notes::new(|id| {
            if id != "jogged" {
                return None;
            }
            // Somebody says it while one is dark.
            let is_early = says == Some("too early") && !std::mem::replace(&mut was_early, true);
            for position in switched.iter().filter(|_| !was_early || is_early) {
                injector.inject(*position, Fault::PowerOff);
                injector.inject(*position, Fault::PowerOn);
            }
            if says != Some("too early") {
                return says;
            }
            injector.inject(2, if is_early { Fault::PowerOff } else { Fault::PowerOn });
            Some("done")
        });
        with_record(BASE, record, &mut open, &mut hand, |guide| {
            assert_eq!(guide.run().unwrap(), Ended::Left(None));
            let Record { jogged, findings, .. } = &guide.record;
            assert_eq!(jogged.len(), if is_kept { 3 } else { 0 }, "{says:?} {switched:?}");
            let words = findings.join("\n");
            let are_told =
                ["SubDevice 2 (vendor ", "was jogged: max torque"].iter().all(|part| words.contains(part));
            assert_eq!(are_told, is_kept, "{words}");
            let is_gone_on = words.contains("gone on though SubDevices 0, 1, 2 weren't switched off and on");
            assert_eq!(is_gone_on, says == Some("go on"), "{words}");
            // And each is told, for all hold what may be a jog's.
            assert!(is_kept || findings.len() == if is_gone_on { 4 } else { 0 }, "{words}");
        });
        for position in 0..3 {
            let was_switched = switched.contains(&position);
            let expected = if was_switched { &stored } else { &left };
            assert_eq!(max_torques(&link, &clock)[position], expected[position]);
        }
        if says == Some("done") && is_kept {
            let [first, second] = [&hand.texts[0], &hand.texts[1]];
            assert!(first.starts_with("a jog was cut off, and SubDevices "), "{first}");
            let begins = "never lost their supply since that was asked: switch it off and on; or go on";
            assert!(second.contains(begins) && 2 * second.len() < first.len(), "{second}");
        }
        // The wheel to be jogged first holds the key; who leaves is asked once.
        let times = hand.asked.iter().filter(|id| *id == "jogged").count();
        let expected = match says {
            Some("done") if is_kept => 20,
            Some("too early") => 2,
            _ => 1,
        };
        assert_eq!(times, expected, "{says:?} {switched:?}");
    }
}

/// Switched off and on while the set-up was left, they are as stored without a question, whoever begins anew, too. Who isn't there is
/// told, and remembered until he is.
#[test]
fn drives_that_lost_their_supply_while_the_set_up_was_left_are_as_stored() {
    let (link, clock, injector) = faulty_segment_of(&format!("{SERVOS}serial = 1\n"));
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let stored = max_torques(&link, &clock);
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        record.jogged = guide.record.jogged.clone();
    });
    let switch = |fault: Fault| (0..3).for_each(|position| injector.inject(position, fault.clone()));
    switch(Fault::PowerOff);
    (0..2).for_each(|position| injector.inject(position, Fault::PowerOn));
    let mut hand = Notes::new(|_| Some("remember"));
    with_record(BASE, record.clone(), &mut open, &mut hand, |guide| {
        let ended = guide.run();
        assert!(matches!(ended, Err(SetupError::TooFewDrives { wheels: 3, drives: 2 })), "{ended:?}");
        assert_eq!((guide.record.jogged.len(), guide.record.findings.len()), (1, 1));
        record = guide.record.clone();
    });
    injector.inject(2, Fault::PowerOn);
    assert_eq!(hand.asked, ["gone for good"]);
    with_record(BASE, record, &mut open, &mut hand, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert_eq!((guide.record.jogged.len(), guide.record.findings.len()), (0, 0), "{:?}", guide.record);
    });
    assert_eq!(max_torques(&link, &clock), stored);
    assert!(hand.asked.iter().all(|id| id != "jogged"), "{:?}", hand.asked);
}

/// It may be another robot's file: what the jogged one's drives hold is told, and nothing is written.
#[test]
fn a_jog_of_another_robots_set_up_is_told() {
    let (link, clock) = segment_of(SERVOS);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record =
        Record { robot: Some("another".to_owned()), done: vec![Step::Find], ..Record::default() };
    record.jogged = vec![FoundDrive { serial: 12_345, ..FoundDrive::default() }];
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        assert!(matches!(guide.run(), Err(SetupError::OtherRobot)));
        assert!(guide.record.findings[0].contains("serial 12345) was jogged"), "{:?}", guide.record.findings);
        assert_eq!(guide.record.jogged.len(), 1);
    });
}

/// Nobody answered when a jog ended. Drives that look alike and held something else may be swapped by then: nothing is put back into these;
/// where they held the same it is, but for what no jog writes.
#[test]
fn who_was_out_of_sight_gets_back_what_he_held_where_it_is_known_whose_that_is() {
    for (held, set, expected, is_left) in [
        ([1100_u16, 1100, 1100], None, [1100_u16, 1100, 1100], false),
        ([1100, 1100, 1100], Some(2500_u16), [1100, 2500, 1100], false),
        ([1100, 1200, 1200], None, [0, 0, 0], true),
    ] {
        let (link, clock) = segment_of(SERVOS);
        for (position, value) in (0..).zip(held) {
            by_tool(&link, &clock).sdo_write(position, TORQUE, &value.to_le_bytes()).unwrap();
        }
        let is_cut = std::cell::Cell::new(false);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            if is_cut.get() {
                return Err("nobody answers".to_owned());
            }
            Ok((Box::new(link.clone()), clock.clone()))
        };
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            guide.operational().unwrap();
            is_cut.set(true);
            assert_eq!(guide.leave_as_found().len(), 3);
            is_cut.set(false);
            if let Some(value) = set {
                by_tool(&link, &clock).sdo_write(1, TORQUE, &value.to_le_bytes()).unwrap();
            }
            // What a second jog finds isn't what they held.
            if set.is_none() {
                guide.operational().unwrap();
            }
            let refused = guide.leave_as_found();
            assert_eq!(
                (refused.is_empty(), guide.record.jogged.is_empty()),
                (!is_left, !is_left),
                "{refused:?}"
            );
            let is_noted = guide.record.log.iter().any(|line| line.contains("is 2500, which no jog writes"));
            assert_eq!(is_noted, set.is_some());
        });
        assert_eq!(max_torques(&link, &clock), expected);
    }
}

/// Holds the key and cuts the cable while it is held; leaves where it is asked.
struct Cuts {
    link: Interrupted,
    cycles: u32,
    asked: Vec<String>,
}

impl Hand for Cuts {
    fn ask(&mut self, question: &Question) -> Answer {
        self.asked.push(question.id.clone());
        Answer::Leave
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        self.cycles += 1;
        if self.cycles == 300 {
            self.link.lost.set([self.link.sent.get(), self.link.sent.get() + 50]);
        }
        crate::Key::Beat
    }
}

/// Where frames were lost in a motion, or others stand behind one that is dark, nobody knows who is in whose place. What then isn't put
/// back is to be ended by the supply before drives are found again.
#[test]
fn drives_that_look_alike_and_were_out_of_sight_keep_what_a_motion_left() {
    for dark in ["frames of a watch", "frames of a jog", "a drive"] {
        let (link, clock, injector) = faulty_segment_of(SERVOS);
        for (position, value) in [(0, 1100_u16), (1, 1200), (2, 1300)] {
            by_tool(&link, &clock).sdo_write(position, TORQUE, &value.to_le_bytes()).unwrap();
        }
        let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let mut hand = Cuts { link: link.clone(), cycles: 0, asked: Vec::new() };
        with_found(BASE, &mut open, &mut hand, |guide| {
            guide.operational().unwrap();
            if dark == "a drive" {
                injector.inject(1, Fault::PowerOff);
                assert_eq!(guide.leave_as_found().len(), 3);
                injector.inject(1, Fault::PowerOn);
            } else {
                guide.leave_as_found();
                if dark == "frames of a watch" {
                    let begun = link.sent.get();
                    guide.watch(0, 0.001).unwrap().unwrap();
                    // Behind as many frames as come before and behind such a motion.
                    let first = link.sent.get() + (link.sent.get() - begun) + 300;
                    link.lost.set([first, first + 50]);
                    let unseen = guide.watch(0, 1.0).unwrap().unwrap_err();
                    assert!(unseen.contains("it is in SAFE-OP with error 0x001a"), "{unseen}");
                    assert!(
                        unseen.contains("SubDevice 1, 2 likewise") && unseen.contains("at the cables"),
                        "{unseen}"
                    );
                } else {
                    let jog = guide.jog(0, jogging::Motion::Turns, "hold the key").unwrap();
                    assert!(matches!(jog.end, crate::JogEnd::Lost(_)), "{}", jog.end);
                }
                link.lost.set([0, 0]);
            }
            assert_eq!(guide.record.jogged.len(), 3, "{dark}");
            assert!(max_torques(&link.link, &clock)[0] < 1100, "{dark}");
            assert!(!guide.find().unwrap(), "somebody leaves at the question");
        });
        assert_eq!(hand.asked, ["jogged"], "{dark}");
    }
}

/// One that got an alias meanwhile is the same; another one in its place isn't touched, and told.
#[test]
fn another_drive_in_the_place_of_a_jogged_one_is_not_touched() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        let alias = guide.written[1].drive.alias.replace(77);
        guide.record.drives[2].identification = Some(9);
        let refused = guide.leave_as_found();
        assert_eq!(alias, None);
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert_eq!((refused[0].0.position, refused[0].1.as_str()), (2, "another one is in its place"));
        guide.tell_left(&refused);
        assert!(
            guide.record.findings[0].contains("(another one is in its place)"),
            "{:?}",
            guide.record.findings
        );
        assert_eq!(max_torques(&link, &clock), [3000, 3000, 0]);
        // What somebody had written into it meanwhile is what is put back.
        let drive = guide.record.drives[2].clone();
        guide.keep_wished(&drive, TORQUE, &2000_u16.to_le_bytes());
        guide.record.drives[2].identification = None;
        assert!(guide.leave_as_found().is_empty());
        assert_eq!(max_torques(&link, &clock), [3000, 3000, 2000]);
    });
}

/// Who didn't get back what he held was out of sight from then on: what somebody sets before the next motion is his own.
#[test]
fn what_is_set_between_two_motions_is_a_drives_own_whatever_was_refused_before() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.record.drives[2].identification = Some(9);
        assert_eq!(guide.leave_as_found().len(), 1);
        guide.record.drives[2].identification = None;
        by_tool(&link, &clock).sdo_write(2, TORQUE, &2500_u16.to_le_bytes()).unwrap();
        guide.operational().unwrap();
        assert!(guide.leave_as_found().is_empty());
        assert_eq!(max_torques(&link, &clock), [3000, 3000, 2500]);
    });
}

/// One that is limited as by a jog is told, whoever did that, until it isn't.
#[test]
fn who_is_limited_as_by_a_jog_is_told() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    by_tool(&link, &clock).sdo_write(1, TORQUE, &100_u16.to_le_bytes()).unwrap();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        let words = "SubDevice 1: its max torque (6072) is 100 per mille of the rated, which a jog may have";
        assert!(guide.record.findings.len() == 1 && guide.record.findings[0].starts_with(words));
        by_tool(&link, &clock).sdo_write(1, TORQUE, &600_u16.to_le_bytes()).unwrap();
        guide.compare().unwrap();
        assert!(guide.record.findings.is_empty(), "{:?}", guide.record.findings);
    });
}

/// The limit that the robot itself tells its drives in each cycle stands in them behind each run.
#[test]
fn what_a_run_leaves_in_drives_is_not_told_as_a_jogs() {
    let base = BASE.replacen("wheel_torque_nm = 21.0", "wheel_torque_nm = 3.0", 1);
    let plan = robot_file::plan(&base, &Registry::with_built_in()).unwrap();
    let drive = &plan.drives[1];
    let limit = drive.scale.torque_limit_per_mille(drive.torque_limit.wheel_nm);
    assert!(limit <= before::MOST_JOG_TORQUE_PER_MILLE, "{limit}");
    let (link, clock) = drives_of(&base);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    by_tool(&link, &clock).sdo_write(1, TORQUE, &limit.to_le_bytes()).unwrap();
    with_found(&base, &mut open, &mut Nobody, |guide| {
        assert!(guide.record.findings.is_empty(), "{:?}", guide.record.findings);
        by_tool(&link, &clock).sdo_write(1, TORQUE, &(limit - 1).to_le_bytes()).unwrap();
        guide.compare().unwrap();
        assert_eq!(guide.record.findings.len(), 1);
        // A gear that was found makes it less in the file that comes out, and in the first metre.
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
            drive.gear_ratio = Some(40.0);
        }
        let made = robot_file::plan(&guide.text().unwrap(), &Registry::with_built_in()).unwrap();
        let less = made.drives[1].scale.torque_limit_per_mille(made.drives[1].torque_limit.wheel_nm);
        assert!(less < limit - 1, "{less}");
        by_tool(&link, &clock).sdo_write(1, TORQUE, &less.to_le_bytes()).unwrap();
        guide.compare().unwrap();
        assert!(guide.record.findings.is_empty(), "{:?}", guide.record.findings);
    });
}

/// What a jog may have left in a drive isn't stored for ever.
#[test]
fn what_a_jog_left_in_a_drive_is_not_stored() {
    let (link, clock) = drives_of(BASE);
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
        assert!(
            findings
                .join("\n")
                .contains("wheel_1: not stored: its max torque (6072) is as a jog may leave it"),
            "{findings:?}"
        );
        // Nor where its limit is its own by somebody's word; nor what a jog wrote over and nobody put back.
        let mut bus = guide.bus().unwrap();
        let drives = guide.record.drives.clone();
        bus.sdo_write(0, torque, &MOST_JOG_TORQUE_PER_MILLE.to_le_bytes()).unwrap();
        assert!(guide.left_by_jog(&mut bus, &drives[0]).unwrap().starts_with("its max torque (6072) is as"));
        guide.record.jogged = vec![drives[1].clone()];
        assert!(guide.left_by_jog(&mut bus, &drives[1]).unwrap().starts_with("it holds what a jog wrote"));
        // One that is gone was at the place of another one.
        guide.record.jogged[0] = FoundDrive { serial: 12_345, ..drives[2].clone() };
        assert_eq!(guide.left_by_jog(&mut bus, &drives[2]), None);
        assert_eq!(guide.record.passed_over_of(Step::Parameters).unwrap(), "parameters of wheel_1");
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
        let at_start = at_start::AtStart::of_drive(&guide.plan, &guide.plan.bus, &guide.record.drives[0]);
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
