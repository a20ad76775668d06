//! Enabled drives: the emergency stop, the first enable, brakes, and what stops a drive whose program is gone.

use omnibase_ethercat::wire::register;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, Injector};

use super::*;
use crate::Key;

/// So many frames behind a drive's fault it is known, and the motion isn't ended yet.
const DARK_BEHIND: u32 = 30;

/// Answers and holds a key as it is told.
struct Scripted<'a> {
    says: &'a mut dyn FnMut(&Question) -> Answer,
    /// What is heard in so many cycles of a motion.
    key: &'a mut dyn FnMut(u32) -> Key,
    cycles: u32,
    asked: Vec<String>,
}

impl<'a> Scripted<'a> {
    fn new(says: &'a mut dyn FnMut(&Question) -> Answer, key: &'a mut dyn FnMut(u32) -> Key) -> Self {
        Scripted { says, key, cycles: 0, asked: Vec::new() }
    }
}

impl Hand for Scripted<'_> {
    fn ask(&mut self, question: &Question) -> Answer {
        self.asked.push(question.id.clone());
        (self.says)(question)
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {
        self.cycles = 0;
    }

    fn key(&mut self) -> Key {
        self.cycles += 1;
        (self.key)(self.cycles)
    }
}

fn said(text: &str) -> Answer {
    Answer::Text(text.to_owned())
}

/// The base's robot, its supply and cables in a hand.
fn powered() -> (Powered, VirtualClock, Injector) {
    let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
    let (mut segment, _) = omnibase_run::simulated::segment(&plan).unwrap();
    let injector = segment.injector();
    let (link, clock) = omnibase_ethercat_sim::in_process(segment);
    (Powered(Rc::new(RefCell::new(link))), clock, injector)
}

/// A guide whose drives turn their wheels, by this hand.
fn with_wheels(
    (link, clock): (&Powered, &VirtualClock),
    hand: &mut dyn Hand,
    look: impl FnOnce(&mut Guide<'_, VirtualClock>),
) {
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, hand, |guide| {
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
            drive.seen_counts = Some(1e6);
        }
        look(guide);
    });
}

/// A stop that takes another drive's supply, or a cable that is knocked out meanwhile, looks like one that takes this drive's: each is
/// called stopped by what its own chip forgot.
#[test]
fn a_wheel_is_stopped_by_its_own_supply_alone() {
    let off = |position| vec![(position, Fault::PowerOff)];
    let cut = vec![(0, Fault::CableCut { port: 1 })];
    let all = (0..3).map(|position| (position, Fault::PowerOff)).collect();
    let fails = vec![(2, Fault::PowerOff), (1, ApplicationFault::DriveFault(0x8700).into())];
    for (pressed, expected) in [
        (off(2), [false, false, true]),
        // Behind it nobody is heard, whoever has its supply.
        (off(0), [true, false, false]),
        (cut, [false; 3]),
        (all, [true; 3]),
        // What a drive fails by while others are lost isn't the stop.
        (fails, [false, false, true]),
    ] {
        let (link, clock, injector) = powered();
        let mut key = |cycle| {
            if cycle == 400 {
                pressed.iter().cloned().for_each(|(position, fault)| injector.inject(position, fault));
            }
            Key::Beat
        };
        let mut says = |question: &Question| match question.id.split(' ').next() {
            Some("stopped") => said("yes"),
            Some("stop") => said("go on"),
            _ => {
                for (position, fault) in &pressed {
                    match fault {
                        Fault::PowerOff => injector.inject(*position, Fault::PowerOn),
                        Fault::CableCut { port } => {
                            injector.inject(*position, Fault::CableRestored { port: *port })
                        }
                        _ => {}
                    }
                }
                said("done")
            }
        };
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            assert!(guide.stop_all().unwrap());
            let stopped: Vec<_> = guide.record.drives.iter().map(|drive| drive.is_stopped).collect();
            let Record { findings, log, .. } = &guide.record;
            assert_eq!(stopped, expected.map(Some), "{pressed:?}: {log:#?}");
            let untested =
                findings.iter().filter(|words| words.contains(": the emergency stop isn't tested: ")).count();
            assert_eq!(untested, expected.iter().filter(|is| !**is).count(), "{findings:#?}");
        });
    }
}

