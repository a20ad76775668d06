//! Robots that nobody knows are set up; more seeds by `cargo run --release -p omnibase-setup --example seeds`.

mod names;
mod rehearsed;
#[path = "../../examples/seeds/unknown/mod.rs"]
mod unknown;

use omnibase_ethercat::wire::Link;
use omnibase_ethercat_sim::VirtualClock;
use omnibase_setup::{Answer, FoundDrive, Guide, Outside, Question, Record, Step, Wished};
use unknown::{Circumstances, Found, Unknown, differences, drive_square, set_up, set_up_in};

fn robot() -> Unknown {
    Unknown {
        positions: [2, 0, 1],
        backward: [true, false, true],
        counts: 10_000,
        gear: 5.0,
        turned_encoder: Some(1),
        brakes: [0; 3],
    }
}

/// This answer to this question, once.
fn once(id: &'static str, answer: Answer) -> impl FnMut(&Question) -> Option<Answer> {
    let mut left = Some(answer);
    move |question| if question.id == id { left.take() } else { None }
}

/// A set-up under these circumstances, by who keeps every EEPROM.
fn set_up_where(
    circumstances: Circumstances,
    robot: &Unknown,
    otherwise: &mut dyn FnMut(&Question) -> Option<Answer>,
) -> Found {
    set_up_in(robot, circumstances, otherwise, &mut |_, _| Ok(())).unwrap()
}

fn said(text: &str) -> Answer {
    Answer::Text(text.to_owned())
}

#[test]
fn a_robot_wired_in_every_way_wrongly_gets_its_file_and_drives_its_square() {
    let robot = robot();
    // Left in the middle, and taken up again.
    let found = set_up(&robot, &mut once("way 1", Answer::Leave)).unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{}", found.text);
    assert_eq!(found.record.done, Step::ALL, "{:?}", found.asked);
    let said = found.record.findings.join("\n");
    for expected in [
        "SubDevice 0: its encoder counted against its motor",
        "counts per turn were seen",
        "wheel_1: its drive is at position 2, the file says 0",
        "wheel_1: it turns the other way than the file says",
    ] {
        assert!(said.contains(expected), "{expected}\n{said}");
    }
    assert!(!said.contains("didn't take its torque"), "{said}");
    let jogged: Vec<&String> = found.record.log.iter().filter(|line| line.contains("hold the key")).collect();
    assert!(
        jogged.len() >= 10 && jogged.iter().all(|line| line.ends_with(" 0 without a held key")),
        "{jogged:?}"
    );
    let rms_m = drive_square(&robot, &found.text).unwrap();
    assert!(rms_m < 5e-3, "{rms_m}");
}

#[test]
fn a_robot_of_a_seed_gets_its_file() {
    let robot = Unknown::of(2);
    let found = set_up(&robot, &mut |_| None).unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{robot:?}");
}

/// Nothing said chooses nothing: a wheel isn't named, a stop isn't called tested, by pressing enter.
#[test]
fn an_empty_answer_is_none_where_there_is_a_choice() {
    for (id, expected) in [
        ("wheel 0", "expected one of"),
        ("way 1", "expected one of"),
        ("parameters 2", "expected one of"),
        ("stopped 0", "expected one of"),
        // Nor what hands have done, or a tape says.
        ("release 0", "expected one of"),
        ("tape x ahead", "expected a number"),
    ] {
        let mut nothing = once(id, said(" \n"));
        let found = set_up(&Unknown::of(2), &mut |question| match question.id.as_str() {
            "floor" => Some(said("drive")),
            _ => nothing(question),
        })
        .unwrap();
        let times = found.asked.iter().filter(|(asked, _)| asked == id).count();
        assert_eq!(times, 2, "{id}: {:?}", found.asked);
        let refused = found.told.iter().filter(|told| told.contains(expected)).count();
        assert_eq!(refused, 1, "{id}: {:?}", found.told);
    }
}

/// What differs from the file is written, read back, and stored in the drive where that is wished.
#[test]
fn parameters_are_written_and_stored_where_that_is_wished() {
    let found = set_up(&Unknown::of(2), &mut |question| match question.id.as_str() {
        "parameters 0" | "parameters 1" => Some(said("store")),
        _ => None,
    })
    .unwrap();
    let count = |words: &str| found.record.log.iter().filter(|line| line.contains(words)).count();
    assert_eq!(count(": stored (0x1010)"), 2, "{:?}", found.record.log);
    assert!(count(" written: ") >= 3 && count(" and reads back ") == 0, "{:?}", found.record.log);
}

