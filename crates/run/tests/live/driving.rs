//! Sticks, pages, stops, settings and floods.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::hands::{Hands, played};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::{Frame, Phase, RequestAnswer, SafetyReason, Setpoint, StopCategory};
use omnibase_robot::stages::Reference;
use omnibase_run::live::{Answer, Ask, Client, Commander, JoystickState, Live, Refusal, Snapshot, StickWish};

const FORWARD: StickWish =
    StickWish::Held { twist: Twist2 { vx_m_s: 0.3, vy_m_s: 0.0, w_rad_s: 0.0 }, frame: Frame::Body };

fn robot(kind: RequestKind) -> Ask {
    Ask::Robot(kind)
}

#[test]
fn a_stick_drives_and_the_robot_stops_where_it_is_let_go() {
    let run = played(8.0, |hands: &mut Hands| {
        hands.at(0.5, |live, _| assert!(live.send(Client::Joystick, robot(RequestKind::Enable)).is_some()));
        hands.stick(1.0, 3.0, Client::Joystick, FORWARD);
        hands.at(2.9, |_, seen| {
            assert_eq!(seen.extras.authority.commander, Commander::Stick(Client::Joystick))
        });
        hands.at(2.9, |_, seen| assert!((seen.record.state.twist_in_body.vx_m_s - 0.3).abs() < 0.01));
        hands.send(3.0, Client::Joystick, Ask::Stick(StickWish::Released));
        hands.at(4.0, |_, seen| assert_eq!(seen.phase, Phase::Holding));
        hands.at(4.0, |_, seen| assert_eq!(seen.extras.authority.commander, Commander::Nobody));
    });
    let x_m = run.last.record.state.odom_from_body.x_m;
    assert!((0.5..0.7).contains(&x_m), "{x_m} m");
    assert!(run.ran.ended.is_ok(), "{:?}", run.ran.ended);
    assert!(run.replayed.difference.is_none() && run.replayed.cycles > 8000, "{:?}", run.replayed);
}

#[test]
fn a_stick_that_falls_silent_stops_and_is_blocked_until_a_person_enables_it() {
    played(9.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Joystick, robot(RequestKind::Enable));
        hands.stick(1.0, 2.0, Client::Joystick, FORWARD);
        // Silent from 2 s on.
        hands.at(3.0, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 1))
        });
        // Back, but blocked.
        hands.stick(3.0, 4.0, Client::Joystick, FORWARD);
        hands.at(4.0, |live, seen| {
            assert_eq!(seen.phase, Phase::Holding);
            live.send(Client::Joystick, Ask::EnableStick(Client::Joystick));
        });
        // Enabled with the stick in hand: it must be let go first.
        hands.stick(4.0, 5.0, Client::Joystick, FORWARD);
        hands.at(5.0, |live, seen| {
            assert_eq!(seen.phase, Phase::Holding);
            live.send(Client::Joystick, Ask::Stick(StickWish::Released));
        });
        hands.stick(5.1, 6.0, Client::Joystick, FORWARD);
        hands.at(5.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
    });
}

#[test]
fn a_page_that_comes_back_after_a_silence_stays_blocked_with_the_finger_still_down() {
    let page = Client::Page(0);
    let run = played(9.0, |hands: &mut Hands| {
        hands.send(0.5, page, robot(RequestKind::Enable));
        hands.stick(1.0, 2.0, page, FORWARD);
        // Silent for longer than a session may be, then there again under the same number: the line stalled.
        hands.stick(3.6, 5.0, page, FORWARD);
        hands.at(5.0, move |live, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 2));
            live.send(page, Ask::EnableStick(page));
        });
        // Enabled with the finger down: nothing yet.
        hands.stick(5.0, 6.0, page, FORWARD);
        hands.at(6.0, move |live, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 0));
            live.send(page, Ask::Stick(StickWish::Released));
        });
        hands.stick(6.1, 7.0, page, FORWARD);
        hands.at(6.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn a_new_session_under_an_old_number_needs_no_enabling_but_a_fresh_hold() {
    played(7.0, |hands: &mut Hands| {
        let page = Client::Page(0);
        hands.at(0.5, move |live, _| {
            assert_eq!(live.begin_session(), Some(page));
            live.send(page, robot(RequestKind::Enable));
            live.send(page, Ask::Stick(StickWish::Released));
        });
        hands.stick(1.0, 2.0, page, FORWARD);
        hands.at(1.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
        // Its line breaks, and it is back at once with the finger still down.
        hands.at(2.0, move |live, _| {
            live.end_session(page);
            assert_eq!(live.begin_session(), Some(page));
        });
        hands.stick(2.001, 4.0, page, FORWARD);
        hands.at(4.0, move |live, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 0));
            live.send(page, Ask::Stick(StickWish::Released));
        });
        hands.stick(4.1, 6.0, page, FORWARD);
        hands.at(5.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
    });
}

