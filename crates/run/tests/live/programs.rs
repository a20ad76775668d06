//! A program's stick that drives again by itself after a silence, and after nothing else.

use crate::hands::{Hands, played};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Frame, Phase, StopCategory};
use omnibase_run::live::{Ask, Client, Commander, Snapshot, StickWish};

const PROGRAM: Client = Client::Page(0);
const PERSON: Client = Client::Page(1);
const FORWARD: StickWish =
    StickWish::Held { twist: Twist2 { vx_m_s: 0.3, vy_m_s: 0.0, w_rad_s: 0.0 }, frame: Frame::Body };

fn drives(seen: &Snapshot) -> bool {
    seen.record.state.twist_in_body.vx_m_s > 0.25
}

fn rests(seen: &Snapshot) -> bool {
    seen.record.state.twist_in_body.speed_m_s() < 5e-3
}

/// A robot that holds, and a program's stick that was let go.
fn holding(hands: &mut Hands) {
    hands.send(0.4, PROGRAM, Ask::RecoverStick);
    hands.send(0.5, PERSON, Ask::Robot(RequestKind::Enable));
    hands.send(0.9, PROGRAM, Ask::Stick(StickWish::Released));
}

#[test]
fn after_a_silence_it_drives_again_by_itself() {
    // Shorter than a session may be silent, and longer.
    for silent_s in [0.6, 2.5] {
        let run = played(7.0, move |hands: &mut Hands| {
            holding(hands);
            hands.stick(1.0, 2.0, PROGRAM, FORWARD);
            hands.at(1.9, |_, seen| assert!(drives(seen)));
            hands.at(1.99 + silent_s, |_, seen| {
                assert!(rests(seen) && seen.phase == Phase::Holding);
                assert_eq!(seen.extras.authority.blocked_sticks, 0);
            });
            hands.stick(2.0 + silent_s, 3.5 + silent_s, PROGRAM, FORWARD);
            hands.at(3.4 + silent_s, |_, seen| assert!(drives(seen)));
        });
        assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    }
}

#[test]
fn after_any_other_stop_it_waits_for_a_person_even_where_it_was_silent_or_wasnt_there() {
    let stop: fn() -> Ask = || Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold));
    for (what, ask) in [("stop", stop), ("withdrawn", || Ask::Stick(StickWish::Withdrawn))] {
        // While it drives, while it is silent, and while its session is gone.
        for (stopped_s, is_new) in [(1.8, false), (2.8, false), (2.8, true)] {
            played(8.0, move |hands: &mut Hands| {
                holding(hands);
                hands.stick(1.0, 2.0, PROGRAM, FORWARD);
                if is_new {
                    hands.send(2.5, PROGRAM, Ask::Gone);
                    hands.send(2.9, PROGRAM, Ask::Begun);
                    hands.send(2.9, PROGRAM, Ask::RecoverStick);
                }
                hands.send(stopped_s, PERSON, ask());
                // It is told to let go, as it does; that is no leave to drive.
                hands.send(3.0, PROGRAM, Ask::Stick(StickWish::Released));
                hands.stick(3.1, 5.0, PROGRAM, FORWARD);
                hands.between(3.1, 5.0, move |_, seen| {
                    assert!(rests(seen), "{what} at {stopped_s} s, new: {is_new}");
                    assert_eq!(seen.extras.authority.blocked_sticks & 2, 2);
                });
                hands.send(5.0, PROGRAM, Ask::EnableStick(PROGRAM));
                hands.send(5.1, PROGRAM, Ask::Stick(StickWish::Released));
                hands.stick(5.2, 7.0, PROGRAM, FORWARD);
                hands.at(6.9, |_, seen| assert!(drives(seen)));
            });
        }
    }
}

#[test]
fn what_is_no_number_blocks_it() {
    played(6.0, |hands: &mut Hands| {
        holding(hands);
        hands.stick(1.0, 2.0, PROGRAM, FORWARD);
        let twist = Twist2 { vx_m_s: f64::NAN, vy_m_s: 0.0, w_rad_s: 0.0 };
        hands.send(1.8, PROGRAM, Ask::Stick(StickWish::Held { twist, frame: Frame::Body }));
        hands.send(2.5, PROGRAM, Ask::Stick(StickWish::Released));
        hands.stick(2.6, 4.0, PROGRAM, FORWARD);
        hands.between(2.6, 4.0, |_, seen| assert!(rests(seen)));
    });
}