/// A parameter that the drives refuse, and one that no set-up can compare: both are told, and the others are written.
#[test]
fn parameters_that_are_refused_are_told_and_keep_nothing_back() {
    let parameters = ", { object = \"2fff\", type = \"u8\", value = 1 }, \
                      { object = \"6065\", type = \"u32\", value = 77, state = \"safe_op\" }";
    let circumstances = Circumstances { parameters, ..Circumstances::default() };
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let found = set_up_where(circumstances, &robot, &mut |_| None);
    let count = |lines: &[String], words: &str| lines.iter().filter(|line| line.contains(words)).count();
    let Record { findings, log, .. } = &found.record;
    assert_eq!(count(findings, ": 2fff:00 isn't 1 now: "), 3, "{findings:#?}");
    assert_eq!(
        count(&found.told, ": 2fff:00 is nothing that can be read, the file says 1"),
        3,
        "{:?}",
        found.told
    );
    assert_eq!(count(log, ": 6065:00 can't be compared and stored here "), 3, "{log:#?}");
    assert_eq!(count(log, ": 6085:00 written: 2500000"), 3, "{log:#?}");
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new());
}

/// Numbers that no eye counts and no gear has are asked again.
#[test]
fn absurd_numbers_are_refused() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let mut absurd = vec!["1e-300", "1e300", "nan", "-1"];
    let found =
        set_up(&robot, &mut |question| (question.id == "turns 0").then(|| absurd.pop().map(said)).flatten())
            .unwrap();
    let refused =
        found.told.iter().filter(|text| text.starts_with("expected a number from 0.01 to 1000")).count();
    assert_eq!(refused, 4, "{:?}", found.told);
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new());
}

/// A drive that loses its torque by itself isn't called stopped: it is noted and asked again.
#[test]
fn a_drive_that_fails_by_itself_is_no_tested_emergency_stop() {
    let found = set_up(&Unknown::of(2), &mut |question| match question.id.as_str() {
        "stopped 1" => Some(said("no")),
        "stop 1" => Some(said("go on")),
        _ => None,
    })
    .unwrap();
    let without = |line: &&String| line.contains("lost its torque without the emergency stop");
    assert_eq!(found.record.findings.iter().filter(without).count(), 1, "{:?}", found.record.findings);
    let tested = |line: &&String| line.contains("the emergency stop took its torque");
    assert_eq!(found.record.log.iter().filter(tested).count(), 2, "{:?}", found.record.log);
    let asked: Vec<&str> = found.asked.iter().map(|(id, _)| id.as_str()).collect();
    assert!(asked.contains(&"stop 1") && !asked.contains(&"stop 0"), "{asked:?}");
    // Whoever reads the file without the record reads it there.
    assert_eq!(
        found.text.matches("the emergency stop was NOT seen to take its torque").count(),
        1,
        "{}",
        found.text
    );
}

/// An emergency stop that takes the drives' supply takes their torque, too.
#[test]
fn an_emergency_stop_that_takes_the_supply_is_a_tested_one() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let takes = Circumstances { stop_takes_supply: true, ..Circumstances::default() };
    let found = set_up_where(takes, &robot, &mut |_| None);
    let tested =
        |line: &&String| line.contains("the emergency stop took its torque: its drive lost its supply");
    assert_eq!(found.record.log.iter().filter(tested).count(), 3, "{:?}", found.record.log);
    assert!(!found.record.findings.join("\n").contains("emergency stop"), "{:?}", found.record.findings);
    assert!(!found.text.contains("NOT seen to take its torque"), "{}", found.text);
}

