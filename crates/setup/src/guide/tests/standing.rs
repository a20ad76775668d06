//! What was found counts until it is over, and no longer.

use super::*;

/// A step that failed is found until it is done; what somebody goes on without stays found, and is over when all begins anew.
#[test]
fn a_step_that_failed_is_found_until_it_is_done() {
    let mut record = Record::default();
    let stop = |text: &str| format!("wheel_1: {text}");
    record.failed(Step::SafeTorqueOff, Some("wheel_1"), stop("not pressed"));
    record.failed(Step::SafeTorqueOff, Some("wheel_2"), "wheel_2: not pressed");
    record.failed(Step::SafeTorqueOff, Some("wheel_1"), stop("frames were lost"));
    assert_eq!(record.findings, ["wheel_2: not pressed".to_owned(), stop("frames were lost")]);
    record.pass_over(Step::SafeTorqueOff, Some("wheel_1"), stop("gone on without"));
    assert_eq!(record.findings.len(), 3, "{:?}", record.findings);
    let mut record = Record::from_json(&record.to_json()).unwrap();
    record.make_good(Step::SafeTorqueOff, Some("wheel_1"));
    assert_eq!(
        (record.findings.as_slice(), record.passed_over.len()),
        (&["wheel_2: not pressed".to_owned()][..], 0)
    );
    record.found("wheels were measured");
    record.begin_again();
    assert_eq!(record.findings, ["wheels were measured"]);
}

/// What a drive adds to its speed is told with its sign, by the last look.
#[test]
fn what_is_added_to_a_speed_is_told_until_it_is_nothing() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let offset = ObjectAddress::new(0x60B1, 0);
    by_tool(&link, &clock).sdo_write(1, offset, &(-4000_i32).to_le_bytes()).unwrap();
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        let findings = &guide.record.findings;
        assert!(
            findings.len() == 1 && findings[0].starts_with("SubDevice 1: 60B1 is -4000, "),
            "{findings:?}"
        );
        record = guide.record.clone();
    });
    by_tool(&link, &clock).sdo_write(1, offset, &[0; 4]).unwrap();
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        guide.compare().unwrap();
        assert!(guide.record.findings.is_empty(), "{:?}", guide.record.findings);
    });
}

/// A jog's limits aren't what the robot drives with on the floor.
#[test]
fn what_a_jog_left_is_put_back_before_the_floor() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Says("drive"), |guide| {
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
            drive.wheel = Some(wheel.to_owned());
            (drive.turned, drive.counts_per_revolution, drive.gear_ratio) =
                (Some(crate::Turned::Forward), Some(1 << 20), Some(1.0));
        }
        guide.operational().unwrap();
        assert_eq!(guide.record.jogged.len(), 3);
        assert!(!guide.first_metre().unwrap(), "nobody holds the key");
        assert_eq!(guide.record.jogged, []);
    });
}

/// One wrong word is no dead end: who was said to turn no wheel is asked for again where a wheel is left without a drive.
#[test]
fn who_was_said_to_turn_no_wheel_is_asked_for_again_where_a_wheel_has_no_drive() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"sgdv\"\ncount = 4\nserial = 1\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_record(BASE, Record::default(), &mut open, &mut Roles("no wheel"), |guide| {
        assert!(guide.find().unwrap());
        let [second, third, _] = &mut guide.record.drives[..] else { panic!("{:?}", guide.record.drives) };
        (second.wheel, third.wheel) = (Some("wheel_2".to_owned()), Some("wheel_3".to_owned()));
        guide.record.done = vec![Step::Find];
        record = guide.record.clone();
    });
    let places = |guide: &Guide<'_, VirtualClock>| -> Vec<u16> {
        guide.record.drives.iter().map(|one| one.position).collect()
    };
    // Nobody knows yet that a wheel has none.
    with_record(BASE, record.clone(), &mut open, &mut Roles("wheel"), |guide| {
        assert!(guide.is_as_it_was().unwrap());
        assert_eq!(places(guide), [1, 2, 3]);
        assert!(!guide.has_every_wheel_a_drive());
        record = guide.record.clone();
    });
    for (said, found) in [("wheel", vec![0, 1, 2, 3]), ("no wheel", vec![1, 2, 3])] {
        with_record(BASE, record.clone(), &mut open, &mut Roles(said), |guide| {
            assert!(guide.is_as_it_was().unwrap());
            assert_eq!(places(guide), found);
        });
    }
    // Where it is left there, nothing is otherwise the next time.
    with_record(BASE, record.clone(), &mut open, &mut Nobody, |guide| {
        assert!(!guide.is_as_it_was().unwrap());
        assert_eq!((places(guide), guide.record.others.clone()), (vec![1, 2, 3], record.others.clone()));
    });
    // Nor is a file that named it by mistake a dead end.
    let mut named = record.clone();
    (named.others[0].is_apart_by_word, named.others[0].name) = (false, Some("lift".to_owned()));
    with_record(BASE, named, &mut open, &mut Roles("wheel"), |guide| {
        assert!(guide.is_as_it_was().unwrap());
        assert_eq!(places(guide), [0, 1, 2, 3]);
    });
    // Who is the last that may turn the wheel isn't taken for its drive unasked.
    record.drives.pop();
    for (said, found) in [("wheel", vec![0, 1, 2]), ("no wheel", vec![1, 2])] {
        with_record(BASE, record.clone(), &mut open, &mut Roles(said), |guide| {
            assert_eq!(guide.is_as_it_was().is_ok(), said == "wheel");
            assert_eq!(places(guide), found);
        });
    }
}

/// Says so of the first SubDevice's role, and that all others turn a wheel.
struct Roles(&'static str);

impl Hand for Roles {
    fn ask(&mut self, question: &Question) -> Answer {
        Answer::Text(if question.id == "role 0" { self.0 } else { "wheel" }.to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}
