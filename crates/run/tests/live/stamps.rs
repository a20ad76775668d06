//! Lines that are slow: what is asked counts from when it was asked, on the robot's own clock.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::{Frame, Phase, RequestAnswer, StopCategory};
use omnibase_run::live::{Answer, Ask, Client, Live, Refusal, Stamp, StickWish};

use crate::hands::{Hands, Played, played};

const MS: u64 = 1_000_000;
const PAGE: Client = Client::Page(0);
const FORWARD: StickWish = StickWish::Held { twist: Twist2::new(0.4, 0.0, 0.0), frame: Frame::Body };

fn robot(kind: RequestKind) -> Ask {
    Ask::Robot(kind)
}

fn go_to() -> Ask {
    robot(RequestKind::GoTo { odom_from_body: Pose2 { x_m: 1.0, ..Pose2::default() } })
}

/// How far it is from where it began, m.
fn distance_m(played: &Played) -> f64 {
    let pose = played.last.record.state.odom_from_body;
    pose.x_m.hypot(pose.y_m)
}

/// A page at the end of a line: what it sees is so old, and what it says takes as long, from the second of the run on.
fn line(hands: &mut Hands, delay_ms: [u64; 2], slow_from_s: f64, say: impl Fn(f64) -> Option<Ask> + 'static) {
    let under_way: Rc<RefCell<VecDeque<(u64, u64, Ask)>>> = Rc::default();
    hands.between(0.5, f64::INFINITY, move |live, seen| {
        let now_ns = seen.record.time.now_ns;
        let delay_ms = delay_ms[usize::from(now_ns as f64 * 1e-9 >= slow_from_s)];
        // The person acts now, before a picture of so long ago.
        if let Some(ask) = say(now_ns as f64 * 1e-9) {
            let told_ns = now_ns.saturating_sub(delay_ms * MS);
            under_way.borrow_mut().push_back((now_ns + delay_ms * MS, told_ns, ask));
        }
        // In order, as a line of TCP has it.
        while under_way.borrow().front().is_some_and(|(arrives_ns, ..)| *arrives_ns <= now_ns) {
            let (_, told_ns, ask) = under_way.borrow_mut().pop_front().unwrap();
            live.send(live.asker(PAGE, Stamp::Told(told_ns)), ask).expect("there is room");
        }
    });
}

/// Held from 2 s to 4 s, said 50 times a second; let go before and after.
fn held(time_s: f64) -> Option<Ask> {
    let is_turn = ((time_s * 1e3).round() as u64).is_multiple_of(20);
    let wish = if (2.0..4.0).contains(&time_s) { FORWARD } else { StickWish::Released };
    is_turn.then_some(Ask::Stick(wish))
}

#[test]
fn with_two_seconds_of_delay_each_way_a_stick_moves_nothing_and_that_is_told_once() {
    let played = played(8.0, |hands| {
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        line(hands, [2000; 2], 0.0, held);
    });
    println!("a stick over 2 s of delay each way moves the robot by {:.6} m", distance_m(&played));
    assert!(distance_m(&played) < 1e-3, "{} m", distance_m(&played));
    let told = played.live.events_after(0).into_iter().filter(|event| event.text.contains("come too late"));
    assert_eq!(told.map(|event| event.client).collect::<Vec<_>>(), [Some(PAGE)]);
}

#[test]
fn with_a_good_line_it_drives() {
    let played = played(6.0, |hands| {
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        line(hands, [40; 2], 0.0, held);
    });
    assert!((0.6..0.9).contains(&distance_m(&played)), "{} m", distance_m(&played));
}

#[test]
fn a_line_that_becomes_slow_while_a_stick_drives_stops_as_a_silent_stick_does() {
    let moves = Rc::new(RefCell::new(0.0));
    let last = moves.clone();
    let played = played(9.0, |hands| {
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        line(hands, [40, 2000], 3.0, held);
        hands.between(0.5, f64::INFINITY, move |_, seen| {
            if seen.record.state.twist_in_body.speed_m_s() > 0.01 {
                *last.borrow_mut() = seen.record.time.now_ns as f64 * 1e-9;
            }
        });
    });
    // What was said last on the good line is of 2.98 s, with a stamp 40 ms before it; the stick's age is 0.2 s, and the
    // ramp from 0.4 m/s takes 0.31 s.
    let stood_s = *moves.borrow();
    println!("a line that becomes 2 s slow: it stands {:.3} s later", stood_s - 3.0);
    assert!((3.2..3.6).contains(&stood_s), "{stood_s} s");
    let events = played.live.events_after(0);
    assert!(events.iter().any(|event| event.text.contains("fell silent")), "{}", events.len());
}