#[test]
fn after_an_emergency_stop_it_waits_though_the_drives_were_enabled_again() {
    played(8.0, |hands: &mut Hands| {
        holding(hands);
        hands.stick(1.0, 2.0, PROGRAM, FORWARD);
        hands.send(1.9, PERSON, Ask::EmergencyStop);
        hands.send(3.0, PERSON, Ask::ReleaseEmergencyStop);
        hands.send(3.2, PERSON, Ask::Robot(RequestKind::Acknowledge));
        hands.send(3.4, PERSON, Ask::Robot(RequestKind::Enable));
        hands.send(4.4, PROGRAM, Ask::Stick(StickWish::Released));
        hands.stick(4.5, 5.5, PROGRAM, FORWARD);
        hands.at(5.4, |_, seen| {
            assert!(rests(seen) && seen.phase == Phase::Holding, "{:?}", seen.phase);
            assert_eq!(seen.extras.authority.blocked_sticks, 2);
        });
    });
}

#[test]
fn a_persons_stick_that_is_lost_hands_nothing_over_to_a_program() {
    played(6.0, |hands: &mut Hands| {
        holding(hands);
        hands.stick(1.0, 2.0, PERSON, FORWARD);
        hands.at(1.9, |_, seen| assert_eq!(seen.extras.authority.commander, Commander::Stick(PERSON)));
        // Its line is dead from 2 s on; the program has gone on to say what it wishes.
        hands.stick(1.5, 5.0, PROGRAM, FORWARD);
        hands.between(3.0, 5.0, |_, seen| assert!(rests(seen)));
    });
}

#[test]
fn a_persons_motion_that_ends_with_its_page_hands_nothing_over_but_a_programs_own_does() {
    for (who, drives_again) in [(PERSON, false), (PROGRAM, true)] {
        played(7.0, move |hands: &mut Hands| {
            holding(hands);
            let far = Pose2 { x_m: 1.5, y_m: 0.0, heading_rad: 0.0 };
            hands.send(1.0, who, Ask::Robot(RequestKind::GoTo { odom_from_body: far }));
            hands.alive(1.0, 2.0, who);
            // From 2 s on nothing is heard of it.
            hands.at(3.5, |_, seen| assert!(rests(seen) && seen.phase == Phase::Holding));
            hands.send(3.6, PROGRAM, Ask::Stick(StickWish::Released));
            hands.stick(3.7, 5.0, PROGRAM, FORWARD);
            hands.at(4.9, move |_, seen| assert_eq!(drives(seen), drives_again, "{who:?}"));
        });
    }
}

#[test]
fn a_motion_is_ended_by_who_began_it_and_that_is_no_stop_of_a_person() {
    for (by, ends) in [(PROGRAM, true), (PERSON, false)] {
        played(8.0, move |hands: &mut Hands| {
            holding(hands);
            let far = Pose2 { x_m: 1.5, y_m: 0.0, heading_rad: 0.0 };
            hands.send(1.0, PROGRAM, Ask::Robot(RequestKind::GoTo { odom_from_body: far }));
            hands.alive(1.0, 4.0, PROGRAM);
            hands.send(2.0, by, Ask::EndMotion);
            hands.at(2.9, move |_, seen| {
                assert_eq!((seen.phase == Phase::Holding, rests(seen)), (ends, ends), "{by:?}");
                assert_eq!(seen.extras.authority.blocked_sticks, 0);
            });
            hands.send(4.0, PROGRAM, Ask::Stick(StickWish::Released));
            hands.stick(4.1, 5.0, PROGRAM, FORWARD);
            hands.at(4.9, |_, seen| assert!(drives(seen)));
        });
    }
}

#[test]
fn a_program_that_dies_while_it_drives_is_followed_by_the_next() {
    played(6.0, |hands: &mut Hands| {
        holding(hands);
        hands.stick(1.0, 2.0, PROGRAM, FORWARD);
        hands.at(1.9, |_, seen| assert!(drives(seen)));
        hands.send(2.0, PROGRAM, Ask::Gone);
        // Before the robot is at rest.
        hands.send(2.05, PROGRAM, Ask::Begun);
        hands.send(2.05, PROGRAM, Ask::RecoverStick);
        hands.send(2.6, PROGRAM, Ask::Stick(StickWish::Released));
        hands.stick(2.7, 4.0, PROGRAM, FORWARD);
        hands.at(3.9, |_, seen| assert!(drives(seen)));
    });
}