/// The first metre and two ways more, against a tape; let go in the middle of one, the drives lose their torque in the next frame.
#[test]
fn on_the_floor_it_drives_while_the_key_is_held_and_a_tape_finds_the_wheels() {
    let robot = Unknown { turned_encoder: None, ..robot() };
    let mut asked = Vec::new();
    let found = set_up(&robot, &mut |question| {
        asked.push(question.id.clone());
        match question.id.as_str() {
            "floor" => Some(said("drive")),
            "calibrate" => Some(said("calibrate")),
            _ => None,
        }
    })
    .unwrap();
    assert_eq!(found.record.done, Step::ALL, "{:?}", found.record.log);
    let names: Vec<&str> = found.record.legs.iter().map(|leg| leg.name.as_str()).collect();
    assert_eq!(names, ["ahead", "aside", "round"], "{:?}", found.record.log);
    for leg in &found.record.legs {
        for (told, measured) in leg.told.iter().zip(&leg.measured) {
            assert!((told - measured).abs() < 0.02, "{}: {:?} {:?}", leg.name, leg.told, leg.measured);
        }
    }
    assert!((1.0..1.05).contains(&found.record.legs[0].told[0]), "{:?}", found.record.legs[0].told);
    assert!(found.record.takes_calibration);
    let driven: Vec<&String> =
        found.record.log.iter().filter(|line| line.contains("by its wheels")).collect();
    assert!(
        driven.len() == 3 && driven.iter().all(|line| line.ends_with(" 0 without a held key")),
        "{driven:?}"
    );
}

/// Who sees the same wheel at every drive isn't asked for ever.
#[test]
fn two_drives_for_one_wheel_are_jogged_again_a_few_times_and_then_left() {
    let mut asked = 0;
    let ended = set_up(&Unknown { turned_encoder: None, ..robot() }, &mut |question| {
        question.id.starts_with("wheel ").then(|| {
            asked += 1;
            said("wheel_1")
        })
    });
    assert!(ended.is_err_and(|words| words.contains("it didn't end")));
    // Three rounds of three drives, and the same when it is taken up again.
    assert_eq!(asked, 18);
}

/// A program that never answers with an answer.
struct Deaf(u32);

impl omnibase_setup::Hand for Deaf {
    fn ask(&mut self, _: &omnibase_setup::Question) -> omnibase_setup::Answer {
        self.0 += 1;
        omnibase_setup::Answer::Text("what?".to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> omnibase_setup::Key {
        omnibase_setup::Key::LetGo
    }
}

#[test]
fn whoever_never_answers_is_left_and_nothing_moves() {
    let (ended, record, asked) = unknown::set_up_with(&robot(), &mut Deaf(0), |deaf| deaf.0);
    assert_eq!(ended, Ok(omnibase_setup::Ended::Left(None)));
    assert!((1..=20).contains(&asked), "{asked}");
    assert!(
        record.log.iter().all(|line| !line.contains("enabled for ") || line.contains("enabled for 0 cycles")),
        "{:?}",
        record.log
    );
}

/// Let go in the middle of the first metre: the very next frame enables nobody, and the metre is driven again.
#[test]
fn whoever_lets_go_on_the_floor_takes_the_torque_in_the_next_frame() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let lets_go = Circumstances { lets_go_at: Some(4000), ..Circumstances::default() };
    let found =
        set_up_where(lets_go, &robot, &mut |question| (question.id == "floor").then(|| said("drive")));
    let driven: Vec<&String> =
        found.record.log.iter().filter(|line| line.contains("by its wheels")).collect();
    assert_eq!(driven.len(), 2, "{driven:?}");
    assert!(driven[0].contains("the key was let go") && driven[1].contains("driven"), "{driven:?}");
    assert!(driven.iter().all(|line| line.ends_with(" 0 without a held key")), "{driven:?}");
    let asked: Vec<&str> = found.asked.iter().map(|(id, _)| id.as_str()).collect();
    assert!(asked.contains(&"drive ahead"), "{asked:?}");
    assert_eq!(found.record.legs.len(), 1);
}

/// A drive that loses its supply in the first metre ends that way and not the set-up, and what was tried stands in the record.
#[test]
fn a_drive_that_goes_dark_on_the_floor_is_driven_again_once_it_is_up() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let dark = Circumstances { dark_while: Some("a metre AHEAD"), ..Circumstances::default() };
    let found = set_up_where(dark, &robot, &mut |question| (question.id == "floor").then(|| said("drive")));
    let driven: Vec<&String> =
        found.record.log.iter().filter(|line| line.contains("by its wheels")).collect();
    assert_eq!(driven.len(), 2, "{driven:?}");
    assert!(driven[0].contains("the robot stopped") && driven[0].contains("SubDevice 1"), "{driven:?}");
    assert!(driven.iter().all(|line| line.ends_with(" 0 without a held key")), "{driven:?}");
    assert_eq!(found.record.legs.len(), 1);
}