/// Whoever goes dark beside a jogged drive is named, with what to do; the jogged one is none the worse.
#[test]
fn a_jog_that_ends_beside_a_dark_drive_names_that_one() {
    for (dark, expected) in [
        (
            vec![2],
            "SubDevice 2 was lost: it does not answer (no power, cable out, or restarted): look at its supply",
        ),
        (
            vec![1],
            "; SubDevice 2 likewise, or cut off by that: look at its supply and at the cable to it, and go on",
        ),
        (vec![0], "no frame comes back: look at the supply of SubDevice 0"),
    ] {
        let (link, clock, injector) = powered();
        let mut key = |cycle| {
            if cycle == 400 {
                dark.iter().for_each(|position| injector.inject(*position, Fault::PowerOff));
            }
            Key::Beat
        };
        let mut says = |_: &Question| {
            dark.iter().for_each(|position| injector.inject(*position, Fault::PowerOn));
            said("leave it out")
        };
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            let found = guide.jog(usize::from(dark == [0]), jogging::Motion::Turns, "hold the key").unwrap();
            let words = found.end.to_string();
            assert!(words.contains(expected), "{dark:?}: {words}");
            let is_first = words.starts_with(&format!("SubDevice {} was lost", dark[0]));
            assert_eq!(is_first, dark != [0], "{words}");
        });
    }
}

/// Whoever jogs on while a drive is dark is told who isn't there, and asked again: the set-up goes on once it is up.
#[test]
fn a_jog_beside_a_drive_that_is_still_dark_is_asked_again() {
    let (link, clock, injector) = powered();
    let mut times = 0;
    let mut says = |question: &Question| {
        assert_eq!(question.id, "again 0");
        times += 1;
        if times == 2 {
            injector.inject(2, Fault::PowerOn);
        }
        said("again")
    };
    // It is taken once all are there.
    let mut key = |_| Key::Gone;
    let mut hand = Scripted::new(&mut says, &mut key);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| record = guide.record.clone());
    injector.inject(2, Fault::PowerOff);
    with_record(BASE, record, &mut open, &mut hand, |guide| assert!(!guide.jog_all().unwrap()));
    assert_eq!(hand.asked, ["again 0"; 2]);
}

/// A position that doesn't change though it is told to is told as such: of a wheel that is held, and of a drive whose firmware hangs.
#[test]
fn a_position_that_stays_the_same_in_a_jog_is_named() {
    // On the floor a wheel alone doesn't move the platform.
    let floor = || powered();
    let free = || faulty_segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let cases: [(&dyn Fn() -> _, _, _); 3] =
        [(&free, false, None), (&floor, false, Some(true)), (&free, true, Some(false))];
    for (robot, is_frozen, expected) in cases {
        let (link, clock, injector) = robot();
        let mut key = |cycle| {
            if cycle == 400 {
                injector.inject(1, ApplicationFault::Frozen(is_frozen).into());
            }
            if cycle == 8000 { Key::LetGo } else { Key::Beat }
        };
        let mut says = |_: &Question| said("leave it out");
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            match guide.jog(1, jogging::Motion::Turns, "hold the key") {
                Ok(jog) => {
                    assert!(!is_frozen, "it can't be led to INIT");
                    assert_eq!(jog.still.map(|still| still.others_changed), expected, "{:?}", jog);
                }
                Err(error) => {
                    assert!(is_frozen, "{error}");
                    let words = error.to_string();
                    assert!(words.starts_with("SubDevice 1: its position (0x6064) stayed at "), "{words}");
                    assert!(words.contains("its firmware hangs"), "{words}");
                }
            }
        });
    }
}