#[test]
fn a_stop_holds_until_every_stick_was_let_go() {
    let stops: [fn() -> Ask; 2] =
        [|| robot(RequestKind::Stop(StopCategory::RampAndHold)), || Ask::Stick(StickWish::Withdrawn)];
    for (stop, by) in stops.into_iter().zip([Client::Page(1), Client::Joystick]) {
        for driver in [Client::Page(0), Client::Joystick] {
            played(7.0, |hands: &mut Hands| {
                hands.send(0.5, Client::Command, robot(RequestKind::Enable));
                hands.stick(1.0, 4.0, driver, FORWARD);
                hands.at(2.0, move |live, seen| {
                    assert!(seen.record.state.twist_in_body.vx_m_s > 0.25);
                    live.send(by, stop());
                });
                hands.between(2.5, 4.0, move |_, seen| {
                    let speed_m_s = seen.record.state.twist_in_body.speed_m_s();
                    assert!(seen.record.time.now_ns < 3_000_000_000 || speed_m_s < 1e-3, "{speed_m_s} m/s");
                    assert_eq!(
                        seen.extras.authority.commander,
                        Commander::Nobody,
                        "{driver:?}, stopped by {by:?}"
                    );
                });
                hands.send(4.0, driver, Ask::EnableStick(driver));
                hands.send(4.1, driver, Ask::Stick(StickWish::Released));
                hands.stick(4.2, 6.0, driver, FORWARD);
                hands.at(5.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
            });
        }
    }
}

#[test]
fn a_joystick_that_nobody_hears_of_is_lost_even_while_nobody_holds_it() {
    played(3.0, |hands: &mut Hands| {
        hands.stick(1.0, 2.0, Client::Joystick, StickWish::Released);
        hands.at(1.9, |_, seen| assert_eq!(seen.extras.authority.joystick, JoystickState::Present));
        hands.at(2.3, |_, seen| assert_eq!(seen.extras.authority.joystick, JoystickState::Lost));
    });
}

#[test]
fn a_joystick_that_says_it_is_blocked_while_it_drives_is_stopped_whatever_was_missed() {
    played(4.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Joystick, robot(RequestKind::Enable));
        hands.stick(1.0, 2.0, Client::Joystick, FORWARD);
        hands.stick(2.0, 3.5, Client::Joystick, StickWish::Blocked);
        hands.at(1.95, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.25));
        hands.at(3.4, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 1));
            assert_eq!(seen.extras.authority.joystick, JoystickState::Blocked);
        });
    });
}

#[test]
fn a_page_that_goes_ends_the_motion_it_asked_for_and_a_command_line_that_goes_does_not() {
    for (client, goes_on) in [(Client::Page(3), false), (Client::Command, true)] {
        played(6.0, |hands: &mut Hands| {
            hands.send(0.5, client, robot(RequestKind::Enable));
            hands.at(1.5, move |live, _| {
                let odom_from_body = Pose2 { x_m: 3.0, y_m: 0.0, heading_rad: 0.0 };
                live.send(client, robot(RequestKind::GoTo { odom_from_body }));
            });
            hands.alive(0.4, 3.0, client);
            hands.at(2.9, move |_, seen| {
                assert_eq!(seen.phase, Phase::Tracking);
                assert_eq!(seen.extras.authority.commander, Commander::Reference(client));
            });
            let expected = if goes_on { Phase::Tracking } else { Phase::Holding };
            hands.at(5.0, move |_, seen| assert_eq!(seen.phase, expected));
        });
    }
}

#[test]
fn while_the_emergency_stop_is_set_nothing_begins_and_the_answer_says_why() {
    played(7.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Command, robot(RequestKind::Enable));
        hands.stick(1.0, 5.0, Client::Joystick, FORWARD);
        hands.at(2.0, |live, seen| {
            assert!(seen.record.state.twist_in_body.vx_m_s > 0.25);
            live.send(Client::Page(0), Ask::EmergencyStop);
        });
        hands.ask(3.0, Client::Command, robot(RequestKind::Enable), Answer::Refused(Refusal::EmergencyStop));
        hands.at(3.5, |_, seen| {
            assert_eq!(seen.phase, Phase::Disabled);
            assert!(seen.extras.authority.is_emergency);
        });
        hands.ask(3.6, Client::Command, Ask::ReleaseEmergencyStop, Answer::Done);
        // Released is not enabled, and a stick in hand starts nothing.
        hands.at(4.5, |_, seen| assert_eq!(seen.phase, Phase::Disabled));
        hands.ask(4.6, Client::Command, robot(RequestKind::Enable), Answer::Robot(RequestAnswer::Taken));
        hands.at(5.0, |_, seen| assert_eq!(seen.record.state.twist_in_body.vx_m_s.abs().max(1e-3), 1e-3));
    });
}

