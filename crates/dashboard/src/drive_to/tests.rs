//! Which drive goes on, and since when it is held up.

use super::going::{BUSY, GONE, TOO_LATE, too_late};
use super::*;
use omnibase_robot::signals::StopCategory;
use omnibase_run::live::{Ages, Client, live};

fn drive(order: u64, replaces: Option<Drive>) -> Drive {
    Drive {
        order,
        asker: Client::Page(1).into(),
        goal: Pose2::new(order as f64, 0.0, 0.0),
        best: BestWay::Shortest,
        replans: 0,
        number: 1,
        before: 0,
        stage: Stage::Blocked { tried: None },
        since: Instant::now(),
        held_up: None,
        replaces: replaces.map(Box::new),
    }
}

#[test]
fn a_drive_that_does_not_begin_leaves_its_place_to_the_one_before_unless_that_was_stopped() {
    let drives = DriveTo::default();
    let (order, _) = drives.take_over();
    drives.keep(drive(order, None), None);
    // The next one doesn't begin: the first goes on, and counts as the latest.
    let (order, before) = drives.take_over();
    assert!(before.is_some() && !drives.is_under_way());
    assert_eq!(drives.give_back(drive(order, before)), Ok(()));
    let goes_on = lock(&drives.under_way).clone().expect("the first one");
    assert_eq!((goes_on.goal.x_m, goes_on.order), (1.0, order));
    assert_eq!(drives.check_latest(&goes_on), Ok(()));
    // A stop comes while another one is planned: nothing goes on.
    let (order, before) = drives.take_over();
    drives.take_over();
    assert_eq!(drives.give_back(drive(order, before)), Err(MEANWHILE.to_owned()));
    assert!(!drives.is_under_way());
}

#[test]
fn who_is_held_up_at_one_place_again_and_again_is_so_since_the_first_time() {
    let begun = Instant::now();
    let later = |seconds| begun + Duration::from_secs(seconds);
    let first = HeldUp::again(None, Pose2::new(1.0, 2.0, 3.1), begun);
    let second = HeldUp::again(Some(first), Pose2::new(1.05, 2.0, -3.1), later(1));
    assert_eq!(second, first);
    for elsewhere in [Pose2::new(1.2, 2.0, 3.1), Pose2::new(1.0, 2.0, 2.8)] {
        let third = HeldUp::again(Some(second), elsewhere, later(2));
        assert_eq!(third, HeldUp { at: elsewhere, since: later(2) });
    }
}

/// It is planned again while somebody stops or pauses the robot: what was planned then neither goes nor is looked after.
#[test]
fn a_stop_ends_a_drive_that_is_seen_on_its_way_whatever_is_planned_for_it_meanwhile() {
    let ages = Ages { stick_ns: u64::MAX, session_ns: u64::MAX };
    let (live, _end) = live(ages, StopCategory::RampAndHold, &[]);
    let drives = DriveTo::default();
    let (order, _) = drives.take_over();
    let poses = vec![Pose2::default()];
    let obstacles = Box::new(Obstacles::default());
    let stage = Stage::Driving { poses, obstacles, walls: 0, is_seen: true, ticket: 1 };
    drives.keep(Drive { stage, ..drive(order, None) }, Some("on its way".to_owned()));
    let planned = lock(&drives.under_way).clone().unwrap();
    // What another client began is nobody else's to end.
    drives.stop(&live, Some(Client::Command));
    assert!(drives.is_under_way());
    drives.stop(&live, None);
    assert!(drives.track(&live, &planned).is_err());
    drives.keep(planned, Some("planned again".to_owned()));
    assert!(!drives.is_under_way());
    let seen = drives.seen().unwrap();
    assert!(
        !seen.under_way && seen.failed && seen.text.starts_with("drive_to was given up"),
        "{}",
        seen.text
    );
}

#[test]
fn who_gave_up_and_for_whom_the_machine_was_too_busy_is_told_in_other_words() {
    let waits = Arc::new(());
    assert_eq!(too_late(&Waiting::of(&waits)), None);
    assert_eq!(too_late(&Waiting::since(&waits, Instant::now() - TOO_LATE - LOOK)), Some(BUSY));
    let waiting = Waiting::of(&waits);
    drop(waits);
    assert_eq!((too_late(&waiting), too_late(&Waiting::here())), (Some(GONE), None));
}