/// A drive that says itself why it lost its torque is stopped by that, though nobody answers any more behind it.
#[test]
fn a_drive_that_says_how_it_was_stopped_is_heard_whoever_goes_dark_behind_it() {
    let (link, clock, injector) = powered();
    let link = Interrupted { link, sent: Rc::default(), lost: Rc::default() };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut key = |cycle| {
        if cycle == 400 {
            injector.inject(1, ApplicationFault::DriveFault(0x3220).into());
            link.lost.set([link.sent.get() + DARK_BEHIND, u32::MAX]);
        }
        Key::Beat
    };
    let mut says = |question: &Question| match question.id.as_str() {
        "stopped 1" => {
            let Question { text, .. } = question;
            assert!(text.starts_with("wheel_2 lost its torque (the drive is in fault"), "{text}");
            said("yes")
        }
        _ => {
            link.lost.set([0, 0]);
            said("done")
        }
    };
    let mut hand = Scripted::new(&mut says, &mut key);
    with_found(BASE, &mut open, &mut hand, |guide| {
        guide.record.drives[1].wheel = Some("wheel_2".to_owned());
        assert!(guide.stop_all().unwrap());
        assert_eq!(guide.record.drives[1].is_stopped, Some(true), "{:?}", guide.record.findings);
        // All got back what they held once somebody said that they are up.
        assert!(guide.written.is_empty() && guide.record.jogged.is_empty());
    });
}

/// Who lets go, or never holds the key, has tried nothing: that is found where he goes on, and nothing else is.
#[test]
fn what_nobody_held_the_key_for_is_told_as_untried() {
    for (last, words) in [(300, "the key was let go"), (0, "the key was never held")] {
        let (link, clock, _) = powered();
        let mut key = |cycle| match cycle {
            _ if cycle < last => Key::Beat,
            _ if cycle == last => Key::LetGo,
            _ => Key::Quiet,
        };
        let (mut tries, leaves) = (0, std::cell::Cell::new(false));
        let mut says = |question: &Question| match question.id.split(' ').next() {
            Some("release") => said("done"),
            _ if leaves.get() => Answer::Leave,
            // Once more for the first wheel.
            _ => {
                tries += 1;
                said(if tries == 1 { "again" } else { "go on" })
            }
        };
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            assert!(guide.enable_all().unwrap());
            let of = |step: &'static str| (1..=3).map(move |wheel| format!("wheel_{wheel}: {step}: {words}"));
            let expected: Vec<_> = of("gone on without 2 s enabled at rest").collect();
            assert_eq!(guide.record.findings, expected);
            guide.record.findings.clear();
            assert!(guide.stop_all().unwrap());
            let expected: Vec<_> = of("the emergency stop wasn't tried").collect();
            assert_eq!(guide.record.findings, expected);
            assert!(guide.record.drives.iter().all(|drive| drive.is_stopped == Some(false)));
            // Whoever tries it again has nothing found before.
            guide.record.findings.clear();
            leaves.set(true);
            assert!(!guide.stop_all().unwrap() && !guide.enable_all().unwrap());
            assert_eq!(guide.record.findings, Vec::<String>::new());
        });
    }
}

/// Whoever leaves in the middle of a brake's test isn't asked whether he tests it again.
#[test]
fn a_brakes_test_is_left_at_once() {
    for (key, leaves_at) in
        [(Key::Gone, ""), (Key::Beat, "opened 0"), (Key::Beat, "push 0"), (Key::Beat, "pushed 0")]
    {
        let (link, clock, _) = powered();
        let mut key = |_| key;
        let mut says = |question: &Question| match question.id.as_str() {
            id if id == leaves_at => Answer::Leave,
            "push 0" => said("done"),
            _ => said("yes"),
        };
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            assert!(!guide.brakes().unwrap(), "{leaves_at}");
        });
        assert_eq!(hand.asked.last().unwrap(), if leaves_at.is_empty() { "brake 0" } else { leaves_at });
    }
}