#[test]
fn a_stick_takes_over_from_a_reference_which_goes_on_afterwards_and_another_can_be_loaded() {
    let line: ReferenceTable = toml::from_str(
        "kind = \"path\"\nframe = \"start\"\npoints = [[0.0, 0.0, 0.0, 0.0], [3.0, 0.5, 0.0, 0.0]]",
    )
    .unwrap();
    let run = played(12.0, move |hands: &mut Hands| {
        hands.send(0.5, Client::Page(1), robot(RequestKind::Enable));
        hands.alive(0.4, 12.0, Client::Page(1));
        let table = line.clone();
        hands.at(1.2, move |live, _| {
            let loaded = crate::hands::reference(&table);
            assert_eq!(live.load(Client::Page(1), table.clone(), loaded).unwrap().0, 1);
        });
        hands.ask(1.5, Client::Page(1), robot(RequestKind::Track), Answer::Robot(RequestAnswer::Taken));
        hands.at(2.5, |_, seen| assert_eq!((seen.phase, seen.reference), (Phase::Tracking, 1)));
        let twist = Twist2 { vx_m_s: 0.0, vy_m_s: 0.2, w_rad_s: 0.0 };
        hands.stick(2.5, 3.5, Client::Joystick, StickWish::Held { twist, frame: Frame::Odom });
        hands.ask(3.0, Client::Page(1), robot(RequestKind::Resume), Answer::Refused(Refusal::Commanded));
        hands.send(3.5, Client::Joystick, Ask::Stick(StickWish::Released));
        hands.at(5.0, |_, seen| assert!(seen.record.state.odom_from_body.y_m > 0.1));
        hands.ask(5.0, Client::Page(1), robot(RequestKind::Resume), Answer::Robot(RequestAnswer::Taken));
        hands.at(11.5, |_, seen| {
            let pose = seen.record.state.odom_from_body;
            assert!((pose.x_m - 0.5).abs() < 1e-3 && pose.y_m.abs() < 1e-3, "{pose:?}");
        });
    });
    assert_eq!(run.live.references().len(), 1);
    assert!(run.replayed.difference.is_none(), "a loaded reference replays too: {:?}", run.replayed);
}

/// How many counted references there are.
static KEPT: AtomicUsize = AtomicUsize::new(0);

struct Counted(Box<dyn Reference>);