#[test]
fn what_begins_something_is_refused_in_words_where_it_is_old_or_nobody_knows_how_old() {
    /// Makes what is asked.
    type Make = fn() -> Ask;
    let begins: [(&str, Make); 8] = [
        ("enable", || robot(RequestKind::Enable)),
        ("acknowledge", || robot(RequestKind::Acknowledge)),
        ("track", || robot(RequestKind::Track)),
        ("resume", || robot(RequestKind::Resume)),
        ("go_to", go_to),
        ("release", || Ask::ReleaseEmergencyStop),
        ("enable_stick", || Ask::EnableStick(PAGE)),
        ("enable_joystick", || Ask::EnableStick(Client::Joystick)),
    ];
    for (name, ask) in begins {
        let answers: Rc<RefCell<Vec<Answer>>> = Rc::default();
        let seen = answers.clone();
        played(2.0, |hands| {
            hands.at(1.0, move |live, seen| {
                let now_ns = seen.record.time.now_ns;
                assert_eq!(live.clock_ns(), now_ns);
                for stamp in [
                    Stamp::Missing,
                    Stamp::Told(now_ns + 50 * MS),
                    Stamp::Told(u64::MAX),
                    Stamp::Told(now_ns - 600 * MS),
                    Stamp::Told(now_ns - 400 * MS),
                ] {
                    live.send(live.asker(Client::Command, stamp), ask()).unwrap();
                }
            });
            // The tickets of a run rise from 1.
            hands.at(1.2, move |live, _| {
                seen.borrow_mut().extend((1..=5).filter_map(|ticket| live.answer(ticket)));
            });
        });
        let answers = answers.borrow();
        assert_eq!(answers.len(), 5, "{name}: {answers:?}");
        assert_eq!(answers[0], Answer::Refused(Refusal::Unstamped), "{name}");
        assert_eq!(answers[1..3], [Answer::Refused(Refusal::OfAnotherRun); 2], "{name}");
        let Answer::Refused(Refusal::TooOld { age_ns, most_ns }) = answers[3] else {
            panic!("{name}: {answers:?}")
        };
        assert!((600 * MS..605 * MS).contains(&age_ns) && most_ns == 500 * MS, "{name}: {age_ns}");
        assert!(answers[3].text().contains("0.60 s ago, and counts for 0.5 s"), "{}", answers[3].text());
        let is_age = matches!(
            answers[4],
            Answer::Refused(Refusal::TooOld { .. } | Refusal::Unstamped | Refusal::OfAnotherRun)
                | Answer::Robot(RequestAnswer::TooOld)
        );
        assert!(!is_age, "{name}: {:?}", answers[4]);
        assert!(name != "enable" || answers[4] == Answer::Robot(RequestAnswer::Taken), "{:?}", answers[4]);
    }
}

#[test]
fn a_goal_that_was_pressed_into_a_dead_line_moves_nothing_two_seconds_later() {
    let played = played(7.0, |hands| {
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        hands.at(4.2, |live, seen| {
            let told_ns = seen.record.time.now_ns - 2200 * MS;
            live.send(live.asker(PAGE, Stamp::Told(told_ns)), go_to()).unwrap();
        });
        hands.alive(0.5, 7.0, PAGE);
    });
    println!("a goal pressed into a dead line moves the robot by {:.6} m", distance_m(&played));
    assert!(distance_m(&played) < 1e-3, "{} m", distance_m(&played));
}

#[test]
fn a_stop_counts_however_old_it_is_and_whatever_its_stamp_says() {
    for stamp in [Stamp::Missing, Stamp::Told(0), Stamp::Told(u64::MAX)] {
        let stopped = Rc::new(RefCell::new(None));
        let seen = stopped.clone();
        played(4.0, |hands| {
            hands.send(0.3, Client::Command, robot(RequestKind::Enable));
            hands.send(1.5, Client::Command, go_to());
            hands.at(2.5, move |live, _| {
                live.send(live.asker(PAGE, stamp), robot(RequestKind::Stop(StopCategory::RampAndHold)))
                    .unwrap();
            });
            hands.at(3.8, move |_, at| {
                let speed_m_s = at.record.state.twist_in_body.speed_m_s();
                *seen.borrow_mut() = Some((at.phase, speed_m_s < 1e-3));
            });
        });
        assert_eq!(*stopped.borrow(), Some((Phase::Holding, true)), "{stamp:?}");
    }
}

#[test]
fn a_page_whose_messages_are_old_is_gone_and_what_it_began_ends() {
    let played = played(6.0, |hands| {
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        hands.at(1.5, |live, _| {
            live.begin_session().unwrap();
            live.send(live.asker(PAGE, Stamp::Here), go_to()).unwrap();
        });
        line(hands, [40, 2000], 2.0, |_| Some(Ask::Alive));
    });
    // Its goal is 1 m away.
    assert!((0.05..0.9).contains(&distance_m(&played)), "{} m", distance_m(&played));
    let events = played.live.events_after(0);
    assert!(events.iter().any(|event| event.text.contains("the page that asked for this motion is gone")));
}