/// Somebody else left the drives' watchdogs off: a jog sets those of the robot's file, or doesn't begin.
#[test]
fn a_jogged_drive_stops_by_its_watchdog_when_the_program_is_gone() {
    let base = format!("{BASE}\n[safety]\ndrive_watchdog_us = 20000\n");
    let (link, clock, _) = powered();
    let watchdogs = |link: &Powered| -> Vec<Vec<u8>> {
        let link = link.0.borrow();
        let peek = |one: &omnibase_ethercat_sim::SubDevice| {
            one.esc().peek(register::WATCHDOG_PROCESS_DATA, 2).unwrap().to_vec()
        };
        link.segment().sub_devices().iter().map(peek).collect()
    };
    let mut bus = by_tool(&link, &clock);
    for position in 0..3 {
        let off = omnibase_ethercat::transaction::Access::write_at(
            "the watchdog",
            position,
            register::WATCHDOG_PROCESS_DATA,
            &[0, 0],
        );
        bus.transactor().perform_one(off).unwrap();
    }
    drop(bus);
    assert_eq!(watchdogs(&link), vec![vec![0, 0]; 3]);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(&base, &mut open, &mut Nobody, |guide| {
        // One that the file doesn't know has it, too.
        guide.record.drives[2].product_code += 1;
        let known = at_start::AtStart::of_drive(&guide.plan, &guide.plan.bus, &guide.record.drives[2])
            .config
            .watchdogs;
        assert_eq!(known, guide.plan.bus.watchdogs());
        guide.record.drives[2].product_code -= 1;
        guide.operational().unwrap();
    });
    assert_eq!(watchdogs(&link), vec![200_u16.to_le_bytes().to_vec(); 3]);

    /// Answers to a read of the watchdog's register of the second SubDevice are wrong.
    struct Lying(Powered);
    impl Link for Lying {
        fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
            self.0.send(frame)
        }

        fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
            let received = self.0.receive(buffer, deadline)?;
            // APRD (1) of 0x0420, its position counted up by three SubDevices from that of the second.
            if buffer[16] == 1 && buffer[18..22] == [2, 0, 0x20, 0x04] {
                buffer[26] = buffer[26].wrapping_add(1);
            }
            Ok(received)
        }
    }
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        Ok((Box::new(Lying(link.clone())), clock.clone()))
    };
    with_found(&base, &mut open, &mut Nobody, |guide| {
        let Err(error) = guide.operational() else { panic!("it read back what it hadn't written") };
        assert!(error.to_string().contains("(SubDevice 1): its watchdog is 20100 us"), "{error}");
    });
}

/// Drives that look alike may be swapped while the robot is put down: somebody says that they weren't, or nothing drives.
#[test]
fn drives_that_look_alike_do_not_drive_before_somebody_knows_their_places() {
    type Step = fn(&mut Guide<'_, VirtualClock>) -> Result<bool, SetupError>;
    let steps: [(&str, Step); 2] =
        [("floor", |guide| guide.first_metre()), ("calibrate", |guide| guide.calibrate())];
    for (id, step) in steps {
        let (link, clock, _) = powered();
        let mut says = |question: &Question| match question.id.as_str() {
            "floor" => said("drive"),
            "calibrate" => said("calibrate"),
            _ => said("jog again"),
        };
        let mut key = |_| panic!("no key is taken");
        let mut hand = Scripted::new(&mut says, &mut key);
        with_wheels((&link, &clock), &mut hand, |guide| {
            guide.record.drives.iter_mut().for_each(|drive| drive.serial = 0);
            assert!(!step(guide).unwrap());
            assert_eq!(guide.record.done, [crate::Step::Find]);
        });
        assert_eq!(hand.asked, [id, "places"]);
    }
}