/// A drive that failed keeps its fault; who answers "again" and holds the key acknowledges it.
#[test]
fn a_drive_that_failed_is_enabled_again_by_who_holds_the_key() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    for (part, asked) in [("SubDevice 1 turns", "again 1"), ("a metre AHEAD", "drive ahead")] {
        let fails = Circumstances { fails_while: Some(part), ..Circumstances::default() };
        let found =
            set_up_where(fails, &robot, &mut |question| (question.id == "floor").then(|| said("drive")));
        let is_told = |text: &&String| text.ends_with("acknowledges that");
        assert_eq!(found.told.iter().filter(is_told).count(), 1, "{part}: {:?}", found.told);
        let times = found.asked.iter().filter(|(id, _)| id == asked).count();
        assert_eq!(times, 1, "{part}: {:?}", found.record.log);
        let said = [&found.record.findings[..], &found.record.log].concat().join("\n");
        assert!(said.contains("; asked by SDO, it says error 0x2310"), "{said}");
        assert!(!said.contains("(no error)"), "{said}");
        assert_eq!(found.record.legs.len(), 1, "{part}");
        assert_eq!(unknown::differences(&robot, &found.text), Vec::<String>::new(), "{part}");
    }
}

/// A brake that holds, one that slips, one that was never heard, all turned by the same hand: the first alone is called tested.
#[test]
fn a_brake_is_opened_with_a_held_key_and_pushed_while_nothing_is_enabled() {
    let robot = Unknown { turned_encoder: None, brakes: [1500, 50, 1500], ..Unknown::of(2) };
    let found = set_up(&robot, &mut |question| match question.id.as_str() {
        "brake 0" | "brake 1" | "brake 2" => Some(said("yes")),
        "opened 2" => Some(said("no")),
        _ => None,
    })
    .unwrap();
    let asked = |id: &str| found.asked.iter().filter(|(asked, _)| asked == id).count();
    assert_eq!(["push 0", "push 1", "push 2"].map(asked), [1, 1, 0], "{:?}", found.asked);
    assert_eq!(["braked 0", "braked 1", "braked 2"].map(asked), [0, 1, 1], "{:?}", found.asked);
    let gave = |lines: &[String]| -> Vec<f64> {
        let said = lines.iter().filter(|line| !line.starts_with("FOUND"));
        let turns = said.filter_map(|line| line.split_once("with its brake closed it gave by "));
        turns.map(|(_, turns)| turns.split(' ').next().unwrap().parse().unwrap()).collect()
    };
    let (held, slipped) = (gave(&found.record.log), gave(&found.record.findings));
    assert!(held.len() == 1 && held[0] < 0.001, "{held:?}");
    assert!(slipped.len() == 1 && slipped[0] > 0.1, "{slipped:?}");
    let heard = |line: &&String| line.contains("its brake wasn't heard to open and close");
    assert_eq!(found.record.findings.iter().filter(heard).count(), 1, "{:?}", found.record.findings);
    let opened = found.record.log.iter().filter(|line| line.contains("the brake of"));
    assert!(
        opened.clone().count() == 3 && opened.clone().all(|line| line.ends_with(" 0 without a held key"))
    );
}

/// A wheel that nobody pushed stands as still as one that is held.
#[test]
fn a_brake_that_nobody_pushed_is_not_called_tested() {
    let robot = Unknown { turned_encoder: None, brakes: [1500, 1500, 1500], ..Unknown::of(2) };
    let found = set_up(&robot, &mut |question| match question.id.as_str() {
        "brake 0" | "brake 1" => Some(said("yes")),
        "push 0" => Some(said("done")),
        "pushed 0" => Some(said("no")),
        _ => None,
    })
    .unwrap();
    let asked = |id: &str| found.asked.iter().filter(|(asked, _)| asked == id).count();
    assert_eq!(["braked 0", "braked 1"].map(asked), [1, 0], "{:?}", found.asked);
    let is_told = |line: &&String| line.contains(": nobody pushed it, or it didn't hold");
    assert_eq!(found.record.findings.iter().filter(is_told).count(), 1, "{:?}", found.record.findings);
    let is_tested = |line: &&String| line.contains("pushed by hand with its brake closed");
    assert_eq!(found.record.log.iter().filter(is_tested).count(), 1, "{:?}", found.record.log);
}

/// Who turns a wheel whose motor has no brake at all sees the same as with one that slips.
#[test]
fn a_brake_that_was_only_believed_in_is_found() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let found = set_up(&robot, &mut |question| (question.id == "brake 1").then(|| said("yes"))).unwrap();
    let findings = found.record.findings.join("\n");
    assert!(findings.contains("pushed by hand with its brake closed it gave by "), "{findings}");
}