impl Counted {
    fn new(reference: Box<dyn Reference>) -> Self {
        KEPT.fetch_add(1, Ordering::Relaxed);
        Counted(reference)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        KEPT.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Reference for Counted {
    fn start(&mut self, from: &Setpoint) {
        self.0.start(from);
    }
    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        self.0.sample(since_start_s)
    }
    fn duration_s(&self) -> Option<f64> {
        self.0.duration_s()
    }
}

#[test]
fn references_that_were_replaced_or_refused_are_dropped_and_the_recording_keeps_them() {
    let run = played(9.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Page(1), robot(RequestKind::Enable));
        hands.alive(0.4, 9.0, Client::Page(1));
        let load = |live: &Live, metres: f64| {
            let table: ReferenceTable = toml::from_str(&format!(
                "kind = \"path\"\nframe = \"start\"\npoints = [[0.0, 0.0, 0.0, 0.0], [3.0, {metres:?}, 0.0, 0.0]]"
            ))
            .unwrap();
            let made = crate::hands::reference(&table);
            live.load(Client::Page(1), table, Box::new(Counted::new(made))).unwrap();
        };
        for number in 1..=100 {
            let metres = f64::from(number) * 4e-3;
            hands.at(1.0 + f64::from(number) * 0.02, move |live, _| load(live, metres));
        }
        hands.at(3.2, |live, _| {
            assert_eq!(live.references().into_keys().collect::<Vec<_>>(), [100]);
            // It, and what it took the place of.
            assert_eq!(KEPT.load(Ordering::Relaxed), 2);
        });
        hands.ask(3.5, Client::Page(1), robot(RequestKind::Track), Answer::Robot(RequestAnswer::Taken));
        // While it is tracked the others are only the next one by turns.
        for number in 0..100 {
            hands.at(4.0 + f64::from(number) * 0.02, move |live, _| load(live, 0.1));
        }
        hands.at(6.3, |live, seen| {
            assert_eq!((seen.phase, seen.reference), (Phase::Tracking, 100));
            assert_eq!(seen.record.reference_next, 200);
            assert!(seen.reference_start.is_some());
            assert_eq!(live.references().into_keys().collect::<Vec<_>>(), [100, 200]);
            // It, and the last that was offered.
            assert_eq!(KEPT.load(Ordering::Relaxed), 2);
        });
        hands.at(8.5, |_, seen| {
            // At its end the last one takes its place, and hasn't begun anywhere.
            assert_eq!((seen.reference, seen.record.reference_next), (200, 200));
            assert!(seen.reference_start.is_none());
            let pose = seen.record.state.odom_from_body;
            assert!((pose.x_m - 0.4).abs() < 1e-3 && pose.y_m.abs() < 1e-3, "{pose:?}");
        });
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    drop(run);
    assert_eq!(KEPT.load(Ordering::Relaxed), 0);
}

fn place(live: &Live, name: &str) -> u32 {
    live.snapshot().setting(name).unwrap_or_else(|| panic!("no setting `{name}`")).0
}

fn speeds(live: &Live, seen: &Snapshot) -> [Option<f64>; 2] {
    ["speed_m_s", "turn_speed_rad_s"]
        .map(|name| seen.settings[place(live, name) as usize].map(|setting| setting.value))
}

#[test]
fn settings_change_as_a_whole_and_bad_ones_change_nothing() {
    let run = played(4.0, |hands: &mut Hands| {
        hands.at(1.0, move |live, _| {
            let (speed, turn) = (place(live, "speed_m_s"), place(live, "turn_speed_rad_s"));
            assert!(live.set(Client::Command, &[(speed, 0.4), (turn, 0.6)]).is_some());
            assert!(live.set(Client::Command, &[]).is_none());
        });
        hands.at(1.5, move |live, seen| {
            assert_eq!(speeds(live, seen), [Some(0.4), Some(0.6)]);
            let (speed, turn) = (place(live, "speed_m_s"), place(live, "turn_speed_rad_s"));
            live.set(Client::Command, &[(speed, 0.7), (turn, f64::NAN)]);
        });
        hands.at(2.0, move |live, seen| assert_eq!(speeds(live, seen), [Some(0.4), Some(0.6)]));
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn a_page_that_goes_amid_its_changes_changes_nothing_and_nothing_of_it_comes_later() {
    let run = played(4.0, |hands: &mut Hands| {
        let page = Client::Page(0);
        hands.at(1.0, move |live, _| {
            assert_eq!(live.begin_session(), Some(page));
            let (speed, turn) = (place(live, "speed_m_s"), place(live, "turn_speed_rad_s"));
            live.set(page, &[(speed, 0.4), (turn, 0.6)]);
        });
        // One cycle later one of the two was taken.
        hands.at(1.001, move |live, seen| {
            let request = seen.record.request.expect("it is under way").kind;
            assert!(matches!(request, RequestKind::Set { batch, .. } if batch.place() == 0), "{request:?}");
            live.end_session(page);
        });
        hands.at(2.0, move |live, seen| {
            assert_eq!(speeds(live, seen), [Some(1.0), Some(1.5)]);
            live.set(Client::Command, &[(place(live, "speed_factor"), 0.5)]);
        });
        hands.at(2.5, move |live, seen| {
            assert_eq!(speeds(live, seen), [Some(1.0), Some(1.5)]);
            assert_eq!(seen.settings[place(live, "speed_factor") as usize].unwrap().value, 0.5);
        });
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn changes_for_which_there_is_no_room_are_refused_as_a_whole() {
    played(4.0, |hands: &mut Hands| {
        let ticket = Rc::new(Cell::new(0));
        let sent = ticket.clone();
        hands.at(1.0, move |live, _| {
            // All but one of the places in which requests wait for their cycle are taken.
            for _ in 0..63 {
                live.send(Client::Command, robot(RequestKind::Pause));
            }
            let (speed, turn) = (place(live, "speed_m_s"), place(live, "turn_speed_rad_s"));
            sent.set(live.set(Client::Command, &[(speed, 0.4), (turn, 0.6)]).expect("it is on its way"));
        });
        hands.at(1.5, move |live, seen| {
            assert_eq!(live.answer(ticket.get()), Some(Answer::Refused(Refusal::Busy)));
            assert_eq!(speeds(live, seen), [Some(1.0), Some(1.5)]);
            live.set(Client::Command, &[(place(live, "speed_factor"), 0.5)]);
        });
        hands.at(2.0, move |live, seen| assert_eq!(speeds(live, seen), [Some(1.0), Some(1.5)]));
    });
}

#[test]
fn a_stop_finds_room_however_much_is_asked() {
    let run = played(4.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Command, robot(RequestKind::Enable));
        hands.stick(1.0, 1.999, Client::Page(0), FORWARD);
        hands.at(2.0, |live, _| {
            while live.send(Client::Page(1), Ask::Alive).is_some() {}
            assert!(live.send(Client::Page(1), Ask::EmergencyStop).is_some());
        });
        hands.at(2.005, |_, seen| assert!(seen.extras.authority.is_emergency));
    });
    assert_eq!(run.last.phase, Phase::Disabled);
}

#[test]
fn a_flood_is_bounded_answered_and_no_cycle_is_lost() {
    let run = played(3.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Command, robot(RequestKind::Enable));
        hands.between(1.0, 2.0, |live, _| {
            for _ in 0..400 {
                let _ = live.send(Client::Page(2), robot(RequestKind::Pause));
            }
            let _ = live.send(
                Client::Page(2),
                Ask::Stick(StickWish::Held { twist: Twist2::new(f64::NAN, 0.0, 0.0), frame: Frame::Odom }),
            );
        });
        hands.at(2.5, |_, seen| assert_eq!(seen.phase, Phase::Holding));
        hands.ask(
            2.6,
            Client::Command,
            robot(RequestKind::Stop(StopCategory::RampThenRemove)),
            Answer::Robot(RequestAnswer::Taken),
        );
    });
    assert_eq!(run.last.overruns, 0);
    assert_eq!(run.last.record.stop_reason, SafetyReason::Requested);
    assert!(run.stop.load(Ordering::Relaxed));
}

#[test]
fn a_run_goes_on_where_the_server_of_its_pages_dies_and_what_they_commanded_stops() {
    let run = played(6.0, |hands: &mut Hands| {
        let page = Client::Page(0);
        hands.at(0.5, move |live, _| {
            assert_eq!(live.begin_session(), Some(page));
            live.send(page, robot(RequestKind::Enable));
            live.send(page, Ask::Stick(StickWish::Released));
        });
        hands.stick(1.0, 1.999, page, FORWARD);
        hands.at(2.0, |live, seen| {
            assert!(seen.record.state.twist_in_body.vx_m_s > 0.25);
            live.lose_pages();
        });
        hands.at(2.5, |_, seen| assert_eq!(seen.extras.authority.commander, Commander::Nobody));
        hands.ask(4.0, Client::Command, robot(RequestKind::Track), Answer::Robot(RequestAnswer::Taken));
    });
    let events: Vec<&str> = run.ran.summary.events.iter().map(|event| event.text.as_str()).collect();
    assert!(events.contains(&"drives by hand (page 1)"), "{events:?}");
    assert!(events.contains(&"the server of the pages died: what they commanded stops"), "{events:?}");
    assert!(run.ran.ended.is_ok() && run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn whoever_asked_for_a_motion_may_ask_for_another_meanwhile_and_nobody_else() {
    let go = |x_m, y_m| robot(RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad: 0.0 } });
    let taken = || Answer::Robot(RequestAnswer::Taken);
    let run = played(9.0, move |hands: &mut Hands| {
        hands.send(0.5, Client::Page(1), robot(RequestKind::Enable));
        for page in [Client::Page(1), Client::Page(2)] {
            hands.alive(0.4, 9.0, page);
        }
        hands.ask(1.5, Client::Page(1), go(1.0, 0.0), taken());
        hands.ask(2.0, Client::Page(2), go(0.0, 0.5), Answer::Refused(Refusal::Led));
        hands.ask(2.1, Client::Page(2), robot(RequestKind::Track), Answer::Refused(Refusal::Led));
        hands.ask(2.4, Client::Page(1), go(0.5, 0.3), taken());
        hands.at(8.0, |_, seen| {
            let pose = seen.record.state.odom_from_body;
            assert!((pose.x_m - 0.5).abs() < 1e-3 && (pose.y_m - 0.3).abs() < 1e-3, "{pose:?}");
        });
        // Nobody moves it any more.
        hands.ask(8.1, Client::Page(2), go(0.5, 0.2), taken());
    });
    assert!(run.replayed.difference.is_none() && run.replayed.cycles > 8000, "{:?}", run.replayed);
}
