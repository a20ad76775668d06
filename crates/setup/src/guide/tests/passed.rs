//! What somebody went on without isn't called done, and is offered again.

use super::*;
use crate::PassedOver;

/// Answers by what is asked, and notes for what a key was taken; it is gone where one is to be held.
struct Offered {
    says: fn(&str) -> &'static str,
    asked: Vec<String>,
    keys: Vec<String>,
    passed: Vec<Step>,
}

impl Hand for Offered {
    fn ask(&mut self, question: &Question) -> Answer {
        self.asked.push(question.id.clone());
        Answer::Text((self.says)(&question.id).to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn passed_over(&mut self, step: Step) {
        self.passed.push(step);
    }

    fn take_key(&mut self, what: &str) {
        self.keys.push(what.to_owned());
    }

    fn key(&mut self) -> crate::Key {
        crate::Key::Gone
    }
}

/// A set-up that is over, in which somebody went on without the brake and stop of wheel_2, and without the first metre.
fn over(open: Open<'_, VirtualClock>) -> Record {
    let mut record = Record::default();
    with_found(BASE, open, &mut Nobody, |guide| {
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
            drive.wheel = Some(wheel.to_owned());
        }
        record = guide.record.clone();
    });
    record.done = Step::ALL.to_vec();
    record.pass_over(Step::Brake, Some("wheel_2"), "no brake was tried");
    record.pass_over(Step::SafeTorqueOff, Some("wheel_2"), "no stop was tried");
    record.pass_over(Step::FirstMetre, None, "no metre was driven");
    record
}

#[test]
fn what_was_passed_over_is_offered_again_without_the_jogs() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let record = over(&mut open);
    let mut take_up = |says: fn(&str) -> &'static str| {
        let mut hand = Offered { says, asked: Vec::new(), keys: Vec::new(), passed: Vec::new() };
        let (mut ended, mut after) = (Ended::Left(None), Record::default());
        with_record(BASE, Record::from_json(&record.to_json()).unwrap(), &mut open, &mut hand, |guide| {
            ended = guide.run().unwrap();
            after = guide.record.clone();
        });
        (matches!(ended, Ended::File(_)), after, hand)
    };
    // Passed over again: nothing moves, nothing is called done.
    let (is_whole, after, hand) = take_up(|_| "go on");
    assert!(is_whole);
    assert_eq!(hand.asked, ["passed brake", "passed stop", "floor"]);
    assert_eq!((after.passed_over.len(), hand.keys), (3, Vec::new()));
    assert_eq!(hand.passed, [Step::Brake, Step::SafeTorqueOff, Step::FirstMetre]);
    assert!(after.log.iter().all(|line| !line.starts_with("done: ")), "{:?}", after.log);
    assert_eq!(after.log.last().unwrap(), "passed over: the first metre");
    // Made good: wheel_2 alone has no brake.
    let (_, after, hand) = take_up(|id| match id {
        "passed brake" => "now",
        "brake 1" => "no",
        _ => "go on",
    });
    assert_eq!(hand.asked[..2], ["passed brake", "brake 1"]);
    assert_eq!(hand.asked[2], "passed stop", "the other wheels' are known");
    assert!(after.log.contains(&"done: brakes".to_owned()), "{:?}", after.log);
    let left: Vec<Step> = after.passed_over.iter().map(|one: &PassedOver| one.step).collect();
    assert_eq!(left, [Step::SafeTorqueOff, Step::FirstMetre]);
    assert_eq!(after.findings, ["no stop was tried", "the first metre wasn't driven"]);
    // The stop is tried now, of that wheel alone.
    let (is_whole, after, hand) = take_up(|id| if id == "passed stop" { "now" } else { "go on" });
    assert!(!is_whole, "the key is gone");
    assert_eq!(hand.keys.len(), 1);
    assert!(hand.keys[0].contains("press the emergency stop: wheel_2"), "{:?}", hand.keys);
    assert_eq!(after.passed_over.len(), 3);
}

/// Whoever leaves where he is asked has made nothing good.
#[test]
fn what_was_passed_over_is_until_somebody_answers() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = over(&mut open);
    record.pass_over(Step::Parameters, Some("wheel_2"), "wheel_2: not stored");
    for (says, is_left) in [(None, true), (Some("leave them"), false)] {
        let mut hand = Notes::new(|_| says);
        with_record(BASE, Record::from_json(&record.to_json()).unwrap(), &mut open, &mut hand, |guide| {
            guide.record.drives.retain(|drive| drive.position == 1);
            assert_eq!(guide.parameters().unwrap(), !is_left);
            assert_eq!(guide.record.passed_over_of(Step::Parameters).is_some(), is_left);
        });
        assert_eq!(hand.asked, ["parameters 1"]);
    }
}

/// Said once of each wheel, and no more once it is done.
#[test]
fn what_was_passed_over_is_named_by_its_wheels_until_it_is_done() {
    let mut record = Record::default();
    let stop = Step::SafeTorqueOff;
    assert!(record.is_due(stop, "a") && record.passed_over_of(stop).is_none());
    for wheel in ["a", "b", "a"] {
        record.pass_over(stop, Some(wheel), format!("{wheel}: none"));
    }
    record.pass_over(Step::Calibration, None, "none");
    record.done = Step::ALL.to_vec();
    assert_eq!(record.passed_over_of(stop).unwrap(), "emergency stop of b, a");
    assert_eq!(record.passed_over_of(Step::Calibration).unwrap(), "calibration by a tape");
    assert!(record.is_due(stop, "a") && !record.is_due(stop, "c") && !record.is_due(Step::Enable, "a"));
    record.make_good(stop, Some("a"));
    record.make_good(stop, Some("b"));
    assert!(record.passed_over_of(stop).is_none() && !record.is_due(stop, "a"));
    assert_eq!(record.findings, ["none"]);
    record.begin_again();
    assert!(record.passed_over.is_empty());
}