/// One zero too many: what was typed is held against what was just counted.
#[test]
fn counts_that_contradict_the_turns_that_were_seen_are_asked_again() {
    let robot = Unknown { turned_encoder: None, ..robot() };
    let found = set_up(&robot, &mut once("counts 0", said("100000"))).unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{}", found.text);
    let asked = |found: &Found, wanted: &str| found.asked.iter().filter(|(id, _)| id == wanted).count();
    assert_eq!(
        ["numbers 0", "gear 0", "turns 0"].map(|id| asked(&found, id)),
        [1, 2, 1],
        "{:?}",
        found.asked
    );
    // Or the turns were wrong: it is jogged again.
    let mut wrong_turns = once("turns 0", said("0.1"));
    let found = set_up(&robot, &mut |question| match question.id.as_str() {
        "numbers 0" => Some(said("jog it again")),
        "counts 0" => Some(said("10000")),
        _ => wrong_turns(question),
    })
    .unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{}", found.text);
    assert_eq!(["numbers 0", "turns 0"].map(|id| asked(&found, id)), [1, 2], "{:?}", found.asked);
}

/// A jog limits the torque, and at its end takes it away: drives are left as they were, before anything is stored in them.
#[test]
fn what_jogs_write_over_is_put_back() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let remembers = Circumstances::default();
    for on_floor in [false, true] {
        let found = set_up_where(remembers, &robot, &mut |question| {
            (on_floor && question.id == "floor").then(|| said("drive"))
        });
        assert_eq!(found.record.legs.len(), usize::from(on_floor));
        let as_found = vec![3000_u16.to_le_bytes().to_vec(); 3];
        assert_eq!(found.max_torques, as_found, "{on_floor}: {:?}", found.record.findings);
    }
}

/// A drive that goes dark in the middle of its jog is on record and jogged again once it is there.
#[test]
fn a_drive_that_loses_its_power_while_it_is_jogged_is_jogged_again() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let dark = Circumstances { dark_while: Some("SubDevice 1 turns"), ..Circumstances::default() };
    let found = set_up_where(dark, &robot, &mut |_| None);
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new());
    let findings = found.record.findings.join("\n");
    assert!(
        findings
            .contains("SubDevice 1: while it was turned: SubDevice 1 was lost: it does not answer (no power"),
        "{findings}"
    );
    let jogs = found
        .record
        .log
        .iter()
        .filter(|line| line.starts_with("SubDevice 1: hold the key: SubDevice 1 turns"));
    let jogs: Vec<&String> = jogs.collect();
    assert!(jogs.len() >= 2, "{jogs:?}");
    assert!(
        jogs.last().is_some_and(|line| line.contains(": the key was let go, ")),
        "{:?}",
        found.record.log
    );
}

/// A tape that says what no robot does is asked again, and never makes a file that can't be read.
#[test]
fn a_tape_that_contradicts_the_wheels_is_asked_again() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    for (id, absurd) in [("tape y ahead", "7"), ("tape turn ahead", "3600")] {
        let mut answer = once(id, said(absurd));
        let found = set_up(&robot, &mut |question| match question.id.as_str() {
            "floor" => Some(said("drive")),
            _ => answer(question),
        })
        .unwrap();
        let asked = found.asked.iter().filter(|(asked, _)| asked == "wrong ahead").count();
        assert_eq!((asked, found.record.legs.len()), (1, 1), "{id}: {:?}", found.told);
    }
}

/// A state is of the robot that it was begun with; what a jog left in that one's drives is told.
#[test]
fn a_set_up_of_another_robot_is_refused() {
    let jogged = vec![FoundDrive::default()];
    let done = vec![Step::Find];
    let record = Record { robot: Some("another".to_owned()), jogged, done, ..Record::default() };
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> { panic!("nothing is opened") };
    let (mut hand, mut keep, mut back_up) = (Deaf(0), |_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let outside =
        Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(Wished::new(unknown::BASE.to_owned()), record, &mut open, outside).unwrap();
    assert!(
        guide.run().unwrap_err().to_string().contains("begun with the file of a robot with other wheels")
    );
    let findings = guide.record.findings.join("\n");
    assert!(
        findings.contains("was jogged: max torque, mode and synchronisation are as the jog"),
        "{findings}"
    );
    assert_eq!(guide.record.jogged.len(), 1);
}