#[test]
fn what_the_robot_asks_on_behalf_of_a_page_that_is_gone_begins_nothing() {
    for is_there in [true, false] {
        let played = played(4.5, |hands| {
            hands.send(0.3, Client::Command, robot(RequestKind::Enable));
            hands.at(1.5, |live, _| _ = live.begin_session().unwrap());
            if is_there {
                hands.alive(1.6, 4.5, PAGE);
            }
            hands.at(3.5, |live, _| _ = live.send(live.asker(PAGE, Stamp::OnBehalf), go_to()).unwrap());
        });
        assert_eq!(distance_m(&played) > 0.05, is_there, "{} m", distance_m(&played));
    }
}

#[test]
fn what_was_asked_before_a_stop_and_sent_after_it_begins_nothing() {
    for (stop, by, is_stopped) in [
        (RequestKind::Stop(StopCategory::RampAndHold), Stamp::Missing, true),
        (RequestKind::Pause, Stamp::Missing, true),
        // By what looks after a way, to plan another one.
        (RequestKind::Pause, Stamp::OnBehalf, false),
    ] {
        let answer = Rc::new(RefCell::new(None));
        let seen = answer.clone();
        let played = played(4.0, |hands| {
            hands.send(0.3, Client::Command, robot(RequestKind::Enable));
            hands.at(1.5, move |live, at| {
                // Computing it took until somebody stopped.
                let asker = live.asker(PAGE, Stamp::Told(at.record.time.now_ns));
                live.send(live.asker(Client::Page(1), by), robot(stop)).unwrap();
                let ticket = live.send(asker, go_to()).unwrap();
                *seen.borrow_mut() = live.answer(ticket);
                // As whoever asks after the stop may.
                assert!(live.send(asker, Ask::Stick(StickWish::Released)).is_some());
            });
            hands.alive(0.5, 4.0, PAGE);
        });
        assert_eq!(*answer.borrow(), is_stopped.then_some(Answer::Refused(Refusal::Stopped)), "{stop:?}");
        assert_eq!(distance_m(&played) < 1e-3, is_stopped, "{stop:?}: {} m", distance_m(&played));
    }
}

/// Whoever planned a way begins it; whoever pauses it, nobody goes on with it, until something else is loaded.
#[test]
fn a_way_that_is_looked_after_begins_and_goes_on_for_nobody_else() {
    let load = |live: &Live, stamp: Stamp, y_m: f64| {
        let points = format!("points = [[0.0, 0.0, 0.0, 0.0], [4.0, 1.0, {y_m}, 0.0]]");
        let table: ReferenceTable =
            toml::from_str(&format!("kind = \"path\"\nframe = \"start\"\n{points}")).unwrap();
        let path = crate::hands::reference(&table);
        live.load(live.asker(PAGE, stamp), table, path).unwrap();
    };
    let taken = Answer::Robot(RequestAnswer::Taken);
    let refused = Answer::Refused(Refusal::LookedAfter);
    let played = played(12.0, |hands| {
        hands.alive(0.2, 12.0, PAGE);
        hands.at(0.2, |live, _| _ = live.begin_session().unwrap());
        hands.send(0.3, Client::Command, robot(RequestKind::Enable));
        hands.at(1.5, move |live, _| load(live, Stamp::OnBehalf, 0.0));
        hands.ask(1.6, PAGE, robot(RequestKind::Track), refused);
        hands.at(1.8, |live, seen| {
            assert_eq!((seen.is_looked_after, seen.phase), ([true; 2], Phase::Holding));
            live.send(live.asker(PAGE, Stamp::OnBehalf), robot(RequestKind::Track)).unwrap();
        });
        hands.at(3.0, |_, seen| assert_eq!(seen.phase, Phase::Tracking));
        hands.ask(3.1, PAGE, robot(RequestKind::Pause), taken);
        // While it slows down, and once it stands.
        hands.ask(3.2, PAGE, robot(RequestKind::Resume), refused);
        hands.ask(5.0, PAGE, robot(RequestKind::Resume), refused);
        hands.at(5.2, |_, seen| assert_eq!(seen.phase, Phase::Holding));
        hands.at(5.3, move |live, _| load(live, Stamp::Here, 0.0));
        hands.at(5.4, |_, seen| assert_eq!(seen.is_looked_after, [false; 2]));
        hands.ask(5.5, PAGE, robot(RequestKind::Track), taken);
        hands.ask(6.5, PAGE, robot(RequestKind::Pause), taken);
        hands.ask(8.0, PAGE, robot(RequestKind::Resume), taken);
    });
    assert!(distance_m(&played) > 1.1, "{} m", distance_m(&played));
}
